# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Read, train, reslice, score, write: one call each."""

from __future__ import annotations

import os
import re
import sys
from typing import Any, Callable, NamedTuple, Optional, Sequence, Union

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData, vtkTable
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from . import _update
from .arrays import _pixels, image
from .pipeline import set_properties, update, update_alone
from .vtkBigusFilters import vtkBigusImageMetrics, vtkBigusPoseCorrection, vtkBigusReslice, vtkBigusTrainer
from .vtkBigusIO import (
    vtkBigusFieldReader,
    vtkBigusFieldWriter,
    vtkBigusPoseReader,
    vtkBigusSequenceReader,
    vtkBigusSequenceWriter,
)

FIELD_EXTENSIONS = (".vtp", ".ply")


class Planes(NamedTuple):
    """Slice planes of a file."""

    poses: np.ndarray  # float64 [n, 4, 4], ImageToReference: pixel (i, j, 0, 1) to mm
    sizes: np.ndarray  # int32 [n, 2], (width, height) in pixels; 0 where the file does not say
    source_frames: np.ndarray  # int32 [n], index in the file
    timestamps: Optional[np.ndarray]  # float64 [n], seconds; None unless every plane has one
    rejections: str  # which poses were left out and why, in a sentence; empty when none was


def _require(data: Any, kind: type, task: str, noun: str) -> None:
    if not isinstance(data, kind):
        found = data.GetClassName() if hasattr(data, "GetClassName") else type(data).__name__
        raise TypeError(f"{task} takes a {noun} ({kind.__name__}), not {found}")


def read(path: Union[str, os.PathLike], **properties: Any) -> Union[vtkImageData, vtkPolyData]:
    """Reads a field (.vtp, .ply: vtkPolyData) or else a tracked sweep (vtkImageData).

    properties are those of vtkBigusFieldReader or vtkBigusSequenceReader, by their VTK names:
    ``read("sweep.igs.mha", ToFrame="Tracker")``. Raises RuntimeError when the file cannot be read.
    """
    name = os.fspath(path)
    is_field = name.lower().endswith(FIELD_EXTENSIONS)
    reader = vtkBigusFieldReader() if is_field else vtkBigusSequenceReader()
    reader.SetFileName(name)
    set_properties(reader, properties)
    return update_alone(reader).GetOutput()


def read_stack(path: Union[str, os.PathLike]) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """The frames of a sequence [frames, height, width], and their times in seconds or None; poses may be missing."""
    sequence = read(path, RequirePoses=False, AutoMask=False)
    times = sequence.GetFieldData().GetArray("Timestamp")
    return _pixels(sequence), None if times is None else vtk_to_numpy(times).copy()


def read_planes(path: Union[str, os.PathLike], spacing: float = 0.5, world: str = "RAS", **properties: Any) -> Planes:
    """Slice planes: poses of a sequence or a CSV, 3D Slicer's planes and lines (.mrk.json) and transforms (.tfm, .h5).

    spacing: mm a pixel, for 3D Slicer's planes and lines. world: the patient system that the field's world stands for,
    "RAS" as 3D Slicer shows tracked sequences, or "LPS"; only 3D Slicer's files look at it.
    properties: those of vtkBigusPoseReader, such as ToFrame. Raises RuntimeError when the file cannot be read.
    """
    if world not in ("RAS", "LPS"):
        raise ValueError(f"world is RAS or LPS, not {world!r}")
    reader = vtkBigusPoseReader()
    reader.SetFileName(os.fspath(path))
    reader.SetPixelSpacing(spacing)
    reader.SetWorldCoordinateSystem(reader.LPS if world == "LPS" else reader.RAS)
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
    writer.SetFileName(os.fspath(path))
    writer.SetInputDataObject(data)
    set_properties(writer, properties)
    update(writer)


class PoseCorrection(NamedTuple):
    """A sweep at corrected poses, and what was found. Arrays have one element a frame.

    The sweep's field data have more: vtkBigusPoseCorrection lists them.
    """

    sweep: vtkImageData  # pixels shared with the sweep given
    displacement: np.ndarray  # mm that the image's corners moved, mean of four
    rotation: np.ndarray  # degrees
    outlier: np.ndarray  # bool: recorded so far off that the pose follows from its neighbours
    noise: dict[str, float]  # the tracker's: translation (mm), rotation (degrees), corner (mm at the image's corners)
    strength: float  # in units of the noise found; 0: no noise is taken out
    decision: dict[str, str]  # choice and evidence


