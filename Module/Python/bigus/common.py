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
    if not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-6):
        advice = "; is it stored column by column? Give its transpose" if not matrix[:3, 3].any() else ""
        raise ValueError(f"the last row of the plane's matrix is {matrix[3].tolist()}, not 0 0 0 1{advice}")
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


def view(centers: np.ndarray, plane: Any, size: Any, spacing: Any) -> tuple[np.ndarray, tuple[int, int]]:
    """The matrix of a plane's pixels, and how many there are; by default as many as reach the last Gaussian."""
    matrix = pixel_matrix(plane, spacing)
    return matrix, checked_size(size if size is not None else size_of_view(centers, matrix))


# ----------------------------------------------------------------------------------------------------------------------
# Sweeps


def doubles(values: Any, name: str) -> np.ndarray:
    try:
        return np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} must be numbers: {error}") from None


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


# Columns of VTK's tables by their names in Python, and what they hold: steps of a pose correction, findings, decisions.
STEP_COLUMNS: dict[str, type] = {**dict.fromkeys(("from", "to", "share", "share_error", "gain", "gain_error", "revisit_share",
                                                  "revisit_error"), float), "taken": bool}  # fmt: skip
FINDING_COLUMNS: dict[str, type] = {"kind": str, "frames": int, "pixels": int, "applied": bool, "text": str}
DECISION_COLUMNS: dict[str, type] = {"decision": str, "choice": str, "evidence": str, "seconds": float}
SCORES = ("PSNR", "SSIM", "BFS", "MeanContrast", "ContrastDistribution", "Rayleigh")  # of an image beside the truth


# ----------------------------------------------------------------------------------------------------------------------
# Training


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
