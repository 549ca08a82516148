#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds Core and the CUDA engine without VTK, tests them on this machine's device, runs compute-sanitizer and the
# benchmark, and prints a short table last.
#
#   Cuda/measure.sh [BUILD_FOLDER]           builds in the folder (default: build-cuda), then measures
#   Cuda/measure.sh --build [BUILD_FOLDER]   only builds, on a machine that needs no device
#   Cuda/measure.sh --built [BUILD_FOLDER]   measures what such a machine has built
#
# Sweeps written by export_sweep.py are trained on when given in BIGUS_CUDA_SWEEPS (files, separated by blanks), for
# BIGUS_CUDA_SECONDS each (default: 5 60). A check is stopped after `limit` seconds (default: 300). ARCHITECTURES
# (default: native) and CMAKE_PREFIX_PATH are passed on to CMake.
set -uo pipefail
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
mode=all
case ${1:-} in
--build | --built)
  mode=${1#--}
  shift
  ;;
esac
build=${1:-$source/build-cuda}
result() { results+="$(printf '%-34s %s' "$1" "$2")"$'\n'; }
results=""

if [[ $mode != built ]]; then
  cmake -S "$source" -B "$build" -G Ninja -DBIGUS_WITH_VTK=OFF -DBIGUS_WITH_CUDA=ON \
    -DCMAKE_CUDA_ARCHITECTURES="${ARCHITECTURES:-native}" || exit 1
  cmake --build "$build" --target BIGUSCuda bigusGradientTests bigusStabilityTests bigusCudaTests bigusDeviceTests \
    bigus-cuda-bench || exit 1
  [[ $mode == all ]] || exit 0
fi
if ! "$build/bin/bigus-cuda-bench" --quick --repeats 1 > /dev/null; then
  echo "The CUDA engine does not run on this machine." >&2
  exit 1
fi

# check NAME COMMAND: a test of the engine on the device, its cases spread over processes; a skipped case is a failure here.
check() {
  local name=$1 shards=${shards:-$(($(nproc) / 2 + 1))} running=() log=$build/$1.log
  shift
  for ((shard = 0; shard < shards; ++shard)); do
    GTEST_TOTAL_SHARDS=$shards GTEST_SHARD_INDEX=$shard timeout "${limit:-300}" "$@" > "$log.$shard" 2>&1 &
    running+=($!)
  done
  local failed=0 start=$SECONDS
  for process in "${running[@]}"; do wait "$process" || ((++failed)); done
  cat "$log".* > "$log"
  rm "$log".*
  if ((!failed)) && grep -q '  PASSED  ' "$log" && ! grep -q SKIPPED "$log"; then
    result "$name" "passed: $(grep -c '^\[       OK' "$log") cases, $((SECONDS - start)) s"
  else
    result "$name" "FAILED: see $log"
    grep -E '^\[  FAILED|^\[  SKIPPED|Failure|rror' "$log" | sort | uniq -c | head -n 20
  fi
}
check engine "$build/bin/bigusCudaTests" --gtest_filter='*/cuda'
check gradients "$build/bin/bigusGradientTests" --gtest_filter='*/cuda'
check projection "$build/bin/bigusDeviceTests"

"$build/bin/bigus-cuda-bench" | tee "$build/bench.md"
for sweep in ${BIGUS_CUDA_SWEEPS:-}; do
  echo
  echo "$sweep"
  case $(basename "$sweep") in
  *volume*) options="--gaussians 140000" ;;
  *) options="--gaussians 2000000 --hold-out 8" ;;
  esac
  # shellcheck disable=SC2086
  "$build/bin/bigus-cuda-bench" --sweep "$sweep" $options $(printf -- '--seconds %s ' ${BIGUS_CUDA_SECONDS:-5 60}) |
    tee "$build/$(basename "$sweep" .txt).md"
done

check stability "$build/bin/bigusStabilityTests" --gtest_filter='*/cuda'

# A short training under each tool of compute-sanitizer.
if command -v compute-sanitizer > /dev/null; then
  for tool in memcheck racecheck initcheck synccheck; do
    shards=1 check "sanitizer-$tool" compute-sanitizer --tool "$tool" --error-exitcode 1 \
      "$build/bin/bigusCudaTests" --gtest_filter='*RepeatsRecordedSteps*/cuda'
  done
else
  result compute-sanitizer "not installed"
fi

echo
nvidia-smi --query-gpu=name,driver_version --format=csv,noheader
echo "$results"
cat "$build/bench.md"
