#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds Core and the CUDA engine without VTK, tests them on this machine's device, runs compute-sanitizer and the
# benchmark, and prints a short table last.
#
#   Cuda/measure.sh [BUILD_FOLDER]
#
# Sweeps written by export_sweep.py are trained on when given in BIGUS_CUDA_SWEEPS (files, separated by blanks).
# ARCHITECTURES (default: native) and CMAKE_PREFIX_PATH are passed on to CMake.
set -uo pipefail
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=${1:-$source/build-cuda}
result() { results+="$(printf '%-34s %s' "$1" "$2")"$'\n'; }
results=""

cmake -S "$source" -B "$build" -G Ninja -DBIGUS_WITH_VTK=OFF -DBIGUS_WITH_CUDA=ON \
  -DCMAKE_CUDA_ARCHITECTURES="${ARCHITECTURES:-native}" || exit 1
cmake --build "$build" || exit 1
if ! "$build/bin/bigus-cuda-bench" --quick --repeats 1 > /dev/null; then
  echo "The CUDA engine does not run on this machine." >&2
  exit 1
fi

# Every test of the engine on the device; a skipped one is a failure here.
check() {
  local name=$1
  shift
  if "$@" > "$build/$name.log" 2>&1 && ! grep -q SKIPPED "$build/$name.log"; then
    result "$name" "passed"
  else
    result "$name" "FAILED: see $build/$name.log"
    tail -n 20 "$build/$name.log"
  fi
}
check gradients "$build/bin/bigusGradientTests" --gtest_filter='*/cuda'
check stability "$build/bin/bigusStabilityTests" --gtest_filter='*/cuda'
check engine "$build/bin/bigusCudaTests" --gtest_filter='*/cuda'
check projection "$build/bin/bigusDeviceTests"

# A short training run under each tool of compute-sanitizer.
if command -v compute-sanitizer > /dev/null; then
  for tool in memcheck racecheck initcheck synccheck; do
    check "sanitizer-$tool" compute-sanitizer --tool "$tool" --error-exitcode 1 \
      "$build/bin/bigusCudaTests" --gtest_filter='*RepeatsRecordedSteps*/cuda'
  done
else
  result compute-sanitizer "not installed"
fi

"$build/bin/bigus-cuda-bench" | tee "$build/bench.md"
for sweep in ${BIGUS_CUDA_SWEEPS:-}; do
  echo
  echo "$sweep"
  case $(basename "$sweep") in
  *volume*) "$build/bin/bigus-cuda-bench" --sweep "$sweep" --gaussians 140000 --seconds 5 --seconds 60 ;;
  *) "$build/bin/bigus-cuda-bench" --sweep "$sweep" --gaussians 2000000 --hold-out 8 --seconds 180 ;;
  esac | tee "$build/$(basename "$sweep" .txt).md"
done

echo
nvidia-smi --query-gpu=name,driver_version --format=csv,noheader
echo "$results"
cat "$build/bench.md"
