# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The plugin in pvpython: a phantom, its field and an oblique slice, drawn by ParaView's view.

    pvpython slice.py BIGUS.so PICTURE.png
"""
import sys

from paraview.simple import *

LoadPlugin(sys.argv[1], remote=False, ns=globals())
sweep = BIGUSPhantom(NumberOfFrames=33, FrameSize=[96, 72], PixelSize=0.4)
field = BIGUSTrainer(Input=sweep, Automatic=0, Iterations=200)
field.UpdatePipeline()  # the slice begins in the middle of the field, which must be known
image = BIGUSFieldSlice(Input=field, Normal=[0.6, 0.2, 0.8])
view = CreateRenderView(ViewSize=[400, 400])
view.UseColorPaletteForBackground, view.Background = 0, [0, 0, 0]
shown = Show(image, view)
shown.Ambient = 0.4
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [0.8, -0.4, -1.6], [0, 0, 0], [0, -1, 0]
ResetCamera(view)
SaveScreenshot(sys.argv[2], view, ImageResolution=[400, 400])
