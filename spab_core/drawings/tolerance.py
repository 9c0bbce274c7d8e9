"""From a drawing with tolerances to the machines that are built after it: drawn, solved, judged.

Machines are drawn by a scrambled Sobol' sequence (Owen, J. Complexity 14, 466 (1998)) in batches
that are powers of two. After each batch the run stops if Wilson's interval of the share of good
machines is narrow enough.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from scipy.stats import qmc

from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import UNREADABLE
from spab_core.common.validation import check_number
from spab_core.common.words import newtons
from spab_core.design.tolerances import (
    VALUES,
    Machine,
    Tolerances,
    check_tolerances,
    parse_tolerances,
    value_of,
)
from spab_core.drawings.drivers import CONFIDENCE, drivers, narrowings, wilson
from spab_core.drawings.look import ROW, Look, Rows, look_at, looker, read_row, read_rows
from spab_core.trajectory.assessment import AVOID, GOOD, GRADE_WORDS, GRADES

FIRST, MACHINES, MOST = 64, 512, 8192  # machines: of the first batch, usually at most, allowed
HALF_WIDTH = 0.04  # of the interval at which a run stops
WANTED = 0.95  # share of good machines
LEARNED = 0.2  # of the variance: a forest that explains less says nothing of what drives it
QUARTERS = (0.05, 0.25, 0.5, 0.75, 0.95)  # quantiles told of a distribution
_MAX_BYTES = 20_000_000


def _named(key: str) -> str:
    return f"{value_of(key).label} ({key})"


def draw(tolerances: Tolerances, count: int, seed: int) -> np.ndarray:
    """Return quantiles (count, d) of the tolerances' distributions; ``count`` is a power of two."""
    sampler = qmc.Sobol(len(tolerances), scramble=True, seed=seed)
    return np.asarray(sampler.random_base2(int(math.log2(count))))


def machines_at(
    machine: Machine, tolerances: Tolerances, quantiles: np.ndarray
) -> tuple[list[Machine], np.ndarray]:
    """Return the machines at quantiles (n, d), and their values (n, d) in form units.

    Raises :class:`InputError` for one that is out of range.
    """
    values = np.column_stack([t.at(machine, quantiles[:, k]) for k, t in enumerate(tolerances)])
    names = [t.name for t in tolerances]
    return [
        machine.replace(dict(zip(names, map(float, row), strict=True))) for row in values
    ], values


