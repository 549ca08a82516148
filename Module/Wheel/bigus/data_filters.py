# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Pipeline filters in pure Python that make, mend, draw and score sweeps and images, and change fields, as the C++ classes do."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _core, common, settings
from .algorithm import Algorithm, Choice, Clamped, getters, guarded, input_ports, matrix_of, parts, ports, properties, table_of
from .algorithm import table_of_rows, tell_image, transform_matrix
from .names import snake_case, vtk_case
from .sources import rotation_of
from .tasks import Phantom
from .vtkdata import add_arrays, cells_of, field_of_polydata, ids_to_vtk, image_of_sweep, points_of, polydata_of_field
from .vtkdata import poses_of_image, set_provenance, sweep_of_image, to_vtk

_PHANTOM = {vtk_case(name): value for name, value in _core.phantom_options().items()
            if name not in ("frames", "width", "height", "probe", "scene")}  # fmt: skip


@properties(
    Probe=Choice(0, ("Linear", "Convex", "Sector")), Scene=Choice(0, ("Organ", "Speckle", "Points")),
    **settings.PHANTOM, **_PHANTOM,
)  # fmt: skip
class vtkBigusPhantomSource(Algorithm):
    """A made-up tracked sweep, with the exact image of any other plane."""

    LINEAR, CONVEX, SECTOR = range(3)
    ORGAN, SPECKLE, POINTS = range(3)

    _outputs = ("vtkImageData",)

    def _phantom(self) -> Any:
        names = {"Probe": self.GetProbeAsString().lower(), "Scene": self.GetSceneAsString().lower()}
        return Phantom(**{**self._values, **names})

    @guarded
    def GetScatterersPerResolutionCell(self) -> float:
        return self._phantom().scatterers_per_resolution_cell

    @guarded
    def ComputeTruth(self, image_to_reference: vtkMatrix4x4, width: int, height: int, truth: vtkImageData) -> bool:
        """Writes into `truth` the exact image of a plane, in the form of the output; False after an error."""
        if image_to_reference is None or truth is None:
            raise _core.Error("ComputeTruth: the matrix and the image to write must both be given.")
        truth.Initialize()
        truth.ShallowCopy(image_of_sweep(self._phantom().truth(matrix_of(image_to_reference), width, height)))
        return True

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        done = self._inform(outputs)
        if not done:
            vtkDataObject.GetData(outputs, 0).Initialize()  # an earlier result is not the answer to these options
        return done

    @guarded
    def _inform(self, outputs: Any) -> int:
        size = self._phantom().size
        tell_image(outputs.GetInformationObject(0), [n for side in size for n in (0, side - 1)], VTK_UNSIGNED_CHAR)
        return 1

    def _fill(self, data: list, outputs: list) -> None:
        phantom = self._phantom()
        sweep = phantom.sweep(self._go_on)
        if len(sweep):  # else stopped: an empty output is not an error
            outputs[0].ShallowCopy(image_of_sweep(sweep))
            outputs[0].GetFieldData().AddArray(to_vtk(phantom.true_poses.reshape(-1, 16), "TrueImageToReference"))


