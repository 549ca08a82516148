#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A frame's plane, as thick as the probe's beam, and a slice that crosses it.

    slice_prop.py FIELD SWEEP [PICTURE.png]
"""
import sys

import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (vtkRenderer, vtkRenderWindow, vtkRenderWindowInteractor,
                                         vtkWindowToImageFilter)

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
renderer.SetBackground(0.1, 0.12, 0.15)
camera = renderer.GetActiveCamera()
camera.SetViewUp(0, -1, 0)  # depth points down
camera.SetPosition(-1.4, -0.6, -1.2)
renderer.ResetCamera()
camera.Zoom(1.35)

window = vtkRenderWindow()
window.SetOffScreenRendering(len(sys.argv) > 3)
window.SetSize(640, 480)
window.AddRenderer(renderer)
interactor = vtkRenderWindowInteractor()
interactor.SetRenderWindow(window)
interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
window.Render()
if len(sys.argv) > 3:
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(sys.argv[3])
    writer.Write()
else:
    interactor.Start()
