# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps and fields as VTK's data, and back: the arrays that the C++ build reads and writes. Needs the package vtk."""

from __future__ import annotations

from typing import Any, Optional, Sequence

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, VTK_UNSIGNED_CHAR, VTK_UNSIGNED_SHORT, vtkPoints, vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkImageData, vtkPolyData

from . import _core
from ._core import Error, Field, Sweep
from .arrays import field as field_of_arrays
from .functions import sweep as sweep_of_arrays


def to_vtk(values: np.ndarray, name: str) -> Any:
    """A named array that shares memory with a contiguous one, [tuples] or [tuples, components]."""
    array = numpy_to_vtk(np.ascontiguousarray(values))
    array.SetName(name)
    return array


def ids_to_vtk(values: Sequence[int], name: str) -> Any:
    """A named array of ids."""
    array = numpy_to_vtkIdTypeArray(np.array(values, dtype=np.int64), deep=True)
    array.SetName(name)
    return array


def points_of(places: np.ndarray) -> vtkPoints:
    """Points [n, 3] of their type."""
    points = vtkPoints()
    points.SetData(to_vtk(places, "Points"))
    return points


def cells_of(numbers: np.ndarray) -> vtkCellArray:
    """Cells [cells, points] of points by their numbers."""
    cells, (count, points) = vtkCellArray(), numbers.shape
    cells.SetData(ids_to_vtk(points * np.arange(count + 1), "Ends"), ids_to_vtk(numbers.ravel(), "Numbers"))
    return cells


def texts_to_vtk(texts: Sequence[str], name: str) -> vtkStringArray:
    array = vtkStringArray()
    array.SetName(name)
    for text in texts:
        array.InsertNextValue(text)
    return array


def add_arrays(data: Any, arrays: dict[str, Any]) -> None:
    """Adds arrays of numbers, and lists of texts, by their names; None is left out."""
    for name, values in arrays.items():
        if values is not None:
            data.AddArray(texts_to_vtk(values, name) if isinstance(values, list) else to_vtk(values, name))


def provenance_of(data: Any) -> list[str]:
    """The lines key=value of field data."""
    lines = data.GetAbstractArray("Provenance")
    if lines is None or not lines.IsA("vtkStringArray"):
        return []
    return [lines.GetValue(k) for k in range(lines.GetNumberOfValues())]


def set_provenance(data: Any, key: str, value: str) -> None:
    """Replaces the line of this key, or adds one; arrays that other data share stay as they are."""
    line, lines = f"{key}={value}", provenance_of(data)
    replaced = [line if old.startswith(key + "=") else old for old in lines]
    data.AddArray(texts_to_vtk(replaced if line in replaced else [*replaced, line], "Provenance"))


def _found(data: Any, owner: str, name: str, components: int, tuples: int, required: bool) -> Optional[np.ndarray]:
    """The numeric array of that name and shape, or Error."""
    found = data.GetAbstractArray(name) if data else None
    if found is None and not required:
        return None
    if found is not None and not found.IsA("vtkDataArray"):
        raise Error(f"{owner}: the array {name} holds {found.GetDataTypeAsString()}; it must be numeric.")
    shape = None if found is None else (found.GetNumberOfComponents(), found.GetNumberOfTuples())
    _core.require_array(owner, name, shape, (components, tuples))
    return vtk_to_numpy(found)


def image_of(pixels: np.ndarray, name: str = "Intensity") -> vtkImageData:
    """An image of [depth, height, width] pixels, origin 0, spacing 1, which shares their memory."""
    depth, height, width = pixels.shape
    image = vtkImageData()
    image.SetDimensions(width, height, depth)
    image.GetPointData().SetScalars(to_vtk(pixels.reshape(-1), name))
    return image


