#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field as a cloud, by VTK's volume rendering. The field's own quantiles say what is opaque.

    field_volume.py FIELD [PICTURE.png]
"""
import sys

import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (vtkRenderer, vtkRenderWindow, vtkRenderWindowInteractor,
                                         vtkWindowToImageFilter)

import bigus

volume = bigus.vtkBigusFieldVolume()
volume.SetInputData(bigus.read(sys.argv[1]))

renderer = vtkRenderer()
renderer.AddVolume(volume)
renderer.SetBackground(0.1, 0.12, 0.15)
camera = renderer.GetActiveCamera()
camera.SetViewUp(0, -1, 0)  # depth points down
camera.SetPosition(-0.7, -0.5, -1.3)
renderer.ResetCamera()
camera.Zoom(1.5)

window = vtkRenderWindow()
window.SetOffScreenRendering(len(sys.argv) > 2)
window.SetSize(520, 390)
window.AddRenderer(renderer)
interactor = vtkRenderWindowInteractor()
interactor.SetRenderWindow(window)
interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
window.Render()
if len(sys.argv) > 2:
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(sys.argv[2])
    writer.Write()
else:
    interactor.Start()
