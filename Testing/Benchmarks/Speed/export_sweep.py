#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Write a sweep in the plain form that bigus-cuda-bench reads on machines without VTK.

    export_sweep.py SWEEP OUT.txt                                   a tracked sequence that bigus reads
    export_sweep.py --volume VOLUME.mha --cube I J K SIZE OUT.txt   slices of a cube of a volume of bytes

OUT.txt gets "width height frames" and a pose a line (ImageToReference, 16 numbers, row by row); OUT.raw the pixels, a
byte each.
"""
import argparse
import pathlib

import numpy as np


def frames_of_sequence(path, reader):
    import bigus

    sweep = bigus.read(path, **reader)
    return bigus.frames(sweep), bigus.poses(sweep)


def slices_of_volume(path, cube):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOImage import vtkMetaImageReader

    reader = vtkMetaImageReader()
    reader.SetFileName(path)
    reader.Update()
    volume = reader.GetOutput()
    width, height, depth = volume.GetDimensions()
    i, j, k, size = cube
    if min(i, j, k) < 0 or i + size > width or j + size > height or k + size > depth:
        raise SystemExit(f"A cube of {size} voxels from ({i}, {j}, {k}) on does not fit {width} x {height} x {depth}.")
    voxels = vtk_to_numpy(volume.GetPointData().GetScalars()).reshape(depth, height, width)
    spacing = volume.GetSpacing()
    poses = [np.diag([spacing[0], spacing[1], 1.0, 1.0]) for _ in range(size)]
    for index, pose in enumerate(poses):
        pose[2, 3] = index * spacing[2]
    return voxels[k : k + size, j : j + size, i : i + size], poses


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep", nargs="?")
    parser.add_argument("--volume")
    parser.add_argument("--cube", nargs=4, type=int, metavar=("I", "J", "K", "SIZE"))
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--config", help="PlusServer configuration, for sequences that need one")
    options = parser.parse_args()
    if bool(options.volume) == bool(options.sweep) or bool(options.volume) != bool(options.cube):
        parser.error("give a sequence, or --volume with --cube")
    if options.volume:
        pixels, poses = slices_of_volume(options.volume, options.cube)
    else:
        reader = {"ConfigFileName": options.config} if options.config else {}
        pixels, poses = frames_of_sequence(options.sweep, reader)
    pixels = np.ascontiguousarray(pixels)
    if pixels.dtype != np.uint8:
        raise SystemExit(f"Pixels are {pixels.dtype}, not bytes.")
    frames, height, width = pixels.shape
    lines = [f"{width} {height} {frames}"]
    lines += [" ".join(repr(float(number)) for number in np.asarray(pose).ravel()) for pose in poses]
    options.out.with_suffix(".raw").write_bytes(pixels.tobytes())
    options.out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
