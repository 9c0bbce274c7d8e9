"""The commands that solve many operating points: map, bifurcation; and export, which reads a solved
map.
"""

from __future__ import annotations

from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from tqdm import tqdm

from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import resumable, say_compiling
from spab_core.common.errors import InputError
from spab_core.common.files import check_output, csv_bytes, write_atomically
from spab_core.common.validation import check_number
from spab_core.maps.bifurcation import (
    SWEEPS,
    VARY,
    chaotic_intervals,
    check_line,
    compute_bifurcation,
    save_bifurcation,
)
from spab_core.maps.checkpoints import Checkpoint, run_plan
from spab_core.maps.compute import compute_map
from spab_core.maps.stability_map import StabilityMap, axis, check_plane, load_map, save_map


def add_commands(commands: Commands) -> None:
    """Add the commands to the parser's."""
    sub = options.add_command(commands, "map", "solve a plane of operating points", _map)
    options.add(sub, "--bearing-number", "--rotor-mass", required=True, **options.AXIS)
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    options.add(sub, "--workers", "--dask", *options.SOLVER)

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
        required=True,
        help="the other one's value: bearing number, or rotor mass in kg",
    )
    sub.add_argument("--range", required=True, metavar="START:STOP:COUNT")
    sub.add_argument("--out", required=True, metavar="FILE.npz")
    sub.add_argument(
        "--sweeps",
        default=",".join(SWEEPS),
        help="cold (every point from rest), up, down (state carried on)",
    )
    options.add(sub, "--workers", *options.SOLVER)

    sub = options.add_command(
        commands, "export", "a map as NetCDF (.nc) or as a table (.csv)", _export
    )
    sub.add_argument("map", metavar="MAP.npz")
    sub.add_argument("--out", required=True, metavar="FILE.nc|FILE.csv")


def _map(args: Namespace) -> Answer:
    bearing_number = axis(args.bearing_number, "--bearing-number")
    rotor_mass = axis(args.rotor_mass, "--rotor-mass")
    cells = check_plane(bearing_number, rotor_mass)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    settings, design = options.settings_of(args), options.design_of(args)
    settings.check_cold_start()
    check_output(args.out, "--out")
    parts = Path(f"{args.out}.parts")
    Checkpoint(parts, run_plan(design, bearing_number, rotor_mass, settings), {}).open()
    say_compiling(settings)
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
    if not args.json:
        print(f"{args.out}: " + ", ".join(f"{name} {count}" for name, count in counts.items()))
    return {
        "out": args.out,
        "cells": int(result.mle.size),
        "regimes": counts,
        "wall_seconds": result.metadata["wall_seconds"],
    }


def _bifurcation(args: Namespace) -> Answer:
    values = axis(args.range, "--range")
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    settings, design = options.settings_of(args), options.design_of(args)
    check_output(args.out, "--out")
    sweeps = args.sweeps.split(",")
    check_line(args.vary, args.at, values, sweeps)
    settings.check_cold_start()
    parts = Path(f"{args.out}.parts")
    say_compiling(settings)
    with (
        tqdm(total=len(values) * len(sweeps), unit="point", smoothing=0.05) as bar,
        resumable(bar, parts, "finished points"),
    ):
        result = compute_bifurcation(
            design,
            args.vary,
            args.at,
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
    if not args.json:
        for name, found in intervals.items():
            text = ", ".join(f"{a:g}" if a == b else f"{a:g} to {b:g}" for a, b in found)
            where = f"chaotic at {args.vary} {text}" if found else "nowhere chaotic"
            print(f"{args.out}: {name}: {where}")
    return {"out": args.out, "points": len(values), "chaotic_intervals": intervals}


def _export(args: Namespace) -> Answer:
    from spab_core.reporting.export import map_netcdf, map_table  # loads Plotly

    writers: dict[str, Callable[[StabilityMap], bytes]] = {
        ".nc": map_netcdf,
        ".csv": lambda m: csv_bytes(map_table(m)),
    }
    ending = Path(args.out).suffix.lower()
    if ending not in writers:
        raise InputError(f"--out = {args.out[:200]!r} must end in {' or '.join(writers)}")
    check_output(args.out, "--out")
    data = writers[ending](load_map(args.map))
    write_atomically(args.out, data)
    if not args.json:
        print(f"{args.out}: {len(data) / 1e6:.2f} MB")
    return {"out": args.out, "bytes": len(data)}
