# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The half of test_slicer_example.py that runs in a Python with slicer-core.

    slicer_core_scene.py FOLDER               writes plane, line, box and pose as Slicer saves them, for the plane of
                                              FOLDER/plane.npy, and shown.npy: where the example's logic puts a slice.
                                              With the wheel, shown-pixels.npy: the slice of FOLDER/field.vtp
    slicer_core_scene.py FOLDER VOLUME...     reads volumes as Slicer does, and writes VOLUME.npy: their IJKToRAS
"""
import importlib.util
import pathlib
import sys

import numpy as np
import slicer
import vtk

FOLDER = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "Examples" / "Slicer"))
scene = slicer.vtkMRMLScene()


def add(kind):
    node = kind()
    scene.AddNode(node)
    return node


def save(node, kind, name):
    storage = add(kind)
    storage.SetFileName(str(FOLDER / name))
    assert storage.WriteData(node), name


def matrix_of(array):
    matrix = vtk.vtkMatrix4x4()
    matrix.DeepCopy(np.asarray(array).ravel())
    return matrix


def array_of(matrix):
    return np.array([[matrix.GetElement(row, column) for column in range(4)] for row in range(4)])


def write():
    to_world = np.load(FOLDER / "plane.npy")
    plane = add(slicer.vtkMRMLMarkupsPlaneNode)
    plane.SetPlaneType(plane.PlaneTypePointNormal)
    plane.SetSizeMode(plane.SizeModeAbsolute)
    plane.SetSize(20, 12)
    plane.SetOrigin(*to_world[:3, 3])
    plane.SetAxes(*to_world[:3, :3].T)
    save(plane, slicer.vtkMRMLMarkupsPlaneJsonStorageNode, "plane.mrk.json")
    box = add(slicer.vtkMRMLMarkupsROINode)
    box.SetSize(12, 9, 6)
    box.SetAndObserveObjectToNodeMatrix(matrix_of(to_world))
    save(box, slicer.vtkMRMLMarkupsROIJsonStorageNode, "box.mrk.json")
    line = add(slicer.vtkMRMLMarkupsLineNode)
    line.AddControlPoint(1, 2, 3)
    line.AddControlPoint(7, 2, 11)
    save(line, slicer.vtkMRMLMarkupsJsonStorageNode, "line.mrk.json")
    pose = add(slicer.vtkMRMLLinearTransformNode)
    pose.SetMatrixTransformToParent(matrix_of(to_world))
    for ending in ("tfm", "txt", "h5"):
        save(pose, slicer.vtkMRMLTransformStorageNode, f"pose.{ending}")

    import BigusPlane

    # The example as outside Slicer, but with its scene, which is what it would import there.
    BigusPlane.vtk, BigusPlane.slicer = vtk, slicer
    logic = BigusPlane.BigusPlaneLogic()
    volume = add(slicer.vtkMRMLScalarVolumeNode)
    if importlib.util.find_spec("bigus"):
        logic.load(FOLDER / "field.vtp")
        logic.show(plane, volume, 0.5)
        np.save(FOLDER / "shown-pixels.npy", slicer.util.arrayFromVolume(volume)[0])
    logic.render = lambda pose, width, height: np.linspace(0, 1, width * height).reshape(height, width).astype(np.float32)
    logic.show(plane, volume, 0.5)
    assert volume.GetImageData().GetDimensions() == (40, 24, 1)
    assert volume.GetImageData().GetScalarComponentAsDouble(39, 23, 0, 0) == 255
    shown = vtk.vtkMatrix4x4()
    volume.GetIJKToRASMatrix(shown)
    np.save(FOLDER / "shown.npy", array_of(shown))


def read_sequence(name):
    """Images and transforms of a sequence together: where each frame's pixels lie [frames, 4, 4], and their first bytes."""
    images, transforms = add(slicer.vtkMRMLSequenceNode), add(slicer.vtkMRMLSequenceNode)
    for sequence, kind, ending in ((images, slicer.vtkMRMLVolumeSequenceStorageNode, "seq.nrrd"),
                                   (transforms, slicer.vtkMRMLLinearTransformSequenceStorageNode, "igs.mha")):
        storage = add(kind)
        storage.SetFileName(str(FOLDER / f"{name}.{ending}"))
        assert storage.ReadData(sequence), ending
    assert images.GetNumberOfDataNodes() == transforms.GetNumberOfDataNodes()
    places, first = [], []
    for k in range(images.GetNumberOfDataNodes()):
        pixels, above = vtk.vtkMatrix4x4(), vtk.vtkMatrix4x4()
        images.GetNthDataNode(k).GetIJKToRASMatrix(pixels)
        transforms.GetNthDataNode(k).GetMatrixTransformToParent(above)
        places.append(array_of(above) @ array_of(pixels))
        image = images.GetNthDataNode(k).GetImageData()
        first.append([image.GetScalarComponentAsDouble(i, j, 0, 0) for i, j in ((20, 30), (40, 25))])
    np.save(FOLDER / f"{name}.npy", places)
    np.save(FOLDER / f"{name}-pixels.npy", first)


def read(names):
    for name in names:
        if name == "sweep":
            read_sequence(name)
            continue
        volume, storage = add(slicer.vtkMRMLScalarVolumeNode), add(slicer.vtkMRMLVolumeArchetypeStorageNode)
        storage.SetFileName(str(FOLDER / name))
        assert storage.ReadData(volume), name
        matrix = vtk.vtkMatrix4x4()
        volume.GetIJKToRASMatrix(matrix)
        np.save(FOLDER / f"{name}.npy", array_of(matrix))


if __name__ == "__main__":
    write() if len(sys.argv) == 2 else read(sys.argv[2:])
