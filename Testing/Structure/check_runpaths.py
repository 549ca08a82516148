# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Programs and libraries look for others in folders that are named in full or from their own.

    check_runpaths.py FOLDER   a build or an installed tree, or a wheel; prints every wrong entry and fails when there is one

An empty or relative entry of a RUNPATH or RPATH is looked up in the working directory. So a library that somebody planted
beside the data would be loaded.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import zipfile


def is_elf(path):
    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(4) == b"\x7fELF"


def search_paths(path):
    """Each RUNPATH and RPATH of an ELF file, as it stands there."""
    text = subprocess.run(["readelf", "-d", path], capture_output=True, text=True).stdout  # objects have no such section
    return re.findall(r"\((?:RUNPATH|RPATH)\).*\[(.*)\]", text)


def main():
    folder = pathlib.Path(sys.argv[1])
    if folder.suffix == ".whl":
        with tempfile.TemporaryDirectory() as name, zipfile.ZipFile(folder) as wheel:
            wheel.extractall(name)
            return check(pathlib.Path(name))
    return check(folder)


def check(folder):
    files = [path for path in sorted(folder.rglob("*")) if path.suffix not in {".o", ".a"} and is_elf(path)]
    wrong = [f"{path}: {search_path!r}" for path in files for search_path in search_paths(path)
             if not all(entry.startswith(("/", "$ORIGIN")) for entry in search_path.split(":"))]
    if not files:
        print(f"{folder} holds no program and no library.")
        return 1
    print("\n".join(wrong) or f"{len(files)} programs and libraries name every folder in full or from their own.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
