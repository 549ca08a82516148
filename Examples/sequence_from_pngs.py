#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Make a tracked sequence of plain images and a table of poses.

    sequence_from_pngs.py SWEEP FOLDER

Takes a sweep apart into FOLDER/frame_000.png and so on and FOLDER/poses.csv: what you would have from your own scanner
and tracker. Then reads poses.csv as a sequence, and checks that it is the same sweep.

poses.csv has one row an image: image (a PNG beside the CSV), m00 to m33 (row by row, pixel (i, j, 0, 1) to mm, pixel
(0, 0) being the first of the first row), and if you have them timestamp (seconds) and status (OK or INVALID).
"""
import argparse
import csv
import pathlib

import numpy as np
from vtkmodules.vtkImagingCore import vtkImageFlip
from vtkmodules.vtkIOImage import vtkPNGWriter

import bigus


def write_png(pixels, path):
    flip = vtkImageFlip()  # VTK's PNG writer puts the last row on top
    flip.SetInputData(bigus.image(pixels))
    flip.SetFilteredAxis(1)
    writer = vtkPNGWriter()
    writer.SetInputConnection(flip.GetOutputPort())
    writer.SetFileName(str(path))
    writer.Write()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep")
    parser.add_argument("folder", type=pathlib.Path)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)

    sweep = bigus.read(options.sweep)
    frames, poses = bigus.frames(sweep), bigus.poses(sweep)
    with open(options.folder / "poses.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["image", "timestamp", "status"] + [f"m{row}{column}" for row in range(4) for column in range(4)])
        for k, (pixels, pose) in enumerate(zip(frames, poses)):
            name = f"frame_{k:03d}.png"
            write_png(pixels, options.folder / name)
            table.writerow([name, k / 20, "OK"] + [repr(float(value)) for value in pose.ravel()])

    again = bigus.read(options.folder / "poses.csv")
    if not np.array_equal(bigus.frames(again), frames) or not np.array_equal(bigus.poses(again), poses):
        raise SystemExit("the sequence read back differs")
    print(f"{options.folder / 'poses.csv'}: {len(frames)} frames, read back the same")


if __name__ == "__main__":
    main()
