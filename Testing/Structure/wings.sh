#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Whether the trunk stands without its wings: deletes one after the other, its folder and its line of CMake, in a copy of what
# git has, builds what is left and runs its quick tests of structure, readers, filters and rendering. Then all at once, with
# all quick tests: what the trunk does without any wing it does without one, but for what wings do to each other.
#   Testing/Structure/wings.sh [FOLDER] [WING...]     FOLDER: of the copy and its build, else a new one that goes away;
#                                                     WING: such as Module/Serve, else each of them and all together
# Links of pages are not looked at, because pages name wings for readers.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
if (($#)); then
  folder=$(mkdir -p "$1" && cd "$1" && pwd)
  shift
else
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
fi
wings=("$@")
if ((${#wings[@]} == 0)); then
  mapfile -t wings < <(python3 "$root/Testing/Structure/check_rooms.py" --wings "$root")
  wings+=("${wings[*]}")
fi

for gone in "${wings[@]}"; do
  start=$SECONDS
  echo "=== without $gone"
  cd "$folder"
  rm -rf "$folder/source"  # files of a wing that an earlier build left would hide that the trunk needs them
  git clone --quiet --shared "$root" "$folder/source"
  cd "$folder/source"
  for wing in $gone; do
    rm -r "$wing"
    sed -i "\|^add_subdirectory($wing)\$|d" CMakeLists.txt
  done
  cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release >"$folder/log" || { cat "$folder/log"; exit 1; }
  cmake --build build --parallel "$(nproc)" >"$folder/log" || { tail -50 "$folder/log"; exit 1; }
  python3 Testing/Structure/check_rooms.py .
  labels=(-L '^(structure|io|filters|rendering)$')
  [[ $gone != *' '* ]] || labels=()
  ctest --test-dir build --output-on-failure --parallel "$(nproc)" "${labels[@]}" -LE '^(slow|nightly|site|install)$' \
    -E '^structure[.]links$' >"$folder/log" || { tail -50 "$folder/log"; exit 1; }
  tail -3 "$folder/log" | head -1
  echo "=== without $gone: $((SECONDS - start)) s"
done
