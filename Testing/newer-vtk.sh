#!/bin/sh
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Builds and tests against a newer VTK than the distribution's: the headers and libraries of a wheel from PyPI.
#
#   Testing/newer-vtk.sh [FOLDER] [ctest arguments]     default: build-newer-vtk, the labels that meet VTK
#
# Tests that draw need an X server. PYTHON names a Python that the wheel is made for (default python3.12), SDK the wheel
# (default cvista-sdk).
set -eu
source_folder=$(cd "$(dirname "$0")/.." && pwd)
folder=${1:-$source_folder/build-newer-vtk}
[ $# -eq 0 ] || shift
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)

venv=$folder/venv
[ -x "$venv/bin/python" ] || "${PYTHON:-python3.12}" -m venv "$venv"
# The wheel's targets for drawing are written for CMake 3.27, and the distribution has 3.25.
"$venv/bin/pip" install --quiet "${SDK:-cvista-sdk}" numpy "cmake>=3.27,<4"
PATH=$venv/bin:$PATH
packages=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
sdk=$packages/$(echo "${SDK:-cvista-sdk}" | sed 's/==.*//; y/-/_/')
[ -e "$sdk/cmake/vtk-config.cmake" ] || { echo "$sdk holds no cmake/vtk-config.cmake; name another SDK" >&2; exit 1; }

# The fork names its Python package cvista. What imports vtkmodules gets its modules.
if [ -d "$sdk/content/cvista" ] && [ ! -d "$packages/vtkmodules" ]; then
  echo "$sdk/content" >"$packages/newer-vtk.pth"
  mkdir "$packages/vtkmodules"
  cat >"$packages/vtkmodules/__init__.py" <<'PYTHON'
import importlib
import importlib.abc
import importlib.machinery
import sys


class _Fork(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, name, path, target=None):
        return importlib.machinery.ModuleSpec(name, self) if name.startswith("vtkmodules.") else None

    def create_module(self, spec):
        module = importlib.import_module("cvista." + spec.name.removeprefix("vtkmodules."))
        self.own_spec = module.__spec__
        return module

    def exec_module(self, module):
        module.__spec__ = self.own_spec


sys.meta_path.insert(0, _Fork())
PYTHON
fi

cmake -S "$source_folder" -B "$folder/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DBIGUS_WITH_CUDA=OFF \
  -DVTK_DIR="$sdk/cmake" -DPython3_EXECUTABLE="$venv/bin/python"
cmake --build "$folder/build" ${JOBS:+--parallel "$JOBS"}
[ $# -gt 0 ] || set -- -L 'io|fuzz|filters|rendering|regression|command|install|examples|python'
cd "$folder/build"
# Installed programs know their own libraries' folder, but not the wheel's.
libraries=$(find "$sdk" -name 'libvtk*.so*' -print -quit)
LD_LIBRARY_PATH=$(dirname "$libraries")${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH} ctest --output-on-failure "$@"
