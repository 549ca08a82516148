#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Installs what building, testing and drawing need on Debian 12; asks apt only for what is missing. With --checks also
# what checks the code itself and builds the site.
set -euo pipefail

packages=(
  g++ cmake ninja-build
  libeigen3-dev libtbb-dev libhwy-dev libopencv-dev  # Core
  libvtk9-dev python3-vtk9                           # filters, readers and their Python wrapping
  libspng-dev zlib1g-dev libpugixml-dev              # PNG images of a sweep; compressed pixels and fields; XML
  libcli11-dev nlohmann-json3-dev                    # the bigus command
  python3 python3-numpy python3-matplotlib           # the Python package; panels and curves
  libgtest-dev xvfb libgl1-mesa-dri libxtst6         # tests
  libbenchmark-dev                                   # benchmarks
)
[[ ${1:-} != --checks ]] || packages+=(
  ccache clang clang-format clang-tidy
  doxygen python3-sphinx python3-myst-parser furo  # the site of all pages
)

missing=()
for package in "${packages[@]}"; do
  status=$(dpkg-query -W -f '${Status}' "$package" 2>/dev/null || true)
  [[ $status == "install ok installed" ]] || missing+=("$package")
done
((${#missing[@]})) || exit 0

as_root=()
if ((EUID != 0)); then
  if ! command -v sudo >/dev/null; then
    echo "These Debian packages are missing: ${missing[*]}" >&2
    echo "Run this script as root, or install sudo, or ask an administrator to install them." >&2
    exit 1
  fi
  as_root=(sudo)
fi

echo "Installing: ${missing[*]}"
"${as_root[@]}" apt-get -qq update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get -qq -y --no-install-recommends -o Dpkg::Use-Pty=0 install "${missing[@]}" >/dev/null
