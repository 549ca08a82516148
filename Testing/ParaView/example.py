# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The examples in Examples/ParaView draw the picture that lies beside them, in C++ and in Python.

    pvpython example.py PVPYTHON SLICE PLUGIN FOLDER      needs an X server; writes into FOLDER

SLICE is Examples/ParaView/slice.cxx, built. Pictures are compared as those of Examples/Rendering are.
"""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "Testing" / "Rendering"))
from test_examples import LARGEST_DIFFERENCE, LARGEST_MEAN, difference  # noqa: E402


def main(pvpython, built, plugin, folder):
    if not os.environ.get("DISPLAY"):
        print("skipped: no X server (DISPLAY is not set)")
        return 0
    example = ROOT / "Examples" / "ParaView"
    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    wrong = False
    for name, program in (("python", [pvpython, str(example / "slice.py")]), ("cxx", [built])):
        picture = os.path.join(folder, name + ".png")
        subprocess.run([*program, plugin, picture], check=True)
        metric, mean = difference(picture, example / "slice.png")
        print(name, "differs by", metric, "and", mean)
        wrong |= not (metric < LARGEST_DIFFERENCE and mean < LARGEST_MEAN)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
