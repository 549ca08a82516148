#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Does the harness work: what it runs, keeps, repeats and reports. On phantoms, with few Gaussians.

    test_experiments.py PROGRAM [unittest options]
"""

import contextlib
import csv
import io
import json
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

import experiments
import hash_grid
from definitions import EXPERIMENTS, Scale
from harness import Job, table

PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else "build/bin/bigusExperiment"


def call(*arguments):
    """experiments.py with these arguments: exit status and what it printed."""
    said = io.StringIO()
    with mock.patch.object(sys, "argv", ["experiments.py", *map(str, arguments)]), contextlib.redirect_stdout(said):
        return experiments.main(), said.getvalue()


def run_job(method):
    """The result of a small phantom's training with these options."""
    job = {"sweep": {"phantoms": [{"width": 48, "height": 40, "pixel_size": 0.8, "frames": 9, "axial_sigma": 0.8,
                                   "lateral_sigma": 0.8, "scatterer_density": 1}]},
           "frames": {"hold_out": 4},
           "method": {"name": "bigus", "automatic": False, "gaussians": 400, "iterations": 12, **method}}
    return subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)


class Options(unittest.TestCase):
    def test_every_option_of_the_trainer_can_be_given(self):
        first = json.loads(run_job({}).stdout)
        settled = first["facts"]["settled"]
        self.assertGreater(len(settled), 30)
        given = {name: value for name, value in settled.items() if name not in ("seed", "hold_out")}
        again = json.loads(run_job(given).stdout)
        self.assertEqual(again["facts"]["settled"], settled)
        self.assertEqual(again["scores"], first["scores"])

    def test_values_out_of_range_and_misspelt_names_are_errors(self):
        for method, says in (({"virtual_planes": 9}, "virtual planes is 9; it must be 0 to 8 or auto"),
                             ({"batch": 0}, "batch is 0; it must be 1 to 4096"), ({"gaussian": 3}, "gaussian")):
            answer = run_job(method)
            self.assertEqual(answer.returncode, 1)
            self.assertIn(says, answer.stderr)

    def test_a_named_interpolation_keeps_contrast_where_the_preset_asks_for_it(self):
        texture = {"preset": "texture", "virtual_planes": 1}
        plain, named = (json.loads(run_job(method).stdout)["scores"]
                        for method in (texture, {**texture, "interpolation": "normals"}))  # what geometry chooses, too
        self.assertEqual(plain, named)


class OtherPlanes(unittest.TestCase):
    PHANTOM = {"width": 40, "height": 40, "frames": 40, "pixel_size": 0.8, "frame_spacing": 0.8, "axial_sigma": 0.8,
               "lateral_sigma": 0.8, "scatterer_density": 1}
    EVEN = {"speed_variation": 0, "tilt": 0, "wander": 0}  # a volume

    def score(self, options, every, method, sets):
        job = {"sweep": {"phantoms": [{**self.PHANTOM, **options}]}, "frames": {"every": every}, "method": method,
               "score": sets}
        return subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)

    def test_planes_of_a_volume_are_its_voxels_and_worse_the_fewer_are_seen(self):
        sets = ["planes_x", "planes_y", "planes_45"]
        for name in ("pose_any_plane", "cubic_any_plane"):
            whole, half, quarter = (json.loads(self.score(self.EVEN, every, {"name": name}, sets).stdout)["scores"]
                                    for every in (1, 2, 4))
            for planes in sets[:2]:
                self.assertTrue(whole[planes]["psnr"] is None or whole[planes]["psnr"] > 120, "met exactly")
            for planes in sets:
                self.assertEqual(whole[planes]["planes"], 40)
                self.assertGreater(half[planes]["psnr"], quarter[planes]["psnr"] + 1)
                self.assertGreater(half[planes]["structure"], half[planes]["psnr"] + 5)
        self.assertTrue(whole["planes_45"]["psnr"] is None or whole["planes_45"]["psnr"] > 120, "the truth is cubic")

    def test_compounding_has_what_the_frames_enclose(self):
        # Black pixels where a grid ends would cost decibels on turned planes and none on x-planes.
        scores = json.loads(self.score(self.EVEN, 2, {"name": "compounding", "voxel_size": 0.8},
                                       ["planes_x", "planes_30", "planes_60"]).stdout)["scores"]
        for planes in ("planes_30", "planes_60"):
            self.assertGreater(scores[planes]["psnr"], scores["planes_x"]["psnr"] - 2)

    def test_turned_frames_show_the_same_world(self):
        scores = json.loads(self.score({}, 2, {"name": "pose_any_plane"}, ["turned_0", "turned_90"]).stdout)["scores"]
        self.assertGreater(scores["turned_0"]["psnr"], scores["turned_90"]["psnr"] + 3)
        self.assertGreater(scores["turned_90"]["structure"], scores["turned_90"]["psnr"] + 5)
        self.assertTrue(0.25 < scores["turned_90"]["scored_share"] <= 1)

    def test_cross_planes_of_linear_interpolation_are_the_measure(self):
        cross = json.loads(self.score({}, 2, {"name": "pose_any_plane"}, ["cross"]).stdout)["scores"]["cross"]
        self.assertEqual((cross["detail"], cross["scratches"]), (1, 1))

    def test_a_freehand_sweep_is_no_volume_and_a_misspelt_set_none(self):
        for sets, says in ((["planes_x"], "frames that lie above one another"), (["plane_x"], "not 'plane_x'")):
            answer = self.score({}, 2, {"name": "pose_any_plane"}, sets)
            self.assertEqual(answer.returncode, 1)
            self.assertIn(says, answer.stderr)


