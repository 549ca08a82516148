# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The field that follows the probe, in pure Python, with the names and properties of the C++ class."""

from __future__ import annotations

import math
from typing import Any, Callable, Optional

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _core
from .algorithm import Algorithm, Clamped, getters, guarded, matrix_of, properties
from .vtkdata import image_of, place_image, polydata_of_field, shifted_to_first_pixel, sweep_of_image

__all__ = ["vtkBigusLiveTrainer"]

TOGETHER = 16  # frames of a sweep that are handed over before the session is waited for, so that none is dropped
MOST = 2**31 - 1


def _times(sweep: Any, last: float) -> np.ndarray:
    """When frames were taken, s; without timestamps each a second after the one before, the first after `last`."""
    return np.arange(len(sweep)) + last + 1.0 if sweep.timestamps is None else sweep.timestamps


@properties(FinishTime=0.0, Engine="auto", Seed=Clamped(1, 0, MOST), Window=Clamped(64, 8, 1024),
            MaximumFrames=Clamped(2000, 8, 10**6), MaximumGaussians=Clamped(10**6, 1000, 2**26),
            MemoryLimit=Clamped(4.0, 0.001, 1e6))
@getters("_state", LastRefusal=("last_error", ""), **{f"NumberOf{name}": (key, 0) for name, key in (
    ("Frames", "frames"), ("PassedOverFrames", "passed_over"), ("DroppedFrames", "dropped"), ("RefusedFrames", "refused"),
    ("WaitingFrames", "waiting"), ("Gaussians", "gaussians"), ("Steps", "steps"))})
