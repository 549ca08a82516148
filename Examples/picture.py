#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws slices of a field beside the truth, and their error, as in the README.

    picture.py PICTURE.png [--field FIELD.vtp]

The sweep is a phantom. The upper row is a frame that was held out of training. The lower row is a plane turned out of
the frames, so no frame shows it; the phantom computes its truth. Training takes a few minutes. A field that is there
already is taken as it is.
"""
import argparse
import pathlib
import sys

import matplotlib
import numpy as np
import PIL.Image
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.util.numpy_support import vtk_to_numpy

import bigus
from slices_at_poses import planes_about_depth

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

HOLD_OUT, FRAME = 8, 60  # the frame lies in the middle of the sweep and is held out, because 60 % 8 == 8 / 2
TURNS = 7                # planes in half a turn about the depth axis: the frame's own, and the next, 26 degrees on
ERROR = 0.3              # share of white at which the colours of the error end
GREYS, COLOURS = 28, 21  # in the file: few of them keep it small, because speckle hardly compresses


def phantom():
    """A hand-held convex probe over 36 mm: vessels, a cyst, a tumour and a bone, seen through a beam 0.8 mm thick."""
    source = bigus.vtkBigusPhantomSource()
    source.SetProbeToConvex()
    source.SetNumberOfFrames(120)
    source.SetFrameSpacing(0.3)
    return source


def truth_at(source, plane, size):
    """What the probe would show there and the pixels that its beams reach: float and bool, [row, column]."""
    matrix, truth = vtkMatrix4x4(), vtkImageData()
    matrix.DeepCopy(plane.ravel())
    source.ComputeTruth(matrix, *size, truth)
    image = bigus.frames(truth)[0] / 255
    return image, vtk_to_numpy(truth.GetFieldData().GetArray("Mask")).reshape(image.shape) > 0


def field_of(sweep, path):
    if path and path.exists():
        return bigus.read(path)
    field, _ = bigus.train(sweep, lambda share, text: print(f"\r{100 * share:3.0f} %  {text}", end="", file=sys.stderr),
                           HoldOut=HOLD_OUT, Automatic=False, Gaussians=120000, Iterations=800)
    if path:
        bigus.write(field, path)
    return field


def palette():
    """Greys for the images and colours for the error."""
    greys = np.repeat(np.linspace(0, 255, GREYS)[:, None], 3, axis=1)
    colours = 255 * plt.get_cmap("RdBu_r")(np.linspace(0, 1, COLOURS))[:, :3]
    image = PIL.Image.new("P", (1, 1))
    image.putpalette(np.vstack((greys, colours)).round().astype(np.uint8).tobytes())
    return image


def draw(rows, path):
    """Rows of (label, truth, image): three pictures each, with the titles above the first row."""
    height, width = rows[0][1].shape
    left, gap, top, side = 0.24, 0.04, 0.28, 3.3  # inches
    deep = side * height / width
    figure = plt.figure(figsize=(left + 3 * side + 2 * gap, top + len(rows) * (deep + gap)))
    total = figure.get_size_inches()
    grey = {"cmap": "gray", "vmin": 0, "vmax": 1}
    signed = {"cmap": "RdBu_r", "vmin": -ERROR, "vmax": ERROR}
    for row, (label, truth, image) in enumerate(rows):
        bottom = total[1] - top - (row + 1) * deep - row * gap
        figure.text(0.5 * left / total[0], (bottom + 0.5 * deep) / total[1], label, rotation=90, fontsize=9,
                    ha="center", va="center")
        score = bigus.metrics(image.astype(np.float32), truth.astype(np.float32))["psnr"]
        for column, (pixels, style, title, note) in enumerate((
                (truth, grey, "Truth", ""),
                (image, grey, "Slice of the field", f"{score:.1f} dB"),
                (image - truth, signed, f"Error, -{ERROR:.0%} to {ERROR:.0%} of white; red: too bright", ""))):
            place = (left + column * (side + gap)) / total[0], bottom / total[1], side / total[0], deep / total[1]
            axes = figure.add_axes(place)
            axes.imshow(pixels, interpolation="antialiased", **style)
            axes.set_axis_off()
            if row == 0:
                axes.set_title(title, fontsize=9, pad=4)
            axes.text(width * 0.985, height * 0.985, note, color="white", fontsize=9, ha="right", va="bottom")
    figure.savefig(path, dpi=100)
    plt.close(figure)
    with PIL.Image.open(path) as picture:
        small = picture.convert("RGB").quantize(palette=palette(), dither=PIL.Image.Dither.NONE)
    small.save(path, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=pathlib.Path)
    parser.add_argument("--field", type=pathlib.Path)
    options = parser.parse_args()

    source = phantom()
    source.Update()
    sweep = source.GetOutput()
    field = field_of(sweep, options.field)
    count, height, width = bigus.frames(sweep).shape
    planes = list(planes_about_depth(bigus.poses(sweep)[FRAME], width, height, TURNS))
    rows = []
    for label, plane in zip(("Frame held out of training", f"Plane {180 / TURNS:.0f}° out of the frames"), planes):
        truth, fan = truth_at(source, plane, (width, height))
        image = bigus.reslice(field, plane, size=(width, height))
        rows.append((label, truth, np.where(fan, image, 0)))
    draw(rows, options.picture)


if __name__ == "__main__":
    main()
