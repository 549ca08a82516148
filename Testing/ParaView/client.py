# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The window of ParaView, with the plugin: phantom, trainer, the field's ellipsoids, a slice, and a picture of the view.

    python3 client.py PARAVIEW BIGUS.so FOLDER      needs an X server; writes client.png into FOLDER

It starts PARAVIEW, which runs the script below in its window, and ends it when the picture is there.
"""
import os
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
    view.UseColorPaletteForBackground, view.Background = 0, [0.32, 0.34, 0.43]
    sweep = BIGUSPhantom(NumberOfFrames=33, FrameSize=[96, 72], PixelSize=0.4)
    field = BIGUSTrainer(Input=sweep, Automatic=0, Gaussians=3000, Iterations=150)
    field.UpdatePipeline()  # so that the slice begins in the middle of the field
    bounds, normal = field.GetDataInformation().GetBounds(), numpy.array([0.3, 0.5, 0.8]) / numpy.sqrt(0.98)
    Show(BIGUSSweepOutline(Input=sweep, FrameStride=32), view).SetRepresentationType("Wireframe")

    # The field's ellipsoids, those behind the slice.
    tensors = BIGUSFieldTensors(Input=field)
    behind = Clip(Input=tensors, ClipType="Plane", Invert=1)
    behind.ClipType.Origin = numpy.reshape(bounds, (3, 2)).mean(axis=1) - 1.5 * normal  # mm
    behind.ClipType.Normal = normal
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
    image = BIGUSFieldSlice(Input=field, Sweep=sweep, Normal=normal, CoverageThreshold=0.1)
    shown = Show(image, view)
    shown.SetRepresentationType("Surface")
    shown.Ambient, shown.Diffuse = 1, 0  # the slice's own grey
    ColorBy(shown, ("POINTS", "Intensity"))
    GetColorTransferFunction("Intensity").ApplyPreset("Grayscale", True)
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
    print("passed", flush=True)
except BaseException:
    traceback.print_exc()
    print("failed", flush=True)
"""
SECONDS = 240  # a client takes 20 s to come up on a quiet machine


def main(client, plugin, folder):
    if not os.environ.get("DISPLAY"):
        print("skipped: no X server (DISPLAY is not set)")
        return 0
    before, picture = (os.path.join(folder, name) for name in ("before.png", "client.png"))
    script, log = os.path.join(folder, "client-script.py"), os.path.join(folder, "client.log")
    if os.path.exists(picture):
        os.remove(picture)
    with open(script, "w", encoding="utf-8") as file:
        file.write(IN_CLIENT.format(plugin=plugin, before=before, picture=picture))
    # Settings of a user, such as a window that greets or plugins, must not matter.
    environment = dict(os.environ, HOME=folder, XDG_CONFIG_HOME=folder, PYTHONUNBUFFERED="1")
    with open(log, "w", encoding="utf-8") as output:
        process = subprocess.Popen([client, "--script=" + script], stdout=output, stderr=subprocess.STDOUT,
                                   env=environment)
    said = ""
    try:
        end = time.time() + SECONDS
        while time.time() < end and process.poll() is None and "passed\n" not in said and "failed\n" not in said:
            time.sleep(0.5)
            with open(log, encoding="utf-8", errors="replace") as file:
                said = file.read()
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
