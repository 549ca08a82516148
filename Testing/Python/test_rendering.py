# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A slice in a render window: what VTK draws is what vtkBigusReslice gave, pixel for pixel."""

import os
import unittest

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkRenderingCore import (vtkImageSlice, vtkImageSliceMapper, vtkRenderer, vtkRenderWindow,
                                         vtkWindowToImageFilter)

import bigus
from test_bigus import two_blobs

WIDTH, HEIGHT = 96, 72


@unittest.skipUnless(os.environ.get("DISPLAY"), "rendering needs an X server; none is set in DISPLAY")
class TestRendering(unittest.TestCase):
    def test_the_window_shows_the_slice(self):
        reslice = bigus.vtkBigusReslice()
        reslice.SetInputData(two_blobs())
        reslice.SetResliceAxesOrigin(0, 0, 1.2)
        reslice.SetOutputDimensionality(2)
        reslice.SetOutputOrigin(0, 0, 0)
        reslice.SetOutputSpacing(0.1, 0.1, 1)
        reslice.SetOutputExtent(0, WIDTH - 1, 0, HEIGHT - 1, 0, 0)
        reslice.SetOutputScalarTypeToUnsignedChar()

        mapper = vtkImageSliceMapper()
        mapper.SetInputConnection(reslice.GetOutputPort())
        picture = vtkImageSlice()
        picture.SetMapper(mapper)
        picture.GetProperty().SetColorWindow(255)
        picture.GetProperty().SetColorLevel(127.5)
        picture.GetProperty().SetInterpolationTypeToNearest()
        renderer = vtkRenderer()
        renderer.AddViewProp(picture)
        window = vtkRenderWindow()
        window.SetOffScreenRendering(True)
        window.SetSize(WIDTH, HEIGHT)
        window.SetMultiSamples(0)
        window.AddRenderer(renderer)
        # Parallel projection with one screen pixel for one pixel of the slice.
        camera = renderer.GetActiveCamera()
        camera.ParallelProjectionOn()
        camera.SetParallelScale(0.1 * HEIGHT / 2)
        camera.SetFocalPoint(0.05 * (WIDTH - 1), 0.05 * (HEIGHT - 1), 0)
        camera.SetPosition(0.05 * (WIDTH - 1), 0.05 * (HEIGHT - 1), 10)
        window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.ReadFrontBufferOff()
        grab.Update()

        drawn = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(HEIGHT, WIDTH, 3).astype(int)
        expected = bigus.frames(reslice.GetOutput())[0].astype(int)
        self.assertGreater(expected.max(), 150)  # the blobs are there
        # The display's window and level round to 8 bits once more.
        self.assertLessEqual(np.abs(drawn - expected[:, :, None]).max(), 1)


if __name__ == "__main__":
    unittest.main()
