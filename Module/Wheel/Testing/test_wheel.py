# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The package without VTK: numpy in, numpy out. Needs numpy alone.

BIGUS_PROGRAM names the command `bigus` and BIGUS_VTK_PYTHON a Python with VTK: then both give the same bits.
"""

import copy
import gc
import inspect
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import types
import unittest
import unittest.mock

import bigus
import numpy as np

QUICK = dict(Automatic=False, Iterations=40, Gaussians=1500, HoldOut=4)
GAMMA = 0.7


def pose(pixel=0.25, z=0.0):
    matrix = np.diag([pixel, pixel, 1.0, 1.0])
    matrix[2, 3] = z
    return matrix


def phantom_sweep(frames=24, size=64, **options):
    return bigus.Phantom(frames=frames, width=size, height=size, pixel_size=0.4, **options).sweep()


def two_blobs():
    return bigus.field([(2, 3, 0.2), (5, 4, -0.3)], [(0.5, 0.8, 1.1), (0.7, 0.6, 0.9)], [1.5, 0.8], gamma=GAMMA)


def expected_image(field, matrix, width, height):
    """The model at a thin plane, without any of the project's code; Gaussians are not turned."""
    i, j = np.meshgrid(np.arange(width), np.arange(height))
    points = (np.stack([i, j, 0 * i, 0 * i + 1], -1) @ matrix.T)[..., :3]
    scattering = sum(
        r * np.exp(-0.5 * (((points - mean) / scale) ** 2).sum(-1))
        for mean, scale, r in zip(field.centers, field.scales, field.reflectivities)
    )
    return 1 - np.exp(-field.gamma * np.maximum(scattering, 0))


