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

# Rendering needs an X server even off screen. One serves the whole run: it picks a free display number itself and
# writes it to its standard output, which is our end of the coprocess's pipe. -noreset: it does not start anew when its
# last client leaves, because a client that comes meanwhile is turned away.
server_log=$(mktemp)
coproc server { exec Xvfb -displayfd 1 -screen 0 1280x1024x24 -nolisten tcp -noreset 2>"$server_log"; }
server_pid=$!
trap 'kill "$server_pid" 2>/dev/null || true; rm -f "$server_log"' EXIT
if ! read -r -t 60 -u "${server[0]}" display; then
  echo "The virtual X server did not start:" >&2
  cat "$server_log" >&2
  exit 1
fi

status=0
DISPLAY=:$display ctest --test-dir "$build_folder" --output-on-failure --parallel "$(nproc)" \
  --output-junit "$build_folder/tests.xml" "$@" || status=$?
python3 Testing/skipped.py "$build_folder/tests.xml"
exit "$status"
