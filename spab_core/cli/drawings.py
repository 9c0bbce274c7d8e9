"""The commands ``spab design tolerance`` and ``spab design improve``."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tqdm import tqdm

from spab_core.active_learning.quick_map import check_cluster
from spab_core.cli import options
from spab_core.cli.options import Answer, Parser
from spab_core.cli.progress import resumable, say_compiling
from spab_core.common.errors import InputError
from spab_core.common.files import check_output
from spab_core.common.units import to_rpm
from spab_core.common.validation import check_choice, check_number
from spab_core.design.form import bearing_number_of
from spab_core.design.model import Design, save_design
from spab_core.design.tolerances import (
    Machine,
    Tolerances,
    parse_range,
    parse_tolerances,
    read_tolerances,
)
from spab_core.drawings import improve as better
from spab_core.drawings.improve import Holds, Ranges, improve, save_improvement
from spab_core.drawings.look import AXES, REACH, Look
from spab_core.drawings.tolerance import (
    HALF_WIDTH,
    MACHINES,
    WANTED,
    check_study,
    save_study,
    tolerance_study,
)
from spab_core.trajectory.assessment import GOOD, GRADES
from spab_core.trajectory.compiling import compile_once

_SOLVER = tuple(n for n in options.SOLVER if n not in ("--design", "--preset"))
NO_LINE = "none"


def _add_machine(parser: Parser) -> None:
    options.add(parser, "--rotor-mass", required=True)
    speed = parser.add_mutually_exclusive_group(required=True)
    options.add(speed, "--rpm", "--bearing-number")
    parser.add_argument(
        "--within",
        nargs=2,
        action="append",
        metavar=("VALUE", "TEXT"),
        help="such as bearing.clearance '± 2 µm', bearing.permeability '± 33 %% normal', "
        "rotor.unbalance_eccentricity 'up to G 2.5', rotor_mass '± 5 %%', speed '± 2 %%' (+- for "
        "±); repeated for each value; besides those of the design file's [tolerances], which it "
        "replaces",
    )
    options.add(parser, "--workers", default=min(2, os.cpu_count() or 1))
    options.add(parser, "--dask")
    options.add(parser, "--seed", help="of the machines drawn; left out: 0")


def add_tolerance_options(parser: Parser) -> None:
    """Add the options of ``spab design tolerance``."""
    _add_machine(parser)
    parser.add_argument(
        "--axis",
        default=AXES[0],
        help=f"of each machine's margin: {', '.join(AXES)}, or {NO_LINE}; left out: {AXES[0]}",
    )
    parser.add_argument(
        "--reach",
        type=options.number,
        default=REACH,
        help=f"end of the margin's line, times the machine's own value; left out: {REACH:g}",
    )
    parser.add_argument(
        "--machines",
        type=options.whole,
        default=MACHINES,
        help=f"drawn at most, a power of two; left out: {MACHINES}",
    )
    parser.add_argument(
        "--half-width",
        type=options.number,
        default=HALF_WIDTH,
        help="of the interval of the share of good machines at which no more are drawn; 0: never; "
        f"left out: {HALF_WIDTH:g}",
    )
    parser.add_argument(
        "--wanted",
        type=options.number,
        default=WANTED,
        help=f"share of good machines that is wanted; left out: {WANTED:g}",
    )
    parser.add_argument(
        "--out",
        metavar="FILE.json",
        help="write the machines drawn and what was found; a run that was stopped goes on from "
        "what is solved",
    )
    options.add(parser, *_SOLVER)
    options.add_limits(parser)


def add_improve_options(parser: Parser) -> None:
    """Add the options of ``spab design improve``."""
    _add_machine(parser)
    parser.add_argument(
        "--vary",
        nargs=2,
        action="append",
        required=True,
        metavar=("VALUE", "RANGE"),
        help="what may move: such as bearing.clearance '15:40 µm', "
        "bearing.supply_pressure_ratio '2:8 bar', rotor.unbalance_eccentricity '1:6.3 G'; "
        "repeated",
    )
    parser.add_argument(
        "--wish",
        action="append",
        help=f"two of {', '.join(better.WISHES)}; left out: {' and '.join(better.USUAL_WISHES)}",
    )
    parser.add_argument(
        "--axis", default=AXES[0], help=f"of the margin: {' or '.join(AXES)}; left out: {AXES[0]}"
    )
    parser.add_argument(
        "--reach",
        type=options.number,
        default=better.REACH,
        help=f"end of the margin's line, times the machine's own value; left out: {better.REACH:g}",
    )
    parser.add_argument(
        "--grade",
        default=GRADES[GOOD],
        help="must hold: good, or watch where a drawing may be to be watched; left out: good",
    )
    for name, text in (
        ("--most-gas-flow", "must hold: normal litres a minute at most"),
        ("--least-stiffness", "must hold: static stiffness of the softest direction, N/µm"),
        ("--held-film", "must hold: least film, µm, besides the limit of the verdict"),
        ("--load", "must hold: times the rotor mass that the film carries at rest"),
    ):
        parser.add_argument(name, type=options.number, help=text)
    parser.add_argument(
        "--screened",
        type=options.whole,
        default=better.SCREENED,
        help=f"drawings predicted by linear theory; left out: {better.SCREENED}",
    )
    parser.add_argument(
        "--solved",
        type=options.whole,
        default=better.SOLVED,
        help=f"drawings solved for the front; left out: {better.SOLVED}",
    )
    parser.add_argument(
        "--out",
        metavar="FILE.json",
        help="write the front; a run that was stopped goes on from what is solved",
    )
    parser.add_argument(
        "--best-out", metavar="FILE.toml", help="write the design with most of the first wish"
    )
    parser.add_argument(
        "--force", action="store_true", help="replace a file of --best-out that is there"
    )
    options.add(parser, *_SOLVER)
    options.add_limits(parser)


def ranges_of(args: Namespace, machine: Machine) -> Ranges:
    """Return what may move."""
    found: Ranges = {}
    for key, text in args.vary:
        name, bounds = parse_range(key, text, machine)
        if name in found:
            raise InputError(f"--vary {key[:60]} is given twice")
        found[name] = bounds
    return found


def machine_of(args: Namespace, design: Design) -> Machine:
    """Return the machine of the options, checked."""
    number = bearing_number_of(design, args.bearing_number, args.rpm, "--rpm")
    machine = Machine(design, args.rotor_mass, to_rpm(design.speed(number)))
    machine.check()
    return machine


def tolerances_of(args: Namespace) -> Tolerances:
    """Return the tolerances of the design file, and those of the options in their place."""
    given = {}
    for key, text in args.within or ():
        if key in given:
            raise InputError(f"--within {key[:60]} is given twice")
        given[key] = text
    found = {t.name: t for t in parse_tolerances(given)}
    if args.design is not None:
        for t in read_tolerances(options.design_bytes(args), args.design):
            found.setdefault(t.name, t)
    return tuple(found.values())


def _look(args: Namespace, axis: str, reach: float) -> Look:
    return Look(axis, reach, limits=options.limits_of(args), settings=options.settings_of(args))


@contextlib.contextmanager
def _run(args: Namespace, look: Look, machine: Machine, total: int) -> Iterator[dict[str, Any]]:
    """Check how the machines are to be solved and where to; yield the options of the run, with a
    bar of ``total`` machines.
    """
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    check_number("--seed", args.seed, 0, options.MAX_SEED)
    cluster = check_cluster(args.dask or "") or None
    if args.out is not None:
        check_output(args.out, "--out", (".json",))
    parts = Path(f"{args.out}.parts")
    say_compiling(look.settings, machine.design)
    compile_once(look.settings, machine.design)
    with (
        tqdm(total=total, unit="machine", leave=False) as bar,
        resumable(bar, parts, "solved machines"),
    ):
        yield {
            "seed": args.seed,
            "checkpoint": None if args.out is None else parts,
            "workers": args.workers,
            "cluster": cluster,
            "progress": bar.update,
        }


def design_tolerance(args: Namespace, design: Design) -> Answer:
    """Run ``spab design tolerance`` and return its answer."""
    check_choice("--axis", args.axis, (*AXES, NO_LINE))
    look = _look(args, "" if args.axis == NO_LINE else args.axis, args.reach)
    machine, tolerances = machine_of(args, design), tolerances_of(args)
    check_study(machine, tolerances, look, args.machines, args.half_width, args.wanted)
    with _run(args, look, machine, args.machines) as run:
        study = tolerance_study(
            machine,
            tolerances,
            look,
            most=args.machines,
            half_width=args.half_width,
            wanted=args.wanted,
            **run,
        )
        if args.out is not None:
            save_study(study, Path(args.out))
    answer = study.record() | {"out": args.out}
    if not args.json:
        print("\n".join([*study.sentences(), "", _table(answer)]))
    return answer


def design_improve(args: Namespace, design: Design) -> Answer:
    """Run ``spab design improve`` and return its answer."""
    check_choice("--axis", args.axis, AXES)
    look = dataclasses.replace(_look(args, args.axis, args.reach), precision=better.PRECISION)
    if args.load is not None:
        look = dataclasses.replace(look, load=args.load)
    wishes = tuple(args.wish or better.USUAL_WISHES)
    holds = Holds(
        args.grade,
        math.inf if args.most_gas_flow is None else args.most_gas_flow,
        1e6 * (args.least_stiffness or 0.0),
        1e-6 * (args.held_film or 0.0),
    )
    machine, tolerances = machine_of(args, design), tolerances_of(args)
    ranges = ranges_of(args, machine)
    better.check_improve(machine, ranges, wishes, look, tolerances, args.screened, args.solved)
    if args.best_out is not None:
        check_output(args.best_out, "--best-out", (".toml",))
        options.check_new(args.best_out, "--best-out", args.force)
    total = better.steps(args.screened, args.solved, bool(tolerances))
    with _run(args, look, machine, total) as run:
        found = improve(
            machine,
            ranges,
            wishes,
            look,
            holds,
            tolerances,
            screened=args.screened,
            solved=args.solved,
            **run,
        )
        if args.out is not None:
            save_improvement(found, Path(args.out))
    if args.best_out is not None and found.best is not None:
        save_design(found.machine_at(found.best).design, args.best_out)
    if not args.json:
        print("\n".join(found.sentences()))
        if found.count:
            print(f"\n{found.table().to_string(index=False, float_format='{:.4g}'.format)}")
    return found.record() | {"out": args.out, "best_out": args.best_out}


def _table(answer: Answer) -> str:
    """Return the drivers and narrowings as lines of text."""
    lines = [
        f"{'tolerance':34s} {'first':>6s} {'total':>6s} {'±':>5s}  narrowed for the wanted share"
    ]
    narrowed = {row["value"]: row["narrowed"] for row in answer["narrowings"]}
    rows = answer["drivers"] or [
        {"value": v, "first": None, "total": None, "total_spread": None} for v in narrowed
    ]
    for row in rows:
        numbers = " ".join(
            f"{'' if row[k] is None else format(row[k], '.2f'):>{w}s}"
            for k, w in (("first", 6), ("total", 6), ("total_spread", 5))
        )
        lines.append(f"{row['value']:34s} {numbers}  {narrowed.get(row['value']) or '–'}")
    return "\n".join(lines)
