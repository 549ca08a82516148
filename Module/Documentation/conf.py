# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Sphinx's configuration of the site. README.md of this folder tells how it is built.

Its sources are the Markdown pages of the whole project where they lie, so links and pictures need no rewriting. Three
things are made at build time: the table of contents, which is the list below and all other pages after it; the
functions of Python, read from the sources without importing them; and the classes of C++, by Doxygen.
"""

import ast
import os
import pathlib
import re
import shutil
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]

project = "BIGUS"
copyright = "BIGUS authors"
version = re.search(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
extensions = ["myst_parser"]
root_doc = "README"
ROOMS = ("Cuda", "Examples", "Filters", "Module", "Rendering", "Testing")  # what else lies there was built
include_patterns = ["*.md", *(f"{room}/**.md" for room in ROOMS)]
myst_heading_anchors = 6
html_theme = "furo"
html_title = f"BIGUS {version}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False

# What a user reads, in this order. The pages of all other rooms follow by themselves.
CONTENTS = {
    "From a bare machine": [
        "Module/Documentation/StartVtk", "Module/Documentation/StartPython", "Module/ParaView/README",
        "Module/Documentation/StartSlicer", "Module/Documentation/StartBrowser",
    ],
    "Use": [
        "Module/Python/Sources", "Module/Documentation/BeforeTraining", "Module/Documentation/Choosing", "Module/Documentation/Troubleshooting", "Examples/README",
        "Module/Command/README", "Module/Viewer/README", "Module/Live/README", "Module/Command/Slicer",
        "Module/Serve/README",
    ],
    "Look up": [
        "Module/Documentation/Coordinates", "Module/IO/README", "Module/Core/Training/Options",
        "Module/Documentation/Reference", "Module/Python/README", "Module/Wheel/README", "Filters/README",
        "Rendering/README", "CHANGELOG",
    ],
    "Understand": ["Module/Core/Model/README", "Module/Core/Training/README", "Module/Core/Deciding/README",
                   "Module/Core/Poses/README", "Testing/Benchmarks/experiments/README", "Testing/Benchmarks/Speed/README"],
}  # fmt: skip


def contents(environment):
    listed = {page for pages in CONTENTS.values() for page in pages} | {root_doc}
    rest = sorted(environment.found_docs - listed, key=lambda page: (not page.startswith(("CON", "Mod")), page))
    return "".join(
        "\n\n```{toctree}\n:hidden:\n:caption: " + caption + "\n\n" + "\n".join(pages) + "\n```\n"
        for caption, pages in [*CONTENTS.items(), ("Inside", rest)])


# ----------------------------------------------------------------------------------------------------------------------
# The functions of Python

def imported(package):
    """(module, name) of everything that a package's __init__ takes from its modules."""
    for node in ast.parse((package / "__init__.py").read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.level == 1 and node.module:
            yield from ((node.module, alias.name) for alias in node.names if alias.name[0] not in "*_")


def definitions(file):
    if not file.is_file():
        return {}
    return {node.name: node for node in ast.parse(file.read_text()).body
            if isinstance(node, (ast.FunctionDef, ast.ClassDef))}  # fmt: skip


def text_of(node):
    """A docstring as Markdown: its arguments, `name: what it is`, become a list."""
    text = (ast.get_docstring(node) or "").replace("``", "`")
    return re.sub(r"^(\w+(?:, \w+)*): ", r"- **\1**: ", text, flags=re.MULTILINE)


def signature(node, skip=0, wrap=True):
    node.args.args = node.args.args[skip:]
    # nanobind's stubs say of arrays more than a caller must know.
    arguments = re.sub(r"Annotated\[NDArray\[numpy\.(\w+)\], dict\([^)]*\)\]", r"NDArray[\1]", ast.unparse(node.args))
    result = f" -> {ast.unparse(node.returns)}" if node.returns else ""
    if wrap and len(node.name + arguments + result) > 100:
        arguments = "\n    " + re.sub(r", (?=\*{0,2}\w+(?:: |=|$))", ",\n    ", arguments) + ",\n"
    return f"{node.name}({arguments}){result}"


def members(node, comments):
    """The attributes and methods of a class that are not private."""
    for part in node.body:
        if isinstance(part, ast.AnnAssign):  # what it means stands in the docstring or behind it
            comment = comments[part.lineno - 1].partition("  # ")[2]
            yield f"- `{part.target.id}: {ast.unparse(part.annotation)}`" + (f": {comment}" if comment else "")
        elif isinstance(part, ast.FunctionDef) and (part.name[0] != "_" or part.name == "__init__" and part.args.args[1:]):
            decorators = {ast.unparse(decorator) for decorator in part.decorator_list}
            if any(name.endswith(".setter") for name in decorators):
                continue
            is_property = "property" in decorators
            head = part.name if is_property else signature(part, 0 if "staticmethod" in decorators else 1, False)
            yield f"- `{head}`: " + " ".join((ast.get_docstring(part) or "").split())


def documented(package, stub):
    """Markdown of what a package gives, in the order of its modules."""
    for module, name in imported(package):
        file = stub if module == "_core" else next(
            (folder / f"{module}.py" for folder in (package, ROOT / "Module/Python/bigus")
             if (folder / f"{module}.py").is_file()), None)  # fmt: skip
        node = definitions(file).get(name) if file else None
        if node is None:
            continue  # compiled, and there is no stub
        yield f"### `{name}`\n"
        if isinstance(node, ast.FunctionDef):
            yield f"```python\n{signature(node)}\n```\n\n{text_of(node)}\n"
        else:
            yield f"{text_of(node)}\n\n" + "\n".join(members(node, file.read_text().splitlines())) + "\n"


def python_reference():
    stub = pathlib.Path(os.environ.get("BIGUS_STUB", ROOT / "build/wheel/bigus/_core.pyi"))
    if not stub.is_file():
        print("Field, Sweep and Phantom of Python are left out: BIGUS_STUB does not name a built _core.pyi.")
    parts = [("Python without VTK", ROOT / "Module/Wheel/bigus"), ("Python with VTK", ROOT / "Module/Python/bigus")]
    return "".join(f"\n\n## {title}\n\n" + "\n".join(documented(package, stub)) for title, package in parts)


# ----------------------------------------------------------------------------------------------------------------------

def add_what_is_made(app, page, source):
    if not source[0].startswith("#"):  # a table that a program writes
        source[0] = f"# {page.rpartition('/')[2]}\n\n{source[0]}"
    if page == root_doc:
        source[0] += contents(app.env)
    elif page == "Module/Documentation/Reference":
        source[0] += python_reference()


def add_doxygen(app, exception):
    """The classes of C++ in cpp/, and a first page that leads to README's."""
    if exception or app.builder.name != "html":
        return
    site = pathlib.Path(app.outdir)
    (site / "index.html").write_text('<meta http-equiv="refresh" content="0; url=README.html"><a href="README.html">BIGUS</a>\n')
    if shutil.which("doxygen"):
        folder = {**os.environ, "SITE": str(site), "BIGUS_VERSION": version}
        subprocess.run(["doxygen", str(HERE / "Doxyfile")], cwd=ROOT, env=folder, check=True)
    else:
        print("The classes of C++ are left out, because doxygen is missing.")


def setup(app):
    app.connect("source-read", add_what_is_made)
    app.connect("build-finished", add_doxygen)
