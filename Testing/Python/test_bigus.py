# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The Python package as its users see it: numpy in, numpy out, errors as exceptions, nothing printed."""

import ast
import copy
import gzip
import importlib.util
import math
import os
import pathlib
import pickle
import re
import signal
import struct
import subprocess
import sys
import tempfile
import textwrap
import threading
import time
import types
import unittest
import unittest.mock

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkAlgorithm
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkImageCast, vtkImageReslice

import bigus

GAMMA = 0.7


def make_field(means, scales, reflectivities, elevation_sigma=0.0):
    """A field of axis-parallel Gaussians, made by hand."""
    count = len(means)
    field = vtkPolyData()
    points = vtkPoints()
    points.SetDataTypeToDouble()
    for mean in means:
        points.InsertNextPoint(*mean)
    field.SetPoints(points)

    def add(attributes, name, values, dtype=np.float64):
        array = numpy_to_vtk(np.ascontiguousarray(values, dtype=dtype), deep=True)
        array.SetName(name)
        attributes.AddArray(array)

    add(field.GetPointData(), "Scale", scales)
    add(field.GetPointData(), "Rotation", [(1, 0, 0, 0)] * count)
    add(field.GetPointData(), "Reflectivity", reflectivities)
    field.GetPointData().SetActiveScalars("Reflectivity")
    add(field.GetFieldData(), "Gamma", [GAMMA])
    add(field.GetFieldData(), "ElevationSigma", [elevation_sigma])
    add(field.GetFieldData(), "FormatVersion", [1], np.int32)
    return field


def two_blobs():
    return make_field([(3, 2, 1), (5, 4, 1.5)], [(1, 1, 1), (0.8, 0.8, 0.8)], [1.5, 2.0])


def expected_image(matrix, width, height):
    """What an infinitely thin slice of two_blobs shows, by the model's formula."""
    j, i = np.mgrid[:height, :width]
    pixels = np.stack([i, j, np.zeros_like(i), np.ones_like(i)], axis=-1)
    x = (pixels @ np.asarray(matrix, dtype=float).T)[..., :3]
    s = 1.5 * np.exp(-0.5 * ((x - (3, 2, 1)) ** 2).sum(-1))
    s += 2.0 * np.exp(-0.5 * ((x - (5, 4, 1.5)) ** 2).sum(-1) / 0.64)
    return 1 - np.exp(-GAMMA * s)


def pose(z=1.0, pixel=0.25):
    return np.array([[pixel, 0, 0, 0], [0, pixel, 0, 0], [0, 0, 1, z], [0, 0, 0, 1.0]])


def small_sweep(count=9, width=36, height=28):
    poses = np.array([pose(z) for z in np.linspace(0, 2.4, count)])
    images = np.array([expected_image(p, width, height) for p in poses])
    return bigus.sweep(np.round(images * 255).astype(np.uint8), poses, timestamps=np.arange(count) / 25)


