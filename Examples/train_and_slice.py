#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Train a field on a sweep, predict a frame it never saw, and say how well.

    train_and_slice.py SWEEP FIELD.vtp [--gaussians N] [--iterations N]
"""
import argparse
import sys

import bigus


def progress(fraction, text):
    print(f"\r{100 * fraction:3.0f} %  {text}", end="", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep")
    parser.add_argument("field")
    parser.add_argument("--gaussians", type=int, default=20000)
    parser.add_argument("--iterations", type=int, default=200)
    options = parser.parse_args()

    hold_out = 8
    sweep = bigus.read(options.sweep)
    # Numbers that are given are not questioned; the rest would be decided by short trainings without Automatic=False.
    training = bigus.train(sweep, progress, Gaussians=options.gaussians, Iterations=options.iterations,
                           HoldOut=hold_out, Automatic=False)
    field, log = training
    print(file=sys.stderr)
    bigus.write(field, options.field)

    frames, poses = bigus.frames(sweep), training.poses  # as trained at, not always as tracked
    height, width = frames.shape[1:]
    for frame in range(hold_out // 2, len(frames), hold_out):
        prediction = bigus.reslice(field, poses[frame], size=(width, height))
        scores = bigus.metrics(prediction, frames[frame])
        print(f"held-out frame {frame:3d}: PSNR {scores['psnr']:.2f} dB, SSIM {scores['ssim']:.3f}, "
              f"BFS {scores['bfs']:.3f}")
    print(f"{options.field}: {field.GetNumberOfPoints()} Gaussians, {log.GetNumberOfRows()} lines of training log")


if __name__ == "__main__":
    main()
