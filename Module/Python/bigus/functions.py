# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Read, train, slice, score, write: one call each. Both packages have this file; how each does it is in its tasks.py.

A sweep is a vtkImageData and a field a vtkPolyData in the package of VTK's classes, and there errors are RuntimeError. In the
package without VTK they are Sweep, Field and Error, which is a RuntimeError.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Callable, NamedTuple, Optional, Sequence, Union

import numpy as np

from . import arrays, common, tasks
from .common import FIELD_EXTENSIONS, Planes, PoseCorrection, TrainingInterrupted, path_text, require
from .names import spell_out
from .tasks import Field, Sweep

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Unpack

    from ._options import CorrectionOptions, PoseOptions, SequenceOptions, SlicerOptions, TrainOptions, WriteOptions

    Path = Union[str, os.PathLike]
    Spacing = Union[None, float, Sequence[float]]
    Progress = Union[None, bool, Callable[[float, str], Optional[bool]]]

# ----------------------------------------------------------------------------------------------------------------------
# Arrays


def sweep(frames: ArrayLike, poses: ArrayLike, timestamps: Optional[ArrayLike] = None, mask: Optional[ArrayLike] = None,
          spacing: Optional[Sequence[float]] = None) -> Sweep:
    """A tracked sweep of arrays.

    frames: [frames, height, width], uint8, uint16 (65535 is white), bool, or floats in [0, 1]. C-contiguous uint8 and
        float32 are not copied: do not write to them while the sweep is used.
    poses: [frames, 4, 4], ImageToReference: pixel (column i, row j, 0, 1), counted from 0, to mm.
    timestamps: [frames], seconds.
    mask: [height, width], 0 where the probe never lights a pixel.
    spacing: (along i, along j) mm a pixel, for poses that are rigid and count in mm; they are multiplied by it.

    Raises ValueError for shapes that do not fit and TypeError for pixels of another type. The package without VTK also raises
    Error, which names the frame and the value, for poses and pixels that are not sound.
    """
    pixels, matrices = np.asarray(frames), common.doubles(poses, "poses")
    if pixels.ndim != 3 or 0 in pixels.shape:
        raise ValueError(f"frames have shape (frames, height, width), not {pixels.shape}")
    if matrices.shape != (len(pixels), 4, 4):
        raise ValueError(f"{len(pixels)} frames need poses of shape ({len(pixels)}, 4, 4), not {matrices.shape}")
    if pixels.dtype == np.bool_:
        pixels = 255 * pixels.astype(np.uint8)
    elif pixels.dtype.kind == "f":
        pixels = pixels.astype(np.float32, copy=False)
    elif pixels.dtype not in (np.uint8, np.uint16):
        raise TypeError(f"frames are uint8, uint16, bool or floats in [0, 1], not {pixels.dtype}")
    if spacing is not None:
        sides = common.doubles(spacing, "spacing")
        if sides.shape != (2,) or not (np.isfinite(sides).all() and (sides > 0).all()):
            raise ValueError(f"spacing is two positive numbers, mm along i and j, not {spacing}")
        matrices = matrices @ np.diag([*sides, 1.0, 1.0])
    times = None if timestamps is None else common.doubles(timestamps, "timestamps")
    lit = None if mask is None else np.ascontiguousarray(np.asarray(mask) != 0, dtype=np.uint8)
    for name, values, shape in (("Timestamp", times, pixels.shape[:1]), ("Mask", lit, pixels.shape[1:])):
        if values is not None and values.shape != shape:
            raise ValueError(f"{name} has shape {values.shape}; {shape} is needed")
    return arrays.make_sweep(np.ascontiguousarray(pixels), np.ascontiguousarray(matrices), times, lit)


def frames(sweep: Sweep) -> np.ndarray:
    """The frames of a sweep: [frames, height, width], a view of its own pixels. A Sweep's cannot be written to."""
    require(sweep, Sweep, "frames", "sweep")
    return arrays.frames(sweep)


def poses(sweep: Sweep) -> np.ndarray:
    """ImageToReference of every frame: float64 [frames, 4, 4], a view of the sweep's own. A Sweep's cannot be written to.

    ``poses(sweep)[k] @ (i, j, 0, 1)`` is where pixel column i, row j of frame k lies, mm.
    """
    require(sweep, Sweep, "poses", "sweep")
    return arrays.poses(sweep)


# ----------------------------------------------------------------------------------------------------------------------
# Files


