#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Speed against error: the table that `bigus-bench frontier --csv` writes, as one log-log plot.

    build/bin/bigus-bench frontier --csv frontier.csv
    Testing/Benchmarks/Speed/frontier.py frontier.csv [--output FOLDER]

Writes frontier.png into FOLDER (default: beside the table).
"""

import argparse
import csv
import math
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib import ticker  # noqa: E402

COLUMNS = ["tolerance", "precision", "evaluation", "threads", "ms", "min_ms", "max_ms", "max", "rms", "p999"]
# Colours that differ in print and to colour-blind eyes; one a way to evaluate.
STYLES = {
    ("float", "recurrence"): ("#0072b2", "o"),
    ("float", "direct"): ("#e69f00", "s"),
    ("double", "recurrence"): ("#009e73", "D"),
    ("double", "direct"): ("#cc79a7", "^"),
    ("float", "plain loop"): ("#555555", "x"),
}


def read(path):
    with open(path, newline="") as file:
        reader = csv.DictReader(file)
        if reader.fieldnames != COLUMNS:
            sys.exit(f"{path}: the first line should be {','.join(COLUMNS)}; is this a table of bigus-bench?")
        return [{key: value if key in ("precision", "evaluation") else float(value) for key, value in row.items()}
                for row in reader]


def curves(rows):
    """{(precision, evaluation, threads): its rows, the loosest tolerance first}."""
    out = {}
    for row in sorted(rows, key=lambda row: -row["tolerance"]):
        out.setdefault((row["precision"], row["evaluation"], int(row["threads"])), []).append(row)
    return out


def power(value):
    """1e-4 as a power of ten."""
    return f"$10^{{{round(math.log10(value))}}}$"


def plot(rows, path):
    figure, axes = plt.subplots(figsize=(8, 5.5), constrained_layout=True)
    most = max(int(row["threads"]) for row in rows)
    for (precision, evaluation, threads), points in curves(rows).items():
        colour, marker = STYLES[precision, evaluation]
        one = threads == 1
        label = f"{evaluation}, {precision}" if evaluation != "plain loop" else "plain loop, std::exp, float"
        axes.plot([p["max"] for p in points], [p["ms"] for p in points], color=colour, marker=marker, markersize=6,
                  markerfacecolor=colour if one else "white", linestyle="-" if one else "--", linewidth=1.5,
                  label=label if one else None)
    # Tolerances stand beside one curve; on the others they follow in the same order.
    for point in curves(rows).get(("double", "recurrence", 1)) or next(iter(curves(rows).values())):
        axes.annotate(power(point["tolerance"]), (point["max"], point["ms"]), textcoords="offset points", xytext=(6, 6),
                      fontsize=8, color="#555555")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
    axes.yaxis.set_minor_formatter(ticker.NullFormatter())
    axes.set_xlabel("largest error of a pixel, |dI| (I from 0 to 1)")
    axes.set_ylabel("milliseconds a slice")
    axes.grid(True, which="major", color="#dddddd", linewidth=0.8)
    axes.grid(True, which="minor", color="#eeeeee", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.set_title("Speed against error: 140000 Gaussians of 4 pixels, 512 x 512, oblique\n"
                   f"points: tolerance asked for, $10^{{-2}}$ (right) to $10^{{-6}}$; solid 1 thread, dashed {most}",
                   fontsize=10, loc="left")
    axes.set_xlim(right=20 * axes.get_xlim()[1])  # room for the legend
    axes.legend(fontsize=9, frameon=False, loc="center right")
    figure.savefig(path, dpi=150)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, help="written by bigus-bench frontier --csv")
    parser.add_argument("--output", type=Path, help="folder for the plot")
    options = parser.parse_args()
    folder = options.output or options.table.parent
    folder.mkdir(parents=True, exist_ok=True)
    plot(read(options.table), folder / "frontier.png")


if __name__ == "__main__":
    main()
