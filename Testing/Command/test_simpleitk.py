# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A plane placed on a volume of a field shows the same in SimpleITK and in `bigus slice`, ITK's transforms move a field as
they move points, and slices and volumes lie where SimpleITK reads that they lie.

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
    both = sitk.CompositeTransform([versor, similarity, sitk.Transform(3, sitk.sitkIdentity)])
    return {"versor": versor, "similarity": similarity, "euler": euler, "other-order": other_order, "affine": affine,
            "mirror": mirror, "identity": sitk.Transform(3, sitk.sitkIdentity),
            "scale": sitk.ScaleTransform(3, (1.2, 1.2, 1.2)), "translation": sitk.TranslationTransform(3, (1, 2, -3)), "composite": both}


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
        for system, ending in (("ras", "tfm"), ("lps", "h5")):
            sitk.WriteTransform(transform, str(folder / f"t.{ending}"))
            bigus(program, "convert", field, folder / "moved.vtp", "--transform", folder / f"t.{ending}", "--inverse",
                  "--world-system", system)
            flip = signs if system == "ras" else np.eye(3)
            after = picture(folder / "moved.vtp", system,
                            lambda x: flip @ np.array(transform.TransformPoint((flip @ x).tolist())))
            difference = np.abs(after - before).max()
            print(f"{name}, {system}: largest difference {difference:.1e} of {before.max():.2f}")
            worst = max(worst, difference)
    return worst < 1e-5 and before.max() > 0.1


def oblique(seed):
    """Axes at right angles, in columns."""
    axes = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return axes if np.linalg.det(axes) > 0 else axes * [1, 1, -1]


def check_places(program, field, folder):
    """Where SimpleITK says that slices and volumes lie is where their planes, boxes, transforms and models lie."""
    bounds = json.loads(subprocess.run([program, "info", field, "--json"], check=True, capture_output=True).stdout)["bounds"]
    middle = np.array([0.5 * (bounds[2 * a] + bounds[2 * a + 1]) for a in range(3)])
    worst = 0.0

    def differ(what, ours, theirs):
        nonlocal worst
        difference = np.abs(np.asarray(ours) - theirs).max()
        print(f"{what}: off by {difference:.1e}")
        worst = max(worst, difference)

    for system in ("ras", "lps"):
        flip = np.diag([-1.0, -1, 1]) if system == "ras" else np.eye(3)
        axes = oblique(3)
        # A pose with pixels of 0.3 x 0.4 mm, as a CSV, and as the transform that 3D Slicer saves for it.
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = axes * [0.3, 0.4, 1], middle - axes @ [8, 6, 0]
        header = "width,height," + ",".join(f"m{r}{c}" for r in range(4) for c in range(4))
        (folder / "pose.csv").write_text(header + "\n50,30," + ",".join(repr(float(x)) for x in pose.ravel()) + "\n")
        shown = np.linalg.inv(pose)  # from where things are shown to where they were, in LPS
        saved = sitk.AffineTransform(3)
        saved.SetMatrix((flip @ shown[:3, :3] @ flip).ravel().tolist())
        saved.SetTranslation((flip @ shown[:3, 3]).tolist())
        pictures = []
        for name in ("pose.csv", "pose.tfm", "pose.txt", "pose.h5"):
            if name != "pose.csv":
                sitk.WriteTransform(saved, str(folder / name))
            for ending in ("nrrd", "mha"):
                place = folder / f"place.{ending}"
                bigus(program, "slice", field, "--poses", folder / name, "--volume", place, "--size", 50, 30, "--type",
                      "float", "--world-system", system)
                volume = sitk.ReadImage(str(place))
                corners = [volume.TransformIndexToPhysicalPoint(index) for index in ((0, 0, 0), (49, 0, 0), (0, 29, 0))]
                truth = [flip @ (pose @ [i, j, 0, 1])[:3] for i, j in ((0, 0), (49, 0), (0, 29))]
                differ(f"{system}, slice at {name} as {ending}", corners, truth)
                pictures.append(sitk.GetArrayFromImage(volume))
        differ(f"{system}, what the slices show", pictures, pictures[0])

        # A box drawn in 3D Slicer.
        box = {"type": "ROI", "coordinateSystem": "LPS", "roiType": "Box", "center": list(flip @ middle),
               "orientation": list(axes.ravel()), "size": [12, 9, 6]}
        (folder / "box.mrk.json").write_text(json.dumps({"markups": [box]}))
        bigus(program, "voxelize", field, "--region", folder / "box.mrk.json", "--spacing", 0.5, "-o", folder / "box.nrrd",
              "--type", "float", "--world-system", system)
        volume = sitk.ReadImage(str(folder / "box.nrrd"))
        differ(f"{system}, size of a box", volume.GetSize(), (24, 18, 12))
        ends = [volume.TransformContinuousIndexToPhysicalPoint([(n - 1) * s + t for n, t in zip((24, 18, 12), (e, e, e))])
                for s, e in ((0, -0.5), (1, 0.5))]
        differ(f"{system}, a box", ends, [flip @ middle + axes @ (0.5 * np.array([12, 9, 6]) * s) for s in (-1, 1)])

        # The same grid again, from files as ITK writes them, of any type of voxels; the last has four channels.
        model = sitk.Image(11, 12, 13, sitk.sitkInt32)
        model.SetSpacing((0.6, 0.7, 0.8))
        model.SetDirection(oblique(4).ravel().tolist())
        model.SetOrigin((flip @ middle).tolist())
        for name, image in (("m.nrrd", model), ("m.mha", sitk.Cast(model, sitk.sitkFloat64)), ("m.mhd", model),
                            ("colour.nrrd", sitk.Compose([sitk.Cast(model, sitk.sitkUInt8)] * 4))):
            sitk.WriteImage(image, str(folder / name), True)
            bigus(program, "voxelize", field, "--like", folder / name, "-o", folder / "like.mha", "--world-system", system)
            like = sitk.ReadImage(str(folder / "like.mha"))
            differ(f"{system}, like {name}", like.GetSize() + like.GetOrigin() + like.GetSpacing() + like.GetDirection(),
                   image.GetSize() + image.GetOrigin() + image.GetSpacing() + image.GetDirection())

        # What lies there is what the field shows there: the box again, sampled from a fine volume along the axes.
        bigus(program, "voxelize", field, "-o", folder / "whole.nrrd", "--spacing", 0.25, "--type", "float",
              "--world-system", system)
        whole = sitk.Resample(sitk.ReadImage(str(folder / "whole.nrrd")), volume, sitk.Transform(), sitk.sitkLinear)
        alike = np.corrcoef(sitk.GetArrayFromImage(whole).ravel(), sitk.GetArrayFromImage(volume).ravel())[0, 1]
        print(f"{system}, the box beside the whole volume: correlation {alike:.4f}")
        worst = max(worst, 0.0 if alike > 0.98 else 1.0)
    return worst < 1e-4


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
        placed = check_places(program, field, folder)
        return 0 if worst > 0.98 and moved and placed else 1


if __name__ == "__main__":
    sys.exit(main())