class Outside(unittest.TestCase):
    JOB = {"sweep": {"phantoms": [OtherPlanes.PHANTOM]}, "frames": {"hold_out": 4}, "poses": "tracked"}
    SCORE = {"score": ["held_out", "turned_90"]}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def run_job(self, method, **more):
        job = {**self.JOB, "method": method, **more}
        return subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)

    def test_another_program_predicts_what_a_method_does(self):
        # The average of the frames before and after, made here of what the first run wrote.
        outside = {"name": "outside", "folder": str(self.folder / "there")}
        self.assertFalse(json.loads(self.run_job(outside).stdout)["facts"]["predicted"])
        frames, asked = (list(hash_grid.Plane.read(self.folder / "there" / name)) for name in ("training.txt", "asked.txt"))
        pixels = np.fromfile(self.folder / "there/training.f32", np.float32).reshape(len(frames), -1)
        self.assertEqual((len(frames), len(asked)), (30, 10))
        predicted = []
        for plane in asked:
            apart = [np.linalg.norm(frame.points().mean(0) - plane.points().mean(0)) for frame in frames]
            predicted.append(pixels[np.argsort(apart)[:2]].mean(0, dtype=np.float32))
        file = self.folder / "there/predicted.f32"
        file.write_bytes(np.nan_to_num(predicted).astype(np.float32).tobytes())
        scores = json.loads(self.run_job(outside).stdout)["scores"]["held_out"]
        expected = json.loads(self.run_job({"name": "neighbour_average"}).stdout)["scores"]["held_out"]
        for name in ("psnr", "ssim", "bfs"):
            self.assertAlmostEqual(scores[name], expected[name], 4, name)
        whole = file.read_bytes()
        for job, bytes_, says in (({}, whole[:-1], "ends within picture 10"), ({"frames": {"every": 2}}, whole, "plane 1"),
                                  ({}, np.float32("nan").tobytes() + whole[4:], "picture 1 that is no number")):
            file.write_bytes(bytes_)
            answer = self.run_job(outside, **job)
            self.assertEqual(answer.returncode, 1)
            self.assertIn(says, answer.stderr)

    def train(self, method):
        job = {**self.JOB, "method": {"name": "hash_grid", **method}, **self.SCORE}
        command = [sys.executable, Path(hash_grid.__file__), "--program", PROGRAM, "--cache", self.folder]
        return subprocess.run(command, input=json.dumps(job), capture_output=True, text=True, timeout=120)

    def test_a_hash_grid_network_learns(self):
        if hash_grid.torch is None:
            self.assertIn("PyTorch is missing", self.train({}).stderr)
            self.skipTest("there is no PyTorch")
        few = {"batch": 2048, "levels": 6, "table_bits": 12, "coarsest": 10}
        first, again = (json.loads(self.train({"batch": 2048, "levels": 6, "table_bits": 12, "coarsest": 10, "steps": 80}).stdout)
                        for _ in range(2))
        self.assertEqual(first["scores"], again["scores"])
        black = json.loads(self.run_job({"name": "outside", "folder": str(self.folder / "black")}, **self.SCORE).stdout)
        for planes in ("held_out", "turned_90"):
            self.assertGreater(first["scores"][planes]["psnr"], black["scores"][planes]["psnr"] + 3)
        self.assertEqual(first["facts"]["steps"], 80)

    def test_options_of_the_network_are_checked(self):
        self.assertEqual(hash_grid.read_options({"name": "hash_grid", "rate": 1}).rate, 1)
        for method, says in (({"leaves": 3}, "no 'leaves'"), ({"table_bits": 25}, "4 to 24"), ({"rate": "fast"}, '"fast"'),
                             ({"steps": 1.5}, "'steps' is 1.5"), ({"width": True}, "true")):
            with self.assertRaisesRegex(ValueError, says):
                hash_grid.read_options(method)


