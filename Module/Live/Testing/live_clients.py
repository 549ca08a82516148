#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What clients cost a live training that is replayed beside them.

    live_clients.py BIGUS SEQUENCE [--reduce 2] [--rate 20] [--repeats 3] [--threads 2] [--cases none,slices,page]

`none` has no client. In `slices` one client asks by TRANSFORM for 10 slices of 512 x 512 a second. In `page` the page of
bigus.serve is open in Chromium, which computes on the same processors; it is there within a second of the first frame.
Cases take turns, because other programs disturb a machine for longer than a run. Each line has a run: steps while frames
came; processor time of the program, and what programs that have no part in this took meanwhile, s; pictures that clients
had, how long those of `slices` took (median and 95th percentile, ms), and processor time of the page's server and browser,
s. The last lines have the median steps of each case, and the smallest and the largest. Needs PYTHONPATH=build/python;
`page` needs aiohttp and Chromium.
"""
import argparse
import asyncio
import contextlib
import json
import os
import pathlib
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "Serve" / "Testing"))

SIZE = 512  # pixels of a side
PERIOD = 0.1  # s between two questions of a client


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bigus")
    parser.add_argument("sequence")
    parser.add_argument("--reduce", type=int, default=2)
    parser.add_argument("--rate", type=float, default=20)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--cases", default="none,slices,page")
    return parser.parse_args()


def plane_of(sequence):
    """The plane of the frame in the middle, cut into SIZE x SIZE pixels."""
    import bigus

    read = bigus.read(sequence)
    poses, (_, height, width) = bigus.poses(read), bigus.frames(read).shape
    plane = numpy.array(poses[len(poses) // 2], dtype=float)
    plane[:, 0] *= (width - 1) / (SIZE - 1)
    plane[:, 1] *= (height - 1) / (SIZE - 1)
    return plane


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


def connect(port, end):
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            return socket.create_connection(("127.0.0.1", port), timeout=10)
        time.sleep(0.02)
    raise SystemExit("live_clients.py: the program does not listen")


class Asker:
    """Asks for a slice every PERIOD, until the program ends."""

    def __init__(self, port, plane):
        self.times, self._port = [], port
        body = struct.pack(">12f", *plane[:3].T.ravel())
        self._question = struct.pack(">H12s20sQQQ", 1, b"TRANSFORM", b"Plane", 0, len(body), 0) + body
        self._thread = threading.Thread(target=self._ask)
        self._thread.start()

    def _ask(self):
        with connect(self._port, time.monotonic() + 60) as connection, connection.makefile("rb") as stream:
            due = time.monotonic()
            with contextlib.suppress(OSError, struct.error):
                while True:
                    begin = time.monotonic()
                    connection.sendall(self._question)
                    stream.read(struct.unpack(">42xQ8x", stream.read(58))[0])
                    self.times.append(1000 * (time.monotonic() - begin))
                    due = max(due + PERIOD, begin)
                    time.sleep(max(0.0, due - time.monotonic()))

    def end(self):
        self._thread.join()
        return sorted(self.times)


def seconds_of_tree(root):
    """Processor time of a process and of those below it, s."""
    parents, times = {}, {}
    for entry in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = entry.read_text().rpartition(")")[2].split()
            parents[int(entry.parent.name)] = int(fields[1])
            times[int(entry.parent.name)] = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")
    tree = {root}
    while more := {pid for pid, parent in parents.items() if parent in tree} - tree:
        tree |= more
    return sum(times.get(pid, 0) for pid in tree)


class Page:
    """The page's server and a browser that shows it, from the first run of its case to the last: the page finds each."""

    def __init__(self, port):
        self._port, self._loop = port, asyncio.new_event_loop()
        self._browser = self._server = None

    def open(self):
        import chromium

        connect(self._port, time.monotonic() + 60).close()
        self._server = subprocess.Popen([sys.executable, "-m", "bigus.serve", f"igtl://127.0.0.1:{self._port}", "--port", "0",
                                         "--json"], stdout=subprocess.PIPE, text=True)
        told = next(one for one in map(json.loads, self._server.stdout) if one["phase"] == "ready")
        self._browser = chromium.Browser()
        self._loop.run_until_complete(self._browser.__aenter__())
        self._loop.run_until_complete(self._browser.call("Page.navigate", url=told["url"]))
        self._loop.run_until_complete(self._browser.until("window.bigus && bigus.updates > 0"))

    def state(self):
        """Pictures that the page had, and processor time of server and browser."""
        updates = self._loop.run_until_complete(self._browser.evaluate("bigus.updates"))
        return updates, seconds_of_tree(self._server.pid), seconds_of_tree(self._browser._process.pid)

    def close(self):
        if self._browser:
            self._loop.run_until_complete(self._browser.__aexit__())
            self._server.terminate()
            self._server.communicate()


