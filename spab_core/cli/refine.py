"""The command ``spab refine``: which cells of a plane are worth solving, solved live."""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from spab_core.active_learning.committee import LABELS, Prediction, scores
from spab_core.active_learning.oracles import live_oracle, map_oracle
from spab_core.active_learning.refine import Refinement, check_budget, refine, save_refinement
from spab_core.cli.jobs import kept_when_stopped
from spab_core.common.errors import InputError
from spab_core.common.files import check_output
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import PLANE, LinearTable, shipped_table, table_for
from spab_core.maps.checkpoints import remove_parts
from spab_core.maps.stability_map import axis, check_plane, load_map
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.regimes import NO_EXPONENT

_SHOWN = 5  # suggestions printed; the file holds all


def add_command(command, run_options, whole, solver) -> None:
    """Add the command to the parser's.

    ``command`` and ``run_options`` add a command and the solver's options, ``whole`` reads an
    integer, ``solver`` makes design and settings from the arguments and says when the solver must
    be compiled."""
    sub = command(
        "refine",
        "solve the cells of a plane that are worth solving, from a coarse start, and predict the "
        "others",
    )
    sub.add_argument("--bearing-number", metavar="START:STOP:COUNT")
    sub.add_argument("--rotor-mass", metavar="START:STOP:COUNT", help="kg on one bearing")
    sub.add_argument(
        "--budget", type=whole, required=True, help="cells to solve, the coarse start included"
    )
    sub.add_argument(
        "--out",
        required=True,
        metavar="FILE.npz",
        help="solved cells, predicted exponent and regime of all cells, and what to solve next",
    )
    sub.add_argument("--workers", type=whole, default=1, help="processes")
    sub.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster, such as tcp://host:8786, to solve there",
    )
    sub.add_argument("--seed", type=whole, default=0, help="of the start, the trees and the draws")
    sub.add_argument(
        "--map",
        metavar="FILE.npz",
        help="a study: plane and values from this map, none solved; errors told",
    )
    run_options(sub, 300)
    own = {"workers": sub.get_default("workers")}
    own |= {
        name: sub.get_default(name)
        for name in (
            "design",
            "mesh",
            "transient",
            "revolutions",
            "method",
            "scheme",
            "tolerance",
            "full_length",
        )
    }
    sub.set_defaults(
        run=partial(
            _refine,
            solver=solver,
            unused=own | dict.fromkeys(("bearing_number", "rotor_mass", "dask")),
        )
    )


def _refine(args, solver, unused) -> dict:
    check_output(args.out, "--out")
    return _study(args, unused) if args.map is not None else _solve(args, *solver)


def _study(args, unused) -> dict:
    given = [
        f"--{name.replace('_', '-')}"
        for name, default in unused.items()
        if getattr(args, name) != default
    ]
    if given:
        raise InputError(
            f"{', '.join(given)}: not allowed with --map, whose plane and values are taken"
        )
    m = load_map(args.map)
    check_budget(m.mle.size, args.budget, args.seed)
    last: list[Prediction] = []

    def watch(solved: np.ndarray, prediction: Prediction) -> None:
        last[:] = [prediction]
        bar.update(int(solved.sum()) - bar.n)

    table = _table(m.design, m.bearing_number, m.rotor_mass)
    with tqdm(total=args.budget, unit="cell", smoothing=0.05) as bar:
        result = refine(
            m.bearing_number,
            m.rotor_mass,
            map_oracle(m),
            args.budget,
            args.seed,
            table=table,
            watch=watch,
            metadata=m.metadata | {"study": True},
        )
    save_refinement(result, args.out)
    found = {
        name: value if np.isfinite(value) else None
        for name, value in scores(m, last[0], ~result.solved.ravel()).items()
    }
    return _answer(args, result, {f"{name}_held_out": value for name, value in found.items()})


def _table(design: Design, bearing_number: np.ndarray, rotor_mass: np.ndarray) -> LinearTable:
    """Linear theory over the plane; says so first where it must be computed."""
    plane = tuple((float(a.min()), float(a.max())) for a in (bearing_number, rotor_mass))
    inside = all(
        least <= low and high <= most
        for (low, high), (least, most) in zip(plane, PLANE, strict=True)
    )
    if design != shipped_table().design or not inside:
        tqdm.write(
            "spab: linear stability of this bearing over the plane (about half a minute)",
            file=sys.stderr,
        )
    return table_for(design, plane)


def _solve(args, design, settings, say_compiling) -> dict:
    if args.bearing_number is None or args.rotor_mass is None:
        raise InputError(
            "the plane is missing: give --bearing-number and --rotor-mass, or --map for a study"
        )
    bearing_number, rotor_mass = (
        axis(args.bearing_number, "--bearing-number"),
        axis(args.rotor_mass, "--rotor-mass"),
    )
    start = check_budget(check_plane(bearing_number, rotor_mass), args.budget, args.seed)
    check_number("--workers", args.workers, 1, 1024)
    chosen, how = design(args), settings(args)
    parts = Path(f"{args.out}.parts")
    metadata = map_metadata(chosen, how, (len(bearing_number), len(rotor_mass))) | {"study": False}
    with (
        tqdm(total=args.budget, unit="cell", smoothing=0.05) as bar,
        kept_when_stopped(bar, parts, "solved cells"),
        live_oracle(
            chosen,
            bearing_number,
            rotor_mass,
            how,
            parts=parts,
            plan={"seed": args.seed, "start": start},
            workers=args.workers,
            cluster=args.dask,
            progress=bar.update,
        ) as oracle,
    ):
        say_compiling()
        table = _table(chosen, bearing_number, rotor_mass)
        result = refine(
            bearing_number,
            rotor_mass,
            oracle,
            args.budget,
            args.seed,
            table=table,
            metadata=metadata,
        )
        save_refinement(result, args.out)
    remove_parts(parts)
    return _answer(args, result, {})


def _answer(args, result: Refinement, found: dict) -> dict:
    solved, failed = (
        int(result.solved.sum()),
        int((result.values["status"][result.solved] != "ok").sum()),
    )
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
                "rotor mass "
                f"{row.rotor_mass_kg:g} kg: {row.in_doubt} in doubt, "
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
