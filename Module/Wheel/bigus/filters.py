# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""VTK's pipeline filters in pure Python, with the names, properties and geometry of the C++ classes. Needs the package vtk.

bigus.vtkBigusReslice and the others come from here when they are asked for. Where the C++ build is installed, its
wrapped classes have the same names. What each property means stands in the documentation of the C++ class.
"""

from __future__ import annotations

import math
import os
from typing import Any, Optional, Sequence

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, VTK_UNSIGNED_CHAR, vtkDoubleArray, vtkIntArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData, vtkTable
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkExecutive, vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkImageStencilData

from . import _core
from .files import FIELD_OUTPUT, SEQUENCE, SEQUENCE_OUTPUT, read_field, write
from .tasks import Slicer, TrainingInterrupted, train
from .algorithm import NO_ERROR, Algorithm, extent_of, geometry, matrix_of, properties, table_of, want_all
from .field_filters import axes_of
from .vtkdata import field_of_polydata, image_of, polydata_of_field, poses_of_image, provenance_of, sweep_of_image, to_vtk

SMALLEST_SPACING, LARGEST_SPACING = 1e-6, 1e6  # mm
LARGEST_INDEX = 10**9  # fits an int; so large an output is refused later
DEFAULT_DIMENSION = 256  # pixels along the longest side of a field, where no geometry is given
PIXELS_AT_ONCE = 1 << 22  # between two reports of progress

__all__ = [
    "vtkBigusFieldReader", "vtkBigusFieldToImage", "vtkBigusFieldWriter", "vtkBigusReslice", "vtkBigusSequenceReader",
    "vtkBigusSequenceWriter", "vtkBigusTrainer", "vtkBigusVoxelizer",
]  # fmt: skip


# ----------------------------------------------------------------------------------------------------------------------
# Readers and writers


class _Source(Algorithm):
    """A reader: the file is read once, when information is asked for."""

    def __init__(self, output: str):
        super().__init__((), (output,))
        self._time, self._data = 0, None

    def _load(self) -> int:
        if self._data is not None and self._time == self.GetMTime():
            return 1
        self._error_code = NO_ERROR
        self._data = None
        try:
            if not self._values["FileName"]:
                raise _core.Error("FileName is not set")
            self._data = self._read(self._values["FileName"])
        except Exception as error:
            return self._fail(error)
        self._time = self.GetMTime()
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        output = vtkDataObject.GetData(outputs, 0)
        output.Initialize()
        if not self._load():
            return 0
        output.ShallowCopy(self._data)
        return 1


@properties(FileName="")
class vtkBigusFieldReader(_Source):
    """Reads a Gaussian field (.vtp, .ply) as vtkPolyData."""

    def __init__(self) -> None:
        super().__init__("vtkPolyData")

    def _read(self, name: str) -> vtkPolyData:
        return polydata_of_field(read_field(name))


@properties(FileName="", **SEQUENCE, KeepRejectedFrames=False, RequirePoses=True)
class vtkBigusSequenceReader(_Source):
    """Reads a tracked sweep as an image stack (x, y, frame); field data say where its frames lie.

    ImageToReference [16, row-major], Status, SourceFrame, Timestamp where every frame has one, and Mask. Pixels keep the
    file's type. The whole file is read when information is asked for.
    """

    CLIP_NONE, CLIP_RECTANGLE, CLIP_FAN = range(3)

    def __init__(self) -> None:
        super().__init__("vtkImageData")
        self._found: dict[str, Any] = {}

    def _read(self, name: str) -> vtkImageData:
        self._found = {}
        settings = {key: value for key, value in self._values.items() if key != "FileName"}
        found = _core.read_sequence(name, **settings)
        image = image_of(found["pixels"])
        data = image.GetFieldData()
        if found["poses"] is not None:
            data.AddArray(to_vtk(found["poses"].reshape(-1, 16), "ImageToReference"))
        data.AddArray(to_vtk(found["status"], "Status"))
        data.AddArray(to_vtk(found["source_frames"], "SourceFrame"))
        if found["timestamps"] is not None:
            data.AddArray(to_vtk(found["timestamps"], "Timestamp"))
        if found["mask"] is not None:
            data.AddArray(to_vtk(found["mask"].ravel(), "Mask"))
        for caution in found["warnings"]:
            self._report("WarningEvent", caution)
        self._found = found
        return image

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        if not self._load():
            return 0
        info = outputs.GetInformationObject(0)
        info.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), self._data.GetExtent(), 6)
        info.Set(vtkDataObject.SPACING(), (1.0, 1.0, 1.0), 3)
        info.Set(vtkDataObject.ORIGIN(), (0.0, 0.0, 0.0), 3)
        scalars = self._data.GetPointData().GetScalars()
        vtkDataObject.SetPointDataActiveScalarInfo(info, scalars.GetDataType(), 1)
        return 1

    def CanReadFile(self, name: str) -> int:
        return int(_core.looks_like_sequence(os.fspath(name), not self._values["RequirePoses"]))

    def GetNumberOfFramesInFile(self) -> int:
        return self._found.get("frames_in_file", 0)

    def GetNumberOfAcceptedFrames(self) -> int:
        return self._found.get("accepted_frames", 0)

    def GetNumberOfRejectedFrames(self) -> int:
        return self.GetNumberOfFramesInFile() - self.GetNumberOfAcceptedFrames()

    def GetNumberOfRejectionReasons(self) -> int:
        return len(self._found.get("rejections", ()))

    def GetRejectionReason(self, index: int) -> str:
        return self._found["rejections"][index][0]

    def GetRejectionCount(self, index: int) -> int:
        return len(self._found["rejections"][index][1])

    def GetRejectionSummary(self) -> str:
        return self._found.get("rejection_summary", "")

    def GetNumberOfTransforms(self) -> int:
        return len(self._found.get("transforms", ()))

    def GetTransformName(self, index: int) -> str:
        return self._found["transforms"][index][0]

    def GetTransformSource(self, index: int) -> str:
        return self._found["transforms"][index][1]

    def GetTransformChain(self) -> str:
        return self._found.get("transform_chain", "")

    def GetFormat(self) -> str:
        return self._found.get("format", "")

    def GetEncoding(self) -> str:
        return self._found.get("encoding", "raw")

    def GetElementType(self) -> str:
        return self._found.get("element_type", "")

    def GetOrientation(self) -> str:
        return self._found.get("orientation", "")

    def GetFrameSize(self, size: list) -> None:
        """Fills (width, height), pixels."""
        size[:] = self._found["pixels"].shape[:0:-1] if self._found else (0, 0)

    def _accepted(self) -> tuple[np.ndarray, np.ndarray]:
        """The poses of accepted frames, and their corners and centre [frames, 5, 3], mm."""
        if not self._found or self._found["poses"] is None:
            return np.empty((0, 4, 4)), np.empty((0, 5, 3))
        poses = self._found["poses"][self._found["status"] != 0]
        height, width = self._found["pixels"].shape[1:]
        places = [(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1), ((width - 1) / 2, (height - 1) / 2)]
        return poses, (poses @ np.array([(i, j, 0, 1) for i, j in places], dtype=float).T).transpose(0, 2, 1)[..., :3]

    def GetPixelSize(self, size: list) -> None:
        """Fills the mean lengths of a pixel's steps along i and j, mm."""
        poses, _ = self._accepted()
        size[:] = np.linalg.norm(poses[:, :3, :2], axis=1).mean(axis=0).tolist() if len(poses) else (0.0, 0.0)

    def GetPathLength(self) -> float:
        _, places = self._accepted()
        return float(np.linalg.norm(np.diff(places[:, 4], axis=0), axis=1).sum())

    def GetBounds(self, bounds: list) -> None:
        """Fills the box around all frames' corners: x, x, y, y, z, z, mm."""
        _, places = self._accepted()
        corners = places[:, :4].reshape(-1, 3)
        bounds[:] = np.stack([corners.min(axis=0), corners.max(axis=0)], -1).ravel().tolist() if len(corners) else (0.0,) * 6

    def _times(self) -> Optional[np.ndarray]:
        times = self._found.get("timestamps")
        return None if times is None else times[self._found["status"] != 0]

    def GetHasTimestamps(self) -> bool:
        return self._times() is not None

    def GetDuration(self) -> float:
        times = self._times()
        return 0.0 if times is None else float(times[-1] - times[0])

    def GetUsedPixelRange(self) -> float:
        return self._found.get("used_pixel_range", 0.0)

    def SetClipModeToNone(self) -> None:
        self.SetClipMode(self.CLIP_NONE)

    def SetClipModeToRectangle(self) -> None:
        self.SetClipMode(self.CLIP_RECTANGLE)

    def SetClipModeToFan(self) -> None:
        self.SetClipMode(self.CLIP_FAN)


