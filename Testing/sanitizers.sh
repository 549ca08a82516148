#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the tests that ctest is asked for under the address and undefined-behaviour sanitizers, and runs them. The first
# that fails ends the run. Arguments go to ctest: Testing/sanitizers.sh -L '^io$'
# BIGUS_SANITIZE_ALL=OFF in the environment saves ten minutes of compiling: one set of instructions, and no sanitizers for
# rooms of Core that only compute.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

targets=()
for label in unit io fuzz filters; do
  [[ " $* " != *"$label"* ]] || targets+=("tests-$label")
done
all=${BIGUS_SANITIZE_ALL:-ON}
cmake --preset sanitizers -DBIGUS_WITH_ALL_KERNELS="$all" -DBIGUS_WITH_SANITIZED_NUMBERS="$all"
cmake --build --preset sanitizers --parallel "$(nproc)" --target "${targets[@]}"
ctest --preset sanitizers --stop-on-failure --parallel "$(nproc)" "$@"
