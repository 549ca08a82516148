# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Images and poses of your own as a sweep: arrays of numpy, HDF5, videos, DICOM, pictures; poses in tables.

`from_files` does all of it. Formats that numpy cannot read ask for a package: h5py, OpenCV or imageio, pydicom.
The page Sources.md says which frames of coordinates are meant, with a picture.
"""

from __future__ import annotations

import contextlib
import csv
import functools
import importlib
import math
import os
import pathlib
import re
import struct
from typing import Any, Callable, Iterable, Iterator, NamedTuple, Optional, Sequence, Union
from xml.etree import ElementTree

import numpy as np

Path = Union[str, os.PathLike]

VIDEOS = (".mp4", ".avi", ".mov", ".mkv", ".mpg", ".mpeg", ".m4v", ".webm", ".wmv")
SEQUENCES = (".mha", ".mhd", ".nrrd", ".nhdr")
HDF5 = (".h5", ".hdf5")
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}

# What a column says of a pose that there is; anything else is none. Numbers only where the column's name says what 1 is.
SOUND = {"ok", "valid", "good", "tracked", "visible", "true", "yes"}
FLAGS = {f"{prefix}{name}" for prefix in ("", "is") for name in ("valid", "tracked", "visible", "ok")}
NO_POSITION = 1e20  # mm; NDI writes -3.7e28 where it sees no marker
# What programs write for a number that there is not.
NOTHING = {"", "-", "--", "?", "na", "n/a", "none", "null", "nil", "missing", "lost", "invalid", "undefined", "untracked",
           "not tracked", "no data", "nodata", "bad", "error", "false", "occluded", "hidden", "out of view", "out of volume"}
RIGID = 0.01  # how far R^T R of a tracker's pose may be off 1; single precision and printed digits stay below 1e-3
MOST_SHEARED = 10  # degrees that rows and columns may be off a right angle where no third column confirms them
INTERPOLATED = "Poses were interpolated at the times of the frames."
SMALLEST_PIXEL, LARGEST_PIXEL = 1e-3, 10.0  # mm
MOST_DEFLATED = 1032  # bytes that a byte of zlib's can become; what else pictures are packed by stays below


class SourceError(ValueError):
    """A file that cannot be used. The message names the file, the field, what was found, and what to do."""


# Names of arrays in files that hold several.
IMAGES, POSES = ("frames", "images"), ("poses", "tforms", "transforms", "tracking")
SINGLE = re.compile(r"(.*(?:frame|image|pose|tform|transform))_?(\d+)")  # one frame of several, by its number


class Images(NamedTuple):
    pixels: np.ndarray  # [frames, height, width], uint8, uint16, or float32 in [0, 1]
    times: Optional[np.ndarray] = None  # s, [frames]
    spacing: Optional[tuple] = None  # mm of a pixel along i and j, where the file says
    has_text: bool = False  # the file says that text, which may name a patient, is part of the pictures
    names: Optional[list] = None  # of the files, where each frame is one


class Named(NamedTuple):
    """The column of a table that says which frame a row belongs to."""

    title: str
    cells: list  # [rows]
    lines: list  # [rows], numbers of the file's lines
    may_be_names: bool = False  # of pictures; else numbers of frames
    is_guess: bool = False  # it has no name, and may be times


class Poses(NamedTuple):
    matrices: np.ndarray  # [rows, 4, 4]; NaN where the tracker saw nothing
    times: Optional[np.ndarray] = None  # [rows]
    frames: Optional[np.ndarray] = None  # index of the frame of each row, counted from 0
    image: Optional[np.ndarray] = None  # [4, 4] from a pixel to what the poses lead from, where the file says
    unit: Optional[float] = 1.0  # s, of times; None where the file does not say
    named: Optional[Named] = None  # from which frames follow when the images are known
    notes: tuple = ()  # what was decided or left out, a sentence each


class Stored(NamedTuple):
    """An array of a file that may be images or poses."""

    name: str
    shape: tuple
    role: str  # images or poses
    is_told: bool  # by its name
    scan: str  # what its name is without the word that tells its role: equal where arrays belong together
    is_stack: bool = False  # of scans, the first axis

    def __str__(self) -> str:
        return f"{self.name} {self.shape}"


def _need(package: str, what: Path, remedy: str = "") -> Any:
    """Imports a package, or says who needs it."""
    try:
        module = importlib.import_module(package)
        # imageio keeps its older interface under a name of its own, where it has a newer one.
        return importlib.import_module("imageio.v2") if hasattr(module, "v3") else module
    except ImportError as error:
        raise SourceError(f"{what}: needs the package {package} ({error}); install it with pip{remedy}") from None


@contextlib.contextmanager
def _refused(path: Path, what: str, advice: str = "it may be cut off: fetch it again") -> Iterator[None]:
    """What packages that read a damaged file raise, of whatever type, becomes one line that names the file."""
    try:
        yield
    except (SourceError, ImportError):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.filename is not None:
            raise  # it names the file
        raise SourceError(f"{path}: {what} ({type(error).__name__}: {str(error)[:120]}); {advice}") from error


def _says_what_is_wrong(read: Callable) -> Callable:
    @functools.wraps(read)
    def reader(path: Path, *arguments: Any, **named: Any) -> Any:
        with _refused(path, "cannot be read", "it may be damaged: fetch it again"):
            _require_file(path)
            return read(path, *arguments, **named)

    return reader


def _suffix(path: Path) -> str:
    return pathlib.Path(path).suffix.lower()


def _require_file(path: Path) -> None:
    if not pathlib.Path(path).exists():
        raise SourceError(f"{path}: there is no such file")


# ---- images


def as_pixels(array: np.ndarray, name: Path) -> np.ndarray:
    """Frames as the trainer takes them: colours become grey, wide types those that hold them."""
    array = np.asarray(array)
    if array.ndim == 4 and array.shape[3] == 1:
        array = array[..., 0]
    if array.ndim == 4 and array.shape[3] in (3, 4):
        if array.dtype != np.uint8:
            raise SourceError(f"{name}: colours of {array.dtype}; uint8 is expected")
        red, green, blue = (array[..., channel].astype(np.uint32) for channel in range(3))
        array = ((299 * red + 587 * green + 114 * blue + 500) // 1000).astype(np.uint8)  # as the sequence reader does
    if array.ndim != 3 or 0 in array.shape:
        raise SourceError(f"{name}: images of shape {array.shape}; (frames, height, width) is expected, or (frames, "
                          "height, width, 3) for colours")
    if array.dtype == np.bool_:
        return array.astype(np.uint8) * 255
    if array.dtype in (np.uint8, np.uint16):
        return array
    if array.dtype.kind == "f":
        array = array.astype(np.float32)
        low, high = float(array.min()), float(array.max())
        if not (low >= 0 and high <= 1):  # false for NaN
            raise SourceError(f"{name}: pixels from {low:.4g} to {high:.4g}; float pixels lie in 0 to 1: divide them by "
                              "their white, or save them as uint8")
        return array
    if array.dtype.kind in "iu" and array.size and 0 <= array.min() and array.max() <= 65535:
        return array.astype(np.uint8 if array.max() <= 255 else np.uint16)
    raise SourceError(f"{name}: pixels of {array.dtype}, from {array.min()} to {array.max()}; uint8, uint16 or float in 0 "
                      "to 1 is expected")


def _require_held(path: Path, claimed: int, held: int) -> None:
    """Refuses pixels that cannot lie in so many bytes, before a package makes room for them."""
    if claimed > MOST_DEFLATED * held:
        raise SourceError(f"{path}: claims {claimed} bytes of pixels, more than {held} bytes can hold; it may be damaged: "
                          "fetch it again")


def _stored(name: str, shape: tuple, dataset: Sequence[str]) -> Optional[Stored]:
    """What an array may be by its shape, and by its name unless that is in dataset; None where it is neither."""
    group, slash, leaf = name.rpartition("/")
    is_pose = len(shape) > 1 and shape[1:] in ((4, 4), (3, 4), (16,), (12,), (7,))
    is_image = len(shape) == 3 or (len(shape) == 4 and shape[3] in (1, 3, 4))
    word = re.search(rf"(?<![a-z])({'|'.join(IMAGES + POSES)})(?![a-z])", leaf, re.IGNORECASE)
    told = None if word is None else "images" if word[1].lower() in IMAGES else "poses"
    may_be_stack = told == "poses" or shape[2:] in ((4, 4), (3, 4)) or not is_image
    if (told or name in dataset) and may_be_stack and not is_pose:  # scans, one upon the other
        one = _stored(name, shape[1:], dataset) if len(shape) > 2 else None
        if one:
            return one._replace(shape=shape, is_stack=True)
    role = "poses" if is_pose else "images" if is_image else None
    if role is None or (name not in dataset and role != ((told or role) if len(shape) > 2 else told)):
        return None
    scan = group if word is None else group + slash + leaf[:word.start()] + leaf[word.end():]
    return Stored(name, shape, role, told == role, re.sub("__+", "_", scan.strip("/_-. ")))


def _listed(found: Iterable) -> str:
    found = list(map(str, found))
    return (", ".join(found[:10]) or "nothing") + (f" and {len(found) - 10} more" if len(found) > 10 else "")


def _chosen(path: Path, role: str, found: Sequence[Stored], top: Sequence[str], dataset: Sequence[str],
            scan: Optional[str]) -> Stored:
    """The array of this role that is named or the only one; of several scans that of the one named."""
    mine = [one for one in found if one.role == role and one.name in dataset]
    if not mine:
        mine = [one for one in found if one.role == role]
        mine = [one for one in mine if one.is_told] or mine
        others = {one.scan for one in found if one.role != role}
        mine = [one for one in mine if one.scan in others] or mine
        if scan is not None and not any(one.is_stack for one in mine) and (len(mine) > 1 or (mine and mine[0].scan)):
            named = [one for one in mine if one.scan == scan] or [one for one in mine if scan in one.name]
            if not named:
                raise SourceError(f"{path}: has no scan {scan}; there are {_listed(one.scan for one in mine)}")
            mine = named
    if len(mine) == 1:
        return mine[0]
    expected = f"{role} are expected under the name {' or '.join(IMAGES if role == 'images' else POSES)}"
    if not mine:
        raise SourceError(f"{path}: holds {_listed(top)}; {expected}, or name the array by dataset (--dataset)")
    if all(one.is_told for one in mine) and len({one.scan for one in mine}) == len(mine):
        what = "holds" if scan is None else f"'{scan}' is part of the names of"
        raise SourceError(f"{path}: {what} {len(mine)} scans: {_listed(one.scan or one.name for one in mine)}; name one by scan "
                          "(--scan)")
    raise SourceError(f"{path}: holds {_listed(top)}; {expected}, but there are {_listed(mine)}; name one by dataset "
                      "(--dataset)")


def _numpy(path: Path, names: Sequence[str], what: str, dataset: Sequence[str] = ()) -> np.ndarray:
    with _refused(path, "not an array of numpy that can be read", "write it with numpy.save"):
        loaded = np.load(path, allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return loaded
    with loaded:
        arrays = {name: _stored(name, loaded[name].shape, dataset) for name in dataset if name in loaded.files}
        for name in (*(name for name, one in arrays.items() if one is not None and one.role == what), *names):
            if name in loaded.files:
                return loaded[name]
        raise SourceError(f"{path}: holds {', '.join(loaded.files) or 'nothing'}; {what} are expected under the name "
                          f"{' or '.join(names)}")


def _of_stack(path: Path, one: Stored, scan: Optional[str]) -> int:
    """Which of the scans that lie in one array is wanted."""
    count = one.shape[0]
    if count == 1 and scan is None:
        return 0
    if scan is None or not scan.isdecimal() or int(scan) >= count:
        found = f"{path}: {one} holds {count} scans" + ("" if scan is None else f", but no scan {scan}")
        raise SourceError(f"{found}; name one by scan (--scan), a number from 0 to {count - 1}")
    return int(scan)


def _hdf5(path: Path, role: str, dataset: Sequence[str] = (), scan: Optional[str] = None) -> tuple:
    """(the images or the poses of a file, pixel_to_image and spacing where they lie beside them)."""
    h5py = _need("h5py", path)
    found, singles, parts = [], {}, {}

    def look(name: str, entry: Any) -> None:
        if not isinstance(entry, h5py.Dataset) or entry.dtype.kind not in "biuf":
            return
        single = SINGLE.fullmatch(name) if len(entry.shape) == 2 else None
        if single is None:
            found.append(_stored(name, entry.shape, dataset))
        else:
            singles.setdefault((single[1] + "s", entry.shape), []).append((int(single[2]), name))

    with _refused(path, "not an HDF5 file that can be read"), h5py.File(path, "r") as file:
        file.visititems(look)
        for name in (*IMAGES, *POSES):  # links to data elsewhere, which are not visited
            if not isinstance(file.get(name, getlink=True), (h5py.HardLink, type(None))):
                look(name, file.get(name))
        for (name, shape), numbered in singles.items():
            parts[name] = [part for _, part in sorted(numbered)]
            found.append(_stored(name, (len(numbered), *shape), dataset))
        one = _chosen(path, role, [array for array in found if array is not None], sorted(file), dataset, scan)
        names = parts.get(one.name, [one.name])
        group = file[names[0]].parent
        beside = {name: np.asarray(group[name][()], float) for name in ("pixel_to_image", "spacing")
                  if isinstance(group.get(name), h5py.Dataset) and group[name].size <= 16}
        for name in names:
            _require_held(path, file[name].nbytes, _bytes_behind(file[name], pathlib.Path(path)))
        if one.is_stack:
            return file[one.name][_of_stack(path, one, scan)], beside
        return np.stack([file[name][()] for name in names]) if one.name in parts else file[one.name][()], beside


def _bytes_behind(array: Any, path: pathlib.Path) -> int:
    """Bytes of files that hold an array of HDF5; where none were written, it claims to be full of zeros."""
    sources = {source.file_name for source in array.virtual_sources()} if array.is_virtual else set()
    files = {path.parent / (path.name if name == "." else name) for name in sources}
    return array.id.get_storage_size() + sum(os.path.getsize(file) for file in files if file.is_file())


def _require_arrays(paths: Sequence[Path], dataset: Sequence[str]) -> None:
    """A name that no file has would be passed over."""
    names: list = []
    for path in paths:
        _require_file(path)
        with _refused(path, "cannot be read"):
            if _suffix(path) == ".npz":
                with np.load(path, allow_pickle=False) as loaded:
                    names += loaded.files
            elif _suffix(path) in HDF5:
                with _need("h5py", path).File(path, "r") as file:
                    file.visit(names.append)
    for name in dataset:
        if name not in names:
            raise SourceError(f"{_listed(paths)}: has no array {name}; there are {_listed(names)}")


CONVERT = "convert the video, for example with ffmpeg to .mp4 (H.264)"


def _video(path: Path) -> Images:
    try:
        import cv2
    except ImportError:
        return _video_by_imageio(path)
    capture = cv2.VideoCapture(os.fspath(path))
    rate = capture.get(cv2.CAP_PROP_FPS)
    pixels = max(0, int(capture.get(cv2.CAP_PROP_FRAME_WIDTH))) * max(0, int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)))
    _require_held(path, pixels, os.path.getsize(path))
    frames, times = [], []
    while capture.isOpened():
        good, frame = capture.read()
        if not good:
            break
        frames.append(as_pixels(frame[np.newaxis, ..., ::-1], path)[0])  # OpenCV gives blue first
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1000)  # of the frame that was read; before, of the one before it
    capture.release()
    if not frames:
        raise SourceError(f"{path}: no frame can be read; {CONVERT}")
    times = np.array(times) - times[0]  # older versions count from the end of the first
    if not np.all(np.diff(times) > 0):  # not every container has times
        times = np.arange(len(frames)) / rate if rate > 0 else None
    return Images(np.stack(frames), times)


def _video_by_imageio(path: Path) -> Images:
    imageio = _need("imageio", path, ", with imageio-ffmpeg, or install opencv-python-headless")
    with _refused(path, "no frame can be read", CONVERT), imageio.get_reader(os.fspath(path)) as reader:
        facts = reader.get_meta_data()
        rate, duration = facts.get("fps"), facts.get("duration")
        frames = [as_pixels(np.asarray(frame)[np.newaxis], path)[0] for frame in reader]
    if not frames:
        raise SourceError(f"{path}: has no frame")
    # imageio fills gaps with repeated frames and does not tell times.
    if rate and duration and abs(len(frames) / rate - duration) > max(3 / rate, 0.02 * duration):
        raise SourceError(f"{path}: has frames of a variable rate ({len(frames)} in {duration:.4g} s, at {rate:.4g} a second), "
                          "whose times OpenCV tells: pip install opencv-python-headless")
    return Images(np.stack(frames), np.arange(len(frames)) / rate if rate else None)


def _claim_of_png(data: bytes) -> int:
    at = 8
    while at < len(data) and data[at + 4:at + 8] != b"IEND":  # room is made for a chunk before it is read
        at += 12 + struct.unpack_from(">I", data, at)[0]
        if at > len(data):
            raise ValueError("a chunk is cut off")
    width, height, bits, colours = struct.unpack_from(">IIBB", data, 16)
    return height * (width * bits * {0: 1, 2: 3, 3: 1, 4: 2}.get(colours, 4) // 8)


def _claim_of_jpeg(data: bytes) -> int:
    at = 2
    while True:  # from marker to marker; what lies between is passed over, as libjpeg does
        at = data.index(b"\xff", at)
        while data[at] == 0xFF:
            at += 1
        if 0xC0 <= data[at] <= 0xCF and data[at] not in (0xC4, 0xC8, 0xCC):
            height, width, colours = struct.unpack_from(">HHB", data, at + 4)
            return height * width * colours
        if data[at] not in (0x00, 0x01, *range(0xD0, 0xD9)):  # these have no length
            at += struct.unpack_from(">H", data, at + 1)[0]
        at += 1


def _claim_of_bmp(data: bytes) -> int:
    is_old = struct.unpack_from("<I", data, 14)[0] == 12
    width, height, _, bits = struct.unpack_from("<HHHH" if is_old else "<iiHH", data, 18)
    return abs(height) * (abs(width) * bits // 8)


def _claim_of_tiff(data: bytes) -> int:
    order = "<" if data[:2] == b"II" else ">"
    first, count, step, numbers = (8, "Q", 20, 12) if data[2:4] in (b"+\0", b"\0+") else (4, "H", 12, 8)
    directory = struct.unpack_from(order + ("Q" if step == 20 else "I"), data, first)[0]
    tags = {256: 0, 257: 0, 258: 1, 277: 1, 322: 0, 323: 0}  # width, height, bits, samples, width and height of a tile
    for entry in range(struct.unpack_from(order + count, data, directory)[0]):
        at = directory + struct.calcsize(count) + step * entry
        tag, kind = struct.unpack_from(order + "HH", data, at)
        if tag in tags:
            several = struct.unpack_from(order + ("Q" if step == 20 else "I"), data, at + 4)[0]
            size = {3: 2, 4: 4, 16: 8}.get(kind, 1)
            if several * size > step - numbers:  # they lie elsewhere
                at = struct.unpack_from(order + ("Q" if step == 20 else "I"), data, at + numbers)[0] - numbers
            tags[tag] = struct.unpack_from(order + {3: "H", 4: "I", 16: "Q"}.get(kind, "B"), data, at + numbers)[0]
    return max(tags[256] * tags[257], tags[322] * tags[323]) * tags[258] * tags[277] // 8


CLAIMS = {b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR": _claim_of_png, b"\xff\xd8": _claim_of_jpeg, b"BM": _claim_of_bmp,
          b"II*\0": _claim_of_tiff, b"MM\0*": _claim_of_tiff, b"II+\0": _claim_of_tiff, b"MM\0+": _claim_of_tiff}


def _require_picture(path: Path) -> None:
    """That it is of a kind that is read, by its first bytes, and large enough for its pixels."""
    data = pathlib.Path(path).read_bytes()
    claimed = None
    for beginning, claim in CLAIMS.items():
        if data.startswith(beginning):
            with contextlib.suppress(struct.error, ValueError, IndexError):  # it ends amid its header
                claimed = claim(data)
    if claimed is None:
        raise SourceError(f"{path}: not a picture that can be read; PNG, JPEG, BMP and TIFF are")
    _require_held(path, claimed, len(data))


def _picture(path: Path) -> np.ndarray:
    """One picture, [height, width] or [height, width, 3 or 4] with red first."""
    _require_picture(path)
    try:
        import cv2

        pixels = cv2.imread(os.fspath(path), cv2.IMREAD_UNCHANGED)
        if pixels is not None and pixels.ndim == 3:
            pixels = np.concatenate([pixels[..., 2::-1], pixels[..., 3:]], axis=2)
    except ImportError:
        try:
            pixels = np.asarray(_need("imageio", path, ", or install opencv-python-headless").imread(os.fspath(path)))
        except SourceError:
            raise
        except Exception:
            pixels = None
    if pixels is None:
        raise SourceError(f"{path}: not a picture that can be read; PNG, JPEG, BMP and TIFF are")
    return pixels


def _pictures(paths: Sequence[Path]) -> np.ndarray:
    frames = []
    for path in paths:
        frames.append(as_pixels(_picture(path)[np.newaxis], path)[0])
        if frames[-1].shape != frames[0].shape or frames[-1].dtype != frames[0].dtype:
            height, width = frames[-1].shape
            raise SourceError(f"{path}: {width} x {height} pixels of {frames[-1].dtype}, but {paths[0]} has "
                              f"{frames[0].shape[1]} x {frames[0].shape[0]} of {frames[0].dtype}; all frames must agree")
    return np.stack(frames)


def _in_natural_order(paths: Iterable[pathlib.Path]) -> list:
    """frame_2 before frame_10, as InNaturalOrder of Module/IO has it."""

    def key(path: pathlib.Path) -> tuple:
        parts = re.split("([0-9]+)", path.name)
        return [int(part) if k % 2 else part for k, part in enumerate(parts)], path.name

    return sorted(paths, key=key)


def _folder(path: pathlib.Path) -> Images:
    paths = _in_natural_order(entry for entry in path.iterdir() if entry.suffix.lower() in PICTURES)
    if not paths:
        raise SourceError(f"{path}: holds no picture; {', '.join(PICTURES)} are looked for")
    return Images(_pictures(paths), names=list(map(str, paths)))


def _list_of_frames(path: pathlib.Path) -> Images:
    """A text file with the name of a picture a line, relative to the file."""
    try:
        lines = _decoded(path).splitlines()
    except UnicodeDecodeError:
        raise SourceError(f"{path}: not text; a list has the name of a picture a line") from None
    pictures = []
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.startswith("#"):
            pictures.append(path.parent / line.strip())
            if not os.path.isfile(pictures[-1]):  # nor a device, which need not end
                raise SourceError(f"{path}: line {number} names {pictures[-1]}: there is no such file")
    if not pictures:
        raise SourceError(f"{path}: names no picture; a list has the name of one a line")
    return Images(_pictures(pictures), names=list(map(str, pictures)))


def _dicom(path: Path) -> Images:
    pydicom = _need("pydicom", path)
    with _refused(path, "not a DICOM file that can be read"):
        data = pydicom.dcmread(os.fspath(path))
    if "PixelData" not in data:
        raise SourceError(f"{path}: PixelData is missing; a multi-frame image is expected")
    with _refused(path, "its header cannot be read"):
        size = (int(data.get(name, 1) or 1) for name in ("NumberOfFrames", "Rows", "Columns", "SamplesPerPixel", "BitsAllocated"))
        _require_held(path, math.prod(size) // 8, len(data.PixelData))
    with _refused(path, "its pixels cannot be decoded", "install pylibjpeg or write it uncompressed, for example with gdcmconv --raw"):
        pixels = data.pixel_array  # of a compression whose codec may be missing
    frames, samples = int(data.get("NumberOfFrames", 1) or 1), int(data.get("SamplesPerPixel", 1))
    if frames < 2:
        raise SourceError(f"{path}: NumberOfFrames is {frames}; a multi-frame image is expected: give the pictures of single "
                          "frames as a folder instead")
    if len(pixels) != frames:
        raise SourceError(f"{path}: NumberOfFrames is {frames}, but PixelData hold {len(pixels)} frames; the file is damaged")
    colours = str(data.get("PhotometricInterpretation", "MONOCHROME2"))
    if samples == 3 and colours.startswith("YBR") and int(pydicom.__version__.split(".")[0]) < 3:  # later ones convert
        from pydicom.pixel_data_handlers.util import convert_color_space

        pixels = convert_color_space(pixels, colours, "RGB")
    elif colours == "PALETTE COLOR":
        raise SourceError(f"{path}: PhotometricInterpretation is PALETTE COLOR; grey or RGB is expected: write it as RGB")
    pixels = as_pixels(pixels, path)
    if colours == "MONOCHROME1":  # white is small
        pixels = (2 ** int(data.get("BitsStored", 8)) - 1 - pixels).astype(pixels.dtype)
    elif pixels.dtype == np.uint16:  # 12 bits become the range of 16, which is white for the trainer
        pixels = (pixels.astype(np.uint32) * 65535 // (2 ** int(data.get("BitsStored", 16)) - 1)).astype(np.uint16)

    times = None
    if len(data.get("FrameTimeVector", [])) == frames:
        times = np.cumsum([float(step) for step in data.FrameTimeVector]) / 1000
    elif float(data.get("FrameTime", 0) or 0) > 0:
        times = np.arange(frames) * float(data.FrameTime) / 1000
    spacing = None
    regions = [region for region in data.get("SequenceOfUltrasoundRegions", [])
               if region.get("RegionSpatialFormat") == 1  # 2-D; 3 is a unit of cm
               and region.get("PhysicalUnitsXDirection") == 3 and region.get("PhysicalUnitsYDirection") == 3]
    if len(regions) == 1:
        spacing = (10 * float(regions[0].PhysicalDeltaX), 10 * float(regions[0].PhysicalDeltaY))
    return Images(pixels, times, spacing, str(data.get("BurnedInAnnotation", "")) == "YES")


def _sequence(path: Path) -> Images:
    """The images of a sequence whose poses lie elsewhere, as 3D Slicer saves them."""
    from . import read_spacing, read_stack  # here, because only this format needs the rest of the package

    try:
        (pixels, times), spacing = read_stack(path), read_spacing(path)
    except RuntimeError as error:
        raise SourceError(str(error)) from None
    known = min(spacing) > 0 and spacing != (1, 1)  # programs write 1 where they know nothing
    return Images(as_pixels(pixels, path), times, spacing if known else None)


@_says_what_is_wrong
def read_images(path: Path, dataset: Sequence[str] = (), scan: Optional[str] = None) -> Images:
    """The frames of a file, a folder of pictures, or a text file that lists them. dataset, scan: as in from_files."""
    path, suffix = pathlib.Path(path), _suffix(path)
    if path.is_dir():
        return _folder(path)
    if suffix in (".npy", ".npz"):
        return Images(as_pixels(_numpy(path, ("images", "frames"), "images", dataset), path))
    if suffix in HDF5:
        pixels, beside = _hdf5(path, "images", dataset, scan)
        spacing = beside.get("spacing", np.zeros(0)).ravel()
        return Images(as_pixels(pixels, path), None, tuple(spacing[:2]) if spacing.size in (2, 3) else None)
    if suffix in VIDEOS:
        return _video(path)
    if suffix in SEQUENCES:
        return _sequence(path)
    if suffix == ".txt":
        return _list_of_frames(path)
    with open(path, "rb") as file:
        is_dicom = file.read(132)[128:] == b"DICM"
    if is_dicom or suffix == ".dcm":
        return _dicom(path)
    raise SourceError(f"{path}: {suffix or 'no ending'} is not read; .npy, .npz, .h5, .dcm, {', '.join(VIDEOS + SEQUENCES)}, a "
                      "folder of pictures and a .txt that lists them are")


# ---- poses


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """[..., 4] with w last to [..., 3, 3]."""
    x, y, z, w = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _matrices_of(rows: np.ndarray, name: Path, order: str) -> np.ndarray:
    """[rows, 16 or 12 or 7] to [rows, 4, 4], NaN where there is no rotation; seven are x y z and a quaternion."""
    count = rows.shape[1]
    turn = rows[:, 3:] if count == 7 else rows[:, [0, 1, 2, 4, 5, 6, 8, 9, 10]]
    is_lost = ~np.isfinite(rows).all(axis=1) | (turn == 0).all(axis=1) | (np.abs(rows) > NO_POSITION).any(axis=1)
    rows = np.where(is_lost[:, None], np.nan, rows)
    matrices = np.tile(np.eye(4), (len(rows), 1, 1))
    if count == 16:
        matrices = rows.reshape(-1, 4, 4).copy()
    elif count == 12:
        matrices[:, :3] = rows.reshape(-1, 3, 4)
    else:
        quaternion = rows[:, 3:] if order == "xyzw" else np.roll(rows[:, 3:], -1, axis=1)
        for row, length in enumerate(np.linalg.norm(quaternion, axis=1)):
            if np.isfinite(length) and abs(length - 1) > RIGID:
                raise SourceError(f"{name}: row {row}: the quaternion has length {length:.4g}; 1 is expected. Do the columns "
                                  "hold something else?")
        matrices[:, :3, :3] = rotation_of(quaternion)
        matrices[:, :3, 3] = rows[:, :3]
    last = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(axis=1)
    if np.any(last > 1e-6):
        row = int(np.argmax(last > 1e-6))
        raise SourceError(f"{name}: row {row}: the matrix ends with {matrices[row, 3].tolist()}; 0 0 0 1 is expected. Is it "
                          "written column by column? Then transpose it")
    return matrices


TRANSLATION = [{f"{prefix}{axis}" for prefix in ("", "t", "p", "pos", "position", "translation")} for axis in "xyz"]
QUATERNION = [{f"{prefix}{axis}" for prefix in ("q", "quat", "quaternion", "orientation", "rot", "rotation")} for axis in "xyzw"]
QUATERNION[3].add("q0")  # of NDI, beside qx, qy and qz
MATRIX = [{f"m{row}{column}"} for row in range(4) for column in range(4)]
UNITS = {1.0: "seconds", 1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}
# The name of a column of times, and of its unit; an "s" alone may make the plural of it.
TIME = re.compile(r"(?:timestamp|time|t|stamp)s?(?:(?P<s>sec|secs|seconds)|(?P<ms>ms|msecs?|millis|milliseconds)|"
                  r"(?P<us>us|usecs?|micros|microseconds)|(?P<ns>ns|nsecs?|nanos|nanoseconds))?")
LARGEST_DRIFT = 0.1  # s between the times of frames and those of their poses
SHORTEST_STEP, LONGEST_STEP = 2e-4, 10.0  # s between the poses of a tracker, on the median
# Which frame a row belongs to; of several columns the first of these names. The same as in Module/IO's PictureNames.cxx.
PICTURE = ("image", "file", "filename", "picture")
FRAME = ("frame", "frameindex", "framenumber", "frameid", "imageindex", "index", "id")
ELSE = "Rename the column where it holds something else"
HEADERLESS = {16: 0, 12: 0, 7: 0, 17: 1, 13: 1, 8: 1}  # numbers in a row, and how many of them are a time, first


MOST_TITLES = 20  # lines before the names of the columns
# What a spreadsheet writes where it has no number: such a line is a row, though it begins like a comment.
NO_NUMBER = re.compile(r"\s*\"?#(N/A|NUM!|VALUE!|REF!|DIV/0!|NULL!|NAME\?)", re.IGNORECASE)
WORDS_OF_UNITS = {"um", "mm", "cm", "m", "deg", "degree", "degrees", "rad", "radian", "radians", "s", "sec", "seconds", "ms", "us",
                  "ns", "px", "pixel", "pixels"}
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")


def _separator(lines: Sequence[str]) -> Optional[str]:
    """What stands between the cells of most lines; None for blanks. Beside another separator a comma is one of decimals."""
    last = lines[-1]
    for mark in (";", "\t", ","):
        if 2 * sum(mark in line for line in lines) > len(lines):
            if mark == "\t" and any(len(cell.split()) > 1 for cell in last.split(mark)):
                continue  # blanks of either kind
            if mark == "," and len(last.split()) > 1 and all(re.fullmatch(r"[-+\d.eE]+", word) or DECIMAL_COMMA.fullmatch(word)
                                                             for word in last.split()):
                continue  # numbers with decimal commas, between blanks
            return mark
    return None


def _cells(line: str, separator: Optional[str], name: Path, number: int) -> list:
    if separator is None:
        return [cell.strip('"') for cell in line.split()]
    try:
        return [cell.strip() for cell in next(csv.reader([line.strip(" ")], delimiter=separator, skipinitialspace=True))]
    except csv.Error as error:
        raise SourceError(f"{name}: line {number}: {error}; a table of poses is expected") from None


def _is_nothing(cell: str) -> bool:
    # "#" as in #N/A, and in 1.#QNAN and -1.#IND, which programs for Windows print.
    return "#" in cell or re.sub(r"[\s_]+", " ", cell).strip(" .<>()[]").lower() in NOTHING


def _number(cell: str, name: Path, line: int, column: str) -> float:
    if _is_nothing(cell):
        return np.nan
    try:
        return float(cell.replace(",", ".") if DECIMAL_COMMA.fullmatch(cell) else cell)
    except ValueError:
        raise SourceError(f"{name}: line {line}, column {column}: '{cell[:40]}' is not a number") from None


def _plain(cell: str) -> str:
    """The name of a column as it is compared."""
    return re.sub(r"[^a-z0-9]", "", cell.lower())


def _pose_columns(names: Sequence[str]) -> Optional[list]:
    """The columns of a pose, 16, 12 or 7; None where names have none."""
    matrix, pose = ([next((c for c, name in enumerate(names) if name in known), None) for known in wanted]
                    for wanted in (MATRIX, TRANSLATION + QUATERNION))
    return next((found for found in (matrix, matrix[:12], pose) if None not in found), None)


def _names_of(titles: Sequence[str], path: Path) -> list:
    """Titles as they are compared. Of a path (field.pose.position.x of ROS, /probe/pose/position/x) its last two words count,
    where they are a pose; one pose of a table at the most."""
    names = list(map(_plain, titles))
    if _pose_columns(names):
        return names
    ends: dict = {}  # by what stands before them
    for column, title in enumerate(titles):
        words = re.split("[./]", title)
        if len(words) > 1:
            ends.setdefault(".".join(words[:-2]), {})[column] = _plain("".join(words[-2:]))
    poses = {start: named for start, named in ends.items() if _pose_columns(list(named.values()))}
    if len(poses) > 1:
        raise SourceError(f"{path}: has columns of {len(poses)} poses, {_listed(list(poses))}; keep those of one")
    for named in poses.values():
        names = [named.get(column, name) for column, name in enumerate(names)]
    return names


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith("#") and not NO_NUMBER.match(line)


class _Table:
    """Cells of a text, and the names of its columns where it has any."""

    def __init__(self, path: Path) -> None:
        try:
            text = _decoded(path)
        except UnicodeDecodeError:
            raise SourceError(f"{path}: not text; a table of poses is expected") from None
        self.path = path
        self.notes: list = []
        lines = [(k, line) for k, line in enumerate(text.splitlines(), 1)
                 if line.strip() and not re.match(r"\s*sep=.$", line)]  # spreadsheets name their separator so
        rows = [(k, line) for k, line in lines if not _is_comment(line)]
        if not rows:
            raise SourceError(f"{path}: is empty; a table of poses is expected")
        self.separator = _separator([line for _, line in rows])
        self._take_names(lines, rows)
        if not self.rows:
            raise SourceError(f"{path}: has a header and no row")
        self._take_units()
        self._require_width()
        self._say_comments(lines)

    def _take_names(self, lines: list, rows: list) -> None:
        """Of the first line that names a pose, also one that begins with # as numpy's; else of the first with two words."""
        for at, (header, line) in enumerate(lines[:MOST_TITLES]):
            self.titles = _cells(line.lstrip("# \t") if _is_comment(line) else line, self.separator, self.path, header)
            self.names = _names_of(self.titles, self.path)
            if _pose_columns(self.names):
                for k, title in lines[:at]:
                    if not _is_comment(title):
                        self.notes.append(f"Line {k} of {self.path} stands before the names of the columns and was skipped: "
                                          f"'{title.strip()[:60]}'.")
                rows = [(k, row) for k, row in rows if k > header]
                self.has_names, self.first = True, header
                break
        else:
            self.first, line = rows[0]
            self.titles = _cells(line, self.separator, self.path, self.first)
            self.names = _names_of(self.titles, self.path)
            words = {name for name in self.names
                     if re.match(r"[a-z]", name) and name not in ("nan", "inf") and not _is_nothing(name)}
            self.has_names = len(words) > 1  # one word, again and again, is a first row in which the tracker saw nothing
            rows = rows[1:] if self.has_names else rows
        self.rows = [(k, _cells(row, self.separator, self.path, k)) for k, row in rows]

    def _take_units(self) -> None:
        """Leaves out a line of units below the names."""
        k, cells = self.rows[0]
        words = [cell.strip("()[] ").lower() for cell in cells]
        if (self.has_names and len(self.rows) > 1 and WORDS_OF_UNITS.intersection(words)
                and all(word in WORDS_OF_UNITS or _is_nothing(word) for word in words)):
            del self.rows[0]
            self.notes.append(f"Line {k} of {self.path} holds units and no pose, and was skipped: '{', '.join(cells)[:60]}'.")

    def _require_width(self) -> None:
        self.width = len(self.names) if self.has_names else max(len(cells) for _, cells in self.rows)
        for k, cells in self.rows:
            if len(cells) < self.width and re.fullmatch(r"\D+", cells[-1]) and k != self.first:  # a word in the place of a pose
                cells += [""] * (self.width - len(cells))
        wrong = [(k, len(cells)) for k, cells in self.rows if len(cells) != self.width]
        if not wrong:
            return
        if len({len(cells) for k, cells in self.rows if k != self.first}) == 1 and re.search("[A-Za-z]", self.titles[0]):
            raise SourceError(f"{self.path}: line {self.first} ('{' '.join(self.titles)[:60]}') is no row, and names no columns that "
                              "are read; remove it, or begin it with #")
        usual = next(k for k, cells in [(self.first, self.names), *self.rows] if len(cells) == self.width)
        raise SourceError(f"{self.path}: line {wrong[0][0]} has {wrong[0][1]} cells, line {usual} has {self.width}; is it cut off?")

    def _say_comments(self, lines: list) -> None:
        """Comments among the rows that look as rows do."""
        like = [k for k, line in lines if _is_comment(line) and k > self.rows[0][0] and self.width > 1
                and len(_cells(line, self.separator, self.path, k)) == self.width]
        if like:
            self.notes.append(f"{len(like)} of the lines of {self.path} begin with # and were skipped as comments: {_listed(like)}.")

    def column_of(self, names: Iterable[str]) -> Optional[int]:
        return next((c for c, name in enumerate(self.names) if name in names), None) if self.has_names else None

    def numbers(self, column: int) -> np.ndarray:
        name = self.names[column] if self.has_names else str(column + 1)
        return np.array([_number(cells[column], self.path, k, name) for k, cells in self.rows])

    def poses(self, columns: Sequence[int]) -> np.ndarray:
        """[rows, columns]; NaN where the status is not OK, and where no cell has a digit but 0, whatever word there is."""
        for k, cells in self.rows:
            if not self.is_sound(k, cells) or not any(re.search("[1-9]", cells[c]) for c in columns):
                for column in columns:
                    cells[column] = ""
        return np.stack([self.numbers(column) for column in columns], axis=1)

    def is_sound(self, k: int, cells: Sequence[str]) -> bool:
        """Whether what columns say of the row's pose, if anything, is that there is one."""
        said = [(name, cells[c]) for c, name in enumerate(self.names) if self.has_names and name in FLAGS | {"status"}]
        for name, cell in said:
            if re.fullmatch(r"[-+.\d]+", cell) and (name == "status" or cell not in ("0", "1")):
                expected = ("a word is expected, OK where there is a pose: numbers mean one thing or the other. Call the column "
                            "valid where 1 means so" if name == "status" else "0 or 1 is expected")
                raise SourceError(f"{self.path}: line {k}, column {name}: '{cell[:40]}'; {expected}")
        return all(cell == "1" or cell.lower() in SOUND for _, cell in said)

    def named(self) -> Optional[Named]:
        """What says which frame a row belongs to."""
        name = next((name for name in PICTURE + FRAME if self.has_names and name in self.names), None)
        column = 0 if name is None else self.names.index(name)
        if name is None and (self.has_names or not HEADERLESS[self.width]):
            return None
        return Named(self.titles[column] if name else "1", [cells[column] for _, cells in self.rows], [k for k, _ in self.rows],
                     name in PICTURE, name is None)


