#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The experiments on quality: what they ask is in README.md of this folder.

    experiments.py e1 [e2 ...|all] [--quick] [--output FOLDER] [--data FOLDER] [--budget MINUTES]
    experiments.py list              what would run, in which order, and how long it should take
    experiments.py publish           put tables and plots of --output into results/, and a few rows into README.md;
                                     rows that were not run stay as published, with the machine that they are of

For each experiment writes NAME.csv (all that is known), NAME.md and NAME-table.csv (the table), NAME-decisions.csv (what
the trainer decided) and NAME.png (the plot). Jobs run in the
order of their priority, over all the experiments asked for; each runs once, whatever the number of calls. What a budget
has no room for is listed as not run. --quick: the same on small pictures with few Gaussians, a minute or two each; it
shows that everything works and says nothing about quality.
"""

import argparse
import math
import os
import re
import sys
from pathlib import Path

import paper
import plots
from definitions import EXPERIMENTS, Scale
from harness import (PROJECT, Runner, decisions, groups, markdown, origin, read_rows, restore, summary, table, write_csv,
                     write_rows, write_whole)

HERE = Path(__file__).resolve().parent


def report(experiment, jobs, scale, folder):
    """The experiment's table, plot and CSV, of what has been run so far."""
    folder.mkdir(parents=True, exist_ok=True)
    name = experiment.name
    write_csv(jobs, folder / f"{name}.csv")
    done = [job for job in jobs if job.result]
    origins = sorted({origin(job.result) for job in done})
    tables = [(title, table(part, experiment.columns)) for title, part in experiment.tables(jobs)]
    if len(origins) > 1:
        for (_, part), (_, rows) in zip(experiment.tables(jobs), tables):
            for row, (_, members) in zip(rows, groups(part)):
                of = {origins.index(origin(job.result)) + 1 for job in members if job.result}
                row["measured"] = " ".join(map(str, sorted(of)))
    write_rows([row for _, rows in tables for row in rows], folder / f"{name}-table.csv")
    text = "".join((f"**{title}**\n\n" if title else "") + markdown(rows, experiment.split) + "\n"
                   for title, rows in tables)
    made = decisions(jobs) if experiment.shows_decisions else []
    if made:
        write_rows(made, folder / f"{name}-decisions.csv")
    if scale.is_quick:
        text += "Quick: pictures a quarter the size, 2 % of the Gaussians and of the time limits; no result.\n\n"
    left = [job for job in jobs if not job.result]
    if left:
        text += f"{len(left)} of {len(jobs)} jobs have no result: " + "; ".join(
            sorted({job.state for job in left})) + ".\n\n"
    measured = [row.get("measured", "").split() for _, rows in tables for row in rows]
    for k, text_of in enumerate(origins, 1):
        count = sum(str(k) in of for of in measured)
        text += f"Machine{f' {k} ({count} rows)' if len(origins) > 1 else ''}: {text_of}.\n"
    seeds = sorted({job.request.get("seed", 1) for job in done})
    text += f"Seeds: {', '.join(map(str, seeds))}.\n" if seeds else ""
    write_whole(folder / f"{name}.md", text)
    if done:
        plots.draw(experiment, jobs, folder / f"{name}.png")
    return text


def page(experiment, text, decided):
    """What the tables in CSV do not say: which jobs have no result, machines, versions and seeds."""
    said = [line for line in text.splitlines() if line and not line.startswith(("|", "**"))]
    name = experiment.name
    rows = f"Rows: [{name}.csv]({name}.csv)." + f" Decisions: [{name}-decisions.csv]({name}-decisions.csv)." * decided
    return "\n".join([f"# {experiment.title}", "", rows, "", *said]) + "\n"


def published(results, name):
    """Rows, decisions and page of an experiment, empty where it has none."""
    rows, decided, said = (results / f"{name}{end}" for end in (".csv", "-decisions.csv", ".md"))
    return (read_rows(rows) if rows.is_file() else [], read_rows(decided) if decided.is_file() else [],
            said.read_text() if said.is_file() else "")


