#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws the quickstart's panel and training curve and writes its report, from the files that 'bigus' made.

    report.py FOLDER --frame HELD_OUT_FRAME --reduce N
"""
import argparse
import csv
import json
import pathlib
import textwrap

import matplotlib
import numpy as np

import bigus

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

FIELD_COLOUR, ORTHOGONAL_COLOUR, OBLIQUE_COLOUR = "#1668b0", "#d1690e", "#2b8a3e"
METHODS = (("nearest", "nearest frame"), ("neighbour_average", "neighbour average"),
           ("pose_interpolation", "pose interpolation"), ("compounding", "voxel compounding"))


def read_png(path):
    pixels = plt.imread(path)  # 8-bit grey becomes float in [0, 1]
    return pixels if pixels.ndim == 2 else pixels[..., 0]


def reduced(image, n):
    """Box average of n x n pixels, as --reduce does it."""
    height, width = (size // n for size in image.shape)
    return image[:height * n, :width * n].reshape(height, n, width, n).mean(axis=(1, 3))


def read_planes(path):
    """[(matrix, width, height)] of a CSV of poses."""
    with open(path, newline="") as file:
        return [(np.array([float(row[f"m{i}{j}"]) for i in range(4) for j in range(4)]).reshape(4, 4),
                 int(row["width"]), int(row["height"])) for row in csv.DictReader(file)]


def outline(matrix, width, height):
    """The corners of an image in space, closed: [5, 3] mm."""
    corners = np.array([(0, 0), (width - 1, 0), (width - 1, height - 1), (0, height - 1), (0, 0)])
    return corners @ matrix[:3, :2].T + matrix[:3, 3]


def scale_bar(axes, extent, colour):
    """A bar of a round number of millimetres, lower right."""
    wide, deep = extent
    length = max(step for step in (1, 2, 5, 10, 20, 50) if step <= max(wide / 3, 1))
    x, y = wide * 0.96 - length, deep * 0.94
    axes.plot([x, x + length], [y, y], color=colour, linewidth=3, solid_capstyle="butt")
    axes.text(x + length / 2, y - 0.02 * deep, f"{length} mm", color=colour, ha="center", va="bottom", fontsize=8)


def decision(answer, name):
    """What was chosen and why; None where it was not open."""
    return next((d for d in answer["decisions"] if d["decision"] == name), None)


def show(axes, image, matrix, title, colour, bar="white", down="depth, mm", **style):
    """An image with its axes in millimetres."""
    side = np.linalg.norm(matrix[:3, :2], axis=0)
    extent = image.shape[1] * side[0], image.shape[0] * side[1]
    picture = axes.imshow(image, extent=(0, extent[0], extent[1], 0), interpolation="nearest",
                          **{"cmap": "gray", "vmin": 0, "vmax": 1, **style})
    axes.set_title(title, fontsize=10, color=colour)
    axes.tick_params(labelsize=7)
    axes.set_xlabel("mm", fontsize=7, labelpad=1)
    axes.set_ylabel(down, fontsize=7, labelpad=1)
    for spine in axes.spines.values():
        spine.set_color(colour)
        spine.set_linewidth(2)
    scale_bar(axes, extent, bar)
    return picture


def scored_methods(answer):
    """[(name, scores)] of the plain methods; none when they could not be scored."""
    return [(name, answer["baselines"][key]) for key, name in METHODS] if answer["baselines"] else []


def show_scores(axes, answer):
    """Held-out PSNR of the field above that of the plain methods."""
    baselines = scored_methods(answer)
    names = ["this field"] + [name for name, _ in baselines]
    scores = [answer["held_out"]] + [score for _, score in baselines]
    values = [score["psnr"] for score in scores]
    places = np.arange(len(names))[::-1]
    axes.barh(places, values, color=[FIELD_COLOUR] + ["#b5b9be"] * len(baselines), height=0.72)
    for place, name, score in zip(places, names, scores):
        axes.text(0.4, place, name, va="center", fontsize=8, color="white" if name == "this field" else "black")
        axes.text(score["psnr"] + 0.3, place, f"{score['psnr']:.2f} dB\nSSIM {score['ssim']:.3f}", va="center",
                  fontsize=7)
    axes.set_xlim(0, max(values) * 1.33)
    axes.set_yticks([])
    axes.tick_params(labelsize=7)
    axes.set_xlabel("PSNR, dB (longer is better)", fontsize=7, labelpad=1)
    axes.set_title(f"All {answer['held_out']['frames']} held-out frames", fontsize=10)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)


def show_places(axes, sweep, frame, planes):
    """The sweep's frames and the planes shown, in space, as the held-out frame sees them: depth points down."""
    count, height, width = bigus.frames(sweep).shape
    poses = bigus.poses(sweep)
    across, down = (poses[frame, :3, k] / np.linalg.norm(poses[frame, :3, k]) for k in range(2))
    axes_of_view = np.stack([across, np.cross(down, across), -down])
    top = poses[frame] @ ((width - 1) / 2, 0, 0, 1)

    def draw(plane, **style):
        axes.plot(*((outline(*plane) - top[:3]) @ axes_of_view.T).T, **style)

    for k in range(0, count, max(count // 16, 1)):
        draw((poses[k], width, height), color="#9aa0a6", linewidth=0.6)
    for plane, colour in (((poses[frame], width, height), FIELD_COLOUR),
                          (planes[0], ORTHOGONAL_COLOUR), (planes[1], OBLIQUE_COLOUR)):
        draw(plane, color=colour, linewidth=2)
    axes.set_aspect("equal")
    axes.view_init(elev=22, azim=-55)
    axes.locator_params(nbins=4)
    axes.tick_params(labelsize=6, pad=-2)
    for set_label, name in ((axes.set_xlabel, "across"), (axes.set_ylabel, "along"), (axes.set_zlabel, "depth, mm")):
        set_label(name, fontsize=7, labelpad=-6)
    axes.set_title("Where these planes lie (sweep in grey)", fontsize=10)


def draw_panel(folder, sweep, frame, n, answer):
    planes = read_planes(folder / "planes.csv")
    pose = bigus.poses(sweep)[frame].copy()
    pose[:3, :2] *= n
    pixels = bigus.frames(sweep)[frame]
    white = 65535.0 if pixels.dtype == np.uint16 else 255.0 if pixels.dtype == np.uint8 else 1.0
    truth = reduced(pixels / white, n)
    prediction = read_png(folder / "held-out.png")
    error = prediction - truth
    known = (folder / "orthogonal-truth.png").exists()

    figure = plt.figure(figsize=(15, 8.2), constrained_layout=True)
    upper, lower = figure.subfigures(2, 1)
    axes = upper.subplots(1, 4)
    show(axes[0], truth, pose, f"Truth: frame {frame}, never trained on", FIELD_COLOUR)
    mse = np.mean(error ** 2)
    quality = f"{-10 * np.log10(mse):.1f} dB" if mse > 0 else "exact"
    show(axes[1], prediction, pose, f"Prediction from the field, {quality}", FIELD_COLOUR)
    # The least range that 95 % of the pixels keep to: a wider one would leave the map white but for a few dots.
    limit = next((step for step in (0.02, 0.05, 0.1, 0.2) if np.percentile(np.abs(error), 95) <= step), 0.5)
    picture = show(axes[2], error, pose, f"Error, colours end at {100 * limit:.0f} % of white", FIELD_COLOUR,
                   bar="black", cmap="RdBu_r", vmin=-limit, vmax=limit)
    bar = upper.colorbar(picture, ax=axes[2], shrink=0.8, extend="both")
    bar.ax.tick_params(labelsize=7)
    bar.set_label("too dark    (share of white)    too bright", fontsize=7)
    show_scores(axes[3], answer)

    # Below, the planes the probe never took; beside each, where it is known, what is really there.
    grid = lower.add_gridspec(1, 5 if known else 3, width_ratios=[1.4, 1, 1, 1, 1] if known else [1, 1, 1])
    show_places(lower.add_subplot(grid[0], projection="3d"), sweep, frame, planes)
    column = 1
    for name, (matrix, _, _), colour in (("orthogonal", planes[0], ORTHOGONAL_COLOUR),
                                         ("oblique", planes[1], OBLIQUE_COLOUR)):
        down = "depth, mm" if name == "orthogonal" else "down the plane, mm"
        show(lower.add_subplot(grid[column]), read_png(folder / f"{name}.png"), matrix, f"Field, {name} plane", colour,
             down=down)
        column += 1
        if known:
            show(lower.add_subplot(grid[column]), read_png(folder / f"{name}-truth.png"), matrix,
                 f"Truth, {name} plane", colour, down=down)
            column += 1
    note = "Black rims lie outside the sweep."
    beam = decision(answer, "probe's beam")
    if beam:
        note += f"  Planes across the frames are seen through the probe's beam: {beam['choice']} (standard deviation)."
    if known:
        note += ("  A shadow lies where the sweep's probe cast it; the truth beside it is seen by a probe held at that "
                 "plane, which casts its own.")
    lower.supxlabel(note, fontsize=8, color="#555555")
    figure.suptitle(f"BIGUS: {answer['training_frames']} frames as {answer['gaussians']:,} Gaussians, decided and "
                    f"trained in {answer['seconds']:.0f} s on {answer['device']}", fontsize=12)
    figure.savefig(folder / "panel.png", dpi=100)
    plt.close(figure)


def draw_curve(folder, answer):
    with open(folder / "training.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    seconds = [float(row["seconds"]) for row in rows]
    figure, axes = plt.subplots(figsize=(8, 4.5), constrained_layout=True)
    axes.plot(seconds, [float(row["loss"]) for row in rows], color=FIELD_COLOUR)
    axes.set_yscale("log")
    axes.set_xlim(0, max(answer["seconds"], *seconds, 1e-3))
    axes.set_xlabel("seconds since the start")
    axes.set_ylabel("training loss, share of white", color=FIELD_COLOUR)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("{x:g}")
    axes.grid(True, which="both", alpha=0.25)
    # What comes before the first step.
    decided = sum(d["seconds"] for d in answer["decisions"])
    first = seconds[0] if seconds else answer["seconds"]
    for begin, end, what, shade in ((0, min(decided, first), "deciding", "#eef1f4"),
                                    (min(decided, first), first, "seeding", "#dfe5ea")):
        if end - begin > 0.01 * answer["seconds"]:
            axes.axvspan(begin, end, color=shade, zorder=0)
            axes.text((begin + end) / 2, 0.5, what, rotation=90, ha="center", va="center", fontsize=8, color="#555555",
                      transform=axes.get_xaxis_transform())
    validated = [(t, float(row["validation_psnr"])) for t, row in zip(seconds, rows) if row["validation_psnr"]]
    if validated:
        other = axes.twinx()
        other.plot(*zip(*validated), color=ORTHOGONAL_COLOUR)
        other.axhline(answer["held_out"]["psnr"], color=OBLIQUE_COLOUR, linestyle="--", linewidth=1)
        other.text(seconds[-1], answer["held_out"]["psnr"], "held-out frames, at the end ", color=OBLIQUE_COLOUR,
                   ha="right", va="top", fontsize=8)
        other.set_ylabel(f"PSNR on {answer['validation_frames']} validation frames, dB", color=ORTHOGONAL_COLOUR)
    axes.set_title(f"{answer['iterations']} steps, {answer['gaussians']:,} Gaussians at the end")
    figure.savefig(folder / "training-curve.png", dpi=100)
    plt.close(figure)


TERMS = """
held out         frames that took no part in anything but this score
validation       frames kept from training to see when it stops gaining; the field of the best moment is kept
PSNR             10 log10(white^2 / mean squared error): 6 dB more is half the error
SSIM             likeness of local structure, 1 for equal images
BFS              likeness of speckle statistics, 1 for equal ones; it compares no pixels
detail           strength of what changes along the sweep slowly enough for the frames to tell
scratches        strength of what changes faster than the frames can tell, so was made up
beam             thickness of the ultrasound beam out of the image plane, standard deviation
Gaussian         one blob of the model, with place, shape and signed reflectivity
AVX2, AVX3, ...  the processor's instructions that were used (AVX3 stands for AVX-512)"""


def write_report(folder, sweep, n, answer):
    count = len(bigus.frames(sweep))
    held_out = answer["held_out"]
    probe = decision(answer, "probe's beam")
    beam = f"; the probe's is {probe['choice']} ({probe['evidence']})" if probe else ""
    lines = [f"Sweep            {count} frames, {answer['width']} x {answer['height']} pixels"
             + (f" after averaging {n} x {n}" if n > 1 else ""),
             f"Trained on       {answer['training_frames']} frames; {held_out['frames']} held out"
             + (f", {answer['validation_frames']} for validation" if answer["validation_frames"] else ""),
             f"Gaussians        {answer['gaussians']}",
             f"Beam             field trained with {answer['elevation_sigma']:.2f} mm" + beam,
             f"Training         {answer['iterations']} steps in {answer['seconds']:.1f} s, deciding included, on "
             f"{answer['device']}",
             f"Peak memory      {answer['peak_memory_bytes'] / 2 ** 20:.0f} MiB",
             f"Seed             {answer['seed']}"]
    # What was neither given nor left to geometry for want of time.
    found = [f"{d['decision']} {d['choice']}" for d in answer["decisions"] if " dB" in d["evidence"]]
    if found:
        lines += textwrap.wrap(", ".join(found), 100, initial_indent="Decided          ", subsequent_indent=" " * 17)
    lines += ["",
             "Held-out frames, mean       PSNR dB     SSIM",
             f"  {'this field':<22}{held_out['psnr']:>11.2f}{held_out['ssim']:>9.4f}"
             f"   (PSNR varies by {held_out['psnr_std']:.2f} between frames; BFS {held_out['bfs']:.3f})"]
    tracked = answer["held_out_tracked"]
    if tracked != held_out:
        lines.append(f"  {'  at tracked poses':<22}{tracked['psnr']:>11.2f}{tracked['ssim']:>9.4f}"
                     "   (all others are at corrected poses)")
    for name, score in scored_methods(answer):
        lines.append(f"  {name:<22}{score['psnr']:>11.2f}{score['ssim']:>9.4f}")
    if answer["cross_planes"]:
        cross = answer["cross_planes"]
        lines += ["", f"Along the sweep  detail {cross['detail']:.2f}, scratches {cross['scratches']:.2f}"
                      "; linear interpolation between frames has 1 and 1"]
    lines += ["", "The held-out frames took no part in training. The four methods below the field need no model: the",
              "nearest frame as it is, the mean of the two neighbouring frames, these two weighted by distance along",
              "their poses, and a voxel volume compounded from all training frames.", TERMS]
    (folder / "report.txt").write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--frame", type=int, required=True)
    parser.add_argument("--reduce", type=int, default=1)
    options = parser.parse_args()

    answer = json.loads((options.folder / "training.json").read_text())
    sweep = bigus.read(options.folder / "sweep.igs.mha")
    draw_panel(options.folder, sweep, options.frame, options.reduce, answer)
    draw_curve(options.folder, answer)
    write_report(options.folder, sweep, options.reduce, answer)


if __name__ == "__main__":
    main()
