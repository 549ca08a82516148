# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Pipeline filters in pure Python that make, mend, draw and score sweeps and images, as the C++ classes do."""

from __future__ import annotations

from typing import Any, Optional

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtkIdTypeArray, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, VTK_UNSIGNED_CHAR, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _core, common, settings
from .algorithm import NO_ERROR, Algorithm, Choice, Clamped, getters, matrix_of, ports, properties, table_of, tell_image
from .names import vtk_case
from .vtkdata import image_of_sweep, poses_of_image, set_provenance, sweep_of_image, texts_to_vtk, to_vtk

__all__ = ["vtkBigusImageMetrics", "vtkBigusPhantomSource", "vtkBigusPoseCorrection", "vtkBigusSweepInspection",
           "vtkBigusSweepOutline"]  # fmt: skip

_OPTIONS = _core.phantom_options()
_NAMES = {vtk_case(name): name for name in _OPTIONS if name not in ("frames", "width", "height", "probe", "scene")}


@properties(
    Probe=Choice(0, ("Linear", "Convex", "Sector")), Scene=Choice(0, ("Organ", "Speckle", "Points")),
    **settings.PHANTOM, **{name: _OPTIONS[own] for name, own in _NAMES.items()},
)  # fmt: skip
class vtkBigusPhantomSource(Algorithm):
    """A made-up tracked sweep, with the exact image of any other plane."""

    LINEAR, CONVEX, SECTOR = range(3)
    ORGAN, SPECKLE, POINTS = range(3)

    _outputs = ("vtkImageData",)

    def _phantom(self) -> Any:
        options = {own: self._values[name] for name, own in _NAMES.items()}
        options["frames"], (options["width"], options["height"]) = (self._values[name] for name in settings.PHANTOM)
        options["probe"], options["scene"] = self.GetProbeAsString().lower(), self.GetSceneAsString().lower()
        return _core.Phantom(**options)

    def GetScatterersPerResolutionCell(self) -> float:
        try:
            return self._phantom().scatterers_per_resolution_cell
        except Exception as error:
            return self._fail(error)

    def ComputeTruth(self, image_to_reference: vtkMatrix4x4, width: int, height: int, truth: vtkImageData) -> bool:
        """Writes into `truth` the exact image of a plane, in the form of the output; False after an error."""
        self._error_code = NO_ERROR
        try:
            if image_to_reference is None or truth is None:
                raise _core.Error("ComputeTruth: the matrix and the image to write must both be given.")
            truth.Initialize()
            truth.ShallowCopy(image_of_sweep(self._phantom().truth(matrix_of(image_to_reference), width, height)))
        except Exception as error:
            return bool(self._fail(error))
        return True

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        self._error_code = NO_ERROR
        try:
            size = self._phantom().size
        except Exception as error:
            vtkDataObject.GetData(outputs, 0).Initialize()  # an earlier result is not the answer to these options
            return self._fail(error)
        tell_image(outputs.GetInformationObject(0), [n for side in size for n in (0, side - 1)], VTK_UNSIGNED_CHAR)
        return 1

    def _fill(self, data: list, outputs: list) -> None:
        phantom = self._phantom()
        sweep = phantom.sweep(self._go_on)
        if len(sweep):  # else stopped: an empty output is not an error
            outputs[0].ShallowCopy(image_of_sweep(sweep))
            outputs[0].GetFieldData().AddArray(to_vtk(phantom.true_poses.reshape(-1, 16), "TrueImageToReference"))


