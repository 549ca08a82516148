# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""bigus live from a user's shell, of a sequence that is replayed.

    test_replay.py PATH_TO_BIGUS [unittest arguments]
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "Testing" / "Command"))
import test_command
import test_metadata
from test_command import BAD_INPUT, CANNOT_WRITE, INTERRUPTED, SUCCESS, USAGE, run


class Replays(test_command.CommandTest):
    FRAMES = ["--frames", "24", "--width", "48", "--height", "40", "--pixel-size", "0.6", "--frame-spacing", "0.5"]

    def replay(self, *arguments):
        return run("live", self.folder / "sweep.igs.mha", "-o", self.folder / "field.vtp", "--rate", 60, "--finish", 1, *arguments)

    def setUp(self):
        super().setUp()
        self.assertEqual(run("phantom", "-o", self.folder / "sweep.igs.mha", *self.FRAMES).returncode, SUCCESS)

    def test_a_replayed_sweep_becomes_a_field_that_is_scored(self):
        result = self.replay("--hold-out", 4, "--json")
        self.assertEqual(result.returncode, SUCCESS, result.stderr)
        answer = json.loads(result.stdout)
        self.assertEqual((answer["frames"], answer["dropped"], answer["refused"], answer["passed_over"]), (18, 0, 0, 0))
        self.assertGreater(answer["seconds"], 23 / 60)
        self.assertGreater(answer["steps"], 0)
        self.assertGreater(answer["latency"]["slices"], 0)
        self.assertGreater(answer["held_out"]["psnr"], 15)
        info = json.loads(run("info", self.folder / "field.vtp", "--json").stdout)
        self.assertEqual(info["gaussians"], answer["gaussians"])

    def test_what_cannot_be_followed_is_said(self):
        few = self.folder / "few.igs.mha"
        run("phantom", "-o", few, *self.FRAMES[:1], 6, *self.FRAMES[2:])
        result = run("live", few, "-o", self.folder / "few.vtp", "--rate", 60, "--finish", 1)
        self.assertEqual(result.returncode, BAD_INPUT)
        self.assertIn("eighth frame", result.stderr)
        self.assertFalse(os.path.exists(self.folder / "few.vtp"))
        self.assertEqual(self.replay("--finish", 0).returncode, USAGE)
        self.assertEqual(run("live", self.folder / "sweep.igs.mha", "-o", self.folder / "no.xyz").returncode, CANNOT_WRITE)

    def test_ctrl_c_keeps_the_field_so_far(self):
        process = subprocess.Popen([test_command.BIGUS, "live", self.folder / "sweep.igs.mha", "-o", self.folder / "field.vtp", "--rate", "12",
                                    "--finish", "60"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        time.sleep(1.5)
        process.send_signal(signal.SIGINT)
        error = process.communicate(timeout=20)[1]
        self.assertEqual(process.returncode, INTERRUPTED, error)
        self.assertEqual(run("info", self.folder / "field.vtp").returncode, SUCCESS)

    def test_no_name_of_a_sequence_gets_into_the_field(self):
        named = test_metadata.Metadata
        named.setUpClass()
        self.addCleanup(named.tearDownClass)
        field = self.folder / "field.vtp"
        result = run("live", named.mha, "-o", field, "--rate", 100, "--finish", 0.5, "--json")
        self.assertEqual(result.returncode, SUCCESS, result.stderr)
        for data in (result.stdout.encode(), field.read_bytes()):
            self.assertEqual(test_metadata.names_in(data), set())


if __name__ == "__main__":
    test_command.BIGUS = test_metadata.BIGUS = os.path.abspath(sys.argv.pop(1))
    unittest.main()
