# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The page in the browser of a field that grows: `bigus live` follows a sender that is written here, and bigus.serve asks it.

    test_serve_live.py BIGUS

Runs with the package of the build with VTK and with the wheel's. What needs aiohttp or Chromium is skipped without them.
BIGUS_CHROMIUM names a browser, BIGUS_SERVE_PICTURE a file for a picture of the page.
"""

import asyncio
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import bigus
import chromium
from bigus import serve
from test_serve import Running, unpack

try:
    import aiohttp
except ImportError:
    aiohttp = None

BIGUS = ""
WIDTH, HEIGHT, FRAMES = 96, 80, 32


def message(kind, device, body, seconds=0.0):
    """Of OpenIGTLink, without a checksum."""
    return struct.pack(">H12s20sQQQ", 1, kind, device, int(seconds * 2**32), len(body), 0) + body


def image(pixels, pose, seconds):
    middle = pose.copy()
    middle[:3, 3] += pose[:3, 0] * (WIDTH - 1) / 2 + pose[:3, 1] * (HEIGHT - 1) / 2
    size = (WIDTH, HEIGHT, 1)
    body = struct.pack(">HBBBB3H12f6H", 1, 1, 3, 2, 1, *size, *middle[:3].T.ravel(), 0, 0, 0, *size) + pixels.tobytes()
    return message(b"IMAGE", b"Image", body, seconds)


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


class Live:
    """`bigus live`, connected to a sender that sends when it is told to."""

    def __init__(self, folder, port=None, finish=3):
        sender = socket.create_server(("127.0.0.1", 0))
        self.port, self.field = port or free_port(), str(Path(folder, "live.vtp"))
        self.process = subprocess.Popen(
            [BIGUS, "live", f"igtl://127.0.0.1:{sender.getsockname()[1]}", "-o", self.field, "--listen", str(self.port),
             "--finish", str(finish), "--pause", "60", "--reconnect", "0", "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)  # fmt: skip
        self.connection, _ = sender.accept()
        sender.close()
        self.address = f"igtl://127.0.0.1:{self.port}"
        while True:
            try:
                return socket.create_connection(("127.0.0.1", self.port)).close()
            except OSError:
                time.sleep(0.05)

    def send(self, pixels, poses, frames):
        for k in frames:
            self.connection.sendall(image(pixels[k], poses[k], 100 + k / 30))
            time.sleep(1 / 30)

    def lift(self):
        """The sender goes away. Gives what the program says at its end."""
        self.connection.close()
        told, complaints = self.process.communicate(timeout=120)
        assert self.process.returncode == 0, complaints
        return json.loads(told)

    def kill(self):
        self.connection.close()
        self.process.kill()
        self.process.communicate()


class WithLive(unittest.IsolatedAsyncioTestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.sweep = cls.folder.name + "/sweep.igs.mha"
        subprocess.run([BIGUS, "phantom", "-o", cls.sweep, "--frames", str(FRAMES), "--width", str(WIDTH), "--height",
                        str(HEIGHT), "--pixel-size", "0.4", "--frame-spacing", "0.4"], check=True, capture_output=True)
        read = bigus.read(cls.sweep)
        cls.pixels, cls.poses = np.asarray(bigus.frames(read)), np.array(bigus.poses(read), dtype=float)

    def start(self, finish=3):
        live = Live(self.folder.name, finish=finish)
        self.addCleanup(live.kill)
        return live

    def field(self, live, tell=lambda *_, **__: None):
        return serve.FieldOfLive(live.address, tell)

    def send(self, live, frames):
        live.send(self.pixels, self.poses, frames)


class Questions(WithLive):
    """What the page's server asks the program; needs no aiohttp."""

    def test_slices_coverage_and_state(self):
        live = self.start()
        field = self.field(live)
        self.assertEqual((field.state["phase"], field.state["frames"], field.state["probe"]), ("following", 0, None))
        nothing = field.render(self.poses[8], WIDTH, HEIGHT)
        self.assertEqual((nothing.image.shape, nothing.image.max(), nothing.coverage.max()), ((HEIGHT, WIDTH), 0, 0))
        self.send(live, range(FRAMES))
        time.sleep(1)
        shown = field.render(self.poses[20], WIDTH, HEIGHT)
        np.testing.assert_allclose(np.array(field.state["probe"]["plane"]).reshape(4, 4)[:, [0, 1, 3]],
                                   self.poses[-1][:, [0, 1, 3]], atol=2)
        likeness = [np.corrcoef(shown.image.ravel(), frame.ravel())[0, 1] for frame in self.pixels]
        self.assertLessEqual(abs(int(np.argmax(likeness)) - 20), 1, likeness)
        away = self.poses[20].copy()
        away[:3, 3] += 500
        self.assertEqual(field.render(away, 8, 8).coverage.max(), 0)
        field.refresh()
        self.assertEqual(field.state["frames"], FRAMES)
        self.assertEqual(len(field.centers), min(field.gaussians, serve.MOST_POINTS))
        # Coverage against its definition: Gaussians' integrals over planes, summed over space, are their volumes.
        scene = serve.Scene(field, None)
        self.assertGreater(shown.coverage.mean(), 0.2 * scene.mean_coverage)
        self.assertLess(shown.coverage.mean(), 20 * scene.mean_coverage)

    def test_the_recorded_frames_beside_it(self):
        live = self.start()
        scene = serve.read_scene(live.address, self.sweep, lambda *_, **__: None)
        self.send(live, range(FRAMES))
        scores = []
        for _ in range(2):
            head, (image, *_) = scene.render(scene.parse('{"id": 1, "frame": 20}'))
            self.assertEqual((head["frame"], head["same"], len(image)), (20, True, WIDTH * HEIGHT))
            scores.append(head["psnr"])
            time.sleep(2)
        self.assertGreater(scores[1], 15)  # 10 where nothing is shown
        self.assertEqual(head["live"]["frames"], FRAMES)

    def test_bad_questions_are_answered_or_dropped(self):
        live = self.start()
        good = self.field(live)

        def ask(text):
            with socket.create_connection(("127.0.0.1", live.port), timeout=30) as connection:
                connection.sendall(message(b"STRING", b"BigusView", struct.pack(">HH", 3, len(text)) + text))
                with connection.makefile("rb") as stream:
                    header = stream.read(58)
                    return json.loads(stream.read(struct.unpack(">42xQ8x", header)[0])[4:]) if header else None

        plane = json.dumps({"plane": np.eye(4).ravel().tolist(), "width": 8, "height": 8})
        for text in ("", "{", "[]", "7", "[" * 3000, '{"points": 0}', '{"points": 1e9}', '{"points": "9"}', '{"plane": [1]}',
                     plane.replace('"width": 8', '"width": 4097'), plane.replace("8", "4096"), plane.replace("1.0", '"1"'),
                     plane.replace("1.0", "0.0"), plane.replace("1.0", "1e999"), plane.replace("1.0", "1e300"), "\xff"):
            with self.subTest(text=text[:60]):
                self.assertIn("error", ask(text.encode("latin-1")))
        self.assertEqual(ask(b"{}")["phase"], "following")
        for junk in (message(b"STRING", b"BigusView", b"\0\3\0\x09{}"), message(b"STRING", b"BigusView", b"x" * 5000),
                     message(b"STRING", b"BigusView", b""), os.urandom(200)):
            with socket.create_connection(("127.0.0.1", live.port), timeout=30) as connection:
                connection.sendall(junk)
                try:
                    self.assertEqual(connection.recv(1), b"")  # dropped
                except ConnectionResetError:
                    pass
        good.look()
        self.assertIsNone(live.process.poll())

    def test_a_program_that_ends_and_one_that_begins(self):
        told = []
        live = self.start()
        field = self.field(live, lambda phase, **_: told.append(phase))
        self.send(live, range(12))
        live.lift()
        with self.assertRaisesRegex(serve.Away, "no live field answers"):
            field.look()
        with self.assertRaises(serve.Away):
            field.look()
        self.assertEqual((field.state["phase"], told), ("away", ["waiting"]))
        again = Live(self.folder.name, live.port)
        self.addCleanup(again.kill)
        field.look()
        self.assertEqual((field.state["phase"], told), ("following", ["waiting", "following"]))

    def test_slices_come_while_the_field_is_finished(self):
        live = self.start()
        field = self.field(live)
        self.send(live, range(FRAMES))
        result = []
        thread = threading.Thread(target=lambda: result.append(live.lift()))
        thread.start()
        fractions = []
        try:
            while True:
                field.render(self.poses[8], WIDTH, HEIGHT)
                if field.state["phase"] == "finishing":
                    fractions.append(field.state["fraction"])
        except serve.Away:
            pass
        thread.join()
        self.assertEqual(result[0]["frames"], FRAMES)
        self.assertGreater(len(fractions), 5)
        self.assertEqual(fractions, sorted(fractions))
        self.assertGreater(fractions[-1], 0.5)

    def test_an_interrupt_while_the_field_is_finished(self):
        live = self.start(finish=600)
        field = self.field(live)
        self.send(live, range(FRAMES))
        live.connection.close()
        while field.state["phase"] != "finishing":
            field.render(self.poses[8], WIDTH, HEIGHT)
        begin = time.monotonic()
        live.process.send_signal(signal.SIGINT)
        told, _ = live.process.communicate(timeout=120)
        self.assertLess(time.monotonic() - begin, 60)
        self.assertEqual((live.process.returncode, json.loads(told)["frames"]), (130, FRAMES))
        self.assertGreater(len(np.asarray(bigus.reslice(bigus.read(live.field), self.poses[8], size=(8, 8)))), 0)

    def test_what_is_no_live_field(self):
        for address, says in ((f"igtl://127.0.0.1:{free_port()}", "--listen"), ("igtl://127.0.0.1:99999", "igtl://HOST:PORT"),
                              ("igtl://127.0.0.1:x", "igtl://HOST:PORT")):
            with self.subTest(address), self.assertRaisesRegex(ValueError, says):
                serve.read_scene(address, None, lambda *_, **__: None)
        liar = socket.create_server(("127.0.0.1", 0))
        answers = [b"HTTP/1.1 400\r\n" * 20, b"\0", message(b"STRING", b"BigusView", b"\0\3\0\2[]"),
                   message(b"STRING", b"BigusView", b"\0\3\0\2{}"), struct.pack(">H12s20sQQQ", 1, b"STRING", b"", 0, 2**60, 0)]

        def lie():
            for answer in answers:
                connection, _ = liar.accept()
                with connection:
                    connection.sendall(answer)
                    connection.recv(1000)

        thread = threading.Thread(target=lie, daemon=True)
        thread.start()
        for _ in answers:
            with self.assertRaises(ValueError):
                serve.read_scene(f"igtl://127.0.0.1:{liar.getsockname()[1]}", None, lambda *_, **__: None)
        thread.join()
        liar.close()


