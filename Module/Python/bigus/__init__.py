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
from .arrays import image
from .common import Planes, PoseCorrection, TrainingInterrupted
from .functions import Training, check, correct_poses, frames, mean, metrics, plane, poses, read, read_field, read_planes
from .functions import read_spacing, read_stack, read_sweep, reslice, standard_error, sweep, train, write
from .pipeline import update
from .sources import SourceError, from_files
from .tasks import label, label_map, texture

from . import pickling  # noqa: F401,E402

_MODULES = {name for name, value in globals().items() if isinstance(value, type(pkgutil))}
__all__ = [name for name in globals() if name[0] != "_" and name not in _MODULES]


def __dir__() -> list:
    return sorted({*__all__, "__version__", "convert", "serve"})