class _OfSweeps(Algorithm):
    """Gives the sweep that it is given, with more arrays, and a table."""

    _inputs, _outputs = ("vtkImageData",), ("vtkImageData", "vtkTable")

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        outputs.GetInformationObject(0).CopyEntry(inputs[0].GetInformationObject(0),
                                                  vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
        return 1


@properties(**settings.CORRECTION)
@ports(Steps=1)
class vtkBigusPoseCorrection(_OfSweeps):
    """Takes the tracker's noise out of a sweep's poses; the C++ class lists the arrays that tell what was done."""

    _chosen = 0.0

    def GetChosenStrength(self) -> float:
        return self._chosen

    def _fill(self, inputs: list, outputs: list) -> None:
        self._chosen = 0.0
        image, output = inputs[0][0], outputs[0]
        sweep, frames = sweep_of_image(image)
        for finding in _core.inspect(sweep, "all", [int(frame) for frame in frames])[0]:
            self._report("WarningEvent", finding["text"])
        strength = self._values["Strength"]
        found = _core.correct_poses(sweep, None if strength < 0 else strength, self._values["HoldOut"], self._go_on)
        if found is None:
            return  # stopped: the output stays empty, and the next update begins anew
        recorded = vtk_to_numpy(image.GetFieldData().GetArray("ImageToReference")).astype(np.float64)
        output.ShallowCopy(image)
        poses, decision = poses_of_image(image, frames, found["sweep"].poses), found["decision"]
        arrays = {"ImageToReference": poses.reshape(-1, 16), "RecordedImageToReference": recorded,
                  "ConstantErrorsApplied": np.array([found["constant_errors_applied"]], dtype=np.uint8)}
        for key, rejected in (("displacement", 0), ("rotation", 0), ("outlier", 0), ("stroke", -1)):
            every = arrays["Pose" + key.capitalize()] = np.full(len(recorded), rejected, dtype=found[key].dtype)
            every[frames] = found[key]
        data = output.GetFieldData()
        add_arrays(data, arrays)
        for name, components, values in found["numbers"]:
            array = to_vtk(values, name)
            for k, component in enumerate(filter(None, components)):
                array.SetComponentName(k, component)
            data.AddArray(array)
        add_arrays(data, {"PoseDecision": [decision["choice"], decision["evidence"]]})
        set_provenance(data, "sweep.poses", f"{decision['choice']} ({decision['evidence']})")
        self._chosen = found["strength"]
        outputs[1].ShallowCopy(table_of_rows(found["steps"], **common.STEP_COLUMNS))


@properties(Keep="none")
@ports(Findings=1)
class vtkBigusSweepInspection(_OfSweeps):
    """Says what is wrong with recorded frames: the sweep with an array Finding, and a table with a row a finding."""

    def _fill(self, inputs: list, outputs: list) -> None:
        image = inputs[0][0]
        sweep, frames = sweep_of_image(image)
        rows, reasons = _core.inspect(sweep, self._values["Keep"], [int(frame) for frame in frames])
        outputs[0].ShallowCopy(image)
        every = np.zeros(image.GetDimensions()[2], dtype=np.int32)
        every[frames] = reasons
        outputs[0].GetFieldData().AddArray(to_vtk(every, "Finding"))
        outputs[1].ShallowCopy(table_of_rows(rows, **common.FINDING_COLUMNS))


@properties(FrameStride=Clamped(1, 1, 2**31 - 1), GeneratePixels=False)
@ports(PathOutput=1, PixelsOutput=2)
class vtkBigusSweepOutline(Algorithm):
    """The outlines of a sweep's frames (output 0) and the probe's path (output 1), as lines, and pixels (output 2)."""

    _inputs, _outputs = ("vtkImageData",), ("vtkPolyData", "vtkPolyData", "vtkStructuredGrid")

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        extent = [0, -1, 0, -1, 0, -1]
        if self._values["GeneratePixels"]:
            info, stride = inputs[0].GetInformationObject(0), self._values["FrameStride"]
            whole = [info.Get(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), k) for k in range(6)]
            extent[1::2] = [whole[1] - whole[0], whole[3] - whole[2], -((whole[4] - whole[5]) // stride)]
        outputs.GetInformationObject(2).Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), extent, 6)
        return 1

    def _fill(self, data: list, outputs: list) -> None:
        outlines, path, grid = outputs
        sweep, frames = sweep_of_image(data[0][0])
        right, bottom, count = sweep.width - 1, sweep.height - 1, len(sweep)
        every = np.arange(count)
        chosen = every[(every % self._values["FrameStride"] == 0) | (every == count - 1)]
        corners = 4 * np.arange(len(chosen))[:, None] + (0, 1, 2, 3, 0)
        self._lines(outlines, self._pixels(sweep.poses[chosen], [(0, 0), (right, 0), (right, bottom), (0, bottom)]), corners)
        self._lines(path, self._pixels(sweep.poses, [(0.5 * right, 0)]), every[None] if count > 1 else every[:0, None])
        for attributes, numbers in ((outlines.GetCellData(), chosen), (path.GetPointData(), every)):
            attributes.AddArray(to_vtk(frames[numbers].astype(np.int32), "Frame"))
            if sweep.timestamps is not None:
                attributes.AddArray(to_vtk(sweep.timestamps[numbers], "Timestamp"))
        if self._values["GeneratePixels"]:
            pixels = vtk_to_numpy(data[0][0].GetPointData().GetScalars()).reshape(-1, sweep.height, sweep.width)
            places = np.stack(np.meshgrid(np.arange(sweep.width), np.arange(sweep.height)), -1).reshape(-1, 2)
            grid.SetDimensions(sweep.width, sweep.height, len(chosen))
            grid.SetPoints(points_of(self._pixels(sweep.poses[chosen], places).astype(np.float32)))
            grid.GetPointData().SetScalars(to_vtk(pixels[frames[chosen]].ravel(), "Recorded"))

    @staticmethod
    def _pixels(poses: np.ndarray, pixels: Any) -> np.ndarray:
        """Where the pixels (i, j) of every frame lie: [frames * pixels, 3], mm."""
        return np.einsum("fab,pb->fpa", poses[..., (0, 1, 3)], np.insert(np.array(pixels, float), 2, 1, axis=1))[..., :3].reshape(-1, 3)

    @staticmethod
    def _lines(polydata: vtkPolyData, places: np.ndarray, cells: np.ndarray) -> None:
        """Lines [cells, points]."""
        polydata.SetPoints(points_of(places))
        polydata.SetLines(cells_of(cells))


