"""The commands that solve many operating points: map, bifurcation; and export, which reads what was
solved.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import resumable, say_compiling
from spab_core.common.errors import InputError
from spab_core.common.files import check_output, csv_bytes, write_atomically
from spab_core.common.validation import check_choice, check_number
from spab_core.design.form import bearing_number_of
from spab_core.design.model import Design
from spab_core.maps.bifurcation import (
    SWEEPS,
    VARY,
    chaotic_intervals,
    check_line,
    compute_bifurcation,
    interval_table,
    line_verdict,
    save_bifurcation,
)
from spab_core.maps.checkpoints import Checkpoint, run_plan
from spab_core.maps.compute import compute_map
from spab_core.maps.stability_map import axis, check_plane, save_map
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES


def add_commands(commands: Commands) -> None:
    """Add the commands to the parser's."""
    sub = options.add_command(commands, "map", "solve a plane of operating points", _map)
    options.add_speed(sub, **options.AXIS)
    options.add(sub, "--rotor-mass", required=True, **options.AXIS)
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    options.add(sub, "--workers", "--dask", *options.SOLVER)
    options.add_limits(sub)

    sub = options.add_command(
        commands,
        "bifurcation",
        "Poincaré sections and exponents along a line of operating points",
        _bifurcation,
    )
    sub.add_argument("--vary", required=True, help=" or ".join(VARY))
    sub.add_argument(
        "--at",
        type=options.number,
        help="the other one's value: bearing number, or rotor mass in kg",
    )
    sub.add_argument("--range", metavar="START:STOP:COUNT")
    sub.add_argument(
        "--rpm",
        metavar="RPM|START:STOP:COUNT",
        help="shaft speed, in place of the bearing number that --at or --range gives",
    )
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    sub.add_argument(
        "--sweeps",
        default=",".join(SWEEPS),
        help="cold (every point from rest), up, down (state carried on)",
    )
    options.add(sub, "--workers", *options.SOLVER)
    options.add_limits(sub)

    sub = options.add_command(
        commands,
        "export",
        "a map, line, operating point or refinement as a table (.csv), NetCDF (.nc) or MATLAB file "
        "(.mat)",
        _export,
    )
    sub.add_argument("map", metavar="FILE.npz", help="of map, bifurcation, simulate or refine")
    sub.add_argument("--out", required=True, metavar="FILE.csv|FILE.nc|FILE.mat")
    sub.add_argument(
        "--semicolons",
        action="store_true",
        help="CSV with semicolons and decimal commas, for Excel where a comma is the decimal sign",
    )


def _map(args: Namespace) -> Answer:
    design = options.design_of(args)
    bearing_number = options.bearing_numbers(args, design)
    rotor_mass = options.values_of(args.rotor_mass, "--rotor-mass")
    cells = check_plane(bearing_number, rotor_mass)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    settings, limits = options.settings_of(args), options.limits_of(args)
    settings.check_cold_start()
    check_output(args.out, "--out", (".npz",))
    parts = Path(f"{args.out}.parts")
    Checkpoint(parts, run_plan(design, bearing_number, rotor_mass, settings), {}).open()
    say_compiling(settings, design)
    with (
        tqdm(total=cells, unit="cell", smoothing=0.05) as bar,
        resumable(bar, parts, "finished chunks"),
    ):
        result = compute_map(
            design,
            bearing_number,
            rotor_mass,
            settings,
            workers=args.workers,
            cluster=args.dask,
            checkpoint=parts,
            progress=bar.update,
        )
        save_map(result, args.out)
    regimes = zip(result.regime.ravel().tolist(), result.status.ravel().tolist(), strict=True)
    counts = dict(sorted(Counter(regime or status for regime, status in regimes).items()))
    grades = replace(result, limits=limits).grades()
    assessed = {grade: int((grades == grade).sum()) for grade in GRADES}
    if not args.json:
        print(f"{args.out}: " + ", ".join(f"{name} {count}" for name, count in counts.items()))
        told = ", ".join(f"{GRADE_WORDS[name]} {count}" for name, count in assessed.items())
        print(f"{args.out}: by the motion alone: {told}")
    return {
        "out": args.out,
        "cells": int(result.mle.size),
        "regimes": counts,
        "assessments": assessed,
        "wall_seconds": result.metadata["wall_seconds"],
    }


def _bifurcation(args: Namespace) -> Answer:
    design = options.design_of(args)
    at, values = _line(args, design)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    settings, limits = options.settings_of(args), options.limits_of(args)
    check_output(args.out, "--out", (".npz",))
    sweeps = options.listed(args.sweeps)
    check_line(args.vary, at, values, sweeps)
    settings.check_cold_start()
    parts = Path(f"{args.out}.parts")
    say_compiling(settings, design)
    with (
        tqdm(total=len(values) * len(sweeps), unit="point", smoothing=0.05) as bar,
        resumable(bar, parts, "finished points"),
    ):
        result = compute_bifurcation(
            design,
            args.vary,
            at,
            values,
            settings,
            sweeps=sweeps,
            workers=args.workers,
            checkpoint=parts,
            progress=bar.update,
        )
        save_bifurcation(result, args.out)
    intervals = {
        name: chaotic_intervals(values, branch.regime) for name, branch in result.branches.items()
    }
    judged = replace(result, limits=limits)
    table = interval_table(judged, sweeps)
    verdicts = {name: line_verdict(judged, name) for name in judged.branches}
    if not args.json:
        for name, (_, words) in verdicts.items():
            print(f"{args.out}: {name}: {words}")
            for row in table[table["sweep"] == name].itertuples():
                where = f"{row.first:g}" + f" to {row.last:g}" * (row.first != row.last)
                why = f": {row.why}" if row.why else ""
                print(f"  {args.vary} {where}: {GRADE_WORDS[row.assessment]}{why}")
    return {
        "out": args.out,
        "points": len(values),
        "assessment": {name: worst for name, (worst, _) in verdicts.items()},
        "bands": table.to_dict("records"),
        "chaotic_intervals": intervals,
    }


def _line(args: Namespace, design: Design) -> tuple[float, np.ndarray]:
    """Return what is held and the values of what is varied, either from --rpm where it is a
    speed.
    """
    check_choice("--vary", args.vary, VARY)
    held, varied = args.at, args.range
    if args.rpm is not None:
        name = "--at" if args.vary == "rotor-mass" else "--range"
        if getattr(args, name.removeprefix("--")) is not None:
            raise InputError(f"give either {name} or --rpm, with --vary {args.vary}")
        if args.vary == "rotor-mass":
            held = bearing_number_of(design, None, options.speed_of(args.rpm), "--rpm")
        else:
            varied = options.rpm_range(args.rpm, design)
    read = options.values_of if args.range is not None else axis
    for name, value in (("--at", held), ("--range", varied)):
        if value is None:
            raise InputError(f"{name} is required, with --vary {args.vary}")
    return float(held), read(varied, "--range")


def _export(args: Namespace) -> Answer:
    from spab_core.reporting.export import WRITERS, result_dataset  # loads Plotly

    check_output(args.out, "--out", tuple(WRITERS))
    ending = Path(args.out).suffix.lower()
    if args.semicolons and ending != ".csv":
        raise InputError("--semicolons belongs to a table, --out FILE.csv")
    found = result_dataset(args.map)
    data = csv_bytes(found.table, True) if args.semicolons else WRITERS[ending](found)
    write_atomically(args.out, data)
    if not args.json:
        print(f"{args.out}: {found.title.split(' of ')[0].lower()}, {len(data) / 1e6:.2f} MB")
    return {"out": args.out, "bytes": len(data)}
