#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The Gaussians of a field as ellipsoids, beside the sweep's frames and the probe's path.

    field_mapper.py FIELD SWEEP [PICTURE.png]
"""
import sys

import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow,
                                         vtkRenderWindowInteractor, vtkWindowToImageFilter)

import bigus

mapper = bigus.vtkBigusFieldMapper()
mapper.SetInputData(bigus.read(sys.argv[1]))
mapper.SetScaleFactor(0.6)  # standard deviations
ellipsoids = vtkActor()
ellipsoids.SetMapper(mapper)
outline = bigus.vtkBigusSweepOutline()
outline.SetInputData(bigus.read(sys.argv[2]))
outline.SetFrameStride(8)
renderer = vtkRenderer()
renderer.AddActor(ellipsoids)
for port, colour, width in ((0, (0.6, 0.75, 0.9), 1), (1, (1, 0.85, 0.2), 4)):  # frames, path
    lines = vtkPolyDataMapper()
    lines.SetInputConnection(outline.GetOutputPort(port))
    actor = vtkActor()
    actor.SetMapper(lines)
    actor.GetProperty().SetColor(colour)
    actor.GetProperty().SetLineWidth(width)
    renderer.AddActor(actor)
renderer.SetBackground(0.1, 0.12, 0.15)
camera = renderer.GetActiveCamera()
camera.SetViewUp(0, -1, 0)  # depth points down
camera.SetPosition(-0.8, -0.9, -1.1)
renderer.ResetCamera()
camera.Zoom(1.4)
window = vtkRenderWindow()
window.SetOffScreenRendering(len(sys.argv) > 3)
window.SetSize(440, 330)
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
