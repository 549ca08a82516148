# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The pipeline filters by the names they have in both packages: VTK's wrapped C++ classes, or pure Python over the wheel.

BIGUS_OTHER_PYTHON and BIGUS_OTHER_PACKAGE name a Python and the folder of the other package: then both give the same
images on the same grids. `test_filters.py --scenes FILE` writes what this package gives, for that comparison.
"""

import math
import os
import subprocess
import sys
import tempfile
import unittest

try:
    import vtkmodules  # noqa: F401
except ImportError:
    print("skipped: there is no package vtk")
    sys.exit(77)

import bigus
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR, vtkOutputWindow, vtkPoints, vtkStringArray, vtkStringOutputWindow
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkTrivialProducer
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkCommonTransforms import vtkThinPlateSplineTransform, vtkTransform
from vtkmodules.vtkImagingCore import vtkImageCast, vtkImageReslice

GAMMA = 0.7
CENTERS, SCALES = np.array([(3, 2, 1), (5, 4, 1.5)]), np.array([(1, 1, 1), (0.8, 0.6, 0.9)])


def add(attributes, name, values, dtype=np.float64):
    array = numpy_to_vtk(np.ascontiguousarray(values, dtype=dtype), deep=True)
    array.SetName(name)
    attributes.AddArray(array)
    return array


def field(reflectivities=(1.5, 2.0), rotations=((1, 0, 0, 0), (1, 0, 0, 0)), centers=CENTERS, scales=SCALES):
    data, points = vtkPolyData(), vtkPoints()
    points.SetData(numpy_to_vtk(centers.astype(float), deep=True))
    data.SetPoints(points)
    add(data.GetPointData(), "Scale", scales)
    add(data.GetPointData(), "Rotation", rotations)
    add(data.GetPointData(), "Reflectivity", reflectivities)
    for name, value in (("Gamma", GAMMA), ("ElevationSigma", 0.0)):
        add(data.GetFieldData(), name, [value])
    add(data.GetFieldData(), "FormatVersion", [1], np.int32)
    return data


def matrix(values):
    axes = vtkMatrix4x4()
    axes.DeepCopy(np.asarray(values, dtype=float).ravel())
    return axes


def expected(points, reflectivities=(1.5, 2.0)):
    """The model at thin planes: signed scattering at points [..., 3]."""
    return sum(r * np.exp(-0.5 * (((points - c) / s) ** 2).sum(-1)) for r, c, s in zip(reflectivities, CENTERS, SCALES))


def pixels(image):
    width, height, depth = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(depth, height, width)


def grid(image):
    """[depth, height, width, 4] coordinates of an image's voxels along its axes."""
    x0, x1, y0, y1, z0, z1 = image.GetExtent()
    k, j, i = np.mgrid[z0:z1 + 1, y0:y1 + 1, x0:x1 + 1]
    place = np.array(image.GetOrigin()) + np.stack([i, j, k], -1) * np.array(image.GetSpacing())
    return np.concatenate([place, np.ones(place.shape[:3] + (1,))], -1)


def matrix_of_shift(z):
    shifted = np.eye(4)
    shifted[2, 3] = z
    return shifted


def tilted():
    c, s = np.cos(0.4), np.sin(0.4)
    return np.array([[c, 0, s, 1.0], [0, 1, 0, 0.5], [-s, 0, c, 2.0], [0, 0, 0, 1]])


def slicer(axes=None, extent=(0, 35, 0, 27, 0, 0), spacing=(0.25, 0.25, 1), **properties):
    filter = bigus.vtkBigusReslice()
    filter.SetInputDataObject(field())
    filter.SetTolerance(1e-6)
    if axes is not None:
        filter.SetResliceAxes(matrix(axes))
    if extent is not None:
        filter.SetOutputExtent(*extent)
        filter.SetOutputSpacing(*spacing)
        filter.SetOutputOrigin(0, 0, 0)
    for name, value in properties.items():
        getattr(filter, "Set" + name)(*(value if isinstance(value, tuple) else (value,)))
    return filter


def sweep(frames=9, size=24):
    """A stack of frames with their poses, drawn by the model itself."""
    poses = np.array([np.diag([0.4, 0.4, 1, 1.0]) for _ in range(frames)])
    poses[:, 2, 3] = np.linspace(0, 2.4, frames)
    j, i = np.mgrid[:size, :size]
    index = np.stack([i, j, 0 * i, 0 * i + 1], -1)
    images = np.array([1 - np.exp(-GAMMA * expected((index @ p.T)[..., :3])) for p in poses])
    stack = vtkImageData()
    stack.SetDimensions(size, size, frames)
    stack.GetPointData().SetScalars(numpy_to_vtk(np.round(255 * images).astype(np.uint8).ravel(), deep=True))
    add(stack.GetFieldData(), "ImageToReference", poses.reshape(-1, 16))
    add(stack.GetFieldData(), "Timestamp", np.arange(frames) / 25)
    return stack


def shown(algorithm):
    """What VTK's output window shows of an update that nobody observes."""
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        algorithm.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    return window.GetOutput()


