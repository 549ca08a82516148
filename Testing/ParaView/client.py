# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The window of ParaView, with the plugin: phantom, trainer, the field's ellipsoids, a slice, and a picture of the view.
Then the mouse drags the plane widget, and the slice follows.

    python3 client.py PARAVIEW BIGUS.so FOLDER      needs an X server; writes client.png into FOLDER

It starts PARAVIEW, which runs the script below in its window, moves the X server's pointer, and ends PARAVIEW.
"""
import ctypes
import ctypes.util
import os
import re
import subprocess
import sys
import time

IN_CLIENT = """
import traceback
import numpy
try:
    from paraview.simple import *
    from paraview.vtk.vtkIOImage import vtkPNGReader
    from vtkmodules.util.numpy_support import vtk_to_numpy

    def colours(picture):
        reader = vtkPNGReader()
        reader.SetFileName(picture)
        reader.Update()
        return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).astype(int)

    LoadPlugin({plugin!r}, remote=False, ns=globals())
    view = GetActiveViewOrCreate("RenderView")
    view.UseColorPaletteForBackground, view.Background = 0, [c / 255 for c in {background}]
    sweep = BIGUSPhantom(NumberOfFrames=33, FrameSize=[96, 72], PixelSize=0.4)
    field = BIGUSTrainer(Input=sweep, Automatic=0, Gaussians=3000, Iterations=150)
    field.UpdatePipeline()  # so that the slice begins in the middle of the field
    bounds, normal = field.GetDataInformation().GetBounds(), numpy.array([0.3, 0.5, 0.8]) / numpy.sqrt(0.98)
    Show(BIGUSSweepOutline(Input=sweep, FrameStride=32), view).SetRepresentationType("Wireframe")

    # The field's ellipsoids, those behind the slice.
    tensors = BIGUSFieldTensors(Input=field)
    middle = numpy.reshape(bounds, (3, 2)).mean(axis=1)
    depth = Calculator(Input=tensors, ResultArrayName="Depth")
    depth.Function = "coordsX * %g + coordsY * %g + coordsZ * %g" % tuple(normal)
    behind = Threshold(Input=depth, Scalars=["POINTS", "Depth"], ThresholdMethod="Below Lower Threshold",
                       LowerThreshold=normal @ middle - 1.5)  # mm
    ellipsoids = TensorGlyph(Input=behind, GlyphType="Sphere")
    ellipsoids.Tensors, ellipsoids.Scalars = ["POINTS", "StandardDeviation"], ["POINTS", "Reflectivity"]
    ellipsoids.ExtractEigenvalues, ellipsoids.ColorGlyphs, ellipsoids.ScaleFactor = 1, 1, 1
    ellipsoids.LimitScalingByEigenvalues = 0
    ellipsoids.GlyphType.Radius = 1
    drawn = Show(ellipsoids, view)
    ColorBy(drawn, ("POINTS", "Reflectivity"))
    strength = max(abs(end) for end in field.PointData["Reflectivity"].GetRange())
    signed = GetColorTransferFunction("Reflectivity")
    signed.ApplyPreset("Cool to Warm", True)
    signed.RescaleTransferFunction(-strength, strength)
    drawn.SetScalarBarVisibility(view, False)
    view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [0.9, -0.5, 0.9], [0, 0, 0], [0, -1, 0]
    ResetCamera(view)
    SaveScreenshot({before!r}, view, ImageResolution=[800, 600])

    # The slice. It is the last source made, so that the panel has its properties and the view its plane widget.
    image = BIGUSFieldSlice(Input=field, Sweep=sweep, Normal=normal)
    shown = Show(image, view)
    shown.SetRepresentationType("Surface")
    shown.Ambient, shown.Diffuse = 1, 0  # the slice's own grey
    shown.SetScalarBarVisibility(view, False)
    Render(view)
    SaveScreenshot({picture!r}, view, ImageResolution=[800, 600])

    assert list(image.GetDataInformation().GetExtent()[1::2]) == [511, 511, 0]
    first, last = image.PointData["Intensity"].GetRange()
    assert 0 <= first < last <= 1, (first, last)
    print("slice from", first, "to", last)
    count, kept = (source.GetDataInformation().GetNumberOfPoints() for source in (field, behind))
    assert 0.2 * count < kept < 0.8 * count, (count, kept)
    assert ellipsoids.GetDataInformation().GetNumberOfPoints() % kept == 0
    # What is to be grasped of the widget is red.
    before, after = (int(((c[:, 0] > 180) & (c[:, 1] < 60) & (c[:, 2] < 60)).sum())
                     for c in (colours({before!r}), colours({picture!r})))
    print("red pixels without and with the plane widget:", before, after)
    assert after > before + 200

    # When the plane was dragged, the panel applies it and the view is drawn anew with another slice.
    for source in (ellipsoids, behind, depth):  # the panel would apply what it holds of them, too
        Delete(source)
    GetSettingsProxy("GeneralSettings").AutoApply = 1
    placed = list(image.GetDataInformation().GetBounds())

    def drawn_anew(caller, event):
        global placed
        if placed and not numpy.allclose(image.GetDataInformation().GetBounds(), placed, atol=0.5):  # mm
            placed = None
            print("origin", [round(x, 2) for x in image.Origin], "normal", [round(x, 2) for x in image.Normal])
            print("passed", flush=True)

    view.GetRenderWindow().AddObserver("EndEvent", drawn_anew)
    renderer = view.GetRenderer()
    renderer.SetWorldPoint(*image.Origin, 1)
    renderer.WorldToDisplay()
    print("handle", *(round(x) for x in renderer.GetDisplayPoint()[:2]), *view.GetRenderWindow().GetSize(), flush=True)
