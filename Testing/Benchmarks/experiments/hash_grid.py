#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A hash-grid network beside a field: the same frames, planes and scorer.

    hash_grid.py [--data FOLDER] [--cache FOLDER] [--program bigusExperiment] < job.json > result.json

In place of bigusExperiment it runs a job whose method is "hash_grid". It needs PyTorch; a processor will do. A small
network makes intensities of what a point finds in grids of growing resolution (Mueller et al., Instant neural graphics
primitives, 2022). Corners of cells lie in a table, by a hash where it is smaller than the grid.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from collections import namedtuple
from pathlib import Path
from types import SimpleNamespace

import numpy as np

try:
    import torch
except ImportError:
    torch = None

AT_ONCE = 1 << 16  # points of a picture
HASH = [73856093, 19349663, 83492791]  # of Teschner et al., Optimized spatial hashing, 2003


# The method's fields in a job: default, least and most.
OPTIONS = {
    "time_limit": (120, 0.1, 1e5),   # seconds(), of training, where "steps" is 0
    "steps": (0, 0, 10**7),
    "batch": (1 << 15, 1, 1 << 20),  # points a step
    "levels": (8, 1, 32),
    "features": (4, 1, 16),          # a level
    "table_bits": (17, 4, 24),       # of a place in a level's table, which has 2^bits entries at most
    "coarsest": (16, 0.01, 1e3),     # mm, side of a cell
    "finest": (0.8, 0.01, 1e3),      # mm; across frames at least their mean distance
    "width": (64, 1, 1024),          # of the two hidden layers
    "rate": (1e-2, 1e-6, 1.0)}       # Adam's, down to a hundredth along a cosine


def read_options(method):
    given = {name: value for name, value in method.items() if name != "name"}
    for name, value in given.items():
        if name not in OPTIONS:
            raise ValueError(f"method: there is no '{name}'; there are {', '.join(OPTIONS)}.")
        default, least, most = OPTIONS[name]
        if isinstance(value, bool) or not isinstance(value, (int, type(most))) or not least <= value <= most:
            raise ValueError(f"method: '{name}' is {json.dumps(value)}; it must be {least} to {most}.")
    return SimpleNamespace(**{name: default for name, (default, _, _) in OPTIONS.items()} | given)


class Plane(namedtuple("Plane", "width height origin column_step row_step")):
    """A line of Outside.h's files."""

    @staticmethod
    def read(file):
        for line in file.read_text().splitlines():
            width, height, *numbers = line.split()
            yield Plane(int(width), int(height), *np.array(numbers, float).reshape(3, 3))

    def points(self):
        """[pixels, 3] in mm."""
        j, i = np.mgrid[:self.height, :self.width]
        return self.origin + i.reshape(-1, 1) * self.column_step + j.reshape(-1, 1) * self.row_step


class Lookup(torch.autograd.Function if torch else object):
    """Weighted sums of a table's entries. On a processor PyTorch's own gradient of these takes ten times as long."""
    @staticmethod
    def forward(context, table, entries, weights):
        context.save_for_backward(table, entries, weights)
        return torch.nn.functional.embedding_bag(entries, table, per_sample_weights=weights, mode="sum")

    @staticmethod
    def backward(context, gradient):
        table, entries, weights = context.saved_tensors
        sums = [torch.zeros(len(table)).scatter_add_(0, entries.flatten(), (weights * one[:, None]).flatten())
                for one in gradient.unbind(1)]
        return torch.stack(sums, 1), None, None


class Network:
    """Intensities of points in mm within a box."""

    def __init__(self, options, low, high, across):
        """`across`: mm, least side of a cell along the third axis, across the frames."""
        self.options, (self.low, self.high) = options, torch.tensor(np.array([low, high]), dtype=torch.float)[..., None]
        shrink = (min(options.finest, options.coarsest) / options.coarsest) ** (1 / max(1, options.levels - 1))
        cells = options.coarsest * shrink ** np.arange(options.levels)
        cells = np.stack([cells, cells, np.maximum(cells, across)], 1)
        # What each coordinate of a corner is multiplied by before they are joined by XOR: numbers of more bits than the
        # table has, or where all corners fit, powers of two that keep them apart.
        bits = [[(int(steps) + 1).bit_length() for steps in (high - low) / cell] for cell in cells]
        self.cells = torch.tensor(cells, dtype=torch.float)[..., None]
        self.factors = torch.tensor([[1, 1 << x, 1 << (x + y)] if x + y + z <= options.table_bits else HASH
                                     for x, y, z in bits])
        self.used = sum(1 << min(options.table_bits, sum(of)) for of in bits)
        self.table = (2e-4 * torch.rand(options.levels << options.table_bits, options.features) - 1e-4).requires_grad_()
        self.layers = torch.nn.Sequential(
            torch.nn.Linear(options.levels * options.features, options.width), torch.nn.ReLU(),
            torch.nn.Linear(options.width, options.width), torch.nn.ReLU(), torch.nn.Linear(options.width, 1))
        self.parameters = [self.table, *self.layers.parameters()]

    def entries(self, points):
        """Of the eight corners about each point, at every level: [levels * points, 8] places in the table; weights."""
        at = (points.T.clamp(self.low, self.high) - self.low) / self.cells  # [levels, 3, points]
        corner = at.floor()
        part = torch.stack([1 - (at - corner), at - corner], 2)  # [levels, 3, 2, points]
        hashed = corner.long() * self.factors[:, :, None]
        hashed = torch.stack([hashed, hashed + self.factors[:, :, None]], 2)
        first = (torch.arange(self.options.levels) << self.options.table_bits)[:, None, None, None, None]
        x, y, z = (hashed[:, 0, :, None, None], hashed[:, 1, None, :, None], hashed[:, 2, None, None])
        places = ((x ^ y ^ z) & ((1 << self.options.table_bits) - 1)) + first
        x, y, z = (part[:, 0, :, None, None], part[:, 1, None, :, None], part[:, 2, None, None])
        return (all_.reshape(self.options.levels, 8, -1).transpose(1, 2).reshape(-1, 8) for all_ in (places, x * y * z))

    def __call__(self, points):
        features = Lookup.apply(self.table, *self.entries(points)).reshape(self.options.levels, len(points), -1)
        return self.layers(features.transpose(0, 1).reshape(len(points), -1)).squeeze(1)


