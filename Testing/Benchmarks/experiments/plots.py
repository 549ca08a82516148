# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Plain plots of what the tables say."""

import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import LogLocator, NullLocator  # noqa: E402

from harness import groups, mean, number  # noqa: E402


def draw(experiment, jobs, path):
    """The experiment's panels, two or three in a row, into a PNG."""
    panels = experiment.panels(jobs)
    columns = len(panels) if len(panels) < 4 else 2 if len(panels) == 4 else 3
    rows = math.ceil(len(panels) / columns)
    figure, axes = plt.subplots(rows, columns, figsize=(5.2 * columns, 4.3 * rows), constrained_layout=True,
                                squeeze=False)
    for axis, panel in zip(axes.flat, panels):
        panel(axis)
        axis.grid(True, color="#dddddd", linewidth=0.8)
        axis.set_axisbelow(True)
    for axis in axes.flat[len(panels):]:
        axis.set_visible(False)
    figure.suptitle(experiment.title, fontsize=11)
    part = path.with_name(path.stem + ".part.png")
    figure.savefig(part, dpi=110)
    part.replace(path)
    plt.close(figure)


OURS, OTHERS = "#4878a8", "#999999"


def is_ours(members):
    return members[0].request["method"]["name"] == "bigus"


def dots(jobs, path, title, label):
    """One dot a row of the table, ours in blue, with the spread over seeds as a whisker. Dots, not bars: a decibel
    has no zero to start from."""
    def panel(axis):
        rows = [(label(labels), members) for labels, members in groups(jobs) if mean(members, path) is not None]
        for k, (_, members) in enumerate(rows):
            values = [v for v in (number(job, path) for job in members if job.result) if v is not None]
            middle = sum(values) / len(values)
            axis.errorbar(middle, k, xerr=[[middle - min(values)], [max(values) - middle]], fmt="o", capsize=2,
                          color=OURS if is_ours(members) else OTHERS)
        axis.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=7)
        axis.invert_yaxis()
        axis.set_xlabel(title)
    return panel


def spread(jobs, path, title, label):
    """Each seed of a row against the row's mean, for rows of several seeds."""
    def panel(axis):
        rows = []
        for labels, members in groups(jobs):
            values = [v for v in (number(job, path) for job in members if job.result) if v is not None]
            if len(values) > 1:
                rows.append((label(labels), [v - sum(values) / len(values) for v in values]))
        for k, (_, offsets) in enumerate(rows):
            axis.plot(offsets, [k] * len(offsets), "o", color=OURS, markersize=5, alpha=0.8)
        axis.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=7)
        axis.invert_yaxis()
        axis.set_xlabel(title)
    return panel


def gains(jobs, path, title, scene, variant, base):
    """By how much variants of each scene exceed the one called `base`: grouped bars."""
    def panel(axis):
        found = {}
        for labels, members in groups(jobs):
            found.setdefault(scene(labels), {})[variant(labels)] = mean(members, path)
        found = {name: variants for name, variants in found.items() if variants.get(base) is not None}
        names = list(dict.fromkeys(name for variants in found.values() for name in variants if name != base))
        height = 0.8 / max(1, len(names))
        for k, name in enumerate(names):
            at = [row + k * height for row, variants in enumerate(found.values()) if variants.get(name) is not None]
            by = [variants[name] - variants[base] for variants in found.values() if variants.get(name) is not None]
            axis.barh(at, by, height=height, label=name, align="edge")
        axis.axvline(0, color="#444444", linewidth=0.8)
        axis.set_yticks([row + 0.4 for row in range(len(found))], list(found), fontsize=8)
        axis.invert_yaxis()
        axis.set_xlabel(f"{title}, gain over {base} (dB)")
        if names:
            axis.legend(fontsize=7, frameon=False)
    return panel


