"""Map a bearing within minutes: tabulate linear theory, solve a coarse plane, then cells where the
assessment and the kind of motion are in doubt, until the time is up.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np

from spab_core.active_learning.oracles import CHUNK, live_oracle
from spab_core.active_learning.refine import MAX_PLANE, MIN_START, Refinement, batch_goals, refine
from spab_core.common.errors import InputError
from spab_core.common.validation import check_number
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Design
from spab_core.linear_theory.linear_table import LinearTable, shipped_table
from spab_core.linear_theory.parallel_table import table_by_rows
from spab_core.maps.parallel import cluster_or_processes
from spab_core.maps.solved_margin import SPAN
from spab_core.maps.stability_map import FIELDS, StabilityMap, axis, check_plane
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.settings import Settings

SECONDS, SECONDS_RANGE = 300.0, (5.0, 86_400.0)
COARSE = 64  # cells of the first plane
SHARE = 0.1  # of a batch for the exponent: borders are what a designer looks for
DOUBLING = 3  # batches in which the solved cells double: each ends with idle cores and a prediction
TABLE_NODES = (32, 25)  # of linear theory's table: a quarter of the usual one, 2 s of processor
SETTINGS = Settings(revolutions=300)
DOING = (  # what a quick map tells
    STARTING := "starting",
    TABULATING := "linear theory over the plane",
    COARSELY := "a coarse plane of cells",
    REFINING := "cells in doubt",
    PREDICTING := "predicting",
)
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


def check_cells(most: int, count: int, name: str = "cells to solve") -> int:
    """Return how many cells of a plane may be solved; raise ``InputError`` if out of range."""
    return int(check_number(name, most, MIN_START, count))


def ends_around(at: float, limits: tuple[float, float]) -> tuple[float, float]:
    """Return the usual ends of a map or line around a point: a quarter of the point's value and
    three times it, to five digits, within ``limits``.
    """
    low, high = (float(f"{min(max(at * k, limits[0]), limits[1]):.5g}") for k in SPAN)
    return low, high


def axis_around(at: float, limits: tuple[float, float], count: int) -> str:
    """Return the usual axis of a map around a point as start:stop:count (:func:`ends_around`)."""
    low, high = ends_around(at, limits)
    return f"{low:.5g}:{high:.5g}:{count}"


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


def _table(
    design: Design,
    number: np.ndarray,
    mass: np.ndarray,
    settings: Settings,
    workers: int,
    cluster: str | None,
    progress: Callable[[int], None],
) -> LinearTable | None:
    """Return the table of linear theory over the plane; None if the design has no static
    equilibrium.
    """
    if len(number) < 2 or len(mass) < 2:
        return None
    shipped = shipped_table()
    if design == shipped.design:
        return shipped
    plane = ((float(number[0]), float(number[-1])), (float(mass[0]), float(mass[-1])))
    try:
        with cluster_or_processes(workers, settings, design, cluster) as run:
            return table_by_rows(design, plane, TABLE_NODES, run, progress)
    except InputError:
        return None


def quick_map(
    design: Design,
    bearing_number: np.ndarray,
    rotor_mass: np.ndarray,
    settings: Settings = SETTINGS,
    *,
    seconds: float = SECONDS,
    most: int | None = None,
    seed: int = 0,
    checkpoint: Path,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[float], None] | None = None,
    tell: Callable[[str], None] | None = None,
    clock: Callable[[], float] = time.perf_counter,
) -> Iterator[Refinement]:
    """Solve as many cells as the time allows, where the motion and what it is worth are most in
    doubt, and predict the rest.

    Parameters
    ----------
    design : Design
    bearing_number : ndarray, (B,)
    rotor_mass : ndarray, (M,)
        kg on one bearing.
    settings : Settings
        Of each solved cell.
    seconds : float
        Wall time from now, linear theory and predictions included; cells found in ``checkpoint``
        take none of it.
    most : int, optional
        Cells to solve at most. Where the time allows them all, the result depends on it alone.
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
    tell : callable
        Called with what is being done now, of :data:`DOING`.
    clock : callable
        Returns the seconds that count, by default those of the wall.

    Yields
    ------
    Refinement
        The result so far, after the coarse plane and after each batch.

    Raises
    ------
    InputError
        For a plane, a time or a number of cells out of range.
    MapError
        As ``oracles.live_oracle``.
    """
    began = last = clock()
    metadata = map_metadata(design, settings, (len(bearing_number), len(rotor_mass)))
    count = check_plane(bearing_number, rotor_mass)
    budget = count if most is None else check_cells(most, count)
    coarse = max(MIN_START, min(COARSE, budget // 4))

    def tick(_: int = 0) -> None:
        nonlocal last
        now = clock()
        if progress:
            progress(now - last)
        last = now

    def say(words: str) -> None:
        if tell:
            tell(words)

    say(STARTING)
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
        say(TABULATING)
        table = _table(design, bearing_number, rotor_mass, settings, workers, cluster, tick)
        tick()

        def solve(cells: np.ndarray) -> dict[str, np.ndarray]:
            say(COARSELY if len(cells) == coarse else REFINING)
            found = oracle(cells)
            say(PREDICTING)
            return found

        end = began + (1.0 - _KEPT_BACK) * seconds
        for result in refine(
            bearing_number,
            rotor_mass,
            solve,
            budget,
            seed,
            table=table,
            share=SHARE,
            judge=True,
            goals=_goals_in_time(batch_goals(coarse, budget, DOUBLING), end, clock),
            metadata=metadata,
        ):
            tick()
            yield result


def _goals_in_time(
    goals: Iterable[int], end: float, clock: Callable[[], float] = time.perf_counter
) -> Iterator[int]:
    """Yield how many cells to solve up to the end of each batch, as many as the pace of the last
    batch allows before ``end``, a reading of ``clock``; stop when less than a chunk is left.
    """
    solved, batch, since = 0, 0, 0.0
    for goal in goals:
        now = clock()
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

    A predicted cell takes the committee's deviation as standard error, what else a cell has from
    the nearest solved cell of its kind of motion (``r.source``), and 0 revolutions.
    """
    filled = {name: r.values[name].ravel()[r.source] for name in FIELDS}
    open_cells, runs = ~r.solved, r.regime != ""
    filled["revolutions"][open_cells] = 0
    for name, predicted in (("mle", r.mle), ("mle_standard_error", r.deviation)):
        filled[name][open_cells] = np.where(runs, predicted, np.nan)[open_cells]
    # where no solved cell has the predicted regime
    odd = open_cells & (filled["regime"] != r.regime)
    filled["regime"][odd] = r.regime[odd]
    filled["period"][odd], filled["status"][odd] = (r.regime == "periodic")[odd], "ok"
    missing = (filled["status"] == "ok") & ~np.isfinite(
        filled["mle"]
    )  # too few solved cells to predict an exponent
    filled["mle"][missing] = 0.0
    return StabilityMap(r.bearing_number, r.rotor_mass, **filled, metadata=r.metadata)
