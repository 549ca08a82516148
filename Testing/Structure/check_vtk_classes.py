# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""What VTK asks of a class, read from the headers of all vtkBigus classes.

    check_vtk_classes.py FOLDER   the project's root; prints what is missing and fails when something is

PrintSelf prints every value that has a Get macro, classes of VTK are declared in its ABI namespace, and a macro that a
header defines with VTK's prefix is undefined at its end.
"""

import pathlib
import re
import sys

# By VTK's macros, and by hand: "Type* GetName() const { return this->Name; }".
GETTERS = (r"vtkGet(?:String|FilePath|Object|Vector[2346])?Macro\((\w+)",
           r"\bGet(\w+)\(\) (?:const )?\{ return this->\1; \}")  # fmt: skip
GUARDED = re.compile(r"#ifdef VTK_ABI_NAMESPACE_BEGIN[^\n]*\nVTK_ABI_NAMESPACE_BEGIN\n#endif\n(.*?)"
                     r"#ifdef VTK_ABI_NAMESPACE_END\nVTK_ABI_NAMESPACE_END\n#endif\n", re.DOTALL)  # fmt: skip
FORWARD = r"^class (vtk\w+);$"


def printed_by(source):
    body = re.search(r"::PrintSelf\(.*?\n\}", source, re.DOTALL)
    return body.group(0) if body else ""


def wrong_in(header, source):
    printed = printed_by(source)
    names = [name for getter in GETTERS for name in re.findall(getter, header)]
    yield from (f"PrintSelf does not print {name}" for name in names if not re.search(rf'"{name}\b', printed))
    inside = {name for block in GUARDED.findall(header) for name in re.findall(FORWARD, block, re.MULTILINE)}
    for name in re.findall(FORWARD, header, re.MULTILINE):
        if name.startswith("vtkBigus") == (name in inside):
            yield f"{name} is declared {'inside' if name in inside else 'outside'} VTK's ABI namespace"
    for macro in re.findall(r"^#define (vtk\w+)\(", header, re.MULTILINE):
        if not re.search(rf"^#undef {macro}$", header, re.MULTILINE):
            yield f"{macro} stays defined"


def main():
    root = pathlib.Path(sys.argv[1])
    headers = [p for folder in ("Filters", "Rendering", "Module") for p in sorted((root / folder).rglob("vtkBigus*.h"))]
    wrong = []
    for path in headers:
        source = path.with_suffix(".cxx")
        texts = path.read_text(), source.read_text() if source.exists() else ""
        wrong += [f"{path.relative_to(root)}: {what}" for what in wrong_in(*texts)]
    if len(headers) < 20:
        wrong.append(f"only {len(headers)} headers of vtkBigus classes were found")
    print("\n".join(wrong) or f"{len(headers)} classes print what they hold.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
