# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Tracked B-mode ultrasound as signed 3-D Gaussians, with numpy and without VTK.

A sweep of tracked frames trains a field of Gaussians; the field predicts the image at any plane::

    import bigus

    sweep = bigus.read_sweep("sweep.igs.mha")   # or bigus.sweep(frames, poses) of numpy arrays
    training = bigus.train(sweep, gaussians=50000, hold_out=8)
    frames = bigus.frames(sweep)
    image = bigus.reslice(training.field, training.poses[4], size=frames.shape[:0:-1])
    print(bigus.metrics(image, frames[4]))
    bigus.write(training.field, "field.vtp")

Lengths are millimetres, intensities lie in [0, 1] (0 to 255 in 8-bit arrays), matrices are row-major as numpy has them.
Where the package vtk is installed, bigus.vtkBigusReslice and others are filters of VTK's pipelines, with the names and
properties of the C++ classes, and bigus.update runs them; import bigus.pyvista lets PyVista's meshes slice fields.
"""

import importlib
from typing import TYPE_CHECKING, Any

from ._core import Error, Field, Sweep, __version__, engines, instruction_sets, missing_engines
from ._core import added_filters as _added_filters
from ._core import use_instruction_set
from .arrays import field
from .common import Planes, PoseCorrection, TrainingInterrupted
from .functions import Training, check, correct_poses, frames, mean, metrics, plane, poses, read, read_field, read_planes
from .functions import read_spacing, read_stack, read_sweep, reslice, standard_error, sweep, train, write
from .names import no_such
from .sources import SourceError, from_files
from .tasks import Phantom, Slicer, distance_to_frames, label, label_map, options

if TYPE_CHECKING:  # what is loaded, with VTK, when it is asked for
    from .data_filters import *
    from .filters import *
    from .pipeline import update

__all__ = [
    "Error", "Field", "Phantom", "Planes", "PoseCorrection", "Slicer", "SourceError", "Sweep", "Training",
    "TrainingInterrupted", "__version__", "check", "correct_poses", "distance_to_frames", "engines", "field", "frames",
    "from_files", "instruction_sets", "label", "label_map", "mean", "metrics", "missing_engines", "options", "plane", "poses", "read", "read_field",
    "read_planes", "read_spacing", "read_stack", "read_sweep", "reslice", "standard_error", "sweep", "train", "use_instruction_set", "write",
]  # fmt: skip

_FILTERS = {  # by the module that they are in
    "filters": ["vtkBigusFieldReader", "vtkBigusFieldToImage", "vtkBigusFieldWriter", "vtkBigusReslice",
                "vtkBigusSequenceReader", "vtkBigusSequenceWriter", "vtkBigusTrainer", "vtkBigusVoxelizer"],
    "data_filters": ["vtkBigusFieldTensors", "vtkBigusImageMetrics", "vtkBigusPartitionField", "vtkBigusPhantomSource",
                     "vtkBigusPoseCorrection", "vtkBigusSweepInspection", "vtkBigusSweepOutline", "vtkBigusTransformField"],
    "pipeline": ["update"],
}
_FROM = {**{name: module for module, names in _FILTERS.items() for name in names}, **_added_filters}
_MODULES = ("convert", "pyvista", "serve")  # to be imported where they are used

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _FROM or name in _MODULES:
            try:
                module = importlib.import_module("." + _FROM.get(name, name), __name__)
            except ImportError as error:
                package = "pyvista" if name == "pyvista" else "vtk"
                raise AttributeError(f"bigus.{name} needs {package} ({error}): pip install {package}") from None
            return module if name in _MODULES else getattr(module, name)
        raise AttributeError(no_such("module 'bigus'", "attribute", name, __dir__()))


def __dir__() -> list:
    return sorted([*__all__, *_FROM, *_MODULES])
