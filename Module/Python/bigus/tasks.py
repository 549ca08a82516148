# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""How VTK's classes do what functions.py offers, and labels."""

from __future__ import annotations

import os
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkTable
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _update, common
from .arrays import _pixels, image
from .common import require
from .names import snake_case
from .pipeline import set_properties, update, update_alone
from .vtkBigusFilters import vtkBigusFieldLabeler, vtkBigusImageMetrics, vtkBigusPoseCorrection, vtkBigusReslice, vtkBigusSweepInspection
from .vtkBigusFilters import vtkBigusTrainer
from .vtkBigusIO import vtkBigusFieldReader, vtkBigusFieldWriter, vtkBigusLabelReader, vtkBigusPoseReader, vtkBigusSequenceReader
from .vtkBigusIO import vtkBigusSequenceWriter

Field, Sweep = vtkPolyData, vtkImageData
OPTIONS: dict[str, dict[str, Any]] = {}  # for signatures; help() of the classes has them here
OPTION_LINES = ["    help(bigus.vtkBigusTrainer) lists them."]


def _read(reader: Any, path: Union[str, os.PathLike], properties: dict[str, Any]) -> Any:
    reader.SetFileName(common.path_text(path))
    set_properties(reader, properties)
    return update_alone(reader).GetOutput()


def read_sweep(name: str, properties: dict[str, Any]) -> vtkImageData:
    return _read(vtkBigusSequenceReader(), name, properties)


def read_field(name: str, properties: dict[str, Any]) -> vtkPolyData:
    return _read(vtkBigusFieldReader(), name, properties)


def read_stack(name: str) -> tuple[np.ndarray, Optional[np.ndarray]]:
    sequence = read_sweep(name, {"RequirePoses": False, "AutoMask": False})
    times = sequence.GetFieldData().GetArray("Timestamp")
    return _pixels(sequence), None if times is None else vtk_to_numpy(times).copy()


def read_spacing(name: str) -> tuple[float, float]:
    reader = vtkBigusSequenceReader()
    reader.SetFileName(name)
    reader.RequirePosesOff()
    reader.UpdateInformation()
    spacing = [0.0, 0.0]
    reader.GetHeaderSpacing(spacing)
    return spacing[0], spacing[1]


def read_planes(name: str, spacing: float, is_lps: bool, properties: dict[str, Any]) -> list:
    reader = vtkBigusPoseReader()
    reader.SetFileName(name)
    reader.SetPixelSpacing(spacing)
    reader.SetWorldCoordinateSystem(reader.LPS if is_lps else reader.RAS)
    set_properties(reader, properties)
    table = update(reader).GetOutput()
    columns = [table.GetColumnByName(name) for name in ("ImageToReference", "Size", "SourceFrame", "Timestamp")]
    poses, *others = [None if column is None else vtk_to_numpy(column).copy() for column in columns]
    return [poses.reshape(-1, 4, 4), *others, reader.GetRejectionSummary()]


def write(data: Any, name: str, properties: dict[str, Any]) -> None:
    writer = vtkBigusFieldWriter() if isinstance(data, vtkPolyData) else vtkBigusSequenceWriter()
    writer.SetFileName(name)
    writer.SetInputDataObject(data)
    set_properties(writer, properties)
    update(writer)


def _rows(table: vtkTable, **kinds: type) -> list[dict[str, Any]]:
    """The rows of a table, of columns by their names in snake case, with values of these kinds."""
    columns = {name: table.GetColumnByName(column) for column in map(table.GetColumnName, range(table.GetNumberOfColumns()))
               if (name := snake_case(column)) in kinds}  # fmt: skip
    return [{name: kind(columns[name].GetValue(row)) for name, kind in kinds.items()} for row in range(table.GetNumberOfRows())]


def check(sweep: vtkImageData, keep: str) -> list[dict]:
    inspection = vtkBigusSweepInspection()
    inspection.SetInputDataObject(sweep)
    inspection.SetKeep(keep)
    return _rows(update(inspection).GetFindings(), **common.FINDING_COLUMNS)


