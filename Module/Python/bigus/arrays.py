# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps and images as numpy arrays, and back, sharing memory."""

from __future__ import annotations

from typing import Optional

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData


def _pixels(data: vtkImageData) -> np.ndarray:
    """[depth, height, width] view of an image's scalars."""
    scalars = data.GetPointData().GetScalars()
    if scalars is None:
        raise ValueError("the image has no scalars")
    if scalars.GetNumberOfComponents() != 1:
        raise ValueError(f"the image has {scalars.GetNumberOfComponents()} components; one is needed")
    width, height, depth = data.GetDimensions()
    return vtk_to_numpy(scalars).reshape(depth, height, width)


frames = _pixels


def poses(sweep: vtkImageData) -> np.ndarray:
    matrices = sweep.GetFieldData().GetArray("ImageToReference")
    if matrices is None:
        raise ValueError("the image has no ImageToReference array: it is not a tracked sweep")
    if matrices.GetNumberOfComponents() != 16:
        raise ValueError(f"ImageToReference has {matrices.GetNumberOfComponents()} components; 16 are needed")
    return vtk_to_numpy(matrices).reshape(-1, 4, 4)


def image(pixels: np.ndarray) -> vtkImageData:
    """An image of [height, width] or [depth, height, width] pixels, origin 0, spacing 1.

    Shares memory when the array is C-contiguous; float64 and bool become float32 and uint8 (0 and 255), which copies.
    """
    pixels = np.asarray(pixels)
    if pixels.ndim not in (2, 3) or 0 in pixels.shape:
        raise ValueError(f"an image has shape (height, width) or (depth, height, width), not {pixels.shape}")
    if pixels.dtype == np.float64:
        pixels = pixels.astype(np.float32)
    elif pixels.dtype == np.bool_:
        pixels = 255 * pixels.astype(np.uint8)
    pixels = np.ascontiguousarray(pixels)
    depth, height, width = pixels.shape if pixels.ndim == 3 else (1, *pixels.shape)
    data = vtkImageData()
    data.SetDimensions(width, height, depth)
    scalars = numpy_to_vtk(pixels.reshape(-1))  # keeps a reference to the array
    scalars.SetName("Intensity")
    data.GetPointData().SetScalars(scalars)
    return data


def make_sweep(pixels: np.ndarray, poses: np.ndarray, times: Optional[np.ndarray], lit: Optional[np.ndarray]) -> vtkImageData:
    """Of arrays that fit each other."""
    data = image(pixels)
    for name, values in (("ImageToReference", poses.reshape(-1, 16)), ("Timestamp", times), ("Mask", lit)):
        if values is not None:
            array = numpy_to_vtk(values.ravel() if name == "Mask" else values)
            array.SetName(name)
            data.GetFieldData().AddArray(array)
    return data