class vtkBigusLiveTrainer(Algorithm):
    """A field that grows while frames come, by AddFrame and AddSweep, or from a sweep that is played as input."""

    _inputs, _outputs, _optional = ("vtkImageData",), ("vtkPolyData",), (0,)

    def _begin(self) -> None:
        self._end_session()

    def _end_session(self) -> None:
        self._session: Optional[Any] = None
        self._last, self._handed, self._used = 0.0, 0, None

    def _live(self) -> Any:
        if self._session is None:
            numbers = (self._values[name] for name in ("Seed", "Window", "MaximumFrames", "MaximumGaussians", "MemoryLimit"))
            self._session = _core.LiveSession(self._values["Engine"] or "auto", *numbers)
        return self._session

    def SetFinishTime(self, seconds: float) -> None:
        seconds = min(max(float(seconds), 0.0), 1e6)
        if seconds != self._values["FinishTime"]:
            self._values["FinishTime"] = seconds
            self.Modified()

    @guarded
    def AddFrame(self, image: Optional[vtkImageData], image_to_reference: Optional[vtkMatrix4x4],
                 seconds: float) -> bool:
        if image is None or image.GetNumberOfPoints() == 0:
            raise _core.Error("Live frame: there is no image.")
        if image_to_reference is None:
            raise _core.Error("There is no matrix.")
        width, height, depth = image.GetDimensions()
        components, kind = image.GetNumberOfScalarComponents(), image.GetScalarType()
        if (kind, components, depth) != (VTK_UNSIGNED_CHAR, 1, 1):
            raise _core.Error(
                f"Live frame: the image has {components} components of {image.GetScalarTypeAsString()} and {depth} "
                "slices; it must have one of unsigned char, and one slice. Use vtkImageLuminance for colours, "
                "vtkImageShiftScale for other types.")
        pose = shifted_to_first_pixel(matrix_of(image_to_reference), image.GetExtent())
        pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width)
        self._live().add(np.ascontiguousarray(pixels), np.ascontiguousarray(pose), float(seconds))
        self._last = float(seconds)
        return True

    def _hand_over(self, sweep: Any, times: np.ndarray, first: int, last: int,
                   go_on: Optional[Callable[[float], bool]] = None) -> int:
        """Frames first to last - 1, when none of them waits any more; how many, fewer when `go_on` said so."""
        session = self._live()
        for begin in range(first, last, TOGETHER):
            if go_on is not None and not go_on((begin - first) / (last - first)):
                return begin - first
            for k in range(begin, min(begin + TOGETHER, last)):
                pixels = sweep.frames[k]
                if pixels.dtype != np.uint8:
                    pixels = np.floor(255 * pixels + np.float32(0.5)).astype(np.uint8)
                session.add(np.ascontiguousarray(pixels), np.array(sweep.poses[k], order="C"), float(times[k]))
                self._last = float(times[k])
            session.wait()
        return last - first

    @guarded
    def AddSweep(self, image: Optional[vtkImageData]) -> bool:
        sweep, _ = sweep_of_image(image)
        self._hand_over(sweep, _times(sweep, self._last), 0, len(sweep))
        return True

    @guarded
    def RenderSlice(self, image_to_reference: Optional[vtkMatrix4x4], width: int, height: int,
                    slice: Optional[vtkImageData]) -> bool:
        if image_to_reference is None:
            raise _core.Error("There is no matrix.")
        if slice is None:
            raise _core.Error("There is no image to render into.")
        pose = matrix_of(image_to_reference)
        picture = image_of(self._live().render(np.ascontiguousarray(pose), width, height)[None])
        place_image(picture, pose)
        slice.Initialize()
        slice.ShallowCopy(picture)
        return True

    def Reset(self) -> None:
        self._end_session()
        self.Modified()

    @property
    def _state(self) -> dict:
        return {} if self._session is None else self._session.state()

    def RequestInformation(self, request: Any, inputs: Any, outputs: Any) -> int:
        pipeline, info = vtkStreamingDemandDrivenPipeline, outputs.GetInformationObject(0)
        info.Remove(pipeline.TIME_STEPS())
        info.Remove(pipeline.TIME_RANGE())
        if self.GetNumberOfInputConnections(0) == 0:
            return 1
        try:
            # Times are data of the sweep, so they are known once it is there.
            sweep, _ = sweep_of_image(self._update_input())
            times = sorted(set(np.array(_times(sweep, -1.0)).tolist()))
            info.Set(pipeline.TIME_STEPS(), times, len(times))
            info.Set(pipeline.TIME_RANGE(), (times[0], times[-1]), 2)
        except _core.Error:
            pass  # what is no sweep has no times; RequestData says what is wrong
        return 1

    def _follow_input(self, image: vtkImageData, until: float) -> bool:
        """Hands over what the input has up to a time and the session has not had; True when that is all of it."""
        sweep, _ = sweep_of_image(image)
        times = _times(sweep, -1.0)
        late = np.flatnonzero(np.asarray(times) > until)
        last = int(late[0]) if len(late) else len(times)
        options = {name: value for name, value in self._values.items() if name != "FinishTime"}
        used = (image.GetMTime(), options)
        if last < self._handed or used != self._used:
            self._end_session()
            self._used = used
        self._handed += self._hand_over(sweep, times, self._handed, last, self._go_on)
        return self._handed == len(times)

    def _fill(self, data: list, outputs: list) -> None:
        pipeline, info = vtkStreamingDemandDrivenPipeline, self.GetOutputInformation(0)
        image = data[0][0] if data[0] else None
        time = info.Get(pipeline.UPDATE_TIME_STEP()) if info.Has(pipeline.UPDATE_TIME_STEP()) else math.inf
        try:
            is_complete = image is None or self._follow_input(image, time)
            session, seconds = self._live(), self._values["FinishTime"]
            field = session.finish(seconds, self._go_on) if seconds > 0 and is_complete else session.field()
            outputs[0].ShallowCopy(polydata_of_field(field))
            if image is not None and not math.isinf(time):
                outputs[0].GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), time)
        except Exception:
            if image is not None:
                self._end_session()  # so that the next update begins anew
            raise
