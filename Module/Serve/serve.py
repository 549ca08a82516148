# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A page in the browser: move a plane through a field and see its slice beside the recorded frames.

    python3 -m bigus.serve field.vtp
    python3 -m bigus.serve field.vtp sweep.igs.mha --port 9000
    python3 -m bigus.serve igtl://localhost:18945     # a field that grows: bigus live ... --listen 18945

The address is printed when all is read. Only programs of this machine reach it, unless --host says otherwise; then a
token is asked for, which is part of the address that is printed. Ctrl-C ends it.
"""

from __future__ import annotations

import argparse
import asyncio
import concurrent.futures
import contextlib
import hmac
import ipaddress
import json
import logging
import math
import os
import secrets
import signal
import socket
import struct
import sys
import time
import warnings
from pathlib import Path
from typing import Any, Iterable, NamedTuple, Optional, Sequence
from urllib.parse import urlsplit

import numpy as np

MOST_CLIENTS = 16
IDLE_SECONDS = 60.0  # who asked nothing for so long gives its place to the next when all are taken
ENDING_SECONDS = 2.0  # to say goodbye to clients, and as long again for requests that are under way
MOST_MESSAGE_BYTES = 4096  # a request has about 400
MESSAGES_PER_SECOND = 200.0  # beside those that were answered by a picture: a page sends the next one then
MESSAGES_AT_ONCE = 400.0
MOST_BAD_MESSAGES = 20  # then the connection is closed
MOST_PIXELS = 2 * 1024 * 1024  # of a slice: a frame of 1920 x 1080 passes
MOST_SIDE = 4096  # pixels
FARTHEST = 1e5  # mm: origins beyond are refused
FINEST, COARSEST = 1e-4, 1e2  # mm a pixel
THICKEST = 10.0  # mm, one standard deviation of a slice's thickness
SEEN_ABOVE = 0.1  # of the field's mean coverage
SEEN_SIDE = 48  # points of the grid on which a sweep is asked what it saw
SEEN_FRAMES = 150  # that are asked at most
MOST_POINTS = 30000  # of the overview; more are not told apart in a picture of 500 x 500
SEND_SECONDS = 20.0  # a client that takes no bytes for so long is dropped
SAME_POSE = 1e-6  # mm at the image's corners: the plane is the frame's own
LIVE_SECONDS = 10.0  # a live field that does not answer for so long is away
SURE_STEPS = 510  # of a byte in white: standard errors travel in half grey levels
REFRESH_SECONDS = 2.0  # a live field's Gaussians are asked for at most so often
MOST_LIVE_BYTES = 2**26  # of a message


# ----------------------------------------------------------------------------------------------------------------------
# What is shown. The build with VTK and the wheel differ in what fields and sweeps are; only this part knows.


class Rendered(NamedTuple):
    image: np.ndarray  # float32 [height, width] in [0, 1)
    coverage: np.ndarray  # float32 [height, width]
    labels: Optional[np.ndarray] = None  # uint8 [height, width], where they were asked for
    error: Optional[np.ndarray] = None  # standard error, float32 [height, width], nan: not known; where it was asked for


def _labels(values: Iterable, names: Iterable, colors: Iterable) -> list[dict[str, Any]]:
    """Labels that a field has, as the page is told of them."""
    return [{"value": int(v), "name": str(n), "color": [float(part) for part in c]} for v, n, c in zip(values, names, colors)]


def _axes_of(poses: np.ndarray) -> np.ndarray:
    """Of recorded frames whose echoes depend on the direction: the axes of each, [k, 3, 3]."""
    return np.array(poses).reshape(-1, 4, 4)[:, :3, :3]


def turn_from(views: np.ndarray, plane: np.ndarray) -> float:
    """Degrees that a plane is turned by from the recorded frame that looks most alike."""
    u, n = plane[:3, 0], np.cross(plane[:3, 0], plane[:3, 1])
    axes = np.stack([a / np.linalg.norm(a) for a in (u, np.cross(n, u), n)], axis=1)
    cosine = (np.einsum("kij,ij->k", views, axes).max() - 1) / 2
    return math.degrees(math.acos(min(1.0, max(-1.0, float(cosine)))))


class FieldOfVtk:
    """A vtkPolyData and the filter that slices it, for one thread at a time."""

    def __init__(self, bigus: Any, field: Any):
        from vtkmodules.util.numpy_support import vtk_to_numpy

        data = field.GetPointData()
        self.centers = np.empty((0, 3))
        self.scales, self.reflectivities = np.empty((0, 3)), np.empty(0)
        if field.GetNumberOfPoints():
            self.centers = vtk_to_numpy(field.GetPoints().GetData())
            self.scales = vtk_to_numpy(data.GetArray("Scale"))
            self.reflectivities = vtk_to_numpy(data.GetArray("Reflectivity")).ravel()
        self.gaussians, self.weight = len(self.centers), 1.0
        sigma = field.GetFieldData().GetArray("ElevationSigma")
        self.elevation_sigma: Optional[float] = sigma.GetTuple1(0) if sigma else 0.0
        self._filter = bigus.vtkBigusReslice()
        self._filter.SetInputData(field)
        self.labels: list[dict[str, Any]] = []
        if data.GetArray("LabelWeight"):
            values, names, colors = (field.GetFieldData().GetAbstractArray("Label" + kind) for kind in ("Values", "Names", "Colors"))
            self.labels = _labels(vtk_to_numpy(values), map(names.GetValue, range(names.GetNumberOfValues())), vtk_to_numpy(colors))
        self.keeps_error = field.GetFieldData().GetArray("StandardError") is not None
        poses = field.GetFieldData().GetArray("ViewPoses") if data.GetArray("ViewTerm") else None
        self.views = None if poses is None else _axes_of(vtk_to_numpy(poses))

    def render(self, plane: np.ndarray, width: int, height: int, sigma: float = -1.0, labels: bool = False,
               error: bool = False) -> Rendered:  # fmt: skip
        from vtkmodules.vtkCommonMath import vtkMatrix4x4

        from .arrays import _pixels
        from .pipeline import update_alone

        axes = vtkMatrix4x4()
        axes.DeepCopy(plane.ravel())
        self._filter.SetElevationSigma(sigma)
        self._filter.SetGenerateLabelOutput(labels)
        self._filter.SetGenerateStandardErrorOutput(error)
        self._filter.SetOutputToFrame(axes, width, height)
        update_alone(self._filter)
        outputs = self._filter.GetOutput(), self._filter.GetCoverageOutput()
        more = self._filter.GetLabelOutput() if labels else None, self._filter.GetStandardErrorOutput() if error else None
        return Rendered(*(None if one is None else _pixels(one)[0] for one in (*outputs, *more)))


class FieldOfWheel:
    """A bigus.Field and the slicer that holds it."""

    def __init__(self, bigus: Any, field: Any):
        self.centers = np.asarray(field.centers)
        self.scales, self.reflectivities = np.asarray(field.scales), np.asarray(field.reflectivities).ravel()
        self.gaussians, self.weight = len(self.centers), 1.0
        self.elevation_sigma: Optional[float] = field.elevation_sigma
        self._make, self._sigma = (lambda sigma: bigus.Slicer(field, ElevationSigma=sigma)), -1.0
        self._slicer = self._make(self._sigma)
        self.labels: list[dict[str, Any]] = []
        if field.label_arrays is not None:
            names, values, colors, *_ = field.label_arrays
            self.labels = _labels(values, names, colors)
        self._label_slicer: Any = None  # made when labels are asked for
        self._make_labels = lambda sigma: bigus._core.LabelRenderer(field, "auto", sigma)
        self._kept, self._error_of = field.kept_error, bigus._core.standard_error
        self.keeps_error = bool(self._kept)
        self.views = None if field.view_arrays is None else _axes_of(field.view_arrays[3])

    def render(self, plane: np.ndarray, width: int, height: int, sigma: float = -1.0, labels: bool = False,
               error: bool = False) -> Rendered:  # fmt: skip
        if sigma != self._sigma:
            self._slicer, self._sigma, self._label_slicer = self._make(sigma), sigma, None
        if labels and self._label_slicer is None:
            self._label_slicer = self._make_labels(sigma)
        map = self._label_slicer.render(plane, width, height) if labels else None
        image, coverage = self._slicer.slice_and_coverage(plane, (width, height))
        return Rendered(image, coverage, map, self._error_of(self._kept, plane, image) if error else None)


class Away(Exception):
    """A live field cannot be asked now. It may come back."""


class FieldOfLive:
    """The field of a running `bigus live --listen PORT`, for one thread at a time.

    Questions and answers are messages of OpenIGTLink: STRING, with JSON, and NDARRAY. Module/Command/Live.md tells them.
    """

    def __init__(self, address: str, tell: Any):
        try:
            parts = urlsplit(address)
            self._place = (parts.hostname or "", parts.port or 18944)
        except ValueError as error:
            raise ValueError(f"{address} is no address igtl://HOST:PORT ({error})") from None
        self.address, self._tell = address, tell
        self.elevation_sigma: Optional[float] = None  # it takes no thickness
        self.centers, self.scales, self.reflectivities = np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
        self.gaussians, self.weight = 0, 1.0  # of which each in `centers` stands for so many
        self.labels: list[dict[str, Any]] = []
        self.keeps_error, self.views = False, None
        self.state: dict[str, Any] = {}
        self._stream: Any = None
        try:
            self._ask({}, 0)
        except Away as error:
            raise ValueError(f"{error}. Start bigus live with --listen {self._place[1]} first.") from None

    def render(self, plane: np.ndarray, width: int, height: int, *_: Any) -> Rendered:
        pixels = self._ask({"plane": plane.ravel().tolist(), "width": width, "height": height}, 3)
        if pixels.shape != (2, height, width):
            self._leave(f"{self.address} gave a slice of another size")
        return Rendered(*pixels)

    def look(self) -> None:
        """Brings `state` up to date."""
        self._ask({}, 0)

    def refresh(self) -> None:
        """Asks for the Gaussians anew."""
        numbers = self._ask({"points": MOST_POINTS}, 2)
        if numbers.shape[1] != 7:
            self._leave(f"{self.address} gave points of another kind")
        self.centers, self.reflectivities, self.scales = numbers[:, :3], numbers[:, 3], numbers[:, 4:]
        self.weight = max(1.0, self.gaussians / max(len(numbers), 1))

    def _leave(self, why: str) -> Any:
        if self._stream is not None:
            with contextlib.suppress(OSError):  # of what was not sent yet
                self._stream.close()
            self._stream = None
        if self.state.get("phase") not in (None, "away"):  # once
            self._tell("waiting", address=self.address)
        self.state = {**self.state, "phase": "away"}
        raise Away(why)

    def _ask(self, question: dict[str, Any], sides: int) -> np.ndarray:
        """Sends a question, keeps the state and gives the array of so many sides that comes with it, if any."""
        try:
            if self._stream is None:
                with socket.create_connection(self._place, timeout=LIVE_SECONDS) as connection:
                    self._stream = connection.makefile("rwb")  # keeps it open
            text = json.dumps(question).encode()
            body = struct.pack(">HH", 3, len(text)) + text
            self._stream.write(struct.pack(">H12s20sQQQ", 1, b"STRING", b"BigusView", 0, len(body), 0) + body)
            self._stream.flush()
            state = json.loads(self._receive(b"STRING")[4:])
            array = np.empty(0, np.float32)
            if sides and "error" not in state:
                body = self._receive(b"NDARRAY")
                kind, count, *shape = struct.unpack_from(f">BB{sides}H", body)
                if (kind, count) != (10, sides):
                    raise ValueError("an array of another kind")
                array = np.frombuffer(body, ">f4", offset=2 + 2 * sides).reshape(shape).astype(np.float32)
            if not isinstance(state, dict) or not ("error" in state or isinstance(state.get("gaussians"), int)):
                raise ValueError("a state of another kind")
        except (OSError, ValueError, struct.error, RecursionError) as error:
            self._leave(f"no live field answers at {self.address} ({error or type(error).__name__})")
        if "error" in state:
            raise ValueError(state["error"])
        if self.state.get("phase") == "away":
            self._tell("following", address=self.address)
        self.state, self.gaussians = state, state["gaussians"]
        return array

    def _receive(self, kind: bytes) -> bytes:
        header = self._stream.read(58)
        if len(header) < 58:
            raise OSError("it closed the connection")
        name, size = struct.unpack(">2x12s28xQ8x", header)
        if name.rstrip(b"\0") != kind or size > MOST_LIVE_BYTES:
            raise ValueError(f"{name!r} came, not {kind.decode()}")
        body = self._stream.read(size)
        if len(body) < size:
            raise OSError("it closed the connection")
        return body


def _thinned(plane: np.ndarray, width: int, height: int) -> tuple[np.ndarray, int, int]:
    """The same part of the plane in at most MOST_PIXELS: every pixel, or every second, third, ... of them."""
    step = max(1, math.ceil(math.sqrt(width * height / MOST_PIXELS)))
    plane = plane.copy()
    plane[:, :2] *= step
    return plane, max(1, width // step), max(1, height // step)


def _bytes(pixels: np.ndarray) -> np.ndarray:
    """Grey values of 8 bits, of bytes, of 16 bits whose largest is white, or of numbers in [0, 1]."""
    if pixels.dtype == np.uint8:
        return np.ascontiguousarray(pixels)
    if pixels.dtype == np.uint16:
        return (pixels >> 8).astype(np.uint8)
    return (np.clip(pixels, 0, 1) * 255 + 0.5).astype(np.uint8)


def _stretched(values: np.ndarray, size: int) -> np.ndarray:
    """The rows of an array, interpolated to so many."""
    at = np.linspace(0, len(values) - 1, size)
    before = at.astype(int)
    weights = (at - before).astype(np.float32)[:, None]
    return values[before] * (1 - weights) + values[np.minimum(before + 1, len(values) - 1)] * weights


def _points(plane: np.ndarray, width: int, height: int, columns: int, rows: int) -> np.ndarray:
    """Of so many points, evenly over an image: x, y and z in mm and 1, [4, rows * columns]."""
    i, j = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    return plane @ np.stack([i.ravel(), j.ravel(), np.zeros(i.size), np.ones(i.size)])


class Sweep:
    """Usable frames and poses. Frames of more than MOST_PIXELS are shown at every second, third, ... pixel."""

    def __init__(self, bigus: Any, sweep: Any):
        pixels, poses = bigus.frames(sweep), np.array(bigus.poses(sweep), dtype=np.float64)
        status, mask = None, getattr(sweep, "mask", None)
        if hasattr(sweep, "GetFieldData"):
            from vtkmodules.util.numpy_support import vtk_to_numpy

            status, mask = (sweep.GetFieldData().GetArray(name) for name in ("Status", "Mask"))
            status = None if status is None else vtk_to_numpy(status).ravel() != 0
            mask = None if mask is None else vtk_to_numpy(mask).reshape(pixels.shape[1:])
        usable = np.isfinite(poses).all(axis=(1, 2)) if status is None else status & np.isfinite(poses).all(axis=(1, 2))
        step = max(1, math.ceil(math.sqrt(pixels.shape[1] * pixels.shape[2] / MOST_PIXELS)))
        self.numbers = np.flatnonzero(usable)  # in the file
        self.poses = poses[usable]
        self.poses[:, :, :2] *= step
        self._pixels = pixels[:, ::step, ::step]
        self.mask = None if mask is None else np.asarray(mask)[::step, ::step] != 0
        self.height, self.width = self._pixels.shape[1:]
        x, y = self.width - 1, self.height - 1
        self._corners = np.array([[0, 0, 0, 1], [x, 0, 0, 1], [0, y, 0, 1], [x, y, 0, 1]], dtype=np.float64).T
        self._placed = self.poses[:, :3] @ self._corners
        self._pixel_sizes = np.linalg.norm(self.poses[:, :3, :2], axis=1)[:, :, None]  # mm
        normals = np.cross(self.poses[:, :3, 0], self.poses[:, :3, 1])
        to_mm = self.poses.copy()
        to_mm[:, :3, 2] = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._from_mm = np.linalg.inv(to_mm)[:, :3]  # to column, row and mm from the frame
        self._every = max(1, math.ceil(len(self.poses) / SEEN_FRAMES))
        steps = np.linalg.norm(np.diff(self._placed[:: self._every], axis=0), axis=1).mean(axis=1)
        self._reach = max(self._pixel_sizes.max(initial=0), float(np.quantile(steps, 0.9)) if len(steps) else 0.0)

    def __len__(self) -> int:
        return len(self.poses)

    def pixels(self, frame: int) -> np.ndarray:
        return _bytes(self._pixels[self.numbers[frame]])

    def nearest(self, plane: np.ndarray, width: int, height: int) -> tuple[int, float]:
        """The frame to which an image is nearest, and the mean distance of the image's points to it, mm.

        Of frames that are as near, such as those in one plane, it is the one whose corners are nearest.
        """
        x, y, away = np.moveaxis(self._from_mm @ _points(plane, width, height, 5, 5), 1, 0)
        beside = [np.maximum(np.maximum(-at, at - last), 0) for at, last in ((x, self.width - 1), (y, self.height - 1))]
        beside = [pixels * self._pixel_sizes[:, k] for k, pixels in enumerate(beside)]
        distances = np.sqrt(away**2 + beside[0] ** 2 + beside[1] ** 2).mean(axis=1)
        frame = int(np.argmin(distances + 1e-6 * self._of_corners(plane)))
        return frame, float(distances[frame])

    def is_at(self, plane: np.ndarray, frame: int) -> bool:
        return bool(self._of_corners(plane)[frame] <= SAME_POSE)

    def _of_corners(self, plane: np.ndarray) -> np.ndarray:
        return np.linalg.norm(self._placed - plane[:3] @ self._corners, axis=1).mean(axis=1)

    def seen(self, plane: np.ndarray, width: int, height: int) -> np.ndarray:
        """Where the sweep looked, [height, width], 1: yes, 0: no; on a coarse grid, interpolated.

        A point counts where it lies over a lit pixel of a frame, and no farther from it than nine in ten steps between frames
        are long (the mean way of the corners). So what casts a shadow hides nothing.
        """
        columns, rows = (max(2, round(side * SEEN_SIDE / max(width, height))) for side in (width, height))
        points, frames = _points(plane, width, height, columns, rows), self._from_mm[:: self._every]
        frame, point = np.nonzero(np.abs(frames[:, 2] @ points) <= self._reach)
        x, y = np.rint(np.einsum("kij,jk->ik", frames[frame, :2], points[:, point])).astype(int)
        looked = (x >= 0) & (x < self.width) & (y >= 0) & (y < self.height)
        if self.mask is not None:
            looked[looked] = self.mask[y[looked], x[looked]]
        grid = np.zeros(rows * columns, np.float32)
        grid[point[looked]] = 1
        grid = grid.reshape(rows, columns)
        return _stretched(_stretched(grid, height).T, width).T


class Request(NamedTuple):
    id: int
    frame: Optional[int]  # whose pose is the plane
    plane: Optional[np.ndarray]  # else this is it
    width: int
    height: int
    sigma: float  # mm, the slice's thickness; negative: the field's own
    labels: bool  # whether to tell them, too
    error: bool  # and the standard error


class Scene:
    """A field, the sweep where there is one, and the pictures of both."""

    def __init__(self, field: Any, sweep: Optional[Sweep]):
        self.field, self.sweep = field, sweep
        self.live = isinstance(field, FieldOfLive)
        self._refreshed = -math.inf
        self.refresh() if self.live else self._measure()

    def _measure(self) -> None:
        field = self.field
        centers = field.centers if len(field.centers) else np.zeros((1, 3))
        self.low, self.high = centers.min(axis=0), centers.max(axis=0)
        pad = float(np.mean(field.scales)) if len(field.scales) else 0.0
        sides = np.maximum(self.high - self.low + 2 * pad, 1e-3)
        # The field's mean coverage, to which that of a pixel is compared, as Core/Slicing's FieldSpread has it.
        volume = float(np.prod(sides))
        integrals = float(np.prod(field.scales, axis=1, dtype=np.float64).sum()) * field.weight
        self.mean_coverage = (2 * math.pi) ** 1.5 * integrals / volume or 1.0
        # Some of the Gaussians, evenly taken: x, y, z (mm) and reflectivity, float32.
        step = max(1, math.ceil(len(field.centers) / MOST_POINTS))
        chosen = np.column_stack([field.centers, field.reflectivities])[::step]
        self.points = np.ascontiguousarray(chosen, dtype="<f4").tobytes()

    def refresh(self) -> None:
        """Of a live field: brings it up to date, unless that was done just now. One that is away stays as it was."""
        if not self.live or time.monotonic() - self._refreshed < REFRESH_SECONDS:
            return
        try:
            self.field.refresh()
        except Away:
            if math.isfinite(self._refreshed):
                return
        self._refreshed = time.monotonic()
        self._measure()

    def look(self) -> None:
        """Of a live field: asks for its state."""
        try:
            self.field.look() if self.live else None
        except Away:
            pass  # which the state says

    def probe(self) -> Optional[tuple[np.ndarray, int, int]]:
        """Of a live field: plane and size of the newest frame."""
        found = self.field.state.get("probe") if self.live else None
        return found and _thinned(np.array(found["plane"]).reshape(4, 4), found["width"], found["height"])

    def first_plane(self) -> tuple[np.ndarray, int, int]:
        """Of the frame in the middle, or of the probe; without both through the middle of the field, along its two longest
        sides."""
        if self.sweep:
            return self.sweep.poses[len(self.sweep) // 2], self.sweep.width, self.sweep.height
        if probe := self.probe():
            return probe
        sides = self.high - self.low
        along = np.argsort(-sides, kind="stable")[:2]
        size = 512
        spacing = max(float(sides.max()) / size, 1e-3)
        plane = np.eye(4)
        plane[:3, :3] = 0
        plane[along[0], 0] = plane[along[1], 1] = spacing
        plane[:3, 2] = np.cross(plane[:3, 0], plane[:3, 1]) / spacing**2
        plane[:3, 3] = (self.low + self.high) / 2 - (plane[:3, 0] + plane[:3, 1]) * (size - 1) / 2
        return plane, size, size

    def description(self) -> dict[str, Any]:
        plane, width, height = self.first_plane()
        sweep = self.sweep
        return {
            "gaussians": self.field.gaussians, "low": self.low.tolist(), "high": self.high.tolist(),
            "plane": plane.ravel().tolist(), "width": width, "height": height,
            "frames": [] if sweep is None else [pose.ravel().tolist() for pose in sweep.poses],
            "numbers": [] if sweep is None else sweep.numbers.tolist(),
            "firstFrame": None if sweep is None else len(sweep) // 2,
            "elevationSigma": self.field.elevation_sigma, "thickest": THICKEST, "labels": self.field.labels,
            "standardError": self.field.keeps_error,
            "live": self.field.state if self.live else None,
        }  # fmt: skip

    def parse(self, text: str) -> Request:
        """A request of a client. Raises ValueError for whatever is not sound."""
        try:
            message = json.loads(text)
        except (ValueError, RecursionError):
            raise ValueError("a request is JSON") from None
        if not isinstance(message, dict):
            raise ValueError("a request is an object")

        def whole(name: str, low: int, high: int) -> int:
            value = message.get(name)
            if type(value) is not int or not low <= value <= high:
                raise ValueError(f"{name} is a whole number from {low} to {high}")
            return value

        id, sigma = whole("id", 0, 2**53), message.get("elevationSigma", -1)
        if "elevationSigma" in message and not (type(sigma) in (int, float) and 0 <= sigma <= THICKEST and not self.live):
            raise ValueError(f"elevationSigma is from 0 to {THICKEST:g} mm; a field that grows takes none")
        more = [message.get(name, False) for name in ("labels", "standardError")]
        for name, value, has in zip(("labels", "standardError"), more, (self.field.labels, self.field.keeps_error)):
            if type(value) is not bool or value and not has:
                raise ValueError(f"{name} is true or false; true where the scene has it")
        if message.get("frame") is not None:
            if not self.sweep:
                raise ValueError("there are no frames")
            return Request(id, whole("frame", 0, len(self.sweep) - 1), None, self.sweep.width, self.sweep.height,
                           sigma, *more)  # fmt: skip
        width, height = whole("width", 1, MOST_SIDE), whole("height", 1, MOST_SIDE)
        if width * height > MOST_PIXELS:
            raise ValueError(f"a slice has at most {MOST_PIXELS} pixels")
        numbers = message.get("plane")
        if not isinstance(numbers, list) or len(numbers) != 16 or any(type(n) not in (int, float) for n in numbers):
            raise ValueError("plane is a list of 16 numbers, the matrix from pixels to mm by rows")
        if any(abs(n) > FARTHEST or n != n for n in numbers):  # compared as Python's numbers, which may be huge
            raise ValueError(f"the plane's numbers are finite and at most {FARTHEST:g}")
        plane = np.array(numbers, dtype=np.float64).reshape(4, 4)
        sides = np.linalg.norm(plane[:3, :2], axis=0)
        if not ((sides >= FINEST) & (sides <= COARSEST)).all():
            raise ValueError(f"pixels are from {FINEST:g} to {COARSEST:g} mm")
        normal = np.cross(plane[:3, 0], plane[:3, 1]) / (sides[0] * sides[1])
        length = np.linalg.norm(normal)
        if length < 1e-3:
            raise ValueError("the plane's first two columns must span a plane")
        plane[:3, 2], plane[3] = normal / length, (0, 0, 0, 1)
        return Request(id, None, plane, width, height, sigma, *more)

    def render(self, request: Request) -> tuple[dict[str, Any], list[bytes]]:
        """What is told of the slice, and its pixels, its coverage, whether the sweep saw them and, where they were asked for,
        their labels and their standard errors, as bytes."""
        self.refresh()
        begin = time.perf_counter()
        plane = self.sweep.poses[request.frame] if request.frame is not None else request.plane
        image, coverage, labels, sigma = self.field.render(plane, *request[3:])
        if sigma is not None:
            steps = np.minimum(np.rint(SURE_STEPS * sigma), 254)
            sigma = np.where(np.isnan(sigma), 255, steps).astype(np.uint8)
        coverage = coverage / self.mean_coverage
        seen = coverage / SEEN_ABOVE
        if self.sweep:
            seen = np.maximum(seen, self.sweep.seen(plane, request.width, request.height))
        head: dict[str, Any] = {"id": request.id, "width": request.width, "height": request.height, "frame": None,
                                "labels": request.labels, "standardError": request.error}  # fmt: skip
        head["turn"] = None if self.field.views is None else turn_from(self.field.views, plane)
        if self.sweep:
            size = (request.width, request.height)
            frame, distance = (request.frame, 0.0) if request.frame is not None else self.sweep.nearest(plane, *size)
            same = size == (self.sweep.width, self.sweep.height) and self.sweep.is_at(plane, frame)
            head.update(frame=frame, distance=distance, same=same, psnr=None)
            if same:
                difference = (image - self.sweep.pixels(frame) / np.float32(255))
                difference = difference if self.sweep.mask is None else difference[self.sweep.mask]
                error = float(np.mean(np.square(difference), dtype=np.float64)) if difference.size else 0.0
                head["psnr"] = -10 * math.log10(error) if error > 0 else None
        if self.live:
            head["live"] = {**self.field.state, "probe": None}
            if probe := self.probe():
                head["live"]["probe"] = probe[0].ravel().tolist()
        head["seconds"] = time.perf_counter() - begin
        return head, [_bytes(pixels).tobytes() for pixels in (image, coverage, seen, labels, sigma) if pixels is not None]


def read_scene(field: str, sweep: Optional[str], tell: Any) -> Scene:
    import bigus

    wheel = hasattr(bigus, "Slicer")
    live = FieldOfLive(field, tell) if field.startswith("igtl://") else None
    if not live:
        tell("reading", file=field)
        data = bigus.read(field)
        if not (isinstance(data, bigus.Field) if wheel else data.IsA("vtkPolyData")):
            raise ValueError(f"{field} is not a field (.vtp or .ply)")
    frames = None
    if sweep is not None:
        tell("reading", file=sweep)
        found = bigus.read(sweep)
        if isinstance(found, bigus.Field) if wheel else found.IsA("vtkPolyData"):
            raise ValueError(f"{sweep} is a field; a sequence is expected there")
        frames = Sweep(bigus, found)
        if not len(frames):
            raise ValueError(f"{sweep}: no frame has a usable pose")
    return Scene(live or (FieldOfWheel(bigus, data) if wheel else FieldOfVtk(bigus, data)), frames)


# ----------------------------------------------------------------------------------------------------------------------
# Who may ask


def is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def host_is_sound(header: str, names: Iterable[str]) -> bool:
    """Whether a Host header is an address, localhost or one of the names.

    A page of a stranger can have its own name lead to this machine (DNS rebinding), but then its name stands here.
    """
    try:
        host = urlsplit("//" + header).hostname or ""
        urlsplit("//" + header).port  # raises where it is not a number
    except ValueError:
        return False
    try:
        ipaddress.ip_address(host)
        return True
    except ValueError:
        return host == "localhost" or host in {name.lower() for name in names}


def origin_is_sound(origin: Optional[str], host: str) -> bool:
    """Whether a page of this server asks, or a program that is no browser."""
    return origin is None or origin.lower() in (f"http://{host.lower()}", f"https://{host.lower()}")


def token_is_sound(given: str, token: str) -> bool:
    return hmac.compare_digest(given.encode("utf-8", "replace"), token.encode())


def address_for_others(address: str) -> str:
    """Where a server at the address "any" is reached from other machines; other addresses as they are."""
    if not ipaddress.ip_address(address).is_unspecified:
        return address
    family, far, here = (socket.AF_INET6, "2001:db8::1", "::1") if ":" in address else (socket.AF_INET, "192.0.2.1", "127.0.0.1")
    with contextlib.suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as way:
        way.connect((far, 9))  # sends nothing: the address of the way out is chosen
        return str(way.getsockname()[0])
    return here


# ----------------------------------------------------------------------------------------------------------------------
# The server


class Client:
    """A connection. Only its newest request waits, and one of its requests is worked on at a time."""

    def __init__(self, transport: Any = None) -> None:
        self.transport = transport
        self.newest: Optional[Request] = None
        self.arrived = asyncio.Event()
        self.shown: Optional[int] = None  # the recorded frame that it has
        self._allowance, self._last = MESSAGES_AT_ONCE, time.monotonic()

    def may_send(self) -> bool:
        now = time.monotonic()
        self._allowance = min(MESSAGES_AT_ONCE, self._allowance + (now - self._last) * MESSAGES_PER_SECOND) - 1
        self._last = now
        return self._allowance >= 0

    def idle_seconds(self) -> float:
        """Since the last whole message, or since it came: a part of a message is none."""
        return time.monotonic() - self._last

    def leave(self) -> None:
        """Without waiting for anything that it has not sent or read."""
        if self.transport is not None:
            self.transport.abort()

    def was_answered(self) -> None:
        self._allowance += 1  # who waits for each picture is as fast as the pictures, and never too fast


class Server:
    """Serves one scene. Slices are rendered one after the other, each with all threads, by turns of the clients."""

    def __init__(self, scene: Scene, token: Optional[str] = None, names: Sequence[str] = (), compress: bool = False):
        self.scene, self.token, self.names, self.compress = scene, token, tuple(names), compress
        self.clients: dict[Any, Client] = {}
        self.rendered = self.superseded = self.refused = 0
        self._recent: list[float] = []  # seconds of the last renders
        self._begin = time.monotonic()
        self._goodbye: dict = {}  # how clients are let go when the server ends
        self._turn: asyncio.Lock
        self._pool = concurrent.futures.ThreadPoolExecutor(1, "render")
        self._page = Path(__file__).with_name("serve.html").read_text(encoding="utf-8")

    def application(self) -> Any:
        from aiohttp import web

        self._turn = asyncio.Lock()

        @web.middleware
        async def guard(request: Any, handler: Any) -> Any:
            host = request.headers.get("Host", "")
            given = request.headers.get("Authorization", "")
            given = given[len("Bearer "):] if given.startswith("Bearer ") else request.query.get("token", "")
            if not host_is_sound(host, self.names):
                raise web.HTTPForbidden(text="This server is not known by that name. Start it with --name NAME.\n")
            if not origin_is_sound(request.headers.get("Origin"), host):
                raise web.HTTPForbidden(text="Pages of other servers may not ask.\n")
            if self.token is not None and not token_is_sound(given, self.token):
                raise web.HTTPUnauthorized(text="The token is missing or wrong. The server printed the whole address.\n")
            return await handler(request)

        async def protect(request: Any, response: Any) -> None:
            response.headers["X-Content-Type-Options"] = "nosniff"
            response.headers["Referrer-Policy"] = "no-referrer"  # the address may hold the token
            response.headers["Cross-Origin-Resource-Policy"] = "same-origin"
            response.headers["Cache-Control"] = "no-store"

        application = web.Application(middlewares=[guard])
        application.on_response_prepare.append(protect)
        application.on_shutdown.append(self._close)
        application.router.add_get("/", self._send_page)
        application.router.add_get("/health", self._send_health)
        application.router.add_get("/scene", self._send_scene)
        application.router.add_get("/points", self._send_points)
        application.router.add_get("/slices", self._serve_slices)
        return application

    async def _close(self, application: Any) -> None:
        from aiohttp import WSCloseCode

        self._goodbye = {"code": WSCloseCode.GOING_AWAY, "message": b"the server ends"}
        goodbyes = [socket.close(**self._goodbye) for socket in self.clients]
        if goodbyes:
            await asyncio.wait([asyncio.ensure_future(one) for one in goodbyes], timeout=ENDING_SECONDS)
        for client in list(self.clients.values()):
            client.leave()
        self._pool.shutdown(wait=True, cancel_futures=True)

    async def _send_page(self, request: Any) -> Any:
        from aiohttp import web

        nonce = secrets.token_urlsafe(16)
        policy = (f"default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; connect-src 'self'; "
                  "img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'")  # fmt: skip
        text = self._page.replace("NONCE", nonce)
        return web.Response(text=text, content_type="text/html", headers={"Content-Security-Policy": policy})

    async def _send_health(self, request: Any) -> Any:
        from aiohttp import web

        await self._in_turn(self.scene.look)
        return web.json_response(self.health())

    async def _send_scene(self, request: Any) -> Any:
        from aiohttp import web

        await self._in_turn(self.scene.refresh)
        return web.json_response(self.scene.description())

    async def _send_points(self, request: Any) -> Any:
        from aiohttp import web

        await self._in_turn(self.scene.refresh)
        return web.Response(body=self.scene.points, content_type="application/octet-stream")

    async def _in_turn(self, work: Any) -> None:
        """What asks a live field, on the thread that renders."""
        if self.scene.live:
            async with self._turn:
                await asyncio.get_running_loop().run_in_executor(self._pool, work)

    def health(self) -> dict[str, Any]:
        """What scripts read at /health."""
        recent = sorted(self._recent)
        live = self.scene.field.state if self.scene.live else None
        return {
            "status": "waiting" if live and live.get("phase") == "away" else "ok",
            **({"live": live} if live else {}),
            "gaussians": self.scene.field.gaussians,
            "frames": len(self.scene.sweep) if self.scene.sweep else 0,
            "clients": len(self.clients),
            "rendered": self.rendered,
            "superseded": self.superseded,
            "refused": self.refused,
            "render_seconds": recent[len(recent) // 2] if recent else None,
            "uptime_seconds": time.monotonic() - self._begin,
        }

    async def _serve_slices(self, request: Any) -> Any:
        from aiohttp import WSCloseCode, WSMsgType, web

        if len(self.clients) >= MOST_CLIENTS:
            idle = max(self.clients, key=lambda one: self.clients[one].idle_seconds())
            if self.clients[idle].idle_seconds() < IDLE_SECONDS:
                raise web.HTTPServiceUnavailable(text=f"{MOST_CLIENTS} clients are served already.\n")
            self.clients.pop(idle).leave()
        socket = web.WebSocketResponse(max_msg_size=MOST_MESSAGE_BYTES, heartbeat=20, compress=self.compress)
        client = self.clients[socket] = Client(request.transport)
        worker = None
        bad = 0
        try:
            await socket.prepare(request)
            worker = asyncio.ensure_future(self._answer(client, socket, request.transport))
            async for message in socket:
                if not client.may_send():
                    self.refused += 1
                    await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"too many messages a second")
                    break
                try:
                    if message.type is not WSMsgType.TEXT:
                        raise ValueError("a request is text")
                    asked = self.scene.parse(message.data)
                except ValueError as error:
                    self.refused += 1
                    bad += 1
                    if bad > MOST_BAD_MESSAGES:
                        await socket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"too many bad requests")
                        break
                    await self._send(socket, request.transport, json.dumps({"error": str(error)}))
                    continue
                self.superseded += client.newest is not None
                client.newest = asked
                client.arrived.set()
            if self._goodbye:  # aiohttp before 3.9 would say that all is well
                await socket.close(**self._goodbye)
        except (ConnectionError, asyncio.TimeoutError):
            pass  # it went away
        finally:
            self.clients.pop(socket, None)
            if worker is not None:
                worker.cancel()
                await asyncio.wait([worker])  # a loop that ends before its task would complain of it
        return socket

    async def _send(self, socket: Any, transport: Any, data: Any) -> None:
        try:
            send = socket.send_str if isinstance(data, str) else socket.send_bytes
            await asyncio.wait_for(send(data), SEND_SECONDS)
        except asyncio.TimeoutError:
            if transport is not None:
                transport.abort()
            raise

    async def _answer(self, client: Client, socket: Any, transport: Any) -> None:
        """Renders and sends the newest request again and again. A slow client keeps only itself waiting."""
        loop = asyncio.get_running_loop()
        try:
            while True:
                await client.arrived.wait()
                async with self._turn:  # first come, first served, and each client waits once: they take turns
                    client.arrived.clear()
                    asked, client.newest = client.newest, None
                    if asked is None:
                        continue
                    try:
                        head, parts = await loop.run_in_executor(self._pool, self.scene.render, asked)
                    except Away as error:
                        head, parts = {"id": asked.id, "error": str(error), "away": True}, []
                    except Exception as error:  # of the renderer; the others are served on
                        self.refused += 1
                        print(f"a slice failed: {error}", file=sys.stderr)
                        head, parts = {"id": asked.id, "error": "this slice cannot be rendered"}, []
                    else:
                        self.rendered += 1
                        self._recent = [*self._recent[-99:], head["seconds"]]
                if not parts:
                    await self._send(socket, transport, json.dumps(head))
                    continue
                if head["frame"] is not None and head["frame"] != client.shown:
                    sweep = self.scene.sweep
                    client.shown = head["frame"]
                    head["recorded"] = [sweep.width, sweep.height]
                    parts.append(sweep.pixels(client.shown).tobytes())
                # Length of the head, the head padded to a multiple of 4, and bytes of slice, coverage, seen, labels, standard
                # error, recorded frame.
                text = json.dumps(head, allow_nan=False).encode()
                text += b" " * (-len(text) % 4)
                await self._send(socket, transport, b"".join([struct.pack("<I", len(text)), text, *parts]))
                client.was_answered()
        except (ConnectionError, asyncio.TimeoutError, RuntimeError):
            pass  # it went away


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> Any:
        self.print_usage(sys.stderr)
        self.exit(1, f"{self.prog}: {message}\n")  # as the bigus program


def parser() -> argparse.ArgumentParser:
    def port(text: str) -> int:
        if not 0 <= int(text) <= 65535:
            raise ValueError
        return int(text)

    def threads(text: str) -> int:
        if not 0 <= int(text) <= 4096:
            raise ValueError
        return int(text)

    parser = _Parser(prog="bigus serve", description=__doc__,
                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("field", metavar="FIELD", help=".vtp or .ply, or igtl://HOST:PORT of bigus live --listen PORT")
    parser.add_argument("sequence", metavar="SEQUENCE", nargs="?", help="the sweep that it was trained on")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen at (default: 127.0.0.1, this machine only)")
    parser.add_argument("--port", type=port, default=8765, help="0: any that is free (default: 8765)")
    parser.add_argument("--name", action="append", default=[], help="a name by which browsers know this machine; repeatable")
    parser.add_argument("--token", action="store_true", help="ask for a token on this machine, too")
    parser.add_argument("--threads", type=threads, default=0, metavar="N", help="cores to use; 0 takes all (default)")
    parser.add_argument("--json", action="store_true", help="tell of progress and the address in JSON, a line each, on stdout")
    return parser


def _is_ours(record: logging.LogRecord) -> bool:
    """False for what aiohttp before 3.9 logs, with a traceback, of a request that is no HTTP: clients must not fill logs."""
    from aiohttp.http import HttpProcessingError

    return not (record.exc_info and isinstance(record.exc_info[1], HttpProcessingError))


async def _run(server: Server, host: str, port: int, tell: Any) -> None:
    from aiohttp import web

    logging.getLogger("aiohttp.server").addFilter(_is_ours)
    runner = web.AppRunner(server.application(), access_log=None, keepalive_timeout=15)
    end = asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, end.set)
    await runner.setup()
    try:
        site = web.TCPSite(runner, host, port, shutdown_timeout=2) if _old_aiohttp() else web.TCPSite(runner, host, port)
        await site.start()
        address, found = runner.addresses[0][:2]
        address = address_for_others(address)
        name = f"[{address}]" if ":" in address else address
        url = f"http://{name}:{found}/" + (f"?token={server.token}" if server.token else "")
        tell("ready", url=url)
        await end.wait()
        tell("ending")
    finally:
        try:
            await asyncio.wait_for(runner.cleanup(), 2 * ENDING_SECONDS)
        except asyncio.TimeoutError:
            pass  # somebody sends half a request


def _old_aiohttp() -> bool:
    import aiohttp

    return int(aiohttp.__version__.split(".")[0]) == 3 and int(aiohttp.__version__.split(".")[1]) < 9


def main(arguments: Optional[Sequence[str]] = None) -> int:
    options = parser().parse_args(arguments)

    def tell(phase: str, **facts: Any) -> None:
        if options.json:
            print(json.dumps({"phase": phase, **facts}), flush=True)
        else:
            print(phase, *facts.values(), file=sys.stderr, flush=True)

    def fail(code: int, message: str) -> int:
        if options.json:
            print(json.dumps({"error": message, "exit_code": code}), flush=True)
        print(f"bigus serve: {message}", file=sys.stderr)
        return code

    if options.threads and hasattr(os, "sched_setaffinity"):  # before anything starts threads
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[: options.threads])
    try:
        import aiohttp  # noqa: F401
    except ImportError as error:
        return fail(2, f'{error}; it serves the page: pip install aiohttp, or apt install python3-aiohttp')
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = read_scene(options.field, options.sequence, tell)
    except (ImportError, OSError, RuntimeError, ValueError) as error:
        return fail(2, str(error))
    away = not is_loopback(options.host)
    token = secrets.token_urlsafe(32) if away or options.token else None
    # Pictures go as they are on this machine, where bytes cost less than packing them does.
    server = Server(scene, token, [options.host, *options.name], compress=away)
    try:
        asyncio.run(_run(server, options.host, options.port, tell))
    except OSError as error:
        return fail(3, f"cannot listen at {options.host} port {options.port}: {error.strerror or error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