class StandardErrors(unittest.TestCase):
    def test_of_held_out_frames_are_those_of_the_command_and_of_turned_ones_larger(self):
        phantom = {**OtherPlanes.PHANTOM, "frames": 24, "tracking_noise": 0.2, "tracking_rotation_noise": 0.3}
        method = {"name": "bigus", "automatic": False, "gaussians": 1500, "iterations": 60}
        job = {"sweep": {"phantoms": [phantom]}, "frames": {"hold_out": 4}, "method": method,
               "poses": "tracked", "score": ["standard_error_0", "standard_error_90"]}
        answer = subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)
        across = json.loads(answer.stdout)["scores"]
        held_out = across["standard_error_0"]
        for scores in across.values():
            bins = scores["reliability"]
            squares = [sum(one[k] ** 2 * one[2] for one in bins) / sum(one[2] for one in bins) for k in (0, 1)]
            self.assertAlmostEqual(squares[1] ** 0.5, scores["rmse"], 6)
            self.assertAlmostEqual(squares[0] / squares[1], scores["variance_ratio"], 5)
            self.assertTrue(0.85 < scores["within_2"] < 1, scores)
        self.assertGreater(across["standard_error_90"]["rmse"], 1.2 * held_out["rmse"], "speckle from another side")
        self.assertLess(across["standard_error_90"]["known"], held_out["known"], "they reach beyond the sweep")
        if not (command := Path(PROGRAM).resolve().with_name("bigus")).is_file():
            self.skipTest("there is no command beside the program")
        with tempfile.TemporaryDirectory() as folder:
            flags = {"scatterer_density": "--scatterers", "tracking_rotation_noise": "--rotation-noise"}
            words = [text for name, value in phantom.items()
                     for text in (flags.get(name, "--" + name.replace("_", "-")), str(value))]
            subprocess.run([command, "phantom", "-o", "s.igs.mha", *words], cwd=folder, check=True, capture_output=True)
            said = subprocess.run([command, "train", "s.igs.mha", "-o", "f.vtp", "--no-auto", "--gaussians", "1500",
                                   "--iterations", "60", "--pose-smoothing", "0", "--hold-out", "4", "--json"], cwd=folder, check=True,
                                  capture_output=True, text=True)
        theirs = json.loads(said.stdout)["standard_error"]
        for name in ("variance_ratio", "within_1", "within_2", "sparsification", "rmse", "known"):
            self.assertAlmostEqual(held_out[name], theirs[name], 3, name)

    def test_other_methods_have_none_and_recorded_sweeps_no_other_planes(self):
        job = {"sweep": {"phantoms": [OtherPlanes.PHANTOM]}, "frames": {"hold_out": 4}, "method": {"name": "nearest"},
               "score": ["standard_error_0"]}
        answer = subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)
        self.assertEqual(json.loads(answer.stdout)["scores"], {})
        job["sweep"]["phantoms"] *= 2
        job |= {"method": {"name": "bigus", "automatic": False, "gaussians": 100, "iterations": 2}, "score": ["standard_error_30"]}
        answer = subprocess.run([PROGRAM], input=json.dumps(job), capture_output=True, text=True, timeout=120)
        self.assertEqual(answer.returncode, 1)
        self.assertIn("need the sweep of one phantom", answer.stderr)


