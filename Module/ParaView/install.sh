#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Makes ParaView 5.11 with the plugin in a folder of its own, on a Debian 12 on which nothing was prepared.
#   Module/ParaView/install.sh [FOLDER]     ~/bigus-paraview by default
# ParaView's packages are unpacked into FOLDER and not installed, because python3-paraview would remove python3-vtk9 and
# all that needs it. apt installs what they need and what the build needs, as root or by sudo, and removes nothing. Run
# again, the script builds anew what has changed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
folder=$(mkdir -p "${1:-$HOME/bigus-paraview}" && cd "${1:-$HOME/bigus-paraview}" && pwd)
paraview=$folder/paraview/usr
build_packages=(
  libqt5svg5  # ParaView's icons
  g++ cmake ninja-build
  libeigen3-dev libtbb-dev libhwy-dev libopencv-dev libspng-dev libpugixml-dev nlohmann-json3-dev  # what the plugin is built on
  mpi-default-dev libutfcpp-dev liblz4-dev liblzma-dev libdouble-conversion-dev libexpat1-dev zlib1g-dev  # ParaView's headers
)

done_with() {
  echo "$1: $((SECONDS / 60)) min $((SECONDS % 60)) s after the start"
}

as_root() {
  if ((EUID == 0)); then
    "$@"
  elif command -v sudo >/dev/null; then
    sudo "$@"
  else
    echo "There is no sudo; run this as root, and then the script again: $*" >&2
    return 1
  fi
}

apt-cache show paraview >/dev/null 2>&1 || as_root apt-get -qq update
if [[ ! -x $paraview/bin/pvpython ]]; then
  packages=$(mktemp -d)
  trap 'rm -rf "$packages"' EXIT
  (cd "$packages" && apt-get -qq download paraview paraview-dev python3-paraview 2>/dev/null)
  done_with "ParaView was downloaded"
  # What the three need besides each other, as apt reads it. qttools is for plugins with windows of their own.
  for package in "$packages"/*.deb; do
    dpkg-deb -f "$package" Depends | tr ',' '\n'
  done | sed 's/^ *//' | grep -vE '^(paraview|python3-paraview|qttools5-dev-tools)( |$)' | sort -u >"$folder/needs"
  for package in "$packages"/*.deb; do
    dpkg -x "$package" "$folder/paraview"
  done
fi

needs=$(paste -sd, "$folder/needs"),$(IFS=,; echo "${build_packages[*]}")
missing=$(apt-get -s --no-install-recommends satisfy "$needs" | sed -n 's/^Inst \([^ ]*\).*/\1/p')
if [[ -n $missing ]]; then
  echo "Installing $(wc -l <<<"$missing") packages"
  as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-remove --no-install-recommends \
    -o Dpkg::Use-Pty=0 satisfy "$needs" >/dev/null
fi
done_with "Packages are there"

generator=()
[[ -e $folder/build/CMakeCache.txt ]] || generator=(-G Ninja)
cmake -S "$root/Module/ParaView" -B "$folder/build" "${generator[@]}" -DPython3_EXECUTABLE=/usr/bin/python3 \
  -DParaView_DIR="$(echo "$paraview"/lib/*/cmake/paraview-5.11)" >"$folder/configure.log"
cmake --build "$folder/build" --parallel "${BIGUS_JOBS:-$(nproc)}" >"$folder/build.log" || {
  tail -20 "$folder/build.log" >&2
  exit 1
}
done_with "The plugin was built"

cat >"$folder/environment" <<END
export PATH="$paraview/bin:\$PATH" PYTHONPATH="$paraview/lib/python3/dist-packages\${PYTHONPATH:+:\$PYTHONPATH}"
export PV_PLUGIN_CONFIG_FILE="$folder/build/lib/bigus.xml"
END
(cd "$folder" && . ./environment && pvpython "$root/Module/ParaView/slice.py" slice.vti)
done_with "The first slice, $folder/slice.vti, was made"
echo "Start ParaView with the plugin:
  . $(printf %q "$folder/environment") && paraview"
