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
from paraview.simple import Delete, FindSource, GetColorTransferFunction, GetSources, LoadPlugin, LoadState, OpenDataFile
from paraview.simple import SaveData, SaveState, Sphere, TrivialProducer
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkOutputWindow
from vtkmodules.vtkCommonDataModel import vtkImageData

IN_VTK = """
import sys
import numpy
import bigus
from vtkmodules.util.numpy_support import vtk_to_numpy

folder = sys.argv[1]
for name in sys.argv[2:]:
    field = bigus.read(f"{folder}/{name}.vtp")
    reslice = bigus.vtkBigusReslice()
    reslice.SetInputData(field)
    reslice.SetOutputDimensionality(2)
    reslice.GenerateStandardErrorOutputOn()
    place = numpy.load(f"{folder}/{name}.npz")
    reslice.SetResliceAxesDirectionCosines(*place["direction"].T.ravel())
    reslice.SetResliceAxesOrigin(*place["origin"])
    reslice.SetOutputOrigin(0, 0, 0)
    reslice.SetOutputSpacing(*place["spacing"])
    reslice.SetOutputExtent(*[int(i) for i in place["extent"]])
    reslice.Update()
    found = {key: vtk_to_numpy(reslice.GetOutput(port).GetPointData().GetScalars()).copy()
             for key, port in (("Intensity", 0), ("StandardError", 4))}
    found["nearness"] = reslice.GetViewNearness()
    field.GetPointData().RemoveArray("ViewTerm")
    field.Modified()
    reslice.Update()
    found["plain"] = vtk_to_numpy(reslice.GetOutput().GetPointData().GetScalars())
    numpy.savez(f"{folder}/{name}-vtk.npz", **found)
"""


def pixels(source):
    source.UpdatePipeline()
    image = servermanager.Fetch(source)
    return image, {image.GetPointData().GetArrayName(i): vtk_to_numpy(image.GetPointData().GetArray(i)).copy()
                   for i in range(image.GetPointData().GetNumberOfArrays())}


def place_of(image):
    matrix = image.GetDirectionMatrix()
    direction = np.array([[matrix.GetElement(row, column) for column in range(3)] for row in range(3)])
    return {"direction": direction, "origin": image.GetOrigin(), "spacing": image.GetSpacing(), "extent": image.GetExtent()}


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


def mean_coverage(field):
    """The Gaussians' integrals over the box of their centres, padded by their mean scale."""
    data = servermanager.Fetch(field)
    centres, scales = vtk_to_numpy(data.GetPoints().GetData()), vtk_to_numpy(data.GetPointData().GetArray("Scale"))
    sides = np.ptp(centres.astype(float), axis=0) + 2 * scales.mean(dtype=float)
    return (2 * np.pi) ** 1.5 * scales.prod(axis=1, dtype=float).sum() / sides.prod()


def warnings_while(work):
    """What ParaView's window of messages gets."""
    said, window = [], vtkOutputWindow.GetInstance()

    def listen(caller, event, text):
        said.append(text)

    listen.CallDataType = "string0"
    tag = window.AddObserver("WarningEvent", listen)
    work()
    window.RemoveObserver(tag)
    return " ".join(said)


def frozen(sweep):
    """The sweep with the fifth picture in the three frames behind it, too, as a source."""
    image = vtkImageData()
    image.DeepCopy(servermanager.Fetch(sweep))  # which is the source's own here
    stack = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(17, -1)
    stack[5:8] = stack[4]
    source = TrivialProducer(registrationName="frozen")
    source.GetClientSideObject().SetOutput(image)
    return source


def labelled_by_package(trainer, sweep, pictures, folder):
    """The field with labels of every fourth frame, which the package without VTK gives it."""
    import bigus

    SaveData(folder + "/plain.vtp", proxy=trainer)
    poses = vtk_to_numpy(servermanager.Fetch(sweep).GetFieldData().GetArray("ImageToReference")).reshape(-1, 4, 4)
    field, frames = bigus.read(folder + "/plain.vtp"), bigus.sweep(pictures, poses)
    bigus.write(bigus.label(field, frames, pictures[::4], {7: "rod"}, frames=range(0, 17, 4)), folder + "/labelled.vtp")
    return BIGUSFieldReader(FileName=folder + "/labelled.vtp")


