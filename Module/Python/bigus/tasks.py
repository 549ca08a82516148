# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Read, train, reslice, score, write: one call each."""

from __future__ import annotations

import os
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkTable
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _update, common
from .arrays import _pixels, image
from .common import FIELD_EXTENSIONS, Planes, PoseCorrection, TrainingInterrupted, path_text, require
from .names import snake_case
from .pipeline import set_properties, update, update_alone
from .vtkBigusFilters import vtkBigusFieldLabeler, vtkBigusImageMetrics, vtkBigusPoseCorrection, vtkBigusReslice, vtkBigusSweepInspection
from .vtkBigusFilters import vtkBigusTrainer
from .vtkBigusIO import (
    vtkBigusFieldReader,
    vtkBigusFieldWriter,
    vtkBigusLabelReader,
    vtkBigusPoseReader,
    vtkBigusSequenceReader,
    vtkBigusSequenceWriter,
)


def read(path: Union[str, os.PathLike], **properties: Any) -> Union[vtkImageData, vtkPolyData]:
    """Reads a field (.vtp, .ply: vtkPolyData) or else a tracked sweep (vtkImageData), by the name of the file.

    properties are those of vtkBigusFieldReader or vtkBigusSequenceReader: ``read("sweep.igs.mha", to_frame="Tracker")``, or
    ToFrame. Raises RuntimeError when the file cannot be read.
    """
    is_field = path_text(path).lower().endswith(FIELD_EXTENSIONS)
    return (read_field if is_field else read_sweep)(path, **properties)


def read_sweep(path: Union[str, os.PathLike], **properties: Any) -> vtkImageData:
    """Reads a tracked sweep, with the properties of vtkBigusSequenceReader."""
    return _read(vtkBigusSequenceReader(), path, properties)


def read_field(path: Union[str, os.PathLike], **properties: Any) -> vtkPolyData:
    """Reads a field (.vtp, .ply), with the properties of vtkBigusFieldReader."""
    return _read(vtkBigusFieldReader(), path, properties)


def _read(reader: Any, path: Union[str, os.PathLike], properties: dict[str, Any]) -> Any:
    reader.SetFileName(path_text(path))
    set_properties(reader, properties)
    return update_alone(reader).GetOutput()


def read_stack(path: Union[str, os.PathLike]) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """The frames of a sequence [frames, height, width], and their times in seconds or None; poses may be missing."""
    sequence = read(path, RequirePoses=False, AutoMask=False)
    times = sequence.GetFieldData().GetArray("Timestamp")
    return _pixels(sequence), None if times is None else vtk_to_numpy(times).copy()


def read_spacing(path: Union[str, os.PathLike]) -> tuple[float, float]:
    """The size of a pixel along i and j, mm, that the header of a sequence or an image states; 0 where it states none."""
    reader = vtkBigusSequenceReader()
    reader.SetFileName(path_text(path))
    reader.RequirePosesOff()
    reader.UpdateInformation()
    spacing = [0.0, 0.0]
    reader.GetHeaderSpacing(spacing)
    return spacing[0], spacing[1]


def read_planes(path: Union[str, os.PathLike], spacing: float = 0.5, world: str = "RAS", **properties: Any) -> Planes:
    """Slice planes: poses of a sequence or a CSV, 3D Slicer's planes and lines (.mrk.json) and transforms (.tfm, .h5).

    spacing: mm a pixel, for 3D Slicer's planes and lines. world: the patient system that the field's world stands for,
    "RAS" as 3D Slicer shows tracked sequences, or "LPS"; only 3D Slicer's files look at it.
    properties: those of vtkBigusPoseReader, such as ToFrame. Raises RuntimeError when the file cannot be read.
    """
    reader = vtkBigusPoseReader()
    reader.SetFileName(path_text(path))
    reader.SetPixelSpacing(spacing)
    reader.SetWorldCoordinateSystem(reader.LPS if common.is_lps(world) else reader.RAS)
    set_properties(reader, properties)
    table = update(reader).GetOutput()
    columns = {name: table.GetColumnByName(name) for name in ("ImageToReference", "Size", "SourceFrame", "Timestamp")}
    arrays = {name: None if column is None else vtk_to_numpy(column).copy() for name, column in columns.items()}
    poses = arrays["ImageToReference"].reshape(-1, 4, 4)
    return Planes(poses, arrays["Size"], arrays["SourceFrame"], arrays["Timestamp"], reader.GetRejectionSummary())