class Harness(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def run_e5(self, *more):
        # No data folder: only what is made on phantoms runs.
        return call("e5", "--quick", "--program", PROGRAM, "--data", self.folder / "nothing", "--output", self.folder,
                    *more)

    def test_rows_of_another_commit_are_by_its_program_or_say_that_there_is_none(self):
        # Its program stands for one that was built of another commit, and tells what it was asked.
        other = self.folder / "other"
        other.write_text(f'#!/bin/sh\ntee -a {self.folder}/asked | {PROGRAM} "$@"\n')
        other.chmod(0o755)
        arguments = ["e12", "--quick", "--program", PROGRAM, "--data", self.folder / "nothing", "--output", self.folder]
        status, said = call(*arguments, "--only", "'limit': 5")
        self.assertEqual(status, 0, said)
        with open(self.folder / "quick" / "e12.csv") as file:
            states = {(row["method"], row["state"]) for row in csv.DictReader(file)
                      if row["scene"] == "phantom, linear" and row["limit"] == "5"}
        self.assertEqual(states, {("field", "done"), ("field of 92a5706", "no program: 92a5706")})
        status, said = call(*arguments, "--only", "92a5706', 'limit': 5", "--other", f"92a5706={other}")
        self.assertEqual(status, 0, said)
        self.assertNotIn("program", json.loads((self.folder / "asked").read_text()))
        with open(self.folder / "quick" / "e12.csv") as file:
            done = {(row["scene"], row["commit"]) for row in csv.DictReader(file)
                    if row["method"] == "field of 92a5706" and row["state"] == "done"}
        self.assertEqual(done, {("phantom, linear", "92a5706")})

    def test_runs_once_and_reports(self):
        status, said = self.run_e5()
        self.assertEqual(status, 0, said)
        quick = self.folder / "quick"
        with open(quick / "e5.csv") as file:
            rows = list(csv.DictReader(file))
        done = [row for row in rows if row["state"] == "done"]
        self.assertEqual({row["scene"] for row in done}, {"phantom"})
        self.assertEqual({row["state"] for row in rows if row["scene"] == "liver"},
                         {"no data: liver-sweep/liver_sweep.igs.mha"})
        self.assertIn(f"{len(done)} jobs run, 0 failed", said)
        for row in done:
            self.assertTrue(10 < float(row["scores.held_out.psnr"]) < 40, row)
            self.assertIn("threads", row["machine"])
        table = (quick / "e5.md").read_text()
        self.assertIn("no data", table)
        with open(quick / "e5-table.csv") as file:
            cells = {(row["scene"], row["gap"], row["method"]): row["held-out PSNR"] for row in csv.DictReader(file)}
        for row in done:
            self.assertIn(cells[row["scene"], row["gap"], row["method"]], table)
            self.assertAlmostEqual(float(cells[row["scene"], row["gap"], row["method"]]),
                                   float(row["scores.held_out.psnr"]), delta=0.006)
        self.assertEqual((quick / "e5.png").read_bytes()[:4], b"\x89PNG")
        self.assertFalse(list(quick.rglob("*.part*")))

        status, said = self.run_e5()
        self.assertIn("0 jobs run, 0 failed", said)
        # Half a result, as after a crash of the machine, is none.
        broken = next((quick / "jobs").glob("*.json"))
        whole = json.loads(broken.read_text())
        broken.write_text(broken.read_text()[:100])
        status, said = self.run_e5()
        self.assertIn("1 jobs run, 0 failed", said)
        again = json.loads(broken.read_text())
        self.assertEqual(again["scores"], whole["scores"])

    def test_a_budget_leaves_jobs_out_and_says_so(self):
        status, said = self.run_e5("--budget", "0.01")
        self.assertEqual(status, 0)
        self.assertIn("0 jobs run, 0 failed", said)
        self.assertIn("not run", said)

    def test_a_failed_job_is_told_and_tried_again(self):
        program = self.folder / "broken"
        program.write_text("#!/bin/sh\necho out of luck >&2\nexit 1\n")
        program.chmod(0o755)
        with contextlib.redirect_stderr(io.StringIO()):
            status, said = call("e5", "--quick", "--program", program, "--data", self.folder / "nothing", "--output",
                                self.folder)
        self.assertEqual(status, 1)
        self.assertIn("failed: out of luck", said)
        self.assertEqual(list(self.folder.rglob("*.json")), [])

    def has_run(self, name, numbers, machine="here", **labels):
        """As if the quick jobs with these labels had been run, with these numbers by their path."""
        jobs = [job for job in EXPERIMENTS[name].jobs(Scale.quick())
                if all(job.labels[label] == wanted for label, wanted in labels.items())]
        self.assertTrue(jobs)
        for job in jobs:
            result = {"job": job.request, "machine": machine, "device": "CPU", "version": "1", "commit": "abc"}
            for path, number in numbers.items():
                *parts, last = path.format(**job.labels).split(".")
                scores = result
                for part in parts:
                    scores = scores.setdefault(part, {})
                scores[last] = number
            path = self.folder / "quick/jobs" / f"{job.key}.json"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(result))

    def publish(self):
        with mock.patch.object(experiments, "HERE", self.folder):
            call("publish", "--quick", "--output", self.folder)
        return {path.name: path.read_bytes() for path in (self.folder / "results").iterdir()}

    def test_publishes_tables_beside_and_a_summary_below_the_heading(self):
        self.has_run("e5", {"scores.held_out.psnr": 40.321}, scene="liver", gap=1, method="BIGUS 100k")
        self.has_run("e5", {"scores.held_out.psnr": 34.219}, scene="liver", gap=2, method="compounding")
        readme = self.folder / "README.md"
        readme.write_text("## E4: other\n\n| kept |\n\n## E5: gap\n\nbefore\n\n| old |\n|---|\n\n## E6: after\n| kept |\n")
        results = self.publish()
        left = len(EXPERIMENTS["e5"].jobs(Scale.quick())) - 2
        self.assertEqual(results["e5.md"].decode(),
                         f"# {EXPERIMENTS['e5'].title}\n\nRows: [e5.csv](e5.csv).\n\nQuick: pictures a quarter the size, 2 % of "
                         f"the Gaussians and of the time limits; no result.\n{left} of {left + 2} jobs have no result: not run.\n"
                         "Machine: here; CPU; version 1 (abc).\nSeeds: 1.\n")
        text = readme.read_text()
        self.assertTrue(text.startswith("## E4: other\n\n| kept |\n\n## E5: gap\n\nbefore\n\n| liver"), text)
        self.assertTrue(text.endswith(" |\n\n## E6: after\n| kept |\n"), text)
        self.assertNotIn("old", text)
        self.assertIn("| field, 100k | 40.32 | – | – | – |", text)
        self.assertIn("| compounding | – | 34.22 | – | – |", text)

    def test_rows_that_were_not_run_anew_stay_and_say_of_which_machine_they_are(self):
        def row(method):
            return next(row for row in csv.DictReader(io.StringIO(results["e9.csv"].decode()))
                        if row["scene"] == "spine" and row["method"] == method)

        (self.folder / "README.md").write_text("# All\n\n## E9: short\n\n| old |\n")
        decision = [{"what": "sigma", "choice": "1", "evidence": "by hand", "seconds": 2.0}]
        self.has_run("e9", {"scores.held_out.psnr": 22.734, "scores.held_out.ssim": 0.70004, "facts.decisions": decision},
                     scene="spine", method="BIGUS auto")
        self.has_run("e9", {"scores.held_out.psnr": 21.5}, scene="spine", method="compounding, 0.3 mm")
        results = self.publish()
        first, decided = row("BIGUS auto"), results["e9-decisions.csv"]
        self.assertNotIn("measured", first)  # all of one machine
        before = results["e9.png"]
        for machine, psnr in (("there", 25.1), ("elsewhere", 26.1)):
            shutil.rmtree(self.folder / "quick")
            self.has_run("e9", {"scores.held_out.psnr": psnr}, machine, scene="spine", method="compounding, 0.3 mm")
            results = self.publish()
            kept = row("BIGUS auto")
            self.assertEqual(row("compounding, 0.3 mm")["held-out PSNR"], f"{psnr:.2f}")
            self.assertNotEqual(kept.pop("measured"), row("compounding, 0.3 mm")["measured"])
            self.assertEqual(kept, first)
            self.assertEqual(results["e9-decisions.csv"], decided)
            page = results["e9.md"].decode()
            numbers = {"here": row("BIGUS auto")["measured"], machine: row("compounding, 0.3 mm")["measured"]}
            for name, number in numbers.items():
                self.assertIn(f"Machine {number} (1 rows): {name}; CPU; version 1 (abc).\n", page)
            self.assertEqual(page.count("Machine"), 2)  # what was replaced is gone
            self.assertNotEqual(results["e9.png"], before)
            before = results["e9.png"]
            self.assertIn("| spine | 22.73 | – | ", (self.folder / "README.md").read_text())
            self.assertIn(f"| {psnr:.2f} |", (self.folder / "README.md").read_text())

    def test_rows_of_several_seeds_stay_whole(self):
        for seed, psnr in ((1, 30), (2, 31), (3, 32)):
            self.has_run("e7", {"scores.held_out.psnr": psnr}, scene="brain, half", method="BIGUS 100k", seed=seed)
        (self.folder / "README.md").write_text("")
        self.publish()
        shutil.rmtree(self.folder / "quick")
        self.has_run("e7", {"scores.held_out.psnr": 33.0}, scene="liver, half", method="BIGUS 100k", seed=1)
        rows = self.publish()["e7.csv"].decode()
        self.assertIn('"brain, half",BIGUS 100k,31.00 ± 1.00,', rows)
        self.assertIn('"liver, half",BIGUS 100k,33.00,', rows)

    def test_a_long_summary_stands_on_the_page_of_its_results(self):
        self.has_run("e14", {"scores.standard_error_{degrees}.variance_ratio": 0.88}, sweep="brain")
        readme = self.folder / "README.md"
        readme.write_text("## E14: sure\n\n| kept |\n")
        text = self.publish()["e14.md"].decode()
        self.assertEqual(readme.read_text(), "## E14: sure\n\n| kept |\n")
        self.assertIn("| brain | – | 0.88 |", text)
        self.assertIn("Seeds: 1.\n\n|", text)

    def test_an_experiment_that_the_paper_lacks_leaves_its_figures_alone(self):
        self.run_e5("--only", "'gap': 1, 'method': 'nearest frame'")
        self.assertTrue(list((self.folder / "quick/jobs").glob("*.json")))
        (self.folder / "README.md").write_text("## E5: gap\n")
        (self.folder / "results").mkdir()
        (self.folder / "results/paper.md").write_text("figures")
        self.assertEqual(self.publish()["paper.md"], b"figures")

    def test_what_is_published_is_what_the_page_says(self):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(experiments.HERE, folder, dirs_exist_ok=True)
            with mock.patch.object(experiments, "HERE", Path(folder)):
                call("publish", "--output", Path(folder) / "nothing")
            self.assertEqual((Path(folder) / "README.md").read_text(), (experiments.HERE / "README.md").read_text())


