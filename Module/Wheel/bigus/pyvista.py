# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""For PyVista: importing this gives meshes an accessor `bigus` that slices and plots fields and trains on sweeps.

    import bigus.pyvista
    import pyvista

    field = bigus.pyvista.mesh(bigus.read_field("field.vtp"))  # pyvista.PolyData; so is pyvista.wrap of a filter's output
    image = field.bigus.slice(normal="z")                      # pyvista.ImageData where it lies
    field.bigus.plot_slice(normal="z").show()                  # seen face on, with a scale in mm
    plotter = pyvista.Plotter()
    field.bigus.add_slice_widget(plotter)                      # a plane to be moved by the mouse
    plotter.show()
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional, Sequence, Union

import numpy as np
import pyvista

from ._core import Field, Sweep
from .common import checked_size, pixel_matrix, size_of_view
from .filters import vtkBigusVoxelizer
from .functions import train
from .pipeline import update
from .tasks import Slicer
from .vtkdata import axes_across, field_of_polydata, image_of, image_of_sweep, place_image, plane_on, polydata_of_field
from .vtkdata import shadow, sweep_of_image

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Unpack

    from ._options import SlicerOptions, TrainOptions

    Plane = Union[str, ArrayLike]
    Spacing = Union[None, float, Sequence[float]]


def mesh(data: Union[Field, Sweep]) -> Any:
    """A field as pyvista.PolyData, or a sweep as an image stack with its poses in field data; both are copies."""
    if isinstance(data, Field):
        return pyvista.wrap(polydata_of_field(data))
    if isinstance(data, Sweep):
        return pyvista.wrap(image_of_sweep(data))
    raise TypeError(f"mesh takes a bigus.Field or a bigus.Sweep, not {type(data).__name__}")


def image_at(plane: np.ndarray, pixels: np.ndarray, name: str = "Intensity") -> Any:
    """pixels [height, width] as pyvista.ImageData where they lie: (i, j) at plane @ (i, j, 0, 1), mm."""
    image = image_of(np.asarray(pixels)[None], name)
    place_image(image, pixel_matrix(plane, None))
    return pyvista.wrap(image)