class Sweeps(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(1)
        self.pixels = rng.integers(0, 255, (5, 20, 30), dtype=np.uint8)
        self.poses = np.array([pose(z=0.5 * k) for k in range(5)])

    def test_shares_the_arrays_memory(self):
        for pixels in (self.pixels, (self.pixels / 255).astype(np.float32)):
            sweep = bigus.sweep(pixels, self.poses)
            self.assertTrue(np.shares_memory(bigus.frames(sweep), pixels))
            self.assertEqual(bigus.frames(sweep).dtype, pixels.dtype)
            np.testing.assert_array_equal(bigus.frames(sweep), pixels)
            np.testing.assert_array_equal(bigus.poses(sweep), self.poses)
            self.assertEqual((len(sweep), sweep.width, sweep.height, sweep.mask, sweep.timestamps), (5, 30, 20, None, None))

    def test_views_live_longer_than_the_sweep_and_the_array(self):
        expected = self.pixels.copy()
        sweep = bigus.sweep(self.pixels, self.poses)
        view, poses = bigus.frames(sweep), bigus.poses(sweep)
        del sweep, self.pixels
        gc.collect()
        np.testing.assert_array_equal(view, expected)
        np.testing.assert_array_equal(poses, self.poses)
        with self.assertRaises(ValueError):
            view[0, 0, 0] = 1

    def test_other_pixels_and_spacing(self):
        sixteen = bigus.sweep(self.pixels.astype(np.uint16) * 257, self.poses)
        np.testing.assert_allclose(bigus.frames(sixteen), self.pixels / 255, atol=1e-6)
        rigid = np.array([pose(1.0, 0.5 * k) for k in range(5)])
        spaced = bigus.sweep(self.pixels, rigid, spacing=(0.25, 0.25), mask=np.ones((20, 30)), timestamps=range(5))
        np.testing.assert_array_equal(bigus.poses(spaced), self.poses)
        np.testing.assert_array_equal(spaced.timestamps, range(5))
        self.assertEqual(spaced.mask.sum(), 600)

    def test_mistakes_are_named(self):
        with self.assertRaisesRegex(ValueError, r"shape \(5, 4, 4\), not \(4, 4, 4\)"):
            bigus.sweep(self.pixels, self.poses[:4])
        with self.assertRaisesRegex(ValueError, "frames, height, width"):
            bigus.sweep(self.pixels[0], self.poses)
        with self.assertRaisesRegex(TypeError, "int32"):
            bigus.sweep(self.pixels.astype(np.int32), self.poses)
        with self.assertRaisesRegex(ValueError, "spacing"):
            bigus.sweep(self.pixels, self.poses, spacing=(0.2, 0))
        self.poses[3, 0, 0] = np.nan
        with self.assertRaisesRegex(bigus.Error, "3"):
            bigus.sweep(self.pixels, self.poses)
        self.assertTrue(issubclass(bigus.Error, RuntimeError))

    def test_pickles(self):
        sweep = bigus.sweep(self.pixels, self.poses, timestamps=np.arange(5.0))
        again = pickle.loads(pickle.dumps(sweep))
        np.testing.assert_array_equal(again.frames, sweep.frames)
        np.testing.assert_array_equal(again.poses, sweep.poses)
        np.testing.assert_array_equal(again.timestamps, sweep.timestamps)

    def test_check_tells_what_is_wrong(self):
        sweep = phantom_sweep()
        self.assertEqual(bigus.check(sweep), [])
        frames = np.array(sweep.frames)
        frames[4] = 0
        sweep = bigus.sweep(frames, sweep.poses)
        (found,) = bigus.check(sweep)
        self.assertEqual((found["kind"], found["frames"], found["applied"]), ("contact", 1, True))
        self.assertIn("1 frame (4)", found["text"])
        self.assertFalse(bigus.check(sweep, keep="contact")[0]["applied"])
        with self.assertRaisesRegex(bigus.Error, "'dust'"):
            bigus.check(sweep, keep="dust")

    def test_poses_without_noise(self):
        truth = bigus.Phantom(frames=24, width=64, height=64, pixel_size=0.4).true_poses
        sweep = phantom_sweep(tracking_noise=0.3, tracking_rotation_noise=0.3)
        found = bigus.correct_poses(sweep)
        corners = np.array([(0, 0, 0, 1), (63, 0, 0, 1), (0, 63, 0, 1), (63, 63, 0, 1)], dtype=float)

        def error(poses):
            return np.linalg.norm((poses - truth) @ corners.T, axis=1).mean()

        self.assertLess(error(found.sweep.poses), 0.6 * error(sweep.poses))
        self.assertTrue(np.shares_memory(found.sweep.frames, sweep.frames))
        self.assertEqual(found.outlier.dtype, bool)
        kept = bigus.correct_poses(sweep, Strength=0)
        self.assertEqual(kept.sweep.poses.tobytes(), sweep.poses.tobytes())


class Fields(unittest.TestCase):
    def test_arrays_are_views(self):
        field = two_blobs()
        before = bigus.reslice(field, pose(), (36, 28))
        field.centers[:, 0] += 1.0
        np.testing.assert_allclose(bigus.reslice(field, pose() @ np.array(
            [[1, 0, 0, 4], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), (36, 28)), before, atol=1e-6)
        shapes = [a.shape for a in (field.centers, field.scales, field.rotations, field.reflectivities)]
        self.assertEqual(shapes, [(2, 3), (2, 3), (2, 4), (2,)])
        centers = field.centers
        del field
        gc.collect()
        np.testing.assert_array_equal(centers[:, 0], (3, 6))

    def test_mistakes_are_named(self):
        with self.assertRaisesRegex(ValueError, r"scales must be of shape \(2, 3\)"):
            bigus.field(np.zeros((2, 3)), np.ones((3, 3)), np.ones(2))
        with self.assertRaisesRegex(bigus.Error, r"Scale\[0\]"):
            bigus.field(np.zeros((2, 3)), -np.ones((2, 3)), np.ones(2))
        field = two_blobs()
        field.scales[1, 2] = np.nan
        with self.assertRaisesRegex(bigus.Error, "nan"):
            bigus.reslice(field, pose(), (4, 4))

    def test_copies(self):
        field = two_blobs()
        for again in (copy.copy(field), copy.deepcopy(field), pickle.loads(pickle.dumps(field))):
            np.testing.assert_array_equal(again.centers, field.centers)
            self.assertEqual((again.gamma, len(again)), (GAMMA, 2))
            self.assertFalse(np.shares_memory(again.centers, field.centers))

    def test_moves_with_its_slices(self):
        turn = np.array([[0, -1, 0, 3.0], [1, 0, 0, -2], [0, 0, 1, 5], [0, 0, 0, 1]])
        field = two_blobs()
        np.testing.assert_allclose(bigus.reslice(field.transformed(turn), turn @ pose(), (36, 28)),
                                   bigus.reslice(field, pose(), (36, 28)), atol=1e-5)
        with self.assertRaises(bigus.Error):
            field.transformed(np.diag([1, 2, 1, 1.0]))


class Slices(unittest.TestCase):
    def test_equal_the_model(self):
        tilted = pose()
        tilted[:3, 0] = 0.25 * np.array([np.cos(0.4), 0, np.sin(0.4)])
        tilted[:3, 1] = (0, 0.3, 0)
        for matrix in (pose(), tilted):
            image = bigus.reslice(two_blobs(), matrix, (36, 28), Tolerance=1e-6)
            self.assertEqual((image.shape, image.dtype), ((28, 36), np.float32))
            np.testing.assert_allclose(image, expected_image(two_blobs(), matrix, 36, 28), atol=2e-5)

    def test_many_planes_scattering_and_coverage(self):
        field = two_blobs()
        field.reflectivities[1] = -0.8
        slicer = bigus.Slicer(field, Tolerance=1e-6)
        planes = np.array([pose(z=z) for z in (-0.4, 0.0, 0.7)])
        images = slicer.slice(planes, (36, 28))
        self.assertEqual(images.shape, (3, 28, 36))
        for image, matrix in zip(images, planes):
            np.testing.assert_array_equal(image, slicer.slice(matrix, (36, 28)))
        signed, coverage = slicer.slice_and_coverage(pose(), (36, 28), scattering=True)
        self.assertLess(signed.min(), 0)
        np.testing.assert_allclose(1 - np.exp(-GAMMA * np.maximum(signed, 0)), images[1], atol=1e-5)
        self.assertGreater(coverage[16, 20], 0.5)
        self.assertLess(coverage[0, 0], 0.01)
        self.assertLess(bigus.reslice(field, pose(), (36, 28), ElevationSigma=2.0).max(), images[1].max())

    def test_planes_of_axes_and_spacing(self):
        matrix = bigus.plane((1, 2, 3), [(2, 0, 0), (0, 0, 5)], (0.25, 0.5))
        np.testing.assert_allclose(matrix @ (4, 2, 0, 1), (2, 2, 4, 1))
        field = two_blobs()
        np.testing.assert_array_equal(bigus.reslice(field, pose(7), (36, 28), spacing=(0.25, 0.5)),
                                      bigus.reslice(field, pose() @ np.diag([1, 2, 1, 1.0]), (36, 28)))
        self.assertEqual(bigus.reslice(field, pose()).shape, (17, 21))  # the farthest center is at (5, 4) mm

    def test_mistakes_are_named(self):
        for wrong, text in ((np.eye(3), "4 x 4"), (np.zeros((4, 4)), "span a plane"), (pose() * np.nan, "span a plane")):
            with self.assertRaisesRegex(ValueError, text):
                bigus.reslice(two_blobs(), wrong, (4, 4))
        with self.assertRaisesRegex(ValueError, "size"):
            bigus.reslice(two_blobs(), pose(), (0, 4))
        with self.assertRaisesRegex(ValueError, "spacing must be positive"):
            bigus.reslice(two_blobs(), pose(), (4, 4), spacing=-1)
        with self.assertRaisesRegex(TypeError, r"field \(bigus.Field\), not Sweep"):
            bigus.reslice(phantom_sweep(2, 16), pose(), (4, 4))
        with self.assertRaisesRegex(bigus.Error, "cpu"):
            bigus.Slicer(two_blobs(), Engine="abacus")

    def test_mistakes_in_arguments_are_named(self):
        field, sweep = two_blobs(), phantom_sweep(3, 16)
        for action, error, text in (
            (lambda: bigus.reslice(field, pose(), size=(24, 64, 80)), ValueError, r"size is \(width, height\).*not \(24, 64, 80\)"),
            (lambda: bigus.reslice(field, pose(), size=(80.5, 64)), ValueError, r"two whole numbers.*80.5"),
            (lambda: bigus.distance_to_frames(sweep, pose(), (8, 8.5)), ValueError, "two whole numbers"),
            (lambda: bigus.reslice(field, "z", (4, 4)), ValueError, "4 x 4 matrix of numbers, not str"),
            (lambda: bigus.reslice(field, pose(), (4, 4), spacing=(1, 1, 1)), ValueError, "one number or two"),
            (lambda: bigus.plane((0, 0), [(1, 0, 0), (0, 1, 0)]), ValueError, r"origin is three numbers, mm, not \(0, 0\)"),
            (lambda: bigus.reslice(field, pose(), (4, 4), engin="cpu"), TypeError, "no property engin; did you mean engine"),
            (lambda: bigus.reslice(field, pose(), (4, 4), Engine="cpu", engine="cpu"), TypeError, "the same property of slicing"),
            (lambda: bigus.reslice(field, pose(), (4, 4), tolerance="little"), TypeError, "Tolerance = 'little'"),
            (lambda: bigus.read(b"sweep.mha"), TypeError, "text or a pathlib.Path, not bytes"),
            (lambda: bigus.read_sweep("s.mha", auto_mask="yes"), TypeError, "AutoMask = 'yes': True or False"),
            (lambda: bigus.correct_poses(sweep, HoldOut=4, hold_out=8), TypeError, "HoldOut and hold_out are the same"),
            (lambda: bigus.train(sweep, hold_out=4, HoldOut=8), TypeError, "hold_out and HoldOut are the same option of training"),
            (lambda: bigus.Phantom(frames=3, NumberOfFrames=4), TypeError, "frames and NumberOfFrames are the same"),
            (lambda: bigus.Phantom(frames="many"), TypeError, "frames = 'many'"),
        ):
            with self.subTest(text), self.assertRaisesRegex(error, text):
                action()

    def test_either_spelling_is_the_same(self):
        field = two_blobs()
        thick = bigus.reslice(field, pose(), (36, 28), elevation_sigma=2.0, engine="cpu")
        np.testing.assert_array_equal(thick, bigus.reslice(field, pose(), (36.0, 28), ElevationSigma=2.0))
        self.assertGreater(np.abs(thick - bigus.reslice(field, pose(), (36, 28))).max(), 0.01)
        made = [bigus.Phantom(**spelt).sweep() for spelt in (
            {"frames": 3, "width": 32, "height": 24, "tracking_noise": 1},
            {"NumberOfFrames": 3, "FrameSize": (32, 24), "TrackingNoise": 1})]
        np.testing.assert_array_equal(made[0].frames, made[1].frames)
        np.testing.assert_array_equal(made[0].poses, made[1].poses)

    def test_beside_everything_is_nothing(self):
        for engine in ("cpu", "cpu-double", "reference"):
            image = bigus.reslice(two_blobs(), pose(z=1000), (9, 9), engine=engine)
            self.assertEqual((np.abs(image).max(), np.signbit(image).sum()), (0, 0), engine)

    def test_labels_drawn_on_frames_are_shown_at_any_plane_and_kept_in_files(self):
        sweep = bigus.sweep(np.full((6, 40, 40), 90, np.uint8), np.array([pose(z=0.5 * k) for k in range(6)]))
        rng = np.random.default_rng(3)
        centers = rng.uniform((0, 0, -1), (10, 10, 4), (2000, 3))
        field = bigus.field(centers, np.full((2000, 3), 0.4), np.ones(2000), gamma=GAMMA)
        pictures = np.zeros((3, 40, 40), int)
        pictures[:, :, :20] = 7
        labelled = bigus.label(field, sweep, pictures, {7: "left"}, frames=[0, 2, 4])
        self.assertEqual((labelled.labels, field.labels), ({7: "left"}, {}))
        across = np.array([[0, 0, -1, 1], [0, 0.25, 0, 1], [0.25, 0, 0, 1], [0, 0, 0, 1.0]])  # at x = 1, columns along z
        self.assertTrue((bigus.label_map(labelled, across, (8, 20))[4:, 1:6] == 7).all())
        shown = bigus.label_map(labelled, pose(z=1.5), (40, 40))
        again = pickle.loads(pickle.dumps(labelled))
        np.testing.assert_array_equal(bigus.label_map(again, pose(z=1.5), (40, 40)), shown)
        self.assertGreater((shown == pictures[0]).mean(), 0.97)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "l.vtp")
            bigus.write(labelled, path)
            again = bigus.read_field(path)
            self.assertEqual(again.labels, {7: "left"})
            np.testing.assert_array_equal(bigus.label_map(again, pose(z=1.5), (40, 40)), shown)
        with self.assertRaisesRegex(bigus.Error, "no labels"):
            bigus.label_map(field, pose(), (40, 40))
        with self.assertRaisesRegex(ValueError, "label pictures"):
            bigus.label(field, sweep, pictures[:, :, 1:], frames=[0, 2, 4])
        with self.assertRaisesRegex(bigus.Error, "frame 9"):
            bigus.label(field, sweep, pictures, frames=[0, 2, 9])

    def test_distance_to_frames(self):
        sweep = bigus.sweep(np.zeros((2, 8, 8), np.uint8), np.array([pose(1.0, 0), pose(1.0, 3.0)]))
        np.testing.assert_allclose(bigus.distance_to_frames(sweep, pose(1.0, 1.0), (8, 8)), 1, atol=1e-6)
        np.testing.assert_allclose(bigus.distance_to_frames(sweep, pose(1.0, 1.0), (8, 8), frames=[1]), 2, atol=1e-6)

    def test_metrics(self):
        rng = np.random.default_rng(2)
        truth = rng.random((40, 50)).astype(np.float32)
        image = np.clip(truth + 0.05, 0, 1).astype(np.float32)
        scores = bigus.metrics(image, truth)
        error = np.mean((image.astype(float) - truth) ** 2)
        self.assertAlmostEqual(scores["psnr"], 10 * np.log10(1 / error), places=4)
        self.assertEqual(set(scores), {"psnr", "ssim", "bfs", "mean_contrast", "contrast_distribution", "rayleigh"})
        with self.assertRaisesRegex(ValueError, "different shapes"):
            bigus.metrics(image, truth[:-1])


class Training(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.sweep = phantom_sweep()
        cls.training = bigus.train(cls.sweep, progress=False, **QUICK)

    def test_predicts_frames_it_has_not_seen(self):
        self.assertEqual(self.training.held_out_frames, [2, 6, 10, 14, 18, 22])
        slicer = bigus.Slicer(self.training.field)
        held_out = self.training.held_out_frames
        images = slicer.slice(self.training.poses[held_out], (64, 64))
        mean = np.broadcast_to(self.sweep.frames.mean() / 255, images.shape)
        truth = self.sweep.frames[held_out]
        self.assertGreater(bigus.metrics(images, truth)["psnr"], bigus.metrics(mean, truth)["psnr"] + 2)

    def test_tells_how_far_slices_may_be_off(self):
        field, held_out = self.training.field, self.training.held_out_frames
        shares = []
        for frame in held_out[1:-1]:
            place = self.training.poses[frame]
            image, sigma = (f(field, place, (64, 64)) for f in (bigus.reslice, bigus.standard_error))
            errors = np.abs(image - self.sweep.frames[frame] / 255)[np.isfinite(sigma)]
            shares.append(np.mean(errors <= 2 * sigma[np.isfinite(sigma)]))
        self.assertTrue(0.85 < np.mean(shares) < 0.995, shares)
        known = np.isfinite(sigma)
        mean, error = bigus.mean(field, place, (64, 64))
        self.assertAlmostEqual(mean, image[known].mean(), 6)
        largest = np.sqrt(np.square(sigma[known]).mean())  # were all errors alike
        self.assertTrue(largest / np.sqrt(known.sum()) < error < largest, "neighbours are alike, but not all")
        left = known & (np.arange(64) < 20)
        self.assertAlmostEqual(bigus.mean(field, place, (64, 64), where=np.arange(64) < 20 + 0 * sigma)[0], image[left].mean(), 6)
        for where, said in ((known & False, "no pixel"), (np.ones((3, 3)), r"shape \(3, 3\); the image has \(64, 64\)")):
            with self.assertRaisesRegex(ValueError, said):
                bigus.mean(field, place, (64, 64), where=where)
        beyond = np.array(self.training.poses[-1])
        beyond[:3, 3] += 5 * np.cross(beyond[:3, 0], beyond[:3, 1]) / np.linalg.norm(beyond[:3, 0]) ** 2
        self.assertTrue(np.isnan(bigus.standard_error(field, beyond, (64, 64))).all())
        self.assertEqual(pickle.loads(pickle.dumps(field)).kept_error, field.kept_error)
        without = bigus.train(self.sweep, progress=False, keep_standard_error=False, **QUICK).field
        self.assertEqual(without.kept_error, b"")
        with self.assertRaisesRegex(bigus.Error, "keeps nothing"):
            bigus.mean(without, beyond, (64, 64))
        without.kept_error = field.kept_error[:-3]
        with self.assertRaisesRegex(bigus.Error, "damaged"):
            bigus.standard_error(without, beyond, (64, 64))

    def test_tells_how_it_went(self):
        field, log = self.training
        self.assertGreater(len(field), 500)
        self.assertEqual(log["iteration"][-1], 40)
        self.assertLess(log["loss"][-1], log["loss"][0])
        self.assertIn("CPU", self.training.device)
        self.assertEqual(self.training.options["HoldOut"], "4")
        self.assertFalse(self.training.aborted)

    def test_same_seed_same_bits_however_options_are_spelt(self):
        again = bigus.train(self.sweep, progress=False, automatic=False, iterations=40, gaussians=1500, hold_out=4)
        self.assertEqual(again.field.centers.tobytes(), self.training.field.centers.tobytes())
        other = bigus.train(self.sweep, progress=False, seed=2, **QUICK)
        self.assertNotEqual(other.field.centers.tobytes(), self.training.field.centers.tobytes())

    def test_is_shown_in_a_line(self):
        self.assertRegex(repr(self.training), r"^<bigus.Training of \d+ Gaussians, finished after 40 iterations, 6 frames held out>$")
        self.assertRegex(repr(bigus.Slicer(self.training.field)), r"^<bigus.Slicer of \d+ Gaussians, CPU \(.*\)>$")

    def test_takes_every_option(self):
        defaults = {option["keyword"]: option["default"] for option in bigus.options()}
        self.assertGreater(len(defaults), 30)
        self.assertTrue(all(option["help"] in bigus.train.__doc__ for option in bigus.options()))
        plain = {**defaults, **dict(automatic=False, iterations=40, gaussians=1500, hold_out=4)}
        again = bigus.train(self.sweep, progress=False, **plain)
        self.assertEqual(again.field.centers.tobytes(), self.training.field.centers.tobytes())

    def test_mistakes_are_named(self):
        with self.assertRaisesRegex(TypeError, "no option Gausians; did you mean Gaussians"):
            bigus.train(self.sweep, Gausians=5)
        with self.assertRaisesRegex(bigus.Error, "(?i)batch"):
            bigus.train(self.sweep, Batch=0)
        with self.assertRaisesRegex(TypeError, "number"):
            bigus.train(self.sweep, Batch=[1])
        with self.assertRaisesRegex(TypeError, r"sweep \(bigus.Sweep\), not ndarray"):
            bigus.train(self.sweep.frames)
        with self.assertRaises(bigus.Error):
            bigus.train(bigus.sweep(np.zeros((9, 32, 32), np.uint8), np.array([pose(z=k) for k in range(9)])))

    def test_goes_on_from_a_field(self):
        field = self.training.field
        kept = field.centers.copy()
        further = bigus.train(self.sweep, False, start=field, Automatic=False, Iterations=5)
        # The same Gaussians, but for those that have become too faint to be seen.
        self.assertLessEqual(len(further.field), len(field))
        self.assertGreater(len(further.field), 0.99 * len(field))
        np.testing.assert_array_equal(field.centers, kept)

    def test_progress_stops_and_its_errors_are_raised(self):
        seen = []

        def stop(fraction, text):
            seen.append((fraction, text))
            return "iteration" not in text

        stopped = bigus.train(self.sweep, stop, Automatic=False, Iterations=100000, Gaussians=500)
        self.assertTrue(stopped.aborted)
        self.assertGreater(len(stopped.field), 0)
        self.assertTrue(all(0 <= fraction <= 1 for fraction, _ in seen))

        def fail(fraction, text):
            raise LookupError("mine")

        with self.assertRaisesRegex(LookupError, "mine"):
            bigus.train(self.sweep, fail, **QUICK)

    def test_other_threads_run_meanwhile(self):
        counted = 0
        over = threading.Event()

        def count():
            nonlocal counted
            while not over.is_set():
                counted += 1
                time.sleep(0.001)

        thread = threading.Thread(target=count)
        thread.start()
        started = time.monotonic()
        bigus.train(self.sweep, False, Automatic=False, Iterations=400, Gaussians=3000)
        seconds = time.monotonic() - started
        over.set()
        thread.join()
        self.assertGreater(counted, 20 * seconds)

    def test_ctrl_c_keeps_the_best_so_far(self):
        # What a shell starts in the background has it ignored.
        self.addCleanup(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, signal.default_int_handler))
        timer = threading.Timer(0.7, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        started = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "checkpoint")
            with self.assertRaises(bigus.TrainingInterrupted) as caught:
                bigus.train(self.sweep, False, Iterations=1000000, checkpoint=path)
            self.assertGreater(os.path.getsize(path), 0)
        self.assertIsInstance(caught.exception, KeyboardInterrupt)
        self.assertLess(time.monotonic() - started, 10)
        self.assertGreater(len(caught.exception.training.field), 0)
        self.assertFalse(caught.exception.training.finished)

    def test_a_notebook_shows_a_bar_unless_told_not_to(self):
        values = []

        class Bar:
            n = 0

            def __init__(self, **settings):
                self.total = settings["total"]

            def set_postfix_str(self, text, refresh):
                self.text = text

            def update(self, more):
                self.n += more
                values.append(self.n / self.total)

            def close(self):
                values.append("closed")

        notebook = {"ipykernel": types.ModuleType("ipykernel"), "tqdm": types.ModuleType("tqdm"),
                    "tqdm.auto": types.ModuleType("tqdm.auto")}
        notebook["tqdm.auto"].tqdm = Bar
        with unittest.mock.patch.dict(sys.modules, notebook):
            bigus.train(self.sweep, **QUICK)
            self.assertEqual(values[-2:], [1, "closed"])
            self.assertEqual(values[:-1], sorted(values[:-1]))
            values.clear()
            bigus.train(self.sweep, progress=False, **QUICK)
            self.assertEqual(values, [])
        bigus.train(self.sweep, progress=True, **QUICK)  # where nobody watches there is none

    def test_a_stopped_training_goes_on_with_the_same_bits(self):
        settings = {"Automatic": False, "Gaussians": 300, "Iterations": 600}
        whole = bigus.train(self.sweep, False, **settings)
        self.assertTrue(whole.finished)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "checkpoint")
            stopped = bigus.train(self.sweep, lambda fraction, text: fraction < 0.4, checkpoint=path, **settings)
            self.assertTrue(0 < stopped.iterations < 600)
            self.assertFalse(stopped.finished)
            with self.assertRaisesRegex(bigus.Error, "seed was 1 and is 5"):
                bigus.train(self.sweep, False, checkpoint=path, resume=True, Seed=5, **settings)
            resumed = bigus.train(self.sweep, False, checkpoint=path, resume=True, **settings)
            self.assertTrue(resumed.finished)
            self.assertEqual(resumed.iterations, 600)
            for name in ("centers", "scales", "rotations", "reflectivities"):
                np.testing.assert_array_equal(getattr(resumed.field, name), getattr(whole.field, name))
            self.assertEqual(os.listdir(folder), [], "a finished training needs no checkpoint")
            again = bigus.train(self.sweep, False, checkpoint=path, resume=True, **settings)
            np.testing.assert_array_equal(again.field.centers, whole.field.centers)

    def test_checkpoints_of_no_use_are_named(self):
        with self.assertRaisesRegex(ValueError, "checkpoint=..."):
            bigus.train(self.sweep, False, resume=True, **QUICK)
        with self.assertRaisesRegex(ValueError, "checkpoint_interval"):
            bigus.train(self.sweep, False, checkpoint="f", checkpoint_interval=-1, **QUICK)
        with tempfile.TemporaryDirectory() as folder:
            missing = os.path.join(folder, "missing", "checkpoint")
            with self.assertWarnsRegex(RuntimeWarning, "missing.*without a new checkpoint"):
                stopped = bigus.train(self.sweep, lambda fraction, text: fraction < 0.1, checkpoint=missing, **QUICK)
            self.assertGreater(len(stopped.field), 0)
            empty = os.path.join(folder, "empty")
            open(empty, "w").close()
            with self.assertRaisesRegex(bigus.Error, "empty"):
                bigus.train(self.sweep, False, checkpoint=empty, resume=True, **QUICK)