def _said_of_order(path: Path, order: str) -> str:
    return (f"{path} has no names of columns, so its quaternions were read as w x y z, as the option quaternion says."
            if order == "wxyz" else f"{path} has no names of columns, so its quaternions were read in the usual order, x y z w. "
            "Where w comes first, give --quaternion wxyz.")


def _text_poses(path: Path, order: str) -> Poses:
    table = _Table(path)
    if not table.has_names:
        if table.width not in HEADERLESS:
            raise SourceError(f"{path}: {table.width} numbers a row and no header; 16 or 12 of a matrix, row by row, or 7 of a "
                              "position and a quaternion are expected, or one more with a time in seconds first")
        first = HEADERLESS[table.width]
        rows = table.poses(range(first, table.width))
        notes = (*table.notes, _said_of_order(path, order)) if table.width - first == 7 else tuple(table.notes)
        return Poses(_matrices_of(rows, path, order), table.numbers(0) if first else None, unit=None, named=table.named(), notes=notes)

    columns = _pose_columns(table.names)
    if columns is None:
        raise SourceError(f"{path}: has the columns {', '.join(table.titles)[:200]}; m00 to m33, or x, y, z, qx, qy, qz, qw are "
                          "expected")
    matrices = _matrices_of(table.poses(columns), path, "xyzw")  # the order that names give a quaternion
    time, unit = next(((c, match.lastgroup) for c, match in enumerate(map(TIME.fullmatch, table.names)) if match), (None, None))
    times = None if time is None else table.numbers(time)
    return Poses(matrices, times, unit=unit and dict(zip(("s", "ms", "us", "ns"), UNITS))[unit], named=table.named(),
                 notes=tuple(table.notes))


