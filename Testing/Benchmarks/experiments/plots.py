"""Plain plots of what the tables say."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from harness import groups, mean, value  # noqa: E402


def draw(experiment, jobs, path):
    """The experiment's panels side by side, into a PNG."""
    panels = experiment.panels(jobs)
    figure, axes = plt.subplots(1, len(panels), figsize=(5.6 * len(panels), 4.6), constrained_layout=True,
                                squeeze=False)
    for axis, panel in zip(axes[0], panels):
        panel(axis)
        axis.grid(True, color="#dddddd", linewidth=0.8)
        axis.set_axisbelow(True)
    figure.suptitle(experiment.title, fontsize=11)
    part = path.with_name(path.stem + ".part.png")
    figure.savefig(part, dpi=110)
    part.replace(path)
    plt.close(figure)


def bars(jobs, path, title, label):
    """One bar a row of the table, with the spread over seeds as a whisker."""
    def panel(axis):
        rows = [(label(labels), members) for labels, members in groups(jobs) if mean(members, path) is not None]
        for k, (_, members) in enumerate(rows):
            values = [v for v in (value(job.result, path) for job in members if job.result) if v is not None]
            middle = sum(values) / len(values)
            axis.barh(k, middle, color="#4878a8", height=0.7,
                      xerr=[[middle - min(values)], [max(values) - middle]] if len(values) > 1 else None)
        axis.set_yticks(range(len(rows)), [name for name, _ in rows], fontsize=7)
        axis.invert_yaxis()
        known = [mean(members, path) for _, members in rows]
        if known:
            room = max(known) - min(known) or 1
            axis.set_xlim(min(known) - 0.3 * room, max(known) + 0.1 * room)
        axis.set_xlabel(title)
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
