#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What a file may cost: memory at most 64 MB and 40 times its bytes, beside what is asked for, and time in proportion.

    test_budget.py PATH_TO_BIGUS [unittest arguments]

Each command runs on an input and on one ten times as large: ten times the frames, the pixels or the Gaussians. Time is
the processor's. Rows that are printed: the command, what is larger, seconds of both, MB of both and how many are allowed. In
proportion means less than 25 times as long, and a quarter of a second for the caprice of a busy
machine; what takes the square of the size takes 100 times as long.
"""
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile
import unittest

BIGUS = None
MEGABYTE = 1 << 20
LONGER, CAPRICE = 25, 0.25  # times, s
MOST_SECONDS = 120  # of the processor, of one command: what runs away ends


def write_sequence(path, frames, width, height, stray=(0, 0, 0), which=(), place=None, pixel=0.2):
    """Speckle at poses that a tracker made noisy, some of them so many mm away. place(k, noise): x, y, z of frame k."""
    noise = random.Random(7)
    lines = ["ObjectType = Image", "NDims = 3", "BinaryData = True", "BinaryDataByteOrderMSB = False",
             "CompressedData = False", f"DimSize = {width} {height} {frames}", "ElementSpacing = 1 1 1",
             "ElementType = MET_UCHAR"]
    for k in range(frames):
        x, y, z = (noise.gauss(0, 0.02) + (far if k in which else 0) for far in stray)
        x, y, z = place(k, noise) if place else (x, y, 0.2 * k + z)
        pose = f"{pixel} 0 0 {x:.5f} 0 {pixel} 0 {y:.5f} 0 0 {pixel} {z:.5f} 0 0 0 1"
        frame = f"Seq_Frame{k:04}_"
        lines += [f"{frame}ImageToReferenceTransform = {pose}", f"{frame}ImageToReferenceTransformStatus = OK",
                  f"{frame}Timestamp = {0.03 * k:.3f}"]
    header = "\n".join(lines + ["ElementDataFile = LOCAL\n"]).encode()
    path.write_bytes(header + noise.randbytes(frames * width * height))


def cost(*arguments):
    """Seconds of the processor, and bytes of memory at the peak."""
    process = subprocess.Popen([BIGUS, *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS)))
    said = process.stderr.read()
    process.stderr.close()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise AssertionError(f"{arguments}: {said.decode()}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


class Budget(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls._folder = tempfile.TemporaryDirectory()
        folder = cls.folder = pathlib.Path(cls._folder.name)
        cls.sequences = {}
        for name, size in {"one": (150, 48, 48), "frames": (1500, 48, 48), "pixels": (150, 152, 152),
                           "tiny": (1500, 8, 8), "tiny frames": (15000, 8, 8)}.items():
            cls.sequences[name] = folder / f"{name}.igs.mha"
            write_sequence(cls.sequences[name], *size)
        cls.fields = {"one": folder / "one.vtp", "gaussians": folder / "gaussians.vtp"}
        for name, gaussians in {"one": 6000, "gaussians": 60000}.items():
            cost("train", cls.sequences["frames"], "-o", cls.fields[name], "--no-auto", "--gaussians", gaussians,
                 "--iterations", 2, "--virtual-planes", 0)

    @classmethod
    def tearDownClass(cls):
        cls._folder.cleanup()

    def compare(self, inputs, larger, make, one="one", further=0):
        """`make` gives the arguments for an input; what it writes lies in self.folder. further: bytes that are allowed."""
        seconds, memory, allowed = {}, {}, {}
        for name in (one, larger):
            path = inputs[name]
            seconds[name], memory[name] = cost(*make(path))
            allowed[name] = 64 * MEGABYTE + 40 * path.stat().st_size + further
        print(f"| `{make(path)[0]}` | {larger} | {seconds[one]:.2f} | {seconds[larger]:.2f} "
              f"| {memory[one] / MEGABYTE:.0f} of {allowed[one] / MEGABYTE:.0f} "
              f"| {memory[larger] / MEGABYTE:.0f} of {allowed[larger] / MEGABYTE:.0f} |")
        for name in (one, larger):
            self.assertLess(memory[name], allowed[name], f"{make(inputs[name])}")
        self.assertLess(seconds[larger], LONGER * seconds[one] + CAPRICE, f"{make(path)}: {seconds}")

    def test_sequences(self):
        out = self.folder / "out"
        jobs = {"info": lambda path: ("info", path),
                "check": lambda path: ("check", path, "-o", f"{out}.png"),
                "poses": lambda path: ("poses", path, "-o", f"{out}.csv"),
                "convert": lambda path: ("convert", path, f"{out}.nrrd"),
                "metrics": lambda path: ("metrics", path, path)}
        for larger in ("frames", "pixels"):
            for name, make in jobs.items():
                with self.subTest(larger=larger, command=name):
                    self.compare(self.sequences, larger, make)

    def test_many_small_frames(self):
        for name, make in {"info": lambda path: ("info", path),
                           "poses": lambda path: ("poses", path, "-o", self.folder / "out.csv")}.items():
            with self.subTest(command=name):
                self.compare(self.sequences, "tiny frames", make, "tiny")

    def test_training(self):
        for larger in ("frames", "pixels"):
            with self.subTest(larger=larger):
                self.compare(self.sequences, larger,
                             lambda path: ("train", path, "-o", self.folder / "out.vtp", "--no-auto", "--gaussians",
                                           2000, "--iterations", 20, "--hold-out", 4))

    def test_stray_poses(self):
        sequences = {"one": self.sequences["one"]}
        for name, stray in {"along": (0, 0, 1e4), "far along": (0, 0, 1e8), "aside": (1e6, 1e6, 0)}.items():
            sequences[name] = self.folder / f"{name}.igs.mha"
            for which in ((70,), (71,), (3, 4, 71, 75)):  # the first is held out
                write_sequence(sequences[name], 150, 48, 48, stray, which)
                with self.subTest(stray=stray, which=which):
                    self.compare(sequences, name,
                                 lambda path: ("train", path, "-o", self.folder / "out.vtp", "--no-auto", "--gaussians",
                                               2000, "--iterations", 20, "--hold-out", 4, "--keep", "tracking"))

    def test_odd_paths(self):
        far = [0.0, 0.0, 0.0]

        def walk(_, noise):
            far[:] = (at + noise.gauss(0, 1) * 10 ** noise.uniform(-2, 4) for at in far)
            return far

        places = {"every other frame far away": lambda k, _: (0, 0, 0.2 * k + (1e4 if k % 2 else 0)),
                  "half of them": lambda k, _: (0 if k < 75 else 1e5, 0, 0.2 * k),
                  "ever longer steps": lambda k, _: (0, 0, 1e-3 * 1.2 ** k),
                  "a walk of all lengths": walk,
                  "two places in turn": lambda k, _: (0, 0, 30 * (k % 2)),
                  "jumps": lambda k, noise: (0, 0, 0.2 * k + (10 ** noise.uniform(1, 8) if noise.random() < 0.2 else 0)),
                  "far from zero": lambda k, _: (1e7, 1e7, 1e7 + 0.2 * k)}
        sequence = self.folder / "odd.igs.mha"
        for name, place in places.items():
            for pixel in (1e-4, 0.2):
                write_sequence(sequence, 150, 48, 48, place=place, pixel=pixel)
                with self.subTest(place=name, pixel=pixel):
                    for option, bytes_a_pixel in (("--auto", 0), ("--hold-out=4", 512)):
                        self.compare({"one": self.sequences["one"], "odd": sequence}, "odd",
                                     lambda path: ("train", path, "-o", self.folder / "out.vtp", "--gaussians", 500,
                                                   "--iterations", 20, option), further=bytes_a_pixel * 150 * 48 * 48)

    def test_fields(self):
        out, sweep = self.folder / "out", self.sequences["one"]
        jobs = {"info": lambda path: ("info", path),
                "convert": lambda path: ("convert", path, f"{out}.ply"),
                "slice": lambda path: ("slice", path, "--poses", sweep, "-o", f"{out}.mha"),
                "voxelize": lambda path: ("voxelize", path, "-o", f"{out}.mha", "--spacing", 2)}
        for name, make in jobs.items():
            with self.subTest(command=name):
                self.compare(self.fields, "gaussians", make)


if __name__ == "__main__":
    BIGUS = os.path.abspath(sys.argv.pop(1))
    unittest.main()