def _sequence_poses(path: Path) -> Poses:
    """Transforms that 3D Slicer saves beside the images of a tracked sequence (.seq.mha, .seq.mhd)."""
    with open(path, "rb") as file:
        header = file.read().split(b"ElementDataFile", 1)[0].decode("utf-8", "replace")
    found: dict = {}
    for line in header.splitlines():
        match = re.match(r"Seq_Frame(\d+)_([^\s:=]*) *:?=", line)
        if match:
            index, field = match.groups()
            if int(index[:9]) > len(header) or len(index) > 9:
                raise SourceError(f"{path}: names frame {index[:20]} in a header of {len(header)} bytes, which has no room for as many")
            found.setdefault(field, {})[int(index)] = line[match.end():].strip()
    transforms = [field for field in found if field.endswith("Transform")]
    if len(transforms) != 1:
        raise SourceError(f"{path}: has {len(transforms)} transforms a frame ({', '.join(transforms)[:120]}); one is expected. "
                          "A sequence with images and transforms is read by 'bigus convert'")
    rows, count = found[transforms[0]], 1 + max(found[transforms[0]])
    table = np.full((count, 16), np.nan)
    for index, value in rows.items():
        if found.get(transforms[0] + "Status", {}).get(index, "OK").lower() in SOUND | {"1"}:
            words = value.split() if re.search("[1-9]", value) else [""] * 16  # a word, or zeros
            if len(words) != 16:
                raise SourceError(f"{path}: frame {index}, {transforms[0]}: {len(words)} numbers; 16 are expected")
            table[index] = [_number(word, path, index, transforms[0]) for word in words]
    times = np.array([_number(found.get("Timestamp", {}).get(index, ""), path, index, "Timestamp") for index in range(count)])
    return Poses(_matrices_of(table, path, "xyzw"), None if np.isnan(times).all() else times, unit=None)


