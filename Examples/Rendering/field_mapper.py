#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The Gaussians of a field as ellipsoids, beside the sweep's frames and the probe's path.

    field_mapper.py FIELD SWEEP [PICTURE.png]
"""
import sys

from example_window import ExampleWindow, picture_named
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer

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
window = ExampleWindow(picture_named(3), 440, 330)
window.add(renderer, (-0.8, -0.9, -1.1), 1.4)
window.show()