def image_of_sweep(sweep: Sweep) -> vtkImageData:
    """A sweep as an image stack (x, y, frame) with its poses in field data; pixels are copied."""
    image = image_of(np.array(sweep.frames))
    times, mask = sweep.timestamps, sweep.mask
    add_arrays(image.GetFieldData(), {"ImageToReference": np.array(sweep.poses).reshape(-1, 16),
                                      "Timestamp": None if times is None else np.array(times),
                                      "Mask": None if mask is None else np.array(mask).ravel()})  # fmt: skip
    return image


def shifted_to_first_pixel(poses: np.ndarray, extent: Sequence[int], sign: int = 1) -> np.ndarray:
    """Poses [..., 4, 4] whose pixel (0, 0) is the image's first, which is VTK's (x0, y0); back with -1."""
    poses = np.array(poses)
    poses[..., 3] += sign * (extent[0] * poses[..., 0] + extent[2] * poses[..., 1])
    return poses


def place_image(image: vtkImageData, pose: np.ndarray) -> None:
    """Puts an image of one slice where a pose puts its pixels."""
    steps = np.linalg.norm(pose[:3, :2], axis=0)
    direction = np.eye(3)
    direction[:, :2] = pose[:3, :2] / steps
    direction[:, 2] = np.cross(direction[:, 0], direction[:, 1])
    image.SetSpacing(*steps.tolist(), 1.0)
    image.SetOrigin(pose[:3, 3].tolist())
    image.SetDirectionMatrix(direction.ravel().tolist())


SMALLEST_SINE = 1e-5  # nearer to the normal, rounding errors would turn the picture


def axes_across(normal: Any, down: Any = (0.0, 1.0, 0.0)) -> Optional[np.ndarray]:
    """Right-handed unit axes as columns: the third along the normal, the second along `down` brought into the plane."""
    length = np.linalg.norm(normal)
    if not (length > 0 and np.isfinite(length)):
        return None
    z = np.array(normal) / length
    for direction in (np.array(down), np.array([0.0, 0, 1]), np.array([1.0, 0, 0])):
        x = np.cross(direction, z)
        if np.linalg.norm(x) > SMALLEST_SINE * np.linalg.norm(direction):
            x /= np.linalg.norm(x)
            return np.stack([x, np.cross(z, x), z], axis=1)
    return None


