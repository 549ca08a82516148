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
Where VTK is at hand, the package of the C++ build has the same functions for VTK's data.
"""

from ._core import Error, Field, Phantom, Sweep, __version__, engines, instruction_sets, missing_engines
from ._core import use_instruction_set
from .arrays import field, frames, poses, sweep
from .files import Planes, read, read_planes, read_stack, write
from .sources import SourceError, from_files
from .tasks import PoseCorrection, Slicer, Training, TrainingInterrupted, correct_poses, distance_to_frames, metrics
from .tasks import options, plane, reslice, train

__all__ = [
    "Error", "Field", "Phantom", "Planes", "PoseCorrection", "Slicer", "SourceError", "Sweep", "Training",
    "TrainingInterrupted", "__version__", "correct_poses", "distance_to_frames", "engines", "field", "frames", "from_files",
    "instruction_sets", "metrics", "missing_engines", "options", "plane", "poses", "read", "read_planes", "read_stack",
    "reslice", "sweep", "train", "use_instruction_set", "write",
]  # fmt: skip
