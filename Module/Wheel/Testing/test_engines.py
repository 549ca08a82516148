# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The CUDA engine beside the package without VTK: found, loaded and used, or one line that says why not.

BIGUS_LIBRARIES names the folder of libBIGUSCore where that is not the package's own, as in a build tree, and
BIGUS_EMULATED_LIBRARY a library that computes by an emulation of CUDA.
"""

import ctypes
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import bigus
import numpy as np

CORE = "libBIGUSCore.so.1"
CUDA = "libBIGUSCuda.so.1"
LIBRARIES = pathlib.Path(os.environ.get("BIGUS_LIBRARIES") or pathlib.Path(bigus.__file__).parent)
EMULATED = os.environ.get("BIGUS_EMULATED_LIBRARY")
TELL = """
import json, bigus
print(json.dumps([bigus.engines(), dict(bigus.missing_engines())]))
"""
COMPUTE = """
import json, sys, bigus, numpy as np
sweep = bigus.Phantom(frames=12, width=32, height=32, pixel_size=0.8).sweep()
training = bigus.train(sweep, False, Automatic=False, Iterations=20, Gaussians=300, Engine="cuda")
engines = ("cpu", "cuda", "auto")
slices = [bigus.Slicer(training.field, Engine=engine).slice(sweep.poses[5], (32, 32)) for engine in engines]
np.save(sys.argv[1], slices)
print(json.dumps(bigus.Slicer(training.field).device))
"""


class Beside(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        package = pathlib.Path(bigus.__file__).parent
        self.beside = pathlib.Path(self.folder.name, "bigus")
        shutil.copytree(package, self.beside, ignore=shutil.ignore_patterns(CUDA, "__pycache__"))
        shutil.copy(LIBRARIES / CORE, self.beside)
        bundled = package.with_name("bigus.libs")  # what a wheel brings along
        if bundled.exists():
            shutil.copytree(bundled, self.beside.with_name(bundled.name))

    def run_beside(self, script, *arguments):
        """The script's JSON, from a copy of the package with Core in it."""
        result = subprocess.run([sys.executable, "-c", script, *map(str, arguments)], capture_output=True, text=True,
                                cwd=self.folder.name, env={**os.environ, "PYTHONPATH": self.folder.name,
                                                           "LD_LIBRARY_PATH": str(self.beside)})  # fmt: skip
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def test_without_one_the_cpu_computes(self):
        engines, missing = self.run_beside(TELL)
        self.assertEqual(engines[0], "cpu")
        self.assertEqual(missing, {"cuda": "this build has no CUDA engine"})

    def test_what_is_no_library_is_said(self):
        (self.beside / CUDA).write_text("not a library")
        engines, missing = self.run_beside(TELL)
        self.assertEqual(engines[0], "cpu")
        self.assertRegex(missing["cuda"], f"{CUDA}.*file too short|{CUDA}.*invalid ELF header")

    @unittest.skipUnless(EMULATED, "BIGUS_EMULATED_LIBRARY does not name the emulated engine")
    def test_an_engine_is_found_and_preferred(self):
        shutil.copy(EMULATED, self.beside / CUDA)
        engines, missing = self.run_beside(TELL)
        self.assertEqual((engines[0], missing), ("cuda", {}))
        device = self.run_beside(COMPUTE, self.beside / "slices.npy")
        self.assertIn("emulat", device.lower())
        cpu, cuda, auto = np.load(self.beside / "slices.npy")
        self.assertGreater(cpu.std(), 0.02)
        self.assertLess(np.abs(cuda - cpu).max(), 2e-4)  # each is within 1e-4 of the model
        np.testing.assert_array_equal(auto, cuda)

    @unittest.skipUnless(EMULATED, "BIGUS_EMULATED_LIBRARY does not name the emulated engine")
    def test_another_version_is_refused(self):
        tell = ctypes.CDLL(EMULATED).bigusCudaEngine
        tell.restype = ctypes.c_char_p
        reason = tell(b"9.9", None).decode()
        self.assertIn("9.9", reason)
        self.assertIn(bigus.__version__, reason)


@unittest.skipUnless((LIBRARIES / CUDA).exists(), f"this package was built without nvcc, so it has no {CUDA}")
class WithoutADevice(unittest.TestCase):
    def test_one_line_says_why(self):
        if "cuda" in bigus.engines():
            self.skipTest("there is a device")
        reason = dict(bigus.missing_engines())["cuda"]
        self.assertRegex(reason, "^(there is no NVIDIA driver, or one too old for CUDA [0-9.]+|there is no CUDA device|"
                                 "the CUDA device does not start: .*)$")  # fmt: skip
        field = bigus.field([(2, 3, 0.2)], [(0.5, 0.8, 1.1)], [1.5])
        with self.assertRaises(bigus.Error) as caught:
            bigus.Slicer(field, Engine="cuda")
        self.assertEqual(str(caught.exception).count("\n"), 0)
        self.assertIn(reason, str(caught.exception))
        self.assertGreater(bigus.Slicer(field).slice(np.eye(4), (8, 8)).max(), 0.1)  # "auto" computes on the CPU


if __name__ == "__main__":
    unittest.main(verbosity=2)