@unittest.skipIf(aiohttp is None, "aiohttp is not installed")
class Serving(WithLive):
    async def serve(self, live, *more):
        server = await asyncio.to_thread(Running, live.address, *more, "--threads", "2")
        self.addCleanup(lambda: server.process.poll() is None and server.process.kill())
        return server

    async def test_scripts_read_progress_and_clients_go_away(self):
        live = self.start()
        server = await self.serve(live)
        self.assertEqual([one["phase"] for one in server.phases], ["ready"])
        async with aiohttp.ClientSession() as session:

            async def health():
                async with session.get(server.url + "health") as answer:
                    return await answer.json()

            first = await health()
            self.assertEqual((first["status"], first["live"]["phase"], first["frames"]), ("ok", "following", 0))
            sending = asyncio.ensure_future(asyncio.to_thread(self.send, live, range(FRAMES)))
            request = json.dumps({"id": 1, "plane": self.poses[4].ravel().tolist(), "width": WIDTH, "height": HEIGHT})
            for _ in range(12):  # ask and leave without reading, some in the middle of a message
                client = await session.ws_connect(server.url + "slices", max_msg_size=0)
                await client.send_str(request)
                client._response.connection.transport.abort()
            await sending
            for _ in range(100):
                now = await health()
                if now["live"]["frames"] == FRAMES and now["clients"] == 0:
                    break
                await asyncio.sleep(0.1)
            self.assertEqual((now["live"]["frames"], now["live"]["dropped"], now["clients"], now["status"]),
                             (FRAMES, 0, 0, "ok"))
            self.assertGreater(now["gaussians"], 0)
            async with session.ws_connect(server.url + "slices", max_msg_size=0) as client:
                await client.send_str(request)
                head, picture, coverage, _ = unpack((await client.receive()).data)
                self.assertEqual(head["live"]["frames"], FRAMES)
                self.assertGreater(picture.std(), 5)
                self.assertGreater(np.median(coverage[picture > 60]), 0)
                # The program ends: the server stays, says so, and ends when it is told to.
                answer = await asyncio.to_thread(live.lift)
                self.assertEqual((answer["frames"], answer["dropped"]), (FRAMES, 0))
                await client.send_str(request)
                told = json.loads((await client.receive()).data)
                self.assertTrue(told["away"])
            gone = await health()
            self.assertEqual((gone["status"], gone["live"]["phase"], gone["live"]["frames"]), ("waiting", "away", FRAMES))
        code, told, complaints = await asyncio.to_thread(server.end)
        self.assertEqual((code, [json.loads(line)["phase"] for line in told.splitlines()], complaints),
                         (0, ["waiting", "ending"], ""))

    async def test_the_server_ends_while_the_field_grows(self):
        for number in (signal.SIGINT, signal.SIGKILL):
            live = self.start()
            server = await self.serve(live)
            sending = asyncio.ensure_future(asyncio.to_thread(self.send, live, range(FRAMES)))
            async with aiohttp.ClientSession() as session, session.ws_connect(server.url + "slices", max_msg_size=0) as client:
                await client.send_str(json.dumps({"id": 1, "plane": self.poses[4].ravel().tolist(), "width": 1024,
                                                  "height": 1024}))
                await asyncio.to_thread(server.end, number)
            await sending
            answer = await asyncio.to_thread(live.lift)
            self.assertEqual((answer["frames"], answer["dropped"], answer["refused"]), (FRAMES, 0, 0))
            self.assertGreater(len(Path(live.field).read_bytes()), 1000)


