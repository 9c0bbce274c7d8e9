"""Better drawings: which values may move between which bounds, what must hold, what is wanted.

Differential evolution (Storn and Price, J. Global Optim. 11, 341 (1997), by scipy) of the first
wish, once for each of several bounds of the second: over predictions of linear theory, some
hundreds, then over solved machines, begun with the best of those, whose lines to the margin have
points :data:`SEARCHED` apart. Every machine of the front is solved again with the line of any other
margin, with the wider line on a finer mesh, and, where tolerances are given, with machines drawn
within them.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np
import pandas as pd
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from spab_core.common.errors import DesignError, InputError
from spab_core.common.files import write_atomically
from spab_core.common.validation import check_choice, check_number
from spab_core.design.form import unused
from spab_core.design.model import Design
from spab_core.design.tolerances import (
    VALUES,
    Machine,
    Tolerances,
    check_tolerances,
    parse_tolerances,
)
from spab_core.drawings.drivers import wilson
from spab_core.drawings.look import (
    CHUNK,
    ROW,
    Look,
    Rows,
    empty_rows,
    look_at,
    looker,
    read_row,
    read_rows,
)
from spab_core.drawings.screening import screen
from spab_core.drawings.tolerance import draw, finite, machines_at, plain, read_json
from spab_core.linear_theory.assumptions import assumptions
from spab_core.maps.parallel import cluster_or_processes
from spab_core.solver.film import AZIMUTHS, Mesh, suitable_mesh
from spab_core.trajectory.assessment import AVOID, GOOD, GRADE_WORDS, GRADES
from spab_core.trajectory.settings import Settings

REACH = 3.0  # of the margin's line
PRECISION = 0.03  # of its end
SEARCHED = 1.2  # spacing of its points while searching, and on the finer mesh
SCREENED, SOLVED = 1024, 136  # machines: predicted, solved; under three minutes on two cores
SCREENED_RANGE, SOLVED_RANGE = (256, 100_000), (96, 20_000)
FIRST, SURVIVORS = 256, 48  # predicted first, and solved first
CAPS, POPULATION = 5, 16  # bounds of the second wish, and machines of a generation of each
FRONT = 12  # machines of the front that are confirmed and shown
DRAWN = 64  # machines within the tolerances of each of them
FINER = (1, 8)  # latitudes and azimuths more than the usual mesh
LOGARITHMIC = 4.0  # a range whose ends have this ratio is searched in the logarithm
MOST_RANGES = 12


@dataclass(frozen=True)
class Wish:
    """What is wanted of a machine.

    Attributes
    ----------
    label, unit : str
    column : str
        Of :data:`spab_core.drawings.look.ROW`.
    most : bool
        Whether more is better.
    factor : float
        Units in one of the column.
    """

    label: str
    unit: str
    column: str
    most: bool
    factor: float

    def cost(self, values: np.ndarray) -> np.ndarray:
        """Return what is to be least; nan becomes the worst there is."""
        cost = -np.asarray(values, float) if self.most else np.asarray(values, float)
        return np.asarray(np.where(np.isfinite(cost), self.factor * cost, 1e6))


WISHES = {
    "margin": Wish("Margin", "%", "margin", True, 100.0),
    "flow": Wish("Gas flow", "Nl/min", "gas_flow", False, 1.0),
    "stiffness": Wish("Stiffness", "N/µm", "stiffness", True, 1e-6),
    "film": Wish("Least film", "µm", "least_film", True, 1e6),
}
USUAL_WISHES = ("margin", "flow")


@dataclass(frozen=True)
class Holds:
    """What must hold.

    Attributes
    ----------
    grade : str
        At worst: "good", or "watch" where a machine may be to be watched.
    gas_flow : float
        At most, normal litres a minute.
    stiffness : float
        At least, N/m, of the softest direction.
    least_film : float
        At least, m, besides that of the assessment's limits.
    """

    grade: str = GRADES[GOOD]
    gas_flow: float = math.inf
    stiffness: float = 0.0
    least_film: float = 0.0

    def __post_init__(self) -> None:
        check_choice("grade", self.grade, GRADES[:AVOID])
        if math.isfinite(self.gas_flow):
            check_number("largest gas flow", self.gas_flow, 1e-6, 1e6, "Nl/min")
        check_number("least stiffness", 1e-6 * self.stiffness, 0.0, 1e6, "N/µm")
        check_number("least film", 1e6 * self.least_film, 0.0, 1e3, "µm")

    def violation(self, rows: Mapping[str, Any]) -> np.ndarray:
        """Return by how much machines (n,) miss what must hold; 0 where all does."""
        grade = np.asarray(rows["grade"], float)
        far = np.clip(np.nan_to_num(np.asarray(rows["eccentricity"], float), nan=1.0), 0.0, 1.0)
        worst = GRADES.index(self.grade)
        missed = np.where(grade > worst, grade - worst + 0.5 * far, 0.0)
        flow, stiffness, film = (
            np.asarray(rows[k], float) for k in ("gas_flow", "stiffness", "least_film")
        )
        if math.isfinite(self.gas_flow):
            missed += np.nan_to_num(np.maximum(flow / self.gas_flow - 1.0, 0.0), nan=3.0)
        for value, least in ((stiffness, self.stiffness), (film, self.least_film)):
            if least > 0.0:
                missed += np.nan_to_num(np.maximum(1.0 - value / least, 0.0), nan=3.0)
        return missed


Ranges = dict[str, tuple[float, float]]  # by names of VALUES, in form units


class Space:
    """Machines in the unit cube of the values that may move.

    Parameters
    ----------
    machine : Machine
    ranges : dict
        Bounds in form units by the names of :data:`spab_core.design.tolerances.VALUES`.
    """

    def __init__(self, machine: Machine, ranges: Ranges) -> None:
        self.machine, self.names = machine, list(ranges)
        self.low, self.high = np.array(list(ranges.values()), float).reshape(-1, 2).T
        with np.errstate(divide="ignore", invalid="ignore"):
            self.log = (self.low > 0.0) & (self.high >= LOGARITHMIC * self.low)

    def values(self, place: np.ndarray) -> dict[str, float]:
        """Return the values at a place (d,), in form units, of six digits."""
        x, low = np.clip(place, 0.0, 1.0), np.where(self.log, self.low, 1.0)
        at = np.where(self.log, low * (self.high / low) ** x, self.low + (self.high - self.low) * x)
        at = np.clip([float(f"{v:.6g}") for v in at], self.low, self.high)
        return dict(zip(self.names, map(float, at), strict=True))

    def machine_at(self, place: np.ndarray) -> Machine | None:
        """Return the machine at a place; None where the values together are no design."""
        try:
            return self.machine.replace(self.values(place))
        except InputError:
            return None

    def place(self, values: Mapping[str, float]) -> np.ndarray:
        """Return the nearest place of a machine's values."""
        at = np.clip([values[name] for name in self.names], self.low, self.high)
        low = np.where(self.log, self.low, 1.0)
        logarithmic = np.log(np.where(self.log, at, 1.0) / low) / np.log(
            np.where(self.log, self.high / low, math.e)
        )
        return np.asarray(np.where(self.log, logarithmic, (at - self.low) / (self.high - self.low)))


