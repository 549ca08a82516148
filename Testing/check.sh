#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Habits that need no build: layout of the code, licence lines, no merge left half done, arrows between rooms, links of
# pages.
# Testing/check.sh --fix lays the code out.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Other versions lay code out differently.
version=14
format=$(command -v clang-format-$version || command -v clang-format || true)
if [[ -z $format || $("$format" --version) != *"version $version."* ]]; then
  echo "clang-format $version is needed (Debian 12: apt-get install clang-format)." >&2
  exit 1
fi
mapfile -t sources < <(git ls-files '*.h' '*.cxx' '*.cu')
if [[ ${1:-} == --fix ]]; then
  "$format" -i "${sources[@]}"
fi
"$format" --dry-run -Werror "${sources[@]}"

unlicensed=$(git ls-files '*.h' '*.cxx' '*.cu' '*.py' '*.sh' '*CMakeLists.txt' | xargs grep -L "SPDX-License-Identifier" || true)
if [[ -n $unlicensed ]]; then
  printf 'These files lack the SPDX lines:\n%s\n' "$unlicensed" >&2
  exit 1
fi
if git grep -nE '^(<<<<<<<|>>>>>>>)( |$)' -- ':!*.patch' >&2; then
  echo "These lines were left by a merge." >&2
  exit 1
fi
# The version stands in CMakeLists.txt. What no build makes has to agree with it.
version=$(sed -n 's/^project(BIGUS VERSION \([0-9.]*\) .*/\1/p' CMakeLists.txt)
date=$(sed -n "s/^## $version (\([0-9]\{4\}-[0-9][0-9]-[0-9][0-9]\))$/\1/p" CHANGELOG.md)
if [[ -z $date ]] || ! grep -qx "version: $version" CITATION.cff || ! grep -qx "date-released: \"$date\"" CITATION.cff; then
  echo "CMakeLists.txt says version $version. CHANGELOG.md needs a heading '## $version (YEAR-MONTH-DAY)' and CITATION.cff the same version and date." >&2
  exit 1
fi
python3 Testing/Structure/check_rooms.py .
python3 Testing/Structure/check_links.py .
