# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""Runs the commands and the Python snippets of a room's page, in a folder that has a small sweep and its field.

    test_rooms.py PAGE BUILD [GIVEN.py]

Every line of a `bash` block is a command of its own. Calls of the program are run; where their sweep or server is none
that a test has, the program must say so, which it does after it has understood the line. What else is not run is named,
with the reason, and the project's files in it must exist. `python` blocks share an interpreter, which knows what the text
around them tells (GIVEN, or the file). TestSnippets.cxx has the `cpp` blocks.
"""

import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile

from test_pages import ROOT, blocks_of

NOT_RUN = {  # what a command begins with, and who runs it
    "BIGUS_BUILD=build ": "it builds packages, and takes ten minutes for each Python",
    r"\./Examples/quickstart\.sh": "continuous integration runs it",
    r"\./Testing/run\.sh|cmake |ctest ": "tests of Module/Documentation and `install` build and install",
    r"python3 Testing/Structure/|Testing/check\.sh": "tests `structure` run it",
    r"python3 -m venv|env/bin/|python3\.12 -m pip|PYTHONPATH=~": "a test of the package without VTK installs it",
    r"Slicer |pvpython |paraview|\. ~/bigus-paraview|Module/ParaView/install\.sh": "it needs another program",
    r"PYTHONPATH=build/python /usr/bin/python3 (Testing|Examples)|/tmp/drawing/": "tests `examples` and `benchmarks` run it",
    r"PYTHONPATH=\S+ (/usr/bin/python3|\.\.\.)$": "it starts an interpreter, as tests `python` do",
    r"mpirun ": "tests `examples` run it",
    r"echo .*bigusExperiment": "it takes minutes on a real sweep",
}
SERVERS = r"(build/bin/)?bigus (serve|view)(?!.*--screenshot|.*igtl:)|python3 -m bigus\.serve"  # run until they are stopped
SMALL = "--frames 24 --width 64 --height 48 --pixel-size 0.5"  # a sweep that takes seconds

GIVEN = {  # what a page's text, or another page, has told before its snippets
    "Module/Python/README.md": """
sweep, field = bigus.read("sweep.igs.mha"), bigus.read("field.vtp")
""",
    "Filters/README.md": """
image, truth = vtkImageData(), vtkImageData()
for picture, value in ((image, 90), (truth, 100)):
    picture.SetDimensions(32, 24, 1)
    picture.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
    picture.GetPointData().GetScalars().Fill(value)
    picture.SetScalarComponentFromDouble(3, 4, 0, 0, 200)
""",
    "Filters/Drawing.md": """
from vtkmodules.vtkFiltersCore import vtkTensorGlyph
from vtkmodules.vtkFiltersSources import vtkSphereSource
sweep, field, sphere = bigus.read("sweep.igs.mha"), bigus.read("field.vtp"), vtkSphereSource()
patient_to_world = vtkTransform()
patient_to_world.RotateX(30)
""",
    "Rendering/README.md": """