def check_improve(
    machine: Machine,
    ranges: Ranges,
    wishes: Sequence[str],
    look: Look,
    tolerances: Tolerances,
    screened: int,
    solved: int,
) -> None:
    """Raise :class:`InputError` for what :func:`improve` does not take."""
    machine.check()
    look.check()
    if not 1 <= len(ranges) <= MOST_RANGES:
        raise DesignError(
            f"{len(ranges)} values may move: allowed are from 1 to {MOST_RANGES}, such as "
            "bearing.clearance 15:40 µm"
        )
    if len(wishes) != 2 or len(set(wishes)) != 2:
        raise DesignError(f"give two different wishes of {', '.join(WISHES)}")
    for wish in wishes:
        check_choice("wish", wish, WISHES)
    if "margin" in wishes and not look.axis:
        raise DesignError("a margin needs an axis: speed or mass")
    check_number("screened", screened, *SCREENED_RANGE)
    check_number("solved", solved, *SOLVED_RANGE)
    for name, bounds in ranges.items():
        if name not in VALUES:
            raise DesignError(f"there is no value {name[:60]!r} that may move")
        if name in unused(machine.design):
            raise DesignError(f"{VALUES[name].key} says nothing about this design")
        if not bounds[0] < bounds[1]:
            raise DesignError(f"range of {VALUES[name].key}: its second number must be the larger")
        for bound in bounds:
            try:
                machine.replace({name: bound})
            except InputError as error:
                raise DesignError(
                    f"range of {VALUES[name].key} reaches {bound:.6g} {VALUES[name].unit}: {error}"
                ) from None
    if tolerances:
        check_tolerances(machine, tolerances)


