#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""See a field at planes of your own: here a fan of them about the depth axis through the middle of a sweep.

    slices_at_poses.py FIELD SWEEP FOLDER [--planes N]

Writes FOLDER/planes.csv (which 'bigus slice --poses' takes as well) and FOLDER/slice_00.png and so on. Where the field
was never trained, slices are black; the share of pixels that were seen is printed from the coverage.
"""
import argparse
import csv
import pathlib

import numpy as np
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkImageFlip
from vtkmodules.vtkIOImage import vtkPNGWriter

import bigus


def planes_about_depth(pose, width, height, count):
    """Turns the image plane about its own vertical midline, in equal steps over half a turn."""
    middle = pose @ ((width - 1) / 2, 0, 0, 1)
    axis = pose[:3, 1] / np.linalg.norm(pose[:3, 1])
    for angle in np.arange(count) * np.pi / count:
        plane = pose.copy()
        column = pose[:3, 0]
        plane[:3, 0] = (column * np.cos(angle) + np.cross(axis, column) * np.sin(angle)
                        + axis * (axis @ column) * (1 - np.cos(angle)))
        plane[:3, 3] = middle[:3] - plane[:3, 0] * (width - 1) / 2
        normal = np.cross(plane[:3, 0], plane[:3, 1])
        plane[:3, 2] = normal / np.linalg.norm(normal)
        yield plane


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field")
    parser.add_argument("sweep")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--planes", type=int, default=6)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)

    sweep = bigus.read(options.sweep)
    count, height, width = bigus.frames(sweep).shape
    planes = list(planes_about_depth(bigus.poses(sweep)[count // 2], width, height, options.planes))
    with open(options.folder / "planes.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow([f"m{row}{column}" for row in range(4) for column in range(4)] + ["width", "height"])
        table.writerows([repr(float(value)) for value in plane.ravel()] + [width, height] for plane in planes)

    # One filter for all planes: the field is uploaded once, then only the axes change.
    axes = vtkMatrix4x4()
    reslice = bigus.vtkBigusReslice()
    reslice.SetInputData(bigus.read(options.field))
    reslice.SetOutputToFrame(axes, width, height)
    reslice.SetOutputScalarTypeToUnsignedChar()
    flip = vtkImageFlip()  # VTK's PNG writer puts the last row on top
    flip.SetInputConnection(reslice.GetOutputPort())
    flip.SetFilteredAxis(1)
    for k, plane in enumerate(planes):
        axes.DeepCopy(plane.ravel())
        bigus.update(flip)
        writer = vtkPNGWriter()
        writer.SetInputData(flip.GetOutput())
        writer.SetFileName(str(options.folder / f"slice_{k:02d}.png"))
        writer.Write()
        coverage = bigus.frames(reslice.GetCoverageOutput())[0]
        print(f"plane {k}: {100 * np.mean(coverage > 0.05 * coverage.max()):.0f} % of its pixels were seen")


if __name__ == "__main__":
    main()