def correct_poses(sweep: vtkImageData, properties: dict[str, Any]) -> dict[str, Any]:
    correction = vtkBigusPoseCorrection()
    correction.SetInputDataObject(sweep)
    set_properties(correction, properties)
    corrected = update_alone(correction).GetOutput()
    data = corrected.GetFieldData()
    decision = data.GetAbstractArray("PoseDecision")
    found = {name: vtk_to_numpy(data.GetArray("Pose" + name.capitalize())) for name in ("displacement", "rotation", "outlier")}
    return {
        **found,
        "sweep": corrected,
        "outlier": found["outlier"] != 0,
        "noise": dict(zip(("translation", "rotation", "corner"), data.GetArray("TrackerNoise").GetTuple3(0))),
        "strength": correction.GetChosenStrength(),
        "decision": {"choice": decision.GetValue(0), "evidence": decision.GetValue(1)},
        "steps": _rows(correction.GetSteps(), **common.STEP_COLUMNS),
    }


def size(field: vtkPolyData) -> int:
    return field.GetNumberOfPoints()


def train(sweeps: list, start: Optional[vtkPolyData], keeping: tuple[str, float, bool], keeps_error: bool,
          properties: dict[str, Any], progress: Optional[Callable]) -> tuple[dict[str, Any], Callable[[], None]]:
    """What came of it, and a function that raises what ended it, if Ctrl-C or `progress` did."""
    trainer = vtkBigusTrainer()
    for one in sweeps:
        trainer.AddInputDataObject(0, one)
    if start is not None:
        trainer.SetInputDataObject(1, start)
    trainer.SetKeepStandardError(keeps_error)
    set_properties(trainer, properties)
    path = keeping[0]
    if path:
        _update.keep_checkpoints(trainer, *keeping)
    failure: list[BaseException] = []

    def on_progress(caller: Any, event: str) -> None:
        if failure or trainer.GetAbortExecute():
            return
        try:
            go_on = progress(trainer.GetProgress(), trainer.GetProgressText() or "")
        except BaseException as error:  # VTK would print it and go on; it belongs to our caller
            failure.append(error)
            go_on = False
        if go_on is False:
            trainer.SetAbortExecute(1)

    if progress:
        trainer.AddObserver("ProgressEvent", on_progress)
    try:
        update_alone(trainer)
    except KeyboardInterrupt as interrupt:
        failure.insert(0, interrupt)
    if path and not failure and trainer.GetFinished() and os.path.isfile(path):
        os.remove(path)

    def rethrow() -> None:
        if failure:
            raise failure[0]

    return _result(trainer), rethrow


def _result(trainer: vtkBigusTrainer) -> dict[str, Any]:
    poses = trainer.GetCorrectedPoses()
    names = [trainer.GetOptionName(index) for index in range(trainer.GetNumberOfOptions())]
    frames = {name: getattr(trainer, "Get" + name)() for name in ("TrainingFrames", "ValidationFrames", "HeldOutFrames")}
    return {
        "field": trainer.GetOutputDataObject(0),
        "log": trainer.GetLog(),
        "decisions": _rows(trainer.GetDecisions(), **common.DECISION_COLUMNS),
        "poses": np.empty((0, 4, 4)) if poses is None else vtk_to_numpy(poses).reshape(-1, 4, 4),
        "options": {name: trainer.GetSettledOption(name) for name in names},
        "device": trainer.GetDevice(),
        "iterations": trainer.GetIterationsDone(),
        "seconds": trainer.GetSeconds(),
        "aborted": trainer.GetAborted(),
        "finished": trainer.GetFinished(),
        **{snake_case(name): vtk_to_numpy(numbers).tolist() for name, numbers in frames.items()},
    }


def _reslice(field: vtkPolyData, plane: Any, size: Any, spacing: Any, caller: str) -> vtkBigusReslice:
    """A filter for one image, without coverage."""
    require(field, vtkPolyData, caller, "field")
    if isinstance(plane, vtkMatrix4x4):
        plane = [[plane.GetElement(row, column) for column in range(4)] for row in range(4)]
    points = field.GetPoints()
    matrix, (width, height) = common.view(vtk_to_numpy(points.GetData()) if points else (), plane, size, spacing)
    axes = vtkMatrix4x4()
    axes.DeepCopy(matrix.ravel())
    filter = vtkBigusReslice()
    filter.SetInputDataObject(field)
    filter.SetOutputToFrame(axes, width, height)
    filter.GenerateCoverageOutputOff()
    return filter


def reslice(field: vtkPolyData, plane: Any, size: Any, spacing: Any, properties: dict[str, Any]) -> np.ndarray:
    filter = _reslice(field, plane, size, spacing, "reslice")
    set_properties(filter, properties)
    return _pixels(update_alone(filter).GetOutput())[0]


