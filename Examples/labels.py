#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Labels drawn on a few frames of a made-up sweep: at any plane, as a volume, as a surface, and in files.

    labels.py FOLDER

Writes labelled.vtp, vessel.stl, vessel.obj and vessel.nii.gz, and says how large the vessel is, and how large the cyst is
on a plane across the frames, give or take its standard error (Module/Core/Labels/README.md).
"""
import os
import sys

import bigus
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkMassProperties, vtkWindowedSincPolyDataFilter
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOImage import vtkNIFTIImageWriter

NAMES = {1: "vessel", 2: "cyst", 3: "bone", 4: "tumour"}
SIZE, PIXEL, FRAMES = (128, 128), 0.4, 40


def drawn(source, pose):  # what a person would draw on a frame there
    matrix, picture = vtkMatrix4x4(), vtkImageData()
    matrix.DeepCopy(np.ravel(pose))
    source.ComputeLabels(matrix, *SIZE, picture)
    return vtk_to_numpy(picture.GetPointData().GetScalars()).reshape(SIZE[::-1])


def area_and_outline(inside):  # mm^2 and mm, the outline by Crofton's formula
    rim = np.pad(inside, 1)
    sides = (rim[1:] != rim[:-1]).sum() + (rim[:, 1:] != rim[:, :-1]).sum()
    return inside.sum() * PIXEL**2, np.pi / 4 * sides * PIXEL


def area_with_error(field, source, poses, plane, value, frames):
    """Of a label on a plane; frames that nobody drew on tell how far the field's border is off, mm."""
    pairs = [[area_and_outline(picture == value) for picture in (bigus.label_map(field, poses[k], SIZE), drawn(source, poses[k]))]
             for k in frames]  # fmt: skip
    most = max(truth for _, (truth, _) in pairs)
    off = [(told - truth) / outline for (told, _), (truth, outline) in pairs if truth >= most / 2]
    area, outline = area_and_outline(bigus.label_map(field, plane, SIZE) == value)
    return area, np.sqrt(np.mean(np.square(off))) * outline


def main(folder):
    os.makedirs(folder, exist_ok=True)
    source = bigus.vtkBigusPhantomSource()
    source.SetNumberOfFrames(FRAMES)
    source.SetFrameSize(*SIZE)
    source.SetPixelSize(PIXEL)
    sweep = bigus.update(source).GetOutput()
    poses = bigus.poses(sweep)
    field, _ = bigus.train(sweep, Gaussians=8000, Iterations=60, Automatic=False)

    some = range(0, FRAMES, 4)
    field = bigus.label(field, sweep, np.stack([drawn(source, poses[k]) for k in some]), NAMES, some)
    bigus.write(field, os.path.join(folder, "labelled.vtp"))
    shown, truth = bigus.label_map(field, poses[18], SIZE), drawn(source, poses[18])
    for value, name in NAMES.items():
        a, b = shown == value, truth == value
        print(f"{name}: Dice {2 * (a & b).sum() / max(1, a.sum() + b.sum()):.3f} on a frame that nobody drew on")

    cos, sin, middle = np.cos(np.pi / 6), np.sin(np.pi / 6), [SIZE[0] / 2, 0, 0]  # 30 degrees about the depth axis
    turn = np.array([[cos, 0, -sin / PIXEL, 0], [0, 1, 0, 0], [sin * PIXEL, 0, cos, 0], [0, 0, 0, 1]])
    turn[:3, 3] = middle - turn[:3, :3] @ middle
    across = poses[FRAMES // 2] @ turn
    area, error = area_with_error(field, source, poses, across, 2, [k for k in range(FRAMES) if k not in some])
    print(f"cyst: {area:.0f} +- {error:.0f} mm^2 on a plane across, truly {(drawn(source, across) == 2).sum() * PIXEL**2:.0f}")

    voxels = bigus.vtkBigusVoxelizer()
    voxels.SetInputData(field)
    voxels.SetOutputModeToLabelShare()
    voxels.SetLabelValue(1)
    voxels.SetOutputSpacing(PIXEL, PIXEL, PIXEL)
    surface = vtkFlyingEdges3D()
    surface.SetInputConnection(voxels.GetOutputPort())
    surface.SetValue(0, 0.5)  # the border of what has the label
    smooth = vtkWindowedSincPolyDataFilter()  # which does not shrink
    smooth.SetInputConnection(surface.GetOutputPort())
    size = vtkMassProperties()
    size.SetInputConnection(smooth.GetOutputPort())
    stl = vtkSTLWriter()
    stl.SetFileTypeToBinary()
    for writer, source_of, name in ((stl, smooth, "vessel.stl"), (vtkOBJWriter(), smooth, "vessel.obj"),
                                    (vtkNIFTIImageWriter(), voxels, "vessel.nii.gz")):  # fmt: skip
        writer.SetInputConnection(source_of.GetOutputPort())
        writer.SetFileName(os.path.join(folder, name))
        bigus.update(writer)
    size.Update()
    print(f"vessel: {size.GetVolume():.0f} mm^3 inside {size.GetSurfaceArea():.0f} mm^2")


if __name__ == "__main__":
    main(sys.argv[1])
