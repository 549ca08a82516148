#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A slice that mouse and keys move, in the box that it covered at first.

    slice_widget.py FIELD [PICTURE.png]
"""
import sys

from example_window import ExampleWindow, picture_named
from vtkmodules.vtkFiltersModeling import vtkOutlineFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

import bigus

outline = vtkOutlineFilter()
outline.SetInputData(bigus.read(sys.argv[1]))
mapper = vtkPolyDataMapper()
mapper.SetInputConnection(outline.GetOutputPort())
box = vtkActor()
box.SetMapper(mapper)
renderer = vtkRenderer()
renderer.AddActor(box)
window = ExampleWindow(picture_named(2), 640, 480)
window.add(renderer, (-1.2, -0.6, 1), 1.1)

widget = bigus.vtkBigusSliceWidget()
widget.SetInteractor(window.interactor)
moved = widget.GetSliceRepresentation()
moved.GetSliceProp().SetInputData(outline.GetInput())
moved.GetSliceProp().PlaceInField(2, 512)
moved.Rotate((0, 1, 0), 12)  # degrees about the field's y
widget.On()
window.show()
