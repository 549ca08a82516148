# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs jobs of bigusExperiment once each, within a budget, and turns their results into tables.

A result is kept in a file named after its job, so nothing is run twice and an interrupted run goes on where it
stopped. Files appear whole or not at all.
"""

import csv
import hashlib
import json
import math
import os
import platform
import re
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass, field
from datetime import datetime, timezone
from fnmatch import fnmatchcase
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]


@dataclass
class Job:
    """What to run, and what the tables call it."""
    request: dict                  # for bigusExperiment; see Baselines/README.md
    labels: dict                   # column: value, for tables and plots
    seconds: float                 # it should take, all in all
    priority: int = 1              # 1 first; 3 only when there is time to waste
    result: dict = None            # what came of it
    state: str = "not run"         # or done, failed, no data

    @property
    def key(self):
        text = json.dumps(self.request, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:20]


def machine():
    """The processor, how many of it, and the system."""
    name = platform.processor() or platform.machine()
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                name = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} threads, {platform.system()} {platform.release()}"


def commit():
    """Of the source tree; empty outside a repository."""
    answer = subprocess.run(["git", "-C", str(PROJECT), "describe", "--always", "--dirty"], capture_output=True,
                            text=True)
    return answer.stdout.strip()


def write_whole(path, text):
    """A file that is there with all of its text, or not at all."""
    part = path.with_name(path.name + f".{os.getpid()}.part")
    part.write_text(text)
    part.replace(path)


@dataclass
class Runner:
    program: Path
    data: Path
    output: Path
    budget: float = math.inf       # seconds left to spend
    others: dict = field(default_factory=dict)  # programs of other versions, for jobs whose request has "program"
    ran: int = 0
    start: float = field(default_factory=time.monotonic)

    def missing(self, job):
        """The first data file the job needs that is not there."""
        scene = job.request["sweep"]
        for name in (scene.get("file"), scene.get("config"), scene.get("volume")):
            if name and not (self.data / name).is_file():
                return name
        return None

    def path(self, job):
        return self.output / "jobs" / f"{job.key}.json"

    def recall(self, job):
        """Takes the result from an earlier run, if there is one."""
        try:
            result = json.loads(self.path(job).read_text())
        except (OSError, ValueError):
            return False
        if result.get("job") != job.request:
            return False
        job.result, job.state = result, "done"
        return True

    def run(self, job):
        if self.recall(job):
            return
        if (missing := self.missing(job)):
            job.state = f"no data: {missing}"
            return
        if job.seconds > self.budget:
            job.state = "not run"
            return
        request = dict(job.request)
        other = request.pop("program", None)
        program = self.others.get(other) if other else self.program
        if program is None:
            job.state = f"no program: {other}"
            return
        began = time.monotonic()
        left = "" if math.isinf(self.budget) else f", {self.budget / 60:.1f} min left"
        print(f"[{began - self.start:6.0f} s{left}] {job.labels}, about {job.seconds:.0f} s", flush=True)
        command = [str(program), "--data", str(self.data), "--cache", str(self.output / "phantoms")]
        try:
            answer = subprocess.run(command, input=json.dumps(request), capture_output=True, text=True,
                                    timeout=4 * job.seconds + 120)
            if answer.returncode != 0:
                raise RuntimeError((answer.stderr.strip() or f"exit status {answer.returncode}").splitlines()[-1])
            result = json.loads(answer.stdout)
        except (subprocess.TimeoutExpired, RuntimeError, ValueError) as error:
            job.state = f"failed: {error}"
            print("    " + job.state, file=sys.stderr, flush=True)
            return
        finally:
            self.budget -= time.monotonic() - began
        result |= {"job": job.request, "machine": machine(), "commit": other or commit(), "wall_seconds": time.monotonic() - began,
                   "date": datetime.now(timezone.utc).isoformat(timespec="seconds")}
        self.path(job).parent.mkdir(parents=True, exist_ok=True)
        write_whole(self.path(job), json.dumps(result, indent=1))
        job.result, job.state = result, "done"
        self.ran += 1


def origin(result):
    """Which processor and program a result is of."""
    return result.get("origin") or "{machine}; {device}; version {version} ({commit})".format_map(result)


def restore(jobs, columns, rows, decided, page):
    """Jobs that were not run take what was published of them before: the numbers of their row, rounded as there, what
    was decided, and the origin that the page names. A row with any new result is left to that."""
    origins = dict(re.findall(r"^Machine(?: (\d+) \(\d+ rows?\))?: (.*)\.$", page, re.MULTILINE))
    origins[""] = " or ".join(text for _, text in re.findall(r"^(Machine)[^:]*: (.*)\.$", page, re.MULTILINE))
    for labels, members in groups(jobs):
        found = [row for row in rows if all(row.get(name, "") == str(label) for name, label in labels.items())]
        if not found or found[0][columns[0][0]][:1].isalpha() or any(job.result for job in members):
            continue
        for job in members:
            job.state, job.result = "done", {"published": found[0], "origin": " or ".join(
                origins.get(number, "") for number in found[0].get("measured", "").split() or [""])}
            for title, path, _ in columns:
                put(job.result, path.format(**job.labels), found[0].get(title, ""))
            made = [entry for entry in decided if entry["row"] == row_name(labels)]
            if made:
                job.result.setdefault("facts", {})["decisions"] = [
                    {"what": entry["decided"], **entry, "seconds": float(entry["seconds"])} for entry in made]


def put(result, path, text):
    """The number of a table's cell under its path; of several seeds their mean."""
    *parts, last = path.split(".")
    try:
        number = float(text.split(" ±")[0])
    except ValueError:
        return
    for part in parts:
        result = result.setdefault(part, {})
    result[last] = number


