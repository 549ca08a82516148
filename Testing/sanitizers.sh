#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the tests that ctest is asked for under the address and undefined-behaviour sanitizers, and runs them. The first
# that fails ends the run. Arguments go to ctest: Testing/sanitizers.sh -L '^io$'
# BIGUS_WITH_ALL_KERNELS=OFF in the environment saves three minutes of compiling.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

targets=()
for label in unit io fuzz filters; do
  [[ " $* " != *"$label"* ]] || targets+=("tests-$label")
done
cmake --preset sanitizers -DBIGUS_WITH_ALL_KERNELS="${BIGUS_WITH_ALL_KERNELS:-ON}"
cmake --build --preset sanitizers --parallel "$(nproc)" --target "${targets[@]}"
ctest --preset sanitizers --stop-on-failure --parallel "$(nproc)" "$@"