class Reslice(unittest.TestCase):
    def check(self, filter, to_world, atol=2e-5):
        image = bigus.update(filter).GetOutputDataObject(0)
        model = 1 - np.exp(-GAMMA * np.maximum(expected((grid(image) @ np.asarray(to_world).T)[..., :3]), 0))
        np.testing.assert_allclose(pixels(image), model, atol=atol)
        return image

    def test_equals_the_model_at_any_plane(self):
        self.check(slicer(), np.eye(4))
        image = self.check(slicer(tilted(), extent=(-3, 30, 2, 20, 0, 2), spacing=(0.3, 0.2, 0.5)), tilted())
        self.assertEqual(image.GetExtent(), (-3, 30, 2, 20, 0, 2))
        self.assertEqual(image.GetPointData().GetScalars().GetName(), "Intensity")

    def test_transform_comes_after_the_axes(self):
        turn = vtkTransform()
        turn.RotateZ(30)
        turn.Translate(0.3, 0.2, -0.1)
        m = turn.GetMatrix()
        turned = np.array([[m.GetElement(i, j) for j in range(4)] for i in range(4)])
        self.check(slicer(tilted(), ResliceTransform=turn), turned @ tilted())

    def test_changed_axes_are_seen_at_the_next_update(self):
        filter = slicer(np.eye(4))
        bigus.update(filter)
        filter.GetResliceAxes().SetElement(2, 3, 1.2)
        self.check(filter, matrix_of(filter.GetResliceAxes()))
        filter.SetResliceAxesDirectionCosines(0, 1, 0, 0, 0, 1, 1, 0, 0)
        filter.SetResliceAxesOrigin(2, 0, 0)
        origin = [0, 0, 0]
        filter.GetResliceAxesOrigin(origin)
        self.assertEqual(origin, [2, 0, 0])
        self.check(filter, [[0, 0, 1, 2], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])

    def test_downstream_filters_see_it_too(self):
        filter = slicer(np.eye(4))
        cast = vtkImageCast()
        cast.SetInputConnection(filter.GetOutputPort())
        cast.SetOutputScalarTypeToDouble()
        cast.Update()
        before = pixels(cast.GetOutput()).copy()
        filter.GetResliceAxes().SetElement(2, 3, 1.2)
        cast.Update()
        self.assertGreater(np.abs(pixels(cast.GetOutput()) - before).max(), 0.1)

    def test_output_to_a_frame(self):
        filter = bigus.vtkBigusReslice()
        filter.SetInputDataObject(field())
        filter.SetTolerance(1e-6)
        axes = tilted() @ np.diag([0.25, 0.3, 1, 1])
        filter.SetOutputToFrame(matrix(axes), 30, 20)
        image = self.check(filter, axes)
        self.assertEqual(image.GetDimensions(), (30, 20, 1))

    def test_default_geometry_is_that_of_vtkimagereslice(self):
        information = vtkImageData()
        information.SetDimensions(20, 30, 10)
        information.SetSpacing(0.5, 0.25, 0.75)
        information.SetOrigin(1, 2, 3)
        information.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
        for dimensionality, crop in ((3, 0), (2, 0), (3, 1)):
            ours, theirs = slicer(tilted(), extent=None), vtkImageReslice()
            theirs.SetInputData(information)
            theirs.SetResliceAxes(matrix(tilted()))
            ours.SetInformationInput(information)
            for filter in (ours, theirs):
                filter.SetOutputDimensionality(dimensionality)
                filter.SetAutoCropOutput(crop)
            theirs.Update()
            image = self.check(ours, tilted(), atol=1e-4)
            self.assertEqual(image.GetExtent(), theirs.GetOutput().GetExtent())
            np.testing.assert_allclose(image.GetSpacing(), theirs.GetOutput().GetSpacing())
            np.testing.assert_allclose(image.GetOrigin(), theirs.GetOutput().GetOrigin())

    def test_without_geometry_the_field_is_covered(self):
        filter = slicer(extent=None, Tolerance=1e-3)
        filter.UpdateInformation()
        low, high = CENTERS - 3 * SCALES, CENTERS + 3 * SCALES
        bigus.update(filter)
        bounds = filter.GetOutputDataObject(0).GetBounds()
        spacing = filter.GetOutputDataObject(0).GetSpacing()[0]
        np.testing.assert_allclose(bounds[::2], low.min(axis=0), atol=spacing)
        np.testing.assert_allclose(bounds[1::2], high.max(axis=0), atol=spacing)

    def test_any_part_has_the_same_bits(self):
        filter = slicer(tilted(), extent=(0, 35, 0, 27, 0, 3))
        whole = pixels(bigus.update(filter).GetOutputDataObject(0)).copy()
        part = slicer(tilted(), extent=(0, 35, 0, 27, 0, 3))
        part.UpdateInformation()
        part.UpdateExtent((5, 20, 3, 9, 1, 2))
        image = part.GetOutputDataObject(0)
        self.assertEqual(image.GetExtent(), (5, 20, 3, 9, 1, 2))
        np.testing.assert_array_equal(pixels(image), whole[1:3, 3:10, 5:21])

    def test_coverage_stencil_and_background(self):
        filter = slicer(GenerateStencilOutput=1, CoverageThreshold=0.05, BackgroundLevel=0.5)
        bigus.update(filter)
        coverage, image = pixels(filter.GetCoverageOutput()), pixels(filter.GetOutputDataObject(0))
        self.assertEqual(filter.GetCoverageOutput().GetPointData().GetScalars().GetName(), "Coverage")
        seen = coverage > 0.05
        self.assertTrue(seen.any() and not seen.all())
        np.testing.assert_array_equal(image[~seen], 0.5)
        np.testing.assert_allclose(coverage[0], sum(np.exp(-0.5 * (((grid(filter.GetOutputDataObject(0))[0, ..., :3] - c) / s)
                                                                   ** 2).sum(-1)) for c, s in zip(CENTERS, SCALES)), atol=2e-4)
        stencil = filter.GetStencilOutput()
        inside = np.array([[[stencil.IsInside(x, y, 0) for x in range(36)] for y in range(28)]]) != 0
        np.testing.assert_array_equal(inside, seen)

    def test_beside_everything_is_nothing(self):
        filter = slicer(matrix_of_shift(1000))
        image = pixels(bigus.update(filter).GetOutputDataObject(0))
        self.assertEqual((np.abs(image).max(), np.signbit(image).sum()), (0, 0))

    def test_signed_scattering_and_bytes(self):
        filter = slicer()
        filter.SetInputDataObject(field((1.5, -2.0)))
        filter.SetOutputModeToScatteringField()
        image = bigus.update(filter).GetOutputDataObject(0)
        np.testing.assert_allclose(pixels(image), expected(grid(image)[..., :3], (1.5, -2.0)), atol=2e-5)
        self.assertEqual(image.GetPointData().GetScalars().GetName(), "ScatteringField")
        filter.SetOutputScalarTypeToUnsignedChar()
        with self.assertRaisesRegex(RuntimeError, "signed and unbounded"):
            bigus.update(filter)
        filter.SetOutputModeToIntensity()
        self.assertEqual(pixels(bigus.update(filter).GetOutputDataObject(0)).dtype, np.uint8)

    def test_slabs(self):
        planes = [1 - np.exp(-GAMMA * expected(grid(bigus.update(slicer()).GetOutputDataObject(0))[..., :3] + (0, 0, z)))
                  for z in (-1.0, 0.0, 1.0)]
        for mode, joined in (("Min", np.min(planes, 0)), ("Max", np.max(planes, 0)), ("Mean", np.mean(planes, 0)),
                             ("Sum", np.sum(planes, 0))):
            filter = slicer(SlabNumberOfSlices=3)
            getattr(filter, "SetSlabModeTo" + mode)()
            np.testing.assert_allclose(pixels(bigus.update(filter).GetOutputDataObject(0)), joined, atol=6e-5, err_msg=mode)

    def test_distance_to_recorded_frames(self):
        filter = slicer(RecordedFrames=sweep())
        bigus.update(filter)
        self.assertEqual(filter.GetDistanceOutput().GetPointData().GetScalars().GetName(), "Distance")
        np.testing.assert_allclose(pixels(filter.GetDistanceOutput())[0, 4, 5], 0, atol=1e-5)
        filter.SetResliceAxesOrigin(0, 0, 3.4)
        bigus.update(filter)
        np.testing.assert_allclose(pixels(filter.GetDistanceOutput())[0, 4, 5], 1, atol=1e-5)

    def test_follows_its_input(self):
        producer = vtkTrivialProducer()
        producer.SetOutput(field())
        filter = slicer()
        filter.SetInputConnection(producer.GetOutputPort())
        before = pixels(bigus.update(filter).GetOutputDataObject(0)).copy()
        producer.SetOutput(field((0.1, 0.1)))
        self.assertLess(pixels(bigus.update(filter).GetOutputDataObject(0)).max(), 0.5 * before.max())

    def test_mistakes_are_named(self):
        for change, text in (
            (dict(OutputSpacing=(0.0, 1, 1)), "OutputSpacing along axis 0"),
            (dict(OutputOrigin=(0, np.nan, 0)), "OutputOrigin along axis 1 is not finite"),
            (dict(ResliceTransform=vtkThinPlateSplineTransform()), "may bend planes"),
            (dict(ResliceAxes=matrix(np.diag([1, 1, 1, 0]))), "perspective|not finite|inverted"),
            (dict(CoverageThreshold=-1), "CoverageThreshold"),
            (dict(MaximumOutputPixels=100), "more than MaximumOutputPixels"),
            (dict(Engine="abacus"), "abacus"),
            (dict(Tolerance=-1), "(?i)tolerance"),
            (dict(OutputScalarType=5), "float and unsigned char"),
        ):
            filter = slicer(**change)
            with self.assertRaisesRegex(RuntimeError, text):
                bigus.update(filter)
            self.assertNotEqual(filter.GetErrorCode(), 0)
        broken = field()
        broken.GetPointData().GetArray("Scale").SetComponent(1, 2, -1)
        filter = slicer()
        filter.SetInputDataObject(broken)
        with self.assertRaisesRegex(RuntimeError, r"Scale\[1\]"):
            bigus.update(filter)
        broken.GetPointData().RemoveArray("Scale")
        with self.assertRaisesRegex(RuntimeError, "the array Scale is missing; it needs 2 tuples of 3"):
            bigus.update(filter)


