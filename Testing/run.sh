#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds everything in build/ and runs every test but those with the label nightly, which ask for rare faults of timing and
# memory; with --all those, too. Arguments go to ctest: Testing/run.sh -L unit
# At the end it says which tests were skipped, and why.
set -euo pipefail

if [[ ${1:-} == --all ]]; then
  shift
elif [[ " $* " != *" -LE "* ]]; then
  set -- -LE '^nightly$' "$@"
fi

source_folder=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build_folder=$source_folder/build
cd "$source_folder"

Testing/install-packages.sh

generator=()
[[ -e $build_folder/CMakeCache.txt ]] || generator=(-G Ninja -DCMAKE_BUILD_TYPE=Release)
cmake -S "$source_folder" -B "$build_folder" "${generator[@]}" -DBUILD_TESTING=ON
cmake --build "$build_folder" --parallel "$(nproc)"

status=0
Testing/Support/display.sh ctest --test-dir "$build_folder" --output-on-failure --parallel "$(nproc)" \
  --output-junit "$build_folder/tests.xml" "$@" || status=$?
python3 Testing/skipped.py "$build_folder/tests.xml"
exit "$status"
