#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Kills a training with SIGKILL at random moments, resumes it, and compares the field with one that never stopped.

    kill_and_resume.py BIGUS [--moments 50] [--seed 1] [--interval 0.3] [--slack 0.5]

Prints one line a moment and a summary; fails when a byte differs, when a file is left, or when a checkpoint was older at
the kill than the interval and the slack, the time that a step, seeds and solve, and the writing may take.
"""

import argparse
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import time


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("bigus")
    parser.add_argument("--moments", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--interval", type=float, default=0.3, help="seconds between checkpoints")
    parser.add_argument("--slack", type=float, default=0.5, help="seconds that a checkpoint may be older than that")
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    moments = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory(prefix="bigus-kill-") as name:
        folder = pathlib.Path(name)
        sweep, field = folder / "sweep.igs.mha", folder / "field.vtp"
        checkpoint = folder / "field.vtp.checkpoint"
        subprocess.run([arguments.bigus, "phantom", "-o", sweep, "--frames", "24", "--width", "64", "--height", "64",
                        "--pixel-size", "0.5", "--no-progress"], check=True, stdout=subprocess.DEVNULL)

        def train(*options):
            return subprocess.Popen([arguments.bigus, "train", sweep, "-o", field, "--max-gaussians", "4000",
                                     "--iterations", "800", "--threads", str(arguments.threads), "--no-progress",
                                     "--checkpoint-interval", str(arguments.interval), *options],
                                    stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

        start = time.monotonic()
        process = train()
        errors = process.communicate()[1]
        assert process.returncode == 0, errors
        duration = time.monotonic() - start
        truth = field.read_bytes()
        print(f"a training that never stops takes {duration:.1f} s and makes {len(truth)} bytes")

        faults, killed, without, oldest = 0, 0, 0, 0.0
        for moment in range(arguments.moments):
            field.unlink()
            delay = moments.uniform(0, duration)
            process = train()
            time.sleep(delay)
            process.kill()
            now = time.time()
            process.communicate()
            ended = process.returncode == 0
            killed += not ended
            age = now - checkpoint.stat().st_mtime if checkpoint.exists() else None
            without += not ended and age is None
            resumed = train("--resume")
            errors = resumed.communicate()[1]
            same = resumed.returncode == 0 and field.read_bytes() == truth
            left = sorted(set(os.listdir(folder)) - {"sweep.igs.mha", "field.vtp"})
            is_old = age is not None and age > arguments.interval + arguments.slack
            oldest = max(oldest, age or 0)
            faults += not same or bool(left) or is_old
            state = "had ended" if ended else "no checkpoint yet" if age is None else f"checkpoint {age:.2f} s old"
            print(f"{moment + 1:3d}  killed after {delay:5.2f} s, {state}: "
                  + ("the same field" if same else "ANOTHER FIELD " + errors.decode()[-300:])
                  + (f", LEFT {left}" if left else ""), flush=True)
        print(f"{arguments.moments} moments, {killed} kills before the end, {without} of them before the first "
              f"checkpoint, oldest checkpoint {oldest:.2f} s, {faults} faults")
        return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
