# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps, fields and slice planes in files."""

from __future__ import annotations

import os
import warnings
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np

from . import _core, settings
from ._core import Error, Field, Sweep
from .arrays import sweep as sweep_of_arrays
from .common import FIELD_EXTENSIONS, Planes, is_lps, path_text, whole
from .names import by_name, spell_out

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from ._options import PoseOptions, SequenceOptions, WriteOptions


def settings_of(
    known: dict[str, Any], given: dict[str, Any], owner: str, noun: str = "property", complete: bool = True
) -> dict[str, Any]:
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


def read(path: Union[str, os.PathLike], **properties: Unpack[SequenceOptions]) -> Union[Sweep, Field]:
    """Reads a field (.vtp, .ply: Field) or else a tracked sweep: read_field or read_sweep, by the name of the file."""
    name = path_text(path)
    if not name.lower().endswith(FIELD_EXTENSIONS):
        return _read_sweep(name, dict(properties))
    by_name(dict(properties), (), "a field")
    return read_field(name)


def read_sweep(path: Union[str, os.PathLike], **properties: Unpack[SequenceOptions]) -> Sweep:
    """Reads a tracked sweep: MetaImage, NRRD, CSV of poses with PNGs. Frames without a usable pose are left out.

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

    Raises Error, a RuntimeError, when the file cannot be read: what, where, what was found and what to do.
    """
    return _read_sweep(path_text(path), dict(properties))


def _read_sweep(name: str, properties: dict[str, Any]) -> Sweep:
    chosen = settings_of(settings.SEQUENCE, properties, "a sequence")
    found = _core.read_sequence(name, KeepRejectedFrames=False, RequirePoses=True, **chosen)
    for caution in found["warnings"]:
        warnings.warn(caution, RuntimeWarning, stacklevel=3)
    return sweep_of_arrays(found["pixels"], found["poses"], found["timestamps"], found["mask"])


def read_field(path: Union[str, os.PathLike]) -> Field:
    """Reads a field of a .vtp or .ply. A .vtp in another encoding than ours is read by VTK, where that is installed.

    Raises Error, a RuntimeError, when the file cannot be read.
    """
    name = path_text(path)
    found = _core.read_field(name)
    if found is not None:
        return found
    try:
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

        from .vtkdata import field_of_polydata
    except ImportError:
        raise Error(
            f"{name}: a .vtp in another encoding than BIGUS writes (raw appended data, zlib, 64-bit sizes). VTK reads it: "
            "pip install vtk, or convert the file with 'bigus convert' of the C++ build"
        ) from None
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(name)
    reader.Update()
    try:
        return field_of_polydata(reader.GetOutput())
    except Error as error:
        raise Error(f"{name}: {error}") from None


def read_stack(path: Union[str, os.PathLike]) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """The frames of a sequence [frames, height, width], and their times in seconds or None; poses may be missing."""
    chosen = settings_of(settings.SEQUENCE, {"AutoMask": False}, "a sequence")
    found = _core.read_sequence(path_text(path), KeepRejectedFrames=False, RequirePoses=False, **chosen)
    return found["pixels"], found["timestamps"]


def read_spacing(path: Union[str, os.PathLike]) -> tuple[float, float]:
    """The size of a pixel along i and j, mm, that the header of a sequence or an image states; 0 where it states none."""
    return _core.header_spacing(path_text(path))


def write(data: Union[Sweep, Field], path: Union[str, os.PathLike], **properties: Unpack[WriteOptions]) -> None:
    """Writes a field (to .vtp, exact, or .ply, for viewers of splats) or a tracked sweep (to .igs.mha).

    Properties: of a sweep FromFrame="Image", ToFrame="Reference" and Compression=True; of a field Rounding=False, which
    leaves out digits that no picture shows. Raises Error on failure, and then leaves no file behind.
    """
    name, given = path_text(path), dict(properties)
    if isinstance(data, Field):
        for what in _core.write_field(data, name, **settings_of(settings.FIELD_OUTPUT, given, "writing a field")):
            warnings.warn(f"{name}: {what} left out; .vtp keeps it.", RuntimeWarning, stacklevel=2)
    elif isinstance(data, Sweep):
        _core.write_sweep(data, name, **settings_of(settings.SEQUENCE_OUTPUT, given, "writing a sweep"))
    else:
        raise TypeError(f"write takes a bigus.Sweep or a bigus.Field, not {type(data).__name__}")


def read_planes(
    path: Union[str, os.PathLike], spacing: float = 0.5, world: str = "RAS", **properties: Unpack[PoseOptions]
) -> Planes:
    """Slice planes: poses of a sequence or a CSV, 3D Slicer's planes and lines (.mrk.json) and transforms (.tfm, .h5).

    spacing: mm a pixel, for 3D Slicer's planes and lines. world: the patient system that the field's world stands for,
    "RAS" as 3D Slicer shows tracked sequences, or "LPS"; only 3D Slicer's files look at it.
    properties: ConfigFileName, FromFrame, ToFrame, ImageSpacing, AssumeMissingStatusOK and AllowReflectedPoses, as for
    read_sweep.
    """
    chosen = settings_of(settings.POSES, dict(properties), "read_planes")
    return Planes(**_core.read_planes(path_text(path), float(spacing), is_lps(world), **chosen))


for _function, _options in ((read, settings.SEQUENCE), (read_sweep, settings.SEQUENCE), (read_planes, settings.POSES),
                            (write, {**settings.SEQUENCE_OUTPUT, **settings.FIELD_OUTPUT})):  # fmt: skip
    spell_out(_function, _options)
