"""What the commands share: parser, options, design and settings made from them."""

from __future__ import annotations

import argparse
import dataclasses
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.workers import MAX_WORKERS as MAX_WORKERS  # of --workers
from spab_core.design.form import bearing_number_of
from spab_core.design.model import (
    Design,
    design_file,
    design_remarks,
    read_design_bytes,
    reference_design,
)
from spab_core.design.presets import PRESETS, preset
from spab_core.maps.stability_map import axis, steps_as_count
from spab_core.solver.film import AUTO
from spab_core.solver.stepping import DEFAULT_TOLERANCE, METHODS
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits
from spab_core.trajectory.settings import Settings

Answer = dict[str, Any]  # what --json prints
MAX_SEED = 2**32 - 1
LIKELY_STEPS = 8  # 0.5:1:25 is likelier steps of 1 up to 25, 0.25:8.5:34 is 34 values
LARGEST_STOP = 50.0  # bearing number or kg; 0.05:8.5:170 is 170 values
LIKELY_STEP = 200  # 5000:30000:1000 is likelier steps of 1000 than 1000 values
_GROUPED = r"[1-9]\d{0,2}(\.\d{3})+"
_LEFT_OUT = "default: the shipped map of the reference design"


class Parser(argparse.ArgumentParser):
    """Parser that says what is wrong in one sentence and exits with 2."""

    def error(self, message: str) -> NoReturn:
        """Print the sentence and exit."""
        print(f"{self.prog}: {' '.join(message.split())}", file=sys.stderr)
        raise SystemExit(2)


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"  # what commands are added to


def number(text: str) -> float:
    """Read a float."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{text[:40]!r} is not a number{_number_hint(text)}"
        ) from None


def _number_hint(text: str) -> str:
    if re.fullmatch(r"[+-]?\d+,\d+", text):
        grouped = re.fullmatch(r"[1-9]\d{0,2},\d{3}", text)
        more = f", or {text.replace(',', '')} for thousands" if grouped else ""
        return f": the decimal sign is a point, {text.replace(',', '.')}{more}"
    if re.fullmatch(r"[+-]?\d{1,3}([\s'\u2019_]\d{3})+", text):
        return f": write {re.sub(r'[^0-9+-]', '', text)}, without signs between the thousands"
    if found := re.fullmatch(r"([+-]?[\d.]*\d)\s*k(rpm)?", text):
        return f": write {1e3 * float(found[1]):g}" if found[1].count(".") < 2 else ""
    if found := re.fullmatch(r"([+-]?[\d.]*\d(?:[eE][+-]?\d+)?)\s*[^\W\d]\S*", text):
        return f": write {found[1]}, without its unit"
    return ""


def speed(text: str) -> float:
    """Read a shaft speed; one such as 20.000 may be twenty or twenty thousand."""
    if re.fullmatch(_GROUPED, text):
        raise argparse.ArgumentTypeError(
            f"{text!r} can be read in two ways: write {text.replace('.', '')}, or "
            f"{text.rstrip('0')}{'0' if text.rstrip('0').endswith('.') else ''}"
        )
    return number(text)


def whole(text: str) -> int:
    """Read an integer."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a whole number") from None