def correct_poses(sweep: vtkImageData, **properties: Any) -> PoseCorrection:
    """Takes the tracker's noise out of a sweep's poses, where its pictures confirm it; exact poses are kept.

    properties are those of vtkBigusPoseCorrection: Strength (negative, the default: chosen by evidence) and HoldOut.
    """
    _require(sweep, vtkImageData, "correct_poses", "sweep")
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
    )


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


class TrainingInterrupted(KeyboardInterrupt):
    """Ctrl-C while training. ``training`` is the best so far."""

    training: Training


class _Bar:
    """Shows a training's progress; close it in any case."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def __call__(self, fraction: float, text: str) -> None:
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.update(100 * fraction - self._bar.n)

    def close(self) -> None:
        self._bar.close()


def _bar() -> Optional[_Bar]:
    """A progress bar by tqdm where somebody watches and it is installed."""
    notebook = "ipykernel" in sys.modules
    if not notebook and not (sys.stderr and sys.stderr.isatty()):
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    bar = tqdm(total=100, desc="Training", unit="%", bar_format="{desc} {bar} {percentage:3.0f} %  {elapsed}{postfix}")
    return _Bar(bar)


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

    A list of sweeps of one patient in one reference frame trains one field. Poses are corrected and frames held out in each
    by itself; frames and poses of the second are counted on from those of the first, and so on.

    What no property sets is decided by short trainings scored on frames set aside, or, with Automatic=False, from the
    sweep's geometry. To force all of it: Gaussians, ElevationSigma (mm), SignedReflectivity, VirtualPlanes,
    Interpolation ("normals" or "probe", each with "+flow", "+rough" or "+smooth" after it), FrameGains, PoseRefinement, Iterations.
    Preset="texture" asks for speckle as strong as in the frames, at a price in error.

    progress(fraction, text) is called now and then, in another thread; when it returns False training stops there and
    gives the best field so far. Without it tqdm, where it is installed, draws a bar in a terminal or a notebook;
    progress=False draws none. Other Python threads run meanwhile. Ctrl-C raises TrainingInterrupted, a
    KeyboardInterrupt that keeps the best so far. start is a field to continue from. properties are those of
    vtkBigusTrainer by their VTK names.

    checkpoint is a file that keeps the state of the training: every checkpoint_interval seconds, 0 or more, and when it is
    stopped, by Ctrl-C or a time limit. A training that finishes removes it. With resume=True training goes on from there
    with the bits of one that never stopped, or begins where there is no such file. One of another sweep, start or
    option is a RuntimeError that says which; one that cannot be written is a RuntimeWarning.
    """
    sweeps = list(sweep) if isinstance(sweep, (list, tuple)) else [sweep]
    for one in sweeps or [None]:
        _require(one, vtkImageData, "train", "sweep")
    if start is not None:
        _require(start, vtkPolyData, "train", "field as start")
    trainer = vtkBigusTrainer()
    for one in sweeps:
        trainer.AddInputDataObject(0, one)
    if start is not None:
        trainer.SetInputDataObject(1, start)
    set_properties(trainer, properties)
    if resume and checkpoint is None:
        raise ValueError("resume goes on from a checkpoint; say from which file: checkpoint=...")
    if not 0 <= checkpoint_interval < float("inf"):
        raise ValueError(f"checkpoint_interval is a number of seconds, 0 or more, not {checkpoint_interval}")
    if checkpoint is not None:
        _update.keep_checkpoints(trainer, os.fspath(checkpoint), float(checkpoint_interval), bool(resume))
    bar = _bar() if progress is None or progress is True else None
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
        stopped = TrainingInterrupted("the field so far is in .training")
        stopped.training = _result(trainer)
        raise stopped from interrupt
    finally:
        if bar:
            bar.close()
    if failure:
        raise failure[0]
    if checkpoint is not None and trainer.GetFinished() and os.path.isfile(checkpoint):
        os.remove(checkpoint)
    return _result(trainer)


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


