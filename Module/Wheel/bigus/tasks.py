# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Train, slice, score: one call each."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np

from . import _core, common, documentation, settings
from ._core import Field, Sweep
from .common import PoseCorrection, TrainingInterrupted, pixel_matrix, require
from .files import settings_of
from .names import by_name, snake_case, spell_out

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Unpack

    from ._options import CorrectionOptions, PhantomOptions, SlicerOptions, TrainOptions


# ----------------------------------------------------------------------------------------------------------------------
# Training


class _FieldAndLog(NamedTuple):
    field: Field
    log: dict[str, np.ndarray]


class Training(_FieldAndLog):
    """The pair of a field and its training log, and what came with them.

    log has arrays of one element a line: iteration, seconds, loss, validation_psnr (dB, nan where there is none),
    gaussians, rate. decisions are the choices training rests on: a list of dicts of decision, choice, evidence and
    seconds. poses, float64 [frames, 4, 4], are ImageToReference of every frame as the field was trained at: the field
    belongs to these, not to poses(sweep). options are texts by name that repeat the training. device, iterations,
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
        return f"<bigus.Training of {len(self.field)} Gaussians, {how} after {self.iterations} iterations{held_out}>"


def _text(name: str, value: Any) -> str:
    """An option's value as Core reads it."""
    if value is None:
        return "auto"
    if isinstance(value, (bool, np.bool_)):
        return "on" if value else "off"
    if isinstance(value, (int, float, np.integer, np.floating)):
        return _core.number_text(float(value))
    if isinstance(value, str):
        return value
    raise TypeError(f"{name} is a number, a text, True, False or None, not {type(value).__name__}")


def options() -> list[dict[str, str]]:
    """Every option of train: name, keyword, group, help, unit, values, type, default, and what holds where it is open."""
    return _core.options()


def train(
    sweep: Union[Sweep, Sequence[Sweep]],
    progress: Union[None, bool, Callable[[float, str], Optional[bool]]] = None,
    start: Optional[Field] = None,
    checkpoint: Union[None, str, os.PathLike] = None,
    resume: bool = False,
    checkpoint_interval: float = 60,
    keep_standard_error: bool = True,
    **properties: Unpack[TrainOptions],
) -> Training:
    """Trains a field on a sweep; gives the pair of the field and the training log, with the decisions.

    {SEVERAL_SWEEPS}

    What no option sets is decided by short trainings scored on frames set aside, or, with Automatic=False, from the
    sweep's geometry.

    {PROGRESS}

    {CHECKPOINTS}

    keep_standard_error: leave in the field what standard_error needs, 0.1 to 4 MB, which is measured at the end.

    Raises TypeError for an option that there is not, and Error for a value out of range and for sweeps that teach
    nothing. Options, spelt like ``HoldOut=8`` or ``hold_out=8``; None leaves one open:
    """
    sweeps = common.training_inputs(sweep, start, Sweep, Field)
    given = by_name(dict(properties), [option["name"] for option in _core.options()], "training", "option")
    texts = {name: _text(name, value) for name, value in given.items()}
    path = common.checkpoint_path(checkpoint, resume, checkpoint_interval)
    bar = common.bar_for(progress)
    if progress is None or progress is True:
        progress = bar
    report = None
    if progress:
        tell = progress

        def report(fraction: float, phase: str, left: float, iteration: int, gaussians: int, loss: float) -> Any:
            text = phase if phase != "training" else f"iteration {iteration}, {gaussians} Gaussians, loss {loss:.4g}"
            return tell(fraction, f"{text}, {left:.0f} s left" if left > 0 else text)

    try:
        found, failure, cautions = _core.train(_core.join(sweeps), texts, start, report, path, float(checkpoint_interval), bool(resume),
                                               bool(keep_standard_error))
        if bar and found["finished"]:
            bar(1.0, "finished")
    finally:
        if bar:
            bar.close()
    for caution in cautions:
        warnings.warn(caution, RuntimeWarning, stacklevel=2)
    training = Training(found.pop("field"), found.pop("log"))
    for name, value in found.items():
        setattr(training, name, value)
    if isinstance(failure, KeyboardInterrupt):
        raise TrainingInterrupted(training) from failure
    if failure is not None:
        raise failure
    return training


def option_text(option: dict[str, str]) -> str:
    """What there is to say of an option, in a line."""
    unit = f" ({option['unit']})" if option["unit"] else ""
    open_ = f": {option['open']}" if option["open"] else ""
    return f"{option['help']}{unit}. {option['values'] or 'text'}; {option['default']}{open_}."


