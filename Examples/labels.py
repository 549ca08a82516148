#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Labels drawn on a few frames of a made-up sweep: at any plane, as a volume, as a surface, and in files.

    labels.py FOLDER

Writes labelled.vtp, vessel.stl and vessel.nii.gz, and says how large the vessel is.
"""
import os
import sys

import bigus
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkMassProperties, vtkWindowedSincPolyDataFilter
from vtkmodules.vtkIOGeometry import vtkSTLWriter
from vtkmodules.vtkIOImage import vtkNIFTIImageWriter

NAMES = {1: "vessel", 2: "cyst", 3: "bone", 4: "tumour"}
SIZE, PIXEL, FRAMES = (128, 128), 0.4, 40


def drawn(source, pose):  # what a person would draw on a frame there
    matrix, picture = vtkMatrix4x4(), vtkImageData()
    matrix.DeepCopy(np.ravel(pose))
    source.ComputeLabels(matrix, *SIZE, picture)
    return vtk_to_numpy(picture.GetPointData().GetScalars()).reshape(SIZE[::-1])


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
    for writer, source_of, name in ((stl, smooth, "vessel.stl"), (vtkNIFTIImageWriter(), voxels, "vessel.nii.gz")):
        writer.SetInputConnection(source_of.GetOutputPort())
        writer.SetFileName(os.path.join(folder, name))
        bigus.update(writer)
    size.Update()
    print(f"vessel: {size.GetVolume():.0f} mm^3 inside {size.GetSurfaceArea():.0f} mm^2")


if __name__ == "__main__":
    main(sys.argv[1])