@_says_what_is_wrong
def read_poses(path: Path, order: str = "xyzw", dataset: Sequence[str] = (), scan: Optional[str] = None) -> Poses:
    """The poses of a file. order: of a quaternion that has no names, xyzw or wxyz. dataset, scan: as in from_files."""
    suffix = _suffix(path)
    if suffix in (".npy", ".npz", *HDF5):
        beside: dict = {}
        if suffix in (".npy", ".npz"):
            array = _numpy(path, ("poses", "tforms", "transforms"), "poses", dataset)
        else:
            array, beside = _hdf5(path, "poses", dataset, scan)
        if array.dtype.kind not in "fiu" or array.shape[1:] not in ((4, 4), (3, 4), (16,), (12,), (7,)) or not len(array):
            raise SourceError(f"{path}: poses of shape {array.shape} and type {array.dtype}; numbers of shape (frames, 4, 4), "
                              "(frames, 3, 4) or (frames, 7) are expected")
        image = beside.get("pixel_to_image", np.zeros(0))
        image = _matrices_of(image.reshape(1, 16), f"{path}: pixel_to_image", order)[0] if image.size == 16 else None
        notes = (_said_of_order(path, order),) if array.shape[1:] == (7,) else ()
        return Poses(_matrices_of(array.astype(float).reshape(len(array), -1), path, order), image=image, notes=notes)
    if suffix in SEQUENCES:
        return _sequence_poses(path)
    return _text_poses(path, order)