SOLVER = (
    "--design",
    "--preset",
    "--mesh",
    "--transient",
    "--revolutions",
    "--method",
    "--tolerance",
    "--full-length",
)
AXIS: dict[str, Any] = {"type": str, "metavar": "START:STOP:COUNT"}  # a range, not a number
_SHARED: dict[str, dict[str, Any]] = {
    "--json": {"action": "store_true", "help": "print one JSON object"},
    "--design": {"metavar": "FILE.toml", "help": "design file; default: the reference design"},
    "--mesh": {
        "default": str(AUTO),
        "help": "latitudes x azimuths of the half band, such as 3x24; auto: those that the design "
        "and the eccentricity ask for",
    },
    "--transient": {"type": whole, "default": 300, "help": "revolutions before the measurement"},
    "--revolutions": {"type": whole, "default": 300, "help": "revolutions measured"},
    "--method": {"default": "rodas", "help": f"time integrator: {' or '.join(METHODS)}"},
    "--tolerance": {
        "type": number,
        "default": DEFAULT_TOLERANCE,
        "help": "largest error estimate of a step",
    },
    "--full-length": {
        "action": "store_true",
        "help": "integrate all revolutions, also after the orbit has settled or been found "
        "unstable",
    },
    "--rotor-mass": {"type": number, "help": "kg on one bearing"},
    "--preset": {"help": f"in place of --design: {', '.join(PRESETS)}"},
    "--bearing-number": {"type": number, "help": "shaft speed as bearing number"},
    "--rpm": {"type": speed, "help": "shaft speed, in place of --bearing-number"},
    "--workers": {"type": whole, "default": 1, "help": "processes"},
    "--dask": {
        "metavar": "ADDRESS",
        "help": "scheduler of a Dask cluster, such as tcp://host:8786, to solve there",
    },
    "--map": {"metavar": "FILE.npz", "help": f"map file; {_LEFT_OUT}"},
    "--floor": {
        "type": number,
        "metavar": "MLE",
        "help": "set exponents under this floor to it before anything is trained, per revolution, "
        "such as -1; left out: as they were solved",
    },
    "--divisor": {"type": whole, "help": "train on n/DIVISOR of the cells"},
    "--seed": {
        "type": whole,
        "default": 0,
        "help": "random seed of the training cells and of the model; default: 0",
    },
}


# of what is good: option, attribute of Limits, what one of it is there, help
LIMITS = (
    (
        "--least-film",
        "least_film",
        1e-6,
        "least film allowed, µm; default: the larger of 3 µm and five roughness lengths",
    ),
    ("--max-eccentricity", "eccentricity", 1.0, "largest eccentricity allowed, over the clearance"),
    (
        "--calm-eccentricity",
        "calm_eccentricity",
        1.0,
        "largest eccentricity that needs no watching, over the clearance",
    ),
    ("--max-orbit", "orbit", 1.0, "largest orbit of a whirl, over the clearance"),
    (
        "--separation",
        "separation",
        1.0,
        "separation of a lightly damped vibration from the speed, in times that of API 617; 0: not "
        "judged",
    ),
)


def add_limits(parser: argparse._ActionsContainer) -> None:
    """Add the options of what is good."""
    for name, attribute, unit, text in LIMITS:
        usual = getattr(DEFAULT_LIMITS, attribute)
        left_out = "" if usual is None else f"; default: {usual / unit:g}"
        parser.add_argument(
            name, type=number, dest=destination(name), metavar="X", help=text + left_out
        )


def limits_of(args: argparse.Namespace) -> Limits:
    """Return the limits of what is good."""
    given = {
        attribute: getattr(args, f"limit_{attribute}") * unit
        for _, attribute, unit, _ in LIMITS
        if getattr(args, f"limit_{attribute}") is not None
    }
    return dataclasses.replace(DEFAULT_LIMITS, **given)


def speed_of(text: str) -> float:
    """Read the shaft speed, in rpm, of an option that may be a range too; raise ``InputError`` for
    what is no speed.
    """
    try:
        return speed(text)
    except argparse.ArgumentTypeError as error:
        raise InputError(f"--rpm = {error}") from None


def add_speed(parser: Parser, required: bool = True, **changes: Any) -> None:
    """Add --bearing-number and --rpm, of which one may be given."""
    either = parser.add_mutually_exclusive_group(required=required)
    add(either, "--bearing-number", "--rpm", **changes)


def bearing_number_at(args: argparse.Namespace, design: Design) -> float:
    """Return the bearing number of --bearing-number or --rpm."""
    return bearing_number_of(design, args.bearing_number, args.rpm, "--rpm")


def bearing_numbers(args: argparse.Namespace, design: Design) -> np.ndarray:
    """Return the values of --bearing-number, or of --rpm as bearing numbers."""
    if args.rpm is None:
        return values_of(args.bearing_number, "--bearing-number")
    return axis(rpm_range(args.rpm, design), "--rpm")


def rpm_range(text: str, design: Design) -> str:
    """Return a range of speeds in rpm as one of bearing numbers."""
    for part in text.split(":")[:2]:
        if re.fullmatch(_GROUPED, part.strip()):
            speed_of(part.strip())
    values = values_of(text, "--rpm")
    ends = (bearing_number_of(design, None, float(v), "--rpm") for v in (values[0], values[-1]))
    return ":".join([*map(repr, ends), str(len(values))])