class Arrays(unittest.TestCase):
    def test_frames_and_poses_are_views_of_the_sweep(self):
        sweep = small_sweep()
        self.assertEqual(bigus.frames(sweep).shape, (9, 28, 36))
        self.assertEqual(bigus.frames(sweep).dtype, np.uint8)
        self.assertEqual(bigus.poses(sweep).shape, (9, 4, 4))
        bigus.frames(sweep)[2, 5, 7] = 123
        self.assertEqual(sweep.GetScalarComponentAsDouble(7, 5, 2, 0), 123)
        bigus.poses(sweep)[3, 0, 1] = 0.5
        self.assertEqual(sweep.GetFieldData().GetArray("ImageToReference").GetComponent(3, 1), 0.5)

    def test_sweep_shares_the_memory_it_is_given(self):
        pixels = np.zeros((2, 3, 4), np.uint8)
        sweep = bigus.sweep(pixels, [np.eye(4)] * 2)
        pixels[1, 2, 3] = 9
        self.assertTrue(np.shares_memory(pixels, bigus.frames(sweep)))
        self.assertEqual(sweep.GetScalarComponentAsDouble(3, 2, 1, 0), 9)

    def test_views_outlive_the_sweep(self):
        view = bigus.frames(small_sweep())
        total = int(view.sum())
        _ = [np.zeros(view.size) for _ in range(8)]
        self.assertEqual(int(view.sum()), total)

    def test_wrong_shapes_are_named(self):
        with self.assertRaisesRegex(ValueError, r"poses of shape \(2, 4, 4\), not \(3, 4, 4\)"):
            bigus.sweep(np.zeros((2, 3, 4), np.uint8), [np.eye(4)] * 3)
        with self.assertRaisesRegex(ValueError, "Timestamp has shape"):
            bigus.sweep(np.zeros((2, 3, 4), np.uint8), [np.eye(4)] * 2, timestamps=[0.0])
        with self.assertRaisesRegex(ValueError, "ImageToReference"):
            bigus.poses(bigus.image(np.zeros((3, 4), np.uint8)))
        with self.assertRaisesRegex(ValueError, r"\(4,\)"):
            bigus.image(np.zeros(4))

    def test_a_field_has_no_frames(self):
        for function in (bigus.frames, bigus.poses):
            with self.subTest(function.__name__), self.assertRaisesRegex(TypeError, "takes a sweep"):
                function(two_blobs())

    def test_true_is_white(self):
        lit = np.indices((2, 28, 36)).sum(axis=0) % 3 == 0
        np.testing.assert_array_equal(bigus.frames(bigus.sweep(lit, [pose(0), pose(1)])), 255 * lit.astype(np.uint8))
        self.assertEqual(bigus.metrics(lit[0], lit[0].astype(np.float32))["psnr"], math.inf)


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name

    def test_a_sweep_comes_back_as_written(self):
        sweep = small_sweep()
        path = os.path.join(self.folder, "sweep.igs.mha")
        bigus.write(sweep, path)
        # Off, the reader would add the mask of pixels that no frame lights, and nothing else changes.
        again = bigus.read(path, AutoMask=False)
        np.testing.assert_array_equal(bigus.frames(again), bigus.frames(sweep))
        np.testing.assert_array_equal(bigus.poses(again), bigus.poses(sweep))

    def test_a_field_comes_back_as_written(self):
        field = two_blobs()
        for extension in (".vtp", ".ply"):
            path = os.path.join(self.folder, "field" + extension)
            bigus.write(field, path)
            again = bigus.read(path)
            np.testing.assert_allclose(
                bigus.reslice(again, pose(), (36, 28)), bigus.reslice(field, pose(), (36, 28)), atol=1e-5)

    def test_failures_are_exceptions_that_name_the_file(self):
        with self.assertRaisesRegex(RuntimeError, "no-such-sweep.mha"):
            bigus.read(os.path.join(self.folder, "no-such-sweep.mha"))
        with self.assertRaisesRegex(RuntimeError, "no-such-field.vtp"):
            bigus.read(os.path.join(self.folder, "no-such-field.vtp"))
        with self.assertRaisesRegex(RuntimeError, "no-such-folder"):
            bigus.write(small_sweep(), os.path.join(self.folder, "no-such-folder", "a.igs.mha"))

    def test_an_error_is_raised_and_not_printed(self):
        script = "import bigus\ntry:\n  bigus.read('/no/such/sweep.mha')\nexcept RuntimeError as error:\n  print(error)"
        run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
        self.assertEqual(run.stderr, "")
        self.assertEqual(run.stdout.count("/no/such/sweep.mha"), 1, run.stdout)
        self.assertNotIn("0x", run.stdout)

    def test_properties_are_those_of_the_class_in_either_spelling(self):
        path = os.path.join(self.folder, "sweep.igs.mha")
        bigus.write(small_sweep(), path, to_frame="Tracker")
        for spelt in ({"ToFrame": "Tracker", "AutoMask": False}, {"to_frame": "Tracker", "auto_mask": False}):
            self.assertIsNone(bigus.read_sweep(path, **spelt).GetFieldData().GetArray("Mask"))
        with self.assertRaisesRegex(TypeError, "AutoMask and auto_mask are the same property of vtkBigusSequenceReader"):
            bigus.read(path, AutoMask=False, auto_mask=True)
        with self.assertRaisesRegex(TypeError, "no property auto_maks; did you mean auto_mask"):
            bigus.read("sweep.mha", auto_maks=False)
        with self.assertRaisesRegex(TypeError, "a path is text or a pathlib.Path, not bytes"):
            bigus.read(b"sweep.mha")
        with self.assertRaisesRegex(TypeError, "AutoMask = 'yes'"):
            bigus.read("sweep.mha", AutoMask="yes")


