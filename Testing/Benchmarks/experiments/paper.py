# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The paper's claims beside what was measured here: other data, the same questions."""

from harness import mean

EXPERIMENTS = {"e1", "e2", "e3", "e4"}  # that have rows here
TRAINING, HELD_OUT = "scores.training.psnr", "scores.held_out.psnr"


def number(jobs, path, labels):
    """Mean over the jobs with these labels; None when none was run."""
    return mean([job for job in jobs if all(job.labels.get(name) == wanted for name, wanted in labels.items())], path)


def level(experiment, labels, *paths):
    """PSNR (and more) of one row."""
    def measure(jobs):
        values = [number(jobs[experiment], path, labels) for path in paths]
        return "–" if values[0] is None else " / ".join("–" if v is None else f"{v:.2f}" if v > 1.5 else f"{v:.3f}"
                                                        for v in values)
    return measure


def gain(experiment, scenes, before, after):
    """PSNR gained from one row to another, on frames trained on and on held-out frames, for each scene."""
    def measure(jobs):
        texts = []
        for title, scene in scenes.items():
            steps = []
            for path in (TRAINING, HELD_OUT):
                a = number(jobs[experiment], path, {"scene": scene, **before})
                b = number(jobs[experiment], path, {"scene": scene, **after})
                steps.append("–" if a is None or b is None else f"{b - a:+.2f}")
            texts.append(f"{title} {steps[0]}, held out {steps[1]}")
        return "; ".join(texts)
    return measure


def e1(method, limit, slices=160):
    labels = {"scene": "liver volume", "slices": slices, "method": method, "limit": limit}
    return level("e1", labels, "scores.all.psnr", "scores.all.ssim")


def e1_unseen(method, limit, slices):
    labels = {"scene": "liver volume", "slices": slices, "method": method, "limit": limit}
    return level("e1", labels, "scores.held_out.psnr", "scores.held_out.ssim")


E3 = {"brain": "brain", "phantom": "phantom"}
E4 = {"brain": "brain (sparse)", "without virtual planes": "brain, no virtual planes", "liver": "liver (dense)",
      "crossing": "crossing phantoms"}
HARRIS_300K = {"seeds": "harris", "count": "300k"}
MORE_LOSSES = "0.8*l1 + 0.2*dssim + ffl"
POSITIVE_THIN = {"signed": "", "beam": ""}

# (what the paper reports, its figures, ours)
CLAIMS = [
    ("Table 1, 160 slices, 140k, 5 minutes: PSNR / SSIM", "58.08 / .998", e1("BIGUS 140k", "300 s")),
    ("the same at convergence", "67.26 / 1.000 (15 minutes)", e1("BIGUS 140k", "3600 s")),
    ("UltraGauss 100k, 5 minutes", "43.07 / .986", e1("UltraGauss preset 100k", "300 s")),
    ("UltraGauss 2M, 5 minutes", "41.17 / .982", e1("UltraGauss preset 2M", "300 s")),
    ("80 slices, 140k, 5 minutes", "51.65 / .999", e1("BIGUS 140k", "300 s", 80)),
    ("its slices not trained on", "not reported", e1_unseen("BIGUS 140k", "300 s", 80)),
    ("UltraGauss 100k, 80 slices", "39.99 / .980", e1("UltraGauss preset 100k", "300 s", 80)),
    ("Table 3, Harris instead of random seeds, 100k", "BITE +4.15, TUS +1.16",
     gain("e3", E3, {"seeds": "random", "count": "100k"},
          {"seeds": "harris", "count": "100k", "loss": "l1", "densified": ""})),
    ("more Gaussians: 100k to 2M (here 300k)", "BITE +3.55, TUS +3.02",
     gain("e3", E3, {"seeds": "harris", "count": "100k", "loss": "l1", "densified": ""},
          {**HARRIS_300K, "loss": "l1", "densified": ""})),
    ("DSSIM and FFL beside L1", "BITE +0.46, TUS +0.69",
     gain("e3", E3, {**HARRIS_300K, "loss": "l1", "densified": ""},
          {**HARRIS_300K, "loss": MORE_LOSSES, "densified": ""})),
    ("densification", "BITE +0.57, TUS +1.05",
     gain("e3", E3, {**HARRIS_300K, "loss": "l1", "densified": ""},
          {**HARRIS_300K, "loss": "l1", "densified": "yes"})),
    ("Table 4, signed reflectivity, thin plane", "BITE +0.71, TUS +0.44",
     gain("e4", E4, POSITIVE_THIN, {"signed": "yes", "beam": ""})),
    ("beam, positive reflectivity", "BITE +5.72, TUS -0.80",
     gain("e4", E4, POSITIVE_THIN, {"signed": "", "beam": "yes"})),
    ("both", "BITE +7.93, TUS +4.67",
     gain("e4", E4, POSITIVE_THIN, {"signed": "yes", "beam": "yes"})),
    ("Table 2, sweep: PSNR / SSIM / BFS of frames trained on (2M)", "BITE 34.7 / .965 / .871, TUS 34.40 / .917 / .805",
     lambda jobs: "; ".join(
         f"{title} " + level("e2", {"scene": scene, "method": "BIGUS 2M, no virtual planes"}, TRAINING, "scores.training.ssim",
                             "scores.training.bfs")(jobs)
         for title, scene in (("brain", "brain, half"), ("phantom", "phantom, linear")))),
]


def table(jobs):
    """jobs: those of every experiment, by its name, with their results."""
    lines = ["| the paper | its figures | here |", "|---|---|---|"]
    lines += [f"| {claim} | {figures} | {measure(jobs)} |" for claim, figures, measure in CLAIMS]
    return "\n".join(lines) + "\n"
