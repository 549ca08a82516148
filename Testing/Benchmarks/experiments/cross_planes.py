#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what methods show at right angles to the frames of the real sweeps, side by side: needles and blur show there.

    cross_planes.py [liver] [brain] [spine] [--field NAME=FILE ...] [--output FOLDER]

For each sweep, at half resolution, writes NAME-axial.png (along the sweep and in depth), NAME-lateral.png (along the
sweep and across) and the middle of each enlarged. Beside linear interpolation and compounding stand the --field files,
which were trained with --reduce 2 and the same --hold-out (liver 8, else 4), or else a field that is trained now.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

from definitions import BRAIN, LIVER, SPINE, auto  # noqa: E402
from harness import PROJECT  # noqa: E402

SWEEPS = {"liver": (LIVER, 8, 0.63), "brain": (BRAIN, 4, 0.8), "spine": (SPINE, 4, 0.8)}  # hold out, voxels in mm
DIRECTIONS = {"axial": 1, "lateral": 4}  # the middle one of three
ENLARGED = 96  # pixels a side
WHITE = 99.5  # percentile of what linear interpolation shows


def read_pgm(path):
    _, size, _, pixels = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    return np.frombuffer(pixels, np.uint8).reshape(height, width)


def cross_planes(options, scene, hold_out, method):
    """The pictures and the result of one method."""
    job = {"sweep": {**scene, "reduce": 2}, "frames": {"hold_out": hold_out}, "method": method,
           "score": ["held_out", "cross"]}
    with tempfile.TemporaryDirectory() as folder:
        answer = subprocess.run([options.program, "--data", options.data, "--pictures", folder], input=json.dumps(job),
                                check=True, text=True, stdout=subprocess.PIPE).stdout
        pictures = {name: read_pgm(Path(folder) / f"cross-{k}.pgm") for name, k in DIRECTIONS.items()}
    pictures["axial"] = pictures["axial"].T  # depth downwards
    return pictures, json.loads(answer)["scores"]


def middle(picture):
    height, width = (min(ENLARGED, size) for size in picture.shape)
    top, left = (picture.shape[0] - height) // 2, (picture.shape[1] - width) // 2
    return picture[top:top + height, left:left + width]


def draw(pictures, titles, path):
    height, width = pictures[0].shape
    figure, axes = plt.subplots(1, len(pictures), figsize=(6 * len(pictures), 6 * min(height / width, 2) + 0.4),
                                constrained_layout=True)
    white = np.percentile(pictures[0][pictures[0] > 0], WHITE)
    for axis, picture, title in zip(axes, pictures, titles):
        axis.imshow(picture, cmap="gray", vmin=0, vmax=white, interpolation="nearest")
        axis.set_title(title, fontsize=10)
        axis.axis("off")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweeps", nargs="*", choices=[[], *SWEEPS])
    parser.add_argument("--field", action="append", default=[], metavar="NAME=FILE", help="a field of sweep NAME")
    parser.add_argument("--program", type=Path, default=PROJECT / "build/bin/bigusExperiment")
    parser.add_argument("--data", type=Path,
                        default=os.environ.get("BIGUS_DATA") or PROJECT.parent / "shared" / "data")
    parser.add_argument("--output", type=Path, default=Path("cross-planes"))
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    fields = [entry.split("=", 1) for entry in options.field]
    for name in options.sweeps or SWEEPS:
        scene, hold_out, voxel = SWEEPS[name]
        methods = {"linear interpolation": {"name": "pose_any_plane"},
                   f"compounding, {voxel} mm": {"name": "compounding", "voxel_size": voxel}}
        given = [Path(file) for sweep, file in fields if sweep == name]
        methods |= {file.name: {"name": "field", "file": str(file)} for file in given} or {"field, 100k": auto(100000)}
        shown, titles = [], []
        for title, method in methods.items():
            pictures, scores = cross_planes(options, scene, hold_out, method)
            shown.append(pictures)
            titles.append(f"{title}: held-out {scores['held_out']['psnr']:.2f} dB, detail "
                          f"{scores['cross']['detail']:.2f}, scratches {scores['cross']['scratches']:.2f}")
            print(f"{name}, {titles[-1]}", flush=True)
        for direction in DIRECTIONS:
            draw([pictures[direction] for pictures in shown], titles, options.output / f"{name}-{direction}.png")
            draw([middle(pictures[direction]) for pictures in shown], titles,
                 options.output / f"{name}-{direction}-middle.png")


if __name__ == "__main__":
    main()