class Reslice(unittest.TestCase):
    def test_equals_the_model(self):
        tilted = pose()
        angle = 0.4
        tilted[:3, 0] = 0.25 * np.array([math.cos(angle), 0, math.sin(angle)])
        tilted[:3, 1] = (0, 0.3, 0)
        for matrix in (pose(), tilted):
            image = bigus.reslice(two_blobs(), matrix, (36, 28), Tolerance=1e-6)
            self.assertEqual((image.shape, image.dtype), ((28, 36), np.float32))
            np.testing.assert_allclose(image, expected_image(matrix, 36, 28), atol=2e-5)

    def test_a_trained_field_tells_how_far_it_may_be_wrong(self):
        few = dict(Automatic=False, Gaussians=300, Iterations=20, Batch=4)
        field = bigus.train(small_sweep(), **few).field
        sigma = bigus.standard_error(field, pose(1.1), (36, 28))
        self.assertEqual((sigma.shape, sigma.dtype), ((28, 36), np.float32))
        self.assertGreater(np.isfinite(sigma).mean(), 0.5)
        self.assertTrue((sigma[np.isfinite(sigma)] > 0).all())
        known = np.isfinite(sigma)
        image = bigus.reslice(field, pose(1.1), (36, 28))
        mean, error = bigus.mean(field, pose(1.1), (36, 28))
        self.assertAlmostEqual(mean, image[known].mean(), 6)
        self.assertLess(error, np.sqrt((sigma[known] ** 2).mean()))
        self.assertGreater(error, np.sqrt((sigma[known] ** 2).mean() / known.sum()), "neighbours are alike")
        few_pixels = known & (np.arange(36) < 18)
        part, error_of_part = bigus.mean(field, pose(1.1), (36, 28), where=few_pixels)
        self.assertAlmostEqual(part, image[few_pixels].mean(), 6)
        self.assertGreater(error_of_part, 0)
        for where, said in ((~known & False, "no pixel"), (np.ones((3, 3), bool), "shape")):
            with self.assertRaisesRegex(ValueError, said):
                bigus.mean(field, pose(1.1), (36, 28), where=where)
        self.assertTrue(np.isnan(bigus.standard_error(field, pose(4), (36, 28))).all(), "behind the last frame")
        with self.assertRaisesRegex(RuntimeError, "no array StandardError"):
            bigus.standard_error(two_blobs(), pose(), (36, 28))

    def test_takes_vtk_matrices(self):
        matrix = vtkMatrix4x4()
        matrix.DeepCopy(pose().ravel())
        np.testing.assert_array_equal(
            bigus.reslice(two_blobs(), matrix, (36, 28)), bigus.reslice(two_blobs(), pose(), (36, 28)))

    def test_the_third_column_and_the_callers_matrix_do_not_matter(self):
        flat = pose()
        flat[:, 2] = 0
        before = flat.copy()
        np.testing.assert_array_equal(
            bigus.reslice(two_blobs(), flat, (36, 28)), bigus.reslice(two_blobs(), pose(), (36, 28)))
        np.testing.assert_array_equal(flat, before)

    def test_spacing_replaces_the_pixel_size(self):
        np.testing.assert_array_equal(
            bigus.reslice(two_blobs(), pose(pixel=7), (36, 28), spacing=(0.25, 0.5)),
            bigus.reslice(two_blobs(), pose() @ np.diag([1, 2, 1, 1.0]), (36, 28)))

    def test_default_size_reaches_the_last_gaussian(self):
        # The farthest mean is at (5, 4) mm: pixel (20, 16), so 21 x 17 pixels.
        self.assertEqual(bigus.reslice(two_blobs(), pose()).shape, (17, 21))

    def test_properties_reach_the_filter(self):
        field = two_blobs()
        thick = bigus.reslice(field, pose(), (36, 28), ElevationSigma=2.0)
        np.testing.assert_array_equal(thick, bigus.reslice(field, pose(), (36, 28), elevation_sigma=2.0))
        self.assertLess(thick.max(), bigus.reslice(field, pose(), (36, 28)).max())
        bytes_ = bigus.reslice(field, pose(), (36, 28), OutputScalarType=VTK_UNSIGNED_CHAR)
        self.assertEqual(bytes_.dtype, np.uint8)
        scattering = bigus.reslice(field, pose(), (36, 28), OutputMode=bigus.vtkBigusReslice.ScatteringField)
        np.testing.assert_allclose(1 - np.exp(-GAMMA * scattering), expected_image(pose(), 36, 28), atol=2e-3)

    def test_bad_planes_are_named(self):
        with self.assertRaisesRegex(ValueError, "4 x 4"):
            bigus.reslice(two_blobs(), np.eye(3), (4, 4))
        with self.assertRaisesRegex(ValueError, "span a plane"):
            bigus.reslice(two_blobs(), np.zeros((4, 4)), (4, 4))
        with self.assertRaisesRegex(ValueError, "span a plane"):
            bigus.reslice(two_blobs(), pose() * np.nan, (4, 4))
        with self.assertRaisesRegex(ValueError, "stored column by column"):
            bigus.reslice(two_blobs(), pose().T, (4, 4))
        with self.assertRaisesRegex(ValueError, "last row"):
            bigus.reslice(two_blobs(), 2 * pose(), (4, 4))
        for size in ((0, 4), (24, 64, 80), (80.5, 64), 7):
            with self.assertRaisesRegex(ValueError, "size"):
                bigus.reslice(two_blobs(), pose(), size)
        with self.assertRaisesRegex(ValueError, r"size=\(width, height\)"):
            bigus.reslice(make_field(np.empty((0, 3)), np.empty((0, 3)), np.empty(0)), pose())

    def test_a_plane_is_told_by_a_corner_and_two_directions(self):
        matrix = bigus.plane((1, 2, 3), [(2, 0, 0), (0, 0, 5)], (0.25, 0.5))
        np.testing.assert_allclose(matrix @ (4, 2, 0, 1), (2, 2, 4, 1))
        with self.assertRaisesRegex(ValueError, "axes"):
            bigus.plane((1, 2, 3), np.eye(2))

    def test_bad_spacings_are_named(self):
        for spacing in (0, -1, math.nan, math.inf, (0.2, 0)):
            with self.subTest(spacing), self.assertRaisesRegex(ValueError, "spacing must be positive"):
                bigus.reslice(two_blobs(), pose(), (4, 4), spacing=spacing)

    def test_only_fields_are_resliced(self):
        with self.assertRaisesRegex(TypeError, r"field \(vtkPolyData\), not vtkImageData"):
            bigus.reslice(small_sweep(), pose(), (4, 4))

    def test_a_broken_field_is_an_exception(self):
        field = two_blobs()
        field.GetPointData().RemoveArray("Scale")
        with self.assertRaisesRegex(RuntimeError, "Scale"):
            bigus.reslice(field, pose(), (4, 4))


def noisy_sweeps():
    """The same sweep with and without a tracker's noise."""
    sweeps = []
    for noise in (0, 0.3):
        phantom = bigus.vtkBigusPhantomSource()
        phantom.SetFrameSize(64, 64)
        phantom.SetPixelSize(0.4)
        phantom.SetNumberOfFrames(24)
        phantom.SetTrackingNoise(noise)
        phantom.SetTrackingRotationNoise(noise)
        sweeps.append(bigus.update(phantom).GetOutput())
    return sweeps


class BesideVtkImageReslice(unittest.TestCase):
    def test_every_setting_is_there(self):
        settings = [name for name in vars(vtkImageReslice) if name.startswith("Set") or name.endswith(("On", "Off"))]
        self.assertGreater(len(settings), 40)
        newer = {"SetOutputDirection", "SetOutputDirectionToDefault"}  # than VTK 9.1; Filters/README.md says what to use
        self.assertEqual({name for name in settings if not hasattr(bigus.vtkBigusReslice, name)} - newer, set())


