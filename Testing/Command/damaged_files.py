#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Damages files of every kind that bigus reads, at random, and gives each to a command that reads it; prints a table.

    damaged_files.py BIGUS [--files 4] [--seed 1]

--files counts those of a kind. Every run must succeed or refuse its file (exit code 2) with a message, within 10 s of the
processor and 64 MB of memory and 40 times the bytes of its inputs, leave nothing beside its output, show no control
character and never say that something was not foreseen. A file that is answered otherwise is written to the working
directory with its command, and the script fails.
"""
import argparse
import os
import pathlib
import random
import re
import resource
import subprocess
import sys
import tempfile

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "Support"), str(pathlib.Path(__file__).parent)]
import test_budget  # noqa: E402
from damage import damaged  # noqa: E402

SECONDS, ADDRESSES, MEGABYTE = 10, 4 << 30, 1 << 20
FRAMES, WIDTH, HEIGHT = 12, 24, 20
FAST = ["--no-auto", "--gaussians", 100, "--iterations", 4]
MARKUP = '{"@schema": "markups", "markups": [{"type": "%s", "coordinateSystem": "LPS", "center": [1.0, 2.0, 1.0], ' \
         '"orientation": [1, 0, 0, 0, 1, 0, 0, 0, 1], "size": [4.0, 3.0, 2.0]}]}'
TRANSFORM = ("#Insight Transform File V1.0\n#Transform 0\nTransform: Similarity3DTransform_double_3_3\n"
             "Parameters: 0.1 0.2 0.3 4 5 6 2\nFixedParameters: 0 0 0\n")
CONFIG = ('<PlusConfiguration><CoordinateDefinitions><Transform From="Image" To="Probe" '
          'Matrix="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/></CoordinateDefinitions></PlusConfiguration>')


class Kinds:
    """Sound files of every kind in a folder, and the commands that read each."""

    def __init__(self, bigus, folder):
        self.bigus, self.folder, self.out = bigus, folder, folder / "out"
        self.out.mkdir()
        self.sweep, self.field = folder / "sweep.mha", folder / "field.vtp"
        test_budget.write_sequence(self.sweep, FRAMES, WIDTH, HEIGHT)
        self.make("train", self.sweep, "-o", self.field, *FAST)
        self.kinds = {**self.sequences(), **self.fields(), **self.geometry()}

    def make(self, *words):
        subprocess.run([self.bigus, *map(str, words)], check=True, capture_output=True)

    def sequences(self):
        header, pixels = self.sweep.read_bytes().split(b"LOCAL\n", 1)
        self.make("convert", self.sweep, self.folder / "sweep.nrrd")
        nrrd, packed = (self.folder / "sweep.nrrd").read_bytes().split(b"\n\n", 1)
        (self.folder / "pixels.raw").write_bytes(pixels)
        (self.folder / "pixels.packed").write_bytes(packed)
        self.make("slice", self.field, "--poses", self.sweep, "-o", self.folder / "frame.png")
        pictures = sorted(self.folder.glob("frame_*.png"))
        poses = re.findall(r"ImageToReferenceTransform = (.*)", header.decode())
        columns = ",".join(f"m{row}{column}" for row in range(4) for column in range(4))
        table = f"image,timestamp,{columns}\n" + "".join(
            f"{picture.name},{0.1 * k},{pose.replace(' ', ',')}\n" for k, (picture, pose) in enumerate(zip(pictures, poses)))
        out = self.out / "out.vtp"
        read = [lambda path: ("info", path), lambda path: ("check", path),
                lambda path: ("train", path, "-o", out, *FAST, "--hold-out", 4),
                lambda path: ("poses", path, "-o", self.out / "out.csv"),
                lambda path: ("slice", self.field, "--poses", path, "--size", WIDTH, HEIGHT, "-o", self.out / "out.mha")]
        picture = pictures[0]
        self.make("voxelize", self.field, "-o", self.folder / "volume.mha", "--spacing", 1)
        volume = [lambda path: ("info", path),
                  lambda path: ("voxelize", self.field, "--like", path, "-o", self.out / "out.mha")]
        return {"a.mha": (header + b"LOCAL\n" + pixels, read), "a.mhd": (header + b"pixels.raw\n", read),
                "a.nrrd": (nrrd + b"\n\n" + packed, read), "a.nhdr": (nrrd + b"\ndata file: pixels.packed\n", read),
                "a.csv": (table.encode(), read),
                "a.png": (picture.read_bytes(), [lambda path: ("info", path), lambda path: ("metrics", path, picture)]),
                "volume.mha": ((self.folder / "volume.mha").read_bytes(), volume)}

    def fields(self):
        self.make("convert", self.field, self.folder / "field.ply")
        self.make("convert", self.field, self.folder / "a.pvtp", "--pieces", 2)
        read = [lambda path: ("info", path),
                lambda path: ("slice", path, "--poses", self.sweep, "-o", self.out / "out.mha"),
                lambda path: ("train", self.sweep, "--continue", path, "-o", self.out / "out.vtp", *FAST),
                lambda path: ("convert", path, self.out / "out.ply")]
        # A training that was stopped leaves its state. It goes on, or is refused.
        trains = ("train", self.sweep, "-o", self.out / "state.vtp", "--no-auto", "--gaussians", 100, "--iterations", 10**7)
        self.make(*trains, "--time-limit", 0.2)
        state = self.out / "state.vtp.checkpoint"
        kinds = {name: ((self.folder / source).read_bytes(), read)
                 for name, source in (("a.vtp", "field.vtp"), ("a.ply", "field.ply"), ("a.pvtp", "a.pvtp"))}
        kinds["out/state.vtp.checkpoint"] = (state.read_bytes(), [lambda _: (*trains, "--time-limit", 0.3, "--resume")])
        return kinds

    def geometry(self):
        apart = self.folder / "apart.mha"  # whose pixels a configuration leads to the probe
        apart.write_bytes(self.sweep.read_bytes().replace(b"ImageToReference", b"ProbeToReference"))
        configured = [lambda path: ("info", apart, "--config", path), lambda path: ("check", apart, "--config", path)]
        planes = [lambda path: ("slice", self.field, "--poses", path, "--size", 20, 20, "--spacing", 0.5, "-o",
                                self.out / "out.mha")]
        moves = [lambda path: ("convert", self.field, self.out / "out.vtp", "--transform", path), *planes]
        box = [lambda path: ("voxelize", self.field, "--region", path, "--spacing", 1, "-o", self.out / "out.mha")]
        tree = pathlib.Path(__file__).resolve().parents[1] / "Data" / "transform.h5"
        return {"plus.xml": (CONFIG.encode(), configured), "plane.mrk.json": ((MARKUP % "Plane").encode(), planes),
                "box.mrk.json": ((MARKUP % "ROI").encode(), box), "a.tfm": (TRANSFORM.encode(), moves),
                "a.h5": (tree.read_bytes(), moves)}


def limits():
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))


def wrong(code, said, seconds, memory, room, left):
    """What is wrong with a run; nothing where it is as promised."""
    if "not foreseen" in said:
        return "not foreseen"
    if seconds >= SECONDS:
        return f"took {seconds:.0f} s"
    # A field that is cut so short that it is taken for a sequence may not become a .ply.
    if code not in (0, 2) and not (code == 3 and "the name must end in" in said):
        return f"exit code {code}"
    if memory > room:
        return f"took {memory / MEGABYTE:.0f} MB"
    if code == 2 and "bigus: " not in said:
        return "no message"
    if re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", said):
        return "control characters"
    return f"left {left}" if code == 2 and left else ""


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("bigus")
    options.add_argument("--files", type=int, default=4)
    options.add_argument("--seed", type=int, default=1)
    options = options.parse_args()
    chance, faults, total = random.Random(options.seed), 0, 0
    print("| file | damaged | read | refused | at most | at most | wrong |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="bigus-damaged-") as name:
        kinds = Kinds(os.path.abspath(options.bigus), pathlib.Path(name))
        for file, (data, commands) in kinds.kinds.items():
            path, codes, longest, largest, bad = kinds.folder / file, [], 0, 0, 0
            for turn in range(-len(commands), options.files):  # first each command on the sound file
                for old in kinds.out.iterdir():
                    old.unlink()
                bytes_now = damaged(data, chance) if turn >= 0 else data
                path.write_bytes(bytes_now)
                words = [options.bigus, *map(str, commands[turn % len(commands)](path)), "--threads", "1"]
                with tempfile.TemporaryFile() as text:
                    process = subprocess.Popen(words, stdout=text, stderr=text, preexec_fn=limits)
                    _, status, usage = os.wait4(process.pid, 0)
                    process.returncode = os.waitstatus_to_exitcode(status)
                    text.seek(0)
                    said = text.read().decode(errors="backslashreplace")
                seconds, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024
                inputs = sum(other.stat().st_size for other in kinds.folder.iterdir() if other.is_file())
                left = sorted(os.listdir(kinds.out)) if path.parent != kinds.out else []
                fault = wrong(process.returncode, said, seconds, memory, 64 * MEGABYTE + 40 * inputs, left)
                if turn < 0 and (fault or process.returncode):
                    sys.exit(f"{words} fails on a sound file: {fault}\n{said}")
                if turn < 0:
                    continue
                codes.append(process.returncode)
                longest, largest, bad = max(longest, seconds), max(largest, memory), bad + bool(fault)
                if fault:
                    faults += 1
                    kept = pathlib.Path(f"fault-{faults}-{path.name}")
                    kept.write_bytes(bytes_now)
                    print(f"{kept}: {fault}: {' '.join(words)}\n{said}", file=sys.stderr)
            total += len(codes)
            print(f"| `{path.name}` | {len(codes)} | {codes.count(0)} | {codes.count(2)} | {longest:.1f} s "
                  f"| {largest / MEGABYTE:.0f} MB | {bad} |", flush=True)
    print(f"\n{total} damaged files, {faults} answered otherwise than promised")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
