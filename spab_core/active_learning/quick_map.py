"""Map a bearing within minutes: solve a coarse plane first, then cells where regimes are in doubt,
until the time is up.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt

from spab_core.active_learning.oracles import CHUNK, live_oracle
from spab_core.active_learning.refine import MAX_PLANE, MIN_START, Refinement, batch_goals, refine
from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import LinearTable, linear_table, shipped_table
from spab_core.maps.stability_map import OPTIONAL, StabilityMap, axis, check_plane
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

SECONDS, SECONDS_RANGE = 300.0, (5.0, 86_400.0)
COARSE = 64  # cells of the first plane
SHARE = 0.2  # of a batch for the exponent: borders between regimes are what a designer looks for
TABLE_NODES = (32, 25)  # of linear theory's table: a quarter of the usual one, 8 s instead of 30
SETTINGS = Settings(revolutions=300)
_KEPT_BACK = 0.05  # of the time, for the last prediction and the file


def usual_plane(design: Design) -> tuple[str, str]:
    """Return the default axes for a design: bearing numbers 0.05 to 8.5, and rotor masses that give
    the loads of the reference map.

    Returns
    -------
    bearing_number, rotor_mass : str
        start:stop:count, as for ``stability_map.axis``. The largest mass weighs 0.67 p_a R², like
        25 kg on the reference bearing, times the supply pressure ratio if that is above one.
    """
    lift = design.force_unit * max(design.bearing.supply_pressure_ratio, 1.0)
    gravity = design.rotor.gravity or 9.81
    top = float(
        f"{np.clip(0.672 * lift / gravity, 10 * ROTOR_MASS_RANGE[0], ROTOR_MASS_RANGE[1]):.3g}"
    )
    return f"{0.05:g}:{8.5:g}:170", f"{top / 250:.6g}:{top:.6g}:250"


def check_quick_map(
    bearing_number: str, rotor_mass: str, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the axes of a quick map; raise ``InputError`` for a plane or a time out of range."""
    number, mass = axis(bearing_number, "bearing number"), axis(rotor_mass, "rotor mass")
    for name, values, limits in (
        ("bearing number", number, BEARING_NUMBER_RANGE),
        ("rotor mass", mass, ROTOR_MASS_RANGE),
    ):
        for value in (values[0], values[-1]):
            check_number(name, float(value), *limits)
    check_number("a plane", check_plane(number, mass), MIN_START, MAX_PLANE, "cells")
    check_number("seconds", seconds, *SECONDS_RANGE, "s")
    return number, mass


def check_cluster(address: str) -> str:
    """Return the address of a Dask scheduler, "" for none; raise ``InputError`` if it is no
    address.
    """
    if not isinstance(address, str) or not re.fullmatch(
        r"((tcp|tls|ws|wss)://[\w.:\[\]-]{1,200}:\d{1,5})?", address
    ):
        raise InputError(
            f"the Dask scheduler {str(address)[:60]!r} is no address: allowed is one such as "
            "tcp://host:8786"
        )
    return address


def _table(design: Design, number: np.ndarray, mass: np.ndarray) -> LinearTable | None:
    """Return the table of linear theory over the plane; None if the design has no static
    equilibrium.
    """
    if len(number) < 2 or len(mass) < 2:
        return None
    shipped = shipped_table()
    if design == shipped.design:
        return shipped
    try:
        return linear_table(
            design,
            ((float(number[0]), float(number[-1])), (float(mass[0]), float(mass[-1]))),
            TABLE_NODES,
        )
    except InputError:
        return None


