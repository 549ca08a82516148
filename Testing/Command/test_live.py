#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""bigus live as the client of an OpenIGTLink server, which is written here from the protocol, and of pyigtl's.

    test_live.py PATH_TO_BIGUS [unittest arguments]
"""
import json
import pathlib
import re
import shutil
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


def checksum(data):
    """CRC-64 of ECMA-182, bit by bit."""
    value = 0
    for byte in data:
        value ^= byte << 56
        for _ in range(8):
            value = (value << 1 ^ 0x42F0E1EBA9EA3693) & (2**64 - 1) if value >> 63 else value << 1
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


def run(*arguments):
    return subprocess.run([BIGUS, *map(str, arguments)], capture_output=True, text=True, timeout=120)


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp(prefix="bigus-live-"))
        cls.sweep = cls.folder / "sweep.igs.mha"
        made = run("phantom", "-o", cls.sweep, "--frames", FRAMES, "--width", WIDTH, "--height", HEIGHT, "--pixel-size",
                   "0.5", "--frame-spacing", "0.4")
        assert made.returncode == 0, made.stderr
        data = cls.sweep.read_bytes()
        mark = b"ElementDataFile = LOCAL\n"
        header, pixels = data[:data.index(mark)].decode(), data[data.index(mark) + len(mark):]
        pixels = zlib.decompress(pixels) if "CompressedData = True" in header else pixels
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

    def follow(self, send, *arguments):
        """Runs the program as a client of a server whose `send(connection)` sends. Gives its result and its answer."""
        server = socket.create_server(("127.0.0.1", 0))

        def serve():
            connection, _ = server.accept()
            with connection:
                try:
                    send(connection)
                except OSError:
                    pass  # the client left

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        result = run("live", f"igtl://127.0.0.1:{server.getsockname()[1]}", "-o", self.folder / "field.vtp", "--finish", 60,
                     "--json", *arguments)
        thread.join(10)
        server.close()
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

    def test_pictures_that_say_where_they_lie(self):
        for lps, version in ((False, 1), (True, 1), (False, 2)):
            with self.subTest(lps=lps, version=version):
                result, answer = self.follow(lambda connection: self.send_frames(connection, lps, version))
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual((answer["frames"], answer["refused"], answer["passed_over"]), (FRAMES, 0, 0))
                self.assertGreater(self.psnr(), 22)

    def test_poses_of_a_tracker(self):
        def send(connection):
            for k in range(FRAMES):
                seconds = 100 + k / RATE
                connection.sendall(message("TRANSFORM", "Stylus", seconds, matrix_bytes(self.poses[0])))
                connection.sendall(message("TRANSFORM", "ImageToReference", seconds, matrix_bytes(self.poses[k])))
                connection.sendall(message("STATUS", "Plus", seconds, b"\0" * 30))
                connection.sendall(message("IMAGE", "Image", seconds, image_body(self.pixels[k], self.poses[0])))
                time.sleep(1 / RATE)

        result, answer = self.follow(send, "--transform", "ImageToReference")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["refused"]), (FRAMES, 0))
        self.assertGreater(self.psnr(), 22)

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

        result, answer = self.follow(send)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual((answer["frames"], answer["passed_over"], answer["refused"]), (FRAMES, 2, 9))
        self.assertIn("damaged on its way", result.stderr)
        self.assertGreater(self.psnr(), 22)

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
        result = run("live", f"igtl://127.0.0.1:{port}", "-o", self.folder / "field.vtp", "--finish", 60, "--pause", 1, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads(result.stdout)["frames"], FRAMES)
        self.assertGreater(self.psnr(), 22)


if __name__ == "__main__":
    BIGUS = sys.argv.pop(1)
    unittest.main()
