#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A field that follows the probe: one plane across the sweep, seen while frames arrive and when the field is finished.

    follow_probe.py SWEEP PICTURE.png [--rate FRAMES_A_SECOND] [--finish SECONDS]
"""
import argparse
import time

import numpy as np
import PIL.Image
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkImagingCore import vtkExtractVOI

import bigus

WIDTH, HEIGHT, SHOWN = 256, 192, 4  # pixels of the plane, moments that are shown


def matrix(pose):
    result = vtkMatrix4x4()
    result.DeepCopy(np.ravel(pose))
    return result


def plane_across(poses, frames):
    """Along the probe's path and down the beams, through the middle of all images."""
    height, width = frames.shape[1:]
    middle = poses @ [(width - 1) / 2, (height - 1) / 2, 0, 1]
    along, down = middle[-1, :3] - middle[0, :3], poses[0, :3, 1] * height
    across = np.eye(4)
    across[:3, 0], across[:3, 1] = along / WIDTH, down / HEIGHT
    across[:3, 3] = middle[0, :3] - down / 2
    return matrix(across)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sweep")
    parser.add_argument("picture")
    parser.add_argument("--rate", type=float, default=20)
    parser.add_argument("--finish", type=float, default=10)
    options = parser.parse_args()
    sweep = bigus.read(options.sweep)
    frames, poses = bigus.frames(sweep), bigus.poses(sweep)
    plane, slice_, pictures = plane_across(poses, frames), vtkImageData(), []

    def look(what):
        start = time.monotonic()
        live.RenderSlice(plane, WIDTH, HEIGHT, slice_)
        print(f"{what}: {live.GetNumberOfGaussians()} Gaussians, slice in {1000 * (time.monotonic() - start):.1f} ms")
        pictures.append(vtk_to_numpy(slice_.GetPointData().GetScalars()).reshape(HEIGHT, WIDTH).copy())

    live = bigus.vtkBigusLiveTrainer()
    cut = vtkExtractVOI()  # one frame of the sweep, as a scanner would hand it over
    cut.SetInputData(sweep)
    for k, pose in enumerate(poses):
        cut.SetVOI(0, frames.shape[2] - 1, 0, frames.shape[1] - 1, k, k)
        cut.Update()
        live.AddFrame(cut.GetOutput(), matrix(pose), k / options.rate)
        time.sleep(1 / options.rate)
        if (k + 1) % max(1, len(poses) // SHOWN) == 0:
            look(f"frame {k + 1:3d}")
    live.SetFinishTime(options.finish)
    bigus.update(live)
    look("finished ")
    PIL.Image.fromarray(np.clip(255 * np.hstack(pictures), 0, 255).astype(np.uint8)).save(options.picture, optimize=True)


if __name__ == "__main__":
    main()
