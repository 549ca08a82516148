#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""VTK's own viewer of images, which asks for one slice of a field; the wheel goes to others, the mouse sets the contrast.

    image_viewer.py FIELD [PICTURE.png]
"""
import sys

from example_window import picture_named, show
from vtkmodules.vtkInteractionImage import vtkImageViewer2
from vtkmodules.vtkRenderingCore import vtkRenderWindowInteractor

import bigus

picture = picture_named(2)
reslice = bigus.vtkBigusReslice()  # unless told otherwise a grid of voxels over the whole field
reslice.SetInputData(bigus.read(sys.argv[1]))
viewer = vtkImageViewer2()
viewer.SetInputConnection(reslice.GetOutputPort())
viewer.SetOffScreenRendering(picture is not None)
viewer.SetSize(480, 400)
interactor = vtkRenderWindowInteractor()
viewer.SetupInteractor(interactor)
viewer.SetColorWindow(1)  # intensities lie in [0, 1]
viewer.SetColorLevel(0.5)
viewer.SetSlice((viewer.GetSliceMin() + viewer.GetSliceMax()) // 2)
viewer.Render()
camera = viewer.GetRenderer().GetActiveCamera()
camera.Azimuth(180)  # depth, the field's y, points down
camera.Roll(180)
camera.Zoom(2.4)
viewer.GetRenderer().ResetCameraClippingRange()
interactor.AddObserver("MouseWheelForwardEvent", lambda *_: viewer.SetSlice(viewer.GetSlice() + 1))
interactor.AddObserver("MouseWheelBackwardEvent", lambda *_: viewer.SetSlice(viewer.GetSlice() - 1))
viewer.Render()
show(viewer.GetRenderWindow(), interactor, picture)