class _Writer(Algorithm):
    def __init__(self, kind: str):
        super().__init__((kind,), ())

    def Write(self) -> int:
        """1 when the file has been written; else 0, with an error, and no file is left behind."""
        self._error_code = NO_ERROR
        try:
            if not self._values["FileName"]:
                raise _core.Error("FileName is not set")
            if self.GetNumberOfInputConnections(0):
                producer = self.GetInputConnection(0, 0)
                producer.GetProducer().Update(producer.GetIndex())
            settings = {key: value for key, value in self._values.items() if key != "FileName"}
            self._write(self.GetInput(), self._values["FileName"], settings)
        except Exception as error:
            return self._fail(error)
        return 1


@properties(FileName="", **FIELD_OUTPUT)
class vtkBigusFieldWriter(_Writer):
    """Writes a field to .vtp (exact) or .ply (for viewers of splats)."""

    def __init__(self) -> None:
        super().__init__("vtkPolyData")

    def _write(self, data: Any, name: str, settings: dict[str, Any]) -> None:
        write(field_of_polydata(data), name, **settings)


@properties(FileName="", **SEQUENCE_OUTPUT)
class vtkBigusSequenceWriter(_Writer):
    """Writes a sweep to .igs.mha; rejected frames (Status 0) are left out."""

    def __init__(self) -> None:
        super().__init__("vtkImageData")

    def _write(self, data: Any, name: str, settings: dict[str, Any]) -> None:
        write(sweep_of_image(data)[0], name, **settings)


# ----------------------------------------------------------------------------------------------------------------------
# Images of a field