@unittest.skipUnless(hasattr(bigus, "Slicer"), "VTK's own wrapping gives its classes what it gives")
class PropertiesOfTheWheel(unittest.TestCase):
    FILTERS = [name for name in dir(bigus) if name.startswith("vtkBigus")]

    def test_properties_do_what_they_say(self):
        filter = slicer()
        before = filter.GetMTime()
        filter.elevation_sigma = 1.0
        self.assertEqual((filter.GetElevationSigma(), filter.elevation_sigma), (1.0, 1.0))
        self.assertGreater(filter.GetMTime(), before)
        filter.output_spacing = (0.3, 0.2, 1)
        self.assertEqual(filter.GetOutputSpacing(), (0.3, 0.2, 1.0))
        filter.reslice_axes_origin = (1, 2, 3)
        self.assertEqual(filter.reslice_axes_origin, (1, 2, 3))
        trainer = bigus.vtkBigusTrainer()
        trainer.hold_out, trainer.automatic = 4, False
        self.assertEqual((trainer.GetHoldOut(), trainer.GetAutomatic()), (4, 0))

    def test_every_setter_has_its_property_and_says_what_it_is_for(self):
        for name in self.FILTERS:
            kind = getattr(bigus, name)
            for setter in [one for one in vars(kind) if one.startswith("Set") and hasattr(kind, "Get" + one[3:]) and one != "SetOption"]:
                with self.subTest(filter=name, setter=setter):
                    own = bigus.names.snake_case(setter[3:])
                    self.assertIsInstance(getattr(kind, own), property)
                    self.assertGreater(len(getattr(kind, setter).__doc__ or ""), 10)
                    self.assertEqual(getattr(kind, own).__doc__, getattr(kind, setter).__doc__)

    def test_constructors_take_properties(self):
        for spelt in ({"elevation_sigma": 0.5, "output_mode": 1}, {"ElevationSigma": 0.5, "OutputMode": 1}):
            filter = bigus.vtkBigusReslice(**spelt)
            self.assertEqual((filter.GetElevationSigma(), filter.GetOutputMode()), (0.5, 1))
        with self.assertRaisesRegex(TypeError, "no property elevation_sgma; did you mean elevation_sigma"):
            bigus.vtkBigusReslice(elevation_sgma=3)
        with self.assertRaisesRegex(TypeError, "ElevationSigma and elevation_sigma are the same"):
            bigus.vtkBigusReslice(ElevationSigma=1, elevation_sigma=1)
        self.assertEqual(bigus.vtkBigusTrainer(hold_out=4).GetHoldOut(), 4)

    def test_what_is_no_property_is_refused(self):
        filter = bigus.vtkBigusReslice()
        with self.assertRaisesRegex(AttributeError, "no property elevation_sgma; did you mean elevation_sigma"):
            filter.elevation_sgma = 3
        with self.assertRaisesRegex(AttributeError, "no property ElevationSigma; did you mean"):
            filter.ElevationSigma = 3
        for name in self.FILTERS:
            if name != "vtkBigusFieldToImage":
                with self.subTest(filter=name), self.assertRaises(AttributeError):
                    getattr(bigus, name)().nothing = 1


class Voxels(unittest.TestCase):
    def test_equal_the_model(self):
        filter = bigus.vtkBigusVoxelizer()
        filter.SetInputDataObject(field())
        filter.SetMaximumDimension(40)
        filter.SetTolerance(1e-6)
        image = bigus.update(filter).GetOutputDataObject(0)
        self.assertEqual(max(image.GetDimensions()), 40)
        model = 1 - np.exp(-GAMMA * expected(grid(image)[..., :3]))
        np.testing.assert_allclose(pixels(image), model, atol=2e-5)

    def test_given_grid_along_given_axes(self):
        filter = bigus.vtkBigusVoxelizer()
        filter.SetInputDataObject(field())
        filter.SetTolerance(1e-6)
        direction = tilted()[:3, :3]
        filter.SetOutputDirection(direction.ravel())
        filter.SetOutputDimensions(12, 10, 8)
        filter.SetOutputOrigin(1, 0.5, 0)
        filter.SetOutputSpacing(0.4, 0.5, 0.3)
        image = bigus.update(filter).GetOutputDataObject(0)
        k, j, i = np.mgrid[:8, :10, :12]
        place = np.array([1, 0.5, 0]) + (np.stack([i, j, k], -1) * (0.4, 0.5, 0.3)) @ direction.T
        np.testing.assert_allclose(pixels(image), 1 - np.exp(-GAMMA * expected(place)), atol=2e-5)
        found = [0.0, 0.0, 0.0]
        image.TransformContinuousIndexToPhysicalPoint((3, 4, 5), found)
        np.testing.assert_allclose(found, place[5, 4, 3])
        filter.SetOutputDirection((1, 0, 0, 0, 1, 0, 0, 0, 2))
        with self.assertRaisesRegex(RuntimeError, "unit vectors"):
            bigus.update(filter)


def sure_field():
    """A field that keeps what its standard error rests on."""
    trainer = bigus.vtkBigusTrainer()
    trainer.SetInputDataObject(0, sweep())
    for name, value in (("Automatic", False), ("Gaussians", 400), ("Iterations", 20)):
        getattr(trainer, "Set" + name)(value)
    return bigus.update(trainer).GetOutputDataObject(0)


def sure_voxels(data):
    """Of the frames and of what lies beside and behind them, on a turned grid."""
    filter = bigus.vtkBigusVoxelizer()
    filter.SetInputDataObject(data)
    filter.SetOutputDirection((1, 0, 0, 0, 0.8, -0.6, 0, 0.6, 0.8))
    filter.SetOutputDimensions(20, 16, 5)
    filter.SetOutputOrigin(1, 1, -1)
    filter.SetOutputSpacing(0.5, 0.5, 0.6)
    filter.GenerateStandardErrorOutputOn()
    return filter


def sure_slice(data):
    """Across its frames, with its standard error."""
    filter = bigus.vtkBigusReslice()
    filter.SetInputDataObject(data)
    filter.SetOutputToFrame(matrix(np.array([[0.5, 0, 0, 1], [0, 0.4, -0.6, 1], [0, 0.3, 0.8, 0], [0, 0, 0, 1]])), 20, 16)
    filter.GenerateStandardErrorOutputOn()
    return filter


def byte_image(values):
    image = vtkImageData()
    image.SetDimensions(values.shape[1], values.shape[0], 1)
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values, np.uint8).ravel(), deep=True))
    return image


