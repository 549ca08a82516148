#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A frame's plane, as thick as the probe's beam, and a slice that crosses it.

    slice_prop.py FIELD SWEEP [PICTURE.png]
"""
import sys

from example_window import ExampleWindow, picture_named
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkRenderer

import bigus

field, sweep = bigus.read(sys.argv[1]), bigus.read(sys.argv[2])
count, height, width = bigus.frames(sweep).shape
pose = vtkMatrix4x4()
pose.DeepCopy(bigus.poses(sweep)[count // 2].ravel())
frame = bigus.vtkBigusSliceProp()
frame.SetInputData(field)
frame.SetPlaneToFrame(pose, width, height)
frame.BeamVisibilityOn()
across = bigus.vtkBigusSliceProp()
across.SetInputData(field)
across.PlaceInField(0, 512)
across.GetOutlineProperty().SetColor(1, 0.6, 0.2)

renderer = vtkRenderer()
renderer.AddViewProp(frame)
renderer.AddViewProp(across)
window = ExampleWindow(picture_named(3), 640, 480)
window.add(renderer, (-1.4, -0.6, -1.2), 1.35)
window.show()
