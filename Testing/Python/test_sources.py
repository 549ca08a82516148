# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Images and poses of one's own: every format gives the sweep that was written, and every way to be bad one clear error.

    test_sources.py [PACKAGE_FOLDER]      the folder of the package; only numpy is needed, and what a format asks for:
                                          tests of h5py, OpenCV, imageio and pydicom are skipped where these are missing

With the package on PYTHONPATH `python3 -m bigus.convert` is run, too.
"""
import importlib.util
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import unittest
import warnings
import zlib
from unittest import mock

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
FOLDER = ROOT / "Module" / "Python" / "bigus"
specification = importlib.util.spec_from_file_location("sources", FOLDER / "sources.py")
sources = importlib.util.module_from_spec(specification)
specification.loader.exec_module(sources)

FRAMES, HEIGHT, WIDTH = 7, 12, 16
SPACING = (0.3, 0.4)


def turn(axis, angle):
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def path_of_probe(times):
    """(poses [n, 4, 4] in mm, quaternions [n, 4] with w last) of a probe that moves evenly and turns about one axis."""
    axis = np.array([0.2, 0.9, -0.3]) / np.linalg.norm([0.2, 0.9, -0.3])
    poses, quaternions = np.tile(np.eye(4), (len(times), 1, 1)), np.empty((len(times), 4))
    for k, time in enumerate(times):
        angle = 0.3 + 0.8 * time
        poses[k, :3, :3] = turn(axis, angle)
        poses[k, :3, 3] = [10 + 50 * time, -20 + 5 * time, 30 - 8 * time]
        quaternions[k] = [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]
    return poses, quaternions


TIMES = np.arange(FRAMES) / 20
POSES, QUATERNIONS = path_of_probe(TIMES)
IMAGES = np.random.default_rng(2).integers(0, 256, (FRAMES, HEIGHT, WIDTH)).astype(np.uint8)
SCALE = np.diag([*SPACING, SPACING[0], 1])
TRUTH = POSES @ SCALE  # ImageToReference
MATRIX_NAMES = [f"m{row}{column}" for row in range(4) for column in range(4)]


def table(names, rows, separator=","):
    lines = [separator.join(names)] if names else []
    return "\n".join(lines + [separator.join(cell if isinstance(cell, str) else repr(float(cell)) for cell in row)
                              for row in rows]) + "\n"


def package(name):
    try:
        return __import__(name)
    except ImportError as error:
        raise unittest.SkipTest(str(error))


PLUS = ('<?xml version="1.0"?><Scene><PlusConfiguration><CoordinateDefinitions><Transform From="Image" To="Probe" Matrix="{}"/>'
        '</CoordinateDefinitions></PlusConfiguration></Scene>')


def with_steps(movie, steps):
    """The bytes of an .mp4 of even rate, its boxes at the end, with other steps between its frames (in units of one)."""

    def changed(data):
        boxes, at = b"", 0
        while at < len(data):
            size, kind = struct.unpack(">I4s", data[at:at + 8])
            size = size or len(data) - at
            body = data[at + 8:at + size]
            at += size
            if kind == b"mdat":
                boxes += data[at - size:at]
                continue
            if kind in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
                body = changed(body)
            elif kind == b"stts":  # of each frame how long it is shown
                step = struct.unpack(">I", body[12:16])[0]
                body = struct.pack(">II", 0, len(steps)) + b"".join(struct.pack(">II", 1, step * count) for count in steps)
            elif kind == b"edts":  # which would end the film where it ended
                kind = b"free"
            boxes += struct.pack(">I4s", 8 + len(body), kind) + body
        return boxes

    assert movie.index(b"moov") > movie.index(b"mdat")
    return changed(movie)


class InFolder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        np.save(self.folder / "images.npy", IMAGES)
        np.save(self.folder / "poses.npy", POSES)

    def write(self, name, text):
        (self.folder / name).write_text(text)
        return self.folder / name

    def check(self, sweep, poses=TRUTH, images=IMAGES, times=None, tolerance=1e-9):
        np.testing.assert_array_equal(sweep.pixels, images)
        self.assertEqual(sweep.pixels.dtype, images.dtype)
        self.assertLess(np.abs(sweep.poses - poses).max(), tolerance)
        if times is None:
            self.assertIsNone(sweep.times)
        else:
            np.testing.assert_allclose(sweep.times, times, atol=1e-9)


class PosesOfEveryKind(InFolder):
    def load(self, poses, **options):
        return sources.load(self.folder / "images.npy", poses, **{"pixel_spacing": SPACING, **options})

    def test_numpy(self):
        self.check(self.load(self.folder / "poses.npy"))
        np.save(self.folder / "three.npy", POSES[:, :3].astype(np.float32))
        self.check(self.load(self.folder / "three.npy"), tolerance=1e-5)
        np.save(self.folder / "seven.npy", np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1))
        self.check(self.load(self.folder / "seven.npy"))
        np.savez(self.folder / "both.npz", images=IMAGES, poses=POSES)
        self.check(sources.load(self.folder / "both.npz", pixel_spacing=SPACING))
        np.save(self.folder / "pixels.npy", TRUTH)  # poses that lead from pixels need no spacing
        self.check(self.load(self.folder / "pixels.npy", pixel_spacing=None))

    def test_tables_with_names(self):
        flat, positions = POSES.reshape(-1, 16), POSES[:, :3, 3]
        for separator in (",", ";", " ", "\t"):
            self.check(self.load(self.write("m.csv", table(MATRIX_NAMES, flat, separator))))
            self.check(self.load(self.write("m.csv", "# recorded\n" + table(MATRIX_NAMES[:12], flat[:, :12], separator))))
        for names in (("tx", "ty", "tz", "qx", "qy", "qz", "qw"), ("X", "Y", "Z", "Q_x", "Q_y", "Q_z", "Q_w"),
                      ("Position.x", "Position.y", "Position.z", "quat_x", "quat_y", "quat_z", "quat_w")):
            rows = np.concatenate([TIMES[:, None], positions, QUATERNIONS], axis=1)
            self.check(self.load(self.write("q.csv", table(("Timestamp", *names), rows))), times=TIMES)
        # Names say the order, whatever the columns' is.
        rows = np.concatenate([QUATERNIONS[:, 3:], QUATERNIONS[:, :3], positions], axis=1)
        self.check(self.load(self.write("q.csv", table(("qw", "qx", "qy", "qz", "x", "y", "z"), rows)), quaternion="wxyz"))
        rows = np.concatenate([1000 * TIMES[:, None], flat], axis=1)
        self.check(self.load(self.write("ms.csv", "\ufeff" + table(("time_ms", *MATRIX_NAMES), rows))), times=TIMES)

    def test_titles_of_other_programs(self):
        rows = np.concatenate([TIMES[:, None], POSES[:, :3, 3], QUATERNIONS], axis=1)
        axes = [f"{what}{{}}{axis}" for what, some in (("position", "xyz"), ("orientation", "xyzw")) for axis in some]
        ros = ["%time", *("field.pose." + axis.format(".") for axis in axes)]
        plotted = ["__time", *("/probe/pose/" + axis.format("/") for axis in axes)]
        unity = ["time", "pos_x", "pos_y", "pos_z", "rot_x", "rot_y", "rot_z", "rot_w"]
        for titles in (ros, plotted, unity):
            self.check(self.load(self.write("other.csv", table(titles, rows))), times=TIMES)
        w_first = np.concatenate([TIMES[:, None], QUATERNIONS[:, 3:], QUATERNIONS[:, :3], POSES[:, :3, 3]], axis=1)
        ndi = ("time", "Q0", "Qx", "Qy", "Qz", "Tx", "Ty", "Tz")
        self.check(self.load(self.write("ndi.csv", table(ndi, w_first))), times=TIMES)
        header = ["field.header.seq", "field.header.frame_id"]
        named = np.concatenate([np.full((FRAMES, 2), 7), rows], axis=1)
        self.check(self.load(self.write("ros.csv", table(header + ros, named))), times=TIMES)
        with self.assertRaisesRegex(sources.SourceError, "two.csv: has columns of 2 poses, a.pose, field.pose; keep"):
            both = np.concatenate([rows, rows[:, 1:]], axis=1)
            self.load(self.write("two.csv", table(["time", *(t.replace("field", "a") for t in ros[1:]), *ros[1:]], both)))

    def test_tables_in_utf_16(self):
        rows = np.concatenate([TIMES[:, None], POSES.reshape(-1, 16)], axis=1)
        text = table(("time", *MATRIX_NAMES), rows, "\t")
        for encoding in ("utf-16", "utf-16-be"):  # the first with its mark, as spreadsheets write it
            path = self.folder / "unicode.txt"
            path.write_bytes((b"" if encoding == "utf-16" else b"\xfe\xff") + text.encode(encoding))
            self.check(self.load(path), times=TIMES)

    def test_decimal_commas(self):
        """As spreadsheets write them where a comma is the sign of decimals."""
        rows = np.concatenate([TIMES[:, None], POSES[:, :3, 3], QUATERNIONS], axis=1)
        names = ("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw")
        for separator in (";", "\t", " ", "; "):
            text = table(names, rows, separator)
            self.check(self.load(self.write("point.csv", text)), times=TIMES)
            comma = re.sub(r"(\d)\.(\d)", r"\1,\2", text)
            for before in ("", "sep=;\n", "# recorded, by hand\n"):
                self.check(self.load(self.write("comma.csv", before + comma)), times=TIMES)
            self.check(self.load(self.write("comma.csv", comma.split("\n", 1)[1])), times=TIMES)  # no names
            if separator != " ":
                lost = re.sub(r"\n0,1[^\d].*", "\n0,1" + 7 * separator, comma)
                self.assertEqual(len(self.load(self.write("lost.csv", lost)).pixels), FRAMES - 1)
        quoted = table(names, [[f'"{cell!r}"'.replace(".", ",") for cell in map(float, row)] for row in rows])
        self.check(self.load(self.write("quoted.csv", quoted)), times=TIMES)
        probe = np.array([[0.25, 0.5, 0, -1.5], [0.5, -0.25, 0, 2], [0, 0, 0.125, 3], [0, 0, 0, 1]])
        for text in (table((), probe, " "), table((), probe, ";"), table((), [probe.ravel()], "\t")):
            calibration = self.write("calibration.txt", text.replace(".", ","))
            self.check(self.load(self.folder / "poses.npy", calibration=calibration, pixel_spacing=None), POSES @ probe)
        self.check(self.load(self.folder / "poses.npy", calibration=self.write("c.txt", table((), probe)), pixel_spacing=None),
                   POSES @ probe)
        with self.assertRaisesRegex(sources.SourceError, "'1.234,5' is not a number"):
            self.load(self.write("thousands.csv", table(names, [[0.0, "1.234,5", *row[2:]] for row in rows], ";")))

    def test_tables_without_names(self):
        positions, times = POSES[:, :3, 3], TIMES[:, None]
        for rows in (POSES.reshape(-1, 16), POSES.reshape(-1, 16)[:, :12], np.concatenate([positions, QUATERNIONS], axis=1)):
            self.check(self.load(self.write("plain.txt", table((), rows, " "))))
            self.check(self.load(self.write("timed.txt", table((), np.concatenate([times, rows], axis=1)))), times=TIMES)
        rows = np.concatenate([positions, QUATERNIONS[:, 3:], QUATERNIONS[:, :3]], axis=1)
        sweep = self.load(self.write("w.txt", table((), rows)), quaternion="wxyz")
        self.check(sweep)
        self.assertRegex(sweep.notes[0], r"w\.txt has no names of columns, .* as w x y z, as the option quaternion says")
        # Numbers cannot say which order they have, so what was taken is said; names can, and a matrix has one order.
        rows = np.concatenate([positions, QUATERNIONS], axis=1)
        np.save(self.folder / "seven.npy", rows)
        for path in (self.write("x.txt", table((), rows)), self.folder / "seven.npy"):
            self.assertRegex(self.load(path).notes[0], "usual order, x y z w. Where w comes first, give --quaternion wxyz")
        for path in (self.write("m.txt", table((), POSES.reshape(-1, 16))),
                     self.write("q.txt", table(("x", "y", "z", "qx", "qy", "qz", "qw"), rows))):
            self.assertEqual(self.load(path).notes, [])

    def test_rows_that_are_none(self):
        """Titles, units and comments are no poses, and what a spreadsheet writes for no number is no comment."""
        names = ("x", "y", "z", "qx", "qy", "qz", "qw")
        rows = np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1)
        for separator in (",", ";", "\t", " "):
            good = table(names, rows, separator)
            header, numbers = good.split("\n", 1)
            for title in ("Recorded with NDI on 2024", "Recorded", "Trial 3\n\nBy hand, in 2024"):
                with self.subTest(separator=separator, title=title):
                    sweep = self.load(self.write("title.csv", f"{title}\n{good}"))
                    self.check(sweep)
                    self.assertRegex(sweep.notes[0], r"Line 1 of .*title\.csv stands before the names.*: '(Recorded|Trial 3)")
            units = separator.join(["mm", "[mm]", "(mm)", "-", "-", "-", "-"])
            sweep = self.load(self.write("units.csv", f"{header}\n{units}\n{numbers}"))
            self.check(sweep)
            self.assertRegex(sweep.notes[0], r"Line 2 of .*units\.csv holds units and no pose, and was skipped: 'mm, \[mm\]")
            # As numpy writes names; w stands first, which no number tells.
            w_first = table(("qw", "qx", "qy", "qz", "x", "y", "z"), rows[:, [6, 3, 4, 5, 0, 1, 2]], separator)
            self.check(self.load(self.write("numpy.csv", "# " + w_first)))
            lines = good.split("\n")
            lines[3] = separator.join(["#N/A"] * 7)
            kept = np.arange(FRAMES) != 2
            sweep = self.load(self.write("lost.csv", "\n".join(lines)))
            self.check(sweep, TRUTH[kept], IMAGES[kept])
            self.assertEqual(sweep.notes, ["1 of 7 frames have no pose and are left out: 2."])
            lines.insert(5, "#" + lines[5])
            sweep = self.load(self.write("comment.csv", "\n".join(lines)))
            self.check(sweep, TRUTH[kept], IMAGES[kept])
            self.assertRegex(sweep.notes[0], "1 of the lines of .*comment.csv begin with # and were skipped as comments: 6")
        for text, part in (("Recorded by hand\n" + table((), rows), r"line 1 \('Recorded by hand'\) is no row"),
                           ("Recorded in 2024\n" + table((), rows, " "), r"line 1 \('Recorded in 2024'\) is no row")):
            with self.assertRaisesRegex(sources.SourceError, part + ".*begin it with #"):
                self.load(self.write("bad.csv", text))

    def test_sequence_of_slicer(self):
        """Text as 3D Slicer 5.13 writes it for a sequence of transforms; the second frame was lost."""
        header = "ObjectType = Image\nNDims = 3\nDimSize = 0 0 7\n"
        for k in range(FRAMES):
            numbers = " ".join(repr(float(x)) for x in POSES[k].ravel())
            header += (f"Seq_Frame{k:04d}_ProbeTransform ={numbers} \nSeq_Frame{k:04d}_ProbeTransformStatus = "
                       f"{'INVALID' if k == 1 else 'OK'}\nSeq_Frame{k:04d}_Timestamp = {float(TIMES[k])!r}\n")
        sweep = self.load(self.write("probe.seq.mha", header + "ElementDataFile = LOCAL\n"))
        kept = np.arange(FRAMES) != 1
        self.check(sweep, TRUTH[kept], IMAGES[kept], TIMES[kept])
        self.assertIn("1 of 7 frames have no pose and are left out: 1.", sweep.notes)

    def test_lost_frames(self):
        rows = [["OK", *row] for row in POSES.reshape(-1, 16)]
        rows[2][0], rows[4][3], rows[5][1:] = "MISSING", "nan", [""] * 16
        kept = [0, 1, 3, 6]
        sweep = self.load(self.write("lost.csv", table(("status", *MATRIX_NAMES), rows)))
        self.check(sweep, TRUTH[kept], IMAGES[kept])
        self.assertIn("3 of 7 frames have no pose and are left out: 2, 4, 5.", sweep.notes)
        rows[2][1:] = ["garbage"] + [9.0] * 15  # whatever stands in a row whose status is not OK
        self.check(self.load(self.write("lost.csv", table(("status", *MATRIX_NAMES), rows))), TRUTH[kept], IMAGES[kept])

    def test_what_columns_say_of_a_pose(self):
        kept = [0, 1, 3, 4, 6]
        for name, good, lost in (("status", "ok", "INVALID"), ("Status", "Tracked", "LOST"), ("status", "VALID", "0 markers"),
                                 ("valid", "1", "0"), ("is_valid", "True", "False"), ("tracked", "yes", "no"), ("visible", "1", "")):
            with self.subTest(name=name, lost=lost):
                rows = [[lost if k in (2, 5) else good, *row] for k, row in enumerate(POSES.reshape(-1, 16))]
                sweep = self.load(self.write("lost.csv", table((name, *MATRIX_NAMES), rows)))
                self.check(sweep, TRUTH[kept], IMAGES[kept])
                self.assertEqual(sweep.notes, ["2 of 7 frames have no pose and are left out: 2, 5."])
        for name, cell, expected in (("status", "0", "OK where there is a pose"), ("status", "1", "valid where 1 means so"),
                                     ("tracked", "0.7", "0 or 1 is expected")):
            with self.subTest(name=name, cell=cell):
                rows = [[cell, *row] for row in POSES.reshape(-1, 16)]
                with self.assertRaisesRegex(sources.SourceError, f"line 2, column {name}: '{cell}'; .*{expected}"):
                    self.load(self.write("numbers.csv", table((name, *MATRIX_NAMES), rows)))

    def test_lost_tracking_as_programs_write_it(self):
        """Zeros, words and what Windows prints for NaN stand for a pose that there is not, in every kind of table."""
        position_and_turn = np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1)
        kept = [0, 1, 4, 5, 6]
        for names, rows in ((("x", "y", "z", "qx", "qy", "qz", "qw"), position_and_turn), (MATRIX_NAMES, POSES.reshape(-1, 16)),
                            (MATRIX_NAMES[:12], POSES.reshape(-1, 16)[:, :12]), ((), position_and_turn)):
            width = rows.shape[1]
            for lost in ([0.0] * width, ["0"] * width, ["MISSING"] * width, ["not_seen_by_camera"] * width, ["None"] * width,
                         ["1.#QNAN"] * width, ["-3.697314e+28"] * width, ["lost"] + [""] * (width - 1), ["Out of Volume"],
                         [*rows[2][:-1], "<missing>"], [*rows[2][:3], *[0.0] * (width - 3)] if width == 7 else [0.0] * width):
                with self.subTest(names=names[:3], lost=lost[:4]):
                    written = [lost if k in (2, 3) else list(row) for k, row in enumerate(rows)]
                    sweep = self.load(self.write("lost.csv", table(names, written)))
                    self.check(sweep, TRUTH[kept], IMAGES[kept])
                    self.assertEqual([note for note in sweep.notes if "quaternions" not in note],
                                     ["2 of 7 frames have no pose and are left out: 2, 3."])
        # Also where the first row is lost, and where there is no rotation but a last row.
        self.check(self.load(self.write("first.csv", table((), [["MISSING"] * 7, *position_and_turn[1:]]))), TRUTH[1:], IMAGES[1:])
        zeros = POSES.copy()
        zeros[2], zeros[3] = 0, np.diag([0, 0, 0, 1])
        np.save(self.folder / "zeros.npy", zeros)
        self.check(self.load(self.folder / "zeros.npy"), TRUTH[kept], IMAGES[kept])
        header = "ObjectType = Image\nNDims = 3\nDimSize = 0 0 7\n"
        for k in range(FRAMES):
            numbers = {2: "MISSING", 3: "0 " * 16}.get(k, " ".join(repr(float(x)) for x in POSES[k].ravel()))
            header += f"Seq_Frame{k:04d}_ProbeTransform = {numbers}\nSeq_Frame{k:04d}_ProbeTransformStatus = OK\n"
        self.check(self.load(self.write("probe.seq.mha", header + "ElementDataFile = LOCAL\n")), TRUTH[kept], IMAGES[kept])
        np.save(self.folder / "none.npy", np.zeros((FRAMES, 4, 4)))
        with self.assertRaisesRegex(sources.SourceError, "no frame has a pose"):
            self.load(self.folder / "none.npy")

    def test_rows_name_their_frames(self):
        rows = [[k, *POSES[k].ravel()] for k in (5, 0, 3)]
        sweep = self.load(self.write("some.csv", table(("frame", *MATRIX_NAMES), rows)))
        self.check(sweep, TRUTH[[0, 3, 5]], IMAGES[[0, 3, 5]])

    def test_every_name_of_a_frames_column(self):
        order = [5, 0, 3, 6, 1, 2, 4]
        for name in ("frame", "Frame_ID", "Frame Number", "frame-index", "Index", "ID", "image", "File", "file name", "picture"):
            for first in (0, 1):
                with self.subTest(name=name, first=first):
                    rows = [[str(k + first), float(TIMES[k]), *POSES[k].ravel()] for k in order]
                    sweep = self.load(self.write("named.csv", table((name, "time_s", *MATRIX_NAMES), rows)))
                    self.check(sweep, times=TIMES)
                    said = [note for note in sweep.notes if "counted from 1" in note]
                    self.assertEqual(len(said), first)
        rows = [[str(k), *POSES[k].ravel()] for k in (1, 2)]
        sweep = self.load(self.write("some.csv", table(("frame", *MATRIX_NAMES), rows)))
        self.check(sweep, TRUTH[1:3], IMAGES[1:3])
        self.assertIn("begins with 1 and does not reach 7, the number of frames, so its numbers were counted from 0", sweep.notes[0])

    def test_numbers_that_count_rows_are_no_times(self):
        order = [5, 0, 3, 6, 1, 2, 4]
        quaternions = np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1)
        for values in (POSES.reshape(-1, 16), POSES.reshape(-1, 16)[:, :12], quaternions):
            for first in (0, 1):
                for taken in (order, range(FRAMES)):
                    rows = [[k + first, *values[k]] for k in taken]
                    sweep = self.load(self.write("counted.txt", table((), rows, " ")))
                    self.check(sweep)
                    self.assertIn(f"counts them from {first}, so it was taken for a frame's number, not for a time.", sweep.notes[-1])
        rows = [[k, *POSES[k].ravel()] for k in (2, 0, 1)]  # of fewer rows than frames the others have no pose
        self.check(self.load(self.write("counted.txt", table((), rows, " "))), TRUTH[:3], IMAGES[:3])

    def test_sequence_of_transforms_without_a_time(self):
        header = "ObjectType = Image\nNDims = 3\nDimSize = 0 0 7\n"
        for k in range(FRAMES):
            numbers = " ".join(repr(float(x)) for x in POSES[k].ravel())
            header += (f"Seq_Frame{k:04d}_ProbeTransform = {numbers}\nSeq_Frame{k:04d}_ProbeTransformStatus = "
                       f"{('ok', 'True', '1')[k % 3]}\nSeq_Frame{k:04d}_Timestamp = {1000 * TIMES[k]:.6g}\n")
        whole = header + "ElementDataFile = LOCAL\n"
        sweep = self.load(self.write("probe.seq.mha", whole))
        self.check(sweep, times=TIMES)
        self.assertIn("taken for milliseconds, because they are 50 apart", sweep.notes[0])
        sweep = self.load(self.write("probe.seq.mha", whole.replace("Seq_Frame0002_Timestamp = 100\n", "")))
        self.check(sweep)
        self.assertIn("1 of 7 frames have no time, so times are not used.", sweep.notes)

    def test_times_of_pictures_that_do_not_ascend_are_said(self):
        for stamps, said in ((TIMES[[0, 2, 1, 3, 4, 5, 6]], "1 come before the one in front of them and 0 have its time"),
                             (np.zeros(FRAMES), "0 come before the one in front of them and 6 have its time"), (TIMES, None)):
            rows = np.concatenate([stamps[:, None], POSES.reshape(-1, 16)], axis=1)
            sweep = self.load(self.write("times.csv", table(("time_s", *MATRIX_NAMES), rows)))
            self.check(sweep, times=stamps)
            self.assertEqual([said in note for note in sweep.notes], [True] if said else [])
        rows = [["" if k == 3 else repr(float(TIMES[k])), *POSES[k].ravel()] for k in range(FRAMES)]
        sweep = self.load(self.write("times.csv", table(("time_s", *MATRIX_NAMES), rows)))
        self.check(sweep)
        self.assertEqual(sweep.notes, ["1 of 7 frames have no time, so times are not used."])

    def test_units_inverse_and_reference(self):
        metres = POSES.copy()
        metres[:, :3, 3] /= 1000
        np.save(self.folder / "m.npy", metres)
        self.check(self.load(self.folder / "m.npy", units="m"))
        np.save(self.folder / "inverse.npy", np.linalg.inv(POSES))
        self.check(self.load(self.folder / "inverse.npy", inverse=True))
        fixed, _ = path_of_probe(TIMES + 3)
        np.save(self.folder / "fixed.npy", fixed)
        np.save(self.folder / "moved.npy", fixed @ POSES)
        self.check(self.load(self.folder / "moved.npy", reference=self.folder / "fixed.npy"))

    def test_calibration(self):
        calibration = np.eye(4)
        calibration[:3, :3], calibration[:3, 3] = turn([1, 2, 3], 0.7), [4, 5, 6]
        pixels = calibration @ SCALE
        np.save(self.folder / "c.npy", pixels)
        for path in (self.write("c.txt", table((), pixels, " ")), self.write("c.csv", "# mine\n" + table((), [pixels.ravel()])),
                     self.folder / "c.npy"):
            self.check(self.load(self.folder / "poses.npy", calibration=path, pixel_spacing=None), POSES @ pixels)
        rigid = self.write("rigid.txt", table((), calibration, " "))
        self.check(self.load(self.folder / "poses.npy", calibration=rigid), POSES @ pixels)
        # A calibration that counts pixels from 1: pixel (0, 0) is its (1, 1).
        sweep = self.load(self.folder / "poses.npy", calibration=path, pixel_spacing=None, first_pixel=1)
        np.testing.assert_allclose(sweep.poses @ [2, 3, 0, 1], POSES @ pixels @ [3, 4, 0, 1], atol=1e-9)

    def test_origin_in_the_middle_of_the_top(self):
        """As Ultra-NeRF has it: column i lies at (i - W/2) sw along x, rows go along y from the pose's origin."""
        sweep = self.load(self.folder / "poses.npy", origin_pixel=(WIDTH / 2, 0))
        for i, j in ((0, 0), (WIDTH - 1, HEIGHT - 1)):
            in_probe = [(i - WIDTH / 2) * SPACING[0], j * SPACING[1], 0, 1]
            np.testing.assert_allclose(sweep.poses @ [i, j, 0, 1], POSES @ in_probe, atol=1e-9)

    def test_crop_keeps_places(self):
        sweep = self.load(self.folder / "poses.npy", crop=(3, 2, 10, 8))
        np.testing.assert_array_equal(sweep.pixels, IMAGES[:, 2:10, 3:13])
        np.testing.assert_allclose(sweep.poses @ [1, 1, 0, 1], TRUTH @ [4, 3, 0, 1], atol=1e-9)

    def test_times(self):
        """A tracker of another rate: between its poses, on the shortest arc, and none where it saw nothing."""
        stamps = np.arange(0, 0.5, 1 / 60) + 100.003
        poses, quaternions = path_of_probe(stamps - 100)
        rows = np.concatenate([stamps[:, None], poses[:, :3, 3], quaternions], axis=1)
        path = self.write("tracker.csv", table(("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"), rows))
        images = sources.Images(IMAGES, TIMES)
        with mock.patch.object(sources, "read_images", return_value=images):
            sweep = self.load(path, time_offset=100.0)
            # At 0 s the tracker had not begun.
            self.check(sweep, TRUTH[1:], IMAGES[1:], TIMES[1:])
            self.assertEqual(sweep.notes[0], "Poses were interpolated at the times of the frames.")
            gap = rows[(stamps < 100.08) | (stamps > 100.22)]
            path = self.write("gap.csv", table(("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"), gap))
            kept = [1, 5, 6]
            self.check(self.load(path, time_offset=100.0, longest_gap=0.1), TRUTH[kept], IMAGES[kept], TIMES[kept])
            self.check(self.load(path, time_offset=100.0, longest_gap=0.5), TRUTH[1:], IMAGES[1:], TIMES[1:])
            seen_nothing = np.where((np.arange(len(rows)) % 5 == 3)[:, None] & (np.arange(8) > 0), 0.0, rows)
            path = self.write("lost.csv", table(("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"), seen_nothing))
            sweep = self.load(path, time_offset=100.0)
            self.check(sweep, TRUTH[1:], IMAGES[1:], TIMES[1:])
            self.assertIn(f"6 of 30 rows of {path} had no pose and were passed over.", sweep.notes)
            # As many poses as frames, but not at their times.
            path = self.write("seven.csv", table(("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw"), rows[:FRAMES]))
            self.assertEqual(len(self.load(path, time_offset=100.0).pixels), FRAMES)
            self.check(self.load(path, time_offset=100.0, by_time=True), TRUTH[1:3], IMAGES[1:3], TIMES[1:3])