class StandardErrors(unittest.TestCase):
    def test_of_voxels_are_those_of_the_volumes_slices(self):
        data = sure_field()
        filter = bigus.update(sure_voxels(data))
        image, sigma = filter.GetOutputDataObject(0), filter.GetStandardErrorOutput()
        self.assertEqual((sigma.GetExtent(), sigma.GetSpacing(), sigma.GetOrigin()), (image.GetExtent(), image.GetSpacing(), image.GetOrigin()))
        last = [[0.0] * 3 for _ in range(2)]
        for one, place in zip((image, sigma), last):
            one.TransformIndexToPhysicalPoint((19, 15, 4), place)
        self.assertEqual(*last)
        found = pixels(sigma).copy()
        self.assertTrue(300 < np.isnan(found).sum() < found.size - 300)
        reslice = bigus.vtkBigusReslice()
        reslice.SetInputDataObject(data)
        reslice.SetElevationSigma(0)
        reslice.GenerateStandardErrorOutputOn()
        for k in range(5):
            first = [0.0] * 3
            image.TransformIndexToPhysicalPoint((0, 0, k), first)
            frame = np.array([[0.5, 0, 0, first[0]], [0, 0.4, -0.6, first[1]], [0, 0.3, 0.8, first[2]], [0, 0, 0, 1]])
            reslice.SetOutputToFrame(matrix(frame), 20, 16)
            expected = pixels(bigus.update(reslice).GetStandardErrorOutput())[0]
            # Places are the same but for rounding, the pictures to a tolerance of 1e-4; what is known is coded in a byte.
            self.assertLess((np.isnan(found[k]) != np.isnan(expected)).sum(), 4)
            self.assertGreater((np.abs(found[k] - expected)[~np.isnan(found[k] - expected)] < 1e-3).mean(), 0.98)

    def test_in_parts_are_those_of_the_whole_and_stop_when_told(self):
        data = sure_field()
        whole = pixels(bigus.update(sure_voxels(data)).GetStandardErrorOutput())
        filter = sure_voxels(data)
        filter.UpdateInformation()
        filter.UpdateExtent((3, 9, 5, 5, 1, 2))
        np.testing.assert_array_equal(pixels(filter.GetStandardErrorOutput()), whole[1:3, 5:6, 3:10])
        fractions = []
        filter = sure_voxels(data)
        filter.AddObserver("ProgressEvent", lambda *_: (fractions.append(filter.GetProgress()), filter.SetAbortExecute(filter.GetProgress() > 0.6)))
        filter.Update()
        self.assertEqual(fractions, sorted(fractions))
        told = [fraction for fraction in fractions if fraction > 0.6]
        self.assertTrue(told[0] < 1 and told[1:] in ([], [1]), fractions)  # newer VTKs end what was stopped with 1, too
        self.assertEqual(filter.GetStandardErrorOutput().GetNumberOfPoints(), 0)

    def test_of_means_are_more_than_of_independent_pixels_and_less_than_of_one(self):
        filter = sure_slice(sure_field())
        complaints = []
        filter.AddObserver("ErrorEvent", lambda *_: complaints.append(1))
        self.assertTrue(math.isnan(filter.GetStandardErrorOfMean()), "nothing yet")
        sigma = pixels(bigus.update(filter).GetStandardErrorOutput())[0]
        where = np.arange(sigma.size).reshape(sigma.shape) % sigma.shape[1] < 9
        self.assertEqual(len(complaints), 1)
        for chosen, error in ((where == where, filter.GetStandardErrorOfMean()),
                              (where, filter.GetStandardErrorOfMean(byte_image(where)))):
            known = sigma[chosen & ~np.isnan(sigma)]
            largest = np.sqrt(np.square(known).mean())
            self.assertTrue(largest / np.sqrt(known.size) < error < largest, (largest, error))
        self.assertTrue(math.isnan(filter.GetStandardErrorOfMean(byte_image(where & False))), "of no pixel")
        self.assertEqual(len(complaints), 1)
        self.assertTrue(math.isnan(filter.GetStandardErrorOfMean(byte_image(where[1:]))), "of another size")
        filter.SetOutputDimensionality(3)
        filter.SetOutputExtent(0, 19, 0, 15, 0, 1)
        sigma = pixels(bigus.update(filter).GetStandardErrorOutput())
        self.assertTrue(0 < filter.GetStandardErrorOfMean() < np.sqrt(np.nanmean(np.square(sigma))), "two slices")
        self.assertEqual(len(complaints), 2)

    def test_need_a_field_that_keeps_them_and_an_intensity(self):
        filter = sure_voxels(field())
        with self.assertRaisesRegex(RuntimeError, "no array StandardError"):
            bigus.update(filter)
        filter.GenerateStandardErrorOutputOff()
        self.assertEqual(bigus.update(filter).GetStandardErrorOutput().GetNumberOfPoints(), 0)
        filter = sure_voxels(sure_field())
        filter.SetOutputModeToLabelShare()
        with self.assertRaisesRegex(RuntimeError, "OutputMode to Intensity|no labels"):
            bigus.update(filter)


def labelled_field():
    """The first Gaussian is label 3, the second label 8."""
    data = field()
    names = vtkStringArray()
    names.SetName("LabelNames")
    for name in ("cyst", "vein"):
        names.InsertNextValue(name)
    data.GetFieldData().AddArray(names)
    add(data.GetFieldData(), "LabelValues", (3, 8), np.int32)
    add(data.GetFieldData(), "LabelColors", ((1, 0, 0), (0, 0.5, 1)))
    add(data.GetPointData(), "LabelWeight", ((1, 0), (0, 1)), np.float32)
    return data


class Labels(unittest.TestCase):
    def test_of_two_gaussians_lie_where_each_is_the_stronger(self):
        filter = slicer(tilted(), extent=(2, 35, 1, 27, 0, 1), GenerateLabelOutput=True, OutputDimensionality=3)
        filter.SetInputDataObject(labelled_field())
        shown = bigus.update(filter).GetLabelOutput()
        self.assertEqual((shown.GetScalarType(), shown.GetPointData().GetScalars().GetName()), (VTK_UNSIGNED_CHAR, "Labels"))
        for what in ("GetExtent", "GetSpacing", "GetOrigin"):
            self.assertEqual(getattr(shown, what)(), getattr(filter.GetOutput(), what)())
        points = (grid(shown) @ tilted().T)[..., :3]
        first, second = expected(points, (1, 0)), expected(points, (0, 1))
        clear = (np.abs(first + second - 0.54) > 0.01) & (np.abs(first - second) > 0.01)
        truth = np.where(first + second < 0.54, 0, np.where(first > second, 3, 8))
        self.assertEqual(set(np.unique(truth[clear])), {0, 3, 8})
        np.testing.assert_array_equal(pixels(shown)[clear], truth[clear])
        self.assertEqual(shown.GetFieldData().GetAbstractArray("LabelNames").GetValue(1), "vein")
        np.testing.assert_array_equal(vtk_to_numpy(shown.GetFieldData().GetArray("LabelValues")), (3, 8))
        self.assertEqual(shown.GetFieldData().GetArray("LabelColors").GetTuple(1), (0, 0.5, 1))

    def test_follow_thickness_and_need_a_field_that_has_them(self):
        filter = slicer(matrix_of_shift(1), GenerateLabelOutput=True)
        filter.SetInputDataObject(labelled_field())
        self.assertTrue(pixels(bigus.update(filter).GetLabelOutput()).any())
        filter.SetElevationSigma(4)  # mm: a quarter of each is left, less than what counts as seen
        self.assertFalse(pixels(bigus.update(filter).GetLabelOutput()).any())
        filter.SetInputDataObject(field())
        with self.assertRaisesRegex(RuntimeError, "no labels"):
            bigus.update(filter)
        filter.GenerateLabelOutputOff()
        self.assertEqual(bigus.update(filter).GetLabelOutput().GetNumberOfPoints(), 0)


