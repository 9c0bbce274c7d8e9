"""The film's whirl over shaft speed, followed by continuity.

The film's whirl is the forward whirl of the rotor on its film with the shaft all but straight: at
half the speed where the film is not fed or the shaft is fast, at a natural frequency on the gas
spring where a fed bearing turns slowly. It is the whirl that sets the limit of stability. The
shaft's bending modes can be less damped without ever growing, so "the least stable" is no name for
a mode: over a range of speeds it changes from one to the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import LIFTED
from spab_core.linear_theory.impedance import Impedance, impedance
from spab_core.linear_theory.modes import FILM_MODE, Mode, rotor_modes
from spab_core.solver.film import Mesh

# continuity: a mode moves by less than this share of its frequency between two speeds, is at least
# twice as near as any other of a like shape, and keeps its shape
_LARGEST_MOVE, _NEARNESS, _LIKENESS = 0.25, 0.5, 0.5
_HARDLY = 0.95  # decay over frequency near which no vibration is found (rotor_modes)
_HALVINGS = 7  # of an interval of speeds in which the next mode is in doubt


def film_whirl(modes: Sequence[Mode]) -> Mode | None:
    """The film's whirl among the modes at one speed: the least stable forward mode with the name
    :data:`FILM_MODE`, unless it hardly swings (a damping ratio above 0.7); in its place the least
    stable forward one of any name. None where nothing whirls forward.
    """
    forward = [mode for mode in modes if mode.forward]
    named = [m for m in forward if m.name == FILM_MODE and -m.root.real < m.root.imag]
    return next(iter(named or forward), None)


def follow_film_whirl(
    design: Design, rotor_mass: float, bearing_numbers: Sequence[float] | np.ndarray, mesh: Mesh
) -> list[tuple[Impedance, list[Mode], Mode] | None]:
    """The film's whirl over shaft speed, rotor mass held, by continuity.

    It is taken by name at the highest speed and followed downwards: at each speed the mode whose
    eigenvalue is nearest to the one before among those of a like shape. Where two are in doubt the
    interval of speeds is halved.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_numbers : sequence of float
    mesh : Mesh

    Returns
    -------
    list
        At each speed the bearing, all its modes, and the one followed; None where there is no
        static equilibrium.

    Raises
    ------
    InputError
        Where nothing whirls forward at the highest speed, or no one mode goes on.
    """
    found: list[tuple[Impedance, list[Mode], Mode] | None] = [None] * len(bearing_numbers)
    here: tuple[Impedance, list[Mode], Mode] | None = None
    for k in np.argsort(-np.asarray(bearing_numbers, dtype=float), kind="stable"):
        number = float(bearing_numbers[k])
        if here is None:
            z = impedance(design, rotor_mass, number, mesh)
            if z is None:
                continue
            modes = rotor_modes(z.system, z.equilibrium.state)
            mode = film_whirl(modes)
            if mode is None:
                raise InputError(
                    f"at {_rpm(z):,.0f} rpm nothing whirls with the rotation{_on_wall(z)}: there "
                    "is no whirl of the film to follow; give other speeds, or a whirl ratio"
                )
            found[k] = here = (z, modes, mode)
            continue
        z = impedance(design, rotor_mass, number, mesh, here[0].equilibrium.state)
        if z is None:
            continue
        for z_next, modes, candidate in _steps(here, z, mesh, _HALVINGS):
            here = (z_next, modes, candidate)
        found[k] = here
    return found


def _rpm(at: Impedance) -> float:
    return at.design.speed_rpm(at.bearing_number)


def _on_wall(at: Impedance) -> str:
    """Return a clause where the asperities carry much of the weight."""
    share = at.contact_load_share
    return f" (not lifted off: the wall carries {share:.0%} of the weight)" * (share > LIFTED)


def _steps(
    start: tuple[Impedance, list[Mode], Mode], end: Impedance, mesh: Mesh, halvings: int
) -> Iterator[tuple[Impedance, list[Mode], Mode]]:
    """Yield the mode of ``start`` at speeds in between and at ``end``."""
    modes = rotor_modes(end.system, end.equilibrium.state)
    mode = _continued(start[0], start[2], end, modes)
    if mode is not None:
        yield end, modes, mode
        return
    half = 0.5 * (start[0].bearing_number + end.bearing_number)
    middle = (
        impedance(end.design, end.rotor_mass, half, mesh, start[0].equilibrium.state)
        if halvings
        else None
    )
    if middle is None:
        here = start[2]
        why = "no one mode goes on"
        if start[0].system.film.depth and -here.root.real > _HARDLY * here.root.imag:
            why = "below, its damping ratio is over 0.7: it hardly swings and is no whirl any more"
        raise InputError(
            f"the film's whirl cannot be followed from {_rpm(start[0]):,.0f} rpm (there at "
            f"{here.ratio:.3f} of the speed, logarithmic decrement "
            f"{here.log_decrement:.3g}) down to {_rpm(end):,.0f} rpm: {why}"
            f"{_on_wall(start[0])}; give speeds on one side of these, or a whirl ratio"
        )
    for at, found, candidate in _steps(start, middle, mesh, halvings - 1):
        start = (at, found, candidate)
        yield start
    yield from _steps(start, end, mesh, halvings - 1)


def _continued(here: Impedance, mode: Mode, there: Impedance, modes: list[Mode]) -> Mode | None:
    """Return the mode at ``there`` that continues one at ``here``, None where that is in doubt."""
    alike = [other for other in modes if mode.likeness(other) >= _LIKENESS]
    # in rad/s and over the speed: a natural frequency keeps the one, a half-speed whirl the other
    scale = there.bearing_number / here.bearing_number
    moves = sorted(
        (min(abs(scale * v.root - mode.root) / scale, abs(v.root - mode.root)), k)
        for k, v in enumerate(alike)
    )
    if not moves or moves[0][0] > _LARGEST_MOVE * abs(mode.root):
        return None
    if len(moves) > 1 and moves[0][0] > _NEARNESS * moves[1][0]:
        return None
    return alike[moves[0][1]]
