# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Files in the package without VTK: what comes back, and that the C++ build with VTK reads and writes the same.

BIGUS_VTK_PYTHON names a Python with VTK and BIGUS_VTK_PACKAGE the folder of the package of the C++ build: then every
small file, good or bad, is read by both, and so are the real sweeps in BIGUS_DATA.
"""

import copy
import json
import os
import pathlib
import pickle
import struct
import subprocess
import sys
import tempfile
import unittest
import warnings
import zlib

import bigus
import numpy as np

DATA = pathlib.Path(__file__).resolve().parents[3] / "Testing" / "Data"
FRAMES, HEIGHT, WIDTH = 3, 4, 5
KIND = {np.uint8: "UCHAR", np.uint16: "USHORT", np.float32: "FLOAT", np.int16: "SHORT"}


def pose(frame):
    matrix = np.diag([0.25, 0.5, 1.0, 1.0])
    matrix[:3, 3] = (1 / 3, -2, 0.7 * frame)
    return matrix


def pixels(kind=np.uint8):
    values = np.arange(FRAMES * HEIGHT * WIDTH).reshape(FRAMES, HEIGHT, WIDTH)
    return (values / values.max()).astype(kind) if kind == np.float32 else (values * (1 if kind == np.uint8 else 900)).astype(kind)


def words(matrix):
    return " ".join(repr(float(v)) for v in np.ravel(matrix))


def mha(data=None, compressed=False, **fields):
    """A MetaImage sequence; fields replace or, as None, remove those it has."""
    data = pixels() if data is None else data
    raw = data.tobytes()
    body = zlib.compress(raw) if compressed else raw
    header = {"ObjectType": "Image", "NDims": "3", "BinaryData": "True", "BinaryDataByteOrderMSB": "False",
              "CompressedData": str(compressed), "DimSize": "%d %d %d" % data.shape[::-1],
              "ElementType": "MET_" + KIND[data.dtype.type], "UltrasoundImageOrientation": "MF"}
    for k in range(len(data)):
        header[f"Seq_Frame{k:04d}_ImageToReferenceTransform"] = words(pose(k))
        header[f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus"] = "OK"
        header[f"Seq_Frame{k:04d}_Timestamp"] = str(0.1 * k)
    header.update(fields)
    header["ElementDataFile"] = fields.get("ElementDataFile", header.pop("ElementDataFile", "LOCAL"))
    lines = [f"{name} = {value}\n" for name, value in header.items() if value is not None and name != "ElementDataFile"]
    return ("".join(lines) + f"ElementDataFile = {header['ElementDataFile']}\n").encode() + body


def nrrd(data):
    import gzip

    lines = ["NRRD0004", "type: unsigned char", "dimension: 3", "sizes: %d %d %d" % data.shape[::-1],
             "kinds: domain domain list", "encoding: gzip"]
    for k in range(len(data)):
        lines.append(f"Seq_Frame{k:04d}_ImageToReferenceTransform:={words(pose(k))}")
        lines.append(f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus:=OK")
    return "\n".join(lines).encode() + b"\n\n" + gzip.compress(data.tobytes())


def png(image):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + row.tobytes() for row in image)
    size = struct.pack(">IIBBBBB", image.shape[1], image.shape[0], 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def config(**transforms):
    elements = "".join(f'<Transform From="{n.split("To")[0]}" To="{n.split("To")[1]}" Matrix="{words(m)}"/>'
                       for n, m in transforms.items())
    return f"<PlusConfiguration><CoordinateDefinitions>{elements}</CoordinateDefinitions></PlusConfiguration>".encode()


def markups():
    plane = {"type": "Plane", "coordinateSystem": "LPS", "center": [1, 2, 3], "size": [6, 8], "orientation": np.eye(3).ravel().tolist(),
             "normal": [0, 0, 1], "baseToNode": [1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1],
             "controlPoints": [{"position": [1, 2, 3], "positionStatus": "defined"}]}
    return json.dumps({"markups": [plane]}).encode()


def field(count=700):
    rng = np.random.default_rng(5)
    made = bigus.field(rng.normal(size=(count, 3)) * 30, np.exp(rng.normal(size=(count, 3))), rng.normal(size=count),
                       rng.normal(size=(count, 4)), gamma=0.3, elevation_sigma=1 / 3, probe_elevation_sigma=0.7,
                       trained_normals=[(0, 0, 1), (0.6, -0.8, 0)])
    made.provenance = ["seed=7", "sequence=a b.mha"]
    poses = np.tile(np.eye(4), (3, 1, 1))  # recorded, of directions that lie 0.2 rad apart
    poses[0, :2, :2] = [(np.cos(0.2), np.sin(0.2)), (-np.sin(0.2), np.cos(0.2))]
    poses[2, :2, :2] = poses[0, :2, :2].T
    poses[:, 2, 3] = -1, 0, 1
    made.view_arrays = (rng.normal(size=(count, 3)), np.eye(3).reshape(1, 9), np.array([[0.1, 10.0, 1.0]]),
                        poses.reshape(3, 16))  # fmt: skip
    made.label_arrays = (["cyst", "vein"], np.array([1, 7]), np.array([(1, 0, 0), (0, 0, 0.1)]),
                         rng.random((count + 2, 2), np.float32), np.array([(0.1, 5, 6, 0.5), (1, 2, 3, 1)]))  # fmt: skip
    return made


def plain(field):
    """The same without what it knows of directions, and without labels."""
    made = copy.copy(field)
    made.view_arrays = made.label_arrays = None
    return made


def arrays_of(field):
    return {name: getattr(field, name) for name in ("centers", "scales", "rotations", "reflectivities", "trained_normals",
                                                    "gamma", "elevation_sigma", "probe_elevation_sigma")}


class InAFolder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def put(self, name, data):
        (self.folder / name).write_bytes(data)
        return self.folder / name


class Sequences(InAFolder):
    def check(self, sweep, data=None):
        expected = pixels() if data is None else data
        np.testing.assert_array_equal(bigus.frames(sweep), expected)
        np.testing.assert_array_equal(bigus.poses(sweep), [pose(k) for k in range(FRAMES)])

    def test_metaimage_and_nrrd(self):
        self.check(bigus.read(self.put("s.igs.mha", mha())))
        sweep = bigus.read(self.put("c.mha", mha(compressed=True)))
        self.check(sweep)
        np.testing.assert_allclose(sweep.timestamps, [0, 0.1, 0.2])
        self.assertEqual(sweep.mask.sum(), WIDTH * HEIGHT)  # pixel (0, 0) is black in the first frame alone
        self.check(bigus.read(self.put("s.seq.nrrd", nrrd(pixels()))))
        (self.folder / "p.raw").write_bytes(pixels().tobytes())
        apart = mha(ElementDataFile="p.raw").split(b"p.raw\n")[0] + b"p.raw\n"
        self.check(bigus.read(self.put("s.mhd", apart)))

    def test_pixel_types(self):
        floats = pixels(np.float32)
        self.check(bigus.read(self.put("f.mha", mha(floats))), floats)
        shorts = pixels(np.uint16)
        wide = bigus.read(self.put("u.mha", mha(shorts)), PixelRange=65535)
        self.check(wide, shorts.astype(np.float32) / np.float32(65535))
        self.assertEqual(shorts.max(), 53100)
        with self.assertWarnsRegex(RuntimeWarning, "12 of 16 bits") as caught:
            narrow = bigus.read(self.put("n.mha", mha((shorts // 16).astype(np.uint16))))
        np.testing.assert_allclose(narrow.frames, shorts // 16 / 4095, atol=1e-5)
        self.assertEqual(pathlib.Path(caught.filename).name, "test_files.py")  # the line that called it, not one of bigus

    def test_csv_with_pictures(self):
        for k in range(FRAMES):
            self.put(f"frame_{k:04d}.png", png(pixels()[k]))
        names = [f"m{i}{j}" for i in range(4) for j in range(4)]
        rows = [",".join(names)] + [",".join(repr(float(v)) for v in pose(k).ravel()) for k in range(FRAMES)]
        path = self.put("poses.csv", "\n".join(rows).encode())
        self.check(bigus.read(path, ImagePattern="frame_%04d.png"))
        planes = bigus.read_planes(path)
        np.testing.assert_array_equal(planes.poses, [pose(k) for k in range(FRAMES)])

    def test_chain_through_a_plus_configuration(self):
        fields = {}
        for k in range(FRAMES):
            fields[f"Seq_Frame{k:04d}_ImageToReferenceTransform"] = None
            fields[f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus"] = None
            fields[f"Seq_Frame{k:04d}_ProbeToReferenceTransform"] = words(pose(k))
            fields[f"Seq_Frame{k:04d}_ProbeToReferenceTransformStatus"] = "OK" if k else "INVALID"
        path = self.put("s.mha", mha(**fields))
        image_to_probe = np.diag([0.1, 0.1, 0.1, 1])
        xml = self.put("plus.xml", config(ImageToProbe=image_to_probe))
        sweep = bigus.read(path, ConfigFileName=xml)
        np.testing.assert_allclose(sweep.poses, [pose(k) @ image_to_probe for k in (1, 2)])
        np.testing.assert_array_equal(sweep.frames, pixels()[1:])
        with self.assertRaisesRegex(bigus.Error, "no way from Image to Reference.*ProbeToReference"):
            bigus.read(path)

    def test_a_third_column_that_is_none(self):
        def flat(k):
            return pose(k) @ np.diag([1, 1, 0, 1])

        fields = {f"Seq_Frame{k:04d}_ImageToReferenceTransform": words(flat(k)) for k in range(FRAMES)}
        with self.assertWarnsRegex(RuntimeWarning, f"third column of {FRAMES} of {FRAMES} poses"):
            self.check(bigus.read(self.put("s.mha", mha(**fields))))

    def test_clips(self):
        path = self.put("s.mha", mha())
        sweep = bigus.read(path, ClipMode=1, ClipRectangle=(1, 1, 2, 2))
        inside = np.zeros((HEIGHT, WIDTH), bool)
        inside[1:3, 1:3] = True
        np.testing.assert_array_equal(sweep.frames, np.where(inside, pixels(), 0))
        np.testing.assert_array_equal(sweep.mask != 0, inside)
        with self.assertRaisesRegex(bigus.Error, "outer radius"):
            bigus.read(path, ClipMode=2)

    def test_written_and_read(self):
        sweep = bigus.sweep(pixels(), [pose(k) for k in range(FRAMES)], timestamps=[0.1, 0.2, 0.4])
        for name, options in (("a.igs.mha", {}), ("b.mha", dict(Compression=False, ToFrame="Tracker"))):
            bigus.write(sweep, self.folder / name, **options)
            again = bigus.read(self.folder / name, **{k: v for k, v in options.items() if k == "ToFrame"})
            self.check(again)
            np.testing.assert_array_equal(again.timestamps, sweep.timestamps)
        bigus.write(bigus.sweep(pixels(np.float32), sweep.poses), self.folder / "f.mha")
        self.check(bigus.read(self.folder / "f.mha"), pixels(np.float32))

    def test_mistakes_are_named(self):
        path = self.put("s.mha", mha())
        for action, error, text in (
            (lambda: bigus.read(self.folder / "no.mha"), bigus.Error, "no.mha: there is no such file"),
            (lambda: bigus.read(path, ToFrme="A"), TypeError, "no property ToFrme; did you mean ToFrame"),
            (lambda: bigus.read(path, ClipRectangle=(1, 2)), TypeError, "4 numbers"),
            (lambda: bigus.read(path, ToFrame="Moon"), bigus.Error, "no way from Image to Moon"),
            (lambda: bigus.write(3, path), TypeError, "not int"),
            (lambda: bigus.write(bigus.read(path), self.folder / "s.nrrd"), bigus.Error, "as .mha"),
            (lambda: bigus.write(bigus.read(path), self.folder / "no" / "s.mha"), bigus.Error, "cannot be written"),
            (lambda: bigus.write(bigus.read(path), self.folder / "t.mha", ToFrame="a b"), bigus.Error, "coordinate frame"),
        ):
            with self.assertRaisesRegex(error, text):
                action()
        self.assertEqual(os.listdir(self.folder), ["s.mha"])


class Fields(InAFolder):
    def same(self, a, b):
        for name, value in arrays_of(a).items():
            np.testing.assert_array_equal(value, arrays_of(b)[name], err_msg=name)
        self.assertEqual((a.provenance, a.labels), (b.provenance, b.labels))
        for name in ("view_arrays", "label_arrays"):
            for one, other in zip(getattr(a, name), getattr(b, name)):
                np.testing.assert_array_equal(one, other, err_msg=name)

    def test_vtp_is_exact(self):
        bigus.write(field(), self.folder / "f.vtp")
        self.same(bigus.read(self.folder / "f.vtp"), field())
        bigus.write(field(), self.folder / "r.vtp", Rounding=True)
        self.same(bigus.read(self.folder / "r.vtp"), field().rounded())
        self.assertLess(2 * (self.folder / "r.vtp").stat().st_size, (self.folder / "f.vtp").stat().st_size)
        self.same(pickle.loads(pickle.dumps(field())), field())
        bigus.write(bigus.Field(), self.folder / "e.vtp")
        self.assertEqual(len(bigus.read(self.folder / "e.vtp")), 0)

    def test_ply_has_float_precision(self):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            bigus.write(field(), self.folder / "f.ply")
        self.assertEqual([str(one.message).split(": ")[1] for one in said], ["the field's labels are left out; .vtp keeps it."])
        again = bigus.read(self.folder / "f.ply")
        np.testing.assert_array_equal(again.reflectivities, field().reflectivities)
        np.testing.assert_allclose(again.scales, field().scales, rtol=5e-7)
        np.testing.assert_array_equal(again.centers, field().centers.astype(np.float32))
        self.assertEqual(again.provenance, field().provenance)
        for one, other in zip(again.view_arrays, field().view_arrays):
            np.testing.assert_allclose(one, other, rtol=5e-7)
        self.assertEqual(again.labels, {})

    def test_pieces_keep_directions(self):
        with self.assertWarnsRegex(RuntimeWarning, "labels are left out"):
            bigus.write(field(), self.folder / "f.pvtp")
        again = bigus.read_field(self.folder / "f.pvtp")
        np.testing.assert_array_equal(again.centers, field().centers)  # of fewer blocks than pieces, in order
        for one, other in zip(again.view_arrays, field().view_arrays):
            np.testing.assert_array_equal(one, other)

    def test_directions_and_labels_must_be_the_fields(self):
        view, labels = list(field().view_arrays), list(field().label_arrays)
        for name, arrays, place, value in (
            ("view_arrays", view, 0, np.ones((9, 3))), ("view_arrays", view, 1, np.ones((1, 9))), ("view_arrays", view, 3, np.full((1, 16), np.nan)),
            ("label_arrays", labels, 1, np.array([7, 1])), ("label_arrays", labels, 1, np.array([np.nan, 1e99])), ("label_arrays", labels, 0, ["cyst", ""]),
            ("label_arrays", labels, 3, np.full((702, 2), 2.0)), ("label_arrays", labels, 4, np.zeros((3, 4))),
        ):  # fmt: skip
            made = field()
            with self.subTest(name=name, place=place), self.assertRaises((bigus.Error, ValueError)):
                setattr(made, name, (*arrays[:place], value, *arrays[place + 1:]))
            self.same(made, field())

    def test_the_commands_field(self):
        found = bigus.read(DATA / "phantom-field.vtp")
        self.assertGreater(len(found), 1000)
        self.assertTrue(any(line.startswith("seed=") for line in found.provenance))

    def test_training_tells_where_a_field_comes_from(self):
        sweep = bigus.Phantom(frames=12, width=32, height=32, pixel_size=0.8).sweep()
        made = bigus.train(sweep, False, Automatic=False, Iterations=5, Gaussians=200, seed=9).field
        for line in ("seed=9", "iterations=5", f"gaussians={len(made)}", "poses=as tracked", "heldOutFrames="):
            self.assertIn(line, made.provenance)
        self.assertEqual(made.rounded().provenance, made.provenance)

    def test_mistakes_are_named(self):
        bigus.write(field(), self.folder / "f.vtp")
        whole = (self.folder / "f.vtp").read_bytes()
        with self.assertRaisesRegex(bigus.Error, "truncated"):
            bigus.read(self.put("t.vtp", whole[:-40]))
        with self.assertRaisesRegex(bigus.Error, "Gaussian field: the array Scale is missing"):
            bigus.read(self.put("s.vtp", whole.replace(b'"Scale"', b'"Scaly"')))
        with self.assertRaisesRegex(bigus.Error, "version"):
            bigus.read(self.put("p.ply", b"ply\nformat ascii 1.0\ncomment bigus.format_version 2\nelement vertex 0\nend_header\n"))
        with self.assertRaisesRegex(bigus.Error, "named? the file so"):
            bigus.write(field(), self.folder / "f.obj")
        broken = field()
        broken.scales[3, 1] = -1
        with self.assertRaisesRegex(bigus.Error, r"Scale\[3\]"):
            bigus.write(broken, self.folder / "b.vtp")
        with self.assertRaisesRegex(TypeError, "no property AutoMask"):
            bigus.read(self.folder / "f.vtp", AutoMask=True)
        self.assertFalse((self.folder / "b.vtp").exists())


    def test_other_encodings_by_vtk(self):
        bigus.write(field(), self.folder / "f.vtp")
        other = (self.folder / "f.vtp").read_bytes().replace(b'"vtkZLibDataCompressor"', b'"vtkLZMADataCompressor"')
        script = f"import sys; sys.modules['vtkmodules'] = None; import bigus; bigus.read({str(self.put('o.vtp', other))!r})"
        result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
        self.assertIn("another encoding than BIGUS writes", result.stderr)
        try:
            from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter
        except ImportError:
            return
        from bigus.vtkdata import polydata_of_field

        writer = vtkXMLPolyDataWriter()
        writer.SetInputData(polydata_of_field(field()))
        writer.SetFileName(str(self.folder / "binary.vtp"))
        writer.SetDataModeToBinary()
        self.assertEqual(writer.Write(), 1)
        self.same(bigus.read(self.folder / "binary.vtp"), field())


class SlicePlanes(InAFolder):
    def test_markups_and_transforms(self):
        path = self.put("p.mrk.json", markups())
        lps, ras = (bigus.read_planes(path, spacing=0.25, world=world) for world in ("LPS", "RAS"))
        np.testing.assert_array_equal(lps.sizes, [(24, 32)])
        corner = lps.poses[0] @ (11.5, 15.5, 0, 1)
        np.testing.assert_allclose(corner, (1, 2, 3, 1))
        np.testing.assert_allclose(ras.poses[0] @ (11.5, 15.5, 0, 1), (-1, -2, 3, 1))
        self.assertIsNone(lps.timestamps)
        self.assertEqual(bigus.read_planes(DATA / "transform.h5").poses.shape, (1, 4, 4))
        with self.assertRaisesRegex(ValueError, "RAS or LPS"):
            bigus.read_planes(path, world="XYZ")


READ_WITH_VTK = r"""
import sys, warnings
import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
warnings.simplefilter("ignore")
import bigus
saved = {}
for line in open(sys.argv[1], encoding="utf-8").read().splitlines():
    name, options = line.split("\t")
    key = name.split("/")[-1]
    try:
        if key.endswith(".mrk.json"):
            planes = bigus.read_planes(name)
            saved[key + "/poses"], saved[key + "/sizes"] = planes.poses, planes.sizes
            continue
        data = bigus.read(name, **eval(options))
        if data.IsA("vtkPolyData"):
            points, fields = data.GetPointData(), data.GetFieldData()
            saved[key + "/centers"] = vtk_to_numpy(data.GetPoints().GetData())
            for array in ("Scale", "Rotation", "Reflectivity"):
                saved[key + "/" + array] = vtk_to_numpy(points.GetArray(array))
            lines = fields.GetAbstractArray("Provenance")
            saved[key + "/provenance"] = np.array([lines.GetValue(k) for k in range(lines.GetNumberOfValues())])
        else:
            saved[key + "/frames"], saved[key + "/poses"] = bigus.frames(data), bigus.poses(data)
            saved[key + "/mask"] = vtk_to_numpy(data.GetFieldData().GetArray("Mask"))
    except RuntimeError as error:
        saved[key + "/error"] = np.array(str(error))