def write(data: Union[vtkImageData, vtkPolyData], path: Union[str, os.PathLike], **properties: Any) -> None:
    """Writes a field (vtkPolyData, to .vtp or .ply) or a tracked sweep (vtkImageData, to .igs.mha).

    properties are those of vtkBigusFieldWriter or vtkBigusSequenceWriter. Raises RuntimeError on failure, and then
    leaves no file behind.
    """
    writer = vtkBigusFieldWriter() if isinstance(data, vtkPolyData) else vtkBigusSequenceWriter()
    writer.SetFileName(path_text(path))
    writer.SetInputDataObject(data)
    set_properties(writer, properties)
    update(writer)


def check(sweep: vtkImageData, keep: str = "none") -> list[dict]:
    """What is wrong with a sweep, a dictionary a finding: kind, frames (how many), pixels, applied, text.

    keep: kinds that nothing is done about, as the property Keep of vtkBigusTrainer.
    """
    require(sweep, vtkImageData, "check", "sweep")
    inspection = vtkBigusSweepInspection()
    inspection.SetInputDataObject(sweep)
    inspection.SetKeep(keep)
    table = update(inspection).GetFindings()
    rows = range(table.GetNumberOfRows())
    numbers = [{name.lower(): table.GetValueByName(row, name).ToInt() for name in ("Frames", "Pixels")} for row in rows]
    return [{"kind": table.GetValueByName(row, "Kind").ToString(), **numbers[row],
             "applied": table.GetValueByName(row, "Applied").ToInt() != 0,
             "text": table.GetValueByName(row, "Text").ToString()} for row in rows]  # fmt: skip


def correct_poses(sweep: vtkImageData, **properties: Any) -> PoseCorrection:
    """Takes the tracker's noise out of a sweep's poses, where its pictures confirm it; exact poses are kept.

    properties are those of vtkBigusPoseCorrection: Strength (negative, the default: chosen by evidence) and HoldOut.
    """
    require(sweep, vtkImageData, "correct_poses", "sweep")
    correction = vtkBigusPoseCorrection()
    correction.SetInputDataObject(sweep)
    set_properties(correction, properties)
    corrected = update_alone(correction).GetOutput()
    data = corrected.GetFieldData()
    decision = data.GetAbstractArray("PoseDecision")
    return PoseCorrection(
        corrected,
        vtk_to_numpy(data.GetArray("PoseDisplacement")),
        vtk_to_numpy(data.GetArray("PoseRotation")),
        vtk_to_numpy(data.GetArray("PoseOutlier")) != 0,
        dict(zip(("translation", "rotation", "corner"), data.GetArray("TrackerNoise").GetTuple3(0))),
        correction.GetChosenStrength(),
        {"choice": decision.GetValue(0), "evidence": decision.GetValue(1)},
        _steps(correction.GetSteps()),
    )


def _steps(table: vtkTable) -> list[dict[str, Any]]:
    columns = {key: vtk_to_numpy(table.GetColumnByName(name)) for key, name in common.STEP_COLUMNS.items()}
    columns["taken"] = columns["taken"] != 0
    return [{key: values[row].item() for key, values in columns.items()} for row in range(table.GetNumberOfRows())]


class _FieldAndLog(NamedTuple):
    field: vtkPolyData
    log: vtkTable


class Training(_FieldAndLog):
    """The field and the training log, as a pair; and decisions, what the training rested on, and poses.

    decisions is a list of dicts: decision, choice, evidence ("given" where the property was set) and seconds, what
    finding out cost. It is empty when nothing was decided.

    poses, float64 [frames, 4, 4], are ImageToReference of every frame as the field was trained at, the tracker's noise
    taken out where pictures confirmed it. The field belongs to these, not to poses(sweep).
    """

    decisions: list[dict[str, Any]]
    poses: np.ndarray

    def __repr__(self) -> str:
        return f"<bigus.Training of {self.field.GetNumberOfPoints()} Gaussians>"