from vtkmodules.vtkRenderingCore import vtkRenderer
import vtkmodules.vtkRenderingOpenGL2
renderer, image_to_reference = vtkRenderer(), vtkMatrix4x4()
""",
}
IMPORTS = """
import bigus
from vtkmodules.util.vtkConstants import VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkCommonTransforms import vtkTransform
"""


def commands_of(block):
    """The lines of a block with their continuations, and without comments."""
    text = re.sub(r"\\\n\s*|(?<=',)\n\s*|(?<=,)\n\s+(?=\")", " ", block.text)
    lines = (re.sub(r"(^|\s+)#\s.*", "", line).strip() for line in text.splitlines())
    return [line for line in lines if line]


def files_that_are_missing(command):
    """Files of the project that a command names and that do not exist."""
    names = re.findall(r"(?<![\w/~.-])(?:\./)?((?:Examples|Testing|Module)/[\w./-]+)", command)
    return [name for name in names if not (ROOT / name).exists()]


def stopped(command, folder, environment):
    """Starts what runs until it is stopped; None, or what is wrong."""
    process = subprocess.Popen(shlex.split(command), cwd=folder, env=environment, text=True, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT)  # fmt: skip
    try:
        told = process.communicate(timeout=10)[0]
        return f"ended by itself with {process.returncode}: {told}"
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGINT)
        told = process.communicate(timeout=60)[0]
    print(f"run until it was stopped: {command}")
    return None if process.returncode in (0, 128 + signal.SIGINT, -signal.SIGINT) else told


def run(command, folder, environment):
    """None, or what is wrong."""
    for beginning, reason in NOT_RUN.items():
        if re.match(beginning, command):
            missing = files_that_are_missing(command)
            print(f"not run, because {reason}: {command}")
            return f"there is no {missing}" if missing else None
    if " view " in command and not environment.get("DISPLAY"):
        print(f"not run, because there is no X server: {command}")
        return None
    command = re.sub(r"(bigus phantom -o \S+).*", rf"\1 {SMALL}", command)
    if re.match(SERVERS, command):
        if "serve" in command and subprocess.run([sys.executable, "-c", "import aiohttp"], capture_output=True).returncode:
            print(f"not run, because aiohttp is missing: {command}")
            return None
        return stopped(command, folder, environment)
    result = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, text=True, stdin=subprocess.DEVNULL,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
    elsewhere = "igtl:" in command or any(
        re.search(r"\.(mha|csv|xml)$", word) and not (folder / word).exists() for word in shlex.split(command))
    if result.returncode == 0 or elsewhere and result.returncode == 2:
        print(f"run: {command}" + (f"\n  {result.stdout.strip()}" if result.returncode else ""))
        return None
    return f"ended with {result.returncode}: {result.stdout}"


def prepare(folder, environment):
    """What pages take for given: a sweep, its field, and files that other pages have made of them."""
    training = "--no-auto --iterations 40 --gaussians 1500"
    for command in (f"bigus phantom -o sweep.igs.mha {SMALL}",
                    f"bigus phantom -o axial.igs.mha {SMALL} --seed 3",
                    f"bigus phantom -o sagittal.igs.mha {SMALL} --seed 3",
                    f"bigus train sweep.igs.mha -o field.vtp --write-poses poses.csv {training}",
                    "cp poses.csv across.csv"):  # fmt: skip
        subprocess.run(["bash", "-c", command], cwd=folder, env=environment, check=True, capture_output=True)


def main():
    page, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    name = str(page.relative_to(ROOT))
    given = pathlib.Path(sys.argv[3]).read_text() if len(sys.argv) > 3 else GIVEN.get(name, "")
    blocks = blocks_of(page)
    problems = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        (folder / "build").symlink_to(build)
        environment = {**os.environ, "PATH": f"{build / 'bin'}:{os.environ['PATH']}", "PYTHONPATH": str(build / "python"),
                       "PYTHONDONTWRITEBYTECODE": "1"}  # fmt: skip
        # The build is made for this Python, which is called python3 in pages.
        (folder / "programs").mkdir()
        (folder / "programs/python3").symlink_to(sys.executable)
        environment["PATH"] = f"{folder / 'programs'}:{environment['PATH']}"
        prepare(folder, environment)
        fields = (folder / "field.vtp").read_bytes()
        for block in blocks:
            for command in commands_of(block) if block.kind == "bash" else ():
                problem = run(command, folder, environment)
                if problem:
                    problems.append(f"{name}:{block.line}: {command}: {problem}")
        (folder / "field.vtp").write_bytes(fields)
        python = [f"print('line {block.line}', flush=True)\n{block.text}" for block in blocks if block.kind == "python"]
        if python and not re.search("ParaView|Slicer", name):  # their own Python runs these
            script = IMPORTS + given + "".join(python)
            result = subprocess.run([sys.executable, "-c", script], cwd=folder, env=environment, text=True,
                                    stdout=subprocess.PIPE, stderr=subprocess.STDOUT)  # fmt: skip
            print(result.stdout)
            if result.returncode:
                problems.append(f"{name}: its Python ended with {result.returncode}")
    print("\n".join(problems) or f"{name}: every command and every line of Python is sound.")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