def quick_map(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings = SETTINGS,
    *,
    seconds: float = SECONDS,
    seed: int = 0,
    checkpoint: Path,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[float], None] | None = None,
) -> Iterator[Refinement]:
    """Solve as many cells as the time allows, where regimes are most in doubt, and predict the
    rest.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    settings : Settings
        Of each solved cell.
    seconds : float
        Wall time from now; cells found in ``checkpoint`` take none of it.
    seed : int
        Of the choice of cells.
    checkpoint : Path
        Folder of solved cells (:func:`spab_core.active_learning.oracles.live_oracle`): a run that
        was killed goes on from them.
    workers : int
        Processes.
    cluster : str
        Address of a Dask scheduler whose workers solve instead.
    progress : callable
        Called with the seconds gone since the last call.

    Yields
    ------
    Refinement
        The result so far, after the coarse plane and after each batch.

    Raises
    ------
    InputError
        For a plane or time out of range.
    MapError
        As ``oracles.live_oracle``.
    """
    began = last = time.perf_counter()
    metadata = map_metadata(design, settings, (len(bearing_number), len(rotor_mass)))
    count = check_plane(bearing_number, rotor_mass)
    coarse = max(MIN_START, min(COARSE, count // 4))

    def tick(_: int = 0) -> None:
        nonlocal last
        now = time.perf_counter()
        if progress:
            progress(now - last)
        last = now

    with live_oracle(
        design,
        bearing_number,
        rotor_mass,
        settings,
        checkpoint=checkpoint,
        plan={"refine_quick": seed},
        workers=workers,
        cluster=cluster,
        progress=tick,
    ) as oracle:
        run = partial(
            refine, bearing_number, rotor_mass, oracle, seed=seed, share=SHARE, metadata=metadata
        )
        yield from run(coarse, goals=[coarse])
        table = _table(design, bearing_number, rotor_mass)
        tick()
        if time.perf_counter() - began <= seconds:
            start = max(coarse, min(count // 256, count // 4))
            goals = _goals_in_time(batch_goals(start, count), began + (1 - _KEPT_BACK) * seconds)
            yield from run(count, table=table, goals=goals)


def _goals_in_time(goals: Iterable[int], end: float) -> Iterator[int]:
    """Yield how many cells to solve up to the end of each batch, as many as the pace of the last
    batch allows before ``end``, a reading of ``time.perf_counter``; stop when less than a chunk is
    left.
    """
    solved, batch, since = 0, 0, 0.0
    for goal in goals:
        now = time.perf_counter()
        if solved:
            most = int(batch / max(now - since, 1e-3) * (end - now))
            if most < CHUNK:
                return
            goal = min(goal, solved + most)
        batch, solved, since = goal - solved, goal, now
        yield goal


def as_map(r: Refinement) -> StabilityMap:
    """Return solved and predicted cells as one map for margins and figures; ``r.solved`` tells them
    apart.

    A predicted cell takes the committee's deviation as standard error, period, contact and orbit
    from the nearest solved cell of its regime, and 0 revolutions. If its run is predicted to fail,
    it takes the status of the nearest failed cell.
    """
    solved = {name: values.copy() for name, values in r.values.items()}
    open_cells = ~r.solved
    solved["mle"][open_cells] = np.where(r.regime == "", np.nan, r.mle)[open_cells]
    solved["mle_standard_error"][open_cells] = np.where(r.regime == "", np.nan, r.deviation)[
        open_cells
    ]
    solved["regime"][open_cells] = r.regime[open_cells]
    for regime in np.unique(r.regime[open_cells]):
        like = r.solved & (r.values["regime"] == regime)
        wanted = open_cells & (r.regime == regime)
        source = like if like.any() else r.solved
        _, (row, column) = distance_transform_edt(~source, return_indices=True)
        for name in ("period", "contact_share", "max_eccentricity", "status", *OPTIONAL):
            solved[name][wanted] = r.values[name][row[wanted], column[wanted]]
        if regime and not like.any():
            solved["period"][wanted], solved["status"][wanted] = int(regime == "periodic"), "ok"
    missing = (solved["status"] == "ok") & ~np.isfinite(
        solved["mle"]
    )  # too few solved cells to predict an exponent
    solved["mle"][missing] = 0.0
    return StabilityMap(r.bearing_number, r.rotor_mass, **solved, metadata=r.metadata)
