#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A slice of a field in a 3-D window, at its place among the sweep's frames. Up and Down move it along its normal, b
shows the probe's beam, c greys what the sweep never saw.

    show_slice.py FIELD SWEEP [--frame K] [--screenshot PNG]

With --screenshot the picture is drawn off screen and written instead; this still needs an X server (VTK of Debian 12).
"""
import argparse
import os
import sys

import numpy as np
import vtkmodules.vtkInteractionStyle  # noqa: F401  the window's mouse
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkIOImage import vtkPNGWriter
from vtkmodules.vtkRenderingCore import (vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow,
                                         vtkRenderWindowInteractor, vtkWindowToImageFilter)

import bigus


def frame_outlines(poses, width, height):
    """Every frame of the sweep as a closed line."""
    points, lines = vtkPoints(), vtkCellArray()
    for pose in poses:
        lines.InsertNextCell(5)
        corners = [points.InsertNextPoint(*(pose @ (i, j, 0, 1))[:3])
                   for i, j in ((0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1))]
        for corner in corners + corners[:1]:
            lines.InsertCellPoint(corner)
    outlines = vtkPolyData()
    outlines.SetPoints(points)
    outlines.SetLines(lines)
    return outlines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field")
    parser.add_argument("sweep")
    parser.add_argument("--frame", type=int, help="start at this frame's pose; default: the middle one")
    parser.add_argument("--screenshot")
    options = parser.parse_args()
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        sys.exit("show_slice.py: no X server (DISPLAY is not set); without a screen, run it under xvfb-run.")

    sweep = bigus.read(options.sweep)
    count, height, width = bigus.frames(sweep).shape
    poses = bigus.poses(sweep)
    pose = poses[count // 2 if options.frame is None else options.frame].copy()

    # One matrix places both the plane to render and its picture.
    plane = vtkMatrix4x4()
    plane.DeepCopy(pose.ravel())
    picture = bigus.vtkBigusSliceProp()
    picture.SetInputData(bigus.read(options.field))
    picture.SetPlaneToFrame(plane, width, height)

    outlines = vtkPolyDataMapper()
    outlines.SetInputData(frame_outlines(poses, width, height))
    frames = vtkActor()
    frames.SetMapper(outlines)
    frames.GetProperty().SetColor(0.4, 0.5, 0.6)

    renderer = vtkRenderer()
    renderer.AddViewProp(picture)
    renderer.AddActor(frames)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(options.screenshot is not None)
    window.SetWindowName("BIGUS")
    window.SetSize(800, 600)
    window.AddRenderer(renderer)

    # Look at the plane from its front, a little from the side, with depth pointing down.
    middle = (pose @ ((width - 1) / 2, (height - 1) / 2, 0, 1))[:3]
    across, down = (pose[:3, k] / np.linalg.norm(pose[:3, k]) for k in range(2))
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*middle)
    camera.SetPosition(*(middle - np.cross(across, down) - 0.4 * across - 0.2 * down))
    camera.SetViewUp(*-down)
    renderer.ResetCamera()
    camera.Zoom(1.6)

    if options.screenshot:
        window.Render()
        grab = vtkWindowToImageFilter()
        grab.SetInput(window)
        grab.ReadFrontBufferOff()
        writer = vtkPNGWriter()
        writer.SetInputConnection(grab.GetOutputPort())
        writer.SetFileName(options.screenshot)
        writer.Write()
        print(f"{options.screenshot}: {np.mean(bigus.frames(picture.GetReslice().GetOutput())):.3f} mean intensity of the slice")
        return

    def press(interactor, event):
        key = interactor.GetKeySym()
        step = {"Up": 0.5, "Down": -0.5}.get(key, 0)  # mm
        normal = np.cross(across, down)
        for row in range(3):
            plane.SetElement(row, 3, plane.GetElement(row, 3) + step * normal[row])
        if key == "b":
            picture.SetBeamVisibility(not picture.GetBeamVisibility())
        if key == "c":
            picture.SetCoverageVisibility(not picture.GetCoverageVisibility())
        window.Render()

    interactor = vtkRenderWindowInteractor()
    interactor.SetRenderWindow(window)
    interactor.AddObserver("KeyPressEvent", press)
    interactor.Initialize()
    window.Render()
    interactor.Start()


if __name__ == "__main__":
    main()
