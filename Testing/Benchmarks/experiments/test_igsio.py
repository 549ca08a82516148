#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Does igsio.py give a reconstructor the right frames and settings, and cut its volume where the held-out frames lie?

    test_igsio.py BIGUS [unittest options]

A stand-in for the reconstructor writes a volume whose voxels are known in closed form.
"""

import json
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from xml.etree import ElementTree

import bigus
import igsio
import numpy as np

BIGUS = sys.argv.pop(1) if len(sys.argv) > 1 else "build/bin/bigus"

# Notes what it was given, and writes a volume with the brightness 20 + x + 2 y + 3 z, which is linear between voxels.
STAND_IN = """#!{python}
import json, shutil, sys
import numpy as np
options = dict(argument.lstrip("-").split("=", 1) for argument in sys.argv[1:] if "=" in argument)
for name, to in (("source-seq-file", "frames.igs.mha"), ("config-file", "settings.xml")):
    shutil.copy(options[name], "{folder}/" + to)
z, y, x = np.mgrid[-12:13, -12:13, -12:13] * 1.0
voxels = (128 + x + 2 * y + 3 * z).astype(np.uint8)
with open(options["output-volume-file"], "wb") as file:
    file.write(b"ObjectType = Image\\nNDims = 3\\nBinaryData = True\\nBinaryDataByteOrderMSB = False\\n"
               b"CompressedData = False\\nOffset = -12 -12 -12\\nElementSpacing = 1 1 1\\nDimSize = 25 25 25\\n"
               b"ElementType = MET_UCHAR\\nElementDataFile = LOCAL\\n" + voxels.tobytes())
"""


def write_sweep(path):
    """Eight frames of 24 x 20 pixels that show that same brightness, turned by 30 degrees about x; a dark border."""
    turn = np.deg2rad(30)
    frames, poses = np.zeros((8, 20, 24), np.uint8), np.tile(np.eye(4), (8, 1, 1))
    for k, pose in enumerate(poses):
        pose[:3, 0] = (0.5, 0, 0)
        pose[:3, 1] = (0, 0.5 * np.cos(turn), 0.5 * np.sin(turn))
        pose[:3, 2] = (0, -np.sin(turn), np.cos(turn))
        pose[:3, 3] = (-6, -5, k - 4)
        row, column = np.mgrid[0:20, 0:24]
        world = np.stack([column, row, 0 * row, 1 + 0 * row], -1) @ pose.T
        frames[k, 1:-1, 2:-2] = np.rint(128 + world @ (1, 2, 3, 0))[1:-1, 2:-2]
    bigus.write(bigus.sweep(frames, poses, timestamps=np.arange(8) / 10), path)


class TestIgsio(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.folder = Path(scratch.name)
        self.sweep = self.folder / "sweep.igs.mha"
        write_sweep(self.sweep)
        self.program = self.folder / "stand-in"
        self.program.write_text(STAND_IN.format(python=sys.executable, folder=self.folder))
        self.program.chmod(0o755)

    def answer(self, *options):
        done = subprocess.run([sys.executable, igsio.__file__, self.sweep, "--program", self.program, "--hold-out", "4",
                               "--bigus", BIGUS, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def test_the_volume_is_cut_where_the_held_out_frames_lie(self):
        answer = self.answer()
        self.assertEqual(answer["held_out"], 2)
        # Only the frames' whole numbers differ from the volume: errors of at most half a step, root mean square 0.29.
        self.assertGreater(answer["psnr"], 20 * np.log10(255 / 0.5))
        self.assertGreater(answer["ssim"], 0.99)

    def test_only_the_other_frames_are_given_and_the_dark_border_is_clipped(self):
        self.answer("--voxel", "0.3")
        given = bigus.frames(bigus.read_sweep(self.folder / "frames.igs.mha"))
        np.testing.assert_array_equal(given, bigus.frames(bigus.read_sweep(self.sweep))[[0, 1, 3, 4, 5, 7]])
        settings = ElementTree.parse(self.folder / "settings.xml").find("VolumeReconstruction")
        self.assertEqual(settings.get("OutputSpacing"), "0.3 0.3 0.3")
        self.assertEqual(settings.get("ClipRectangleOrigin"), "2 1")
        # Below a lit pixel all pixels of its column belong to the lit area.
        self.assertEqual(settings.get("ClipRectangleSize").split()[0], "20")
        self.assertEqual(settings.find("HoleFilling/HoleFillingElement").get("StickLengthLimit"), "15")

    def test_as_its_users_find_it_no_hole_is_filled(self):
        self.answer("--found")
        settings = ElementTree.parse(self.folder / "settings.xml").find("VolumeReconstruction")
        self.assertEqual((settings.get("CompoundingMode"), settings.get("FillHoles")), ("MAXIMUM", "OFF"))
        self.assertIsNone(settings.find("HoleFilling"))

    def test_a_reconstructor_that_fails_is_quoted(self):
        self.program.write_text("#!/bin/sh\necho no such mode\nexit 3\n")
        done = subprocess.run([sys.executable, igsio.__file__, self.sweep, "--program", self.program, "--hold-out", "4",
                               "--bigus", BIGUS], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("ended with 3", done.stderr)
        self.assertIn("no such mode", done.stderr)


if __name__ == "__main__":
    unittest.main()
