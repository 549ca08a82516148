#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Trains, slices and scores the real sweeps at full resolution: the table of results in the README.

    PYTHONPATH=build/python Testing/Benchmarks/real_sweeps.py [--data FOLDER] [--output FOLDER] [--only NAME]

Needs the real data ($BIGUS_DATA, else ../shared/data beside the project). For each sweep it writes a folder with the
field, slices, panel.png, training-curve.png and report.txt, and at the end results.md. A sweep whose training.json is
there already is not trained again, so an interrupted run goes on where it stopped.
"""

import argparse
import json
import os
import subprocess
from pathlib import Path

import numpy as np

import bigus

PROJECT = Path(__file__).resolve().parents[2]
SPINE = "spine-phantom/SpinePhantomFreehand.igs.mha"
PLUS_CONFIG = "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml"
PLUS_VOLUME = "spine-phantom/SpinePhantomFreehandReconstructed.mha"

# name: file, how to read it, what to train
SWEEPS = {
    "liver": ("liver-sweep/liver_sweep.igs.mha", [], ["--hold-out", "8", "--gaussians", "300000"]),
    "brain": ("brain-sweep/us_brain_sweep.igs.mha", [], ["--hold-out", "4"]),
    "spine phantom": (SPINE, ["--config", PLUS_CONFIG], ["--hold-out", "4"]),
}
# What the table calls it: (whether it serves any plane, name in `bigus train --json`, else method of bigusExperiment)
METHODS = {
    "pose interpolation at any plane": ("yes", None, "pose_any_plane"),
    "voxel compounding": ("yes", "compounding", None),
    "nearest frame": ("yes", "nearest", None),
    "pose interpolation of sequence neighbours": ("no", "pose_interpolation", None),
    "the same, cubic in the plane": ("no", None, "pose_cubic"),
    "average of sequence neighbours, poses ignored": ("no", "neighbour_average", None),
}


def run(*command, output=None):
    """A command; its JSON when asked for, also into a file."""
    print("+", *command, flush=True)
    text = subprocess.run([str(part) for part in command], check=True,
                          stdout=subprocess.PIPE if output else None).stdout
    if output:
        output.write_bytes(text)


def slices_and_report(program, folder, sweep, hold_out):
    """Held-out, orthogonal and oblique slices, the panel, the curve and the report, as the quickstart makes them."""
    examples = PROJECT / "Examples"
    run("/usr/bin/python3", examples / "plan.py", sweep, folder / "planes.csv")
    frames = bigus.frames(bigus.read(str(sweep))).shape[0]
    frame = min(range(hold_out // 2, frames, hold_out), key=lambda k: abs(k - frames // 2))
    field = folder / "field.vtp"
    run(program, "slice", field, "--poses", sweep, "--frames", frame, "--lit", "-o", folder / "held-out.png")
    run(program, "slice", field, "--poses", folder / "planes.csv", "--frames", 0, "-o", folder / "orthogonal.png")
    run(program, "slice", field, "--poses", folder / "planes.csv", "--frames", 1, "-o", folder / "oblique.png")
    run("/usr/bin/python3", examples / "report.py", folder, "--frame", frame, "--reduce", 1)


def plus_correlation(program, data, folder, sweep):
    """Correlation of a field trained on every frame with Plus's own reconstruction, on its grid where it saw tissue."""
    field, volume = folder / "field-all-frames.vtp", folder / "plus-grid.mha"
    if not field.exists():
        run(program, "train", sweep, "-o", field, "--gaussians", 20000)
    grid, truth = read_volume(data / PLUS_VOLUME)
    run(program, "voxelize", field, "-o", volume, "--spacing", grid["spacing"], "--origin", *grid["origin"], "--size",
        *grid["size"], "--elevation-sigma", 0.8)
    _, ours = read_volume(volume)
    middle = truth.shape[0] // 2
    seen = truth > 0
    return {"volume": np.corrcoef(truth.ravel(), ours.ravel())[0, 1],
            "seen voxels": np.corrcoef(truth[seen], ours[seen])[0, 1],
            "middle slice": np.corrcoef(truth[middle].ravel(), ours[middle].ravel())[0, 1]}


