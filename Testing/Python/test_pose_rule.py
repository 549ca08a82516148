# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The share of a step that pictures confirm, computed anew with numpy from poses and pixels (PoseCorrection.md), against what
vtkBigusPoseCorrection says of every step, and the rule that takes them."""

import math
import sys
import unittest

import bigus
import numpy as np

LADDER = (0, 0.5, 1, 2, 4, 8, 16, 32, 64, 128)
TESTS, EDGE, LEAST_COVER, AHEAD = 48, 3, 0.25, 3


def blurred(image, sigma):
    """Sampled Gaussian of four deviations each way; black beyond the border."""
    x = np.arange(-4 * sigma, 4 * sigma + 1)
    taps = np.exp(-0.5 * (x / sigma) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        image = np.apply_along_axis(np.convolve, axis, image, taps, "same")
    return image


def octaves(residual):
    """What blurring by 2, 4 and 8 removes of what blurring by 1 left, sides even throughout."""
    low = blurred(residual, 1)
    for _ in range(3):
        picture, low = low, blurred(low, 2)
        yield picture - low
        low = low.reshape(low.shape[0] // 2, 2, low.shape[1] // 2, 2).mean((1, 3))


def normal(pose):
    n = np.cross(pose[:3, 0], pose[:3, 1])
    return n / np.linalg.norm(n)


class Evidence:
    """Frames in [0, 1], every pixel of which is lit."""

    def __init__(self, frames):
        self.frames = frames
        count, height, width = frames.shape
        self.inner = np.zeros((height, width), bool)
        self.inner[EDGE:-EDGE, EDGE:-EDGE] = True
        inside = np.arange(1, count - 1)
        most = min(TESTS, len(inside))
        self.tests = [[(k, k - lag, k + lag) for lag in (1, 2) if k >= lag and k + lag < count]
                      for k in inside[[(2 * t + 1) * len(inside) // (2 * most) for t in range(most)]]]

    def side(self, pose, direction, other, frame):
        """Of every pixel of `pose` what lies along a direction on another frame, nan where nothing does, and how far."""
        axes = np.linalg.inv(np.column_stack([other[:3, 0], other[:3, 1], normal(other)]))
        height, width = frame.shape
        y, x = np.mgrid[:height, :width]
        points = pose[:3, 3] - other[:3, 3] + x[..., None] * pose[:3, 0] + y[..., None] * pose[:3, 1]
        local, along = points @ axes.T, axes @ direction
        steps = -local[..., 2] / along[2]
        i, j = local[..., 0] + steps * along[0], local[..., 1] + steps * along[1]
        seen = (i >= 0) & (j >= 0) & (i < width - 1) & (j < height - 1)
        u, v = np.where(seen, i, 0), np.where(seen, j, 0)
        i, j = u.astype(int), v.astype(int)
        u, v = u - i, v - j
        seen &= self.inner[j, i] & self.inner[j + 1, i + 1]
        value = ((1 - v) * ((1 - u) * frame[j, i] + u * frame[j, i + 1])
                 + v * ((1 - u) * frame[j + 1, i] + u * frame[j + 1, i + 1]))  # fmt: skip
        return np.where(seen, value, np.nan), np.abs(steps)

    def residual(self, poses, test):
        k, before, after = test
        direction = normal(poses[before]) + normal(poses[after])
        direction /= np.linalg.norm(direction)
        (a, near), (b, far) = (self.side(poses[k], direction, poses[o], self.frames[o]) for o in (before, after))
        share = near / (near + far)
        return np.where(self.inner, (1 - share) * a + share * b - self.frames[k], np.nan)

    def step(self, poses, others):
        """Share, its error and the gain of the step from some poses to others."""
        gained, changed, gain = [], [], []
        for tests in self.tests:
            of = []
            for test in tests:
                r, s = self.residual(poses, test), self.residual(others, test)
                both = ~np.isnan(r) & ~np.isnan(s)
                if both.sum() <= LEAST_COVER * self.inner.sum():
                    continue
                for a, b in zip(octaves(np.where(both, r, 0)), octaves(np.where(both, s, 0))):
                    rounding = a.size / r.size * both.sum() / 255**2 / 12
                    p, q = (a * a).sum() + rounding, (b * b).sum() + rounding
                    level = (p + q) / 2
                    of.append(((p - q) / level, ((a - b) ** 2).sum() / level, 10 * math.log10(p / q)))
            for to, value in zip((gained, changed, gain), np.mean(of, 0)):
                to.append(value)
        g, c = np.array(gained), np.array(changed)
        share = 0.5 + 0.5 * g.sum() / c.sum()
        e = 0.5 * (g - (2 * share - 1) * c) / c.sum()
        variance = (e * e).sum() + sum(2 * (1 - lag / 3) * (e[:-lag] * e[lag:]).sum() for lag in (1, 2))
        return share, math.sqrt(max(variance, 0)), np.mean(gain)


def chosen(judge):
    """The rule: strength, and the steps that it asks for as (from, to, taken)."""
    steps = []

    def taken(now, to, least, errors, least_gain):
        share, error, gain = judge(now, to)
        steps.append((now, to, share > least and share - 0.5 > errors * error and gain > least_gain))
        return steps[-1][2]

    if not taken(0, 1, 0.5, 1, -math.inf):
        return (0.5 if taken(0, 0.5, 0.5, 1, -math.inf) else 0), steps
    rung = last = LADDER.index(1)
    while last < len(LADDER) - 1 and last < rung + AHEAD:
        last += 1
        if taken(LADDER[rung], LADDER[last], 0.75, 1.5, 0.02):
            rung = last
    return LADDER[rung], steps


def correction(sweep, strength=-1.0):
    found = bigus.correct_poses(sweep, Strength=strength)
    choice = found.decision["choice"]
    if "aligned" in choice or "image moved" in choice:
        raise AssertionError(f"these poses are more than smoothed: {choice}")
    return found


class Rule(unittest.TestCase):
    def check(self, **settings):
        source = bigus.vtkBigusPhantomSource()
        for name, value in dict(Scene=1, FrameSize=(96, 96), PixelSize=0.3, ScattererDensity=8.0, **settings).items():
            getattr(source, f"Set{name}")(*(value if isinstance(value, tuple) else (value,)))
        sweep = bigus.update(source).GetOutput()
        frames = np.asarray(bigus.frames(sweep)) / 255
        corners = frames.max(0)[[0, 0, -1, -1], [0, -1, 0, -1]]
        self.assertTrue((corners > 0).all(), "all is lit that lies within what some frame shows brighter than 0")
        evidence = Evidence(frames)
        at = {0: bigus.poses(sweep)}

        def judge(now, to):
            for strength in (now, to):
                if strength not in at:
                    at[strength] = bigus.poses(correction(sweep, float(strength)).sweep)
            return evidence.step(at[now], at[to])

        found = correction(sweep)
        strength, steps = chosen(judge)
        self.assertEqual(found.strength, strength)
        self.assertEqual([(step["from"], step["to"], step["taken"]) for step in found.steps], steps)
        for step in found.steps:
            said = [step[key] for key in ("share", "share_error", "gain")]
            # Pictures are float in the program, and a sum has thousands of terms.
            np.testing.assert_allclose(said, judge(step["from"], step["to"]), rtol=0, atol=2e-3)
        return strength

    def test_white_noise_asks_for_what_it_is(self):
        self.assertIn(self.check(NumberOfFrames=32, TrackingNoise=0.2, TrackingRotationNoise=0.3, Seed=2), (1, 2, 4))

    def test_correlated_noise_asks_for_more(self):
        strength = self.check(NumberOfFrames=40, TrackingNoise=0.2, TrackingRotationNoise=0.3, NoiseCorrelation=10, Seed=1)
        self.assertGreaterEqual(strength, 4)

    def test_nothing_is_asked_where_a_strength_is_given(self):
        source = bigus.vtkBigusPhantomSource()
        source.SetNumberOfFrames(16)
        source.SetFrameSize(32, 32)
        source.SetTrackingNoise(0.2)
        given = bigus.correct_poses(bigus.update(source).GetOutput(), Strength=2.0)
        self.assertEqual(given.steps, [])


if __name__ == "__main__":
    unittest.main(argv=sys.argv)
