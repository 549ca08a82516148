# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The page in the browser: its server against honest and hostile clients, and the page itself in Chromium.

    test_serve.py FIELD

Runs with the package of the build with VTK and with the wheel's. What needs aiohttp or Chromium is skipped without them.
BIGUS_CHROMIUM names a browser. With BIGUS_SERVE_FIELD and BIGUS_SERVE_SWEEP the browser's test prints how fast these are.
"""

import asyncio
import contextlib
import ipaddress
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock
from pathlib import Path

import numpy as np

import bigus
import chromium
from bigus import serve

try:
    import aiohttp
    import aiohttp.test_utils
except ImportError:
    aiohttp = None

FIELD = ""
FRAMES, HEIGHT, WIDTH = 5, 48, 64
START_SECONDS = 120  # on a busy machine


def poses() -> np.ndarray:
    matrices = np.tile(np.diag([0.4, 0.4, 1.0, 1.0]), (FRAMES, 1, 1))
    matrices[:, :3, 3] = [[-12, -10, k] for k in range(FRAMES)]
    return matrices


def write_sweep(path: str) -> np.ndarray:
    pixels = np.random.default_rng(7).integers(0, 256, (FRAMES, HEIGHT, WIDTH), dtype=np.uint8)
    bigus.write(bigus.sweep(pixels, poses(), np.arange(FRAMES) / 20.0), path)
    return pixels


def write_labelled(sweep: str, path: str) -> None:
    """The field with two labels, one at each side of the frames, of which the right one is named as no HTML may be."""
    pictures = np.zeros((3, HEIGHT, WIDTH), int)
    pictures[:, 8:40, 6:26], pictures[:, 8:40, 38:58] = 1, 7
    names = {1: "left", 7: "<b>right"}
    bigus.write(bigus.label(bigus.read(FIELD), bigus.read(sweep), pictures, names, frames=[0, 2, 4]), path)


def write_sure(sweep: str, path: str, **options) -> None:
    """A field that keeps what its standard error rests on."""
    few = {"Automatic": False, "Gaussians": 400, "Iterations": 30, "Batch": 4, **options}
    bigus.write(bigus.train(bigus.read(sweep), progress=False, **few)[0], path)


def line(x: float, y: float, dx: float, dy: float, places: int = 9) -> list:
    return [(x + dx * k / (places - 1), y + dy * k / (places - 1)) for k in range(places)]


def unpack(data: bytes) -> tuple:
    """Head, slice, coverage and the recorded frame or None of an answer. What was seen is left out."""
    (length,) = struct.unpack("<I", data[:4])
    head = json.loads(data[4 : 4 + length])
    pixels = np.frombuffer(data, np.uint8, offset=4 + length)
    count, shape = head["width"] * head["height"], (head["height"], head["width"])
    recorded = pixels[3 * count :].reshape(head["recorded"][::-1]) if "recorded" in head else None
    return head, pixels[:count].reshape(shape), pixels[count : 2 * count].reshape(shape), recorded


class Running:
    """A server as people start it."""

    def __init__(self, *arguments: str):
        command = [sys.executable, "-m", "bigus.serve", *arguments, "--port", "0", "--json"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.phases = []
        for line in self.process.stdout:
            self.phases.append(json.loads(line))
            if self.phases[-1].get("phase") == "ready":
                break
        else:
            raise AssertionError(self.process.communicate()[1])
        self.url = self.phases[-1]["url"]

    def end(self, number: int = signal.SIGTERM) -> tuple:
        self.process.send_signal(number)
        told, complaints = self.process.communicate(timeout=60)
        return self.process.returncode, told, complaints


class Rules(unittest.TestCase):
    """Needs neither aiohttp nor a network."""

    @classmethod
    def setUpClass(cls):
        cls.scene = serve.read_scene(FIELD, None, lambda *_, **__: None)

    def request(self, **changes):
        plane = np.diag([0.4, 0.4, 1.0, 1.0]).ravel().tolist()
        return {"id": 1, "plane": plane, "width": 64, "height": 48, **changes}

    def test_a_sound_request_is_the_slice_of_the_library(self):
        asked = self.scene.parse(json.dumps(self.request()))
        head, (image, coverage, _) = self.scene.render(asked)
        expected = bigus.reslice(bigus.read(FIELD), np.diag([0.4, 0.4, 1, 1]), size=(64, 48))
        np.testing.assert_allclose(np.frombuffer(image, np.uint8).reshape(48, 64), expected * 255, atol=0.51)
        self.assertEqual(len(coverage), 64 * 48)
        self.assertGreater(max(coverage), 0)
        self.assertIsNone(head["frame"])

    def test_unsound_requests_are_refused(self):
        def plane(**changes):
            numbers = self.request()["plane"]
            for place, value in changes.items():
                numbers[int(place[1:])] = value
            return self.request(plane=numbers)

        unsound = [
            {}, [], 1, None, "text", self.request(id=-1), self.request(id=1.5), self.request(id=True), self.request(id=2**70),
            self.request(width=0), self.request(width=10**30), self.request(width=4096, height=4096), self.request(height="9"),
            self.request(frame=0), self.request(plane=None), self.request(plane=[1] * 15), self.request(plane=["1"] * 16),
            self.request(plane=[[1] * 16]), self.request(plane=[True] * 16), self.request(plane=[0] * 16),
            plane(n0=float("nan")), plane(n3=float("inf")), plane(n3=1e300), plane(n3=10**400), plane(n0=1e-9),
            plane(n0=1e4), plane(n1=0.4, n5=0), self.request(elevationSigma=-1), self.request(elevationSigma=1e9),
            self.request(elevationSigma="1"), self.request(elevationSigma=None), self.request(elevationSigma=float("nan")),
        ]  # fmt: skip
        for message in unsound:
            with self.subTest(message=str(message)[:80]), self.assertRaises(ValueError):
                self.scene.parse(json.dumps(message))
        for text in ("", "{", "[" * 4000, '{"id": ' + "9" * 4000 + "}", "\0", '{"id": 1e999}', "\ud800"):
            with self.subTest(text=text[:20]), self.assertRaises(ValueError):
                self.scene.parse(text)

    def test_names_of_strangers_are_refused(self):
        for host in ("127.0.0.1:8765", "localhost", "LOCALHOST:1", "[::1]:80", "192.168.1.7:80", "ward.example:80"):
            self.assertTrue(serve.host_is_sound(host, ["ward.example"]), host)
        for host in ("", "evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", "[::1", "a:b", "ward.example.x"):
            self.assertFalse(serve.host_is_sound(host, ["ward.example"]), host)
        self.assertTrue(serve.origin_is_sound(None, "localhost:80"))
        self.assertTrue(serve.origin_is_sound("http://localhost:80", "localhost:80"))
        for origin in ("null", "http://evil.example", "http://localhost:81", "file://", "http://localhost:80.evil.example"):
            self.assertFalse(serve.origin_is_sound(origin, "localhost:80"), origin)

    def test_tokens(self):
        self.assertTrue(serve.token_is_sound("abc", "abc"))
        for given in ("", "ab", "abcd", "abC", "\udc80"):
            self.assertFalse(serve.token_is_sound(given, "abc"))

    def test_the_nearest_frame(self):
        with tempfile.TemporaryDirectory() as folder:
            write_sweep(folder + "/sweep.igs.mha")
            sweep = serve.Sweep(bigus, bigus.read(folder + "/sweep.igs.mha"))
        moved = poses()[3]
        moved[2, 3] += 0.25
        for turned in (moved, moved @ np.array([[0.6, -0.8, 0, 9], [0.8, 0.6, 0, 5], [0, 0, 1, 0], [0, 0, 0, 1]])):
            frame, distance = sweep.nearest(turned, 16, 12)  # wherever in the plane
            self.assertEqual(frame, 3)
            self.assertAlmostEqual(distance, 0.25)
            self.assertFalse(sweep.is_at(turned, 3))
        beside = poses()[0]
        beside[0, 3] -= WIDTH * 0.4 + 3
        frame, distance = sweep.nearest(beside, 1, 1)
        self.assertEqual(frame, 0)
        self.assertAlmostEqual(distance, WIDTH * 0.4 + 3)

    def test_what_the_sweep_looked_at_is_seen_though_nothing_shines_there(self):
        with tempfile.TemporaryDirectory() as folder:
            pixels = np.zeros((FRAMES, HEIGHT, WIDTH), dtype=np.uint8)
            pixels[0, :, WIDTH // 2 :] = 90  # the rest is beside the probe's fan
            bigus.write(bigus.sweep(pixels, poses() + np.eye(4)[2][:, None] * [0, 0, 0, 500], np.arange(FRAMES)), folder + "/s.mha")
            scene = serve.read_scene(FIELD, folder + "/s.mha", lambda *_, **__: None)

        def seen(k, up=0.0):  # far from the field
            plane = poses()[k]
            plane[2, 3] += 500 + up
            _, (_, coverage, seen) = scene.render(scene.parse(json.dumps(self.request(plane=plane.ravel().tolist()))))
            self.assertEqual(max(coverage), 0)
            return np.frombuffer(seen, np.uint8).reshape(48, 64)

        for picture in (seen(3), seen(0, -0.9), seen(2, 0.5)):  # frames are 1 mm apart
            self.assertTrue((picture[:, WIDTH // 2 + 2 :] == 255).all())
            self.assertFalse(picture[:, : WIDTH // 2 - 2].any())
        self.assertFalse(seen(0, -1.1).any())

    def test_a_slice_may_be_thick(self):
        for sigma in (0.0, 1.5):
            _, (image, *_) = self.scene.render(self.scene.parse(json.dumps(self.request(elevationSigma=sigma))))
            expected = bigus.reslice(bigus.read(FIELD), np.diag([0.4, 0.4, 1, 1]), size=(64, 48), ElevationSigma=sigma)
            np.testing.assert_allclose(np.frombuffer(image, np.uint8).reshape(48, 64), expected * 255, atol=0.51)

    def test_labels_are_told_where_they_are_asked_for(self):
        with tempfile.TemporaryDirectory() as folder:
            write_sweep(folder + "/sweep.igs.mha")
            write_labelled(folder + "/sweep.igs.mha", folder + "/labelled.vtp")
            scene = serve.read_scene(folder + "/labelled.vtp", None, lambda *_, **__: None)
            expected = bigus.label_map(bigus.read(folder + "/labelled.vtp"), poses()[1], size=(WIDTH, HEIGHT))
        request = self.request(plane=poses()[1].ravel().tolist())
        head, parts = scene.render(scene.parse(json.dumps({**request, "labels": True})))
        self.assertEqual((head["labels"], len(parts)), (True, 4))
        np.testing.assert_array_equal(np.frombuffer(parts[3], np.uint8).reshape(HEIGHT, WIDTH), expected)
        self.assertEqual(set(np.unique(expected)), {0, 1, 7})
        self.assertEqual([(one["value"], one["name"]) for one in scene.description()["labels"]], [(1, "left"), (7, "<b>right")])
        self.assertEqual(len(scene.render(scene.parse(json.dumps(request)))[1]), 3)
        for wrong in (1, "yes", None):
            with self.assertRaisesRegex(ValueError, "labels"):
                scene.parse(json.dumps({**request, "labels": wrong}))
        with self.assertRaisesRegex(ValueError, "labels"):  # of a field without any
            self.scene.parse(json.dumps({**request, "labels": True}))

    def test_the_standard_error_is_told_where_it_is_asked_for(self):
        with tempfile.TemporaryDirectory() as folder:
            write_sweep(folder + "/sweep.igs.mha")
            write_sure(folder + "/sweep.igs.mha", folder + "/sure.vtp")
            scene = serve.read_scene(folder + "/sure.vtp", None, lambda *_, **__: None)
            plane = poses()[2]
            plane[2, 0] = -0.04  # it leaves the frames
            expected = bigus.standard_error(bigus.read(folder + "/sure.vtp"), plane, size=(64, 48))
        request = self.request(plane=plane.ravel().tolist())
        head, parts = scene.render(scene.parse(json.dumps({**request, "standardError": True})))
        self.assertEqual((head["standardError"], head["labels"], head["turn"], len(parts)), (True, False, None, 4))
        told = np.frombuffer(parts[3], np.uint8).reshape(48, 64)
        known = np.isfinite(expected)
        self.assertTrue(100 < known.sum() < known.size - 100)
        np.testing.assert_array_equal(told == 255, ~known)
        self.assertLess(np.abs(told[known] / 510 - np.minimum(expected[known], 254 / 510)).max(), 0.51 / 510)
        self.assertTrue(scene.description()["standardError"])
        self.assertEqual(len(scene.render(scene.parse(json.dumps(request)))[1]), 3)
        for asked, wrong in ((scene, 1), (scene, None), (self.scene, True)):  # the last field keeps none
            with self.assertRaisesRegex(ValueError, "standardError"):
                asked.parse(json.dumps({**request, "standardError": wrong}))

    def test_how_far_a_plane_is_turned_from_recorded_frames(self):
        def tilted(degrees):
            c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
            turned = np.eye(4)
            turned[1:3, 1:3] = [[c, -s], [s, c]]  # about x
            return turned

        tilts = (0, 3, 6, 10, 14)
        with tempfile.TemporaryDirectory() as folder:
            frames = np.array([tilted(degrees) @ pose for degrees, pose in zip(tilts, poses())])
            pixels = np.random.default_rng(5).integers(0, 256, (FRAMES, HEIGHT, WIDTH), dtype=np.uint8)
            bigus.write(bigus.sweep(pixels, frames, np.arange(FRAMES) / 20.0), folder + "/s.igs.mha")
            write_sure(folder + "/s.igs.mha", folder + "/views.vtp", ViewDependence=True)
            scene = serve.read_scene(folder + "/views.vtp", None, lambda *_, **__: None)
        for plane, expected in ((tilted(4.2) @ poses()[2], 1.2), (tilted(12) @ poses()[0], 2), (tilted(-90) @ poses()[0], 90)):
            head, _ = scene.render(scene.parse(json.dumps(self.request(plane=plane.ravel().tolist()))))
            self.assertAlmostEqual(head["turn"], expected, places=2)

    def test_where_other_machines_find_the_page(self):
        self.assertEqual(serve.address_for_others("192.0.2.7"), "192.0.2.7")
        for anywhere in ("0.0.0.0", "::"):
            self.assertFalse(ipaddress.ip_address(serve.address_for_others(anywhere)).is_unspecified)

    def test_wrong_usage_and_bad_files(self):
        def run(*arguments):
            done = subprocess.run([sys.executable, "-m", "bigus.serve", *arguments], capture_output=True, text=True)
            self.assertNotIn("Traceback", done.stderr)
            return done.returncode

        self.assertEqual(run(), 1)
        self.assertEqual(run(FIELD, "--port", "70000"), 1)
        self.assertEqual(run("/nonexistent.vtp"), 2)
        self.assertEqual(run("--help"), 0)


@unittest.skipIf(aiohttp is None, "aiohttp is not installed")
class Serving(unittest.IsolatedAsyncioTestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.sweep = cls.folder.name + "/sweep.igs.mha"
        cls.pixels = write_sweep(cls.sweep)
        cls.server = Running(FIELD, cls.sweep, "--threads", "2")

    @classmethod
    def tearDownClass(cls):
        code, _, complaints = cls.server.end()
        cls.folder.cleanup()
        assert code == 0 and "Traceback" not in complaints, complaints

    async def asyncSetUp(self):
        self.session = aiohttp.ClientSession()

    async def asyncTearDown(self):
        await self.session.close()

    def connect(self, **more):
        return self.session.ws_connect(self.server.url + "slices", max_msg_size=0, **more)

    async def health(self):
        async with self.session.get(self.server.url + "health") as answer:
            return await answer.json()

    async def ask(self, client, **request):
        await client.send_str(json.dumps({"id": 1, **request}))
        message = await asyncio.wait_for(client.receive(), 60)
        return unpack(message.data) if message.type is aiohttp.WSMsgType.BINARY else json.loads(message.data)

    async def test_phases_and_health(self):
        self.assertEqual([one["phase"] for one in self.server.phases], ["reading", "reading", "ready"])
        health = await self.health()
        self.assertEqual((health["status"], health["frames"]), ("ok", FRAMES))
        self.assertGreater(health["gaussians"], 0)

    async def test_a_frame_and_a_moved_plane(self):
        async with self.connect() as client:
            head, image, _, recorded = await self.ask(client, frame=2)
            self.assertTrue(head["same"])
            np.testing.assert_array_equal(recorded, self.pixels[2])
            expected = bigus.reslice(bigus.read(FIELD), poses()[2], size=(WIDTH, HEIGHT))
            np.testing.assert_allclose(image, expected * 255, atol=0.51)
            truth = self.pixels[2] / 255.0
            mask = getattr(bigus.read(self.sweep), "mask", None)
            if mask is None:  # the build with VTK finds one, too; then only that there is a number can be told
                self.assertTrue(np.isfinite(head["psnr"]))
            else:
                squares = np.square(expected - truth)[np.asarray(mask) != 0]
                self.assertAlmostEqual(head["psnr"], -10 * np.log10(squares.mean()), places=3)
            moved = poses()[2]
            moved[2, 3] += 0.1
            head, _, _, recorded = await self.ask(client, plane=moved.ravel().tolist(), width=WIDTH, height=HEIGHT)
            self.assertEqual((head["frame"], head["same"], head["psnr"]), (2, False, None))
            self.assertAlmostEqual(head["distance"], 0.1)
            self.assertIsNone(recorded)  # the client has it

    async def test_no_file_is_served(self):
        for path in ("/etc/passwd", "/../../etc/passwd", "/serve.html", "/%2e%2e/%2e%2e/etc/passwd", "/" + FIELD):
            reader, writer = await asyncio.open_connection("127.0.0.1", int(self.server.url.split(":")[2].strip("/")))
            writer.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
            self.assertIn((await reader.read()).split()[1], (b"404", b"400"), path)
            writer.close()

    async def test_strangers_are_refused(self):
        for path in ("", "health", "scene", "points", "slices"):
            for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
                async with self.session.get(self.server.url + path, headers=headers) as answer:
                    self.assertEqual(answer.status, 403)
        with self.assertRaises(aiohttp.WSServerHandshakeError):
            await self.connect(headers={"Origin": "http://evil.example"})

    async def test_hostile_messages_hurt_nobody(self):
        async with self.connect() as good:
            for junk in ("", "{", "[" * 4000, "NaN", '{"id": 1e999}', json.dumps({"id": 1, "plane": [1e308] * 16})):
                async with self.connect() as bad:
                    await bad.send_str(junk)
                    self.assertIn("error", json.loads((await bad.receive()).data))
            async with self.connect() as bad:
                await bad.send_bytes(os.urandom(100))
                self.assertIn("error", json.loads((await bad.receive()).data))
            async with self.connect() as bad:  # too long
                await bad.send_str("x" * 100_000)
                self.assertEqual((await bad.receive()).type, aiohttp.WSMsgType.CLOSE)
                self.assertEqual(bad.close_code, 1009)
            async with self.connect() as bad:  # never sound
                for _ in range(serve.MOST_BAD_MESSAGES + 1):
                    await bad.send_str("x")
                while (message := await bad.receive()).type is aiohttp.WSMsgType.TEXT:
                    pass
                self.assertEqual(bad.close_code, 1008)
            async with self.connect() as bad:  # too many at once
                with self.assertRaises((ConnectionError, AssertionError)):
                    for k in range(4000):
                        await bad.send_str(json.dumps({"id": k, "frame": 0}))
                    while (message := await bad.receive()).type is aiohttp.WSMsgType.BINARY:
                        pass
                    self.assertNotEqual(bad.close_code, 1008)
            reader, writer = await asyncio.open_connection("127.0.0.1", int(self.server.url.split(":")[2].strip("/")))
            writer.write(os.urandom(1000) + b"\r\n\r\n")
            await reader.read(1000)
            writer.close()
            head, *_ = await self.ask(good, frame=1)
            self.assertEqual(head["frame"], 1)
        self.assertEqual((await self.health())["status"], "ok")

    async def test_only_the_newest_request_is_rendered(self):
        before = await self.health()
        async with self.connect() as client:
            size = {"width": 1024, "height": 1024}
            plane = (poses()[0] @ np.diag([0.03, 0.03, 1, 1])).ravel().tolist()
            for k in range(60):
                await client.send_str(json.dumps({"id": k, "plane": plane, **size}))
            last = -1
            while last < 59:
                last = unpack((await asyncio.wait_for(client.receive(), 60)).data)[0]["id"]
        after = await self.health()
        rendered, superseded = (after[name] - before[name] for name in ("rendered", "superseded"))
        self.assertGreater(superseded, 0)
        self.assertEqual(rendered + superseded, 60)

    def upgraded(self, port):
        """A connection to /slices that no library keeps in order."""
        client = socket.create_connection(("127.0.0.1", port))
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(f"GET /slices HTTP/1.1\r\nHost: localhost:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                       "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())  # fmt: skip
        return client

    def half_message(self, port):
        client = self.upgraded(port)
        client.sendall(b"\x81\xfe" + struct.pack(">H", 4000) + b"\0\0\0\0{")
        return client

    def deaf(self, port):
        """Asks for twenty large pictures and reads none."""
        client = self.upgraded(port)
        plane = (poses()[0] @ np.diag([0.03, 0.03, 1, 1])).ravel().tolist()
        for k in range(20):
            text = json.dumps({"id": k, "plane": plane, "width": 1024, "height": 1024}).encode()
            client.sendall(b"\x81\xfe" + struct.pack(">H", len(text)) + b"\0\0\0\0" + text)
        return client

    async def test_a_client_that_reads_nothing_keeps_nobody_waiting(self):
        port = int(self.server.url.split(":")[2].strip("/"))
        slow = self.deaf(port)
        await asyncio.sleep(1)
        begin = time.monotonic()
        async with self.connect() as client:
            for k in range(20):
                await self.ask(client, frame=k % FRAMES)
        self.assertLess(time.monotonic() - begin, serve.SEND_SECONDS / 2)
        slow.close()

    async def test_who_waits_for_each_picture_is_never_too_fast(self):
        patient, hasty = serve.Client(), serve.Client()
        for _ in range(3 * int(serve.MESSAGES_AT_ONCE)):
            self.assertTrue(patient.may_send())
            patient.was_answered()
        answers = [hasty.may_send() for _ in range(3 * int(serve.MESSAGES_AT_ONCE))]
        self.assertTrue(all(answers[: int(serve.MESSAGES_AT_ONCE)]))
        self.assertFalse(answers[-1])

    async def test_clients_take_turns(self):
        answers = [0, 0]

        async def hurry(client, number, until):
            while time.monotonic() < until:
                await self.ask(client, frame=number)
                answers[number] += 1

        async with self.connect() as one, self.connect() as other:
            until = time.monotonic() + 1.5
            await asyncio.gather(hurry(one, 0, until), hurry(other, 1, until))
        self.assertGreater(min(answers), max(answers) / 3, answers)

    async def test_no_more_clients_than_can_be_served(self):
        clients = [await self.connect() for _ in range(serve.MOST_CLIENTS - (await self.health())["clients"])]
        with self.assertRaises(aiohttp.WSServerHandshakeError) as refusal:
            await self.connect()
        self.assertEqual(refusal.exception.status, 503)
        for client in clients:
            await client.close()

    async def test_the_idle_give_their_places(self):
        with unittest.mock.patch.object(serve, "IDLE_SECONDS", 0.5):
            scene = serve.read_scene(FIELD, None, lambda *_, **__: None)
            async with aiohttp.test_utils.TestServer(serve.Server(scene).application()) as server:
                address = f"http://127.0.0.1:{server.port}/slices"
                held = [self.half_message(server.port) for _ in range(serve.MOST_CLIENTS - 1)]
                plane = np.diag([0.4, 0.4, 1, 1]).ravel().tolist()
                async with self.session.ws_connect(address, max_msg_size=0) as busy:
                    until = time.monotonic() + 1
                    while time.monotonic() < until:
                        await self.ask(busy, plane=plane, width=8, height=8)
                        for one in held:
                            one.sendall(b" ")  # of a message that never ends
                    async with self.session.ws_connect(address, max_msg_size=0) as client:
                        for one in (client, busy):
                            self.assertEqual((await self.ask(one, plane=plane, width=8, height=8))[0]["id"], 1)
                for one in held:
                    one.close()

    async def test_it_ends_though_clients_neither_read_nor_finish(self):
        server = await asyncio.to_thread(Running, FIELD)
        port = int(server.url.split(":")[2].strip("/"))
        half = socket.create_connection(("127.0.0.1", port))
        half.sendall(f"POST /scene HTTP/1.1\r\nHost: localhost:{port}\r\nContent-Length: 100\r\n\r\nhalf".encode())
        held = [self.half_message(port), self.deaf(port), half]
        await asyncio.sleep(0.5)
        begin = time.monotonic()
        code, _, complaints = await asyncio.to_thread(server.end)
        self.assertEqual((code, complaints), (0, ""))
        self.assertLess(time.monotonic() - begin, 3 * serve.ENDING_SECONDS)
        for one in held:
            one.close()

    async def test_a_token_is_asked_for_elsewhere(self):
        server = await asyncio.to_thread(Running, FIELD, "--host", "0.0.0.0")
        try:
            address, token = server.url.split("?token=")
            self.assertNotIn("0.0.0.0", address)  # but one of this machine, which is asked below
            self.assertGreaterEqual(len(token), 40)
            for query, headers, status in (
                ("", {}, 401), ("?token=", {}, 401), ("?token=" + token[:-1], {}, 401), ("?token=" + token, {}, 200),
                ("", {"Authorization": "Bearer " + token}, 200), ("", {"Authorization": "Bearer x"}, 401),
            ):  # fmt: skip
                for path in ("", "health", "scene", "points"):
                    async with self.session.get(address + path + query, headers=headers) as answer:
                        self.assertEqual(answer.status, status, (path, query))
            async with self.session.ws_connect(address + "slices?token=" + token, max_msg_size=0) as client:
                plane = np.diag([0.4, 0.4, 1, 1]).ravel().tolist()
                self.assertEqual((await self.ask(client, plane=plane, width=8, height=8))[0]["id"], 1)
            with self.assertRaises(aiohttp.WSServerHandshakeError):
                await self.session.ws_connect(address + "slices")
        finally:
            server.end()

    async def test_signals_end_it_while_clients_are_connected(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            server = await asyncio.to_thread(Running, FIELD)
            async with self.session.ws_connect(server.url + "slices", max_msg_size=0) as client:
                ending = asyncio.ensure_future(asyncio.to_thread(server.end, number))
                last = await asyncio.wait_for(client.receive(), 60)
                self.assertEqual((last.type, last.data), (aiohttp.WSMsgType.CLOSE, 1001))
                await client.close()
                code, told, complaints = await ending
            self.assertEqual((code, json.loads(told)["phase"], complaints), (0, "ending", ""))

    async def test_a_port_that_is_taken(self):
        port = self.server.url.split(":")[2].strip("/")
        command = [sys.executable, "-m", "bigus.serve", FIELD, "--port", port]
        done = await asyncio.to_thread(subprocess.run, command, capture_output=True, text=True)
        self.assertEqual(done.returncode, 3)
        self.assertIn("cannot listen", done.stderr)


@unittest.skipUnless("BIGUS_PROGRAM_BESIDE" in os.environ, "the program was not built with this package")
class Program(unittest.TestCase):
    """bigus serve hands over to Python."""

    def run_program(self, python, *arguments):
        with tempfile.TemporaryDirectory() as folder:  # with a module that must not run
            Path(folder, "json.py").write_text("raise SystemExit(99)")
            environment = {**os.environ, "BIGUS_PYTHON": python, "PYTHONPATH": folder}
            command = [os.environ["BIGUS_PROGRAM_BESIDE"], "serve", *arguments]
            process = subprocess.Popen(command, cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                                       stderr=subprocess.PIPE)  # fmt: skip
            for line in process.stdout:
                if '"ready"' in line:
                    process.send_signal(signal.SIGINT)
            complaints = process.stderr.read()
            process.stdout.close()
            process.stderr.close()
            return process.wait(60), complaints

    def test_it_serves_or_says_what_is_missing(self):
        code, complaints = self.run_program(sys.executable, FIELD, "--port", "0", "--json", "--threads", "2")
        if aiohttp is None:
            self.assertEqual(code, 2)
            self.assertIn("pip install", complaints)
        else:
            self.assertEqual((code, complaints), (0, ""))

    def test_a_python_that_is_not_there(self):
        code, complaints = self.run_program("/nonexistent/python", FIELD)
        self.assertEqual(code, 2)
        self.assertIn("BIGUS_PYTHON", complaints)

    def test_wrong_usage(self):
        self.assertEqual(self.run_program(sys.executable, FIELD, "--port", "70000")[0], 1)
        self.assertEqual(self.run_program(sys.executable, "/nonexistent.vtp")[0], 2)


@unittest.skipIf(aiohttp is None or chromium.program() is None, "aiohttp or Chromium is not installed")
class Page(unittest.IsolatedAsyncioTestCase):
    @contextlib.asynccontextmanager
    async def page(self, width, height, phone=False, labels=False, sure=False):
        field, sweep = os.environ.get("BIGUS_SERVE_FIELD"), os.environ.get("BIGUS_SERVE_SWEEP")
        with tempfile.TemporaryDirectory() as folder:
            if field is None or sweep is None:
                field, sweep = FIELD, folder + "/sweep.igs.mha"
                write_sweep(sweep)
                if labels:
                    field = folder + "/labelled.vtp"
                    write_labelled(sweep, field)
                if sure:
                    field = folder + "/sure.vtp"
                    write_sure(sweep, field)
            server = await asyncio.to_thread(Running, field, sweep, "--threads", "2", "--token")
            try:
                async with chromium.Browser() as browser:
                    await browser.screen(width, height, phone)
                    await browser.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=folder)
                    browser.url, browser.folder = server.url, Path(folder)
                    await self.load(browser)
                    yield browser
                    if "BIGUS_SERVE_PICTURE" in os.environ:
                        await browser.picture(os.environ["BIGUS_SERVE_PICTURE"])
                    self.assertEqual(browser.problems, [])
                    self.assertEqual(await browser.evaluate("bigus.errors"), [])
            finally:
                code, _, complaints = await asyncio.to_thread(server.end)
            self.assertEqual((code, complaints), (0, ""))

    SETTLED = "bigus.updates > 0 && !bigus.state().wanted && bigus.state().answered === bigus.state().asked"

    async def load(self, browser):
        await browser.call("Page.navigate", url=browser.url)
        await browser.until("window.bigus && " + self.SETTLED)

    async def moved(self, browser):
        await browser.until(self.SETTLED)
        return (await browser.evaluate("bigus.state()"))["moved"]

    async def bytes_of(self, browser, name, of_them, after=""):
        # Of a copy, because the browser warns where the page's own canvas is read often.
        return await browser.evaluate(after + "(((c) => { const t = new OffscreenCanvas(c.width, c.height).getContext('2d', "
                                      "{ willReadFrequently: true }); t.drawImage(c, 0, 0); "
                                      "return t.getImageData(0, 0, c.width, c.height).data; })"
                                      f"(document.getElementById('{name}')).{of_them})")  # fmt: skip

    async def text(self, browser, name):
        return await browser.evaluate(f"document.getElementById('{name}').textContent")

    async def box(self, browser, name):
        box = await browser.evaluate(f"document.getElementById('{name}').getBoundingClientRect().toJSON()")
        return box["x"], box["y"], box["width"], box["height"]

    async def test_on_a_phone(self):
        async with self.page(390, 844, True) as browser:
            self.assertLessEqual(await browser.evaluate("document.documentElement.scrollWidth"), 390)
            for name in ("slice", "recorded", "difference", "overview", "coverage"):
                x, _, width, height = await self.box(browser, name)
                self.assertGreater(width, 350, name)  # one column
                self.assertGreater(height, 200, name)
            for name in ("frame", "x", "z", "tilt", "zoom", "window"):
                _, _, width, height = await self.box(browser, name)
                self.assertGreater(width, 150, name)
                self.assertGreaterEqual(height, 24, name)  # a finger's
            self.assertIn("two, both up or down", await browser.evaluate("document.body.innerText"))
            await self.fingers_on_slice(browser)
            await self.fingers_on_overview(browser)
            await browser.screen(844, 390, True)
            self.assertLessEqual(await browser.evaluate("document.documentElement.scrollWidth"), 844)
            self.assertGreater((await self.box(browser, "slice"))[3], 300)
            self.assertGreater((await self.box(browser, "frame"))[2], 100)

    async def fingers_on_slice(self, browser):
        x, y, width, height = await self.box(browser, "slice")
        x, y = x + width / 2, y + height / 2

        async def moved_by(*ways):
            before = await self.moved(browser)
            await browser.fingers(*ways)
            after = await self.moved(browser)
            return {name: after[name] - before[name] for name in after if abs(after[name] - before[name]) > 1e-9}

        perMm = await browser.evaluate("placeOnScreen().scale / pixelSize(plane())[0]")
        by = await moved_by(line(x, y, 40, 20))
        self.assertEqual(set(by), {"x", "y"})
        self.assertAlmostEqual(by["x"], -40 / perMm, delta=0.5)  # the picture follows the finger
        self.assertAlmostEqual(by["y"], -20 / perMm, delta=0.5)
        by = await moved_by(line(x - 60, y + 40, 0, -80), line(x + 60, y + 40, 0, -80))
        self.assertEqual(set(by), {"z"})
        self.assertGreater(by["z"], 5)
        by = await moved_by(line(x - 40, y, -40, 0), line(x + 40, y, 40, 0))
        self.assertEqual(set(by), {"zoom"})
        self.assertAlmostEqual(by["zoom"], 1, delta=0.4)  # twice as far apart, less what decided it
        twist = [(60 * np.cos(a), 60 * np.sin(a)) for a in np.linspace(0, np.pi / 6, 9)]
        by = await moved_by([(x + dx, y + dy) for dx, dy in twist], [(x - dx, y - dy) for dx, dy in twist])
        self.assertEqual(set(by), {"spin"})
        self.assertAlmostEqual(by["spin"], -30, delta=15)
        by = await moved_by(*(line(x + dx, y, 40, -20) for dx in (-60, 0, 60)))
        self.assertEqual(set(by), {"turn", "tilt"})
        self.assertGreater(min(by.values()), 0)

        await browser.evaluate("document.getElementById('tool').value = 'length'")
        perMm = await browser.evaluate("placeOnScreen().scale / pixelSize(plane())[0]")  # that of a zoomed plane
        self.assertEqual(await moved_by(line(x - 40, y, 80, 0)), {})
        self.assertAlmostEqual(float((await browser.evaluate("sizeOf(measures[0])")).split()[0]), 80 / perMm, delta=0.06)

    async def fingers_on_overview(self, browser):
        await browser.evaluate("document.getElementById('overview').scrollIntoView()")
        x, y, width, height = await self.box(browser, "overview")
        x, y = x + width / 2, y + height / 2
        before = await browser.evaluate("camera")
        await browser.fingers(line(x, y, 40, 0))
        self.assertNotEqual((await browser.evaluate("camera"))["axes"], before["axes"])
        await browser.fingers(line(x - 20, y, -20, 0), line(x + 20, y, 20, 0))
        self.assertAlmostEqual((await browser.evaluate("camera"))["zoom"], 2 * before["zoom"], delta=0.2)

    async def test_on_a_desk(self):
        async with self.page(1440, 900) as browser:
            place = await browser.evaluate("placeOnScreen()")
            self.assertGreater(place["scale"] ** 2 * WIDTH * HEIGHT, 0.25 * 1440 * 900)  # the slice fills the window
            await self.keys(browser)
            await self.measures(browser, place)
            await self.files(browser)
            await self.kept_planes(browser)
            await self.screen(browser)

    async def keys(self, browser):
        for key, modifiers, name, by in (
            ("ArrowUp", 0, "z", 0.5), ("ArrowDown", 0, "z", -0.5), ("ArrowUp", 8, "tilt", 1), ("ArrowRight", 8, "turn", 1),
            ("ArrowRight", 2, "x", 1), ("ArrowDown", 2, "y", 1), (",", 0, "spin", -1), ("+", 0, "zoom", 0.1),
        ):  # fmt: skip
            await browser.key("b")
            await browser.key(key, modifiers)
            self.assertEqual({k: v for k, v in (await self.moved(browser)).items() if abs(v) > 1e-9}, {name: by}, key)
        # The number at the slider is that of the recorded frame, which is the nearest.
        await browser.key("b")
        await browser.evaluate("(() => { moved.z = 1.2; changed(); })()")
        await self.moved(browser)
        nearest = FRAMES // 2 + 1
        self.assertEqual(await browser.evaluate("document.getElementById('frame').nextSibling.textContent"), str(nearest))
        self.assertEqual(await self.text(browser, "recordedText"), f"frame {nearest}, the nearest, 0.2 mm away")
        await browser.key("ArrowRight")
        self.assertEqual((await browser.evaluate("bigus.state()"))["frame"], FRAMES // 2 + 2)

    async def measures(self, browser, place):
        x, y, *_ = await self.box(browser, "slice")

        async def draw(tool, *pixels):
            await browser.evaluate(f"document.getElementById('tool').value = '{tool}'")
            at = [(x + place["left"] + (i + 0.5) * place["scale"], y + place["top"] + (j + 0.5) * place["scale"]) for i, j in pixels]
            await browser.mouse("mousePressed", *at[0], True)
            for one in at[1:]:
                await browser.mouse("mouseMoved", *one, True)
            await browser.mouse("mouseReleased", *at[-1])
            return float((await browser.evaluate("sizeOf(measures[measures.length - 1])")).split()[0])

        await self.moved(browser)
        plane = await browser.evaluate("plane()")
        self.assertAlmostEqual(await draw("length", (10, 10), (20, 15), (40, 30)), np.hypot(30, 20) * 0.4, delta=0.11)
        self.assertAlmostEqual(await draw("area", (10, 10), (40, 10), (40, 30), (10, 30)), 30 * 20 * 0.16, delta=1)
        self.assertEqual(await browser.evaluate("plane()"), plane)
        await browser.evaluate("document.getElementById('tool').value = 'move'")
        self.assertEqual(await browser.evaluate("shares([3, 4, 0], [1, 0, 0], [1, 1, 0])"), [-1, 4])  # a sheared image
        # Depth counts from the upper edge of the frame, of whose rows 0.4 mm each the plane shows others.
        self.assertAlmostEqual(await browser.evaluate("view().top"), 0)
        await browser.evaluate("(() => { moved.y = 3; moved.zoom = 1; changed(); })()")
        self.assertAlmostEqual(await browser.evaluate("view().top"), 3 + HEIGHT * 0.4 / 4)
        await browser.evaluate("(() => { moved.spin = 10; changed(); })()")
        self.assertIsNone(await browser.evaluate("view().top"))
        await browser.evaluate("(() => { moved.z = 900; changed(); })()")
        await self.moved(browser)
        self.assertEqual(await self.text(browser, "sliceText"), "misses the field")

    async def files(self, browser):
        for button, name in (("savePose", "bigus-plane.csv"), ("savePicture", "bigus-slice.png")):
            await browser.evaluate(f"document.getElementById('{button}').click()")
            for _ in range(200):
                if (browser.folder / name).exists():
                    break
                await asyncio.sleep(0.05)
        planes = bigus.read_planes(str(browser.folder / "bigus-plane.csv"))
        np.testing.assert_array_equal(np.ravel(planes.poses), await browser.evaluate("plane()"))
        np.testing.assert_array_equal(np.ravel(planes.sizes), (WIDTH, HEIGHT))
        png = (browser.folder / "bigus-slice.png").read_bytes()
        self.assertEqual((png[:4], struct.unpack(">II", png[16:24])), (b"\x89PNG", (WIDTH, HEIGHT)))
        if "BIGUS_PROGRAM_BESIDE" in os.environ:
            command = [os.environ["BIGUS_PROGRAM_BESIDE"], "slice", FIELD, "--poses", str(browser.folder / "bigus-plane.csv"), "-o",
                       str(browser.folder / "slice.png")]  # fmt: skip
            await asyncio.to_thread(subprocess.run, command, check=True, capture_output=True)

    async def kept_planes(self, browser):
        await browser.evaluate("(() => { const n = document.getElementById('planeName'); n.value = '<b>vein'; keep.click(); })()")
        plane = await browser.evaluate("plane()")
        await self.load(browser)
        self.assertNotEqual(await browser.evaluate("plane()"), plane)
        await browser.evaluate("[...planes.querySelectorAll('button')].find((one) => one.textContent === '<b>vein').click()")
        await self.moved(browser)
        self.assertEqual(await browser.evaluate("plane()"), plane)
        await browser.evaluate("planes.querySelectorAll('button')[1].click()")
        self.assertEqual(await self.text(browser, "planes"), "")
        await browser.evaluate("localStorage.setItem(shelf(), JSON.stringify([null, { name: 'x', base: [1], frame: 0 }]))")
        await self.load(browser)
        self.assertEqual(await self.text(browser, "planes"), "")

    async def screen(self, browser):
        async def values():
            await self.moved(browser)
            return set(await self.bytes_of(browser, "slice", "filter((_, k) => k % 4 === 0)", "Array.from"))

        await browser.evaluate("greyOver.click()")
        self.assertGreater(len(await values()), 2)
        await browser.evaluate("(() => { const w = document.getElementById('window'); w.value = 1; w.oninput(); })()")
        self.assertLessEqual(await values(), {0, 255})
        await browser.evaluate("(() => { level.value = 255; level.oninput(); })()")
        self.assertEqual(await values(), {0})

    async def test_labels_are_outlined_and_named(self):
        """On a desk and on a phone, and not where they are switched off."""
        for width, height, phone in ((1440, 900, False), (390, 844, True)):
            async with self.page(width, height, phone, labels=True) as browser:
                self.assertLessEqual(await browser.evaluate("document.documentElement.scrollWidth"), width)
                self.assertEqual(await browser.evaluate("last.outlines.map((one) => one.name)"), ["left", "<b>right"])
                place, ratio = await browser.evaluate("placeOnScreen()"), await browser.evaluate("window.devicePixelRatio")
                colour = (await browser.evaluate("last.outlines[0].color.map((part) => Math.round(part * 255))"))

                async def outline():  # on the row of pixels in the middle, where the marks have the left label's colour
                    row = round((place["top"] + HEIGHT / 2 * place["scale"]) * ratio)
                    wide = 4 * await browser.evaluate("document.getElementById('marks').width")
                    pixels = await self.bytes_of(browser, "marks", f"slice({row * wide}, {(row + 1) * wide})", "Array.from")
                    pixels = np.array(pixels).reshape(-1, 4)
                    found = np.flatnonzero((np.abs(pixels[:, :3] - colour).max(axis=1) < 40) & (pixels[:, 3] > 100))
                    return (found / ratio - place["left"]) / place["scale"]

                # The borders lie before pixels 6 and 26, but where carriers are as wide as that.
                at = await outline()
                for border in (6, 26):
                    self.assertLess(np.abs(at - border).min(), 2, at)
                await browser.evaluate("document.getElementById('labels').click()")
                await self.moved(browser)
                self.assertEqual(await browser.evaluate("last.outlines"), [])
                self.assertEqual(len(await outline()), 0)
                await browser.evaluate("document.getElementById('labels').click()")
                await self.moved(browser)
                if "BIGUS_SERVE_PICTURE" in os.environ:
                    await browser.picture(f"{os.environ['BIGUS_SERVE_PICTURE']}.labels-{width}.png")
        async with self.page(1440, 900) as browser:
            self.assertTrue(await browser.evaluate("document.getElementById('labelBox').hidden"))

    async def test_doubtful_pixels_are_amber_and_the_mouse_tells_numbers(self):
        for width, height, phone in ((1440, 900, False), (390, 844, True)):
            async with self.page(width, height, phone, sure=True) as browser:
                self.assertLessEqual(await browser.evaluate("document.documentElement.scrollWidth"), width)
                self.assertEqual(await browser.evaluate("[doubtBox.hidden, doubt.checked, last.errors]"), [False, False, None])
                x, y, *_ = await self.box(browser, "slice")
                place = await browser.evaluate("placeOnScreen()")

                async def told(i, j):
                    at = x + place["left"] + (i + 0.5) * place["scale"], y + place["top"] + (j + 0.5) * place["scale"]
                    if phone:
                        await browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[{"x": at[0], "y": at[1]}])
                    else:
                        await browser.mouse("mouseMoved", *at)
                    text = await browser.evaluate("hereText(placeOnScreen())")
                    if phone:
                        await browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
                    return text

                frame = await browser.evaluate("bigus.state().frame")
                field = bigus.read(str(browser.folder / "sure.vtp"))
                image, sigma = (f(field, poses()[frame], size=(WIDTH, HEIGHT)) for f in (bigus.reslice, bigus.standard_error))
                self.assertAlmostEqual(float(await told(20, 30)), image[30, 20], delta=0.0026)  # told in 255 steps
                await browser.evaluate("doubt.click()")
                await self.moved(browser)
                number, error = (await told(20, 30)).split(" ± ")
                self.assertAlmostEqual(float(number), image[30, 20], delta=0.0026)
                self.assertAlmostEqual(float(error), sigma[30, 20], delta=0.0016)
                await browser.evaluate("(() => { greyOver.checked = false; draw(); })()")
                pixels = np.array(await self.bytes_of(browser, "slice", "slice(0)", "Array.from")).reshape(HEIGHT, WIDTH, 4)
                amber, clear = pixels[..., 0] > pixels[..., 2], np.abs(sigma - 0.1) > 0.0011  # but for rounding
                np.testing.assert_array_equal(amber[clear], ~(sigma <= 0.1)[clear])
                self.assertTrue(0 < amber.sum())
                await browser.evaluate("(() => { moved.z = 3; changed(); })()")  # behind the last frame
                await self.moved(browser)
                self.assertIn(", not known", await told(20, 30))
                if "BIGUS_SERVE_PICTURE" in os.environ:
                    await browser.evaluate("(() => { moved.z = 0.4; moved.turn = 20; greyOver.checked = true; changed(); })()")
                    await self.moved(browser)
                    await told(20, 30) if not phone else None
                    await browser.picture(f"{os.environ['BIGUS_SERVE_PICTURE']}.sure-{width}.png")
        async with self.page(1440, 900) as browser:
            self.assertTrue(await browser.evaluate("doubtBox.hidden"))

    async def test_a_drag_moves_the_slice(self):
        async with self.page(1400, 900) as browser:
            await self.use(browser)

    async def use(self, browser):
        async def pictures():
            await browser.until(self.SETTLED)
            names = ("slice", "overview", "difference")
            return {name: await self.bytes_of(browser, name, "reduce((sum, byte) => (sum * 31 + byte) % 4294967291, 0)") for name in names}

        first = await pictures()
        box = await browser.evaluate("document.getElementById('slice').getBoundingClientRect().toJSON()")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

        async def drag(modifiers):
            await browser.mouse("mousePressed", x, y, True, modifiers=modifiers)
            for k in range(1, 6):
                await browser.mouse("mouseMoved", x + 6 * k, y + 3 * k, True, modifiers=modifiers)
            await browser.mouse("mouseReleased", x + 30, y + 15, True, modifiers=modifiers)
            return await pictures()

        moved = await drag(0)
        self.assertTrue(all(moved[name] != first[name] for name in first), (first, moved))
        state = (await browser.evaluate("bigus.state()"))["moved"]
        self.assertLess(state["x"], 0)
        self.assertAlmostEqual(state["x"], 2 * state["y"], delta=0.05 * abs(state["x"]))
        turned = await drag(8)  # Shift
        self.assertNotEqual(turned["slice"], moved["slice"])
        self.assertNotEqual((await browser.evaluate("bigus.state()"))["moved"]["turn"], 0)
        await browser.evaluate("document.getElementById('back').click()")
        self.assertEqual(await pictures(), first)
        await browser.evaluate("(() => { const f = document.getElementById('frame'); f.value = 0; f.oninput(); })()")
        self.assertNotEqual((await pictures())["slice"], first["slice"])

        # As fast as it goes: 512 x 512 pixels, the plane pushed on with every picture.
        speed = await browser.evaluate("""(async () => {
          scene.width = scene.height = 512;
          const begin = performance.now(), count = bigus.updates;
          bigus.latencies.length = 0;
          let k = 0;
          while (performance.now() - begin < 3000) { moved.z = 0.01 * ++k; changed(); await new Promise(requestAnimationFrame); }
          const seconds = (performance.now() - begin) / 1000, sorted = [...bigus.latencies].sort((a, b) => a - b);
          return { perSecond: (bigus.updates - count) / seconds, median: sorted[sorted.length >> 1],
                   q95: sorted[Math.floor(sorted.length * 0.95)], gaussians: scene.gaussians };
        })()""")
        print(f"\n{speed['gaussians']} Gaussians, 512 x 512 pixels, two threads: {speed['perSecond']:.1f} updates a second; "
              f"from a move to its picture {speed['median']:.0f} ms (95 %: {speed['q95']:.0f} ms)")  # fmt: skip
        self.assertGreater(speed["perSecond"], 0)  # how fast it is depends on who else works here


if __name__ == "__main__":
    FIELD = os.path.abspath(sys.argv.pop(1))
    sys.path.insert(0, str(Path(__file__).parent))
    unittest.main()