@unittest.skipUnless(hasattr(vtkAlgorithm, "__rshift__"), "filters are joined with >> from VTK 9.4 on")
class Pipelines(unittest.TestCase):
    def setUp(self):
        self.reslice = bigus.vtkBigusReslice()
        self.reslice.SetOutputDimensionality(2)
        self.reslice.SetOutputSpacing(0.5, 0.5, 1)
        self.cast = vtkImageCast()
        self.cast.SetOutputScalarTypeToDouble()

    def test_a_field_flows_through_filters(self):
        image = (two_blobs() >> self.reslice >> self.cast)()
        self.reslice.SetInputData(two_blobs())
        bigus.update(self.reslice)
        np.testing.assert_array_equal(bigus.frames(image), bigus.frames(self.reslice.GetOutput()))
        self.assertGreater(bigus.frames(image).max(), 0.2)

    def test_a_pipeline_takes_one_field_after_another(self):
        pipeline = bigus.vtkBigusVoxelizer() >> self.cast
        first, second = pipeline(two_blobs()), pipeline(make_field([(0, 0, 0)], [(1, 1, 1)], [1.0]))
        self.assertEqual(first.GetDimensions()[0], 256)
        self.assertNotEqual(first.GetDimensions(), second.GetDimensions())


class Check(unittest.TestCase):
    def test_tells_what_is_wrong(self):
        sweep = small_sweep()
        self.assertEqual(bigus.check(sweep), [])
        bigus.frames(sweep)[4] = 0
        (found,) = bigus.check(sweep)
        self.assertEqual((found["kind"], found["frames"], found["applied"]), ("contact", 1, True))
        self.assertIn("1 frame (4)", found["text"])
        self.assertFalse(bigus.check(sweep, keep="contact")[0]["applied"])
        with self.assertRaisesRegex(RuntimeError, "'dust'"):
            bigus.check(sweep, keep="dust")


class CorrectPoses(unittest.TestCase):
    def test_noisy_poses_come_nearer_to_the_truth(self):
        truth, sweep = noisy_sweeps()
        found = bigus.correct_poses(sweep)

        def error(data):
            corners = np.array([(0, 0, 0, 1), (63, 0, 0, 1), (0, 63, 0, 1), (63, 63, 0, 1)], dtype=float)
            return np.linalg.norm((bigus.poses(data) - bigus.poses(truth)) @ corners.T, axis=1).mean()

        self.assertLess(error(found.sweep), 0.6 * error(sweep))
        self.assertGreater(found.strength, 0)
        self.assertIn("smoothed by", found.decision["choice"])
        self.assertEqual(set(found.noise), {"translation", "rotation", "corner"})
        self.assertAlmostEqual(found.noise["translation"], 0.3, delta=0.15)
        for values in (found.displacement, found.rotation, found.outlier):
            self.assertEqual(values.shape, (24,))
        self.assertEqual(found.outlier.dtype, bool)
        self.assertTrue(np.shares_memory(bigus.frames(found.sweep), bigus.frames(sweep)))

    def test_exact_poses_and_strength_0_keep_every_bit(self):
        truth, sweep = noisy_sweeps()
        self.assertEqual(bigus.poses(bigus.correct_poses(truth).sweep).tobytes(), bigus.poses(truth).tobytes())
        kept = bigus.correct_poses(sweep, Strength=0)
        self.assertEqual(bigus.poses(kept.sweep).tobytes(), bigus.poses(sweep).tobytes())
        self.assertEqual((kept.strength, kept.displacement.max()), (0, 0))

    def test_training_gives_the_poses_it_trained_at(self):
        _, sweep = noisy_sweeps()
        few = {"Automatic": False, "Gaussians": 200, "Iterations": 1}
        expected = bigus.correct_poses(sweep, Strength=1, HoldOut=4).sweep
        training = bigus.train(sweep, PoseSmoothing=1, HoldOut=4, **few)
        np.testing.assert_array_equal(training.poses, bigus.poses(expected))
        np.testing.assert_array_equal(bigus.train(sweep, **few).poses, bigus.poses(sweep))

    def test_wrong_input_is_an_exception(self):
        with self.assertRaisesRegex(TypeError, "correct_poses takes a sweep"):
            bigus.correct_poses(vtkPolyData())
        with self.assertRaisesRegex(RuntimeError, "(?i)strength"):
            bigus.correct_poses(small_sweep(), Strength=5000)
        with self.assertRaisesRegex(RuntimeError, "ImageToReference"):
            bigus.correct_poses(bigus.image(np.zeros((3, 8, 8), np.uint8)))
        with self.assertRaisesRegex(TypeError, "no property Strenght"):
            bigus.correct_poses(small_sweep(), Strenght=1)


class Copies(unittest.TestCase):
    """Fields and sweeps reach other processes with every bit."""

    def assertSame(self, a, b):
        self.assertIsNot(a, b)
        self.assertEqual(a.GetClassName(), b.GetClassName())
        for mine, other in ((a.GetPointData(), b.GetPointData()), (a.GetFieldData(), b.GetFieldData())):
            self.assertEqual(mine.GetNumberOfArrays(), other.GetNumberOfArrays())
            for i in range(mine.GetNumberOfArrays()):
                array = mine.GetAbstractArray(i)
                same = other.GetAbstractArray(array.GetName())
                for k in range(array.GetNumberOfValues()):
                    self.assertEqual(array.GetVariantValue(k), same.GetVariantValue(k), array.GetName())

    def test_pickle_copy_and_deepcopy(self):
        field, sweep = two_blobs(), small_sweep()
        field.GetPoints().SetPoint(0, math.pi, 1 / 3, 1e-300)
        for data in (field, sweep):
            for made in (pickle.loads(pickle.dumps(data)), copy.copy(data), copy.deepcopy(data)):
                self.assertSame(data, made)
        again = pickle.loads(pickle.dumps(field))
        self.assertEqual(again.GetPoint(0), field.GetPoint(0))
        self.assertEqual(again.GetPointData().GetScalars().GetName(), "Reflectivity")
        np.testing.assert_array_equal(bigus.reslice(again, pose(), (36, 28)), bigus.reslice(field, pose(), (36, 28)))
        np.testing.assert_array_equal(bigus.frames(pickle.loads(pickle.dumps(sweep))), bigus.frames(sweep))


