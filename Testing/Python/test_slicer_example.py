# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The logic of Examples/Slicer without Slicer, beside the program; and with the classes of Slicer's scene.

    test_slicer_example.py BIGUS FIELD

$BIGUS_SLICER_PYTHON may name a Python that has slicer-core of PyPI. It then writes markups and transforms, which the
program reads, and shows a slice through the logic, which must lie where the plane lies. Where the wheel is installed in it,
too, the slice must be the program's.
"""
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "Examples" / "Slicer"))
import BigusPlane  # noqa: E402

LPS = np.diag([-1.0, -1, 1, 1])


def read_volume(path):
    """(pose [4, 4] in RAS, pixels [height, width]) of a slice that `bigus slice --volume` wrote as NRRD, by hand."""
    header, pixels = pathlib.Path(path).read_bytes().split(b"\n\n", 1)
    fields = dict(line.split(": ", 1) for line in header.decode().splitlines()[1:])
    assert fields["space"] == "left-posterior-superior"
    pose = np.eye(4)
    pose[:3, :3] = np.array([eval(word) for word in fields["space directions"].split(" ")]).T
    pose[:3, 3] = eval(fields["space origin"])
    width, height, depth = map(int, fields["sizes"].split())
    kind = {"uint8": np.uint8, "float": np.float32}[fields["type"]]
    return LPS @ pose, np.frombuffer(pixels, kind).reshape(depth, height, width)[0]


def bigus(*arguments):
    result = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result


def some_plane():
    """Oblique, and off the middle of the field."""
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    to_world = np.eye(4)
    to_world[:3, :3] = axes if np.linalg.det(axes) > 0 else axes * [1, 1, -1]
    bounds = json.loads(bigus("info", FIELD, "--json").stdout)["bounds"]
    to_world[:3, 3] = [0.5 * (bounds[0] + bounds[1]) + 2, 0.5 * (bounds[2] + bounds[3]) - 1, 0.5 * (bounds[4] + bounds[5])]
    return to_world


class Logic(unittest.TestCase):
    def test_beside_the_program(self):
        to_world, size, spacing = some_plane(), (23.2, 14.8), 0.4
        lps = LPS @ to_world
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "plane.mrk.json").write_text(json.dumps({"markups": [{
                "type": "Plane", "coordinateSystem": "LPS", "center": list(lps[:3, 3]),
                "orientation": list(lps[:3, :3].ravel()), "size": [*size, 0]}]}))
            bigus("slice", FIELD, "--poses", folder / "plane.mrk.json", "--spacing", spacing, "--type", "float",
                  "--volume", folder / "slice.nrrd")
            pose, pixels = read_volume(folder / "slice.nrrd")
        ours, width, height = BigusPlane.plane_grid(to_world, size, spacing)
        self.assertEqual((height, width), pixels.shape)
        self.assertLess(np.abs(ours - pose).max(), 1e-12)
        logic = BigusPlane.BigusPlaneLogic()
        logic.load(FIELD)
        self.assertLess(np.abs(logic.render(ours, width, height) - pixels).max(), 1e-6)
        self.assertGreater(pixels.std(), 0.02)

    def test_too_many_pixels(self):
        with self.assertRaisesRegex(ValueError, "larger spacing"):
            BigusPlane.plane_grid(np.eye(4), (3000, 10), 0.05)


class Panel(unittest.TestCase):
    def test_with_stand_ins(self):
        """Every line of the panel runs, on objects that take any call; Slicer's own are not here."""
        names = ("ctk", "qt", "slicer", "vtk", "slicer.ScriptedLoadableModule", "slicer.util")
        stand_ins = {name: mock.MagicMock() for name in names}
        for name in ("ScriptedLoadableModule", "ScriptedLoadableModuleLogic", "ScriptedLoadableModuleWidget"):
            base = type(name, (), {"__init__": lambda self, parent=None: None, "setup": lambda self: None})
            setattr(stand_ins["slicer.ScriptedLoadableModule"], name, base)
        stand_ins["slicer.util"].VTKObservationMixin = type(
            "Mixin", (), {"__init__": lambda self: None, "addObserver": lambda *_: None, "removeObservers": lambda _: None})
        with mock.patch.dict(sys.modules, stand_ins):
            specification = importlib.util.spec_from_file_location("panel", BigusPlane.__file__)
            module = importlib.util.module_from_spec(specification)
            specification.loader.exec_module(module)
            module.BigusPlane(mock.MagicMock())
            panel = module.BigusPlaneWidget()
            panel.layout = mock.MagicMock()
            panel.setup()
            panel.draw()  # nothing is chosen yet
            self.assertIsNone(panel.volume)
            panel.on_path("missing.vtp")
            self.assertIn("missing.vtp", panel.message.text)
            panel.on_path(FIELD)
            self.assertEqual(panel.message.text, "")
            panel.on_plane(mock.MagicMock())
            panel.logic.show = mock.Mock(side_effect=ValueError("too large"))
            panel.draw()
            panel.logic.show.assert_called_once_with(panel.plane, panel.volume, panel.spacing.value)
            self.assertEqual(panel.message.text, "too large")
            stand_ins["qt"].QFileDialog.getOpenFileName.return_value = ""
            panel.on_install()
            stand_ins["slicer"].util.pip_install.assert_not_called()
            stand_ins["qt"].QFileDialog.getOpenFileName.return_value = "/wheels/bigus-0.1.0.whl"
            panel.on_install()
            stand_ins["slicer"].util.pip_install.assert_called_once_with(["/wheels/bigus-0.1.0.whl"])
            panel.cleanup()


