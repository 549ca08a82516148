#!/usr/bin/python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Scores the volume reconstructor that Plus and SlicerIGT run on the frames that a field is scored on.

    igsio.py SWEEP --program VolumeReconstructorTest --hold-out 4 [--voxel 0.5] [--found] [--corrected] [--config PLUS_XML]

The program is IGSIO's (https://github.com/IGSIO/IGSIO, IGSIO_BUILD_VOLUMERECONSTRUCTION and BUILD_TESTING); Plus installs
it as VolumeReconstructor. It gets all frames but those with index % K == K / 2, clipped to the rectangle of lit pixels. The
held-out frames are cut out of its volume, linearly, and scored as `bigus train` scores a field: the mean of whole frames,
black outside the lit area. Prints one JSON object. Needs PYTHONPATH=build/python.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from xml.etree import ElementTree

import bigus
import numpy as np
from harness import PROJECT
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkImageReslice
from vtkmodules.vtkIOImage import vtkMetaImageReader

# As its users find it: nearest pixel, the brightest of a voxel, holes left open.
FOUND = {"Interpolation": "NEAREST_NEIGHBOR", "CompoundingMode": "MAXIMUM", "FillHoles": "OFF"}
BEST = {"Interpolation": "LINEAR", "CompoundingMode": "MEAN", "FillHoles": "ON"}
STICK = 4.5  # mm along which holes are filled: 9 voxels of 0.5 mm; frames of the spine sweep lie up to 3 mm apart


def run(*command):
    """Runs it; its output is shown where it fails."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        sys.exit(f"{command[0]} ended with {done.returncode}:\n{done.stdout[-2000:]}")


def held_out_frames(count, k):
    return [frame for frame in range(count) if frame % k == k // 2]


def lit_pixels(sweep):
    """[height, width] bool, and the rectangle around them: column, row, columns, rows."""
    width, height, _ = sweep.GetDimensions()
    mask = sweep.GetFieldData().GetArray("Mask")
    lit = np.ones((height, width), bool) if mask is None else vtk_to_numpy(mask).reshape(height, width) > 0
    rows, columns = np.flatnonzero(lit.any(1)), np.flatnonzero(lit.any(0))
    return lit, (columns[0], rows[0], columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1)


def configuration(voxel, rectangle, settings):
    """The XML file that the reconstructor reads."""
    root = ElementTree.Element("PlusConfiguration", version="2.9")
    element = ElementTree.SubElement(
        root, "VolumeReconstruction", settings, ImageCoordinateFrame="Image", ReferenceCoordinateFrame="Reference",
        OutputSpacing=f"{voxel} {voxel} {voxel}", Optimization="FULL", NumberOfThreads="2",
        ClipRectangleOrigin=f"{rectangle[0]} {rectangle[1]}", ClipRectangleSize=f"{rectangle[2]} {rectangle[3]}")
    if settings["FillHoles"] == "ON":
        ElementTree.SubElement(ElementTree.SubElement(element, "HoleFilling"), "HoleFillingElement", Type="STICK",
                               StickLengthLimit=str(round(STICK / voxel)), NumberOfSticksToUse="1")
    return ElementTree.tostring(root)


def read_volume(path):
    reader = vtkMetaImageReader()
    reader.SetFileName(str(path))
    reader.Update()
    volume = reader.GetOutput()
    if not volume.GetNumberOfPoints():
        sys.exit(f"{path}: the reconstructor wrote no volume")
    return volume


def cut(volume, pose, width, height):
    """The volume at a frame's pixels, float32 [height, width] in [0, 1]; 0 outside."""
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(np.asarray(pose, float).ravel())
    reslice = vtkImageReslice()
    reslice.SetInputData(volume)
    reslice.SetResliceAxes(matrix)
    reslice.SetOutputSpacing(1, 1, 1)  # the matrix has millimetres a pixel
    reslice.SetOutputOrigin(0, 0, 0)
    reslice.SetOutputExtent(0, width - 1, 0, height - 1, 0, 0)
    reslice.SetInterpolationModeToLinear()
    reslice.SetOutputScalarType(10)  # VTK_FLOAT, so that no error of rounding is scored
    reslice.Update()
    pixels = reslice.GetOutput().GetPointData().GetScalars()
    return vtk_to_numpy(pixels).reshape(height, width) / np.float32(255)


def score(volume, sweep, held_out, lit):
    frames, poses = bigus.frames(sweep), bigus.poses(sweep)
    scores = [bigus.metrics(np.where(lit, cut(volume, poses[k], *lit.shape[::-1]), np.float32(0)),
                            np.where(lit, frames[k], np.uint8(0))) for k in held_out]
    return {name: float(np.mean([one[name] for one in scores])) for name in ("psnr", "ssim")}


def reconstruct(options, path, held_out, count, rectangle, folder):
    """The volume of all other frames, and the seconds that it took."""
    training = folder / "training.igs.mha"
    kept = [str(frame) for frame in range(count) if frame not in set(held_out)]
    run(options.bigus, "convert", path, training, "--frames", ",".join(kept))
    settings = FOUND if options.found else BEST
    (folder / "settings.xml").write_bytes(configuration(options.voxel, rectangle, settings))
    start = time.monotonic()
    run(options.program, f"--source-seq-file={training}", f"--config-file={folder / 'settings.xml'}",
        "--image-to-reference-transform=ImageToReference", f"--output-volume-file={folder / 'volume.mha'}",
        "--disable-compression")
    return read_volume(folder / "volume.mha"), time.monotonic() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", type=Path)
    parser.add_argument("--program", type=Path, required=True, help="VolumeReconstructorTest or VolumeReconstructor")
    parser.add_argument("--hold-out", type=int, required=True, metavar="K", help="every K-th frame is scored")
    parser.add_argument("--voxel", type=float, default=0.5, help="size of a voxel, mm (0.5)")
    parser.add_argument("--found", action="store_true", help="as its users find it: nearest, maximum, holes open")
    parser.add_argument("--corrected", action="store_true", help="at the poses of `bigus poses`; else as tracked")
    parser.add_argument("--config", type=Path, help="a Plus file with transforms that the sweep lacks")
    parser.add_argument("--bigus", type=Path, default=PROJECT / "build/bin/bigus")
    options = parser.parse_args()
    if options.hold_out < 2 or not 0 < options.voxel < np.inf:
        parser.error("--hold-out is at least 2, and --voxel a length in mm")

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # One file with ImageToReference for every frame, which both programs then read alike.
        path = folder / "sweep.igs.mha"
        config = ["--config", options.config] if options.config else []
        verb = ["poses", options.sweep, "-o", path, "--hold-out", options.hold_out] if options.corrected else \
            ["convert", options.sweep, path]
        run(options.bigus, *verb, *config)
        sweep = bigus.read_sweep(path)
        count = sweep.GetDimensions()[2]
        held_out = held_out_frames(count, options.hold_out)
        lit, rectangle = lit_pixels(sweep)
        volume, seconds = reconstruct(options, path, held_out, count, rectangle, folder)
        print(json.dumps({"sweep": options.sweep.name, "voxel": options.voxel, "found": options.found,
                          "corrected": options.corrected, "held_out": len(held_out), "seconds": round(seconds, 1),
                          "size": list(volume.GetDimensions()), **score(volume, sweep, held_out, lit)}))


if __name__ == "__main__":
    main()