class Environment(unittest.TestCase):
    def test_what_cannot_load_the_compiled_part_is_told(self):
        from bigus.environment import PYTHON, VTK_LIBRARY, complaint
        ours = ["/usr/lib/" + VTK_LIBRARY + "9.1.0", "/usr/lib/libc.so.6"]
        self.assertEqual(complaint((*PYTHON, 0), ours), "")
        self.assertEqual(complaint((*PYTHON, 0), []), "")
        self.assertIn("3.99", complaint((3, 99, 0), ours))
        foreign = "/venv/vtkmodules/libvtkCommonCore-9.7.so"
        self.assertIn(foreign, complaint((*PYTHON, 0), [*ours[1:], foreign]))

    def test_a_foreign_vtk_is_an_import_error_and_no_crash(self):
        with tempfile.TemporaryDirectory() as folder:
            library = os.path.join(folder, "libvtkCommonCore-0.0.so")
            built = subprocess.run(["cc", "-shared", "-x", "c", "/dev/null", "-o", library], capture_output=True)
            if built.returncode:
                self.skipTest("no C compiler")
            script = f"import ctypes; ctypes.CDLL({library!r}); import bigus"
            result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertRegex(result.stderr, "ImportError: BIGUS was built for the VTK .*libvtkCommonCore-0.0.so")


