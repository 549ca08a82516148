#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A slice that mouse and keys move, in the box that it covered at first.

    slice_widget.py FIELD [PICTURE.png]
"""
import sys

import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkFiltersModeling import vtkOutlineFilter
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow,
                                         vtkRenderWindowInteractor, vtkWindowToImageFilter)

import bigus

outline = vtkOutlineFilter()
outline.SetInputData(bigus.read(sys.argv[1]))
mapper = vtkPolyDataMapper()
mapper.SetInputConnection(outline.GetOutputPort())
box = vtkActor()
box.SetMapper(mapper)
renderer = vtkRenderer()
renderer.AddActor(box)
renderer.SetBackground(0.1, 0.12, 0.15)
camera = renderer.GetActiveCamera()
camera.SetViewUp(0, -1, 0)  # depth points down
camera.SetPosition(-1.2, -0.6, 1)
renderer.ResetCamera()
camera.Zoom(1.1)

window = vtkRenderWindow()
window.SetOffScreenRendering(len(sys.argv) > 2)
window.SetSize(640, 480)
window.AddRenderer(renderer)
interactor = vtkRenderWindowInteractor()
interactor.SetRenderWindow(window)
interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())

widget = bigus.vtkBigusSliceWidget()
widget.SetInteractor(interactor)
moved = widget.GetSliceRepresentation()
moved.GetSliceProp().SetInputData(outline.GetInput())
moved.GetSliceProp().PlaceInField(2, 512)
moved.Rotate((0, 1, 0), 12)  # degrees about the field's y
widget.On()
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
