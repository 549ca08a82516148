#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Labels drawn on all frames of a sweep: an area with its error on a plane across them, a surface and a volume.

    labels.py SWEEP LABELS FIELD VALUE FOLDER

Writes label.stl, label.obj and label.nii.gz of the label of that value. Module/Core/Labels/README.md has the error's equations.
"""
import os
import sys

import bigus
import numpy as np
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkWindowedSincPolyDataFilter
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOImage import vtkNIFTIImageWriter


def area_and_outline(inside, pixel):  # mm^2 and mm, the outline by Crofton's formula
    rim = np.pad(inside, 1)
    sides = (rim[1:] != rim[:-1]).sum() + (rim[:, 1:] != rim[:, :-1]).sum()
    return inside.sum() * pixel**2, np.pi / 4 * sides * pixel


def main(sweep, labels, field, value, folder):
    reader = bigus.vtkBigusLabelReader()
    reader.SetFileName(labels)
    drawn = bigus.frames(bigus.update(reader).GetOutput())
    sweep, field, value, size = bigus.read(sweep), bigus.read(field), int(value), drawn.shape[:0:-1]
    poses, pixel = bigus.poses(sweep), np.linalg.norm(bigus.poses(sweep)[0][:3, 0])
    # How far borders are off on frames that had no part, mm for each mm of them, where they show most of the label.
    every_other = bigus.label(field, sweep, drawn[::2], frames=range(0, len(drawn), 2))
    shown = [area_and_outline(bigus.label_map(every_other, pose, size) == value, pixel) for pose in poses[1::2]]
    truth = [area_and_outline(picture == value, pixel) for picture in drawn[1::2]]
    most = max(area for area, _ in truth)
    off = [(told - area) / outline for (told, _), (area, outline) in zip(shown, truth) if 0 < most / 2 <= area]

    field = bigus.label(field, sweep, drawn)
    turn = np.array([(0.8, 0, -0.6 / pixel, 0.1 * size[0]), (0, 1, 0, 0), (0.6 * pixel, 0, 0.8, -0.3 * pixel * size[0]), (0, 0, 0, 1)])
    area, outline = area_and_outline(bigus.label_map(field, poses[len(poses) // 2] @ turn, size) == value, pixel)
    print(f"{area:.0f} +- {np.sqrt(np.mean(np.square(off))) * outline:.0f} mm^2 on a plane across")

    share, border, smooth = bigus.vtkBigusVoxelizer(), vtkFlyingEdges3D(), vtkWindowedSincPolyDataFilter()  # which does not shrink
    share.SetInputData(field)
    share.SetOutputModeToLabelShare()
    share.SetLabelValue(value)
    border.SetInputConnection(share.GetOutputPort())
    border.SetValue(0, 0.5)
    smooth.SetInputConnection(border.GetOutputPort())
    os.makedirs(folder, exist_ok=True)
    for writer, source, name in ((vtkSTLWriter(), smooth, "stl"), (vtkOBJWriter(), smooth, "obj"), (vtkNIFTIImageWriter(), share, "nii.gz")):
        writer.SetInputConnection(source.GetOutputPort())
        writer.SetFileName(os.path.join(folder, "label." + name))
        bigus.update(writer)


if __name__ == "__main__":
    main(*sys.argv[1:])