class Labels(unittest.TestCase):
    def test_rows_of_one_job_take_what_their_label_names(self):
        request, result = {"score": []}, {"scores": {"turned_0": {"psnr": 3}, "turned_30": {"psnr": 2}}}
        jobs = [Job(request, {"sweep": "a", "degrees": degrees}, 1, result=result) for degrees in (0, 30)]
        rows = table(jobs, [("PSNR", "scores.turned_{degrees}.psnr", 1)])
        self.assertEqual([row["PSNR"] for row in rows], ["3.0", "2.0"])


class Definitions(unittest.TestCase):
    def test_jobs_of_an_experiment_have_rows_of_their_own(self):
        for scale in (Scale(), Scale.quick()):
            for experiment in EXPERIMENTS.values():
                jobs = experiment.jobs(scale)
                rows = [json.dumps([job.labels, job.request.get("seed")]) for job in jobs]
                self.assertEqual(len(set(rows)), len(rows), experiment.name)
                self.assertTrue(all(job.seconds > 0 and job.priority in (1, 2, 3) for job in jobs))

    def test_quick_jobs_are_quick(self):
        for experiment in EXPERIMENTS.values():
            jobs = [job for job in experiment.jobs(Scale.quick()) if job.priority < 3]
            for job in jobs:
                method = job.request["method"]
                self.assertLessEqual(method.get("time_limit", 0), 3)
                self.assertLessEqual(method.get("gaussians", 0), 40000)


if __name__ == "__main__":
    unittest.main()
