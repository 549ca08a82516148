#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""An example in C++ and in Python draws the picture that Examples/README.md shows.

    test_examples.py NAME FIELD SWEEP BUILD_FOLDER OUTPUT_FOLDER

Runs Examples/Rendering/NAME.py, and NAME in BUILD_FOLDER where that is built. The two pictures must be the same in every
pixel, because they are of one scene and one machine. Each must be like Examples/Rendering/NAME.png, or NAME_1.png and so
on, which are those of other platforms: vtkImageDifference with the defaults of VTK's own tests, which leave room for
another driver's edges, and, because those pass a slice that lies half a millimetre aside, a mean difference of grey levels
as well. A picture of one colour fails.
"""
import os
import pathlib
import subprocess
import sys

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkImagingCore import vtkImageDifference
from vtkmodules.vtkIOImage import vtkPNGReader

SKIPPED = 77
LARGEST_DIFFERENCE = 0.15  # as vtkRegressionTestImage has it
# Grey levels. Edges smoothed or not, as drivers differ, give up to 1.4; a slice 0.5 mm aside 1.6, ellipsoids larger by a
# twentieth 10, a slice turned by 2 degrees 4.4.
LARGEST_MEAN = 1.5
NEEDS_SWEEP = ("field_mapper", "slice_prop")
EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "Examples" / "Rendering"


def picture_of(path):
    reader = vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def pixels_of(path):
    image = picture_of(path)
    return image.GetDimensions(), vtk_to_numpy(image.GetPointData().GetScalars())


def difference(path, baseline):
    """VTK's metric, and the mean difference of grey levels."""
    if picture_of(path).GetDimensions() != picture_of(baseline).GetDimensions():
        return float("inf"), float("inf")  # vtkImageDifference calls them equal
    metric = vtkImageDifference()
    metric.SetInputData(picture_of(path))
    metric.SetImageData(picture_of(baseline))
    metric.Update()
    mean = np.abs(pixels_of(path)[1].astype(float) - pixels_of(baseline)[1].astype(float)).mean()
    return metric.GetThresholdedError(), mean


def main():
    name, field, sweep, build, output = sys.argv[1:]
    if not os.environ.get("DISPLAY"):
        print("rendering needs an X server; none is set in DISPLAY")
        return SKIPPED
    pathlib.Path(output).mkdir(parents=True, exist_ok=True)
    data = [field, sweep] if name in NEEDS_SWEEP else [field]
    programs = {"python": [sys.executable, str(EXAMPLES / f"{name}.py")], "cxx": [str(pathlib.Path(build) / name)]}
    pictures = {}
    for kind, program in programs.items():
        if not pathlib.Path(program[-1]).exists():
            continue
        pictures[kind] = pathlib.Path(output) / f"{name}-{kind}.png"
        subprocess.run([*program, *data, str(pictures[kind])], check=True)

    failures = []
    for kind, path in pictures.items():
        if np.ptp(pixels_of(path)[1]) == 0:
            failures.append(f"{path} has one colour")
        baselines = [EXAMPLES / f"{name}.png", *sorted(EXAMPLES.glob(f"{name}_[0-9]*.png"))]
        found = {baseline.name: difference(path, baseline) for baseline in baselines}
        print(kind, found)
        if not any(metric < LARGEST_DIFFERENCE and mean < LARGEST_MEAN for metric, mean in found.values()):
            failures.append(f"{path} is like none of {found}; look at it, and copy it to {EXAMPLES} if it is right")
    if len(pictures) == 2:
        (size, python), (other, cxx) = (pixels_of(path) for path in pictures.values())
        if size != other or not np.array_equal(python, cxx):
            failures.append(f"{' and '.join(map(str, pictures.values()))} differ")
    print("\n".join(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