class Train(unittest.TestCase):
    def test_label_pictures_that_do_not_fit_are_refused(self):
        with self.assertRaisesRegex(ValueError, "between 0"):
            bigus.label(vtkPolyData(), vtkImageData(), np.full((2, 3, 3), 256))
        with self.assertRaisesRegex(ValueError, "float64"):
            bigus.label(vtkPolyData(), vtkImageData(), np.zeros((2, 3, 3)))
        with self.assertRaises(TypeError):
            bigus.label(None, vtkImageData(), np.zeros((2, 3, 3), int))

    def test_volumes_are_read_back_where_they_lie(self):
        """The example's NIfTI by its header, and both files by SimpleITK where it is installed."""
        examples = pathlib.Path(__file__).parents[2] / "Examples"
        spec = importlib.util.spec_from_file_location("volume_files", examples / "volume_files.py")
        files = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(files)
        volume = bigus.image(np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
        volume.SetOrigin(-7, 5, 3)
        volume.SetSpacing(0.5, 0.6, 0.7)
        with tempfile.TemporaryDirectory() as folder:
            nifti = os.path.join(folder, "v.nii.gz")
            files.write_nifti(volume, nifti)
            header = gzip.open(nifti).read()
            self.assertEqual(struct.unpack("<3h", header[42:48]), (5, 4, 3))
            np.testing.assert_allclose(struct.unpack("<3f", header[80:92]), (0.5, 0.6, 0.7), rtol=1e-6)
            np.testing.assert_allclose(struct.unpack("<3f", header[268:280]), (-7, 5, 3), rtol=1e-6)  # RAS
            try:
                import pydicom  # noqa: F401
                import SimpleITK
            except ImportError as missing:
                print(f"Skipped: a part of volumes: {missing}")
                return
            files.write_dicom(volume, os.path.join(folder, "dicom"))
            names = SimpleITK.ImageSeriesReader.GetGDCMSeriesFileNames(os.path.join(folder, "dicom"))
            for read in (SimpleITK.ReadImage(nifti), SimpleITK.ReadImage(names)):
                for index in ((0, 0, 0), (4, 3, 2), (1, 2, 0)):
                    x, y, z = read.TransformIndexToPhysicalPoint(index)  # LPS
                    i, j, k = np.rint((np.array([-x, -y, z]) - (-7, 5, 3)) / (0.5, 0.6, 0.7)).astype(int)
                    self.assertEqual(read.GetPixel(index), 20 * k + 5 * j + i)

    def test_several_sweeps_train_one_field(self):
        sweeps = [small_sweep(), small_sweep(count=7)]
        few = {"Automatic": False, "Gaussians": 600, "Iterations": 20, "HoldOut": 4}
        training = bigus.train(sweeps, False, **few)
        self.assertEqual(training.poses.shape, (16, 4, 4))
        np.testing.assert_array_equal(training.poses, np.concatenate([bigus.poses(sweep) for sweep in sweeps]))
        lines = training.field.GetFieldData().GetAbstractArray("Provenance")
        provenance = [lines.GetValue(k) for k in range(lines.GetNumberOfValues())]
        self.assertIn("heldOutFrames=2 6 11 15", provenance)  # 2 and 6 of either, counted on
        self.assertIn("sequences=2", provenance)
        # One in a list is one alone.
        for name in ("Scale", "Reflectivity"):
            alone, listed = (vtk_to_numpy(bigus.train(one, False, **few).field.GetPointData().GetArray(name))
                             for one in (sweeps[0], sweeps[:1]))
            np.testing.assert_array_equal(alone, listed)
        for wrong in ([], [sweeps[0], 3], "sweep"):
            with self.assertRaises(TypeError):
                bigus.train(wrong, False)

    def test_learns_a_small_sweep(self):
        sweep = small_sweep()
        seen = []
        field, log = bigus.train(
            sweep, progress=lambda fraction, text: seen.append(fraction), Automatic=False, Gaussians=300,
            Iterations=60, Batch=4, HoldOut=4)
        self.assertGreater(field.GetNumberOfPoints(), 0)
        self.assertGreater(log.GetNumberOfRows(), 0)
        self.assertTrue(seen)
        self.assertEqual(seen, sorted(seen))
        self.assertTrue(0 <= seen[0] and seen[-1] <= 1)
        held_out = 2
        image = bigus.reslice(field, bigus.poses(sweep)[held_out], (36, 28))
        scores = bigus.metrics(image, bigus.frames(sweep)[held_out])
        black = bigus.metrics(np.zeros_like(image), bigus.frames(sweep)[held_out])
        self.assertGreater(scores["psnr"], black["psnr"] + 6)

    def test_progress_can_stop_it(self):
        calls = []

        def progress(fraction, text):
            calls.append(fraction)
            return fraction < 0.05

        field, _ = bigus.train(small_sweep(), progress, Automatic=False, Gaussians=300, Iterations=20000)
        self.assertGreater(field.GetNumberOfPoints(), 0)
        self.assertLess(calls[-1], 0.5)

    def test_an_exception_in_progress_is_the_callers(self):
        def progress(fraction, text):
            raise KeyError("mine")

        with self.assertRaisesRegex(KeyError, "mine"):
            bigus.train(small_sweep(), progress, Automatic=False, Gaussians=300, Iterations=1000000)

    def test_other_threads_run_meanwhile(self):
        ticks, stop = [], threading.Event()

        def tick():
            while not stop.wait(0.005):
                ticks.append(time.monotonic())

        thread = threading.Thread(target=tick)
        thread.start()
        begin = time.monotonic()
        bigus.train(small_sweep(), progress=False, Automatic=False, Gaussians=300, Iterations=4000)
        end = time.monotonic()
        stop.set()
        thread.join()
        waits = np.diff([begin, *(t for t in ticks if begin < t < end), end])
        self.assertGreater(len(waits), 10, "training is long enough to see")
        self.assertLess(max(waits), (end - begin) / 2, "nobody waited for its end")

    def test_ctrl_c_keeps_the_best_so_far(self):
        script = textwrap.dedent("""
            import sys, numpy as np, bigus
            sweep = bigus.read(sys.argv[1])
            print("ready", flush=True)
            try:
                bigus.train(sweep, checkpoint=sys.argv[3], Automatic=False, Gaussians=300, Iterations=10**7)
            except KeyboardInterrupt as stop:
                bigus.write(stop.training.field, sys.argv[2])
                print(type(stop).__name__, stop.training.field.GetNumberOfPoints(), len(stop.training.poses))
            print("goes on")
        """)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "sweep.mha")
            bigus.write(small_sweep(), path)
            child = subprocess.Popen([sys.executable, "-c", script, path, os.path.join(folder, "f.vtp"),
                                      os.path.join(folder, "checkpoint")],
                                     stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.assertEqual(child.stdout.readline(), "ready\n")
            time.sleep(1.5)
            child.send_signal(signal.SIGINT)
            out, err = child.communicate(timeout=60)
            self.assertEqual(child.returncode, 0, err)
            name, points, poses = out.splitlines()[0].split()
            self.assertEqual((name, int(poses)), ("TrainingInterrupted", 9))
            self.assertGreater(int(points), 0)
            self.assertEqual(out.splitlines()[1], "goes on")
            self.assertGreater(os.path.getsize(os.path.join(folder, "checkpoint")), 0)
            self.assertEqual(bigus.read(os.path.join(folder, "f.vtp")).GetNumberOfPoints(), int(points))

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
            bigus.train(small_sweep(), Automatic=False, Gaussians=300, Iterations=20)
            self.assertEqual(values[-2:], [1, "closed"])
            self.assertEqual(values[:-1], sorted(values[:-1]))
            values.clear()
            bigus.train(small_sweep(), progress=False, Automatic=False, Gaussians=300, Iterations=20)
            self.assertEqual(values, [])
        bigus.train(small_sweep(), progress=True, Automatic=False, Gaussians=300, Iterations=20)  # where nobody watches there is none

    SETTINGS = {"Automatic": False, "Gaussians": 300, "Iterations": 600}

    def test_a_stopped_training_goes_on_with_the_same_bits(self):
        sweep = small_sweep()
        whole = bigus.train(sweep, False, **self.SETTINGS).field
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "checkpoint")
            stopped = bigus.train(sweep, lambda fraction, text: fraction < 0.4, checkpoint=path, **self.SETTINGS)
            rows = stopped.log.GetNumberOfRows()  # none where the first line would have come later
            self.assertLess(stopped.log.GetValueByName(rows - 1, "Iteration").ToInt() if rows else 0, 600)
            self.assertTrue(path.exists())
            with self.assertRaisesRegex(RuntimeError, "seed was 1 and is 5"):
                bigus.train(sweep, False, checkpoint=path, resume=True, Seed=5, **self.SETTINGS)
            resumed = bigus.train(sweep, False, checkpoint=path, resume=True, **self.SETTINGS).field
            self.assertEqual(os.listdir(folder), [], "a finished training needs no checkpoint")
            again = bigus.train(sweep, False, checkpoint=path, resume=True, **self.SETTINGS).field
        for field in (resumed, again):
            np.testing.assert_array_equal(vtk_to_numpy(field.GetPoints().GetData()),
                                          vtk_to_numpy(whole.GetPoints().GetData()))
            for name in ("Scale", "Rotation", "Reflectivity"):
                np.testing.assert_array_equal(vtk_to_numpy(field.GetPointData().GetArray(name)),
                                              vtk_to_numpy(whole.GetPointData().GetArray(name)))

    def test_checkpoints_of_no_use_are_named(self):
        sweep = small_sweep()
        with self.assertRaisesRegex(ValueError, "checkpoint=..."):
            bigus.train(sweep, False, resume=True, **self.SETTINGS)
        with self.assertRaisesRegex(ValueError, "checkpoint_interval"):
            bigus.train(sweep, False, checkpoint="f", checkpoint_interval=-1, **self.SETTINGS)
        with tempfile.TemporaryDirectory() as folder:
            missing = os.path.join(folder, "missing", "checkpoint")
            with self.assertWarnsRegex(RuntimeWarning, "missing.*without a new checkpoint"):
                stopped = bigus.train(sweep, lambda fraction, text: fraction < 0.1, checkpoint=missing, **self.SETTINGS)
            self.assertGreater(stopped.field.GetNumberOfPoints(), 0)
            empty = os.path.join(folder, "empty")
            open(empty, "w").close()
            with self.assertRaisesRegex(RuntimeError, "empty"):
                bigus.train(sweep, False, checkpoint=empty, resume=True, **self.SETTINGS)

    def test_continues_from_a_field(self):
        sweep = small_sweep()
        field, _ = bigus.train(sweep, Gaussians=300, Iterations=0)
        again, _ = bigus.train(sweep, start=field, Iterations=0)
        self.assertEqual(again.GetNumberOfPoints(), field.GetNumberOfPoints())

    def test_decisions_come_with_the_field(self):
        trained = bigus.train(small_sweep(), Automatic=False, Gaussians=300, Iterations=0)
        self.assertEqual(trained.decisions, [])
        field, log = trained
        self.assertIs(field, trained.field)
        self.assertIs(log, trained.log)
        trained = bigus.train(
            small_sweep(), Gaussians=300, Iterations=10, VirtualPlanes=1, Interpolation="probe")
        found = {decision["decision"]: decision for decision in trained.decisions}
        self.assertEqual(found["Gaussians"]["choice"], "300")
        self.assertEqual(found["interpolation"]["choice"], "probe")
        self.assertEqual(found["interpolation"]["evidence"], "given")
        self.assertTrue(found["elevation sigma"]["evidence"])
        self.assertTrue(found["probe's beam"]["evidence"])
        for wrong in ({"Preset": "beauty"}, {"Interpolation": "sideways"}, {"Price": -1.0}):
            with self.subTest(wrong), self.assertRaisesRegex(RuntimeError, "(?i)" + "|".join(wrong)):
                bigus.train(small_sweep(), **wrong)

    def test_every_option_is_a_property(self):
        trainer = bigus.vtkBigusTrainer()
        for index in range(trainer.GetNumberOfOptions()):
            name = trainer.GetOptionName(index)
            with self.subTest(name):
                default = trainer.GetOption(name)
                value = getattr(trainer, "Get" + name)()
                other = value + 1 if isinstance(value, (int, float)) and default not in ("on", "off") else \
                    "other" if isinstance(value, str) else 1 - value
                getattr(trainer, "Set" + name)(other)
                self.assertEqual(getattr(trainer, "Get" + name)(), other)
                self.assertNotEqual(trainer.GetOption(name), default)
                getattr(trainer, "Set" + name)(value)
                self.assertEqual(trainer.GetOption(name), default)
                self.assertRegex(getattr(type(trainer), "Set" + name).__doc__, r"\n.*\w", "what it means")

    def test_bad_input_is_an_exception(self):
        with self.assertRaisesRegex(RuntimeError, "ImageToReference"):
            bigus.train(bigus.image(np.ones((3, 16, 16), np.uint8)))
        for wrong, kind in ((None, "NoneType"), (two_blobs(), "vtkPolyData")):
            with self.assertRaisesRegex(TypeError, rf"sweep \(vtkImageData\), not {kind}"):
                bigus.train(wrong)
        with self.assertRaisesRegex(TypeError, r"field as start \(vtkPolyData\), not vtkImageData"):
            bigus.train(small_sweep(), start=small_sweep())
        with self.assertRaisesRegex(RuntimeError, "(?i)hold"):
            bigus.train(small_sweep(), HoldOut=1)


