#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures a second of a field's ellipsoids and of its cloud while the camera turns, and seconds of a still picture; and of
three views while a reslice cursor moves.

    scene_rates.py --field FIELD.vtp [--threads 2] [--pictures 60] [--rate 15]

In a window of 800 x 600 off screen (960 x 320 for the views). While the camera turns the window wants --rate pictures a second, as an interactor
asks for; a still picture has all ellipsoids and the finest steps. Each line has the median and the 95th percentile, ms.
Needs PYTHONPATH=build/python and an X server.
"""
import argparse
import os
import time


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--field", required=True)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--pictures", type=int, default=60)
    parser.add_argument("--rate", type=float, default=15)
    options = parser.parse_args()
    # Before TBB and Mesa count processors.
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:options.threads])
    os.environ["LP_NUM_THREADS"] = str(options.threads)
    return options


def scene(prop):
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
    from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow

    renderer, window = vtkRenderer(), vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetSize(800, 600)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    renderer.AddViewProp(prop)
    renderer.GetActiveCamera().SetViewUp(0, -1, 0)
    renderer.GetActiveCamera().SetPosition(-1, -0.7, -1.3)
    renderer.ResetCamera()
    renderer.GetActiveCamera().Zoom(1.4)
    return renderer, window


def pictures(renderer, window, rate, count):
    """Seconds of each picture while the camera turns by a degree each."""
    window.SetDesiredUpdateRate(rate)
    found = []
    for _ in range(count):
        renderer.GetActiveCamera().Azimuth(1)
        renderer.ResetCameraClippingRange()
        start = time.perf_counter()
        window.Render()
        window.WaitForCompletion()
        found.append(time.perf_counter() - start)
    return found


def moved_cursor(field, count):
    """Seconds of each picture of three views, 320 pixels along the longest side, while their cursor moves."""
    import bigus
    import vtkmodules.vtkRenderingFreeType  # noqa: F401  the widget's text
    from vtkmodules.vtkInteractionWidgets import vtkResliceCursor, vtkResliceCursorWidget
    from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
    from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

    window, interactor, cursor, widgets = (vtkRenderWindow(), vtkGenericRenderWindowInteractor(), vtkResliceCursor(), [])
    window.SetOffScreenRendering(True)
    window.SetSize(960, 320)
    window.SetMultiSamples(0)
    interactor.SetRenderWindow(window)
    for axis in range(3):
        renderer, widget = vtkRenderer(), vtkResliceCursorWidget()
        renderer.SetViewport(axis / 3, 0, (axis + 1) / 3, 1)
        window.AddRenderer(renderer)
        view = bigus.vtkBigusResliceCursorRepresentation()
        view.SetInputData(field)
        view.PlaceCursor(cursor, axis, 320)
        widget.SetInteractor(interactor)
        widget.SetRepresentation(view)
        widget.SetDefaultRenderer(renderer)
        widget.On()
        renderer.ResetCamera()
        renderer.GetActiveCamera().ParallelProjectionOn()
        renderer.GetActiveCamera().Zoom(1.45)
        widgets.append(widget)
    found = []
    for k in range(count + 3):
        centre = list(cursor.GetCenter())
        centre[k % 3] += 0.1  # mm
        cursor.SetCenter(centre)
        start = time.perf_counter()
        window.Render()
        window.WaitForCompletion()
        found.append(time.perf_counter() - start)
    for widget in widgets:
        widget.Off()
    return found[3:]


def report(name, found, drawn):
    import numpy as np

    median, high = 1e3 * np.percentile(found, 50), 1e3 * np.percentile(found, 95)
    print(f"| {name} | {median:.0f}, {high:.0f} | {1e3 / median:.1f} | {drawn} |")


def main():
    options = arguments()
    if not os.environ.get("DISPLAY"):
        raise SystemExit("scene_rates.py: no X server (DISPLAY is not set); without a screen, run it under xvfb-run.")
    import bigus
    from vtkmodules.vtkRenderingCore import vtkActor

    field = bigus.read(options.field)
    mapper = bigus.vtkBigusFieldMapper()
    mapper.SetInputData(field)
    ellipsoids = vtkActor()
    ellipsoids.SetMapper(mapper)
    volume = bigus.vtkBigusFieldVolume()
    volume.SetInputData(field)

    print(f"{field.GetNumberOfPoints()} Gaussians, {options.threads} threads, {options.rate:g} pictures a second wanted")
    print("| scene | a picture, ms | pictures a second | drawn |\n|---|---|---|---|")
    for name, prop in (("ellipsoids", ellipsoids), ("cloud", volume)):
        renderer, window = scene(prop)
        window.Render()
        pictures(renderer, window, options.rate, 15)  # these find the speed
        found = pictures(renderer, window, options.rate, options.pictures)
        drawn = f"{mapper.GetNumberOfEllipsoidsDrawn()} ellipsoids, {mapper.GetNumberOfPointsDrawn()} points"
        report(f"{name}, turning", found, drawn if prop is ellipsoids else "")
        still = pictures(renderer, window, 1e-4, 4)
        drawn = f"{mapper.GetNumberOfEllipsoidsDrawn()} ellipsoids, {mapper.GetNumberOfPointsDrawn()} points"
        report(f"{name}, still", still[1:], drawn if prop is ellipsoids else "")
        renderer.RemoveViewProp(prop)
        window.Finalize()
    report("three views, cursor moving", moved_cursor(field, options.pictures), "")


if __name__ == "__main__":
    main()