def labels_on_slices(trainer, sweep, folder, is_compiled):
    """A round rod along the sweep, drawn on every fourth frame as 3D Slicer writes it, is round on a frame between, an
    ellipse on an oblique plane, and a tube of so many mm^3."""
    before = list(GetSources().values())
    j, i = np.mgrid[:48, :64]
    pictures = np.zeros((17, 48, 64), np.uint8)
    pictures[::4] = 7 * ((i - 30) ** 2 + (j - 22) ** 2 < 12 ** 2)  # 6 mm
    if not is_compiled:  # nothing reads and fits labels
        return labels_shown(labelled_by_package(trainer, sweep, pictures, folder), sweep, pictures, before)
    header = ("NRRD0004\ntype: unsigned char\ndimension: 3\nsizes: 64 48 17\nkinds: domain domain domain\nencoding: raw\n"
              "Segment0_LabelValue:=7\nSegment0_Layer:=0\nSegment0_Name:=rod\nSegment0_Color:=1 0.8 0.2\n\n")
    with open(folder + "/rod.seg.nrrd", "wb") as file:
        file.write(header.encode() + pictures.tobytes())
    drawn = BIGUSLabelReader(FileName=folder + "/rod.seg.nrrd")
    labelled = BIGUSFieldLabeler(Input=trainer, Sweep=sweep, Labels=drawn)
    SaveData(folder + "/labelled.vtp", proxy=labelled)
    return labels_shown(labelled, sweep, pictures, before)


