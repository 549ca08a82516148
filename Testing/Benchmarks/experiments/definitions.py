# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What each experiment runs, and which tables and plots it makes of the results."""

import math
from dataclasses import dataclass
from typing import Callable

from harness import Job, mean
from plots import curves, dots, frontier, gains, reliability, spread

LIVER = {"file": "liver-sweep/liver_sweep.igs.mha"}
BRAIN = {"file": "brain-sweep/us_brain_sweep.igs.mha"}
SPINE = {"file": "spine-phantom/SpinePhantomFreehand.igs.mha",
         "config": "spine-phantom/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml",
         "crop": [186, 12, 446, 590]}  # what the probe lights
VOLUME = {"volume": "liver-volume/liver_compounded_0p6mm.mha"}
FOREVER = 10**7  # iterations: the time limit ends training, and the rates are fitted to it


@dataclass
class Scale:
    """How large everything is."""
    gaussians: float = 1     # factors
    seconds: float = 1
    longest: float = math.inf  # time limit
    reduce: int = 1          # more than the experiment asks for
    cube: int = 160          # voxels a side
    is_quick: bool = False

    @staticmethod
    def quick():
        return Scale(gaussians=0.02, seconds=0.02, longest=3, reduce=4, cube=32, is_quick=True)

    def real(self, scene, reduce):
        return {**scene, "reduce": reduce * self.reduce}

    def phantom(self, **options):
        """A made-up sweep of about 5 x 5 x 3 cm."""
        size = {"width": 64, "height": 64, "pixel_size": 0.8, "frames": 24, "axial_sigma": 0.8, "lateral_sigma": 0.8,
                "scatterer_density": 2, "frame_spacing": 1} if self.is_quick else {}
        return {"phantoms": [{**size, **options}]}

    def count(self, gaussians):
        return max(200, round(gaussians * self.gaussians))

    def limit(self, seconds):
        return min(max(0.5, seconds * self.seconds), self.longest)

    def job(self, scene, frames, method, labels, seconds=4, priority=1, **more):
        """Seconds: what all of it should take. Gaussian counts and time limits of the method are scaled."""
        method = dict(method)
        for name, scaled in (("gaussians", self.count), ("densification_cap", self.count), ("equal_gaussians", self.count),
                             ("time_limit", self.limit)):
            if name in method:
                method[name] = scaled(method[name])
        request = {"sweep": scene, "frames": frames, "method": method, **more}
        return Job(request, labels, max(1.5, seconds * self.seconds) if self.is_quick else seconds, priority)


@dataclass
class Experiment:
    name: str
    title: str
    jobs: Callable[[Scale], list]
    columns: list
    panels: Callable[[list], list]
    split: str = ""  # a table for each value of this label
    summary: tuple = ()  # of the table, for README.md: corner, down, across as harness.summary takes them
    shows_decisions: bool = False
    is_long: bool = False  # the summary stands on the page in results/, not in README.md

    def tables(self, jobs):
        if not self.split:
            return [("", jobs)]
        names = list(dict.fromkeys(job.labels[self.split] for job in jobs))
        return [(name, [job for job in jobs if job.labels[self.split] == name]) for name in names]


def short(gaussians):
    return f"{gaussians // 1000}k" if gaussians < 10**6 else f"{gaussians / 10**6:g}M"


def auto(gaussians=None, **options):
    """Our method as a user gets it: what is not given is decided by the trainer, the length of training, too. It has
    no limit but the job's own, since what deciding takes would be missing in training."""
    return {"name": "bigus", **({} if gaussians is None else {"gaussians": gaussians}), **options}


def forced(gaussians, limit, **options):
    """Nothing decided from evidence: what is not given follows from the sweep's geometry."""
    return {"name": "bigus", "gaussians": gaussians, "time_limit": limit, "automatic": False, **options}


def megabytes(members):
    size = mean(members, "bytes")
    return None if size is None else size / 1e6


def psnr(frames):
    return lambda members: mean(members, f"scores.{frames}.psnr")


def scored(frames, title):
    return [(f"{title} PSNR", f"scores.{frames}.psnr", 2), (f"{title} SSIM", f"scores.{frames}.ssim", 4)]


def with_speckle(frames, title):
    return scored(frames, title) + [
        (f"{title} BFS", f"scores.{frames}.bfs", 3), ("contrast", f"scores.{frames}.bfs_mean_contrast", 3),
        ("distribution", f"scores.{frames}.bfs_contrast_distribution", 3),
        ("Rayleigh", f"scores.{frames}.bfs_rayleigh", 3)]


# Planes that are no frames: of a volume, of a phantom swept in another direction, and along a sweep, which has no truth.
VOLUME_PLANES = {"planes_x": "x", "planes_y": "y", "planes_30": "30°", "planes_45": "45°", "planes_60": "60°"}
SLANTED_PLANES = {name: VOLUME_PLANES[name] for name in ("planes_x", "planes_45")}
TURNED_FRAMES = {"turned_30": "30°", "turned_60": "60°", "turned_90": "90°"}
CROSS = [("detail along", "scores.cross.detail", 2), ("scratches", "scores.cross.scratches", 2)]


def at_planes(sets):
    """Columns of PSNR at other planes."""
    return [(f"{title} PSNR", f"scores.{name}.psnr", 2) for name, title in sets.items()]


def structure_at(sets):
    return [(f"{title} structure", f"scores.{name}.structure", 2) for name, title in sets.items()]


TRAINED = scored("training", "training") + [("training BFS", "scores.training.bfs", 3)]
COST = [("seconds", "seconds", 1), ("Gaussians", "facts.gaussians", 0)]

# ---- E1: the paper's Table 1 ----

# Coarse enough for voxels of 0.6 mm: parallel planes that distance apart through a world whose echoes are wider.
VOLUME_PHANTOM = {"pixel_size": 0.6, "frame_spacing": 0.6, "speed_variation": 0, "tilt": 0, "wander": 0,
                  "frequency": 2, "axial_sigma": 0.8, "lateral_sigma": 1, "elevation_sigma": 1.2,
                  "scatterer_density": 1}