def _decoded(path: Path) -> str:
    """Text in UTF-8, or in UTF-16, which begins with its mark or has every second byte of a tag 0."""
    data = pathlib.Path(path).read_bytes()
    little, big = data[:2] == b"<\0", data[:2] == b"\0<"
    is_marked = data[:2] in (b"\xff\xfe", b"\xfe\xff")
    return data.decode("utf-16-le" if little else "utf-16-be" if big else "utf-16" if is_marked else "utf-8-sig")


def _plus_calibration(path: Path, text: str) -> np.ndarray:
    """The 16 numbers of ImageToProbe in a Plus configuration, wherever its CoordinateDefinitions lie."""
    try:
        if "<!ENTITY" in text:
            raise ElementTree.ParseError("it defines entities")
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise SourceError(f"{path}: not a Plus configuration that can be read ({error})") from None
    found = {f"{transform.get('From')}To{transform.get('To')}": transform.get("Matrix", "")
             for definitions in root.iter("CoordinateDefinitions") for transform in definitions.iter("Transform")}
    if "ImageToProbe" not in found:
        raise SourceError(f"{path}: has the transforms {_listed(found)}; ImageToProbe is expected")
    return np.array([_number(cell, path, 1, "Matrix of ImageToProbe") for cell in found["ImageToProbe"].split()])


