# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""How Core does what functions.py offers, and what this package has besides: slicers, phantoms, labels."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np

from . import _core, common, documentation, settings
from ._core import Error, Field, Sweep
from .arrays import make_sweep
from .common import path_text, pixel_matrix, require, whole
from .names import by_name, snake_case, spell_out

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Unpack

    from ._options import PhantomOptions, SlicerOptions


# ----------------------------------------------------------------------------------------------------------------------
# Options


def options() -> list[dict[str, str]]:
    """Every option of train: name, keyword, group, help, unit, values, type, default, and what holds where it is open."""
    return _core.options()


def option_text(option: dict[str, str]) -> str:
    """What there is to say of an option, in a line."""
    unit = f" ({option['unit']})" if option["unit"] else ""
    open_ = f": {option['open']}" if option["open"] else ""
    return f"{option['help']}{unit}. {option['values'] or 'text'}; {option['default']}{open_}."


def _default(option: dict[str, str]) -> Any:
    kinds = {"bool": lambda text: text == "on", "int": int, "float": float, "str": str}
    return None if option["default"] == "auto" and option["open"] else kinds[option["type"]](option["default"])


def value_text(name: str, value: Any) -> str:
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


# What the signatures of functions.py show, and what train says of its options.
OPTIONS: dict[str, dict[str, Any]] = {
    "read": settings.SEQUENCE, "read_sweep": settings.SEQUENCE, "read_planes": settings.POSES, "reslice": settings.SLICER,
    "write": {**settings.SEQUENCE_OUTPUT, **settings.FIELD_OUTPUT}, "correct_poses": settings.CORRECTION,
    "train": {option["name"]: _default(option) for option in _core.options()},
}  # fmt: skip
OPTION_LINES = [f"    {option['name']}: {option_text(option)}" for option in _core.options()]


def settings_of(known: dict[str, Any], given: dict[str, Any], owner: str, noun: str = "property",
                complete: bool = True) -> dict[str, Any]:
    """What is given, each value of its default's kind; the default where it is None and, if complete, where it is not given."""
    chosen = dict(known) if complete else {}
    for name, value in by_name(given, known, owner, noun).items():
        try:
            chosen[name] = known[name] if value is None else _of_kind(known[name], value)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{name} = {value!r}: {error}") from None
    return chosen


def _of_kind(default: Any, value: Any) -> Any:
    if isinstance(default, tuple):
        numbers = tuple(_of_kind(default[0], one) for one in value)
        if len(numbers) != len(default):
            raise TypeError(f"{len(default)} numbers are expected")
        return numbers
    if isinstance(default, str):
        return path_text(value)
    if isinstance(default, bool) and value not in (True, False):
        raise TypeError("True or False is expected")
    return whole(value) if type(default) is int else type(default)(value)


# ----------------------------------------------------------------------------------------------------------------------
# Files


def _read_sequence(name: str, properties: dict[str, Any], requires_poses: bool = True) -> dict[str, Any]:
    chosen = settings_of(settings.SEQUENCE, properties, "a sequence")
    return _core.read_sequence(name, KeepRejectedFrames=False, RequirePoses=requires_poses, **chosen)


def read_sweep(name: str, properties: dict[str, Any]) -> Sweep:
    found = _read_sequence(name, properties)
    for caution in found["warnings"]:
        warnings.warn(caution, RuntimeWarning, stacklevel=3)
    return make_sweep(found["pixels"], found["poses"], found["timestamps"], found["mask"])


def read_field(name: str, properties: dict[str, Any]) -> Field:
    by_name(properties, (), "a field")
    found = _core.read_field(name)
    if found is not None:
        return found
    try:
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

        from .vtkdata import field_of_polydata
    except ImportError:
        raise Error(f"{name}: a .vtp in another encoding than BIGUS writes (raw appended data, zlib, 64-bit sizes). VTK reads it: "
                    "pip install vtk, or convert the file with 'bigus convert' of the C++ build") from None
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(name)
    reader.Update()
    try:
        return field_of_polydata(reader.GetOutput())
    except Error as error:
        raise Error(f"{name}: {error}") from None


def read_stack(name: str) -> tuple[np.ndarray, Optional[np.ndarray]]:
    found = _read_sequence(name, {"AutoMask": False}, requires_poses=False)
    return found["pixels"], found["timestamps"]


read_spacing = _core.header_spacing


def read_planes(name: str, spacing: float, is_lps: bool, properties: dict[str, Any]) -> tuple:
    found = _core.read_planes(name, spacing, is_lps, **settings_of(settings.POSES, properties, "read_planes"))
    return tuple(found[part] for part in common.Planes._fields)


def write(data: Union[Sweep, Field], name: str, properties: dict[str, Any]) -> None:
    if isinstance(data, Sweep):
        _core.write_sweep(data, name, **settings_of(settings.SEQUENCE_OUTPUT, properties, "writing a sweep"))
        return
    for what in _core.write_field(data, name, **settings_of(settings.FIELD_OUTPUT, properties, "writing a field")):
        warnings.warn(f"{name}: {what} left out; .vtp keeps it.", RuntimeWarning, stacklevel=3)


