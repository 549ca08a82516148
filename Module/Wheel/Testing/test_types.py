# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What mypy and pyright say of the lines that the pages tell to write. Skipped where neither is installed."""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

import bigus

ROOT = pathlib.Path(__file__).resolve().parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "Module/Documentation").glob("Start*.md"))]
PACKAGE = pathlib.Path(bigus.__file__).parents[1]
GIVEN = """
import bigus
import numpy as np
sweep = bigus.read_sweep("s.mha", to_frame="Tracker", ClipRectangle=(1, 2, 3, 4), config_file_name=None)
field = bigus.train([sweep], Gaussians=50000, hold_out=8, automatic=False, loss="l1", elevation_sigma=0.5, Seed=None).field
image = bigus.Slicer(field, engine="cpu").slice(np.eye(4), size=sweep.frames.shape[:0:-1], spacing=0.5)
phantom = bigus.Phantom(frames=3, PixelSize=0.2, probe="convex", calibration_shift=(0, 0, 1))
reslice = bigus.vtkBigusReslice(elevation_sigma=0.5)
reslice.SetElevationSigma(1.0)
reslice.elevation_sigma = 1.0
try:
    image = bigus.update(reslice).GetOutput()
except bigus.Error as error:
    print(error.args, bigus.TrainingInterrupted)
"""
WRONG = """
import bigus
sweep, field = bigus.read_sweep("s.mha"), bigus.read_field("f.vtp")
bigus.read_sweep("s.mha", to_farme="Tracker")
bigus.train(sweep, gausians=3)
bigus.train(sweep, hold_out=[4])
bigus.reslice(sweep, field)
bigus.Slicer(field, engin="cpu")
bigus.Phantom(frame=3)
bigus.tarin(sweep)
bigus.Error("wrong").text
"""
CHECKERS = {"mypy": ["-m", "mypy", "--no-error-summary", "--no-incremental", "--check-untyped-defs"],
            "pyright": ["-m", "pyright"]}  # fmt: skip


def pieces():
    """Every page's own lines of Python, as a program."""
    for page in PAGES:
        blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
        program = "\n".join(block for block in blocks if "vtkmodules" not in block)
        if "import bigus" in program:
            yield page.stem, program


class Types(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """What each checker says of all programs: by checker, and by program, the lines with an error and its text."""
        cls.programs = {**dict(pieces()), "given": GIVEN, "wrong": WRONG}
        cls.found = {}
        with tempfile.TemporaryDirectory() as folder:
            for name, text in cls.programs.items():
                pathlib.Path(folder, name + ".py").write_text(text)
            settings = {"extraPaths": [str(PACKAGE)], "reportMissingModuleSource": False}
            pathlib.Path(folder, "pyrightconfig.json").write_text(json.dumps(settings))
            for checker, words in CHECKERS.items():
                if subprocess.run([sys.executable, *words[:2], "--version"], capture_output=True).returncode != 0:
                    print(f"skipped: {checker} is not installed")
                    continue
                run = subprocess.run([sys.executable, *words, "."], cwd=folder, text=True, capture_output=True)
                if run.returncode not in (0, 1):
                    raise RuntimeError(run.stdout + run.stderr)
                lines = re.findall(r"(\w+)\.py:(\d+)(?::\d+)?(?: -|:) error: (.*)", run.stdout)
                own = cls.found[checker] = {name: {} for name in cls.programs}
                for name, line, text in lines:
                    if name in own and "import-untyped" not in text and "import-not-found" not in text and "reportMissingImports" not in text:
                        own[name][int(line)] = text
        if not cls.found:
            raise unittest.SkipTest("neither mypy nor pyright is installed")

    def test_the_pages_own_lines_pass(self):
        self.assertLess({"README", "StartPython", "StartBrowser"}, set(self.programs))
        for checker, found in self.found.items():
            for program in set(self.programs) - {"wrong"}:
                with self.subTest(checker=checker, program=program):
                    self.assertEqual(found[program], {})

    def test_what_is_wrong_is_an_error(self):
        for checker, found in self.found.items():
            with self.subTest(checker=checker):
                self.assertEqual(sorted(found["wrong"]), list(range(4, WRONG.count("\n") + 1)))


if __name__ == "__main__":
    unittest.main(verbosity=2)