@_says_what_is_wrong
def read_calibration(path: Path) -> tuple:
    """(matrix [4, 4] from a pixel to the probe, whether it counts pixels from 1), of 16 numbers in a text or .npy file, of
    ImageToProbe in a Plus configuration, or of the two matrices of TUS-REC: pixels to mm, and mm to the tool."""
    if _suffix(path) == ".npy":
        array = _numpy(path, (), "a matrix")
        numbers = array.astype(float).ravel() if array.dtype.kind in "fiu" else np.zeros(0)
    else:
        try:
            text = _decoded(path)
        except UnicodeDecodeError:
            raise SourceError(f"{path}: not text; a calibration has 16 numbers, row by row") from None
        lines = [(k, line) for k, line in enumerate(text.splitlines(), 1)
                 if line.strip() and not re.match(r'\s*[#"A-Za-z]', line)]
        words = [word for _, line in lines for word in re.split(r"[;\s]+", line.strip())]
        has_points = not all(DECIMAL_COMMA.fullmatch(word) for word in words if "," in word)
        lines = [(k, [cell for cell in re.split(r"[,;\s]+" if has_points else r"[;\s]+", line) if cell]) for k, line in lines]
        numbers = (_plus_calibration(path, text) if text.lstrip().startswith("<") else
                   np.array([_number(cell, path, k, str(c)) for k, cells in lines for c, cell in enumerate(cells, 1)]))
    if numbers.size not in (16, 32) or not np.isfinite(numbers).all():
        raise SourceError(f"{path}: {np.isfinite(numbers).sum()} numbers; 16 are expected, a 4 x 4 matrix row by row, or the 32 "
                          "of TUS-REC's calib_matrix.csv")
    parts = _matrices_of(numbers.reshape(-1, 16), path, "xyzw")
    matrix = parts[0] if len(parts) == 1 else parts[1] @ parts[0]
    matrix = _with_third_columns(matrix[np.newaxis], False, path)[0][0]
    if not abs(np.linalg.det(matrix[:3, :3])) > 0:
        raise SourceError(f"{path}: the matrix is singular")
    return matrix, len(parts) == 2


# ---- both together


def _translation(i: float, j: float) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:2, 3] = i, j
    return matrix


def _require_rigid(poses: Poses, name: Path) -> None:
    """A tracker turns and moves, and does nothing else."""
    for row, matrix in enumerate(poses.matrices[:, :3, :3]):
        if np.isnan(matrix).any():
            continue
        fault = np.abs(matrix.T @ matrix - np.eye(3)).max()
        if fault > RIGID or np.linalg.det(matrix) < 0:
            sides = ", ".join(f"{side:.4g}" for side in np.linalg.norm(matrix, axis=0))
            raise SourceError(f"{name}: row {row}: the matrix is no rotation (its columns have the lengths {sides}, its "
                              f"determinant is {np.linalg.det(matrix):.4g}), but with a calibration or a pixel spacing poses are "
                              "those of the probe. Leave these out where poses lead from pixels")


def _with_third_columns(matrices: np.ndarray, left_handed: bool, name: Path) -> tuple:
    """(matrices, how many were mended): a picture has two axes, so a third column that is zero or lies in their plane or,
    where left_handed says so, points the other way is made from them, right-handed and of length 1."""
    matrices, made = matrices.copy(), 0
    for row, matrix in enumerate(matrices):
        sides = np.linalg.norm(matrix[:3, :3], axis=0)
        if not np.isfinite(sides).all() or not min(sides[:2]) > 0:
            continue
        volume = np.linalg.det(matrix[:3, :3]) / (sides.prod() or 1)
        if volume > 1e-9 or (not left_handed and volume < -1e-9):
            continue
        columns, rows = (matrix[:3, axis] / sides[axis] for axis in (0, 1))
        if abs(columns @ rows) > np.sin(np.radians(MOST_SHEARED)):
            raise SourceError(f"{name}: row {row}: the first two columns of the matrix meet at "
                              f"{np.degrees(np.arccos(np.clip(columns @ rows, -1, 1))):.3g} degrees, and its third is none; "
                              "rows and columns of a picture are at right angles")
        normal = np.cross(columns, rows)
        matrix[:3, 2], made = normal / np.linalg.norm(normal), made + 1
    return matrices, made


def _in_seconds(poses: Poses, frames: Optional[np.ndarray], name: Path, notes: list) -> Poses:
    """Without a unit in the file, that in which a tracker may have such a rate; of several, the one in which most poses and
    frames, whose times are given, come together."""
    times = np.unique(poses.times[np.isfinite(poses.times)]) if poses.times is not None else np.zeros(0)
    if not times.size:
        return poses
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0

    def in_common(unit: float) -> int:
        if frames is None:
            return 0
        stamps = unit * times
        return min(np.count_nonzero((frames >= stamps[0]) & (frames <= stamps[-1])),
                   np.count_nonzero((stamps >= frames.min()) & (stamps <= frames.max())))

    possible = [unit for unit in UNITS if SHORTEST_STEP <= unit * step <= LONGEST_STEP] or [1.0]
    unit = poses.unit or max(possible, key=in_common)
    if unit != 1:
        reason = "by the name of their column" if poses.unit else f"because they are {step:.4g} apart"
        notes.append(f"The times of {name} are taken for {UNITS[unit]}, {reason}.")
    return poses._replace(times=unit * poses.times, unit=1.0)


def _in_order(poses: Poses, rows: np.ndarray, name: Path, notes: list) -> np.ndarray:
    """The rows in the order of their times."""
    stamps = poses.times[rows]
    early = np.count_nonzero(stamps < np.maximum.accumulate(stamps))
    if not early:
        return rows
    ordered = rows[np.argsort(stamps, kind="stable")]
    way, ordered_way = (np.nansum(np.linalg.norm(np.diff(poses.matrices[some, :3, 3], axis=0), axis=1))
                        for some in (rows, ordered))
    if ordered_way > 2 * way:  # the tool would jump to and fro
        row = int(np.argmax(np.diff(stamps) < 0)) + 1
        raise SourceError(f"{name}: the time {stamps[row]:.6f} s comes after {stamps[row - 1]:.6f} s, and in the order of the "
                          "times the poses jump; times must increase. Are these two recordings? Then give one")
    notes.append(f"{early} of {len(rows)} rows of {name} stood after later ones; all were sorted by time.")
    return ordered


def _once_a_time(poses: Poses, rows: np.ndarray, name: Path, notes: list) -> np.ndarray:
    """The rows in the order of their times, the first of each."""
    rows = _in_order(poses, rows, name, notes)
    repeats = np.diff(poses.times[rows], prepend=-np.inf) == 0
    if repeats.any():
        notes.append(f"{np.count_nonzero(repeats)} of {len(rows)} rows of {name} had the time of an earlier one and were left out.")
    return rows[~repeats]


def _at_times(poses: Poses, times: np.ndarray, longest_gap: float, name: Path, notes: list) -> np.ndarray:
    """Poses between those recorded: positions linear, rotations along the shortest arc; NaN where none is near in time."""
    if INTERPOLATED not in notes:
        notes.append(INTERPOLATED)
    rows = np.flatnonzero(np.isfinite(poses.matrices[:, 0, 0]) & np.isfinite(poses.times))
    if len(rows) < len(poses.times):
        notes.append(f"{len(poses.times) - len(rows)} of {len(poses.times)} rows of {name} had no pose and were passed over.")
    rows = _once_a_time(poses, rows, name, notes)
    stamps = poses.times[rows]
    if len(rows) < 2:
        raise SourceError(f"{name}: has {len(rows)} usable poses with a time; two are needed to find poses between them")
    after = np.clip(np.searchsorted(stamps, times), 1, len(rows) - 1)
    first, second = poses.matrices[rows[after - 1]], poses.matrices[rows[after]]
    gap = stamps[after] - stamps[after - 1]
    share = (times - stamps[after - 1]) / gap
    between = np.tile(np.eye(4), (len(times), 1, 1))
    between[:, :3, 3] = first[:, :3, 3] + share[:, None] * (second[:, :3, 3] - first[:, :3, 3])
    turn = np.swapaxes(first[:, :3, :3], 1, 2) @ second[:, :3, :3]
    for k, part in enumerate(turn):
        # The turn's axis and angle; below 1e-9 rad its axis means nothing, and no rotation is what it is.
        axis = np.array([part[2, 1] - part[1, 2], part[0, 2] - part[2, 0], part[1, 0] - part[0, 1]])
        angle = np.arctan2(0.5 * np.linalg.norm(axis), 0.5 * (np.trace(part) - 1))
        half = 0.5 * share[k] * angle
        quaternion = np.append(np.sin(half) * axis / max(np.linalg.norm(axis), 1e-9), np.cos(half))
        between[k, :3, :3] = first[k, :3, :3] @ rotation_of(quaternion)
    exact = np.minimum(np.abs(times - stamps[after]), np.abs(times - stamps[after - 1])) < 1e-9
    between[((times < stamps[0]) | (times > stamps[-1]) | (gap > longest_gap)) & ~exact] = np.nan
    return between


def _whole(cell: str) -> Optional[int]:
    try:
        number = float(cell.replace(",", ".") if DECIMAL_COMMA.fullmatch(cell) else cell)
    except ValueError:
        return None
    return int(number) if 0 <= number < 2**31 and number == int(number) else None