def read(path: Path, **properties: Unpack[SequenceOptions]) -> Union[Sweep, Field]:
    """Reads a field (.vtp, .ply) or else a tracked sweep: read_field or read_sweep, by the name of the file."""
    name, given = path_text(path), dict(properties)
    return tasks.read_field(name, given) if name.lower().endswith(FIELD_EXTENSIONS) else tasks.read_sweep(name, given)


def read_sweep(path: Path, **properties: Unpack[SequenceOptions]) -> Sweep:
    """Reads a tracked sweep: MetaImage, NRRD, CSV of poses with PNGs. The package without VTK leaves out frames without a
    usable pose. Properties are those of vtkBigusSequenceReader:

    FromFrame="Image", ToFrame="Reference": coordinate frames that the poses lead from and to, by their names in the file.
    ConfigFileName: a Plus configuration (XML) with transforms that the file lacks.
    ImageSpacing=(0, 0): mm of a pixel along i and j, in the place of what the transforms say; 0: what they say.
    AssumeMissingStatusOK=False: accept transforms that have no status.
    AllowReflectedPoses=False: a third column that points the other way is made from the first two; True keeps it.
    ImageFolder, ImagePattern: of a CSV, where its PNGs are; the pattern has one %d.
    PixelRange=0: the stored pixel that becomes white; 0: what the type says, or fewer of 16 bits where no pixel has more.
    AutoMask=True: mark pixels that are 0 in every frame.
    ClipMode=0: 1 blackens what lies outside of ClipRectangle (column, row, width, height in pixels), 2 what lies outside
    of the fan of FanApex, FanRadii (pixels) and FanAngles (degrees from +j towards +i).

    An error says what is wrong, where, what was found and what to do.
    """
    return tasks.read_sweep(path_text(path), dict(properties))


def read_field(path: Path, **properties: Any) -> Field:
    """Reads a field of a .vtp or .ply; in the package of VTK's classes with the properties of vtkBigusFieldReader.

    Without VTK's classes a .vtp in another encoding than ours is read by VTK, where that is installed.
    """
    return tasks.read_field(path_text(path), properties)


def read_stack(path: Path) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """The frames of a sequence [frames, height, width], and their times in seconds or None; poses may be missing."""
    return tasks.read_stack(path_text(path))


def read_spacing(path: Path) -> tuple[float, float]:
    """The size of a pixel along i and j, mm, that the header of a sequence or an image states; 0 where it states none."""
    return tasks.read_spacing(path_text(path))


def read_planes(path: Path, spacing: float = 0.5, world: str = "RAS", **properties: Unpack[PoseOptions]) -> Planes:
    """Slice planes: poses of a sequence or a CSV, 3D Slicer's planes and lines (.mrk.json) and transforms (.tfm, .h5).

    spacing: mm a pixel, for 3D Slicer's planes and lines. world: the patient system that the field's world stands for,
    "RAS" as 3D Slicer shows tracked sequences, or "LPS"; only 3D Slicer's files look at it.
    properties: ConfigFileName, FromFrame, ToFrame, ImageSpacing, AssumeMissingStatusOK and AllowReflectedPoses, as for
    read_sweep.
    """
    if world not in ("RAS", "LPS"):
        raise ValueError(f"world is RAS or LPS, not {world!r}")
    return Planes(*tasks.read_planes(path_text(path), float(spacing), world == "LPS", dict(properties)))


def write(data: Union[Sweep, Field], path: Path, **properties: Unpack[WriteOptions]) -> None:
    """Writes a field (to .vtp, exact, or .ply, for viewers of splats) or a tracked sweep (to .igs.mha).

    Properties: of a sweep FromFrame="Image", ToFrame="Reference" and Compression=True; of a field Rounding=False, which
    leaves out digits that no picture shows. After an error no file is left behind.
    """
    if not isinstance(data, (Field, Sweep)):
        raise TypeError(f"write takes a sweep ({Sweep.__name__}) or a field ({Field.__name__}), not {type(data).__name__}")
    tasks.write(data, path_text(path), dict(properties))


# ----------------------------------------------------------------------------------------------------------------------
# Training


def check(sweep: Sweep, keep: str = "none") -> list[dict]:
    """What is wrong with a sweep, a dictionary a finding: kind, frames (how many), pixels, applied, text.

    keep: kinds that nothing is done about, as the option Keep of train.
    """
    require(sweep, Sweep, "check", "sweep")
    return tasks.check(sweep, keep)


def correct_poses(sweep: Sweep, **properties: Unpack[CorrectionOptions]) -> PoseCorrection:
    """Takes the tracker's noise out of a sweep's poses, where its pictures confirm it; exact poses are kept.

    Strength=-1: 0 to 1000, in units of the noise found; None or a negative number: chosen by evidence.
    HoldOut=0: the pixels of frames with index % HoldOut == HoldOut // 2 are not looked at; 0: all are.
    """
    require(sweep, Sweep, "correct_poses", "sweep")
    return PoseCorrection(**tasks.correct_poses(sweep, dict(properties)))


