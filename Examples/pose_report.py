#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Draws what 'bigus poses' did: the probe's path, how far every frame moved, and the tracker's noise.

    bigus poses sweep.igs.mha -o corrected.igs.mha --json > poses.json
    pose_report.py poses.json PICTURE.png

The CSV of 'bigus poses SWEEP -o poses.csv' will do, too; it does not hold the noise. Several are drawn one below the
other, to compare settings.
"""
import argparse
import csv
import json
import textwrap

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

RECORDED, CORRECTED, OUTLIER = "#9aa0a6", "#1668b0", "#c92a2a"


def read_json(path):
    with open(path) as file:
        answer = json.load(file)
    each = answer["each_frame"]
    found = {name: np.array(each[name], dtype=float) for name in
             ("displacement", "rotation", "stroke", "recorded_centre", "corrected_centre")}
    found["times"] = each["timestamp"]
    found["outliers"] = answer["outliers"]
    found["noise"] = answer["noise"]
    found["title"] = f"{answer['frames']} frames, poses {answer['decision']['choice']}"
    return found


def read_csv(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    column = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
    poses = np.array([column[f"m{i}{j}"] for i in range(4) for j in range(4)]).T.reshape(-1, 4, 4)
    middle = np.stack([(column["width"] - 1) / 2, (column["height"] - 1) / 2, 0 * column["width"],
                       1 + 0 * column["width"]], axis=1)
    found = {name: column[name] for name in ("displacement", "rotation", "stroke")}
    found["recorded_centre"] = np.stack([column["recorded_" + axis] for axis in "xyz"], axis=1)
    found["corrected_centre"] = np.einsum("kij,kj->ki", poses, middle)[:, :3]
    found["times"] = column.get("timestamp")
    found["outliers"] = np.flatnonzero(column["outlier"])
    found["noise"] = None
    found["title"] = f"{len(rows)} frames, moved by {found['displacement'].mean():.2f} mm on average"
    return found


def draw(figure, found):
    """Four panels over the same frames."""
    recorded, corrected = found["recorded_centre"], found["corrected_centre"]
    outliers = np.asarray(found["outliers"], dtype=int)
    noise = found["noise"]
    when = np.arange(len(recorded)) if found["times"] is None else np.asarray(found["times"], dtype=float)
    breaks = when[1:][np.diff(found["stroke"]) != 0]

    axes = figure.subplots(2, 2)
    told = f"; tracker's noise {noise['translation']:.3f} mm and {noise['rotation']:.3f} degrees" if noise else ""
    figure.suptitle(textwrap.fill(found["title"] + told, 120), fontsize=12)

    # The plane in which the path is longest.
    middle = corrected.mean(axis=0)
    main = np.linalg.svd(corrected - middle, full_matrices=False)[2]
    flat = [(path - middle) @ main.T for path in (recorded, corrected)]
    axes[0, 0].plot(flat[0][:, 0], flat[0][:, 1], ".", color=RECORDED, markersize=4, label="recorded")
    for stroke in np.unique(found["stroke"]):
        part = flat[1][found["stroke"] == stroke]
        axes[0, 0].plot(part[:, 0], part[:, 1], color=CORRECTED, linewidth=1.2,
                        label="corrected" if stroke == found["stroke"][0] else None)
    axes[0, 0].plot(flat[0][outliers, 0], flat[0][outliers, 1], "x", color=OUTLIER, label=f"{len(outliers)} outliers")
    axes[0, 0].set(title="Path of the image's centre, where it is longest", xlabel="mm", ylabel="mm")
    axes[0, 0].set_aspect("equal", adjustable="datalim")
    axes[0, 0].legend(fontsize=8)

    for k, (name, colour) in enumerate(zip("xyz", ("#d1690e", "#2b8a3e", "#5f3dc4"))):
        axes[0, 1].plot(when, (recorded - corrected)[:, k], color=colour, linewidth=0.9, label=name)
    axes[0, 1].set(title="Recorded less corrected centre", ylabel="mm")
    axes[0, 1].legend(fontsize=8)

    for panel, name, unit, key, title in (
            (axes[1, 0], "displacement", "mm", "corner", "How far the image's corners moved"),
            (axes[1, 1], "rotation", "degrees", "rotation", "How far the image turned")):
        panel.vlines(when, 0, found[name], color=CORRECTED, linewidth=1)
        panel.plot(when[outliers], found[name][outliers], "x", color=OUTLIER)
        if noise:
            meaning = "noise at the corners, rms" if key == "corner" else "noise on each axis"
            panel.axhline(noise[key], color="black", linewidth=0.8, linestyle="--",
                          label=f"{meaning} {noise[key]:.3f} {unit}")
            panel.legend(fontsize=8)
        panel.set(title=title, ylabel=unit)
        panel.set_ylim(bottom=0)
    for panel in axes.flat[1:]:
        panel.set_xlabel("frame" if found["times"] is None else "s")
        for where in breaks:
            panel.axvline(where, color="black", linewidth=0.6, alpha=0.5)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("poses", nargs="+", help="what 'bigus poses --json' printed, or its CSV")
    parser.add_argument("picture")
    options = parser.parse_args()
    figure = plt.figure(figsize=(13, 7.5 * len(options.poses)), constrained_layout=True)
    parts = figure.subfigures(len(options.poses), 1, squeeze=False)[:, 0]
    for part, path in zip(parts, options.poses):
        draw(part, read_csv(path) if path.lower().endswith(".csv") else read_json(path))
    figure.savefig(options.picture, dpi=110)
    print(options.picture)


if __name__ == "__main__":
    main()