def values_of(text: str, name: str) -> np.ndarray:
    """Return the values of START:STOP:COUNT; say so where START:STEP:STOP may have been meant."""
    values = axis(text, name)
    start, second, third = map(float, text.split(":"))
    meant = steps_as_count(start, second, third)
    likely = name == "--rpm" or third <= LARGEST_STOP
    if meant and likely and third - start >= LIKELY_STEPS * second:
        print(
            f"spab: {name} = {text} is {len(values)} values from {start:g} to {second:g}; for "
            f"steps of {second:g} up to {third:g} write {meant}",
            file=sys.stderr,
        )
    elif LIKELY_STEP <= third <= second - start and (second - start) % third == 0.0:
        print(
            f"spab: {name} = {text} is {len(values):,} values; for steps of {third:g} write "
            f"{start:g}:{second:g}:{(second - start) / third + 1.0:g}",
            file=sys.stderr,
        )
    return values


def listed(text: str) -> list[str]:
    """Return the words of a list separated by commas, blanks around them allowed."""
    return [word.strip() for word in text.split(",")]


def add_command(
    commands: Commands,
    name: str,
    text: str,
    run: Callable[[argparse.Namespace], Answer],
    *shared: str,
) -> Parser:
    """Add a command with --json and the shared options named; return its parser."""
    parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    parser.set_defaults(run=run, prog=parser.prog)
    add(parser, *shared, "--json")
    return parser


def add_group(commands: Commands, name: str, text: str) -> Commands:
    """Add a command that has commands of its own; return what these are added to."""
    parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    return parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)


def add(parser: argparse._ActionsContainer, *names: str, **changes: Any) -> None:
    """Add shared options to a command or a group of options, each with the changes."""
    for name in names:
        parser.add_argument(name, **_SHARED[name] | changes)


def destination(option: str) -> str:
    """Return the name of an option's value among the arguments."""
    limit = next((attribute for name, attribute, *_ in LIMITS if name == option), None)
    return f"limit_{limit}" if limit else option.removeprefix("--").replace("-", "_")


def settings_of(args: argparse.Namespace) -> Settings:
    """Return the settings of the solver."""
    return Settings(
        args.mesh,
        args.method,
        args.transient,
        args.revolutions,
        args.tolerance,
        not args.full_length,
    )


def set_unused(parser: Parser, names: Iterable[str]) -> None:
    """Note the options that some use of a command does not ask for (:func:`check_unused`)."""
    unused = {name: parser.get_default(destination(name)) for name in names}
    parser.set_defaults(unused=unused)


def check_unused(args: argparse.Namespace, why: str) -> None:
    """Raise :class:`InputError` where one of the options of :func:`set_unused` is given."""
    given = [n for n, usual in args.unused.items() if getattr(args, destination(n)) != usual]
    if given:
        raise InputError(f"{', '.join(given)}: {why}")


def check_new(path: str, name: str, force: bool) -> None:
    """Raise :class:`InputError` where the file of an option is there and may not be replaced."""
    if Path(path).exists() and not force:
        raise InputError(
            f"{name} = {path[:200]!r} is there already: give another name, or --force to replace it"
        )


def design_bytes(args: argparse.Namespace) -> bytes:
    """Return the bytes of --design, read once: from a pipe they come but once."""
    if "design_read" not in args:
        args.design_read = design_file(args.design)
    return bytes(args.design_read)


def design_of(args: argparse.Namespace) -> Design:
    """Return the design of --design or --preset, or the reference design.

    Raises
    ------
    InputError
        For both at once, or a file that is no design.
    """
    name = getattr(args, "preset", None)
    if name is not None and args.design is not None:
        raise InputError("give either --design or --preset")
    if name is not None:
        return preset(name).design
    if args.design is None:
        return reference_design()
    data = design_bytes(args)
    design = read_design_bytes(data, args.design)
    for remark in design_remarks(data):
        print(f"spab: design file {args.design[:200]!r}: {remark}", file=sys.stderr)
    return design