def read_volume(path):
    """Geometry and [k, j, i] values of a MetaImage volume."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOImage import vtkMetaImageReader

    reader = vtkMetaImageReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    values = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions()[::-1]).astype(float)
    return {"spacing": image.GetSpacing()[0], "origin": image.GetOrigin(), "size": image.GetDimensions()}, values


def experiment(program, data, file, config, hold_out, method):
    """Held-out PSNR and SSIM of a method that needs no field and that `bigus train` does not score."""
    job = {"sweep": {"file": file, **({"config": config} if config else {})}, "frames": {"hold_out": hold_out},
           "method": {"name": method}}
    answer = subprocess.run([str(program), "--data", str(data)], input=json.dumps(job), check=True, text=True,
                            stdout=subprocess.PIPE).stdout
    return json.loads(answer)["scores"]["held_out"]


def shown(scores):
    return f"{scores['psnr']:.2f} / {scores['ssim']:.3f}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bigus", type=Path, default=PROJECT / "build/bin/bigus")
    parser.add_argument("--experiment", type=Path, default=PROJECT / "build/bin/bigusExperiment")
    parser.add_argument("--data", type=Path,
                        default=os.environ.get("BIGUS_DATA") or PROJECT.parent / "shared" / "data")
    parser.add_argument("--output", type=Path, default=Path("real-sweeps"))
    parser.add_argument("--only", choices=SWEEPS)
    options = parser.parse_args()
    data = Path(options.data)

    columns = {}
    notes = []
    for name, (file, reading, training) in SWEEPS.items():
        if options.only and name != options.only:
            continue
        folder = options.output / name.replace(" ", "-")
        folder.mkdir(parents=True, exist_ok=True)
        sweep, answer_file = folder / "sweep.igs.mha", folder / "training.json"
        if not answer_file.exists():
            reading = [str(data / part) if part.endswith(".xml") else part for part in reading]
            run(options.bigus, "convert", data / file, sweep, *reading)
            run(options.bigus, "train", sweep, "-o", folder / "field.vtp", "--log", folder / "training.csv", "--json",
                *training, output=answer_file)
        answer = json.loads(answer_file.read_text())
        slices_and_report(options.bigus, folder, sweep, int(training[1]))
        held_out = answer["held_out"]
        total = held_out["frames"] + answer["training_frames"]
        config = next((part for part in SWEEPS[name][1] if part.endswith(".xml")), None)
        column = {"this field": ("yes", shown(held_out))}
        for title, (any_plane, baseline, method) in METHODS.items():
            scores = answer["baselines"][baseline] if baseline else experiment(
                options.experiment, data, file, config, int(training[1]), method)
            column[title] = (any_plane, shown(scores))
        along = answer["cross_planes"]
        column["detail; scratches along the sweep"] = ("", f"{along['detail']:.2f}; {along['scratches']:.1f}")
        column["frames held out"] = ("", f"{held_out['frames']} of {total}")
        column["Gaussians; seconds; peak MiB"] = ("", f"{answer['gaussians']:,}; {answer['seconds']:.0f}; "
                                                      f"{answer['peak_memory_bytes'] / 2**20:.0f}")
        columns[name] = column
        if name == "spine phantom":
            correlation = plus_correlation(options.bigus, data, folder, sweep)
            notes.append("Correlation with the Plus reconstruction on its own grid: " +
                         ", ".join(f"{key} {value:.3f}" for key, value in correlation.items()) + ".")
    lines = ["| method | serves any plane | " + " | ".join(columns) + " |", "|---" * (2 + len(columns)) + "|"]
    for title, (any_plane, _) in next(iter(columns.values())).items():
        lines.append(f"| {title} | {any_plane} | " + " | ".join(column[title][1] for column in columns.values()) + " |")
    text = "\n".join(lines + [""] + notes) + "\n"
    (options.output / "results.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