class Files(unittest.TestCase):
    def test_fields_and_sweeps_come_back(self):
        with tempfile.TemporaryDirectory() as folder:
            for kind, name, data in (("Field", "f.vtp", field()), ("Field", "f.ply", field()), ("Sequence", "s.mha", sweep())):
                path = os.path.join(folder, name)
                writer, reader = getattr(bigus, f"vtkBigus{kind}Writer")(), getattr(bigus, f"vtkBigus{kind}Reader")()
                writer.SetFileName(path)
                writer.SetInputDataObject(data)
                self.assertEqual(writer.Write(), 1)
                reader.SetFileName(path)
                again = bigus.update(reader).GetOutputDataObject(0)
                if kind == "Field":
                    np.testing.assert_array_equal(vtk_to_numpy(again.GetPoints().GetData()), CENTERS)
                    self.assertEqual(again.GetPointData().GetScalars().GetName(), "Reflectivity")
                    self.assertEqual(again.GetNumberOfVerts(), 2)
                    continue
                np.testing.assert_array_equal(pixels(again), pixels(data))
                names = [again.GetFieldData().GetArrayName(k) for k in range(again.GetFieldData().GetNumberOfArrays())]
                self.assertEqual(sorted(names), ["ImageToReference", "Mask", "SourceFrame", "Status", "Timestamp"])
                self.assertEqual(reader.GetNumberOfAcceptedFrames(), 9)
                self.assertEqual(reader.GetTransformChain(), "Image -> Reference")
                size, bounds, spacing = [0.0] * 2, [0.0] * 6, [0.0] * 3
                reader.GetPlaneSpacing(spacing)
                np.testing.assert_allclose(spacing, 0.3)
                reader.GetPixelSize(size)
                reader.GetBounds(bounds)
                np.testing.assert_allclose(size, (0.4, 0.4))
                np.testing.assert_allclose(bounds, (0, 9.2, 0, 9.2, 0, 2.4))
                self.assertAlmostEqual(reader.GetPathLength(), 2.4)
                self.assertTrue(reader.GetHasTimestamps())
                self.assertAlmostEqual(reader.GetDuration(), 0.32)
                reader.SetToFrame("Moon")
                with self.assertRaisesRegex(RuntimeError, "no way from Image to Moon"):
                    bigus.update(reader)
            writer.SetFileName(os.path.join(folder, "s.nrrd"))
            with self.assertRaisesRegex(RuntimeError, "as .mha"):
                bigus.update(writer)
            with self.assertRaisesRegex(RuntimeError, "FileName is not set"):
                bigus.update(bigus.vtkBigusFieldReader())