def publish(runner, scale, priority):
    """Tables and plots of what has been run into results/, and a few rows of each into README.md. Runs nothing. Rows that
    --output does not have stay as they were published before, and say so."""
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    jobs = {name: experiment.jobs(scale) for name, experiment in EXPERIMENTS.items()}
    new = {name: [job for job in group if runner.recall(job)] for name, group in jobs.items()}
    for name, experiment in EXPERIMENTS.items():
        restore(jobs[name], experiment.columns, *published(results, name))
        if not new[name]:
            continue
        jobs[name] = [job for job in jobs[name] if job.priority <= priority or job.result]
        staged = runner.output / "published"
        made = report(experiment, jobs[name], scale, staged)
        for kept, at in ((f"{name}-table.csv", f"{name}.csv"), (f"{name}-decisions.csv", f"{name}-decisions.csv"),
                         (f"{name}.png", f"{name}.png")):
            if (staged / kept).is_file():
                (results / at).write_bytes((staged / kept).read_bytes())
        text = page(experiment, made, (results / f"{name}-decisions.csv").is_file())
        if experiment.is_long:
            text += "\n" + summary(read_rows(results / f"{name}.csv"), *experiment.summary)
        write_whole(results / f"{name}.md", text)
    # Published numbers are rounded, so gains are not told anew from these alone.
    if any(job.request["method"]["name"] in ("bigus", "ultragauss") for name in paper.EXPERIMENTS for job in new[name]):
        write_whole(results / "paper.md", "# The paper's figures and ours\n\n" + paper.table(jobs))
    readme = HERE / "README.md"
    text = readme.read_text()
    for name, experiment in EXPERIMENTS.items():
        rows = results / f"{name}.csv"
        if experiment.summary and not experiment.is_long and rows.is_file():
            # The first table below the experiment's heading.
            body = summary(read_rows(rows), *experiment.summary)
            text = re.sub(rf"(\n## {name.upper()}:(?:(?!\n#|\n\|).)*\n)(?:\|[^\n]*\n)+", lambda m: m.group(1) + body, text,
                          flags=re.DOTALL)
    write_whole(readme, text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="+", choices=[*EXPERIMENTS, "all", "list", "publish"])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--output", type=Path, default=Path("experiments"))
    parser.add_argument("--data", type=Path,
                        default=os.environ.get("BIGUS_DATA") or PROJECT.parent / "shared" / "data")
    parser.add_argument("--program", type=Path, default=PROJECT / "build/bin/bigusExperiment")
    parser.add_argument("--other", default=[], action="append", metavar="COMMIT=PROGRAM",
                        help="the program of rows that ask for another (e12: 92a5706; e11: hash-grid=hash_grid.py, in full)")
    parser.add_argument("--budget", type=float, default=math.inf, metavar="MINUTES")
    parser.add_argument("--priority", type=int, default=2, choices=[1, 2, 3],
                        help="leave out jobs above it that were not run before; 3 runs everything (default: 2)")
    parser.add_argument("--only", default="", metavar="TEXT", help="run only jobs with this in their row")
    options = parser.parse_args()
    output = options.output / ("quick" if options.quick else "full")
    named = [name for name in options.what if name in EXPERIMENTS]
    chosen = [EXPERIMENTS[name] for name in (named or EXPERIMENTS)]
    scale = Scale.quick() if options.quick else Scale()
    others = dict(other.split("=", 1) for other in options.other)
    runner = Runner(options.program, Path(options.data), output, 60 * options.budget, others)
    if "publish" in options.what:
        publish(runner, scale, options.priority)
        return 0
    jobs = {experiment.name: [job for job in experiment.jobs(scale)
                              if job.priority <= options.priority or runner.recall(job)]
            for experiment in chosen}
    # Stable: within a priority, experiments and their jobs in the order in which they are defined.
    queue = sorted((job for group in jobs.values() for job in group), key=lambda job: job.priority)
    if "list" in options.what:
        total, known = 0, set()
        for job in queue:
            new = job.key not in known and not runner.recall(job)
            known.add(job.key)
            total += job.seconds if new else 0
            print(f"{job.priority}  {job.seconds if new else 0:5.0f} s  {job.labels}")
        print(f"{len(queue)} jobs, {total / 60:.1f} minutes")
        return 0
    if not options.program.is_file():
        sys.exit(f"There is no program '{options.program}'; build bigusExperiment, or name it with --program.")
    try:
        for job in queue:
            if options.only in str(job.labels) or runner.recall(job):
                runner.run(job)
    finally:  # also when interrupted: what is there can be looked at
        for experiment in chosen:
            text = report(experiment, jobs[experiment.name], scale, output)
            print(f"\n{experiment.name}: {experiment.title}\n\n{text}", end="")
    failed = [job for job in queue if job.state.startswith("failed")]
    print(f"\n{runner.ran} jobs run, {len(failed)} failed.")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
