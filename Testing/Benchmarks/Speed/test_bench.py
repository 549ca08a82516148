#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""bigus-bench as a user's shell sees it.

    test_bench.py PATH_TO_BIGUS_BENCH [unittest arguments]
"""
import csv
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

BENCH = None
SUCCESS, USAGE, BAD_INPUT, CANNOT_WRITE = 0, 1, 2, 3
TINY = ["--quick", "--repeats", "1", "--share", "0.005"]


def run(*arguments):
    return subprocess.run([BENCH, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def instruction_sets():
    """Those of this machine, the best first, but the slow one that any machine has."""
    names = re.search(r"here: (.+?)\. A published", " ".join(run("--help").stdout.split())).group(1)
    return [name for name in names.split(", ") if name != "SCALAR"]


class Bench(unittest.TestCase):
    """What the answer holds and how exact pictures are; no test looks at a time."""
    RATIOS = {"render_vs_plain", "render_vs_slab_reslice", "train_pass_vs_torch", "backward_vs_forward",
              "field_2m_vs_140k", "second_core"}
    # On I: float sums and recurrences in float (Core/Engine/README.md), and the float that every picture is returned in.
    ROUNDING = {"float": 1e-5, "double": 1e-7}

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="bigus-bench-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def expect(self, code, *arguments):
        """Runs with --json: stdout must hold one object and nothing else. Gives the object."""
        result = run(*arguments, "--json")
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stderr}")
        answer = json.loads(result.stdout)
        if code != SUCCESS:
            self.assertTrue(answer["error"])
        return answer

    def test_everything(self):
        table = self.folder / "frontier.csv"
        answer = self.expect(SUCCESS, *TINY, "--csv", table)
        self.assertLessEqual({"ratios", "splat_ns", "pairs_per_second", "frontier", "machine"}, set(answer))
        self.assertEqual(set(answer["ratios"]), self.RATIOS)
        skipped = [check for check in answer["checks"] if "skipped" in check]
        for name, value in answer["ratios"].items():
            if value is None:  # without PyTorch, or on one core
                self.assertTrue(name == "train_pass_vs_torch" and skipped
                                or name == "second_core" and answer["machine"]["threads"] == 1, name)
            else:
                self.assertTrue(math.isfinite(value), name)
        for key in ("splat_ns", "pairs_per_second"):
            self.assertEqual(set(answer[key]), {"1", "1.5", "2.5", "4"})
        for key in ("device", "multiply_adds_per_second", "bytes_per_second"):
            self.assertTrue(answer["machine"][key], key)
        for timing in answer["timings"]:
            self.assertLessEqual(timing["min_ms"], timing["ms"])
            self.assertLessEqual(timing["ms"], timing["max_ms"])
        for key in ("training_bytes_per_gaussian", "bytes_per_frame_stored"):
            self.assertGreater(answer["memory"][key], 0)
        self.assertEqual(answer["memory"]["bytes_per_frame_stored"], 160 * 160)

        self.assertFrontier(answer)
        with open(table, newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), len(answer["frontier"]) + len(answer["frontier_plain"]))
        self.assertEqual(float(rows[0]["tolerance"]), answer["frontier"][0]["tolerance"])

    def assertFrontier(self, answer):
        keys = {"tolerance", "precision", "evaluation", "threads", "ms", "max", "rms", "p999"}
        seen = set()
        for point in answer["frontier"]:
            self.assertEqual(set(point), keys)
            seen.add((point["precision"], point["evaluation"], point["tolerance"]))
            self.assertLess(point["max"], point["tolerance"] + self.ROUNDING[point["precision"]])
            self.assertLessEqual(point["rms"], point["p999"])
            self.assertLessEqual(point["p999"], point["max"])
        self.assertEqual(seen, {(p, e, t) for p in ("float", "double") for e in ("recurrence", "direct")
                                for t in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)})

    def test_one_workload_and_one_instruction_set(self):
        answer = self.expect(SUCCESS, "frontier", *TINY, "--threads", 1)
        self.assertEqual(set(answer["ratios"]), self.RATIOS)
        self.assertEqual(set(answer["ratios"].values()), {None})
        self.assertEqual({point["threads"] for point in answer["frontier"]}, {1})
        self.assertFrontier(answer)
        worst = instruction_sets()[-1]
        answer = self.expect(SUCCESS, "evaluation", *TINY, "--simd", worst)
        self.assertIn(f"({worst},", answer["machine"]["device"])

    def test_errors(self):
        self.expect(USAGE, "speed")
        self.expect(USAGE, "--simd", "AVX9")
        self.expect(USAGE, "--repeats", 0)
        self.expect(CANNOT_WRITE, "frontier", *TINY, "--csv", self.folder / "no" / "f.csv")
        self.assertEqual(os.listdir(self.folder), [])

    def test_nothing_of_the_working_directory_runs(self):
        for name in ("torch.py", "numpy.py", "json.py"):
            (self.folder / name).write_text(f"open('{self.folder}/ran', 'w')\n")
        environment = {**os.environ, "PYTHONPATH": str(self.folder)}
        result = subprocess.run([BENCH, "train-pass", *TINY],
                                capture_output=True, cwd=self.folder, env=environment, timeout=300)
        self.assertEqual(result.returncode, SUCCESS, result.stderr)
        self.assertFalse((self.folder / "ran").exists())

    def test_without_a_temporary_folder(self):
        environment = {**os.environ, "TMPDIR": str(self.folder / "absent")}
        result = subprocess.run([BENCH, "train-pass", *TINY],
                                capture_output=True, env=environment, timeout=300)
        self.assertIn(result.returncode, (SUCCESS, BAD_INPUT), "success where PyTorch is missing")


if __name__ == "__main__":
    BENCH = os.path.abspath(sys.argv.pop(1))
    unittest.main()