TEXTURES = ("ContrastRatio", "ContrastDistance", "IntensityDistance", "SpectrumDifference", "HighFrequencyPower")
SPREADS = ("PSNR", "SSIM")


@getters("_means", **{name: (name, 0.0) for name in (*common.SCORES, *TEXTURES, *(name + "StandardDeviation" for name in SPREADS))})
@input_ports(Truth=1)
class vtkBigusImageMetrics(Algorithm):
    """How close an image (input 0) is to the truth (input 1): a table with a row for each z slice."""

    _inputs, _outputs = ("vtkImageData", "vtkImageData"), ("vtkTable",)

    def _begin(self) -> None:
        self._means: dict[str, float] = {}

    @staticmethod
    def _pixels(image: Optional[vtkImageData], name: str) -> np.ndarray:
        """[depth, height, width], of the image's type."""
        scalars = image.GetPointData().GetScalars() if image is not None else None
        if scalars is None or image.GetNumberOfPoints() == 0 or scalars.GetNumberOfTuples() != image.GetNumberOfPoints():
            raise _core.Error(f"{name} has no pixels.")
        if scalars.GetNumberOfComponents() != 1:
            raise _core.Error(f"{name} has {scalars.GetNumberOfComponents()} components; grey images with one are compared. "
                              "Convert colour to grey first.")
        if scalars.GetDataType() not in (VTK_UNSIGNED_CHAR, VTK_FLOAT):
            raise _core.Error(f"{name} holds {scalars.GetDataTypeAsString()}; unsigned char, or float in [0, 1], is expected.")
        return vtk_to_numpy(scalars).reshape(image.GetDimensions()[::-1])

    @staticmethod
    def _intensities(pixels: np.ndarray, name: str) -> np.ndarray:
        if pixels.dtype == np.uint8:
            return (pixels / 255.0).astype(np.float32)
        bad = pixels[~((pixels >= 0) & (pixels <= 1))]
        if bad.size:
            raise _core.Error(f"{name} holds the value {bad[0]:f}; float intensities must lie in [0, 1]. Use "
                              "vtkImageShiftScale to scale them.")
        return pixels

    def _fill(self, data: list, outputs: list) -> None:
        self._means = {}
        a, b = self._pixels(data[0][0], "The image"), self._pixels(data[1][0], "The truth")
        if a.shape != b.shape:
            sizes = [" x ".join(str(n) for n in pixels.shape[::-1]) for pixels in (a, b)]
            raise _core.Error(f"The image is {sizes[0]} pixels, the truth {sizes[1]}; they must be equal.")
        rows: list[dict[str, Any]] = []
        for k in range(len(a)):
            rows.append(_core.compare(self._intensities(a[k], "The image"), self._intensities(b[k], "The truth"), True))
            if not self._go_on((k + 1) / len(a)):
                break  # what was measured so far is the result
        scores = {snake_case(name): name for name in common.SCORES}
        columns = {scores.get(name, name): np.array([row[name] for row in rows]) for name in rows[0]}
        first = data[0][0].GetExtent()[4]
        outputs[0].ShallowCopy(table_of({"Slice": np.arange(first, first + len(rows), dtype=np.int32), **columns}))
        self._means = {name: float(np.mean(columns[name])) for name in (*common.SCORES, *TEXTURES)}
        for name in SPREADS:  # equal slices of infinite PSNR do not spread
            values = columns[name]
            self._means[name + "StandardDeviation"] = 0.0 if (values == values[0]).all() else float(np.std(values))


# ----------------------------------------------------------------------------------------------------------------------
# Fields


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
        w_last = np.roll(field.rotations, -1, axis=1)
        axes, lengths = rotation_of(w_last), field.scales ** (1 + self._values["Tensor"])
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