class Metrics(unittest.TestCase):
    def test_known_values(self):
        rng = np.random.default_rng(1)
        truth = rng.uniform(0.2, 0.7, (2, 32, 40)).astype(np.float32)
        same = bigus.metrics(truth, truth)
        self.assertEqual((same["psnr"], same["ssim"], same["bfs"]), (math.inf, 1.0, 1.0))
        self.assertAlmostEqual(bigus.metrics(truth + np.float32(0.1), truth)["psnr"], 20, places=4)

    def test_bytes_and_floats_compare(self):
        pixels = np.random.default_rng(2).integers(0, 256, (32, 40), dtype=np.uint8)
        scores = bigus.metrics(pixels / 255.0, pixels)
        self.assertGreater(scores["psnr"], 120)
        self.assertEqual(
            sorted(scores), ["bfs", "contrast_distribution", "mean_contrast", "psnr", "rayleigh", "ssim"])

    def test_texture(self):
        rng = np.random.default_rng(3)
        truth = rng.rayleigh(0.1, (2, 96, 80)).astype(np.float32)
        smooth = (truth + np.roll(truth, 1, 1) + np.roll(truth, 1, 2) + np.roll(truth, (1, 1), (1, 2))) / 4
        scores = bigus.texture(smooth, truth)
        self.assertAlmostEqual(scores["truth_contrast_mean"], 0.5227, delta=0.02)
        self.assertAlmostEqual(scores["truth_snr"], 1.913, delta=0.05)
        self.assertAlmostEqual(scores["contrast_ratio"], scores["image_contrast_mean"] / scores["truth_contrast_mean"],
                               places=3)
        self.assertAlmostEqual(scores["image_std"], scores["truth_std"] / 2, delta=0.002)
        self.assertLess(scores["high_frequency_power"], 0.3)
        frequency = scores["spectrum_frequency"]
        np.testing.assert_allclose(scores["truth_spectrum"][1:], truth.var(), rtol=0.2)
        np.testing.assert_allclose(frequency, np.arange(1, 17) / 32)
        # A 2 x 2 mean lets through less the higher the frequency.
        self.assertTrue((np.diff(scores["image_spectrum"] / scores["truth_spectrum"]) < 0).all())

    def test_sizes_must_agree(self):
        with self.assertRaises(RuntimeError):
            bigus.metrics(np.zeros((20, 20), np.uint8), np.zeros((20, 21), np.uint8))


