# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The accessor `bigus` of PyVista's meshes. Skipped where PyVista is not installed."""

import os
import sys
import unittest

try:
    import pyvista
except ImportError:
    print("skipped: there is no package pyvista")
    sys.exit(77)

import bigus
import bigus.pyvista
import numpy as np

CENTERS, SCALES = np.array([(3, 2, 1), (5, 4, 1.5)]), np.array([(1, 1, 1), (0.8, 0.6, 0.9)])


def blobs():
    return bigus.field(CENTERS, SCALES, [1.5, 2.0], gamma=0.7)


def tilted():
    return bigus.plane((0, 0.5, 0.5), [(np.cos(0.4), 0, np.sin(0.4)), (0, 1, 0)], (0.2, 0.25))


class Meshes(unittest.TestCase):
    def test_a_field_goes_there_and_back(self):
        mesh = bigus.pyvista.mesh(blobs())
        self.assertIsInstance(mesh, pyvista.PolyData)
        again = mesh.bigus.field
        np.testing.assert_array_equal(again.centers, CENTERS)
        np.testing.assert_array_equal(again.scales, SCALES)
        self.assertEqual(again.gamma, 0.7)
        with self.assertRaisesRegex(bigus.Error, "the array"):
            pyvista.Sphere().bigus.field

    def test_a_slice_lies_where_its_plane_is(self):
        image = bigus.pyvista.mesh(blobs()).bigus.slice(tilted(), (30, 24), Tolerance=1e-6)
        j, i = np.mgrid[:24, :30]
        places = (np.stack([i, j, 0 * i, 0 * i + 1], -1) @ tilted().T)[..., :3].reshape(-1, 3)
        np.testing.assert_allclose(image.points, places, atol=1e-5)
        model = sum(r * np.exp(-0.5 * (((places - c) / s) ** 2).sum(-1)) for r, c, s in zip((1.5, 2.0), CENTERS, SCALES))
        np.testing.assert_allclose(image["Intensity"], 1 - np.exp(-0.7 * model), atol=2e-5)
        self.assertEqual(image.active_scalars_name, "Intensity")
        self.assertGreater(image["Coverage"].max(), 0.5)

    def test_the_output_of_a_filter_is_wrapped(self):
        filter = bigus.vtkBigusVoxelizer()
        filter.SetInputDataObject(bigus.pyvista.mesh(blobs()))
        filter.SetMaximumDimension(20)
        image = pyvista.wrap(bigus.update(filter).GetOutput())
        self.assertEqual(max(image.dimensions), 20)
        volume = bigus.pyvista.mesh(blobs()).bigus.voxelize(dimension=20)
        np.testing.assert_array_equal(image.point_data["Intensity"], volume.point_data["Intensity"])
        self.assertAlmostEqual(bigus.pyvista.mesh(blobs()).bigus.voxelize(0.5).spacing[1], 0.5)

    def test_a_sweep_trains(self):
        sweep = bigus.Phantom(frames=12, width=32, height=32, pixel_size=0.8).sweep()
        stack = bigus.pyvista.mesh(sweep)
        np.testing.assert_array_equal(stack.bigus.sweep.frames, sweep.frames)
        frame = stack.bigus.frame(3)
        np.testing.assert_allclose(frame.points[0], sweep.poses[3][:3, 3], atol=1e-5)
        field = stack.bigus.train(Automatic=False, Iterations=5, Gaussians=200, progress=False)
        self.assertGreater(len(field.bigus.field), 100)

    @unittest.skipUnless(os.environ.get("DISPLAY"), "DISPLAY is not set")
    def test_a_slice_is_drawn(self):
        plotter = pyvista.Plotter(off_screen=True, window_size=(240, 180))
        bigus.pyvista.mesh(blobs()).bigus.plot_slice(tilted(), (40, 32), plotter=plotter)
        picture = plotter.screenshot(os.environ.get("BIGUS_PICTURE"), return_img=True).astype(float)
        self.assertEqual(picture.shape[:2], (180, 240))
        self.assertGreater(picture.std(), 10)
        plotter.close()


if __name__ == "__main__":
    unittest.main(verbosity=2)
