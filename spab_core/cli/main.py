"""The command ``spab``: every answer as text for people or, with --json, as one JSON object."""

from __future__ import annotations

import contextlib
import importlib
import json
import sys
from argparse import Namespace
from pathlib import Path

from spab_core._version import __version__
from spab_core.cli.options import Parser
from spab_core.common.errors import InputError
from spab_core.common.files import check_writable

# modules of this package and their commands: only that of the command given is loaded, since
# half of the libraries' loading is for the others
_GROUPS = {
    "point": ("simulate", "stiffness", "whirl-threshold"),
    "maps": ("map", "bifurcation", "export"),
    "margin": ("margin",),
    "surrogates": ("evaluate", "predict"),
    "refine": ("refine",),
    "models": ("train", "verify"),
    "jobs": ("jobs",),
    "design": ("design",),
    "dashboard": ("dashboard",),
}


def _build_parser(command: str = "") -> Parser:
    """Build the parser of the module that holds this command, or of all."""
    parser = Parser(
        prog="spab",
        description="Rotors on spherical or cylindrical porous gas bearings: regimes, exponents, "
        "stability maps.",
    )
    parser.add_argument("--version", action="version", version=f"spab {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    holding = [group for group, names in _GROUPS.items() if command in names]
    for group in holding or _GROUPS:
        importlib.import_module(f"spab_core.cli.{group}").add_commands(commands)
    return parser


_OUTPUTS = ("out", "map_out", "orbit", "best_out")  # options that name a file to write
_INPUTS = ("design", "map")  # and one to read, which none of these may be


def _check_outputs(args: Namespace) -> None:
    """Raise :class:`InputError` where a file cannot be written, or is another file of the
    command.
    """

    def told(name: str) -> str:
        return f"--{name.replace('_', '-')} = {getattr(args, name)[:200]!r}"

    given = [n for n in (*_INPUTS, *_OUTPUTS) if isinstance(getattr(args, n, None), str)]
    for name in _OUTPUTS:
        if name not in given or not getattr(args, name):
            continue
        check_writable(Path(getattr(args, name)).parent, told(name))
        for other in given[: given.index(name)]:
            if _same(getattr(args, name), getattr(args, other)):
                what = "to read" if other in _INPUTS else f"of --{other.replace('_', '-')} too"
                raise InputError(f"{told(name)} is the file {what}: give another name")


def _same(one: str, other: str) -> bool:
    try:
        return Path(one).resolve() == Path(other).resolve() or Path(one).samefile(other)
    except (OSError, ValueError):
        return False


def main(argv: list[str] | None = None) -> int:
    """Run the command line and return the exit code: 0, 1 where ``spab verify`` finds something
    wrong, 2 for bad input, 130 where the user stopped it.
    """
    with contextlib.suppress(AttributeError):  # a file name may hold what the terminal cannot show
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    given = sys.argv[1:] if argv is None else argv
    parser = _build_parser(given[0] if given else "")
    args = parser.parse_args(argv)
    for name, value in vars(args).items():
        if value == []:  # what argparse of Python 3.11 makes of --name=--
            parser.error(f"--{name.replace('_', '-')} = '--' is not allowed")
    try:
        _check_outputs(args)
        answer = args.run(args)
    except InputError as error:
        print(f"{args.prog}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("spab: stopped", file=sys.stderr)
        return 130
    except OSError as error:
        # no name: the disk was full while a file was written; the file before it stays
        where = error.filename or "a file could not be written"
        print(f"{args.prog}: {where}: {error.strerror or error}", file=sys.stderr)
        return 2
    if args.json:
        print(json.dumps(answer, allow_nan=False))
    return 1 if answer.get("passed") is False else 0


if __name__ == "__main__":
    raise SystemExit(main())
