# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What editors, type checkers and help() need, from the lists and headers that say it.

    generate.py FOLDER HEADER...

Writes FOLDER/_options.pyi, a TypedDict of every function's options in both spellings, and FOLDER/documentation.py, what
the headers of VTK's classes say of their properties. PYTHONPATH leads to _core, which is all that it needs.
"""

import pathlib
import pprint
import re
import runpy
import sys

import _core

WHEEL = pathlib.Path(__file__).resolve().parent
LICENCE = "# SPDX-FileCopyrightText: BIGUS authors\n# SPDX-License-Identifier: BSD-3-Clause\n"
TYPES = {"bool": 'Union[bool, Literal["on", "off"]]', "int": 'Union[int, Literal["auto"]]',
         "float": 'Union[float, Literal["auto"]]', "str": "str"}  # of options that may be given as text
BLOCK = re.compile(r"/\*\*(?!\s*\n\s*\* @class)\s*(.*?)\s*\*/\n(.*?)(?=\n\s*(?:\n|///@\}|/\*\*|\};)|\Z)", re.DOTALL)
NAME = re.compile(r"^\s*(?:vtk\w*Macro\(|[\w:*&<> ]*?\b(?:(?:Set|Get)(?=\w+\())?)(\w+)[(,)]", re.MULTILINE)


def type_of(name, value):
    if isinstance(value, tuple):
        return f"Sequence[{type_of(name, value[0])}]"
    is_path = isinstance(value, str) and name.endswith(("FileName", "Folder"))
    return "Union[str, PathLike[str]]" if is_path else type(value).__name__


def typed_dict(name, types, snake_case):
    lines = [f"class {name}(TypedDict, total=False):"]
    for option, kind in types.items():
        lines += [f"    {one}: Optional[{kind}]" for one in dict.fromkeys((option, snake_case(option)))]
    return "\n".join(lines) + "\n"


def options():
    """The text of _options.pyi."""
    tables = runpy.run_path(str(WHEEL / "bigus" / "settings.py"))
    names = runpy.run_path(str(WHEEL.parent / "Python" / "bigus" / "names.py"))
    spell = names["snake_case"]
    text = LICENCE + "from os import PathLike\nfrom typing import Literal, Optional, Sequence, TypedDict, Union\n"
    found = {"TrainOptions": {option["name"]: TYPES[option["type"]] for option in _core.options()}}
    phantom = {**{names["vtk_case"](name): value for name, value in _core.phantom_options().items()}, **tables["PHANTOM"]}
    written = {**tables["SEQUENCE_OUTPUT"], **tables["FIELD_OUTPUT"]}
    for name, table in (("PoseOptions", tables["POSES"]), ("SequenceOptions", tables["SEQUENCE"]), ("WriteOptions", written),
                        ("CorrectionOptions", tables["CORRECTION"]), ("SlicerOptions", tables["SLICER"]),
                        ("PhantomOptions", phantom)):
        found[name] = {option: type_of(option, value) for option, value in table.items()}
    return "\n".join([text, *(typed_dict(name, types, spell) for name, types in found.items())])


def documentation(headers):
    """What is said of every property and method, by class and name without Set and Get."""
    classes, bases = {}, {}
    for header in headers:
        said, text = classes.setdefault(header.stem, {}), header.read_text()
        bases.update(re.findall(r"class \w+ (vtkBigus\w+) : public (vtkBigus\w+)", text))
        for comment, members in BLOCK.findall(text.partition("\npublic:")[2]):
            text = " ".join(re.sub(r"^\s*\* ?", "", line) for line in comment.splitlines()).strip()
            for found in NAME.findall(members):
                said.setdefault(found, text)
    for name, base in bases.items():
        classes[name] = {**classes[base], **classes[name]}
    return classes


def main(folder, *headers):
    (folder / "_options.pyi").write_text(options())
    classes = pprint.pformat(documentation(headers), width=200)
    said = f'"""What VTK\'s classes say of their properties and methods; made from their headers."""\n\nCLASSES = {classes}\n'
    (folder / "documentation.py").write_text(LICENCE + said)


if __name__ == "__main__":
    main(*map(pathlib.Path, sys.argv[1:]))
