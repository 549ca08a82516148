# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A plane placed on a volume of a field shows the same in SimpleITK and in `bigus slice`.

    test_simpleitk.py BIGUS FIELD       the program, and a field; skipped (77) where SimpleITK is not installed
"""

import json
import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy as np
    import SimpleITK as sitk
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

WIDTH, HEIGHT, PIXEL = 90, 70, 0.5


def bigus(program, *arguments):
    subprocess.run([program, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def markup(centre, axes, path):
    """A plane as 3D Slicer saves it: LPS, x, y and z as columns."""
    plane = {"type": "Plane", "coordinateSystem": "LPS", "coordinateUnits": "mm", "center": list(centre),
             "baseToNode": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
             "normal": list(axes[:, 2]), "size": [WIDTH * PIXEL, HEIGHT * PIXEL, 0], "orientation": list(axes.ravel()),
             "planeType": "pointNormal", "sizeMode": "absolute"}
    path.write_text(json.dumps({"@schema": "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/"
                                           "Markups/Resources/Schema/markups-schema-v1.0.3.json#",
                                "markups": [plane]}))


def main():
    program, field = sys.argv[1:3]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        worst = 1.0
        for system in ("ras", "lps"):
            for ending in ("mha", "nrrd"):
                path = folder / f"volume-{system}.{ending}"
                bigus(program, "voxelize", field, "-o", path, "--spacing", 0.4, "--type", "float", "--world-system", system)
                volume = sitk.ReadImage(str(path))
                low = np.array(volume.TransformIndexToPhysicalPoint((0, 0, 0)))
                high = np.array(volume.TransformIndexToPhysicalPoint([n - 1 for n in volume.GetSize()]))
                # Off the middle and oblique, so that no mirror image of the plane shows the same.
                centre = 0.5 * (low + high) + 0.06 * (high - low)
                x = np.array([0.8, 0.1, 0.6])
                x /= np.linalg.norm(x)
                z = np.cross(x, [0.1, 0.9, 0.2])
                z /= np.linalg.norm(z)
                axes = np.stack([x, np.cross(z, x), z], axis=1)
                markup(centre, axes, folder / "plane.mrk.json")
                bigus(program, "slice", field, "--poses", folder / "plane.mrk.json", "-o", folder / "slice.mha",
                      "--spacing", PIXEL, "--size", WIDTH, HEIGHT, "--elevation-sigma", 0, "--type", "float",
                      "--world-system", system)
                ours = sitk.GetArrayFromImage(sitk.ReadImage(str(folder / "slice.mha")))[0]

                grid = sitk.Image(WIDTH, HEIGHT, 1, sitk.sitkFloat32)
                grid.SetSpacing((PIXEL, PIXEL, 1))
                grid.SetDirection(axes.ravel().tolist())
                corner = centre - PIXEL * (0.5 * (WIDTH - 1) * axes[:, 0] + 0.5 * (HEIGHT - 1) * axes[:, 1])
                grid.SetOrigin(corner.tolist())
                theirs = sitk.GetArrayFromImage(sitk.Resample(volume, grid, sitk.Transform(), sitk.sitkLinear))[0]
                alike = np.corrcoef(ours.ravel(), theirs.ravel())[0, 1]
                print(f"{path.name}: correlation {alike:.4f}, brightest {ours.max():.2f}")
                worst = min(worst, alike)
        return 0 if worst > 0.98 else 1


if __name__ == "__main__":
    sys.exit(main())
