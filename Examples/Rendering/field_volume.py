#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field as a cloud, by VTK's volume rendering. The field's own quantiles say what is opaque.

    field_volume.py FIELD [PICTURE.png]
"""
import sys

from example_window import ExampleWindow, picture_named
from vtkmodules.vtkRenderingCore import vtkRenderer

import bigus

volume = bigus.vtkBigusFieldVolume()
volume.SetInputData(bigus.read(sys.argv[1]))

renderer = vtkRenderer()
renderer.AddVolume(volume)
window = ExampleWindow(picture_named(2), 520, 390)
window.add(renderer, (-0.7, -0.5, -1.3), 1.5)
window.show()