class TimesOfEveryKind(InFolder):
    """A tracker's table beside pictures that have times."""

    NAMES = ("timestamp", "x", "y", "z", "qx", "qy", "qz", "qw")
    STAMPS = np.arange(0, 0.4, 1 / 60)
    ROWS = np.concatenate([STAMPS[:, None], path_of_probe(STAMPS)[0][:, :3, 3], path_of_probe(STAMPS)[1]], axis=1)

    def load(self, rows, names=NAMES, times=TIMES, **options):
        """The sweep, whose poses must be the true ones, and its notes."""
        path = self.write("tracker.csv", table(names, rows))
        with mock.patch.object(sources, "read_images", return_value=sources.Images(IMAGES, times)):
            sweep = sources.load(self.folder / "images.npy", path, pixel_spacing=SPACING, **options)
        self.check(sweep, TRUTH, IMAGES, times)
        return [note.replace(str(path), "tracker.csv") for note in sweep.notes if note != sources.INTERPOLATED]

    def test_repeated_times(self):
        self.assertEqual(self.load(self.ROWS), [])
        self.assertEqual(self.load(np.repeat(self.ROWS, 2, axis=0)),
                         ["24 of 48 rows of tracker.csv had the time of an earlier one and were left out."])
        # One that is written again much later comes after later ones, too.
        self.assertEqual(self.load(np.concatenate([self.ROWS, self.ROWS[5:6]])),
                         ["1 of 25 rows of tracker.csv stood after later ones; all were sorted by time.",
                          "1 of 25 rows of tracker.csv had the time of an earlier one and were left out."])

        # Pictures that have no times follow each other as the rows do.
        seven = np.concatenate([TIMES[:, None], POSES[:, :3, 3], QUATERNIONS], axis=1)
        twice = np.repeat(seven, 2, axis=0)
        path = self.write("twice.csv", table(self.NAMES, twice))
        sweep = sources.load(self.folder / "images.npy", path, pixel_spacing=SPACING)
        self.check(sweep, times=TIMES)
        self.assertIn(f"7 of 14 rows of {path} had the time of an earlier one and were left out.", sweep.notes)

    def test_a_row_a_frame_at_other_times_is_said(self):
        times = TIMES * [1, 1, 1, 1, 2, 2, 2]  # a video that skips, and as many poses as it has frames
        seven = np.concatenate([TIMES[:, None], POSES[:, :3, 3], QUATERNIONS], axis=1)
        self.assertRegex(self.load(seven, times=times)[0], "drift apart by 0.3 s; --by-time")
        self.assertEqual(self.load(seven, times=TIMES + 7), [])

    def test_rows_in_another_order(self):
        swapped = self.ROWS[[1, 0, *range(2, 24)]]
        said = "{} of 24 rows of tracker.csv stood after later ones; all were sorted by time."
        self.assertEqual(self.load(swapped), [said.format(1)])
        self.assertEqual(self.load(self.ROWS[::-1]), [said.format(23)])
        shuffled = self.ROWS[np.random.default_rng(1).permutation(24)]
        self.assertEqual(len(self.load(shuffled)), 1)
        # As many rows as frames: frames of a video follow each other in time, and so must poses.
        seven = np.concatenate([TIMES[:, None], POSES[:, :3, 3], QUATERNIONS], axis=1)
        self.assertEqual(self.load(seven[[0, 2, 1, 3, 4, 5, 6]]), [said.format(1).replace("24", "7")])

    def test_units(self):
        as_text = [[f"{time:.0f}" for time in 1e9 * self.STAMPS], *self.ROWS[:, 1:].T]
        nanoseconds = [list(row) for row in zip(*as_text)]
        said = "The times of tracker.csv are taken for nanoseconds, "
        for name in ("timestamp_ns", "Time (ns)", "time[nsec]", "t_nanoseconds"):
            self.assertEqual(self.load(nanoseconds, (name, *self.NAMES[1:])), [said + "by the name of their column."])
        for names in (self.NAMES, ("times", *self.NAMES[1:]), ()):
            self.assertEqual(self.load(nanoseconds, names)[-1:], [said + "because they are 1.667e+07 apart."])
        for factor, unit in ((1e6, "microseconds"), (1e3, "milliseconds")):
            rows = self.ROWS * [factor, *[1] * 7]
            self.assertIn(f"taken for {unit}, because", self.load(rows)[0])
            self.assertIn(f"taken for {unit}, by", self.load(rows, (f"time_{unit}", *self.NAMES[1:]))[0])
        # Since 1970, and a tracker of 240 Hz, whose milliseconds might be the seconds of a slow one.
        rows = self.ROWS * [1e9, *[1] * 7] + [1.7e18, *[0] * 7]
        poses = sources._in_seconds(sources.Poses(POSES, rows[:, 0], unit=None), None, "x", [])
        np.testing.assert_allclose(poses.times - 1.7e9, self.STAMPS, atol=1e-6)
        stamps = np.arange(0, 0.4, 1 / 240)
        poses, quaternions = path_of_probe(stamps)
        rows = np.concatenate([1000 * stamps[:, None], poses[:, :3, 3], quaternions], axis=1)
        self.assertEqual(self.load(rows), ["The times of tracker.csv are taken for milliseconds, because they are 4.167 apart."])