def train(
    sweep: Union[vtkImageData, Sequence[vtkImageData]],
    progress: Union[None, bool, Callable[[float, str], Optional[bool]]] = None,
    start: Optional[vtkPolyData] = None,
    checkpoint: Union[None, str, os.PathLike] = None,
    resume: bool = False,
    checkpoint_interval: float = 60,
    **properties: Any,
) -> Training:
    """Trains a field on a sweep; gives the pair of the field and the training log, with the decisions.

    {SEVERAL_SWEEPS}

    What no property sets is decided by short trainings scored on frames set aside, or, with Automatic=False, from the
    sweep's geometry. To force all of it: Gaussians, ElevationSigma (mm), SignedReflectivity, VirtualPlanes,
    Interpolation ("normals" or "probe", each with "+flow", "+rough" or "+smooth" after it), FrameGains, Iterations.
    Preset="texture" asks for speckle as strong as in the frames, at a price in error.

    {PROGRESS}
    properties are those of vtkBigusTrainer: HoldOut or hold_out.

    {CHECKPOINTS}
    """
    sweeps = common.training_inputs(sweep, start, vtkImageData, vtkPolyData)
    trainer = vtkBigusTrainer()
    for one in sweeps:
        trainer.AddInputDataObject(0, one)
    if start is not None:
        trainer.SetInputDataObject(1, start)
    set_properties(trainer, properties)
    path = common.checkpoint_path(checkpoint, resume, checkpoint_interval)
    if path:
        _update.keep_checkpoints(trainer, path, float(checkpoint_interval), bool(resume))
    bar = common.bar_for(progress)
    if progress is None or progress is True:
        progress = bar
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
        raise TrainingInterrupted(_result(trainer)) from interrupt
    finally:
        if bar:
            bar.close()
    if failure:
        raise failure[0]
    if path and trainer.GetFinished() and os.path.isfile(path):
        os.remove(path)
    return _result(trainer)


train.__doc__ = (train.__doc__ or "").format(**vars(common))


def _result(trainer: vtkBigusTrainer) -> Training:
    training = Training(trainer.GetOutputDataObject(0), trainer.GetOutputDataObject(1))
    poses = trainer.GetCorrectedPoses()
    training.poses = np.empty((0, 4, 4)) if poses is None else vtk_to_numpy(poses).reshape(-1, 4, 4)
    table = trainer.GetDecisions()
    training.decisions = [
        {
            "decision": table.GetValueByName(row, "Decision").ToString(),
            "choice": table.GetValueByName(row, "Choice").ToString(),
            "evidence": table.GetValueByName(row, "Evidence").ToString(),
            "seconds": table.GetValueByName(row, "Seconds").ToDouble(),
        }
        for row in range(table.GetNumberOfRows())
    ]
    return training


def _reslice(field: vtkPolyData, plane: Any, size: Any, spacing: Any, caller: str) -> vtkBigusReslice:
    """A filter for one image, without coverage."""
    require(field, vtkPolyData, caller, "field")
    if isinstance(plane, vtkMatrix4x4):
        plane = [[plane.GetElement(row, column) for column in range(4)] for row in range(4)]
    matrix = common.pixel_matrix(plane, spacing)
    if size is None:
        points = field.GetPoints()
        size = common.size_of_view(vtk_to_numpy(points.GetData()) if points else (), matrix)
    width, height = common.checked_size(size)
    axes = vtkMatrix4x4()
    axes.DeepCopy(matrix.ravel())
    filter = vtkBigusReslice()
    filter.SetInputDataObject(field)
    filter.SetOutputToFrame(axes, width, height)
    filter.GenerateCoverageOutputOff()
    return filter


