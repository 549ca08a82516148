#!/usr/bin/env python3
# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sequences full of names: none of them gets into any file that bigus writes. Module/IO/Metadata.md tells what does.

    test_metadata.py PATH_TO_BIGUS [unittest arguments]

Every text that could tell who was scanned holds one of NAMES, be it a field, a remark, a file or a folder. What is written is
searched for them as it is and unpacked, in one byte a character and in two.
"""
import json
import pathlib
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib

BIGUS = None
# So long that no pixels, compressed or in base 64, spell one by chance.
NAMES = ("weatherbee", "josephine", "kx47-11", "st. mary", "1947-07-11")
DATE = 1714550400.25  # s since 1970: 1 May 2024
FRAMES, WIDTH, HEIGHT = 10, 40, 32
TINY = ["--no-auto", "--gaussians", "300", "--iterations", "8", "--batch", "2"]


def run(*arguments):
    return subprocess.run([BIGUS, *map(str, arguments)], capture_output=True, text=True, timeout=300)


def unpacked(data):
    """The bytes, and what any stream of zlib or gzip in them holds."""
    yield data
    for match in re.finditer(rb"\x78[\x01\x5e\x9c\xda]|\x1f\x8b\x08", data):
        stream = zlib.decompressobj(47)  # either kind
        try:
            yield stream.decompress(data[match.start():], 1 << 24)
        except zlib.error:
            pass  # those bytes were pixels


def names_in(data):
    found = set()
    for part in unpacked(data):
        text = part.lower()
        found |= {name for name in NAMES if name.encode() in text or name.encode("utf-16-le") in text}
    return found


def png(width, height, pixels, text):
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows = b"".join(b"\0" + pixels[y * width:(y + 1) * width] for y in range(height))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
            + chunk(b"tEXt", b"Author\0" + text) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


class Metadata(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.root = pathlib.Path(tempfile.mkdtemp(prefix="bigus-metadata-"))
        cls.folder = cls.root / "Weatherbee, Josephine KX47-11"  # what is read
        cls.folder.mkdir()
        plain = cls.root / "plain.igs.mha"
        made = run("phantom", "-o", plain, "--frames", FRAMES, "--width", WIDTH, "--height", HEIGHT, "--pixel-size", "0.6",
                   "--frame-spacing", "0.8", "--tracking-noise", "0.2")
        assert made.returncode == 0, made.stderr
        data = plain.read_bytes()
        mark = b"ElementDataFile = LOCAL\n"
        header, cls.pixels = data[:data.index(mark)].decode(), data[data.index(mark) + len(mark):]
        if "CompressedData = True" in header:
            cls.pixels = zlib.decompress(cls.pixels)
        cls.poses = [line.split() for line in re.findall(r"Seq_Frame\d+_ImageToReferenceTransform = (.*)", header)]
        assert len(cls.poses) == FRAMES
        cls.mha, cls.nrrd, cls.csv = cls.meta_image(), cls.nrrd_file(), cls.table()

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.root)

    @classmethod
    def frame_fields(cls, assign):
        lines = []
        for k in range(FRAMES):
            for name, value in (("ImageToReferenceTransform", " ".join(cls.poses[k])), ("ImageToReferenceTransformStatus", "OK"),
                                ("Timestamp", DATE + k / 20), ("ImageStatus", "OK"), ("Operator", "Josephine"),
                                ("FrameNumber", k), ("Remark", "pain, says Mrs Weatherbee")):
                lines.append(f"Seq_Frame{k:04}_{name}{assign}{value}")
        return lines

    @classmethod
    def meta_image(cls):
        lines = ["ObjectType = Image", "NDims = 3", "Comment = Weatherbee^Josephine", "Name = Josephine Weatherbee", "ID = KX47-11",
                 "AcquisitionDate = 1947-07-11", "PatientName = WEATHERBEE^JOSEPHINE", "BinaryData = True", "BinaryDataByteOrderMSB = False",
                 "CompressedData = False", f"DimSize = {WIDTH} {HEIGHT} {FRAMES}", "ElementType = MET_UCHAR",
                 "UltrasoundImageOrientation = MF", "UltrasoundImageType = BRIGHTNESS", "Hospital = St. Mary",
                 *cls.frame_fields(" = "), "ElementDataFile = LOCAL"]
        path = cls.folder / "Josephine Weatherbee.igs.mha"
        path.write_bytes("\n".join(lines).encode() + b"\n" + cls.pixels)
        return path

    @classmethod
    def nrrd_file(cls):
        lines = ["NRRD0005", "# Josephine Weatherbee, St. Mary", "type: uint8", "dimension: 3", f"sizes: {WIDTH} {HEIGHT} {FRAMES}",
                 "kinds: domain domain list", "encoding: raw", "content: liver of Josephine Weatherbee", "PatientID:=KX47-11",
                 "labels: \"Josephine\" \"Weatherbee\" \"KX47-11\"", "birthday:=1947-07-11", *cls.frame_fields(":=")]
        path = cls.folder / "Josephine Weatherbee.seq.nrrd"
        path.write_bytes("\n".join(lines).encode() + b"\n\n" + cls.pixels)
        return path

    @classmethod
    def table(cls):
        names = [f"m{n // 4}{n % 4}" for n in range(16)]
        rows = ["# Josephine Weatherbee", ",".join(["image", "timestamp", "patient", *names])]
        rows[0], rows[1] = rows[1], rows[0]  # names come first
        for k in range(FRAMES):
            image = f"weatherbee_josephine_{k:02}.png"
            size = WIDTH * HEIGHT
            (cls.folder / image).write_bytes(png(WIDTH, HEIGHT, cls.pixels[k * size:(k + 1) * size], b"Josephine Weatherbee, KX47-11"))
            rows.append(",".join([image, repr(DATE + k / 20), '"Weatherbee, Josephine"', *cls.poses[k]]))
        path = cls.folder / "Josephine Weatherbee.csv"
        path.write_text("\n".join(rows) + "\n")
        return path

    def setUp(self):
        self.out = pathlib.Path(tempfile.mkdtemp(dir=self.root, prefix="out-"))

    def do(self, *arguments):
        result = run(*arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def assertNoNames(self):
        files = sorted(path for path in self.out.rglob("*") if path.is_file())
        self.assertTrue(files)
        for path in files:
            with self.subTest(file=path.name):
                self.assertEqual(names_in(path.read_bytes()), set())
        return {path.name for path in files}

    def sources(self):
        return (("mha", self.mha), ("nrrd", self.nrrd), ("csv", self.csv))

    def test_the_search_finds_names_that_are_packed(self):
        hidden = b"\0" * 7 + zlib.compress("Patient: WEATHERBEE^JOSEPHINE".encode("utf-16-le")) + b"more"
        self.assertEqual(names_in(hidden), {"weatherbee", "josephine"})
        image = self.csv.with_name("weatherbee_josephine_00.png").read_bytes()
        self.assertEqual(names_in(image), {"weatherbee", "josephine", "kx47-11"})

    def test_fields_and_all_that_training_writes(self):
        for kind, source in self.sources():
            for ending in (".vtp", ".ply"):
                self.do("train", source, "-o", self.out / f"{kind}{ending}", *TINY, "--hold-out", 4, "--log",
                        self.out / f"{kind}.log.csv", "--write-poses", self.out / f"{kind}.poses.igs.mha")
        answer = json.loads(self.do("train", self.mha, "-o", self.out / "json.vtp", *TINY, "--json").stdout)
        self.assertEqual(names_in(json.dumps(answer).encode()), set())
        self.assertEqual(len(self.assertNoNames()), 13)

    def test_a_checkpoint(self):
        field = self.out / "field.vtp"
        self.do("train", self.mha, "-o", field, *TINY[:-4], "--iterations", 100000, "--time-limit", 2, "--checkpoint-interval", 0.2)
        self.assertIn("field.vtp.checkpoint", self.assertNoNames())

    def test_sequences_poses_and_slices(self):
        field = self.out / "field.vtp"
        self.do("train", self.mha, "-o", field, *TINY)
        for kind, source in self.sources():
            for ending in (".igs.mha", ".nrrd", ".seq.nrrd", ".png"):
                self.do("convert", source, self.out / f"{kind}{ending}")
            for ending in (".igs.mha", ".csv"):
                self.do("poses", source, "-o", self.out / f"{kind}.corrected{ending}", "--strength", 1)
            self.do("slice", field, "--poses", source, "-o", self.out / f"{kind}.slices.igs.mha", "--distance",
                    self.out / f"{kind}.distance.mha", "--recorded", source)
        for ending in (".mha", ".nrrd", ".vti"):
            self.do("slice", field, "--poses", self.mha, "--frames", 3, "-o", self.out / "one.png", "--volume",
                    self.out / f"plane{ending}")
            self.do("voxelize", field, "-o", self.out / f"volume{ending}", "--spacing", 2)
        self.assertNoNames()

    def test_a_configuration(self):
        config = self.folder / "Josephine Weatherbee.xml"
        config.write_text("""<PlusConfiguration version="2.9"><!-- Josephine Weatherbee --><Patient Name="WEATHERBEE^JOSEPHINE" ID="kx47-11"/>
          <CoordinateDefinitions><Transform From="Reference" To="World" Matrix="1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1"
          Date="1947-07-11" Operator="Weatherbee"/></CoordinateDefinitions></PlusConfiguration>""")
        chain = ["--config", config, "--image-to", "World"]
        self.do("train", self.mha, "-o", self.out / "field.vtp", *chain, *TINY)
        self.do("convert", self.mha, self.out / "sweep.igs.mha", *chain)
        self.assertNoNames()

    def test_info_shows_what_is_not_taken_along(self):
        for kind, source in self.sources():
            found = {field["name"]: field for field in json.loads(self.do("info", source, "--json").stdout)["not_taken_along"]}
            wanted = {"mha": {"Comment", "Name", "ID", "AcquisitionDate", "PatientName", "Hospital", "Operator", "FrameNumber",
                              "Remark"},
                      "nrrd": {"comment", "content", "labels", "PatientID", "birthday", "Operator", "FrameNumber", "Remark"},
                      "csv": {"comment", "patient"}}[kind]
            self.assertEqual(set(found), wanted, kind)
        text = self.do("info", self.mha).stdout
        self.assertRegex(text, r"Operator = Josephine \(and 9 more\)")
        written = self.out / "again.igs.mha"
        self.do("convert", self.mha, written)
        self.assertEqual(json.loads(self.do("info", written, "--json").stdout)["not_taken_along"], [])

    def times(self, path):
        return [float(time) for time in re.findall(rb"_Timestamp ?:?= ?(\S+)", path.read_bytes())]

    def test_strip_of_a_sequence(self):
        for ending in (".igs.mha", ".nrrd"):
            kept, stripped = self.out / f"kept{ending}", self.out / f"stripped{ending}"
            self.do("convert", self.mha, kept)
            self.do("convert", self.mha, stripped, "--strip")
            self.assertEqual(self.times(kept)[0], DATE)
            for k, time in enumerate(self.times(stripped)):
                self.assertAlmostEqual(time, k / 20, places=5)
            self.assertEqual(json.loads(self.do("metrics", kept, stripped, "--json").stdout)["psnr"], None)

    def test_strip_of_a_field(self):
        # A field of another program, or one that somebody wrote notes into.
        field, noted = self.out / "field.ply", self.folder / "noted.ply"
        self.do("train", self.mha, "-o", field, *TINY)
        mark = b"comment bigus.provenance "
        noted.write_bytes(field.read_bytes().replace(mark, mark + b"patient=Josephine Weatherbee\ncomment Josephine Weatherbee\n" + mark, 1))
        provenance = json.loads(self.do("info", noted, "--json").stdout)["provenance"]
        self.assertEqual(provenance["patient"], "Josephine Weatherbee")
        self.assertIn("poses", provenance)
        kept = self.folder / "kept.vtp"
        self.do("convert", noted, kept)
        self.assertEqual(names_in(kept.read_bytes()), {"weatherbee", "josephine"})
        for ending in (".vtp", ".ply"):
            stripped = self.out / f"stripped{ending}"
            self.do("convert", noted, stripped, "--strip")
            self.assertEqual(json.loads(self.do("info", stripped, "--json").stdout)["provenance"], {})
            pictures = [self.out / f"{name}.igs.mha" for name in ("before", "after")]
            for one, picture in zip((noted, stripped), pictures):
                self.do("slice", one, "--poses", self.mha, "-o", picture)
            self.assertEqual(pictures[0].read_bytes(), pictures[1].read_bytes())
        # What is computed from a field that holds names does not hold them.
        self.do("voxelize", kept, "-o", self.out / "volume.vti", "--spacing", 2)
        self.do("train", self.mha, "-o", self.out / "continued.vtp", *TINY, "--continue", kept)
        self.assertNoNames()

    def test_a_sweep_is_known_again_without_its_name(self):
        field, poses = self.out / "field.vtp", self.out / "poses.igs.mha"
        self.do("train", self.mha, "-o", field, *TINY, "--pose-smoothing", 1, "--reduce", 2, "--write-poses", poses)
        note = "these planes are as tracked"
        for source in (self.mha, self.nrrd, self.csv):  # the same poses
            self.assertIn(note, self.do("slice", field, "--poses", source, "-o", self.out / "s.mha").stderr)
        self.assertNotIn(note, self.do("slice", field, "--poses", poses, "-o", self.out / "s.mha").stderr)


if __name__ == "__main__":
    BIGUS = sys.argv.pop(1)
    unittest.main()