@unittest.skipIf(aiohttp is None or chromium.program() is None, "aiohttp or Chromium is not installed")
class Page(WithLive):
    async def test_the_picture_changes_when_frames_come(self):
        live = self.start()
        server = await asyncio.to_thread(Running, live.address, "--threads", "2", "--token")
        self.addCleanup(lambda: server.process.poll() is None and server.process.kill())
        async with chromium.Browser() as browser:
            await self.use(browser, server, live)
        code, told, complaints = await asyncio.to_thread(server.end)
        self.assertEqual((code, complaints), (0, ""))

    async def use(self, browser, server, live):
        grey = ("(() => {{ const c = document.getElementById('{}'), t = new OffscreenCanvas(c.width, c.height)"
                ".getContext('2d', {{ willReadFrequently: true }}); t.drawImage(c, 0, 0); "
                "return Array.from(t.getImageData(0, 0, c.width, c.height).data.filter((_, k) => k % 4 === 1)); }})()")

        async def picture(name="slice"):
            return np.array(await browser.evaluate(grey.format(name)), dtype=float)

        async def says(words):
            await browser.until(f"document.getElementById('status')?.textContent.includes({json.dumps(words)})", 60)

        await browser.call("Page.navigate", url=server.url)
        await says("waiting for the first frames")
        half = FRAMES // 2
        await asyncio.to_thread(self.send, live, range(half))
        await browser.until("window.bigus && bigus.updates > 1")
        await says(f"following, {half} frames")
        self.assertIn("probe", await browser.evaluate("document.getElementById('sliceText').textContent"))
        await browser.evaluate("document.getElementById('greyOver').click()")

        # The plane is dragged aside, and stays where it is when the probe moves on.
        box = await browser.evaluate("document.getElementById('slice').getBoundingClientRect().toJSON()")
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        before = await browser.evaluate("plane()")
        await browser.mouse("mousePressed", x, y, True)
        for k in range(1, 4):
            await browser.mouse("mouseMoved", x + 4 * k, y, True)
        await browser.mouse("mouseReleased", x + 12, y, True)
        dragged = await browser.evaluate("plane()")
        self.assertGreater(np.abs(np.subtract(dragged, before)).max(), 0.5)
        # It is pushed to where no frame was yet: the picture is dark, and bright when frames came there.
        normal = self.poses[0][:3, 2] / np.linalg.norm(self.poses[0][:3, 2])
        on = float(normal @ (self.poses[half + half // 2] - self.poses[half - 1])[:3, 3])
        await browser.evaluate(f"(() => {{ const z = document.getElementById('z'); z.max = 99; z.min = -99; "
                               f"const n = axesOf(base)[2], s = n[0] * {normal[0]} + n[1] * {normal[1]} + n[2] * {normal[2]}; "
                               f"z.value = s * {on}; z.oninput(); }})()")
        at = await browser.evaluate("plane()")
        await browser.until(f"bigus.updates > {await browser.evaluate('bigus.updates')} + 3")
        dark, uncovered = await picture(), await picture("coverage")
        await asyncio.to_thread(self.send, live, range(half, FRAMES))
        await says(f"following, {FRAMES} frames")
        await browser.until(f"bigus.updates > {await browser.evaluate('bigus.updates')} + 5")
        bright, covered = await picture(), await picture("coverage")
        self.assertEqual(await browser.evaluate("plane()"), at)
        self.assertGreater(bright.std(), 2 * dark.std() + 5)
        self.assertGreater(covered.mean(), 2 * uncovered.mean() + 5)
        await browser.evaluate("document.getElementById('back').click()")
        await browser.until(f"bigus.updates > {await browser.evaluate('bigus.updates')} + 3")
        middle = np.array(await browser.evaluate("plane()")).reshape(4, 4)
        self.assertLess(np.abs(middle[:3, 3] - self.poses[-1][:3, 3]).max(), 2)  # where the probe is now, or was 0.1 s ago
        await browser.until("scene.high[0] > scene.low[0] && points.length > 0")
        updates = await browser.evaluate("(async () => { const before = bigus.updates; await pause(3000); "
                                         "return bigus.updates - before; })()")
        self.assertGreater(updates, 3)
        status = await browser.evaluate("document.getElementById('status').textContent")
        print(f"\n{updates / 3:.1f} updates a second without a hand on the mouse; {status}")
        if "BIGUS_SERVE_PICTURE" in os.environ:
            await browser.picture(os.environ["BIGUS_SERVE_PICTURE"])
        await asyncio.to_thread(live.lift)
        await says("no live field answers")
        # Another one begins at the same port: the page goes on by itself.
        again = Live(self.folder.name, live.port)
        self.addCleanup(again.kill)
        await asyncio.to_thread(self.send, again, range(half))
        await says(f"following, {half} frames")
        self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    BIGUS = sys.argv.pop(1)
    if subprocess.run([BIGUS, "live", "--help"], capture_output=True).returncode:
        print("skipped: the program has no live, which is a wing")
        sys.exit(77)
    unittest.main()
