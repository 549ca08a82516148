#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Gives every option odd values, and every input odd paths, and looks at how the program ends.

    odd_arguments.py PATH_TO_BIGUS [--values 30] [--options REGEX]

*Options*: all that `--help` of a command names, each with values such as nan, -1, 2^63, 1e308 and "". *Paths*: a pipe that
nobody writes to, devices, folders, links in a ring, files of /proc, a name of 300 letters, an empty file, a socket, in the
place of each input. *Threads*: what commands write has the same bytes for 1, 2, 3 and 7.

A run is wrong where a signal ends it that is not that of a limit, where its exit code is none that `--help` tells, where it
fails and says nothing, or "not foreseen", or where an odd path makes it wait. Much may be asked for by an option: runs that
reach 5 s of the processor, 60 s, 3 GB of addresses or 64 MB of a file are ended and counted. Not tried: live, serve and view,
which have tests of their own.
"""
import argparse
import collections
import os
import pathlib
import re
import resource
import signal
import socket
import subprocess
import sys
import tempfile

VALUES = ["nan", "-1", "0", "1e308", "", "9223372036854775808", "inf", "2147483648", "1,5", "0.5", "-0", "1", "-inf", "-1e308",
          "5e-324", "2147483647", "-2147483649", "4294967296", "9223372036854775807", "1e19", "0x10", " ", "1e", "--", "\u00b2",
          "1e400", "007", "+1", "1_000", "a" * 5000]
CODES = (0, 1, 2, 3)
LIMITS = (signal.SIGXCPU, signal.SIGKILL, signal.SIGXFSZ)
SECONDS, WAITS, ADDRESSES, FILE_BYTES = 5, 60, 3 << 30, 64 << 20
FAST = ("--no-auto", "--gaussians", 60, "--iterations", 3, "--no-baselines", "--no-standard-error")


def limits():
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_BYTES, FILE_BYTES))


class Runs:
    """Runs of the program in a folder of their own, and what was wrong with them."""

    def __init__(self, bigus, folder):
        self.bigus, self.folder, self.out = os.path.abspath(bigus), folder, folder / "out"
        self.out.mkdir()
        self.counts, self.wrong = collections.Counter(), 0
        self.sweep, self.field, self.labels = folder / "sweep.igs.mha", folder / "field.vtp", folder / "labels.nrrd"
        self.labels.write_bytes(b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 24 20 8\nencoding: raw\n\n"
                                + 8 * (240 * b"\0" + 240 * b"\1"))
        for words in (("phantom", "-o", self.sweep, "--width", 24, "--height", 20, "--frames", 8),
                      ("train", self.sweep, "-o", self.field, *FAST)):
            if self.run(words) != "0":
                sys.exit(f"{words} fails")
        for command, words in self.commands().items():
            if self.run([command, *words]) != "0":
                sys.exit(f"{command} fails")
        self.counts.clear()

    def commands(self):
        """Of each command, words that work. The inputs are a sweep, its labels and a field."""
        sweep, field, out = self.sweep, self.field, self.out
        return {"phantom": ("-o", out / "p.igs.mha", "--width", 24, "--height", 20, "--frames", 8), "info": (sweep,),
                "check": (sweep,), "poses": (sweep, "-o", out / "p.csv"), "train": (sweep, "-o", out / "f.vtp", *FAST),
                "slice": (field, "--poses", sweep, "-o", out / "s.mha"), "metrics": (sweep, sweep),
                "voxelize": (field, "-o", out / "v.mha", "--spacing", 1), "convert": (sweep, out / "c.nrrd"),
                "label": (sweep, self.labels, field, "-o", out / "l.vtp")}

    def run(self, words, may_wait=True):
        """How the program ended: its exit code, "limit" or what is wrong."""
        for old in self.out.iterdir():
            old.unlink()
        with tempfile.TemporaryFile() as text:
            process = subprocess.Popen([self.bigus, *map(str, words)], stdin=subprocess.DEVNULL, stdout=text, stderr=text,
                                       cwd=self.out, preexec_fn=limits)
            try:
                code = process.wait(WAITS)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                code = -signal.SIGKILL if may_wait else "waits"
            text.seek(0)
            said = text.read().decode(errors="backslashreplace")
        if code in (-limit for limit in LIMITS) and may_wait:
            end = "limit"
        elif code not in CODES or "not foreseen" in said or (code and not said.strip()):
            end = f"wrong ({code})"
            self.wrong += 1
            print(f"{code}: {' '.join(str(word)[:300] for word in words)}\n{said[-600:]}", file=sys.stderr, flush=True)
        else:
            end = str(code)
        self.counts[end] += 1
        return end

    def report(self, what):
        total, counts = sum(self.counts.values()), self.counts
        print(f"| {what} | {total} | {counts['0']} | {counts['1'] + counts['2'] + counts['3']} | {counts['limit']} "
              f"| {total - sum(counts[end] for end in ('0', '1', '2', '3', 'limit'))} |", flush=True)
        self.counts.clear()


def options_of(runs, command):
    """Names of options, and how many values each takes."""
    text = subprocess.run([runs.bigus, command, "--help"], capture_output=True, text=True, check=True).stdout
    text += subprocess.run([runs.bigus, "--help"], capture_output=True, text=True, check=True).stdout
    found = {}
    for names, values in re.findall(r"^  ((?:-\w,)?--[\w,-]+)((?: [^ \n]+)*)", text, re.MULTILINE):
        words = [word for word in values.split() if word != "REQUIRED"]
        if words and not names.startswith("-h"):
            found[names.split(",")[-1]] = len(words)
    return found


def try_options(runs, values, only):
    for command, words in runs.commands().items():
        for option, count in options_of(runs, command).items():
            if option in ("--output",) or not re.search(only, option):
                continue
            for value in VALUES[:values]:
                kept = list(words)
                if option in kept:  # given twice would be its own error
                    at = kept.index(option)
                    del kept[at:at + 1 + count]
                given = [f"{option}={value}"] if count == 1 else [option] + count * [value]
                runs.run([command, *kept, *given])
        runs.report(f"options of `{command}`")


def odd_paths(folder):
    place = folder / "odd"
    place.mkdir()
    os.mkfifo(place / "pipe")
    (place / "ring").symlink_to("ring")
    (place / "nowhere").symlink_to("is-not-there")
    (place / "empty").touch()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(place / "socket"))
    listener.close()
    within = [place / name for name in ("pipe", "ring", "nowhere", "empty", "socket")]
    for end in (".mha", ".vtp", ".csv", ".nrrd"):  # the same with the names that are looked for
        os.mkfifo(place / f"pipe{end}")
        (place / f"folder{end}").mkdir()
        within += [place / f"pipe{end}", place / f"folder{end}"]
    return [*within, place, "/dev/null", "/dev/zero", "/dev/full", "/proc/self/maps", "/proc/self/mem", "/proc/self/environ", "/",
            "n" * 300 + ".mha", "x/" * 3000, "-", "\u00e9\n\x1b[31m.mha"]


def try_paths(runs):
    paths = odd_paths(runs.folder)
    for command, words in runs.commands().items():
        for at, word in enumerate(words):
            if word in (runs.sweep, runs.field, runs.labels):
                for path in paths:
                    runs.run([command, *words[:at], path, *words[at + 1:]], may_wait=False)
    runs.report("paths of inputs")


def try_threads(runs):
    for command, words in runs.commands().items():
        for engine in ("cpu", "cpu-double", "reference") if command in ("slice", "voxelize") else (None,):
            first = None
            for threads in (1, 2, 3, 7):
                given = [command, *words, "--threads", threads, *(("--engine", engine) if engine else ())]
                runs.run(given)
                written = {file.name: file.read_bytes() for file in sorted(runs.out.iterdir())}
                first = first or written
                if written != first:
                    runs.counts["wrong (bits)"] += 1
                    runs.wrong += 1
                    print(f"other bytes: {' '.join(map(str, given))}", file=sys.stderr)
    runs.report("numbers of threads")


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("bigus")
    options.add_argument("--values", type=int, default=len(VALUES))
    options.add_argument("--options", default="", metavar="REGEX")
    options = options.parse_args()
    print("| what | runs | done | refused | ended by a limit | wrong |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="bigus-odd-") as name:
        runs = Runs(options.bigus, pathlib.Path(name))
        try_paths(runs)
        try_threads(runs)
        try_options(runs, options.values, options.options)
    return 1 if runs.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
