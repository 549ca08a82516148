#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Looks at a sweep and plans the quickstart: prints "REDUCE HOLD_OUT HELD_OUT_FRAME VALIDATION" and writes
two planes.

    plan.py SWEEP PLANES.csv

The planes pass through the middle of the sweep: one at right angles to the frames, along the sweep and in depth, and
one at an angle to everything. They are as deep as a frame and have its pixel size.
"""
import csv
import sys

import numpy as np

import bigus

PIXELS = 6e6  # so many train in about a minute on two cores


def unit(vector):
    return vector / np.linalg.norm(vector)


def turned(vector, axis, degrees):
    """Rodrigues' rotation."""
    angle = np.radians(degrees)
    return (vector * np.cos(angle) + np.cross(axis, vector) * np.sin(angle)
            + axis * (axis @ vector) * (1 - np.cos(angle)))


def main():
    path, planes_path = sys.argv[1:]
    sweep = bigus.read(path)
    count, height, width = bigus.frames(sweep).shape
    poses = bigus.poses(sweep)

    reduce = 1
    while count * (width // reduce) * (height // reduce) > PIXELS:
        reduce += 1
    hold_out = 8 if count >= 60 else 4 if count >= 8 else 2
    validation = 16 if count >= 60 else 0  # of the others, to stop early by; a short sweep can spare none
    middle = count // 2
    held_out_frame = min(range(hold_out // 2, count, hold_out), key=lambda k: abs(k - middle))

    centres = poses @ ((width - 1) / 2, (height - 1) / 2, 0, 1)
    across, depth = poses[middle, :3, 0], poses[middle, :3, 1]
    pixel = np.sqrt(np.linalg.norm(np.cross(across, depth)))
    depth = unit(depth)
    centre = centres[middle, :3]
    path_vector = centres[-1, :3] - centres[0, :3]
    normal = unit(np.cross(across, depth))
    along = path_vector - depth * (depth @ path_vector)
    if np.linalg.norm(along) < 1:  # a probe that turns or tilts in place
        along = normal
    along = unit(along) if along @ normal >= 0 else -unit(along)
    deep = int(round(height * np.linalg.norm(poses[middle, :3, 1]) / pixel))
    length = max(np.ptp(centres[:, :3] @ along), 10)

    half = turned(along, depth, -40)  # between along the sweep and along a frame ...
    tilted = turned(depth, half, 15)  # ... and leaning out of the depth axis
    with open(planes_path, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow([f"m{row}{column}" for row in range(4) for column in range(4)] + ["width", "height"])
        for columns, rows, size in ((along, depth, length), (half, tilted, 1.3 * length)):
            wide = max(int(round(size / pixel)), 16)
            matrix = np.eye(4)
            matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = columns * pixel, rows * pixel, np.cross(columns, rows)
            matrix[:3, 3] = centre - matrix[:3, 0] * (wide - 1) / 2 - matrix[:3, 1] * (deep - 1) / 2
            table.writerow([repr(value) for value in matrix.ravel()] + [wide, deep])
    print(reduce, hold_out, held_out_frame, validation)


if __name__ == "__main__":
    main()
