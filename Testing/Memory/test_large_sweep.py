#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A sweep larger than the memory that training may use gives the same field, and no more than that stays resident.

    test_large_sweep.py BIGUS
"""
import os
import subprocess
import sys
import tempfile
import unittest
import zlib
from pathlib import Path

BIGUS = None
WIDTH, HEIGHT, FRAMES, DRAWN = 512, 512, 2400, 16  # 630 MB; so many frames are drawn, and repeated there and back
LIMIT = 0.3  # GB
OTHER = 0.12  # GB that may be resident beside it, for a moment or in the program itself


def write_sweep(path):
    """Raw, because nothing else can be written so fast."""
    drawn = path.with_name("drawn.igs.mha")
    subprocess.run([BIGUS, "phantom", "-o", drawn, "--frames", str(DRAWN), "--width", str(WIDTH), "--height", str(HEIGHT),
                    "--pixel-size", "0.1"], check=True, capture_output=True)
    header, data = drawn.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
    pixels = zlib.decompress(data) if b"CompressedData = True" in header else data
    frames = [pixels[k * WIDTH * HEIGHT:(k + 1) * WIDTH * HEIGHT] for k in range(DRAWN)]
    frames += frames[-2:0:-1]
    with path.open("wb") as file:
        file.write(f"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
                   f"CompressedData = False\nDimSize = {WIDTH} {HEIGHT} {FRAMES}\nElementSpacing = 1 1 1\n"
                   f"ElementType = MET_UCHAR\nUltrasoundImageOrientation = MF\n".encode())
        for k in range(FRAMES):
            file.write(f"Seq_Frame{k:04d}_ImageToReferenceTransform = 0.1 0 0 0 0 0.1 0 0 0 0 1 {0.3 * k!r} 0 0 0 1\n"
                       f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus = OK\n".encode())
        file.write(b"ElementDataFile = LOCAL\n")
        for k in range(FRAMES):
            file.write(frames[k % len(frames)])


class LargeSweep(unittest.TestCase):
    def train(self, sweep, field, *arguments):
        """Peak of resident memory, GB."""
        program = subprocess.Popen([BIGUS, "train", sweep, "-o", field, "--no-auto", "--virtual-planes", "0", "--gaussians",
                                    "3000", "--iterations", "12", "--no-baselines", "--checkpoint-interval", "0", "--threads",
                                    "2", "--json", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        program.stdout.read()
        message = program.stderr.read()
        program.stdout.close()
        program.stderr.close()
        _, status, usage = os.wait4(program.pid, 0)
        program.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(program.returncode, 0, message)
        return usage.ru_maxrss * 1024 / 1e9

    def test_the_field_is_the_same_and_memory_is_not_exceeded(self):
        with tempfile.TemporaryDirectory(dir="/var/tmp") as name:
            folder = Path(name)
            sweep = folder / "sweep.igs.mha"
            write_sweep(sweep)
            whole = self.train(sweep, folder / "whole.vtp")
            limited = self.train(sweep, folder / "limited.vtp", "--memory", str(LIMIT))
            print(f"peak of resident memory: {whole:.2f} GB without a limit, {limited:.2f} GB with {LIMIT} GB")
            self.assertEqual((folder / "limited.vtp").read_bytes(), (folder / "whole.vtp").read_bytes())
            self.assertGreater(whole, FRAMES * WIDTH * HEIGHT / 1e9)
            self.assertLess(limited, LIMIT + OTHER)


if __name__ == "__main__":
    BIGUS = sys.argv.pop(1)
    unittest.main(verbosity=2)
