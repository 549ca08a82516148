# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Tracked B-mode ultrasound as signed 3-D Gaussians, with numpy and without VTK.

A sweep of tracked frames trains a field of Gaussians; the field predicts the image at any plane::

    import bigus

    sweep = bigus.read("sweep.igs.mha")         # or bigus.sweep(frames, poses) of numpy arrays
    training = bigus.train(sweep, Gaussians=50000, HoldOut=8)
    frames = bigus.frames(sweep)
    image = bigus.reslice(training.field, training.poses[4], size=frames.shape[:0:-1])
    print(bigus.metrics(image, frames[4]))
    bigus.write(training.field, "field.vtp")

Lengths are millimetres, intensities lie in [0, 1] (0 to 255 in 8-bit arrays), matrices are row-major as numpy has them.
Where the package vtk is installed, bigus.vtkBigusReslice and others are filters of VTK's pipelines, with the names and
properties of the C++ classes, and bigus.update runs them; import bigus.pyvista lets PyVista's meshes slice fields.
"""

import importlib
from typing import Any

from ._core import Error, Field, Phantom, Sweep, __version__, engines, instruction_sets, missing_engines
from ._core import added_filters as _added_filters, use_instruction_set
from .arrays import field, frames, poses, sweep
from .files import Planes, read, read_planes, read_spacing, read_stack, write
from .sources import SourceError, from_files
from .tasks import PoseCorrection, Slicer, Training, TrainingInterrupted, check, correct_poses, distance_to_frames
from .tasks import metrics, options, plane, reslice, train

__all__ = [
    "Error", "Field", "Phantom", "Planes", "PoseCorrection", "Slicer", "SourceError", "Sweep", "Training",
    "TrainingInterrupted", "__version__", "check", "correct_poses", "distance_to_frames", "engines", "field", "frames", "from_files",
    "instruction_sets", "metrics", "missing_engines", "options", "plane", "poses", "read", "read_planes", "read_spacing",
    "read_stack",
    "reslice", "sweep", "train", "use_instruction_set", "write",
]  # fmt: skip

_FILTERS = {  # by the module that they are in
    "filters": ["vtkBigusFieldReader", "vtkBigusFieldToImage", "vtkBigusFieldWriter", "vtkBigusReslice",
                "vtkBigusSequenceReader", "vtkBigusSequenceWriter", "vtkBigusTrainer", "vtkBigusVoxelizer"],
    "field_filters": ["vtkBigusFieldTensors", "vtkBigusPartitionField", "vtkBigusTransformField"],
    "sweep_filters": ["vtkBigusImageMetrics", "vtkBigusPhantomSource", "vtkBigusPoseCorrection",
                      "vtkBigusSweepInspection", "vtkBigusSweepOutline"],
    "pipeline": ["update"],
}
_MODULES = {**{name: module for module, names in _FILTERS.items() for name in names}, **_added_filters}


def __getattr__(name: str) -> Any:
    """The filters of VTK's pipelines, which are loaded, with VTK, when they are asked for."""
    if name in _MODULES:
        try:
            module = importlib.import_module("." + _MODULES[name], __name__)
        except ImportError as error:
            raise AttributeError(f"bigus.{name} needs VTK ({error}): pip install vtk") from None
        return getattr(module, name)
    raise AttributeError(f"module 'bigus' has no attribute {name!r}")


def __dir__() -> list:
    return sorted([*globals(), *_MODULES])
