# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The command of the package without VTK. BIGUS_PROGRAM names that of the C++ build: then both give the same."""

import importlib.util
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

import bigus
import numpy as np

QUICK = ("--no-auto", "--iterations", "40", "--gaussians", "1500", "--hold-out", "4")


class Command(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.sweep = bigus.Phantom(frames=24, width=64, height=64, pixel_size=0.4).sweep()
        bigus.write(cls.sweep, cls.folder / "s.igs.mha")
        run = cls.run_words("train", "s.igs.mha", "-o", "f.vtp", *QUICK, "--json")
        cls.trained = json.loads(run.stdout)

    @classmethod
    def run_words(cls, *words, program=(sys.executable, "-m", "bigus")):
        return subprocess.run([*program, *words], cwd=cls.folder, text=True, capture_output=True)

    def fails(self, code, text, *words):
        run = self.run_words(*words)
        self.assertEqual(run.returncode, code, run.stderr)
        self.assertIn(text, run.stderr)
        self.assertNotIn("Traceback", run.stderr)

    def test_info_and_check(self):
        facts = json.loads(self.run_words("info", "s.igs.mha", "--json").stdout)
        self.assertEqual((facts["frames"], facts["width"], facts["height"]), (24, 64, 64))
        np.testing.assert_allclose(facts["pixel_mm"], 0.4, rtol=1e-6)
        self.assertIn(f"gaussians           {self.trained['gaussians']}", self.run_words("info", "f.vtp").stdout)
        self.assertIn("cpu", self.run_words("info", "--devices").stdout)
        self.assertIn("24 usable frames, nothing is wrong", self.run_words("check", "s.igs.mha").stdout)
        frames = np.array(self.sweep.frames)
        frames[4] = 0
        bigus.write(bigus.sweep(frames, self.sweep.poses), self.folder / "black.igs.mha")
        self.assertIn("1 frame (4)", self.run_words("check", "black.igs.mha").stdout)

    def test_trains_and_scores_as_the_functions_do(self):
        training = bigus.train(bigus.read_sweep(self.folder / "s.igs.mha"), False, automatic=False, iterations=40,
                               gaussians=1500, hold_out=4)
        field = bigus.read_field(self.folder / "f.vtp")
        np.testing.assert_array_equal(field.centers, training.field.rounded().centers)
        self.assertEqual(self.trained["held_out"]["frames"], 6)
        frame = self.sweep.frames[2]
        self.assertGreater(bigus.metrics(bigus.reslice(field, training.poses[2], (64, 64)), frame)["psnr"], 15)

    @unittest.skipUnless(os.environ.get("BIGUS_PROGRAM"), "BIGUS_PROGRAM does not name the program")
    def test_scores_as_the_program(self):
        program = [os.environ["BIGUS_PROGRAM"]]
        theirs = json.loads(self.run_words("train", "s.igs.mha", "-o", "p.vtp", *QUICK, "--json", program=program).stdout)
        for name in ("psnr", "ssim"):
            self.assertAlmostEqual(self.trained["held_out"][name], theirs["held_out"][name], 2)
        fields = [bigus.read_field(self.folder / name) for name in ("f.vtp", "p.vtp")]
        np.testing.assert_array_equal(fields[0].centers, fields[1].centers)

    def test_slices_to_pictures_and_sequences(self):
        field = bigus.read_field(self.folder / "f.vtp")
        expected = np.floor(255 * bigus.Slicer(field).slice(self.sweep.poses, (64, 64)) + np.float32(0.5))
        self.run_words("slice", "f.vtp", "--poses", "s.igs.mha", "-o", "again.igs.mha", "--spacing", "0.8", "--size", "32", "20")
        again = bigus.read_sweep(self.folder / "again.igs.mha")
        self.assertEqual(again.frames.shape, (24, 20, 32))
        np.testing.assert_allclose(np.linalg.norm(again.poses[:, :3, :2], axis=1), 0.8, rtol=1e-6)
        self.run_words("slice", "f.vtp", "--poses", "s.igs.mha", "-o", "p.png")
        data = (self.folder / "p_003.png").read_bytes()
        start, end = data.index(b"IDAT") + 4, data.index(b"IEND") - 8  # checksum and length stand between
        rows = np.frombuffer(zlib.decompress(data[start:end]), np.uint8).reshape(64, 65)
        np.testing.assert_array_equal(rows[:, 1:], expected[3])
        pose = np.eye(4)
        pose[:3, 3] = 999
        far = bigus.sweep(np.zeros((1, 8, 8), np.uint8), pose[None])
        bigus.write(far, self.folder / "far.igs.mha")
        run = self.run_words("slice", "f.vtp", "--poses", "far.igs.mha", "-o", "far.png")
        self.assertEqual(run.returncode, 0)
        self.assertIn("do not meet the field", run.stderr)

    def test_slices_have_their_standard_error(self):
        field = bigus.read_field(self.folder / "f.vtp")
        words = ("slice", "f.vtp", "--poses", "s.igs.mha", "-o", "i.mha", "--elevation-sigma", "0.6", "--standard-error")
        self.assertEqual(self.run_words(*words, "e.mha").returncode, 0)
        sigma, _ = bigus.read_stack(self.folder / "e.mha")
        self.assertEqual((sigma.dtype, sigma.shape), (np.float32, (24, 64, 64)))
        # A frame that was not trained on is as far from the slice as it says.
        errors = (bigus.reslice(field, self.sweep.poses[6], (64, 64), elevation_sigma=0.6) - self.sweep.frames[6] / 255)
        known = np.isfinite(sigma[6])
        self.assertGreater(known.mean(), 0.9)
        self.assertTrue(0.85 < np.mean(np.abs(errors)[known] <= 2 * sigma[6][known]) < 0.995)
        self.assertTrue(np.isnan(sigma[-1]).any(), "before the first frame and behind the last nothing is known")
        self.fails(3, ".mha", *words, "e.png")
        self.fails(3, "the other output", *words, "./i.mha")
        self.run_words("train", "s.igs.mha", "-o", "unsure.vtp", *QUICK, "--no-standard-error")
        unsure = ("slice", "unsure.vtp", *words[2:], "e.mha")
        self.fails(2, "--standard-error: unsure.vtp does not hold what it rests on; train it again", *unsure)
        if not os.environ.get("BIGUS_PROGRAM"):
            return
        program = [os.environ["BIGUS_PROGRAM"]]
        self.assertEqual(self.run_words(*words, "p.mha", program=program).returncode, 0)
        self.assertEqual((self.folder / "p.mha").read_bytes(), (self.folder / "e.mha").read_bytes())
        said = [self.run_words(*unsure, **how).stderr.split("--standard-error")[1] for how in ({}, {"program": program})]
        self.assertEqual(*said)

    def test_converts_fields_and_files_of_your_own(self):
        self.assertEqual(self.run_words("convert", "f.vtp", "f.ply").returncode, 0)
        self.assertEqual(len(bigus.read_field(self.folder / "f.ply")), self.trained["gaussians"])
        np.save(self.folder / "images.npy", self.sweep.frames)
        np.save(self.folder / "poses.npy", self.sweep.poses)
        self.run_words("convert", "images.npy", "poses.npy", "-o", "own.igs.mha")
        np.testing.assert_array_equal(bigus.read_sweep(self.folder / "own.igs.mha").frames, self.sweep.frames)

    def test_exit_codes_are_the_programs(self):
        self.fails(1, "did you mean --gaussians", "train", "s.igs.mha", "-o", "g.vtp", "--gausians", "3")
        self.fails(1, "COMMAND", "tarin")
        self.fails(1, "--output", "convert", "images.npy")
        if importlib.util.find_spec("bigus.serve"):
            self.fails(1, "required", "serve")
        self.fails(2, "there is no such file", "info", "no.mha")
        self.fails(1, "gaussians is -3; it must be 1 to 67108864", "train", "s.igs.mha", "-o", "g.vtp", "--gaussians", "-3")
        self.fails(3, ".vtp, .ply", "train", "s.igs.mha", "-o", "g.obj")
        self.fails(3, "cannot be written", "train", "s.igs.mha", "-o", "no/g.vtp")
        self.fails(3, "an input, too", "convert", "f.vtp", "f.vtp")
        run = self.run_words("info", "no.mha", "--json")
        self.assertEqual(json.loads(run.stdout)["exit_code"], 2)
        self.assertEqual(self.run_words().returncode, 0)

    def test_the_script_of_the_wheel_is_the_module(self):
        script = pathlib.Path(sys.executable).with_name("bigus")
        if not script.exists():
            self.skipTest("the wheel is not installed beside this Python")
        self.assertEqual(self.run_words("--version", program=[str(script)]).stdout, self.run_words("--version").stdout)

    def test_help_tells_units_and_ranges(self):
        text = " ".join(self.run_words("train", "--help").stdout.split())
        for option in bigus.options():
            self.assertIn("--" + option["keyword"].replace("_", "-"), text)
        self.assertIn("(mm). 0 to 1000", text)

    def test_ctrl_c_keeps_the_best_so_far(self):
        words = [sys.executable, "-m", "bigus", "train", "s.igs.mha", "-o", "best.vtp", "--iterations", "1000000", "--no-auto",
                 "--json"]
        process = subprocess.Popen(words, cwd=self.folder, stdout=subprocess.PIPE, text=True)
        time.sleep(4)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 130)
        self.assertTrue(json.loads(output)["interrupted"])
        self.assertGreater(len(bigus.read_field(self.folder / "best.vtp")), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
