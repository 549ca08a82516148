# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""vtkBigusPartitionField in both packages: VTK's wrapped C++ class, or pure Python over the wheel."""

import sys
import unittest

try:
    import vtkmodules  # noqa: F401
except ImportError:
    print("skipped: there is no package vtk")
    sys.exit(77)

import bigus
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkPolyData

GAMMA = 0.7


def add(attributes, name, values, dtype=np.float64):
    array = numpy_to_vtk(np.ascontiguousarray(values, dtype=dtype), deep=True)
    array.SetName(name)
    attributes.AddArray(array)


def many(count):
    """A field of `count` Gaussians in a row, whose reflectivities are their numbers."""
    numbered = np.arange(count)
    data, points = vtkPolyData(), vtkPoints()
    points.SetData(numpy_to_vtk(np.stack([numbered, 0 * numbered, 0 * numbered], 1).astype(float), deep=True))
    data.SetPoints(points)
    add(data.GetPointData(), "Scale", np.ones((count, 3)))
    add(data.GetPointData(), "Rotation", np.tile([1, 0, 0, 0], (count, 1)))
    add(data.GetPointData(), "Reflectivity", numbered)
    for name, value in (("Gamma", GAMMA), ("ElevationSigma", 0.0)):
        add(data.GetFieldData(), name, [value])
    return data


def numbers(attributes, name):
    return vtk_to_numpy(attributes.GetArray(name))


class PartitionField(unittest.TestCase):
    def parts(self, data, **settings):
        for piece in range(settings["NumberOfPieces"]):
            filter = bigus.vtkBigusPartitionField()
            filter.SetInputDataObject(0, data)
            for name, value in {**settings, "Piece": piece}.items():
                getattr(filter, "Set" + name)(value)
            yield bigus.update(filter).GetOutputDataObject(0)

    def test_every_gaussian_is_in_one_part_and_blocks_are_dealt_in_turn(self):
        parts = list(self.parts(many(1000), NumberOfChunks=4, NumberOfPieces=3))
        numbered = [numbers(part.GetPointData(), "Reflectivity").astype(int) for part in parts]
        # Blocks of 256: the chunks hold 0-255, 256-511, 512-767 and 768-999, of which the last piece has two.
        for found, first, last in zip(numbered, (0, 256, 512), (256, 512, 1000)):
            np.testing.assert_array_equal(found, np.arange(first, last))
        self.assertEqual([numbers(part.GetFieldData(), "Chunks").tolist() for part in parts],
                         [[4, 0, 256], [4, 1, 256], [4, 2, 256, 232]])
        self.assertEqual(numbers(parts[0].GetFieldData(), "Gamma"), [GAMMA])

    def test_mistakes_are_named(self):
        for settings, named in (({"NumberOfChunks": 6}, "power of two"), ({"Piece": 1}, "Piece is 1"),
                                ({"NumberOfPieces": 0}, "NumberOfPieces 0")):
            filter = bigus.vtkBigusPartitionField()
            filter.SetInputDataObject(0, many(2))
            for name, value in settings.items():
                getattr(filter, "Set" + name)(value)
            with self.assertRaisesRegex(RuntimeError, named):
                bigus.update(filter)


if __name__ == "__main__":
    unittest.main(verbosity=2)
