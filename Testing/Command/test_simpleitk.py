# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A plane placed on a volume of a field shows the same in SimpleITK and in `bigus slice`, and ITK's transforms move a
field as they move points.

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


def transforms():
    """One of every type that `bigus convert` reads, off the middle and unlike in every direction."""
    axis, centre = (0.3, -0.5, 0.8), (10.0, -20.0, 5.0)
    versor = sitk.VersorRigid3DTransform()
    versor.SetCenter(centre)
    versor.SetRotation(axis, 0.7)
    versor.SetTranslation((3, 4, -5))
    similarity = sitk.Similarity3DTransform()
    similarity.SetCenter(centre)
    similarity.SetRotation(axis, -0.4)
    similarity.SetTranslation((1, 2, 3))
    similarity.SetScale(1.3)
    euler = sitk.Euler3DTransform(centre, 0.3, -0.2, 0.9, (5, -6, 7))
    other_order = sitk.Euler3DTransform(centre, 0.3, -0.2, 0.9, (5, -6, 7))
    other_order.SetComputeZYX(True)
    affine = sitk.AffineTransform(3)
    affine.SetMatrix(np.array(euler.GetMatrix()) * 0.8)
    affine.SetCenter(centre)
    affine.SetTranslation((9, 8, 7))
    mirror = sitk.AffineTransform(3)
    mirror.SetMatrix((-1, 0, 0, 0, 1, 0, 0, 0, 1))
    both = sitk.CompositeTransform([versor, similarity])
    return {"versor": versor, "similarity": similarity, "euler": euler, "other-order": other_order, "affine": affine,
            "mirror": mirror, "translation": sitk.TranslationTransform(3, (1, 2, -3)), "composite": both}


def check_transforms(program, field, folder):
    """A plane that ITK moves shows in the field that `bigus convert` moves what it showed before."""
    signs = np.diag([-1.0, -1, 1])
    bounds = json.loads(subprocess.run([program, "info", field, "--json"], check=True, capture_output=True).stdout)["bounds"]
    corner = np.array([0.5 * (bounds[2 * a] + bounds[2 * a + 1]) for a in range(3)]) - [12, 10, 1]
    u, v = np.array([0.4, 0.05, 0.1]), np.array([-0.03, 0.4, 0.06])

    def picture(of, system, way):
        corners = [way(corner + d) for d in (0 * u, u, v)]
        matrix = np.eye(4)
        matrix[:3, 3] = corners[0]
        matrix[:3, 0], matrix[:3, 1] = corners[1] - corners[0], corners[2] - corners[0]
        matrix[:3, 2] = np.cross(matrix[:3, 0], matrix[:3, 1])
        header = ",".join(f"m{r}{c}" for r in range(4) for c in range(4))
        (folder / "plane.csv").write_text(header + "\n" + ",".join(repr(float(x)) for x in matrix.ravel()) + "\n")
        bigus(program, "slice", of, "--poses", folder / "plane.csv", "-o", folder / "slice.mha", "--size", WIDTH, HEIGHT,
              "--type", "float", "--engine", "reference")
        return sitk.GetArrayFromImage(sitk.ReadImage(str(folder / "slice.mha")))[0]

    worst, before = 0.0, picture(field, "ras", lambda x: x)
    for name, transform in transforms().items():
        for system in ("ras", "lps"):
            sitk.WriteTransform(transform, str(folder / "t.tfm"))
            bigus(program, "convert", field, folder / "moved.vtp", "--transform", folder / "t.tfm", "--inverse",
                  "--world-system", system)
            flip = signs if system == "ras" else np.eye(3)
            after = picture(folder / "moved.vtp", system,
                            lambda x: flip @ np.array(transform.TransformPoint((flip @ x).tolist())))
            difference = np.abs(after - before).max()
            print(f"{name}, {system}: largest difference {difference:.1e} of {before.max():.2f}")
            worst = max(worst, difference)
    return worst < 1e-5 and before.max() > 0.1


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
        moved = check_transforms(program, field, folder)
        return 0 if worst > 0.98 and moved else 1


if __name__ == "__main__":
    sys.exit(main())
