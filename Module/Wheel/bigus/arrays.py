# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps and fields of numpy arrays, and their arrays."""

from __future__ import annotations

import copyreg
from typing import TYPE_CHECKING, Optional, Sequence

import numpy as np

from ._core import Field, Sweep, sweep_of_bytes, sweep_of_floats
from .common import check_sweep

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def _doubles(values: object, name: str) -> np.ndarray:
    try:
        return np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} must be numbers: {error}") from None


def sweep(
    frames: ArrayLike,
    poses: ArrayLike,
    timestamps: Optional[ArrayLike] = None,
    mask: Optional[ArrayLike] = None,
    spacing: Optional[Sequence[float]] = None,
) -> Sweep:
    """A tracked sweep of arrays.

    frames: [frames, height, width], uint8, uint16 (65535 is white), bool, or floats in [0, 1]. C-contiguous uint8 and
        float32 are not copied: do not write to them while the sweep is used.
    poses: [frames, 4, 4], ImageToReference: pixel (column i, row j, 0, 1), counted from 0, to mm.
    timestamps: [frames], seconds.
    mask: [height, width], 0 where the probe never lights a pixel.
    spacing: (along i, along j) mm a pixel, for poses that are rigid and count in mm; they are multiplied by it.

    Raises ValueError for shapes that do not fit, TypeError for pixels of another type, and Error, which names the frame
    and the value, for poses and pixels that are not sound.
    """
    pixels, matrices = np.asarray(frames), _doubles(poses, "poses")
    check_sweep(pixels, matrices)
    if pixels.dtype == np.bool_:
        pixels = pixels.astype(np.uint8)
    elif pixels.dtype == np.uint16:
        pixels = pixels.astype(np.float32) / np.float32(65535)
    elif pixels.dtype != np.uint8:
        if pixels.dtype.kind != "f":
            raise TypeError(f"frames are uint8, uint16, bool or floats in [0, 1], not {pixels.dtype}")
        pixels = pixels.astype(np.float32, copy=False)
    if spacing is not None:
        sides = _doubles(spacing, "spacing")
        if sides.shape != (2,) or not (np.isfinite(sides).all() and (sides > 0).all()):
            raise ValueError(f"spacing is two positive numbers, mm along i and j, not {spacing}")
        matrices = matrices @ np.diag([*sides, 1.0, 1.0])
    make = sweep_of_bytes if pixels.dtype == np.uint8 else sweep_of_floats
    lit = None if mask is None else np.ascontiguousarray(np.asarray(mask) != 0, dtype=np.uint8)
    times = None if timestamps is None else _doubles(timestamps, "timestamps")
    return make(np.ascontiguousarray(pixels), np.ascontiguousarray(matrices), times, lit)


def frames(sweep: Sweep) -> np.ndarray:
    """The frames of a sweep: uint8 or float32 [frames, height, width], a view that cannot be written to."""
    return sweep.frames


def poses(sweep: Sweep) -> np.ndarray:
    """ImageToReference of every frame: float64 [frames, 4, 4], a view that cannot be written to.

    ``poses(sweep)[k] @ (i, j, 0, 1)`` is where pixel column i, row j of frame k lies, mm.
    """
    return sweep.poses


def field(
    centers: ArrayLike,
    scales: ArrayLike,
    reflectivities: ArrayLike,
    rotations: Optional[ArrayLike] = None,
    gamma: float = 1.0,
    elevation_sigma: float = 0.0,
    probe_elevation_sigma: float = 0.0,
    trained_normals: Optional[ArrayLike] = None,
) -> Field:
    """A field of arrays, which are copied.

    centers: [n, 3], mm. scales: [n, 3], standard deviations, mm, above 0. reflectivities: [n], signed.
    rotations: [n, 4], quaternions w, x, y, z of any length but 0; by default none is turned.
    gamma: above 0; the image is 1 - exp(-gamma max(S, 0)).
    elevation_sigma, probe_elevation_sigma: mm, at least 0. trained_normals: [k, 3], unit vectors.

    Raises ValueError for shapes that do not fit and Error, which names the array, the index and the value.
    """
    means = _doubles(centers, "centers")
    if rotations is None:
        rotations = np.tile([1.0, 0.0, 0.0, 0.0], (len(means), 1))
    return Field.make(
        means,
        _doubles(scales, "scales"),
        _doubles(rotations, "rotations"),
        _doubles(reflectivities, "reflectivities"),
        float(gamma),
        float(elevation_sigma),
        float(probe_elevation_sigma),
        np.empty((0, 3)) if trained_normals is None else _doubles(trained_normals, "trained_normals"),
    )


# Copies for pickle, by positional arguments of the functions above.
def _field_with_more(more: dict, *arguments: object) -> Field:
    made = field(*arguments)
    for name, value in more.items():
        setattr(made, name, value)
    return made


def _reduce_field(data: Field) -> tuple:
    arrays = (data.centers, data.scales, data.reflectivities, data.rotations)
    sigmas = (data.elevation_sigma, data.probe_elevation_sigma)
    values = (*(np.array(a) for a in arrays), data.gamma, *sigmas, np.array(data.trained_normals))
    more = {name: getattr(data, name) for name in ("provenance", "kept_error", "view_arrays", "label_arrays")}
    return _field_with_more, (more, *values)


def _reduce_sweep(data: Sweep) -> tuple:
    parts = (data.timestamps, data.mask)
    return sweep, (np.array(data.frames), np.array(data.poses), *(None if p is None else np.array(p) for p in parts))


copyreg.pickle(Field, _reduce_field)
copyreg.pickle(Sweep, _reduce_sweep)