def outside_words(machine: Machine) -> str:
    """Return which assumptions of the theory a machine breaks, in a sentence: while it does, it is
    never good. Empty where it breaks none.
    """
    broken = [
        one.words
        for one in assumptions(machine.design, machine.bearing_number)
        if one.watched and not one.holds
    ]
    if not broken:
        return ""
    told = "; ".join(broken)
    return f"Outside the theory, as this drawing is, the best grade is to be watched: {told}."


@dataclass(frozen=True)
class Improvement:
    """A front of better drawings, all solved.

    Attributes
    ----------
    machine : Machine
        To begin with.
    ranges : dict
        What may move, in form units.
    wishes : tuple of str
        Of :data:`WISHES`.
    look : Look
    holds : Holds
    tolerances : tuple of Tolerance
    seed : int
    before : dict
        Row of the machine to begin with.
    values : ndarray, (n, d)
        Of the front's machines, in form units, by falling margin or first wish.
    rows, finer : dict of ndarray, (n,)
        As found on the usual mesh and on a finer one, there with points :data:`SEARCHED` apart.
    shares : ndarray, (n, 3)
        Share of good machines drawn within the tolerances and Wilson's interval; nan without.
    screened, solved : int
        Machines predicted, and solved for the front.
    lacking : dict
        Share of the solved machines whose gravest trouble is of each kind, the most first.
    seconds : float
    """

    machine: Machine
    ranges: Ranges
    wishes: tuple[str, ...]
    look: Look
    holds: Holds
    tolerances: Tolerances
    seed: int
    before: dict[str, Any]
    values: np.ndarray
    rows: Rows
    finer: Rows
    shares: np.ndarray
    screened: int = 0
    solved: int = 0
    lacking: dict[str, float] = dataclasses.field(default_factory=dict)
    seconds: float = dataclasses.field(default=0.0, compare=False)

    @property
    def count(self) -> int:
        """Machines of the front."""
        return len(self.values)

    def machine_at(self, k: int) -> Machine:
        """Return a machine of the front."""
        names = list(self.ranges)
        return self.machine.replace(dict(zip(names, map(float, self.values[k]), strict=True)))

    @property
    def confirmed(self) -> np.ndarray:
        """Which machines hold on the finer mesh what must hold, (n,)."""
        return np.asarray((self.holds.violation(self.finer) == 0.0), bool)

    @property
    def best(self) -> int | None:
        """The machine with most of the first wish among those confirmed; None where there is
        none.
        """
        if not self.confirmed.any():
            return None
        cost = WISHES[self.wishes[0]].cost(self.finer[WISHES[self.wishes[0]].column])
        return int(np.argmin(np.where(self.confirmed, cost, np.inf)))

    def table(self) -> pd.DataFrame:
        """Return a row for each machine of the front."""
        drawn = pd.DataFrame(self.values, columns=[VALUES[n].key for n in self.ranges])
        found = pd.DataFrame(
            {
                "assessment": [GRADES[g] for g in self.rows["grade"]],
                "margin": self.rows["margin"],
                "meets": self.rows["meets"],
                "gas_flow": self.rows["gas_flow"],
                "stiffness": self.rows["stiffness"],
                "least_film": self.rows["least_film"],
                "peak_contact_force": self.rows["peak_contact_force"],
                "confirmed": self.confirmed,
                "finer_margin": self.finer["margin"],
                "share_good": self.shares[:, 0],
                "share_low": self.shares[:, 1],
                "share_high": self.shares[:, 2],
            }
        )
        return pd.concat([drawn, found], axis=1)

    def bought(self, k: int) -> pd.DataFrame:
        """Return what a machine of the front has and costs beside the one to begin with:
        ``value``, ``unit``, ``before``, ``after``.
        """
        old = self.machine.values()
        rows: list[tuple[str, str, float, float]] = []
        for name, after in zip(self.ranges, self.values[k], strict=True):
            rows.append((VALUES[name].label, VALUES[name].unit, old[name], float(after)))
        for wish in WISHES.values():
            label = (
                f"{wish.label} up in {self.look.axis}" if wish.column == "margin" else wish.label
            )
            old_value, new = (
                wish.factor * float(v)
                for v in (self.before[wish.column], self.rows[wish.column][k])
            )
            rows.append((label, wish.unit, old_value, new))
        pair = (float(self.before["eccentricity"]), float(self.rows["eccentricity"][k]))
        rows.append(("Largest eccentricity", "", *pair))
        forces = (float(self.before["peak_contact_force"]), self.rows["peak_contact_force"][k])
        if np.isfinite(forces).all():  # files of earlier versions have none
            before, after = np.round(forces, 2)
            rows.append(("Largest asperity force", "N", float(before), float(after)))
        return pd.DataFrame(rows, columns=["value", "unit", "before", "after"])

    def sentences(self) -> list[str]:
        """Describe what was found, in sentences."""
        lines = [
            f"{self.screened:,} drawings predicted by linear theory, {self.solved:,} solved; "
            f"before: {GRADE_WORDS[GRADES[self.before['grade']]]}"
            + (f" ({self.before['trouble']})." if self.before["trouble"] else ".")
        ]
        if not self.count:
            outside = outside_words(self.machine) if self.holds.grade == GRADES[GOOD] else ""
            return [
                *lines,
                f"No drawing within these ranges was found that is {GRADE_WORDS[self.holds.grade]} "
                f"and holds what must hold.{self._nearest_words()}",
                *([outside] if outside else []),
            ]
        sure = int(self.confirmed.sum())
        lines.append(
            f"The front has {self.count} drawings, all solved; {sure} of them hold what must hold "
            f"on a finer mesh too (its line at points {100 * (SEARCHED - 1):.0f} % apart)."
        )
        if self.best is None:
            return lines
        k = self.best
        row = self.rows
        end = f"+{100 * row['margin'][k]:.0f} % in {self.look.axis}"
        if not math.isfinite(row["ends"][k]):
            end += ", where the line looked at ends"
        told = [
            f"{r.value.lower()} {_digits(r.before)} → {_digits(r.after)} {r.unit}".strip()
            for r in self.bought(k).itertuples()
        ]
        lines.append(
            f"Most {WISHES[self.wishes[0]].label.lower()} of those: "
            f"{GRADE_WORDS[GRADES[row['grade'][k]]]}, margin {end} "
            f"(finer mesh: +{100 * self.finer['margin'][k]:.0f} %)"
            + (f", then {row['meets'][k]}" if row["meets"][k] else "")
            + f". What was bought: {'; '.join(told)}."
        )
        if np.isfinite(self.shares[k, 0]):
            share, low, high = 100.0 * self.shares[k]
            lines.append(
                f"Of {DRAWN} machines within the tolerances of that drawing {share:.0f} % are "
                f"good ({low:.0f} to {high:.0f} %)."
            )
        return lines

    def _nearest_words(self) -> str:
        """Return what keeps most of the solved drawings from being good."""
        if not self.lacking:
            return ""
        told = ", ".join(f"{kind} {100 * s:.0f} %" for kind, s in list(self.lacking.items())[:3])
        return f" Gravest trouble of the drawings solved: {told}."

    def record(self) -> dict[str, Any]:
        """Return plain values for ``--json``."""
        best = self.best
        return {
            "rotor_mass_kg": self.machine.rotor_mass,
            "speed_rpm": self.machine.speed_rpm,
            "vary": {VALUES[n].key: list(b) for n, b in self.ranges.items()},
            "units": {VALUES[n].key: VALUES[n].unit for n in self.ranges},
            "wishes": list(self.wishes),
            "margin_axis": self.look.axis or None,
            "seed": self.seed,
            "screened": self.screened,
            "solved": self.solved,
            "before": finite(self.before),
            "troubles": self.lacking,
            "front": finite(self.table().to_dict("records")),
            "best": best,
            "best_design": None if best is None else finite(self.machine_at(best).design.to_dict()),
            "bought": [] if best is None else finite(self.bought(best).to_dict("records")),
            "sentences": self.sentences(),
            "seconds": self.seconds,
        }


