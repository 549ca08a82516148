#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draw the frames of coordinates between a pixel and a sweep: the picture of Module/Python/Sources.md.

    coordinate_frames.py PICTURE.png
"""
import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

IMAGE, PROBE, REFERENCE, TRACKER = "#d55e00", "#0072b2", "#009e73", "#555555"  # told apart by most eyes


def flat(points):
    """An oblique view of points [..., 3]: x to the right, y into the page and up, z up."""
    points = np.asarray(points, float)
    return points[..., :2] * [1, 0] + np.stack([0.55 * points[..., 1], 0.4 * points[..., 1] + points[..., 2]], axis=-1)


def line(axes, points, **style):
    axes.plot(*flat(points).T, **style)


def arrow(axes, start, end, colour, width=1.6, bend=0.0):
    axes.annotate("", flat(end), flat(start), zorder=5,
                  arrowprops={"arrowstyle": "-|>", "color": colour, "lw": width, "connectionstyle": f"arc3,rad={bend}"})


def frame(axes, origin, directions, names, colour, length=1.0):
    for direction, name in zip(directions, names):
        end = np.asarray(origin) + length * np.asarray(direction, float)
        arrow(axes, origin, end, colour)
        at = flat(np.asarray(origin) + 1.18 * length * np.asarray(direction, float))
        axes.text(*at, name, color=colour, ha="center", va="center", fontsize=11, style="italic")
    axes.plot(*flat(origin), "o", color=colour, ms=5, zorder=6)


def label(axes, at, text, colour, **style):
    axes.text(*flat(at), text, color=colour, fontsize=10.5, **{"ha": "center", "va": "center", **style})


def draw_chain(axes):
    # The image: a plane below the probe, i along its columns, j down.
    corner, i, j = np.array([-1.7, 0.2, 2.3]), np.array([1, 0.12, 0]), np.array([0.1, 0.1, -1])
    corners = [corner, corner + 3.4 * i, corner + 3.4 * i + 2.6 * j, corner + 2.6 * j, corner]
    axes.fill(*flat(corners).T, color=IMAGE, alpha=0.13, lw=0)
    line(axes, corners, color=IMAGE, lw=1)
    frame(axes, corner, (i, j), ("", ""), IMAGE, 1.15)
    label(axes, corner + 1.1 * i + [0, 0, -0.22], "i", IMAGE, style="italic")
    label(axes, corner + 1.1 * j + [-0.22, 0, 0], "j", IMAGE, style="italic")
    label(axes, corner + 1.7 * i + 1.9 * j, "Image\npixel (i, j), counted from 0", IMAGE)
    # The probe stands on the image's upper edge.
    foot = corner + 1.7 * i
    body = [foot + d for d in ([-1.1, 0, 0.05], [-1.1, 0, 0.5], [-0.45, 0, 0.95], [-0.45, 0, 2.2], [0.45, 0, 2.2],
                               [0.45, 0, 0.95], [1.1, 0, 0.5], [1.1, 0, 0.05], [-1.1, 0, 0.05])]
    axes.fill(*flat(body).T, color="#dddddd", zorder=1)
    line(axes, body, color="#888888", lw=1)
    marker = foot + np.array([0, 0, 1.75])
    frame(axes, marker, ([0.9, 0.25, 0.1], [-0.2, 0.9, 0.3], [0, -0.2, 1]), ("x", "y", "z"), PROBE, 0.85)
    label(axes, marker + [-1.15, 0, 0.25], "Probe\nits marker", PROBE)
    # What the sweep lies in, and what measures.
    tracker, reference = np.array([6.0, 1.5, 3.3]), np.array([5.0, -0.6, -0.2])
    frame(axes, tracker, ([-0.9, 0.2, 0], [0.1, 0.8, -0.2], [0, 0, 1]), ("x", "y", "z"), TRACKER, 0.85)
    label(axes, tracker + [1.05, 0, 0.5], "Tracker", TRACKER, ha="left")
    frame(axes, reference, ([0.95, 0, 0], [0, 1, 0], [0, 0, 1]), ("x", "y", "z"), REFERENCE)
    label(axes, reference + [0.3, 0, -0.45], "Reference\nmm; the sweep lies here", REFERENCE)

    arrow(axes, corner + [-0.1, 0, 0.1], marker + [-0.1, 0, -0.05], IMAGE, 2.2, -0.55)
    label(axes, corner + [-1.55, 0, 1.2], "ImageToProbe\n--calibration, or\n--pixel-spacing and\n--origin-pixel", IMAGE)
    arrow(axes, marker + [0.2, 0, 0.12], tracker + [-0.15, 0, 0.1], PROBE, 2.2, -0.25)
    label(axes, 0.5 * (marker + tracker) + [0.1, 0, 1.3], "ProbeToTracker\na pose a frame: POSES", PROBE)
    arrow(axes, reference + [0.35, 0, 0.3], tracker + [0.15, 0, -0.15], REFERENCE, 2.2, 0.25)
    label(axes, reference + [2.75, 0, 2.0], "ReferenceToTracker\n--reference,\nif there is one", REFERENCE, ha="left")
    axes.text(2.6, 6.3, "ImageToReference = inverse(ReferenceToTracker) · ProbeToTracker · ImageToProbe", fontsize=12,
              ha="center")
    axes.set_xlim(-4.4, 9.6)
    axes.set_ylim(-1.1, 6.8)


def draw_pixels(axes):
    for k in range(5):
        axes.plot([k - 0.5, k - 0.5], [-0.5, 3.5], color="#bbbbbb", lw=1)
        axes.plot([-0.5, 3.5], [k - 0.5, k - 0.5], color="#bbbbbb", lw=1)
    for i in range(4):
        for j in range(4):
            axes.plot(i, j, ".", color=IMAGE, ms=5)
    for (i, j), text in {(0, 0): "(0, 0)", (1, 0): "(1, 0)", (0, 1): "(0, 1)"}.items():
        axes.text(i, j - 0.2, text, color=IMAGE, ha="center", va="center", fontsize=10)
        axes.text(i, j + 0.25, f"({i + 1}, {j + 1})", color="#999999", ha="center", va="center", fontsize=8.5)
    axes.annotate("", (3, 2), (2, 2), arrowprops={"arrowstyle": "<->", "color": "black"})
    axes.text(2.5, 1.8, "SX mm", ha="center", fontsize=9.5)
    axes.annotate("", (2, 3), (2, 2), arrowprops={"arrowstyle": "<->", "color": "black"})
    axes.text(1.93, 2.5, "SY mm", ha="right", va="center", fontsize=9.5)
    for end, name, at in (((1.5, -0.85), "i, along a row", (1.6, -0.85)), ((-0.85, 1.5), "j, down", (-1.05, 1.75))):
        axes.annotate("", end, (-0.5 if end[0] > 0 else -0.85, -0.85 if end[0] > 0 else -0.5),
                      arrowprops={"arrowstyle": "-|>", "color": IMAGE, "lw": 1.6})
        axes.text(*at, name, color=IMAGE, va="center", ha="left" if end[0] > 0 else "center")
    axes.set_title("A pixel's place is its middle;\ngrey: counted from 1 (TUS-REC)", fontsize=11)
    axes.set_xlim(-1.8, 3.6)
    axes.set_ylim(3.9, -1.3)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture")
    options = parser.parse_args()
    figure, (chain, pixels) = plt.subplots(1, 2, figsize=(12.5, 5), width_ratios=(2.6, 1), constrained_layout=True)
    draw_chain(chain)
    draw_pixels(pixels)
    for axes in (chain, pixels):
        axes.set_aspect("equal")
        axes.axis("off")
    figure.savefig(options.picture, dpi=90)


if __name__ == "__main__":
    main()
