"""The command ``spab margin``: solved live, or read off a map."""

from __future__ import annotations

from argparse import Namespace

from tqdm import tqdm

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.point import assessment_lines
from spab_core.cli.progress import say_compiling
from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.design.form import bearing_number_of
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.maps.margin import margin
from spab_core.maps.solved_margin import (
    POINTS,
    PRECISION,
    check_solved_margin,
    solve_margin,
)
from spab_core.maps.stability_map import load_map
from spab_core.shipped.manifest import load_reference_map
from spab_core.trajectory.compiling import compile_once


def add_commands(commands: Commands) -> None:
    """Add the command to the parser's."""
    sub = options.add_command(
        commands,
        "margin",
        "how far an operating point is from the first trouble in speed and in mass, solved live",
        _margin,
    )
    options.add(sub, "--rotor-mass", required=True)
    options.add_speed(sub)
    sub.add_argument(
        "--map",
        nargs="?",
        const=True,
        metavar="FILE.npz",
        help="read the regime borders from a map instead, predicted where its cells are; without a "
        "file, from the shipped map of the reference design",
    )
    sub.add_argument(
        "--points",
        type=options.whole,
        default=POINTS,
        help="solved on each side of the point before bisection, down to a quarter of its value or "
        f"up to three times it; default: {POINTS}",
    )
    sub.add_argument(
        "--precision",
        type=options.number,
        default=PRECISION,
        help=f"largest width of a limit's bracket, relative to its value; default: {PRECISION:g}",
    )
    options.add(sub, "--workers", *options.SOLVER)
    options.add_limits(sub)
    solving = [n for n in options.SOLVER if n not in ("--design", "--preset")]
    limits = [name for name, *_ in options.LIMITS]
    options.set_unused(sub, ("--points", "--precision", "--workers", *solving, *limits))


def _margin(args: Namespace) -> Answer:
    return _solved(args) if args.map is None else _read_off(args)


def _number(args: Namespace, design: Design) -> float:
    if args.bearing_number is not None:
        return float(args.bearing_number)  # checked with the map, or the point
    return bearing_number_of(design, None, args.rpm, "--rpm")


def _solved(args: Namespace) -> Answer:
    settings, design = options.settings_of(args), options.design_of(args)
    settings.check_cold_start()
    limits = options.limits_of(args)
    number = _number(args, design)
    check_point(args.rotor_mass, number)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    check_solved_margin(args.points, args.precision)
    say_compiling(settings, design)
    compile_once(settings, design)
    with tqdm(unit="point", smoothing=0.05, leave=False) as bar:
        found = solve_margin(
            design,
            args.rotor_mass,
            number,
            settings,
            limits,
            points=args.points,
            precision=args.precision,
            workers=args.workers,
            progress=bar.update,
        )
    if not args.json:
        print(
            "\n".join([*assessment_lines(found.assessment), found.headline(), *found.sentences()])
        )
    return found.record()


def _read_off(args: Namespace) -> Answer:
    if args.design is not None or args.preset is not None:
        raise InputError("a map has its own design: give either --map, or --design or --preset")
    options.check_unused(args, "not allowed with --map, whose values are read")
    m = load_reference_map() if args.map is True else load_map(args.map)
    number = _number(args, m.design)
    found = margin(m, args.rotor_mass, number)
    if not args.json:
        print(
            f"{found.here} at {found.rotor_mass:g} kg and {found.speed_rpm:,.0f} rpm (bearing "
            f"number {number:.4g})"
        )
        print("\n".join([found.headline(), *found.sentences()]))
    return found.record()