class Phantoms(unittest.TestCase):
    def test_truth_at_the_sweeps_planes_is_the_sweep(self):
        phantom = bigus.Phantom(frames=4, width=48, height=40, pixel_size=0.4, probe="convex", tracking_noise=1)
        sweep = phantom.sweep()
        np.testing.assert_array_equal(phantom.frame(phantom.true_poses[2], 48, 40), sweep.frames[2])
        self.assertGreater(np.abs(phantom.true_poses - sweep.poses).max(), 0.1)
        self.assertEqual(sweep.mask.shape, (40, 48))

    def test_mistakes_are_named(self):
        with self.assertRaisesRegex(TypeError, "no option framse; did you mean frames"):
            bigus.Phantom(framse=3)
        with self.assertRaisesRegex(ValueError, "organ, speckle, points"):
            bigus.Phantom(scene="liver")
        with self.assertRaises(bigus.Error):
            bigus.Phantom(frames=0)


class Package(unittest.TestCase):
    def test_shows_what_a_user_needs_and_nothing_else(self):
        shown = set(dir(bigus))
        self.assertLess({"train", "read_sweep", "pyvista", "serve", "convert", "vtkBigusReslice", "update"}, shown)
        self.assertEqual([name for name in shown if name[0] == "_" and name != "__version__"], [])
        self.assertEqual(shown & {"Any", "importlib", "arrays", "files", "sources", "tasks", "TYPE_CHECKING"}, set())
        with self.assertRaisesRegex(AttributeError, "did you mean train"):
            bigus.trian

    def test_signatures_tell_the_options(self):
        found = inspect.signature(bigus.train).parameters
        for option in bigus.options():
            self.assertIn(option["keyword"], found)
        self.assertEqual((found["hold_out"].default, found["gaussians"].default, found["automatic"].default), (0, None, True))
        self.assertEqual(inspect.signature(bigus.Phantom).parameters["pixel_size"].default, 0.2)
        self.assertEqual(inspect.signature(bigus.Slicer).parameters["tolerance"].default, 1e-4)
        for name in inspect.signature(bigus.Phantom).parameters:
            self.assertIn(f" {name}: ", bigus.Phantom.__doc__.replace("frame_size: ", "width: height: ").replace("number_of_", ""))

    def test_needs_no_vtk(self):
        script = "import sys, bigus; sys.exit(any(name.startswith('vtk') for name in sys.modules))"
        self.assertEqual(subprocess.run([sys.executable, "-c", script]).returncode, 0)

    def test_filters_say_what_to_install(self):
        for missing, name, package in (("vtkmodules", "vtkBigusReslice", "vtk"), ("pyvista", "pyvista", "pyvista")):
            script = f"import sys; sys.modules['{missing}'] = None; import bigus; bigus.{name}"
            result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
            self.assertRegex(result.stderr.splitlines()[-1], f"AttributeError: .*pip install {package}")
        self.assertIn("vtkBigusReslice", dir(bigus))
        self.assertFalse(hasattr(bigus, "vtkNothing"))

    def test_every_name_says_what_it_is(self):
        for name in bigus.__all__:
            value = getattr(bigus, name)
            if callable(value):
                self.assertTrue(value.__doc__, name)

    def test_tells_what_computes(self):
        self.assertIn("cpu", bigus.engines())
        self.assertTrue(bigus.instruction_sets())

    def test_reads_files_of_your_own(self):
        with tempfile.TemporaryDirectory() as folder:
            images, poses = os.path.join(folder, "images.npy"), os.path.join(folder, "poses.npy")
            sweep = phantom_sweep(6, 32)
            np.save(images, sweep.frames)
            np.save(poses, sweep.poses)
            again = bigus.from_files(images, poses)
            np.testing.assert_array_equal(again.frames, sweep.frames)
            np.testing.assert_allclose(again.poses, sweep.poses)