@properties(**settings.CORRECTION)
class vtkBigusPoseCorrection(Algorithm):
    """Takes the tracker's noise out of a sweep's poses; the C++ class lists the arrays that tell what was done."""

    CONSTANT_ERRORS = ("Delay", "ShiftX", "ShiftY", "ShiftZ", "RotationX", "RotationY", "RotationZ")
    CONFIRMED_STEPS = ("Share", "ShareError", "Gain", "Taken")

    _inputs, _outputs = ("vtkImageData",), ("vtkImageData", "vtkTable")
    _chosen = 0.0

    def GetChosenStrength(self) -> float:
        return self._chosen

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        outputs.GetInformationObject(0).CopyEntry(inputs[0].GetInformationObject(0),
                                                  vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
        return 1

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
        data = output.GetFieldData()
        data.AddArray(to_vtk(poses_of_image(image, frames, found["sweep"].poses).reshape(-1, 16), "ImageToReference"))
        data.AddArray(to_vtk(recorded, "RecordedImageToReference"))
        for name, key, rejected in (("PoseDisplacement", "displacement", 0), ("PoseRotation", "rotation", 0),
                                    ("PoseOutlier", "outlier", 0), ("PoseStroke", "stroke", -1)):
            every = np.full(len(recorded), rejected, dtype=found[key].dtype)
            every[frames] = found[key]
            data.AddArray(to_vtk(every, name))
        self._add_numbers(data, "ConstantErrors", found["constant_errors"], self.CONSTANT_ERRORS)
        self._add_numbers(data, "ConfirmedSteps", found["confirmed_steps"], self.CONFIRMED_STEPS)
        data.AddArray(to_vtk(np.array([found["constant_errors_applied"]], dtype=np.uint8), "ConstantErrorsApplied"))
        noise = found["noise"]
        self._add_numbers(data, "TrackerNoise", np.array([list(noise.values())]), [name.capitalize() for name in noise])
        data.AddArray(to_vtk(np.array([found["strength"]]), "PoseStrength"))
        decision = found["decision"]
        data.AddArray(texts_to_vtk([decision["choice"], decision["evidence"]], "PoseDecision"))
        set_provenance(data, "sweep.poses", f"{decision['choice']} ({decision['evidence']})")
        self._chosen = found["strength"]
        rows = found["steps"]
        columns = {name: np.array([row[key] for row in rows], dtype=np.int32 if key == "taken" else np.float64)
                   for key, name in common.STEP_COLUMNS.items()}  # fmt: skip
        outputs[1].ShallowCopy(table_of(columns))

    def GetSteps(self) -> Any:
        return self.GetOutputDataObject(1)

    @staticmethod
    def _add_numbers(data: Any, name: str, values: np.ndarray, components: Any) -> None:
        array = to_vtk(values, name)
        for k, component in enumerate(components):
            array.SetComponentName(k, component)
        data.AddArray(array)


@properties(Keep="none")
class vtkBigusSweepInspection(Algorithm):
    """Says what is wrong with recorded frames: the sweep with an array Finding, and a table with a row a finding."""

    _inputs, _outputs = ("vtkImageData",), ("vtkImageData", "vtkTable")

    def GetFindings(self) -> Any:
        return self.GetOutputDataObject(1)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        outputs.GetInformationObject(0).CopyEntry(inputs[0].GetInformationObject(0),
                                                  vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
        return 1

    def _fill(self, inputs: list, outputs: list) -> None:
        image = inputs[0][0]
        sweep, frames = sweep_of_image(image)
        rows, reasons = _core.inspect(sweep, self._values["Keep"], [int(frame) for frame in frames])
        outputs[0].ShallowCopy(image)
        every = np.zeros(image.GetDimensions()[2], dtype=np.int32)
        every[frames] = reasons
        outputs[0].GetFieldData().AddArray(to_vtk(every, "Finding"))
        columns = {"Kind": [row["kind"] for row in rows]}
        for name in ("Frames", "Pixels", "Applied"):
            columns[name] = np.array([row[name.lower()] for row in rows], dtype=np.int32)
        outputs[1].ShallowCopy(table_of({**columns, "Text": [row["text"] for row in rows]}))


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
        right, bottom, last = sweep.width - 1, sweep.height - 1, len(sweep) - 1
        chosen = [k for k in range(len(sweep)) if k % self._values["FrameStride"] == 0 or k == last]
        corners = [(0, 0), (right, 0), (right, bottom), (0, bottom)]
        cells = [[4 * n, 4 * n + 1, 4 * n + 2, 4 * n + 3, 4 * n] for n in range(len(chosen))]
        self._lines(outlines, self._pixels(sweep.poses[chosen], corners), cells)
        self._lines(path, self._pixels(sweep.poses, [(0.5 * right, 0)]), [list(range(len(sweep)))] if last > 0 else [])
        for attributes, numbers in ((outlines.GetCellData(), chosen), (path.GetPointData(), range(len(sweep)))):
            attributes.AddArray(to_vtk(frames[list(numbers)].astype(np.int32), "Frame"))
            if sweep.timestamps is not None:
                attributes.AddArray(to_vtk(np.array(sweep.timestamps)[list(numbers)], "Timestamp"))
        if self._values["GeneratePixels"]:
            pixels = vtk_to_numpy(data[0][0].GetPointData().GetScalars()).reshape(-1, sweep.height, sweep.width)
            places, points = [(i, j) for j in range(sweep.height) for i in range(sweep.width)], vtkPoints()
            points.SetData(to_vtk(self._pixels(sweep.poses[chosen], places).astype(np.float32), "Points"))
            grid.SetDimensions(sweep.width, sweep.height, len(chosen))
            grid.SetPoints(points)
            grid.GetPointData().SetScalars(to_vtk(pixels[frames[chosen]].ravel(), "Recorded"))

    @staticmethod
    def _pixels(poses: np.ndarray, pixels: list) -> np.ndarray:
        """Where the pixels (i, j) of every frame lie: [frames * pixels, 3], mm."""
        return np.einsum("fab,pb->fpa", poses, [(i, j, 0, 1) for i, j in pixels])[..., :3].reshape(-1, 3)

    @staticmethod
    def _lines(polydata: vtkPolyData, places: np.ndarray, cells: list) -> None:
        points, lines = vtkPoints(), vtkCellArray()
        points.SetData(to_vtk(places, "Points"))
        if cells:
            ends = np.cumsum([0] + [len(cell) for cell in cells])
            numbers = np.concatenate(cells)
            lines.SetData(*(numpy_to_vtkIdTypeArray(a.astype(np.int64), deep=True) for a in (ends, numbers)))
        polydata.SetPoints(points)
        polydata.SetLines(lines)


SCORES = {"PSNR": "psnr", "SSIM": "ssim", "BFS": "bfs", "MeanContrast": "mean_contrast",
          "ContrastDistribution": "contrast_distribution", "Rayleigh": "rayleigh"}
TEXTURES = ("ContrastRatio", "ContrastDistance", "IntensityDistance", "SpectrumDifference", "HighFrequencyPower")
SPREADS = ("PSNR", "SSIM")


@getters("_means", **{name: (name, 0.0) for name in (*SCORES, *TEXTURES, *(name + "StandardDeviation" for name in SPREADS))})
class vtkBigusImageMetrics(Algorithm):
    """How close an image (input 0) is to the truth (input 1): a table with a row for each z slice."""

    _inputs, _outputs = ("vtkImageData", "vtkImageData"), ("vtkTable",)

    def _begin(self) -> None:
        self._means: dict[str, float] = {}

    def SetTruthConnection(self, port: Any) -> None:
        self.SetInputConnection(1, port)

    def SetTruthData(self, image: Any) -> None:
        self.SetInputDataObject(1, image)

    @staticmethod
    def _pixels(image: Optional[vtkImageData], name: str) -> np.ndarray:
        """[depth, height, width], of the image's type."""
        scalars = image.GetPointData().GetScalars() if image is not None else None
        if scalars is None or image.GetNumberOfPoints() in (0, None) or \
                scalars.GetNumberOfTuples() != image.GetNumberOfPoints():
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
            pair = self._intensities(a[k], "The image"), self._intensities(b[k], "The truth")
            scores = _core.compare(*pair)
            rows.append({**{column: scores[name] for column, name in SCORES.items()}, **_core.compare_textures(*pair)})
            if not self._go_on((k + 1) / len(a)):
                break  # what was measured so far is the result
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        first = data[0][0].GetExtent()[4]
        outputs[0].ShallowCopy(table_of({"Slice": np.arange(first, first + len(rows), dtype=np.int32), **columns}))
        self._means = {name: float(np.mean(columns[name])) for name in (*SCORES, *TEXTURES)}
        for name in SPREADS:  # equal slices of infinite PSNR do not spread
            values = columns[name]
            self._means[name + "StandardDeviation"] = 0.0 if (values == values[0]).all() else float(np.std(values))