@dataclass(frozen=True)
class ToleranceStudy:
    """Machines drawn within tolerances, all solved.

    Attributes
    ----------
    machine : Machine
        As drawn on paper.
    tolerances : tuple of Tolerance, (d,)
    look : Look
    seed : int
    wanted : float
        Share of good machines.
    nominal : dict
        Row of the machine with its nominal values (:data:`spab_core.drawings.look.ROW`).
    quantiles, values : ndarray, (n, d)
        Of each machine drawn; values in form units.
    rows : dict of ndarray, (n,)
    stopped : str
        "narrow" where the interval became narrow enough, else "all".
    seconds : float
    """

    machine: Machine
    tolerances: Tolerances
    look: Look
    seed: int
    wanted: float
    nominal: dict[str, Any]
    quantiles: np.ndarray
    values: np.ndarray
    rows: Rows
    stopped: str = "all"
    seconds: float = dataclasses.field(default=0.0, compare=False)

    @property
    def count(self) -> int:
        """Machines drawn."""
        return len(self.quantiles)

    @property
    def names(self) -> list[str]:
        """Names of the values that have a tolerance."""
        return [VALUES[t.name].key for t in self.tolerances]

    def shares(self) -> dict[str, tuple[float, float, float]]:
        """Return share and Wilson's interval of each grade."""
        found = {}
        for k, name in enumerate(GRADES):
            n = int((self.rows["grade"] == k).sum())
            found[name] = (n / self.count, *wilson(n, self.count))
        return found

    @property
    def good(self) -> np.ndarray:
        """Which machines are good, (n,)."""
        return np.asarray(self.rows["grade"] == GOOD)

    @functools.cached_property
    def drivers(self) -> tuple[str, pd.DataFrame]:
        """What the tolerances are asked to explain, and
        :func:`spab_core.drawings.drivers.drivers`: which machines are not good; where that is the
        same for all, which are to be avoided, else the margin, else the least film.
        """
        film = self.rows["least_film"]
        asked = {
            "not good": ~self.good,
            GRADE_WORDS["avoid"]: self.rows["grade"] == AVOID,
            f"margin in {self.look.axis}": self.rows["margin"],
            "least film": np.where(np.isfinite(film), film, 0.0),
        }
        what = next((k for k, v in asked.items() if np.ptp(v.astype(float)) > 0.0), "not good")
        return what, drivers(self.quantiles, asked[what], self.names, self.seed)

    @functools.cached_property
    def narrowings(self) -> pd.DataFrame:
        """What :func:`spab_core.drawings.drivers.narrowings` returns."""
        return narrowings(self.quantiles, self.good, self.tolerances, self.wanted)

    def troubles(self) -> dict[str, float]:
        """Return the share of machines whose gravest trouble is of each kind, the most first."""
        kinds, counts = np.unique(self.rows["trouble"][~self.good], return_counts=True)
        order = np.argsort(-counts, kind="stable")
        return {str(kinds[k]): float(counts[k] / self.count) for k in order}

    def spread(self, name: str) -> dict[str, float]:
        """Return quantiles of a column of the rows, by their percentages; without what is nan."""
        values = self.rows[name][np.isfinite(self.rows[name])]
        if not len(values):
            return {}
        return {f"{100 * q:g} %": float(np.quantile(values, q)) for q in QUARTERS}

    def table(self) -> pd.DataFrame:
        """Return a row for each machine: its values and what was found."""
        drawn = pd.DataFrame(self.values, columns=self.names)
        found = pd.DataFrame({name: self.rows[name] for name in ROW if name != "seconds"})
        return pd.concat([drawn, found], axis=1)

    def sentences(self) -> list[str]:
        """Describe what was found, in sentences."""
        shares = self.shares()
        told = ", ".join(
            f"{100 * share:.1f} % {GRADE_WORDS[name]} ({100 * low:.1f} to {100 * high:.1f} %)"
            for name, (share, low, high) in shares.items()
        )
        lines = [
            f"Of {self.count:,} machines drawn within the tolerances and solved: {told}; in "
            f"brackets Wilson's interval at {100 * CONFIDENCE:g} %."
        ]
        lines.append(f"The drawing's own values: {GRADE_WORDS[GRADES[self.nominal['grade']]]}.")
        if troubles := self.troubles():
            kinds = ", ".join(f"{k} {100 * s:.0f} %" for k, s in list(troubles.items())[:4])
            lines.append(f"Gravest trouble of those that are not good, of all machines: {kinds}.")
        film = self.spread("least_film")
        if film:
            lines.append(
                f"Least film: median {1e6 * film['50 %']:.1f} µm, 5 % of the machines have less "
                f"than {1e6 * film['5 %']:.1f} µm."
            )
        force = self.spread("peak_contact_force")
        if force:
            lines.append(
                f"Largest asperity force: median {newtons(force['50 %'])} N, 5 % of the machines "
                f"have more than {newtons(force['95 %'])} N."
            )
        if self.look.axis:
            lines.append(self._margin_words())
        what, table = self.drivers
        if len(table) and table.attrs["explained"] < LEARNED:
            lines.append(f"What drives it ({what}) cannot be told from these machines.")
        elif len(table):
            first = table.iloc[0]
            lines.append(
                f"What drives it ({what}): {_named(first['value'])}, a total Sobol index of "
                f"{first['total']:.2f} ± {first['total_spread']:.2f}; the forest behind it "
                f"explains {100 * table.attrs['explained']:.0f} % of the variance of machines it "
                "has not seen."
            )
        return [*lines, self._narrowing_words()]

    def _margin_words(self) -> str:
        margin, axis = self.spread("margin"), self.look.axis
        none = float((self.rows["margin"] == 0.0).mean())
        return (
            f"Margin up in {axis}, looked at to +{100 * (self.look.reach - 1):.0f} %: median "
            f"{100 * margin['50 %']:.0f} %, 5 % of the machines have less than "
            f"{100 * margin['5 %']:.0f} %, {100 * none:.0f} % have none."
        )

    def _narrowing_words(self) -> str:
        share, wanted = self.shares()["good"][0], 100 * self.wanted
        if share >= self.wanted:
            return f"The wanted share of good machines, {wanted:g} %, is reached as it is."
        table = self.narrowings
        if table["factor"].isna().all():
            return (
                f"No tolerance alone, narrowed to a twentieth, brings the share of good machines "
                f"to {wanted:g} %, as far as the machines drawn tell."
            )
        best = table.iloc[0]
        return (
            f"{_named(best['value'])} {best['narrowed']} instead of {best['tolerance']} would "
            f"bring the share of good machines to {100 * best['share']:.0f} % "
            f"({100 * best['low']:.0f} to {100 * best['high']:.0f} %), estimated from the "
            f"{best['machines']:.0f} machines drawn within it; solve that drawing to know."
        )

    def record(self) -> dict[str, Any]:
        """Return plain values for ``--json``."""
        what, table = self.drivers
        return {
            "design": finite(self.machine.design.to_dict()),
            "rotor_mass_kg": self.machine.rotor_mass,
            "speed_rpm": self.machine.speed_rpm,
            "tolerances": {VALUES[t.name].key: t.text for t in self.tolerances},
            "seed": self.seed,
            "machines": self.count,
            "stopped": self.stopped,
            "confidence": CONFIDENCE,
            "shares": {
                name: {"share": share, "low": low, "high": high}
                for name, (share, low, high) in self.shares().items()
            },
            "nominal": finite({k: plain(v) for k, v in self.nominal.items()}),
            "troubles": self.troubles(),
            "margin_axis": self.look.axis or None,
            "margin": self.spread("margin") if self.look.axis else None,
            "least_film_m": self.spread("least_film"),
            "peak_contact_force_n": self.spread("peak_contact_force"),
            "drivers_of": what,
            "drivers": finite(table.to_dict("records")),
            "forest_explains": table.attrs.get("explained"),
            "wanted_share": self.wanted,
            "narrowings": finite(self.narrowings.to_dict("records")),
            "sentences": self.sentences(),
            "seconds": self.seconds,
        }