def shadow(bounds: Sequence[float], axes: np.ndarray, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From where to where a box reaches along the first two axes, mm from the origin."""
    corners = np.array(np.meshgrid(*np.array(bounds).reshape(3, 2))).reshape(3, -1)
    places = axes[:, :2].T @ (corners - origin[:, None])
    return places.min(axis=1), places.max(axis=1)


def plane_on(axes: np.ndarray, origin: np.ndarray, centre: np.ndarray, size: np.ndarray, pixel: float) -> np.ndarray:
    """From pixel (i, j, 0, 1) to mm of a picture of `size` pixels about `centre`, mm from the origin along the axes."""
    matrix = np.eye(4)
    matrix[:3, :2] = axes[:, :2] * pixel
    matrix[:3, 2] = axes[:, 2]
    matrix[:3, 3] = origin + axes[:, :2] @ (centre - 0.5 * (size - 1) * pixel)
    return matrix


def sweep_of_image(image: vtkImageData) -> tuple[Sweep, np.ndarray]:
    """The sweep of an image stack, and the index of its frames in the stack: those with Status 0 are left out.

    Pixels are unsigned char, unsigned short (65535 is white) or float in [0, 1]; the first and last are not copied while
    no frame is left out. Raises Error naming the array.
    """
    owner = "Sweep"
    if image is None or image.GetNumberOfPoints() == 0:
        raise Error(f"{owner}: the image has no pixels; connect a tracked sequence.")
    scalars = image.GetPointData().GetScalars()
    if scalars is None:
        raise Error(f"{owner}: the image has no active scalars, so there are no pixels.")
    if scalars.GetNumberOfComponents() != 1:
        raise Error(f"{owner}: pixels have {scalars.GetNumberOfComponents()} components; one grey value each is expected. "
                    "Convert colour to grey first.")
    if scalars.GetDataType() not in (VTK_UNSIGNED_CHAR, VTK_UNSIGNED_SHORT, VTK_FLOAT):
        raise Error(f"{owner}: pixels are of type {scalars.GetDataTypeAsString()}; unsigned char, unsigned short, or float in "
                    "[0, 1] are expected. Use vtkImageShiftScale first.")
    width, height, depth = image.GetDimensions()
    data = image.GetFieldData()
    poses = _found(data, owner, "ImageToReference", 16, depth, True).reshape(-1, 4, 4).astype(np.float64)
    poses = shifted_to_first_pixel(poses, image.GetExtent())
    times = _found(data, owner, "Timestamp", 1, depth, False)
    mask = _found(data, owner, "Mask", 1, width * height, False)
    status = _found(data, owner, "Status", 1, depth, False)
    frames = vtk_to_numpy(scalars).reshape(depth, height, width)
    kept = np.arange(depth) if status is None else np.flatnonzero(status)
    if len(kept) == 0:
        raise Error(f"{owner}: all {depth} frames are marked as rejected (Status 0); no frame has a usable pose.")
    if len(kept) < depth:
        frames, poses, times = frames[kept], poses[kept], None if times is None else times[kept]
    return sweep_of_arrays(frames, poses, times, None if mask is None else mask.reshape(height, width)), kept


def poses_of_image(image: vtkImageData, frames: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """ImageToReference of every frame of an image stack, in VTK's indices: those of `frames` are `poses` of the sweep."""
    every = vtk_to_numpy(image.GetFieldData().GetArray("ImageToReference")).astype(np.float64).reshape(-1, 4, 4)
    every[frames] = shifted_to_first_pixel(poses, image.GetExtent(), -1)
    return every


def polydata_of_field(field: Field) -> vtkPolyData:
    """A field as points with their arrays, one vertex each; the arrays are copied."""
    polydata = vtkPolyData()
    polydata.SetPoints(points_of(np.array(field.centers)))
    polydata.SetVerts(cells_of(np.arange(len(field))[:, None]))
    arrays, data = polydata.GetPointData(), polydata.GetFieldData()
    add_arrays(arrays, {"Scale": np.array(field.scales), "Rotation": np.array(field.rotations),
                        "Reflectivity": np.array(field.reflectivities)})  # fmt: skip
    arrays.SetActiveScalars("Reflectivity")
    probe, normals, kept = field.probe_elevation_sigma, np.array(field.trained_normals), field.kept_error
    add_arrays(data, {
        "Gamma": np.array([field.gamma]), "ElevationSigma": np.array([field.elevation_sigma]),
        "ProbeElevationSigma": np.array([probe]) if probe > 0 else None, "TrainedNormals": normals if len(normals) else None,
        "FormatVersion": np.array([_core.format_version], dtype=np.int32), "Provenance": field.provenance or None,
        "StandardError": np.frombuffer(kept, np.uint8) if kept else None})
    if field.view_arrays is not None:
        terms, *others = field.view_arrays
        add_arrays(arrays, {"ViewTerm": terms})
        add_arrays(data, {"ViewVersion": np.array([_core.view_version], np.int32), **dict(zip(VIEW_NUMBERS, others))})
    if field.label_arrays is not None:
        names, values, colors, weights, points = field.label_arrays
        add_arrays(arrays, {"LabelWeight": weights[: len(field)]})
        add_arrays(data, {"LabelNames": names, "LabelValues": values.astype(np.int32), "LabelColors": colors,
                          "LabelPoints": points, "LabelPointWeight": weights[len(field):]})  # fmt: skip
    return polydata


VIEW_NUMBERS = {"ViewMean": 9, "ViewSteps": 3, "ViewPoses": 16}


def _view_arrays(arrays: Any, data: Any, owner: str, count: int) -> Optional[tuple]:
    """What Field.view_arrays is, or None."""
    if arrays.GetAbstractArray("ViewTerm") is None:
        return None
    _core.require_view_version(owner, float(_found(data, owner, "ViewVersion", 1, 1, True)[0]))
    poses = data.GetArray("ViewPoses")
    counts = {"ViewPoses": 1 if poses is None else poses.GetNumberOfTuples()}
    numbers = (_found(data, owner, name, size, counts.get(name, 1), True).reshape(-1, size) for name, size in VIEW_NUMBERS.items())
    return (_found(arrays, owner, "ViewTerm", 3, count, True), *numbers)


def share_label_names(field: Any, image: vtkImageData) -> None:
    """Names, values and colours of a field's labels for an image that shows them."""
    for kind in ("Names", "Values", "Colors"):
        image.GetFieldData().AddArray(field.GetFieldData().GetAbstractArray("Label" + kind))


def _label_arrays(arrays: Any, data: Any, owner: str, count: int) -> Optional[tuple]:
    """What Field.label_arrays is, or None."""
    if arrays.GetAbstractArray("LabelWeight") is None:
        return None
    found = {name: data.GetArray(name) for name in ("LabelValues", "LabelPoints")}
    labels, points = (0 if one is None else one.GetNumberOfTuples() for one in found.values())
    names = data.GetAbstractArray("LabelNames")
    if names is None or not names.IsA("vtkStringArray") or names.GetNumberOfValues() != labels:
        raise Error(f"{owner}: LabelNames must be {labels} strings, one for each of LabelValues.")
    weights = [_found(arrays, owner, "LabelWeight", labels, count, True).reshape(count, labels)]
    if points:
        weights.append(_found(data, owner, "LabelPointWeight", labels, points, True).reshape(points, labels))
    return ([names.GetValue(k) for k in range(labels)], _found(data, owner, "LabelValues", 1, labels, True),
            _found(data, owner, "LabelColors", 3, labels, True), np.concatenate(weights),
            _found(data, owner, "LabelPoints", 4, points, True) if points else np.empty((0, 4)))  # fmt: skip


def field_of_polydata(polydata: vtkPolyData) -> Field:
    """The field of points with arrays of any numeric type, or Error naming the array, the index and the value."""
    owner = "Gaussian field"
    if polydata is None:
        raise Error(f"{owner}: there is no input; connect a field (vtkPolyData).")
    count = polydata.GetNumberOfPoints()
    data, arrays = polydata.GetFieldData(), polydata.GetPointData()

    def number(name: str, required: bool, default: float) -> float:
        found = _found(data, owner, name, 1, 1, required)
        return default if found is None else float(found[0])

    _core.require_format_version(owner, number("FormatVersion", False, _core.format_version))
    empty = Field()
    gamma = number("Gamma", count > 0, empty.gamma)
    sigma = number("ElevationSigma", count > 0, empty.elevation_sigma)
    probe = number("ProbeElevationSigma", False, 0.0)
    normals = data.GetArray("TrainedNormals")
    if normals is not None:
        _core.require_few_normals(owner, normals.GetNumberOfTuples())
        normals = _found(data, owner, "TrainedNormals", 3, normals.GetNumberOfTuples(), True)
    if count == 0:
        scales = rotations = reflectivities = centers = np.empty((0, 3))
        rotations, reflectivities = np.empty((0, 4)), np.empty(0)
    else:
        centers = vtk_to_numpy(polydata.GetPoints().GetData())
        scales = _found(arrays, owner, "Scale", 3, count, True)
        rotations = _found(arrays, owner, "Rotation", 4, count, True)
        reflectivities = _found(arrays, owner, "Reflectivity", 1, count, True)
    field = field_of_arrays(centers, scales, reflectivities, rotations, gamma, sigma, probe, normals)
    field.provenance = provenance_of(data)
    kept = data.GetArray("StandardError")
    if kept is not None:
        field.kept_error = vtk_to_numpy(kept).astype(np.uint8).tobytes()
    field.view_arrays = _view_arrays(arrays, data, owner, count)
    field.label_arrays = _label_arrays(arrays, data, owner, count)
    return field