# ----------------------------------------------------------------------------------------------------------------------
# Training


def check(sweep: Sweep, keep: str) -> list[dict]:
    return _core.inspect(sweep, keep, list(range(len(sweep))))[0]


def correct_poses(sweep: Sweep, properties: dict[str, Any]) -> dict[str, Any]:
    chosen = settings_of(settings.CORRECTION, properties, "correct_poses")
    strength = None if chosen["Strength"] < 0 else chosen["Strength"]
    for finding in check(sweep, "all"):
        warnings.warn(finding["text"], RuntimeWarning, stacklevel=3)
    found = _core.correct_poses(sweep, strength, chosen["HoldOut"])
    found["outlier"] = found["outlier"] != 0
    (found["noise"],) = ({part.lower(): float(value) for part, value in zip(parts, values[0])}
                         for name, parts, values in found["numbers"] if name == "TrackerNoise")  # fmt: skip
    return {name: found[name] for name in common.PoseCorrection._fields}


size = len  # of a field, in Gaussians


def train(sweeps: list, start: Optional[Field], keeping: tuple[str, float, bool], keeps_error: bool, properties: dict[str, Any],
          progress: Optional[Callable]) -> tuple[dict[str, Any], Callable[[], None]]:
    """What came of it, and a function that raises what ended it, if Ctrl-C or `progress` did."""
    given = by_name(properties, [option["name"] for option in _core.options()], "training", "option")
    texts = {name: value_text(name, value) for name, value in given.items()}
    found, rethrow, cautions = _core.train(_core.join(sweeps), texts, start, progress, *keeping, keeps_error)
    for caution in cautions:
        warnings.warn(caution, RuntimeWarning, stacklevel=3)
    return found, rethrow


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

    def slice(self, planes: ArrayLike, size: Sequence[int], spacing: Union[None, float, Sequence[float]] = None,
              scattering: bool = False) -> np.ndarray:
        """The image at a plane [4, 4] (or images at planes [n, 4, 4]): float32 [height, width] or [n, height, width].

        size: (width, height) in pixels. spacing: as for reslice. scattering: signed S instead of intensity in [0, 1).
        """
        return self._render(planes, size, spacing, scattering, False)[0]

    def slice_and_coverage(self, planes: ArrayLike, size: Sequence[int], spacing: Union[None, float, Sequence[float]] = None,
                           scattering: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """The same with the coverage: the sum of all Gaussians' weights, near 0 where the sweep saw nothing."""
        return self._render(planes, size, spacing, scattering, True)


spell_out(Slicer.__init__, settings.SLICER)


def reslice(field: Field, plane: Any, size: Any, spacing: Any, properties: dict[str, Any]) -> np.ndarray:
    matrix, pixels = common.view(field.centers, plane, size, spacing)
    return Slicer(field, **properties).slice(matrix, pixels)


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


def image_and_error(field: Field, plane: Any, size: Any, spacing: Any, caller: str) -> tuple[np.ndarray, np.ndarray, Callable]:
    """The image at a plane, its standard error, and what tells that of a mean over pixels that are not 0."""
    kept = field.kept_error
    if not kept:
        raise Error(f"{caller}: the field keeps nothing that it could rest on; train lets a field keep it, in a .vtp.")
    matrix = pixel_matrix(plane, spacing)
    image = reslice(field, matrix, size, None, {})
    sigma = _core.standard_error(kept, matrix, image)
    return image, sigma, lambda chosen: _core.standard_error_of_mean(kept, matrix, sigma[np.newaxis], chosen[np.newaxis])


def distance_to_frames(sweep: Sweep, plane: ArrayLike, size: Sequence[int], frames: Optional[Sequence[int]] = None) -> np.ndarray:
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
    elif pixels.dtype != np.bool_ and pixels.dtype.kind != "f":
        raise TypeError(f"an image is uint8, bool or floats in [0, 1], not {pixels.dtype}")
    if pixels.ndim not in (2, 3) or 0 in pixels.shape:
        raise ValueError(f"an image has shape (height, width) or (frames, height, width), not {pixels.shape}")
    pixels = np.ascontiguousarray(pixels, dtype=np.float32)
    if not (np.isfinite(pixels).all() and pixels.min() >= 0 and pixels.max() <= 1):
        raise ValueError("intensities must lie in [0, 1]")
    return pixels if pixels.ndim == 3 else pixels[None]


def metrics(a: Any, b: Any) -> dict[str, float]:
    images, truths = _intensities(a), _intensities(b)
    if images.shape != truths.shape:
        raise ValueError(f"the images have different shapes: {np.shape(a)} and {np.shape(b)}")
    scores = [_core.compare(image, truth) for image, truth in zip(images, truths)]
    return {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}
