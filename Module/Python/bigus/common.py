# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What both Python packages have in common, the one of VTK's classes and the one without VTK."""

from __future__ import annotations

import operator
import os
import sys
from typing import Any, NamedTuple, Optional, Sequence, Union

import numpy as np

FIELD_EXTENSIONS = (".vtp", ".ply")


def require(data: Any, kind: type, task: str, noun: str) -> None:
    """Raises TypeError for data of another kind."""
    if not isinstance(data, kind):
        package = "bigus." if kind.__module__.startswith("bigus.") else ""
        found = data.GetClassName() if hasattr(data, "GetClassName") else type(data).__name__
        raise TypeError(f"{task} takes a {noun} ({package}{kind.__name__}), not {found}")


def path_text(path: Union[str, os.PathLike]) -> str:
    name = os.fspath(path) if isinstance(path, os.PathLike) else path
    if not isinstance(name, str):
        raise TypeError(f"a path is text or a pathlib.Path, not {type(name).__name__}")
    return name


# ----------------------------------------------------------------------------------------------------------------------
# Planes


class Planes(NamedTuple):
    """Slice planes of a file."""

    poses: np.ndarray  # float64 [n, 4, 4], ImageToReference: pixel (i, j, 0, 1) to mm
    sizes: np.ndarray  # int32 [n, 2], (width, height) in pixels; 0 where the file does not say
    source_frames: np.ndarray  # int32 [n], index in the file
    timestamps: Optional[np.ndarray]  # float64 [n], seconds; None unless every plane has one
    rejections: str  # which poses were left out and why, in a sentence; empty when none was


def is_lps(world: str) -> bool:
    if world not in ("RAS", "LPS"):
        raise ValueError(f"world is RAS or LPS, not {world!r}")
    return world == "LPS"


def pixel_matrix(matrix: np.ndarray, spacing: Union[None, float, Sequence[float]] = None) -> np.ndarray:
    """A plane's matrix with columns of this spacing and its third column along the normal, of length 1."""
    try:
        matrix = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"a plane is a 4 x 4 matrix of numbers, not {type(matrix).__name__}") from None
    if matrix.shape != (4, 4):
        raise ValueError(f"a plane is a 4 x 4 matrix, not of shape {matrix.shape}")
    normal = np.cross(matrix[:3, 0], matrix[:3, 1])
    if not np.isfinite(matrix).all() or np.linalg.norm(normal) == 0:
        raise ValueError("the first two columns of the plane's matrix must be finite and span a plane")
    if spacing is not None:
        if np.size(spacing) not in (1, 2) or not all(0 < side < np.inf for side in np.ravel(spacing)):
            raise ValueError(f"the spacing must be positive, one number or two, not {spacing}")
        matrix[:3, :2] *= np.broadcast_to(spacing, 2) / np.linalg.norm(matrix[:3, :2], axis=0)
    matrix[:3, 2] = normal / np.linalg.norm(normal)
    matrix[3] = (0, 0, 0, 1)
    return matrix


def size_of_view(centers: np.ndarray, matrix: np.ndarray) -> tuple[int, int]:
    """(width, height) of the image that starts at pixel (0, 0) and reaches the field's last Gaussian either way."""
    advice = "give size=(width, height)"
    if len(centers) == 0:
        raise ValueError(f"the field is empty, so there is nothing to size the image by; {advice}")
    pixels = (centers - matrix[:3, 3]) @ np.linalg.pinv(matrix[:3, :2]).T
    width, height = (int(n) for n in np.ceil(pixels.max(axis=0)) + 1)
    if width < 1 or height < 1:
        raise ValueError(f"the whole field lies before pixel (0, 0) of this plane; {advice}")
    return width, height


def whole(number: Any) -> int:
    """A whole number, which may be a float; TypeError for any other value."""
    return int(number) if isinstance(number, (float, np.floating)) and number.is_integer() else operator.index(number)


def checked_size(size: Sequence[int]) -> tuple[int, int]:
    try:
        width, height = (whole(n) for n in size)
    except (TypeError, ValueError):
        raise ValueError(f"size is (width, height), two whole numbers of pixels, not {size!r}") from None
    if width < 1 or height < 1:
        raise ValueError(f"the size must be positive, not {width} x {height}")
    return width, height


def pixels_of_mean(sigma: np.ndarray, where: Any) -> np.ndarray:
    """Which pixels a mean is of: those of which the standard error is known, of those that are chosen."""
    known = ~np.isnan(sigma)
    if where is not None:
        if np.shape(where) != known.shape:
            raise ValueError(f"mean: where has the shape {np.shape(where)}; the image has {known.shape}.")
        known &= np.asarray(where, bool)
    if not known.any():
        raise ValueError("mean: no pixel was chosen of which the training frames tell.")
    return known


# ----------------------------------------------------------------------------------------------------------------------
# Sweeps