# ---- tables ----

def value(result, path):
    """The number under a path such as scores.held_out.psnr; None where there is none."""
    for part in path.split("."):
        if not isinstance(result, dict) or result.get(part) is None:
            return None
        result = result[part]
    return result


def number(job, path):
    """The number of a job's result under a path; in it {degrees} stands for the job's label of that name."""
    return value(job.result, path.format(**job.labels))


def groups(jobs):
    """Jobs that differ by nothing but the seed: [(labels, [results])], in order; results may be empty."""
    found = {}
    for job in jobs:
        labels = tuple((name, label) for name, label in job.labels.items() if name != "seed")
        found.setdefault(labels, []).append(job)
    return [(dict(labels), members) for labels, members in found.items()]


def mean(jobs, path):
    """Over the jobs that are done; None when none is."""
    values = [number(job, path) for job in jobs if job.result]
    values = [v for v in values if v is not None]
    return statistics.fmean(values) if values else None


def cell(jobs, path, places):
    """Mean, and the spread over seeds where there are several; without `places` each of them."""
    values = [number(job, path) for job in jobs if job.result]
    values = [v for v in values if v is not None]
    if not values:
        return "–"
    if places is None:
        return " ".join(f"{value:g}" for value in values)
    text = f"{statistics.fmean(values):.{places}f}"
    return text + (f" ± {statistics.stdev(values):.{places}f}" if len(values) > 1 else "")


def table(jobs, columns):
    """One dictionary a row, {title of a column: text}, labels first. columns: [(title, path in the result, decimal
    places, None for each seed's number)]. Rows that were not run say so in their first number's place."""
    rows = groups(jobs)
    names = list(dict.fromkeys(name for labels, _ in rows for name in labels))
    lines = []
    for labels, members in rows:
        row = {name: str(labels.get(name, "")) for name in names}
        if (kept := members[0].result or {}).get("published"):
            row |= {title: kept["published"].get(title, "–") for title, _, _ in columns}
        elif any(job.result for job in members):
            row |= {title: cell(members, path, places) for title, path, places in columns}
        else:
            row |= {title: "" for title, _, _ in columns} | {columns[0][0]: members[0].state.split(":")[0]}
        lines.append(row)
    return lines


def markdown(rows, without=""):
    """Rows of table() for a reader. `without`: a column to leave out. So are columns in which no row says anything."""
    names = [name for name in rows[0] if name != without and any(row[name] not in ("", "–") for row in rows)]
    lines = ["| " + " | ".join(names) + " |", "|---" * len(names) + "|"]
    lines += ["| " + " | ".join(row[name] for name in names) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def write_rows(rows, path):
    """Rows of table() as CSV."""
    part = path.with_name(path.name + ".part")
    with open(part, "w", newline="") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(name for row in rows for name in row)), restval="",
                                lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    part.replace(path)


def read_rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def summary(rows, corner, down, across):
    """A few numbers of a table. down: {title: labels of the rows}; across: {title: (more labels, column)}. Each cell
    is that column of the row with both sets of labels, or a dash. A label may be a pattern such as 'compounding, * mm':
    of the rows that match the largest number is taken."""
    lines = ["| " + " | ".join([corner, *across]) + " |", "|---" * (1 + len(across)) + "|"]
    for title, labels in down.items():
        cells = [title]
        for more, column in across.values():
            wanted = {**labels, **more}.items()
            found = [row[column] for row in rows
                     if all(fnmatchcase(row[name], str(label)) for name, label in wanted) and row[column][:1].isdigit()]
            cells.append(max(found, key=lambda text: float(text.split()[0]), default="–"))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def row_name(labels):
    return ", ".join(str(label) for label in labels.values() if label != "")


def decisions(jobs):
    """What the trainer decided by itself, and why: rows, none where it did not."""
    rows = []
    for labels, members in groups(jobs):
        made = value(members[0].result, "facts.decisions") if members[0].result else None
        open_ones = [entry for entry in made or [] if entry["evidence"] != "given"]
        rows += [{"row": row_name(labels), "decided": entry["what"], "choice": entry["choice"], "evidence": entry["evidence"],
                  "seconds": f"{entry['seconds']:.1f}"} for entry in open_ones]
    return rows


def flat(result, prefix=""):
    """Every number and word of a result by its path; lists are left out."""
    for name, entry in result.items():
        if isinstance(entry, dict):
            yield from flat(entry, f"{prefix}{name}.")
        elif not isinstance(entry, list):
            yield prefix + name, entry


def write_csv(jobs, path):
    """Everything known about every job, one a line."""
    rows = []
    for job in jobs:
        known = dict(flat({k: v for k, v in job.result.items() if k not in ("job", "published")})) if job.result else {}
        rows.append({**job.labels, "seed": job.request.get("seed", 1), "state": job.state, **known,
                     "job": json.dumps(job.request, sort_keys=True)})
    names = list(dict.fromkeys(name for row in rows for name in row))
    part = path.with_name(path.name + ".part")
    with open(part, "w", newline="") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)
    part.replace(path)