def volumes(scale):
    n = scale.cube
    # Centred in the lit part of the volume: 97 % of the cube's voxels are lit.
    middle = [104 + (160 - n) // 2, 160 + (160 - n) // 2, 36 + (160 - n) // 2]
    return {"liver volume": {**VOLUME, "offset": middle, "size": n},
            "phantom": {"phantoms": [{**VOLUME_PHANTOM, "width": n, "height": n, "frames": n}]}}


def e1_jobs(scale):
    n = scale.cube
    fit = {"loss": "l2", "iterations": FOREVER, "tolerance": 1e-5}
    rates = {"mean_rate": 0.15, "reflectivity_rate": 0.025}  # found on a cube of 64 voxels; UltraGauss has its own
    jobs = []
    for name, scene in volumes(scale).items():
        for slices in (160, 80, 40):
            frames = {"spread": n * slices // 160}

            def add(title, method, seconds, priority=1, name=name, slices=slices, scene=scene, frames=frames):
                limit = method.get("time_limit")
                jobs.append(scale.job(scene, frames, method,
                                      {"scene": name, "slices": slices, "method": title,
                                       "limit": f"{limit} s" if limit else ""},
                                      seconds, priority, score=["all", "held_out", *SLANTED_PLANES]))

            liver = name == "liver volume"
            # All slices seen: nothing lies between them, and they have no thickness. Else the trainer decides.
            ours = {"automatic": False, "elevation_sigma": 0} if slices == 160 else {}
            if liver and slices == 160:
                add("BIGUS 140k", auto(140000, time_limit=40, **ours, **fit, **rates), 48)
            for limit, priority in ((60, 1), (300, 1 if liver else 3), (3600, 3)):
                add("BIGUS 140k", auto(140000, time_limit=limit, **ours, **fit, **rates), limit + 8, priority)
            for count, limit, priority in ((100000, 60, 2), (100000, 300, 2 if liver and slices == 160 else 3),
                                           (2000000, 300, 3)):
                add(f"UltraGauss preset {short(count)}",
                    {"name": "ultragauss", "gaussians": count, "time_limit": limit, **fit}, limit + 10, priority)
            if slices < 160:
                add("trilinear", {"name": "pose_linear"}, 2)
                add("cubic", {"name": "cubic"}, 2)
    return jobs


E1 = Experiment(
    "e1", "E1: slices of a volume, as in the paper's Table 1", e1_jobs,
    scored("all", "all 160") + scored("held_out", "unseen") + at_planes(SLANTED_PLANES) + COST + [("iterations", "facts.iterations", 0)],
    lambda jobs: [curves([job for job in jobs if job.labels["scene"] == scene], lambda labels, _: labels["slices"],
                         psnr(frames), lambda labels: f"{labels['method']} {labels['limit']}".strip(),
                         ("slices trained on", f"PSNR, {title} (dB)", scene))
                  for scene in ("liver volume", "phantom")
                  for frames, title in (("all", "all slices"), ("held_out", "slices not trained on"))],
    summary=("liver volume, PSNR in dB",
             {title: {"scene": "liver volume", "method": method, "limit": limit}
              for title, method, limit in (("BIGUS 140k, 5 minutes", "BIGUS 140k", "300 s"),
                                           ("BIGUS 140k, 1 minute", "BIGUS 140k", "60 s"),
                                           ("like UltraGauss 100k, 1 minute", "UltraGauss preset 100k", "60 s"),
                                           ("cubic", "cubic", ""))},
             {"160 slices, all": ({"slices": 160}, "all 160 PSNR"), "160, at 45°": ({"slices": 160}, "45° PSNR"),
              "80 slices, unseen": ({"slices": 80}, "unseen PSNR"),
              "80, at right angles": ({"slices": 80}, "x PSNR"), "80, at 45°": ({"slices": 80}, "45° PSNR"),
              "40 slices, unseen": ({"slices": 40}, "unseen PSNR"),
              "40, at right angles": ({"slices": 40}, "x PSNR")}),
    split="scene")

# ---- E2: the paper's Table 2 ----

COMPOUNDING = {"liver": (0.3, 0.4, 0.5, 0.63, 0.9), "brain": (0.3, 0.41, 0.6, 0.8, 1.2), "spine": (0.3, 0.5, 0.8, 1.2),
               "phantom": (0.2, 0.3, 0.5, 0.8)}
BASELINES = {"nearest frame": {"name": "nearest"}, "neighbour average": {"name": "neighbour_average"},
             "pose-aware linear": {"name": "pose_linear"},
             "pose-aware linear, any plane": {"name": "pose_any_plane"},
             "pose-aware cubic in plane": {"name": "pose_cubic"},
             "cubic in all directions": {"name": "cubic"}}
# What virtual planes are made of, as methods of their own: what does the field add to them?
VIRTUAL = {f"virtual plane, {kind}": {"name": "virtual", "interpolation": kind}
           for kind in ("normals", "normals+flow", "probe", "probe+flow")}


def sweeps(scale):
    """Name: (scene, frames, {count: seconds it takes}); count None is the trainer's own choice."""
    return {
        "liver, half": (scale.real(LIVER, 2), {"hold_out": 8}, {None: 300, 100000: 90, 300000: 160}),
        "brain, half": (scale.real(BRAIN, 2), {"hold_out": 4}, {None: 25, 100000: 25}),
        "spine, half": (scale.real(SPINE, 2), {"hold_out": 4}, {None: 12, 20000: 12}),
        "phantom, linear": (scale.phantom(), {"hold_out": 4}, {None: 190, 100000: 60}),
        "liver, full": (scale.real(LIVER, 1), {"hold_out": 8}, {None: 500, 300000: 250}),
        "brain, full": (scale.real(BRAIN, 1), {"hold_out": 4}, {None: 45, 100000: 45}),
        "spine, full": (scale.real(SPINE, 1), {"hold_out": 4}, {None: 25, 20000: 20}),
        "phantom, convex": (scale.phantom(probe="convex"), {"hold_out": 4}, {None: 200, 100000: 70}),
        "phantom, sector": (scale.phantom(probe="sector"), {"hold_out": 4}, {None: 200, 100000: 70})}


def other_planes(scene):
    """What a sweep can be scored on besides its frames."""
    return ["cross"] + (["turned_90"] if "phantoms" in scene else [])


def headline_job(scale, name, count, seed, labels, priority):
    scene, frames, counts = sweeps(scale)[name]
    return scale.job(scene, frames, auto(count), labels, counts[count] + 3, priority,
                     score=["held_out", "training", "aligned", *other_planes(scene)], seed=seed)


def headline(scale, seeds):
    """Our own rows of E2, which E7 repeats with other seeds."""
    jobs = []
    for name, (_, _, counts) in sweeps(scale).items():
        for count in counts:
            for seed in seeds:
                # First what the targets are about: fixed counts on half-size sweeps, three seeds; everything once.
                again = count == 100000 and name in ("liver, half", "brain, half")
                first = again or seed == 1 and (count or "half" in name or "linear" in name)
                method = "BIGUS auto" if count is None else f"BIGUS {short(count)}"
                jobs.append(headline_job(scale, name, count, seed, {"scene": name, "method": method, "seed": seed},
                                         1 if first else 2))
    return jobs


def e2_jobs(scale):
    jobs = headline(scale, [1])
    for name, (scene, frames, counts) in sweeps(scale).items():
        def add(title, method, cost=1, priority=1, name=name, scene=scene, frames=frames, score=("held_out",)):
            jobs.append(scale.job(scene, frames, method, {"scene": name, "method": title, "seed": 1}, cost, priority,
                                  score=[*score, *other_planes(scene)]))
        kind = name.split(",")[0]
        if name in ("brain, half", "phantom, linear"):
            # As the paper scores: frames trained on, so no virtual planes stand between them.
            add("BIGUS 2M, no virtual planes", forced(2000000, 150, virtual_planes=0, iterations=FOREVER), 170, 3,
                score=["held_out", "training"])
        for count, seconds in counts.items():
            if count:
                add(f"UltraGauss preset {short(count)}",
                    {"name": "ultragauss", "gaussians": count, "time_limit": 3 * seconds},
                    seconds + 3, 1 if name in ("liver, half", "brain, half") and count == 100000 else 3,
                    score=["held_out", "training"])
                add(f"compounding, memory of {short(count)}", {"name": "compounding", "equal_gaussians": count}, 2)
        for voxel in COMPOUNDING[kind]:
            add(f"compounding, {voxel} mm", {"name": "compounding", "voxel_size": voxel}, 3)
        for title, method in {**BASELINES, **VIRTUAL}.items():
            add(title, method)
    return jobs


E2 = Experiment(
    "e2", "E2: sweeps, as in the paper's Table 2", e2_jobs,
    with_speckle("held_out", "held-out") + at_planes({"turned_90": "90°"}) + structure_at({"turned_90": "90°"}) + CROSS
    + TRAINED + [("aligned PSNR", "scores.aligned.psnr", 2),
                                            ("voxel mm", "facts.voxel_size", 2)] + COST,
    lambda jobs: [dots([job for job in jobs if job.labels["scene"] == scene], "scores.held_out.psnr",
                       f"{scene}: held-out PSNR (dB)", lambda labels: labels["method"])
                  for scene in dict.fromkeys(job.labels["scene"] for job in jobs) if ", full" in scene or "linear" in scene],
    summary=("held-out PSNR in dB",
             {title: {"method": method}
              for title, method in (("field, nothing set", "BIGUS auto"),
                                    ("pose interpolation, any plane", "pose-aware linear, any plane"),
                                    ("compounding, best voxel", "compounding, * mm"),
                                    ("neighbour average", "neighbour average"))},
             {scene: ({"scene": scene}, "held-out PSNR")
              for scene in ("liver, full", "brain, full", "spine, full", "phantom, linear", "phantom, convex")}),
    split="scene", shows_decisions=True)

# ---- E3: the paper's Table 3 ----


def e3_jobs(scale):
    more = "0.8*l1 + 0.2*dssim + ffl"
    rows = [("random", "l1", 0, 100000), ("harris", "l1", 0, 100000), ("intensity", "l1", 0, 100000),
            ("intensity", "l2", 0, 100000), ("intensity", "0.8*l1 + 0.2*dssim", 0, 100000),
            ("intensity", more, 0, 100000), ("intensity", "l1", 50, 100000), ("intensity", "l1", 0, 20000),
            ("intensity", "l1", 0, 300000), ("harris", "l1", 0, 300000), ("harris", more, 0, 300000),
            ("harris", "l1", 50, 300000), ("harris", more, 50, 300000)]
    jobs = []
    for name, scene in (("brain", scale.real(BRAIN, 2)), ("phantom", scale.phantom())):
        for seeding, loss, interval, count in rows:
            cost = (8 if name == "brain" else 12) * max(1, count / 100000) * (2 if loss not in ("l1", "l2") else 1)
            jobs.append(scale.job(
                scene, {"hold_out": 4},
                forced(count, 4 * cost, seeding=seeding, loss=loss, densification_interval=interval, densification_cap=2 * count),
                {"scene": name, "seeds": seeding, "loss": loss, "densified": "yes" if interval else "",
                 "count": short(count)}, cost + 4, 1 if count <= 100000 else 2, score=["held_out", "training"]))
    return jobs


E3 = Experiment(
    "e3", "E3: seeds, losses, densification, count, as in the paper's Table 3", e3_jobs,
    with_speckle("held_out", "held-out") + TRAINED + COST,
    lambda jobs: [dots([job for job in jobs if job.labels["scene"] == scene], f"scores.{frames}.psnr",
                       f"{scene}: PSNR, {title} frames (dB)",
                       lambda labels: " ".join(str(labels[k]) for k in ("seeds", "loss", "count"))
                       + (" densified" if labels["densified"] else ""))
                  for scene in ("brain", "phantom")
                  for frames, title in (("held_out", "held-out"), ("training", "training"))],
    summary=("PSNR in dB",
             {title: {"seeds": seeds, "loss": loss, "densified": densified, "count": count}
              for title, seeds, loss, densified, count in (
                  ("random seeds, 100k", "random", "l1", "", "100k"), ("Harris seeds, 100k", "harris", "l1", "", "100k"),
                  ("intensity seeds, 100k", "intensity", "l1", "", "100k"),
                  ("Harris, DSSIM and FFL, densified, 300k", "harris", "0.8*l1 + 0.2*dssim + ffl", "yes", "300k"))},
             {f"{scene}, {frames}": ({"scene": scene}, f"{frames} PSNR")
              for scene in ("brain", "phantom") for frames in ("held-out", "training")}),
    split="scene")

# ---- E4: the paper's Table 4 ----

KNOWN_SIGMAS = (1, 2, 3, 4)  # mm


def thick(scale, sigma, **options):
    """A phantom whose beam has a standard deviation of sigma mm, with a dozen scatterers in a resolution cell."""
    size = ({"width": 64, "height": 64, "pixel_size": 0.8, "frames": 16} if scale.is_quick else
            {"width": 128, "height": 160, "pixel_size": 0.25, "frames": 60, "axial_sigma": 0.25, "lateral_sigma": 0.4,
             "scatterer_density": 10 / sigma})
    return scale.phantom(**{**size, "elevation_sigma": sigma, **options})


def e4_jobs(scale):
    crossing = {"phantoms": [phantom for angle in (0, 90)
                             for phantom in thick(scale, 1.5, sweep_angle=angle)["phantoms"]]}
    scenes = {"brain (sparse)": (scale.real(BRAIN, 2), 4, 100000, 0.8, 8, {}),
              "brain, no virtual planes": (scale.real(BRAIN, 2), 4, 100000, 0.8, 8, {"virtual_planes": 0}),
              "liver (dense)": (scale.real(LIVER, 2), 8, 40000, 0.3, 18, {}),
              "crossing phantoms": (crossing, 4, 50000, 1.5, 15, {})}
    for sigma in KNOWN_SIGMAS:
        scenes[f"phantom, sigma {sigma} mm"] = (thick(scale, sigma), 4, 30000, sigma, 5 + 3 * sigma, {})
    jobs = []
    for name, (scene, hold_out, count, sigma, cost, options) in scenes.items():
        priority = 1 if "sigma" not in name or sigma in (1, 4) else 2

        def add(method, labels, seconds, priority=priority, name=name, scene=scene, hold_out=hold_out):
            jobs.append(scale.job(scene, {"hold_out": hold_out}, method, {"scene": name, **labels}, seconds, priority,
                                  score=["held_out", "training"]))

        for is_signed in (False, True):
            for beam in (0, sigma):
                add(forced(count, 4 * cost, **{"signed_reflectivity": is_signed, "elevation_sigma": beam, **options}),
                    {"signed": "yes" if is_signed else "", "beam": "yes" if beam else "", "sigma mm": beam}, cost + 2)
        add(auto(count, **options), {"signed": "auto", "beam": "auto", "sigma mm": ""}, 2 * cost + 2)
    # What the decorrelation of speckle says, from all frames at full size; known where the label says so.
    estimated = {"brain (sparse)": (scale.real(BRAIN, 1), ""), "liver (dense)": (scale.real(LIVER, 1), ""),
                 "spine": (scale.real(SPINE, 1), ""), "crossing phantoms": (crossing, 1.5),
                 **{f"phantom, sigma {sigma} mm": (thick(scale, sigma), sigma) for sigma in KNOWN_SIGMAS}}
    for probe in ("linear", "convex", "sector"):
        estimated[f"phantom, {probe}"] = (scale.phantom(probe=probe), 0.8 if not scale.is_quick else "")
    for name, (scene, sigma) in estimated.items():
        jobs.append(scale.job(scene, {"hold_out": 0}, {"name": "elevation"},
                              {"scene": name, "signed": "", "beam": "estimate", "sigma mm": sigma}, 3))
    return jobs


def e4_panels(jobs):
    trained = [job for job in jobs if job.request["method"]["name"] == "bigus"]
    known = [job for job in jobs if job.labels["beam"] == "estimate" and job.labels["sigma mm"]]

    def estimates(axis):
        curves(known, lambda labels, _: labels["sigma mm"], lambda members: mean(members, "facts.sigma"),
               lambda labels: labels["scene"].split(",")[0], ("known sigma_E (mm)", "estimated (mm)"))(axis)
        axis.plot([0, max(KNOWN_SIGMAS)], [0, max(KNOWN_SIGMAS)], color="#999999", linewidth=0.8)

    return [gains(trained, f"scores.{frames}.psnr", f"PSNR, {title} frames", lambda labels: labels["scene"],
                  lambda labels: "auto" if labels["beam"] == "auto" else
                  f"{'signed' if labels['signed'] else 'positive'}, {'beam' if labels['beam'] else 'thin plane'}",
                  "positive, thin plane")
            for frames, title in (("held_out", "held-out"), ("training", "training"))] + [estimates]


E4 = Experiment(
    "e4", "E4: signed reflectivity and beam, as in the paper's Table 4", e4_jobs,
    scored("held_out", "held-out") + [("held-out BFS", "scores.held_out.bfs", 3)] + TRAINED + [
                                      ("sigma used mm", "facts.elevation_sigma", 2),
                                      ("estimated mm", "facts.sigma", 2), ("± mm", "facts.standard_error", 2),
                                      ("reliable", "facts.reliable", 0)] + COST[:1], e4_panels,
    summary=("held-out PSNR in dB",
             {scene: {"scene": scene} for scene in ("brain (sparse)", "brain, no virtual planes", "liver (dense)",
                                                    "crossing phantoms")},
             {title: ({"signed": signed, "beam": beam}, "held-out PSNR")
              for title, signed, beam in (("positive, thin plane", "", ""), ("positive, beam", "", "yes"),
                                          ("signed, thin plane", "yes", ""), ("signed, beam", "yes", "yes"),
                                          ("decided", "auto", "auto"))}))

# ---- E5: how far from the frames that were seen ----


def e5_jobs(scale):
    scenes = {"liver": (scale.real(LIVER, 2), 16, (1, 2, 4, 8), 90),
              "brain": (scale.real(BRAIN, 2), 8, (1, 2, 4), 25),
              "phantom": (scale.phantom(**({} if scale.is_quick else {"frames": 65})), 16 if not scale.is_quick else 8,
                          (1, 2, 4, 8) if not scale.is_quick else (1, 2, 4), 60)}
    jobs = []
    for name, (scene, period, gaps, cost) in scenes.items():
        for gap in gaps:
            frames = {"gap": gap, "period": period}
            labels = {"scene": name, "gap": gap}
            jobs.append(scale.job(scene, frames, auto(100000),
                                  {**labels, "method": "BIGUS 100k"}, cost / gap + 3))
            for title, method in BASELINES.items():
                jobs.append(scale.job(scene, frames, method, {**labels, "method": title}, 1))
            jobs.append(scale.job(scene, frames, {"name": "compounding"}, {**labels, "method": "compounding"}, 3))
    return jobs


E5 = Experiment(
    "e5", "E5: error against the distance to the next frame trained on", e5_jobs,
    with_speckle("held_out", "held-out") + COST,
    lambda jobs: [curves([job for job in jobs if job.labels["scene"] == scene], lambda labels, _: labels["gap"],
                         psnr("held_out"), lambda labels: labels["method"],
                         ("frames to the next training frame", "held-out PSNR (dB)", scene))
                  for scene in ("liver", "brain", "phantom")],
    summary=("liver, held-out PSNR in dB",
             {title: {"scene": "liver", "method": method}
              for title, method in (("field, 100k", "BIGUS 100k"), ("pose interpolation", "pose-aware linear"),
                                    ("compounding", "compounding"), ("neighbour average", "neighbour average"))},
             {f"{gap} frames away" if gap > 1 else "1 frame away": ({"gap": gap}, "held-out PSNR") for gap in (1, 2, 4, 8)}),
    split="scene")

# ---- E6: what time and memory buy ----


def e6_jobs(scale):
    scenes = {"liver": (scale.real(LIVER, 2), {"hold_out": 8},
                        [(20000, 15), (20000, 30), (100000, 15), (100000, 30), (100000, 60), (100000, 120),
                         (300000, 60), (300000, 150), (1000000, 300)]),
              "brain": (scale.real(BRAIN, 2), {"hold_out": 4},
                        [(20000, 5), (20000, 15), (100000, 5), (100000, 15), (100000, 30), (300000, 15),
                         (300000, 45)])}
    jobs = []
    for name, (scene, frames, runs) in scenes.items():
        for count, limit in runs:
            # As with `--time-limit`, deciding included.
            jobs.append(scale.job(scene, frames, auto(count, time_limit=limit, iterations=FOREVER),
                                  {"scene": name, "method": "BIGUS", "size": short(count), "limit": f"{limit} s"},
                                  limit + 5, 1 if limit <= 150 else 3))
        jobs.append(headline_job(scale, f"{name}, half", None, 1,
                                 {"scene": name, "method": "BIGUS", "size": "auto", "limit": ""}, 1))
        for voxel in (0.4, 0.5, 0.63, 0.8, 1, 1.3, 1.6):
            jobs.append(scale.job(scene, frames, {"name": "compounding", "voxel_size": voxel},
                                  {"scene": name, "method": "compounding", "size": f"{voxel} mm", "limit": ""}, 2))
        for count in (20000, 100000, 300000, 1000000):
            jobs.append(scale.job(scene, frames, {"name": "compounding", "equal_gaussians": count},
                                  {"scene": name, "method": "compounding", "size": f"memory of {short(count)}",
                                   "limit": ""}, 2))
    return jobs


def e6_panels(jobs):
    panels = []
    for scene in ("liver", "brain"):
        here = [job for job in jobs if job.labels["scene"] == scene]
        panels.append(curves([job for job in here if job.labels["method"] == "BIGUS"],
                             lambda _, members: mean(members, "seconds"), psnr("held_out"),
                             lambda labels: labels["size"],
                             ("seconds", "held-out PSNR (dB)", f"{scene}: time"), logarithmic=True))
        # Of each size the longest run: what so much memory can hold.
        longest = {job.labels["size"]: job for job in here if job.result}
        panels.append(curves(list(longest.values()), lambda _, members: megabytes(members), psnr("held_out"),
                             lambda labels: labels["method"],
                             ("megabytes", "held-out PSNR (dB)", f"{scene}: memory"), logarithmic=True))
    return panels


E6 = Experiment("e6", "E6: quality against time, and against memory", e6_jobs,
                scored("held_out", "held-out") + [("voxel mm", "facts.voxel_size", 2), ("bytes", "bytes", 0)] + COST
                + [("iterations", "facts.iterations", 0)], e6_panels,
                summary=("",
                         {title: {"method": method, "size": size, "limit": limit}
                          for title, method, size, limit in (
                              ("field, 20k, 15 s", "BIGUS", "20k", "15 s"), ("field, 100k, 30 s", "BIGUS", "100k", "30 s"),
                              ("compounding, 0.4 mm", "compounding", "0.4 mm", ""),
                              ("compounding, memory of 100k", "compounding", "memory of 100k", ""))},
                         {f"{scene}, {title}": ({"scene": scene}, column) for scene in ("liver", "brain")
                          for title, column in (("PSNR", "held-out PSNR"), ("bytes", "bytes"))}),
                split="scene")

# ---- E7: spread over seeds ----

E7 = Experiment(
    "e7", "E7: three seeds of the headline rows", lambda scale: headline(scale, [1, 2, 3]),
    scored("held_out", "held-out") + [("held-out BFS", "scores.held_out.bfs", 3),
                                      ("training PSNR", "scores.training.psnr", 2)] + COST[:1],
    lambda jobs: [spread(jobs, "scores.held_out.psnr", "held-out PSNR, each seed less the row's mean (dB)",
                         lambda labels: f"{labels['scene']}: {labels['method']}")])

# ---- E8: error against speckle ----


def e8_jobs(scale):
    losses = ["l1", "l2", "0.8*l1 + 0.2*dssim", "0.5*l1 + 0.5*dssim", "l1 + ffl", "l1 + 10*ffl", "l1 + 3*contrast",
              "l1 + 10*contrast", "l1 + 30*contrast", "l1 + 100*contrast"]
    jobs = []
    for name, scene, count, cost in (("brain", scale.real(BRAIN, 2), 100000, 10), ("phantom", scale.phantom(), 50000, 12)):
        for loss in losses:
            seconds = cost * (1 if loss in ("l1", "l2") else 2)
            jobs.append(scale.job(scene, {"hold_out": 4}, forced(count, 4 * seconds, loss=loss),
                                  {"scene": name, "method": loss}, seconds + 3, 1 if name == "brain" else 2,
                                  score=["held_out", "training"]))
        for preset in ("fidelity", "texture"):
            for count_kind, chosen in ((short(count), count), ("auto", None)):
                method = auto(chosen, preset=preset)
                jobs.append(scale.job(scene, {"hold_out": 4}, method,
                                      {"scene": name, "method": f"{preset}, {count_kind}"}, 3 * cost, 1,
                                      score=["held_out", "training"]))
        kept = {"virtual plane, contrast kept": {"name": "virtual", "interpolation": "normals", "keep_contrast": True}}
        for title, method in {**BASELINES, **kept}.items():
            jobs.append(scale.job(scene, {"hold_out": 4}, method, {"scene": name, "method": title}, 1))
    return jobs


def contrast_error(members):
    """Of the mean speckle contrast, in per cent of the truth's."""
    ratio = mean(members, "scores.held_out.texture.contrast_ratio")
    return None if ratio is None else 100 * abs(ratio - 1)


E8 = Experiment(
    "e8", "E8: error against speckle", e8_jobs,
    with_speckle("held_out", "held-out") + [
        ("contrast / truth", "scores.held_out.texture.contrast_ratio", 3),
        ("spectrum dB", "scores.held_out.texture.spectrum_difference", 2),
        ("high frequencies / truth", "scores.held_out.texture.high_frequency_power", 3)] + COST[:1],
    lambda jobs: [frontier([job for job in jobs if job.labels["scene"] == scene], contrast_error, psnr("held_out"),
                           lambda labels: labels["method"], lambda name: name == "l1" or "*contrast" in name,
                           ("error of the mean speckle contrast, held-out frames (%)", "held-out PSNR (dB)", scene))
                  for scene in ("brain", "phantom")],
    summary=("",
             {title: {"method": method}
              for title, method in (("preset fidelity", "fidelity, auto"), ("preset texture", "texture, auto"),
                                    ("pose interpolation", "pose-aware linear"), ("nearest frame", "nearest frame"))},
             {f"{scene}, {title}": ({"scene": scene}, column) for scene in ("brain", "phantom")
              for title, column in (("PSNR", "held-out PSNR"), ("contrast / truth", "contrast / truth"))}),
    split="scene")

# ---- E9: short and rough sweeps ----


def e9_jobs(scale):
    variants = [(10, 0.1, 0.4, 1.5), (20, 0.3, 0.4, 1), (40, 0.5, 0.4, 0.6), (20, 0.1, 0.9, 1.5), (30, 0.5, 0.9, 1)]
    jobs = []

    def add(name, scene, title, method, seconds=1.5):
        jobs.append(scale.job(scene, {"hold_out": 4}, method, {"scene": name, "method": title}, seconds,
                              score=["held_out", "aligned"]))

    scenes = {"spine": (scale.real(SPINE, 2), COMPOUNDING["spine"])}
    for frames, noise, unevenness, spacing in variants:
        options = {"tracking_noise": noise, "speed_variation": unevenness, "frame_spacing": spacing, "frames": frames}
        name = f"phantom, {frames} frames, noise {noise} mm, step {spacing} mm, uneven {unevenness:.0%}"
        scenes[name] = (scale.phantom(**options), (0.3, 0.5, 0.8, 1.2))
    for name, (scene, voxels) in scenes.items():
        add(name, scene, "BIGUS auto", auto(), 18)
        add(name, scene, "nearest frame", {"name": "nearest"})
        add(name, scene, "neighbour average", {"name": "neighbour_average"})
        add(name, scene, "pose-aware linear", {"name": "pose_linear"})
        for voxel in voxels:
            add(name, scene, f"compounding, {voxel} mm", {"name": "compounding", "voxel_size": voxel})
    return jobs


E9 = Experiment(
    "e9", "E9: short and rough sweeps, nothing set by hand", e9_jobs,
    scored("held_out", "held-out") + [("aligned PSNR", "scores.aligned.psnr", 2)] + COST,
    lambda jobs: [dots([job for job in jobs if job.labels["scene"] == scene], "scores.held_out.psnr",
                       f"{scene.replace('phantom, ', '')}:\nheld-out PSNR (dB)", lambda labels: labels["method"])
                  for scene in dict.fromkeys(job.labels["scene"] for job in jobs)],
    summary=("held-out PSNR in dB",
             {title: {"scene": scene}
              for title, scene in (
                  ("spine", "spine"),
                  ("phantom, 10 frames, noise 0.1 mm", "phantom, 10 frames, noise 0.1 mm, step 1.5 mm, uneven 40%"),
                  ("phantom, 20 frames, noise 0.3 mm", "phantom, 20 frames, noise 0.3 mm, step 1 mm, uneven 40%"),
                  ("phantom, 40 frames, noise 0.5 mm", "phantom, 40 frames, noise 0.5 mm, step 0.6 mm, uneven 40%"))},
             {title: ({"method": method}, "held-out PSNR")
              for title, method in (("field, nothing set", "BIGUS auto"), ("pose interpolation", "pose-aware linear"),
                                    ("compounding, best voxel", "compounding, * mm"),
                                    ("neighbour average", "neighbour average"))}),
    split="scene", shows_decisions=True)

# ---- E10: errors of the tracker ----

STEPPER = {"speed_variation": 0, "tilt": 0, "wander": 0}
TRACKERS = {"exact": {}, "stepper, exact": STEPPER,
            "noise 0.05 mm, 0.05°": {"tracking_noise": 0.05, "tracking_rotation_noise": 0.05},
            "noise 0.2 mm, 0.3°": {"tracking_noise": 0.2, "tracking_rotation_noise": 0.3},
            "noise 0.2 mm, 0.3°, a quarter dropped":
                {"tracking_noise": 0.2, "tracking_rotation_noise": 0.3, "dropped_share": 0.25},
            "drift 1 mm, 1°": {"tracking_drift": 1, "tracking_rotation_drift": 1},
            "5 % outliers, 2 mm": {"outlier_share": 0.05, "outlier_size": 2},
            "rounded to 0.25 mm, 0.25°": {"tracking_quantum": 0.25, "tracking_rotation_quantum": 0.25}}
# Two sweeps that cross at right angles, or one there and back, whose errors are the same in every frame.
CALIBRATION = {"calibration_shift": [1, 1, 1], "calibration_rotation": [1, -1, 1]}
CONSTANT = {"crossing, exact": (True, {}), "crossing, 1 mm and 1° of calibration": (True, CALIBRATION),
            "crossing, the same with noise 0.1 mm, 0.1°":
                (True, {**CALIBRATION, "tracking_noise": 0.1, "tracking_rotation_noise": 0.1}),
            "crossing, delay 50 ms": (True, {"tracking_delay": 0.05}),
            "there and back, exact": (False, {}), "there and back, delay 50 ms": (False, {"tracking_delay": 0.05})}


def e10_jobs(scale):
    # Small and without trials: what poses cost shows in any field, and trials would choose another for each tracker.
    field = {"name": "bigus", "gaussians": 20000, "iterations": 300, "automatic": False}
    scenes = {name: scale.phantom(**tracker) for name, tracker in TRACKERS.items()}
    for name, (crosses, tracker) in CONSTANT.items():
        sweeps = [scale.phantom(**tracker, sweep_angle=angle, frames=48)["phantoms"][0] for angle in (0, 90)]
        scenes[name] = {"phantoms": sweeps} if crosses else scale.phantom(**tracker, passes=2, frames=96)
    jobs = []
    for name, scene in scenes.items():
        for poses in ("tracked", "corrected"):
            for title, method, seconds, priority in (
                    ("BIGUS 20k, nothing tried", field, 20, 1),
                    ("pose interpolation, any plane", {"name": "pose_any_plane"}, 6, 1),
                    ("neighbour average", {"name": "neighbour_average"}, 3, 1),
                    ("compounding", {"name": "compounding"}, 4, 1)):
                jobs.append(scale.job(scene, {"hold_out": 8}, method,
                                      {"tracker": name, "poses": poses, "method": title}, seconds, priority,
                                      poses=poses))
    return jobs


E10 = Experiment(
    "e10", "E10: errors of the tracker", e10_jobs,
    scored("held_out", "held-out") + [("corner error mm", "poses.error.distance", 3),
                                      ("bent by mm", "poses.error.bending", 3),
                                      ("angle °", "poses.error.angle", 3)] + COST,
    lambda jobs: [dots([job for job in jobs if job.labels["method"] == "pose interpolation, any plane"], path, title,
                       lambda labels: f"{labels['tracker']}, {labels['poses']}")
                  for path, title in (("poses.error.bending", "poses are bent by (mm)"),
                                      ("scores.held_out.psnr", "pose interpolation: PSNR (dB)"))],
    summary=("pose interpolation at any plane",
             {name: {"tracker": name, "method": "pose interpolation, any plane"} for name in (*TRACKERS, *CONSTANT)},
             {f"{column}, {poses}": ({"poses": poses}, column)
              for column in ("bent by mm", "held-out PSNR") for poses in ("tracked", "corrected")}),
    split="method", shows_decisions=False)

# ---- E11: any plane ----

ANY_PLANE = {"pose interpolation": {"name": "pose_any_plane"}, "cubic": {"name": "cubic_any_plane"}}
PEER_SECONDS = 120  # for a field and for a network that another program trains
VOLUME_VOXELS, PHANTOM_VOXELS = (0.6, 0.9, 1.2), (0.3, 0.4, 0.6, 0.8, 1)


def e11_jobs(scale):
    jobs = []

    def add(name, scene, every, frames, voxels, sets, seconds):
        def row(title, method, seconds, priority=1, **more):
            jobs.append(scale.job(scene, frames, method, {"scene": name, "every": every, "method": title}, seconds,
                                  priority, score=["held_out", *sets], **more))
        row("BIGUS", auto(), seconds, 1 if every in ("", 4) else 2)
        for title, method in ANY_PLANE.items():
            row(title, method, 6)
        for voxel in voxels:
            row(f"compounding, {voxel} mm", {"name": "compounding", "voxel_size": voxel}, 4)
        if name == "liver volume" and every == 4:
            row(f"BIGUS, {PEER_SECONDS} s", auto(time_limit=PEER_SECONDS), PEER_SECONDS + 8, 2)
            row(f"hash-grid network, {PEER_SECONDS} s", {"name": "hash_grid", "time_limit": PEER_SECONDS},
                PEER_SECONDS + 60, 2, program="hash-grid")

    for name, scene in volumes(scale).items():
        for every in (2, 4, 8):
            add(name, scene, every, {"every": every}, VOLUME_VOXELS, VOLUME_PLANES, 140)
    for probe in ("linear", "convex"):
        add(f"phantom, {probe}", scale.phantom(probe=probe), "", {"hold_out": 4}, PHANTOM_VOXELS,
            [*TURNED_FRAMES, "cross"], 110)
    for name in ("liver, half", "brain, half", "spine, half"):
        scene, frames, counts = sweeps(scale)[name]
        count = [count for count in counts if count][0]
        jobs.append(headline_job(scale, name, count, 1, {"scene": name, "every": "", "method": "BIGUS"}, 1))
        for title, method in ANY_PLANE.items():
            jobs.append(scale.job(scene, frames, method, {"scene": name, "every": "", "method": title}, 3,
                                  score=["held_out", *other_planes(scene)]))
        for voxel in COMPOUNDING[name.split(",")[0]]:
            jobs.append(scale.job(scene, frames, {"name": "compounding", "voxel_size": voxel},
                                  {"scene": name, "every": "", "method": f"compounding, {voxel} mm"}, 3,
                                  score=["held_out", *other_planes(scene)]))
    return jobs


def e11_panels(jobs):
    def of(scene):
        return [job for job in jobs if job.labels["scene"] == scene]

    def method(labels):
        return labels["method"]

    return [curves(of(scene), lambda labels, _: labels["every"], psnr(planes), method,
                   ("one z-plane in so many trained on", f"PSNR, {title} planes (dB)", scene))
            for scene in ("liver volume", "phantom") for planes, title in (("planes_x", "x-"), ("planes_45", "45°"))] + [
        dots(of("phantom, linear"), "scores.turned_90.structure", "phantom turned by 90°: structure (dB)", method),
        dots(of("brain, half"), "scores.cross.scratches", "brain: scratches, linear interpolation = 1", method)]


E11 = Experiment(
    "e11", "E11: any plane", e11_jobs,
    scored("held_out", "held-out")[:1] + at_planes({**VOLUME_PLANES, **{name: f"turned {title}" for name, title in
                                                                       TURNED_FRAMES.items()}})
    + structure_at({name: f"turned {title}" for name, title in TURNED_FRAMES.items()}) + CROSS + COST
    + [("sigma mm", "facts.elevation_sigma", 2)], e11_panels,
    summary=("PSNR in dB",
             {title: {"method": method}
              for title, method in (("field", "BIGUS"), (f"field, {PEER_SECONDS} s", f"BIGUS, {PEER_SECONDS} s"),
                                    (f"hash-grid network, {PEER_SECONDS} s", f"hash-grid network, {PEER_SECONDS} s"),
                                    ("pose interpolation, any plane", "pose interpolation"),
                                    ("cubic, any plane", "cubic"), ("compounding, best voxel", "compounding, * mm"))},
             {**{f"volume, {title}": ({"scene": "liver volume", "every": 4}, f"{column} PSNR")
                 for title, column in {"unseen z": "held-out", **{name: name for name in VOLUME_PLANES.values()}}.items()},
              "phantom, 90°": ({"scene": "phantom, linear"}, "turned 90° PSNR"),
              "its structure": ({"scene": "phantom, linear"}, "turned 90° structure")}),
    split="scene", shows_decisions=True)

# ---- E12: quality over time ----

LIMITS = (5, 10, 20, 40, 80)
LEAST_SECONDS = 0.05  # where a logarithmic axis shows what needs no preparation
TIMED = ("liver, full", "brain, full", "spine, full", "phantom, linear")
FIRST, FIRST_LIMITS = "92a5706", (5, 20, 80)  # before poses were corrected and trials stood behind the first stage


def e12_jobs(scale):
    jobs = []
    for name in TIMED:
        scene, frames, _ = sweeps(scale)[name]
        for limit in LIMITS:
            jobs.append(scale.job(scene, frames, auto(time_limit=limit),
                                  {"scene": name, "method": "field", "limit": limit}, limit + 8))
        for limit in FIRST_LIMITS:
            jobs.append(scale.job(scene, frames, auto(time_limit=limit),
                                  {"scene": name, "method": f"field of {FIRST}", "limit": limit}, limit + 60,
                                  program=FIRST))
        for title in ("neighbour average", "pose-aware linear, any plane"):
            jobs.append(scale.job(scene, frames, BASELINES[title], {"scene": name, "method": title, "limit": ""}, 5))
        for voxel in COMPOUNDING[name.split(",")[0]]:
            jobs.append(scale.job(scene, frames, {"name": "compounding", "voxel_size": voxel},
                                  {"scene": name, "method": f"compounding, {voxel} mm", "limit": ""}, 8))
    return jobs


def e12_panels(jobs):
    def at(_, members):
        return max(mean(members, "seconds"), LEAST_SECONDS)

    return [curves([job for job in jobs if job.labels["scene"] == name], at, psnr("held_out"),
                   lambda labels: labels["method"], ("seconds", "held-out PSNR (dB)", name), logarithmic=True)
            for name in TIMED]


E12 = Experiment(
    "e12", "E12: quality over time", e12_jobs, scored("held_out", "held-out") + COST, e12_panels,
    summary=("held-out PSNR in dB",
             {**{f"field, {limit} s": {"method": "field", "limit": limit} for limit in LIMITS},
              **{f"field of {FIRST}, {limit} s": {"method": f"field of {FIRST}", "limit": limit} for limit in FIRST_LIMITS},
              **{title: {"method": method}
                 for title, method in (("pose interpolation, any plane", "pose-aware linear, any plane"),
                                       ("compounding, best voxel", "compounding, * mm"),
                                       ("neighbour average", "neighbour average"))}},
             {name: ({"scene": name}, "held-out PSNR") for name in TIMED}),
    split="scene")

# ---- E13: corrected poses of made-up sweeps ----

SEEDS = (1, 2, 3, 4)
MADE_UP = {"width": 96, "height": 96, "pixel_size": 0.3, "scatterer_density": 8}
NOISE = {"tracking_noise": 0.2, "tracking_rotation_noise": 0.3}
ROUNDED = {"tracking_quantum": 0.3, "tracking_rotation_quantum": 0.3}
SHAKING = {"shake": 0.2, "shake_rotation": 0.3}
DRIFT = {"tracking_noise": 0.5, "tracking_rotation_noise": 0.5, "noise_correlation": 40}
BACK = {"passes": 2, "frames": 96}
SPARSE = {"frames": 24, "frame_spacing": 1.5}
HANDS = {
    "exact": {},
    "white 0.05 mm, 0.05°": {"tracking_noise": 0.05, "tracking_rotation_noise": 0.05},
    "white 0.2 mm, 0.3°": NOISE,
    "the same, 5 % outliers of 2 mm": {**NOISE, "outlier_share": 0.05},
    **{f"the same, correlated over {n} frames": {**NOISE, "noise_correlation": n} for n in (3, 10, 30)},
    "10 frames, and rounded to 0.3 mm, 0.3°": {**NOISE, **ROUNDED, "noise_correlation": 10},
    "drift 0.5 mm, 0.5° (40 frames)": DRIFT,
    "24 frames 1.5 mm apart, white": {**SPARSE, **NOISE},
    "24 frames 1.5 mm apart, 8 frames": {**SPARSE, **NOISE, "noise_correlation": 8},
    "there and back, white": {**BACK, **NOISE},
    "there and back, white 0.5 mm, 0.5°": {**BACK, "tracking_noise": 0.5, "tracking_rotation_noise": 0.5},
    "there and back, 10 frames": {**BACK, **NOISE, "noise_correlation": 10},
    "there and back, drift": {**BACK, **DRIFT},
    "straight there and back, 10 frames": {**BACK, **NOISE, "noise_correlation": 10, "tilt": 0, "wander": 0},
    "probe shakes, white": SHAKING,
    "probe shakes, 3 frames": {**SHAKING, "shake_correlation": 3},
    "probe shakes, 10 frames": {**SHAKING, "shake_correlation": 10},
    "probe shakes, tracker white": {**SHAKING, **NOISE}}


def e13_jobs(scale):
    size, seeds = ({}, SEEDS[:1]) if scale.is_quick else (MADE_UP, SEEDS)
    return [scale.job(scale.phantom(**{**size, **hand, "seed": seed}), {"hold_out": 8}, {"name": "pose_any_plane"},
                      {"sweep": name, "seed": seed}, 6, seed=seed)
            for name, hand in HANDS.items() for seed in seeds]


E13_ERRORS = {"tracked": "error_tracked", "smoothed": "error_smoothed", "corrected": "error", "best": "error_best"}
E13 = Experiment(
    "e13", "E13: how well are the poses of made-up sweeps corrected?", e13_jobs,
    [("strengths", "poses.strength", None), ("best strengths", "poses.error_best.strength", None),
     ("aligned", "poses.aligned", None)]
    + [(f"{title}, mm", f"poses.{path}.distance", 3) for title, path in E13_ERRORS.items()]
    + [(f"{title}, bent by mm", f"poses.{path}.bending", 3) for title, path in E13_ERRORS.items()]
    + scored("held_out", "held-out")[:1] + [("seconds for poses", "poses.seconds", 2)],
    lambda jobs: [dots(jobs, f"poses.{path}.distance", f"corner error (mm), {title}", lambda labels: labels["sweep"])
                  for title, path in E13_ERRORS.items()],
    summary=("made-up sweep", {name: {"sweep": name} for name in HANDS},
             {column: ({}, column) for column in ("strengths", "best strengths", "aligned",
                                                  *(f"{title}, mm" for title in E13_ERRORS))}),
    is_long=True)

# ---- E14: standard errors ----

WIRES = {name: {"file": f"nwire-fcal/fCal_Test_{name.capitalize()}_3NWires_fCal2.0.igs.mha",
                "config": "nwire-fcal/PlusDeviceSet_fCal_Sim_VolumeReconstruction.xml"}
         for name in ("validation", "calibration")}
UNSEEN = {"width": 128, "height": 128, "pixel_size": 0.3, "frames": 48}
WORLDS = {"phantom, linear": {}, "phantom, linear, noise": NOISE, "phantom, convex": {"probe": "convex"},
          "phantom, sector": {"probe": "sector"}}
TURNS = (0, 30, 60, 90)


def e14_jobs(scale):
    jobs = []
    for name in ("brain, half", "spine, half", "liver, half"):
        scene, frames, counts = sweeps(scale)[name]
        jobs.append((name.split(",")[0], scene, frames, counts[None] + 10, 1, (0,)))
    jobs[2:2] = [(f"wires, {name}", scale.real(scene, 2), {"hold_out": 8}, 90, 1, (0,)) for name, scene in WIRES.items()]
    size, seeds = ({}, (1,)) if scale.is_quick else (UNSEEN, (1, 2))
    jobs += [(name, scale.phantom(**{**size, **world, "seed": seed}), {"hold_out": 4}, 80, seed, TURNS)
             for name, world in WORLDS.items() for seed in seeds]
    # One training has a row for each direction.
    return [scale.job(scene, frames, auto(), {"sweep": name, "degrees": degrees, "seed": seed}, seconds,
                      2 if name == "liver" else 1, seed=seed,
                      score=["held_out", *(f"standard_error_{turn}" for turn in turns)])
            for name, scene, frames, seconds, seed, turns in jobs for degrees in turns]


def e14_columns():
    under = "scores.standard_error_{degrees}"
    kinds = {"": "", "distance ": ".distance", "local variance ": ".local_variance"}
    return ([("error", f"{under}.rmse", 4), ("known", f"{under}.known", 2), ("ratio", f"{under}.variance_ratio", 2)]
            + [(f"{kind}{title}", f"{under}{of}.{path}", 2) for kind, of in kinds.items()
               for title, path in (("within 1", "within_1"), ("within 2", "within_2"), ("AUSE", "sparsification"),
                                   ("correlation", "correlation"))]
            + [(f"constant {title}", f"{under}.constant.{path}", 2)
               for title, path in (("within 1", "within_1"), ("within 2", "within_2"))]
            + [(f"means of {n} x {n}", f"{under}.means.{n}.variance_ratio", 2) for n in (8, 32, 128)] + COST)


def e14_panels(jobs):
    def of(has):
        return [job for job in jobs if has(job.labels["sweep"], job.labels["degrees"])]

    path = "scores.standard_error_{degrees}.reliability"
    return [reliability(of(lambda name, _: "phantom" not in name), path, lambda labels: labels["sweep"], "recorded sweeps"),
            reliability(of(lambda name, turn: "phantom" in name and turn == 0), path, lambda labels: labels["sweep"],
                        "made-up sweeps, frames held out"),
            reliability(of(lambda name, _: name == "phantom, linear"), path,
                        lambda labels: f"turned by {labels['degrees']}°", "made-up sweep, linear probe, other planes"),
            dots(jobs, "scores.standard_error_{degrees}.variance_ratio", "mean variance said / mean squared error",
                 lambda labels: f"{labels['sweep']}, {labels['degrees']}°")]


E14 = Experiment(
    "e14", "E14: are standard errors right?", e14_jobs, e14_columns(), e14_panels,
    summary=("held-out frames; turned planes",
             {name if degrees == 0 else f"{name}, turned by {degrees}°": {"sweep": name, "degrees": degrees}
              for name in ("brain", "spine", *(f"wires, {name}" for name in WIRES), "liver", *WORLDS)
              for degrees in (TURNS if name in WORLDS else (0,))},
             {column: ({}, column) for column in ("error", "ratio", "within 1", "within 2", "correlation", "AUSE",
                                                  "distance AUSE", "local variance AUSE", "means of 8 x 8",
                                                  "means of 32 x 32")}),
    is_long=True)

EXPERIMENTS = {experiment.name: experiment
               for experiment in (E1, E2, E3, E4, E5, E6, E7, E8, E9, E10, E11, E12, E13, E14)}