def labels_shown(labelled, sweep, pictures, before):
    _, between = pixels(BIGUSFieldSlice(Input=labelled, Sweep=sweep, Frame=6, Labels=1))
    truth = pictures[4].ravel()
    assert ((between["Labels"] == 7) != (truth == 7)).mean() < 0.02 and set(np.unique(between["Labels"])) == {0, 7}
    image, oblique = pixels(BIGUSFieldSlice(Input=labelled, Normal=[0.5, 0, 1], Size=[96, 80], PixelSize=0.2, Labels=1))
    assert image.GetFieldData().GetAbstractArray("LabelNames").GetValue(0) == "rod"
    first = vtk_to_numpy(servermanager.Fetch(sweep).GetFieldData().GetArray("ImageToReference")).reshape(-1, 4, 4)
    places = np.array([image.GetPoint(k) for k in range(image.GetNumberOfPoints())])
    middle = first[:, :3] @ [30, 22, 0, 1]
    nearest = np.abs(places[:, None, 2] - middle[:, 2]).argmin(axis=1)  # the hand wanders, and the rod with it
    away = np.linalg.norm((places - middle[nearest])[:, :2], axis=1)
    inside, swept = away < 6, (places[:, 2] > middle[0, 2] + 1) & (places[:, 2] < middle[-1, 2] - 1)
    clear = swept & (np.abs(away - 6) > 1)  # tilted frames and half a millimetre between them blur the border
    assert clear.sum() > 2000 and ((oblique["Labels"] == 7) == inside)[clear].all()
    share = pixels(BIGUSFieldSlice(Input=labelled, Normal=[0.5, 0, 1], Size=[96, 80], PixelSize=0.2, OutputMode=2, LabelValue=7))[1]
    assert ((share["LabelShare"] >= 0.5) != (oblique["Labels"] == 7)).mean() < 1e-3
    volume = servermanager.Fetch(BIGUSVoxelizer(Input=labelled, OutputMode=2, LabelValue=7, MaximumDimension=64))
    voxels = (vtk_to_numpy(volume.GetPointData().GetScalars()) >= 0.5).sum() * np.prod(volume.GetSpacing())
    length = abs(middle[-1, 2] - middle[0, 2])
    print("a rod of", np.pi * 36 * length, "mm^3, and its ends, has voxels of", voxels)
    assert np.pi * 36 * length * 0.9 < voxels < np.pi * 36 * (length + 4) * 1.1
    for source in reversed(list(GetSources().values())):
        if source not in before:
            Delete(source)


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
    hidden = arrays["vtkGhostType"] != 0
    assert np.array_equal(hidden, arrays["Coverage"] <= 0.1 * mean_coverage(trainer)) and 0.05 < hidden.mean() < 0.95
    direction = place_of(image)["direction"]
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

    points = list(GetColorTransferFunction("Intensity").RGBPoints)
    assert points[1:4] == [0, 0, 0] and points[-3:] == [1, 1, 1] and len(points) == 8, points  # grey

    # How far a slice may be off: at a training frame about as far as it is.
    error = pixels(BIGUSFieldSlice(Input=trainer, Sweep=sweep, Frame=4, StandardError=1))[1]["StandardError"]
    known = np.isfinite(error)
    off = (shown["Recorded"] / 255.0 - shown["Intensity"])[known]
    assert known.mean() > 0.5 and error[known].min() >= 0
    predicted, measured = (np.sqrt(np.mean(values ** 2)) for values in (error[known], off))
    print("root mean square of the standard error and of the error:", predicted, measured)
    assert measured / 2 < predicted < 2 * measured
    oblique.StandardError = 1
    image, arrays = pixels(oblique)

    # A picture that stands still is found, and the trainer says so.
    stuck = frozen(sweep)
    inspection = BIGUSSweepInspection(Input=stuck)
    inspection.UpdatePipeline()
    found = servermanager.Fetch(inspection, idx=1)
    kinds = {found.GetColumnByName("Kind").GetValue(row): found.GetColumnByName("Frames").GetValue(row)
             for row in range(found.GetNumberOfRows())}
    assert kinds.get("repeat") == 3, kinds
    warned = BIGUSTrainer(Input=stuck, Automatic=0, Gaussians=100, Iterations=2)
    said = warnings_while(warned.UpdatePipeline)
    for source in (warned, inspection, stuck):  # a saved state could not make it again
        Delete(source)
    assert found.GetColumnByName("Text").GetValue(list(kinds).index("repeat")) in said, said

    # Every pixel of a sweep at its place.
    outline = BIGUSSweepOutline(Input=sweep, FrameStride=4, Pixels=1)
    outline.UpdatePipeline()
    grid = servermanager.Fetch(outline, idx=2)
    assert list(grid.GetExtent()) == [0, 63, 0, 47, 0, 4], grid.GetExtent()
    poses = vtk_to_numpy(servermanager.Fetch(sweep).GetFieldData().GetArray("ImageToReference")).reshape(-1, 4, 4)
    assert np.allclose(grid.GetPoint(64 * 48 + 64 * 3 + 5), (poses[4] @ [5, 3, 0, 1])[:3], atol=1e-5)
    assert np.array_equal(vtk_to_numpy(grid.GetPointData().GetArray("Recorded")), stack.reshape(17, -1)[::4].ravel())

    voxels = BIGUSVoxelizer(Input=trainer, MaximumDimension=32, StandardError=1)
    voxels.UpdatePipeline()
    volume, sigma = (servermanager.Fetch(voxels, idx=port) for port in (0, 1))
    assert sigma.GetDimensions() == volume.GetDimensions()
    known = vtk_to_numpy(sigma.GetPointData().GetArray("StandardError"))
    assert 0 < np.isfinite(known).sum() < known.size and (known[np.isfinite(known)] > 0).all()
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

    labels_on_slices(trainer, sweep, folder, plugin.endswith(".so"))

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

    # Files that hold no ultrasound go to ParaView's own readers.
    for name, header in (("mha", "ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"),
                         ("nrrd", "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n")):
        with open(f"{folder}/ordinary.{name}", "wb") as file:
            file.write(header.encode() + bytes(8))
    ball = Sphere()
    for name in ("vtp", "ply"):
        SaveData(f"{folder}/ordinary.{name}", proxy=ball)
    Delete(ball)
    for name in ("mha", "nrrd", "vtp", "ply"):
        source = OpenDataFile(f"{folder}/ordinary.{name}")
        assert not source.SMProxy.GetXMLName().startswith("BIGUS"), name
        Delete(source)

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
    # A field that knows of directions, at a tilted plane near its frames; the package without VTK does not see them.
    back = BIGUSPhantom(NumberOfFrames=32, FrameSize=[48, 48], PixelSize=0.5, Tilt=8, Passes=2)
    seeing = BIGUSTrainer(Input=back, Automatic=0, Gaussians=1000, Iterations=60, ViewDependence="on")
    SaveData(folder + "/seeing.vtp", proxy=seeing)
    tilted = BIGUSFieldSlice(Input=BIGUSFieldReader(FileName=folder + "/seeing.vtp"), Sweep=back, Frame=7, StandardError=1)
    views = {"field": (image, arrays)}
    if plugin.endswith(".so"):
        views["seeing"] = pixels(tilted)
    for name, (at, _) in views.items():
        np.savez(f"{folder}/{name}.npz", **place_of(at))
    subprocess.run(["/usr/bin/python3", "-c", IN_VTK, folder, *views], check=True,
                   env={"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/"), "PYTHONPATH": package})
    for name, (_, here) in views.items():
        there = np.load(f"{folder}/{name}-vtk.npz")
        error = np.abs(there["Intensity"] - here["Intensity"]).max()
        assert error <= 2e-4, (name, error)  # each side keeps to a tolerance of 1e-4
        known = np.isfinite(here["StandardError"])
        assert np.array_equal(known, np.isfinite(there["StandardError"])), name
        spread = np.abs(there["StandardError"] - here["StandardError"])[known].max(initial=0)
        print(name, "differs from VTK by at most", error, "its standard error by", spread)
        assert spread <= 1e-3, (name, spread)
        if name == "seeing":
            assert there["nearness"] == 1 and np.abs(there["plain"] - here["Intensity"]).max() > 0.01


if __name__ == "__main__":
    main(*sys.argv[1:])
    print("passed")
