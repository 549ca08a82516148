#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The bigus program as a user's shell sees it: exit codes, JSON, files, and nothing half-written.

    test_command.py PATH_TO_BIGUS [unittest arguments]
"""
import base64
import csv
import fcntl
import json
import math
import os
import pathlib
import pty
import re
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest
import zlib

BIGUS = None
SUCCESS, USAGE, BAD_INPUT, CANNOT_WRITE, INTERRUPTED = 0, 1, 2, 3, 130

PHANTOM = ["--frames", "9", "--width", "48", "--height", "40", "--pixel-size", "0.6", "--frame-spacing", "0.8"]
TINY = ["--no-auto", "--gaussians", "400", "--iterations", "12", "--batch", "2"]
IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def run(*arguments, threads=None):
    extra = ["--threads", str(threads)] if threads else []
    result = subprocess.run([BIGUS, *map(str, arguments), *extra], capture_output=True, text=True, timeout=120)
    assert "not foreseen" not in result.stderr, f"{arguments}\n{result.stderr}"
    return result


def instruction_sets():
    """Those of this machine, the best first, but the slow one that any machine has."""
    names = re.search(r"here: (.+?)\. A published", " ".join(run("--help").stdout.split())).group(1)
    return [name for name in names.split(", ") if name != "SCALAR"]


def read_sequence(path):
    """(header text, pixels, offset of the pixels) of an uncompressed or zlib .mha, by other means than bigus."""
    data = pathlib.Path(path).read_bytes()
    mark = b"ElementDataFile = LOCAL\n"
    offset = data.index(mark) + len(mark)
    header = data[:offset].decode()
    compressed = "CompressedData = True" in header
    return header, zlib.decompress(data[offset:]) if compressed else data[offset:], offset


def write_sequence(path, header, pixels):
    """The same sequence with other pixels."""
    packed = zlib.compress(bytes(pixels)) if "CompressedData = True" in header else bytes(pixels)
    header = re.sub(r"CompressedDataSize = \d+", f"CompressedDataSize = {len(packed)}", header)
    pathlib.Path(path).write_bytes(header.encode() + packed)


def read_png(path):
    """(width, height, rows of 8-bit grey) of a PNG without interlacing."""
    data = pathlib.Path(path).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, packed = 8, b""
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 0)
        if kind == b"IDAT":
            packed += body
        at += 12 + size
    raw, rows, above = zlib.decompress(packed), [], bytes(width)
    for y in range(height):
        method, line = raw[y * (width + 1)], bytearray(raw[y * (width + 1) + 1:(y + 1) * (width + 1)])
        for x in range(width):
            left, corner = (line[x - 1], above[x - 1]) if x else (0, 0)
            up = above[x]
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda v: abs(guess - v))
            line[x] = (line[x] + (0, left, up, (left + up) // 2, paeth)[method]) & 255
        above = bytes(line)
        rows.append(above)
    return width, height, b"".join(rows)


def read_vti(path):
    """The first array of a .vti, which is stored in zlib blocks, in base64, appended."""
    text = pathlib.Path(path).read_text()
    assert 'header_type="UInt32"' in text and 'compressor="vtkZLibDataCompressor"' in text
    data = text[text.index("_", text.index("<AppendedData encoding=\"base64\"")) + 1:].strip()
    blocks = struct.unpack("<I", base64.b64decode(data[:8])[:4])[0]
    head = 4 * -(-4 * (3 + blocks) // 3)  # bytes to characters, padded
    sizes = struct.unpack_from(f"<{blocks}I", base64.b64decode(data[:head]), 12)
    body = base64.b64decode(data[head:head + 4 * -(-sum(sizes) // 3)])
    pixels, at = b"", 0
    for size in sizes:
        pixels += zlib.decompress(body[at:at + size])
        at += size
    return pixels


class CommandTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.shared = pathlib.Path(tempfile.mkdtemp(prefix="bigus-command-"))
        cls.sweep = cls.shared / "sweep.igs.mha"
        made = run("phantom", "-o", cls.sweep, *PHANTOM)
        assert made.returncode == SUCCESS, made.stderr
        cls.field = cls.shared / "field.vtp"
        made = run("train", cls.sweep, "-o", cls.field, *TINY, "--json")
        assert made.returncode == SUCCESS, made.stderr
        cls.gaussians = json.loads(made.stdout)["gaussians"]  # 400, but for those that no plane shows

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.shared)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="bigus-command-"))
        self.addCleanup(shutil.rmtree, self.folder)

    def expect(self, code, *arguments, says="", notes=""):
        """Runs with --json: stdout must hold one object and nothing else. Gives the object. `notes` are on stderr."""
        result = run(*arguments, "--json")
        self.assertEqual(result.returncode, code, f"{arguments}\n{result.stderr}")
        self.assertIn(notes, result.stderr)
        answer = json.loads(result.stdout)
        self.assertIsInstance(answer, dict)
        if code not in (SUCCESS, INTERRUPTED):
            self.assertTrue(answer["error"])
            self.assertIn(says, answer["error"])
            self.assertIn(says, result.stderr)
            self.assertNotRegex(result.stderr, r"0x[0-9a-f]{6}|\.cxx", "addresses and source lines are not for users")
        return answer

    def assertNothingIn(self, folder):
        self.assertEqual(sorted(os.listdir(folder)), [])

    def await_bar(self, process, name):
        seen = b""
        while name not in seen:
            chunk = os.read(process.stderr.fileno(), 4096)
            self.assertTrue(chunk, seen)
            seen += chunk

    def poses_csv(self, *matrices, extra=()):
        path = self.folder / "planes.csv"
        with open(path, "w", newline="") as file:
            table = csv.writer(file)
            table.writerow([f"m{i}{j}" for i in range(4) for j in range(4)] + [name for name, _ in extra])
            for matrix in matrices:
                table.writerow(list(matrix) + [value for _, value in extra])
        return path


class Check(CommandTest):
    def test_a_good_sweep_has_no_finding_and_a_page(self):
        page = self.folder / "check.png"
        answer = self.expect(SUCCESS, "check", self.sweep, "-o", page)
        self.assertEqual((answer["findings"], answer["left_out"]), ([], []))
        head = page.read_bytes()[:24]
        self.assertEqual((head[:8], int.from_bytes(head[16:20], "big")), (b"\x89PNG\r\n\x1a\n", 1200))
        self.assertIn("nothing is wrong", run("check", self.sweep).stdout)

    def test_what_the_probe_lights_is_said(self):
        fan = self.folder / "fan.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", fan, "--probe", "convex", "--width", 96, "--height", 80, "--pixel-size", 0.7,
                    "--frames", 12, "--scatterers", 4)
        head, body = fan.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
        pixels = zlib.decompress(body)
        answer = self.expect(SUCCESS, "check", fan)
        self.assertEqual(answer["findings"], [])
        self.assertLess(answer["lit"], 0.8)
        self.assertIn(f"lights {100 * answer['lit']:.0f} % of a frame", run("check", fan).stdout)
        unlit = [place for place in range(96 * 80) if not any(pixels[place::96 * 80])]
        grey = bytearray(pixels)
        for place in unlit:
            grey[place::96 * 80] = bytes([30]) * 12
        damaged = self.folder / "grey.igs.mha"
        damaged.write_bytes(re.sub(rb"CompressedData(Size)? = .*\n", b"", head) + b"ElementDataFile = LOCAL\n" + bytes(grey))
        found = self.expect(SUCCESS, "check", damaged, "-o", self.folder / "grey.png")
        self.assertEqual([one["kind"] for one in found["findings"]], ["fan"])
        self.assertAlmostEqual(found["lit"], answer["lit"], delta=0.03)
        self.assertEqual(self.expect(SUCCESS, "check", damaged, "--keep", "fan")["lit"], 1)

    def changed(self, name, change):
        """The sweep with other bytes for pixels: change(frame, column, row, level)."""
        head, body = self.sweep.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
        width, height, count = (int(n) for n in re.search(rb"DimSize = (\d+) (\d+) (\d+)", head).groups())
        pixels = zlib.decompress(body) if b"CompressedData = True" in head else body
        made = bytes(change(p // (width * height), p % width, p // width % height, level)
                     for p, level in enumerate(pixels[:width * height * count]))
        head = re.sub(rb"CompressedData(Size)? = .*\n", b"", head)
        (self.folder / name).write_bytes(head + b"ElementDataFile = LOCAL\n" + made)
        return self.folder / name

    def test_text_of_the_screen_is_filled_before_pixels_are_averaged(self):
        # A pattern of single pixels: averaged, each is as much tissue as text.
        shown = self.changed("text.igs.mha", lambda k, i, j, level: 235 if 4 <= i < 24 and 4 <= j < 10 and
                             (7 * i + 3 * j + i * j) % 5 < 2 else level)
        found = self.expect(SUCCESS, "check", shown)["findings"]
        self.assertEqual([one["kind"] for one in found], ["overlay"])
        for reduce in (1, 2, 3):
            result = run("train", shown, "-o", self.folder / "text.vtp", *TINY, "--reduce", reduce)
            self.assertEqual(result.returncode, SUCCESS, result.stderr)
            self.assertEqual(result.stderr.count("The scanner's screen shows"), 1, result.stderr)
            answer = self.expect(SUCCESS, "train", shown, "-o", self.folder / "text.vtp", *TINY, "--reduce", reduce)
            self.assertEqual(answer["findings"], found, reduce)
        kept = self.expect(SUCCESS, "train", shown, "-o", self.folder / "text.vtp", *TINY, "--reduce", 2, "--keep", "overlay")
        self.assertEqual([(one["kind"], one["applied"]) for one in kept["findings"]], [("overlay", False)])
        self.assertEqual(kept["settled"]["keep"], "overlay")

    def test_what_train_refuses_is_said(self):
        for name, change, words in (("black.igs.mha", lambda k, i, j, level: 0, "all pixels are black"),
                                    ("flat.igs.mha", lambda k, i, j, level: 77, "one grey level")):
            flat = self.changed(name, change)
            found = self.expect(SUCCESS, "check", flat)["findings"]
            self.assertIn(words, " ".join(one["text"] for one in found if one["kind"] == "levels"))
            self.assertNotIn("nothing is wrong", run("check", flat).stdout)
            self.expect(BAD_INPUT, "train", flat, "-o", self.folder / "flat.vtp", *TINY)

    def test_frames_without_tissue_are_named(self):
        head, body = self.sweep.read_bytes().split(b"ElementDataFile = LOCAL\n", 1)
        width, height, count = (int(n) for n in re.search(rb"DimSize = (\d+) (\d+) (\d+)", head).groups())
        pixels = bytearray(zlib.decompress(body) if b"CompressedData = True" in head else body)
        pixels[3 * width * height:5 * width * height] = bytes(2 * width * height)
        damaged = self.folder / "damaged.igs.mha"
        head = re.sub(rb"CompressedData(Size)? = .*\n", b"", head)
        damaged.write_bytes(head + b"ElementDataFile = LOCAL\n" + bytes(pixels))
        answer = self.expect(SUCCESS, "check", damaged, "-o", self.folder / "damaged.png")
        self.assertEqual([(one["kind"], one["frames"], one["applied"]) for one in answer["findings"]], [("contact", 2, True)])
        self.assertEqual(answer["left_out"], [3, 4])
        self.assertIn("off the skin: 2 frames (3-4)", run("check", damaged).stdout)
        self.assertEqual(self.expect(SUCCESS, "check", damaged, "--keep", "contact")["left_out"], [])
        self.assertIn("'dust'", run("check", damaged, "--keep", "dust").stderr)
        trained = self.expect(SUCCESS, "train", damaged, "-o", self.folder / "damaged.vtp", "--no-auto", "--gaussians", 50,
                              "--iterations", 2)
        self.assertEqual(trained["findings"], answer["findings"])
        self.assertEqual(trained["training_frames"], count - 2)


class Help(CommandTest):
    def test_every_subcommand_teaches(self):
        top = run("--help")
        self.assertEqual(top.returncode, SUCCESS)
        for name in ("info", "check", "phantom", "poses", "train", "slice", "voxelize", "metrics", "convert"):
            with self.subTest(name):
                self.assertIn(f"bigus {name} ", top.stdout)
                own = run(name, "--help")
                self.assertEqual(own.returncode, SUCCESS)
                self.assertIn(f"  bigus {name} ", own.stdout, "an example")
        for code in ("1 wrong usage", "2 bad input", "3 output", "130 interrupted"):
            self.assertIn(code, " ".join(top.stdout.split()))  # lines end where the terminal does

    def test_train_has_every_promised_option(self):
        text = run("train", "--help").stdout
        for option in ("--auto", "--no-auto", "--max-gaussians", "--price", "--signed", "--positive", "--virtual-planes",
                       "--interpolation", "--frame-gains", "--pose-smoothing",
                       "--preset", "--loss", "--validation", "--output", "--gaussians", "--elevation-sigma", "--hold-out", "--reduce", "--iterations",
                       "--time-limit", "--seed", "--config", "--image-to", "--log"):
            self.assertIn(option, text)

    def test_version(self):
        self.assertRegex(run("--version").stdout, r"^bigus \d+\.\d+\.\d+\n$")


class Usage(CommandTest):
    def test_wrong_command_lines(self):
        for arguments in ([], ["fly"], ["train"], ["train", self.sweep], ["info"], ["slice", self.field, "-o", "x.png"],
                          ["info", self.sweep, "--devices"], ["train", self.sweep, "-o", "x.vtp", "--no-such-option"]):
            with self.subTest(arguments):
                self.expect(USAGE, *arguments)

    def test_an_option_spelt_otherwise_is_recognised(self):
        result = run("train", self.sweep, "-o", self.folder / "f.vtp", "--holdout", "4")
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("Did you mean --hold-out instead of --holdout?", result.stderr)

    def test_typos_are_recognised(self):
        for words, meant in ((["trian", self.sweep], "train instead of trian"),
                             (["train", self.sweep, "-o", "f.vtp", "--gausians", "4"], "--gaussians instead of --gausians"),
                             (["slice", self.field, "-o", "s.png", "--posse", self.sweep], "--poses instead of --posse")):
            result = run(*words)
            self.assertEqual(result.returncode, USAGE)
            self.assertIn(f"Did you mean {meant}?", result.stderr)
        for words in (["fly"], ["train", self.sweep, "-o", "f.vtp", "--no-such-option"]):
            self.assertNotIn("Did you mean", run(*words).stderr)

    def test_help_of_a_command_and_of_nothing(self):
        self.assertEqual(run("help", "train").stdout, run("train", "--help").stdout)
        self.assertEqual(run("help").stdout, run("--help").stdout)
        alone = subprocess.run([BIGUS], capture_output=True, text=True, timeout=60)
        self.assertEqual((alone.returncode, alone.stderr), (USAGE, run("--help").stdout))

    def test_help_is_as_wide_as_the_terminal(self):
        for columns in (60, 100):
            for command in ("train", "slice", "phantom"):
                text = subprocess.run([BIGUS, command, "--help"], capture_output=True, text=True, timeout=60,
                                      env={**os.environ, "COLUMNS": str(columns)}).stdout
                before, options = text.split("Usage:")
                for line in options.splitlines():
                    words = line[30:].split()  # a word longer than its column stands alone
                    self.assertTrue(len(line) <= columns or len(words) == 1 or line.startswith("  -"), line)
                self.assertNotRegex(text, "Excludes|Needs|\\{false\\}")
                self.assertIn("\n  bigus " + command, before)

    def test_a_wrong_command_line_names_the_help_at_hand(self):
        self.assertTrue(run("slice", self.field).stderr.endswith("Run 'bigus slice --help'.\n"))

    def test_shells_complete_commands_options_and_choices(self):
        def completed(*words):
            script = ('source <("$0" completion bash); COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _bigus; '
                      'printf "%s\\n" "${COMPREPLY[@]}"')
            result = subprocess.run(["bash", "-c", script, BIGUS, "bigus", *words], capture_output=True, text=True, timeout=60)
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            return result.stdout.split()

        self.assertEqual(completed("tr"), ["train"])
        self.assertEqual(completed("help", "vox"), ["voxelize"])
        self.assertEqual(completed("slice", self.field, "--elev"), ["--elevation-sigma"])
        self.assertEqual(completed("slice", self.field, "--thr"), ["--threads"])
        self.assertEqual(completed("slice", "--mode", "sc"), ["scattering"])
        self.assertEqual(completed("slice", "fie"), [])  # bash completes the file's name

    def test_the_man_page_has_every_option(self):
        page = run("completion", "man").stdout.replace("\\-", "-")
        for command in ("train", "slice"):
            for option in re.findall(r"^  (?:-\w,)?(--[a-z-]+)", run(command, "--help").stdout, re.M):
                self.assertIn(option, page)
        self.assertIn(".SH bigus train", page)
        if shutil.which("groff"):
            drawn = subprocess.run(["groff", "-man", "-Tutf8", "-ww"], input=run("completion", "man").stdout,
                                   capture_output=True, text=True, timeout=60)
            self.assertEqual(drawn.stderr, "")

    def test_global_options_are_in_every_help(self):
        for command in ("info", "train", "slice"):
            self.assertIn("--threads", run(command, "--help").stdout)

    def test_an_unknown_command_is_named(self):
        self.expect(USAGE, "nosuch", says="'nosuch'")
        self.expect(USAGE, "nosuch", self.sweep, "-o", "x.mha", says="'nosuch'")

    def test_ranges_are_plain_numbers(self):
        self.expect(USAGE, "train", self.sweep, "-o", "x.vtp", "--gaussians", "1e9", says="it must be 1 to 67108864")
        self.expect(USAGE, "phantom", "-o", "x.mha", "--axial-sigma", "0", says="from 0.02 to 5")

    def test_bad_numbers(self):
        bad = {"--gaussians": ["0", "-5", "1e99", "many", "", "2.5", "nan"],
               "--hold-out": ["1", "-1", "4.5", "x"],
               "--reduce": ["0", "-1", "1e9", "two"],
               "--elevation-sigma": ["-1", "nan", "inf", "thick"],
               "--iterations": ["-1", "1e12", "x"],
               "--time-limit": ["-1", "nan", "soon"],
               "--seed": ["-1", "x", "1.5"],
               "--batch": ["0", "-1"],
               "--validation": ["1"],
               "--threads": ["-1", "x"],
               "--seeding": ["nowhere"],
               "--max-gaussians": ["0", "-1", "many", "1e99"],
               "--price": ["-1", "nan", "101", "cheap"],
               "--virtual-planes": ["-1", "9", "0.5", "some"],
               "--interpolation": ["", "sideways", "probe+flo", "x" * 10000],
               "--frame-gains": ["maybe", "", "1"],
               "--pose-smoothing": ["-1", "1001", "nan", "on"],
               "--preset": ["", "beauty", "Texture "],
               "--loss": ["l3", "", "l1+", "-1*l1", "0*l1", "nan*l2"]}
        for option, values in bad.items():
            for value in values:
                with self.subTest(option=option, value=value):
                    self.expect(USAGE, "train", self.sweep, "-o", self.folder / "x.vtp", f"{option}={value}")
        self.assertNothingIn(self.folder)
        for arguments in (["slice", self.field, "--poses", self.sweep, "-o", "x.mha", "--spacing=0"],
                          ["slice", self.field, "--poses", self.sweep, "-o", "x.mha", "--size", "0", "5"],
                          ["slice", self.field, "--poses", self.sweep, "-o", "x.mha", "--elevation-sigma=-1"],
                          ["slice", self.field, "--poses", self.sweep, "-o", "x.mha", "--mode=colour"],
                          ["voxelize", self.field, "-o", "x.mha", "--spacing=nan"],
                          ["voxelize", self.field, "-o", "x.mha", "--size", "32769", "1", "1"],
                          ["poses", self.sweep, "-o", "x.mha", "--strength=-1"],
                          ["poses", self.sweep, "-o", "x.mha", "--strength=1001"],
                          ["poses", self.sweep, "-o", "x.mha", "--strength=nan"],
                          ["poses", self.sweep, "-o", "x.mha", "--strength=strong"],
                          ["poses", self.sweep, "-o", "x.mha", "--hold-out=1"],
                          ["poses", self.sweep, "-o", "x.mha", "--hold-out=2.5"],
                          ["phantom", "-o", "x.mha", "--frames=0"],
                          ["phantom", "-o", "x.mha", "--tilt=90"],
                          ["phantom", "-o", "x.mha", "--probe=round"]):
            with self.subTest(arguments):
                self.expect(USAGE, *arguments)


class Outputs(CommandTest):
    def test_no_output_replaces_an_input_or_another_output(self):
        sweep, field = self.folder / "me.igs.mha", self.folder / "me.vtp"
        shutil.copy(self.sweep, sweep)
        shutil.copy(self.field, field)
        link = self.folder / "link.mha"
        link.symlink_to(sweep)
        new, detour = self.folder / "new.vtp", self.folder / "." / ".." / self.folder.name / "new.vtp"
        before = sweep.read_bytes(), field.read_bytes(), sorted(os.listdir(self.folder))
        for output, other, arguments in (
                (new, new, ["train", sweep, "-o", new, "--log", new]),
                (detour, new, ["train", sweep, "-o", new, "--log", detour]),
                (sweep, sweep, ["train", sweep, "-o", new, "--log", sweep]),
                (field, field, ["train", sweep, "-o", field, "--continue", field]),
                (self.folder / "b.mha", self.folder / "b.mha",
                 ["slice", field, "--poses", sweep, "-o", self.folder / "b.mha", "--coverage", self.folder / "b.mha"]),
                (sweep, sweep, ["slice", field, "--poses", sweep, "-o", sweep]),
                (sweep, link, ["slice", field, "--poses", link, "-o", sweep]),
                (link, sweep, ["slice", field, "--poses", sweep, "-o", link]),
                (sweep, sweep, ["poses", sweep, "-o", sweep]),
                (new, new, ["train", sweep, "-o", new, "--write-poses", new]),
                (sweep, sweep, ["train", sweep, "-o", new, "--write-poses", sweep]),
                (sweep, sweep, ["convert", sweep, sweep]),
                (field, field, ["convert", field, field]),
                (sweep, sweep, ["phantom", "--truth", sweep, "-o", sweep])):
            with self.subTest(arguments):
                answer = self.expect(CANNOT_WRITE, *arguments, says=str(output))
                self.assertIn(f"'{other}'", answer["error"])
        volume = self.folder / "volume.mha"
        shutil.copy(field, volume)
        self.expect(CANNOT_WRITE, "voxelize", volume, "-o", volume, says="volume.mha")
        volume.unlink()
        self.assertEqual((sweep.read_bytes(), field.read_bytes(), sorted(os.listdir(self.folder))), before)

    def test_a_folder_that_may_not_be_entered_is_said(self):
        closed = self.folder / "closed"
        closed.mkdir(mode=0)
        nobody = {"user": 65534} if os.getuid() == 0 else {}
        sweep = pathlib.Path(tempfile.mkdtemp()) / "sweep.igs.mha"
        self.addCleanup(shutil.rmtree, sweep.parent)
        sweep.parent.chmod(0o755)
        shutil.copy(self.sweep, sweep)
        self.folder.chmod(0o755)
        result = subprocess.run([BIGUS, "train", sweep, "-o", closed / "f.vtp", *TINY], capture_output=True, text=True,
                                timeout=60, **nobody)
        self.assertEqual(result.returncode, CANNOT_WRITE, result.stderr)
        self.assertIn("Permission denied", result.stderr)

    def test_messages_name_the_files_there_are(self):
        png = self.folder / "s.png"
        for arguments in (["convert", self.sweep, png], ["slice", self.field, "--poses", self.sweep, "-o", png],
                          ["phantom", "-o", png, *PHANTOM]):
            with self.subTest(arguments):
                said = run(*arguments).stdout
                self.assertIn(f"{self.folder / 's_000.png'} ... {self.folder / 's_008.png'}: 9 ", said)
                self.assertEqual(len(self.expect(SUCCESS, *arguments)["output"]), 9)


class Phantom(CommandTest):
    def test_json_and_file(self):
        out = self.folder / "p.igs.mha"
        answer = self.expect(SUCCESS, "phantom", "-o", out, *PHANTOM)
        self.assertEqual((answer["frames"], answer["width"], answer["height"]), (9, 48, 40))
        header, pixels, _ = read_sequence(out)
        self.assertEqual(len(pixels), 9 * 48 * 40)
        self.assertIn("Seq_Frame0008_ImageToReferenceTransform", header)
        self.assertGreater(max(pixels), 100)

    def test_seed_and_threads(self):
        files = []
        for name, seed, threads in (("a", 1, 1), ("b", 1, 2), ("c", 2, 2)):
            path = self.folder / f"{name}.mha"
            self.assertEqual(run("phantom", "-o", path, *PHANTOM, "--seed", seed, threads=threads).returncode, SUCCESS)
            files.append(path.read_bytes())
        self.assertEqual(files[0], files[1])
        self.assertNotEqual(files[0], files[2])

    def test_truth_at_the_sweeps_own_planes_is_the_sweep(self):
        truth = self.folder / "truth.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", truth, *PHANTOM, "--truth", self.sweep)
        self.assertEqual(read_sequence(truth)[1], read_sequence(self.sweep)[1])

    def test_noise_moves_recorded_poses_only(self):
        noisy, true = self.folder / "noisy.mha", self.folder / "true.mha"
        noise = [*PHANTOM, "--tracking-noise", "0.5"]
        self.expect(SUCCESS, "phantom", "-o", noisy, *noise)
        self.expect(SUCCESS, "phantom", "-o", true, *noise, "--true-poses")
        self.assertEqual(read_sequence(noisy)[1], read_sequence(true)[1])
        self.assertNotEqual(read_sequence(noisy)[0], read_sequence(true)[0])
        self.assertEqual(read_sequence(true)[0], read_sequence(self.sweep)[0])


    def test_every_error_of_the_tracker_leaves_the_pixels(self):
        for error in (["--tracking-drift", 1], ["--rotation-drift", 1], ["--outliers", 0.3, "--outlier-size", 3],
                      ["--tracking-delay", 0.1], ["--tracking-quantum", 0.5], ["--rotation-quantum", 0.5],
                      ["--calibration-shift", 0, 0, 2], ["--calibration-rotation", 0, 3, 0]):
            out = self.folder / "p.mha"
            self.expect(SUCCESS, "phantom", "-o", out, *PHANTOM, *error)
            self.assertEqual(read_sequence(out)[1], read_sequence(self.sweep)[1], error)
            self.assertNotEqual(read_sequence(out)[0], read_sequence(self.sweep)[0], error)

    def test_true_poses_beside_the_sweep(self):
        noisy, poses, truth = (self.folder / name for name in ("noisy.mha", "poses.csv", "truth.mha"))
        answer = self.expect(SUCCESS, "phantom", "-o", noisy, *PHANTOM, "--tracking-noise", 2, "--write-true-poses", poses)
        self.assertEqual(answer["true_poses"], str(poses))
        self.expect(SUCCESS, "phantom", "-o", truth, *PHANTOM, "--truth", poses)
        self.assertEqual(read_sequence(truth)[1], read_sequence(noisy)[1])
        self.expect(USAGE, "phantom", "-o", noisy, *PHANTOM, "--truth", poses, "--write-true-poses", poses)


class Info(CommandTest):
    def test_sequence(self):
        answer = self.expect(SUCCESS, "info", self.sweep)
        self.assertEqual(answer["kind"], "sequence")
        self.assertEqual((answer["frames"], answer["width"], answer["height"]), (9, 48, 40))
        self.assertAlmostEqual(answer["pixel_size"][0], 0.6, places=9)
        self.assertIn("Image", answer["chain"])
        self.assertIn("ImageToReference", [transform["name"] for transform in answer["transforms"]])
        self.assertGreater(answer["plane_spacing"]["median"], 0.1)
        self.assertEqual(answer["rejected"], [])
        text = run("info", self.sweep).stdout
        for word in ("Frames", "Transforms", "Chain used", "Pixel", "Plane spacing", "Extent", "Orientation"):
            self.assertIn(word, text)

    def test_pictures_of_a_table_of_poses(self):
        """Numbered without leading zeros, in a folder of their own, named or not: 'info' and 'convert' take the same."""
        header, pixels, _ = read_sequence(self.sweep)
        (self.folder / "frames").mkdir()
        poses = re.findall(r"Frame\d+_ImageToReferenceTransform = (.*)", header) * 2
        lines = ["image," + ",".join(f"m{i}{j}" for i in range(4) for j in range(4))]
        for k, pose in enumerate(poses):
            image = pixels[(k % 9) * 48 * 40:][:48 * 40]
            rows = b"".join(b"\0" + image[48 * y:48 * y + 48] for y in range(40))
            chunks = ((b"IHDR", struct.pack(">IIBBBBB", 48, 40, 8, 0, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
            (self.folder / "frames" / f"frame_{k}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(
                struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body)) for kind, body in chunks))
            lines.append(",".join([f"frame_{k}.png", *pose.split()]))
        named, bare, out = (self.folder / name for name in ("named.csv", "bare.csv", "out.igs.mha"))
        named.write_text("\n".join(lines))
        bare.write_text("\n".join(line.split(",", 1)[1] for line in lines))
        for arguments in ((named, "--image-folder", self.folder / "frames"), (bare, "--image-folder", self.folder / "frames"),
                          (bare, "--image-folder", self.folder / "frames", "--image-pattern", "frame_%d.png")):
            answer = self.expect(SUCCESS, "info", *arguments)
            self.assertEqual((answer["frames"], answer["width"], answer["height"]), (18, 48, 40))
            self.expect(SUCCESS, "convert", arguments[0], out, *arguments[1:])
            self.assertEqual(read_sequence(out)[1], pixels * 2)

    def test_rejected_frames_are_named(self):
        header, pixels, _ = read_sequence(self.sweep)
        some = self.folder / "some.mha"
        write_sequence(some, header.replace("Seq_Frame0003_ImageToReferenceTransformStatus = OK",
                                            "Seq_Frame0003_ImageToReferenceTransformStatus = INVALID"), pixels)
        answer = self.expect(SUCCESS, "info", some)
        self.assertEqual((answer["frames_in_file"], answer["frames"]), (9, 8))
        self.assertEqual(answer["rejected"][0]["frames"], 1)
        self.assertIn("INVALID", answer["rejected"][0]["reason"])
        self.assertIn("Rejected", run("info", some).stdout)

        none = self.folder / "none.mha"
        write_sequence(none, header.replace("TransformStatus = OK", "TransformStatus = INVALID"), pixels)
        answer = self.expect(BAD_INPUT, "info", none)
        self.assertEqual(answer["rejected"][0]["frames"], 9)
        self.expect(BAD_INPUT, "train", none, "-o", self.folder / "x.vtp")

    def test_a_damaged_configuration_is_the_fault(self):
        """Of a sweep with transforms of its own, and of one without any."""
        header, pixels, _ = read_sequence(self.sweep)
        bare, config = self.folder / "bare.mha", self.folder / "plus.xml"
        write_sequence(bare, re.sub(r"Seq_Frame.*Transform.*\n", "", header), pixels)
        for text in ("<PlusConfiguration><CoordinateDefinitions>", "<a/>", ""):
            config.write_text(text)
            for sequence in (self.sweep, bare):
                self.expect(BAD_INPUT, "info", sequence, "--config", config, says=str(config))
        self.assertEqual(self.expect(SUCCESS, "info", bare)["kind"], "images")

    def test_tracker_and_doubtful_poses(self):
        answer = self.expect(SUCCESS, "info", self.sweep)
        self.assertLess(answer["tracker"]["corner_noise"], 0.01)
        self.assertEqual((answer["tracker"]["outliers"], answer["doubts"]), ([], []))
        self.assertNotIn("Doubtful", run("info", self.sweep).stdout)

        noisy = self.folder / "noisy.mha"
        self.expect(SUCCESS, "phantom", "-o", noisy, "--frames=60", "--width=48", "--height=40", "--pixel-size=0.6",
                    "--scatterers=1", "--tracking-noise=0.3", "--rotation-noise=0.4")
        tracker = self.expect(SUCCESS, "info", noisy)["tracker"]
        self.assertAlmostEqual(tracker["translation_noise"], 0.3, delta=0.1)
        self.assertAlmostEqual(tracker["rotation_noise"], 0.4, delta=0.12)
        self.assertRegex(run("info", noisy).stdout, r"Noise by the path +0\.\d+ mm and 0\.\d+ degrees")

        few = self.folder / "few.mha"
        self.expect(SUCCESS, "phantom", "-o", few, "--frames=5", "--width=48", "--height=40", "--pixel-size=0.6",
                    "--scatterers=1", "--tracking-noise=0.3")
        self.assertIsNone(self.expect(SUCCESS, "info", few)["tracker"]["translation_noise"])
        self.assertRegex(run("info", few).stdout, "Noise by the path +unknown")
        self.assertIsNone(self.expect(SUCCESS, "poses", few, "-o", self.folder / "same.mha")["noise"]["corner"])
        self.assertRegex(run("poses", few, "-o", self.folder / "same.mha").stdout, "tracker's noise +unknown")

        def changed(name, change):
            """The sweep with every pose changed, row-major."""
            header, pixels, _ = read_sequence(self.sweep)
            lines = []
            for line in header.split("\n"):
                key, mark, value = line.partition(" = ")
                if key.endswith("ImageToReferenceTransform"):
                    line = key + mark + " ".join(repr(x) for x in change([float(x) for x in value.split()]))
                lines.append(line)
            write_sequence(self.folder / name, "\n".join(lines), pixels)
            return self.folder / name

        metres = changed("metres.mha", lambda m: [x / 1000 for x in m[:12]] + m[12:])
        self.assertIn("metres", self.expect(SUCCESS, "info", metres)["doubts"][0])
        self.assertRegex(run("info", metres).stdout, "Doubtful +Pixels of .*metres")
        sheared = changed("sheared.mha", lambda m: [x + 0.1 * m[k - 1] * (k % 4 == 1) for k, x in enumerate(m)])
        self.assertIn("shear", self.expect(SUCCESS, "info", sheared)["doubts"][0])
        # A turn about the image's own middle: nothing is doubtful, and the path is that of the mean place.
        turns = self.folder / "turns.mha"
        header, pixels, _ = read_sequence(self.sweep)
        poses = iter(0.05 * k for k in range(9))
        def turn(match):
            angle = next(poses)
            c, s = math.cos(angle), math.sin(angle)
            return match.group(1) + f"{0.6 * c} 0 {s} {-14.1 * c} 0 0.6 0 0 {-0.6 * s} 0 {c} {14.1 * s} 0 0 0 1"
        write_sequence(turns, re.sub(r"(_ImageToReferenceTransform = ).*", turn, header), pixels)
        answer = self.expect(SUCCESS, "info", turns)
        self.assertEqual(answer["doubts"], [])
        self.assertAlmostEqual(answer["path_length"], 8 * 2 * math.sin(0.025) * 14.1 / 2, delta=0.01)
        self.assertAlmostEqual(answer["plane_spacing"]["median"], math.sin(0.05) * 14.1 / 2, delta=0.01)
        self.assertNotIn("hardly moved", run("check", turns).stdout)
        flat = changed("flat.mha", lambda m: [0.6, 0, 0, 0, 0, 0.6, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
        self.assertIn("one plane", self.expect(SUCCESS, "info", flat)["doubts"][0])
        mirrored = changed("mirrored.mha", lambda m: [-x if k % 4 == 0 else x for k, x in enumerate(m)])
        self.assertIn("9 frames have a third column that is zero, or mirror",
                      self.expect(SUCCESS, "info", mirrored)["doubts"][0])
        third = changed("third.mha", lambda m: [0 if k % 4 == 2 and k < 12 else x for k, x in enumerate(m)])
        trained = run("train", third, "-o", self.folder / "third.vtp", *TINY)
        self.assertEqual(trained.returncode, SUCCESS, trained.stderr)
        self.assertEqual(trained.stderr.count("third column of 9 of 9 poses"), 1, trained.stderr)

    def test_without_a_chain_frames_are_not_called_bad(self):
        self.expect(BAD_INPUT, "info", self.sweep, "--image-to", "Moon", says="Moon")
        text = run("info", self.sweep, "--image-to", "Moon").stdout
        self.assertNotIn("0 usable", text)
        self.assertRegex(text, "Chain used +none: .* from Image to Moon")

    def test_field(self):
        answer = self.expect(SUCCESS, "info", self.field)
        self.assertEqual(answer["kind"], "field")
        self.assertEqual(answer["gaussians"], self.gaussians)
        self.assertGreater(answer["gamma"], 0)
        self.assertEqual(answer["provenance"]["seed"], "1")
        self.assertRegex(answer["provenance"]["recordedPoses"], "^[0-9a-f]{16}$")
        self.assertNotIn("sequence", answer["provenance"])  # a file's name may be a person's

    def test_devices(self):
        answer = self.expect(SUCCESS, "info", "--devices")
        names = [engine["name"] for engine in answer["engines"]]
        self.assertIn("cpu", names)
        self.assertIn("reference", names)
        missing = {engine["name"]: engine["reason"] for engine in answer["missing"]}
        self.assertTrue(("cuda" in names) != bool(missing.get("cuda")), answer)
        if missing:
            self.expect(BAD_INPUT, "slice", self.field, "--poses", self.sweep, "--frames", "0", "--engine", "cuda",
                        "-o", self.folder / "x.png", says=missing["cuda"])

    def test_truncated_pixels(self):
        data = self.sweep.read_bytes()
        self.assertIn(b"CompressedDataSize", data)
        cut = self.folder / "cut.igs.mha"
        cut.write_bytes(data[:-10])
        self.expect(BAD_INPUT, "info", cut, says="truncated")
        out = self.folder / "x.igs.mha"
        self.expect(BAD_INPUT, "slice", self.field, "--poses", cut, "-o", out, says="truncated")
        self.assertFalse(out.exists())

    def test_own_volumes_and_pictures(self):
        for name in ("v.mha", "v.nrrd"):
            path = self.folder / name
            self.expect(SUCCESS, "voxelize", self.field, "-o", path, "--spacing", "1")
            answer = self.expect(SUCCESS, "info", path)
            self.assertEqual(answer["kind"], "images")
            self.assertGreater(answer["images"] * answer["width"] * answer["height"], 1)
            self.assertEqual(answer["place"]["spacing"], [1, 1, 1])
            low, high = answer["place"]["bounds"][:2]
            self.assertAlmostEqual(high - low, answer["width"] - 1)
        picture = self.folder / "s.png"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", "0", "-o", picture)
        self.assertEqual(self.expect(SUCCESS, "info", picture),
                         {"kind": "images", "images": 1, "width": 48, "height": 40, "place": None,
                          "not_taken_along": []})

    def test_other_kinds_of_files_are_told_how_to_come_in(self):
        for name, says in (("a.mp4", "bigus.convert"), ("a.DCM", "bigus.convert"), ("a.h5", "bigus.convert"), ("a.nii.gz", "nibabel"),
                           ("a.jpg", "bigus.convert"), ("a.mrb", ".seq.nrrd"), ("a.tfm", "--poses")):
            path = self.folder / name
            path.write_bytes(bytes(range(256)))
            self.expect(BAD_INPUT, "info", path, says=says)

    def test_errors_name_the_options_that_cure_them(self):
        header, pixels, _ = read_sequence(self.sweep)
        path = self.folder / "s.mha"
        write_sequence(path, header.replace("ImageToReference", "ImageToTracker"), pixels)
        self.expect(BAD_INPUT, "info", path, says="--image-to")
        write_sequence(path, re.sub(r"Seq_Frame\d+_ImageToReferenceTransformStatus = OK\n", "", header), pixels)
        self.expect(BAD_INPUT, "train", path, "-o", self.folder / "f.vtp", says="--assume-status")

    def test_bad_files(self):
        self.expect(BAD_INPUT, "info", self.folder / "absent.mha", says="absent.mha")
        self.expect(BAD_INPUT, "info", self.folder, says="folder")
        empty = self.folder / "empty.mha"
        empty.write_bytes(b"")
        self.expect(BAD_INPUT, "info", empty, says="empty.mha")
        header, pixels, offset = read_sequence(self.sweep)
        cut = self.folder / "cut.mha"
        cut.write_bytes(self.sweep.read_bytes()[:offset // 2])
        self.expect(BAD_INPUT, "info", cut, says="cut.mha")
        self.expect(BAD_INPUT, "info", self.sweep, "--image-to", "Moon", says="Moon")


class Train(CommandTest):
    def test_json_keys(self):
        log = self.folder / "log.csv"
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 4,
                             "--log", log, "--seed", 7)
        self.assertEqual(answer["settled"]["gaussians"], 400)
        self.assertTrue(380 < answer["gaussians"] <= 400, "but for those that no plane shows")
        self.assertEqual(answer["iterations"], 12)
        self.assertEqual(answer["seed"], 7)
        self.assertIsInstance(answer["seconds"], float)
        self.assertIsInstance(answer["device"], str)
        self.assertGreater(answer["peak_memory_bytes"], 1 << 20)
        self.assertIs(answer["interrupted"], False)
        held_out = answer["held_out"]
        self.assertEqual(answer["held_out_tracked"], held_out, "exact poses are kept")
        self.assertEqual(held_out["frames"], 2, "frames 2 and 6 of 9")
        self.assertEqual(answer["training_frames"], 7)
        for key in ("psnr", "psnr_std", "ssim", "bfs"):
            self.assertTrue(math.isfinite(held_out[key]), key)
        for scores in (held_out, answer["trained"]):
            self.assertGreater(scores["texture"]["truth_contrast_mean"], 0)
        self.assertEqual(answer["trained"]["frames"], 2)
        self.assertEqual(set(answer["baselines"]), {"nearest", "neighbour_average", "pose_interpolation", "compounding"})
        for name, scores in answer["baselines"].items():
            for key in ("psnr", "ssim"):
                self.assertTrue(math.isfinite(scores[key]), (name, key))
        with open(log, newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(int(rows[-1]["iteration"]), 12)
        self.assertGreater(float(rows[-1]["loss"]), 0)

    def test_planes_along_the_sweep_are_scored_with_and_without_held_out_frames(self):
        sweep = self.folder / "long.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", sweep, "--frames", 24, "--width", 32, "--height", 32,
                    "--pixel-size", 0.8, "--tilt", 0)
        for more in ((), ("--hold-out", 4)):
            cross = self.expect(SUCCESS, "train", sweep, "-o", self.folder / "f.vtp", *TINY, *more)["cross_planes"]
            self.assertGreater(cross["detail"], 0)
            self.assertGreater(cross["scratches"], 0)
        # A beam is set after the training: the Gaussians are the same, and so is what is said of them.
        thick = self.expect(SUCCESS, "train", sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 4,
                            "--probe-elevation-sigma", 1.5)["cross_planes"]
        self.assertEqual(thick, cross)

    def test_a_standard_error_is_kept_unless_left_out_and_nothing_else_changes(self):
        plain, sure = self.folder / "plain.vtp", self.folder / "sure.vtp"
        left_out = self.expect(SUCCESS, "train", self.sweep, "-o", plain, *TINY, "--hold-out", 4, "--no-standard-error")
        scores = self.expect(SUCCESS, "train", self.sweep, "-o", sure, *TINY, "--hold-out", 4)["standard_error"]
        self.assertEqual(set(left_out["standard_error"]), set(scores))
        self.assertTrue(all(value is None for value in left_out["standard_error"].values()))
        ranked = ("variance_ratio", "within_1", "within_2", "correlation", "sparsification")
        for key in ("seconds", "rmse", "known", *ranked):
            self.assertTrue(math.isfinite(scores[key]), key)
        self.assertTrue(0 < scores["within_1"] <= scores["within_2"] <= 1)
        self.assertEqual(set(scores["peers"]), {"constant", "distance", "local_variance"})
        for peer in scores["peers"].values():
            self.assertEqual(set(peer), set(ranked))
            self.assertAlmostEqual(peer["variance_ratio"], 1, places=4)
        for mean in scores["means"]:
            self.assertEqual(set(mean), {"side", "variance_ratio", "squares"})
            self.assertTrue(mean["side"] > 0 and mean["variance_ratio"] > 0 and mean["squares"] > 0)
        self.assertTrue(scores["means"])
        self.bins_say_what_the_scores_do(scores)
        self.assertNotIn(b"StandardError", plain.read_bytes())
        self.assertIn(b"StandardError", sure.read_bytes())
        images = [self.folder / "a.mha", self.folder / "b.mha"]
        for field, image in zip((plain, sure), images):
            self.expect(SUCCESS, "slice", field, "--poses", self.sweep, "-o", image)
        self.assertEqual(read_sequence(images[0])[1], read_sequence(images[1])[1])
        stripped = self.folder / "stripped.vtp"
        self.expect(SUCCESS, "convert", sure, stripped, "--strip")
        self.assertNotIn(b"StandardError", stripped.read_bytes())
        kept = self.folder / "kept.vtp"
        self.expect(SUCCESS, "convert", sure, kept)
        self.assertIn(b"StandardError", kept.read_bytes())
        for verb in (("slice", plain, "--poses", self.sweep, "-o", images[0]), ("voxelize", plain, "-o", self.folder / "v.mha")):
            self.expect(BAD_INPUT, *verb, "--standard-error", self.folder / "sigma.mha", says="--no-standard-error")
        self.assertFalse((self.folder / "v.mha").exists())

    def bins_say_what_the_scores_do(self, scores):
        bins = scores["reliability"]
        self.assertTrue(all(set(one) == {"sigma", "error", "pixels"} and one["pixels"] > 0 for one in bins))
        self.assertGreater(len(bins), 1)
        sigmas = [one["sigma"] for one in bins]
        self.assertEqual(sigmas, sorted(set(sigmas)))
        pixels = sum(one["pixels"] for one in bins)
        said, found = (sum(one["pixels"] * one[key] ** 2 for one in bins) / pixels for key in ("sigma", "error"))
        self.assertAlmostEqual(found, scores["rmse"] ** 2, places=7)
        self.assertAlmostEqual(said / found, scores["variance_ratio"], places=5)

    def test_a_standard_error_that_cannot_be_had_is_null_and_says_why(self):
        sweep = self.folder / "three.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", sweep, "--frames", 3, *PHANTOM[2:])
        answer = self.expect(SUCCESS, "train", sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 2,
                             notes="the standard error could not be scored: The standard error is known at no pixel")
        self.assertIsNone(answer["standard_error"]["variance_ratio"])
        self.assertIsNone(answer["standard_error"]["reliability"])
        self.assertTrue(math.isfinite(answer["held_out"]["psnr"]))

    def standard_error_of_a_volume_is_that_of_its_slices(self, field, origin):
        volume, sigma = self.folder / "volume.mha", self.folder / "sigma.mha"
        planes = [[0.6, 0, 0, origin[0], 0, 0.6, 0, origin[1], 0, 0, 0.6, origin[2] + 0.6 * k, 0, 0, 0, 1] for k in (0, 1)]
        self.expect(SUCCESS, "voxelize", field, "-o", volume, "--standard-error", sigma, "--spacing", 0.6, "--origin", *origin,
                    "--size", 40, 30, 2)
        of_volume = struct.unpack("<2400f", sigma.read_bytes()[-9600:])
        self.expect(SUCCESS, "slice", field, "--poses", self.poses_csv(*planes), "--size", 40, 30, "-o",
                    self.folder / "s.mha", "--standard-error", sigma)
        of_slices = struct.unpack("<2400f", read_sequence(sigma)[1])
        self.assertGreater(sum(not math.isnan(value) for value in of_slices), 500)
        # Places are the same but for rounding of matrices, and what is known is coded in a byte.
        self.assertLess(sum(math.isnan(a) != math.isnan(b) for a, b in zip(of_volume, of_slices)), 24)
        close = sum(abs(a - b) <= 1e-3 for a, b in zip(of_volume, of_slices) if not math.isnan(a + b))
        self.assertGreater(close, 0.98 * sum(not math.isnan(a + b) for a, b in zip(of_volume, of_slices)))

    def test_slices_say_how_far_they_may_be_wrong(self):
        sure, sigma = self.folder / "sure.vtp", self.folder / "sigma.mha"
        self.expect(SUCCESS, "train", self.sweep, "-o", sure, *TINY)
        header, pixels, _ = read_sequence(self.sweep)
        poses = [list(map(float, found.split())) for found in re.findall(r"ImageToReferenceTransform = (.*)", header)]
        far = list(poses[0])
        far[11] -= 3  # mm before the first frame
        answer = self.expect(SUCCESS, "slice", sure, "--poses", self.poses_csv(poses[4], far), "--size", 48, 40,
                             "-o", self.folder / "s.mha", "--standard-error", sigma)
        values = struct.unpack("<3840f", read_sequence(sigma)[1])
        self.assertTrue(all(0 < value < 1 for value in values[:1920] if not math.isnan(value)))
        self.assertGreater(sum(not math.isnan(value) for value in values[:1920]), 1000)
        self.assertTrue(all(math.isnan(value) for value in values[1920:]))
        self.assertEqual(answer["mostly_guessed"], [1])
        self.standard_error_of_a_volume_is_that_of_its_slices(sure, [poses[4][k] for k in (3, 7, 11)])
        said = run("slice", sure, "--poses", self.poses_csv(far), "--size", 48, 40, "-o", self.folder / "s.mha")
        self.assertIn("mostly guessed: this slice", said.stdout)

    def test_without_hold_out_there_is_no_score(self):
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.ply", *TINY)
        self.assertIsNone(answer["held_out"])
        self.assertIsNone(answer["baselines"])
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 4,
                             "--no-baselines")
        self.assertIsNotNone(answer["held_out"])
        self.assertIsNone(answer["baselines"])

    def test_aligned_scores_are_a_diagnostic_beside_the_score(self):
        training = ("train", self.sweep, "-o", self.folder / "f.vtp", "--no-auto", "--gaussians", 2000,
                    "--iterations", 60, "--hold-out", 4, "--no-baselines")
        plain = self.expect(SUCCESS, *training)
        self.assertIsNone(plain["held_out_aligned"])
        answer = self.expect(SUCCESS, *training, "--align")
        tracked, aligned = answer["held_out"], answer["held_out_aligned"]
        self.assertEqual(tracked, plain["held_out"], "the score itself stays what it is")
        self.assertEqual(aligned["frames"], tracked["frames"])
        self.assertGreaterEqual(aligned["psnr"], tracked["psnr"] - 1e-9, "never worse than the tracked pose")
        self.assertGreater(aligned["largest_translation"], 0)
        for unit, bound in (("translation", 2), ("rotation", 3)):
            self.assertLessEqual(aligned["mean_" + unit], aligned["largest_" + unit])
            self.assertLessEqual(aligned["largest_" + unit], bound + 1e-9)
        text = run(*training, "--align").stdout
        self.assertIn("tracked poses", text)
        self.assertIn("aligned poses (diagnostic: the frame itself chose its pose)", text)

    def test_noisy_poses_are_corrected_and_both_scores_are_told(self):
        sweep = self.folder / "noisy.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", sweep, "--width", 64, "--height", 64, "--pixel-size", 0.4, "--frames", 24,
                    "--tracking-noise", 0.3, "--rotation-noise", 0.3)
        training = ["train", sweep, "-o", self.folder / "f.vtp", "--gaussians", 2000, "--iterations", 60, "--hold-out", 4,
                    "--virtual-planes", 0, "--elevation-sigma", 0.5]
        answer = self.expect(SUCCESS, *training)
        poses = answer["decisions"][0]
        self.assertEqual(poses["decision"], "poses")
        self.assertIn("smoothed by", poses["choice"])
        self.assertRegex(poses["evidence"], r"tracker's noise 0\.\d+ mm and 0\.\d+ degrees.*pictures confirm")
        self.assertGreater(answer["settled"]["pose_smoothing"], 0)
        self.assertGreater(answer["held_out"]["psnr"], answer["held_out_tracked"]["psnr"] + 0.5)
        plain = self.expect(SUCCESS, *training, "--pose-smoothing", 0)
        self.assertEqual(plain["held_out"], plain["held_out_tracked"])
        self.assertGreater(answer["held_out"]["psnr"], plain["held_out"]["psnr"] + 0.5)
        baselines = [run["baselines"]["pose_interpolation"]["psnr"] for run in (answer, plain)]
        self.assertGreater(baselines[0], baselines[1])
        text = run(*training).stdout
        self.assertIn("corrected poses (their own pixels had no part in them)", text)
        self.assertIn("at tracked poses", text)

    def test_training_predicts_better_than_its_seeds(self):
        scores = []
        for iterations in (0, 120):
            answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", "--no-auto", "--gaussians",
                                 2000, "--iterations", iterations, "--hold-out", 4, "--no-baselines", "--batch", 4)
            scores.append(answer["held_out"]["psnr"])
        self.assertGreater(scores[1], scores[0])

    def test_same_bits_for_any_number_of_threads(self):
        fields = []
        for threads in (1, 2, 7):
            folder = self.folder / str(threads)
            folder.mkdir()
            path = folder / "f.vtp"
            self.assertEqual(run("train", self.sweep, "-o", path, *TINY, threads=threads).returncode, SUCCESS)
            fields.append(path.read_bytes())
        self.assertEqual(fields[0], fields[1])
        self.assertEqual(fields[0], fields[2])
        self.assertEqual(run("train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--seed", 2).returncode, SUCCESS)
        self.assertNotEqual(fields[0], (self.folder / "f.vtp").read_bytes())

    def test_held_out_pixels_never_reach_training(self):
        header, pixels, _ = read_sequence(self.sweep)
        frame = 48 * 40
        for hold_out, held in ((4, (2, 6)), (3, (1, 4, 7))):
            poisoned = bytearray(pixels)
            for k in held:
                poisoned[k * frame:(k + 1) * frame] = bytes(255 - value for value in poisoned[k * frame:(k + 1) * frame])
            spoiled = bytearray(pixels)
            spoiled[0:frame] = bytes(255 - value for value in spoiled[0:frame])
            fields = []
            for name, data in (("clean", pixels), ("poisoned", poisoned), ("spoiled", spoiled)):
                folder = self.folder / f"{name}{hold_out}"
                folder.mkdir()
                sequence = folder / "s.igs.mha"
                write_sequence(sequence, header, data)
                result = run("train", sequence, "-o", folder / "f.vtp", *TINY, "--hold-out", hold_out)
                self.assertEqual(result.returncode, SUCCESS, result.stderr)
                fields.append((folder / "f.vtp").read_bytes())
            self.assertEqual(fields[0], fields[1], f"held-out frames {held} took part in training")
            self.assertNotEqual(fields[0], fields[2], "a training frame did not")

    def test_reduce(self):
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--reduce", 2)
        self.assertEqual((answer["width"], answer["height"]), (24, 20))
        self.expect(BAD_INPUT, "train", self.sweep, "-o", self.folder / "g.vtp", *TINY, "--reduce", 50)

    def test_elevation_sigma(self):
        for given, expected in (("0", 0), ("0.55", 0.55), ("auto", 0)):  # frames side by side cannot tell it
            answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY,
                                 "--elevation-sigma", given)
            self.assertAlmostEqual(answer["elevation_sigma"], expected, places=12)

    def test_positive_only(self):
        path = self.folder / "f.vtp"
        for flag in ("--positive-only", "--positive"):
            self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY, flag)
            self.assertGreaterEqual(self.expect(SUCCESS, "info", path)["reflectivity"]["minimum"], 0)
        self.expect(USAGE, "train", self.sweep, "-o", path, "--positive", "--signed")

    def test_forced_choices_are_obeyed_and_reported(self):
        path = self.folder / "f.vtp"
        forced = ["--signed", "--virtual-planes", 1, "--interpolation", "probe+flow", "--frame-gains", "on",
                  "--pose-smoothing", 0, "--elevation-sigma", 0.55, "--loss", "l2",
                  "--probe-elevation-sigma", 0.9]
        settled = {"gaussians": 400, "elevation_sigma": 0.55, "signed_reflectivity": True, "virtual_planes": 1,
                   "interpolation": "probe+flow", "frame_gains": True, "pose_smoothing": 0,
                   "iterations": 12, "loss": "l2"}
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY, *forced)
        self.assertEqual({name: answer["settled"][name] for name in settled}, settled)
        self.assertEqual(answer["decisions"], [], "nothing is decided with --no-auto")
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY, *forced, "--auto")
        self.assertEqual({name: answer["settled"][name] for name in settled}, settled)
        self.assertEqual({decision["evidence"] for decision in answer["decisions"]}, {"given"})
        found = {decision["decision"]: decision["choice"] for decision in answer["decisions"]}
        self.assertEqual(found["Gaussians"], "400")
        self.assertEqual(found["interpolation"], "probe+flow")
        text = run("train", self.sweep, "-o", path, *TINY, *forced, "--auto").stdout
        self.assertRegex(text, r"Gaussians +400 +0\.0 s +given")
        provenance = self.expect(SUCCESS, "info", path)["provenance"]
        self.assertEqual(provenance["decision.Gaussians"], "400 (given)")
        self.assertEqual(provenance["interpolation"], "probe+flow")

    def test_open_choices_are_decided_with_evidence(self):
        path, log = self.folder / "f.vtp", self.folder / "log.csv"
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", path, "--iterations", 12, "--gaussians", "auto",
                             "--hold-out", 9, "--log", log)
        decisions = {decision["decision"]: decision for decision in answer["decisions"]}
        for name in ("interpolation", "Gaussians"):
            self.assertIn("dB", decisions[name]["evidence"], name)
            self.assertGreater(decisions[name]["seconds"], 0, name)
        for name in ("probe's beam", "elevation sigma"):
            self.assertTrue(decisions[name]["evidence"], name)
        self.assertLessEqual(answer["settled"]["gaussians"], 300000)
        self.assertEqual(log.read_text().splitlines()[0], "iteration,seconds,loss,validation_psnr,gaussians,rate")
        # Too few frames to set some aside: geometry decides, and that is said.
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", path, "--iterations", 12, "--hold-out", 2)
        self.assertEqual([decision["decision"] for decision in answer["decisions"]], ["everything"])
        self.assertIn("5 frames", answer["decisions"][0]["evidence"])

    def test_every_option_can_be_given(self):
        path = self.folder / "f.vtp"
        first = self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY)["settled"]
        self.assertGreater(len(first), 30)
        words = {None: "auto", True: "on", False: "off"}
        given = [part for name, value in first.items() for part in
                 ("--" + name.replace("_", "-"), words[value] if value is None or value is True or value is False else value)]
        field = path.read_bytes()
        self.assertEqual(self.expect(SUCCESS, "train", self.sweep, "-o", path, *given)["settled"], first)
        self.assertEqual(path.read_bytes(), field)
        usage = run("train", "--help").stdout
        for name in first:
            self.assertRegex(usage, "--" + name.replace("_", "-") + r"[ ,].*")

    def test_values_out_of_range_name_option_value_and_range(self):
        for option, value, says in (("--virtual-planes", 9, "virtual planes is 9; it must be 0 to 8 or auto"),
                                    ("--price", -1, "price is -1; it must be 0 to 100 dB"),
                                    ("--hold-out", 1, "hold out is 1; it must be 0 or 2 to 1000000"),
                                    ("--batch", 2.5, "batch is 2.5; it must be 1 to 4096"),
                                    ("--frame-gains", "perhaps", "frame gains is 'perhaps'; it must be on|off"),
                                    ("--loss", "l3", "loss: ")):
            self.expect(USAGE, "train", self.sweep, "-o", self.folder / "f.vtp", option, value, says=says)

    def test_a_named_interpolation_keeps_contrast_where_the_preset_asks_for_it(self):
        fields = []
        for options in ([], ["--interpolation", "normals"]):  # what geometry chooses, too
            path = self.folder / "f.vtp"
            self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY, "--preset", "texture", *options)
            fields.append(path.read_bytes())
        self.assertEqual(fields[0], fields[1])

    def test_presets_choose_the_loss_unless_one_is_given(self):
        def loss(*options):
            answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, *options)
            return answer["settled"]["loss"]

        self.assertEqual(loss("--preset", "fidelity"), "l1")
        self.assertIn("contrast", loss("--preset", "texture"))
        self.assertEqual(loss("--preset", "texture", "--loss", "l2"), "l2")

    def test_continue_from_a_field(self):
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", "--continue", self.field,
                             "--iterations", 3)
        self.assertTrue(380 < answer["gaussians"] <= 400)

    def test_time_limit(self):
        start = time.monotonic()
        answer = self.expect(SUCCESS, "train", self.sweep, "-o", self.folder / "f.vtp", "--no-auto", "--gaussians",
                             5000, "--iterations", 10000000, "--time-limit", 1)
        self.assertLess(time.monotonic() - start, 30)
        self.assertLess(answer["iterations"], 10000000)

    def test_a_field_without_a_score_stands(self):
        header, pixels, _ = read_sequence(self.sweep)
        poses = (" ".join(map(str, [.4, 0, 0, 0, 0, .4, 0, 0, 0, 0, 1, 3e-6 * k, 0, 0, 0, 1])) for k in range(1000))
        header = re.sub(r"(ImageToReferenceTransform = ).*", lambda found: found.group(1) + next(poses), header)
        path, field = self.folder / "near.mha", self.folder / "near.vtp"
        write_sequence(path, header, pixels)
        answer = self.expect(SUCCESS, "train", path, "-o", field, *TINY, "--keep", "all", "--hold-out", "4",
                             notes="the field was written, but planes along the sweep could not be scored")
        self.assertIsNone(answer["cross_planes"])
        self.assertTrue(field.exists())

    def test_unwritable_output_is_found_before_training(self):
        for name in (".vtp", ".ply"):
            self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / name, *TINY, says="something before that")
            self.assertNothingIn(self.folder)
        start = time.monotonic()
        long = ["--iterations", "10000000"]
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / "no" / "f.vtp", *long, says="f.vtp")
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder, *long)
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / "f.txt", *long, says=".vtp or .ply")
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / "f.vtp", *long, "--log",
                    self.folder / "no" / "log.csv", says="log.csv")
        self.assertLess(time.monotonic() - start, 30)
        self.assertNothingIn(self.folder)

    def test_bad_sequences(self):
        header, pixels, offset = read_sequence(self.sweep)
        whole = self.sweep.read_bytes()
        cases = {"truncated.mha": whole[:offset + 100],
                 "empty.mha": b"",
                 "text.mha": b"hello\n",
                 "nan.mha": re.sub(rb"(ImageToReferenceTransform =) \S+", rb"\1 nan", whole),
                 "singular.mha": re.sub(rb"(ImageToReferenceTransform =)[^\n]*", rb"\1" + b" 0" * 16, whole)}
        for name, data in cases.items():
            path = self.folder / name
            path.write_bytes(data)
            with self.subTest(name):
                self.expect(BAD_INPUT, "train", path, "-o", self.folder / "f.vtp", *TINY, says=name)
        black = self.folder / "black.mha"
        write_sequence(black, header, bytes(len(pixels)))
        self.expect(BAD_INPUT, "train", black, "-o", self.folder / "f.vtp", *TINY)
        self.expect(BAD_INPUT, "train", self.folder / "absent.mha", "-o", self.folder / "f.vtp", says="absent.mha")
        self.expect(BAD_INPUT, "train", self.sweep, "-o", self.folder / "f.vtp", "--config", self.folder / "no.xml",
                    says="no.xml")
        # An engine that does not exist is found before the sweep is read.
        for sequence in (self.sweep, self.folder / "empty.mha"):
            self.expect(BAD_INPUT, "train", sequence, "-o", self.folder / "f.vtp", "--engine", "steam", says="steam")
        self.expect(BAD_INPUT, "train", self.sweep, "-o", self.folder / "f.vtp", "--image-to", "Moon", says="Moon")
        self.assertFalse((self.folder / "f.vtp").exists())

    def test_unusual_sequences(self):
        header, pixels, _ = read_sequence(self.sweep)
        frame = 48 * 40
        one = self.folder / "one.mha"
        lines = [line for line in header.splitlines(keepends=True) if not re.match(r"Seq_Frame000[1-8]_", line)]
        write_sequence(one, "".join(lines).replace("DimSize = 48 40 9", "DimSize = 48 40 1"), pixels[:frame])
        self.assertEqual(self.expect(SUCCESS, "info", one)["frames"], 1)
        self.expect(BAD_INPUT, "train", one, "-o", self.folder / "f.vtp", *TINY, says="one frame")
        self.expect(BAD_INPUT, "train", one, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 2, says="--hold-out 2")
        self.expect(BAD_INPUT, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 100,
                    says="--hold-out 100")
        constant = self.folder / "constant.mha"
        write_sequence(constant, header, bytes([90]) * len(pixels))
        self.expect(BAD_INPUT, "train", constant, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 4,
                    says="nothing to learn")
        self.expect(BAD_INPUT, "train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--hold-out", 4, "--reduce", 4,
                    says="11 x 11")

    def test_clip_blackens_what_is_outside(self):
        clipped = self.folder / "clipped.mha"
        self.expect(SUCCESS, "convert", self.sweep, clipped, "--clip-rectangle", 10, 5, 20, 30)
        before, after = read_sequence(self.sweep)[1], read_sequence(clipped)[1]
        for k, (a, b) in enumerate(zip(before, after)):
            i, j = k % 48, k // 48 % 40
            self.assertEqual(b, a if 10 <= i < 30 and 5 <= j < 35 else 0)

    def test_interrupt_saves_the_best_so_far(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM, signal.SIGUSR1, signal.SIGUSR2,
                       signal.SIGXCPU):
            with self.subTest(number):
                path = self.folder / "f.vtp"
                process = subprocess.Popen([BIGUS, "train", str(self.sweep), "-o", str(path), "--no-auto",
                                            "--gaussians", "2000",
                                            "--iterations", "10000000", "--hold-out", "4", "--json", "--progress"],
                                           stdout=subprocess.PIPE, stderr=subprocess.PIPE)
                self.await_bar(process, b"Training [")
                time.sleep(0.5)
                process.send_signal(number)
                stdout, stderr = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 128 + number)
                self.assertEqual(stderr.count(b"stopping at the end of this step"), 1, "it is said that it was heard")
                answer = json.loads(stdout)
                self.assertIs(answer["interrupted"], True)
                self.assertGreater(answer["iterations"], 0)
                gaussians = self.expect(SUCCESS, "info", path)["gaussians"]
                self.assertEqual(gaussians, answer["gaussians"])
                self.assertTrue(1900 < gaussians <= 2000, "but for those that no plane shows")
                self.assertEqual(sorted(os.listdir(self.folder)), ["f.vtp", "f.vtp.checkpoint"])
                self.assertIs(answer["finished"], False)
                path.unlink()
                (self.folder / "f.vtp.checkpoint").unlink()

    ENDLESS = ("--no-auto", "--gaussians", "2000", "--iterations", "10000000")

    def endless_training(self, path, *options):
        process = subprocess.Popen([BIGUS, "train", str(self.sweep), "-o", str(path), *self.ENDLESS, "--progress", *options],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.await_bar(process, b"iteration")
        return process

    def test_a_reader_that_goes_away_costs_no_field(self):
        path = self.folder / "f.vtp"
        process = self.endless_training(path)
        process.stderr.close()
        process.stdout.close()
        self.assertEqual(process.wait(timeout=60), 128 + signal.SIGPIPE)
        self.expect(SUCCESS, "info", path)
        self.assertTrue((self.folder / "f.vtp.checkpoint").exists())

    def test_a_folder_that_goes_away_costs_no_field(self):
        folder = self.folder / "a" / "b"
        folder.mkdir(parents=True)
        process = self.endless_training(folder / "f.vtp")
        shutil.rmtree(self.folder / "a")
        process.send_signal(signal.SIGTERM)
        _, stderr = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 128 + signal.SIGTERM)
        self.assertIn(b"made anew", stderr)
        self.assertEqual(sorted(os.listdir(folder)), ["f.vtp", "f.vtp.checkpoint"])

    def test_one_output_is_trained_once_at_a_time(self):
        path = self.folder / "f.vtp"
        process = self.endless_training(path, "--checkpoint-interval", "0.01")
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", path, *TINY, says="another training")
        self.assertTrue((self.folder / "f.vtp.checkpoint").exists(), "it is the other training's")
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
        self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY)
        self.assertEqual(os.listdir(self.folder), ["f.vtp"])

    def test_interrupt_ends_scoring(self):
        sweep, path = self.folder / "long.igs.mha", self.folder / "f.vtp"
        self.expect(SUCCESS, "phantom", "-o", sweep, "--frames", 80, "--width", 160, "--height", 160)
        process = subprocess.Popen([BIGUS, "train", str(sweep), "-o", str(path), "--no-auto", "--gaussians", "2000",
                                    "--iterations", "2", "--hold-out", "2", "--align", "--json"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.await_bar(process, b"Aligning")
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate(timeout=5)
        self.assertEqual(process.returncode, INTERRUPTED)
        self.assertIn(b"not scored", stderr)
        answer = json.loads(stdout)
        self.assertIsNone(answer["held_out_aligned"])
        self.assertEqual(self.expect(SUCCESS, "info", path)["gaussians"], answer["gaussians"])
        self.assertEqual(sorted(os.listdir(self.folder)), ["f.vtp", "long.igs.mha"])

    def test_nohup_is_obeyed(self):
        path = self.folder / "f.vtp"
        process = subprocess.Popen([BIGUS, "train", str(self.sweep), "-o", str(path), "--no-auto", "--gaussians", "500",
                                    "--iterations", "300", "--progress"], stderr=subprocess.PIPE,
                                   stdout=subprocess.DEVNULL, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        self.await_bar(process, b"Training [")
        process.send_signal(signal.SIGHUP)
        process.communicate(timeout=60)
        self.assertEqual(process.returncode, SUCCESS)

    def test_messages_and_bar_keep_off_stdout(self):
        result = run("train", self.sweep, "-o", self.folder / "f.vtp", *TINY, "--progress", "--json")
        json.loads(result.stdout)
        self.assertIn("100 %", result.stderr)
        quiet = run("train", self.sweep, "-o", self.folder / "f.vtp", *TINY)
        self.assertNotIn("%", quiet.stderr, "no bar unless stderr is a terminal")
        self.assertRegex(quiet.stdout, r"\d+ Gaussians, .* MB, 12 iterations")

    def test_the_bar_fits_the_terminal(self):
        for columns in (40, 80, 120):
            with self.subTest(columns):
                ours, theirs = pty.openpty()
                fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))
                process = subprocess.Popen([BIGUS, "train", str(self.sweep), "-o", str(self.folder / "f.vtp"), *TINY,
                                            "--progress"], stdout=subprocess.DEVNULL, stderr=theirs)
                os.close(theirs)
                seen = b""
                while True:
                    try:
                        chunk = os.read(ours, 4096)
                    except OSError:  # the other side is closed
                        break
                    if not chunk:
                        break
                    seen += chunk
                os.close(ours)
                self.assertEqual(process.wait(timeout=60), SUCCESS)
                drawn = [text.split(b"\x1b[K")[0] for text in seen.split(b"\r") if b"Training " in text and b"\x1b[K" in text]
                self.assertTrue(drawn)
                self.assertLess(max(map(len, drawn)), columns)


class Resume(CommandTest):
    RESUMABLE = ("--no-auto", "--gaussians", "400", "--iterations", "3000")

    def interrupted_training(self, path, *options):
        process = subprocess.Popen([BIGUS, "train", str(self.sweep), "-o", str(path), *self.RESUMABLE, "--progress",
                                    "--json", *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.await_bar(process, b"iteration")
        process.send_signal(signal.SIGINT)
        stdout, _ = process.communicate(timeout=60)
        self.assertEqual(process.returncode, INTERRUPTED)
        return json.loads(stdout)

    def test_an_interrupted_training_goes_on_with_the_same_bits(self):
        whole, path = self.folder / "whole.vtp", self.folder / "f.vtp"
        checkpoint = self.folder / "f.vtp.checkpoint"
        for threads in ("1", "2"):
            with self.subTest(threads):
                train = ("train", self.sweep, *self.RESUMABLE, "--threads", threads)
                self.assertIs(self.expect(SUCCESS, *train, "-o", whole)["finished"], True)
                self.interrupted_training(path, "--threads", threads)
                self.assertTrue(checkpoint.exists())
                self.assertNotEqual(path.read_bytes(), whole.read_bytes())
                self.assertEqual(self.expect(SUCCESS, *train, "-o", path, "--resume")["iterations"], 3000)
                self.assertEqual(path.read_bytes(), whole.read_bytes())
                self.assertFalse(checkpoint.exists(), "a finished training needs none")

    def test_checkpoints_of_other_trainings_and_damaged_ones_are_refused(self):
        path, checkpoint = self.folder / "f.vtp", self.folder / "f.vtp.checkpoint"
        self.interrupted_training(path)
        train = ("train", self.sweep, "-o", path, *self.RESUMABLE, "--resume")
        self.expect(BAD_INPUT, *train, "--seed", 5, says="seed was 1 and is 5")
        other = self.folder / "other.igs.mha"
        self.assertEqual(run("phantom", "-o", other, *PHANTOM, "--seed", 9).returncode, SUCCESS)
        self.expect(BAD_INPUT, "train", other, *train[2:], says="checksum of the pixels")
        sound = checkpoint.read_bytes()
        for damaged in (b"", b"BIG", sound[:1000], sound[:-1], sound + b"0", sound[:5000] + b"\xff" + sound[5001:],
                        self.sweep.read_bytes()):
            if damaged != sound:
                checkpoint.write_bytes(damaged)
                self.expect(BAD_INPUT, *train)
        self.assertTrue(checkpoint.exists(), "what is refused stays")
        checkpoint.write_bytes(sound)
        self.expect(SUCCESS, *train)

    def test_where_no_checkpoint_is_or_can_be_written_training_goes_on(self):
        path, checkpoint = self.folder / "f.vtp", self.folder / "f.vtp.checkpoint"
        result = run("train", self.sweep, "-o", path, *TINY, "--resume")
        self.assertEqual(result.returncode, SUCCESS)
        self.assertIn("no " + str(checkpoint), result.stderr)
        checkpoint.mkdir()
        result = run("train", self.sweep, "-o", path, *self.RESUMABLE, "--checkpoint-interval", "0.01")
        self.assertEqual(result.returncode, SUCCESS)
        self.assertEqual(result.stderr.count("warning"), 1, result.stderr)
        checkpoint.rmdir()
        self.interrupted_training(path, "--checkpoint-interval", "0")
        self.assertFalse(checkpoint.exists())


def centres(path):
    """Where the image's upper left pixel lies in every frame, mm, and the poses themselves, of a sequence or a CSV."""
    if str(path).endswith(".csv"):
        with open(path, newline="") as file:
            poses = [[float(row[f"m{i}{j}"]) for i in range(4) for j in range(4)] for row in csv.DictReader(file)]
    else:
        poses = [[float(value) for value in line.split()]
                 for line in re.findall(r"ImageToReferenceTransform = (.*)", read_sequence(path)[0])]
    return [(pose[3], pose[7], pose[11]) for pose in poses], poses


