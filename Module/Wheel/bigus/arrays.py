# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps and fields of numpy arrays."""

from __future__ import annotations

import copyreg
import operator
from typing import TYPE_CHECKING, Optional

import numpy as np

from ._core import Field, Sweep, sweep_of_bytes, sweep_of_floats
from .common import doubles

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def make_sweep(pixels: np.ndarray, poses: np.ndarray, times: Optional[np.ndarray], lit: Optional[np.ndarray]) -> Sweep:
    """Of contiguous arrays that fit each other."""
    if pixels.dtype == np.uint16:
        pixels = pixels.astype(np.float32) / np.float32(65535)
    return (sweep_of_bytes if pixels.dtype == np.uint8 else sweep_of_floats)(pixels, poses, times, lit)


frames, poses = operator.attrgetter("frames"), operator.attrgetter("poses")  # of a sweep


def field(centers: ArrayLike, scales: ArrayLike, reflectivities: ArrayLike, rotations: Optional[ArrayLike] = None,
          gamma: float = 1.0, elevation_sigma: float = 0.0, probe_elevation_sigma: float = 0.0,
          trained_normals: Optional[ArrayLike] = None) -> Field:
    """A field of arrays, which are copied.

    centers: [n, 3], mm. scales: [n, 3], standard deviations, mm, above 0. reflectivities: [n], signed.
    rotations: [n, 4], quaternions w, x, y, z of any length but 0; by default none is turned.
    gamma: above 0; the image is 1 - exp(-gamma max(S, 0)).
    elevation_sigma, probe_elevation_sigma: mm, at least 0. trained_normals: [k, 3], unit vectors.

    Raises ValueError for shapes that do not fit and Error, which names the array, the index and the value.
    """
    means = doubles(centers, "centers")
    given = {"centers": means, "scales": scales, "reflectivities": reflectivities,
             "rotations": np.tile([1.0, 0.0, 0.0, 0.0], (len(means), 1)) if rotations is None else rotations,
             "trained_normals": np.empty((0, 3)) if trained_normals is None else trained_normals}
    made = Field(len(means), len(given["trained_normals"]))
    for name, values in given.items():
        numbers, own = doubles(values, name), getattr(made, name)
        if numbers.shape != own.shape:
            raise ValueError(f"{name} must be of shape {own.shape}, not {numbers.shape}")
        own[...] = numbers
    made.gamma, made.elevation_sigma, made.probe_elevation_sigma = float(gamma), float(elevation_sigma), float(probe_elevation_sigma)
    made.validate()
    return made


# What pickle keeps: positional arguments of the functions above.
def _field_with_more(more: dict, *arguments: object) -> Field:
    made = field(*arguments)
    for name, value in more.items():
        setattr(made, name, value)
    return made


def _reduce_field(data: Field) -> tuple:
    values = (data.centers, data.scales, data.reflectivities, data.rotations, data.gamma, data.elevation_sigma,
              data.probe_elevation_sigma, data.trained_normals)
    return _field_with_more, ({name: getattr(data, name) for name in ("provenance", "kept_error", "view_arrays", "label_arrays")},
                              *map(np.array, values))


def _reduce_sweep(data: Sweep) -> tuple:
    arrays = (data.frames, data.poses, data.timestamps, data.mask)
    return make_sweep, tuple(None if one is None else np.array(one, order="C") for one in arrays)


copyreg.pickle(Field, _reduce_field)
copyreg.pickle(Sweep, _reduce_sweep)