class _FieldAndLog(NamedTuple):
    field: Field
    log: Any


class Training(_FieldAndLog):
    """The pair of a field and its training log, and what came with them.

    log has a line for iteration, seconds, loss, validation_psnr (dB, nan where there is none), gaussians and rate: a vtkTable,
    or arrays by these names. decisions are the choices training rests on: a list of dicts of decision, choice, evidence
    ("given" where the option was set) and seconds; it is empty when nothing was decided. poses, float64 [frames, 4, 4], are
    ImageToReference of every frame as the field was trained at, the tracker's noise taken out where pictures confirmed it:
    the field belongs to these, not to poses(sweep). options are texts by name that repeat the training. device, iterations,
    seconds, aborted and finished (all steps were taken, or validation said stop) tell how it went; training_frames,
    validation_frames and held_out_frames are frame numbers.
    """

    decisions: list[dict[str, Any]]
    poses: np.ndarray
    options: dict[str, str]
    device: str
    iterations: int
    seconds: float
    aborted: bool
    finished: bool
    training_frames: list[int]
    validation_frames: list[int]
    held_out_frames: list[int]

    def __repr__(self) -> str:
        how = "finished" if self.finished else "stopped"
        held_out = f", {len(self.held_out_frames)} frames held out" if self.held_out_frames else ""
        return f"<bigus.Training of {tasks.size(self.field)} Gaussians, {how} after {self.iterations} iterations{held_out}>"


def train(sweep: Union[Sweep, Sequence[Sweep]], progress: Progress = None, start: Optional[Field] = None,
          checkpoint: Optional[Path] = None, resume: bool = False, checkpoint_interval: float = 60,
          keep_standard_error: bool = True, **properties: Unpack[TrainOptions]) -> Training:
    """Trains a field on a sweep; gives the pair of the field and the training log, with the decisions.

    A list of sweeps of one patient in one reference frame trains one field. Poses are corrected and frames held out in each
    by itself; frames and poses of the second are counted on from those of the first, and so on.

    What no option sets is decided by short trainings scored on frames set aside, or, with Automatic=False, from the
    sweep's geometry. To force all of it: Gaussians, ElevationSigma (mm), SignedReflectivity, VirtualPlanes,
    Interpolation ("normals" or "probe", each with "+flow", "+rough" or "+smooth" after it), FrameGains, Iterations.
    Preset="texture" asks for speckle as strong as in the frames, at a price in error.

    progress(fraction, text) is called now and then, it may be in another thread; when it returns False training stops there
    and gives the best field so far. Without it tqdm, where it is installed, draws a bar in a terminal or a notebook;
    progress=False draws none. Other Python threads run meanwhile. Ctrl-C raises TrainingInterrupted, a KeyboardInterrupt that
    keeps the best so far. start is a field to continue from.

    checkpoint is a file that keeps the state of the training: every checkpoint_interval seconds, 0 or more, and when it is
    stopped, by Ctrl-C or a time limit. A training that finishes removes it. With resume=True training goes on from there with
    the bits of one that never stopped, or begins where there is no such file. One of another sweep, start or option is an
    error that says which; one that cannot be written is a RuntimeWarning.

    keep_standard_error: leave in the field what standard_error needs, 0.1 to 4 MB, which is measured at the end.

    Raises TypeError for an option that there is not, and an error for a value out of range and for sweeps that teach
    nothing. Options, which are the properties of vtkBigusTrainer, are spelt like ``HoldOut=8`` or ``hold_out=8``:
    """
    sweeps = list(sweep) if isinstance(sweep, (list, tuple)) else [sweep]
    for one in sweeps or [None]:
        require(one, Sweep, "train", "sweep")
    if start is not None:
        require(start, Field, "train", "field as start")
    keeping = (common.checkpoint_path(checkpoint, resume, checkpoint_interval), float(checkpoint_interval), bool(resume))
    bar = common.bar_for(progress)
    tell = bar if progress is None or progress is True else progress or None
    try:
        found, rethrow = tasks.train(sweeps, start, keeping, bool(keep_standard_error), dict(properties), tell)
        if bar and found["finished"]:
            bar(1.0, "finished")
    finally:
        if bar:
            bar.close()
    training = Training(found.pop("field"), found.pop("log"))
    for name, value in found.items():
        setattr(training, name, value)
    try:
        rethrow()
    except KeyboardInterrupt as interrupt:
        raise TrainingInterrupted(training) from interrupt
    return training


