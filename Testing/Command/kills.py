#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Ends jobs by signals at random moments, and lets their files run full; prints what is left, as a table.

    kills.py BIGUS [--trials 10] [--seed 1]

An output is there from before. Afterwards it must be as it was, or the new one, whole; a training that is told to end
saves a sound field instead. A following run must leave nothing but its output. Fails where anything is lost, or ends for
a reason that was not foreseen.
"""

import argparse
import os
import pathlib
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bigus")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    moments = random.Random(arguments.seed)
    lost = 0
    with tempfile.TemporaryDirectory(prefix="bigus-kills-") as name:
        folder = pathlib.Path(name)
        (folder / "out").mkdir()
        said = (folder / "said").open("ab")

        def start(*words, **more):
            return subprocess.Popen([arguments.bigus, *map(str, words), "--threads", "2", "--no-progress"],
                                    stdout=subprocess.DEVNULL, stderr=said, **more)

        sweep, field = folder / "sweep.igs.mha", folder / "field.vtp"
        fast = ("--no-auto", "--gaussians", "20000", "--iterations", "60")
        assert start("phantom", "-o", sweep, "--frames", 24, "--width", 64, "--height", 64, "--pixel-size", 0.5).wait() == 0
        assert start("train", sweep, "-o", field, *fast).wait() == 0
        jobs = {"f.vtp": ("train", sweep, *fast, "-o"), "f.ply": ("train", sweep, *fast, "-o"),
                "v.mha": ("voxelize", field, "--spacing", 0.25, "-o"),
                "s.igs.mha": ("slice", field, "--poses", sweep, "--spacing", 0.1, "-o")}
        print("| job | ended by | trials | ended before | old output | new output, whole | best field so far | lost | "
              "left for the next |\n|---|---|---|---|---|---|---|---|---|")
        for output, job in jobs.items():
            path = folder / "out" / output

            def clear():
                for file in path.parent.iterdir():
                    file.unlink()

            begin = time.monotonic()
            assert start(*job, path).wait() == 0
            duration, truth = time.monotonic() - begin, path.read_bytes()
            for number in (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP, "full disk"):
                ended = old = new = best = bad = left = 0
                for _ in range(arguments.trials):
                    clear()
                    path.write_bytes(b"old")
                    if number == "full disk":
                        limit = moments.randrange(1, len(truth))
                        process = start(*job, path, preexec_fn=lambda: resource.setrlimit(
                            resource.RLIMIT_FSIZE, (limit, limit)))
                    else:
                        process = start(*job, path)
                        time.sleep(moments.uniform(0, duration))
                        process.send_signal(number)
                    code = process.wait()
                    ended += code != 0
                    now = path.read_bytes()
                    if now == b"old":
                        old += 1
                    elif now == truth:
                        new += 1
                    elif job[0] == "train" and start("info", path).wait() == 0:
                        best += 1
                    else:
                        bad += 1
                    assert start(*job, path).wait() == 0
                    left += sorted(os.listdir(path.parent)) != [output] or path.read_bytes() != truth
                lost += bad + left
                text = number if number == "full disk" else number.name
                print(f"| `{job[0]}` `{output}` | {text} | {arguments.trials} | {ended} | {old} | {new} | {best} | {bad} "
                      f"| {left} |", flush=True)
        said.close()
        if b"not foreseen" in (folder / "said").read_bytes():
            lost += 1
            print("A message says that its reason was not foreseen.")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