class Poses(CommandTest):
    WORLD = ["--width", 64, "--height", 64, "--pixel-size", 0.4, "--frames", 24]
    NOISE = ["--tracking-noise", 0.3, "--rotation-noise", 0.3]

    def noisy(self, name="noisy.igs.mha"):
        path = self.folder / name
        self.expect(SUCCESS, "phantom", "-o", path, *self.WORLD, *self.NOISE, "--write-true-poses",
                    self.folder / "true.csv")
        return path

    def error(self, path):
        """Mean distance of the first pixels from where they truly are, mm."""
        found, truth = centres(path)[0], centres(self.folder / "true.csv")[0]
        return sum(map(math.dist, found, truth)) / len(truth)

    def test_a_sequence_comes_nearer_to_the_truth_with_the_same_pixels(self):
        sweep, out = self.noisy(), self.folder / "corrected.igs.mha"
        answer = self.expect(SUCCESS, "poses", sweep, "-o", out)
        self.assertLess(self.error(out), 0.6 * self.error(sweep))
        self.assertEqual(read_sequence(out)[1], read_sequence(sweep)[1])
        self.assertEqual(re.findall("Timestamp = .*", read_sequence(out)[0]),
                         re.findall("Timestamp = .*", read_sequence(sweep)[0]))
        self.assertEqual(set(answer), {"output", "frames", "changed", "strength", "decision", "noise", "constant_errors",
                                       "findings", "steps", "outliers", "strokes", "displacement", "rotation", "each_frame",
                                       "alignment"})
        self.assertEqual((answer["output"], answer["frames"], answer["changed"]), (str(out), 24, True))
        self.assertGreater(answer["strength"], 0)
        self.assertIn("smoothed by", answer["decision"]["choice"])
        self.assertAlmostEqual(answer["noise"]["translation"], 0.3, delta=0.15)
        self.assertAlmostEqual(answer["noise"]["rotation"], 0.3, delta=0.15)
        constant = answer["constant_errors"]  # one sweep there and not back tells none
        self.assertEqual((constant["applied"], constant["delay"]), (False, {"value": [0], "standard_error": [None],
                                                                            "observable": [False]}))
        nothing = {"share": None, "share_error": None, "gain": None, "taken": False}
        self.assertEqual((constant["steps"], answer["alignment"]), ({"delay": nothing, "calibration": nothing}, nothing))
        page = self.folder / "poses.png"
        self.expect(SUCCESS, "poses", sweep, "-o", page)
        width, height = struct.unpack(">II", page.read_bytes()[16:24])
        self.assertEqual(width, 1200)
        self.assertGreater(height, 700)
        now = 0.0
        for step in answer["steps"]:
            self.assertEqual(step["from"], now)
            now = step["to"] if step["taken"] else now
        self.assertEqual(now, answer["strength"])
        self.assertEqual((len(constant["shift"]["value"]), len(constant["rotation"]["standard_error"])), (3, 3))
        each = answer["each_frame"]
        self.assertEqual({len(values) for values in each.values()}, {24})
        self.assertEqual(each["source_frame"], list(range(24)))
        self.assertEqual(max(each["displacement"]), answer["displacement"]["largest"])
        self.assertAlmostEqual(sum(each["displacement"]) / 24, answer["displacement"]["mean"])
        before, after = each["recorded_centre"], each["corrected_centre"]
        self.assertNotEqual(before, after)
        self.assertLessEqual(answer["displacement"]["median"], answer["displacement"]["q95"])
        text = run("poses", sweep, "-o", out).stdout
        for part in ("tracker's noise", "outliers", "1 continuous motion", "95 % below", "pictures confirm"):
            self.assertIn(part, text)

    def test_every_format_holds_the_same_poses(self):
        sweep = self.noisy()
        mha, nrrd, table, back = (self.folder / name for name in ("c.igs.mha", "c.nrrd", "c.csv", "back.igs.mha"))
        for out in (mha, nrrd, table):
            self.expect(SUCCESS, "poses", sweep, "-o", out)
        self.expect(SUCCESS, "convert", nrrd, back)
        self.assertEqual(centres(back)[1], centres(mha)[1])
        self.assertEqual(centres(table)[1], centres(mha)[1])
        with open(table, newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual({row["width"] + row["height"] for row in rows}, {"6464"})
        self.assertGreater(float(rows[3]["displacement"]), 0)
        recorded = centres(sweep)[1][3]
        self.assertAlmostEqual(float(rows[3]["recorded_y"]), 31.5 * (recorded[4] + recorded[5]) + recorded[7])
        slices = [self.folder / "a.mha", self.folder / "b.mha"]
        for poses, out in zip((mha, table), slices):
            self.expect(SUCCESS, "slice", self.field, "--poses", poses, "-o", out)
        self.assertEqual(slices[0].read_bytes(), slices[1].read_bytes())

    def test_a_delay_is_told_with_the_share_that_pictures_confirm(self):
        late, out = self.folder / "late.igs.mha", self.folder / "out.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", late, "--width", 64, "--height", 64, "--pixel-size", 0.4, "--frames", 48,
                    "--passes", 2, "--tracking-delay", 0.1)
        constant = self.expect(SUCCESS, "poses", late, "-o", out)["constant_errors"]
        step = constant["steps"]["delay"]
        self.assertTrue(constant["applied"] and step["taken"])
        self.assertGreater(step["share"] - 2 * step["share_error"], 0.5)
        self.assertGreater(step["gain"], 0)
        delay = constant["delay"]
        self.assertAlmostEqual(delay["value"][0], 0.1, delta=2 * delay["standard_error"][0])

    def test_exact_poses_and_strength_off_are_kept_bit_for_bit(self):
        for sweep, strength in ((self.sweep, "auto"), (self.noisy(), "off"), (self.noisy(), "0")):
            out = self.folder / "kept.mha"
            answer = self.expect(SUCCESS, "poses", sweep, "-o", out, "--strength", strength)
            self.assertEqual((answer["changed"], answer["strength"], answer["displacement"]["largest"]), (False, 0, 0))
            self.assertEqual(centres(out)[1], centres(sweep)[1])

    def test_strength_and_threads(self):
        sweep, one, many = self.noisy(), self.folder / "one.mha", self.folder / "many.mha"
        answer = self.expect(SUCCESS, "poses", sweep, "-o", one, "--strength", 2.5, "--threads", 1)
        self.assertEqual((answer["strength"], answer["decision"]["evidence"].split(";")[0]), (2.5, "given"))
        run("poses", sweep, "-o", one, threads=1)
        run("poses", sweep, "-o", many, threads=3)
        self.assertEqual(one.read_bytes(), many.read_bytes())

    def test_held_out_pixels_are_not_looked_at(self):
        sweep, inverted, out = self.noisy(), self.folder / "inverted.igs.mha", self.folder / "out.mha"
        header, pixels, _ = read_sequence(sweep)
        frame = 64 * 64
        write_sequence(inverted, header, bytes(255 - v if k // frame % 4 == 2 else v for k, v in enumerate(pixels)))
        found = []
        for path in (sweep, inverted):
            found.append(self.expect(SUCCESS, "poses", path, "-o", out, "--hold-out", 4)["decision"])
            found.append(centres(out)[1])
        self.assertEqual(found[:2], found[2:])

    def test_slices_agree_with_the_report_of_training(self):
        sweep, field = self.noisy(), self.folder / "f.vtp"
        table, sequence = self.folder / "poses.csv", self.folder / "poses.igs.mha"
        training = ["train", sweep, "-o", field, "--no-auto", "--pose-smoothing", 1, "--gaussians", 2000, "--iterations",
                    60, "--hold-out", 4, "--no-baselines"]
        answer = self.expect(SUCCESS, *training, "--write-poses", sequence)
        self.expect(SUCCESS, *training, "--write-poses", table)
        self.assertEqual(centres(table)[1], centres(sequence)[1])
        self.assertEqual(read_sequence(sequence)[1], read_sequence(sweep)[1])
        self.assertLess(self.error(sequence), 0.6 * self.error(sweep))
        out, truth = self.folder / "s.mha", self.folder / "t.mha"
        frames = ["--frames", "2,6,10,14,18,22"]
        header, pixels, _ = read_sequence(sweep)
        held_out = b"".join(pixels[k * 4096:(k + 1) * 4096] for k in range(2, 24, 4))
        scores, notes = {}, {}
        for poses in (sequence, table, sweep):
            sliced = run("slice", field, "--poses", poses, *frames, "-o", out, "--json")
            self.assertEqual(sliced.returncode, SUCCESS)
            self.assertRegex(json.loads(sliced.stdout)["trained_poses"], r"^corrected by 0\.\d+ mm on average$")
            write_sequence(truth, *read_sequence(out)[:1], held_out)
            scores[poses] = self.expect(SUCCESS, "metrics", out, truth)["psnr"]
            notes[poses] = sliced.stderr
        # The report scores intensities before they are rounded to bytes.
        self.assertAlmostEqual(scores[sequence], answer["held_out"]["psnr"], delta=0.02)
        self.assertEqual(scores[table], scores[sequence])
        self.assertAlmostEqual(scores[sweep], answer["held_out_tracked"]["psnr"], delta=0.02)
        self.assertGreater(scores[sequence], scores[sweep] + 0.1)
        self.assertIn("these planes are as tracked", notes[sweep])
        self.assertIn("--write-poses", notes[sweep])
        self.assertEqual(notes[table] + notes[sequence], "")

    def test_fields_know_of_directions_near_recorded_frames(self):
        sweep, field, plain = (self.folder / name for name in ("s.igs.mha", "f.vtp", "plain.vtp"))
        self.expect(SUCCESS, "phantom", "-o", sweep, *PHANTOM[2:], "--frames", 18, "--tilt", 8, "--passes", 2)
        training = ["train", sweep, *TINY, "--no-baselines", "-o"]
        answer = self.expect(SUCCESS, *training, field, "--view-dependence", "on")
        self.assertEqual(answer["decisions"][-1]["decision"], "view dependence")
        self.assertEqual((answer["decisions"][-1]["choice"], answer["settled"]["view_dependence"]), ("on", True))
        self.assertEqual(self.expect(SUCCESS, *training, plain)["settled"]["view_dependence"], False)
        self.assertEqual(self.expect(SUCCESS, "info", field)["view_poses"], 18)
        self.assertIsNone(self.expect(SUCCESS, "info", plain)["view_poses"])
        out, again = self.folder / "o.mha", self.folder / "again.mha"
        at_frames = ["--poses", sweep, "-o"]
        self.assertEqual(self.expect(SUCCESS, "slice", field, *at_frames, out)["view_nearness"], [1] * 18)
        self.assertIsNone(self.expect(SUCCESS, "slice", plain, *at_frames, out)["view_nearness"])
        across = ["--poses", self.poses_csv([0, 0, 0.6, 0, 0, 0.6, 0, 0, 0.6, 0, 0, 0, 0, 0, 0, 1]), "--size", 30, 30, "-o"]
        self.assertEqual(self.expect(SUCCESS, "slice", field, *across, out)["view_nearness"], [0])
        # Copied, it is the same; as .ply, whose places and sizes are floats, but for rounding.
        copy, ply = self.folder / "copy.vtp", self.folder / "f.ply"
        self.expect(SUCCESS, "convert", field, copy)
        self.expect(SUCCESS, "convert", field, ply)
        self.expect(SUCCESS, "slice", field, *at_frames, out)
        self.expect(SUCCESS, "slice", copy, *at_frames, again)
        pixels = read_sequence(out)[1]
        self.assertEqual(pixels, read_sequence(again)[1])
        self.assertEqual(self.expect(SUCCESS, "slice", ply, *at_frames, again)["view_nearness"], [1] * 18)
        self.assertLessEqual(max(abs(a - b) for a, b in zip(pixels, read_sequence(again)[1])), 1)

    def test_several_sequences_train_one_field(self):
        first, second = self.noisy(), self.folder / "patient-doe.igs.mha"
        self.expect(SUCCESS, "phantom", "-o", second, *self.WORLD, *self.NOISE, "--sweep-angle", 90)
        field, poses = self.folder / "f.vtp", self.folder / "poses.csv"
        training = ["train", first, second, "-o", field, "--no-auto", "--pose-smoothing", 1, "--gaussians", 4000,
                    "--iterations", 60, "--hold-out", 4, "--no-baselines", "--write-poses", poses]
        answer = self.expect(SUCCESS, *training)
        self.assertEqual(answer["held_out"]["frames"], 12)
        self.assertEqual([one["held_out"]["frames"] for one in answer["sequences"]], [6, 6])
        self.assertEqual([one["frames"] for one in answer["sequences"]], [24, 24])
        mean = sum(one["held_out"]["psnr"] for one in answer["sequences"]) / 2
        self.assertAlmostEqual(mean, answer["held_out"]["psnr"], places=6)
        self.assertFalse(poses.exists())
        for k, sweep in enumerate((first, second)):
            own = self.folder / f"poses-{k + 1}.csv"
            out, truth = self.folder / "s.mha", self.folder / "t.mha"
            sliced = run("slice", field, "--poses", own, "--frames", "2,6,10,14,18,22", "-o", out, "--json")
            self.assertEqual(sliced.stderr, "")
            _, pixels, _ = read_sequence(sweep)
            held_out = b"".join(pixels[n * 4096:(n + 1) * 4096] for n in range(2, 24, 4))
            write_sequence(truth, read_sequence(out)[0], held_out)
            # The report scores intensities before they are rounded to bytes.
            self.assertAlmostEqual(self.expect(SUCCESS, "metrics", out, truth)["psnr"],
                                   answer["sequences"][k]["held_out"]["psnr"], delta=0.02)
            self.assertRegex(answer["sequences"][k]["poses"], r"^corrected by 0\.\d+ mm on average$")
            note = run("slice", field, "--poses", sweep, "-o", out).stderr
            self.assertIn("these planes are as tracked", note)
        told = run("info", field, "--json").stdout
        self.assertIn("poses.sequence2", told)
        self.assertNotIn("doe", told)
        # Trained again as the report says, the same bytes; a sequence alone has a list of one.
        before = field.read_bytes()
        self.expect(SUCCESS, *training)
        self.assertEqual(field.read_bytes(), before)
        alone = self.expect(SUCCESS, "train", first, "-o", field, *TINY, "--hold-out", 4)
        self.assertEqual([one["held_out"] for one in alone["sequences"]], [alone["held_out"]])

    def test_sequences_of_other_sizes_are_refused_with_both_names(self):
        answer = self.expect(BAD_INPUT, "train", self.noisy(), self.sweep, "-o", self.folder / "f.vtp", says="48 x 40")
        self.assertIn("sweep.igs.mha", answer["error"])
        self.assertIn("64 x 64", answer["error"])
        self.expect(BAD_INPUT, "train", self.sweep, self.folder / "none.mha", "-o", self.folder / "f.vtp", says="none.mha")
        self.expect(CANNOT_WRITE, "train", self.sweep, self.sweep, "-o", self.folder / "f.vtp", "--write-poses", "x.txt",
                    says=".csv")

    def test_written_poses_follow_reduce_and_say_nothing_of_exact_ones(self):
        field, poses = self.folder / "f.vtp", self.folder / "poses.mha"
        self.expect(SUCCESS, "train", self.sweep, "-o", field, *TINY, "--reduce", 2, "--write-poses", poses)
        sliced = run("slice", field, "--poses", poses, "-o", self.folder / "s.mha", "--json")
        self.assertEqual((json.loads(sliced.stdout)["width"], json.loads(sliced.stdout)["height"]), (24, 20))
        self.assertEqual(json.loads(sliced.stdout)["trained_poses"], "as tracked")
        self.assertEqual(run("slice", field, "--poses", self.sweep, "-o", self.folder / "s.mha").stderr, "")

    def test_errors(self):
        self.expect(CANNOT_WRITE, "poses", self.sweep, "-o", self.folder / "x.jpg", says=".csv")
        self.expect(CANNOT_WRITE, "poses", self.sweep, "-o", self.folder / "no" / "x.mha")
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / "f.vtp", "--write-poses", "x.txt", says=".csv")
        self.expect(BAD_INPUT, "poses", self.folder / "none.mha", "-o", self.folder / "x.mha", says="none.mha")
        self.expect(BAD_INPUT, "poses", self.field, "-o", self.folder / "x.mha")
        self.assertNothingIn(self.folder)


class InstructionSets(CommandTest):
    def test_each_repeats_its_field_whichever_way_it_is_asked_for(self):
        fields = {}
        for name in instruction_sets():
            path = self.folder / f"{name}.vtp"
            answer = self.expect(SUCCESS, "train", self.sweep, "-o", path, *TINY, "--simd", name, "--hold-out", "4")
            self.assertIn(f"({name},", answer["device"])
            self.assertEqual(self.expect(SUCCESS, "info", path)["provenance"]["instructionSet"], name)
            again = self.folder / "again.vtp"
            subprocess.run([BIGUS, "train", self.sweep, "-o", again, *TINY, "--hold-out", "4"], check=True,
                           capture_output=True, env={**os.environ, "BIGUS_SIMD": name})
            self.assertEqual(path.read_bytes(), again.read_bytes())
            fields[name] = answer["held_out"]["psnr"]
        self.assertLess(max(fields.values()) - min(fields.values()), 0.1, "dB; rounding, grown by training")

    def test_errors(self):
        self.expect(USAGE, "info", self.field, "--simd", "AVX9", says="AVX9")
        result = subprocess.run([BIGUS, "info", self.field], capture_output=True, text=True,
                                env={**os.environ, "BIGUS_SIMD": "AVX9"})
        self.assertEqual(result.returncode, USAGE)
        self.assertIn("BIGUS_SIMD", result.stderr)


class Hostile(CommandTest):
    """Files that mean harm, and places where nothing can be written."""

    def sequence_with(self, *lines):
        """The sweep with these lines in its header, and no pose under the name that is looked for."""
        header, pixels, _ = read_sequence(self.sweep)
        header = header.replace("ImageToReference", "ImageToNowhere")
        path = self.folder / "hostile.mha"
        write_sequence(path, header.replace("ElementDataFile", "\n".join(lines) + "\nElementDataFile"), pixels)
        return path

    def test_long_names_do_not_exhaust_the_stack(self):
        matrix = " ".join(map(str, IDENTITY))
        names = [f"A{i}To{'0x' + 'a' * 60000}Transform = {matrix}" for i in range(6)]
        result = run("info", self.sequence_with(*names))
        self.assertEqual(result.returncode, BAD_INPUT)
        self.assertIn("no way from Image to Reference", result.stderr)
        self.assertLess(len(result.stderr), 3000)

    def test_many_transforms_are_searched_once(self):
        matrix = " ".join(map(str, IDENTITY))
        chain = [f"F{i}ToF{i + 1}Transform = {matrix}" for i in range(60000)]
        chain.append(f"ImageToF0Transform = {matrix}")
        answer = self.expect(BAD_INPUT, "info", self.sequence_with(*chain), says="no way from Image to Reference")
        self.assertLess(len(answer["error"]), 4000)

    def test_provenance_of_a_million_lines(self):
        text = self.field.read_bytes()
        raw = text.index(b"_", text.index(b"<AppendedData")) + 1
        tail = text.rindex(b"</AppendedData>")
        array = re.search(rb'<Array type="String" Name="Provenance"[^>]*>', text)
        for size in (100_000, 10_000_000):  # bytes, each a line of its own
            lines = zlib.compress(bytes(size))
            block = struct.pack("<4Q", 1, size, 0, len(lines)) + lines
            appended = text[raw:tail].rstrip(b"\n ")
            tag = re.sub(rb'offset="\d+"', b'offset="%d"' % len(appended), array.group(0))
            path = self.folder / "bomb.vtp"
            path.write_bytes(text[:array.start()] + tag + text[array.end():raw] + appended + block + b"\n  " + text[tail:])
            self.expect(BAD_INPUT, "info", path, says="Provenance")

    def test_what_a_terminal_obeys_is_not_shown(self):
        header, pixels, _ = read_sequence(self.sweep)
        matrix, path = " ".join(map(str, IDENTITY)), self.folder / "escape.mha"
        for evil in ("\x1b]0;title\x07", "\x9b31m", "\u202e", "\u2066", "\x7f"):  # title, colour, right to left, delete
            lines = f"X{evil}ToReferenceTransform = {matrix}\n"
            path.write_bytes(header.replace("ElementDataFile", lines + "ElementDataFile").encode() + pixels)
            with self.subTest(evil):
                said = run("info", path)
                self.assertEqual(said.returncode, SUCCESS, said.stderr)
                self.assertIn("X?", said.stdout)
                self.assertNotRegex(said.stdout + said.stderr, r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")

    def test_a_few_bytes_hold_no_million_frames(self):
        pixels = zlib.compress(bytes(10**6), 9)
        path = self.folder / "many.mha"
        path.write_bytes(b"ObjectType = Image\nNDims = 3\nDimSize = 1 1 1000000\nElementType = MET_UCHAR\n"
                         b"CompressedData = True\nElementDataFile = LOCAL\n" + pixels)
        self.expect(BAD_INPUT, "info", path, says=f"1000000 frames in {len(pixels)} bytes")

    def test_numbers_that_vtk_sizes_arrays_by_are_checked_first(self):
        path = self.folder / "ascii.vtp"
        for attribute in ('NumberOfComponents="18446744073709551615"', 'NumberOfComponents="200000000"',
                          'NumberOfComponents="-1"', 'NumberOfTuples="1e9"', 'offset="1,5"'):
            path.write_text(
                '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian"><PolyData><FieldData>'
                f'<Array type="String" Name="Own" {attribute} format="ascii">0</Array></FieldData>'
                '<Piece NumberOfPoints="1"><PointData/><Points><DataArray type="Float64" Name="Points" '
                'NumberOfComponents="3" format="ascii">0 0 0</DataArray></Points></Piece></PolyData></VTKFile>')
            with self.subTest(attribute):
                self.expect(BAD_INPUT, "info", path, says=attribute.split("=")[0] + " is ")

    def test_a_link_to_itself_is_not_replaced(self):
        loop = self.folder / "loop.vtp"
        loop.symlink_to("loop.vtp")
        self.expect(CANNOT_WRITE, "convert", self.field, loop, says="leads nowhere")
        self.assertTrue(loop.is_symlink())

    def library_to_preload(self, name):
        library = self.folder.parent / f"{name}-{os.getpid()}.so"
        source = pathlib.Path(__file__).with_name(f"{name}.c")
        if shutil.which("cc") is None or subprocess.run(["cc", "-O1", "-shared", "-fPIC", source, "-o", library]).returncode:
            self.skipTest("no C compiler")
        self.addCleanup(library.unlink)
        return library

    def test_no_byte_past_the_last_frame_is_read(self):
        guard = self.library_to_preload("guard_pages")
        sweep = self.folder / "sweep.mha"
        self.expect(SUCCESS, "phantom", "-o", sweep, "--frames", "6", "--width", "256", "--height", "256")
        result = subprocess.run([BIGUS, "train", sweep, "-o", self.folder / "f.vtp", *TINY, "--no-baselines"],
                                capture_output=True, text=True, env={**os.environ, "LD_PRELOAD": str(guard)}, timeout=300)
        self.assertEqual(result.returncode, SUCCESS, result.stderr)

    def test_stdout_that_cannot_be_written(self):
        if not os.path.exists("/dev/full"):
            self.skipTest("there is no /dev/full here")
        with open("/dev/full", "w") as full:
            for arguments in (["info", self.field], ["info", self.field, "--json"]):
                result = subprocess.run([BIGUS, *map(str, arguments)], stdout=full, stderr=subprocess.PIPE, text=True)
                self.assertEqual(result.returncode, CANNOT_WRITE)
                self.assertIn("stdout", result.stderr)

    def test_a_series_appears_whole_or_not_at_all(self):
        (self.folder / "s_005.png").mkdir()
        self.expect(CANNOT_WRITE, "slice", self.field, "--poses", self.sweep, "-o", self.folder / "s.png", says="s_005.png")
        self.assertEqual(os.listdir(self.folder), ["s_005.png"])

    def test_a_series_whose_last_picture_cannot_be_named_leaves_the_earlier_ones(self):
        broken = self.library_to_preload("broken_rename")
        earlier = {"s_004.png": b"old", "s_005.png": b"old, too"}
        for name, content in earlier.items():
            (self.folder / name).write_bytes(content)
        result = subprocess.run(
            [BIGUS, "slice", self.field, "--poses", self.sweep, "-o", self.folder / "s.png"], capture_output=True, text=True,
            env={**os.environ, "LD_PRELOAD": str(broken), "BROKEN_NAME": "s_008.png"}, timeout=300)
        self.assertEqual(result.returncode, CANNOT_WRITE, result.stderr)
        self.assertIn("s_008.png", result.stderr)
        self.assertEqual({file.name: file.read_bytes() for file in self.folder.iterdir()}, earlier)

    def test_a_file_that_may_not_grow_is_an_error(self):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        for name in ("v.mha", "v.nrrd", "v.vti"):
            with self.subTest(name):
                result = subprocess.run([BIGUS, "voxelize", self.field, "-o", self.folder / name, "--spacing", "1"],
                                        capture_output=True, text=True, preexec_fn=limit, timeout=60)
                self.assertEqual(result.returncode, CANNOT_WRITE, result.stderr)
                self.assertNothingIn(self.folder)

    def test_killed_runs_leave_nothing_to_the_next(self):
        path = self.folder / "v.mha"
        leftover = self.folder / "v.mha.bigus-part"
        leftover.write_bytes(b"half")
        self.expect(SUCCESS, "voxelize", self.field, "-o", path, "--spacing", "1")
        self.assertEqual(os.listdir(self.folder), ["v.mha"])


class Slice(CommandTest):
    def test_interrupt_stops_within_a_large_plane(self):
        process = subprocess.Popen([BIGUS, "slice", str(self.field), "--poses", str(self.sweep), "--frames", "0",
                                    "--size", "8000", "8000", "--engine", "reference", "--json", "--progress",
                                    "-o", str(self.folder / "large.mha")],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.await_bar(process, b"Slicing [")  # the whole plane would take minutes
        process.send_signal(signal.SIGINT)
        stdout, _ = process.communicate(timeout=20)
        self.assertEqual(process.returncode, INTERRUPTED)
        self.assertEqual(json.loads(stdout)["exit_code"], INTERRUPTED)
        self.assertNothingIn(self.folder)

    def test_at_the_sweeps_planes(self):
        out = self.folder / "again.igs.mha"
        answer = self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", out)
        self.assertEqual((answer["slices"], answer["width"], answer["height"]), (9, 48, 40))
        mine, theirs = (re.findall(r"ImageToReferenceTransform = (.*)", read_sequence(path)[0])
                        for path in (out, self.sweep))
        for a, b in zip(mine, theirs):
            for x, y in zip(a.split(), b.split()):
                self.assertAlmostEqual(float(x), float(y), places=9)
        self.assertGreater(self.expect(SUCCESS, "metrics", out, self.sweep)["psnr"], 10)

    def test_lit_is_black_where_the_probe_is(self):
        header, pixels, _ = read_sequence(self.sweep)
        dark = bytes(0 if p % 48 < 6 else max(value, 1) for p, value in enumerate(pixels))
        sweep, field = self.folder / "dark.igs.mha", self.folder / "f.vtp"
        write_sequence(sweep, header, dark)
        trained = self.expect(SUCCESS, "train", sweep, "-o", field, *TINY, "--hold-out", 3)
        slices = {}
        for name, options in (("whole", []), ("lit", ["--lit"])):
            out = self.folder / f"{name}.mha"
            self.expect(SUCCESS, "slice", self.field, "--poses", sweep, "-o", out, *options)
            slices[name] = read_sequence(out)[1]
        self.assertTrue(any(value for p, value in enumerate(slices["whole"]) if p % 48 < 6))
        self.assertEqual(slices["lit"], bytes(0 if p % 48 < 6 else value for p, value in enumerate(slices["whole"])))
        # Held-out frames are scored as such slices.
        mine = self.folder / "mine.mha"
        self.expect(SUCCESS, "slice", field, "--poses", sweep, "--frames", "1,4,7", "--lit", "--type", "float", "-o", mine)
        whole = read_sequence(mine)[1]
        errors = [[(value - dark[(1 + 3 * k) * 1920 + p] / 255) ** 2 for p, value in
                   enumerate(struct.unpack("<1920f", whole[k * 7680:(k + 1) * 7680]))] for k in range(3)]
        psnr = sum(-10 * math.log10(sum(frame) / 1920) for frame in errors) / 3
        self.assertAlmostEqual(trained["held_out"]["psnr"], psnr, places=3)

    def test_lit_needs_the_sweeps_own_size(self):
        for option in (["--size", "20", "20"], ["--spacing", "1"]):
            self.expect(USAGE, "slice", self.field, "--poses", self.sweep, "-o", self.folder / "s.mha", "--lit",
                        *option, says="excludes")
        self.expect(BAD_INPUT, "slice", self.field, "--poses", self.poses_csv(IDENTITY), "-o", self.folder / "s.mha",
                    "--lit")
        self.assertEqual(os.listdir(self.folder), ["planes.csv"])

    def test_png_is_the_same_picture(self):
        out, png = self.folder / "one.mha", self.folder / "one.png"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 3, "-o", out)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 3, "-o", png)
        self.assertEqual(read_png(png), (48, 40, read_sequence(out)[1]))

    def test_many_pngs_are_numbered_by_frame(self):
        answer = self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", "1,4-5", "-o",
                             self.folder / "s.png")
        names = ["s_001.png", "s_004.png", "s_005.png"]
        self.assertEqual(sorted(os.listdir(self.folder)), names)
        self.assertEqual([pathlib.Path(name).name for name in answer["output"]], names)

    def test_rejected_planes_are_told_and_not_counted(self):
        header, pixels, _ = read_sequence(self.sweep)
        some = self.folder / "some.mha"
        write_sequence(some, header.replace("Seq_Frame0003_ImageToReferenceTransformStatus = OK",
                                            "Seq_Frame0003_ImageToReferenceTransformStatus = INVALID"), pixels)
        out = self.folder / "s.png"
        slicing = ["slice", self.field, "--poses", some, "--frames", "2-3", "-o", out]
        answer = self.expect(SUCCESS, *slicing)
        self.assertEqual((answer["slices"], answer["rejected"]), (2, 1))
        self.assertEqual([pathlib.Path(name).name for name in answer["output"]], ["s_002.png", "s_003.png"])
        self.assertRegex(run(*slicing).stderr, r"some.mha: 1 of 9 frames rejected: .*frame 3")
        # Usable frame 3 is frame 4 of the file.
        whole = self.folder / "w.png"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 4, "-o", whole)
        self.assertEqual(read_png(self.folder / "s_003.png"), read_png(whole))
        self.assertEqual(self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o",
                                     self.folder / "all.mha")["rejected"], 0)

    def test_rejected_rows_of_a_csv_are_told(self):
        bad = ["nan", *IDENTITY[1:]]
        slicing = ["slice", self.field, "--poses", self.poses_csv(IDENTITY, bad), "--size", 30, 20,
                   "-o", self.folder / "s.png"]
        answer = self.expect(SUCCESS, *slicing)
        self.assertEqual((answer["slices"], answer["rejected"]), (1, 1))
        self.assertRegex(run(*slicing).stderr, "1 of 2 frames rejected: .*frame 1")

    def test_nrrd_reads_back(self):
        mha, nrrd = self.folder / "s.mha", self.folder / "s.nrrd"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", mha)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", nrrd)
        self.assertEqual(self.expect(SUCCESS, "info", nrrd)["bounds"], self.expect(SUCCESS, "info", mha)["bounds"])
        self.assertIsNone(self.expect(SUCCESS, "metrics", nrrd, mha)["psnr"], "infinite, so null")

    def test_float_rounds_to_bytes(self):
        byte, real = self.folder / "b.mha", self.folder / "r.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", byte)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", real, "--type", "float")
        pixels, raw = read_sequence(byte)[1], read_sequence(real)[1]
        values = struct.unpack(f"<{len(raw) // 4}f", raw)
        self.assertLess(max(abs(255 * v - p) for v, p in zip(values, pixels)), 0.5 + 1e-4)

    def test_scattering_relates_to_intensity(self):
        real, s = self.folder / "r.mha", self.folder / "s.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", real, "--type", "float", "--frames", 2)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", s, "--mode", "scattering", "--frames", 2)
        gamma = self.expect(SUCCESS, "info", self.field)["gamma"]
        for i, scattering in zip(struct.iter_unpack("<f", read_sequence(real)[1]),
                                 struct.iter_unpack("<f", read_sequence(s)[1])):
            self.assertAlmostEqual(i[0], 1 - math.exp(-gamma * max(scattering[0], 0)), delta=2e-5)

    def test_planes_from_csv(self):
        plane = self.poses_csv(IDENTITY)
        self.expect(BAD_INPUT, "slice", self.field, "--poses", plane, "-o", self.folder / "x.png", says="--size")
        answer = self.expect(SUCCESS, "slice", self.field, "--poses", plane, "--size", 30, 20, "-o",
                             self.folder / "x.png")
        self.assertEqual((answer["width"], answer["height"]), (30, 20))

    def test_planes_from_markup(self):
        markup = {"@schema": "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/"
                             "Schema/markups-schema-v1.0.3.json#",
                  "markups": [{"type": "Plane", "coordinateSystem": "RAS", "coordinateUnits": "mm",
                               "center": [0, 12, 0], "normal": [0, 0, 1], "size": [20, 10],
                               "objectToBase": IDENTITY, "baseToNode": IDENTITY, "orientation": IDENTITY[:3]
                               + IDENTITY[4:7] + IDENTITY[8:11],
                               "controlPoints": [{"id": "1", "position": [0, 12, 0]}]}]}
        path = self.folder / "plane.mrk.json"
        path.write_text(json.dumps(markup))
        answer = self.expect(SUCCESS, "slice", self.field, "--poses", path, "--spacing", 0.5, "-o",
                             self.folder / "x.png")
        self.assertEqual(answer["slices"], 1)
        self.assertAlmostEqual(answer["width"], 40, delta=1)
        self.assertAlmostEqual(answer["height"], 20, delta=1)

    def test_reduce_and_spacing_keep_the_upper_left_corner(self):
        def first_and_step(*options):
            out = self.folder / "s.mha"
            self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 4, "-o", out, *options)
            row = re.search(r"ImageToReferenceTransform = (.*)", read_sequence(out)[0]).group(1)
            m = [float(value) for value in row.split()]
            size = re.search(r"DimSize = (\d+) (\d+)", read_sequence(out)[0]).groups()
            return [m[3], m[7], m[11]], [m[0], m[4], m[8]], [m[1], m[5], m[9]], tuple(map(int, size))

        origin, columns, rows, _ = first_and_step()
        for options, factor, size in ((["--reduce", 2], 2, (24, 20)), (["--spacing", 0.3], 0.5, (96, 80))):
            new_origin, new_columns, new_rows, new_size = first_and_step(*options)
            self.assertEqual(new_size, size)
            for k in range(3):
                self.assertAlmostEqual(new_columns[k], factor * columns[k], places=9)
                corner = origin[k] - 0.5 * (columns[k] + rows[k])
                self.assertAlmostEqual(new_origin[k] - 0.5 * (new_columns[k] + new_rows[k]), corner, places=9)

    def test_a_plane_that_misses_is_black(self):
        far = list(IDENTITY)
        far[11] = 5000
        out, coverage = self.folder / "x.mha", self.folder / "c.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.poses_csv(far), "--size", 30, 20, "-o", out,
                    "--coverage", coverage)
        self.assertEqual(read_sequence(out)[1], bytes(600))
        self.assertEqual(read_sequence(coverage)[1], bytes(2400))

    def test_a_field_without_gaussians_is_black(self):
        ply = self.folder / "none.ply"
        names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
                 "rot_2", "rot_3"]
        ply.write_text("ply\nformat ascii 1.0\nelement vertex 0\n"
                       + "".join(f"property float {name}\n" for name in names) + "end_header\n")
        out = self.folder / "x.mha"
        self.expect(SUCCESS, "slice", ply, "--poses", self.sweep, "-o", out)
        self.assertEqual(read_sequence(out)[1], bytes(9 * 48 * 40))
        self.assertEqual(self.expect(SUCCESS, "info", ply)["gaussians"], 0)

    def test_distance_tells_where_a_plane_runs_through_a_gap(self):
        # 24 frames 0.5 mm apart; without three of them a gap of 2 mm stays, which training fills with virtual planes.
        sweep, gap, field = (self.folder / name for name in ("whole.igs.mha", "gap.igs.mha", "gap.vtp"))
        self.expect(SUCCESS, "phantom", "-o", sweep, "--frames", 24, "--width", 48, "--height", 40, "--pixel-size", 0.6,
                    "--frame-spacing", 0.5, "--speed-variation", 0, "--tilt", 0, "--wander", 0)
        data = sweep.read_bytes()
        for frame in range(8, 11):
            name = f"Seq_Frame{frame:04d}_ImageToReferenceTransformStatus = ".encode()
            self.assertIn(name + b"OK", data)
            data = data.replace(name + b"OK", name + b"INVALID")
        gap.write_bytes(data)
        self.expect(SUCCESS, "train", gap, "-o", field, "--no-auto", "--gaussians", 2000, "--iterations", 40)
        # A plane at right angles to the frames: columns along the sweep at steps of 0.25 mm from its first frame, at
        # z = -5.75, to its last; the gap is from -2.25 to -0.25 mm.
        columns = 47
        across = self.poses_csv([0, 0, -1, 1.5, 0, 0.6, 0, 3, 0.25, 0, 0, -5.75, 0, 0, 0, 1])
        coverage, distance = self.folder / "c.mha", self.folder / "d.mha"
        self.expect(SUCCESS, "slice", field, "--poses", across, "--size", columns, 30, "-o", self.folder / "x.mha",
                    "--coverage", coverage, "--distance", distance, "--recorded", gap)

        def column_means(path):
            values = [v[0] for v in struct.iter_unpack("<f", read_sequence(path)[1])]
            return [sum(values[u::columns]) / 30 for u in range(columns)]
        frames = [-5.75 + 0.5 * k for k in range(24) if not 8 <= k < 11]
        distances, covered = column_means(distance), column_means(coverage)
        for u in range(columns):
            self.assertAlmostEqual(distances[u], min(abs(-5.75 + 0.25 * u - z) for z in frames), places=4)
        self.assertAlmostEqual(max(distances), 1, places=4)
        self.assertGreater(covered[distances.index(max(distances))], 0.7 * sum(covered) / columns,
                           "coverage alone does not tell the gap")

        both = ["slice", field, "--poses", across, "--size", columns, 30, "-o", self.folder / "x.mha"]
        self.expect(USAGE, *both, "--distance", distance, says="--recorded")
        self.expect(USAGE, *both, "--recorded", gap, says="--distance")
        self.expect(BAD_INPUT, *both, "--distance", distance, "--recorded", self.folder / "no.csv", says="no.csv")
        self.expect(CANNOT_WRITE, *both, "--distance", self.folder / "d.png", "--recorded", gap, says="PNG")
        self.expect(CANNOT_WRITE, *both, "--distance", gap, "--recorded", gap, says="read")

    def test_coverage_is_there_where_the_sweep_was(self):
        coverage = self.folder / "c.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", self.folder / "x.mha", "--frames", 4,
                    "--coverage", coverage)
        values = [v[0] for v in struct.iter_unpack("<f", read_sequence(coverage)[1])]
        self.assertGreater(sum(v > 0 for v in values) / len(values), 0.9)
        self.assertGreaterEqual(min(values), 0)

    def test_bad_input(self):
        out = self.folder / "x.mha"
        poses = ["--poses", self.sweep]
        self.expect(BAD_INPUT, "slice", self.folder / "no.vtp", *poses, "-o", out, says="no.vtp")
        self.expect(BAD_INPUT, "slice", self.sweep, *poses, "-o", out)
        self.expect(BAD_INPUT, "slice", self.field, "--poses", self.folder / "no.csv", "-o", out, says="no.csv")
        self.expect(BAD_INPUT, "slice", self.field, *poses, "-o", out, "--frames", "99", says="--frames")
        self.expect(BAD_INPUT, "slice", self.field, *poses, "-o", out, "--frames", "3-1", says="--frames")
        self.expect(BAD_INPUT, "slice", self.field, *poses, "-o", out, "--frames", "1;2", says="--frames")
        self.expect(BAD_INPUT, "slice", self.field, *poses, "-o", out, "--size", 65536, 65536, says="pixels")
        self.expect(BAD_INPUT, "slice", self.field, *poses, "-o", out, "--reduce", 200)
        data = self.field.read_bytes()
        self.assertIn(b'Name="Scale"', data)
        (self.folder / "broken.vtp").write_bytes(data.replace(b'Name="Scale"', b'Name="Size_"'))
        self.expect(BAD_INPUT, "slice", self.folder / "broken.vtp", *poses, "-o", out, says="Scale")
        (self.folder / "cut.vtp").write_bytes(data[:len(data) // 2])
        self.expect(BAD_INPUT, "slice", self.folder / "cut.vtp", *poses, "-o", out, says="cut.vtp")
        self.assertFalse(out.exists())

    def test_unwritable(self):
        poses = ["--poses", self.sweep]
        self.expect(CANNOT_WRITE, "slice", self.field, *poses, "-o", self.folder / "no" / "x.mha")
        self.expect(CANNOT_WRITE, "slice", self.field, *poses, "-o", self.folder / "x.bmp", says=".png")
        self.expect(CANNOT_WRITE, "slice", self.field, *poses, "-o", self.folder / "x.png", "--type", "float")
        self.assertNothingIn(self.folder)


class Voxelize(CommandTest):
    def test_formats_agree(self):
        answers = {}
        for ending in ("mha", "nrrd", "vti"):
            path = self.folder / f"v.{ending}"
            answers[ending] = self.expect(SUCCESS, "voxelize", self.field, "-o", path, "--spacing", 1.5)
            self.assertEqual(answers[ending]["spacing"], [1.5, 1.5, 1.5])
        self.assertEqual(answers["mha"]["size"], answers["vti"]["size"])
        self.assertIsNone(self.expect(SUCCESS, "metrics", self.folder / "v.nrrd",
                                      self.folder / "v.mha")["psnr"], "equal")
        header, pixels, _ = read_sequence(self.folder / "v.mha")
        self.assertEqual(read_vti(self.folder / "v.vti"), pixels)
        nx, ny, nz = answers["mha"]["size"]
        self.assertIn(f"DimSize = {nx} {ny} {nz}\n", header)
        self.assertEqual(len(pixels), nx * ny * nz)

    def test_every_file_says_where_it_lies(self):
        """Files are in LPS, so x and y of a world in RAS change their signs."""
        for system, sign in (("ras", -1), ("lps", 1)):
            mha, nrrd = self.folder / f"{system}.mha", self.folder / f"{system}.nrrd"
            for path in (mha, nrrd):
                answer = self.expect(SUCCESS, "voxelize", self.field, "-o", path, "--spacing", 2,
                                     "--origin", -7, 5, 3, "--size", 4, 5, 6, "--world-system", system)
                self.assertEqual((answer["world_system"], answer["origin"]), (system, [-7, 5, 3]))
            header = read_sequence(mha)[0]
            self.assertIn(f"Offset = {-7 * sign} {5 * sign} 3\n", header)
            self.assertIn(f"TransformMatrix = {sign} 0 0 0 {sign} 0 0 0 1\n", header)
            text = nrrd.read_bytes().split(b"\n\n")[0].decode()
            self.assertIn("space: left-posterior-superior\n", text)
            self.assertIn(f"space directions: ({2 * sign},0,0) (0,{2 * sign},0) (0,0,2)\n"
                          f"space origin: ({-7 * sign},{5 * sign},3)", text)
            self.assertNotIn("space dimension", text)  # a named space has one
        self.expect(SUCCESS, "voxelize", self.field, "-o", self.folder / "default.mha", "--spacing", 2,
                    "--origin", -7, 5, 3, "--size", 4, 5, 6)
        self.assertEqual((self.folder / "default.mha").read_bytes(), (self.folder / "ras.mha").read_bytes())

    def test_errors(self):
        self.expect(BAD_INPUT, "voxelize", self.folder / "no.vtp", "-o", self.folder / "v.mha", says="no.vtp")
        self.expect(BAD_INPUT, "voxelize", self.field, "-o", self.folder / "v.mha", "--spacing", 1e-5)
        self.expect(CANNOT_WRITE, "voxelize", self.field, "-o", self.folder / "no" / "v.mha", says="v.mha")
        self.expect(CANNOT_WRITE, "voxelize", self.field, "-o", self.folder / "v.stl", says=".vti")
        self.assertNothingIn(self.folder)

    def test_a_grid_of_the_other_patient_system_is_told_how_to_be_met(self):
        # As Plus writes volumes: in the sweep's own coordinates, in a format that ITK and we take for LPS.
        shift, moved = self.folder / "shift.tfm", self.folder / "moved.vtp"
        shift.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                         "Parameters: 1 0 0 0 1 0 0 0 1 300 0 0\nFixedParameters: 0 0 0\n")
        self.expect(SUCCESS, "convert", self.field, moved, "--transform", shift, "--world-system", "lps")
        plus, seen = self.folder / "plus.mha", self.folder / "seen.mha"
        self.expect(SUCCESS, "voxelize", moved, "-o", plus, "--spacing", 2, "--world-system", "lps")
        missed = run("voxelize", moved, "-o", seen, "--like", plus)
        self.assertEqual(missed.returncode, SUCCESS)
        self.assertIn("does not meet the field, so it is black. It would meet it in the other patient system: --world-system lps", missed.stderr)
        self.assertIs(self.expect(SUCCESS, "voxelize", moved, "-o", seen, "--like", plus, "--world-system", "lps")["meets_field"], True)
        self.assertEqual(seen.read_bytes(), plus.read_bytes())

    def test_a_grid_that_misses_the_field_is_said(self):
        volume = self.folder / "v.nrrd"
        far = self.expect(SUCCESS, "voxelize", self.field, "-o", volume, "--origin", 1000, 0, 0, "--size", 9, 9, 9)
        self.assertIs(far["meets_field"], False)
        self.assertIs(self.expect(SUCCESS, "voxelize", self.field, "-o", volume, "--spacing", 2)["meets_field"], True)
        shifted = self.folder / "shifted.csv"
        self.poses_csv([0.6, 0, 0, 500, 0, 0.6, 0, 0, 0, 0, 0.6, 0, 0, 0, 0, 1]).rename(shifted)
        result = run("slice", self.field, "--poses", shifted, "--size", 8, 8, "-o", self.folder / "s.png")
        self.assertEqual(result.returncode, SUCCESS)
        self.assertIn("does not meet the field", result.stderr)


class Label(CommandTest):
    """Tissues of the phantom, carried by a field that was trained on its sweep."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.big, cls.drawn = cls.shared / "big.igs.mha", cls.shared / "drawn.mha"
        made = run("phantom", "-o", cls.big, "--frames", 25, "--width", 64, "--height", 64, "--pixel-size", 0.8,
                   "--labels", cls.drawn)
        assert made.returncode == SUCCESS, made.stderr
        cls.trained = cls.shared / "big.vtp"
        made = run("train", cls.big, "-o", cls.trained, "--no-auto", "--gaussians", 4000, "--iterations", 30)
        assert made.returncode == SUCCESS, made.stderr

    def label(self, *arguments):
        return self.expect(SUCCESS, "label", self.big, self.drawn, self.trained, "-o", self.folder / "labelled.vtp",
                           "--names", "1=vessel,2=cyst,3=bone,4=tumour", *arguments)

    def test_frames_held_out_are_met(self):
        answer = self.label("--hold-out", 3)
        cyst = answer["labels"][1]
        # 4 / 3 pi 6.5 x 5.5 x 7 mm^3, of which z < 6, 0.6 of it, was swept.
        self.assertTrue(400 < cyst["volume"] < 900 and 0 < cyst["standard_error"] < 100, cyst)
        self.assertEqual([label["name"] for label in answer["labels"]], ["vessel", "cyst", "bone", "tumour"])
        self.assertEqual(answer["fitted_frames"] + answer["held_out_frames"], 25)
        self.assertGreater(sum(row["field"] for row in answer["dice"]), 0.8 * len(answer["dice"]))

    def test_slices_and_volumes_show_labels(self):
        self.label()
        labelled, maps = self.folder / "labelled.vtp", self.folder / "maps.mha"
        self.expect(SUCCESS, "slice", labelled, "--poses", self.big, "-o", self.folder / "s.mha", "--labels", maps)
        shown, drawn = read_sequence(maps)[1], read_sequence(self.drawn)[1]
        self.assertEqual(len(shown), len(drawn))
        same = sum(a == b for a, b in zip(shown, drawn)) / len(drawn)
        self.assertGreater(same, 0.95)
        volume = self.folder / "v.mha"
        self.expect(SUCCESS, "voxelize", labelled, "--label", "tumour", "-o", volume, "--spacing", 1)
        bright = sum(value > 127 for value in read_sequence(volume)[1])
        # An ellipsoid of 7 x 6 x 8 mm half axes, of which the sweep sees the middle 12 mm.
        self.assertTrue(700 < bright < 1500, bright)
        self.expect(BAD_INPUT, "voxelize", labelled, "--label", "liver", "-o", volume, says="it has vessel (1), cyst (2)")
        self.assertEqual([label["name"] for label in self.expect(SUCCESS, "info", labelled)["labels"]],
                         ["vessel", "cyst", "bone", "tumour"])

    def test_some_frames_only(self):
        header, pixels, _ = read_sequence(self.drawn)
        some = self.folder / "some.mha"
        sparse = b"".join(pixels[64 * 64 * k:64 * 64 * (k + 1)] if k % 6 == 0 else bytes(64 * 64) for k in range(25))
        write_sequence(some, header, sparse)
        answer = self.expect(SUCCESS, "label", self.big, some, self.trained, "-o", self.folder / "l.vtp",
                             notes="20 of 25 pictures hold no label")
        self.assertEqual(answer["fitted_frames"], 5)
        self.assertEqual(self.expect(SUCCESS, "label", self.big, some, self.trained, "-o", self.folder / "l.vtp",
                                     "--keep-empty")["fitted_frames"], 25)

    def segmentation(self, name, first, end, offset):
        """The cyst in columns, rows and frames from `first` to before `end`, as 3D Slicer saves a segmentation."""
        pixels = bytes(2 * (value == 2) for value in read_sequence(self.drawn)[1])
        part = b"".join(pixels[64 * (64 * k + j) + first[0]:64 * (64 * k + j) + end[0]]
                        for k in range(first[2], end[2]) for j in range(first[1], end[1]))
        path = self.folder / name
        path.write_bytes(("NRRD0004\ntype: unsigned char\ndimension: 3\nkinds: domain domain domain\nencoding: raw\n"
                          f"sizes: {' '.join(str(b - a) for a, b in zip(first, end))}\n{offset}"
                          "Segment0_LabelValue:=2\nSegment0_Name:=cyst\n\n").encode() + part)
        return path

    def test_a_cropped_segmentation_labels_as_the_whole_one(self):
        key = "Segmentation_ReferenceImageExtentOffset:="
        cyst = [p for p, value in enumerate(read_sequence(self.drawn)[1]) if value == 2]
        axes = [[p % 64 for p in cyst], [p // 64 % 64 for p in cyst], [p // 4096 for p in cyst]]
        first, end = [min(axis) for axis in axes], [max(axis) + 1 for axis in axes]
        self.assertGreater(min(first), 0)
        whole = self.segmentation("w.seg.nrrd", (0, 0, 0), (64, 64, 25), key + "0 0 0\n")
        part = self.segmentation("p.seg.nrrd", first, end, key + " ".join(map(str, first)) + "\n")
        fields = []
        for labels in (whole, part):
            fields.append(self.folder / (labels.stem + ".vtp"))
            self.expect(SUCCESS, "label", self.big, labels, self.trained, "-o", fields[-1])
        self.assertEqual(fields[0].read_bytes(), fields[1].read_bytes())
        out = self.folder / "l.vtp"
        for offset, says in (("", "Segmentation_ReferenceImageExtentOffset"), (key + "40 0 0\n", "columns 40 to"),
                             (key + "0 0 20\n", "frames 20 to 28")):
            bad = self.segmentation("bad.seg.nrrd", (0, 0, 0), (30, 30, 9), offset)
            self.expect(BAD_INPUT, "label", self.big, bad, self.trained, "-o", out, says=says)
        self.assertFalse(out.exists())

    def test_errors(self):
        out, few = self.folder / "l.vtp", self.segmentation("few.seg.nrrd", (0, 0, 0), (64, 64, 9), "")
        self.expect(BAD_INPUT, "label", self.big, few, self.trained, "-o", out, says="--frames")
        self.expect(BAD_INPUT, "label", self.big, few, self.trained, "-o", out, "--frames", "0-3", says="9 pictures")
        self.expect(BAD_INPUT, "label", self.big, self.sweep, self.trained, "-o", out, says="48 x 40")
        self.expect(BAD_INPUT, "label", self.sweep, self.drawn, self.trained, "-o", out, says="64 x 64")
        self.expect(CANNOT_WRITE, "label", self.big, self.drawn, self.trained, "-o", self.folder / "l.ply", says=".vtp")
        self.expect(BAD_INPUT, "label", self.big, self.drawn, self.trained, "-o", out, "--names", "vessel",
                    says="VALUE=NAME")
        few.unlink()
        self.assertNothingIn(self.folder)


class Metrics(CommandTest):
    def test_chosen_frames_of_one_or_both(self):
        again, some = self.folder / "again.mha", self.folder / "some.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", again)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", some, "--frames", "2,5-6")
        both = self.expect(SUCCESS, "metrics", again, self.sweep, "--frames", "2,5-6")
        self.assertEqual(both["images"], 3)
        self.assertEqual(both, self.expect(SUCCESS, "metrics", some, self.sweep, "--frames", "2,5-6"))
        self.assertNotEqual(both["psnr"], self.expect(SUCCESS, "metrics", again, self.sweep)["psnr"])
        self.expect(BAD_INPUT, "metrics", again, self.sweep, "--frames", "9", says="0 to 8")

    def test_reduced_truth_compares_with_reduced_slices(self):
        field, again = self.folder / "f.vtp", self.folder / "again.mha"
        trained = self.expect(SUCCESS, "train", self.sweep, "-o", field, *TINY, "--reduce", "2", "--hold-out", "3",
                              "--write-poses", self.folder / "poses.csv", "--pose-smoothing", "0")
        self.expect(SUCCESS, "slice", field, "--poses", self.sweep, "--reduce", "2", "-o", again, "--type", "float")
        self.expect(BAD_INPUT, "metrics", again, self.sweep, says="--reduce")
        scores = self.expect(SUCCESS, "metrics", again, self.sweep, "--reduce", "2", "--frames", "1,4,7")
        self.assertAlmostEqual(scores["psnr"], trained["held_out"]["psnr"], delta=0.01)
        self.expect(BAD_INPUT, "metrics", again, self.sweep, "--reduce", "50", says="no pixel")

    def test_keys_and_an_exact_number(self):
        header, pixels, _ = read_sequence(self.sweep)
        shifted = self.folder / "shifted.mha"
        write_sequence(shifted, header, bytes(value + 5 if value < 250 else value - 5 for value in pixels))
        answer = self.expect(SUCCESS, "metrics", shifted, self.sweep)
        self.assertAlmostEqual(answer["psnr"], 20 * math.log10(255 / 5), places=4)
        self.assertEqual(answer["images"], 9)
        for key in ("ssim", "bfs", "mean_contrast", "contrast_distribution", "rayleigh"):
            self.assertTrue(0 < answer[key] <= 1, key)
        self.assertAlmostEqual(answer["bfs"], 0.4 * answer["mean_contrast"] + 0.4 * answer["contrast_distribution"]
                               + 0.2 * answer["rayleigh"], places=9)

    def test_equal_images(self):
        answer = self.expect(SUCCESS, "metrics", self.sweep, self.sweep)
        self.assertIsNone(answer["psnr"], "infinity is null in JSON")
        self.assertAlmostEqual(answer["ssim"], 1, places=6)
        self.assertAlmostEqual(answer["bfs"], 1, places=6)
        texture = answer["texture"]
        self.assertAlmostEqual(texture["contrast_ratio"], 1, places=9)
        self.assertAlmostEqual(texture["high_frequency_power"], 1, places=9)
        self.assertEqual(texture["contrast_distance"], 0)
        self.assertEqual(texture["image_contrast_q50"], texture["truth_contrast_q50"])
        for power, truth in zip(texture["image_spectrum"], texture["truth_spectrum"]):
            self.assertAlmostEqual(power, truth, places=12)
        self.assertEqual(len(texture["image_spectrum"]), len(texture["spectrum_frequency"]))
        self.assertIn("PSNR  infinite", run("metrics", self.sweep, self.sweep).stdout)

    def test_errors(self):
        other = self.folder / "other.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", "0-2", "-o", other)
        self.expect(BAD_INPUT, "metrics", other, self.sweep, says="48 x 40 x 9")
        self.expect(BAD_INPUT, "metrics", self.folder / "no.png", self.sweep, says="no.png")
        text = self.folder / "text.png"
        text.write_text("no picture")
        self.expect(BAD_INPUT, "metrics", text, self.sweep, says="text.png")
        small = self.folder / "small.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--size", 8, 8, "-o", small)
        self.expect(BAD_INPUT, "metrics", small, small)

    def test_plain_pictures(self):
        one, png, real = (self.folder / name for name in ("one.mha", "one.png", "real.mha"))
        for out, extra in ((one, []), (png, []), (real, ["--type", "float"])):
            self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 3, "-o", out, *extra)
        self.assertIsNone(self.expect(SUCCESS, "metrics", png, one)["psnr"], "the same pixels, the same way up")
        self.assertGreater(self.expect(SUCCESS, "metrics", real, png)["psnr"], 50, "rounded to bytes")

    def test_hostile_files(self):
        volume, nrrd, png = (self.folder / name for name in ("v.mha", "v.nrrd", "v.png"))
        self.expect(SUCCESS, "voxelize", self.field, "-o", volume, "--spacing", 1.5)
        self.expect(SUCCESS, "voxelize", self.field, "-o", nrrd, "--spacing", 1.5)
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "--frames", 3, "-o", png)
        bad = self.folder / "bad"
        bad.mkdir()

        def refused(name, data, says):
            (bad / name).write_bytes(data)
            for arguments in ((bad / name, volume), (volume, bad / name)):
                answer = self.expect(BAD_INPUT, "metrics", *arguments, says=says)
                self.assertIn(name, answer["error"])
                self.assertEqual(len(answer["error"].splitlines()), 1, answer["error"])

        for path in (volume, nrrd, png):
            whole = path.read_bytes()
            refused("empty" + path.suffix, b"", "the file is empty")
            for length in (4, 20, 40, len(whole) // 2, len(whole) - 1):
                refused("cut" + path.suffix, whole[:length], "")
        header, pixels, _ = read_sequence(volume)
        for name, field, value, says in (
                ("huge.mha", "DimSize", "60000 60000 60000", "60000"),
                ("claims.mha", "DimSize", "30000 30000 30000", "bytes"),
                ("escape.mha", "ElementDataFile", "../../etc/passwd", "../../etc/passwd"),
                ("absolute.mha", "ElementDataFile", "/etc/passwd", "/etc/passwd")):
            refused(name, re.sub(f"{field} = .*", f"{field} = {value}", header).encode() + pixels, says)
        text = nrrd.read_bytes()
        refused("huge.nrrd", re.sub(rb"sizes: .*", b"sizes: 60000 60000 60000", text), "60000")
        refused("escape.nrrd", text.replace(b"\n\n", b"\ndata file: ../v.mha\n\n", 1), "../v.mha")
        refused("huge.png", png.read_bytes()[:16] + struct.pack(">II", 60000, 60000) + png.read_bytes()[24:], "60000")
        refused("v.vti", b'<?xml version="1.0"?><VTKFile type="ImageData"><ImageData WholeExtent="0 9999 0 9999 0 9999"/>'
                         b"</VTKFile>", "neither")


class Convert(CommandTest):
    def test_images_of_a_sequence_are_browsed_by_time_in_slicer(self):
        images, again = self.folder / "images.seq.nrrd", self.folder / "again.igs.mha"
        self.expect(SUCCESS, "convert", self.sweep, images)
        header = images.read_bytes().split(b"\n\n")[0].decode().split("\n")
        self.assertIn('labels: "" "" "" "time"', header)
        self.assertIn('units: "" "" "" "s"', header)
        self.assertIn("axis 3 index type:=numeric", header)
        times = [float(line.split(":=")[1]) for line in header if "_Timestamp" in line]
        self.assertIn("axis 3 index values:=" + " ".join(f"{time:.3f}" for time in times), header)
        self.assertEqual(len(times), 9)
        self.expect(SUCCESS, "convert", images, again)
        stamps = [re.findall(r"_Timestamp = (.*)", read_sequence(path)[0]) for path in (self.sweep, again)]
        self.assertEqual([list(map(float, all_stamps)) for all_stamps in stamps], [times, times])
        self.assertNotIn("labels", run("info", images).stdout)

    def test_times_of_any_unit_and_rate_are_seconds(self):
        header, pixels, _ = read_sequence(self.sweep)

        def with_times(path, step):
            of_frame = re.compile(r"(Seq_Frame(\d+)_Timestamp = ).*")
            write_sequence(path, of_frame.sub(lambda line: f"{line[1]}{step * int(line[2])}", header), pixels)

        slow, again = self.folder / "slow.igs.mha", self.folder / "again.igs.mha"
        with_times(slow, 50)
        self.assertIn("the times are taken for milliseconds, because they are 50 apart", run("info", slow).stderr)
        self.assertAlmostEqual(self.expect(SUCCESS, "info", slow)["duration"], 0.4)
        with_times(slow, 1)
        self.assertAlmostEqual(self.expect(SUCCESS, "info", slow)["duration"], 8)
        for step in (60, 1e-5):
            with_times(slow, step)
            stated = slow.read_bytes().replace(b"Seq_Frame0000", b"TimestampUnit = s\nSeq_Frame0000", 1)
            slow.write_bytes(stated)
            for name in ("out.nrrd", "out.seq.nrrd", "out.igs.mha"):
                with self.subTest(step=step, name=name):
                    self.expect(SUCCESS, "convert", slow, self.folder / name)
                    self.expect(SUCCESS, "convert", self.folder / name, again)
                    times = re.findall(r"_Timestamp = (.*)", read_sequence(again)[0])
                    self.assertEqual([float(time) for time in times], [step * k for k in range(9)])

    def test_a_part_of_a_sequence_keeps_what_belongs_to_its_frames(self):
        part = self.folder / "part.igs.mha"
        chosen = [7, 2, 3, 4]
        self.assertEqual(self.expect(SUCCESS, "convert", self.sweep, part, "--frames", "7,2-4")["frames"], 4)
        whole_header, whole, _ = read_sequence(self.sweep)
        header, pixels, _ = read_sequence(part)
        per_frame = len(whole) // 9
        self.assertEqual(pixels, b"".join(whole[k * per_frame:(k + 1) * per_frame] for k in chosen))
        for field in ("ImageToReferenceTransform", "Timestamp"):
            of_all = re.findall(rf"Frame\d+_{field} = (.*)", whole_header)
            self.assertEqual([list(map(float, value.split())) for value in re.findall(rf"Frame\d+_{field} = (.*)", header)],
                             [list(map(float, of_all[k].split())) for k in chosen])
        self.expect(BAD_INPUT, "convert", self.sweep, part, "--frames", "9", says="from 0 to 8")
        self.expect(BAD_INPUT, "convert", self.field, self.folder / "f.ply", "--frames", "1", says="is a field")

    def sequence(self, name, pixels, pixel_type="MET_USHORT", cropped=False):
        """Eight frames of 12 x 12 pixels, 1 mm apart; the 32 pixels again and again."""
        header = "ObjectType = Image\nNDims = 3\nDimSize = 12 12 8\n"
        for k in range(8):
            header += (f"Seq_Frame{k:04}_ImageToReferenceTransform = 1 0 0 0 0 1 0 0 0 0 1 {k} 0 0 0 1\n"
                       f"Seq_Frame{k:04}_ImageToReferenceTransformStatus = OK\n")
        if cropped:
            header += "CroppedImageToImageTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n"
        path = self.folder / name
        layout = {"MET_USHORT": "H", "MET_FLOAT": "f"}[pixel_type]
        path.write_bytes((header + f"ElementType = {pixel_type}\nElementDataFile = LOCAL\n").encode() +
                         36 * struct.pack(f"<32{layout}", *pixels))
        return path

    def test_pixels_of_twelve_bits(self):
        ramp = [132 * k for k in range(32)]  # to 4092
        few = self.sequence("few.mha", ramp)
        full = self.sequence("full.mha", [round(pixel * 65535 / 4095) for pixel in ramp])
        out = self.folder / "out.igs.mha"
        self.expect(SUCCESS, "convert", few, out, notes="4095 is shown as white")
        self.assertEqual(read_sequence(out)[1], read_sequence(full)[1])
        self.expect(SUCCESS, "convert", few, out, "--pixel-range", 65535)
        self.assertEqual(read_sequence(out)[1], read_sequence(few)[1])
        self.expect(BAD_INPUT, "convert", few, out, "--pixel-range", 4000, says="above the pixel range of 4000")
        self.expect(USAGE, "convert", few, out, "--pixel-range", 0)
        # Two files of 16 bits compare on one scale: a quarter as bright is not the same.
        dim = self.sequence("dim.mha", [pixel // 4 for pixel in ramp])
        self.assertLess(self.expect(SUCCESS, "metrics", dim, few)["psnr"], 10)
        self.assertGreater(self.expect(SUCCESS, "metrics", few, few)["psnr"] or 99, 90)
        # Float of 0 to 255.
        real = self.sequence("real.mha", [8.0 * k for k in range(32)], "MET_FLOAT")
        self.expect(SUCCESS, "convert", real, out, "--pixel-range", 255)

    def test_what_is_doubtful_is_said(self):
        sweep = self.sequence("cropped.mha", [2000 * k for k in range(32)], cropped=True)
        out = self.folder / "out.igs.mha"
        self.assertIn("CroppedImage", " ".join(self.expect(SUCCESS, "info", sweep)["doubts"]))
        self.expect(SUCCESS, "convert", sweep, out, notes="(--image-from)")
        text = sweep.read_text(errors="surrogateescape")
        sweep.write_text(re.sub(r"1 0 0 0 0 1 0 0 0 0 1 \d 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", text),
                         errors="surrogateescape")
        self.expect(SUCCESS, "convert", sweep, out, notes="lie in one plane")
        header, pixels, _ = read_sequence(self.sweep)
        spacing = self.folder / "spacing.mha"
        write_sequence(spacing, header.replace("ElementSpacing = 1 1 1", "ElementSpacing = 0.25 0.5 1"), pixels)
        self.assertRegex(self.expect(SUCCESS, "info", spacing)["doubts"][0],
                         r"0\.6 x 0\.6 mm by the transforms, but 0\.25 x 0\.5 mm .*to 0\.25 0\.5 \(--pixel-spacing\)")
        answer = self.expect(SUCCESS, "info", spacing, "--pixel-spacing", 0.25, 0.5)
        self.assertEqual(answer["doubts"], [])
        self.assertAlmostEqual(answer["pixel_size"][1], 0.5, places=9)
        self.expect(USAGE, "info", spacing, "--pixel-spacing", 0.25, 0)

    def test_field_to_ply_and_back(self):
        ply, vtp = self.folder / "f.ply", self.folder / "f.vtp"
        self.assertEqual(self.expect(SUCCESS, "convert", self.field, ply)["gaussians"], self.gaussians)
        self.expect(SUCCESS, "convert", ply, vtp)
        before, after = self.expect(SUCCESS, "info", self.field), self.expect(SUCCESS, "info", vtp)
        for key in ("gaussians", "gamma", "elevation_sigma"):
            self.assertEqual(before[key], after[key])
        for a, b in zip(before["bounds"], after["bounds"]):
            self.assertAlmostEqual(a, b, places=4)

    def test_sequence(self):
        nrrd, mha = self.folder / "s.nrrd", self.folder / "s.igs.mha"
        self.expect(SUCCESS, "convert", self.sweep, nrrd)
        self.assertEqual(self.expect(SUCCESS, "convert", nrrd, mha)["frames"], 9)
        self.assertEqual(read_sequence(mha)[1], read_sequence(self.sweep)[1])

    def test_a_moved_field(self):
        """A slice that moves along shows the same; there and back is where it was."""
        turn = [0, -1, 0, 10, 1, 0, 0, -20, 0, 0, 1, 30, 0, 0, 0, 1]  # 90 degrees about z
        text, moved, back = self.folder / "t.txt", self.folder / "moved.vtp", self.folder / "back.ply"
        text.write_text(" ".join(map(str, turn)))
        self.expect(SUCCESS, "convert", self.field, moved, "--transform", text)
        self.expect(SUCCESS, "convert", moved, back, "--transform", text, "--inverse")
        x = self.expect(SUCCESS, "info", self.field)["bounds"]
        y = self.expect(SUCCESS, "info", moved)["bounds"]
        for a, b in zip(y, [10 - x[3], 10 - x[2], x[0] - 20, x[1] - 20, x[4] + 30, x[5] + 30]):
            self.assertAlmostEqual(a, b, places=6)
        for a, b in zip(self.expect(SUCCESS, "info", back)["bounds"], x):
            self.assertAlmostEqual(a, b, places=4)

        # Moved as 3D Slicer moves what is under it: by the inverse, x and y of LPS.
        itk, placed = self.folder / "t.tfm", self.folder / "placed.vtp"
        itk.write_text("#Insight Transform File V1.0\nTransform: AffineTransform_double_3_3\n"
                       "Parameters: 1 0 0 0 1 0 0 0 1 5 6 7\nFixedParameters: 0 0 0\n")
        for world, shift in (("ras", (5, 6, -7)), ("lps", (-5, -6, -7))):
            self.expect(SUCCESS, "convert", self.field, placed, "--transform", itk, "--world-system", world)
            for axis, value in enumerate(self.expect(SUCCESS, "info", placed)["bounds"]):
                self.assertAlmostEqual(value, x[axis] + shift[axis // 2], places=6)

        text.write_text("1 0 0 0 0 2 0 0 0 0 1 0 0 0 0 1")
        self.expect(BAD_INPUT, "convert", self.field, placed, "--transform", text, says="evenly")
        text.write_text("1 0 0 0 0 0 0 0 0 0 1 0 0 0 0 1")
        self.expect(BAD_INPUT, "convert", self.field, placed, "--transform", text, "--inverse", says="no inverse")
        self.expect(BAD_INPUT, "convert", self.sweep, self.folder / "s.nrrd", "--transform", itk, says="moves fields")
        self.expect(BAD_INPUT, "convert", self.field, placed, "--transform", self.folder / "no.tfm", says="no.tfm")
        self.expect(USAGE, "convert", self.field, placed, "--inverse")

    def test_errors(self):
        self.expect(BAD_INPUT, "convert", self.folder / "no.vtp", self.folder / "f.ply", says="no.vtp")
        self.expect(CANNOT_WRITE, "convert", self.field, self.folder / "f.mha", says=".ply")
        self.expect(CANNOT_WRITE, "convert", self.sweep, self.folder / "s.ply", says=".mha")
        self.expect(CANNOT_WRITE, "convert", self.sweep, self.folder / "no" / "s.mha")
        self.assertNothingIn(self.folder)


    def test_fields_in_pieces(self):
        index = self.folder / "field.pvtp"
        self.assertEqual(self.expect(SUCCESS, "convert", self.field, index, "--pieces", 2)["gaussians"], self.gaussians)
        self.assertEqual(sorted(file.name for file in self.folder.iterdir()), ["field.pvtp", "field_0.vtp", "field_1.vtp"])
        self.assertEqual(self.expect(SUCCESS, "info", index)["gaussians"], self.gaussians)
        whole, pieces = self.folder / "whole.mha", self.folder / "pieces.mha"
        self.expect(SUCCESS, "slice", self.field, "--poses", self.sweep, "-o", whole)
        self.expect(SUCCESS, "slice", index, "--poses", self.sweep, "-o", pieces)
        # The same Gaussians in another order: sums differ by rounding, and each keeps to a tolerance of 1e-4.
        psnr = self.expect(SUCCESS, "metrics", pieces, whole)["psnr"]
        self.assertTrue(psnr is None or psnr > 74, psnr)  # 20 log10(2e-4)
        again = self.folder / "again.vtp"
        self.expect(SUCCESS, "convert", index, again)
        self.assertEqual(self.expect(SUCCESS, "info", again)["gaussians"], self.gaussians)
        # A piece is never written over the field that it is made of.
        self.expect(CANNOT_WRITE, "convert", self.folder / "field_0.vtp", index, says="field_0.vtp")
        self.expect(USAGE, "convert", self.field, index, "--pieces", 0)
        self.expect(CANNOT_WRITE, "train", self.sweep, "-o", self.folder / "x.pvtp", *TINY, says=".vtp")
        (self.folder / "field_1.vtp").unlink()
        self.expect(BAD_INPUT, "info", index, says="field_1.vtp")


if __name__ == "__main__":
    BIGUS = os.path.abspath(sys.argv.pop(1))
    unittest.main()
