#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Multi-planar reformatting: three views through a cursor that the mouse moves and turns.

    reslice_cursor.py FIELD [PICTURE.png]
"""
import sys

from example_window import ExampleWindow, picture_named
from vtkmodules.vtkInteractionWidgets import vtkResliceCursor, vtkResliceCursorWidget
from vtkmodules.vtkRenderingCore import vtkRenderer

import bigus

field = bigus.read(sys.argv[1])
window = ExampleWindow(picture_named(2), 960, 320)
window.window.SetMultiSamples(0)  # smooth edges take long where software draws

cursor, widgets = vtkResliceCursor(), []
cursor.SetXViewUp(0, -1, 0)  # depth points down, as it does in z from the start
for axis in range(3):
    renderer = vtkRenderer()
    renderer.SetViewport(axis / 3, 0, (axis + 1) / 3, 1)
    window.window.AddRenderer(renderer)
    view = bigus.vtkBigusResliceCursorRepresentation()
    view.SetInputData(field)
    view.PlaceCursor(cursor, axis, 320)
    widget = vtkResliceCursorWidget()
    widget.SetInteractor(window.interactor)
    widget.SetRepresentation(view)
    widget.SetDefaultRenderer(renderer)
    widget.AddObserver("InteractionEvent", lambda *_: window.window.Render())
    widget.On()
    widgets.append(widget)
    renderer.ResetCamera()
    renderer.GetActiveCamera().ParallelProjectionOn()
    renderer.GetActiveCamera().Zoom(1.45)
cursor.GetPlane(0).SetNormal(0.9, 0, 0.4)  # oblique
cursor.GetPlane(2).SetNormal(0, 0, -1)  # seen as frames are, not from behind
window.show()