def curves(jobs, x, y, series, titles, logarithmic=False):
    """y(members) over x(labels or members), a line for each series(labels). A series looks the same in every panel
    of the same rows, also where another has no points."""
    def panel(axis):
        lines, style = {}, {}
        for labels, members in groups(jobs):
            style.setdefault(series(labels), len(style))
            if not any(job.result for job in members):
                continue
            at, height = x(labels, members), y(members)
            if at is not None and height is not None:
                lines.setdefault(series(labels), []).append((at, height))
        for name, points in lines.items():
            points.sort()
            axis.plot(*zip(*points), marker="osD^vx*P"[style[name] % 8], color=f"C{style[name] % 10}", markersize=5,
                      linewidth=1.4, label=name)
        if logarithmic:
            axis.set_xscale("log")
            axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
            axis.xaxis.set_major_formatter("{x:g}")
            axis.xaxis.set_minor_locator(NullLocator())
        axis.set_xlabel(titles[0])
        axis.set_ylabel(titles[1])
        if len(titles) > 2:
            axis.set_title(titles[2], fontsize=10)
        if lines:
            axis.legend(fontsize=7, frameon=False)
    return panel


def frontier(jobs, x, y, label, is_joined, titles):
    """y(members) over x(members), numbered, with the names beside; those that share a place share a mark. Rows that
    are `is_joined` are one method with a knob: a line goes through them."""
    def panel(axis):
        points = [(x(members), y(members), label(labels), is_ours(members)) for labels, members in groups(jobs)]
        points = sorted(point for point in points if None not in point[:2])
        if not points:
            return
        width = (points[-1][0] - points[0][0]) or 1
        height = (max(p[1] for p in points) - min(p[1] for p in points)) or 1
        places = []
        for point in points:
            near = [place for place in places if abs(place[0][0] - point[0]) < 0.04 * width
                    and abs(place[0][1] - point[1]) < 0.05 * height]
            if near:
                near[0].append(point)
            else:
                places.append([point])
        number = 0
        for place in places:
            first = number + 1
            for u, v, name, ours in place:
                number += 1
                axis.plot(u, v, "o" if ours else "s", color=OURS if ours else OTHERS, label=f"{number}  {name}")
            axis.annotate(str(first) if first == number else f"{first}-{number}", place[0][:2],
                          textcoords="offset points", xytext=(-2, 6), ha="right", fontsize=7)
        joined = [(u, v) for u, v, name, _ in points if is_joined(name)]
        if joined:
            axis.plot(*zip(*joined), color=OURS, linewidth=1, zorder=0)
        axis.set_xlabel(titles[0])
        axis.set_ylabel(titles[1])
        axis.set_title(titles[2], fontsize=10)
        axis.legend(fontsize=6, frameon=False, handlelength=1, loc="upper left", bbox_to_anchor=(1.03, 1.0))
    return panel


LEAST_ERROR = 1e-3  # a quarter of a grey level: where a logarithmic axis shows what has no error


def reliability(jobs, path, series, title):
    """What errors are over what they are said to be, root mean squares over pixels of about one standard error and all
    seeds; a line for each series(labels). A mark's area is its share of pixels; those of less than 0.1 % are left out."""
    def panel(axis):
        for line, (labels, members) in enumerate(groups(jobs)):
            bins = {}
            for sigma, error, count in (one for job in members if job.result for one in number(job, path) or []):
                squares = bins.setdefault(math.floor(2 * math.log2(sigma)), [0, 0, 0])
                for k, term in enumerate((sigma**2, error**2, 1)):
                    squares[k] += count * term
            total = sum(count for *_, count in bins.values())
            points = [(math.sqrt(sigma / count), max(math.sqrt(error / count), LEAST_ERROR), count / total)
                      for _, (sigma, error, count) in sorted(bins.items()) if count >= 1e-3 * total]
            if points:
                said, found, shares = zip(*points)
                axis.plot(said, found, color=f"C{line % 10}", linewidth=1.2, label=series(labels))
                axis.scatter(said, found, [8 + 150 * share for share in shares], color=f"C{line % 10}")
        axis.axline((0.01, 0.01), slope=1, color="#444444", linewidth=0.8)
        around = (0.8 * LEAST_ERROR, 0.5)
        axis.set(xscale="log", yscale="log", xlim=around, ylim=around, xlabel="standard error, as said",
                 ylabel="root mean square error")
        axis.set_title(title, fontsize=10)
        axis.legend(fontsize=7, frameon=False)
    return panel