def check_sweep(frames: np.ndarray, poses: np.ndarray) -> None:
    """Raises ValueError unless the shapes are those of a sweep."""
    if frames.ndim != 3 or 0 in frames.shape:
        raise ValueError(f"frames have shape (frames, height, width), not {frames.shape}")
    if poses.shape != (len(frames), 4, 4):
        raise ValueError(f"{len(frames)} frames need poses of shape ({len(frames)}, 4, 4), not {poses.shape}")


class PoseCorrection(NamedTuple):
    """A sweep at corrected poses, and what was found. Arrays have one element a frame.

    In the package of VTK's classes the sweep's field data have more: vtkBigusPoseCorrection lists them.
    """

    sweep: Any  # pixels shared with the sweep given
    displacement: np.ndarray  # mm that the image's corners moved, mean of four
    rotation: np.ndarray  # degrees
    outlier: np.ndarray  # bool: recorded so far off that the pose follows from its neighbours
    noise: dict[str, float]  # the tracker's: translation (mm), rotation (degrees), corner (mm at the image's corners)
    strength: float  # in units of the noise found; 0: no noise is taken out
    decision: dict[str, str]  # choice and evidence
    steps: list[dict[str, Any]]  # that were judged: from, to, share, share_error, gain (dB), gain_error, revisit_share and _error, taken


# The columns of vtkBigusPoseCorrection's table of steps.
STEP_COLUMNS = {"from": "From", "to": "To", "share": "Share", "share_error": "ShareError", "gain": "Gain",
                "gain_error": "GainError", "revisit_share": "RevisitShare",
                "revisit_error": "RevisitError", "taken": "Taken"}  # fmt: skip


# ----------------------------------------------------------------------------------------------------------------------
# Training

# What the documentation of train says in both packages.
SEVERAL_SWEEPS = """A list of sweeps of one patient in one reference frame trains one field. Poses are corrected and frames held
    out in each by itself; frames and poses of the second are counted on from those of the first, and so on."""
CHECKPOINTS = """checkpoint is a file that keeps the state of the training: every checkpoint_interval seconds, 0 or more, and when
    it is stopped, by Ctrl-C or a time limit. A training that finishes removes it. With resume=True training goes on from
    there with the bits of one that never stopped, or begins where there is no such file. One of another sweep, start or
    option is a RuntimeError that says which; one that cannot be written is a RuntimeWarning."""
PROGRESS = """progress(fraction, text) is called now and then, it may be in another thread; when it returns False training stops
    there and gives the best field so far. Without it tqdm, where it is installed, draws a bar in a terminal or a notebook; progress=False draws none.
    Other Python threads run meanwhile. Ctrl-C raises TrainingInterrupted, a KeyboardInterrupt that keeps the best so far.
    start is a field to continue from."""


class TrainingInterrupted(KeyboardInterrupt):
    """Ctrl-C while training. ``training`` is the best so far."""

    training: Any

    def __init__(self, training: Any = None):
        super().__init__("the field so far is in .training")
        self.training = training


def label_pixels(labels: Any) -> np.ndarray:
    """Label pictures as uint8 [frames, height, width]."""
    pixels = np.asarray(labels)
    if pixels.ndim != 3 or pixels.dtype.kind not in "bui":
        raise ValueError(f"labels are whole numbers [frames, height, width], not {pixels.dtype} of shape {pixels.shape}")
    if pixels.size and (pixels.min() < 0 or pixels.max() > 255):
        raise ValueError(f"labels lie between 0 (none) and 255, not between {pixels.min()} and {pixels.max()}")
    return np.ascontiguousarray(pixels, dtype=np.uint8)


def training_inputs(sweep: Any, start: Any, sweep_kind: type, field_kind: type) -> list:
    """The sweeps that train was called with; it was called with data of these kinds, or TypeError."""
    sweeps = list(sweep) if isinstance(sweep, (list, tuple)) else [sweep]
    for one in sweeps or [None]:
        require(one, sweep_kind, "train", "sweep")
    if start is not None:
        require(start, field_kind, "train", "field as start")
    return sweeps


def checkpoint_path(checkpoint: Union[None, str, os.PathLike], resume: bool, interval: float) -> str:
    """The file that keeps a training's state, or nothing."""
    if resume and checkpoint is None:
        raise ValueError("resume goes on from a checkpoint; say from which file: checkpoint=...")
    if not 0 <= interval < float("inf"):
        raise ValueError(f"checkpoint_interval is a number of seconds, 0 or more, not {interval}")
    return "" if checkpoint is None else path_text(checkpoint)


class Bar:
    """Shows a training's progress; close it in any case."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def __call__(self, fraction: float, text: str) -> None:
        self._bar.set_postfix_str(text, refresh=False)
        self._bar.update(100 * fraction - self._bar.n)

    def close(self) -> None:
        self._bar.close()


def bar_for(progress: Any) -> Optional[Bar]:
    """A progress bar by tqdm where somebody watches and it is installed, unless progress is told otherwise."""
    if progress is not None and progress is not True:
        return None
    if "ipykernel" not in sys.modules and not (sys.stderr and sys.stderr.isatty()):
        return None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return Bar(tqdm(total=100, desc="Training", unit="%", bar_format="{desc} {bar} {percentage:3.0f} %  {elapsed}{postfix}"))