def _refused_cell(name: Path, named: Named, row: int, what: str) -> SourceError:
    return SourceError(f"{name}: line {named.lines[row]}, column {named.title}: '{named.cells[row][:60]}'{what}. {ELSE}")


def _by_number(named: Named, numbers: list, images: Images, name: Path, notes: list) -> list:
    """The index of each row's frame, by its number: as the names of the pictures have it, or else counted."""
    count, files = len(images.pixels), images.names or []
    own = [re.findall(r"\d+", pathlib.PurePath(file).stem)[-1:] for file in files]
    places = {int(digits[0]): k for k, digits in enumerate(own) if digits}
    if len(places) == count and places.keys() >= set(numbers):
        frames = [places[number] for number in numbers]
        if frames != numbers:
            notes.append(f"Numbers of column {named.title} of {name} are those of the pictures' names: {numbers[0]} is "
                         f"{pathlib.PurePath(files[frames[0]]).name}.")
        return frames
    first = int(min(numbers) > 0 and max(numbers) == count)
    if min(numbers) == 1:
        reason = "reaches" if first else "does not reach"
        notes.append(f"Column {named.title} of {name} begins with 1 and {reason} {count}, the number of frames, so its numbers were "
                     f"counted from {first}.")
    beyond = next((row for row, number in enumerate(numbers) if number - first >= count), None)
    if beyond is not None:
        raise _refused_cell(name, named, beyond, f" names frame {numbers[beyond]}, but there are {count}, counted from 0, and no "
                            "pictures of such numbers" if files else f" names frame {numbers[beyond]}, but there are {count}, "
                            "counted from 0")
    return [number - first for number in numbers]


def _by_name(named: Named, images: Images, name: Path) -> list:
    """The index of each row's picture, by its name: the file's, with or without its ending and the folders before it."""
    files = images.names
    if not files:
        raise _refused_cell(name, named, 0, " names a picture, but the images are not files with names; frames' numbers, counted "
                            "from 0, are expected")
    paths = [pathlib.PurePath(file).parts for file in files]
    places: dict = {}
    for k, parts in enumerate(paths):
        for word in {parts[-1], pathlib.PurePath(parts[-1]).stem}:
            places.setdefault(word, []).append(k)
    frames = []
    for row, cell in enumerate(named.cells):
        parts = [part for part in re.split(r"[\\/]+", cell) if part] or [""]
        found, depth = places.get(parts[-1], []), 1
        while len(found) > 1 and depth < len(parts):  # pictures of the same name in several folders
            depth += 1
            found = [k for k in found if paths[k][-depth:-1] == tuple(parts[-depth:-1])]
        if len(found) != 1:
            raise _refused_cell(name, named, row, f" names {len(found) or 'none'} of the {len(files)} pictures "
                                f"({_listed(pathlib.PurePath(file).name for file in files[:2])}, ...); their names or numbers are "
                                "expected")
        frames.append(found[0])
    return frames


def _placed(poses: Poses, images: Images, by_time: bool, name: Path, notes: list) -> Poses:
    """Poses with the frames that their rows name, where they do. Sources.md has the rule."""
    notes += poses.notes
    named = poses.named
    if named is None or by_time:
        return poses
    numbers, count = [_whole(cell) for cell in named.cells], len(images.pixels)
    if named.is_guess:
        first = min((number for number in numbers if number is not None), default=0)
        ascending = list(range(first, first + len(numbers)))
        if None in numbers or first > 1 or len(numbers) < 2 or sorted(numbers) != ascending:
            return poses
        if numbers == ascending and len(numbers) != count:  # times of a slow tracker
            return poses
        notes.append(f"The first number of the rows of {name} counts them from {first}, so it was taken for a frame's number, not for "
                     "a time.")
        return poses._replace(frames=np.array(numbers) - first, times=None)
    if None not in numbers:
        frames = _by_number(named, numbers, images, name, notes)
    elif named.may_be_names:
        frames = _by_name(named, images, name)
    else:
        raise _refused_cell(name, named, numbers.index(None), "; a frame's number, counted from 0, is expected")
    again = next((row for row in range(len(frames)) if frames[row] in frames[:row]), None) if len(set(frames)) < len(frames) else None
    if again is not None:
        raise _refused_cell(name, named, again, " names a frame twice: a line before it has the same")
    return poses._replace(frames=np.array(frames))


def _of_each_frame(poses: Poses, images: Images, offset: float, longest_gap: float, by_time: bool, name: Path,
                   notes: list) -> np.ndarray:
    """[frames, 4, 4]; NaN for frames without a pose."""
    frames = len(images.pixels)
    if poses.frames is not None and not by_time:
        if len(poses.frames) and poses.frames.max() >= frames:
            raise SourceError(f"{name}: {len(poses.frames)} poses for {frames} frames; give one pose a frame")
        matrices = np.full((frames, 4, 4), np.nan)
        matrices[poses.frames] = poses.matrices
        return matrices
    if len(poses.matrices) == frames and not by_time:
        if poses.times is None or images.times is None:
            return poses.matrices
        untimed = np.count_nonzero(~np.isfinite(poses.times))
        if untimed:
            notes.append(f"{untimed} of {frames} rows of {name} have no time, so rows were taken for the frames in their order.")
            return poses.matrices
        rows = _in_order(poses, np.arange(frames), name, notes)
        drift = np.ptp(poses.times[rows] - images.times)
        if drift > LARGEST_DRIFT:
            notes.append(f"Rows of {name} were taken for the frames in their order, but by their times the two drift apart by "
                         f"{drift:.2g} s; --by-time takes poses at the times of the frames.")
        return poses.matrices[rows]
    if poses.times is None or images.times is None:
        lacks = "the poses have no times" if poses.times is None else "the images have no times"
        raise SourceError(f"{name}: {len(poses.matrices)} poses for {frames} frames, and {lacks}; give one pose a frame, a "
                          "column frame, or times on both sides")
    _require_rigid(poses, name)
    return _at_times(poses, images.times + offset, longest_gap, name, notes)


def _times_of_frames(poses: Poses, images: Images, usable: np.ndarray, name: Path, notes: list) -> Optional[np.ndarray]:
    """Of the images, or else those of their poses; None unless every usable frame has one."""
    times = images.times
    if times is None and poses.times is not None:
        times = poses.times
        if poses.frames is not None:
            times = np.full(len(usable), np.nan)
            times[poses.frames] = poses.times
        if len(times) != len(usable):
            return None
    if times is None:
        return None
    known = np.isfinite(times[usable])
    if not known.all():
        if known.any():
            notes.append(f"{np.count_nonzero(~known)} of {len(known)} frames have no time, so times are not used.")
        return None
    steps = np.diff(times[usable])
    if images.times is None and (steps <= 0).any():
        notes.append(f"The times of {name} do not ascend: of {len(known)} frames {np.count_nonzero(steps < 0)} come before the one in "
                     f"front of them and {np.count_nonzero(steps == 0)} have its time. The pictures' order was kept.")
    return times


class Sweep(NamedTuple):
    """What `from_files` hands to `bigus.sweep`."""

    pixels: np.ndarray  # [frames, height, width]
    poses: np.ndarray  # [frames, 4, 4], ImageToReference
    times: Optional[np.ndarray]  # s
    notes: list  # what was decided or left out, a sentence each


class Reading(NamedTuple):
    """How files become a sweep; from_files says what each means."""

    calibration: Optional[Path] = None
    pixel_spacing: Optional[Sequence[float]] = None
    origin_pixel: Sequence[float] = (0, 0)
    first_pixel: Optional[int] = None
    reference: Optional[Path] = None
    units: str = "mm"
    quaternion: str = "xyzw"
    inverse: bool = False
    crop: Optional[Sequence[int]] = None
    by_time: bool = False
    time_offset: float = 0.0
    longest_gap: float = 0.2
    dataset: Union[str, Sequence[str]] = ()
    scan: Optional[str] = None

    def checked(self, paths: Sequence[Path]) -> Reading:
        if self.units not in MILLIMETRES:
            raise ValueError(f"units is {self.units!r}; mm, cm or m is expected")
        if self.quaternion not in ("xyzw", "wxyz"):
            raise ValueError(f"quaternion is {self.quaternion!r}; xyzw or wxyz is expected")
        if self.first_pixel not in (None, 0, 1):
            raise ValueError(f"first_pixel is {self.first_pixel!r}; 0 or 1 is expected")
        spacing = self.pixel_spacing
        if spacing is not None and (len(spacing) != 2 or not all(SMALLEST_PIXEL <= side <= LARGEST_PIXEL for side in spacing)):
            raise ValueError(f"pixel_spacing is {tuple(spacing)}; two lengths from {SMALLEST_PIXEL} to {LARGEST_PIXEL} mm, along "
                             "i and j, are expected")
        names = [name.strip("/") for name in ([self.dataset] if isinstance(self.dataset, str) else self.dataset or ()) if name]
        if names:
            _require_arrays(paths, names)
        if self.scan is not None and not any(_suffix(path) in HDF5 for path in paths):
            raise ValueError(f"scan is {self.scan!r}; only HDF5 files hold several")
        return self._replace(dataset=names, scan=None if self.scan is None else str(self.scan))