np.savez(sys.argv[2], **saved)
"""


@unittest.skipUnless(os.environ.get("BIGUS_VTK_PACKAGE"), "BIGUS_VTK_PACKAGE does not name the package of the C++ build")
class AsTheClassesOfVtk(InAFolder):
    def read_with_vtk(self, files):
        """What the C++ build reads, by `file/array`, or `file/error`; files are pairs of path and options."""
        (self.folder / "list.txt").write_text("\n".join(f"{path}\t{options!r}" for path, options in files))
        environment = {**os.environ, "PYTHONPATH": os.environ["BIGUS_VTK_PACKAGE"]}
        subprocess.run([os.environ["BIGUS_VTK_PYTHON"], "-c", READ_WITH_VTK, "list.txt", "out.npz"], check=True,
                       cwd=self.folder, env=environment)
        return np.load(self.folder / "out.npz")

    def compare(self, files):
        """Reads every file with both, and returns how many were read and how many refused."""
        theirs = self.read_with_vtk(files)
        good = bad = 0
        for path, options in files:
            name = path.name
            with self.subTest(name), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    data = bigus.read_planes(path) if name.endswith(".mrk.json") else bigus.read(path, **options)
                except bigus.Error as error:
                    self.assertEqual(str(error), str(theirs[name + "/error"]))
                    bad += 1
                    continue
                good += 1
                self.assertNotIn(name + "/error", theirs)
                if isinstance(data, bigus.Field):
                    found = {"centers": data.centers, "Scale": data.scales, "Rotation": data.rotations,
                             "Reflectivity": data.reflectivities, "provenance": np.array(data.provenance)}
                elif isinstance(data, bigus.Planes):
                    found = {"poses": data.poses, "sizes": data.sizes}
                else:
                    frames = theirs[name + "/frames"]
                    if frames.dtype == np.uint16:
                        frames = (frames / 65535.0).astype(np.float32)
                    np.testing.assert_array_equal(data.frames, frames)
                    found = {"poses": data.poses, "mask": data.mask.ravel()}
                for array, values in found.items():
                    np.testing.assert_array_equal(values, theirs[f"{name}/{array}"], err_msg=array)
        return good, bad

    def test_good_and_bad_files(self):
        whole = mha(compressed=True)
        texts = {
            "good": whole, "raw": mha(), "float": mha(pixels(np.float32)), "short": mha(pixels(np.int16)),
            "ushort": mha(pixels(np.uint16)), "narrow": mha((pixels(np.uint16) // 16).astype(np.uint16)),
            "turned": mha(UltrasoundImageOrientation="UN"), "empty": b"", "text": b"hello", "cut": whole[:-5],
            "more": mha() + b"x", "header": whole[:200], "big": mha(DimSize="5 4 999999999"), "negative": mha(DimSize="5 -4 3"),
            "far": mha(UltrasoundImageOrientation="FM"), "radio": mha(UltrasoundImageType="RF_REAL"),
            "type": mha(ElementType="MET_LONG"), "list": mha(ElementDataFile="LIST"), "out": mha(ElementDataFile="../a.raw"),
            "flat": mha(Seq_Frame0001_ImageToReferenceTransform="1 " * 16),
            "nan": mha(Seq_Frame0001_ImageToReferenceTransform="nan " * 16),
            "status": mha(**{f"Seq_Frame{k:04d}_ImageToReferenceTransformStatus": "INVALID" for k in range(FRAMES)}),
            "extra": mha(Seq_Frame0009_Timestamp="1"), "strange": mha(Seq_FrameX_Timestamp="1"), "latin": mha(UltrasoundImageOrientation="M\u00fc").decode().encode("latin-1"),
        }
        files = [(self.put(f"{name}.mha", data), {}) for name, data in texts.items()]
        files += [(self.put("list.nrrd", nrrd(pixels())), {}), (self.put("cut.nrrd", nrrd(pixels())[:-9]), {}),
                  (self.put("chain.mha", whole), {"ToFrame": "Tracker"}), (self.put("p.mrk.json", markups()), {}),
                  (self.put("bad.mrk.json", b'{"markups": [{"type": "Plane"}]}'), {}),
                  (self.put("config.mha", whole), {"ConfigFileName": str(self.put("c.xml", b"<a><b></a>")), "ToFrame": "Far"}),
                  (self.put("configured.mha", whole),
                   {"ConfigFileName": str(self.put("d.xml", config(ReferenceToFar=pose(2)))), "ToFrame": "Far"})]
        bigus.write(field(), self.folder / "f.vtp")
        bigus.write(field(), self.folder / "f.ply")
        vtp, ply = (self.folder / "f.vtp").read_bytes(), (self.folder / "f.ply").read_bytes()
        files += [(self.folder / "f.vtp", {}), (self.folder / "f.ply", {}), (DATA / "phantom-field.vtp", {})]
        for k in range(12):
            files.append((self.put(f"cut{k}.vtp", vtp[:len(vtp) * k // 12]), {}))
            files.append((self.put(f"cut{k}.ply", ply[:len(ply) * k // 12]), {}))
        for old, new in ((b'"Scale"', b'"Scala"'), (b'NumberOfPoints="700"', b'NumberOfPoints="701"'), (b"<Piece", b"<Piec\xc3"),
                         (b'offset="0"', b'offset="7"'), (b'NumberOfComponents="3"', b'NumberOfComponents="2"'),
                         (b'"FormatVersion"', b'"Gamma"')):
            files.append((self.put(f"m{len(files)}.vtp", vtp.replace(old, new, 1)), {}))
        good, bad = self.compare(files)
        self.assertGreater(good, 12)
        self.assertGreater(bad, 40)

    def test_writes_the_same_bytes(self):
        sweep = bigus.sweep(pixels(), [pose(k) for k in range(FRAMES)], timestamps=[0.1, 0.2, 0.4])
        bigus.write(sweep, self.folder / "s.mha")
        bigus.write(field(), self.folder / "f.vtp")
        bigus.write(field(), self.folder / "f.ply")
        script = "import bigus\nfor n in ('s.mha', 'f.vtp', 'f.ply'): bigus.write(bigus.read(n), 'their-' + n)"
        environment = {**os.environ, "PYTHONPATH": os.environ["BIGUS_VTK_PACKAGE"]}
        subprocess.run([os.environ["BIGUS_VTK_PYTHON"], "-c", script], check=True, cwd=self.folder, env=environment)
        for name in ("s.mha", "f.vtp"):
            self.assertEqual((self.folder / name).read_bytes(), (self.folder / f"their-{name}").read_bytes(), name)
        self.assertEqual((self.folder / "their-f.ply").stat().st_size, (self.folder / "f.ply").stat().st_size)

    def test_slices_see_directions_and_labels(self):
        bigus.write(field(), self.folder / "f.vtp")
        np.save(self.folder / "p.npy", pose(0.1))
        script = ("import bigus, numpy as np\nf, p = bigus.read('f.vtp'), np.load('p.npy')\n"
                  "np.savez('out.npz', image=bigus.reslice(f, p, (40, 30)), labels=bigus.label_map(f, p, (40, 30)), "
                  "share=bigus.reslice(f, p, (40, 30), OutputMode=2, LabelValue=7))")  # fmt: skip
        environment = {**os.environ, "PYTHONPATH": os.environ["BIGUS_VTK_PACKAGE"]}
        subprocess.run([os.environ["BIGUS_VTK_PYTHON"], "-c", script], check=True, cwd=self.folder, env=environment)
        theirs = np.load(self.folder / "out.npz")
        seen = bigus.reslice(field(), pose(0.1), (40, 30))
        np.testing.assert_array_equal(seen, theirs["image"])
        np.testing.assert_array_equal(bigus.label_map(field(), pose(0.1), (40, 30)), theirs["labels"])
        self.assertEqual(set(np.unique(theirs["labels"])), {0, 1, 7})
        self.assertGreater(np.abs(seen - bigus.reslice(plain(field()), pose(0.1), (40, 30))).max(), 0.01)
        self.assertEqual(field().transformed(np.eye(4)).labels, {1: "cyst", 7: "vein"})
        try:
            from bigus.vtkdata import polydata_of_field
        except ImportError:
            return
        reslice = bigus.vtkBigusReslice()
        reslice.SetInputData(polydata_of_field(field()))
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonMath import vtkMatrix4x4

        axes = vtkMatrix4x4()
        axes.DeepCopy(pose(0.1).ravel())
        reslice.SetOutputToFrame(axes, 40, 30)
        bigus.update(reslice)
        pixels = vtk_to_numpy(reslice.GetOutput().GetPointData().GetScalars()).reshape(30, 40)
        np.testing.assert_allclose(pixels, seen, atol=1e-6)
        reslice.SetOutputMode(reslice.LabelShare)
        reslice.SetLabelValue(7)
        bigus.update(reslice)
        share = vtk_to_numpy(reslice.GetOutput().GetPointData().GetScalars()).reshape(30, 40)
        self.assertGreater(np.ptp(share), 0.1)
        np.testing.assert_allclose(share, theirs["share"], atol=1e-6)
        reslice.SetLabelValue(3)
        with self.assertRaisesRegex(RuntimeError, "no label of the value 3"):
            bigus.update(reslice)

    def test_real_sweeps(self):
        folder = pathlib.Path(os.environ.get("BIGUS_DATA", "none"))
        spine = folder / "spine-phantom" / "SpinePhantomFreehand.igs.mha"
        brain = folder / "brain-sweep" / "us_brain_sweep.igs.mha"
        if not (spine.exists() and brain.exists()):
            self.skipTest(f"BIGUS_DATA does not hold {spine.name} and {brain.name}")
        xml = next(spine.parent.glob("*.xml"))
        self.assertEqual(self.compare([(spine, {"ConfigFileName": str(xml)}), (brain, {})]), (2, 0))


if __name__ == "__main__":
    unittest.main(verbosity=2)
