# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The command `bigus` of the package without VTK. The program of the C++ build has these verbs, and more, with the same
words and exit codes: 0 done, 1 wrong usage, 2 bad input, 3 an output that cannot be written, 130 Ctrl-C.
"""

from __future__ import annotations

import argparse
import difflib
import importlib
import itertools
import json
import os
import pathlib
import struct
import sys
import warnings
import zlib
from typing import Any, Callable, NoReturn, Optional, Sequence

import numpy as np

import bigus

from ._core import check_option, standard_error, write_images
from .common import FIELD_EXTENSIONS, pixel_matrix
from .settings import POSES
from .tasks import option_text


class Failure(Exception):
    """What ends a command: exit code and text."""


class Parser(argparse.ArgumentParser):
    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, unknown = super().parse_known_args(args, namespace)
        return (found, unknown) if not unknown else self.error(f"there is no {unknown[0]}")

    def error(self, message: str) -> NoReturn:
        wrong = next((word for word in message.split() if word.startswith("--")), "")
        known = self._option_string_actions
        close = [] if wrong in known else difflib.get_close_matches(wrong, known, 1)
        hint = f"; did you mean {close[0]}?" if close else ""
        self.exit(1, f"{self.prog}: {message}{hint}\nRun '{self.prog} --help'.\n")


def say(options: Any, facts: dict[str, Any], lines: Sequence[str]) -> int:
    print(json.dumps(facts) if options.json else "\n".join(lines))
    return 0


def check_output(name: str, endings: Sequence[str], *inputs: str) -> None:
    """Before long work: Failure unless the file could be written."""
    path = pathlib.Path(name)
    if not name.lower().endswith(tuple(endings)):
        raise Failure(3, f"{name}: the name of an output must end in {', '.join(endings)}")
    if not path.parent.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise Failure(3, f"{name}: cannot be written; is {path.parent} a folder in which you may write?")
    if any(path.exists() and os.path.exists(one) and path.samefile(one) for one in inputs):
        raise Failure(3, f"{name}: it is an input, too; give another name")


def attempted(code: int, action: Callable, *arguments: Any) -> None:
    try:
        action(*arguments)
    except (bigus.Error, OSError) as error:
        raise Failure(code, str(error)) from None


def info(options: Any) -> int:
    if options.devices:
        facts: dict[str, Any] = {"engines": bigus.engines(), "missing": dict(bigus.missing_engines())}
        return say(options, facts, [*facts["engines"], *(f"{name}: not usable: {why}" for name, why in facts["missing"].items())])
    if not options.file:
        options.parser.error("FILE, or --devices, is required")
    if options.file.lower().endswith(FIELD_EXTENSIONS):
        field = bigus.read_field(options.file)
        points = field.centers
        facts = {"file": options.file, "gaussians": len(field), "gamma": field.gamma, "elevation_sigma_mm": field.elevation_sigma}
    else:
        sweep = bigus.read_sweep(options.file, **options.reading)
        pixel = np.linalg.norm(sweep.poses[:, :3, :2], axis=1).mean(axis=0)
        corners = np.array([(i, j, 0, 1) for i in (0, sweep.width - 1) for j in (0, sweep.height - 1)])
        points = (sweep.poses @ corners.T)[:, :3].transpose(0, 2, 1).reshape(-1, 3)
        facts = {"file": options.file, "frames": len(sweep), "width": sweep.width, "height": sweep.height, "pixel_mm": pixel.tolist()}
    if len(points):
        facts.update(low_mm=points.min(axis=0).tolist(), high_mm=points.max(axis=0).tolist())
    shown = {name: " ".join(f"{v:.4g}" for v in value) if isinstance(value, list) else value for name, value in facts.items()}
    return say(options, facts, [f"{name:<20}{value}" for name, value in shown.items()])


def check(options: Any) -> int:
    sweep = bigus.read_sweep(options.sequence, **options.reading)
    findings = bigus.check(sweep, options.keep)
    facts = {"sequence": options.sequence, "frames": len(sweep), "findings": findings}
    nothing = f"{options.sequence}: {len(sweep)} usable frames, nothing is wrong with them that was looked for"
    return say(options, facts, [found["text"] for found in findings] or [nothing])


def train(options: Any) -> int:
    names = [option["name"] for option in bigus.options()]
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    attempted(1, lambda: [check_option(name, value) for name, value in given.items()])
    check_output(options.output, FIELD_EXTENSIONS, *options.sequence)
    sweeps = [bigus.read_sweep(name, **options.reading) for name in options.sequence]
    stopped = False
    try:
        training = bigus.train(sweeps, keep_standard_error=not options.no_standard_error, **given)
    except bigus.TrainingInterrupted as stop:
        training, stopped = stop.training, True
    attempted(3, bigus.write, training.field if options.exact else training.field.rounded(), options.output)
    facts: dict[str, Any] = {name: getattr(training, name) for name in ("iterations", "seconds", "device", "finished", "decisions")}
    facts.update(gaussians=len(training.field), interrupted=stopped, held_out=None)
    lines = [f"{options.output}: {len(training.field)} Gaussians, {training.iterations} iterations in {training.seconds:.1f} s"]
    if training.held_out_frames and not stopped:
        facts["held_out"] = score(training, sweeps)
        lines.append("Held out: {frames} frames, PSNR {psnr:.2f} dB, SSIM {ssim:.3f}".format(**facts["held_out"]))
    return say(options, facts, lines) or (130 if stopped else 0)


def score(training: Any, sweeps: Sequence[Any]) -> dict[str, float]:
    """Slices beside the frames held out, where frames are lit at all."""
    frames = [(frame, 1 if sweep.mask is None else sweep.mask != 0) for sweep in sweeps for frame in sweep.frames]
    slicer, found = bigus.Slicer(training.field), []
    for number in training.held_out_frames:
        frame, lit = frames[number]
        found.append(bigus.metrics(lit * slicer.slice(training.poses[number], frame.shape[::-1]), frame))
    return {"frames": len(found), **{name: float(np.mean([one[name] for one in found])) for name in ("psnr", "ssim")}}


def slice_field(options: Any) -> int:
    check_output(options.output, (".png", ".mha"), options.field, options.poses)
    if options.standard_error:
        check_output(options.standard_error, (".mha",), options.field, options.poses)
        if pathlib.Path(options.standard_error).resolve() == pathlib.Path(options.output).resolve():
            raise Failure(3, f"{options.standard_error}: it is the other output, too; give another name")
    field = bigus.read_field(options.field)
    planes = bigus.read_planes(options.poses, options.spacing or 0.5, options.world_system.upper(), **options.reading)
    sizes = np.broadcast_to(options.size or planes.sizes, planes.sizes.shape)
    if sizes.min() < 1 or np.ptp(sizes, axis=0).any():
        raise Failure(2, f"{options.poses}: planes have no size, or several; give --size W H")
    if options.standard_error and not field.kept_error:
        raise Failure(2, f"--standard-error: {options.field} does not hold what it rests on; train it again, into a .vtp and "
                         "without --no-standard-error.")
    poses = np.array([pixel_matrix(pose, options.spacing) for pose in planes.poses])
    images = bigus.Slicer(field, elevation_sigma=options.elevation_sigma).slice(poses, sizes[0])
    grey = np.floor(255 * images + np.float32(0.5)).astype(np.uint8)
    if not grey.any():
        print(f"bigus: {options.poses}: the planes do not meet the field; every pixel is black", file=sys.stderr)
    if options.output.lower().endswith(".mha"):
        attempted(3, bigus.write, bigus.sweep(grey, poses, planes.timestamps), options.output)
    else:
        stem, one = options.output[:-4], len(grey) == 1
        for number, image in enumerate(grey):
            attempted(3, pathlib.Path(f"{stem}.png" if one else f"{stem}_{number:03d}.png").write_bytes, png(image))
    if options.standard_error:
        sigmas = np.array([standard_error(field.kept_error, pose, image) for pose, image in zip(poses, images)])
        attempted(3, write_images, sigmas, poses, planes.timestamps, options.standard_error)
    return say(options, {"images": len(grey), "meets_field": bool(grey.any())}, [f"{options.output}: {len(grey)} slices"])


def png(image: np.ndarray) -> bytes:
    """A grey picture of bytes as a PNG file."""
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", image.shape[1], image.shape[0], 8, 0, 0, 0, 0)),
              (b"IDAT", zlib.compress(np.insert(image, 0, 0, axis=1).tobytes())), (b"IEND", b""))
    parts = [struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data)) for name, data in chunks]
    return b"".join([b"\x89PNG\r\n\x1a\n", *parts])


def convert_field(options: Any) -> int:
    check_output(options.output, FIELD_EXTENSIONS, options.input)
    field = bigus.read_field(options.input)
    attempted(3, bigus.write, field.rounded() if options.round else field, options.output)
    return say(options, {"gaussians": len(field)}, [f"{options.output}: {len(field)} Gaussians"])


def add_reading(parser: Parser) -> None:
    add = parser.add_argument_group("how the sequence is read").add_argument
    add("--config", dest="ConfigFileName", metavar="PLUS.xml", help="Plus configuration with transforms that the sequence lacks")
    add("--image-to", dest="ToFrame", metavar="NAME", help="frame that the poses lead to (default: Reference)")
    add("--image-from", dest="FromFrame", metavar="NAME", help="frame that the poses lead from (default: Image)")
    add("--pixel-spacing", dest="ImageSpacing", nargs=2, type=float, metavar="MM", help="size of a pixel along i and j, mm")
    add("--assume-status", dest="AssumeMissingStatusOK", action="store_true", help="accept transforms that carry no status")


def make_parser() -> Parser:
    parser = Parser(prog="bigus", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--version", action="version", version=f"bigus {bigus.__version__}")
    verbs = parser.add_subparsers(metavar="COMMAND", required=True)

    def verb(name: str, text: str, function: Callable) -> Parser:
        added = verbs.add_parser(name, help=text, description=text, allow_abbrev=False)
        added.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
        added.set_defaults(function=function, parser=added)
        return added

    own = verb("info", "what is in a sequence or a field", info)
    own.add_argument("file", metavar="FILE", nargs="?", help=".igs.mha .mha .mhd .nrrd .csv .vtp .ply")
    own.add_argument("--devices", action="store_true", help="what can compute here, and why not what cannot")
    add_reading(own)
    own = verb("check", "what is wrong with a sequence, before it is trained on", check)
    own.add_argument("sequence", metavar="SEQUENCE", help=".igs.mha .mha .mhd .nrrd .csv")
    own.add_argument("--keep", default="none", metavar="KINDS", help="findings that nothing is done about, joined by +")
    add_reading(own)
    own = verb("train", "a sequence to a field; Ctrl-C keeps the best so far", train)
    own.add_argument("sequence", metavar="SEQUENCE", nargs="+", help="several, of one patient in one world, train one field")
    own.add_argument("-o", "--output", metavar="FIELD", required=True, help="field to write: .vtp or .ply")
    own.add_argument("--exact", action="store_true", help="write every digit, also those that no picture shows")
    own.add_argument("--no-standard-error", action="store_true", help="leave out of the field what 'slice --standard-error' needs")
    add_reading(own)
    own.add_argument("--no-auto", dest="Automatic", action="store_const", const="off", help="the same as --automatic off")
    for title, options in itertools.groupby(bigus.options(), lambda option: option["group"]):
        group = own.add_argument_group(title)
        for option in options:
            group.add_argument("--" + option["keyword"].replace("_", "-"), dest=option["name"], metavar="VALUE",
                               help=option_text(option).replace("%", "%%"))
    own = verb("slice", "a field at any planes", slice_field)
    own.add_argument("field", metavar="FIELD", help=".vtp or .ply")
    own.add_argument("--poses", required=True, metavar="POSES", help="a sequence, a CSV, or 3D Slicer's .mrk.json, .tfm, .h5")
    own.add_argument("-o", "--output", required=True, metavar="OUT", help=".png (numbered if many), or .mha with poses")
    own.add_argument("--size", nargs=2, type=int, metavar="N", help="pixels across and down; needed where the file does not say")
    own.add_argument("--spacing", type=float, metavar="MM", help="side of a pixel, mm (default: the file's, 0.5 for markups)")
    own.add_argument("--elevation-sigma", type=float, metavar="MM", help="beam's standard deviation, mm (default: the field's)")
    own.add_argument("--standard-error", metavar="OUT", help="also write how far what a probe would show may be from every pixel, "
                     "a standard deviation in units of intensity (1 is white), nan where that is not known: .mha of floats")
    own.add_argument("--world-system", choices=("ras", "lps"), default="ras", help="the field's world (default: ras)")
    add_reading(own)
    own = verb("convert", "a field to another format, or files of your own to a sequence: 'bigus convert --help'", convert_field)
    own.add_argument("input", metavar="FIELD", help=".vtp or .ply")
    own.add_argument("output", metavar="OUT", help=".vtp or .ply")
    own.add_argument("--round", action="store_true", help="drop the digits that no picture shows")
    verb("serve", "a page in the browser that shows slices of a field", info)
    return parser


def main(arguments: Optional[Sequence[str]] = None) -> int:
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    warnings.showwarning = lambda message, *_: print(f"bigus: {message}", file=sys.stderr)  # type: ignore[assignment]
    try:
        fields = [word for word in words if word.lower().endswith(FIELD_EXTENSIONS)]
        if words[0] == "serve" or words[0] == "convert" and not fields:
            return importlib.import_module("bigus." + words[0]).main(words[1:])
        options = make_parser().parse_args(words)
        options.reading = {name: getattr(options, name) for name in POSES if getattr(options, name, None)}
        return options.function(options)
    except (SystemExit, KeyboardInterrupt) as end:
        code = getattr(end, "code", 130)
        return 1 if code == 2 else int(code or 0)  # 2 is wrong usage to the parsers of convert and serve
    except Failure as failure:
        code, text = failure.args
    except (ImportError, OSError, RuntimeError, TypeError, ValueError) as error:
        code, text = 2, str(error)
    if "--json" in words:
        print(json.dumps({"error": text, "exit_code": code}))
    print(f"bigus: {text}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
