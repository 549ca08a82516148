#!/usr/bin/env python3
"""What signed reflectivity, the beam and the seeding are each worth, on a phantom whose beam thickness is known.

    Testing/Benchmarks/ablation.py [--bigus build/bin/bigus] [--output FOLDER] [--seeds 1 2 3] [--spacing MM]

Trains the same field in every variant, one change at a time, and scores it on held-out frames (every 4th) and on as
many of the frames trained on. Writes ablation.csv and ablation.md (mean and standard deviation over seeds) and prints the table.
A variant whose scores are in FOLDER already is not run again, so an interrupted run goes on where it stopped.
"""

import argparse
import csv
import json
import statistics
import subprocess
from pathlib import Path

ELEVATION_SIGMA = 1.0  # mm, of the phantom's amplitude profile

VARIANTS = {
    "signed, beam of known thickness, intensity seeds": [],
    "positive only": ["--positive-only"],
    "beam at half the known thickness": ["--elevation-sigma", str(ELEVATION_SIGMA / 2)],
    "beam off (thin plane)": ["--elevation-sigma", "0"],
    "positive only, beam off": ["--positive-only", "--elevation-sigma", "0"],
    "Harris seeds": ["--seeding", "harris"],
    "random seeds": ["--seeding", "random"],
    "densification every 50 steps": ["--densify", "50"],
}


def run(command):
    return json.loads(subprocess.run([str(part) for part in command], check=True, stdout=subprocess.PIPE).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bigus", type=Path, default=Path("build/bin/bigus"))
    parser.add_argument("--output", type=Path, default=Path("ablation"))
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--spacing", type=float, default=0.5, help="mm between frames")
    parser.add_argument("--gaussians", type=int, default=50000)
    parser.add_argument("--iterations", type=int, default=360, help="the same for every variant")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)

    sweep = options.output / "phantom.igs.mha"
    if not sweep.exists():
        run([options.bigus, "phantom", "-o", sweep, "--elevation-sigma", ELEVATION_SIGMA, "--frame-spacing",
             options.spacing, "--json"])

    results = {}
    for name, change in VARIANTS.items():
        file_name = name.replace(" ", "-").replace(",", "")
        for seed in options.seeds:
            stem = options.output / f"{file_name}-{seed}"
            scores = Path(f"{stem}.json")
            if not scores.exists():
                beam = [] if "--elevation-sigma" in change else ["--elevation-sigma", ELEVATION_SIGMA]
                answer = run([options.bigus, "train", sweep, "-o", f"{stem}.vtp", "--gaussians", options.gaussians,
                              "--hold-out", 4, "--iterations", options.iterations, "--seed", seed,
                              "--no-baselines", "--json", *beam, *change])
                scores.write_text(json.dumps(answer))
            results.setdefault(name, []).append(json.loads(scores.read_text()))

    columns = {
        "held-out PSNR": lambda a: a["held_out"]["psnr"],
        "held-out SSIM": lambda a: a["held_out"]["ssim"],
        "held-out BFS": lambda a: a["held_out"]["bfs"],
        "trained PSNR": lambda a: a["trained"]["psnr"],
        "trained BFS": lambda a: a["trained"]["bfs"],
        "Gaussians": lambda a: a["gaussians"],
        "seconds": lambda a: a["seconds"],
    }
    digits = {"held-out PSNR": 2, "trained PSNR": 2, "Gaussians": 0, "seconds": 0}
    lines = ["| variant | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    with open(options.output / "ablation.csv", "w", newline="") as table:
        writer = csv.writer(table)
        writer.writerow(["variant", "seed", *columns])
        for name, answers in results.items():
            for seed, answer in zip(options.seeds, answers):
                writer.writerow([name, seed, *(value(answer) for value in columns.values())])
            cells = []
            for column, value in columns.items():
                values = [value(answer) for answer in answers]
                spread = statistics.stdev(values) if len(values) > 1 else 0.0
                places = digits.get(column, 3)
                cells.append(f"{statistics.mean(values):.{places}f}" + (f" ± {spread:.{places}f}" if places else ""))
            lines.append(f"| {name} | " + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n"
    (options.output / "ablation.md").write_text(text)
    print(text, end="")


if __name__ == "__main__":
    main()
