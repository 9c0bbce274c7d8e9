"""``spab design map``: the map of a bearing in minutes."""

from __future__ import annotations

import os
import sys
import time
from argparse import Namespace
from pathlib import Path

from tqdm import tqdm

from spab_core.active_learning.quick_map import (
    SECONDS,
    SECONDS_RANGE,
    SETTINGS,
    as_map,
    check_cells,
    check_cluster,
    check_quick_map,
    quick_map,
    usual_plane,
)
from spab_core.active_learning.refine import save_refinement
from spab_core.cli import options
from spab_core.cli.options import Answer, Parser
from spab_core.cli.progress import resumable, say_compiling
from spab_core.common.files import check_output
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.maps.stability_map import save_map
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES
from spab_core.trajectory.regimes import NO_EXPONENT, REGIMES


def add_map_options(parser: Parser) -> None:
    """Add the options of the command."""
    usual = "default: bearing numbers 0.05:8.5:170"
    options.add_speed(parser, required=False, **options.AXIS, help=f"shaft speed; {usual}")
    options.add(
        parser,
        "--rotor-mass",
        **options.AXIS,
        help="kg on one bearing; default: 250 masses up to the load of the reference map",
    )
    parser.add_argument(
        "--minutes",
        type=options.number,
        default=SECONDS / 60.0,
        help="wall time; a coarse plane of cells is solved in any case",
    )
    parser.add_argument(
        "--cells",
        type=options.whole,
        help="end at so many solved cells, if the minutes allow: the same map however fast the "
        "machine",
    )
    options.add(parser, "--seed", help="of the choice of cells; default: 0")
    options.add(parser, "--workers", default=min(2, os.cpu_count() or 1))
    options.add(parser, "--dask")
    parser.add_argument(
        "--out",
        required=True,
        metavar="FILE.npz",
        help="solved cells and predictions, as spab refine writes them",
    )
    parser.add_argument(
        "--map-out", metavar="FILE.npz", help="both as one map, for spab margin and spab export"
    )


def design_map(args: Namespace, design: Design) -> Answer:
    """Run the command and return its answer."""
    shortest, longest = (seconds / 60.0 for seconds in SECONDS_RANGE)
    check_number("--minutes", args.minutes, shortest, longest, "min")
    usual = usual_plane(design)
    given = args.bearing_number if args.rpm is None else options.rpm_range(args.rpm, design)
    axes = (given or usual[0], args.rotor_mass or usual[1])
    for name in ("--bearing-number", "--rotor-mass"):
        if text := getattr(args, options.destination(name)):
            options.values_of(text, name)  # whose words name the option
    bearing_number, rotor_mass = check_quick_map(*axes, 60.0 * args.minutes)
    if args.cells is not None:
        check_cells(args.cells, len(bearing_number) * len(rotor_mass), "--cells")
    check_number("--workers", args.workers, 1, options.MAX_WORKERS)
    check_number("--seed", args.seed, 0, options.MAX_SEED)
    check_output(args.out, "--out", (".npz",))
    if args.map_out is not None:
        check_output(args.map_out, "--map-out", (".npz",))
    cluster = check_cluster(args.dask or "") or None
    parts = Path(f"{args.out}.parts")
    say_compiling(design=design)
    began = time.monotonic()
    form = "{l_bar}{bar}| {n:.0f} of {total} s"
    with (
        tqdm(total=round(60.0 * args.minutes), unit="s", bar_format=form) as bar,
        resumable(bar, parts, "solved cells"),
    ):
        for result in quick_map(
            design,
            bearing_number,
            rotor_mass,
            SETTINGS,
            seconds=60.0 * args.minutes,
            most=args.cells,
            seed=args.seed,
            checkpoint=parts,
            workers=args.workers,
            cluster=cluster,
            # what takes longer than was asked for is no reason for a bar without an end
            progress=lambda seconds: bar.update(min(seconds, bar.total - bar.n)),
            tell=bar.set_description_str,
        ):
            save_refinement(result, args.out)
    filled, solved = as_map(result), int(result.solved.sum())
    if args.map_out is not None:
        save_map(filled, args.map_out)
    asked, took = 60.0 * args.minutes, time.monotonic() - began
    if took > asked + 10.0:
        print(
            f"spab: the map took {took:.0f} s instead of {asked:.0f} s: linear theory, a coarse "
            "plane of cells and the predictions are computed in any case",
            file=sys.stderr,
        )
    shares = {name or NO_EXPONENT: float((filled.regime == name).mean()) for name in (*REGIMES, "")}
    worth = {grade: float((filled.grades() == grade).mean()) for grade in GRADES}
    if not args.json:
        told = ", ".join(
            f"{name} {100 * s:.1f} %"
            for name, s in ({GRADE_WORDS[g]: s for g, s in worth.items()} | shares).items()
            if s
        )
        print(
            f"{args.out}: {solved:,} of {result.batch.size:,} cells solved, the others predicted; "
            f"of the plane {told}"
        )
    return {
        "out": args.out,
        "map_out": args.map_out,
        "cells": int(result.batch.size),
        "solved": solved,
        "bearing_number": axes[0],
        "rotor_mass": axes[1],
        "shares": shares,
        "assessment_shares": worth,
    }