def _matrix(plane: Union[np.ndarray, vtkMatrix4x4]) -> np.ndarray:
    if isinstance(plane, vtkMatrix4x4):
        return np.array([[plane.GetElement(row, column) for column in range(4)] for row in range(4)])
    matrix = np.asarray(plane, dtype=np.float64)
    if matrix.shape != (4, 4):
        raise ValueError(f"a plane is a 4 x 4 matrix, not of shape {matrix.shape}")
    return matrix


def _size_of_view(field: vtkPolyData, matrix: np.ndarray) -> tuple[int, int]:
    """(width, height) of the image that starts at pixel (0, 0) and reaches the field's last Gaussian either way."""
    advice = "give size=(width, height)"
    if field.GetNumberOfPoints() == 0:
        raise ValueError(f"the field is empty, so there is nothing to size the image by; {advice}")
    points = vtk_to_numpy(field.GetPoints().GetData())
    pixels = (points - matrix[:3, 3]) @ np.linalg.pinv(matrix[:3, :2]).T
    width, height = (int(n) for n in np.ceil(pixels.max(axis=0)) + 1)
    if width < 1 or height < 1:
        raise ValueError(f"the whole field lies before pixel (0, 0) of this plane; {advice}")
    return width, height


def reslice(
    field: vtkPolyData,
    plane: Union[np.ndarray, vtkMatrix4x4],
    size: Optional[tuple[int, int]] = None,
    spacing: Union[None, float, tuple[float, float]] = None,
    **properties: Any,
) -> np.ndarray:
    """The image that the field predicts at a plane: float32 [height, width] in [0, 1).

    plane: 4 x 4 ImageToReference: pixel (i, j, 0, 1) to mm, as in ``poses(sweep)``.
    size: (width, height) in pixels; by default the image starts at pixel (0, 0) and reaches to the field's far end.
    spacing: pixel size, mm, one number or (along i, along j); by default the length of the matrix's columns.
    properties: those of vtkBigusReslice by their VTK names, such as ``ElevationSigma=0``,
    ``OutputMode=vtkBigusReslice.ScatteringField`` (then signed values) or ``OutputScalarType=VTK_UNSIGNED_CHAR``.

    For many planes of one field, and for the coverage, use a vtkBigusReslice: it uploads the field only once.
    """
    _require(field, vtkPolyData, "reslice", "field")
    matrix = _matrix(plane).copy()
    if not np.isfinite(matrix).all() or np.linalg.norm(np.cross(matrix[:3, 0], matrix[:3, 1])) == 0:
        raise ValueError("the first two columns of the plane's matrix must be finite and span a plane")
    if spacing is not None:
        if not all(0 < side < np.inf for side in np.ravel(spacing)):
            raise ValueError(f"the spacing must be positive, not {spacing}")
        matrix[:3, :2] *= np.broadcast_to(spacing, 2) / np.linalg.norm(matrix[:3, :2], axis=0)
    width, height = size if size is not None else _size_of_view(field, matrix)
    if width < 1 or height < 1:
        raise ValueError(f"the size must be positive, not {width} x {height}")

    # The image is one slice: the third column only has to make the matrix regular.
    normal = np.cross(matrix[:3, 0], matrix[:3, 1])
    matrix[:3, 2] = normal / np.linalg.norm(normal)
    matrix[3] = (0, 0, 0, 1)
    axes = vtkMatrix4x4()
    axes.DeepCopy(matrix.ravel())

    filter = vtkBigusReslice()
    filter.SetInputDataObject(field)
    filter.SetOutputToFrame(axes, int(width), int(height))
    filter.GenerateCoverageOutputOff()
    set_properties(filter, properties)
    return _pixels(update_alone(filter).GetOutput())[0]


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
        re.sub("(?<!^)(?=[A-Z])", "_", name).lower(): vtk_to_numpy(table.GetColumnByName(name)).mean(axis=0)
        for name in names
    }
    numbers = {name: mean if mean.ndim else float(mean) for name, mean in means.items()}
    return {**numbers, "spectrum_frequency": np.arange(1, len(numbers["image_spectrum"]) + 1) / 32}
