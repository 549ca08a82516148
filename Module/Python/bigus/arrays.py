# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps and images as numpy arrays, and back, sharing memory."""

from __future__ import annotations

from typing import Optional

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData

from .common import check_sweep


def _pixels(data: vtkImageData) -> np.ndarray:
    """[depth, height, width] view of an image's scalars."""
    scalars = data.GetPointData().GetScalars()
    if scalars is None:
        raise ValueError("the image has no scalars")
    if scalars.GetNumberOfComponents() != 1:
        raise ValueError(f"the image has {scalars.GetNumberOfComponents()} components; one is needed")
    width, height, depth = data.GetDimensions()
    return vtk_to_numpy(scalars).reshape(depth, height, width)


def frames(sweep: vtkImageData) -> np.ndarray:
    """The frames of a sweep: [frames, height, width], a view of the sweep's own pixels."""
    return _pixels(sweep)


def poses(sweep: vtkImageData) -> np.ndarray:
    """ImageToReference of every frame: float64 [frames, 4, 4], a view of the sweep's own array.

    ``poses(sweep)[k] @ (i, j, 0, 1)`` is where pixel column i, row j of frame k lies, mm.
    """
    matrices = sweep.GetFieldData().GetArray("ImageToReference")
    if matrices is None:
        raise ValueError("the image has no ImageToReference array: it is not a tracked sweep")
    if matrices.GetNumberOfComponents() != 16:
        raise ValueError(f"ImageToReference has {matrices.GetNumberOfComponents()} components; 16 are needed")
    return vtk_to_numpy(matrices).reshape(-1, 4, 4)


def image(pixels: np.ndarray) -> vtkImageData:
    """An image of [height, width] or [depth, height, width] pixels, origin 0, spacing 1.

    Shares memory when the array is C-contiguous; float64 and bool become float32 and uint8, which copies.
    """
    pixels = np.asarray(pixels)
    if pixels.ndim not in (2, 3) or 0 in pixels.shape:
        raise ValueError(f"an image has shape (height, width) or (depth, height, width), not {pixels.shape}")
    if pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    elif pixels.dtype == np.bool_:
        pixels = pixels.astype(np.uint8)
    pixels = np.ascontiguousarray(pixels)
    depth, height, width = pixels.shape if pixels.ndim == 3 else (1, *pixels.shape)
    data = vtkImageData()
    data.SetDimensions(width, height, depth)
    scalars = numpy_to_vtk(pixels.reshape(-1))  # keeps a reference to the array
    scalars.SetName("Intensity")
    data.GetPointData().SetScalars(scalars)
    return data


def sweep(
    frames: np.ndarray,
    poses: np.ndarray,
    timestamps: Optional[np.ndarray] = None,
    mask: Optional[np.ndarray] = None,
) -> vtkImageData:
    """A tracked sweep of arrays.

    frames: [frames, height, width], uint8, uint16 (full range is white) or float32 in [0, 1]; memory is shared.
    poses: [frames, 4, 4], ImageToReference, pixel indices to mm.
    timestamps: [frames], seconds.
    mask: [height, width], 0 where the probe never lights a pixel.
    """
    pixels = np.asarray(frames)
    matrices = np.ascontiguousarray(poses, dtype=np.float64)
    check_sweep(pixels, matrices)
    data = image(pixels)

    def attach(name: str, values: np.ndarray, components: int, count: int) -> None:
        if values.size != components * count:
            raise ValueError(f"{name} has {values.size} values; {components * count} are needed")
        array = numpy_to_vtk(values.reshape(count, components))
        array.SetName(name)
        data.GetFieldData().AddArray(array)

    attach("ImageToReference", matrices, 16, len(pixels))
    if timestamps is not None:
        attach("Timestamp", np.ascontiguousarray(timestamps, dtype=np.float64), 1, len(pixels))
    if mask is not None:
        lit = np.ascontiguousarray(np.asarray(mask) != 0, dtype=np.uint8)
        attach("Mask", lit, 1, pixels.shape[1] * pixels.shape[2])
    return data
