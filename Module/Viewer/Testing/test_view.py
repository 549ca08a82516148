#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""bigus view: what its window shows, how it obeys keys and signals, and what it says where nothing can be drawn.

    test_view.py PATH_TO_BIGUS TESTING_DATA_FOLDER [unittest arguments]
"""
import ctypes
import math
import os
import pathlib
import re
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "Testing" / "Command"))
import test_command  # noqa: E402
from test_command import BAD_INPUT, CANNOT_WRITE, SUCCESS, USAGE, CommandTest, read_sequence, run  # noqa: E402

try:
    from vtkmodules.vtkImagingCore import vtkImageDifference
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOImage import vtkPNGReader
except ModuleNotFoundError:
    vtkPNGReader = None
try:
    X11, XTest = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
except OSError:
    XTest = None

DATA = None
BASELINES = pathlib.Path(__file__).resolve().parent / "Baseline"
NEEDS_DISPLAY = unittest.skipUnless(os.environ.get("DISPLAY"), "rendering needs an X server; none is set in DISPLAY")
SIZE = ["--size", 600, 400]
MOST_DIFFERENCE = 10  # of two pictures by VTK's metric, as VTK's own tests ask of scenes
# The sweep that Testing/Data/phantom-field.vtp was trained on.
PHANTOM = ["--probe", "convex", "--frames", "24", "--width", "160", "--height", "128", "--pixel-size", "0.4",
           "--frame-spacing", "1", "--elevation-sigma", "1", "--seed", "1"]


class Windows:
    """Windows, keys and buttons of the X server, as a person has them."""

    def __init__(self):
        X11.XOpenDisplay.restype = ctypes.c_void_p
        X11.XDefaultRootWindow.restype = X11.XStringToKeysym.restype = X11.XInternAtom.restype = ctypes.c_ulong
        # Xlib ends the process at an error, such as a focus on a window that is not shown yet.
        self.ignore = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(lambda display, error: 0)
        X11.XSetErrorHandler(self.ignore)
        self.display = ctypes.c_void_p(X11.XOpenDisplay(None))
        self.root = ctypes.c_ulong(X11.XDefaultRootWindow(self.display))

    def close(self):
        X11.XCloseDisplay(self.display)

    def find(self, title):
        ignored, count, children = ctypes.c_ulong(), ctypes.c_uint(), ctypes.POINTER(ctypes.c_ulong)()
        X11.XQueryTree(self.display, self.root, ctypes.byref(ignored), ctypes.byref(ignored), ctypes.byref(children),
                       ctypes.byref(count))
        for k in range(count.value):
            name = ctypes.c_char_p()
            if X11.XFetchName(self.display, ctypes.c_ulong(children[k]), ctypes.byref(name)) and name.value == title:
                return ctypes.c_ulong(children[k])
        return None

    def focus(self, window):
        """True when the window has the focus."""
        X11.XSetInputFocus(self.display, window, 1, 0)
        X11.XSync(self.display, 0)
        focused, ignored = ctypes.c_ulong(), ctypes.c_int()
        X11.XGetInputFocus(self.display, ctypes.byref(focused), ctypes.byref(ignored))
        return focused.value == window.value

    def press(self, key, *held):
        keys = [X11.XKeysymToKeycode(self.display, ctypes.c_ulong(X11.XStringToKeysym(name.encode())))
                for name in (*held, key)]
        for code in keys:
            XTest.XTestFakeKeyEvent(self.display, code, 1, 0)
        for code in reversed(keys):
            XTest.XTestFakeKeyEvent(self.display, code, 0, 0)
        X11.XSync(self.display, 0)

    def move(self, x, y):
        XTest.XTestFakeMotionEvent(self.display, -1, x, y, 0)
        X11.XSync(self.display, 0)

    def button(self, number, is_down):
        XTest.XTestFakeButtonEvent(self.display, number, is_down, 0)
        X11.XSync(self.display, 0)

    def ask_to_close(self, window):
        """As a window manager does it: a client message with five numbers of data."""
        atom = X11.XInternAtom(self.display, b"WM_DELETE_WINDOW", 0)
        protocols = X11.XInternAtom(self.display, b"WM_PROTOCOLS", 0)
        message = (ctypes.c_long * 24)(33, 0, 0, 0, window.value, protocols, 32, atom)
        X11.XSendEvent(self.display, window, 0, 0, ctypes.byref(message))
        X11.XSync(self.display, 0)


class View(CommandTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.trained_field = DATA / "phantom-field.vtp"
        cls.trained_sweep = cls.shared / "trained.igs.mha"
        made = run("phantom", "-o", cls.trained_sweep, *PHANTOM)
        assert made.returncode == SUCCESS, made.stderr

    def screenshot(self, *arguments):
        """(answer, path) of a small screenshot."""
        path = self.folder / "view.png"
        return self.expect(SUCCESS, "view", *arguments, *SIZE, "--screenshot", path), path

    def difference(self, first, second):
        """Of two pictures by VTK's metric."""
        readers = []
        for path in (first, second):
            reader = vtkPNGReader()
            reader.SetFileName(str(path))
            reader.Update()
            readers.append(reader)
        self.assertEqual(*(reader.GetOutput().GetDimensions() for reader in readers))
        metric = vtkImageDifference()
        metric.SetInputConnection(readers[0].GetOutputPort())
        metric.SetImageConnection(readers[1].GetOutputPort())
        metric.Update()
        return metric.GetThresholdedError()

    def check_baseline(self, name, picture):
        baselines = sorted(BASELINES.glob(f"view-{name}*.png"))  # one a platform where they differ
        self.assertTrue(baselines, f"no view-{name}*.png in {BASELINES}")
        smallest = min(self.difference(picture, baseline) for baseline in baselines)
        if smallest > MOST_DIFFERENCE:
            kept = pathlib.Path(f"view-{name}.png").absolute()
            picture.replace(kept)
            self.fail(f"{kept} differs from its baseline by {smallest:.0f}. Look at both.")

    @NEEDS_DISPLAY
    @unittest.skipIf(vtkPNGReader is None, "VTK's Python modules compare the pictures")
    def test_pictures_are_as_looked_at(self):
        answer, picture = self.screenshot(self.trained_field, self.trained_sweep)
        self.assertEqual((answer["size"], answer["frame"]), ([600, 400], 12))
        self.check_baseline("sweep", picture)
        everything = "ellipsoids,volume,slice,frames,planes,beam"
        answer, picture = self.screenshot(self.trained_field, self.trained_sweep, "--frame", 3, "--show", everything)
        self.check_baseline("everything", picture)
        answer, picture = self.screenshot(self.trained_field)
        self.assertEqual((answer["frame"], answer["psnr"]), (None, None))
        self.check_baseline("field", picture)
        self.assertGreater(self.difference(picture, BASELINES / "view-sweep.png"), MOST_DIFFERENCE)

    @NEEDS_DISPLAY
    def test_the_score_is_that_of_the_slice(self):
        answer, _ = self.screenshot(self.trained_field, self.trained_sweep, "--frame", 5)
        again = self.folder / "again.mha"
        self.expect(SUCCESS, "slice", self.trained_field, "--poses", self.trained_sweep, "--lit", "-o", again)
        metrics = self.expect(SUCCESS, "metrics", again, self.trained_sweep, "--frames", 5)
        # Before compression a field is nowhere exactly 0, so --lit tells the lit pixels.
        mask = self.folder / "mask.mha"
        self.expect(SUCCESS, "slice", self.trained_field, "--poses", self.trained_sweep, "--lit", "--frames", 5, "--mode",
                    "scattering", "-o", mask)
        lit = sum(value != 0 for value in memoryview(read_sequence(mask)[1]).cast("f")) / (160 * 128)
        # The same squared error, but for rounding to 8 bits, here spread over the lit pixels only.
        expected = 10 ** (-metrics["psnr"] / 10) / lit
        self.assertAlmostEqual(10 ** (-answer["psnr"] / 10) / expected, 1, delta=0.01)

    @NEEDS_DISPLAY
    def test_odd_fields_and_sweeps(self):
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
                 "rot_1", "rot_2", "rot_3"]
        for count in (0, 1):
            with self.subTest(gaussians=count):
                field = self.folder / f"{count}.ply"
                field.write_text(f"ply\nformat ascii 1.0\nelement vertex {count}\n"
                                 + "".join(f"property float {name}\n" for name in names) + "end_header\n"
                                 + count * "1 2 3 1 1 1 1 0 0 0 1 0 0 0\n")
                self.screenshot(field, "--show", "ellipsoids,volume,slice,planes,beam")
                self.screenshot(field, self.sweep)
        one = self.folder / "one.igs.mha"
        self.assertEqual(run("phantom", "-o", one, "--frames", "1", "--width", "24", "--height", "20").returncode, 0)
        self.screenshot(self.field, one)

    @NEEDS_DISPLAY
    def test_a_sweep_that_lies_elsewhere_is_told(self):
        header, pixels, _ = read_sequence(self.sweep)
        moved = self.folder / "moved.igs.mha"
        numbers = r"(Seq_Frame\d+_ImageToReferenceTransform = (?:\S+ ){3})(\S+)"
        header = re.sub(numbers, lambda match: f"{match[1]}{float(match[2]) + 500}", header)
        test_command.write_sequence(moved, header, pixels)
        for sweep, is_told in ((self.sweep, False), (moved, True)):
            told = run("view", self.field, sweep, *SIZE, "--screenshot", self.folder / "view.png")
            self.assertEqual(told.returncode, SUCCESS)
            self.assertEqual("trained on another sweep" in told.stderr, is_told, told.stderr)

    def test_errors(self):
        picture = self.folder / "view.png"
        self.expect(USAGE, "view")
        for size in ((0, 400), (600, "1e9"), (600, "nan"), (4097, 400)):
            self.expect(USAGE, "view", self.field, "--size", *size)
        self.expect(USAGE, "view", self.field, "--show", "everything", says="--show")
        self.expect(CANNOT_WRITE, "view", self.field, "--screenshot", self.folder / "view.jpg", says=".png")
        self.expect(CANNOT_WRITE, "view", self.field, "--screenshot", self.folder / "no" / "view.png")
        self.expect(BAD_INPUT, "view", self.folder / "none.vtp", "--screenshot", picture, says="none.vtp")
        self.assertNothingIn(self.folder)

    @NEEDS_DISPLAY
    def test_foreign_files(self):
        picture = ["--screenshot", self.folder / "view.png"]
        self.expect(BAD_INPUT, "view", self.sweep, *picture, says="neither a VTK XML")
        self.expect(BAD_INPUT, "view", self.field, self.field, *picture)
        self.expect(BAD_INPUT, "view", self.field, self.sweep, "--frame", 9, *picture, says="9 usable frames")
        self.expect(BAD_INPUT, "view", self.field, "--frame", 0, *picture, says="name a sequence")
        self.assertNothingIn(self.folder)

    def test_without_a_display(self):
        for display, says in (("", "DISPLAY is not set"), (":4711", "does not answer")):
            with self.subTest(display):
                result = subprocess.run([test_command.BIGUS, "view", self.field], capture_output=True, text=True,
                                        env={**os.environ, "DISPLAY": display}, timeout=60)
                self.assertEqual(result.returncode, CANNOT_WRITE, result.stderr)
                self.assertIn(says, result.stderr)
                self.assertIn("xvfb-run", result.stderr)

    def open(self, *arguments):
        """(process, windows) of a window that has drawn its first picture and has the focus."""
        process = subprocess.Popen([test_command.BIGUS, "view", *map(str, arguments)], stderr=subprocess.PIPE, text=True,
                                   cwd=self.folder)
        self.addCleanup(process.stderr.close)
        self.addCleanup(process.wait, 60)
        self.addCleanup(process.kill)
        windows = Windows()
        self.addCleanup(windows.close)
        title = b"BIGUS: " + os.path.basename(arguments[0]).encode()
        window, end = None, time.time() + 60
        while not (window and windows.focus(window)) and process.poll() is None and time.time() < end:
            time.sleep(0.1)
            window = windows.find(title)
        self.assertTrue(window, "no window")
        windows.window = window
        # Keys are obeyed in turn, so the first file tells that it serves them.
        self.saved(windows, "s", "phantom-field-view-1.png")
        return process, windows

    def saved(self, windows, key, name):
        """The file that a key makes it save."""
        path, end = self.folder / name, time.time() + 60
        time.sleep(0.3)
        windows.press(key)
        while not path.exists() and time.time() < end:
            time.sleep(0.1)
        self.assertTrue(path.exists(), name)
        return path

    @NEEDS_DISPLAY
    @unittest.skipIf(XTest is None, "libXtst presses the keys")
    def test_keys_and_mouse(self):
        process, windows = self.open(self.trained_field, self.trained_sweep, "--frame", 7, *SIZE)
        windows.move(150, 390)  # on the scene
        windows.press("Right")
        moved = self.saved(windows, "w", "phantom-field-slice-1.igs.mha")
        expected = self.folder / "expected.mha"
        self.expect(SUCCESS, "slice", self.trained_field, "--poses", self.trained_sweep, "--frames", 8, "--type", "float", "-o",
                    expected)
        self.assertEqual(read_sequence(moved)[1], read_sequence(expected)[1])

        windows.press("Up")  # the slice goes on by half a millimetre
        pushed = self.saved(windows, "w", "phantom-field-slice-2.igs.mha")
        origins = [[float(x) for x in re.search(r"Transform = (.*)", read_sequence(path)[0])[1].split()[3:12:4]]
                   for path in (moved, pushed)]
        self.assertAlmostEqual(sum((a - b) ** 2 for a, b in zip(*origins)), 0.25, delta=1e-4)

        windows.press("f")
        back = self.saved(windows, "w", "phantom-field-slice-3.igs.mha")
        self.assertEqual(read_sequence(back)[1], read_sequence(moved)[1])
        windows.press("question")
        windows.press("q")
        self.assertEqual(process.wait(20), SUCCESS)

    def drag(self, windows, start, end):
        windows.move(*start)
        windows.button(1, 1)
        windows.move(*end)
        windows.button(1, 0)

    @staticmethod
    def pixels(path):
        """[row][column][3] of a picture, from the top."""
        reader = vtkPNGReader()
        reader.SetFileName(str(path))
        reader.Update()
        image = reader.GetOutput()
        pixels = vtk_to_numpy(image.GetPointData().GetScalars())
        return pixels.reshape(image.GetDimensions()[1], image.GetDimensions()[0], 3)[::-1]

    @NEEDS_DISPLAY
    @unittest.skipIf(XTest is None or vtkPNGReader is None, "libXtst presses the keys, VTK reads the pictures")
    def test_measures_kept_planes_and_the_nearest_frame(self):
        process, windows = self.open(self.trained_field, self.trained_sweep, "--frame", 7, *SIZE)
        first = self.pixels(self.folder / "phantom-field-view-1.png")
        # The ruler of the recorded frame: a bright line 10 pixels above the lower end of its cell, which is a third high.
        ruler = max((first[row, 450:] > 180).all(axis=1).nonzero()[0].size for row in range(118, 128))
        self.drag(windows, (480, 40), (480 + ruler, 40))
        windows.move(480, 40 + ruler // 2)
        windows.button(1, 1)
        windows.button(1, 0)
        for x, y in ((525, 200), (545, 200), (545, 220)):  # clicks on the rendered slice
            windows.move(x, y)
            windows.button(1, 1)
            windows.button(1, 0)
        windows.move(150, 390)
        windows.press("k")
        windows.press("Right")
        other = self.saved(windows, "w", "phantom-field-slice-1.igs.mha")
        windows.press("n")  # back to frame 7, by its plane
        kept = self.saved(windows, "w", "phantom-field-slice-2.igs.mha")
        moved = self.pixels(self.saved(windows, "s", "phantom-field-view-2.png"))
        expected = self.folder / "expected.mha"
        for frame, slice_ in ((7, kept), (8, other)):
            self.expect(SUCCESS, "slice", self.trained_field, "--poses", self.trained_sweep, "--frames", frame, "--type",
                        "float", "-o", expected)
            self.assertEqual(read_sequence(slice_)[1], read_sequence(expected)[1])
        # The frame there is shown as the nearest one.
        self.assertLess(abs(moved[30:110, 460:590].astype(int) - first[30:110, 460:590]).mean(), 1)
        windows.press("q")
        self.assertEqual(process.wait(20), SUCCESS)
        told = process.stderr.read()
        length, path, area = map(float, re.search(r"([\d.]+) mm\n([\d.]+) mm, inside ([\d.]+) mm\^2", told).groups())
        value, mean = map(float, re.search(r"intensity ([\d.]+)\n(?:.*\n)*?.*mm\^2, mean ([\d.]+)", told).groups())
        row, column = 200 - 134, 525 - 450  # in its cell: the mean of the pixels about there
        grey = first[134 + row - 1:134 + row + 2, 450 + column - 1:450 + column + 2].mean() / 255
        self.assertAlmostEqual(value, grey, delta=0.25)
        inside = [first[200 + y, 525 + x].mean() / 255 for y in range(20) for x in range(y, 20)]
        self.assertAlmostEqual(mean, sum(inside) / len(inside), delta=0.05)
        self.assertIn(str(round(length)), ("10", "20", "50"), told)  # what a ruler is long
        self.assertAlmostEqual(length, round(length), delta=length / ruler)  # a pixel
        self.assertAlmostEqual(path / length, 1 + math.hypot(1, 0.5), delta=2 / ruler)
        self.assertAlmostEqual(area / length**2, 0.25, delta=2 / ruler)

    @NEEDS_DISPLAY
    @unittest.skipIf(XTest is None, "libXtst presses the keys")
    def test_a_mean_over_an_area_has_an_error_of_its_own(self):
        field = self.folder / "phantom-field.vtp"  # the name that open() waits for
        self.expect(SUCCESS, "train", self.trained_sweep, "-o", field, "--no-auto", "--gaussians", 500,
                    "--iterations", 60)
        process, windows = self.open(field, self.trained_sweep, "--frame", 7, *SIZE)
        for x, y in ((525, 200), (545, 200), (545, 220)):
            windows.move(x, y)
            windows.button(1, 1)
            windows.button(1, 0)
        windows.press("q")
        self.assertEqual(process.wait(20), SUCCESS)
        told = process.stderr.read()
        sigma = float(re.search(r"intensity [\d.]+ \+- ([\d.]+)", told)[1])
        self.assertTrue(0 < float(re.search(r"mm\^2, mean [\d.]+ \+- ([\d.]+)", told)[1]) < sigma, told)

    @NEEDS_DISPLAY
    @unittest.skipIf(XTest is None, "libXtst presses the keys")
    def test_it_ends_when_told(self):
        for end in ("close", signal.SIGTERM, signal.SIGINT):
            with self.subTest(end):
                (self.folder / "phantom-field-view-1.png").unlink(missing_ok=True)
                process, windows = self.open(self.trained_field, *SIZE)
                if end == "close":
                    windows.ask_to_close(windows.window)
                else:
                    process.send_signal(end)
                self.assertEqual(process.wait(20), SUCCESS if end == "close" else 128 + end)
                self.assertEqual(process.stderr.read(), "Saved phantom-field-view-1.png\n")


if __name__ == "__main__":
    test_command.BIGUS = os.path.abspath(sys.argv.pop(1))
    DATA = pathlib.Path(sys.argv.pop(1)).absolute()
    unittest.main()