def seconds():
    """Of all threads' processors each: those of a clock where nothing else runs."""
    return time.process_time() / torch.get_num_threads()


def train(network, points, truth, options, generator):
    """Least squares over random points. Returns how many steps were taken."""
    optimizer = torch.optim.Adam(network.parameters, lr=options.rate, betas=(0.9, 0.99), eps=1e-15)
    begin, step, done = seconds(), 0, 0.0
    while done < 1:
        optimizer.param_groups[0]["lr"] = options.rate * (0.01 + 0.99 * (1 + math.cos(math.pi * done)) / 2)
        chosen = torch.randint(len(points), (options.batch,), generator=generator)
        optimizer.zero_grad()
        (network(points[chosen]) - truth[chosen]).square().mean().backward()
        optimizer.step()
        step += 1
        done = step / options.steps if options.steps else (seconds() - begin) / options.time_limit
    return step


def learn(folder, options, seed):
    """From Outside's first run to its second: seconds, bytes and facts."""
    begin = seconds()
    torch.manual_seed(seed)
    planes = list(Plane.read(folder / "training.txt"))
    pixels = np.fromfile(folder / "training.f32", np.float32)
    # Axes of the middle frame, whose normal is the third: between frames there is less to know than within them.
    middle = planes[len(planes) // 2]
    axes = np.linalg.qr(np.stack([middle.column_step, middle.row_step], 1), "complete")[0]
    points = np.concatenate([plane.points() @ axes for plane in planes])
    places = points[:, 2].reshape(len(planes), -1).mean(1)
    across = np.abs(np.diff(places)).mean() if len(planes) > 1 else options.coarsest
    network, lit = Network(options, points.min(0), points.max(0), across), np.isfinite(pixels)
    steps = train(network, torch.from_numpy(points[lit].astype(np.float32)), torch.from_numpy(pixels[lit]), options,
                  torch.Generator().manual_seed(seed))
    spent = seconds() - begin
    with open(folder / "predicted.f32", "wb") as out, torch.no_grad():
        for plane in Plane.read(folder / "asked.txt"):
            for part in torch.from_numpy((plane.points() @ axes).astype(np.float32)).split(AT_ONCE):
                out.write(network(part).clamp(0, 1).numpy().tobytes())
    kept = network.used * options.features + sum(one.numel() for one in network.parameters[1:])
    return {"seconds": spent, "bytes": 4 * kept, "facts": {"steps": steps, "finest_cell": options.finest}}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    program = Path(__file__).resolve().parents[3] / "build/bin/bigusExperiment"
    for name, default in (("--data", "."), ("--cache", ""), ("--program", program)):
        parser.add_argument(name, default=default)
    arguments = parser.parse_args()
    if torch is None:
        sys.exit("hash_grid.py: PyTorch is missing; 'pip install torch', in an environment of its own, brings it.")
    try:
        job = json.load(sys.stdin)
        options = read_options(job["method"])
        with tempfile.TemporaryDirectory() as folder:
            outside = json.dumps({**job, "method": {"name": "outside", "folder": folder}})
            run = [arguments.program, "--data", arguments.data] + ["--cache", arguments.cache] * bool(arguments.cache)
            subprocess.run(run, input=outside, stdout=subprocess.DEVNULL, text=True, check=True)
            made = learn(Path(folder), options, job.get("seed", 1))
            answer = subprocess.run(run, input=outside, stdout=subprocess.PIPE, text=True, check=True)
    except subprocess.CalledProcessError:  # which has said why
        sys.exit(1)
    except (ValueError, TypeError, KeyError, OSError) as error:
        sys.exit(f"hash_grid.py: {error}")
    made["device"] = f"PyTorch {torch.__version__}, {torch.get_num_threads()} threads"
    print(json.dumps({**json.loads(answer.stdout), **made, "job": job}, indent=1))


if __name__ == "__main__":
    main()