def _default(option: dict[str, str]) -> Any:
    kinds = {"bool": lambda text: text == "on", "int": int, "float": float, "str": str}
    return None if option["default"] == "auto" and option["open"] else kinds[option["type"]](option["default"])


_lines = [f"    {option['name']}: {option_text(option)}" for option in _core.options()]
train.__doc__ = "\n".join([(train.__doc__ or "").format(**vars(common)), *_lines, "    "])
spell_out(train, {option["name"]: _default(option) for option in _core.options()})


def check(sweep: Sweep, keep: str = "none") -> list[dict]:
    """What is wrong with a sweep, a dictionary a finding: kind, frames (how many), pixels, applied, text.

    keep: kinds that nothing is done about, as the option Keep of train.
    """
    require(sweep, Sweep, "check", "sweep")
    return _core.inspect(sweep, keep, list(range(len(sweep))))[0]


def correct_poses(sweep: Sweep, **properties: Unpack[CorrectionOptions]) -> PoseCorrection:
    """Takes the tracker's noise out of a sweep's poses, where its pictures confirm it; exact poses are kept.

    Strength=-1: 0 to 1000, in units of the noise found; None or a negative number: chosen by evidence.
    HoldOut=0: the pixels of frames with index % HoldOut == HoldOut // 2 are not looked at; 0: all are.
    """
    require(sweep, Sweep, "correct_poses", "sweep")
    chosen = settings_of(settings.CORRECTION, dict(properties), "correct_poses")
    strength = None if chosen["Strength"] < 0 else chosen["Strength"]
    for finding in check(sweep, "all"):
        warnings.warn(finding["text"], RuntimeWarning, stacklevel=2)
    found = _core.correct_poses(sweep, strength, chosen["HoldOut"])
    found["outlier"] = found["outlier"] != 0
    return PoseCorrection(**{name: found[name] for name in PoseCorrection._fields})


spell_out(correct_poses, settings.CORRECTION)


class Phantom(_core.Phantom):
    """A made-up organ that a made-up probe sees: its image is known at every plane.

    For example ``Phantom(frames=24, width=80, height=64, pixel_size=0.5, probe="convex").sweep()``; true_poses is where its
    frames were taken, frame(plane, width, height) the truth at any plane. The world's x points to the right, y into the
    body from the skin at 0, z along the sweep. Raises Error for a value out of its range.
    Options, each also in VTK's spelling, and what vtkBigusPhantomSource says of them:
    """

    def __init__(self, **options: Unpack[PhantomOptions]):
        defaults = _core.phantom_options()
        given = settings_of({**defaults, **settings.PHANTOM}, dict(options), "a phantom", "option", complete=False)
        for name, owns in (("NumberOfFrames", ("frames",)), ("FrameSize", ("width", "height"))):  # VTK's for the same
            for own, value in zip(owns, np.ravel(given.pop(name, ()))):
                if own in given:
                    raise TypeError(f"{own} and {name} are the same option of a phantom; give one of them")
                given[own] = int(value)
        super().__init__(**given)


spell_out(Phantom.__init__, _core.phantom_options())
_lines = [f"    {snake_case(name)}: {text}" for name, text in documentation.CLASSES["vtkBigusPhantomSource"].items()
          if snake_case(name) in _core.phantom_options() or name in settings.PHANTOM]  # fmt: skip
Phantom.__doc__ = "\n".join([(Phantom.__doc__ or "").rstrip(), *_lines, "    "])


# ----------------------------------------------------------------------------------------------------------------------
# Slices


def plane(origin: ArrayLike, axes: ArrayLike, spacing: Union[float, Sequence[float]] = 1.0) -> np.ndarray:
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
    return pixel_matrix(matrix, spacing)


