# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Tracked B-mode ultrasound as signed 3-D Gaussians.

A sweep of tracked frames trains a field of Gaussians; the field predicts the image at any plane::

    import bigus

    sweep = bigus.read_sweep("sweep.igs.mha")
    training = bigus.train(sweep, gaussians=50000, hold_out=8)
    frames = bigus.frames(sweep)
    image = bigus.reslice(training.field, training.poses[4], size=frames.shape[:0:-1])
    print(bigus.metrics(image, frames[4]))

Sweeps are vtkImageData, fields vtkPolyData, and the classes (vtkBigusTrainer, vtkBigusReslice, ...) are ordinary VTK
classes, so everything mixes with any VTK pipeline. Lengths are millimetres, intensities lie in [0, 1] (0 to 255 in
8-bit arrays), matrices are row-major as numpy has them.
"""

import importlib
import pkgutil

from . import environment

environment.require()  # before anything compiled is loaded
__version__ = environment.VERSION

# VTK's own wrapped classes must be there before the classes derived from them.
import vtkmodules.vtkCommonDataModel  # noqa: F401
import vtkmodules.vtkCommonExecutionModel  # noqa: F401
import vtkmodules.vtkIOCore  # noqa: F401

for _library in [found.name for found in pkgutil.iter_modules(__path__) if found.name.startswith("vtkBigus")]:
    if _library == "vtkBigusRendering":  # not there when built without BIGUS_WITH_RENDERING
        import vtkmodules.vtkInteractionWidgets  # noqa: F401
        import vtkmodules.vtkRenderingCore  # noqa: F401
    _classes = vars(importlib.import_module("." + _library, __name__))
    globals().update({name: value for name, value in _classes.items() if name.startswith("vtkBigus")})

from ._update import instruction_sets, use_instruction_set
from .arrays import frames, image, poses, sweep
from .pipeline import update
from .sources import SourceError, from_files
from .tasks import Planes, TrainingInterrupted, check, correct_poses, label, label_map, mean, metrics, read, read_field, read_planes
from .tasks import read_spacing, read_stack, read_sweep, reslice, standard_error, texture, train, write

from . import pickling  # noqa: F401,E402

__all__ = ["Planes", "SourceError", "TrainingInterrupted", "check", "correct_poses", "frames", "from_files", "image", "label", "label_map", "mean", "metrics", "poses", "sweep", "texture", "train"]
__all__ += ["instruction_sets", "read", "read_field", "read_planes", "read_spacing", "read_stack", "read_sweep", "reslice", "standard_error", "update", "use_instruction_set", "write"]
__all__ += [name for name in globals() if name.startswith("vtkBigus")]


def __dir__() -> list:
    return sorted({*__all__, "__version__", "convert", "serve"})
