"""The bearing's eight linearised coefficients, stiffness and damping at the static equilibrium,
against shaft speed and whirl frequency.

The force on the journal is

    F_x = -kxx x - kxy y - cxx x' - cxy y',   F_y = -kyx x - kyy y - cyx x' - cyy y'

(x horizontal, y upwards, rotation from x to y; a film that drives forward whirl has kxy > 0 > kyx).
In a gas film they depend on the frequency, because the gas is compressed (J. W. Lund, J. Tribology
109, 1987, pp. 37-41), and on how fast the whirl grows or decays: for one that goes as exp(p tau)
they are the real K and C with K + p C = Z(p)
(:class:`spab_core.linear_theory.impedance.Impedance`). On the imaginary axis, p = i nu, that is
the usual K(nu) + i nu C(nu). At an eigenvalue of rotor and film the rotor on these K and C has that
very eigenvalue, frequency and decay."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.linear_theory.film_whirl import follow_film_whirl
from spab_core.linear_theory.impedance import Impedance, impedance
from spab_core.linear_theory.modes import Mode
from spab_core.solver.film import AUTO, Mesh

WHIRL_RANGE = (0.0, 1000.0)  # whirl frequency over the shaft speed
FILM_WHIRL = "film-whirl"  # in place of a whirl ratio: that of the film's whirl at each speed
FREQUENCIES = 121  # of a table over speed and frequency
# such a table begins at this share of the lowest speed, beside 0, and ends so far over twice the
# highest speed and over the modes with a damping ratio under 0.3
_LOWEST, _MARGIN, _LIGHTLY_DAMPED = 0.1, 1.25, 0.3
# relative, in frequency: two modes with growth rates of their own are at least so far apart, and
# each rate holds so far about its mode
_NUDGE = 0.01  # relative change of a frequency, to see what follows from it
_APART, _FLAT = 0.02, 0.15
NAMES = tuple(
    f"{kind}{i}{j}" for kind in "kc" for i in "xy" for j in "xy"
)  # the order of ROSS and of tables here


@dataclass(frozen=True)
class Coefficients:
    """The eight coefficients against shaft speed, whirl frequency, or both; a row each.

    Attributes
    ----------
    axis : str
        What the rows run over: ``speed``, ``frequency`` (of the whirl, at one speed), or ``speed
        and frequency``, a grid in C order, the same frequencies in rad/s at each speed.
    speed : ndarray, (n,)
        Shaft speed, rad/s.
    whirl_frequency : ndarray, (n,)
        rad/s.
    growth : ndarray, (n,)
        Growth rate of the whirl that feels them, 1/s; 0 for a steady one, negative if it decays.
    stiffness : ndarray, (n, 2, 2)
        N/m: [[kxx, kxy], [kyx, kyy]], F = -k x - c x'.
    damping : ndarray, (n, 2, 2)
        N s/m, likewise.
    contact_load_share : ndarray, (n,)
        Share of the weight that the asperities carry at rest.
    modes : tuple of Mode
        The film's whirl at the speed of each row where the rows follow it, else empty.
    missing : tuple of float
        Shaft speeds in rad/s that were asked for and have no static equilibrium.
    held : bool
        Whether the journal, which moves along the axis in the design, is held there in these.
    lost : tuple of float
        Of a grid, shaft speeds in rad/s at which a program that takes K and C at a mode's frequency
        and repeats that at the frequency found is driven away from the film's whirl, which it then
        does not find.
    """

    axis: str
    speed: np.ndarray
    whirl_frequency: np.ndarray
    growth: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    contact_load_share: np.ndarray
    modes: tuple[Mode, ...] = ()
    missing: tuple[float, ...] = ()
    held: bool = False
    lost: tuple[float, ...] = ()

    @property
    def whirl_ratio(self) -> np.ndarray:
        """Whirl frequency over the shaft speed."""
        return np.asarray(self.whirl_frequency / self.speed)

    def column(self, name: str) -> np.ndarray:
        """One coefficient by its name in :data:`NAMES`, such as ``kxy``."""
        k = NAMES.index(name)
        return (self.stiffness if k < 4 else self.damping)[:, (k // 2) % 2, k % 2]


def _join(
    axis: str,
    parts: Sequence[Coefficients],
    modes: Sequence[Mode] = (),
    missing: Sequence[float] = (),
) -> Coefficients:
    if not parts:
        raise InputError(
            "at none of these speeds does the film carry the load: there is no static equilibrium "
            "to linearise"
        )
    names = ("speed", "whirl_frequency", "growth", "stiffness", "damping", "contact_load_share")
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in names
    }
    held = any(part.held for part in parts)
    return Coefficients(axis, **columns, modes=tuple(modes), missing=tuple(missing), held=held)


@one_thread
def coefficients(
    at: Impedance,
    whirl_ratios: Sequence[float] | np.ndarray,
    growth: float | np.ndarray = 0.0,
) -> Coefficients:
    """Stiffness and damping at whirl frequencies.

    Parameters
    ----------
    at : Impedance
    whirl_ratios : sequence of float
        Frequencies over the shaft speed; 0 is the limit of a slow whirl.
    growth : float, or ndarray with one for each ratio
        Growth rate of the whirl per unit tau, negative if it decays; 0: steady.

    Raises
    ------
    DesignError
        For a ratio out of :data:`WHIRL_RANGE`.
    """
    ratios = np.array([check_number("whirl ratio", float(v), *WHIRL_RANGE) for v in whirl_ratios])
    rates = np.broadcast_to(np.asarray(growth, dtype=float), ratios.shape)
    roots = (complex(rate, v) for rate, v in zip(rates, ratios, strict=True))
    pairs = np.array([at.coefficients(root) for root in roots]).reshape(-1, 2, 2, 2)
    speed, unit = at.design.speed(at.bearing_number), at.design.stiffness_unit
    return Coefficients(
        "frequency",
        np.full(len(ratios), speed),
        ratios * speed,
        rates * speed,
        pairs[:, 0] * unit,
        pairs[:, 1] * unit / speed,
        np.full(len(ratios), at.contact_load_share),
        held=at.design.rotor.axial_motion,
    )


def coefficients_over_whirl(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    whirl_ratios: Sequence[float] | np.ndarray,
    mesh: Mesh = AUTO,
) -> Coefficients:
    """Stiffness and damping of a bearing at one speed; parameters as those of
    :func:`~spab_core.linear_theory.impedance.impedance` and :func:`coefficients`.

    Raises
    ------
    InputError
        Where there is no static equilibrium.
    """
    z = impedance(design, rotor_mass, bearing_number, mesh)
    if z is None:
        raise InputError(
            "there is no static equilibrium: the film does not carry this rotor at this speed"
        )
    return coefficients(z, whirl_ratios)


@one_thread
def coefficients_over_speed(
    design: Design,
    rotor_mass: float,
    bearing_numbers: Sequence[float] | np.ndarray,
    whirl: float | str = 1.0,
    mesh: Mesh = AUTO,
) -> Coefficients:
    """Stiffness and damping against shaft speed, rotor mass held.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_numbers : sequence of float
    whirl : float or str
        Whirl ratio of every row (1: synchronous), of a steady whirl. Or :data:`FILM_WHIRL`: at each
        speed the frequency and the decay of the film's whirl, followed by continuity
        (:func:`~spab_core.linear_theory.film_whirl.follow_film_whirl`). The rotor on those rows has
        the film's whirl as film and rotor together have it, and so the limit of stability.
    mesh : Mesh

    Raises
    ------
    InputError
        For a whirl that is neither, where no speed has a static equilibrium, or where the film's
        whirl cannot be followed.
    """
    if whirl == FILM_WHIRL:
        followed = follow_film_whirl(design, rotor_mass, bearing_numbers, mesh)
        found = [item for item in followed if item is not None]
        return _join(
            "speed",
            [coefficients(z, [mode.root.imag], mode.root.real) for z, _, mode in found],
            [mode for _, _, mode in found],
            _missing(design, bearing_numbers, followed),
        )
    check_number("whirl ratio", whirl, *WHIRL_RANGE)
    bearings: list[Impedance | None] = []
    guess = None
    for number in bearing_numbers:
        bearings.append(impedance(design, rotor_mass, float(number), mesh, guess))
        guess = guess if bearings[-1] is None else bearings[-1].equilibrium.state
    parts = [coefficients(z, [float(whirl)]) for z in bearings if z is not None]
    return _join("speed", parts, missing=_missing(design, bearing_numbers, bearings))


@one_thread
def coefficients_over_speed_and_frequency(
    design: Design,
    rotor_mass: float,
    bearing_numbers: Sequence[float] | np.ndarray,
    frequencies: Sequence[float] | np.ndarray | None = None,
    mesh: Mesh = AUTO,
) -> Coefficients:
    """Stiffness and damping against shaft speed and whirl frequency, rotor mass held: a grid.

    At each speed a whirl decays, or grows, as fast as the rotor's own mode of that frequency does
    there, in between as the line between the modes tells (:func:`_growth_at`). A program that takes
    K and C of this table at a mode's own frequency finds that mode as film and rotor together have
    it. With K and C of steady whirls in its place it would miss a tenth of the logarithmic
    decrement and more (docs/my_bearing.md).

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_numbers : sequence of float
        Rising.
    frequencies : sequence of float, optional
        Whirl frequencies in rad/s, rising; left out, :data:`FREQUENCIES` from 0 to past twice the
        highest speed and past the lightly damped modes.
    mesh : Mesh

    Raises
    ------
    InputError
        Where no speed has a static equilibrium, or where the film's whirl cannot be followed.
    """
    followed = follow_film_whirl(design, rotor_mass, bearing_numbers, mesh)
    found = [item for item in followed if item is not None]
    if frequencies is None and found:
        speeds = [design.speed(z.bearing_number) for z, _, _ in found]
        modes = [
            speed * mode.root.imag
            for speed, (_, modes, _) in zip(speeds, found, strict=True)
            for mode in modes
            if abs(mode.root.real) < _LIGHTLY_DAMPED * abs(mode.root)
        ]
        low, high = _LOWEST * min(speeds), _MARGIN * max(2.0 * max(speeds), *modes)
        frequencies = np.concatenate([[0.0], np.geomspace(low, high, FREQUENCIES - 1)])
    axis = np.asarray(frequencies, dtype=float)
    rows = []
    for z, every, mode in found:
        ratios = axis / design.speed(z.bearing_number)
        rows.append(coefficients(z, ratios, _growth_at(ratios, every, mode)))
    table = _join(
        "speed and frequency",
        [replace(part, whirl_frequency=axis) for part in rows],  # the same to the last bit
        [mode for _, _, mode in found for _ in axis],
        _missing(design, bearing_numbers, followed),
    )
    lost = [z.bearing_number for z, every, mode in found if _is_lost(z, every, mode, rotor_mass)]
    return replace(table, lost=tuple(design.speed(number) for number in lost))


def _is_lost(z: Impedance, every: Sequence[Mode], followed: Mode, rotor_mass: float) -> bool:
    """Return whether the frequency of the film's whirl on K and C moves by more than the frequency
    that K and C are taken at: a fixed point that repels what repeats.
    """
    given = followed.ratio * np.array([1.0 - _NUDGE, 1.0 + _NUDGE])
    near = coefficients(z, given, _growth_at(given, every, followed))
    speed, told = z.design.speed(z.bearing_number), []
    for k, c in zip(near.stiffness, near.damping, strict=True):
        roots = _roots_on(z.design, rotor_mass, k, c) / speed
        told.append(roots[np.abs(roots - followed.root).argmin()].imag)
    return bool(abs(told[1] - told[0]) >= given[1] - given[0])


def _roots_on(
    design: Design, rotor_mass: float, stiffness: np.ndarray, damping: np.ndarray
) -> np.ndarray:
    """Return the eigenvalues, 1/s, of the rotor on real K (N/m) and C (N s/m)."""
    share, shaft = design.rotor.journal_mass_fraction, design.rotor.shaft_stiffness
    if design.rigid:
        mass: np.ndarray = rotor_mass * np.eye(2)
        k, c = stiffness, damping
    else:
        spring = np.kron([[1.0, -1.0], [-1.0, 1.0]], shaft * np.eye(2))
        mass = rotor_mass * np.kron(np.diag([share, 1.0 - share]), np.eye(2))
        k = spring + np.kron(np.diag([1.0, 0.0]), stiffness)
        c = np.kron(np.diag([1.0, 0.0]), damping)
    motion = np.eye(len(mass), 2 * len(mass), len(mass))  # displacements change by velocities
    return np.linalg.eigvals(np.vstack([motion, -np.linalg.solve(mass, np.hstack([k, c]))]))


def _growth_at(ratios: np.ndarray, modes: Sequence[Mode], followed: Mode) -> np.ndarray:
    """Return the growth rate per unit tau at whirl ratios: that of each lightly damped mode about
    its own frequency, flat over two rows of a usual table if there is room, so that what reads
    between the rows finds it; linear in between, the outermost beyond.

    Of two modes of all but one frequency the film's whirl, or else the less damped, keeps its own.
    """
    kept = [followed.root]
    for mode in sorted(modes, key=lambda m: m.log_decrement):
        root = mode.root
        apart = min(abs(root.imag - other.imag) for other in kept)
        if abs(root.real) < _LIGHTLY_DAMPED * abs(root) and apart > _APART * root.imag:
            kept.append(root)
    kept.sort(key=lambda root: root.imag)
    at, rates = [kept[0].imag], [kept[0].real]
    for low, high in itertools.pairwise(kept):
        gap = high.imag - low.imag
        for root, side in ((low, 1.0), (high, -1.0)):
            room = gap * (0.7 if root == followed.root else 0.25)
            at.append(root.imag + side * min(_FLAT * root.imag, room))
        rates += [low.real, high.real]
    return np.asarray(np.interp(ratios, at, rates))


def _missing(
    design: Design, bearing_numbers: Sequence[float] | np.ndarray, found: Sequence[object]
) -> list[float]:
    """Return the speeds in rad/s at which nothing was found."""
    return [
        design.speed(float(number))
        for number, item in zip(bearing_numbers, found, strict=True)
        if item is None
    ]
