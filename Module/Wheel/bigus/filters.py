# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""VTK's pipeline filters in pure Python, with the names, properties and geometry of the C++ classes. Needs the package vtk.

bigus.vtkBigusReslice and the others come from here when they are asked for. Where the C++ build is installed, its
wrapped classes have the same names. What each property means stands in the documentation of the C++ class.
"""

from __future__ import annotations

import math
import os
import warnings
from typing import Any, Callable, Optional, Sequence

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.util.vtkConstants import vtkImageScalarTypeNameMacro
from vtkmodules.vtkCommonCore import VTK_FLOAT, VTK_UNSIGNED_CHAR, vtkDoubleArray
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm, vtkExecutive, vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkImageStencilData

from . import _core, common
from .algorithm import Algorithm, Choice, Clamped, Open, add_methods, extent_of, fills, getters, guarded, infos_of, input_ports
from .algorithm import matrix_of, parts, ports, properties, table_of, table_of_rows, tell_image, transform_matrix
from .functions import TrainingInterrupted, read_field, train, write
from .names import snake_case, vtk_case
from .settings import FIELD_OUTPUT, SEQUENCE, SEQUENCE_OUTPUT, SLICER
from .tasks import value_text
from .vtkdata import add_arrays, field_of_polydata, image_of, polydata_of_field, poses_of_image, provenance_of, share_label_names
from .vtkdata import sweep_of_image, to_vtk


# ----------------------------------------------------------------------------------------------------------------------
# Readers and writers


def _file_name(algorithm: Algorithm) -> str:
    if not algorithm._values["FileName"]:
        raise _core.Error("FileName is not set")
    return algorithm._values["FileName"]


def _settings(algorithm: Algorithm) -> dict[str, Any]:
    return {name: value for name, value in algorithm._values.items() if name != "FileName"}


class _Source(Algorithm):
    """A reader: the file is read once, when information is asked for."""

    def _begin(self) -> None:
        self._time, self._data = 0, None
        self._found: dict[str, Any] = {}

    @guarded
    def _load(self) -> int:
        if self._data is None or self._time != self.GetMTime():
            self._data = None
            self._data = self._read(_file_name(self))
            self._time = self.GetMTime()
        return 1

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        vtkDataObject.GetData(outputs, 0).Initialize()
        if not self._load():
            return 0
        vtkDataObject.GetData(outputs, 0).ShallowCopy(self._data)
        return 1


@properties(FileName="")
class vtkBigusFieldReader(_Source):
    """Reads a Gaussian field (.vtp, .ply) as vtkPolyData."""

    _outputs = ("vtkPolyData",)

    def _read(self, name: str) -> vtkPolyData:
        return polydata_of_field(read_field(name))

    def CanReadFile(self, name: str) -> int:
        return int(_core.is_field(os.fspath(name)))


@properties(FileName="", **{**SEQUENCE, "ClipMode": Choice(0, ("None", "Rectangle", "Fan"))}, KeepRejectedFrames=False,
            RequirePoses=True)
@getters("_found", NumberOfFramesInFile=("frames_in_file", 0), NumberOfAcceptedFrames=("accepted_frames", 0),
         RejectionSummary=("rejection_summary", ""), TransformChain=("transform_chain", ""), Format=("format", ""),
         Encoding=("encoding", "raw"), ElementType=("element_type", ""), Orientation=("orientation", ""),
         UsedPixelRange=("used_pixel_range", 0.0), NumberOfMadeAxes=("made_axes", 0),
         SpacingDoubt=("spacing_doubt", ""), FrameSize=("frame_size", (0, 0)), PixelSize=("pixel_size", (0.0,) * 2),
         PlaneSpacing=("plane_spacing", (0.0,) * 3), PathLength=("path_length", 0.0), Bounds=("bounds", (0.0,) * 6))
class vtkBigusSequenceReader(_Source):
    """Reads a tracked sweep as an image stack (x, y, frame); field data say where its frames lie.

    ImageToReference [16, row-major], Status, SourceFrame, Timestamp where every frame has one, and Mask. Pixels keep the
    file's type. The whole file is read when information is asked for.
    """

    CLIP_NONE, CLIP_RECTANGLE, CLIP_FAN = range(3)

    _outputs = ("vtkImageData",)

    def _read(self, name: str) -> vtkImageData:
        self._found = {}
        found = _core.read_sequence(name, **_settings(self))
        image = image_of(found["pixels"])
        poses, mask = found["poses"], found["mask"]
        add_arrays(image.GetFieldData(), {
            "ImageToReference": None if poses is None else poses.reshape(-1, 16), "Status": found["status"],
            "SourceFrame": found["source_frames"], "Timestamp": found["timestamps"], "Mask": None if mask is None else mask.ravel()})
        for caution in found["warnings"]:
            self._report("WarningEvent", caution)
        self._found = found
        return image

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        if not self._load():
            return 0
        scalars = self._data.GetPointData().GetScalars()
        tell_image(outputs.GetInformationObject(0), self._data.GetExtent(), scalars.GetDataType())
        return 1

    def CanReadFile(self, name: str) -> int:
        return int(_core.is_sequence(os.fspath(name), not self._values["RequirePoses"]))

    def GetNumberOfRejectedFrames(self) -> int:
        return self.GetNumberOfFramesInFile() - self.GetNumberOfAcceptedFrames()

    def _times(self) -> Optional[np.ndarray]:
        times = self._found.get("timestamps")
        return None if times is None else times[self._found["status"] != 0]

    def GetHasTimestamps(self) -> bool:
        return self._times() is not None

    def GetDuration(self) -> float:
        times = self._times()
        return 0.0 if times is None else float(times[-1] - times[0])


class _Writer(Algorithm):
    _of = staticmethod(field_of_polydata)  # what is written

    @guarded
    def Write(self) -> int:
        """1 when the file has been written; else 0, with an error, and no file is left behind."""
        name = _file_name(self)
        write(self._of(self._update_input()), name, **_settings(self))
        return 1


@properties(FileName="", **FIELD_OUTPUT)
class vtkBigusFieldWriter(_Writer):
    """Writes a field to .vtp (exact) or .ply (for viewers of splats)."""

    _inputs = ("vtkPolyData",)


@properties(FileName="", **SEQUENCE_OUTPUT)
class vtkBigusSequenceWriter(_Writer):
    """Writes a sweep to .igs.mha; rejected frames (Status 0) are left out."""

    _inputs = ("vtkImageData",)
    _of = staticmethod(lambda image: sweep_of_image(image)[0])


# ----------------------------------------------------------------------------------------------------------------------
# Images of a field


@properties(OutputSpacing=Open((1.0,) * 3), OutputOrigin=Open((0.0,) * 3),
            OutputMode=Choice(0, ("Intensity", "ScatteringField", "LabelShare")), LabelValue=Clamped(1, 1, 255),
            OutputScalarType=VTK_FLOAT, MaximumOutputPixels=1 << 29, GenerateStandardErrorOutput=False, **SLICER)
class vtkBigusFieldToImage(Algorithm):
    """What filters share that render a field: OutputSpacing, OutputOrigin, OutputMode, Engine and more."""

    Intensity, ScatteringField, LabelShare = 0, 1, 2

    _inputs: Sequence[str] = ("vtkPolyData",)
    _sees_directions = True

    def _begin(self) -> None:
        self._field, self._slicer = None, None

    def SetOutputScalarTypeToFloat(self) -> None:
        self.SetOutputScalarType(VTK_FLOAT)

    def SetOutputScalarTypeToUnsignedChar(self) -> None:
        self.SetOutputScalarType(VTK_UNSIGNED_CHAR)

    def GetDevice(self) -> str:
        return self._slicer.device if self._slicer else ""

    def _load_field(self, polydata: Any) -> Any:
        self._field = None
        self._field = self._while("field", polydata and polydata.GetMTime(), lambda: field_of_polydata(polydata))
        return self._field

    def _updated_field(self) -> Any:
        return self._load_field(self._update_input())

    @guarded
    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        kind = self._values["OutputScalarType"]
        spacing, origin, extent = self._grid(self._values["OutputSpacing"], self._values["OutputOrigin"])
        _core.check_pixel_type(vtkImageScalarTypeNameMacro(kind), self._values["OutputMode"] == self.ScatteringField)
        for port, info in enumerate(infos_of(outputs)):
            tell_image(info, extent, VTK_FLOAT if port else kind, spacing, origin)
            info.Set(vtkAlgorithm.CAN_PRODUCE_SUB_EXTENT(), 1)
        return 1

    def _wanted(self, request: Any, infos: list, whole: Sequence[int]) -> Optional[list]:
        """The extent that the asking port wants with what consumers of the others want, so that a filter connected to two
        outputs finds both; None when nothing is wanted."""
        asking = max(0, request.Get(vtkExecutive.FROM_OUTPUT_PORT()))
        wanted = [extent_of(info, vtkStreamingDemandDrivenPipeline.UPDATE_EXTENT()) for port, info in enumerate(infos)
                  if port == asking or vtkExecutive.CONSUMERS().Length(info) > 0]
        wanted = [w for w in wanted if all(w[2 * a] <= w[2 * a + 1] for a in range(3))]
        return [max(min(w[k] for w in wanted), whole[k]) if k % 2 == 0 else min(max(w[k] for w in wanted), whole[k])
                for k in range(6)] if wanted else None

    def RequestData(self, request: Any, inputs: Any, outputs: Any) -> int:
        infos = infos_of(outputs)
        whole = extent_of(infos[0], vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT())
        self._whole, self._extent = whole, self._wanted(request, infos, whole)
        self._place = [[infos[0].Get(key, k) for k in range(3)] for key in (vtkDataObject.SPACING(), vtkDataObject.ORIGIN())]
        return super().RequestData(request, inputs, outputs)

    def _fill(self, data: list, outputs: list) -> None:
        if self._extent is None:
            return
        _core.check_output_size(self._extent, self._values["MaximumOutputPixels"])
        field = self._load_field(data[0][0])
        is_share = self._values["OutputMode"] == self.LabelShare
        if self._values["GenerateStandardErrorOutput"] and is_share:
            raise _core.Error("GenerateStandardErrorOutput: it is that of an intensity; set OutputMode to Intensity.")
        if self._values["GenerateStandardErrorOutput"] and not field.kept_error:
            raise _core.Error("GenerateStandardErrorOutput: the field has no array StandardError; bigus train keeps it in a .vtp.")
        settings = (*(self._values[name] for name in SLICER), self._sees_directions, self._values["LabelValue"] if is_share else None)
        self._slicer = None  # let go of before there is another
        self._slicer = self._while("slicer", (data[0][0].GetMTime(), settings), lambda: _core.Renderer(field, *settings))
        self._draw(outputs)

    def _image(self, image: vtkImageData, pixels: np.ndarray, name: str) -> None:
        image.SetExtent(*self._extent)
        image.SetSpacing(*self._place[0])
        image.SetOrigin(*self._place[1])
        image.GetPointData().SetScalars(to_vtk(pixels, name))

    def _draw_image(self, output: Any, index_to_world: np.ndarray, slab: tuple = (1, 1.0, 2, False), seen: tuple = (0.0, 0.0),
                    coverage: bool = False, stencil: bool = False) -> Any:
        """Fills the image; coverage and runs of seen pixels, or None when the algorithm was asked to stop."""
        scattering = self._values["OutputMode"] == self.ScatteringField
        is_bytes = self._values["OutputScalarType"] == VTK_UNSIGNED_CHAR
        share = 0.5 if self._values["GenerateStandardErrorOutput"] else 1.0  # of the work
        found = self._slicer.render_part(index_to_world, self._whole, self._extent, scattering, is_bytes, slab, seen, coverage,
                                         stencil, lambda part: self._go_on(share * part))
        if found is None:
            return None
        if share < 1:
            shows = not scattering and not is_bytes and slab[0] == 1 and seen == (0.0, 0.0)  # single planes as they are
            sigma = self._slicer.standard_error_part(self._field.kept_error, index_to_world, self._whole, self._extent,
                                                     found[0] if shows else None, lambda part: self._go_on(share * (1 + part)))
            if sigma is None:
                return None
            self._image(self.GetStandardErrorOutput(), sigma, "StandardError")
        self._image(output, found[0], self.GetOutputModeAsString())
        return found[1:]


@properties(OutputDimensions=Open((1, 1, 1)), OutputDirection=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            MaximumDimension=Clamped(256, 2, 4096), ElevationSigma=0.0)
@ports(StandardErrorOutput=1)
class vtkBigusVoxelizer(vtkBigusFieldToImage):
    """A volume of a field: voxels along OutputDirection, by default over the whole field, thin (ElevationSigma 0)."""

    _sees_directions = False

    _outputs = ("vtkImageData", "vtkImageData")

    def _grid(self, spacing: Any, origin: Any) -> tuple:
        return _core.voxel_grid(spacing, origin, *(self._values[name] for name in (
            "OutputDimensions", "OutputDirection", "MaximumDimension")), self._updated_field)

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        for info in infos_of(outputs):
            info.Set(vtkDataObject.DIRECTION(), self._values["OutputDirection"], 9)
        return super().RequestInformation(request, inputs, outputs)

    def _draw(self, outputs: list) -> None:
        index_to_world = np.eye(4)
        index_to_world[:3, :3] = np.array(self._values["OutputDirection"]).reshape(3, 3) * self._place[0]
        index_to_world[:3, 3] = self._place[1]
        if self._draw_image(outputs[0], index_to_world) is not None:
            for output in outputs:
                output.SetDirectionMatrix(self._values["OutputDirection"])


@properties(OutputExtent=Open((0,) * 6), OutputDimensionality=Clamped(3, 0, 3), TransformInputSampling=True,
            AutoCropOutput=False, SlabNumberOfSlices=Clamped(1, 1, 4096), SlabMode=Choice(2, ("Min", "Max", "Mean", "Sum")),
            SlabSliceSpacingFraction=1.0, SlabTrapezoidIntegration=False, CoverageThreshold=0.0, BackgroundLevel=0.0,
            GenerateCoverageOutput=True, GenerateStencilOutput=False, GenerateLabelOutput=False)
@parts("ResliceAxes", "ResliceTransform", "InformationInput", "RecordedFrames")
@ports(CoverageOutput=1, StencilOutput=2, DistanceOutput=3, StandardErrorOutput=4, LabelOutput=5)
class vtkBigusReslice(vtkBigusFieldToImage):
    """The image that a field predicts at any plane, placed as in vtkImageReslice.

    For an output index (i, j, k) its place in the field's frame, mm, is
    ResliceTransform(ResliceAxes (OutputOrigin + OutputSpacing (i, j, k))).

    Output 0 is the image, 1 the coverage, 2 a stencil of the pixels with coverage above CoverageThreshold (where
    GenerateStencilOutput is on), 3 the distance to the nearest of RecordedFrames (where they are set), mm, 4 the standard
    error (where GenerateStandardErrorOutput is on), 5 which label each pixel has (where GenerateLabelOutput is on).
    """

    _outputs = ("vtkImageData", "vtkImageData", "vtkImageStencilData", *("vtkImageData",) * 3)

    def _begin(self) -> None:
        super()._begin()
        self.GetExecutive().SetOutputData(2, vtkImageStencilData())  # VTK's executive cannot make stencils by name

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        found = super().RequestInformation(request, inputs, outputs)
        vtkDataObject.SetPointDataActiveScalarInfo(outputs.GetInformationObject(5), VTK_UNSIGNED_CHAR, 1)
        return found

    def _own_axes(self) -> vtkMatrix4x4:
        if self.GetResliceAxes() is None:
            self.SetResliceAxes(vtkMatrix4x4())
        return self.GetResliceAxes()

    def SetResliceAxesDirectionCosines(self, *cosines: Any) -> None:
        axes = self._own_axes()
        for column, cosine in enumerate(np.array(cosines, dtype=float).reshape(3, 3)):
            for row in range(3):
                axes.SetElement(row, column, cosine[row])
            axes.SetElement(3, column, 0)

    @fills
    def GetResliceAxesDirectionCosines(self) -> Any:
        return matrix_of(self.GetResliceAxes())[:3, :3].T.ravel().tolist()

    def SetResliceAxesOrigin(self, *origin: Any) -> None:
        axes = self._own_axes()
        for row, value in enumerate(origin[0] if len(origin) == 1 else origin):
            axes.SetElement(row, 3, value)
        axes.SetElement(3, 3, 1)

    @fills
    def GetResliceAxesOrigin(self) -> Any:
        return matrix_of(self.GetResliceAxes())[:3, 3].tolist()

    def SetOutputToFrame(self, axes: vtkMatrix4x4, width: int, height: int) -> None:
        self.SetResliceAxes(axes)
        self.SetOutputSpacing(1, 1, 1)
        self.SetOutputOrigin(0, 0, 0)
        self.SetOutputExtent(0, width - 1, 0, height - 1, 0, 0)
        self.SetOutputDimensionality(2)

    def GetStandardErrorOfMean(self, where: Optional[vtkImageData] = None) -> float:
        sigma = self.GetStandardErrorOutput()
        size = sigma.GetDimensions()
        values = sigma.GetPointData().GetScalars()
        fits = where is None or (where.GetPointData().GetScalars() is not None and where.GetScalarType() == VTK_UNSIGNED_CHAR
                                 and where.GetNumberOfScalarComponents() == 1 and where.GetDimensions() == size)
        if self._field is None or not self._field.kept_error or values is None or not fits:
            self._report("ErrorEvent", "GetStandardErrorOfMean: output 4 must be filled, and the pixels to take be an image of unsigned "
                                       "char of the same dimensions.")
            return math.nan
        shape = size[::-1]
        chosen = np.ones(shape, np.uint8) if where is None else vtk_to_numpy(where.GetPointData().GetScalars()).reshape(shape)
        place = _core.index_to_world(matrix_of(self.GetResliceAxes()), self._transform(), sigma.GetSpacing(), sigma.GetOrigin())
        return _core.standard_error_of_mean(self._field.kept_error, place, vtk_to_numpy(values).reshape(shape), chosen)

    def _transform(self) -> Optional[np.ndarray]:
        return transform_matrix(self.GetResliceTransform(), "ResliceTransform", "planes")

    def _input_grid(self) -> Any:
        image = self.GetInformationInput()
        return self._updated_field() if image is None else (image.GetSpacing(), image.GetOrigin(), image.GetExtent())

    def _grid(self, spacing: Any, origin: Any) -> tuple:
        values, extent = self._values, self._values["OutputExtent"]
        crops = values["AutoCropOutput"] and None in (spacing, origin, extent)
        return _core.reslice_grid(spacing, origin, extent, matrix_of(self.GetResliceAxes()), self._transform() if crops else None,
                                  values["TransformInputSampling"], crops, values["OutputDimensionality"], self._input_grid)

    def _draw(self, outputs: list) -> None:
        values = self._values
        index_to_world = _core.index_to_world(matrix_of(self.GetResliceAxes()), self._transform(), *self._place)
        slab, seen = (tuple(values[name] for name in names) for names in (
            ("SlabNumberOfSlices", "SlabSliceSpacingFraction", "SlabMode", "SlabTrapezoidIntegration"),
            ("CoverageThreshold", "BackgroundLevel")))
        found = self._draw_image(outputs[0], index_to_world, slab, seen, values["GenerateCoverageOutput"],
                                 values["GenerateStencilOutput"])
        if found is None:
            return
        if values["GenerateCoverageOutput"]:
            self._image(outputs[1], found[0], "Coverage")
        if values["GenerateStencilOutput"]:
            stencil = outputs[2]
            stencil.SetSpacing(*self._place[0])
            stencil.SetOrigin(*self._place[1])
            stencil.SetExtent(*self._extent)
            stencil.AllocateExtents()
            for run in found[1].tolist():
                stencil.InsertNextExtent(*run)
        frames = self.GetRecordedFrames()
        if frames is not None:
            recorded = self._while("recorded", frames.GetMTime(), lambda: sweep_of_image(frames)[0])
            self._image(outputs[3], _core.grid_distances(recorded, index_to_world, self._extent), "Distance")
        if values["GenerateLabelOutput"]:
            field, settings = self.GetInput(), (values["Engine"] or "auto", values["ElevationSigma"])
            labelled = self._while("labels", (field.GetMTime(), settings), lambda: _core.LabelRenderer(self._field, *settings))
            self._image(outputs[5], labelled.render_part(index_to_world, self._whole, self._extent), "Labels")
            share_label_names(field, outputs[5])


# ----------------------------------------------------------------------------------------------------------------------
# Training


_FRAMES = ("TrainingFrames", "ValidationFrames", "HeldOutFrames")


@getters("_about", IterationsDone=("iterations", 0), Seconds=("seconds", 0.0), Device=("device", ""), Aborted=("aborted", False),
         Finished=("finished", False), **{name: (name, None) for name in (*_FRAMES, "CorrectedPoses", "Decisions")})
@properties(KeepStandardError=True)
@ports(Log=1)
@input_ports(InitialField=1)
class vtkBigusTrainer(Algorithm):
    """Trains a field (output 0, vtkPolyData) on a sweep (vtkImageData), with a log (output 1, vtkTable).

    Every option of bigus.train is a property: SetHoldOut(8), AutomaticOff(), SetEngine("cpu"). A negative number leaves
    an open choice open. Several sweeps of one patient (AddInputDataObject(0, sweep)) train one field; frames are numbered on
    from one to the next. Input 1 may be a field to continue from.
    """

    _inputs, _outputs = ("vtkImageData", "vtkPolyData"), ("vtkPolyData", "vtkTable")
    _repeatable, _optional = (0,), (1,)
    _known = {option["name"]: option for option in _core.options()}

    def _begin(self) -> None:
        self._options = {name: option["default"] for name, option in self._known.items()}
        self._forget()

    def _forget(self) -> None:
        self._about: dict[str, Any] = {"CorrectedPoses": vtkDoubleArray(), "Decisions": table_of_rows([], **common.DECISION_COLUMNS),
                                       **{name: to_vtk(np.empty(0, np.int32), name) for name in _FRAMES}}  # fmt: skip

    def _set(self, name: str, value: Any) -> None:
        option = self._known[name]
        if isinstance(value, str) or value is None:
            self.SetOption(name, value or "")
        elif option["open"] and value < 0:
            self.SetOption(name, "auto")
        else:
            self.SetOption(name, value_text(name, bool(value) if option["type"] == "bool" and value in (0, 1) else value))

    def _get(self, name: str) -> Any:
        kind, text = self._known[name]["type"], self._options[name]
        if kind == "str":
            return text
        if text == "auto":
            return -1
        number = float(text == "on") if kind == "bool" else float(text)
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
        return self._about.get("options", {}).get(name, "")

    def _fill(self, data: list, outputs: list) -> None:
        self._forget()
        images, sweeps, frames = data[0], [], []
        for number, image in enumerate(images, 1):
            try:
                sweep, own = sweep_of_image(image)
            except _core.Error as error:
                if len(images) == 1:
                    raise
                raise _core.Error(f"Sequence {number}: {error}") from error
            sweeps.append(sweep)
            frames.append(own)
        with warnings.catch_warnings(record=True) as cautions:
            warnings.simplefilter("always")
            try:
                result = train(sweeps, self._go_on, field_of_polydata(data[1][0]) if data[1] else None,
                               keep_standard_error=self._values["KeepStandardError"], **self._options)
            except TrainingInterrupted as interrupt:
                result = interrupt.training
        for caution in cautions:
            self._report("WarningEvent", str(caution.message))
        self._about.update(vars(result))
        self._keep(result, images, frames)
        # Where the sweep came from, the filter, and how it was trained; each key once.
        lines = [line for image in images for line in provenance_of(image.GetFieldData())]
        lines = [*lines, "filter=vtkBigusTrainer", *result.field.provenance]
        provenance = {line.split("=", 1)[0]: line for line in lines}
        for name in _FRAMES:
            key = name[0].lower() + name[1:]
            provenance[key] = key + "=" + " ".join(map(str, vtk_to_numpy(self._about[name])))
        result.field.provenance = list(provenance.values())
        outputs[0].ShallowCopy(polydata_of_field(result.field))
        columns = {"ValidationPSNR" if name == "validation_psnr" else vtk_case(name): values for name, values in result.log.items()}
        outputs[1].ShallowCopy(table_of(columns))

    def _keep(self, result: Any, images: list[vtkImageData], frames: list[np.ndarray]) -> None:
        first = np.cumsum([0, *(image.GetDimensions()[2] for image in images)])
        numbers_of = np.concatenate([own + offset for own, offset in zip(frames, first)])
        for name in _FRAMES:  # the caller knows frames by index in the image
            own_numbers = np.array(self._about[snake_case(name)], dtype=int)
            self._about[name] = to_vtk(numbers_of[own_numbers].astype(np.int32), name)
        self._about["Decisions"] = table_of_rows(result.decisions, **common.DECISION_COLUMNS)
        used = np.cumsum([0, *map(len, frames)])
        poses = [poses_of_image(image, own, result.poses[begin : begin + len(own)])
                 for image, own, begin in zip(images, frames, used)]
        self._about["CorrectedPoses"] = to_vtk(np.concatenate(poses).reshape(-1, 16), "ImageToReference")


def _add_option(name: str, is_switch: bool) -> None:
    methods: dict[str, Callable] = {"Set" + name: lambda self, value: self._set(name, value),
                                    "Get" + name: lambda self: self._get(name)}
    if is_switch:
        methods.update({name + "On": lambda self: self._set(name, True), name + "Off": lambda self: self._set(name, False)})
    add_methods(vtkBigusTrainer, methods)


for _option in _core.options():
    _add_option(_option["name"], _option["type"] == "bool")