class ImagesOfEveryKind(InFolder):
    def load(self, images, poses="poses.npy", **options):
        return sources.load(images, self.folder / poses, **{"pixel_spacing": SPACING, **options})

    def test_numpy(self):
        wide = IMAGES.astype(np.uint16) * 257
        for array, expected in ((wide, wide), (IMAGES.astype(np.int64), IMAGES), (IMAGES[..., np.newaxis], IMAGES),
                                (IMAGES / 255, (IMAGES / 255).astype(np.float32)), (IMAGES > 99, (IMAGES > 99) * np.uint8(255)),
                                (np.repeat(IMAGES[..., np.newaxis], 3, axis=3), IMAGES)):
            np.save(self.folder / "array.npy", array)
            self.check(self.load(self.folder / "array.npy"), images=expected)
        colour = np.zeros((FRAMES, HEIGHT, WIDTH, 3), np.uint8)
        colour[..., 0], colour[..., 1], colour[..., 2] = 200, 100, 50
        np.save(self.folder / "colour.npy", colour)
        np.testing.assert_array_equal(self.load(self.folder / "colour.npy").pixels, round(0.299 * 200 + 0.587 * 100 + 0.114 * 50))

    def test_a_third_column_that_is_none(self):
        for matrices, third, spacing in ((POSES, 0 * POSES[..., 2], SPACING), (POSES, POSES[..., 0], SPACING),
                                         (TRUTH, 0 * TRUTH[..., 2], None), (TRUTH, -TRUTH[..., 2], None)):
            poses = matrices.copy()
            poses[:, :3, 2] = third[:, :3]
            np.save(self.folder / "poses.npy", poses)
            sweep = sources.load(self.folder / "images.npy", self.folder / "poses.npy", pixel_spacing=spacing)
            np.testing.assert_allclose(sweep.poses[..., [0, 1, 3]], TRUTH[..., [0, 1, 3]], atol=1e-12)
            self.assertTrue((np.linalg.det(sweep.poses[:, :3, :3]) > 0).all())
            self.assertTrue(any(f"third column of {FRAMES} of {FRAMES}" in note for note in sweep.notes), sweep.notes)

    def test_calibration_of_plus(self):
        flat = SCALE.copy()
        flat[:3, 2] = 0  # the third axis of a picture
        for matrix in (SCALE, flat):
            text = PLUS.format(table((), matrix, " "))
            for encoding in ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"):
                (self.folder / "plus.xml").write_bytes(text.encode(encoding))
                sweep = self.load(self.folder / "images.npy", pixel_spacing=None, calibration=self.folder / "plus.xml")
                np.testing.assert_allclose(sweep.poses[..., [0, 1, 3]], TRUTH[..., [0, 1, 3]], atol=1e-9)

    def test_tus_rec(self):
        """Against the formula of the challenge: a pixel counted from 1, scaled to mm, to the tool, to the tracker."""
        h5py = package("h5py")
        to_tool = np.eye(4)
        to_tool[:3, :3], to_tool[:3, 3] = turn([3, 1, 2], 1.1), [7, -8, 9]
        text = ("scaling_from_pixel_to_mm,,,\n" + table((), SCALE) + "spatial_calibration_from_image_to_tool,,,\n" +
                table((), to_tool))
        calibration = self.write("calib_matrix.csv", text)
        with h5py.File(self.folder / "scan.h5", "w") as file:
            file["frames"], file["tforms"] = IMAGES, POSES.astype(np.float32)
        with h5py.File(self.folder / "frames.h5", "w") as file:
            file["frames"] = IMAGES
        with h5py.File(self.folder / "transfs.h5", "w") as file:
            file["tforms"] = POSES.astype(np.float32)
        for paths in ((self.folder / "scan.h5",), (self.folder / "frames.h5", self.folder / "transfs.h5")):
            sweep = sources.load(*paths, calibration=calibration)
            np.testing.assert_array_equal(sweep.pixels, IMAGES)
            for i, j in ((0, 0), (WIDTH - 1, 0), (3, HEIGHT - 1)):
                theirs = POSES @ to_tool @ SCALE @ [i + 1, j + 1, 0, 1]
                np.testing.assert_allclose(sweep.poses @ [i, j, 0, 1], theirs, atol=1e-4)
            self.assertTrue(any("from 1" in note for note in sweep.notes))
        # Without headings, as older projects keep them.
        older = self.write("older.csv", table((), SCALE) + table((), to_tool))
        np.testing.assert_array_equal(sources.load(self.folder / "scan.h5", calibration=older).poses, sweep.poses)

    def test_hdf5_of_dualtrack(self):
        """Poses are those of the image's middle, and pixel_to_image leads there."""
        h5py = package("h5py")
        middle = np.eye(4)
        middle[:2, 3] = -(WIDTH - 1) / 2, -(HEIGHT - 1) / 2
        to_image = SCALE @ middle
        with h5py.File(self.folder / "sweep.h5", "w") as file:
            file["images"], file["images_small"], file["tracking"] = IMAGES, IMAGES[:, ::2, ::2], TRUTH @ np.linalg.inv(to_image)
            file["dimensions"], file["spacing"], file["pixel_to_image"] = [WIDTH, HEIGHT, 1], [*SPACING, 1], to_image
        sweep = sources.load(self.folder / "sweep.h5")
        self.check(sweep)
        self.assertTrue(any("pixel_to_image" in note for note in sweep.notes), sweep.notes)
        given = {"pixel_spacing": SPACING, "origin_pixel": ((WIDTH - 1) / 2, (HEIGHT - 1) / 2)}
        self.check(sources.load(self.folder / "sweep.h5", **given))

    def test_hdf5_with_many_scans(self):
        h5py = package("h5py")
        names = {"flat.h5": ("sub{:03d}_frames00", "sub{:03d}_tforms00"), "groups.h5": ("scan{}/us", "scan{}/probe"),
                 "deep.h5": ("data/{}/images", "data/{}/transforms")}
        for name, (images, poses) in names.items():
            with h5py.File(self.folder / name, "w") as file:
                for scan in range(2):
                    file[images.format(scan)], file[poses.format(scan)] = np.roll(IMAGES, scan, 0), np.roll(POSES, scan, 0)
                    file[poses.format(scan).replace("tforms", "tforms_inv") + "_inv" * ("tforms" not in poses)] = POSES
                file["num_frames"], file["sub_folders"] = np.full((12, 7), 5), [b"a", b"b"]
        for name, scan in (("flat.h5", "sub001_00"), ("flat.h5", "sub001"), ("deep.h5", "data/1"), ("groups.h5", "scan1")):
            if name != "groups.h5":
                self.check(sources.load(self.folder / name, pixel_spacing=SPACING, scan=scan), np.roll(TRUTH, 1, 0),
                           np.roll(IMAGES, 1, 0))
            named = [part.format(1) for part in names[name]]
            for dataset in (named, named[::-1]):
                self.check(sources.load(self.folder / name, pixel_spacing=SPACING, dataset=dataset), np.roll(TRUTH, 1, 0),
                           np.roll(IMAGES, 1, 0))

    def test_hdf5_with_scans_in_one_array(self):
        h5py = package("h5py")
        stacked = [np.stack([np.roll(array, scan, 0) for scan in range(3)]) for array in (IMAGES, POSES)]
        with h5py.File(self.folder / "stack.h5", "w") as file:
            file["frames"], file["tforms"] = stacked
            file["features"] = np.zeros((3, FRAMES, HEIGHT, WIDTH))  # of other shape and name
        with h5py.File(self.folder / "named.h5", "w") as file:
            file["us"], file["probe"] = stacked[0], stacked[1][:, :, :3]
            file["others"] = stacked[0]
        with h5py.File(self.folder / "one.h5", "w") as file:
            file["frames"], file["tforms"] = (array[:1] for array in stacked)
        with h5py.File(self.folder / "colours.h5", "w") as file:
            file["frames"], file["poses"] = np.repeat(stacked[0][..., None], 3, -1), stacked[1].reshape(3, FRAMES, 16)
        for name, options in (("stack.h5", {}), ("named.h5", {"dataset": ["us", "probe"]}), ("colours.h5", {})):
            for scan in (0, "2"):
                with self.subTest(name, scan=scan):
                    self.check(sources.load(self.folder / name, pixel_spacing=SPACING, scan=scan, **options),
                               np.roll(TRUTH, int(scan), 0), np.roll(IMAGES, int(scan), 0))
        self.check(sources.load(self.folder / "one.h5", pixel_spacing=SPACING))
        for scan in (None, "3", "-1", "second"):
            with self.subTest(scan=scan), self.assertRaisesRegex(sources.SourceError, "holds 3 scans.*--scan.*0 to 2"):
                sources.load(self.folder / "stack.h5", pixel_spacing=SPACING, scan=scan)

    def test_hdf5_with_an_array_a_frame(self):
        h5py = package("h5py")
        with h5py.File(self.folder / "frames.h5", "w") as file:
            for scan in range(2):
                for k, shift in enumerate(np.roll(np.arange(FRAMES), scan)):
                    name = f"sub000_scan{scan:02d}_{{}}{k:d}"  # 10 after 9
                    file[name.format("frame")], file[name.format("tform")] = IMAGES[shift], POSES[shift]
                    file[name.format("tform_inv")] = np.linalg.inv(POSES[shift])
            file["frame_size"], file["num_frames"] = [HEIGHT, WIDTH], [[FRAMES, FRAMES]]
        self.check(sources.load(self.folder / "frames.h5", pixel_spacing=SPACING, scan="scan01"), np.roll(TRUTH, 1, 0),
                   np.roll(IMAGES, 1, 0))
        with self.assertRaisesRegex(sources.SourceError, "holds 2 scans: sub000_scan00, sub000_scan01"):
            sources.load(self.folder / "frames.h5", pixel_spacing=SPACING)

    def test_arrays_of_other_names(self):
        h5py = package("h5py")
        with h5py.File(self.folder / "own.h5", "w") as file:
            file["us"], file["probe"], file["position"] = IMAGES, POSES, POSES[:, :3, 3]
        self.check(sources.load(self.folder / "own.h5", pixel_spacing=SPACING))  # no other array has their shapes
        np.savez(self.folder / "own.npz", us=IMAGES, probe=POSES)
        for dataset in (("us", "probe"), ("/probe", "/us")):
            self.check(sources.load(self.folder / "own.npz", pixel_spacing=SPACING, dataset=dataset))
        rows = np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1)
        with h5py.File(self.folder / "rows.h5", "w") as file:
            file["us"], file["camera"], file["table"] = IMAGES, IMAGES[::-1], rows
        self.check(sources.load(self.folder / "rows.h5", pixel_spacing=SPACING, dataset=("table", "us")))
        self.check(sources.load(self.folder / "rows.h5", self.folder / "poses.npy", pixel_spacing=SPACING, dataset="us"))
        with h5py.File(self.folder / "links.h5", "w") as file:
            file["raw/a"], file["raw/b"], file["poses"] = IMAGES, IMAGES[::-1], POSES
            file["frames"] = h5py.SoftLink("/raw/a")
            file["images"] = h5py.SoftLink("/nowhere")
        self.check(sources.load(self.folder / "links.h5", pixel_spacing=SPACING))

    def test_damaged_files_say_so_in_one_line(self):
        """Whatever a package raises while it reads, such as zipfile.BadZipFile or TypeError."""
        whole = self.folder / "whole.npz"
        np.savez_compressed(whole, images=IMAGES)
        data = bytearray(whole.read_bytes())
        for at in range(40, len(data) - 10, max(1, len(data) // 25)):
            changed = bytes(data[:at]) + bytes([data[at] ^ 0x55]) + bytes(data[at + 1 :])
            (self.folder / "damaged.npz").write_bytes(changed)
            try:
                self.load(self.folder / "damaged.npz")
            except ValueError as error:
                self.assertIn("damaged.npz", str(error))
        header = "Seq_Frame9999999_XToYTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\nElementDataFile = LOCAL\n"
        (self.folder / "far.seq.mha").write_text(header)
        with self.assertRaisesRegex(ValueError, "names frame 9999999"):
            self.load(self.folder / "whole.npz", "far.seq.mha")
        rows = [[2.0**63, *POSES[0].ravel()]] + [[float(k), *POSES[k].ravel()] for k in range(1, FRAMES)]
        self.write("far.csv", table(["frame", *MATRIX_NAMES], rows))
        with self.assertRaisesRegex(ValueError, "far.csv: line 2, column frame"):
            self.load(self.folder / "whole.npz", "far.csv")

    def test_pictures(self):
        cv2 = package("cv2")
        names = [f"frame_{k}.png" for k in range(8, 8 + FRAMES)]  # frame_10 comes after frame_9
        (self.folder / "frames").mkdir()
        for name, image in zip(names, IMAGES):
            cv2.imwrite(str(self.folder / "frames" / name), image)
        self.check(self.load(self.folder / "frames"))
        self.check(self.load(self.write("list.txt", "# backwards\n" + "\n".join(f"frames/{name}" for name in names[::-1]))),
                   images=IMAGES[::-1])
        for name, image in zip(names, IMAGES):  # red, which OpenCV keeps last
            cv2.imwrite(str(self.folder / "frames" / name), np.stack([0 * image, 0 * image, image], axis=2))
        red = ((299 * IMAGES.astype(int) + 500) // 1000).astype(np.uint8)
        self.check(self.load(self.folder / "frames"), images=red)
        package("imageio")
        with mock.patch.dict(sys.modules, {"cv2": None}):
            self.check(self.load(self.folder / "frames"), images=red)

    def picture_folder(self, names):
        """Pictures of these names, one a frame, and what reads each, so that no package is needed."""
        folder = self.folder / "named"
        folder.mkdir()
        for name in names:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text("")
        images = {str(folder / name): image for name, image in zip(names, IMAGES)}
        patch = mock.patch.object(sources, "_picture", side_effect=lambda path: images[str(path)])
        patch.start()
        self.addCleanup(patch.stop)
        return folder

    def test_rows_name_their_pictures(self):
        names = [f"frame_{k}.png" for k in range(5, 5 + FRAMES)]  # up to frame_11
        folder = self.picture_folder(names)
        glob = sorted(range(FRAMES), key=lambda k: names[k])  # frame_10 before frame_5
        self.assertNotEqual(glob, list(range(FRAMES)))
        spellings = (lambda k: names[k], lambda k: f"named/{names[k]}", lambda k: f"C:\\scan\\{names[k]}", lambda k: f"/far/{names[k]}",
                     lambda k: names[k][:-4], lambda k: str(k + 5), lambda k: str(k))
        for title in ("image", "Filename", "File name", "picture", "file"):
            for spelling in spellings:
                for rows in (glob, glob[::2]):
                    with self.subTest(title=title, cell=spelling(0), rows=len(rows)):
                        text = table((title, *MATRIX_NAMES), [[spelling(k), *POSES[k].ravel()] for k in rows])
                        sweep = self.load(folder, self.write("named.csv", text))
                        self.check(sweep, TRUTH[sorted(rows)], IMAGES[sorted(rows)])
        for title, cell, part in (("image", "frame_99.png", "names none of the 7 pictures (frame_5.png, frame_6.png, ...)"),
                                  ("frame", "frame_5.png", "; a frame's number"), ("file", "", "names none of the 7 pictures"),
                                  ("file", "12", "names frame 12, but there are 7"), ("frame_id", "world", "; a frame's number")):
            with self.subTest(title=title, cell=cell), self.assertRaises(sources.SourceError) as caught:
                text = table((title, *MATRIX_NAMES), [[cell, *POSES[k].ravel()] for k in range(FRAMES)])
                self.load(folder, self.write("bad.csv", text))
            self.assertIn(f"bad.csv: line 2, column {title}: '{cell}'{part if part[0] == ';' else ' ' + part}", str(caught.exception))
            self.assertIn("Rename the column where it holds something else", str(caught.exception))
        text = table(("image", *MATRIX_NAMES), [["frame_5.png", *POSES[k].ravel()] for k in range(2)])
        with self.assertRaisesRegex(sources.SourceError, "line 3, column image: 'frame_5.png' names a frame twice"):
            self.load(folder, self.write("bad.csv", text))
        with self.assertRaisesRegex(sources.SourceError, "names a picture, but the images are not files with names"):
            self.load(self.folder / "images.npy", "bad.csv")

    def test_pictures_of_one_name_in_several_folders(self):
        names = [f"{side}/{k}.png" for k in range(4) for side in ("left", "right")][:FRAMES]
        self.picture_folder(names)
        self.write("list.txt", "\n".join(f"named/{name}" for name in names))
        rows = [[names[k], *POSES[k].ravel()] for k in range(FRAMES)][::-1]
        self.check(self.load(self.folder / "list.txt", self.write("named.csv", table(("image", *MATRIX_NAMES), rows))))
        rows[1][0] = "0.png"
        with self.assertRaisesRegex(sources.SourceError, "line 3, column image: '0.png' names 2 of the 7 pictures"):
            self.load(self.folder / "list.txt", self.write("named.csv", table(("image", *MATRIX_NAMES), rows)))

    def test_video(self):
        cv2 = package("cv2")
        large = np.kron(IMAGES, np.ones((1, 8, 8), np.uint8))  # coders ask for some pixels
        writer = cv2.VideoWriter(str(self.folder / "scan.avi"), cv2.VideoWriter_fourcc(*"FFV1"), 20, large.shape[:0:-1])
        if not writer.isOpened():
            self.skipTest("OpenCV has no lossless coder here")
        for image in large:
            writer.write(np.repeat(image[..., np.newaxis], 3, axis=2))
        writer.release()
        rows = np.concatenate([TIMES[:, None], POSES.reshape(-1, 16)], axis=1)
        self.write("poses.csv", table(("timestamp", *MATRIX_NAMES), rows))
        sweep = self.load(self.folder / "scan.avi", "poses.csv")
        self.assertLess(np.abs(sweep.pixels.astype(int) - large).max(), 3)  # limited range of video
        np.testing.assert_allclose(sweep.times, TIMES, atol=1e-3)
        np.testing.assert_allclose(sweep.poses, TRUTH, atol=1e-9)
        package("imageio_ffmpeg")
        with mock.patch.dict(sys.modules, {"cv2": None}):
            again = self.load(self.folder / "scan.avi", "poses.csv")
        self.assertLess(np.abs(again.pixels.astype(int) - large).max(), 3)
        np.testing.assert_allclose(again.times, TIMES, atol=1e-3)

    def test_video_of_variable_rate(self):
        """A recorder that skips: the times of the frames are those in the file, not those that a rate would give."""
        cv2 = package("cv2")
        large = np.kron(IMAGES, np.ones((1, 8, 8), np.uint8))
        writer = cv2.VideoWriter(str(self.folder / "even.mp4"), cv2.VideoWriter_fourcc(*"mp4v"), 20, large.shape[:0:-1])
        if not writer.isOpened():
            self.skipTest("OpenCV has no coder for .mp4 here")
        for image in large:
            writer.write(np.repeat(image[..., np.newaxis], 3, axis=2))
        writer.release()
        steps = [1, 1, 9, 1, 3, 1, 1]
        times = np.cumsum([0, *steps[:-1]]) / 20
        (self.folder / "uneven.mp4").write_bytes(with_steps((self.folder / "even.mp4").read_bytes(), steps))
        stamps = np.arange(0, times[-1] + 0.02, 0.01)
        self.write("tracker.csv", table(("timestamp", *MATRIX_NAMES),
                                        np.concatenate([stamps[:, None], path_of_probe(stamps)[0].reshape(-1, 16)], axis=1)))
        for name, expected in (("even.mp4", TIMES), ("uneven.mp4", times)):
            sweep = self.load(self.folder / name, "tracker.csv")
            np.testing.assert_allclose(sweep.times, expected, atol=1e-3)
            np.testing.assert_allclose(sweep.poses, path_of_probe(expected)[0] @ SCALE, atol=0.06)  # mm in 1 ms

    def dicom(self, name="scan.dcm", **elements):
        pydicom = package("pydicom")
        from pydicom.dataset import FileDataset, FileMetaDataset
        meta = FileMetaDataset()
        meta.MediaStorageSOPClassUID = pydicom.uid.UltrasoundMultiFrameImageStorage
        meta.MediaStorageSOPInstanceUID = pydicom.uid.generate_uid()
        meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
        data = FileDataset(name, {}, file_meta=meta, preamble=b"\0" * 128)
        data.SOPClassUID, data.SOPInstanceUID = meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID
        data.Rows, data.Columns, data.NumberOfFrames, data.SamplesPerPixel = HEIGHT, WIDTH, FRAMES, 1
        data.BitsAllocated = data.BitsStored = 8
        data.HighBit, data.PixelRepresentation = 7, 0
        data.PhotometricInterpretation, data.PixelData = "MONOCHROME2", IMAGES.tobytes()
        for key, value in elements.items():
            if value is None:
                delattr(data, key)
            else:
                setattr(data, key, value)
        data.save_as(self.folder / name)
        return self.folder / name

    def test_dicom(self):
        pydicom = package("pydicom")
        self.check(self.load(self.dicom(FrameTime=50.0)), times=TIMES)
        self.check(self.load(self.dicom("noending", FrameTimeVector=[0.0] + [50.0] * (FRAMES - 1))), times=TIMES)
        region = pydicom.Dataset()
        region.RegionSpatialFormat, region.PhysicalUnitsXDirection, region.PhysicalUnitsYDirection = 1, 3, 3
        region.PhysicalDeltaX, region.PhysicalDeltaY = SPACING[0] / 10, SPACING[1] / 10  # cm
        sweep = self.load(self.dicom(SequenceOfUltrasoundRegions=pydicom.Sequence([region])), pixel_spacing=None)
        self.check(sweep)
        self.assertIn("Pixels are 0.3 x 0.4 mm, by the file of the images.", sweep.notes)
        self.check(self.load(self.dicom(PhotometricInterpretation="MONOCHROME1")), images=255 - IMAGES)
        colour = {"SamplesPerPixel": 3, "PlanarConfiguration": 0, "PhotometricInterpretation": "RGB",
                  "PixelData": np.repeat(IMAGES[..., np.newaxis], 3, axis=3).tobytes()}
        self.check(self.load(self.dicom(**colour)))
        ybr = np.stack([IMAGES, 0 * IMAGES + 128, 0 * IMAGES + 128], axis=3)  # no colour
        self.check(self.load(self.dicom(**{**colour, "PhotometricInterpretation": "YBR_FULL", "PixelData": ybr.tobytes()})))
        wide = {"BitsAllocated": 16, "BitsStored": 12, "HighBit": 11, "PixelData": (IMAGES.astype(np.uint16) * 16).tobytes()}
        self.check(self.load(self.dicom(**wide)), images=(IMAGES.astype(np.uint32) * 16 * 65535 // 4095).astype(np.uint16))

    def test_of_a_dicom_file_only_frames_times_and_sizes_get_into_the_sweep(self):
        package("pydicom")
        who = {"PatientName": "DOE^JANE", "PatientID": "DOE-4711", "InstitutionName": "St. DOE", "StudyDescription": "of JANE",
               "PatientBirthDate": "19470711", "StudyDate": "20240501", "ImageComments": "DOE", "FrameTime": 50.0}
        (self.folder / "JANE").mkdir()
        path = self.dicom("JANE/DOE.dcm", **who, BurnedInAnnotation="YES")
        sweep = self.load(path)
        self.check(sweep, times=TIMES)
        self.assertTrue(any("BurnedInAnnotation" in note for note in sweep.notes))
        self.assertFalse(any("BurnedIn" in note for note in self.load(path, crop=(0, 0, WIDTH, HEIGHT)).notes))
        self.assertFalse(any("BurnedIn" in note for note in self.load(self.dicom(FrameTime=50.0)).notes))
        try:
            import bigus
        except ImportError:
            self.skipTest("the package bigus is not built")
        written = self.folder / "sweep.igs.mha"
        bigus.write(bigus.from_files(path, self.folder / "poses.npy", pixel_spacing=SPACING), written)
        header = written.read_bytes().split(b"ElementDataFile")[0]
        for text in (b"DOE", b"JANE", b"4711", b"1947", b"2024"):
            self.assertNotIn(text, header)

    def test_claims_are_checked_before_packages_see_them(self):
        """What a file of some bytes claims to hold, which a package would make room for."""
        h5py = package("h5py")

        def refused(path, part="more than [0-9]+ bytes can hold"):
            with self.assertRaisesRegex(sources.SourceError, part) as caught:
                self.load(path)
            self.assertIn(path.name, str(caught.exception))

        with h5py.File(self.folder / "empty.h5", "w") as file:
            file.create_dataset("frames", (FRAMES, 30000, 30000), np.uint8, chunks=(1, 1000, 1000), compression="gzip")
        refused(self.folder / "empty.h5")
        refused(self.dicom(Rows=60000, Columns=60000))

    def test_pictures_are_as_large_as_they_claim(self):
        cv2 = package("cv2")
        image = np.kron(IMAGES[0], np.ones((2, 2), np.uint8))
        height, width = image.shape
        folder = self.folder / "pictures"
        folder.mkdir()
        for kind, order in (("png", ">II"), ("jpg", ">HH"), ("bmp", "<ii"), ("tif", "<HH")):
            with self.subTest(kind):
                cv2.imwrite(str(folder / f"1.{kind}"), image)
                whole = (folder / f"1.{kind}").read_bytes()
                size = (height, width) if kind == "jpg" else (width, height)
                np.testing.assert_allclose(sources._picture(folder / f"1.{kind}"), image, atol=255 if kind == "jpg" else 0)
                if kind == "tif":  # tags of short numbers
                    old = [struct.pack("<HHIHH", tag, 3, 1, side, 0) for tag, side in zip((256, 257), size)]
                    new = [struct.pack("<HHIHH", tag, 3, 1, 65000, 0) for tag in (256, 257)]
                else:
                    old, new = [struct.pack(order, *size)], [struct.pack(order, 65000, 65000)]
                for one, other in zip(old, new):
                    self.assertEqual(whole.count(one), 1, one)
                    whole = whole.replace(one, other)
                (folder / f"1.{kind}").write_bytes(whole)
                with self.assertRaisesRegex(sources.SourceError, f"1[.]{kind}.*can hold"):
                    sources._picture(folder / f"1.{kind}")

    def test_a_png_whose_chunk_claims_more_than_the_file_has(self):
        cv2 = package("cv2")
        cv2.imwrite(str(self.folder / "1.png"), IMAGES[0])
        whole = (self.folder / "1.png").read_bytes()
        at = whole.index(b"IDAT")
        (self.folder / "1.png").write_bytes(whole[:at - 4] + struct.pack(">I", 500 << 20) + whole[at:])
        with mock.patch.object(cv2, "imread") as read, self.assertRaisesRegex(sources.SourceError, "1[.]png: not a picture"):
            sources._picture(self.folder / "1.png")
        read.assert_not_called()

    def test_bad_dicom(self):
        def refused(path, part):
            with self.assertRaisesRegex(sources.SourceError, part) as caught:
                self.load(path)
            self.assertIn(path.name, str(caught.exception))

        refused(self.dicom(PixelData=None), "PixelData is missing")
        refused(self.dicom(NumberOfFrames=1, PixelData=IMAGES[0].tobytes()), "NumberOfFrames is 1")
        doubled = self.dicom(FrameTime=50.0, Rows=HEIGHT // 2)
        refused(doubled, f"NumberOfFrames is {FRAMES}, but PixelData hold {2 * FRAMES} frames")
        refused(self.dicom(PhotometricInterpretation="PALETTE COLOR"), "PALETTE COLOR")
        whole = self.dicom().read_bytes()
        (self.folder / "cut.dcm").write_bytes(whole[:len(whole) - 700])
        refused(self.folder / "cut.dcm", "cannot be decoded")
        refused(self.write("text.dcm", "hello"), "not a DICOM file")


class Page(InFolder):
    def test_lines_of_the_page(self):
        """Every line of Sources.md, on files of these names; those whose package is missing here are left out."""
        lines = re.findall(r"`python3 -m bigus\.convert (.*?)`", (ROOT / "Module" / "Python" / "Sources.md").read_text())
        lines = [line for line in lines if not line.startswith("IMAGES")]
        self.assertEqual(len(lines), 12)
        specification = importlib.util.spec_from_file_location("convert", FOLDER / "convert.py")
        convert = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(convert)
        rows = POSES.reshape(-1, 16)
        self.write("poses.csv", table(MATRIX_NAMES, rows))
        self.write("probe.txt", table((), SCALE, " "))
        self.write("calib_matrix.csv", "a\n" + table((), SCALE) + "b\n" + table((), np.eye(4)))
        stamps = np.arange(-0.1, 0.6, 1 / 60) + 100
        self.write("tracker.csv", table(("timestamp", *MATRIX_NAMES),
                                        np.concatenate([stamps[:, None], path_of_probe(stamps - 100)[0].reshape(-1, 16)], axis=1)))
        skipped = []
        try:
            h5py = package("h5py")
            for name in ("scan.h5", "frames.h5", "transfs.h5"):
                with h5py.File(self.folder / name, "w") as file:
                    file["frames"], file["tforms"] = IMAGES, POSES
            with h5py.File(self.folder / "scans.h5", "w") as file:
                for scan in range(2):
                    file[f"sub{scan:03d}_frames00"], file[f"sub{scan:03d}_tforms00"] = IMAGES, POSES
            with h5py.File(self.folder / "dualtrack.h5", "w") as file:
                file["images"], file["tracking"], file["pixel_to_image"] = IMAGES, POSES, SCALE
            with h5py.File(self.folder / "own.h5", "w") as file:
                file["us"], file["camera"], file["probe"] = IMAGES, IMAGES, POSES
        except unittest.SkipTest:
            skipped += ["scan.h5", "frames.h5", "scans.h5", "dualtrack.h5", "own.h5"]
        try:
            cv2 = package("cv2")
            (self.folder / "frames").mkdir()
            for k, image in enumerate(IMAGES):
                cv2.imwrite(str(self.folder / "frames" / f"{k}.png"), image)
            self.write("frames.txt", "\n".join(f"frames/{k}.png" for k in range(FRAMES)))
            writer = cv2.VideoWriter(str(self.folder / "video.avi"), cv2.VideoWriter_fourcc(*"FFV1"), 20, (128, 96))
            for image in np.kron(IMAGES, np.ones((1, 8, 8), np.uint8)):
                writer.write(np.repeat(image[..., np.newaxis], 3, axis=2))
            writer.release()
        except unittest.SkipTest:
            skipped += ["frames", "frames.txt", "video.avi"]
        try:
            ImagesOfEveryKind.dicom(self, FrameTime=50.0)
        except unittest.SkipTest:
            skipped.append("scan.dcm")
        skipped.append("images.seq.nrrd")  # needs the package; Program has it
        for line in lines:
            options = vars(convert.parser().parse_args(line.split()))
            self.assertEqual(options.pop("output"), "sweep.igs.mha")
            if options["images"] in skipped:
                continue
            with self.subTest(line):
                for name in ("images", "poses", "calibration"):
                    options[name] = options[name] and self.folder / options[name]
                sweep = sources.load(**options)
                self.assertEqual(len(sweep.pixels), FRAMES)
                if "--crop" not in line:
                    np.testing.assert_array_equal(sweep.pixels, IMAGES)
                shift = {"--origin-pixel": [-8, 0], "--crop": [16, 8], "calib_matrix": [1, 1]}
                i, j = next((offset for word, offset in shift.items() if word in line), [0, 0])
                np.testing.assert_allclose(sweep.poses @ [0, 0, 0, 1], TRUTH @ [i, j, 0, 1], atol=1e-4)


class BadFiles(InFolder):
    def refused(self, part, images="images.npy", poses="poses.npy", kind=None, **options):
        """One error that names the file and the part."""
        poses = poses and self.folder / poses
        with self.assertRaises(kind or sources.SourceError) as caught:
            sources.load(self.folder / images, poses, **{"pixel_spacing": SPACING, **options})
        self.assertIn(part, str(caught.exception))
        if kind is None:
            self.assertIn(str(self.folder), str(caught.exception))

    def test_images(self):
        for name, array, part in (("shape", IMAGES[0], "(12, 16)"), ("empty", IMAGES[:0], "(0, 12, 16)"),
                                  ("range", IMAGES.astype(float), "divide them"), ("nan", IMAGES / np.nan, "nan to nan"),
                                  ("negative", -IMAGES.astype(int), "uint8, uint16 or float"),
                                  ("large", IMAGES.astype(int) * 1000, "uint8, uint16 or float"),
                                  ("complex", IMAGES * 1j, "complex128"),
                                  ("channels", np.zeros((FRAMES, HEIGHT, WIDTH, 2), np.uint8), "(7, 12, 16, 2)"),
                                  ("colours", np.zeros((FRAMES, HEIGHT, WIDTH, 3)), "colours of float64")):
            np.save(self.folder / f"{name}.npy", array)
            self.refused(part, f"{name}.npy")
        self.refused("no such file", "none.npy")
        np.save(self.folder / "objects.npy", np.array([{}], object), allow_pickle=True)
        self.refused("not an array", "objects.npy")
        whole = (self.folder / "images.npy").read_bytes()
        (self.folder / "cut.npy").write_bytes(whole[:300])
        self.refused("not an array", "cut.npy")
        np.savez(self.folder / "names.npz", a=IMAGES, b=POSES)
        self.refused("holds a, b; images are expected under the name images or frames", "names.npz", None)
        self.refused("images only", poses=None)
        self.write("scan.xyz", "hello")
        self.refused(".xyz is not read", "scan.xyz")
        (self.folder / "nothing").mkdir()
        self.refused("holds no picture", "nothing")
        self.write("list.txt", "\n# nothing\n")
        self.refused("names no picture", "list.txt")
        for name in ("missing.png", "/dev/zero", "a" * 5000):  # a device need not end, and no file has so long a name
            self.write("list.txt", f"# nothing\n{name}\n")
            self.refused("list.txt: line 2 names", "list.txt")
        (self.folder / "binary.txt").write_bytes(b"\xfd\xff\x00\x01")
        self.refused("not text", "binary.txt")

    def test_images_that_need_a_package(self):
        for module, name in (("h5py", "scan.h5"), ("pydicom", "scan.dcm")):
            self.write(name, "hello")
            with mock.patch.dict(sys.modules, {module: None}):
                self.refused(f"needs the package {module}", name)
        self.write("scan.mp4", "hello")
        with mock.patch.dict(sys.modules, {"cv2": None, "imageio": None}):
            self.refused("needs the package imageio", "scan.mp4")

    def test_hdf5(self):
        h5py = package("h5py")
        self.write("text.h5", "hello")
        self.refused("not an HDF5 file", "text.h5")
        with h5py.File(self.folder / "names.h5", "w") as file:
            file["us"], file["frames/inner"] = IMAGES, IMAGES
        self.refused("holds frames, us; images are expected", "names.h5")
        with h5py.File(self.folder / "images.h5", "w") as file:
            file["frames"] = IMAGES
        self.refused("poses are expected under the name poses or tforms", "images.h5", None)
        with h5py.File(self.folder / "scans.h5", "w") as file:
            for scan in range(12):
                file[f"scan_{scan:02d}/frames"], file[f"scan_{scan:02d}/tforms"] = IMAGES, POSES
        self.refused("holds 12 scans: scan_00, scan_01", "scans.h5", None)
        self.refused("has no scan scan_99; there are scan_00, scan_01", "scans.h5", None, scan="scan_99")
        self.refused("'scan_0' is part of the names of 10 scans: scan_00", "scans.h5", None, scan="scan_0")
        self.refused("has no array us; there are scan_00, scan_00/frames", "scans.h5", None, dataset=["us"])
        self.refused("only HDF5", kind=ValueError, scan="scan_00")
        with h5py.File(self.folder / "several.h5", "w") as file:
            file["left"], file["right"], file["probe"] = IMAGES, IMAGES, POSES
        self.refused("there are left (7, 12, 16), right (7, 12, 16); name one by dataset", "several.h5", None)
        self.refused("there are left (7, 12, 16), right", "several.h5", None, dataset=["left", "right"])
        whole = (self.folder / "images.h5").read_bytes()
        (self.folder / "cut.h5").write_bytes(whole[:len(whole) // 2])
        self.refused("cut off", "cut.h5")

    def test_pictures_and_videos(self):
        cv2 = package("cv2")
        (self.folder / "frames").mkdir()
        self.write("frames/a.png", "hello")
        self.refused("a.png: not a picture", "frames")
        cv2.imwrite(str(self.folder / "frames" / "a.png"), IMAGES[0])
        cv2.imwrite(str(self.folder / "frames" / "b.png"), IMAGES[0][:5])
        self.refused("b.png: 16 x 5 pixels of uint8", "frames")
        self.write("scan.mp4", "hello")
        self.refused("no frame can be read", "scan.mp4")

    def test_poses(self):
        flat, names = POSES.reshape(-1, 16), MATRIX_NAMES
        quaternion_names = ("x", "y", "z", "qx", "qy", "qz", "qw")
        quaternions = np.concatenate([POSES[:, :3, 3], QUATERNIONS], axis=1)

        def changed(rows, row, column, value):
            rows = [list(one) for one in rows]
            rows[row][column] = value
            return rows

        cases = {
            "is empty": "\n# only a comment\n",
            "no row": table(names, []),
            "line 4, column m11: 'x' is not a number": table(names, changed(flat, 2, 5, "x")),
            "has 15 cells": table(names, [flat[0], flat[1][:15]]),
            "5 numbers a row": table((), flat[:, :5]),
            "m00 to m33, or x, y, z": table(("a", "b"), flat[:, :2]),
            "row 3: the matrix ends with": table(names, changed(flat, 3, 14, 5.0)),
            "column by column": table(names, POSES.transpose(0, 2, 1).reshape(-1, 16)),
            "row 1: the quaternion has length": table(quaternion_names, changed(quaternions, 1, 3, 5.0)),
            "row 0: the matrix is no rotation": table(names, TRUTH.reshape(-1, 16)),
            "its determinant is -1": table(names, (POSES @ np.diag([-1, 1, 1, 1])).reshape(-1, 16)),
            "3 poses for 7 frames": table(names, flat[:3]),
            "line 2, column frame: '99.0' names frame 99, but there are 7, counted from 0. Rename": table(("frame", *names), [[99, *flat[0]]]),
            "names a frame twice": table(("frame", *names), [[1, *flat[0]], [1, *flat[0]]]),
            "line 2, column frame: '1.5'; a frame's number": table(("frame", *names), [[1.5, *flat[0]]]),
            "no frame has a pose": table(("status", *names), [["LOST", *row] for row in flat]),
        }
        for part, text in cases.items():
            with self.subTest(part):
                self.write("bad.csv", text)
                self.refused(part, poses="bad.csv")
        (self.folder / "bad.csv").write_bytes(b"\xfd\xff\x00\x01")
        self.refused("not text", poses="bad.csv")
        self.refused("no such file", poses="none.csv")
        for name, array in (("shape", POSES[:, :2]), ("words", np.array(["a"])), ("none", POSES[:0])):
            np.save(self.folder / f"{name}.npy", array)
            self.refused("poses of shape", poses=f"{name}.npy")

    def test_size_of_pixels(self):
        self.refused("say nothing of a pixel's size", pixel_spacing=None)
        self.refused("Is the unit", calibration=self.write("c.txt", table((), np.diag([300.0, 400, 300, 1]))), pixel_spacing=None)
        for spacing in ((0, 1), (0.3, -0.4), (0.3, np.nan), (0.3,), (99, 1)):
            self.refused("pixel_spacing", kind=ValueError, pixel_spacing=spacing)

    def test_sequence(self):
        def text(*names):
            return "DimSize = 0 0 1\n" + "".join(f"Seq_Frame0000_{name}\n" for name in names) + "ElementDataFile = LOCAL\n"

        identity = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
        for part, content in (("has 0 transforms", text()),
                              ("has 2 transforms", text(f"ATransform = {identity}", f"BTransform = {identity}")),
                              ("ATransform: 3 numbers", text("ATransform = 1 2 3")),
                              ("'x' is not a number", text(f"ATransform = x{identity[1:]}"))):
            self.write("bad.seq.mha", content)
            self.refused(part, poses="bad.seq.mha")

    def test_calibration(self):
        for part, text in (("15 numbers", table((), [np.eye(4).ravel()[:15]])), ("'x' is not a number", "x"[:0] + "1 2 3 4\n1 x 3 4\n"),
                           ("singular", table((), np.diag([1, 0, 1, 1]))), ("0 numbers", "nothing\n"),
                           ("StylusToProbe; ImageToProbe is expected", PLUS.replace("Image", "Stylus")),
                           ("not a Plus configuration", "<a>"), ("it defines entities", "<!DOCTYPE a [<!ENTITY b 'c'>]><a/>"),
                           ("15 numbers", PLUS.format(" ".join(["1"] * 15))), ("'x' is not a number", PLUS.format("x")),
                           ("the matrix ends with", table((), np.ones((4, 4))))):
            with self.subTest(part):
                self.refused(part, calibration=self.write("bad.txt", text))
        self.refused("no such file", calibration=self.folder / "none.txt")

    def test_times(self):
        rows = np.concatenate([TIMES[:3, None], POSES.reshape(-1, 16)[:3]], axis=1)
        self.write("three.csv", table(("timestamp", *MATRIX_NAMES), rows))
        self.refused("the images have no times", poses="three.csv")
        with mock.patch.object(sources, "read_images", return_value=sources.Images(IMAGES, TIMES)):
            np.save(self.folder / "three.npy", POSES[:3])
            self.refused("the poses have no times", poses="three.npy")
            again = POSES[:3] + np.pad([[50.0]], ((0, 3), (3, 0)))  # elsewhere, and the clock begins anew
            twice = np.concatenate([rows, np.concatenate([TIMES[:3, None] + 0.02, again.reshape(-1, 16)], axis=1)])
            self.write("twice.csv", table(("timestamp", *MATRIX_NAMES), twice))
            self.refused("times must increase. Are these two recordings?", poses="twice.csv")
            self.write("three.csv", table(("timestamp", *MATRIX_NAMES), rows[:1]))
            self.refused("two are needed", poses="three.csv")

    def test_arguments(self):
        for part, options in (("units", {"units": "inch"}), ("quaternion", {"quaternion": "zyxw"}),
                              ("first_pixel", {"first_pixel": 2}), ("crop", {"crop": (0, 0, 99, 5)}),
                              ("crop", {"crop": (-1, 0, 5, 5)}), ("crop", {"crop": (0, 0, 0, 5)})):
            self.refused(part, kind=ValueError, **options)


class Program(InFolder):
    def run_convert(self, *arguments):
        return subprocess.run([sys.executable, "-m", "bigus.convert", *map(str, arguments)], capture_output=True, text=True,
                              cwd=self.folder)

    def write_pngs(self, names):
        """A PNG a frame in the folder frames."""
        (self.folder / "frames").mkdir()
        raw = [zlib.compress(b"".join(b"\0" + row.tobytes() for row in image)) for image in IMAGES]
        for name, data in zip(names, raw):
            chunks = ((b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0)), (b"IDAT", data), (b"IEND", b""))
            (self.folder / "frames" / name).write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(
                struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks))

    def test_both_readers_know_which_picture_a_row_belongs_to(self):
        try:
            import bigus
        except ImportError as error:
            self.skipTest(str(error))
        package("cv2")
        names = [f"scan_{k}.png" for k in range(5, 5 + FRAMES)]  # up to 11
        self.write_pngs(names)
        order = [5, 0, 3, 6, 1, 2, 4]
        for title, cells in (("image", names), ("File Name", [f"frames/{name}" for name in names]),
                             ("picture", [name[:-4] for name in names]), ("file", range(5, 5 + FRAMES)), ("frame", range(FRAMES)),
                             ("Frame Number", range(1, 1 + FRAMES)), ("frame_id", range(5, 5 + FRAMES)), ("index", range(FRAMES))):
            for rows in (order, order[:4]):  # frames 5, 0, 3, 6, of which the last tells that they count from 1
                with self.subTest(title=title, cell=cells[0], rows=len(rows)):
                    self.write("named.csv", "# by hand\nRecorded in 2024\n" +
                               table((title, *MATRIX_NAMES), [[str(cells[k]), *TRUTH[k].ravel()] for k in rows]))
                    self.check(sources.load(self.folder / "frames", self.folder / "named.csv"), TRUTH[sorted(rows)], IMAGES[sorted(rows)])
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        read = bigus.read(self.folder / "named.csv", ImageFolder=str(self.folder / "frames"))
                    np.testing.assert_array_equal(bigus.frames(read), IMAGES[sorted(rows)])
                    np.testing.assert_allclose(bigus.poses(read), TRUTH[sorted(rows)], atol=1e-12)
        self.write("bad.csv", table(("image", *MATRIX_NAMES), [["far.png", *pose.ravel()] for pose in TRUTH]))
        result = self.run_convert("frames", "bad.csv", "-o", "sweep.igs.mha")
        self.assertRegex(result.stderr, "bad.csv: line 2, column image: 'far.png' .*Rename the column")
        with self.assertRaisesRegex(RuntimeError, 'bad.csv: row 0, column image: "far.png" .*Rename the column'):
            bigus.read(self.folder / "bad.csv", ImageFolder=str(self.folder / "frames"))

    def test_convert(self):
        try:
            import bigus
        except ImportError as error:
            self.skipTest(str(error))
        self.write("poses.csv", table(("status", *MATRIX_NAMES), [["OK" if k != 3 else "LOST", *POSES[k].ravel()]
                                                                  for k in range(FRAMES)]))
        result = self.run_convert("images.npy", "poses.csv", "--pixel-spacing", *SPACING, "-o", "sweep.igs.mha")
        self.assertEqual((result.returncode, result.stdout), (0, "sweep.igs.mha: 6 frames of 16 x 12 pixels\n"), result.stderr)
        self.assertIn("1 of 7 frames have no pose and are left out: 3.", result.stderr)
        sweep, kept = bigus.read(self.folder / "sweep.igs.mha"), np.arange(FRAMES) != 3
        np.testing.assert_array_equal(bigus.frames(sweep), IMAGES[kept])
        np.testing.assert_allclose(bigus.poses(sweep), TRUTH[kept], atol=1e-12)
        # Images and transforms as 3D Slicer saves a tracked sequence, in two files.
        (self.folder / "images.seq.nrrd").write_bytes(
            f"NRRD0005\ntype: unsigned char\ndimension: 4\nspace: left-posterior-superior\nsizes: {FRAMES} {WIDTH} {HEIGHT} 1\n"
            "space directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: list domain domain domain\nencoding: raw\n"
            "space origin: (0,0,0)\n\n".encode() + IMAGES.transpose(1, 2, 0).tobytes())
        self.write("probe.seq.mha", "".join(
            f"Seq_Frame{k:04d}_ProbeTransform ={' '.join(repr(float(x)) for x in POSES[k].ravel())} \n" for k in range(FRAMES)) +
            "ElementDataFile = LOCAL\n")
        result = self.run_convert("images.seq.nrrd", "probe.seq.mha", "--pixel-spacing", *SPACING, "-o", "slicer.igs.mha")
        self.assertEqual(result.returncode, 0, result.stderr)
        np.testing.assert_array_equal(bigus.frames(bigus.read(self.folder / "slicer.igs.mha")), IMAGES)
        np.testing.assert_allclose(bigus.poses(bigus.read(self.folder / "slicer.igs.mha")), TRUTH, atol=1e-12)
        # Where poses are rigid, and nothing else says how large a pixel is, the header of the images does.
        header = (self.folder / "images.seq.nrrd").read_bytes()
        for spacing, ending in (("(0.3,0,0) (0,0.4,0)", 0), ("(1,0,0) (0,1,0)", 2)):
            (self.folder / "spaced.seq.nrrd").write_bytes(header.replace(b"(1,0,0) (0,1,0)", spacing.encode()))
            result = self.run_convert("spaced.seq.nrrd", "probe.seq.mha", "-o", "spaced.igs.mha")
            self.assertEqual(result.returncode, ending, result.stderr)
            self.assertIn("pixel's size" if ending else "Pixels are 0.3 x 0.4 mm, by the file of the images.", result.stderr)
        np.testing.assert_allclose(bigus.poses(bigus.read(self.folder / "spaced.igs.mha")), TRUTH, atol=1e-12)
        # Pictures in a folder: the same order as where the sequence reader takes them.
        names = ("a1b2.png", "a1b10.png", "a01b10.png", "a2.png", "a10.png", "a10-.png", "b.png")
        self.write_pngs(names)
        self.write("pixels.csv", table(MATRIX_NAMES, TRUTH.reshape(-1, 16)))
        read = bigus.frames(bigus.read(self.folder / "pixels.csv", ImageFolder=str(self.folder / "frames")))
        order = [path.name for path in sources._in_natural_order((self.folder / "frames").iterdir())]
        np.testing.assert_array_equal(read, IMAGES[[names.index(name) for name in order]])
        self.assertEqual(order[:2] + order[3:5], ["a1b2.png", "a01b10.png", "a2.png", "a10-.png"])
        for arguments, part in ((("images.npy", "poses.npy", "-o", "x.mha"), "pixel's size"),
                                (("probe.seq.mha", "poses.npy", "--pixel-spacing", 1, 1, "-o", "x.mha"), "probe.seq.mha: neither"),
                                (("images.npy", "poses.npy", "--pixel-spacing", 1, 1, "-o", "x.png"), "must end in"),
                                (("images.npy", "poses.npy", "--pixel-spacing", 1, 1, "-o", "no/x.mha"), "no/x.mha")):
            result = self.run_convert(*arguments)
            self.assertEqual(result.returncode, 2)
            self.assertIn(part, result.stderr)
            self.assertEqual(len(result.stderr.splitlines()), 1, result.stderr)
        self.assertEqual(self.run_convert("--help").returncode, 0)


if __name__ == "__main__":
    unittest.main()
