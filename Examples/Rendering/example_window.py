# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What the examples share: a window that is shown, or drawn off screen and written to a file."""
import sys

import vtkmodules.vtkRenderingFreeType  # noqa: F401
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkRenderWindowInteractor, vtkWindowToImageFilter


def picture_named(argument):
    """The PNG file that this argument of the command names, or None."""
    return sys.argv[argument] if len(sys.argv) > argument else None


def show(window, interactor, picture):
    """Returns when the user closes the window, or when the picture is written."""
    if not picture:
        interactor.Start()
        return
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetInputConnection(grab.GetOutputPort())
    writer.SetFileName(picture)
    writer.Write()


class ExampleWindow:
    def __init__(self, picture, width, height):
        self.picture, self.window, self.interactor = picture, vtkRenderWindow(), vtkRenderWindowInteractor()
        self.window.SetOffScreenRendering(picture is not None)
        self.window.SetSize(width, height)
        self.interactor.SetRenderWindow(self.window)
        self.interactor.SetInteractorStyle(vtkInteractorStyleTrackballCamera())

    def add(self, renderer, position, zoom):
        """Adds a renderer that sees all it has from a direction, with depth, the field's y, pointing down."""
        renderer.SetBackground(0.1, 0.12, 0.15)
        renderer.GetActiveCamera().SetViewUp(0, -1, 0)
        renderer.GetActiveCamera().SetPosition(position)
        renderer.ResetCamera()
        renderer.GetActiveCamera().Zoom(zoom)
        self.window.AddRenderer(renderer)

    def show(self):
        self.window.Render()
        show(self.window, self.interactor, self.picture)