class Slicer:
    """A field ready for many slices; it holds the field as it was when the slicer was made.

    Engine="auto", or a name of engines(). ElevationSigma=-1: thickness of every slice, mm; negative: the field's own beam.
    Tolerance=1e-4: how much may be left out of a pixel's intensity, 0 to 1. Several threads may use one slicer.
    Raises Error for a field or an option that is not sound.
    """

    def __init__(self, field: Field, **properties: Unpack[SlicerOptions]):
        require(field, Field, "Slicer", "field")
        chosen = settings_of(settings.SLICER, dict(properties), "slicing")
        self._gaussians = len(field)
        self._renderer = _core.Renderer(field, *chosen.values())

    def __repr__(self) -> str:
        return f"<bigus.Slicer of {self._gaussians} Gaussians, {self.device}>"

    @property
    def device(self) -> str:
        """What computes, such as "CPU (AVX2, 2 threads)"."""
        return self._renderer.device

    @property
    def mean_coverage(self) -> float:
        """The field's mean coverage; a pixel with less than a tenth of it counts as unseen."""
        return self._renderer.mean_coverage

    def _render(self, planes: ArrayLike, size: Sequence[int], spacing: Any, scattering: bool, coverage: bool) -> Any:
        matrices = np.asarray(planes, dtype=np.float64)
        is_one = matrices.ndim == 2
        stack = matrices[None] if is_one else matrices
        if stack.ndim != 3 or stack.shape[1:] != (4, 4):
            raise ValueError(f"a plane is a 4 x 4 matrix, not of shape {matrices.shape}")
        width, height = common.checked_size(size)
        pixels = np.array([pixel_matrix(matrix, spacing) for matrix in stack]).reshape(-1, 4, 4)
        images, seen = self._renderer.render(pixels, width, height, scattering, coverage)
        return (images[0], seen[0] if coverage else None) if is_one else (images, seen)

    def slice(
        self,
        planes: ArrayLike,
        size: Sequence[int],
        spacing: Union[None, float, Sequence[float]] = None,
        scattering: bool = False,
    ) -> np.ndarray:
        """The image at a plane [4, 4] (or images at planes [n, 4, 4]): float32 [height, width] or [n, height, width].

        size: (width, height) in pixels. spacing: as for reslice. scattering: signed S instead of intensity in [0, 1).
        """
        return self._render(planes, size, spacing, scattering, False)[0]

    def slice_and_coverage(
        self,
        planes: ArrayLike,
        size: Sequence[int],
        spacing: Union[None, float, Sequence[float]] = None,
        scattering: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """The same with the coverage: the sum of all Gaussians' weights, near 0 where the sweep saw nothing."""
        return self._render(planes, size, spacing, scattering, True)


def reslice(
    field: Field,
    plane: ArrayLike,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
    **properties: Unpack[SlicerOptions],
) -> np.ndarray:
    """The image that the field predicts at a plane: float32 [height, width] in [0, 1).

    plane: 4 x 4 ImageToReference: pixel (i, j, 0, 1) to mm, as in ``poses(sweep)`` or from ``plane(origin, axes)``.
    size: (width, height) in pixels; by default the image starts at pixel (0, 0) and reaches to the field's far end.
    spacing: pixel size, mm, one number or (along i, along j); by default the length of the matrix's columns.
    properties: Engine, ElevationSigma and Tolerance, as Slicer takes them.

    For many planes of one field, and for the coverage, use a Slicer: it prepares the field only once.
    """
    require(field, Field, "reslice", "field")
    matrix = pixel_matrix(plane, spacing)
    slicer = Slicer(field, **properties)
    return slicer.slice(matrix, size if size is not None else common.size_of_view(field.centers, matrix))


spell_out(Slicer.__init__, settings.SLICER)
spell_out(reslice, settings.SLICER)


def label(
    field: Field,
    sweep: Sweep,
    labels: ArrayLike,
    names: Optional[Mapping[int, str]] = None,
    frames: Optional[Sequence[int]] = None,
    keep_empty_pictures: bool = False,
    engine: str = "auto",
) -> Field:
    """The field with labels drawn on frames, which ``label_map`` shows at any plane.

    sweep: the one that the field was trained on, at the poses that it was trained at.
    labels: whole numbers, 0 (none) to 255, [frames, height, width]. names: {1: "vessel"}.
    frames: the sweep's frames that the pictures are of, ascending; by default all.
    keep_empty_pictures: also where most are empty between the first and the last with a label, they say that nothing is there.
    Raises Error for what does not fit.
    """
    require(field, Field, "label", "field")
    require(sweep, Sweep, "label", "sweep")
    pictures = common.label_pixels(labels)
    numbers = [int(k) for k in (range(len(sweep)) if frames is None else frames)]
    return _core.label(field, sweep, pictures, numbers, dict(names or {}), keep_empty_pictures, engine)


def label_map(
    field: Field,
    plane: ArrayLike,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
    engine: str = "auto",
) -> np.ndarray:
    """Which label each pixel of a plane has, uint8 [height, width], 0 for none. Planes as in ``reslice``."""
    require(field, Field, "label_map", "field")
    matrix = pixel_matrix(plane, spacing)
    width, height = common.checked_size(size if size is not None else common.size_of_view(field.centers, matrix))
    return _core.LabelRenderer(field, engine).render(matrix, width, height)


def standard_error(
    field: Field,
    plane: ArrayLike,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
) -> np.ndarray:
    """How far what a probe would show may be from ``reslice`` at the same plane: a standard deviation for every pixel.

    float32 [height, width] in units of intensity (1 is white), nan where the training frames do not tell. The field must
    keep what it rests on (``field.kept_error``), as ``train`` lets it and .vtp files have it; else Error says so.
    """
    return _image_and_error(field, plane, size, spacing, "standard_error")[1]


def _image_and_error(field: Field, plane: Any, size: Any, spacing: Any, caller: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of a plane: its image, its standard error and the matrix of its pixels."""
    require(field, Field, caller, "field")
    if not field.kept_error:
        raise _core.Error(f"{caller}: the field keeps nothing that it could rest on; train lets a field keep it, in a .vtp.")
    matrix = pixel_matrix(plane, spacing)
    image = reslice(field, matrix, size)
    return image, _core.standard_error(field.kept_error, matrix, image), matrix


def mean(
    field: Field,
    plane: ArrayLike,
    size: Optional[Sequence[int]] = None,
    spacing: Union[None, float, Sequence[float]] = None,
    where: Optional[ArrayLike] = None,
) -> tuple[float, float]:
    """The mean of ``reslice`` at a plane, and its standard error: (0.31, 0.004).

    where: bool [height, width], the pixels to take; by default all of which ``standard_error`` tells.
    Errors of pixels beside each other are alike, so a mean over n pixels is less sure than their standard error divided
    by the root of n: how much less was measured by the training. The field must keep it, as ``train`` lets it; of releases
    that did not measure it the error is nan.
    """
    image, sigma, matrix = _image_and_error(field, plane, size, spacing, "mean")
    known = common.pixels_of_mean(sigma, where)
    return float(image[known].mean()), _core.standard_error_of_mean(field.kept_error, matrix, sigma, known.view(np.uint8))


def distance_to_frames(
    sweep: Sweep, plane: ArrayLike, size: Sequence[int], frames: Optional[Sequence[int]] = None
) -> np.ndarray:
    """From every pixel of a plane to the nearest of the sweep's frames, mm: float32 [height, width].

    frames: the numbers of those that count; by default all.
    """
    require(sweep, Sweep, "distance_to_frames", "sweep")
    numbers = [common.whole(n) for n in (range(len(sweep)) if frames is None else frames)]
    return _core.distances(sweep, numbers, pixel_matrix(plane, None), *common.checked_size(size))


def _intensities(image: ArrayLike) -> np.ndarray:
    pixels = np.asarray(image)
    if pixels.dtype == np.uint8:
        pixels = pixels.astype(np.float32) / np.float32(255)
    elif pixels.dtype.kind != "f":
        raise TypeError(f"an image is uint8 or floats in [0, 1], not {pixels.dtype}")
    if pixels.ndim not in (2, 3) or 0 in pixels.shape:
        raise ValueError(f"an image has shape (height, width) or (frames, height, width), not {pixels.shape}")
    pixels = np.ascontiguousarray(pixels, dtype=np.float32)
    if not (np.isfinite(pixels).all() and pixels.min() >= 0 and pixels.max() <= 1):
        raise ValueError("intensities must lie in [0, 1]")
    return pixels if pixels.ndim == 3 else pixels[None]


def metrics(a: ArrayLike, b: ArrayLike) -> dict[str, float]:
    """How close image a is to the truth b: both [height, width] or [frames, height, width].

    uint8 pixels are divided by 255, floating-point ones must lie in [0, 1]. Gives psnr (dB), ssim, bfs and the three
    terms of bfs: mean_contrast, contrast_distribution, rayleigh; each the mean over frames.
    """
    images, truths = _intensities(a), _intensities(b)
    if images.shape != truths.shape:
        raise ValueError(f"the images have different shapes: {np.shape(a)} and {np.shape(b)}")
    scores = [_core.compare(image, truth) for image, truth in zip(images, truths)]
    return {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}
