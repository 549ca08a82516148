# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The programs that 3D Slicer runs: what they say of themselves, what they do when called as Slicer calls them, and how they
tell their progress.

    test_modules.py BIGUS FOLDER [TEST...]     the program, and the folder with BigusTrain, BigusSlice, ...

With ctk-cli from PyPI its parser is asked, too. $BIGUS_CLI_SCHEMA may name ctkCmdLineModule.xsd of CTK; with it and lxml
or xmllint the descriptions are checked against it.
"""
import contextlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ET

BIGUS, MODULES = sys.argv[1], pathlib.Path(sys.argv[2])
COMMANDS = {"BigusTrain": "train", "BigusSlice": "slice", "BigusVoxelize": "voxelize", "BigusLabel": "label",
            "BigusPoses": "poses"}
PROGRAM_OPTIONS = {"threads", "simd", "memory"}  # of the whole program, which modules have, too


def run(program, *arguments):
    return subprocess.run([str(program), *map(str, arguments)], capture_output=True, text=True)


def describe(module):
    result = run(MODULES / module, "--xml")
    assert result.returncode == 0 and result.stderr == "", result.stderr
    return ET.fromstring(result.stdout)


def parameters(executable):
    for group in executable.iter("parameters"):
        for element in group:
            if element.tag not in ("label", "description"):
                yield element


def slicer_arguments(executable, values):
    """The command line as vtkSlicerCLIModuleLogic builds it: numbers and enumerations are always there, text, files and
    vectors where they are not empty, booleans where true; what has an index comes last."""
    line, last = [], []
    for element in parameters(executable):
        name = element.findtext("name")
        value = str(values.get(name, element.findtext("default") or ""))
        if element.find("index") is not None:
            last.append((int(element.findtext("index")), value))
        elif element.tag == "boolean":
            line += [element.findtext("longflag")] if value == "true" else []
        elif element.tag in ("integer", "double", "string-enumeration") or value:
            line += [element.findtext("longflag"), value]
    unknown = set(values) - {element.findtext("name") for element in parameters(executable)}
    assert not unknown, unknown
    return line + [value for _, value in sorted(last)]


class Descriptions(unittest.TestCase):
    def test_schema_by_hand(self):
        """The order and the names that CTK's schema asks for."""
        for module in COMMANDS:
            executable = describe(module)
            tags = [child.tag for child in executable]
            self.assertEqual(tags[:6], ["category", "title", "description", "version", "license", "contributor"])
            self.assertEqual(set(tags[6:]), {"parameters"})
            names = []
            for group in executable.iter("parameters"):
                self.assertEqual([child.tag for child in group][:2], ["label", "description"])
                self.assertGreater(len(group), 2)
            for element in parameters(executable):
                names.append(element.findtext("name"))
                self.assertRegex(names[-1], r"^[_a-zA-Z][_a-zA-Z0-9]*$")
                order = [child.tag for child in element if child.tag != "element"]
                allowed = ["name", "longflag", "index", "description", "label", "default", "channel", "constraints"]
                self.assertEqual(order, [tag for tag in allowed if tag in order], names[-1])
                self.assertTrue(("longflag" in order) != ("index" in order))
                if "longflag" in order:
                    self.assertRegex(element.findtext("longflag"), r"^--[_a-zA-Z][_a-zA-Z0-9]*$")
                self.assertIn(element.tag, {"boolean", "integer", "double", "string", "integer-vector", "double-vector",
                                            "string-enumeration", "file", "image", "transform"})
                self.assertTrue("longflag" in order or element.get("multiple") is None)
                if element.tag in ("file", "image", "transform"):
                    self.assertIn(element.findtext("channel"), ("input", "output"))
                    self.assertRegex(element.get("fileExtensions"), r"^\.[^,]+(,\.[^,]+)*$")
                if element.tag == "string-enumeration":
                    self.assertIn(element.findtext("default"), [e.text for e in element.iter("element")], names[-1])
                if element.tag in ("integer", "double"):
                    value = float(element.findtext("default"))
                    if "constraints" in order:
                        self.assertTrue(float(element.findtext("constraints/minimum")) <= value <=
                                        float(element.findtext("constraints/maximum")))
            self.assertEqual(len(names), len(set(names)))

    def test_no_option_is_missing(self):
        """What the help lists is what the description has: both come from one list, which this guards."""
        for module, command in COMMANDS.items():
            text = run(BIGUS, command, "--help").stdout
            listed = set()
            for line in text.split("\nAlso:")[0].splitlines():
                found = re.match(r"  (?:-\w,)?--([a-z][a-z-]*)", line)
                if found and found.group(1) != "help":
                    listed.add(found.group(1))
            shorthand = {"auto", "preview", "signed", "positive"} if command == "train" else set()
            positional = {name.lower() for name in re.findall(r"\n  ([A-Z]+) ", text.split("\nOptions:")[0])}
            self.assertEqual(len(positional), {"train": 2, "label": 3}.get(command, 1))
            described = {element.findtext("name") for element in parameters(describe(module)) if element.tag != "transform"}
            self.assertEqual(described - PROGRAM_OPTIONS - positional,
                             {name.replace("-", "_") for name in listed - shorthand}, module)

    def test_what_must_be_given_comes_first_and_units_are_told(self):
        for module in COMMANDS:
            first, *others = describe(module).iter("parameters")
            self.assertIsNone(first.get("advanced"))
            self.assertTrue(all(group.get("advanced") == "true" for group in others))
            computing = next(group for group in others if group.findtext("label") == "Computing")
            self.assertEqual({name.text for name in computing.iter("name")} - {"engine"}, PROGRAM_OPTIONS)
        first = describe("BigusSlice").find("parameters")
        self.assertLessEqual({"field", "poses", "output"}, {name.text for name in first.iter("name")})
        described = {element.findtext("name"): element for element in parameters(describe("BigusSlice"))}
        self.assertEqual(described["elevation_sigma"].findtext("label"), "Elevation sigma (mm)")
        self.assertEqual(described["memory"].findtext("label"), "Memory (GB)")
        for module, name in (("BigusSlice", "standard_error_volume"), ("BigusVoxelize", "standard_error")):
            element = next(one for one in parameters(describe(module)) if one.findtext("name") == name)
            self.assertEqual((element.tag, element.findtext("channel")), ("image", "output"))

    def test_defaults_are_those_of_the_trainer(self):
        """Options.md holds the table that Core writes of its list."""
        page = pathlib.Path(__file__).parents[2] / "Module/Core/Training/Options.md"
        rows = dict(re.findall(r"\n\| `([A-Za-z]+)` \| `?([^|`]*)`? \|", page.read_text()))
        self.assertGreater(len(rows), 25)
        described = {e.findtext("name"): e for e in parameters(describe("BigusTrain"))}
        for name, default in rows.items():
            element = described[re.sub(r"(?<!^)([A-Z])", r"_\1", name).lower()]
            self.assertEqual(element.findtext("default") or "", default.strip(), name)

    def test_schema(self):
        path = os.environ.get("BIGUS_CLI_SCHEMA")
        if not path:
            self.skipTest("$BIGUS_CLI_SCHEMA does not name ctkCmdLineModule.xsd of CTK")
        # "(?:" is no part of the regular expressions that schemas have.
        text = pathlib.Path(path).read_text().replace("(?:", "(")
        with tempfile.TemporaryDirectory() as folder:
            schema = pathlib.Path(folder) / "schema.xsd"
            schema.write_text(text)
            for module in COMMANDS:
                file = pathlib.Path(folder) / "description.xml"
                file.write_text(run(MODULES / module, "--xml").stdout)
                if shutil.which("xmllint"):
                    result = run("xmllint", "--noout", "--schema", schema, file)
                    self.assertEqual(result.returncode, 0, result.stderr)
                else:
                    from lxml import etree  # a missing one is an error here, because a schema was given
                    etree.XMLSchema(etree.parse(str(schema))).assertValid(etree.parse(str(file)))

    def test_ctk_cli(self):
        try:
            import ctk_cli
        except ImportError as error:
            self.skipTest(str(error))
        for module in COMMANDS:
            with self.assertNoLogs("ctk_cli") if hasattr(self, "assertNoLogs") else contextlib.nullcontext():
                parsed = ctk_cli.CLIModule(str(MODULES / module))
            arguments, options, outputs = parsed.classifyParameters()
            self.assertEqual((parsed.name, len(arguments), len(outputs)), (module, 3 if module == "BigusLabel" else 1, 0))
            self.assertEqual(len(options) + len(arguments), len(list(parameters(describe(module)))))


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.sweep, cls.field = cls.folder / "sweep.igs.mha", cls.folder / "field.vtp"
        run(BIGUS, "phantom", "-o", cls.sweep, "--frames", 17, "--width", 64, "--height", 48, "--pixel-size", 0.5)
        result = run(BIGUS, "train", cls.sweep, "-o", cls.field, "--no-auto", "--iterations", 40, "--threads", 2)
        assert result.returncode == 0, result.stderr

    def module(self, name, **values):
        result = run(MODULES / name, *slicer_arguments(describe(name), values))
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_train_is_the_command(self):
        """All defaults said, as Slicer says them, train the same bytes as none said."""
        output = self.folder / "again.vtp"
        text = self.module("BigusTrain", sequence=self.sweep, output=output, automatic="off", iterations=40, threads=2)
        self.assertEqual(output.read_bytes(), self.field.read_bytes())
        self.check_progress(text, {"Reading", "Training", "Writing"})

    def test_further_sequences_train_one_field(self):
        """As Slicer gives several files for one option, with commas between, and as the schema allows, one by one."""
        other = self.folder / "turned, by 90.igs.mha"
        run(BIGUS, "phantom", "-o", other, "--frames", 9, "--width", 64, "--height", 48, "--pixel-size", 0.5,
            "--sweep-angle", 90)
        plain, output = self.folder / "three.vtp", self.folder / "module.vtp"
        options = ["--no-auto", "--iterations", 40, "--threads", 2]
        result = run(BIGUS, "train", self.sweep, other, self.sweep, "-o", plain, *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.module("BigusTrain", sequence=self.sweep, more=f'"{other}",{self.sweep}', output=output, automatic="off",
                    iterations=40, threads=2)
        self.assertEqual(output.read_bytes(), plain.read_bytes())
        output.unlink()
        result = run(MODULES / "BigusTrain", "--more", f'"{other}"', "--more", self.sweep, "--output", output,
                     "--automatic", "off", "--iterations", 40, "--threads", 2, self.sweep)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(output.read_bytes(), plain.read_bytes())
        result = run(MODULES / "BigusTrain", "--more", f"{self.sweep},missing.mha", "--output", output, self.sweep)
        self.assertEqual(result.returncode, 2)
        self.assertIn("missing.mha", result.stderr)

    def test_slice_is_the_command(self):
        output, plain = self.folder / "module.igs.mha", self.folder / "command.igs.mha"
        text = self.module("BigusSlice", field=self.field, poses=self.sweep, output=output, frames="0,4,10-12",
                           size="60,40", spacing=0.4)
        result = run(BIGUS, "slice", self.field, "--poses", self.sweep, "-o", plain, "--frames", "0,4,10-12", "--size", 60,
                     40, "--spacing", 0.4)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(output.read_bytes(), plain.read_bytes())
        self.check_progress(text, {"Reading", "Slicing"})

    def test_a_transform_of_the_scene_is_a_plane(self):
        place, output, plain = (self.folder / name for name in ("place.tfm", "module.png", "command.png"))
        place.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
                         "Parameters: 1 0 0 0 1 0 0 0 1 -10 0 0\nFixedParameters: 0 0 0\n")
        self.module("BigusSlice", field=self.field, poses_transform=place, output=output, size="40,30")
        result = run(BIGUS, "slice", self.field, "--poses", place, "-o", plain, "--size", 40, 30)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(output.read_bytes(), plain.read_bytes())

    def test_a_slice_and_its_standard_error_are_two_volumes_at_one_place(self):
        slice, error, stack = (self.folder / name for name in ("slice.nrrd", "error.nrrd", "stack.nrrd"))
        self.module("BigusSlice", field=self.field, poses=self.sweep, frames="8", volume=slice, standard_error_volume=error)
        result = run(BIGUS, "slice", self.field, "--poses", self.sweep, "--frames", 8, "-o", self.folder / "s.mha", "--standard-error", stack)
        self.assertEqual(result.returncode, 0, result.stderr)
        headers, values = zip(*(path.read_bytes().split(b"\n\n", 1) for path in (slice, error)))
        places = [re.findall(rb"\n(?:sizes|space directions|space origin):[^\n]*", header) for header in headers]
        self.assertEqual(len(places[0]), 3)
        self.assertEqual(places[0], places[1])
        self.assertEqual(len(values[1]), 4 * 64 * 48)
        self.assertTrue(stack.read_bytes().endswith(values[1]))
        result = run(BIGUS, "slice", self.field, "--poses", self.sweep, "-o", self.folder / "s.mha", "--standard-error-volume", error)
        self.assertEqual(result.returncode, 2)
        self.assertIn("--standard-error-volume holds one slice", result.stderr)

    def test_voxelize_and_poses(self):
        volume, poses = self.folder / "volume.nrrd", self.folder / "poses.csv"
        self.check_progress(self.module("BigusVoxelize", field=self.field, output=volume, origin="-5,-6,1", size="8,9,7",
                                        spacing=0.5), {"Reading", "Sampling"})
        self.assertIn(b"sizes: 8 9 7\n", volume.read_bytes())
        self.check_progress(self.module("BigusPoses", sequence=self.sweep, output=poses), {"Reading", "Comparing"})
        self.assertEqual(len(poses.read_text().splitlines()), 18)

    def test_faults(self):
        """A code that is not 0, and the reason on stderr."""
        for values, code, words in (({"field": "missing.vtp", "poses": self.sweep, "output": "x.mha"}, 2, "missing.vtp"),
                                    ({"field": self.field, "poses": self.sweep}, 1, "--output or --volume"),
                                    ({"field": self.field, "poses": self.sweep, "output": "x.mha", "reduce": 1.5}, 1,
                                     "whole number")):
            result = run(MODULES / "BigusSlice", *slicer_arguments(describe("BigusSlice"), values))
            self.assertEqual(result.returncode, code, result.stderr)
            self.assertIn(words, result.stderr)

    def check_progress(self, text, jobs):
        """Every job starts, goes up to 1 and ends, and what is left after taking the tags out is for people."""
        open_job, names, fraction = None, set(), 0.0
        for line in re.findall(r"<filter-start>|</filter-end>|<filter-name>.*</filter-name>|<filter-progress>.*</filter-progress>",
                               text):
            if line == "<filter-start>":
                self.assertIsNone(open_job)
                open_job, fraction = "", 0.0
            elif line == "</filter-end>":
                names.add(open_job)
                open_job = None
            elif line.startswith("<filter-name>"):
                open_job = line[13:-14]
            else:
                self.assertIsNotNone(open_job)
                value = float(line[17:-18])
                self.assertTrue(fraction <= value <= 1, line)
                fraction = value
        self.assertIsNone(open_job)
        self.assertLessEqual(jobs, names)
        # As Slicer takes the tags out: innermost ones first, then those that only hold space.
        for tag in ("progress", "name", "comment", "time", "start", "end"):
            text = re.sub(rf"<filter-{tag}>[^<]*</filter-{tag}>[ \t\n\r]*", "", text)
        self.assertNotIn("<filter", text)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
