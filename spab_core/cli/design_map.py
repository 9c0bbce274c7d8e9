"""``spab design map``: the map of a bearing in minutes."""

from __future__ import annotations

import os
from pathlib import Path

from tqdm import tqdm

from spab_core.active_learning.quick_map import (
    SECONDS,
    SETTINGS,
    as_map,
    check_cluster,
    check_quick_map,
    quick_map,
    usual_plane,
)
from spab_core.active_learning.refine import save_refinement
from spab_core.cli.jobs import kept_when_stopped
from spab_core.common.files import check_output
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.maps.checkpoints import remove_parts
from spab_core.maps.stability_map import save_map
from spab_core.trajectory.compiling import is_compiled
from spab_core.trajectory.regimes import NO_EXPONENT

MAX_WORKERS = 1024


def add_command(sub, number, whole) -> None:
    """Options of the command; ``number`` and ``whole`` read a float and an integer."""
    sub.add_argument("--bearing-number", metavar="START:STOP:COUNT", help="left out: 0.05:8.5:170")
    sub.add_argument(
        "--rotor-mass",
        metavar="START:STOP:COUNT",
        help="kg on one bearing; left out: 250 masses up to the load of the reference map",
    )
    sub.add_argument("--minutes", type=number, default=SECONDS / 60.0, help="wall time")
    sub.add_argument("--seed", type=whole, default=0, help="of the choice of cells")
    sub.add_argument("--workers", type=whole, default=min(2, os.cpu_count() or 1), help="processes")
    sub.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster, such as tcp://host:8786, to solve there",
    )
    sub.add_argument(
        "--out",
        required=True,
        metavar="FILE.npz",
        help="solved cells and predictions, as spab refine writes them",
    )
    sub.add_argument(
        "--map-out", metavar="FILE.npz", help="both as one map, for spab margin and spab export"
    )


def design_map(args, design: Design) -> dict:
    """Run the command; returns its answer."""
    usual = usual_plane(design)
    axes = (args.bearing_number or usual[0], args.rotor_mass or usual[1])
    bearing_number, rotor_mass = check_quick_map(*axes, 60.0 * args.minutes)
    check_number("--workers", args.workers, 1, MAX_WORKERS)
    check_number("--seed", args.seed, 0, 2**32 - 1)
    for name, path in (("--out", args.out), ("--map-out", args.map_out)):
        if path is not None:
            check_output(path, name)
    cluster = check_cluster(args.dask or "") or None
    parts = Path(f"{args.out}.parts")
    if not is_compiled():
        print("spab: compiling the kernels, once on this machine (about 20 s)", flush=True)
    with (
        tqdm(
            total=round(60.0 * args.minutes),
            unit="s",
            bar_format="{l_bar}{bar}| {n:.0f} of {total} s",
        ) as bar,
        kept_when_stopped(bar, parts, "solved cells"),
    ):
        result = quick_map(
            design,
            bearing_number,
            rotor_mass,
            SETTINGS,
            seconds=60.0 * args.minutes,
            seed=args.seed,
            parts=parts,
            workers=args.workers,
            cluster=cluster,
            progress=bar.update,
            publish=lambda found: save_refinement(found, args.out),
        )
        save_refinement(result, args.out)
    remove_parts(parts)
    filled, solved = as_map(result), int(result.solved.sum())
    if args.map_out is not None:
        save_map(filled, args.map_out)
    shares = {
        name: float((filled.regime == name).mean())
        for name in ("periodic", "quasi-periodic", "chaotic", "")
    }
    if not args.json:
        print(
            f"{args.out}: {solved:,} of {result.batch.size:,} cells solved; of the plane "
            + ", ".join(
                f"{name or 'without exponent'} {100 * share:.1f} %"
                for name, share in shares.items()
                if share
            )
        )
    return {
        "out": args.out,
        "map_out": args.map_out,
        "cells": int(result.batch.size),
        "solved": solved,
        "bearing_number": axes[0],
        "rotor_mass": axes[1],
        "shares": {name or NO_EXPONENT: s for name, s in shares.items()},
    }
