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

try:
    import vtkmodules.vtkInteractionStyle  # noqa: F401  what viewers need to be made
    import vtkmodules.vtkRenderingFreeType  # noqa: F401
    from vtkmodules.vtkInteractionImage import vtkImageViewer2, vtkResliceImageViewer
except ModuleNotFoundError:
    vtkImageViewer2 = None

WIDTH, HEIGHT = 96, 72


def flat_slice():
    """A reslice of one plane, 8 bits."""
    reslice = bigus.vtkBigusReslice()
    reslice.SetInputData(two_blobs())
    reslice.SetResliceAxesOrigin(0, 0, 1.2)
    reslice.SetOutputDimensionality(2)
    reslice.SetOutputOrigin(0, 0, 0)
    reslice.SetOutputSpacing(0.1, 0.1, 1)
    reslice.SetOutputExtent(0, WIDTH - 1, 0, HEIGHT - 1, 0, 0)
    reslice.SetOutputScalarTypeToUnsignedChar()
    return reslice


def pixels_of(window):
    """What a render window shows, [row, column, colour], row 0 at the bottom."""
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    width, height, _ = grab.GetOutput().GetDimensions()
    return vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars()).reshape(height, width, 3).astype(int)


def show_one_to_one(renderer):
    """Parallel projection with one screen pixel for one pixel of the slice."""
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(0.1 * HEIGHT / 2)
    camera.SetFocalPoint(0.05 * (WIDTH - 1), 0.05 * (HEIGHT - 1), 0)
    camera.SetPosition(0.05 * (WIDTH - 1), 0.05 * (HEIGHT - 1), 10)
    renderer.ResetCameraClippingRange()


@unittest.skipUnless(os.environ.get("DISPLAY"), "rendering needs an X server; none is set in DISPLAY")
class TestRendering(unittest.TestCase):
    def test_the_window_shows_the_slice(self):
        reslice = flat_slice()
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
        show_one_to_one(renderer)
        window.Render()
        drawn = pixels_of(window)
        expected = bigus.frames(reslice.GetOutput())[0].astype(int)
        self.assertGreater(expected.max(), 150)  # the blobs are there
        # The display's window and level round to 8 bits once more.
        self.assertLessEqual(np.abs(drawn - expected[:, :, None]).max(), 1)

    def check_viewer(self, viewer, reslice):
        """VTK's own viewer shows the slice, and what it shows follows the plane."""
        viewer.SetOffScreenRendering(True)
        viewer.SetSize(WIDTH, HEIGHT)
        viewer.GetRenderWindow().SetMultiSamples(0)
        viewer.SetColorWindow(255)
        viewer.SetColorLevel(127.5)
        viewer.GetImageActor().InterpolateOff()
        viewer.Render()
        show_one_to_one(viewer.GetRenderer())
        brightest = []
        for z in (1.2, 2.5):
            reslice.SetResliceAxesOrigin(0, 0, z)
            bigus.update(reslice)
            viewer.Render()
            drawn = pixels_of(viewer.GetRenderWindow())
            expected = bigus.frames(reslice.GetOutput())[0].astype(int)
            brightest.append(expected.max())
            self.assertLessEqual(np.abs(drawn - expected[:, :, None]).max(), 1)
        self.assertGreater(brightest[0], 150)
        self.assertNotEqual(brightest[0], brightest[1])

    @unittest.skipIf(vtkImageViewer2 is None, "this VTK has no viewers")
    def test_vtkImageViewer2_shows_the_slice(self):
        reslice = flat_slice()
        viewer = vtkImageViewer2()
        viewer.SetInputConnection(reslice.GetOutputPort())
        self.check_viewer(viewer, reslice)

    @unittest.skipIf(vtkImageViewer2 is None, "this VTK has no viewers")
    def test_vtkResliceImageViewer_shows_the_slice(self):
        reslice = flat_slice()
        bigus.update(reslice)
        viewer = vtkResliceImageViewer()
        viewer.SetInputData(reslice.GetOutput())  # it needs data; SetInputConnection is not for a reslice viewer
        viewer.GetLookupTable().SetValueRange(1, 1)  # white: it shows its table's colour times the windowed grey
        viewer.GetLookupTable().ForceBuild()
        self.check_viewer(viewer, reslice)


if __name__ == "__main__":
    unittest.main()