def _digits(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1e4 else f"{value:,.0f}"


def front_of(costs: np.ndarray, missed: np.ndarray) -> np.ndarray:
    """Return the machines that miss nothing and that no other such machine beats in every wish, by
    rising first cost.

    Parameters
    ----------
    costs : ndarray, (n, 2)
    missed : ndarray, (n,)
    """
    allowed = np.flatnonzero(missed == 0.0)
    order = allowed[np.lexsort(costs[allowed].T[::-1])]
    best, front = math.inf, []
    for k in order:
        if costs[k, 1] < best:
            best = float(costs[k, 1])
            front.append(int(k))
    return np.array(front, int)


def _thinned(front: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """Return at most :data:`FRONT` machines of a front, its ends and others far from each other."""
    if len(front) <= FRONT:
        return front
    place = costs[front]
    place = (place - place.min(axis=0)) / np.maximum(np.ptp(place, axis=0), 1e-12)
    kept = [0, len(front) - 1]
    while len(kept) < FRONT:
        apart = np.min(np.linalg.norm(place[:, None] - place[None, kept], axis=2), axis=1)
        kept.append(int(np.argmax(apart)))
    return np.asarray(front[np.sort(kept)])


# costs (n, 2) and violations (n,) of places (n, d), and of rows
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
Judge = Callable[[Mapping[str, Any]], tuple[np.ndarray, np.ndarray]]


class _Asked:
    """Places that were asked for, with their costs and violations, each evaluated once."""

    def __init__(self, evaluate: Evaluate, begin: np.ndarray) -> None:
        self._evaluate, self._known = evaluate, dict[bytes, int]()
        self.places = np.empty((0, begin.shape[1]))
        self.costs, self.missed = np.empty((0, 2)), np.empty(0)
        self.ask(begin)

    def ask(self, places: np.ndarray) -> np.ndarray:
        """Return the numbers (n,) of places (n, d)."""
        keys = [p.tobytes() for p in np.ascontiguousarray(places, float)]
        new = {key: p for key, p in zip(keys, places, strict=True) if key not in self._known}
        if new:
            fresh = np.array(list(new.values()))
            costs, missed = self._evaluate(fresh)
            self._known |= {key: len(self.places) + k for k, key in enumerate(new)}
            self.places = np.concatenate([self.places, fresh])
            self.costs = np.concatenate([self.costs, costs])
            self.missed = np.concatenate([self.missed, missed])
        return np.array([self._known[key] for key in keys], int)

    def scores(self, cap: float) -> np.ndarray:
        """Return the first cost of all places, far worse where something is missed or the second
        cost is above a cap.
        """
        scale = np.maximum(np.ptp(np.where(self.costs < 1e6, self.costs, 0.0), axis=0), 1e-9)
        over = np.maximum(self.costs[:, 1] - cap, 0.0) / scale[1]
        return np.asarray(self.costs[:, 0] / scale[0] + 10.0 * over + 1e3 * self.missed)

    def caps(self) -> np.ndarray:
        """Return bounds of the second cost, from the least to the most that is of use."""
        allowed = self.missed == 0.0
        second = self.costs[allowed if allowed.any() else self.missed < np.inf, 1]
        return np.asarray(np.quantile(second, np.linspace(0.02, 1.0, CAPS)))


def _evolve(begin: np.ndarray, evaluate: Evaluate, generations: int, seed: int) -> _Asked:
    """Return all places (n, d) of the unit cube that differential evolution asked for.

    Parameters
    ----------
    begin : ndarray, (k, d)
        Evaluated first; at least :data:`POPULATION`.
    evaluate : callable
        Costs (n, 2) and violations (n,) of places (n, d).
    generations : int
        For each of :data:`CAPS` bounds of the second cost.
    seed : int
    """
    asked = _Asked(evaluate, begin)
    for k, cap in enumerate(asked.caps()):

        def score(x: np.ndarray, cap: float = float(cap)) -> np.ndarray:
            numbers = asked.ask(x.T)
            return np.asarray(asked.scores(cap)[numbers])

        best = np.argsort(asked.scores(float(cap)), kind="stable")[:POPULATION]
        differential_evolution(
            score,
            [(0.0, 1.0)] * begin.shape[1],
            init=asked.places[best],
            maxiter=generations,
            tol=0.0,
            polish=False,
            vectorized=True,
            updating="deferred",
            seed=seed + k,
        )
    return asked


def _screen_chunk(
    number: int, machines: Sequence[Machine | None], look: Look
) -> tuple[int, list[dict[str, Any]]]:
    """Predict machines, None where there is no design; the number tells whose chunk it is."""
    nothing = dict.fromkeys(("least_film", "eccentricity", "gas_flow", "stiffness"), math.nan)
    nothing |= {"grade": AVOID, "margin": 0.0}
    return number, [nothing if m is None else screen(m, look) for m in machines]


def _columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, np.ndarray]:
    names = ("grade", "margin", "gas_flow", "stiffness", "least_film", "eccentricity")
    return {name: np.array([row[name] for row in rows], float) for name in names}


def _best_places(asked: _Asked, count: int) -> np.ndarray:
    """Return the places (count, d) to begin solving with: fronts after fronts, then what misses
    least.
    """
    left, chosen = asked.missed.copy(), list[int]()
    while len(chosen) < count:
        layer = front_of(asked.costs, left)
        if not len(layer):
            break
        chosen += _thinned(layer, asked.costs).tolist()
        left[layer] = math.inf
    rest = [k for k in np.argsort(asked.missed, kind="stable").tolist() if k not in set(chosen)]
    return np.asarray(asked.places[(chosen + rest)[:count]])


def _generations(screened: int, solved: int) -> tuple[int, int]:
    """Return the generations of each bound that are predicted and solved."""
    return tuple(
        max(round((count - begin) / (CAPS * POPULATION)), 1)
        for count, begin in ((screened, FIRST), (solved, SURVIVORS))
    )  # type: ignore[return-value]


def improve(
    machine: Machine,
    ranges: Ranges,
    wishes: Sequence[str] = USUAL_WISHES,
    look: Look | None = None,
    holds: Holds | None = None,
    tolerances: Tolerances = (),
    *,
    screened: int = SCREENED,
    solved: int = SOLVED,
    seed: int = 0,
    checkpoint: Path | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> Improvement:
    """Look for drawings that are good and have more of two wishes.

    Parameters
    ----------
    machine : Machine
        To begin with; it keeps what may not move.
    ranges : dict
        What may move, in form units, by the names of
        :data:`spab_core.design.tolerances.VALUES`.
    wishes : sequence of str, (2,)
        Of :data:`WISHES`.
    look : Look
        How machines are solved and judged; by default the margin in speed, looked at to
        :data:`REACH`.
    holds : Holds
    tolerances : tuple of Tolerance
        Of every drawing.
    screened, solved : int
        Machines to predict and to solve, in whole generations.
    seed : int
    checkpoint : Path, optional
        Folder of solved machines, from which a run that was stopped goes on.
    workers : int
        Processes; the result does not depend on it.
    cluster : str, optional
        Address of a Dask scheduler whose workers solve instead.
    progress : callable
        Called with the number of machines done since the last call; :func:`steps` in all.

    Returns
    -------
    Improvement

    Raises
    ------
    InputError
        For values out of range.
    """
    began, holds = time.perf_counter(), holds or Holds()
    look = look or Look(reach=REACH, precision=PRECISION)
    check_improve(machine, ranges, wishes, look, tolerances, screened, solved)
    means = _Means(checkpoint, workers, cluster, progress)
    space = Space(machine, ranges)

    def judge(rows: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        costs = np.column_stack([WISHES[w].cost(rows[WISHES[w].column]) for w in wishes])
        return costs, holds.violation(rows)

    predicting, solving = _generations(screened, solved)
    predicted = _predict(space, look, judge, predicting, seed, means)
    plan = {
        "machine": machine.to_dict(),
        "ranges": {name: list(b) for name, b in ranges.items()},
        "wishes": list(wishes),
        "holds": dataclasses.asdict(holds),
        "seed": seed,
        "screened": screened,
    }
    wide = dataclasses.replace(look, spacing=max(look.spacing, SEARCHED))
    begin = _best_places(predicted, SURVIVORS)
    tried, troubles = _solve(space, wide, judge, begin, solving, seed, plan, means)
    places = tried.places
    valid = np.array([space.machine_at(p) is not None for p in places])
    found = front_of(tried.costs, np.where(valid, tried.missed, math.inf))
    front, rows, finer = _confirm(
        space, places[_thinned(found, tried.costs)], look, wide, judge, means
    )
    machines = [space.machine_at(place) or machine for place in front]
    values = [list(space.values(place).values()) for place in front]
    return Improvement(
        machine,
        dict(ranges),
        tuple(wishes),
        look,
        holds,
        tolerances,
        seed,
        look_at(machine, look),
        np.array(values).reshape(-1, len(ranges)),
        rows,
        finer,
        _shares(machines, look, tolerances, seed, means),
        len(predicted.places),
        len(places),
        _kinds(troubles),
        time.perf_counter() - began,
    )


class _Means(NamedTuple):
    """Where machines are solved, what is kept of them, and who is told."""

    checkpoint: Path | None
    workers: int
    cluster: str | None
    progress: Callable[[int], None] | None

    def told(self, count: int) -> None:
        if self.progress:
            self.progress(count)

    def processes(self, look: Look, design: Design) -> contextlib.AbstractContextManager[Any]:
        return cluster_or_processes(self.workers, look.settings, design, self.cluster)

    def looker(
        self, look: Look, design: Design, most: int, plan: dict[str, Any], part: str, chunk: int
    ) -> contextlib.AbstractContextManager[Callable[[Sequence[Machine]], Rows]]:
        return looker(
            look,
            design,
            most,
            plan,
            chunk=chunk,
            checkpoint=self.checkpoint and self.checkpoint / part,
            workers=self.workers,
            cluster=self.cluster,
            progress=self.progress,
        )


def _predict(
    space: Space, look: Look, judge: Judge, generations: int, seed: int, means: _Means
) -> _Asked:
    """Search among predictions of linear theory, from Sobol' points on."""
    with means.processes(look, space.machine.design) as parallel:

        def predict(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            machines = [space.machine_at(p) for p in places]
            jobs = (
                joblib.delayed(_screen_chunk)(k, machines[k : k + 4], look)
                for k in range(0, len(machines), 4)
            )
            parts = dict(parallel(jobs))
            means.told(len(places))
            return judge(_columns([row for k in sorted(parts) for row in parts[k]]))

        first = np.asarray(qmc.Sobol(len(space.names), scramble=True, seed=seed).random(FIRST))
        first[0] = space.place(space.machine.values())
        return _evolve(first, predict, generations, seed)


def _solve(
    space: Space,
    look: Look,
    judge: Judge,
    begin: np.ndarray,
    generations: int,
    seed: int,
    plan: dict[str, Any],
    means: _Means,
) -> tuple[_Asked, np.ndarray]:
    """Search among solved machines, from places (n, d) on; and the gravest trouble of each."""
    troubles: list[np.ndarray] = []
    most = SURVIVORS + CAPS * POPULATION * generations
    with means.looker(look, space.machine.design, most, plan, "", 2) as solve:

        def solve_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            # where the values together are no design, the machine to begin with stands in: it is
            # no better than itself
            rows = solve([space.machine_at(p) or space.machine for p in places])
            troubles.append(rows["trouble"])
            return judge(rows)

        tried = _evolve(begin, solve_places, generations, seed)
    return tried, np.concatenate(troubles)


def _kinds(troubles: np.ndarray) -> dict[str, float]:
    """Return the share of each kind of trouble, the most first; without those that have none."""
    kinds, counts = np.unique(troubles[troubles != ""], return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return {str(kinds[k]): float(counts[k] / len(troubles)) for k in order}


def finer_settings(machine: Machine, settings: Settings) -> Settings:
    """Return settings with a mesh finer than the usual one of a design."""
    usual = suitable_mesh(machine.design, AZIMUTHS)
    mesh = Mesh(usual.latitude + FINER[0], usual.azimuth + FINER[1])
    return dataclasses.replace(settings, mesh=mesh)


def _finer_row(name: int, machine: Machine, look: Look) -> tuple[int, dict[str, Any]]:
    finer = dataclasses.replace(look, settings=finer_settings(machine, look.settings))
    return name, look_at(machine, finer)


def _confirm(
    space: Space, front: np.ndarray, look: Look, wide: Look, judge: Judge, means: _Means
) -> tuple[np.ndarray, Rows, Rows]:
    """Solve the front with all points of the line, and with fewer on a finer mesh.

    Returns
    -------
    front : ndarray, (n, d)
        Places without those that are no part of the front where all points are solved.
    rows, finer : dict of ndarray, (n,)
    """
    if not len(front):
        means.told(2 * FRONT)
        return front, empty_rows(0), empty_rows(0)
    machines = [space.machine_at(place) or space.machine for place in front]
    plan = {"front": [m.to_dict() for m in machines]}
    with means.looker(look, space.machine.design, FRONT, plan, "front", 1) as solve:
        rows = solve(machines)
    chosen = front_of(*judge(rows)).tolist()
    found: dict[int, dict[str, Any]] = {}
    with means.processes(look, space.machine.design) as parallel:
        for k, row in parallel(joblib.delayed(_finer_row)(k, machines[k], wide) for k in chosen):
            found[k] = row
            means.told(1)
    means.told(2 * FRONT - len(machines) - len(chosen))
    finer = {name: np.array([found[k][name] for k in chosen], t) for name, t in ROW.items()}
    return front[chosen], {name: values[chosen] for name, values in rows.items()}, finer


def _shares(
    machines: Sequence[Machine], look: Look, tolerances: Tolerances, seed: int, means: _Means
) -> np.ndarray:
    """Solve machines within the tolerances; the shares of good ones with intervals, (n, 3), nan
    without tolerances.
    """
    shares = np.full((len(machines), 3), math.nan)
    if not (tolerances and len(machines)):
        return shares
    alone = dataclasses.replace(look, axis="")
    quantiles = draw(tolerances, DRAWN, seed)
    drawn = [_drawn(machine, tolerances, quantiles) for machine in machines]
    plan = {"front": [m.to_dict() for m in machines], "seed": seed}
    plan |= {"tolerances": {t.name: t.text for t in tolerances}}
    most = DRAWN * len(machines)
    with means.looker(alone, machines[0].design, most, plan, "drawn", CHUNK) as solve:
        for k, some in enumerate(drawn):
            if some:
                good = int((solve(some)["grade"] == GOOD).sum())
                shares[k] = good / DRAWN, *wilson(good, DRAWN)
    return shares


def _drawn(machine: Machine, tolerances: Tolerances, quantiles: np.ndarray) -> list[Machine]:
    """Return the machines within the tolerances; none where these lead out of what is allowed."""
    try:
        return machines_at(machine, tolerances, quantiles)[0]
    except InputError:
        return []


def steps(screened: int, solved: int, tolerances: bool) -> int:
    """Return how many machines :func:`improve` counts at most."""
    predicting, solving = _generations(screened, solved)
    both = FIRST + SURVIVORS + CAPS * POPULATION * (predicting + solving)
    return both + 2 * FRONT + (FRONT * DRAWN if tolerances else 0)


def _plain_rows(rows: Rows) -> dict[str, list[Any]]:
    return {name: values.tolist() for name, values in rows.items()}


def improvement_dict(found: Improvement) -> dict[str, Any]:
    """Return an improvement as plain values that :func:`improvement_of` reads."""
    return {
        "machine": found.machine.to_dict(),
        "ranges": {name: list(b) for name, b in found.ranges.items()},
        "wishes": list(found.wishes),
        "look": found.look.to_dict(),
        "holds": dataclasses.asdict(found.holds),
        "tolerances": {VALUES[t.name].key: t.text for t in found.tolerances},
        "seed": found.seed,
        "before": {k: plain(v) for k, v in found.before.items()},
        "values": found.values.tolist(),
        "rows": _plain_rows(found.rows),
        "finer": _plain_rows(found.finer),
        "shares": found.shares.tolist(),
        "screened": found.screened,
        "solved": found.solved,
        "lacking": found.lacking,
        "seconds": found.seconds,
    }


def improvement_of(data: dict[str, Any]) -> Improvement:
    """Return the improvement of :func:`improvement_dict`."""
    ranges = {str(name): (float(b[0]), float(b[1])) for name, b in data["ranges"].items()}
    values = np.array(data["values"], float).reshape(-1, len(ranges))
    rows, finer = (read_rows(data[key]) for key in ("rows", "finer"))
    shares = np.array(data["shares"], float).reshape(-1, 3)
    if any(len(v) != len(values) for v in (*rows.values(), *finer.values(), shares)):
        raise ValueError("its columns have different lengths")
    found = Improvement(
        Machine.from_dict(data["machine"]),
        ranges,
        tuple(str(w) for w in data["wishes"]),
        Look.from_dict(data["look"]),
        Holds(**data["holds"]),
        parse_tolerances(data["tolerances"]),
        int(data["seed"]),
        read_row(data["before"]),
        values,
        rows,
        finer,
        shares,
        int(data["screened"]),
        int(data["solved"]),
        {str(kind): float(share) for kind, share in data["lacking"].items()},
        float(data["seconds"]),
    )
    for k in range(found.count):
        found.machine_at(k)
    return found


def save_improvement(found: Improvement, path: Path) -> None:
    """Write an improvement as JSON, atomically."""
    write_atomically(path, json.dumps(improvement_dict(found)).encode())


def load_improvement(path: Path) -> Improvement:
    """Read a file of :func:`save_improvement`. Raises ``InputError`` for any other file."""
    return read_json(path, improvement_of, "improvement")
