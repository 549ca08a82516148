# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Pipeline filters in pure Python that take fields and give fields, as the C++ classes do."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkDataObject
from vtkmodules.vtkCommonTransforms import vtkAbstractTransform, vtkHomogeneousTransform

from . import _core
from .algorithm import NO_ERROR, Algorithm, Clamped, matrix_of, properties
from .arrays import field as field_of_arrays
from .vtkdata import field_of_polydata, ids_to_vtk, polydata_of_field, to_vtk

__all__ = ["vtkBigusFieldTensors", "vtkBigusPartitionField", "vtkBigusTransformField"]

BLOCK = 256  # consecutive Gaussians, which stay together
MOST_CHUNKS = 4096


def axes_of(field: Any) -> np.ndarray:
    """The rotation matrix of every Gaussian, [n, 3, 3]: its columns are the Gaussian's axes."""
    w, x, y, z = (field.rotations / np.linalg.norm(field.rotations, axis=1, keepdims=True)).T
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)


class vtkBigusTransformField(Algorithm):
    """Moves, turns, mirrors and scales a field: points, scales, rotations and the beam's thickness together."""

    def __init__(self) -> None:
        super().__init__(("vtkPolyData",), ("vtkPolyData",))

    def SetTransform(self, transform: Optional[vtkAbstractTransform]) -> None:
        """A linear transform that stretches alike in all directions; None changes nothing. Changes to it are followed."""
        self._set_part("Transform", transform)

    def GetTransform(self) -> Optional[vtkAbstractTransform]:
        return self._parts.get("Transform")

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        output = vtkDataObject.GetData(outputs, 0)
        output.Initialize()
        self._error_code = NO_ERROR
        try:
            field = field_of_polydata(vtkDataObject.GetData(inputs[0], 0))
            transform = self.GetTransform()
            if transform is not None:
                if not isinstance(transform, vtkHomogeneousTransform):
                    raise _core.Error(f"Transform is a {transform.GetClassName()}, which may bend space; give a linear "
                                      "transform, for example a vtkTransform.")
                transform.Update()
                field = self._moved(field, matrix_of(transform.GetMatrix()))
            output.ShallowCopy(polydata_of_field(field))
        except Exception as error:
            return self._fail(error)
        return 1

    @staticmethod
    def _moved(field: Any, matrix: np.ndarray) -> Any:
        key = "transform="
        before = [line[len(key):] for line in field.provenance if line.startswith(key)]
        text = "; then ".join([*before, " ".join(f"{element:.17g}" for element in matrix.ravel())])
        moved = field.transformed(matrix)
        lines = [key + text if line.startswith(key) else line for line in field.provenance]
        moved.provenance = lines if before else [*lines, key + text]
        return moved


@properties(Tensor=Clamped(0, 0, 1))
class vtkBigusFieldTensors(Algorithm):
    """Gives a field the tensors that VTK's glyph filters ask for: R diag(s) R^T, or the covariance R diag(s^2) R^T."""

    StandardDeviation, Covariance = range(2)

    def __init__(self) -> None:
        super().__init__(("vtkPolyData",), ("vtkPolyData",))

    def SetTensorToStandardDeviation(self) -> None:
        self.SetTensor(self.StandardDeviation)

    def SetTensorToCovariance(self) -> None:
        self.SetTensor(self.Covariance)

    def GetTensorAsString(self) -> str:
        return ("StandardDeviation", "Covariance")[self._values["Tensor"]]

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        output = vtkDataObject.GetData(outputs, 0)
        output.Initialize()
        self._error_code = NO_ERROR
        try:
            polydata = vtkDataObject.GetData(inputs[0], 0)
            field = field_of_polydata(polydata)
            axes, lengths = axes_of(field), np.array(field.scales)
            lengths = lengths**2 if self._values["Tensor"] == self.Covariance else lengths
            tensors = np.einsum("nik,nk,njk->nij", axes, lengths, axes)
            output.ShallowCopy(polydata)
            output.GetPointData().SetTensors(to_vtk(tensors.reshape(-1, 9), self.GetTensorAsString()))
        except Exception as error:
            output.Initialize()
            return self._fail(error)
        return 1


@properties(NumberOfChunks=16, NumberOfPieces=1, Piece=0)
class vtkBigusPartitionField(Algorithm):
    """One process's part of a field, as the C++ class makes it."""

    def __init__(self) -> None:
        super().__init__(("vtkPolyData",), ("vtkPolyData",))

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        output = vtkDataObject.GetData(outputs, 0)
        output.Initialize()
        self._error_code = NO_ERROR
        total, pieces, piece = (self._values[name] for name in ("NumberOfChunks", "NumberOfPieces", "Piece"))
        try:
            if not 1 <= total <= MOST_CHUNKS or total & (total - 1):
                raise _core.Error(f"NumberOfChunks is {total}; it must be a power of two from 1 to {MOST_CHUNKS}.")
            if not 0 <= piece < pieces:
                raise _core.Error(f"Piece is {piece} of NumberOfPieces {pieces}; pieces are counted from 0.")
            field = field_of_polydata(vtkDataObject.GetData(inputs[0], 0))
            first, last = total * piece // pieces, total * (piece + 1) // pieces
            chunk_of = np.arange(len(field)) // BLOCK % total
            chunks = [np.flatnonzero(chunk_of == chunk) for chunk in range(first, last)]
            kept = np.concatenate([np.empty(0, dtype=int), *chunks])
            part = field_of_arrays(field.centers[kept], field.scales[kept], field.reflectivities[kept], field.rotations[kept],
                                   field.gamma, field.elevation_sigma, field.probe_elevation_sigma, field.trained_normals)
            part.provenance = field.provenance
            output.ShallowCopy(polydata_of_field(part))
            output.GetFieldData().AddArray(ids_to_vtk([total, first, *map(len, chunks)], "Chunks"))
        except Exception as error:
            return self._fail(error)
        return 1
