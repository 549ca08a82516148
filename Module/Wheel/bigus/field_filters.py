# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Pipeline filters in pure Python that take fields and give fields, as the C++ classes do."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _core
from .algorithm import Algorithm, Choice, parts, properties, transform_matrix
from .vtkdata import field_of_polydata, ids_to_vtk, polydata_of_field, set_provenance, to_vtk

__all__ = ["vtkBigusFieldTensors", "vtkBigusPartitionField", "vtkBigusTransformField"]


def _axes_of(field: Any) -> np.ndarray:
    """The rotation matrix of every Gaussian, [n, 3, 3]: its columns are the Gaussian's axes."""
    w, x, y, z = (field.rotations / np.linalg.norm(field.rotations, axis=1, keepdims=True)).T
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)


@parts("Transform")
class vtkBigusTransformField(Algorithm):
    """Moves, turns, mirrors and scales a field: points, scales, rotations and the beam's thickness together.

    Transform is linear and stretches alike in all directions; None changes nothing. Changes to it are followed.
    """

    _inputs = _outputs = ("vtkPolyData",)

    def _fill(self, data: list, outputs: list) -> None:
        field = field_of_polydata(data[0][0])
        matrix = transform_matrix(self.GetTransform(), "Transform", "space")
        outputs[0].ShallowCopy(polydata_of_field(field if matrix is None else field.transformed(matrix)))
        if matrix is not None:
            key = "transform="
            before = [line[len(key):] for line in field.provenance if line.startswith(key)]
            text = _core.transform_text(before[0] if before else "", matrix)
            set_provenance(outputs[0].GetFieldData(), "transform", text)


@properties(Tensor=Choice(0, ("StandardDeviation", "Covariance")))
class vtkBigusFieldTensors(Algorithm):
    """Gives a field the tensors that VTK's glyph filters ask for: R diag(s) R^T, or the covariance R diag(s^2) R^T."""

    StandardDeviation, Covariance = range(2)

    _inputs = _outputs = ("vtkPolyData",)

    def _fill(self, data: list, outputs: list) -> None:
        field = field_of_polydata(data[0][0])
        axes, lengths = _axes_of(field), field.scales ** (1 + self._values["Tensor"])
        tensors = np.einsum("nik,nk,njk->nij", axes, lengths, axes)
        outputs[0].ShallowCopy(data[0][0])
        outputs[0].GetPointData().SetTensors(to_vtk(tensors.reshape(-1, 9), self.GetTensorAsString()))


@properties(NumberOfChunks=16, NumberOfPieces=1, Piece=0)
class vtkBigusPartitionField(Algorithm):
    """One process's part of a field, as the C++ class makes it."""

    _inputs = _outputs = ("vtkPolyData",)

    def _fill(self, data: list, outputs: list) -> None:
        total, piece, pieces = (self._values[name] for name in ("NumberOfChunks", "Piece", "NumberOfPieces"))
        part, first, sizes = field_of_polydata(data[0][0]).part(total, piece, pieces)
        outputs[0].ShallowCopy(polydata_of_field(part))
        outputs[0].GetFieldData().AddArray(ids_to_vtk([total, first, *sizes], "Chunks"))