def live(options, port, folder, meanwhile=lambda: None):
    """One run, and the processor time of its program."""
    command = [options.bigus, "--threads", options.threads, "live", options.sequence, "--reduce", options.reduce, "--rate",
               options.rate, "--slice-size", SIZE, SIZE, "--listen", port, "--finish", 0.1, "-o",
               pathlib.Path(folder, "field.vtp"), "--json"]
    program = subprocess.Popen(map(str, command), stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    meanwhile()
    told = program.stdout.read()
    _, status, usage = os.wait4(program.pid, 0)
    program.returncode = os.waitstatus_to_exitcode(status)
    if program.returncode:
        raise SystemExit(f"live_clients.py: {' '.join(map(str, command))} ended with {program.returncode}")
    return json.loads(told), usage.ru_utime + usage.ru_stime


def busy_seconds():
    """Of all processors since the machine began, s."""
    user, nice, system, _, _, irq, soft, stolen = map(int, pathlib.Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + irq + soft + stolen) / os.sysconf("SC_CLK_TCK")


class Bench:
    def __init__(self, options, folder):
        self._options, self._folder, self._plane = options, folder, plane_of(options.sequence)
        self._port, self._page_port = free_port(), free_port()
        self._page = Page(self._page_port)
        if "page" in options.cases:
            live(options, self._page_port, folder, self._page.open)

    def close(self):
        self._page.close()

    def run(self, case):
        line, page = "", (0, 0, 0)
        busy, own = busy_seconds(), time.process_time()
        if case == "slices":
            asker = Asker(self._port, self._plane)
            told, seconds = live(self._options, self._port, self._folder)
            times = asker.end()
            line = (f"; {len(times)} slices in {statistics.median(times):.1f} ms, "
                    f"{times[int(0.95 * (len(times) - 1))]:.1f} ms")
        elif case == "page":
            before = self._page.state()
            told, seconds = live(self._options, self._page_port, self._folder)
            page = [after - first for first, after in zip(before, self._page.state())]
            line = f"; {page[0]} pictures, server {page[1]:.1f} s, browser {page[2]:.1f} s"
        else:
            told, seconds = live(self._options, self._port, self._folder)
        others = busy_seconds() - busy - (time.process_time() - own) - seconds - page[1] - page[2]
        print(f"{case:7} {told['steps']} steps, {told['gaussians']} Gaussians, {told['dropped']} dropped; {seconds:.1f} s, "
              f"others {others:.1f} s{line}", flush=True)
        return told["steps"]


def main():
    options = arguments()
    cases = options.cases.split(",")
    steps = {case: [] for case in cases}
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(Bench(options, folder)) as bench:
        for _ in range(options.repeats):
            for case in cases:
                steps[case].append(bench.run(case))
    for case, numbers in steps.items():
        print(f"{case:7} median {statistics.median(numbers):.0f}, {min(numbers)} to {max(numbers)}")


if __name__ == "__main__":
    main()
