"""The command ``spab refine``: which cells of a plane are worth solving, solved live."""

from __future__ import annotations

import json
import sys
from argparse import Namespace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from spab_core.active_learning.committee import LABELS, scores
from spab_core.active_learning.oracles import live_oracle, map_oracle
from spab_core.active_learning.refine import Refinement, check_budget, last, refine, save_refinement
from spab_core.cli import options
from spab_core.cli.options import Answer, Commands
from spab_core.cli.progress import resumable, say_compiling
from spab_core.common.errors import InputError
from spab_core.common.files import check_output
from spab_core.common.threads import one_thread
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import PLANE, LinearTable, shipped_table, table_for
from spab_core.maps.stability_map import check_plane, load_map
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.regimes import NO_EXPONENT

_SHOWN = 5  # suggestions printed; the file holds all


def add_commands(commands: Commands) -> None:
    """Add the command to the parser's."""
    sub = options.add_command(
        commands,
        "refine",
        "solve the cells of a plane that are worth solving, beginning with a coarse grid, and "
        "predict the others",
        _refine,
    )
    options.add_speed(sub, required=False, **options.AXIS)
    options.add(sub, "--rotor-mass", **options.AXIS)
    sub.add_argument(
        "--budget",
        type=options.whole,
        required=True,
        help="cells to solve, the coarse grid included",
    )
    sub.add_argument(
        "--out",
        required=True,
        metavar="FILE.npz",
        help="solved cells, predicted exponent and regime of all cells, and what to solve next",
    )
    options.add(sub, "--seed", help="of the start, the trees and the choice of cells; default: 0")
    options.add(
        sub,
        "--map",
        help="a study: plane and values are taken from this map, nothing is solved; prints errors",
    )
    options.add(sub, "--workers", "--dask", *options.SOLVER)
    solving = ("--bearing-number", "--rpm", "--rotor-mass", "--workers", "--dask", *options.SOLVER)
    options.set_unused(sub, solving)


def _refine(args: Namespace) -> Answer:
    check_output(args.out, "--out", (".npz",))
    return _solve(args) if args.map is None else _study(args)


def _study(args: Namespace) -> Answer:
    options.check_unused(args, "not allowed with --map, whose plane and values are taken")
    m = load_map(args.map)
    check_budget(m.mle.size, args.budget, args.seed)
    table = _table(m.design, m.bearing_number, m.rotor_mass)
    with tqdm(total=args.budget, unit="cell", smoothing=0.05) as bar:
        for result in refine(
            m.bearing_number,
            m.rotor_mass,
            map_oracle(m),
            args.budget,
            args.seed,
            table=table,
            metadata=m.metadata | {"study": True},
        ):
            bar.update(int(result.solved.sum()) - bar.n)
    save_refinement(result, args.out)
    found = {
        name: value if np.isfinite(value) else None
        for name, value in scores(m, result.mle, result.regime, ~result.solved.ravel()).items()
    }
    return _answer(args, result, {f"{name}_held_out": value for name, value in found.items()})


def _table(design: Design, bearing_number: np.ndarray, rotor_mass: np.ndarray) -> LinearTable:
    """Return linear theory over the plane; say so first where it must be computed."""
    plane = tuple((float(a.min()), float(a.max())) for a in (bearing_number, rotor_mass))
    inside = all(
        least <= low and high <= most
        for (low, high), (least, most) in zip(plane, PLANE, strict=True)
    )
    if design != shipped_table().design or not inside:
        tqdm.write(
            "spab: linear stability of this bearing over the plane (some 10 s)",
            file=sys.stderr,
        )
    return one_thread(table_for)(design, plane)


def _solve(args: Namespace) -> Answer:
    design = options.design_of(args)
    if args.bearing_number is args.rpm or args.rotor_mass is None:  # None, both of them
        raise InputError(
            "the plane is missing: give --bearing-number or --rpm, and --rotor-mass, or --map for "
            "a study"
        )
    bearing_number = options.bearing_numbers(args, design)
    rotor_mass = options.values_of(args.rotor_mass, "--rotor-mass")
    start = check_budget(check_plane(bearing_number, rotor_mass), args.budget, args.seed)
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    settings = options.settings_of(args)
    parts = Path(f"{args.out}.parts")
    metadata = map_metadata(design, settings, (len(bearing_number), len(rotor_mass))) | {
        "study": False
    }
    with (
        tqdm(total=args.budget, unit="cell", smoothing=0.05) as bar,
        resumable(bar, parts, "solved cells"),
        live_oracle(
            design,
            bearing_number,
            rotor_mass,
            settings,
            checkpoint=parts,
            plan={"refine_seed": args.seed, "refine_start": start},
            workers=args.workers,
            cluster=args.dask,
            progress=bar.update,
        ) as oracle,
    ):
        say_compiling(settings, design)
        table = _table(design, bearing_number, rotor_mass)
        result = last(
            refine(
                bearing_number,
                rotor_mass,
                oracle,
                args.budget,
                args.seed,
                table=table,
                metadata=metadata,
            )
        )
        save_refinement(result, args.out)
    return _answer(args, result, {})


def _answer(args: Namespace, result: Refinement, found: dict[str, float | None]) -> Answer:
    solved = int(result.solved.sum())
    failed = int((result.values["status"][result.solved] != "ok").sum())
    names = [name for name in LABELS if (result.regime == name).any()]
    regimes = {name or NO_EXPONENT: int((result.regime == name).sum()) for name in names}
    suggested = result.suggestions()
    if not args.json:
        without = f", {failed:,} without an exponent" if failed else ""
        print(
            f"{args.out}: {solved:,} of {result.batch.size:,} cells solved{without}; predicted: "
            + ", ".join(f"{name} {count:,}" for name, count in regimes.items())
        )
        if found:
            labels = (
                "RMSE per revolution",
                "RMSE without strongly damped cells",
                "MAE",
                "regime accuracy",
                "F1 of chaos",
            )
            print(
                "held-out cells: "
                + ", ".join(
                    f"{label} {'none' if value is None else format(value, '.4f')}"
                    for label, value in zip(labels, found.values(), strict=True)
                )
            )
        for row in suggested.head(_SHOWN).itertuples():
            print(
                f"solve next: bearing number {row.bearing_number:g} ({row.speed_rpm:,.0f} rpm), "
                f"rotor mass {row.rotor_mass_kg:g} kg: {row.in_doubt} in doubt, "
                f"{row.predicted_regime or NO_EXPONENT} with MLE "
                f"{row.predicted_mle:+.3f} ± {row.deviation:.3f} expected"
            )
    return {
        "out": args.out,
        "cells": int(result.batch.size),
        "solved": solved,
        "without_exponent": failed,
        "predicted_regimes": regimes,
        "suggested": json.loads(suggested.to_json(orient="records", double_precision=15)),
        **found,
    }
