"""What the commands share: parser, options, design and settings made from them."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Callable
from typing import Any, NoReturn, TypeAlias

from spab_core.common.errors import InputError
from spab_core.design.model import Design, load_design, reference_design
from spab_core.design.presets import PRESETS, preset
from spab_core.solver.film import AUTO
from spab_core.solver.stepping import DEFAULT_TOLERANCE, METHODS
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits
from spab_core.trajectory.settings import Settings

Answer = dict[str, Any]  # what --json prints
MAX_WORKERS = 1024
MAX_SEED = 2**32 - 1
_LEFT_OUT = "left out: the shipped map of the reference design"


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
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a number") from None


def whole(text: str) -> int:
    """Read an integer."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a whole number") from None


SOLVER = (
    "--design",
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
    "--design": {"metavar": "FILE.toml", "help": "design file; left out: the reference design"},
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
    "--bearing-number": {"type": number, "help": "shaft speed as bearing number"},
    "--workers": {"type": whole, "default": 1, "help": "processes"},
    "--dask": {
        "metavar": "ADDRESS",
        "help": "scheduler of a Dask cluster, such as tcp://host:8786, to solve there",
    },
    "--map": {"metavar": "FILE.npz", "help": f"map file; {_LEFT_OUT}"},
    "--divisor": {"type": whole, "help": "train on n/DIVISOR of the cells"},
    "--seed": {
        "type": whole,
        "default": 0,
        "help": "of the draw of the training cells and of the model; left out: 0",
    },
}


# of what is good: option, attribute of Limits, what one of it is there, help
_LIMITS = (
    (
        "--least-film",
        "least_film",
        1e-6,
        "thinnest film allowed, µm; left out: the larger of 3 µm and five roughness lengths",
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
    for name, attribute, unit, text in _LIMITS:
        usual = getattr(DEFAULT_LIMITS, attribute)
        left_out = "" if usual is None else f"; left out: {usual / unit:g}"
        parser.add_argument(name, type=number, dest=f"limit_{attribute}", help=text + left_out)


def limits_of(args: argparse.Namespace) -> Limits:
    """Return the limits of what is good."""
    given = {
        attribute: getattr(args, f"limit_{attribute}") * unit
        for _, attribute, unit, _ in _LIMITS
        if getattr(args, f"limit_{attribute}") is not None
    }
    return dataclasses.replace(DEFAULT_LIMITS, **given)


def add_preset(parser: argparse._ActionsContainer) -> None:
    """Add the option that names a preset in place of a design file."""
    parser.add_argument("--preset", help=f"in place of --design: {', '.join(PRESETS)}")


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
    return option.removeprefix("--").replace("-", "_")


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


def design_of(args: argparse.Namespace) -> Design:
    """Return the design of --design or --preset, or the reference design."""
    name = getattr(args, "preset", None)
    if name is not None and args.design is not None:
        raise InputError("give either --design or --preset")
    if name is not None:
        return preset(name).design
    return reference_design() if args.design is None else load_design(args.design)