def reslice(
    field: vtkPolyData,
    plane: Union[np.ndarray, vtkMatrix4x4],
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
    **properties: Any,
) -> np.ndarray:
    """The image that the field predicts at a plane: float32 [height, width] in [0, 1).

    plane: 4 x 4 ImageToReference: pixel (i, j, 0, 1) to mm, as in ``poses(sweep)``.
    size: (width, height) in pixels; by default the image starts at pixel (0, 0) and reaches to the field's far end.
    spacing: pixel size, mm, one number or (along i, along j); by default the length of the matrix's columns.
    properties: those of vtkBigusReslice, such as ``elevation_sigma=0`` or ``ElevationSigma=0``,
    ``OutputMode=vtkBigusReslice.ScatteringField`` (then signed values) or ``OutputScalarType=VTK_UNSIGNED_CHAR``.

    For many planes of one field, and for the coverage, use a vtkBigusReslice: it uploads the field only once.
    """
    filter = _reslice(field, plane, size, spacing, "reslice")
    set_properties(filter, properties)
    return _pixels(update_alone(filter).GetOutput())[0]


def standard_error(
    field: vtkPolyData,
    plane: Union[np.ndarray, vtkMatrix4x4],
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
) -> np.ndarray:
    """How far what a probe would show may be from ``reslice`` at the same plane: a standard deviation for every pixel.

    float32 [height, width] in units of intensity (1 is white), NaN where the training frames do not tell. The field must
    keep what it rests on, as ``train`` lets it; else a RuntimeError says so.
    """
    filter = _reslice(field, plane, size, spacing, "standard_error")
    filter.GenerateStandardErrorOutputOn()
    return _pixels(update_alone(filter).GetStandardErrorOutput())[0]


def mean(
    field: vtkPolyData,
    plane: Union[np.ndarray, vtkMatrix4x4],
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
    where: Optional[np.ndarray] = None,
) -> tuple[float, float]:
    """The mean of ``reslice`` at a plane, and its standard error: (0.31, 0.004).

    where: bool [height, width], the pixels to take; by default all of which ``standard_error`` tells.
    Errors of pixels beside each other are alike, so a mean over n pixels is less sure than their standard error divided
    by the root of n: how much less was measured by the training. The field must keep it, as ``train`` lets it.
    """
    filter = _reslice(field, plane, size, spacing, "mean")
    filter.GenerateStandardErrorOutputOn()
    image = _pixels(update_alone(filter).GetOutput())[0]
    sigma = filter.GetStandardErrorOutput()
    known = common.pixels_of_mean(_pixels(sigma)[0], where)
    chosen = vtkImageData()
    chosen.SetDimensions(sigma.GetDimensions())
    chosen.GetPointData().SetScalars(numpy_to_vtk(known.astype(np.uint8).ravel(), deep=True))
    return float(image[known].mean()), filter.GetStandardErrorOfMean(chosen)


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


def _compare(a: Union[np.ndarray, vtkImageData], b: Union[np.ndarray, vtkImageData]) -> vtkBigusImageMetrics:
    filter = vtkBigusImageMetrics()
    filter.SetInputDataObject(0, a if isinstance(a, vtkImageData) else image(a))
    filter.SetInputDataObject(1, b if isinstance(b, vtkImageData) else image(b))
    return update_alone(filter)


def metrics(a: Union[np.ndarray, vtkImageData], b: Union[np.ndarray, vtkImageData]) -> dict[str, float]:
    """How close image a is to the truth b: both [height, width] or [frames, height, width], or vtkImageData.

    uint8 pixels are divided by 255, floating-point ones must lie in [0, 1]. Gives psnr (dB), ssim, bfs and the three
    terms of bfs: mean_contrast, contrast_distribution, rayleigh; each the mean over frames.
    """
    filter = _compare(a, b)
    return {
        "psnr": filter.GetPSNR(),
        "ssim": filter.GetSSIM(),
        "bfs": filter.GetBFS(),
        "mean_contrast": filter.GetMeanContrast(),
        "contrast_distribution": filter.GetContrastDistribution(),
        "rayleigh": filter.GetRayleigh(),
    }


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
