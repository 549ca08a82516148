# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Images and poses of your own to a sequence that every BIGUS program reads.

    python3 -m bigus.convert images.npy poses.npy --pixel-spacing 0.2 0.2 -o sweep.igs.mha
    python3 -m bigus.convert scan.h5 --calibration calib_matrix.csv -o sweep.igs.mha
    python3 -m bigus.convert scans.h5 --scan sub000_00 --calibration calib_matrix.csv -o sweep.igs.mha
    python3 -m bigus.convert own.h5 --dataset us probe --pixel-spacing 0.2 0.2 -o sweep.igs.mha
    python3 -m bigus.convert video.mp4 tracker.csv --calibration probe.txt --time-offset 12.4 -o sweep.igs.mha
"""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from typing import Any, Optional, Sequence

import bigus
from bigus import sources

# How words of a command line become what from_files takes.
WORDS: dict[str, dict[str, Any]] = {
    "images": {}, "poses": {"nargs": "?"}, "calibration": {"metavar": "FILE"}, "reference": {"metavar": "POSES"},
    "pixel_spacing": {"nargs": 2, "type": float, "metavar": ("SX", "SY")}, "scan": {"metavar": "NAME"},
    "origin_pixel": {"nargs": 2, "type": float, "metavar": ("I", "J")}, "first_pixel": {"type": int, "choices": (0, 1)},
    "dataset": {"nargs": "+", "action": "extend", "metavar": "NAME"}, "units": {"choices": ("mm", "cm", "m")},
    "quaternion": {"choices": ("xyzw", "wxyz")}, "inverse": {"action": "store_true"}, "by_time": {"action": "store_true"},
    "crop": {"nargs": 4, "type": int, "metavar": ("I", "J", "W", "H")}, "time_offset": {"type": float, "metavar": "S"},
    "longest_gap": {"type": float, "metavar": "S"},
}  # fmt: skip


def parser() -> argparse.ArgumentParser:
    """Of the options of from_files, with what it says of them."""
    parser = argparse.ArgumentParser(prog="python3 -m bigus.convert", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    said = dict(re.findall(r"^    (\w+): (.*(?:\n        .*)*)", sources.from_files.__doc__ or "", re.MULTILINE))
    for name, default in {"images": None, "poses": None, **sources.Reading._field_defaults}.items():
        usual = f" (default: {default})" if isinstance(default, (str, float)) else ""
        text = " ".join(said[name].split()) + usual
        if name in ("images", "poses"):
            parser.add_argument(name, help=text, **WORDS[name])
        else:
            default = list(default) if default == () else default
            parser.add_argument("--" + name.replace("_", "-"), help=text, default=default, **WORDS[name])
    parser.add_argument("-o", "--output", required=True, help="sequence to write: .igs.mha")
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    options = vars(parser().parse_args(arguments))
    output = options.pop("output")
    try:
        if not output.lower().endswith(".mha"):
            raise ValueError(f"{output}: the name must end in .igs.mha or .mha")
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            sweep = bigus.from_files(options.pop("images"), options.pop("poses"), **options)
        for note in notes:
            print(note.message, file=sys.stderr)
        bigus.write(sweep, output)
    except (ValueError, RuntimeError, OSError) as error:
        print(f"bigus.convert: {error}", file=sys.stderr)
        return 2
    frames, height, width = bigus.frames(sweep).shape
    print(f"{output}: {frames} frames of {width} x {height} pixels")
    return 0


if __name__ == "__main__":
    sys.exit(main())