class WithSlicerCore(unittest.TestCase):
    def test_files_and_nodes(self):
        python = os.environ.get("BIGUS_SLICER_PYTHON")
        if not python:
            self.skipTest("$BIGUS_SLICER_PYTHON does not name a Python with slicer-core")
        to_world = some_plane()
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            np.save(folder / "plane.npy", to_world)
            shutil.copy(FIELD, folder / "field.vtp")
            result = subprocess.run([python, str(pathlib.Path(__file__).with_name("slicer_core_scene.py")), str(folder)],
                                    capture_output=True, text=True, cwd=folder,
                                    env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"})
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
            expected = np.load(folder / "shown.npy")  # IJKToRAS of the volume that the logic filled
            bigus("slice", FIELD, "--poses", folder / "plane.mrk.json", "--spacing", 0.5, "--volume", folder / "plane.nrrd")
            pose, pixels = read_volume(folder / "plane.nrrd")
            self.assertEqual(pixels.shape, (24, 40))
            self.assertLess(np.abs(pose - expected).max(), 1e-9)
            if (folder / "shown-pixels.npy").exists():  # the wheel is there, too
                shown = np.load(folder / "shown-pixels.npy")
                self.assertLessEqual(np.abs(shown.astype(int) - pixels).max(), 1)
                self.assertGreater(shown.std(), 2)
            for ending in ("tfm", "txt", "h5"):
                bigus("slice", FIELD, "--poses", folder / f"pose.{ending}", "--size", 7, 5, "--volume", folder / "pose.nrrd")
                self.assertLess(np.abs(read_volume(folder / "pose.nrrd")[0] - to_world).max(), 1e-9, ending)
            bigus("slice", FIELD, "--poses", folder / "line.mrk.json", "--volume", folder / "line.nrrd")
            pose, pixels = read_volume(folder / "line.nrrd")
            self.assertEqual(pixels.shape, (20, 20))
            self.assertLess(np.abs(pose[:3, 0] - 0.5 * np.array([0.6, 0, 0.8])).max(), 1e-9)
            bigus("voxelize", FIELD, "--region", folder / "box.mrk.json", "--spacing", 1, "-o", folder / "box.nrrd")
            header = (folder / "box.nrrd").read_bytes().split(b"\n\n")[0].decode()
            self.assertIn("sizes: 12 9 6\n", header)
            # The box's corner as Slicer has it, half a voxel before the first voxel's centre.
            origin = LPS[:3, :3] @ eval(header.split("space origin: ")[1])
            corner = to_world[:3, :3] @ [-6, -4.5, -3] + to_world[:3, 3]
            self.assertLess(np.abs(origin - to_world[:3, :3] @ [0.5, 0.5, 0.5] - corner).max(), 1e-9)
            # Back in Slicer, volumes lie where they were asked for, and a sequence's frames where their poses say.
            bigus("phantom", "-o", folder / "sweep.igs.mha", "--frames", 5, "--width", 64, "--height", 48, "--pixel-size", 0.5)
            bigus("convert", folder / "sweep.igs.mha", folder / "sweep.seq.nrrd")
            check = subprocess.run([python, str(pathlib.Path(__file__).with_name("slicer_core_scene.py")), str(folder),
                                    "plane.nrrd", "box.nrrd", "sweep"], capture_output=True, text=True,
                                   env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"})
            self.assertEqual(check.returncode, 0, check.stdout + check.stderr)
            self.assertLess(np.abs(np.load(folder / "plane.nrrd.npy") - expected).max(), 1e-9)
            import bigus as package
            for path in (folder / "sweep.igs.mha", folder / "sweep.seq.nrrd"):  # ours reads either, and the same
                sweep = package.read(path)
                self.assertLess(np.abs(np.load(folder / "sweep.npy") - package.poses(sweep)).max(), 1e-9)
                shown = np.load(folder / "sweep-pixels.npy")
                np.testing.assert_array_equal(package.frames(sweep)[:, [30, 25], [20, 40]], shown)


if __name__ == "__main__":
    PROGRAM, FIELD = sys.argv[1:3]
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
