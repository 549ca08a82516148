#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Several sweeps of one patient in one field, beside a field of each alone.

    several_sweeps.py FIELD.vtp SWEEP SWEEP... [--gaussians N] [--iterations N]

The sweeps have one reference frame, and frames of one size. Every 8th frame of each is held out, and scored.
"""
import argparse

import numpy as np

import bigus

HOLD_OUT = 8


def held_out_psnr(training, sweep, first):
    """Mean over the frames of a sweep whose poses begin at `first` among those of the training."""
    frames = bigus.frames(sweep)
    scores = []
    for frame in range(HOLD_OUT // 2, len(frames), HOLD_OUT):
        prediction = bigus.reslice(training.field, training.poses[first + frame], size=frames.shape[:0:-1])
        scores.append(bigus.metrics(prediction, frames[frame])["psnr"])
    return np.mean(scores)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("field")
    parser.add_argument("sweeps", nargs="+")
    parser.add_argument("--gaussians", type=int, default=40000)
    parser.add_argument("--iterations", type=int, default=400)
    options = parser.parse_args()

    sweeps = [bigus.read(path) for path in options.sweeps]

    def train(sweep, share):
        return bigus.train(sweep, False, Gaussians=round(share * options.gaussians), HoldOut=HOLD_OUT, Automatic=False,
                           Iterations=round(share * options.iterations))

    together = train(sweeps, 1)  # a list: poses of each are corrected, and frames of each held out, by itself
    bigus.write(together.field, options.field)
    first = 0
    for number, (path, sweep) in enumerate(zip(options.sweeps, sweeps), 1):
        alone = train(sweep, 1 / len(sweeps))
        print(f"sweep {number}, {path}: PSNR {held_out_psnr(together, sweep, first):.2f} dB in the field of all, "
              f"{held_out_psnr(alone, sweep, 0):.2f} dB in its own")
        first += sweep.GetDimensions()[2]
    print(f"{options.field}: {together.field.GetNumberOfPoints()} Gaussians")


if __name__ == "__main__":
    main()