def plain(value: Any) -> Any:
    """Return a number or text of numpy as Python's own."""
    return value.item() if isinstance(value, np.generic) else value


def finite(value: Any) -> Any:
    """Return plain values for JSON: None for nan, "inf" for infinity."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    value = plain(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def check_study(
    machine: Machine,
    tolerances: Tolerances,
    look: Look,
    most: int,
    half_width: float,
    wanted: float,
) -> None:
    """Raise :class:`InputError` for what :func:`tolerance_study` does not take."""
    check_tolerances(machine, tolerances)
    look.check()
    check_number("machines", most, FIRST, MOST)
    if most & (most - 1):
        raise InputError(f"machines = {most} must be a power of two from {FIRST} to {MOST}")
    check_number("half width of the interval", half_width, 0.0, 0.5)
    check_number("wanted share", wanted, 0.01, 0.999)
    machines_at(machine, tolerances, draw(tolerances, most, 0))


def tolerance_study(
    machine: Machine,
    tolerances: Tolerances,
    look: Look | None = None,
    *,
    most: int = MACHINES,
    half_width: float = HALF_WIDTH,
    wanted: float = WANTED,
    seed: int = 0,
    checkpoint: Path | None = None,
    workers: int = 1,
    cluster: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> ToleranceStudy:
    """Draw machines within tolerances, solve and judge them.

    Parameters
    ----------
    machine : Machine
    tolerances : tuple of Tolerance
    look : Look
        How each machine is solved and judged.
    most : int
        Machines at most, a power of two.
    half_width : float
        Of Wilson's interval of the share of good machines at which no more are drawn; 0: never.
    wanted : float
        Share of good machines.
    seed : int
        Of the scrambled Sobol' sequence.
    checkpoint : Path, optional
        Folder of solved machines, from which a run that was stopped goes on.
    workers : int
        Processes; the result does not depend on it.
    cluster : str, optional
        Address of a Dask scheduler whose workers solve instead.
    progress : callable
        Called with the number of machines done since the last call.

    Returns
    -------
    ToleranceStudy

    Raises
    ------
    InputError
        For a machine, tolerances or numbers out of range.
    """
    began, look = time.perf_counter(), look or Look()
    check_study(machine, tolerances, look, most, half_width, wanted)
    quantiles = draw(tolerances, most, seed)
    machines, values = machines_at(machine, tolerances, quantiles)
    plan = {"machine": machine.to_dict(), "seed": seed, "most": most} | {
        "tolerances": {t.name: t.text for t in tolerances}
    }
    batches: list[Rows] = []
    done, goal, stopped = 0, FIRST, "all"
    with looker(
        look,
        machine.design,
        most,
        plan,
        checkpoint=checkpoint,
        workers=workers,
        cluster=cluster,
        progress=progress,
    ) as solve:
        nominal = look_at(machine, look)
        while done < most:
            batches.append(solve(machines[done:goal]))
            done, goal = goal, min(2 * goal, most)
            grade = np.concatenate([rows["grade"] for rows in batches])
            low, high = wilson(int((grade == GOOD).sum()), done)
            if done < most and 0.5 * (high - low) <= half_width:
                stopped = "narrow"
                break
    rows = {name: np.concatenate([b[name] for b in batches]) for name in ROW}
    return ToleranceStudy(
        machine,
        tolerances,
        look,
        seed,
        wanted,
        nominal,
        quantiles[:done],
        values[:done],
        rows,
        stopped,
        time.perf_counter() - began,
    )


def study_dict(study: ToleranceStudy) -> dict[str, Any]:
    """Return a study as plain values that :func:`study_of` reads."""
    return {
        "machine": study.machine.to_dict(),
        "tolerances": {VALUES[t.name].key: t.text for t in study.tolerances},
        "look": study.look.to_dict(),
        "seed": study.seed,
        "wanted": study.wanted,
        "nominal": {k: plain(v) for k, v in study.nominal.items()},
        "quantiles": study.quantiles.tolist(),
        "rows": {name: values.tolist() for name, values in study.rows.items()},
        "stopped": study.stopped,
        "seconds": study.seconds,
    }


def study_of(data: dict[str, Any]) -> ToleranceStudy:
    """Return the study of :func:`study_dict`."""
    machine = Machine.from_dict(data["machine"])
    tolerances = parse_tolerances(data["tolerances"])
    quantiles = np.array(data["quantiles"], float).reshape(-1, len(tolerances))
    rows = read_rows(data["rows"])
    if any(len(values) != len(quantiles) for values in rows.values()) or not len(quantiles):
        raise ValueError("its columns have different lengths")
    _, values = machines_at(machine, tolerances, quantiles)
    nominal = read_row(data["nominal"])
    return ToleranceStudy(
        machine,
        tolerances,
        Look.from_dict(data["look"]),
        int(data["seed"]),
        float(data["wanted"]),
        nominal,
        quantiles,
        values,
        rows,
        str(data["stopped"]),
        float(data["seconds"]),
    )


def save_study(study: ToleranceStudy, path: Path) -> None:
    """Write a study as JSON, atomically."""
    write_atomically(path, json.dumps(study_dict(study)).encode())


def load_study(path: Path) -> ToleranceStudy:
    """Read a file of :func:`save_study`. Raises ``InputError`` for any other file."""
    return read_json(path, study_of, "tolerances' result")


_T = TypeVar("_T")


def read_json(path: Path, read: Callable[[dict[str, Any]], _T], what: str) -> _T:
    """Return what ``read`` makes of a JSON file; raise ``InputError`` for a damaged one."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"it has more than {_MAX_BYTES:,} bytes")
        return read(json.loads(path.read_text("utf-8")))
    except UNREADABLE as error:
        raise InputError(f"cannot read the {what} {str(path)!r}: {str(error)[:200]}") from None
