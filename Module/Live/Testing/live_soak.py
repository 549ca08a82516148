#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Half an hour of `bigus live`: does its memory stay?

    live_soak.py BIGUS [minutes]

A server of OpenIGTLink, with the messages of test_live.py, sends 20 frames of 320 x 240 a second of a made-up sweep, there and
back, with a second of rest at either end and the noise of a tracker in every pose (0.05 mm). Once a second it asks for a
slice and takes it. Every 15 s a line tells what is resident, how many Gaussians there are and what was lost. Fails when
the program does not end well, a slice is missing, a frame was dropped, or the resident size of the last fifth is more than
5 % above that of the second.
"""
import json
import math
import pathlib
import re
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from test_live import checksum, matrix_bytes, message, read_sequence

WIDTH, HEIGHT, FRAMES, RATE, REST = 320, 240, 140, 20, 20
JITTER = 0.05  # mm
SLICE = 256  # pixels of a side


def read_sweep(path):
    header, pixels = read_sequence(path)
    poses = [[[float(v) for v in line.split()][4 * row:4 * row + 4] for row in range(4)]
             for line in re.findall(r"Seq_Frame\d+_ImageToReferenceTransform = (.*)", header)]
    size = WIDTH * HEIGHT
    return [pixels[k * size:(k + 1) * size] for k in range(FRAMES)], poses


class Server:
    """Sends frames until it is told to stop; counts slices that come back."""

    def __init__(self, pixels, poses):
        self.bodies = [struct.pack(">HBBBB3H", 1, 1, 3, 2, 1, WIDTH, HEIGHT, 1)
                       + matrix_bytes([[float(i == j) for j in range(4)] for i in range(4)])
                       + struct.pack(">6H", 0, 0, 0, WIDTH, HEIGHT, 1) + frame for frame in pixels]
        self.checks = [checksum(body) for body in self.bodies]
        self.poses = poses
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.asked = self.answered = self.sent = 0
        self.stop = False
        threading.Thread(target=self.serve, daemon=True).start()

    def path(self):
        """Frames there, a rest, back, a rest, without end."""
        while True:
            yield from range(FRAMES)
            yield from [FRAMES - 1] * REST
            yield from range(FRAMES - 1, -1, -1)
            yield from [0] * REST

    def serve(self):
        connection, _ = self.listening.accept()
        threading.Thread(target=self.take, args=(connection,), daemon=True).start()
        begun = time.monotonic()
        for k, frame in enumerate(self.path()):
            if self.stop:
                break
            pose = [row[:] for row in self.poses[frame]]
            for axis in range(3):
                pose[axis][3] += JITTER * math.sin(12.9898 * k + 78.233 * axis)
            seconds = 1000 + k / RATE
            connection.sendall(message("TRANSFORM", "ImageToReference", seconds, matrix_bytes(pose))
                               + message("IMAGE", "Image", seconds, self.bodies[frame], crc=self.checks[frame]))
            self.sent += 1
            if k >= 2 * RATE and k % RATE == 0:
                middle = self.poses[FRAMES // 2]
                plane = [[row[0] * WIDTH / SLICE, row[1] * HEIGHT / SLICE, row[2], row[3]] for row in middle]
                connection.sendall(message("TRANSFORM", "Plane", seconds, matrix_bytes(plane)))
                self.asked += 1
            time.sleep(max(0.0, begun + (k + 1) / RATE - time.monotonic()))
        time.sleep(2)
        connection.shutdown(socket.SHUT_RDWR)
        connection.close()

    def take(self, connection):
        stream = connection.makefile("rb")
        try:
            while len(header := stream.read(58)) == 58:
                size = struct.unpack(">Q", header[42:50])[0]
                if len(stream.read(size)) == size and header[2:7] == b"IMAGE":
                    self.answered += 1
        except OSError:
            pass


def resident(process):
    """MB."""
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{process.pid}/status").read_text()).group(1)) / 1024


def main():
    bigus, minutes = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 30
    with tempfile.TemporaryDirectory(prefix="bigus-live-soak-") as name:
        folder = pathlib.Path(name)
        sweep, status = folder / "sweep.igs.mha", folder / "status.json"
        subprocess.run([bigus, "phantom", "-o", sweep, "--frames", str(FRAMES), "--width", str(WIDTH), "--height", str(HEIGHT)],
                       check=True, capture_output=True)
        server = Server(*read_sweep(sweep))
        process = subprocess.Popen(
            [bigus, "live", f"igtl://127.0.0.1:{server.listening.getsockname()[1]}", "-o", folder / "field.vtp", "--transform",
             "ImageToReference", "--plane", "Plane", "--slice-size", str(SLICE), str(SLICE), "--finish", "5", "--reconnect", "0",
             "--status", status, "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        end, sizes = time.monotonic() + 60 * minutes, []
        while time.monotonic() < end and process.poll() is None:
            time.sleep(min(15, max(0.1, end - time.monotonic())))
            if process.poll() is None and status.exists():
                state = json.loads(status.read_text())
                sizes.append(resident(process))
                print(f"{60 * minutes - (end - time.monotonic()):6.0f} s  {sizes[-1]:7.1f} MB  {state['gaussians']} Gaussians  "
                      f"{state['steps']} steps  {server.sent} frames sent, {state['dropped']} dropped  "
                      f"{server.answered} of {server.asked} slices", flush=True)
        server.stop = True
        answer = json.loads(process.communicate(timeout=300)[0])
        fifth = max(1, len(sizes) // 5)
        early, late = max(sizes[fifth:2 * fifth] or sizes), max(sizes[-fifth:])
        print(f"largest resident size in the second fifth {early:.1f} MB, in the last {late:.1f} MB; {answer['frames']} frames, "
              f"{answer['dropped']} dropped, {answer['gaussians']} Gaussians, latency {answer['latency']}")
        sound = (process.returncode == 0 and answer["dropped"] == 0 and server.answered >= server.asked - 1
                 and late <= 1.05 * early)
        sys.exit(0 if sound else "live_soak.py: not sound")


if __name__ == "__main__":
    main()
