# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps, fields and slice planes in files."""

from __future__ import annotations

import os
import warnings
from typing import Any, Optional, Union

import numpy as np

from . import _core
from ._core import Error, Field, Sweep
from .arrays import sweep as sweep_of_arrays
from .common import FIELD_EXTENSIONS, Planes, is_lps

POSES = {
    "ConfigFileName": "",
    "FromFrame": "Image",
    "ToFrame": "Reference",
    "ImageSpacing": (0.0, 0.0),
    "AssumeMissingStatusOK": False,
    "AllowReflectedPoses": False,
}
SEQUENCE = {
    **POSES,
    "ImageFolder": "",
    "ImagePattern": "",
    "PixelRange": 0.0,
    "AutoMask": True,
    "ClipMode": 0,
    "ClipRectangle": (0, 0, 0, 0),
    "FanApex": (0.0, 0.0),
    "FanRadii": (0.0, 0.0),
    "FanAngles": (-180.0, 180.0),
}
SEQUENCE_OUTPUT = {"FromFrame": "Image", "ToFrame": "Reference", "Compression": True}
FIELD_OUTPUT = {"Rounding": False}


def settings_of(known: dict[str, Any], given: dict[str, Any], what: str) -> dict[str, Any]:
    """The defaults with what is given, each value of its default's kind."""
    settings = dict(known)
    for name, value in given.items():
        if name not in known:
            close = [k for k in known if k.lower() == name.replace("_", "").lower()]
            hint = f"; did you mean {close[0]}?" if close else ""
            raise TypeError(f"{what} has no property {name}{hint}")
        default = known[name]
        try:
            if isinstance(default, tuple):
                kind = type(default[0])
                settings[name] = tuple(kind(v) for v in value)
                if len(settings[name]) != len(default):
                    raise TypeError(f"{len(default)} numbers are expected")
            elif isinstance(default, str):
                settings[name] = "" if value is None else os.fspath(value)
            else:
                settings[name] = type(default)(value)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{name} = {value!r}: {error}") from None
    return settings


def read(path: Union[str, os.PathLike], **properties: Any) -> Union[Sweep, Field]:
    """Reads a field (.vtp, .ply: Field) or else a tracked sweep (Sweep; MetaImage, NRRD, CSV of poses with PNGs).

    Frames without a usable pose are left out. Properties for sweeps, with their defaults:

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
    name = os.fspath(path)
    if name.lower().endswith(FIELD_EXTENSIONS):
        if properties:
            raise TypeError(f"a field has no property {next(iter(properties))}")
        return read_field(name)
    settings = settings_of(SEQUENCE, properties, "a sequence")
    found = _core.read_sequence(name, KeepRejectedFrames=False, RequirePoses=True, **settings)
    for caution in found["warnings"]:
        warnings.warn(caution, RuntimeWarning, stacklevel=2)
    return sweep_of_arrays(found["pixels"], found["poses"], found["timestamps"], found["mask"])


def read_field(name: str) -> Field:
    """A field of a .vtp or .ply, whatever its name; a .vtp in another encoding than ours by VTK's own reader."""
    found = _core.read_field(name)
    if found is not None:
        return found
    try:
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
    except ImportError:
        raise Error(
            f"{name}: a .vtp in another encoding than BIGUS writes (raw appended data, zlib, 64-bit sizes). VTK reads it: "
            "pip install vtk, or convert the file with 'bigus convert' of the C++ build"
        ) from None
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(name)
    reader.Update()
    data = reader.GetOutput()
    from .vtkdata import field_of_polydata

    try:
        return field_of_polydata(data)
    except Error as error:
        raise Error(f"{name}: {error}") from None


def read_stack(path: Union[str, os.PathLike]) -> tuple[np.ndarray, Optional[np.ndarray]]:
    """The frames of a sequence [frames, height, width], and their times in seconds or None; poses may be missing."""
    settings = settings_of(SEQUENCE, {"AutoMask": False}, "a sequence")
    found = _core.read_sequence(os.fspath(path), KeepRejectedFrames=False, RequirePoses=False, **settings)
    return found["pixels"], found["timestamps"]


def read_spacing(path: Union[str, os.PathLike]) -> tuple[float, float]:
    """The size of a pixel along i and j, mm, that the header of a sequence or an image states; 0 where it states none."""
    return _core.header_spacing(os.fspath(path))


def write(data: Union[Sweep, Field], path: Union[str, os.PathLike], **properties: Any) -> None:
    """Writes a field (to .vtp, exact, or .ply, for viewers of splats) or a tracked sweep (to .igs.mha).

    Properties: of a sweep FromFrame="Image", ToFrame="Reference" and Compression=True; of a field Rounding=False, which
    leaves out digits that no picture shows. Raises Error on failure, and then leaves no file behind.
    """
    name = os.fspath(path)
    if isinstance(data, Field):
        _core.write_field(data, name, **settings_of(FIELD_OUTPUT, properties, "writing a field"))
    elif isinstance(data, Sweep):
        _core.write_sweep(data, name, **settings_of(SEQUENCE_OUTPUT, properties, "writing a sweep"))
    else:
        raise TypeError(f"write takes a bigus.Sweep or a bigus.Field, not {type(data).__name__}")


def read_planes(path: Union[str, os.PathLike], spacing: float = 0.5, world: str = "RAS", **properties: Any) -> Planes:
    """Slice planes: poses of a sequence or a CSV, 3D Slicer's planes and lines (.mrk.json) and transforms (.tfm, .h5).

    spacing: mm a pixel, for 3D Slicer's planes and lines. world: the patient system that the field's world stands for,
    "RAS" as 3D Slicer shows tracked sequences, or "LPS"; only 3D Slicer's files look at it.
    properties: ConfigFileName, FromFrame, ToFrame, ImageSpacing, AssumeMissingStatusOK and AllowReflectedPoses, as for read.
    """
    settings = settings_of(POSES, properties, "read_planes")
    return Planes(**_core.read_planes(os.fspath(path), float(spacing), is_lps(world), **settings))
