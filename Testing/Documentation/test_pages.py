# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs every command and snippet of a page of Module/Documentation as it stands there, from its top to its end.

    test_pages.py PAGE BUILD [--for-real]    exit code 77 where something is missing here

All blocks of a page run in one shell, in a folder that has the project's. Module/Documentation/README.md tells how blocks
that cannot run, or run until Ctrl-C, are marked. What installs or builds is answered by what is built in BUILD, after a
look whether such a package, extra or preset exists. --for-real runs it, too, in a copy of the sources; that takes long and
needs a machine to install on.
"""

import itertools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"(?:^ *\*(?P<mark>[^*]+)\*\n\n)?^(?P<indent> *)```(?P<kind>\w+)\n(?P<text>.*?)^ *```$", re.DOTALL | re.MULTILINE)
MISSING = 77

# What stands in for installing and building: programs that are found first, and pip, which must win over an environment's.
STAND_INS = {
    "sudo": 'exec "$@"',
    "python3": 'exec "$PYTHON" "$@"',
    "apt-get": """
while (($#)) && [[ $1 != install ]]; do shift; done
for package in "${@:2}"; do
  [[ $package == -* ]] || dpkg-query --show "$package" >/dev/null 2>&1 || apt-cache show "$package" >/dev/null
done""",
    "cmake": """
[[ $* == *--preset* ]] || PATH=${PATH#*:} exec cmake "$@"
PATH=${PATH#*:} cmake -S "$PROJECT" --list-presets=all | grep "\\"${*: -1}\\"" >/dev/null""",
}
PIP = r"""
pip() {  # the wheel of the build, and the packages of the Python that it was made for
  local what
  for what in "${@:2}"; do
    case $what in
      .) ;;
      .*web*)
        grep 'optional-dependencies.*web = ."aiohttp' pyproject.toml >/dev/null || return 1
        "$PYTHON" -c "import aiohttp" || exit 77 ;;
      .*) return 1 ;;  # no other extra is in a page yet
      *) "$PYTHON" -c "import $what" || exit 77 ;;
    esac
  done
  { echo "$BUILD/wheel"; "$PYTHON" -c "import sys; print(*sys.path[1:], sep='\n')"; } \
    >"$(python -c "import sysconfig; print(sysconfig.get_path('purelib'))")/bigus.pth"
}
"""

# A server: its page is asked for, and it is ended.
UNTIL_STOPPED = r"""
log=$(mktemp)
( trap - INT; exec {command} ) >"$log" 2>&1 &
for second in $(seq 60); do
  ! grep --quiet http "$log" || break
  sleep 1
done
cat "$log"
python3 -c "import re, sys, urllib.request as u; print(len(u.urlopen(re.search(r'http\S+', open(sys.argv[1]).read())[0]).read()), 'bytes')" "$log"
kill -INT $! && wait $!
"""


class Block:
    def __init__(self, found, page):
        indent = len(found["indent"])
        self.kind, self.mark = found["kind"], found["mark"] or ""
        self.text = "".join(line[indent:] for line in found["text"].splitlines(keepends=True))
        self.line = page.count("\n", 0, found.start("text"))

    def is_run(self):
        return self.kind in ("bash", "python") and not self.mark.startswith("Not run")

    def script(self):
        """What the shell is told."""
        return UNTIL_STOPPED.replace("{command}", self.text.strip()) if self.mark.startswith("It runs until") else self.text


def script_of(blocks):
    """All of a page. Neighbouring blocks of Python share an interpreter."""
    script = "set -euo pipefail\n"
    for is_python, group in itertools.groupby(
            ((number, block) for number, block in enumerate(blocks) if block.is_run()), lambda one: one[1].kind == "python"):
        if is_python:
            text = "".join(f"print('=== {number}', flush=True)\n{block.text}" for number, block in group)
            script += f"python3 - <<'END_OF_BLOCK'\n{text}END_OF_BLOCK\n"
        else:
            script += "".join(f"echo '=== {number}'\n{block.script()}" for number, block in group)
    return script


def blocks_of(page):
    text = page.read_text()
    return [Block(found, text) for found in BLOCK.finditer(text)]


def folder_of_the_project(folder, build, for_real):
    """The project as its user has it: a copy, or links to its parts and the build, with what stands in for programs."""
    if for_real:
        shutil.copytree(ROOT, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("build*", ".git"))
        return
    for entry in ROOT.iterdir():
        if not entry.name.startswith((".", "build")):
            (folder / entry.name).symlink_to(entry)
    (folder / "build").symlink_to(build)
    (folder / "stand-ins").mkdir()
    for name, text in STAND_INS.items():
        (folder / "stand-ins" / name).write_text(f"#!/bin/bash\nset -euo pipefail\n{text}\n")
        (folder / "stand-ins" / name).chmod(0o755)


def differences(expected, output):
    """Lines of `expected`, in their order, that are not in `output`."""
    position, lines = 0, [line.rstrip() for line in output.splitlines()]
    for line in expected.splitlines():
        if line.strip() == "...":
            continue
        parts = re.split(r"\s*\.\.\.\s*", line.strip())
        pattern = re.compile(".*".join(r"\s+".join(map(re.escape, part.split())) for part in parts))
        found = next((k for k in range(position, len(lines)) if pattern.search(lines[k])), None)
        if found is None:
            yield line
        else:
            position = found + 1


def main():
    page, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    for_real = "--for-real" in sys.argv
    blocks = blocks_of(page)
    for block in blocks:
        if block.mark.startswith("Not run"):
            print(f"{page.name}:{block.line}: {block.mark}")
    if not any(block.is_run() for block in blocks):
        print(f"{page.name} has nothing else to run.")
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        folder_of_the_project(folder, build, for_real)
        with_wheel = any("pip install" in block.text for block in blocks if block.is_run())
        if with_wheel and not for_real and not (build / "wheel/bigus/_core.pyi").is_file():
            print("The package without VTK is not built, because nanobind is missing.")
            return MISSING
        environment = {**os.environ, "BUILD": str(build), "PROJECT": str(ROOT), "PYTHON": sys.executable,
                       "PYTHONDONTWRITEBYTECODE": "1", "MPLBACKEND": "Agg"}  # fmt: skip
        environment.pop("PYTHONPATH", None)
        if not with_wheel:  # bigus and its package are at hand
            environment["PATH"] = f"{build / 'bin'}:{environment['PATH']}"
            environment["PYTHONPATH"] = str(build / "python")
        script = script_of(blocks)
        if not for_real:
            environment["PATH"] = f"{folder / 'stand-ins'}:{environment['PATH']}"
            script = PIP + script
        run = subprocess.run(["bash", "-c", script], cwd=folder, env=environment, text=True, stdin=subprocess.DEVNULL,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    print(run.stdout)
    printed = {int(number): text for number, text in re.findall(r"^=== (\d+)\n(.*?)(?=^=== |\Z)", run.stdout, re.M | re.S)}
    if run.returncode:
        last = blocks[max(printed)] if printed else blocks[0]
        print(f"{page.name}:{last.line}: this block ended with {run.returncode}.")
        return MISSING if run.returncode == MISSING else 1
    wrong = [f"{page.name}:{block.line}: not printed: {line}" for number, block in enumerate(blocks) if block.kind == "text"
             for line in differences(block.text, printed.get(number - 1, ""))]  # fmt: skip
    print("\n".join(wrong) or f"{page.name}: {len(printed)} blocks ran.")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