def _field_grid(field: Any, axes: np.ndarray, dimension: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(spacing, origin, dimensions) of cubic voxels along `axes` that hold every Gaussian to 3 standard deviations."""
    if len(field) == 0:
        return np.ones(3), np.zeros(3), np.ones(3, dtype=int)
    to_grid = np.linalg.inv(axes)
    rotation = axes_of(field)
    reach = 3 * np.sqrt(((np.einsum("ij,njk->nik", to_grid, rotation) * field.scales[:, None, :]) ** 2).sum(axis=2))
    centres = field.centers @ to_grid.T
    low, high = (centres - reach).min(axis=0), (centres + reach).max(axis=0)
    spacing = min(max((high - low).max() / (dimension - 1), SMALLEST_SPACING), LARGEST_SPACING)
    steps = np.minimum(np.floor((high - low) / spacing + 0.5), LARGEST_INDEX)
    return np.full(3, spacing), 0.5 * (low + high) - 0.5 * spacing * steps, steps.astype(int) + 1


@properties(OutputMode=0, OutputScalarType=VTK_FLOAT, ElevationSigma=-1.0, Tolerance=1e-4, MaximumOutputPixels=1 << 29,
             Engine="auto")
class vtkBigusFieldToImage(Algorithm):
    """What filters share that render a field: OutputSpacing, OutputOrigin, OutputMode, Engine and more."""

    Intensity, ScatteringField = 0, 1
    defaults_of_geometry = {"OutputSpacing": None, "OutputOrigin": None}

    def __init__(self, outputs: Sequence[str]):
        super().__init__(("vtkPolyData",), outputs)
        self._values.update(self.defaults_of_geometry)
        self._field, self._field_time = None, 0
        self._slicer, self._slicer_key = None, None

    for _name, _usual in (("OutputSpacing", (1.0,) * 3), ("OutputOrigin", (0.0,) * 3)):
        locals().update(geometry(_name, _usual))

    def SetOutputModeToIntensity(self) -> None:
        self.SetOutputMode(self.Intensity)

    def SetOutputModeToScatteringField(self) -> None:
        self.SetOutputMode(self.ScatteringField)

    def SetOutputScalarTypeToFloat(self) -> None:
        self.SetOutputScalarType(VTK_FLOAT)

    def SetOutputScalarTypeToUnsignedChar(self) -> None:
        self.SetOutputScalarType(VTK_UNSIGNED_CHAR)

    def GetDevice(self) -> str:
        return self._slicer.device if self._slicer else ""

    def _load_field(self, polydata: Any) -> Any:
        time = polydata.GetMTime() if polydata is not None else 0
        if self._field is None or self._field_time != time:
            self._field, self._slicer = None, None
            self._field = field_of_polydata(polydata)
            self._field_time = time
        return self._field

    def _updated_field(self) -> Any:
        if self.GetNumberOfInputConnections(0):
            producer = self.GetInputConnection(0, 0)
            producer.GetProducer().Update(producer.GetIndex())
        return self._load_field(self.GetInput())

    def _check_grid(self, spacing: np.ndarray, origin: np.ndarray) -> None:
        for axis in range(3):
            if not SMALLEST_SPACING <= abs(spacing[axis]) <= LARGEST_SPACING:
                raise _core.Error(f"OutputSpacing along axis {axis} is {spacing[axis]:f} mm; it must lie between 1e-6 and "
                                  "1e6 mm.")
            if not math.isfinite(origin[axis]):
                raise _core.Error(f"OutputOrigin along axis {axis} is not finite.")

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        self._error_code = NO_ERROR
        try:
            self._check_grid(self.GetOutputSpacing(), self.GetOutputOrigin())
            spacing, origin, extent = self._grid()
            kind = self._values["OutputScalarType"]
            if kind not in (VTK_FLOAT, VTK_UNSIGNED_CHAR):
                raise _core.Error(f"OutputScalarType is {kind}; float and unsigned char are possible.")
            if self._values["OutputMode"] == self.ScatteringField and kind != VTK_FLOAT:
                raise _core.Error("The scattering field is signed and unbounded; set OutputScalarType to float.")
        except Exception as error:
            return self._fail(error)
        for port in range(outputs.GetNumberOfInformationObjects()):
            info = outputs.GetInformationObject(port)
            info.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), tuple(int(e) for e in extent), 6)
            info.Set(vtkDataObject.SPACING(), tuple(float(s) for s in spacing), 3)
            info.Set(vtkDataObject.ORIGIN(), tuple(float(o) for o in origin), 3)
            info.Set(vtkAlgorithm.CAN_PRODUCE_SUB_EXTENT(), 1)
        vtkDataObject.SetPointDataActiveScalarInfo(outputs.GetInformationObject(0), kind, 1)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        pipeline = vtkStreamingDemandDrivenPipeline
        count = outputs.GetNumberOfInformationObjects()
        for port in range(count):
            vtkDataObject.GetData(outputs, port).Initialize()
        self._error_code = NO_ERROR
        try:
            infos = [outputs.GetInformationObject(port) for port in range(count)]
            whole = extent_of(infos[0], pipeline.WHOLE_EXTENT())
            # What the asking port wants with what the consumers of the others want, so that a filter connected to two
            # outputs finds both.
            asking = max(0, request.Get(vtkExecutive.FROM_OUTPUT_PORT()))
            wanted = [extent_of(info, pipeline.UPDATE_EXTENT()) for port, info in enumerate(infos)
                      if port == asking or vtkExecutive.CONSUMERS().Length(info) > 0]
            wanted = [w for w in wanted if all(w[2 * a] <= w[2 * a + 1] for a in range(3))]
            if not wanted:
                return 1
            extent = [(max(min(w[k] for w in wanted), whole[k]) if k % 2 == 0 else min(max(w[k] for w in wanted), whole[k]))
                      for k in range(6)]
            sizes = [extent[2 * axis + 1] - extent[2 * axis] + 1 for axis in range(3)]
            if math.prod(sizes) > self._values["MaximumOutputPixels"]:
                raise _core.Error(
                    f"The output asked for is {sizes[0]} x {sizes[1]} x {sizes[2]} pixels, more than MaximumOutputPixels "
                    f"({self._values['MaximumOutputPixels']}). Make it smaller or its spacing larger, or stream it in pieces.")
            self._load_field(vtkDataObject.GetData(inputs[0], 0))
            key = tuple(self._values[name] for name in ("Engine", "ElevationSigma", "Tolerance"))
            if self._slicer is None or self._slicer_key != key:
                self._slicer, self._slicer_key = Slicer(self._field, *key), key
            spacing = [infos[0].Get(vtkDataObject.SPACING(), k) for k in range(3)]
            origin = [infos[0].Get(vtkDataObject.ORIGIN(), k) for k in range(3)]
            self._render(outputs, whole, extent, spacing, origin)
        except Exception as error:
            for port in range(count):
                vtkDataObject.GetData(outputs, port).Initialize()
            return self._fail(error)
        return 1

    def _image(self, outputs: Any, port: int, pixels: np.ndarray, name: str, extent: Sequence[int],
               spacing: Sequence[float], origin: Sequence[float]) -> vtkImageData:
        image = vtkDataObject.GetData(outputs, port)
        image.SetExtent(*extent)
        image.SetSpacing(*spacing)
        image.SetOrigin(*origin)
        image.GetPointData().SetScalars(to_vtk(pixels.reshape(-1), name))
        return image

    def _planes(self, index_to_world: np.ndarray, whole: Sequence[int], extent: Sequence[int], offset: float) -> np.ndarray:
        """[n, 4, 4] of the slices of an extent, moved so many steps along the third axis; they begin at the whole's
        first pixel, so that any part of the output has the same bits."""
        planes = []
        for k in range(extent[4], extent[5] + 1):
            plane = index_to_world.copy()
            plane[:, 3] = index_to_world @ (whole[0], whole[2], k + offset, 1.0)
            planes.append(plane)
        return np.array(planes)

    def _slices(self, index_to_world: np.ndarray, whole: Sequence[int], extent: Sequence[int], slab: tuple, coverage: bool
                ) -> Optional[tuple[np.ndarray, Optional[np.ndarray]]]:
        """Images and coverage of an extent, [depth, height, width]; None when the algorithm was asked to stop."""
        number, fraction, mode, trapezoid = slab
        width, height = whole[1] - whole[0] + 1, whole[3] - whole[2] + 1
        rows = slice(extent[2] - whole[2], extent[3] - whole[2] + 1)
        columns = slice(extent[0] - whole[0], extent[1] - whole[0] + 1)
        scattering = self._values["OutputMode"] == self.ScatteringField
        images, seen = [], []
        step = max(1, PIXELS_AT_ONCE // (width * height))
        for first in range(extent[4], extent[5] + 1, step):
            part = (*extent[:4], first, min(first + step - 1, extent[5]))
            joined = covered = None
            for i in range(number):
                planes = self._planes(index_to_world, whole, part, (i - 0.5 * (number - 1)) * fraction)
                image, weights = self._slicer._render(planes, (width, height), None, scattering, coverage)
                image = image[:, rows, columns]
                if number > 1 and mode >= 2:  # the mean, and the sum
                    share = 1.0 if mode == 3 else 1.0 / (number - trapezoid)
                    image = image * np.float32(share * (0.5 if trapezoid and i in (0, number - 1) else 1.0))
                join = (np.minimum, np.maximum, np.add, np.add)[mode]
                joined = image if joined is None else join(joined, image)
                if coverage:
                    weights = weights[:, rows, columns]
                    covered = weights if covered is None else np.maximum(covered, weights)
            images.append(joined)
            seen.append(covered)
            if not self._go_on((part[5] - extent[4] + 1) / (extent[5] - extent[4] + 1)):
                return None
        return np.concatenate(images), np.concatenate(seen) if coverage else None

    def _pixels(self, image: np.ndarray) -> np.ndarray:
        if self._values["OutputScalarType"] == VTK_UNSIGNED_CHAR:
            return np.clip(np.float32(255) * image + np.float32(0.5), 0, 255).astype(np.uint8)
        return image

    def _name(self) -> str:
        return "ScatteringField" if self._values["OutputMode"] == self.ScatteringField else "Intensity"


@properties(OutputDirection=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), MaximumDimension=256, ElevationSigma=0.0)
class vtkBigusVoxelizer(vtkBigusFieldToImage):
    """A volume of a field: voxels along OutputDirection, by default over the whole field, thin (ElevationSigma 0)."""

    defaults_of_geometry = {**vtkBigusFieldToImage.defaults_of_geometry, "OutputDimensions": None}
    locals().update(geometry("OutputDimensions", (1, 1, 1)))

    def __init__(self) -> None:
        super().__init__(("vtkImageData",))

    def _direction(self) -> np.ndarray:
        return np.array(self._values["OutputDirection"]).reshape(3, 3)

    def _grid(self) -> tuple[np.ndarray, np.ndarray, list[int]]:
        direction = self._direction()
        if not (np.abs(np.linalg.norm(direction, axis=0) - 1).max() < 1e-6 and abs(np.linalg.det(direction)) > 1e-3):
            raise _core.Error("OutputDirection must be a 3 x 3 matrix whose columns are unit vectors that span space.")
        spacing, origin, dimensions = (self._values[n] for n in ("OutputSpacing", "OutputOrigin", "OutputDimensions"))
        if spacing is None or origin is None or dimensions is None:
            # What was set replaces its part of the grid over the field, the rest keeps to its bounds.
            grid_spacing, grid_origin, grid_dimensions = _field_grid(
                self._updated_field(), direction, min(max(self._values["MaximumDimension"], 2), 4096))
            size = grid_spacing * (grid_dimensions - 1)
            centre = grid_origin + 0.5 * size
            if spacing is None:
                spacing = np.array(grid_spacing)
                for axis in range(3) if dimensions is not None else ():
                    if dimensions[axis] > 1 and size[axis] > 0:
                        spacing[axis] = size[axis] / (dimensions[axis] - 1)
            spacing = np.array(spacing, dtype=float)
            if dimensions is None:
                low = grid_origin if origin is None else np.linalg.inv(direction) @ np.array(origin)
                steps = (grid_origin + size - low) / np.abs(spacing)
                dimensions = np.clip(np.floor(steps + 0.5), 0, LARGEST_INDEX).astype(int) + 1
            if origin is None:
                origin = direction @ (centre - 0.5 * spacing * (np.array(dimensions) - 1))
        if min(dimensions) < 1:
            raise _core.Error(f"OutputDimensions are {dimensions[0]} x {dimensions[1]} x {dimensions[2]}; each must be at "
                              "least 1.")
        return np.array(spacing), np.array(origin), [0, dimensions[0] - 1, 0, dimensions[1] - 1, 0, dimensions[2] - 1]

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        outputs.GetInformationObject(0).Set(vtkDataObject.DIRECTION(), self._values["OutputDirection"], 9)
        return super().RequestInformation(request, inputs, outputs)

    def _render(self, outputs: Any, whole: Sequence[int], extent: Sequence[int], spacing: Sequence[float],
                origin: Sequence[float]) -> None:
        index_to_world = np.eye(4)
        index_to_world[:3, :3] = self._direction() @ np.diag(spacing)
        index_to_world[:3, 3] = origin
        found = self._slices(index_to_world, whole, extent, (1, 1.0, 2, False), False)
        if found is not None:
            image = self._image(outputs, 0, self._pixels(found[0]), self._name(), extent, spacing, origin)
            image.SetDirectionMatrix(self._values["OutputDirection"])


@properties(OutputDimensionality=3, TransformInputSampling=True, AutoCropOutput=False, SlabNumberOfSlices=1, SlabMode=2,
             SlabSliceSpacingFraction=1.0, SlabTrapezoidIntegration=False, CoverageThreshold=0.0, BackgroundLevel=0.0,
             GenerateCoverageOutput=True, GenerateStencilOutput=False)
class vtkBigusReslice(vtkBigusFieldToImage):
    """The image that a field predicts at any plane, placed as in vtkImageReslice.

    For an output index (i, j, k) its place in the field's frame, mm, is
    ResliceTransform(ResliceAxes (OutputOrigin + OutputSpacing (i, j, k))).

    Output 0 is the image, 1 the coverage, 2 a stencil of the pixels with coverage above CoverageThreshold (where
    GenerateStencilOutput is on), 3 the distance to the nearest of RecordedFrames (where they are set), mm.
    """

    defaults_of_geometry = {**vtkBigusFieldToImage.defaults_of_geometry, "OutputExtent": None}
    locals().update(geometry("OutputExtent", (0,) * 6))
    _PARTS = ("ResliceAxes", "ResliceTransform", "InformationInput", "RecordedFrames")

    def __init__(self) -> None:
        super().__init__(("vtkImageData", "vtkImageData", "vtkImageStencilData", "vtkImageData"))
        self.GetExecutive().SetOutputData(2, vtkImageStencilData())  # VTK's executive cannot make stencils by name
        self._parts = dict.fromkeys(self._PARTS)
        self._recorded, self._recorded_time = None, 0

    def SetResliceAxes(self, axes: Optional[vtkMatrix4x4]) -> None:
        self._set_part("ResliceAxes", axes)

    def GetResliceAxes(self) -> Optional[vtkMatrix4x4]:
        return self._parts["ResliceAxes"]

    def SetResliceTransform(self, transform: Any) -> None:
        self._set_part("ResliceTransform", transform)

    def GetResliceTransform(self) -> Any:
        return self._parts["ResliceTransform"]

    def SetInformationInput(self, image: Optional[vtkImageData]) -> None:
        self._set_part("InformationInput", image)

    def GetInformationInput(self) -> Optional[vtkImageData]:
        return self._parts["InformationInput"]

    def SetRecordedFrames(self, sweep: Optional[vtkImageData]) -> None:
        self._set_part("RecordedFrames", sweep)

    def GetRecordedFrames(self) -> Optional[vtkImageData]:
        return self._parts["RecordedFrames"]

    def _own_axes(self) -> vtkMatrix4x4:
        if self.GetResliceAxes() is None:
            self.SetResliceAxes(vtkMatrix4x4())
        return self.GetResliceAxes()

    def SetResliceAxesDirectionCosines(self, *cosines: Any) -> None:
        """Nine numbers, or three vectors, or a sequence of nine: the x, y and z axes of the output."""
        columns = np.array(cosines, dtype=float).reshape(3, 3)
        axes = self._own_axes()
        for column in range(3):
            for row in range(3):
                axes.SetElement(row, column, columns[column, row])
            axes.SetElement(3, column, 0)

    def GetResliceAxesDirectionCosines(self, cosines: list) -> None:
        """Fills the nine numbers of a list."""
        cosines[:] = matrix_of(self.GetResliceAxes())[:3, :3].T.ravel().tolist()

    def SetResliceAxesOrigin(self, *origin: Any) -> None:
        axes = self._own_axes()
        for row, value in enumerate(origin[0] if len(origin) == 1 else origin):
            axes.SetElement(row, 3, value)
        axes.SetElement(3, 3, 1)

    def GetResliceAxesOrigin(self, origin: list) -> None:
        """Fills the three numbers of a list."""
        origin[:] = matrix_of(self.GetResliceAxes())[:3, 3].tolist()

    def SetOutputToFrame(self, axes: vtkMatrix4x4, width: int, height: int) -> None:
        """Makes the output the image of a tracked frame: pixel (i, j) lies at axes (i, j, 0, 1), mm."""
        self.SetResliceAxes(axes)
        self.SetOutputSpacing(1, 1, 1)
        self.SetOutputOrigin(0, 0, 0)
        self.SetOutputExtent(0, width - 1, 0, height - 1, 0, 0)
        self.SetOutputDimensionality(2)

    def SetSlabModeToMin(self) -> None:
        self.SetSlabMode(0)

    def SetSlabModeToMax(self) -> None:
        self.SetSlabMode(1)

    def SetSlabModeToMean(self) -> None:
        self.SetSlabMode(2)

    def SetSlabModeToSum(self) -> None:
        self.SetSlabMode(3)

    def GetCoverageOutput(self) -> vtkImageData:
        return self.GetOutputDataObject(1)

    def GetCoverageOutputPort(self) -> Any:
        return self.GetOutputPort(1)

    def GetStencilOutput(self) -> vtkImageStencilData:
        return self.GetOutputDataObject(2)

    def GetStencilOutputPort(self) -> Any:
        return self.GetOutputPort(2)

    def GetDistanceOutput(self) -> vtkImageData:
        return self.GetOutputDataObject(3)

    def GetDistanceOutputPort(self) -> Any:
        return self.GetOutputPort(3)

    def _output_to_world(self) -> np.ndarray:
        matrix, transform = matrix_of(self.GetResliceAxes()), self.GetResliceTransform()
        if transform is not None:
            if not transform.IsA("vtkHomogeneousTransform"):
                raise _core.Error(f"ResliceTransform is a {transform.GetClassName()}, which may bend planes; give a linear "
                                  "transform, for example a vtkTransform.")
            transform.Update()
            matrix = matrix_of(transform.GetMatrix()) @ matrix
        if not np.isfinite(matrix).all():
            raise _core.Error("ResliceAxes or ResliceTransform holds a value that is not finite.")
        if matrix[3, 3] == 0 or np.abs(matrix[3, :3]).max() > 1e-12 * abs(matrix[3, 3]):
            raise _core.Error("ResliceAxes and ResliceTransform together are perspective (their last row is not 0 0 0 1); "
                              "a slice must stay evenly spaced.")
        return matrix / matrix[3, 3]

    def _grid(self) -> tuple[np.ndarray, np.ndarray, list[int]]:
        given = [self._values[name] for name in ("OutputSpacing", "OutputOrigin", "OutputExtent")]
        spacing, origin = np.array(self.GetOutputSpacing(), float), np.array(self.GetOutputOrigin(), float)
        extent = list(self.GetOutputExtent())
        if None in given:
            information = self.GetInformationInput()
            if information is not None:
                step, start = np.array(information.GetSpacing()), np.array(information.GetOrigin())
                limits = np.array(information.GetExtent(), float).reshape(3, 2)
            else:
                step, start, size = _field_grid(self._updated_field(), np.eye(3), DEFAULT_DIMENSION)
                limits = np.array([(0.0, n - 1) for n in size])
            # The grid is turned to the output's axes as vtkImageReslice does: spacing and size are averaged with the
            # squares of the direction cosines as weights, and the centre is kept.
            axes = matrix_of(self.GetResliceAxes())
            turn = axes if self._values["TransformInputSampling"] else np.eye(4)
            try:
                np.linalg.inv(axes)
                centre = np.linalg.inv(turn) @ np.append(start + limits.mean(axis=1) * step, 1.0)
            except np.linalg.LinAlgError:
                raise _core.Error("ResliceAxes cannot be inverted, so there is no default output geometry; set "
                                  "OutputSpacing, OutputOrigin and OutputExtent, or mend the axes.") from None
            crop = self._values["AutoCropOutput"]
            if crop:
                to_output = np.linalg.inv(self._output_to_world())
                corners = np.array([[start[j] + limits[j, corner >> j & 1] * step[j] for j in range(3)] + [1.0]
                                    for corner in range(8)]) @ to_output.T
                low, high = corners[:, :3].min(axis=0), corners[:, :3].max(axis=0)
            for i in range(3):
                weight = turn[:3, i] ** 2
                total = weight.sum()
                length = (weight * (limits[:, 1] - limits[:, 0]) * np.abs(step)).sum() / (total * math.sqrt(total))
                length = high[i] - low[i] if crop else length
                if given[0] is None:
                    spacing[i] = (weight * np.abs(step)).sum() / total
                if given[2] is None:
                    first = min(max((weight * limits[:, 0]).sum() / total, -LARGEST_INDEX), LARGEST_INDEX)
                    extent[2 * i] = math.floor(first + 0.5)
                    extent[2 * i + 1] = math.floor(extent[2 * i] + min(abs(length / spacing[i]), LARGEST_INDEX) + 0.5)
                if given[1] is None:
                    origin[i] = (low[i] - extent[2 * i] * spacing[i] if crop
                                 else centre[i] - 0.5 * (extent[2 * i] + extent[2 * i + 1]) * spacing[i])
        for axis in range(self._values["OutputDimensionality"], 3):
            extent[2 * axis] = extent[2 * axis + 1] = 0
            origin[axis] = 0
        return spacing, origin, extent

    def _fills_background(self) -> bool:
        return self._values["BackgroundLevel"] != 0 or self._values["CoverageThreshold"] > 0

    def _render(self, outputs: Any, whole: Sequence[int], extent: Sequence[int], spacing: Sequence[float],
                origin: Sequence[float]) -> None:
        values = self._values
        if not values["CoverageThreshold"] >= 0:
            raise _core.Error(f"CoverageThreshold is {values['CoverageThreshold']}; it must be at least 0.")
        index_to_world = self._output_to_world() @ np.array(
            [[spacing[0], 0, 0, origin[0]], [0, spacing[1], 0, origin[1]], [0, 0, spacing[2], origin[2]], [0, 0, 0, 1.0]])
        slab = (values["SlabNumberOfSlices"], values["SlabSliceSpacingFraction"], values["SlabMode"],
                values["SlabTrapezoidIntegration"])
        needs_coverage = self._fills_background() or values["GenerateCoverageOutput"] or values["GenerateStencilOutput"]
        found = self._slices(index_to_world, whole, extent, slab, needs_coverage)
        if found is None:
            return
        image, coverage = found
        if self._fills_background():
            level = values["BackgroundLevel"] / (255 if values["OutputScalarType"] == VTK_UNSIGNED_CHAR else 1)
            image = np.where(coverage > np.float32(values["CoverageThreshold"]), image, np.float32(level))
        place = (extent, spacing, origin)
        self._image(outputs, 0, self._pixels(image), self._name(), *place)
        if values["GenerateCoverageOutput"]:
            self._image(outputs, 1, coverage, "Coverage", *place)
        if values["GenerateStencilOutput"]:
            self._fill_stencil(vtkDataObject.GetData(outputs, 2), coverage > np.float32(values["CoverageThreshold"]), *place)
        if self.GetRecordedFrames() is not None:
            self._image(outputs, 3, self._distance(index_to_world, extent), "Distance", *place)

    def _fill_stencil(self, stencil: vtkImageStencilData, seen: np.ndarray, extent: Sequence[int],
                      spacing: Sequence[float], origin: Sequence[float]) -> None:
        stencil.SetOrigin(*origin)
        stencil.SetSpacing(*spacing)
        stencil.SetExtent(*extent)
        stencil.AllocateExtents()
        for z, plane in enumerate(seen):
            for y, row in enumerate(plane):
                edges = np.flatnonzero(np.diff(np.concatenate(([0], row.astype(np.int8), [0]))))
                for begin, end in edges.reshape(-1, 2):
                    stencil.InsertNextExtent(int(extent[0] + begin), int(extent[0] + end - 1), extent[2] + y, extent[4] + z)

    def _distance(self, index_to_world: np.ndarray, extent: Sequence[int]) -> np.ndarray:
        frames = self.GetRecordedFrames()
        if self._recorded is None or self._recorded_time != frames.GetMTime():
            self._recorded = sweep_of_image(frames)[0]
            self._recorded_time = frames.GetMTime()
        every = list(range(len(self._recorded)))
        width, height = extent[1] - extent[0] + 1, extent[3] - extent[2] + 1
        planes = self._planes(index_to_world, extent, extent, 0.0)
        return np.array([_core.distances(self._recorded, every, plane, width, height) for plane in planes])


# ----------------------------------------------------------------------------------------------------------------------
# Training


class vtkBigusTrainer(Algorithm):
    """Trains a field (output 0, vtkPolyData) on a sweep (vtkImageData), with a log (output 1, vtkTable).

    Every option of bigus.train is a property: SetHoldOut(8), AutomaticOff(), SetEngine("cpu"). A negative number leaves
    an open choice open. Several sweeps of one patient (AddInputDataObject(0, sweep)) train one field; frames are numbered on
    from one to the next. Input 1 may be a field to continue from.
    """

    def __init__(self) -> None:
        super().__init__(("vtkImageData", "vtkPolyData"), ("vtkPolyData", "vtkTable"))
        self._known = {option["name"]: option for option in _core.options()}
        self._options = {name: option["default"] for name, option in self._known.items()}
        self._forget()

    def _forget(self) -> None:
        self._result: Any = None
        self._frames: dict[str, vtkIntArray] = {}
        for name in ("TrainingFrames", "ValidationFrames", "HeldOutFrames"):
            self._frames[name] = vtkIntArray()
            self._frames[name].SetName(name)
        self._decisions = table_of({"Decision": [], "Choice": [], "Evidence": [], "Seconds": np.empty(0)})
        self._poses = vtkDoubleArray()

    def __getattr__(self, name: str) -> Any:
        known = self.__dict__.get("_known", {})
        if name[:3] in ("Set", "Get") and name[3:] in known:
            option = name[3:]
            return (lambda value: self._set(option, value)) if name[0] == "S" else (lambda: self._get(option))
        for ending, text in (("On", "on"), ("Off", "off")):
            if name.endswith(ending) and known.get(name[: -len(ending)], {}).get("values") == "on|off":
                return lambda: self.SetOption(name[: -len(ending)], text)
        raise AttributeError(f"vtkBigusTrainer has no {name}")

    def _set(self, name: str, value: Any) -> None:
        option = self._known[name]
        if isinstance(value, str) or value is None:
            text = value or ""
        elif option["open"] and value < 0:
            text = "auto"
        elif option["values"] == "on|off" and value in (0, 1):
            text = "on" if value else "off"
        else:
            text = _core.number_text(float(value))
        self.SetOption(name, text)

    def _get(self, name: str) -> Any:
        text, values = self._options[name], self._known[name]["values"]
        if values == "on|off":
            return int(text == "on")
        if not values[:1].isdigit():
            return text
        number = -1.0 if text == "auto" else float(text)
        return int(number) if number.is_integer() else number

    def SetOption(self, name: str, value: str) -> None:
        if name not in self._known:
            self._report("ErrorEvent", f"There is no option '{name}'.")
            return
        text = value or self._known[name]["default"]
        if self._options[name] != text:
            self._options[name] = text
            self.Modified()

    def GetOption(self, name: str) -> Optional[str]:
        return self._options.get(name)

    def GetNumberOfOptions(self) -> int:
        return len(self._known)

    def GetOptionName(self, index: int) -> Optional[str]:
        names = list(self._known)
        return names[index] if 0 <= index < len(names) else None

    def GetSettledOption(self, name: str) -> str:
        return self._result.options.get(name, "") if self._result else ""

    def SetInitialFieldConnection(self, port: Any) -> None:
        self.SetInputConnection(1, port)

    def SetInitialFieldData(self, field: Any) -> None:
        self.SetInputDataObject(1, field)

    def GetIterationsDone(self) -> int:
        return self._result.iterations if self._result else 0

    def GetSeconds(self) -> float:
        return self._result.seconds if self._result else 0.0

    def GetDevice(self) -> str:
        return self._result.device if self._result else ""

    def GetAborted(self) -> bool:
        return bool(self._result and self._result.aborted)

    def GetTrainingFrames(self) -> vtkIntArray:
        return self._frames["TrainingFrames"]

    def GetValidationFrames(self) -> vtkIntArray:
        return self._frames["ValidationFrames"]

    def GetHeldOutFrames(self) -> vtkIntArray:
        return self._frames["HeldOutFrames"]

    def GetCorrectedPoses(self) -> vtkDoubleArray:
        return self._poses

    def GetLog(self) -> vtkTable:
        return self.GetOutputDataObject(1)

    def GetDecisions(self) -> vtkTable:
        return self._decisions

    def FillInputPortInformation(self, port: int, info: Any) -> int:
        info.Set(vtkAlgorithm.INPUT_IS_OPTIONAL() if port == 1 else vtkAlgorithm.INPUT_IS_REPEATABLE(), 1)
        return super().FillInputPortInformation(port, info)

    def RequestUpdateExtent(self, request: Any, inputs: Any, outputs: Any) -> int:
        for connections in inputs:
            want_all(connections)
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        output, log = (vtkDataObject.GetData(outputs, port) for port in range(2))
        output.Initialize()
        log.Initialize()
        self._forget()
        self._error_code = NO_ERROR
        try:
            images = [vtkDataObject.GetData(inputs[0], k) for k in range(inputs[0].GetNumberOfInformationObjects())]
            sweeps, frames = [], []
            for number, image in enumerate(images, 1):
                try:
                    sweep, own = sweep_of_image(image)
                except _core.Error as error:
                    if len(images) == 1:
                        raise
                    raise _core.Error(f"Sequence {number}: {error}") from error
                sweeps.append(sweep)
                frames.append(own)
            start = inputs[1].GetNumberOfInformationObjects() and vtkDataObject.GetData(inputs[1], 0)
            start = field_of_polydata(start) if start else None
            try:
                result = train(sweeps, self._go_on, start, **self._options)
            except TrainingInterrupted as interrupt:
                result = interrupt.training
            self._result = result
            self._keep(result, images, frames)
            # Where the sweep came from, the filter, and how it was trained; each key once.
            lines = [line for image in images for line in provenance_of(image.GetFieldData())]
            lines = [*lines, "filter=vtkBigusTrainer", *result.field.provenance]
            provenance = {line.split("=", 1)[0]: line for line in lines}
            for name, array in self._frames.items():
                key = name[0].lower() + name[1:]
                provenance[key] = key + "=" + " ".join(str(array.GetValue(k)) for k in range(array.GetNumberOfValues()))
            result.field.provenance = list(provenance.values())
            output.ShallowCopy(polydata_of_field(result.field))
            columns = {"Iteration": "iteration", "Seconds": "seconds", "Loss": "loss", "ValidationPSNR": "validation_psnr",
                       "Gaussians": "gaussians", "Rate": "rate"}
            log.ShallowCopy(table_of({column: result.log[name] for column, name in columns.items()}))
        except Exception as error:
            output.Initialize()
            log.Initialize()
            return self._fail(error)
        return 1

    def _keep(self, result: Any, images: list[vtkImageData], frames: list[np.ndarray]) -> None:
        first = np.cumsum([0, *(image.GetDimensions()[2] for image in images)])
        numbers_of = np.concatenate([own + offset for own, offset in zip(frames, first)])
        for name, numbers in (("TrainingFrames", result.training_frames), ("ValidationFrames", result.validation_frames),
                              ("HeldOutFrames", result.held_out_frames)):
            for number in numbers:  # the caller knows frames by index in the image
                self._frames[name].InsertNextValue(int(numbers_of[number]))
        rows = result.decisions
        self._decisions = table_of({
            **{name: [row[name.lower()] for row in rows] for name in ("Decision", "Choice", "Evidence")},
            "Seconds": np.array([row["seconds"] for row in rows]),
        })
        used = np.cumsum([0, *map(len, frames)])
        poses = [poses_of_image(image, own, result.poses[begin : begin + len(own)])
                 for image, own, begin in zip(images, frames, used)]
        self._poses = to_vtk(np.concatenate(poses).reshape(-1, 16), "ImageToReference")
