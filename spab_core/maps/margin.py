"""Find the distance of an operating point to the nearest border of a map, and where linear theory
disagrees with the map.

Every cell of a map stands for the box around it, halfway to its neighbours. A border lies between
two cells and is known to half the distance of their centres. Regimes alone count: "stable" is every
periodic motion, whatever it is worth, and "unstable" every other, failed cells included.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from spab_core.common.validation import check_number
from spab_core.common.words import small
from spab_core.maps.stability_map import MapError, StabilityMap
from spab_core.trajectory.regimes import Regime

if TYPE_CHECKING:  # it loads scikit-learn
    from spab_core.linear_theory.linear_table import LinearTable

_ALIKE = 1e-9  # relative: a point on the edge of the map is inside


@dataclass(frozen=True)
class Border:
    """The next border along one axis.

    Attributes
    ----------
    value : float
        Halfway between the last cell on this side and the first beyond: kg, or a bearing number.
    half : float
        Half the distance of the two cells: the border lies somewhere in ``value`` ± ``half``.
    distance : float
        From the point to ``value``, at least 0.
    beyond : str
        Motion in the first cell beyond it, such as "chaotic".
    """

    value: float
    half: float
    distance: float
    beyond: str


@dataclass(frozen=True)
class Nearest:
    """The nearest point in the whole plane beyond a border, such as an unstable one from a stable
    one.

    Attributes
    ----------
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    change : float
        Root of the sum of squares of the relative changes of mass and speed to reach it.
    beyond : str
        Motion in its cell.
    """

    rotor_mass: float
    bearing_number: float
    change: float
    beyond: str


@dataclass(frozen=True)
class Borders:
    """Borders around a point; None if there is none up to the edge of the map."""

    mass_below: Border | None
    mass_above: Border | None
    number_below: Border | None
    number_above: Border | None
    both: Nearest | None


@dataclass(frozen=True)
class Margin:
    """Borders around an operating point of a map.

    Attributes
    ----------
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    rpm_per_number : float
        Shaft speed in rpm at the bearing number 1 of the map's design.
    here : str
        Regime of the point's cell, or the status of its failed run.
    stable, chaotic : bool
        Whether the motion is periodic, or chaotic.
    instability : Borders
        Towards the nearest cells that are not periodic; from one of those, the nearest periodic
        ones.
    chaos : Borders
        Towards the nearest chaotic cells; from a chaotic point, the nearest that are not.
    masses, numbers : tuple of float
        Edges of the map, kg and bearing numbers.
    predicted : bool
        Whether cells of the map are predicted, not solved: then a border's ``half`` is the grid's,
        not its error.
    """

    rotor_mass: float
    bearing_number: float
    rpm_per_number: float
    here: str
    stable: bool
    chaotic: bool
    instability: Borders
    chaos: Borders
    masses: tuple[float, float]
    numbers: tuple[float, float]
    predicted: bool = False

    def headline(self) -> str:
        """Return the distance to another regime in one sentence: whether motions repeat, not what
        they are worth.
        """
        kind, begin = (
            ("motion that is not periodic", "Margin")
            if self.stable
            else ("periodic motion", f"Not periodic here ({self.here})")
        )
        near = self.instability.both
        if self.predicted:
            begin = f"Predicted: {_small(begin)}"
        if near is None:
            return f"{begin}: no {kind} anywhere in the map."
        return f"{begin}: the nearest {kind} is {near.beyond}, at {self._where(near)}."

    def sentences(self) -> list[str]:
        """Describe the borders in mass at this speed and in speed at this mass, then chaos if it is
        not the nearest instability.
        """
        at_speed, at_mass = (
            f"t {_thousands(self.speed_rpm, 10.0)} rpm",
            f"t {self.rotor_mass:.4g} kg",
        )
        found = [
            f"A{at_speed}: {self._along(self.instability, 'mass')}.",
            f"A{at_mass}: {self._along(self.instability, 'number')}.",
        ]
        near = self.chaos.both
        if self.chaos == self.instability:
            return found
        if near is None:
            return [
                *found,
                "Chaos everywhere in the map." if self.chaotic else "No chaos anywhere in the map.",
            ]
        if self.chaotic:
            return [*found, f"Chaos ends at {self._where(near)}."]
        return [
            *found,
            f"Chaos is nearest at {self._where(near)}; a{at_speed} "
            f"{self._ends(self.chaos, 'mass')}; a{at_mass} {self._ends(self.chaos, 'number')}.",
        ]

    @property
    def speed_rpm(self) -> float:
        """Shaft speed of the point."""
        return self.bearing_number * self.rpm_per_number

    def _end(self, border: Border, side: str, scale: float) -> str:
        half = scale * border.half
        value, begin = (
            _thousands(scale * border.value, half),
            "up to" if side == "below" else "from",
        )
        if self.predicted:
            return f"predicted {begin} about {value}"
        return f"{begin} {value} ± {_thousands(half, half)}"

    def limits(self) -> list[dict[str, Any]]:
        """Return the borders of instability as ``limits`` of ``spab margin --json``."""
        found = []
        for axis, name, at in (
            ("speed", "number", self.bearing_number),
            ("mass", "mass", self.rotor_mass),
        ):
            scale = self.rpm_per_number if axis == "speed" else 1.0
            for direction, side in (("down", "below"), ("up", "above")):
                border: Border | None = getattr(self.instability, f"{name}_{side}")
                if border is None:
                    continue
                found.append(
                    {
                        "axis": axis,
                        "direction": direction,
                        "what": border.beyond if self.stable else self.here,
                        "value": scale * border.value,
                        "low": scale * (border.value - border.half),
                        "high": scale * (border.value + border.half),
                        "begins": self.stable,
                        "change": border.value / at - 1.0,
                        "predicted": self.predicted,
                    }
                )
        return found

    def record(self) -> dict[str, Any]:
        """Return plain values, the keys of ``spab margin --map --json``."""
        return asdict(self) | {
            "limits": self.limits(),
            "speed_rpm": self.speed_rpm,
            "headline": self.headline(),
            "sentences": self.sentences(),
        }

    def _where(self, near: Nearest) -> str:
        mass, speed = (
            near.rotor_mass / self.rotor_mass - 1.0,
            near.bearing_number / self.bearing_number - 1.0,
        )
        return (
            f"{near.rotor_mass:.4g} kg and "
            f"{_thousands(near.bearing_number * self.rpm_per_number, 10.0)} rpm "
            f"(mass {_percent(mass)}, speed {_percent(speed)})"
        )

    def _units(self, axis: str) -> tuple[str, float, tuple[float, float]]:
        """Return the unit of the axis ``mass`` or ``number`` in words, what one of it is in that
        unit, and the map's edges.
        """
        return (
            ("kg", 1.0, self.masses)
            if axis == "mass"
            else ("rpm", self.rpm_per_number, self.numbers)
        )

    def _along(self, borders: Borders, axis: str) -> str:
        """Write both borders along an axis, the nearer one first."""
        unit, scale, edges = self._units(axis)
        told = []
        for side, edge in zip(("below", "above"), edges, strict=True):
            border: Border | None = getattr(borders, f"{axis}_{side}")
            if border is None:
                end = f"{edge:g} kg" if axis == "mass" else f"{scale * edge:,.0f} rpm"
                told.append(
                    (
                        math.inf,
                        f"no border {'down' if side == 'below' else 'up'} to {end} (edge of the "
                        "map)",
                    )
                )
            else:
                told.append(
                    (
                        border.distance,
                        f"{_thousands(scale * border.distance, scale * border.half)} {unit} "
                        f"{'above' if side == 'below' else 'below'} the {border.beyond} band "
                        f"({self._end(border, side, scale)} {unit})",
                    )
                )
        return "; ".join(text for _, text in sorted(told))

    def _ends(self, borders: Borders, axis: str) -> str:
        """Write both borders along an axis without their distances."""
        unit, scale, _ = self._units(axis)
        sides = {side: getattr(borders, f"{axis}_{side}") for side in ("below", "above")}
        return (
            " and ".join(
                f"{self._end(b, side, scale)} {unit}" for side, b in sides.items() if b is not None
            )
            or "nowhere"
        )


def _small(words: str) -> str:
    return small(words)


def _percent(change: float) -> str:
    return f"{100.0 * change:+,.{0 if abs(change) >= 0.1 else 1}f} %"


def _thousands(value: float, resolution: float) -> str:
    """Format a number without digits finer than the first digit of its resolution."""
    digits = -math.floor(math.log10(resolution)) if resolution > 0.0 else 6
    return f"{round(value, digits):,.{max(digits, 0)}f}"


def margin(m: StabilityMap, rotor_mass: float, bearing_number: float) -> Margin:
    """Return the distance of a point of a map to instability and to chaos, or out of them.

    Parameters
    ----------
    m : StabilityMap
    rotor_mass : float
        kg on one bearing.
    bearing_number : float

    Raises
    ------
    InputError
        For a point outside the map, or a map whose axes do not rise.
    """
    numbers, masses = _edges(m.bearing_number), _edges(m.rotor_mass)
    for name, value, axis, unit in (
        ("rotor mass", rotor_mass, m.rotor_mass, "kg"),
        ("bearing number", bearing_number, m.bearing_number, ""),
    ):
        low, high = float(axis[0]), float(axis[-1])
        if not low * (1.0 - _ALIKE) <= value <= high * (1.0 + _ALIKE):
            check_number(f"{name} in this map", value, low, high, unit)
    row, column = m.nearest(rotor_mass, bearing_number)
    here, stable, chaos = _words(m, row, column), m.regime == "periodic", m.regime == "chaotic"

    def borders(other: np.ndarray) -> Borders:
        along_mass = _along(
            other[row], column, m.rotor_mass, rotor_mass, lambda k: _words(m, row, k)
        )
        along_number = _along(
            other[:, column], row, m.bearing_number, bearing_number, lambda k: _words(m, k, column)
        )
        return Borders(
            *along_mass,
            *along_number,
            _nearest(m, other, numbers, masses, rotor_mass, bearing_number),
        )

    return Margin(
        float(rotor_mass),
        float(bearing_number),
        m.design.speed_rpm(1.0),
        here,
        bool(stable[row, column]),
        bool(chaos[row, column]),
        borders(stable != stable[row, column]),
        borders(chaos != chaos[row, column]),
        (float(m.rotor_mass[0]), float(m.rotor_mass[-1])),
        (float(m.bearing_number[0]), float(m.bearing_number[-1])),
        bool(np.any((m.status == "ok") & (m.revolutions == 0))),
    )


def _edges(axis: np.ndarray) -> np.ndarray:
    """Return the edges of the cells, (n + 1,), halfway between the centres; the map ends at its
    outermost centres.
    """
    if np.any(np.diff(axis) <= 0.0):
        raise MapError("the axes of this map do not increase, so it has no margin")
    return np.concatenate([axis[:1], 0.5 * (axis[1:] + axis[:-1]), axis[-1:]])


def _words(m: StabilityMap, row: int, column: int) -> str:
    name = str(m.regime[row, column])
    return Regime(name, int(m.period[row, column])).text if name else str(m.status[row, column])


def _along(
    other: np.ndarray, k: int, axis: np.ndarray, point: float, words: Callable[[int], str]
) -> tuple[Border | None, Border | None]:
    """Return the borders below and above index k to the first cells where ``other`` is true."""
    found: list[Border | None] = []
    for cells, step in (
        (np.flatnonzero(other[:k])[-1:], -1),
        (k + 1 + np.flatnonzero(other[k + 1 :])[:1], 1),
    ):
        if len(cells):
            first = int(cells[0])
            last = first - step
            value, half = (
                0.5 * float(axis[first] + axis[last]),
                0.5 * abs(float(axis[first] - axis[last])),
            )
            found.append(Border(value, half, max(step * (value - point), 0.0), words(first)))
        else:
            found.append(None)
    return found[0], found[1]


def _nearest(
    m: StabilityMap,
    other: np.ndarray,
    numbers: np.ndarray,
    masses: np.ndarray,
    rotor_mass: float,
    bearing_number: float,
) -> Nearest | None:
    """Return the point in the boxes of the cells in ``other`` that is reached by the smallest
    relative change.
    """
    rows, columns = np.nonzero(other)
    if not len(rows):
        return None
    number = np.clip(bearing_number, numbers[rows], numbers[rows + 1])
    mass = np.clip(rotor_mass, masses[columns], masses[columns + 1])
    change = np.hypot(number / bearing_number - 1.0, mass / rotor_mass - 1.0)
    k = int(change.argmin())
    return Nearest(
        float(mass[k]), float(number[k]), float(change[k]), _words(m, int(rows[k]), int(columns[k]))
    )


@dataclass(frozen=True)
class Region:
    """Cells of a map that have something in common.

    Attributes
    ----------
    share : float
        Of all cells.
    numbers, masses : tuple of float
        Bearing numbers, and rotor masses in kg, within which nine tenths of them lie; nan if there
        are none.
    """

    share: float
    numbers: tuple[float, float]
    masses: tuple[float, float]

    def text(self) -> str:
        """Return a sentence such as "12 % of the cells (mostly Λ 2.9 to 8.3, 4 to 24 kg)"."""
        if not self.share:
            return "no cell"
        (a, b), (c, d) = self.numbers, self.masses
        where = f"Λ {a:.2g} to {b:.2g}, {c:.2g} to {d:.2g} kg"
        return f"{100.0 * self.share:.2g} % of the cells (mostly {where})"


@dataclass(frozen=True)
class LinearDisagreement:
    """Cells where linear stability of the static equilibrium, without unbalance, does not predict
    the motion with unbalance.

    Attributes
    ----------
    calm : Region
        Linearly unstable, yet the orbit repeats every revolution: no whirl is seen.
    locked : Region
        Linearly unstable, and the orbit repeats after two revolutions or more: a whirl locked to
        the rotation.
    driven : Region
        Linearly stable, yet the orbit is chaotic or quasi-periodic, or the run fails: driven by
        unbalance.
    """

    calm: Region
    locked: Region
    driven: Region

    def sentences(self) -> list[str]:
        """Describe all three in words."""
        return [
            "Linearly unstable, yet the orbit repeats every revolution, without whirl: "
            f"{self.calm.text()}.",
            "Linearly unstable, yet periodic, the whirl locked to the rotation: "
            f"{self.locked.text()}.",
            "Linearly stable, yet quasi-periodic or chaotic, driven by the unbalance: "
            f"{self.driven.text()}.",
        ]


def critical_masses(table: LinearTable, bearing_number: float) -> np.ndarray:
    """Return the rotor masses in kg, rising, at which the equilibrium changes its stability at a
    bearing number: zeros of the growth rate.
    """
    mass = table.rotor_mass
    rate = table.at(np.full(len(mass), bearing_number), mass)[:, 0]
    k = np.flatnonzero((rate[:-1] < 0.0) != (rate[1:] < 0.0))
    zeros: np.ndarray = mass[k] + np.diff(mass)[k] * rate[k] / (rate[k] - rate[k + 1])
    return zeros


def against_linear(m: StabilityMap, table: LinearTable) -> LinearDisagreement:
    """Compare a map with linear stability; ``table`` is of its design and covers its plane."""
    number, mass = (a.ravel() for a in np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij"))
    stable = table.at(number, mass)[:, 0] < 0.0

    def region(mask: np.ndarray) -> Region:
        if not mask.any():
            return Region(0.0, (math.nan, math.nan), (math.nan, math.nan))
        spans = [
            tuple(float(v) for v in np.quantile(a[mask], (0.05, 0.95))) for a in (number, mass)
        ]
        return Region(float(mask.mean()), (spans[0][0], spans[0][1]), (spans[1][0], spans[1][1]))

    periodic, period = m.regime.ravel() == "periodic", m.period.ravel()
    return LinearDisagreement(
        region(~stable & periodic & (period == 1)),
        region(~stable & periodic & (period > 1)),
        region(stable & ~periodic),
    )