def image_and_error(field: vtkPolyData, plane: Any, size: Any, spacing: Any, caller: str) -> tuple[np.ndarray, np.ndarray, Callable]:
    """The image at a plane, its standard error, and what tells that of a mean over pixels that are not 0."""
    filter = _reslice(field, plane, size, spacing, caller)
    filter.GenerateStandardErrorOutputOn()
    pictures = _pixels(update_alone(filter).GetOutput())[0], _pixels(filter.GetStandardErrorOutput())[0]
    return (*pictures, lambda chosen: filter.GetStandardErrorOfMean(image(chosen)))


def label(
    field: vtkPolyData,
    sweep: vtkImageData,
    labels: Union[np.ndarray, vtkImageData, str, os.PathLike],
    names: Optional[Mapping[int, str]] = None,
    frames: Optional[Sequence[int]] = None,
    **properties: Any,
) -> vtkPolyData:
    """The field with labels drawn on frames, which ``label_map`` and vtkBigusReslice show at any plane.

    sweep: the one that the field was trained on, at the poses that it was trained at.
    labels: whole numbers, 0 (none) to 255, [frames, height, width]; or what vtkBigusLabelReader reads: .seg.nrrd of 3D
    Slicer, .nrrd, .mha, a folder of PNG images.
    names: {1: "vessel"}. frames: numbers in the file of the frames that the pictures are of; by default all, in order.
    properties: those of vtkBigusFieldLabeler, such as KeepEmptyPictures.
    """
    require(field, vtkPolyData, "label", "field")
    require(sweep, vtkImageData, "label", "sweep")
    if isinstance(labels, (str, os.PathLike)):
        labels = _read(vtkBigusLabelReader(), labels, {})
    elif not isinstance(labels, vtkImageData):
        labels = image(common.label_pixels(labels))
    pictures = vtkImageData()
    pictures.ShallowCopy(labels)
    if frames is not None:
        numbers = numpy_to_vtk(np.asarray(frames, np.int32), deep=True)
        numbers.SetName("SourceFrame")
        pictures.GetFieldData().AddArray(numbers)
    if names is not None:
        values = numpy_to_vtk(np.array(sorted(names), np.int32), deep=True)
        values.SetName("LabelValues")
        words = vtkStringArray()
        words.SetName("LabelNames")
        for value in sorted(names):
            words.InsertNextValue(names[value])
        pictures.GetFieldData().AddArray(values)
        pictures.GetFieldData().AddArray(words)
        pictures.GetFieldData().RemoveArray("LabelColors")
    labeler = vtkBigusFieldLabeler()
    for port, data in enumerate((field, sweep, pictures)):
        labeler.SetInputDataObject(port, data)
    set_properties(labeler, properties)
    return update_alone(labeler).GetOutput()


def label_map(
    field: vtkPolyData,
    plane: Union[np.ndarray, vtkMatrix4x4],
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
) -> np.ndarray:
    """Which label each pixel of a plane has, uint8 [height, width], 0 for none. Planes as in ``reslice``."""
    filter = _reslice(field, plane, size, spacing, "label_map")
    filter.GenerateLabelOutputOn()
    return _pixels(update_alone(filter).GetLabelOutput())[0]


def _compare(a: Any, b: Any) -> vtkBigusImageMetrics:
    filter = vtkBigusImageMetrics()
    for port, one in enumerate((a, b)):
        filter.SetInputDataObject(port, one if isinstance(one, vtkImageData) else image(one))
    return update_alone(filter)


def metrics(a: Any, b: Any) -> dict[str, float]:
    filter = _compare(a, b)
    return {snake_case(name): getattr(filter, "Get" + name)() for name in common.SCORES}


def texture(a: Union[np.ndarray, vtkImageData], b: Union[np.ndarray, vtkImageData]) -> dict[str, Any]:
    """Whether image a has the texture of the truth b, wherever its grains lie; images as in metrics.

    Gives the texture columns of vtkBigusImageMetrics by their names in snake case, each the mean over frames:
    contrast_ratio, high_frequency_power, image_contrast_mean, truth_contrast_mean, ... image_spectrum and truth_spectrum
    are arrays of the power at spectrum_frequency, in cycles a pixel.
    """
    table = _compare(a, b).GetOutput()
    names = [table.GetColumnName(column) for column in range(table.GetNumberOfColumns())]
    names = names[names.index("Rayleigh") + 1:]
    means = {
        snake_case(name): vtk_to_numpy(table.GetColumnByName(name)).mean(axis=0)
        for name in names
    }
    numbers = {name: mean if mean.ndim else float(mean) for name, mean in means.items()}
    return {**numbers, "spectrum_frequency": np.arange(1, len(numbers["image_spectrum"]) + 1) / 32}
