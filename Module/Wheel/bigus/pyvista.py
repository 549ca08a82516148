# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""For PyVista: importing this gives meshes an accessor `bigus` that slices and plots fields and trains on sweeps.

    import bigus.pyvista
    import pyvista

    field = bigus.pyvista.mesh(bigus.read("field.vtp"))        # pyvista.PolyData; so is pyvista.wrap of a filter's output
    field.bigus.slice(plane, size=(640, 480)).plot()
    field.bigus.plot_slice(plane, size=(640, 480))             # the slice where it lies, with the field's centers
"""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np
import pyvista

from ._core import Field, Sweep
from .filters import vtkBigusVoxelizer
from .pipeline import update
from .common import pixel_matrix, size_of_view
from .tasks import Slicer, train
from .vtkdata import field_of_polydata, image_of_sweep, polydata_of_field, sweep_of_image

Spacing = Union[None, float, tuple]


def mesh(data: Union[Field, Sweep]) -> Any:
    """A field as pyvista.PolyData, or a sweep as an image stack with its poses in field data; both are copies."""
    if isinstance(data, Field):
        return pyvista.wrap(polydata_of_field(data))
    if isinstance(data, Sweep):
        return pyvista.wrap(image_of_sweep(data))
    raise TypeError(f"mesh takes a bigus.Field or a bigus.Sweep, not {type(data).__name__}")


def image_at(plane: np.ndarray, pixels: np.ndarray, name: str = "Intensity") -> Any:
    """pixels [height, width] as pyvista.ImageData where they lie: (i, j) at plane @ (i, j, 0, 1), mm."""
    matrix = pixel_matrix(plane, None)
    sides = np.append(np.linalg.norm(matrix[:3, :2], axis=0), 1.0)
    image = pyvista.ImageData()
    image.dimensions = (pixels.shape[1], pixels.shape[0], 1)
    image.spacing = tuple(sides)
    image.origin = tuple(matrix[:3, 3])
    image.SetDirectionMatrix((matrix[:3, :3] / sides).ravel())
    image.point_data[name] = np.asarray(pixels).ravel()
    return image


class FieldAccessor:
    """Slices of a field."""

    def __init__(self, mesh: Any):
        self._mesh = mesh

    @property
    def field(self) -> Field:
        """The field, a copy. Raises bigus.Error where the mesh is no field."""
        return field_of_polydata(self._mesh)

    def slice(self, plane: np.ndarray, size: Optional[tuple] = None, spacing: Spacing = None, **properties: Any) -> Any:
        """The image at a plane, as pyvista.ImageData with Intensity and Coverage, placed where it lies.

        plane, size, spacing and properties are those of bigus.reslice.
        """
        field = self.field
        matrix = pixel_matrix(plane, spacing)
        size = size if size is not None else size_of_view(field.centers, matrix)
        pixels, coverage = Slicer(field, **properties).slice_and_coverage(matrix, size)
        image = image_at(matrix, pixels)
        image.point_data["Coverage"] = coverage.ravel()
        image.set_active_scalars("Intensity")
        return image

    def voxelize(self, spacing: Spacing = None, dimension: int = 256) -> Any:
        """A volume over the whole field: voxels of spacing (mm), or `dimension` of them along the longest side."""
        filter = vtkBigusVoxelizer()
        filter.SetInputDataObject(self._mesh)
        filter.SetMaximumDimension(dimension)
        if spacing is not None:
            filter.SetOutputSpacing(*np.broadcast_to(spacing, 3).tolist())
        return pyvista.wrap(update(filter).GetOutput())

    def plot_slice(self, plane: np.ndarray, size: Optional[tuple] = None, spacing: Spacing = None, centers: bool = True,
                   plotter: Any = None, **properties: Any) -> Any:
        """Draws the slice where it lies, with the field's centers around it; returns the plotter.

        Without `plotter` a new one is made; call show() or screenshot() on what comes back.
        """
        image = self.slice(plane, size, spacing, **properties)
        width, height, _ = image.dimensions
        j, i = np.mgrid[:height, :width]
        index = np.stack([i, j, np.zeros_like(i), np.ones_like(i)], -1)
        points = (index @ pixel_matrix(plane, spacing).T)[..., :3]
        surface = pyvista.StructuredGrid(*(points[:, :, None, axis] for axis in range(3)))
        surface.point_data["Intensity"] = np.asarray(image.point_data["Intensity"]).reshape(height, width).ravel(order="F")
        plotter = plotter if plotter is not None else pyvista.Plotter()
        plotter.add_mesh(surface, scalars="Intensity", cmap="gray", clim=(0, 1), lighting=False, show_scalar_bar=False)
        if centers:
            plotter.add_mesh(pyvista.PolyData(np.array(self.field.centers)), color="tan", point_size=2, opacity=0.3)
        return plotter


class SweepAccessor:
    """A sweep: an image stack with the field data of vtkBigusSequenceReader."""

    def __init__(self, mesh: Any):
        self._mesh = mesh

    @property
    def sweep(self) -> Sweep:
        """The sweep; frames with Status 0 are left out. Raises bigus.Error where the image is none."""
        return sweep_of_image(self._mesh)[0]

    def frame(self, number: int) -> Any:
        """A frame as pyvista.ImageData, placed where it lies."""
        sweep = self.sweep
        return image_at(sweep.poses[number], sweep.frames[number])

    def train(self, **options: Any) -> Any:
        """The field that bigus.train makes of the sweep, as pyvista.PolyData."""
        return mesh(train(self.sweep, **options).field)


class _Accessor:
    """Gives every mesh of a class its accessor, where PyVista itself has no way to register one."""

    def __init__(self, kind: type):
        self._kind = kind

    def __get__(self, instance: Any, owner: type) -> Any:
        return self._kind if instance is None else self._kind(instance)


for _mesh, _kind in ((pyvista.PolyData, FieldAccessor), (pyvista.ImageData, SweepAccessor)):
    if hasattr(pyvista, "register_dataset_accessor"):
        pyvista.register_dataset_accessor("bigus", _mesh)(_kind)
    else:
        _mesh.bigus = _Accessor(_kind)