def read_mha(path):
    """Pixels and poses of a sequence as the program writes it: by nobody's reader but this one."""
    import zlib

    with open(path, "rb") as file:
        data = file.read()
    end = data.index(b"\n", data.index(b"ElementDataFile")) + 1
    header = dict(line.split(" = ", 1) for line in data[:end].decode().splitlines() if " = " in line)
    width, height, count = (int(n) for n in header["DimSize"].split())
    pixels = zlib.decompress(data[end:]) if header.get("CompressedData") == "True" else data[end:]
    poses = [header[f"Seq_Frame{k:04d}_ImageToReferenceTransform"] for k in range(count)]
    times = [float(header[f"Seq_Frame{k:04d}_Timestamp"]) for k in range(count)]
    frames = np.frombuffer(pixels, np.uint8).reshape(count, height, width)
    return frames, np.array([text.split() for text in poses], float).reshape(-1, 4, 4), times


@unittest.skipUnless(os.environ.get("BIGUS_PROGRAM"), "BIGUS_PROGRAM does not name the command")
class SameBits(unittest.TestCase):
    def test_as_the_program(self):
        program, python = os.environ["BIGUS_PROGRAM"], os.environ["BIGUS_VTK_PYTHON"]
        with tempfile.TemporaryDirectory() as folder:
            def run(*arguments):
                subprocess.run(arguments, check=True, cwd=folder, capture_output=True)

            run(program, "phantom", "-o", "s.igs.mha", "--frames", "24", "--width", "64", "--height", "64",
                "--pixel-size", "0.4")
            frames, poses, times = read_mha(os.path.join(folder, "s.igs.mha"))
            np.testing.assert_array_equal(frames, phantom_sweep().frames)
            sweep = bigus.sweep(frames, poses, times)
            for exact in (True, False):
                run(program, "train", "s.igs.mha", "-o", "f.vtp", "--no-auto", "--iterations", "40",
                    "--gaussians", "1500", "--hold-out", "4", *(["--exact"] if exact else []))
                run(python, "-c", "import numpy as np, vtk\nfrom vtk.util.numpy_support import vtk_to_numpy as a\n"
                    "r = vtk.vtkXMLPolyDataReader(); r.SetFileName('f.vtp'); r.Update(); d = r.GetOutput()\n"
                    "p = d.GetPointData()\nnp.savez('f.npz', centers=a(d.GetPoints().GetData()), "
                    "scales=a(p.GetArray('Scale')), rotations=a(p.GetArray('Rotation')), "
                    "reflectivities=a(p.GetArray('Reflectivity')))\n")
                trained = bigus.train(sweep, False, **QUICK)
                field = trained.field if exact else trained.field.rounded()
                np.save(os.path.join(folder, "p.npy"), trained.poses[7])
                run(python, "-c", "import sys\nsys.path.insert(0, sys.argv[1])\nimport bigus, numpy as np\n"
                    "f, p = bigus.read_field('f.vtp'), np.load('p.npy')\n"
                    "np.save('e', bigus.standard_error(f, p, (64, 64)))\n"
                    "np.save('m', [bigus.mean(f, p, (64, 64)), bigus.mean(f, p, (64, 64), where=np.tri(64))])",
                    os.environ["BIGUS_VTK_PACKAGE"])
                stored = bigus.read_field(os.path.join(folder, "f.vtp"))
                self.assertEqual(stored.kept_error, field.kept_error)
                np.testing.assert_array_equal(np.load(os.path.join(folder, "e.npy")),
                                              bigus.standard_error(stored, trained.poses[7], (64, 64)))
                means = [bigus.mean(stored, trained.poses[7], (64, 64), where=where) for where in (None, np.tri(64))]
                np.testing.assert_array_equal(np.load(os.path.join(folder, "m.npy")), means)
                with np.load(os.path.join(folder, "f.npz")) as written:
                    for name in written.files:
                        np.testing.assert_array_equal(written[name], getattr(field, name).astype(written[name].dtype))


if __name__ == "__main__":
    unittest.main(verbosity=2)
