# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The plugin in ParaView gives the pixels of the pipeline in VTK, and a saved state gives them again.

    pvpython pipeline.py PLUGIN FOLDER [PACKAGE]     or pvbatch; writes into FOLDER

PLUGIN is the compiled BIGUS.so, or the plugin of the package bigus that needs no VTK, which PYTHONPATH holds then.
PACKAGE is the folder that holds the Python package bigus, built against the distribution's VTK. /usr/bin/python3 renders
with it what is compared. Without it the comparison is skipped with a message.
"""
import inspect
import os
import subprocess
import sys

import numpy as np
from paraview import servermanager
from paraview.simple import Delete, FindSource, GetSources, LoadPlugin, LoadState, SaveData, SaveState
from vtkmodules.util.numpy_support import vtk_to_numpy

IN_VTK = """
import sys
import numpy
import bigus
from vtkmodules.util.numpy_support import vtk_to_numpy

folder = sys.argv[1]
reslice = bigus.vtkBigusReslice()
reslice.SetInputData(bigus.read(folder + "/field.vtp"))
reslice.SetOutputDimensionality(2)
place = numpy.load(folder + "/place.npz")
reslice.SetResliceAxesDirectionCosines(*place["direction"].T.ravel())
reslice.SetResliceAxesOrigin(*place["origin"])
reslice.SetOutputOrigin(0, 0, 0)
reslice.SetOutputSpacing(*place["spacing"])
reslice.SetOutputExtent(*[int(i) for i in place["extent"]])
reslice.Update()
numpy.save(folder + "/vtk.npy", vtk_to_numpy(reslice.GetOutput().GetPointData().GetScalars()))
"""


def pixels(source):
    source.UpdatePipeline()
    image = servermanager.Fetch(source)
    return image, {image.GetPointData().GetArrayName(i): vtk_to_numpy(image.GetPointData().GetArray(i)).copy()
                   for i in range(image.GetPointData().GetNumberOfArrays())}


def provenance(field):
    lines = servermanager.Fetch(field).GetFieldData().GetAbstractArray("Provenance")
    return [lines.GetValue(k) for k in range(lines.GetNumberOfValues())]


def field_array(field, name="Reflectivity"):
    field.UpdatePipeline()
    return vtk_to_numpy(servermanager.Fetch(field).GetPointData().GetArray(name)).copy()


def likeness_to_frames(field, sweep):
    """Mean correlation of what the field shows at every fourth frame of a sweep with that frame."""
    found = []
    for frame in range(0, 17, 4):
        source = BIGUSFieldSlice(Input=field, Sweep=sweep, Frame=frame, HideUnseen=0)
        _, shown = pixels(source)
        found.append(np.corrcoef(shown["Recorded"], shown["Intensity"])[0, 1])
        Delete(source)
    print("likeness to the frames of the second sweep:", np.round(found, 2))
    return np.nanmean(np.nan_to_num(found))


def main(plugin, folder, package=None):
    # ParaView 5.11 imports inspect.getargspec for plugins in Python, which Debian's Python 3.11 no longer has.
    inspect.getargspec = inspect.getfullargspec
    LoadPlugin(plugin, remote=False, ns=globals())
    sweep = BIGUSPhantom(NumberOfFrames=17, FrameSize=[64, 48], PixelSize=0.5)
    trainer = BIGUSTrainer(Input=sweep, Automatic=0, Gaussians=1000, Iterations=60)
    oblique = BIGUSFieldSlice(registrationName="oblique", Input=trainer, Sweep=sweep, Size=[96, 80], PixelSize=0.3)
    oblique.Normal = [0.3, 0.5, 0.8]
    image, arrays = pixels(oblique)
    assert list(image.GetDimensions()) == [96, 80, 1], image.GetDimensions()
    assert {"Intensity", "Coverage", "Distance"} <= set(arrays), sorted(arrays)
    assert arrays["Intensity"].std() > 0.01 and (arrays["Coverage"] > 0).any()
    matrix = image.GetDirectionMatrix()
    direction = np.array([[matrix.GetElement(row, column) for column in range(3)] for row in range(3)])
    normal = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
    assert np.allclose(direction[:, 2], normal, atol=1e-12) and np.isclose(np.linalg.det(direction), 1)
    middle = image.GetOrigin() + direction @ (np.array(image.GetSpacing()) * [95 / 2, 79 / 2, 0])
    assert np.allclose(middle, list(oblique.Origin), atol=1e-9), (middle, oblique.Origin)

    frame = BIGUSFieldSlice(registrationName="frame", Input=trainer, Sweep=sweep, Frame=4)
    _, shown = pixels(frame)
    stack = vtk_to_numpy(servermanager.Fetch(sweep).GetPointData().GetScalars())
    assert np.array_equal(shown["Recorded"], stack[4 * 64 * 48:5 * 64 * 48])
    # A short training is blurred, but its picture is more like its own frame than like any other.
    likeness = [np.corrcoef(recorded, shown["Intensity"])[0, 1] for recorded in stack.reshape(17, -1)]
    assert np.argmax(likeness) == 4, likeness

    for name, source in (("voxels", BIGUSVoxelizer(Input=trainer, MaximumDimension=32)),
                         ("poses", BIGUSPoseCorrection(Input=sweep)), ("outline", BIGUSSweepOutline(Input=sweep)),
                         ("tensors", BIGUSFieldTensors(Input=trainer))):
        source.UpdatePipeline()
        assert servermanager.Fetch(source).GetNumberOfPoints() > 0, name

    # A quarter turn about z and a shift: the slice at the moved plane is the slice of before.
    moved = BIGUSTransformField(Input=trainer)
    moved.Transform.Translate, moved.Transform.Rotate = [10, 20, 30], [0, 0, 90]
    x, y, z = oblique.Origin
    _, turned = pixels(BIGUSFieldSlice(Input=moved, Size=[96, 80], PixelSize=0.3, Normal=[-0.5, 0.3, 0.8], Down=[-1, 0, 0],
                                       Origin=[10 - y, 20 + x, 30 + z]))
    assert np.abs(turned["Intensity"] - arrays["Intensity"]).max() <= 2e-4  # each keeps to a tolerance of 1e-4
    scores = BIGUSImageMetrics(Input=oblique, Truth=oblique)
    scores.UpdatePipeline()
    table = servermanager.Fetch(scores)
    assert table.GetNumberOfRows() == 1 and table.GetColumnByName("SSIM").GetValue(0) > 0.999999

    # A second sweep, across the first, in the same field; without it the field is again the first one's.
    across = BIGUSPhantom(registrationName="across", NumberOfFrames=17, FrameSize=[64, 48], PixelSize=0.5, SweepAngle=90)
    both = BIGUSTrainer(registrationName="both", Input=[sweep, across], Automatic=0, Gaussians=1000, Iterations=60)
    both.UpdatePipeline()
    assert "sequences=2" in provenance(both), provenance(both)
    alone, together = (likeness_to_frames(source, across) for source in (trainer, both))
    assert together > alone + 0.1, (alone, together)  # the middle of the second was all that the first saw of it
    reflectivity = field_array(both)
    both.Input = sweep
    both.UpdatePipeline()
    assert np.array_equal(field_array(both), field_array(trainer)) and "sequences=2" not in provenance(both)
    both.Input = [sweep, across]

    # Another seed is another world, up to the largest one.
    other = BIGUSPhantom(NumberOfFrames=17, FrameSize=[64, 48], PixelSize=0.5, Seed=9007199254740992)
    other.UpdatePipeline()
    assert (vtk_to_numpy(servermanager.Fetch(other).GetPointData().GetScalars()) != stack).mean() > 0.1
    Delete(other)

    # A field grows while the sweep is played, and begins anew when the time goes back.
    if "BIGUSLiveTrainer" in globals():  # a wing
        live = BIGUSLiveTrainer(Input=sweep)
        live.UpdatePipelineInformation()
        times = list(live.TimestepValues)
        assert len(times) == 17 and times == sorted(times), times
        counts = []
        for step in (3, 9, 16, 9):
            live.UpdatePipeline(times[step])
            counts.append(servermanager.Fetch(live).GetNumberOfPoints())
        assert counts[0] == 0 < counts[1] < counts[2] and counts[3] < counts[2], counts  # it begins with the eighth frame
        live.FinishTime = 2
        live.UpdatePipeline(times[16])
        assert "filter=vtkBigusLiveTrainer" in provenance(live)
        Delete(live)

    # A training tells its progress. One that is stopped gives the field so far.
    endless = BIGUSTrainer(Input=sweep, Automatic=0, Gaussians=1000, Iterations=10000000)
    told = []

    def stop_soon(caller, event):
        told.append(caller.GetProgress())
        caller.SetAbortExecute(len(told) >= 20)

    endless.SMProxy.GetClientSideObject().AddObserver("ProgressEvent", stop_soon)
    endless.UpdatePipeline()
    assert 20 <= len(told) < 1000 and told[0] < 0.5, told[:10]
    assert servermanager.Fetch(endless).GetNumberOfPoints() > 0
    Delete(endless)

    SaveData(folder + "/field.vtp", proxy=trainer)
    reader = BIGUSFieldReader(FileName=folder + "/field.vtp")
    _, again = pixels(BIGUSFieldSlice(Input=reader, Size=[96, 80], PixelSize=0.3, Normal=[0.3, 0.5, 0.8],
                                      Origin=list(oblique.Origin)))
    assert np.array_equal(again["Intensity"], arrays["Intensity"]), "a field read again shows other pixels"

    SaveState(folder + "/state.pvsm")
    for source in list(GetSources().values()):
        Delete(source)
    LoadState(folder + "/state.pvsm")
    assert FindSource("oblique") is not None and FindSource("oblique") != oblique
    _, reloaded = pixels(FindSource("oblique"))
    for name in ("Intensity", "Coverage", "Distance"):
        assert np.array_equal(reloaded[name], arrays[name]), name + " differs after a state was loaded"
    assert len(FindSource("both").Input) == 2 and np.array_equal(field_array(FindSource("both")), reflectivity)

    if not package:
        print("skipped: comparison with VTK, because no folder of the package bigus was given")
        return
    np.savez(folder + "/place.npz", direction=direction, origin=image.GetOrigin(), spacing=image.GetSpacing(),
             extent=image.GetExtent())
    subprocess.run(["/usr/bin/python3", "-c", IN_VTK, folder], check=True,
                   env={"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/"), "PYTHONPATH": package})
    error = np.abs(np.load(folder + "/vtk.npy").ravel() - arrays["Intensity"]).max()
    assert error <= 2e-4, error  # each side keeps to a tolerance of 1e-4
    print("largest difference from VTK:", error)


if __name__ == "__main__":
    main(*sys.argv[1:])
    print("passed")