class Documentation(unittest.TestCase):
    def test_the_examples_run_as_they_stand(self):
        """The Python block of the README and that of the package, with fewer Gaussians, on a small sweep."""
        readme = (pathlib.Path(__file__).resolve().parents[2] / "README.md").read_text()
        blocks = re.findall(r"```python\n(.*?)```", readme, re.DOTALL)
        self.assertEqual(len(blocks), 1)
        indented = re.search(r"::\n\n((?:(?:    .*)?\n)+)", bigus.__doc__).group(1)
        for block in (blocks[0], textwrap.dedent(indented)):
            bounded, replaced = re.subn(r"gaussians=\d+", "gaussians=300", block)
            self.assertEqual(replaced, 1)
            with self.subTest(block), tempfile.TemporaryDirectory() as folder:
                bigus.write(small_sweep(), os.path.join(folder, "sweep.igs.mha"))
                script = subprocess.run(
                    [sys.executable, "-c", bounded], cwd=folder, capture_output=True, text=True, timeout=120)
                self.assertEqual((script.returncode, script.stderr), (0, ""))
                self.assertGreater(ast.literal_eval(script.stdout)["psnr"], 15)


class Package(unittest.TestCase):
    def test_has_the_wrapped_classes(self):
        for name in ("SequenceReader", "SequenceWriter", "FieldReader", "FieldWriter", "Trainer", "Reslice",
                     "Voxelizer", "ImageMetrics", "PhantomSource", "PoseCorrection"):
            with self.subTest(name):
                instance = getattr(bigus, "vtkBigus" + name)()
                self.assertTrue(instance.IsA("vtkAlgorithm"))
                self.assertIn("vtkBigus" + name, str(instance))
                self.assertIn("vtkBigus" + name, bigus.__all__)

    def test_a_field_is_repeated_with_its_instruction_set(self):
        self.assertTrue(bigus.instruction_sets())
        last = bigus.instruction_sets()[-1]
        script = textwrap.dedent("""
            import sys, bigus
            if sys.argv[2] == "function":
                bigus.use_instruction_set(sys.argv[3])
            field = bigus.train(bigus.read(sys.argv[1]), False, Automatic=False, Gaussians=300, Iterations=20).field
            bigus.write(field, sys.argv[4])
        """)
        with tempfile.TemporaryDirectory() as folder:
            sweep, one, two = (os.path.join(folder, name) for name in ("sweep.mha", "one.vtp", "two.vtp"))
            bigus.write(small_sweep(), sweep)
            for how, path in (("function", one), ("environment", two)):
                environment = {**os.environ, **({"BIGUS_SIMD": last} if how == "environment" else {})}
                subprocess.run([sys.executable, "-c", script, sweep, how, last, path], env=environment, check=True)
            self.assertEqual(pathlib.Path(one).read_bytes(), pathlib.Path(two).read_bytes())
            provenance = bigus.read(one).GetFieldData().GetAbstractArray("Provenance")
            lines = [provenance.GetValue(k) for k in range(provenance.GetNumberOfValues())]
            self.assertTrue(any(line.startswith("instructionSet") and line.endswith(last) for line in lines), lines)
        with self.assertRaisesRegex(RuntimeError, "AVX9"):
            bigus.use_instruction_set("AVX9")

    def test_is_the_package_under_test(self):
        expected = os.environ.get("BIGUS_EXPECTED_PACKAGE")
        if not expected:
            self.skipTest("BIGUS_EXPECTED_PACKAGE says where the package should come from; it is not set")
        self.assertEqual(os.path.realpath(os.path.dirname(bigus.__file__)), os.path.realpath(expected))

    def test_version_is_the_one_to_cite(self):
        citation = (pathlib.Path(__file__).resolve().parents[2] / "CITATION.cff").read_text()
        self.assertIn(f"\nversion: {bigus.__version__}\n", citation)


if __name__ == "__main__":
    unittest.main()
