"""Plain plots of what the tables say."""

import math

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from harness import groups, mean, value  # noqa: E402


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


def bars(jobs, path, title, label):
    """One bar a row of the table, ours in blue, with the spread over seeds as a whisker."""
    def panel(axis):
        rows = [(label(labels), members) for labels, members in groups(jobs) if mean(members, path) is not None]
        for k, (_, members) in enumerate(rows):
            values = [v for v in (value(job.result, path) for job in members if job.result) if v is not None]
            middle = sum(values) / len(values)
            axis.barh(k, middle, color=OURS if is_ours(members) else OTHERS, height=0.7,
                      xerr=[[middle - min(values)], [max(values) - middle]] if len(values) > 1 else None)
        axis.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=7)
        axis.invert_yaxis()
        known = [mean(members, path) for _, members in rows]
        if known:
            room = max(known) - min(known) or 1
            axis.set_xlim(min(known) - 0.3 * room, max(known) + 0.1 * room)
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
    """y(members) over x(labels or members), a line for each series(labels)."""
    def panel(axis):
        lines = {}
        for labels, members in groups(jobs):
            if not any(job.result for job in members):
                continue
            at, height = x(labels, members), y(members)
            if at is not None and height is not None:
                lines.setdefault(series(labels), []).append((at, height))
        for k, (name, points) in enumerate(lines.items()):
            points.sort()
            axis.plot(*zip(*points), marker="osD^vx*P"[k % 8], markersize=5, linewidth=1.4, label=name)
        if logarithmic:
            axis.set_xscale("log")
        axis.set_xlabel(titles[0])
        axis.set_ylabel(titles[1])
        if len(titles) > 2:
            axis.set_title(titles[2], fontsize=10)
        if lines:
            axis.legend(fontsize=7, frameon=False)
    return panel
