#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the fuzz targets and runs each for its share of the time, or for so many executions, two at once. A finding ends its
# target and this script fails; the file that caused it lies in build-fuzz/findings/TARGET.
#   Testing/Fuzz/run.sh [SECONDS] [TARGET...]      default: 120 seconds for all targets together
#   Testing/Fuzz/run.sh --runs COUNT [TARGET...]
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

runs=
if [[ ${1:-} == --runs ]]; then
  runs=${2:?how many executions}
  shift
fi
seconds=${1:-120}
shift $(($# > 0 ? 1 : 0))
cmake --preset fuzz >/dev/null
cmake --build --preset fuzz --parallel "$(nproc)"

folder=$PWD/build-fuzz
"$folder/fuzz/fuzz-seeds" "$folder/seeds"
targets=("$@")
if ((${#targets[@]} == 0)); then
  for dictionary in "$folder"/fuzz/fuzz-*.dict; do
    target=${dictionary##*/fuzz-}
    targets+=("${target%.dict}")
  done
fi
atOnce=2
limit=(-max_total_time="$((seconds * atOnce / ${#targets[@]}))")
[[ -z $runs ]] || limit=(-runs="$runs")

run_target() {
  local target=$1
  mkdir -p "$folder/corpus/$target" "$folder/findings/$target" "$folder/log"
  UBSAN_OPTIONS=print_stacktrace=1 \
    "$folder/fuzz/fuzz-$target" "${limit[@]}" -max_len=65536 -timeout=60 -rss_limit_mb=2048 -detect_leaks=0 -entropic=0 \
    -dict="$folder/fuzz/fuzz-$target.dict" -artifact_prefix="$folder/findings/$target/" -print_final_stats=1 \
    "$folder/corpus/$target" "$folder/seeds/$target" >"$folder/log/$target.txt" 2>&1 || touch "$folder/log/$target.failed"
}

rm -f "$folder"/log/*.failed
for target in "${targets[@]}"; do
  while (($(jobs -rp | wc -l) >= atOnce)); do
    wait -n
  done
  run_target "$target" &
done
wait

failed=0
for target in "${targets[@]}"; do
  log=$folder/log/$target.txt
  count=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  if [[ -e $folder/log/$target.failed ]]; then
    failed=1
    echo "$target: ${count:-?} executions, FINDING:"
    grep -m 3 -E 'FINDING|ERROR:|SUMMARY:|runtime error|libFuzzer' "$log" || tail -n 5 "$log"
  else
    echo "$target: $count executions"
  fi
done
exit "$failed"
