#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""bigus live as the client of an OpenIGTLink server, which is written here from the protocol, and of pyigtl's; and a table
of poses that grows.

    test_live.py PATH_TO_BIGUS [unittest arguments]
"""
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import zlib

BIGUS = None
RATE = 60  # frames a second
WIDTH, HEIGHT, FRAMES = 64, 56, 24
SOUND = 19  # dB, on a busy machine, too; pictures upside down give 13
LONG = 15  # s: a field of so small a sweep is finished by then, or is sound on a machine that does other work


def checksum_of_byte(byte):
    value = byte << 56
    for _ in range(8):
        value = (value << 1 ^ 0x42F0E1EBA9EA3693) & (2**64 - 1) if value >> 63 else value << 1
    return value


CHECKSUMS = [checksum_of_byte(byte) for byte in range(256)]


def checksum(data):
    """CRC-64 of ECMA-182."""
    value = 0
    for byte in data:
        value = (value << 8 & (2**64 - 1)) ^ CHECKSUMS[value >> 56 ^ byte]
    return value


def message(kind, device, seconds, body, version=1, crc=None):
    stamp = int(seconds * 2**32)
    return struct.pack(">H12s20sQQQ", version, kind.encode(), device.encode(), stamp, len(body),
                       checksum(body) if crc is None else crc) + body


def matrix_bytes(pose):
    """Column by column, three rows."""
    return struct.pack(">12f", *(pose[row][column] for column in range(4) for row in range(3)))


def image_body(pixels, pose, lps=False, kind=3, size=(WIDTH, HEIGHT, 1)):
    sign = [-1, -1, 1] if lps else [1, 1, 1]
    middle = [row[:] for row in pose]
    for axis in range(3):
        middle[axis][3] += (WIDTH - 1) / 2 * pose[axis][0] + (HEIGHT - 1) / 2 * pose[axis][1]
        middle[axis] = [sign[axis] * value for value in middle[axis]]
    return (struct.pack(">HBBBB3H", 1, 1, kind, 2, 2 if lps else 1, *size) + matrix_bytes(middle)
            + struct.pack(">6H", 0, 0, 0, *size) + pixels)


def tracked_frame_body(pixels, fields, embedded=None, order=5, kind=1, valid=True, **sizes):
    """As PlusServer sends it: embedded None for versions up to 2.4, whose header ends before order and matrix."""
    text = f'<TrackedFrame Timestamp="1" ImageDataValid="{str(valid).lower()}" NumberOfBits="8">\n'
    text += "".join(f'  <FrameField Name="{name}" Value="{value}" />\n' for name, value in fields.items())
    text = sizes.get("text", (text + "</TrackedFrame>\n").encode())
    body = struct.pack(">6H2I", 3, 1, kind, *sizes.get("size", (WIDTH, HEIGHT, 1)), sizes.get("image_bytes", len(pixels)),
                       sizes.get("text_bytes", len(text)))
    if embedded is not None:  # in the order of bytes of the machine that sends
        body += struct.pack(">H", order) + struct.pack("<16f", *(value for row in embedded for value in row))
    return body + text + pixels


def text_of(pose):
    return " ".join(repr(value) for row in pose for value in row)


IDENTITY = [[float(i == j) for j in range(4)] for i in range(4)]


def png(pixels):
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows = b"".join(b"\0" + pixels[y * WIDTH:(y + 1) * WIDTH] for y in range(HEIGHT))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def read_sequence(path):
    """Header and pixels of a MetaImage."""
    data, mark = path.read_bytes(), b"ElementDataFile = LOCAL\n"
    header, pixels = data[:data.index(mark)].decode(), data[data.index(mark) + len(mark):]
    return header, zlib.decompress(pixels) if "CompressedData = True" in header else pixels


def run(*arguments):
    result = subprocess.run([BIGUS, *map(str, arguments)], capture_output=True, text=True, timeout=120)
    assert "not foreseen" not in result.stderr, result.stderr
    return result


class InFolder(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="bigus-live-"))
        cls.sweep = cls.folder / "sweep.igs.mha"
        made = run("phantom", "-o", cls.sweep, "--frames", FRAMES, "--width", WIDTH, "--height", HEIGHT, "--pixel-size",
                   "0.5", "--frame-spacing", "0.4")
        assert made.returncode == 0, made.stderr
        header, pixels = read_sequence(cls.sweep)
        size = WIDTH * HEIGHT
        cls.pixels = [pixels[k * size:(k + 1) * size] for k in range(FRAMES)]

        def transforms(name):
            found = re.findall(rf"Seq_Frame\d+_{name}Transform = (.*)", header)
            return [[[float(v) for v in line.split()][4 * row:4 * row + 4] for row in range(4)] for line in found]

        def product(a, b):
            return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]

        poses = transforms("ImageToReference")
        if not poses:
            image = re.search(r"\nImageToProbeTransform = (.*)", header)
            fixed = [[float(v) for v in image.group(1).split()][4 * row:4 * row + 4] for row in range(4)]
            poses = [product(probe, fixed) for probe in transforms("ProbeToReference")]
        cls.poses = poses

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    def follow(self, send, *arguments, finish=1):
        """Runs the program as a client of a server whose `send(connection)` sends. Gives its result and its answer."""
        return self.follow_again([send], 0, "--reconnect", 0, *arguments, finish=finish)

    def follow_again(self, sends, away, *arguments, finish=1):
        """The server is there once for each of `sends`, and away for so many seconds in between. A field whose pictures are
        looked at takes LONG to finish."""
        server = socket.create_server(("127.0.0.1", 0))
        port = server.getsockname()[1]

        def serve(server):
            for send in sends:
                server = server or socket.create_server(("127.0.0.1", port))
                connection, _ = server.accept()
                server.close()
                with connection:
                    try:
                        send(connection)
                    except OSError:
                        pass  # the client left
                server = None
                time.sleep(away)

        thread = threading.Thread(target=serve, args=(server,), daemon=True)
        thread.start()
        result = run("live", f"igtl://127.0.0.1:{port}", "-o", self.folder / "field.vtp", "--finish", finish, "--json",
                     *arguments)
        thread.join(10)
        return result, json.loads(result.stdout)

    def send_frames(self, connection, lps=False, version=1):
        for k in range(FRAMES):
            body = image_body(self.pixels[k], self.poses[k], lps)
            if version == 2:  # the third version of the protocol: more before and after the content
                body = struct.pack(">HHII", 12, 2, 3, 77) + body + b"\0\0abc"
            connection.sendall(message("IMAGE", "Image", 100 + k / RATE, body, version))
            time.sleep(1 / RATE)

    def psnr(self):
        """How near the field comes to the frames at their recorded poses."""
        slices = self.folder / "slices.igs.mha"
        made = run("slice", self.folder / "field.vtp", "--poses", self.sweep, "-o", slices)
        self.assertEqual(made.returncode, 0, made.stderr)
        return json.loads(run("metrics", slices, self.sweep, "--json").stdout)["psnr"]


class Messages(InFolder):
    def test_pictures_that_say_where_they_lie(self):
        for lps, version in ((False, 1), (True, 1), (False, 2)):
            with self.subTest(lps=lps, version=version):
                result, answer = self.follow(lambda connection: self.send_frames(connection, lps, version), finish=LONG)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual((answer["frames"], answer["refused"], answer["passed_over"]), (FRAMES, 0, 0))
                self.assertGreater(self.psnr(), SOUND)

    def test_poses_of_a_tracker(self):
        def send(connection):
            for k in range(FRAMES):
                seconds = 100 + k / RATE
                connection.sendall(message("TRANSFORM", "Stylus", seconds, matrix_bytes(self.poses[0])))
                connection.sendall(message("TRANSFORM", "ImageToReference", seconds, matrix_bytes(self.poses[k])))
                connection.sendall(message("STATUS", "Plus", seconds, b"\0" * 30))
                connection.sendall(message("IMAGE", "Image", seconds, image_body(self.pixels[k], self.poses[0])))
                time.sleep(1 / RATE)

        result, answer = self.follow(send, "--transform", "ImageToReference", finish=LONG)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["refused"]), (FRAMES, 0))
        self.assertGreater(self.psnr(), SOUND)

    def test_one_of_two_devices_is_followed(self):
        def send(connection):
            for k in range(FRAMES):
                seconds = 100 + k / RATE
                connection.sendall(message("TRANSFORM", "ImageToReference", seconds, matrix_bytes(self.poses[k])))
                connection.sendall(message("IMAGE", "Webcam", seconds, image_body(b"\x99" * WIDTH * HEIGHT, self.poses[0])))
                connection.sendall(message("IMAGE", "Image_Reference", seconds + 0.001,
                                           image_body(self.pixels[k], self.poses[k])))
                time.sleep(1 / RATE)

        for options in (["--device", "Image_Reference"], ["--transform", "ImageToReference"]):
            with self.subTest(options):
                result, answer = self.follow(send, *options, finish=LONG)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual((answer["frames"], answer["refused"], answer["passed_over"]), (FRAMES, 0, 0), result.stderr)
                self.assertGreater(self.psnr(), SOUND)
        (self.folder / "field.vtp").unlink()
        for options, says in (([], "2 devices send pictures, 'Webcam', 'Image_Reference'. Name the one to follow"),
                              (["--transform", "ProbeToTracker"], "without a TRANSFORM of 'ProbeToTracker'"),
                              (["--device", "Image"], "no picture came of the device 'Image'")):
            with self.subTest(options):
                result, answer = self.follow(send, *options)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(says, answer["error"] + result.stderr)
                self.assertFalse((self.folder / "field.vtp").exists())

    def test_a_device_that_comes_late_is_left_out(self):
        def send(connection):
            self.send_frames(connection)
            for k in range(FRAMES):
                connection.sendall(message("IMAGE", "Webcam", 200 + k, image_body(bytes(WIDTH * HEIGHT), self.poses[k])))

        result, answer = self.follow(send)
        self.assertEqual((result.returncode, answer["frames"], answer["passed_over"]), (0, FRAMES, 0), result.stderr)
        self.assertEqual(result.stderr.count("pictures of 'Webcam' are not followed"), 1)

    def test_a_slice_is_sent_back_for_every_plane(self):
        slices = []

        def send(connection):
            self.send_frames(connection)
            time.sleep(0.5)
            connection.sendall(message("TRANSFORM", "Plane", 200, matrix_bytes(self.poses[12])))
            with connection.makefile("rb") as stream:
                header = stream.read(58)
                kind, device, size, crc = struct.unpack(">2x12s20s8xQQ", header)
                body = stream.read(size)
                slices.append((kind.rstrip(b"\0"), device.rstrip(b"\0"), crc == checksum(body), body))

        result, _ = self.follow(send, "--plane", "Plane", "--slice-size", WIDTH, HEIGHT)
        self.assertEqual(result.returncode, 0, result.stderr)
        (kind, device, is_whole, body), = slices
        self.assertEqual((kind, device, is_whole), (b"IMAGE", b"BigusSlice", True))
        place, wanted = (struct.unpack(">HBBBB3H12f6H", data[:72]) for data in (body, image_body(b"", self.poses[12])))
        for number, other in zip(place, wanted):
            self.assertAlmostEqual(number, other, places=4)  # mm; a float of 40 mm has six digits
        error = sum((a - b) ** 2 for a, b in zip(body[72:], self.pixels[12])) / len(self.pixels[12])
        self.assertLess(error, 40 ** 2)

    def test_late_repeated_and_damaged_messages_are_counted(self):
        def send(connection):
            self.send_frames(connection)
            good = image_body(self.pixels[0], self.poses[0])
            connection.sendall(message("IMAGE", "Image", 100, good))  # late
            connection.sendall(message("IMAGE", "Image", 100 + (FRAMES - 1) / RATE, good))  # repeated
            flipped = bytearray(good)
            flipped[-1] ^= 1
            nowhere = [row[:] for row in self.poses[0]]
            nowhere[1][3] = float("nan")
            for body, crc in ((bytes(flipped), checksum(good)), (good[:-5], None), (good + b"?", None), (b"", None),
                              (image_body(self.pixels[0], self.poses[0], kind=10), None),
                              (image_body(self.pixels[0], self.poses[0], size=(60000, 60000, 1)), None),
                              (image_body(self.pixels[0], self.poses[0], size=(WIDTH, 0, 1)), None),
                              (image_body(self.pixels[0], nowhere), None)):
                connection.sendall(message("IMAGE", "Image", 300, body, crc=crc))
            connection.sendall(message("IMAGE", "Image", 300, b"\xff" * 20, version=2))

        result, answer = self.follow(send, finish=LONG)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["passed_over"], answer["refused"]), (FRAMES, 2, 9))
        self.assertIn("damaged on its way", result.stderr)
        self.assertGreater(self.psnr(), SOUND)

    def test_a_hostile_server_costs_nothing_that_came_before(self):
        for junk in (b"GET / HTTP/1.1\r\n" * 10,
                     struct.pack(">H12s20sQQQ", 1, b"IMAGE", b"Image", 0, 2**63, 0),
                     message("IMAGE", "Image", 300, bytes(2**20))[:1000]):  # then it closes
            def send(connection):
                self.send_frames(connection)
                connection.sendall(junk)

            with self.subTest(junk=junk[:20]):
                result, answer = self.follow(send)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual(answer["frames"], FRAMES)

    def test_pictures_larger_than_the_memory_are_refused_by_name(self):
        def send(connection):
            self.send_frames(connection)
            time.sleep(0.2)

        (self.folder / "field.vtp").unlink(missing_ok=True)  # of another test
        result, answer = self.follow(send, "--memory", 0.001)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn(f"it has {WIDTH} x {HEIGHT} pixels", answer["error"])
        self.assertIn("--memory GB)", answer["error"])
        self.assertFalse((self.folder / "field.vtp").exists())

        side = 16384

        def announce(connection):
            connection.sendall(struct.pack(">H12s20sQQQ", 1, b"IMAGE", b"Image", 0, 72 + side * side, 0))
            connection.sendall(image_body(b"", self.poses[0], size=(side, side, 1)))

        result, answer = self.follow(announce)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn(f"it has {72 + side * side} bytes, more than", answer["error"])

    def test_a_silent_server_ends_with_the_pause(self):
        done = threading.Event()

        def send(connection):
            self.send_frames(connection)
            done.wait(30)

        start = time.monotonic()
        result, answer = self.follow(send, "--pause", 1)
        done.set()
        self.assertEqual((result.returncode, answer["frames"]), (0, FRAMES))
        self.assertLess(time.monotonic() - start, 20)

    def test_ctrl_c_ends_what_no_frame_came_of(self):
        (self.folder / "field.vtp").unlink(missing_ok=True)  # of another test
        with socket.create_server(("127.0.0.1", 0)) as server:
            process = subprocess.Popen([BIGUS, "live", f"igtl://127.0.0.1:{server.getsockname()[1]}", "-o",
                                        str(self.folder / "field.vtp"), "--json"],
                                       stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            connection, _ = server.accept()
            process.stderr.readline()  # it is connected
            process.send_signal(signal.SIGINT)
            stdout, _ = process.communicate(timeout=30)
            connection.close()
        self.assertEqual((process.returncode, json.loads(stdout)["exit_code"]), (130, 130))
        self.assertFalse((self.folder / "field.vtp").exists())

    def test_no_server_and_no_address(self):
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        for address, says in ((f"igtl://127.0.0.1:{port}", "refused"), ("igtl://", "no address"),
                              ("igtl://localhost:99999", "no address"), ("igtl://localhost:x", "no address")):
            result = run("live", address, "-o", self.folder / "none.vtp")
            self.assertEqual(result.returncode, 2, address)
            self.assertIn(says, result.stderr)
        result = run("live", f"igtl://127.0.0.1:{port}", "-o", self.folder / "none.vtp", "--hold-out", 4)
        self.assertIn("--hold-out", result.stderr)
        for option in (["--reduce", 2], ["--clip-rectangle", 0, 0, 8, 8]):  # rather than to look past it
            result = run("live", f"igtl://127.0.0.1:{port}", "-o", self.folder / "none.vtp", *option)
            self.assertEqual(result.returncode, 2)
            self.assertIn("need a sequence that is replayed", result.stderr)
        self.assertFalse((self.folder / "none.vtp").exists())

    def test_another_implementation(self):
        try:
            import numpy
            import pyigtl
        except ImportError:
            self.skipTest("pyigtl is not installed")
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        server = pyigtl.OpenIGTLinkServer(port=port, local_server=True)

        def serve():
            while not server.is_connected():
                time.sleep(0.05)
            for k in range(FRAMES):
                pixels = numpy.frombuffer(self.pixels[k], numpy.uint8).reshape(1, HEIGHT, WIDTH)
                server.send_message(pyigtl.ImageMessage(pixels, numpy.array(self.poses[k]), "ras", 100 + k / RATE, "Image"),
                                    wait=True)
                time.sleep(1 / RATE)
            time.sleep(1)
            server.stop()

        threading.Thread(target=serve, daemon=True).start()
        time.sleep(0.5)
        result = run("live", f"igtl://127.0.0.1:{port}", "-o", self.folder / "field.vtp", "--finish", LONG, "--pause", 1,
                     "--reconnect", 1, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads(result.stdout)["frames"], FRAMES)
        self.assertGreater(self.psnr(), SOUND)


class TrackedFrames(InFolder):
    def test_tracked_frames_of_plus(self):
        config = self.folder / "plus.xml"
        half = [[0.5 if i == j else 0.0 for j in range(4)] for i in range(3)] + [[0.0, 0.0, 0.0, 1.0]]
        double = [[2 * row[j] if j < 3 else row[j] for j in range(4)] for row in IDENTITY[:3]] + [IDENTITY[3]]
        config.write_text('<PlusConfiguration><CoordinateDefinitions><Transform From="Image" To="Probe" Matrix="'
                          + text_of(half) + '"/></CoordinateDefinitions></PlusConfiguration>')

        def times(a, b):
            return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]

        def mirrored(k):
            return b"".join(self.pixels[k][y * WIDTH:(y + 1) * WIDTH] for y in reversed(range(HEIGHT)))

        def fields(name, pose):
            return {f"{name}Transform": text_of(pose), f"{name}TransformStatus": "OK", "Operator": "A &quot;B&quot; &lt;C&gt;"}

        kinds = {
            "fields, old header": (lambda k: tracked_frame_body(self.pixels[k], fields("ImageToReference", self.poses[k])), []),
            "fields before what is embedded": (lambda k: tracked_frame_body(
                self.pixels[k], fields("ImageToReference", self.poses[k]), self.poses[0]), []),
            "with a configuration": (lambda k: tracked_frame_body(
                self.pixels[k], fields("ProbeToTracker", times(self.poses[k], double)), IDENTITY),
                ["--config", config, "--image-to", "Tracker"]),
            "embedded": (lambda k: tracked_frame_body(self.pixels[k], fields("StylusToTracker", IDENTITY), self.poses[k]), []),
            "other order": (lambda k: tracked_frame_body(mirrored(k), fields("ImageToReference", self.poses[k]), IDENTITY, 8),
                            [])}
        for name, (body, arguments) in kinds.items():
            def send(connection):
                for k in range(FRAMES):
                    connection.sendall(message("TRACKEDFRAME", "Tracked", 100 + k / RATE, body(k)))
                    time.sleep(1 / RATE)

            with self.subTest(name):
                result, answer = self.follow(send, *arguments, finish=LONG)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual((answer["frames"], answer["refused"], answer["passed_over"]), (FRAMES, 0, 0), result.stderr)
                self.assertGreater(self.psnr(), SOUND)

    def test_tracked_frames_that_are_none_are_counted(self):
        good = {"ImageToReferenceTransform": text_of(self.poses[0]), "ImageToReferenceTransformStatus": "OK"}
        lost = {**good, "ImageToReferenceTransformStatus": "INVALID"}
        pixels = self.pixels[0]
        bad = [tracked_frame_body(pixels, lost), tracked_frame_body(pixels, {}), tracked_frame_body(pixels, {}, IDENTITY),
               tracked_frame_body(pixels, {**good, "ImageToReferenceTransform": "1 2 3"}, self.poses[0]),
               tracked_frame_body(pixels, good, valid=False), tracked_frame_body(pixels, good, kind=2),
               tracked_frame_body(pixels, good, IDENTITY, order=12), tracked_frame_body(pixels, good, size=(WIDTH, HEIGHT, 2)),
               tracked_frame_body(pixels, good, size=(65535, 65535, 1)), tracked_frame_body(pixels, good, image_bytes=2**32 - 1),
               tracked_frame_body(pixels, good, text_bytes=2**32 - 1), tracked_frame_body(pixels, good, text=b"<a><b></a>"),
               tracked_frame_body(pixels, good, text=b"<a>" * 200), tracked_frame_body(pixels, good, text=b" " * (2**20 + 1)),
               tracked_frame_body(pixels, good)[:-1], tracked_frame_body(pixels, good)[:19], b""]

        def send(connection):
            self.send_frames(connection)
            for body in bad:
                connection.sendall(message("TRACKEDFRAME", "Tracked", 300, body, crc=0))

        result, answer = self.follow(send)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["refused"]), (FRAMES, len(bad)), result.stderr)
        self.assertIn("EmbeddedTransformToFrame", result.stderr)
        self.assertIn("INVALID", result.stderr)


class Reconnects(InFolder):
    def part(self, first, last, seconds, cut=0):
        """Sends these frames, and at the end `cut` bytes of another."""
        def send(connection):
            for k in range(first, last):
                connection.sendall(message("IMAGE", "Image", seconds + k / RATE, image_body(self.pixels[k], self.poses[k])))
                time.sleep(1 / RATE)
            connection.sendall(message("IMAGE", "Image", seconds + last / RATE, image_body(self.pixels[0], self.poses[0]))[:cut])

        return send

    def test_a_server_that_comes_back_is_followed_on(self):
        third = FRAMES // 3
        status, phases = self.folder / "status.json", set()

        def look():
            while not phases.issuperset({"ended"}):
                if status.exists():  # read while it is replaced: always whole
                    phases.add(json.loads(status.read_text())["phase"])
                time.sleep(0.02)

        threading.Thread(target=look, daemon=True).start()
        for name, clocks in (("the same clock", (100, 101, 102)), ("a clock that begins anew", (100, 100 - 5, 2))):
            sends = [self.part(k * third, (k + 1) * third, clock, cut) for k, (clock, cut) in enumerate(zip(clocks, (0, 500, 0)))]
            with self.subTest(name):
                result, answer = self.follow_again(sends, 0.7, "--reconnect", 5, "--status", status, finish=LONG)
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual((answer["frames"], answer["passed_over"], answer["reconnects"]), (FRAMES, 0, 2), result.stderr)
                self.assertIn("again", result.stderr)
                self.assertGreater(self.psnr(), SOUND)
                last = json.loads(status.read_text())
                self.assertEqual([last[key] for key in ("phase", "fraction", "frames", "reconnects", "refused", "waiting")],
                                 ["ended", 1, FRAMES, 2, 0, 0])
        self.assertEqual(phases, {"following", "waiting", "finishing", "ended"})

    def test_what_is_sent_again_after_a_reconnect_is_passed_over(self):
        # The clock goes on, and after its first new frame the server repeats some.
        def send(connection):
            self.part(12, FRAMES, 100)(connection)
            self.part(6, 18, 100)(connection)

        result, answer = self.follow_again([self.part(0, 12, 100), send], 0.3, "--reconnect", 5)
        self.assertEqual((result.returncode, answer["frames"], answer["passed_over"]), (0, FRAMES, 12), result.stderr)

    def test_a_server_that_does_not_come_back_is_not_waited_for_without_end(self):
        start = time.monotonic()
        result, answer = self.follow_again([self.part(0, FRAMES, 100, 30)], 0, "--reconnect", 1.5)
        self.assertEqual((result.returncode, answer["frames"], answer["reconnects"]), (0, FRAMES, 0), result.stderr)
        self.assertLess(time.monotonic() - start, 30)

    def test_a_server_that_only_drops_connections_is_not_followed_without_end(self):
        start = time.monotonic()
        junk = [lambda connection: None, lambda connection: connection.sendall(b"GET / HTTP/1.1\r\n" * 10)] * 20
        result, answer = self.follow_again([self.part(0, FRAMES, 100), *junk], 0, "--reconnect", 2)
        self.assertEqual((result.returncode, answer["frames"]), (0, FRAMES), result.stderr)
        self.assertLess(answer["reconnects"], 6)
        self.assertLess(time.monotonic() - start, 40)


class Slices(InFolder):
    def test_clients_take_turns(self):
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]
        lifted, counts, pictures = threading.Event(), {}, []

        def connect():
            while not lifted.is_set():
                try:
                    return socket.create_connection(("127.0.0.1", port), timeout=20)
                except OSError:
                    time.sleep(0.05)

        def receive(stream):
            header = stream.read(58)
            kind, device, size, crc = struct.unpack(">2x12s20s8xQQ", header)
            body = stream.read(size)
            self.assertEqual((kind.rstrip(b"\0"), device.rstrip(b"\0"), crc), (b"IMAGE", b"BigusSlice", checksum(body)))
            return body[72:]

        def ask(name, ahead):
            """One plane after another, each before so many answers have come."""
            plane = message("TRANSFORM", "Plane", 1, matrix_bytes(self.poses[12]))
            with connect() as connection, connection.makefile("rb") as stream:
                counts[name] = 0
                try:
                    connection.sendall(plane * ahead)
                    while not lifted.is_set():
                        pictures.append(receive(stream))
                        counts[name] += 1
                        connection.sendall(plane * ahead)
                except (OSError, struct.error):
                    pass  # the program ended

        def disturb():
            for bad in (b"GET / HTTP/1.1\r\n" * 10, message("TRANSFORM", "Plane", 1, b"", crc=0), b"\0",
                        message("TRANSFORM", "Plane", 1, bytes(48)), message("TRANSFORM", "Plane", 1, b"\xff" * 48, crc=0),
                        struct.pack(">H12s20sQQQ", 1, b"TRANSFORM", b"Plane", 0, 2**25, 0)):
                with connect() as connection:
                    connection.sendall(bad)

        def send(connection):
            threads = [threading.Thread(target=ask, args=arguments, daemon=True)
                       for arguments in (("patient", 1), ("greedy", 20), ("third", 1))]
            for thread in [*threads, threading.Thread(target=disturb, daemon=True)]:
                thread.start()
            for _ in range(2):
                self.send_frames(connection)
            time.sleep(2)
            lifted.set()

        result, answer = self.follow(send, "--listen", port, "--slice-size", WIDTH, HEIGHT)
        self.assertEqual((result.returncode, answer["frames"], answer["dropped"]), (0, FRAMES, 0), result.stderr)
        self.assertGreater(min(counts.values()), 4, counts)
        self.assertLess(max(counts.values()), 3 * min(counts.values()) + 5, counts)
        error = sum((a - b) ** 2 for a, b in zip(pictures[-1], self.pixels[12])) / len(self.pixels[12])
        self.assertLess(error, 40 ** 2)

    def test_another_implementation_asks(self):
        """pyigtl asks for the state by STRING and for a slice by TRANSFORM. It keeps only a device's newest message, so each
        question waits for its answer."""
        try:
            import numpy
            import pyigtl
        except ImportError:
            self.skipTest("pyigtl is not installed")
        sender, done = socket.create_server(("127.0.0.1", 0)), threading.Event()
        with socket.create_server(("127.0.0.1", 0)) as free:
            port = free.getsockname()[1]

        def serve():
            connection, _ = sender.accept()
            with sender, connection:
                self.send_frames(connection)
                done.wait(120)

        threading.Thread(target=serve, daemon=True).start()
        field, slices = self.folder / "asked.vtp", self.folder / "asked.igs.mha"
        command = [BIGUS, "live", f"igtl://127.0.0.1:{sender.getsockname()[1]}", "-o", field, "--listen", port, "--slice-size",
                   WIDTH, HEIGHT, "--pause", 120, "--json"]
        with subprocess.Popen(map(str, command), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
            client = pyigtl.OpenIGTLinkClient("127.0.0.1", port)

            def ask(question):
                client.send_message(pyigtl.StringMessage(json.dumps(question), device_name="BigusView"))
                answer = client.wait_for_message("BigusView", 20)
                self.assertIsNotNone(answer, question)
                return json.loads(answer.string)

            try:
                states, end = [ask({})], time.monotonic() + 60
                # The newest frames are trained on for a while. Then the field stays as it is.
                while len(states) < 3 or states[-1]["frames"] < FRAMES or states[-1]["steps"] != states[-3]["steps"]:
                    self.assertLess(time.monotonic(), end, states[-1])
                    time.sleep(0.5)
                    states.append(ask({}))
                # pyigtl passes over the array that comes after this state.
                state = ask({"plane": [value for row in self.poses[12] for value in row], "width": 8, "height": 8})
                self.assertIn("points is a whole number", ask({"points": 0})["error"])
                client.send_message(pyigtl.TransformMessage(numpy.array(self.poses[12]), 7.5, "Plane"))
                slice = client.wait_for_message("BigusSlice", 20)
                self.assertIsNotNone(slice)
                program.send_signal(signal.SIGINT)  # it writes the field as it is
                output, errors = program.communicate(timeout=60)
            finally:
                done.set()
                client.stop()
                program.kill()
        self.assertEqual(program.returncode, 130, errors)
        written = json.loads(output)
        self.assertEqual([state[key] for key in ("phase", "fraction", "frames", "passed_over", "dropped", "refused")],
                         ["following", None, FRAMES, 0, 0, 0])
        self.assertEqual((state["gaussians"], state["steps"]), (written["gaussians"], written["steps"]))
        probe = state["probe"]
        self.assertEqual((probe["width"], probe["height"]), (WIDTH, HEIGHT))
        plane = numpy.reshape(probe["plane"], (4, 4))
        # 1e-5 mm: what travels as a float of up to 64 mm is 2e-6 off, and two such errors meet in an IMAGE's middle.
        self.assertLess(min(numpy.abs(plane - pose).max() for pose in self.poses), 1e-5)
        self.assertEqual((slice.image.shape, slice.image.dtype, slice.world_coordinate_system, slice.timestamp),
                         ((1, HEIGHT, WIDTH), numpy.uint8, "ras", 7.5))
        self.assertLess(numpy.abs(slice.ijk_to_world_matrix - self.poses[12]).max(), 1e-5)
        made = run("slice", field, "--poses", self.sweep, "--frames", 12, "-o", slices)
        self.assertEqual(made.returncode, 0, made.stderr)
        expected, frame = (numpy.frombuffer(pixels, numpy.uint8).reshape(HEIGHT, WIDTH).astype(float)
                           for pixels in (read_sequence(slices)[1], self.pixels[12]))
        # The plane as floats and the rounding of what is written move a pixel by far less than half a grey level.
        self.assertLessEqual(numpy.abs(slice.image[0] - expected).max(), 1)
        self.assertLess(numpy.mean((slice.image[0] - frame) ** 2), 40 ** 2)

    def test_a_port_that_is_taken(self):
        with socket.create_server(("127.0.0.1", 0)) as taken:
            result = run("live", self.sweep, "-o", self.folder / "none.vtp", "--rate", 100, "--listen", taken.getsockname()[1])
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("--listen", result.stderr)


class Budget(InFolder):
    """Memory at most 64 MB and 40 times the bytes that came, as SECURITY.md promises of every command."""

    MEGABYTE = 1 << 20
    SIZES = ((30, 48), (300, 48), (30, 160), (30, 512))  # frames, pixels of a side
    noise = random.Random(7)

    def pose(self, k):
        return [[0.2, 0, 0, 0], [0, 0.2, 0, 0], [0, 0, 0.2, 0.2 * k], [0, 0, 0, 1]]

    def expect_within(self, received, *arguments):
        process = subprocess.Popen([BIGUS, "live", *map(str, arguments), "-o", str(self.folder / "field.vtp"), "--finish", "1"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        said = process.stderr.read()
        process.stderr.close()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        self.assertEqual(process.returncode, 0, said)
        self.assertLess(usage.ru_maxrss * 1024, 64 * self.MEGABYTE + 40 * received())

    def test_frames_of_a_server(self):
        for frames, side in self.SIZES:
            sent = []

            def send(server):
                connection, _ = server.accept()
                with connection:
                    for k in range(frames):
                        # Nobody waits for a checksum of so much.
                        body = struct.pack(">HBBBB3H", 1, 1, 3, 2, 1, side, side, 1) + matrix_bytes(self.pose(k))
                        body += struct.pack(">6H", 0, 0, 0, side, side, 1) + self.noise.randbytes(side * side)
                        sent.append(message("IMAGE", "Image", 100 + k / RATE, body, crc=0))
                        connection.sendall(sent[-1])

            with self.subTest(frames=frames, side=side), socket.create_server(("127.0.0.1", 0)) as server:
                thread = threading.Thread(target=send, args=(server,), daemon=True)
                thread.start()
                self.expect_within(lambda: sum(map(len, sent)), f"igtl://127.0.0.1:{server.getsockname()[1]}",
                                   "--reconnect", 0)
                thread.join(10)

    def test_a_sequence(self):
        path = self.folder / "speckle.igs.mha"
        for frames, side in self.SIZES:
            lines = ["ObjectType = Image", "NDims = 3", f"DimSize = {side} {side} {frames}", "ElementType = MET_UCHAR"]
            for k in range(frames):
                lines += [f"Seq_Frame{k:04}_ImageToReferenceTransform = {text_of(self.pose(k))}",
                          f"Seq_Frame{k:04}_ImageToReferenceTransformStatus = OK", f"Seq_Frame{k:04}_Timestamp = {k / RATE}"]
            path.write_bytes("\n".join(lines + ["ElementDataFile = LOCAL\n"]).encode()
                             + self.noise.randbytes(frames * side * side))
            with self.subTest(frames=frames, side=side):
                self.expect_within(lambda: path.stat().st_size, path, "--rate", 1000)


class Tables(InFolder):
    HEADER = "image,timestamp," + ",".join(f"m{n // 4}{n % 4}" for n in range(16)) + "\n"

    def grow(self, write, finish=1):
        """Follows a table in a folder of its own, which `write(folder, stream)` makes longer."""
        folder = pathlib.Path(tempfile.mkdtemp(dir=self.folder))
        path = folder / "poses.csv"
        path.touch()

        def work():
            with path.open("w") as stream:
                write(folder, stream)

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        result = run("live", path, "--follow", "-o", self.folder / "field.vtp", "--finish", finish, "--pause", 2, "--json")
        thread.join(10)
        return result, json.loads(result.stdout)

    def row(self, k, seconds=None):
        return f"{k}.png,{k / RATE if seconds is None else seconds}," + text_of(self.poses[k]).replace(" ", ",") + "\n"

    def test_a_table_that_grows(self):
        def write(folder, stream):
            stream.write(self.HEADER + "# of a recording\n\n")
            for k in range(FRAMES):
                text, image = self.row(k), png(self.pixels[k])
                if k % 3 == 0:  # the picture comes first
                    (folder / f"{k}.png").write_bytes(image)
                stream.write(text[:40])  # half a line
                stream.flush()
                time.sleep(1 / RATE)
                stream.write(text[40:])
                stream.flush()
                if k % 3 == 1:
                    (folder / f"{k}.png").write_bytes(image[:300])  # half a picture
                    time.sleep(0.1)
                (folder / f"{k}.png").write_bytes(image)
            stream.write(self.row(3))  # again
            stream.write("1,2,3\n" + self.row(5).replace("5.png", "../5.png"))
            stream.write(self.row(6).replace("6.png", "none.png", 1) + self.row(7, "soon"))

        result, answer = self.grow(write, finish=LONG)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["passed_over"], answer["refused"]), (FRAMES, 1, 4), result.stderr)
        self.assertGreater(self.psnr(), SOUND)

    def test_pipes_and_devices_are_not_followed(self):
        pipe = self.folder / "pipe.csv"
        os.mkfifo(pipe)
        for path in (pipe, "/dev/zero", self.folder):
            result = run("live", path, "--follow", "-o", self.folder / "field.vtp")
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn("is a folder" if path == self.folder else "not a file", result.stderr)

    def test_a_table_that_is_none_or_ends_early(self):
        def other(folder, stream):
            stream.write("x,y,z\n")

        def without_pictures(folder, stream):
            stream.write(self.HEADER.replace("image,", "picture,"))

        for write, says in ((other, "no column m00"), (without_pictures, "no column image")):
            result, answer = self.grow(write)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(says, answer["error"])

        def cut(folder, stream):
            stream.write(self.HEADER)
            for k in range(FRAMES):
                (folder / f"{k}.png").write_bytes(png(self.pixels[k]))
                stream.write(self.row(k))
            stream.flush()
            time.sleep(1)
            stream.truncate(100)

        result, answer = self.grow(cut)
        self.assertEqual((result.returncode, answer["frames"], answer["refused"]), (0, FRAMES, 1), result.stderr)
        self.assertIn("shorter", result.stderr)


if __name__ == "__main__":
    BIGUS = sys.argv.pop(1)
    unittest.main()
