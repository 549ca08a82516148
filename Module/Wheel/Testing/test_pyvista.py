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

CAN_DRAW = os.environ.get("DISPLAY") or pyvista.vtk_version_info >= (9, 4)  # which needs no X server
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

    def test_a_normal_and_an_origin_make_a_plane(self):
        mesh = bigus.pyvista.mesh(blobs())
        for normal, along in (("z", (0, 0, 1)), ("-x", (-1, 0, 0)), ("y", (0, 1, 0)), ((1, 2, 2), (1 / 3, 2 / 3, 2 / 3))):
            image = mesh.bigus.slice(normal, origin=(4, 3, 1.2), spacing=0.1, Tolerance=1e-6)
            places = image.points - (4, 3, 1.2)
            np.testing.assert_allclose(places @ along, 0, atol=1e-5, err_msg=str(normal))
            model = sum(r * np.exp(-0.5 * (((image.points - c) / s) ** 2).sum(-1))
                        for r, c, s in zip((1.5, 2.0), CENTERS, SCALES))
            np.testing.assert_allclose(image["Intensity"], 1 - np.exp(-0.7 * model), atol=3e-5)
            np.testing.assert_allclose(image.spacing[:2], 0.1)
            shadow, field = places @ np.linalg.svd([along])[2][1:].T, (CENTERS - (4, 3, 1.2)) @ np.linalg.svd([along])[2][1:].T
            self.assertLess(np.abs(shadow[:, None] - field).max(axis=2).min(axis=0).max(), 0.1)  # it holds the whole field
        across = mesh.bigus.slice(normal="z")
        self.assertEqual(max(across.dimensions), 512)
        np.testing.assert_allclose(across.center, mesh.center, atol=1e-6)
        self.assertEqual(mesh.bigus.slice("x", size=(40, 30)).dimensions, (40, 30, 1))
        for wrong, text in (({"normal": "q"}, "x, y, z"), ({"normal": (0, 0, 0)}, "finite and not 0"),
                            ({"normal": "x", "origin": 3}, "origin is three numbers"),
                            ({"normal": tilted(), "origin": (0, 0, 0)}, "origin of its own")):
            with self.assertRaisesRegex(ValueError, text):
                mesh.bigus.slice(**wrong)

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

    def picture(self, plotter):
        picture = plotter.screenshot(os.environ.get("BIGUS_PICTURE"), return_img=True).astype(float)
        plotter.close()
        self.assertEqual(picture.shape[:2], (180, 240))
        return picture

    @unittest.skipUnless(CAN_DRAW, "nothing can be drawn here")
    def test_a_slice_is_drawn_face_on(self):
        mesh, plane = bigus.pyvista.mesh(blobs()), tilted()
        plotter = mesh.bigus.plot_slice(plane, (40, 32), plotter=pyvista.Plotter(off_screen=True, window_size=(240, 180)))
        looks = np.array(plotter.camera.focal_point) - plotter.camera.position
        np.testing.assert_allclose(looks / np.linalg.norm(looks), plane[:3, 2], atol=1e-6)
        self.assertTrue(plotter.camera.parallel_projection)
        # The middle of the picture shows the slice: its columns to the right, its rows down.
        grey = self.picture(plotter)[..., 0]
        image = 255 * bigus.reslice(blobs(), plane, (40, 32))
        pixel = 2 * plotter.camera.parallel_scale / 180  # mm
        row, column = np.unravel_index(image.argmax(), image.shape)
        across, down = (column - 19.5) * 0.2 / pixel, (row - 15.5) * 0.25 / pixel
        found = grey[int(89.5 + down) - 1:int(89.5 + down) + 3, int(119.5 + across) - 1:int(119.5 + across) + 3]
        self.assertAlmostEqual(found.mean(), image.max(), delta=8)

    @unittest.skipUnless(CAN_DRAW, "nothing can be drawn here")
    def test_a_widget_moves_the_slice(self):
        plotter = pyvista.Plotter(off_screen=True, window_size=(240, 180))
        widget = bigus.pyvista.mesh(blobs()).bigus.add_slice_widget(plotter, "z")
        before = plotter.actors["bigus slice"].bounds
        widget.SetOrigin(4, 3, 1.4)
        widget.InvokeEvent("EndInteractionEvent")
        after = plotter.actors["bigus slice"].bounds
        np.testing.assert_allclose((before[4], after[4]), (1.25, 1.4), atol=1e-3)
        self.picture(plotter)


if __name__ == "__main__":
    unittest.main(verbosity=2)