class Trainer(unittest.TestCase):
    def trainer(self):
        trainer = bigus.vtkBigusTrainer()
        trainer.SetInputDataObject(0, sweep())
        trainer.AutomaticOff()
        trainer.SetGaussians(400)
        trainer.SetIterations(20)
        trainer.SetHoldOut(4)
        return trainer

    def test_trains_a_field_that_a_slice_shows(self):
        trainer = self.trainer()
        texts = []
        trainer.AddObserver("ProgressEvent", lambda *_: texts.append(trainer.GetProgressText()))
        bigus.update(trainer)
        self.assertTrue(any("iteration" in (text or "") for text in texts))
        frames = trainer.GetHeldOutFrames()
        self.assertEqual([frames.GetValue(k) for k in range(frames.GetNumberOfValues())], [2, 6])
        self.assertEqual((trainer.GetIterationsDone(), trainer.GetAborted()), (20, False))
        log = trainer.GetLog()
        self.assertEqual(log.GetColumnName(2), "Loss")
        self.assertEqual(trainer.GetCorrectedPoses().GetNumberOfTuples(), 9)
        self.assertEqual(trainer.GetSettledOption("HoldOut"), "4")
        filter = bigus.vtkBigusReslice()
        filter.SetInputConnection(trainer.GetOutputPort())
        axes = vtkMatrix4x4()
        axes.DeepCopy(trainer.GetCorrectedPoses().GetTuple(2))
        filter.SetOutputToFrame(axes, 24, 24)
        image = pixels(bigus.update(filter).GetOutputDataObject(0))[0]
        truth = pixels(sweep())[2] / 255
        self.assertGreater(10 * np.log10(1 / np.mean((image - truth) ** 2)), 25)
        lines = trainer.GetOutputDataObject(0).GetFieldData().GetAbstractArray("Provenance")
        self.assertEqual(lines.GetValue(0), "filter=vtkBigusTrainer")

    def test_frames_off_the_skin_are_left_out_and_said(self):
        stack = sweep()
        vtk_to_numpy(stack.GetPointData().GetScalars()).reshape(9, -1)[4] = 0
        trainer = self.trainer()
        trainer.SetInputDataObject(0, stack)
        trainer.SetHoldOut(0)
        with self.assertWarnsRegex(RuntimeWarning, r"off the skin: 1 frame \(4\).*keep 'contact'"):
            bigus.update(trainer)
        frames = trainer.GetTrainingFrames()
        self.assertEqual([frames.GetValue(k) for k in range(frames.GetNumberOfValues())], [0, 1, 2, 3, 5, 6, 7, 8])
        trainer.SetKeep("contact")
        with self.assertWarnsRegex(RuntimeWarning, "Nothing was done"):
            bigus.update(trainer)
        self.assertEqual(trainer.GetTrainingFrames().GetNumberOfValues(), 9)

    def test_findings_come_to_the_output_window(self):
        stack = sweep()
        vtk_to_numpy(stack.GetPointData().GetScalars()).reshape(9, -1)[4] = 0
        correction = bigus.vtkBigusPoseCorrection()
        correction.SetStrength(0)
        for algorithm in (self.trainer(), correction):
            algorithm.SetInputDataObject(0, stack)
            self.assertEqual(shown(algorithm).count("off the skin: 1 frame"), 1)
        correction.Modified()
        with self.assertWarnsRegex(RuntimeWarning, "off the skin: 1 frame.*Nothing was done"):
            bigus.update(correction)

    def test_doubts_about_poses_are_said(self):
        for said in ("metres", "one plane"):
            stack = sweep()
            poses = vtk_to_numpy(stack.GetFieldData().GetArray("ImageToReference")).reshape(-1, 4, 4)
            if said == "metres":
                poses[:, :3] /= 1000
            else:  # the probe is pushed along its rows
                poses[:, 0, 3], poses[:, 2, 3] = poses[:, 2, 3], 0
            trainer = self.trainer()
            trainer.SetInputDataObject(0, stack)
            inspection = bigus.vtkBigusSweepInspection()
            inspection.SetInputDataObject(stack)
            with self.subTest(said):
                found = bigus.update(inspection).GetFindings()
                texts = [found.GetValueByName(row, "Text").ToString() for row in range(found.GetNumberOfRows())]
                self.assertIn(said, " ".join(texts))
                with self.assertWarnsRegex(RuntimeWarning, f"Poses are doubtful: .*{said}.*Nothing was done"):
                    bigus.update(trainer)

    def test_twelve_bits_are_said(self):
        lines = ["ObjectType = Image", "NDims = 3", "BinaryData = True", "DimSize = 4 3 2", "ElementType = MET_USHORT",
                 *(f"Seq_Frame{k:04d}_ImageToReferenceTransform = 0.3 0 0 0 0 0.3 0 0 0 0 1 {k} 0 0 0 1" for k in range(2)),
                 *(f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus = OK" for k in range(2)), "ElementDataFile = LOCAL\n"]
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "twelve.mha")
            with open(path, "wb") as file:
                file.write("\n".join(lines).encode() + np.linspace(1, 4095, 24).astype("<u2").tobytes())
            with self.assertWarnsRegex(RuntimeWarning, "12 of 16 bits"):
                bigus.read(path)
            reader = bigus.vtkBigusSequenceReader()
            reader.SetFileName(path)
            self.assertEqual(shown(reader).count("12 of 16 bits"), 1)

    def test_twelve_bits_of_arrays_are_said(self):
        stack = sweep()
        bytes_ = vtk_to_numpy(stack.GetPointData().GetScalars())
        stack.GetPointData().SetScalars(numpy_to_vtk(16 * bytes_.astype(np.uint16), deep=True))
        said = r"no pixel is brighter than \d.\d % of white"  # 16 x 255 of 65535 at the most: 6.2 %
        inspection = bigus.vtkBigusSweepInspection()
        inspection.SetInputDataObject(stack)
        texts = bigus.update(inspection).GetOutputDataObject(1).GetColumnByName("Text")
        self.assertRegex(" ".join(texts.GetValue(row) for row in range(texts.GetNumberOfValues())), said)
        trainer = self.trainer()
        trainer.SetInputDataObject(0, stack)
        self.assertRegex(shown(trainer), said)
        trainer.Modified()
        with self.assertWarnsRegex(RuntimeWarning, said):
            bigus.update(trainer)

    def test_properties(self):
        trainer = self.trainer()
        self.assertEqual((trainer.GetHoldOut(), trainer.GetAutomatic(), trainer.GetElevationSigma()), (4, 0, -1))
        trainer.SetEngine("reference")
        trainer.SetOption("Batch", "3")
        self.assertEqual((trainer.GetEngine(), trainer.GetBatch(), trainer.GetOption("Batch")), ("reference", 3, "3"))
        trainer.SetGaussians(-1)
        self.assertEqual(trainer.GetOption("Gaussians"), "auto")
        names = [trainer.GetOptionName(k) for k in range(trainer.GetNumberOfOptions())]
        self.assertIn("PoseSmoothing", names)
        trainer.SetBatch(0)
        with self.assertRaisesRegex(RuntimeError, "(?i)batch"):
            bigus.update(trainer)

    def test_stops_when_asked(self):
        trainer = self.trainer()
        trainer.SetIterations(1000000)
        trainer.AddObserver("ProgressEvent", lambda *_: "iteration" in (trainer.GetProgressText() or "")
                            and trainer.SetAbortExecute(1))
        trainer.Update()
        self.assertTrue(trainer.GetAborted())
        self.assertGreater(trainer.GetOutputDataObject(0).GetNumberOfPoints(), 0)


def numbers(data, name):
    return np.array(vtk_to_numpy(data.GetArray(name)))


def phantom(**settings):
    source = bigus.vtkBigusPhantomSource()
    for name, value in {"NumberOfFrames": 20, "FrameSize": (48, 48), **settings}.items():
        getattr(source, "Set" + name)(*(value if isinstance(value, tuple) else (value,)))
    return source


class Phantom(unittest.TestCase):
    def test_truth_at_a_frames_true_pose_is_the_frame(self):
        source = phantom(TrackingNoise=0.5, NumberOfFrames=4)
        source.SetProbeToConvex()
        image = bigus.update(source).GetOutput()
        self.assertEqual((image.GetDimensions(), source.GetProbeAsString()), ((48, 48, 4), "Convex"))
        data = image.GetFieldData()
        true = numbers(data, "TrueImageToReference")
        self.assertGreater(np.abs(true - numbers(data, "ImageToReference")).max(), 0.1)
        self.assertEqual(data.GetArray("Mask").GetNumberOfTuples(), 48 * 48)
        truth = vtkImageData()
        self.assertTrue(source.ComputeTruth(matrix(true[2]), 48, 48, truth))
        np.testing.assert_array_equal(pixels(truth)[0], pixels(image)[2])
        np.testing.assert_allclose(numbers(truth.GetFieldData(), "ImageToReference")[0], true[2], atol=1e-12)

    def test_mistakes_are_named(self):
        with self.assertRaisesRegex(RuntimeError, "(?i)frequency"):
            bigus.update(phantom(Frequency=-1.0))
        source = phantom()
        source.SetScene(7)
        self.assertEqual(source.GetSceneAsString(), "Points")
        self.assertGreater(source.GetScatterersPerResolutionCell(), 10)


class PoseCorrection(unittest.TestCase):
    def correction(self, **settings):
        correction = bigus.vtkBigusPoseCorrection()
        source = phantom(NumberOfFrames=40, TrackingNoise=0.2, TrackingRotationNoise=0.3)
        correction.SetInputConnection(source.GetOutputPort())
        for name, value in settings.items():
            getattr(correction, "Set" + name)(value)
        return correction

    def test_poses_come_closer_to_the_truth(self):
        correction = self.correction(Strength=1)
        image = bigus.update(correction).GetOutput()
        data = image.GetFieldData()
        true, recorded, corrected = (numbers(data, name) for name in
                                     ("TrueImageToReference", "RecordedImageToReference", "ImageToReference"))
        self.assertLess(np.abs(corrected - true)[:, 3::4].mean(), 0.7 * np.abs(recorded - true)[:, 3::4].mean())
        self.assertEqual(correction.GetChosenStrength(), 1)
        self.assertGreater(numbers(data, "PoseDisplacement").mean(), 0.1)
        self.assertEqual(sorted(set(numbers(data, "PoseStroke"))), [0])
        noise = data.GetArray("TrackerNoise")
        self.assertEqual(noise.GetComponentName(2), "Corner")
        self.assertTrue(0.1 < noise.GetComponent(0, 0) < 0.3)
        self.assertEqual(data.GetArray("ConstantErrors").GetComponentName(6), "RotationZ")
        self.assertEqual(data.GetArray("ConstantErrors").GetNumberOfTuples(), 3)
        lines = data.GetAbstractArray("Provenance")
        self.assertTrue(lines.GetValue(lines.GetNumberOfValues() - 1).startswith("sweep.poses=smoothed"))

    def test_none_keeps_every_bit_and_a_stop_leaves_nothing(self):
        correction = self.correction(Strength=0)
        data = bigus.update(correction).GetOutput().GetFieldData()
        np.testing.assert_array_equal(numbers(data, "ImageToReference"), numbers(data, "RecordedImageToReference"))
        stopped = self.correction()
        stopped.AddObserver("ProgressEvent", lambda *_: stopped.SetAbortExecute(1))
        stopped.Update()
        self.assertEqual(stopped.GetOutput().GetNumberOfPoints(), 0)

    def test_the_field_keeps_what_was_done(self):
        correction = self.correction(Strength=1)
        trainer = bigus.vtkBigusTrainer()
        trainer.SetInputConnection(correction.GetOutputPort())
        trainer.AutomaticOff()
        trainer.SetGaussians(100)
        trainer.SetIterations(1)
        lines = bigus.update(trainer).GetOutput().GetFieldData().GetAbstractArray("Provenance")
        self.assertIn("sweep.poses=", "\n".join(lines.GetValue(k) for k in range(lines.GetNumberOfValues())))


class SweepInspection(unittest.TestCase):
    def test_tells_what_training_leaves_out_by_the_images_numbers(self):
        stack = sweep()
        self.assertEqual(bigus.update(self.inspection(stack)).GetFindings().GetNumberOfRows(), 0)
        vtk_to_numpy(stack.GetPointData().GetScalars()).reshape(9, -1)[4] = 0
        add(stack.GetFieldData(), "Status", [1, 0, 1, 1, 1, 1, 1, 1, 1], np.uint8)
        inspection = bigus.update(self.inspection(stack))
        table = inspection.GetFindings()
        self.assertEqual([table.GetColumnName(k) for k in range(5)], ["Kind", "Frames", "Pixels", "Applied", "Text"])
        self.assertEqual([table.GetValueByName(0, name).ToString() for name in ("Kind", "Frames", "Pixels", "Applied")],
                         ["contact", "1", "0", "1"])
        self.assertIn("1 frame (4)", table.GetValueByName(0, "Text").ToString())
        self.assertEqual(list(numbers(inspection.GetOutputDataObject(0).GetFieldData(), "Finding")), [0, 0, 0, 0, 2, 0, 0, 0, 0])
        inspection.SetKeep("all")
        self.assertEqual(bigus.update(inspection).GetFindings().GetValueByName(0, "Applied").ToInt(), 0)
        inspection.SetKeep("dust")
        with self.assertRaisesRegex(RuntimeError, "'dust'"):
            bigus.update(inspection)

    def inspection(self, stack):
        inspection = bigus.vtkBigusSweepInspection()
        inspection.SetInputDataObject(stack)
        return inspection


class SweepOutline(unittest.TestCase):
    def test_lines_pass_through_the_corners_of_usable_frames(self):
        stack = sweep()
        add(stack.GetFieldData(), "Status", [1, 1, 0, 1, 1, 1, 1, 1, 1], np.uint8)
        outline = bigus.vtkBigusSweepOutline()
        outline.SetInputDataObject(0, stack)
        outline.SetFrameStride(3)
        lines = bigus.update(outline).GetOutputDataObject(0)
        usable, poses = [0, 1, 3, 4, 5, 6, 7, 8], numbers(stack.GetFieldData(), "ImageToReference").reshape(-1, 4, 4)
        chosen = [0, 4, 7, 8]  # every third usable frame, and the last
        np.testing.assert_array_equal(numbers(lines.GetCellData(), "Frame"), chosen)
        np.testing.assert_allclose(numbers(lines.GetCellData(), "Timestamp"), np.array(chosen) / 25)
        for n, frame in enumerate(chosen):
            cell = lines.GetCell(n)
            for c, (i, j) in enumerate([(0, 0), (23, 0), (23, 23), (0, 23), (0, 0)]):
                np.testing.assert_allclose(lines.GetPoint(cell.GetPointId(c)), (poses[frame] @ (i, j, 0, 1))[:3], atol=1e-9)
        path = outline.GetPathOutput()
        self.assertEqual((path.GetNumberOfLines(), path.GetNumberOfPoints()), (1, len(usable)))
        for n, frame in enumerate(usable):
            np.testing.assert_allclose(path.GetPoint(n), (poses[frame] @ (11.5, 0, 0, 1))[:3], atol=1e-9)
        outline.GeneratePixelsOn()
        grid = bigus.update(outline).GetPixelsOutput()
        self.assertEqual(tuple(grid.GetExtent()), (0, 23, 0, 23, 0, 3))
        pixels = vtk_to_numpy(stack.GetPointData().GetScalars()).reshape(9, -1)
        np.testing.assert_array_equal(numbers(grid.GetPointData(), "Recorded"), pixels[chosen].ravel())
        np.testing.assert_allclose(grid.GetPoint(576 + 24 * 5 + 3), (poses[4] @ (3, 5, 0, 1))[:3], atol=1e-5)


class Metrics(unittest.TestCase):
    def stacks(self):
        rng = np.random.default_rng(5)
        truth = rng.integers(0, 256, size=(3, 40, 40)).astype(np.uint8)
        images = [truth, np.clip(truth + rng.normal(scale=9, size=truth.shape), 0, 255).astype(np.uint8)]
        stacks = []
        for values in images:
            stack = vtkImageData()
            stack.SetDimensions(40, 40, 3)
            stack.GetPointData().SetScalars(numpy_to_vtk(values.ravel(), deep=True))
            stacks.append(stack)
        return stacks, images

    def test_psnr_is_what_numpy_says_and_equal_images_are_equal(self):
        (truth, image), values = self.stacks()
        metrics = bigus.vtkBigusImageMetrics()
        metrics.SetInputDataObject(0, image)
        metrics.SetTruthData(truth)
        table = bigus.update(metrics).GetOutputDataObject(0)
        mse = (((values[1].astype(float) - values[0]) / 255) ** 2).mean(axis=(1, 2))
        found = vtk_to_numpy(table.GetColumnByName("PSNR"))
        np.testing.assert_allclose(found, -10 * np.log10(mse), atol=1e-4)
        self.assertAlmostEqual(metrics.GetPSNR(), found.mean(), 9)
        self.assertAlmostEqual(metrics.GetPSNRStandardDeviation(), found.std(), 9)
        self.assertEqual(table.GetColumnByName("ImageSpectrum").GetNumberOfComponents(), 16)
        self.assertAlmostEqual(metrics.GetContrastRatio(), vtk_to_numpy(table.GetColumnByName("ContrastRatio")).mean(), 9)
        metrics.SetInputDataObject(0, truth)
        bigus.update(metrics)
        self.assertEqual((metrics.GetPSNR(), metrics.GetSSIM(), metrics.GetPSNRStandardDeviation()), (np.inf, 1, 0))

    def test_mistakes_are_named(self):
        (truth, _), _ = self.stacks()
        metrics = bigus.vtkBigusImageMetrics()
        metrics.SetInputDataObject(0, sweep())
        metrics.SetTruthData(truth)
        with self.assertRaisesRegex(RuntimeError, "24 x 24 x 9 pixels, the truth 40 x 40 x 3"):
            bigus.update(metrics)


class TransformField(unittest.TestCase):
    def test_a_slice_of_the_moved_field_shows_what_the_slice_showed(self):
        transform = vtkTransform()
        transform.Translate(5, -2, 1)
        transform.RotateWXYZ(40, 1, 2, 3)
        transform.Scale(2, 2, 2)
        filter = bigus.vtkBigusTransformField()
        filter.SetInputDataObject(0, field((1.5, -1.0), ((1, 0.2, 0, 0), (0.5, 0, 0.3, 1))))
        filter.SetTransform(transform)
        moved = bigus.update(filter).GetOutputDataObject(0)
        pose = matrix([[0.2, 0, 0, 0.5], [0, 0.2, 0, 0.5], [0, 0, 1, 1.2], [0, 0, 0, 1]])
        both = vtkMatrix4x4()
        vtkMatrix4x4.Multiply4x4(transform.GetMatrix(), pose, both)
        images = []
        for data, axes in ((filter.GetInputDataObject(0, 0), pose), (moved, both)):
            reslice = bigus.vtkBigusReslice()
            reslice.SetInputDataObject(data)
            reslice.SetOutputToFrame(axes, 32, 32)
            images.append(pixels(bigus.update(reslice).GetOutputDataObject(0)))
        self.assertGreater(images[0].max(), 0.3)
        np.testing.assert_allclose(images[1], images[0], atol=2e-4)
        lines = moved.GetFieldData().GetAbstractArray("Provenance")
        self.assertTrue(lines.GetValue(0).startswith("transform="))
        place = np.array(moved.GetPoint(0))
        transform.PostMultiply()
        transform.Translate(1, 0, 0)  # a change to it is seen
        again = bigus.update(filter).GetOutputDataObject(0)
        np.testing.assert_allclose(again.GetPoint(0), place + (1, 0, 0), atol=1e-9)

    def test_what_bends_or_stretches_unevenly_is_refused(self):
        filter = bigus.vtkBigusTransformField()
        filter.SetInputDataObject(0, field())
        uneven = vtkTransform()
        uneven.Scale(1, 2, 1)
        for transform in (uneven, vtkThinPlateSplineTransform()):
            filter.SetTransform(transform)
            with self.assertRaises(RuntimeError):
                bigus.update(filter)


class FieldTensors(unittest.TestCase):
    def test_eigenvalues_are_scales_and_axes_are_turned(self):
        half = np.sqrt(0.5)  # the first is turned by 90 degrees about z, so x and y change places
        data = field(rotations=((half, 0, 0, half), (1, 0, 0, 0)))
        scales = numpy_to_vtk(np.array([[1.0, 2.0, 3.0], [0.8, 0.6, 0.9]]), deep=True)
        scales.SetName("Scale")
        data.GetPointData().AddArray(scales)
        filter = bigus.vtkBigusFieldTensors()
        filter.SetInputDataObject(0, data)
        found = numbers(bigus.update(filter).GetOutputDataObject(0).GetPointData(), "StandardDeviation").reshape(-1, 3, 3)
        np.testing.assert_allclose(found, [np.diag([2.0, 1.0, 3.0]), np.diag([0.8, 0.6, 0.9])], atol=1e-12)
        filter.SetTensorToCovariance()
        squared = bigus.update(filter).GetOutputDataObject(0).GetPointData().GetTensors()
        self.assertEqual(squared.GetName(), "Covariance")
        np.testing.assert_allclose(vtk_to_numpy(squared).reshape(-1, 3, 3)[0], np.diag([4.0, 1.0, 9.0]), atol=1e-12)


def matrix_of(axes):
    return np.array([[axes.GetElement(i, j) for j in range(4)] for i in range(4)])


def scenes():
    """Images and their grids, for random properties."""
    rng = np.random.default_rng(3)
    found = {}
    for number in range(25):
        turn = vtkTransform()
        turn.RotateWXYZ(rng.uniform(0, 90), *rng.normal(size=3))
        axes = vtkMatrix4x4()
        axes.DeepCopy(turn.GetMatrix())
        for row in range(3):
            axes.SetElement(row, 3, rng.uniform(1, 3))
        filter = bigus.vtkBigusReslice()
        filter.SetInputDataObject(field((1.5, rng.uniform(-1, 2)), rng.normal(size=(2, 4))))
        filter.SetResliceAxes(axes)
        filter.SetElevationSigma(float(rng.choice([-1, 0, 0.5])))
        filter.SetOutputDimensionality(int(rng.choice([2, 3])))
        filter.SetAutoCropOutput(int(rng.integers(2)))
        filter.SetTransformInputSampling(int(rng.integers(2)))
        filter.SetOutputSpacing(*rng.uniform(0.3, 0.6, size=3))
        filter.SetSlabNumberOfSlices(int(rng.choice([1, 3])))
        filter.SetSlabTrapezoidIntegration(int(rng.integers(2)))
        filter.SetSlabMode(int(rng.integers(4)))
        filter.SetBackgroundLevel(float(rng.choice([0, 0.25])))
        filter.SetCoverageThreshold(float(rng.choice([0, 0.03])))
        filter.SetOutputScalarType(int(rng.choice([3, 10])))
        bigus.update(filter)
        voxels = bigus.vtkBigusVoxelizer()
        voxels.SetInputDataObject(filter.GetInputDataObject(0, 0))
        voxels.SetOutputDirection(matrix_of(turn.GetMatrix())[:3, :3].ravel())
        voxels.SetMaximumDimension(int(rng.integers(10, 30)))
        if rng.integers(2):
            voxels.SetOutputDimensions(*(int(n) for n in rng.integers(4, 20, size=3)))
        if rng.integers(2):
            voxels.SetOutputSpacing(*rng.uniform(0.3, 0.6, size=3))
        bigus.update(voxels)
        images = {"slice": filter.GetOutputDataObject(0), "coverage": filter.GetCoverageOutput(), "voxels": voxels.GetOutputDataObject(0)}
        for name, image in images.items():
            found[f"{name} {number}"] = pixels(image)
            found[f"grid of {name} {number}"] = np.array([*image.GetExtent(), *image.GetSpacing(), *image.GetOrigin()])
    sure = sure_field()
    found["error of voxels"] = pixels(bigus.update(sure_voxels(sure)).GetStandardErrorOutput())
    filter = slicer(extent=(0, 30, 0, 20, 0, 1), GenerateStandardErrorOutput=True)
    filter.SetInputDataObject(sure)
    shown = slicer(tilted(), extent=(0, 35, 0, 27, 0, 1), GenerateLabelOutput=True, OutputDimensionality=3)
    shown.SetInputDataObject(labelled_field())
    found["labels"] = pixels(bigus.update(shown).GetLabelOutput())
    found["error of slices"] = pixels(bigus.update(filter).GetStandardErrorOutput())
    found["error of a mean of slices"] = np.array([filter.GetStandardErrorOfMean()])
    filter = bigus.update(sure_slice(sure))
    chosen = byte_image(np.tri(16, 20))
    found["errors of means"] = np.array([filter.GetStandardErrorOfMean(), filter.GetStandardErrorOfMean(chosen)])
    correction = bigus.vtkBigusPoseCorrection()
    source = phantom(TrackingNoise=0.2, TrackingRotationNoise=0.3, Seed=3)
    correction.SetInputConnection(source.GetOutputPort())
    correction.SetStrength(1)
    corrected = bigus.update(correction).GetOutputDataObject(0)
    found["phantom"] = pixels(corrected)
    data = corrected.GetFieldData()
    for name in ("ImageToReference", "PoseDisplacement", "PoseRotation", "PoseOutlier", "PoseStroke", "TrackerNoise"):
        found["same numbers: " + name] = numbers(data, name).astype(float)
    metrics = bigus.vtkBigusImageMetrics()
    metrics.SetInputDataObject(0, corrected)
    turned = vtkImageData()
    turned.DeepCopy(corrected)
    turned.GetPointData().SetScalars(numpy_to_vtk(pixels(corrected)[::-1].ravel(), deep=True))
    metrics.SetTruthData(turned)
    table = bigus.update(metrics).GetOutputDataObject(0)
    for k in range(table.GetNumberOfColumns()):
        found["same numbers: " + table.GetColumnName(k)] = np.array(vtk_to_numpy(table.GetColumn(k)), dtype=float)
    return found


@unittest.skipUnless(os.environ.get("BIGUS_OTHER_PACKAGE"), "BIGUS_OTHER_PACKAGE does not name the other package")
class BothPackages(unittest.TestCase):
    def test_give_the_same_images_on_the_same_grids(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scenes.npz")
            environment = {**os.environ, "PYTHONPATH": os.environ["BIGUS_OTHER_PACKAGE"]}
            subprocess.run([os.environ["BIGUS_OTHER_PYTHON"], __file__, "--scenes", path], check=True, env=environment)
            theirs = np.load(path)
            ours = scenes()
            self.assertEqual(sorted(ours), sorted(theirs.files))
            for name, values in ours.items():
                if name in ("phantom", "labels") or name.startswith("error"):
                    np.testing.assert_array_equal(values, theirs[name])
                    continue
                atol = 1e-9 if name.startswith(("grid", "same numbers")) else 1 if values.dtype == np.uint8 else 2e-4 if "coverage" in name else 3e-5
                np.testing.assert_allclose(values.astype(float), theirs[name].astype(float), atol=atol, err_msg=name)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--scenes"]:
        np.savez(sys.argv[2], **scenes())
    else:
        unittest.main(verbosity=2)