# ----------------------------------------------------------------------------------------------------------------------
# Slices


def plane(origin: Any, axes: Any, spacing: Union[float, Sequence[float]] = 1.0) -> np.ndarray:
    """The 4 x 4 matrix of a plane, from pixel (i, j, 0, 1) to mm.

    origin: centre of pixel (0, 0), mm. axes: [2, 3] or [3, 3], directions of i and j (they are normalised); a third is
    not looked at. spacing: mm a pixel, one number or (along i, along j). Raises ValueError unless they span a plane.
    """
    directions, place = np.asarray(axes, dtype=np.float64), np.asarray(origin, dtype=np.float64)
    if directions.shape not in ((2, 3), (3, 3)):
        raise ValueError(f"axes are the directions of i and j, of shape (2, 3), not {directions.shape}")
    if place.shape != (3,):
        raise ValueError(f"origin is three numbers, mm, not {origin!r}")
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1] = directions[:2]
    matrix[:3, 3] = place
    return common.pixel_matrix(matrix, spacing)


def reslice(field: Field, plane: Any, size: Optional[Sequence[int]] = None, spacing: Spacing = None,
            **properties: Unpack[SlicerOptions]) -> np.ndarray:
    """The image that the field predicts at a plane: float32 [height, width] in [0, 1).

    plane: 4 x 4 ImageToReference: pixel (i, j, 0, 1) to mm, as in ``poses(sweep)``.
    size: (width, height) in pixels; by default the image starts at pixel (0, 0) and reaches to the field's far end.
    spacing: pixel size, mm, one number or (along i, along j); by default the length of the matrix's columns.
    properties: Engine, ElevationSigma and Tolerance; in the package of VTK's classes all of vtkBigusReslice, such as
    ``OutputMode=vtkBigusReslice.ScatteringField`` (then signed values) or ``OutputScalarType=VTK_UNSIGNED_CHAR``.

    For many planes of one field, and for the coverage, use a Slicer or a vtkBigusReslice: it prepares the field only once.
    """
    require(field, Field, "reslice", "field")
    return tasks.reslice(field, plane, size, spacing, dict(properties))


def standard_error(field: Field, plane: Any, size: Optional[Sequence[int]] = None, spacing: Spacing = None) -> np.ndarray:
    """How far what a probe would show may be from ``reslice`` at the same plane: a standard deviation for every pixel.

    float32 [height, width] in units of intensity (1 is white), nan where the training frames do not tell. The field must
    keep what it rests on, as ``train`` lets it and .vtp files have it; else an error says so.
    """
    require(field, Field, "standard_error", "field")
    return tasks.image_and_error(field, plane, size, spacing, "standard_error")[1]


def mean(field: Field, plane: Any, size: Optional[Sequence[int]] = None, spacing: Spacing = None,
         where: Any = None) -> tuple[float, float]:
    """The mean of ``reslice`` at a plane, and its standard error: (0.31, 0.004).

    where: bool [height, width], the pixels to take; by default all of which ``standard_error`` tells.
    Errors of pixels beside each other are alike, so a mean over n pixels is less sure than their standard error divided
    by the root of n: how much less was measured by the training. The field must keep it, as ``train`` lets it; of releases
    that did not measure it the error is nan.
    """
    require(field, Field, "mean", "field")
    image, sigma, error_of_mean = tasks.image_and_error(field, plane, size, spacing, "mean")
    known = ~np.isnan(sigma)
    if where is not None:
        if np.shape(where) != known.shape:
            raise ValueError(f"mean: where has the shape {np.shape(where)}; the image has {known.shape}.")
        known &= np.asarray(where, bool)
    if not known.any():
        raise ValueError("mean: no pixel was chosen of which the training frames tell.")
    return float(image[known].mean()), error_of_mean(known.astype(np.uint8))


def metrics(a: Any, b: Any) -> dict[str, float]:
    """How close image a is to the truth b: both [height, width] or [frames, height, width], or vtkImageData.

    uint8 pixels are divided by 255, bool is black and white, floating-point ones must lie in [0, 1]. Gives psnr (dB), ssim, bfs and the three
    terms of bfs: mean_contrast, contrast_distribution, rayleigh; each the mean over frames.
    """
    return tasks.metrics(a, b)


for _function, _defaults in tasks.OPTIONS.items():
    spell_out(globals()[_function], _defaults)
train.__doc__ = "\n".join([(train.__doc__ or "").rstrip(), *tasks.OPTION_LINES, "    "])