except BaseException:
    traceback.print_exc()
    print("failed", flush=True)
"""
BACKGROUND = (82, 87, 110)
SECONDS = 540  # 12 s on a quiet machine, minutes beside much other work


class XImage(ctypes.Structure):
    """The beginning of Xlib's structure."""
    _fields_ = [(name, ctypes.c_int) for name in ("width", "height", "xoffset", "format")] + [("data", ctypes.c_void_p)]


class Pointer:
    """The X server's pointer and screen, by its libraries Xlib and XTest."""

    def __init__(self):
        self.x, self.test = (ctypes.CDLL(ctypes.util.find_library(name) or name + ".so") for name in ("X11", "Xtst"))
        self.x.XOpenDisplay.restype = ctypes.c_void_p
        self.x.XDefaultRootWindow.restype = ctypes.c_ulong
        self.x.XGetImage.restype = ctypes.POINTER(XImage)
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(None))

    def find(self, colour, width):
        """(x, y) on the screen where a row of that many pixels begins and ends with a colour (red, green, blue)."""
        window = ctypes.c_ulong(self.x.XDefaultRootWindow(self.display))
        columns, rows = (getattr(self.x, f)(self.display, 0) for f in ("XDisplayWidth", "XDisplayHeight"))
        every, z_pixmap = ctypes.c_ulong(2**64 - 1), 2
        image = self.x.XGetImage(self.display, window, 0, 0, columns, rows, every, z_pixmap)
        pixels = ctypes.string_at(image.contents.data, 4 * columns * rows)
        is_found = [pixels[k:k + 3] == bytes(colour[::-1]) for k in range(0, len(pixels), 4)]
        for first in range(len(is_found) - width):
            if is_found[first] and is_found[first + width - 1]:
                return first % columns, first // columns
        return None

    def _wait(self):
        self.x.XFlush(self.display)
        time.sleep(0.3)  # so long that the client sees each step for itself

    def drag(self, x, y, dx, dy, steps=5):
        self.test.XTestFakeMotionEvent(self.display, -1, x - 3, y, 0)
        self._wait()
        self.test.XTestFakeMotionEvent(self.display, -1, x, y, 0)
        self._wait()
        self.test.XTestFakeButtonEvent(self.display, 1, 1, 0)
        self._wait()
        for k in range(1, steps + 1):
            self.test.XTestFakeMotionEvent(self.display, -1, x + k * dx // steps, y + k * dy // steps, 0)
            self._wait()
        self.test.XTestFakeButtonEvent(self.display, 1, 0, 0)
        self._wait()


def main(client, plugin, folder):
    if not os.environ.get("DISPLAY"):
        print("skipped: no X server (DISPLAY is not set)")
        return 0
    before, picture = (os.path.join(folder, name) for name in ("before.png", "client.png"))
    script, log = os.path.join(folder, "client-script.py"), os.path.join(folder, "client.log")
    if os.path.exists(picture):
        os.remove(picture)
    with open(script, "w", encoding="utf-8") as file:
        file.write(IN_CLIENT.format(background=BACKGROUND, plugin=plugin, before=before, picture=picture))
    settings = os.path.join(folder, "ParaView")
    os.makedirs(settings, exist_ok=True)
    with open(os.path.join(settings, "ParaView5.11.0.ini"), "w", encoding="utf-8") as file:
        file.write("[General]\nGeneralSettings.ShowWelcomeDialog=false\n")  # it would take the mouse's clicks
    # A user's own settings must not matter.
    environment = dict(os.environ, HOME=folder, XDG_CONFIG_HOME=folder, PYTHONUNBUFFERED="1")
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen([client, "--script=" + script], stdout=output, stderr=subprocess.STDOUT,
                                   env=environment)
    said, is_dragged, pointer = "", False, None
    try:
        pointer = Pointer()
    except OSError as error:
        print(f"nothing will be dragged, because the X server's pointer cannot be moved: {error}")
    try:
        end = time.time() + SECONDS
        while time.time() < end and process.poll() is None and "passed\n" not in said and "failed\n" not in said:
            time.sleep(0.5)
            with open(log, encoding="utf-8", errors="replace") as file:
                said = file.read()
            handle = re.search(r"^handle (\d+) (\d+) (\d+) (\d+)$", said, re.MULTILINE)
            if handle and pointer is None:
                said += "passed\n"  # as far as can be tried without a pointer
            elif handle and not is_dragged:
                i, j, width, height = (int(n) for n in handle.groups())
                corner = pointer.find(BACKGROUND, width)  # the view's upper left one, once the window is drawn
                if corner:
                    pointer.drag(corner[0] + i - 50, corner[1] + height - 1 - j, -40, 60)  # beside the handle: the plane
                    is_dragged = True
    finally:
        process.kill()
        process.wait()
    print(said)
    if "passed\n" not in said or not os.path.getsize(picture):
        print("failed: the client did not come to its end")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
