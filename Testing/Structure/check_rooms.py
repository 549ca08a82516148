# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Includes point one way only: down through the layers, and inside Core down through its rooms.

    check_rooms.py FOLDER        the project's root; prints every wrong include and fails when there is one
    check_rooms.py --floors FOLDER   prints how many floors of rooms and of headers Core has
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
    "Module/Wheel": ["Module/IO", "Module/Data", "Module/Core"],
    "Module/IO": ["Module/Data", "Module/Core"],
    "Filters": ["Module/Data", "Module/Core"],
    "Rendering": ["Filters", "Module/IO", "Module/Data", "Module/Core"],
    "Module/ParaView": ["Filters", "Module/IO", "Module/Data", "Module/Core"],
    "Module/Command": ["Rendering", "Filters", "Module/IO", "Module/Data", "Module/Core"],
}
# How an include begins that names a layer.
PREFIXES = {"Core/": "Module/Core", "Data/": "Module/Data", "Cuda/": "Cuda", "Testing/": "Testing", "Support/": "Testing"}


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
    for layer, allowed in LAYERS.items():
        for path in sources_below(root / layer):
            for include in includes_of(path):
                for prefix, target in PREFIXES.items():
                    if include.startswith(prefix) and target != layer and target not in allowed:
                        yield f"{path.relative_to(root)}: {layer} includes {include}"
                name = include.split("/")[-1]
                if name.startswith("vtkBigus"):
                    home = next((l for l in LAYERS if (root / l / name).exists()), layer)
                    if home != layer and home not in allowed:
                        yield f"{path.relative_to(root)}: {layer} includes {include} of {home}"


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
    parser.add_argument("folder", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.floors:
        print("%d floors, %d units, %d files" % floors(arguments.folder))
        return 0
    wrong = list(wrong_between_rooms(arguments.folder)) + list(wrong_between_layers(arguments.folder))
    print("\n".join(wrong) or "Every include points down.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
