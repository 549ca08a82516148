# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Includes point one way only: down through the layers, and inside Core down through its rooms. The trunk names no wing.

    check_rooms.py FOLDER        the project's root; prints every wrong include and fails when there is one
    check_rooms.py --floors FOLDER   prints how many floors of rooms and of headers Core has
    check_rooms.py --wings FOLDER    prints the folders of the wings
"""

import argparse
import pathlib
import re
import sys

# Which folders each folder may include, itself apart. Module/Core is listed room by room in its CMakeLists.txt.
LAYERS = {
    "Module/Core": [],
    "Cuda": ["Module/Core"],
    "Module/Data": ["Module/Core"],
    "Module/IO": ["Module/Data", "Module/Core"],
    "Filters": ["Module/Data", "Module/Core"],
    "Rendering": ["Filters", "Module/IO", "Module/Data", "Module/Core"],
    "Module/ParaView": ["Filters", "Module/IO", "Module/Data", "Module/Core"],
    "Module/Command": ["Rendering", "Filters", "Module/IO", "Module/Data", "Module/Core"],
}
# What each wing may include beside itself. No wing includes another.
WINGS = {
    "Module/Serve": ["Module/Command", "Module/IO", "Module/Data", "Module/Core"],
    "Module/Viewer": ["Module/Command", *LAYERS["Module/Command"]],
    "Module/Wheel": ["Module/IO", "Module/Data", "Module/Core"],
    "Module/Live": ["Module/Command", "Filters", "Module/IO", "Module/Data", "Module/Core", "Testing"],
    "Filters/Parallel": ["Filters", "Module/IO", "Module/Data", "Module/Core", "Testing"],
}
# How an include begins that names a layer.
PREFIXES = {"Core/": "Module/Core", "Data/": "Module/Data", "Cuda/": "Cuda", "Testing/": "Testing", "Support/": "Testing",
            "Live/": "Module/Live"}

# The one line of each wing, and names by which the trunk finds what any wing may bring.
KNOW_WINGS = {"CMakeLists.txt"}
FOUND_BY_NAME = {"vtk.module", "Sources.cmake", "ParaView.cmake"}


def includes_of(path):
    return re.findall(r'^\s*#\s*include\s*["<]([^">]+)[">]', path.read_text(), re.MULTILINE)


def sources_below(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in {".h", ".cxx", ".cu"})


def rooms_of(root):
    text = (root / "Module/Core/CMakeLists.txt").read_text()
    return re.search(r"set\(rooms\s+([^)]*)\)", text).group(1).split()


def wrong_between_rooms(root):
    core = root / "Module/Core"
    rooms = rooms_of(root)
    for path in sources_below(core):
        room = path.relative_to(core).parts[0]
        if room not in rooms:
            yield f"{path.relative_to(root)}: {room} is not in the list of rooms in Module/Core/CMakeLists.txt"
            continue
        for include in includes_of(path):
            parts = include.split("/")
            if parts[0] != "Core":
                if (path.parent / include).exists():
                    yield f'{path.relative_to(root)}: "{include}" does not name its room'
                continue
            if parts[1] not in rooms[: rooms.index(room) + 1]:
                yield f"{path.relative_to(root)}: {room} includes {include}, which is above it"


def wrong_between_layers(root):
    for layer, allowed in {**LAYERS, **WINGS}.items():
        for path in sources_below(root / layer):
            if any(path.is_relative_to(root / wing) for wing in WINGS if wing != layer):
                continue
            for include in includes_of(path):
                for prefix, target in PREFIXES.items():
                    if include.startswith(prefix) and target != layer and target not in allowed:
                        yield f"{path.relative_to(root)}: {layer} includes {include}"
                name = include.split("/")[-1]
                if name.startswith("vtkBigus"):
                    home = next((l for l in LAYERS if (root / l / name).exists()), layer)
                    if home != layer and home not in allowed:
                        yield f"{path.relative_to(root)}: {layer} includes {include} of {home}"


def trunk_files(root):
    """What is compiled, configured or run, outside wings. Pages name wings for readers, and so does what lists pages."""
    # Builds are not walked through: other tests write there meanwhile.
    tops = [top for top in root.iterdir() if not top.name.startswith(("build", "."))]
    for path in sorted(path for top in tops for path in (top, *top.rglob("*"))):
        name = path.relative_to(root).as_posix()
        is_code = path.suffix in {".h", ".cxx", ".cu", ".py", ".cmake", ".sh", ".xml", ".in"} or path.name == "CMakeLists.txt"
        skipped = ("Testing/Structure/", "Module/Documentation/", *(w + "/" for w in WINGS))
        if is_code and path.is_file() and not name.startswith(skipped) and name not in KNOW_WINGS:
            yield path


def wings_named(root):
    """Lines of the trunk that name a wing's folder or one of its files."""
    shared = {path.name for path in trunk_files(root)}
    own = {path.name for wing in WINGS for path in (root / wing).rglob("*")
           if path.is_file() and path.suffix not in {".md", ".png", ".pyc"}} - shared - FOUND_BY_NAME  # fmt: skip
    modules = [re.escape(name[:-3]) for name in own if name.endswith(".py")]
    names = re.compile(r"(?<![\w.-])(?:[\w.-]+/)*(" + "|".join(map(re.escape, [*own, *WINGS])) + r")(?![\w-]|\.\w)"
                       + "".join(rf"|^ *import {m}\b|^ *from [.\w]* ?(?:import )?{m}\b" for m in modules))
    for path in trunk_files(root):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            if found := names.search(line):
                yield f"{path.relative_to(root)}:{number}: the trunk names {found.group().strip()}, which is of a wing"
    root_list = (root / "CMakeLists.txt").read_text().splitlines()
    for wing in WINGS:
        if (root / wing).is_dir() and root_list.count(f"add_subdirectory({wing})") != 1:
            yield f"CMakeLists.txt: {wing} is a wing, and not one line of its own"


def floors(root):
    """The longest chain of includes between files of Core, a header and its source counted as one unit."""
    core = root / "Module/Core"
    units = {}
    for path in sources_below(core):
        unit = path.name.replace("-inl.h", "").replace(".cxx", "").replace(".h", "")
        units.setdefault(unit, set()).update(
            i.split("/")[-1].replace("-inl.h", "").replace(".h", "") for i in includes_of(path))
    depth = {}

    def walk(unit, trail):
        if unit in trail:
            return 0
        if unit not in depth:
            below = [walk(u, trail | {unit}) for u in units[unit] if u in units and u != unit]
            depth[unit] = 1 + max(below, default=0)
        return depth[unit]

    return max(walk(unit, frozenset()) for unit in units), len(units), len(sources_below(core))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--floors", action="store_true")
    parser.add_argument("--wings", action="store_true")
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.floors:
        print("%d floors, %d units, %d files" % floors(arguments.folder))
        return 0
    if arguments.wings:
        print("\n".join(WINGS))
        return 0
    wrong = list(wrong_between_rooms(arguments.folder)) + list(wrong_between_layers(arguments.folder))
    wrong += wings_named(arguments.folder)
    print("\n".join(wrong) or "Every include points down.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
