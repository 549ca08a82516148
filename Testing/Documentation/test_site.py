# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Builds the site with Sphinx and Doxygen, without a warning, and follows its links.

    test_site.py [FOLDER]    where the site is kept; exit code 77 where a tool is missing
"""

import importlib.util
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
MISSING = 77


def build(site):
    with tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-E", "-d", cache]
        run = subprocess.run([*command, "-c", str(ROOT / "Module/Documentation"), str(ROOT), str(site)],
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    print(run.stdout)
    return run.returncode


def dead_links(site):
    """Links between the site's own files that lead nowhere, those that Sphinx does not look at included."""
    for page in site.rglob("*.html"):
        if "cpp" in page.relative_to(site).parts or "_static" in page.parts:
            continue
        for target in set(re.findall(r'(?:href|src)="([^"#?]+)', page.read_text())):
            if not re.match(r"[a-z]+:|//", target) and not (page.parent / urllib.parse.unquote(target)).exists():
                yield f"{page.relative_to(site)}: there is no {target}"


def missing_words(site):
    """What a reader must find: a word on each page that is made of sources, and the class of the C++ reference."""
    for name, word in (("README.html", "From a bare machine"), ("Module/Core/Training/Options.html", "VirtualPlanes"),
                       ("Module/Documentation/Reference.html", "ImageToReference: pixel"),
                       ("cpp/classvtkBigusReslice.html", "SetResliceAxes")):  # fmt: skip
        if word not in re.sub(r"<[^>]*>", "", (site / name).read_text() if (site / name).is_file() else ""):
            yield f"{name} does not say {word!r}"


def main():
    missing = [name for name in ("sphinx", "myst_parser", "furo") if not importlib.util.find_spec(name)]
    missing += [name for name in ("doxygen",) if not shutil.which(name)]
    if missing:
        print(f"The site is not built, because {sys.executable} has no {', '.join(missing)}.")
        return MISSING
    with tempfile.TemporaryDirectory() as name:
        site = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else name).resolve()
        shutil.rmtree(site, ignore_errors=True)
        code = build(site)
        wrong = [] if code else [*dead_links(site), *missing_words(site)]
    print("\n".join(wrong) or ("" if code else "The site has no warning and no dead link."))
    return 1 if code or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
