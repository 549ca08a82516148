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
import sys
import warnings
from typing import Optional, Sequence


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python3 -m bigus.convert", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", help=".npy, .npz, .h5, a video, DICOM, .mha, .nrrd, a folder of pictures, or a .txt that lists them")
    parser.add_argument("poses", nargs="?", help=".csv, .txt, .npy, .h5 or .seq.mha; not given where IMAGES has them, too")
    parser.add_argument("-o", "--output", required=True, help="sequence to write: .igs.mha")
    parser.add_argument("--calibration", metavar="FILE",
                        help="from a pixel to the probe (from mm with --pixel-spacing): 16 numbers, a Plus configuration, or "
                             "TUS-REC's CSV")
    parser.add_argument("--pixel-spacing", nargs=2, type=float, metavar=("SX", "SY"), help="mm along columns i and rows j")
    parser.add_argument("--origin-pixel", nargs=2, type=float, default=(0, 0), metavar=("I", "J"),
                        help="the pixel that the pose or the calibration calls its origin (default: 0 0)")
    parser.add_argument("--dataset", nargs="+", action="extend", default=[], metavar="NAME",
                        help="arrays of an HDF5 or .npz file that are the images and the poses, where it has several")
    parser.add_argument("--scan", metavar="NAME",
                        help="which scan of an HDF5 file that holds several: part of its name, or its number, from 0, in one "
                             "array")
    parser.add_argument("--first-pixel", type=int, choices=(0, 1),
                        help="what the calibration counts the first pixel as (default: 0, and 1 for TUS-REC)")
    parser.add_argument("--reference", metavar="POSES", help="poses of a second tool, in which the sweep shall lie")
    parser.add_argument("--units", choices=("mm", "cm", "m"), default="mm", help="of the positions (default: mm)")
    parser.add_argument("--quaternion", choices=("xyzw", "wxyz"), default="xyzw",
                        help="their order where columns have no names (default: xyzw)")
    parser.add_argument("--inverse", action="store_true", help="poses lead from the reference to the probe")
    parser.add_argument("--crop", nargs=4, type=int, metavar=("I", "J", "W", "H"),
                        help="column, row, columns and rows that are the image, as in a screen capture")
    parser.add_argument("--by-time", action="store_true",
                        help="take poses at the frames' times even where there is one pose a frame")
    parser.add_argument("--time-offset", type=float, default=0.0, metavar="S",
                        help="added to the frames' times to give the poses' (default: 0)")
    parser.add_argument("--longest-gap", type=float, default=0.2, metavar="S",
                        help="the most time between two poses that are interpolated (default: 0.2)")
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    options = vars(parser().parse_args(arguments))
    output = options.pop("output")

    import bigus  # after the help, which needs no VTK

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