def load(images: Path, poses: Optional[Path] = None, **options: Any) -> Sweep:
    """See from_files."""
    how = Reading(**options).checked([path for path in (images, poses) if path is not None])
    notes: list = []
    frames = read_images(images, how.dataset, how.scan)
    source = images if poses is None else poses
    if poses is None and _suffix(images) not in (".npz", *HDF5):
        raise SourceError(f"{images}: holds images only; give a file of poses, too")
    tracked, matrices = _tracked(source, frames, how, notes)
    image, says_size = _image_to_probe(tracked, matrices, frames, how, source, notes)
    matrices = matrices @ image
    pixels = frames.pixels
    if how.crop is None and frames.has_text:
        notes.append("The file says that text is part of its pictures (BurnedInAnnotation); it may name a patient. --crop keeps "
                     "what lies inside.")
    if how.crop is not None:
        pixels = _cropped(pixels, how.crop)
        matrices = matrices @ _translation(how.crop[0], how.crop[1])
    if how.reference is not None:
        fixed = _placed(read_poses(how.reference, how.quaternion), frames, how.by_time, how.reference, notes)
        fixed = _in_seconds(fixed, _stamps(frames, how), how.reference, notes)
        fixed.matrices[:, :3, 3] *= MILLIMETRES[how.units]
        _require_rigid(fixed, how.reference)
        fixed = _of_each_frame(fixed, frames, how.time_offset, how.longest_gap, how.by_time, how.reference, notes)
        matrices = np.stack([np.linalg.inv(a) @ b if np.isfinite(a).all() else a for a, b in zip(fixed, matrices)])
    usable = _usable(matrices, source, notes)
    _require_size(matrices[usable], says_size, source)
    times = _times_of_frames(tracked, frames, usable, source, notes)
    return Sweep(np.ascontiguousarray(pixels[usable]), np.ascontiguousarray(matrices[usable]),
                 None if times is None else times[usable], notes)


def _stamps(frames: Images, how: Reading) -> Optional[np.ndarray]:
    """Times of the frames by the tracker's clock."""
    return None if frames.times is None else frames.times + how.time_offset


def _tracked(source: Path, frames: Images, how: Reading, notes: list) -> tuple:
    """(what a file tells of poses, the pose of each frame)."""
    tracked = read_poses(source, how.quaternion, how.dataset, how.scan)
    tracked.matrices[:, :3, 3] *= MILLIMETRES[how.units]
    if not how.inverse:  # of a probe all three axes count, so one that is turned round is an error
        mended, made = _with_third_columns(tracked.matrices, how.calibration is None and how.pixel_spacing is None, source)
        tracked = tracked._replace(matrices=mended)
        if made:
            notes.append(f"The third column of {made} of {len(mended)} poses is zero or points the other way. A picture has "
                         "two axes, so the first two were read and the third was made.")
    elif np.any(np.abs(np.linalg.det(tracked.matrices[:, :3, :3])) < 1e-12):
        row = int(np.argmax(np.abs(np.linalg.det(tracked.matrices[:, :3, :3])) < 1e-12))
        raise SourceError(f"{source}: row {row}: the matrix is singular, so it cannot be inverted")
    stamps = _stamps(frames, how)
    tracked = _placed(tracked, frames, how.by_time, source, notes)
    tracked = _in_seconds(tracked, stamps, source, notes)
    if stamps is None and tracked.frames is None and tracked.times is not None and len(tracked.times) > len(frames.pixels):
        said: list = []
        rows = _once_a_time(tracked, np.flatnonzero(np.isfinite(tracked.times)), source, said)
        if len(rows) == len(frames.pixels):  # pictures without times, and a tracker that logs some readings twice
            tracked = tracked._replace(matrices=tracked.matrices[rows], times=tracked.times[rows])
            notes += said
    matrices = _of_each_frame(tracked, frames, how.time_offset, how.longest_gap, how.by_time, source, notes)
    if how.inverse:
        matrices = np.stack([np.linalg.inv(matrix) if np.isfinite(matrix).all() else matrix for matrix in matrices])
    return tracked, matrices


def _image_to_probe(tracked: Poses, matrices: np.ndarray, frames: Images, how: Reading, source: Path, notes: list) -> tuple:
    """([4, 4] from a pixel to what the poses lead from, whether something but the poses says how large pixels are)."""
    image, counts_from_one, spacing = np.eye(4), False, how.pixel_spacing
    is_plain = spacing is None and how.calibration is None
    is_placed = is_plain and tracked.image is not None
    if is_placed:
        image = tracked.image
        notes.append("pixel_to_image of the file says where pixels lie in the probe's image.")
    elif is_plain and frames.spacing is not None and _is_rigid(matrices):
        spacing = frames.spacing
        notes.append(f"Pixels are {spacing[0]:.4g} x {spacing[1]:.4g} mm, by the file of the images.")
    if spacing is not None:
        image = np.diag([spacing[0], spacing[1], spacing[0], 1.0])
    if how.calibration is not None:
        matrix, counts_from_one = read_calibration(how.calibration)
        image = matrix @ image
    says_size = is_placed or spacing is not None or how.calibration is not None
    if says_size:
        _require_rigid(tracked, source)
    if how.first_pixel is not None:
        counts_from_one = bool(how.first_pixel)
    if counts_from_one:
        image = image @ _translation(1, 1)
        notes.append("The calibration counts pixels from 1; it was moved by one pixel.")
    return image @ _translation(-how.origin_pixel[0], -how.origin_pixel[1]), says_size


def _cropped(pixels: np.ndarray, crop: Sequence[int]) -> np.ndarray:
    left, top, width, height = crop
    if min(crop) < 0 or min(width, height) < 1 or left + width > pixels.shape[2] or top + height > pixels.shape[1]:
        raise ValueError(f"crop is {tuple(crop)} (column, row, columns, rows), but frames have {pixels.shape[2]} x "
                         f"{pixels.shape[1]} pixels")
    return pixels[:, top:top + height, left:left + width]


def _usable(matrices: np.ndarray, source: Path, notes: list) -> np.ndarray:
    """Which frames have a pose."""
    usable = np.isfinite(matrices).all(axis=(1, 2))
    if not usable.any():
        raise SourceError(f"{source}: no frame has a pose; status, times or empty cells leave none")
    if not usable.all():
        lost = np.flatnonzero(~usable)
        notes.append(f"{len(lost)} of {len(usable)} frames have no pose and are left out: "
                     f"{', '.join(map(str, lost[:8]))}{', ...' if len(lost) > 8 else ''}.")
    return usable


def _require_size(matrices: np.ndarray, says_size: bool, source: Path) -> None:
    """That something says how large pixels are, and that they may be of ultrasound."""
    sides = np.linalg.norm(matrices[:, :3, :2], axis=1)
    if not says_size and np.abs(sides - 1).max() < RIGID:
        raise SourceError(f"{source}: poses say nothing of a pixel's size; give a calibration or the pixel spacing (1 1 where "
                          "pixels are 1 mm)")
    if sides.min() < SMALLEST_PIXEL or sides.max() > LARGEST_PIXEL:
        raise SourceError(f"{source}: pixels would be {sides.min():.3g} to {sides.max():.3g} mm; {SMALLEST_PIXEL} to "
                          f"{LARGEST_PIXEL} mm is expected. Is the unit of the poses or the calibration another?")


def _is_rigid(matrices: np.ndarray) -> bool:
    known = matrices[np.isfinite(matrices).all(axis=(1, 2)), :3, :3]
    return len(known) > 0 and np.abs(np.swapaxes(known, 1, 2) @ known - np.eye(3)).max() < RIGID


def from_files(images: Path, poses: Optional[Path] = None, **options: Any) -> Any:
    """A sweep of images and poses in files of your own.

    images: .npy, .npz, .h5 (frames), a video, DICOM of many frames, .mha or .nrrd, a folder of pictures, or a .txt that
        lists them.
    poses: .csv or .txt (matrices, or positions and quaternions), .npy, .h5 (tforms), or .seq.mha of 3D Slicer; not given where
        images has them, too. Columns such as image and frame say which picture a row belongs to. Rows of zeros, empty cells, NaN, words or a status other than OK are frames without a pose.
    calibration: from a pixel to the probe, or from mm in the image where a pixel spacing is given: 16 numbers in a file,
        a Plus configuration with ImageToProbe, or calib_matrix.csv of TUS-REC, which counts pixels from 1.
    pixel_spacing: mm along i and j. Without it and without a calibration poses lead from pixels.
    origin_pixel: the pixel (i, j) that the calibration, or the pose, calls its origin.
    dataset: names of arrays in an HDF5 or .npz file, of images, of poses or of both, where they have other names than usual.
    scan: which one of an HDF5 file that holds several; of its name as much as no other has, or its number, from 0, where they
        lie in one array (scans, frames, height, width).
    first_pixel: what the calibration counts the first pixel as, 0 or 1; by default 0, and 1 for TUS-REC.
    reference: poses of a second tool, in which the sweep shall lie.
    units: of the positions, mm, cm or m.
    quaternion: its order where columns have no names, xyzw or wxyz.
    inverse: poses lead from the reference to the probe.
    crop: column, row, columns, rows of every frame that are the image, as in a screen capture.
    by_time: take poses at the frames' times even where there are as many poses as frames.
    time_offset: s, added to the frames' times to give the poses'.
    longest_gap: s, the most between two poses that are interpolated.

    Raises SourceError, a ValueError, that names file, field, what was found and what to do.
    """
    import warnings

    from .functions import sweep

    loaded = load(images, poses, **options)
    for note in loaded.notes:
        warnings.warn(note, RuntimeWarning, stacklevel=2)
    return sweep(loaded.pixels, loaded.poses, loaded.times)
