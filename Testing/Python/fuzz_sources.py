# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Damages images and poses of every kind that bigus.convert reads, at random, and reads them again.

    fuzz_sources.py [--executions 1500] [--seed 1]
    fuzz_sources.py --guided FOLDER [--executions 1500] [--seed 1]

Each damaged file must be read, or refused by SourceError in one line that names it (its folder, where a picture's size
is another; the poses, where numbers of frames differ), within 10 s of the processor and 64 MB more memory than
the program had before, 4 GB of addresses. What is damaged is bytes (changed, cut out, doubled, cut off) and numbers
(replaced by such as 1e308, -1 and 2^63). A file that is answered otherwise is written to the working directory. Kinds whose
package is not there are left out, and named. Sequences (.mha, .nrrd) have fuzz targets of their own.

--guided lets libFuzzer (the package atheris) choose what is damaged, by the lines of ours that it reaches. FOLDER keeps the
inputs that reached new ones: the number of the kind in a byte, then the file's bytes.
"""
import argparse
import io
import itertools
import pathlib
import random
import resource
import sys
import tempfile
import time
import traceback
import warnings

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "Module" / "Python" / "bigus"), str(ROOT / "Testing" / "Support")]
if "--guided" in sys.argv:
    import atheris

    with atheris.instrument_imports(include=["sources"]):
        import sources
else:
    import sources  # noqa: E402
from damage import damaged  # noqa: E402

FRAMES, HEIGHT, WIDTH = 5, 6, 8
SECONDS, BYTES, ADDRESSES = 10, 64 << 20, 4 << 30


def poses():
    all_poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    all_poses[:, 2, 3] = 0.5 * np.arange(FRAMES)
    return all_poses


def arrays(save):
    stream = io.BytesIO()
    save(stream)
    return stream.getvalue()


def images_of_every_kind(folder):
    """Names and bytes of files of images, and of those that need a package the kinds that were left out."""
    pixels = np.random.default_rng(1).integers(0, 256, (FRAMES, HEIGHT, WIDTH)).astype(np.uint8)
    files = {"images.npy": arrays(lambda stream: np.save(stream, pixels)),
             "images.npz": arrays(lambda stream: np.savez_compressed(stream, images=pixels))}
    missing = []
    try:
        import h5py

        with h5py.File(folder / "whole.h5", "w") as file:
            file["frames"] = pixels
        files["images.h5"] = (folder / "whole.h5").read_bytes()
    except ImportError:
        missing.append("HDF5")
    try:
        files["images.dcm"] = dicom_of(pixels)
    except ImportError:
        missing.append("DICOM")
    try:
        files["images.avi"] = video_of(pixels, folder / "whole.avi")
        files |= pictures_of(pixels, folder)
    except ImportError:
        missing += ["video", "pictures"]
    return files, missing


def pictures_of(pixels, folder):
    """One picture of each kind amid sound ones in a folder of its own, and a list of pictures; by their paths."""
    import cv2

    files = {}
    for kind in ("png", "jpg", "bmp", "tif"):
        (folder / kind).mkdir()
        for k, image in enumerate(pixels):
            cv2.imwrite(str(folder / kind / f"frame_{k}.{kind}"), image)
        files[f"{kind}/frame_2.{kind}"] = (folder / kind / f"frame_2.{kind}").read_bytes()
    return files | {"list.txt": "".join(f"png/frame_{k}.png\n" for k in range(FRAMES)).encode()}


def dicom_of(pixels):
    import pydicom
    from pydicom.dataset import FileDataset, FileMetaDataset

    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = pydicom.uid.UltrasoundMultiFrameImageStorage
    meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid(entropy_srcs=["the same bytes every time"])
    meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    data = FileDataset("images.dcm", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
    data.NumberOfFrames, data.Rows, data.Columns = pixels.shape
    data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
    data.BitsAllocated = data.BitsStored = 8
    data.HighBit, data.PixelRepresentation = 7, 0
    data.FrameTime, data.PixelData = 50.0, pixels.tobytes()
    return arrays(data.save_as)


def video_of(pixels, path):
    import cv2

    large = np.kron(pixels, np.ones((1, 8, 8), np.uint8))  # coders ask for some pixels
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 20, large.shape[:0:-1])
    for image in large:
        writer.write(np.repeat(image[..., np.newaxis], 3, axis=2))
    writer.release()
    return path.read_bytes()


def poses_of_every_kind():
    names = ",".join(f"m{row}{column}" for row in range(4) for column in range(4))
    rows = [",".join(map(repr, pose.ravel())) for pose in poses()]
    sequence = "".join(f"Seq_Frame{k:04}_ProbeToTrackerTransform = {' '.join(map(str, pose.ravel()))}\n"
                       f"Seq_Frame{k:04}_Timestamp = {0.1 * k}\n" for k, pose in enumerate(poses()))
    quaternions = "".join(f"{0.1 * k};{0};{0};{0.5 * k};0;0;0;1\n" for k in range(FRAMES))
    return {"poses.csv": f"frame,time,{names}\n".encode() + "".join(
                f"{k},{0.1 * k},{row}\n" for k, row in enumerate(rows)).encode(),
            "plain.txt": ("\n".join(row.replace(",", " ") for row in rows) + "\n").encode(),
            "quaternions.csv": b"time;x;y;z;qx;qy;qz;qw\n" + quaternions.encode(),
            "poses.npy": arrays(lambda stream: np.save(stream, poses())),
            "poses.seq.mha": ("NDims = 3\n" + sequence + "ElementDataFile = LOCAL\n").encode()}


def answer(folder, file, damage=None):
    """What is wrong with the answer to one damaged file amid sound ones; nothing where it is as promised."""
    path = folder / file
    sound = path.read_bytes()
    path.write_bytes(sound if damage is None else damage)
    images, trajectory = (folder / "images.npy", path) if file in poses_of_every_kind() else (path, folder / "poses.csv")
    if "/" in file:  # a picture amid others
        images = path.parent
    pathlib.Path("/proc/self/clear_refs").write_text("5")  # the most memory is that from now on
    start, before = time.process_time(), most_memory()
    try:
        sources.load(images, trajectory, pixel_spacing=(0.2, 0.2))
    except sources.SourceError as error:
        if not any(name in str(error) for name in (path.name, images.name, trajectory.name)):
            return f"does not name the file: {error}"
    except Exception:
        return traceback.format_exc()
    finally:
        path.write_bytes(sound)
    seconds, memory = time.process_time() - start, most_memory() - before
    if damage is not None and memory > BYTES:  # reading the first sound one imports its package
        return f"took {memory >> 20} MB"
    return f"took {seconds:.1f} s" if seconds > SECONDS else ""


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--executions", type=int, default=1500)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--guided", type=pathlib.Path, metavar="FOLDER")
    options = options.parse_args()
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        files, missing = images_of_every_kind(folder)
        files |= poses_of_every_kind()
        for file, data in files.items():
            (folder / file).write_bytes(data)
        for file in files:
            if wrong := answer(folder, file):
                sys.exit(f"{file} is not read though it is sound: {wrong}")
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
        if options.guided:
            return guided(folder, files, options)
        faults = at_random(folder, files, options)
    left_out = f"; left out: {', '.join(missing)}" if missing else ""
    print(f"{options.executions} damaged files of {len(files)} kinds, {faults} faults{left_out}")
    return 1 if faults else 0


def at_random(folder, files, options):
    """How many damaged files are answered otherwise than promised; each is written to the working directory."""
    chance, faults = random.Random(options.seed), 0
    for file in itertools.islice(itertools.cycle(files), options.executions):
        damage = damaged(files[file], chance)
        if wrong := answer(folder, file, damage):
            faults += 1
            fault = f"fault-{faults}-{pathlib.Path(file).name}"
            pathlib.Path(fault).write_bytes(damage)
            print(f"{fault}: {wrong}")
    return faults


def guided(folder, files, options):
    """Does not return: libFuzzer ends the program, with an input in the working directory where one is a fault."""
    options.guided.mkdir(parents=True, exist_ok=True)
    names = list(files)
    for k, file in enumerate(names):
        (options.guided / f"sound-{k}").write_bytes(bytes([k]) + files[file])

    def once(data):
        if wrong := data and answer(folder, names[data[0] % len(names)], data[1:]):
            raise RuntimeError(wrong)

    atheris.Setup([sys.argv[0], str(options.guided), f"-runs={options.executions}", f"-seed={options.seed}",
                   f"-timeout={6 * SECONDS}", "-rss_limit_mb=0", "-max_len=65536"], once)
    atheris.Fuzz()


def most_memory():
    """The most bytes of memory that the program has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss << 10


if __name__ == "__main__":
    sys.exit(main())
