#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""How long vtkBigusSliceWidget takes from a motion of the mouse to the picture.

    slice_latency.py [--field FIELD.vtp] [--gaussians 140000] [--pixels 512] [--threads 2] [--events 300]

Events go to the interactor of an off-screen window, as a mouse sends them. Each line has the median and the 95th
percentile over the events, ms: of the whole, of the reslice and of the rest, which is VTK drawing the scene; the share of
pictures that took longer than a thirtieth of a second; the median of the processor time of all threads, which other
programs disturb less; and by how much pixels were larger than those of the exact slice. Without --field a phantom's is
trained for a minute or so. Needs PYTHONPATH=build/python and an X server.
"""
import argparse
import math
import os
import time


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--field")
    parser.add_argument("--gaussians", type=int, default=140000)
    parser.add_argument("--pixels", type=int, default=512)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--events", type=int, default=300)
    options = parser.parse_args()
    # Before TBB and Mesa count processors.
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:options.threads])
    os.environ["LP_NUM_THREADS"] = str(options.threads)
    return options


def field_of(options):
    import bigus

    if options.field:
        return bigus.read(options.field)
    source = bigus.vtkBigusPhantomSource()
    source.SetNumberOfFrames(100)
    bigus.update(source)
    return bigus.train(source.GetOutput(), Automatic=False, Gaussians=options.gaussians, Iterations=60).field


class Scene:
    """A window of 800 x 600 with a slice that fills most of it, seen from the side."""

    def __init__(self, field, pixels):
        import bigus
        import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  what draws
        from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
        from vtkmodules.vtkRenderingUI import vtkGenericRenderWindowInteractor

        self.renderer, self.window = vtkRenderer(), vtkRenderWindow()
        self.window.SetOffScreenRendering(True)
        self.window.SetSize(800, 600)
        self.window.SetMultiSamples(0)  # smoothing of edges, which takes most of the time where software draws
        self.window.AddRenderer(self.renderer)
        self.interactor = vtkGenericRenderWindowInteractor()
        self.interactor.SetRenderWindow(self.window)
        self.interactor.SetInteractorStyle(None)
        self.interactor.Initialize()
        self.widget = bigus.vtkBigusSliceWidget()
        self.widget.SetInteractor(self.interactor)
        self.slice = self.widget.GetSliceRepresentation().GetSliceProp()
        self.slice.SetInputData(field)
        self.slice.PlaceInField(2, pixels)
        self.slice.SetSliceSize(pixels, pixels)
        self.slice.SetSliceOrigin(*(-0.5 * (pixels - 1) * s for s in self.slice.GetSliceSpacing()))
        self.widget.On()
        self.renderer.ResetCamera()
        self.renderer.GetActiveCamera().Elevation(-35)
        self.renderer.GetActiveCamera().Azimuth(20)
        self.renderer.GetActiveCamera().Zoom(1.6)
        self.renderer.ResetCameraClippingRange()
        self.window.Render()

    def send(self, event, place):
        self.interactor.SetEventInformation(*place)
        self.interactor.InvokeEvent(event)

    def at(self, share_x, share_y):
        """A place on the slice, in shares of its half sides, in the window."""
        size, spacing = self.slice.GetSliceSize(), self.slice.GetSliceSpacing()
        point = self.slice.GetPlane().MultiplyPoint((0.5 * share_x * size[0] * spacing[0],
                                                     0.5 * share_y * size[1] * spacing[1], 0, 1))
        self.renderer.SetWorldPoint(*point)
        self.renderer.WorldToDisplay()
        return tuple(round(x) for x in self.renderer.GetDisplayPoint()[:2])

    def drag(self, start, events):
        """Seconds of the whole, of the reslice and of the processor, and the reduction, of every motion."""
        self.send("LeftButtonPressEvent", start)
        found = []
        for k in range(events):
            turn = 2 * math.pi * k / 50
            place = start[0] + round(20 * math.sin(turn)), start[1] + round(15 * math.sin(2 * turn))
            before = time.process_time()
            self.send("MouseMoveEvent", place)
            found.append((self.widget.GetPictureSeconds(), self.widget.GetResliceSeconds(), time.process_time() - before,
                          self.slice.GetReduction()))
        self.send("LeftButtonReleaseEvent", start)
        return found

    def exact(self, events):
        found = []
        plane = self.slice.GetPlane()
        for k in range(events):
            plane.SetElement(2, 3, plane.GetElement(2, 3) + (0.1 if k % 20 < 10 else -0.1))
            start, before = time.perf_counter(), time.process_time()
            self.window.Render()
            found.append((time.perf_counter() - start, self.slice.GetResliceSeconds(), time.process_time() - before, 1))
        return found


def report(name, found):
    import numpy as np

    whole, reslice, processor, reduction = np.array(found[5:]).T  # the first find the size of pixels
    columns = [f"{1e3 * np.percentile(x, q):5.1f}" for x in (whole, reslice, whole - reslice) for q in (50, 95)]
    print(f"| {name} | {columns[0]}, {columns[1]} | {columns[2]}, {columns[3]} | {columns[4]}, {columns[5]} "
          f"| {100 * np.mean(whole > 1 / 30):.0f} % | {1e3 * np.median(processor):.1f} | {np.median(reduction):.2f} |")


def main():
    options = arguments()
    if not os.environ.get("DISPLAY"):
        raise SystemExit("slice_latency.py: no X server (DISPLAY is not set); without a screen, run it under xvfb-run.")
    field = field_of(options)
    scene = Scene(field, options.pixels)
    drawn_by = scene.window.ReportCapabilities().split("OpenGL renderer string:")[1].splitlines()[0].strip()
    print(f"{field.GetNumberOfPoints()} Gaussians, {options.pixels} x {options.pixels}, "
          f"{scene.slice.GetReslice().GetDevice()}, {drawn_by}")
    print("| motion | event to picture, ms | reslice | rest | late | processor | pixels larger |\n|---|---|---|---|---|---|---|")
    report("push", scene.drag(scene.at(0.4, -0.3), options.events))
    report("turn", scene.drag(scene.at(0.95, 0.95), options.events))
    report("exact", scene.exact(max(20, options.events // 4)))


if __name__ == "__main__":
    main()