class FieldAccessor:
    """Slices of a field. A plane is given by a normal ("x", "-y", "z" or a vector) and an origin, or by a 4 x 4 matrix.

    With a normal the slice goes through origin, mm (the middle of the field), and holds the whole field. Its rows go along
    y, or along z where y is the normal. spacing, mm a pixel, and size, (width, height), follow from each other; by default
    the longer side has 512 pixels. With a matrix, from pixel (i, j, 0, 1) to mm, both are as for bigus.reslice.
    """

    def __init__(self, mesh: Any):
        self._mesh = mesh

    @property
    def field(self) -> Field:
        """The field, a copy. Raises bigus.Error where the mesh is no field."""
        return field_of_polydata(self._mesh)

    def _plane(self, normal: Plane, origin: Optional[Sequence[float]], size: Optional[Sequence[int]],
               spacing: Spacing) -> tuple[np.ndarray, Sequence[int]]:
        if np.ndim(normal) == 2:
            if origin is not None:
                raise ValueError("a matrix has an origin of its own; give origin with a normal")
            matrix = pixel_matrix(normal, spacing)
            return matrix, size if size is not None else size_of_view(np.asarray(self._mesh.points), matrix)
        axes = axes_across(NORMALS[normal] if isinstance(normal, str) and normal in NORMALS else _numbers(normal, "normal"))
        if axes is None:
            raise ValueError(f"normal is x, y, z, -x, -y, -z or a vector that is finite and not 0, not {normal!r}")
        place = np.array(self._mesh.center) if origin is None else _numbers(origin, "origin")
        low, high = shadow(self._mesh.bounds, axes, place)
        pixel = spacing if spacing is not None else float(((high - low) / (np.subtract(size, 1) if size else 511)).max()) or 1.0
        if np.ndim(pixel):
            raise ValueError("with a normal, spacing is one number")
        across = checked_size(size if size is not None else np.ceil((high - low) / pixel) + 1)
        return plane_on(axes, place, 0.5 * (low + high), np.array(across), pixel), across

    def slice(self, normal: Plane = "z", size: Optional[Sequence[int]] = None, spacing: Spacing = None,
              origin: Optional[Sequence[float]] = None, **properties: Unpack[SlicerOptions]) -> Any:
        """The image at a plane, as pyvista.ImageData with Intensity and Coverage, placed where it lies.

        properties are those of bigus.reslice.
        """
        matrix, size = self._plane(normal, origin, size, spacing)
        pixels, coverage = Slicer(self.field, **properties).slice_and_coverage(matrix, size)
        image = image_at(matrix, pixels)
        image.point_data["Coverage"] = coverage.ravel()
        image.set_active_scalars("Intensity")
        return image

    def voxelize(self, spacing: Spacing = None, dimension: int = 256) -> Any:
        """A volume over the whole field: voxels of spacing (mm), or `dimension` of them along the longest side."""
        filter = vtkBigusVoxelizer(maximum_dimension=dimension)
        filter.SetInputDataObject(self._mesh)
        if spacing is not None:
            filter.output_spacing = np.broadcast_to(spacing, 3).tolist()
        return pyvista.wrap(update(filter).GetOutput())

    def plot_slice(self, normal: Plane = "z", size: Optional[Sequence[int]] = None, spacing: Spacing = None,
                   origin: Optional[Sequence[float]] = None, plotter: Any = None,
                   **properties: Unpack[SlicerOptions]) -> Any:
        """Draws the slice where it lies, seen face on, with a scale in mm; returns the plotter.

        Without `plotter` a new one is made; call show() or screenshot() on what comes back.
        """
        matrix, size = self._plane(normal, origin, size, spacing)
        plotter = plotter if plotter is not None else pyvista.Plotter()
        middle = (matrix @ (*(0.5 * np.subtract(size, 1)), 0, 1))[:3]
        _add(plotter, matrix, Slicer(self.field, **properties).slice(matrix, size))
        # Columns to the right and rows down: the camera looks along the normal, and up is against the rows.
        plotter.camera.focal_point = middle
        plotter.camera.position = middle - matrix[:3, 2] * max(self._mesh.length, 1e-3)
        plotter.camera.up = -matrix[:3, 1]
        plotter.enable_parallel_projection()
        sides = np.linalg.norm(matrix[:3, :2], axis=0) * size
        aspect = plotter.window_size[0] / plotter.window_size[1]
        plotter.camera.parallel_scale = 0.6 * max(sides[1], sides[0] / aspect)
        plotter.reset_camera_clipping_range()
        plotter.add_axes()
        plotter.add_ruler(*((matrix @ (*corner, 0, 1))[:3] for corner in ((0, size[1] - 1), (size[0] - 1, size[1] - 1))), title="mm")
        return plotter

    def add_slice_widget(self, plotter: Any, normal: Plane = "z", **properties: Unpack[SlicerOptions]) -> Any:
        """Adds a plane that the mouse moves and turns, and the slice on it, to a plotter; returns the widget."""
        slicer = Slicer(self.field, **properties)

        def move(direction: Any, place: Any) -> None:
            matrix, size = self._plane(direction, place, None, None)
            _add(plotter, matrix, slicer.slice(matrix, size), name="bigus slice", reset_camera=False)

        matrix, _ = self._plane(normal, None, None, None)
        return plotter.add_plane_widget(move, normal=matrix[:3, 2], origin=self._mesh.center, bounds=self._mesh.bounds)


NORMALS = {sign + axis: (-1.0 if sign else 1.0) * np.eye(3)[k] for sign in ("", "-") for k, axis in enumerate("xyz")}


def _numbers(vector: Any, name: str) -> np.ndarray:
    try:
        return np.asarray(vector, dtype=np.float64).reshape(3)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is three numbers{' or x, y, z, -x, -y, -z' * (name == 'normal')}, not {vector!r}") from None


def _add(plotter: Any, matrix: np.ndarray, pixels: np.ndarray, **options: Any) -> None:
    """Draws pixels where they lie, as grey as they are."""
    surface = image_at(matrix, pixels).cast_to_structured_grid()
    plotter.add_mesh(surface, scalars="Intensity", cmap="gray", clim=(0, 1), lighting=False, show_scalar_bar=False, **options)


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

    def train(self, **options: Unpack[TrainOptions]) -> Any:
        """The field that bigus.train makes of the sweep, as pyvista.PolyData."""
        return mesh(train(self.sweep, **options).field)


for _mesh, _kind in ((pyvista.PolyData, FieldAccessor), (pyvista.ImageData, SweepAccessor)):
    if hasattr(pyvista, "register_dataset_accessor"):
        pyvista.register_dataset_accessor("bigus", _mesh)(_kind)
    else:
        _mesh.bigus = property(_kind)  # PyVista itself has no way to register one
