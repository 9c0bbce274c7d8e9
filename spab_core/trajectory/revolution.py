"""One revolution in full: film thickness, pressure and every force, and the run-up that led there.

A trajectory keeps the rotor alone. From its final state one more revolution is integrated here,
span by span, and the whole state is kept at the end of each span. The film is drawn from the same
polynomials and the same sums that the solver uses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import legendre

from spab_core.common.errors import DesignError
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import running_system
from spab_core.solver.film import (
    Film,
    band_operators,
    film_array,
    film_force,
    gas_size,
    latitude_operators,
    on_azimuths,
    placed,
    profile,
    thickness,
)
from spab_core.solver.rotor import ROTOR_STATES, build_rotor, contact_force, wall_force
from spab_core.solver.stepping import (
    OK,
    REVOLUTION,
    STATUS,
    Options,
    advance,
    build_memory,
    build_record,
)
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.settings import Settings

TOLERANCE = 2e-4  # finer than a live solve's: it costs nothing over one revolution
FORCES = ("film", "contact", "unbalance", "gravity")


@dataclass(frozen=True)
class Revolution:
    """Rotor and film at equal shaft angles over one revolution, both ends included.

    Attributes
    ----------
    design : Design
    rotor_mass, bearing_number : float
        kg on one bearing; Lambda.
    status : str
        One of ``stepping.STATUS``; not ``ok``: the arrays end before the revolution does.
    tau : ndarray, (K + 1,)
        Shaft angle since the start of the run, rad.
    states : ndarray, (K + 1, 8)
        Rotor states [X2, Y2, X1, Y1, X2', Y2', X1', Y1'], over C.
    gas : ndarray, (K + 1, N, M)
        Gas content P H of the film's nodes, azimuth by latitude of the half band.
    film : Film
    axial : ndarray, (K + 1, 2)
        Z and Z', over C; of a journal that is held along the axis its position, and 0.
    """

    design: Design
    rotor_mass: float
    bearing_number: float
    status: str
    tau: np.ndarray
    states: np.ndarray
    gas: np.ndarray
    film: Film = field(repr=False)
    axial: np.ndarray

    @property
    def angle(self) -> np.ndarray:
        """Shaft angle from 0 to 360, degrees."""
        return np.asarray(np.degrees(self.tau - self.tau[0]))

    @property
    def thickness(self) -> np.ndarray:
        """Film thickness H at the nodes, over C, (K + 1, N, M)."""
        pairs = zip(self.films, self.states, strict=True)
        return np.array([thickness(film, *q[:2]).T for film, q in pairs])

    @property
    def films(self) -> list[Film]:
        """The film at each shaft angle, its journal where it is along the axis."""
        return [placed(self.film, np.array([z, *np.zeros(7)])) for z in self.axial[:, 0]]

    @property
    def pressure(self) -> np.ndarray:
        """Pressure P at the nodes, over ambient, (K + 1, N, M)."""
        return np.asarray(self.gas / self.thickness)


def integrate_revolution(point: OperatingPoint, samples: int = 72) -> Revolution:
    """Go on for one revolution from where a point's run ended.

    Parameters
    ----------
    point : OperatingPoint
        Whatever its method, this revolution is integrated by ``rodas``: the semi-discrete equations
        are the same.
    samples : int
        Spans of the revolution.

    Raises
    ------
    DesignError
        If the run did not complete: there is no state to go on from.
    """
    t = point.trajectory
    if t.status != "ok":
        raise DesignError("the run did not complete: there is no film to show")
    settings = point.settings
    system = running_system(point.design, point.rotor_mass, point.bearing_number, t.mesh)
    film, memory = system.film, build_memory(system.film)
    memory.state[:] = t.final
    options = Options(tolerance=min(TOLERANCE, settings.tolerance), period=REVOLUTION / samples)
    kept, status = [memory.state.copy()], OK
    record = build_record(1, 0, moving=bool(film.slide))
    for k in range(samples):
        status, _ = advance(system, memory, options, t.completed * samples + k, 1, record)
        if status != OK:
            break
        kept.append(memory.state.copy())
    behind = np.array([u[gas_size(film) :] for u in kept])
    states, axial = behind[:, :ROTOR_STATES], behind[:, ROTOR_STATES : ROTOR_STATES + 2]
    if not film.slide:
        axial = np.column_stack([np.full(len(kept), film.offset), np.zeros(len(kept))])
    if point.design.rigid:  # the disc is the journal
        states[:, 2:4], states[:, 6:8] = states[:, 0:2], states[:, 4:6]
    tau = t.completed * REVOLUTION + np.arange(len(kept)) * (REVOLUTION / samples)
    return Revolution(
        point.design,
        point.rotor_mass,
        point.bearing_number,
        STATUS[status],
        tau,
        states,
        np.array([film_array(film, u).T for u in kept]),
        film,
        axial,
    )


def run_up(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings,
    revolutions: int = 60,
    samples: int = 48,
) -> np.ndarray:
    """Rotor states of the first revolutions from rest, shape (n, 8): the load is raised over the
    first 30.

    Parameters
    ----------
    settings : Settings
        Its mesh and tolerance are taken; the integrator is ``rodas``.
    revolutions, samples : int
        How many, and points of each. A run that fails ends there.
    """
    system = running_system(design, rotor_mass, bearing_number, settings.mesh)
    record = build_record(revolutions, samples, moving=bool(system.film.slide))
    advance(
        system,
        build_memory(system.film),
        Options(tolerance=settings.tolerance),
        0,
        revolutions,
        record,
    )
    path: np.ndarray = record.path[..., :ROTOR_STATES].reshape(-1, ROTOR_STATES)
    path = path[np.isfinite(path[:, 0])]
    if design.rigid:
        path[:, 2:4], path[:, 6:8] = path[:, 0:2], path[:, 4:6]
    return path


def forces(revolution: Revolution) -> dict[str, np.ndarray]:
    """Forces over the revolution, in N, each of shape (K + 1, 2): x and y.

    Returns
    -------
    dict
        ``film`` and ``contact`` on the journal, ``unbalance`` and ``gravity`` on the whole rotor:
        their sum is the rotor's mass times its acceleration (docs/model.md). ``shaft``, on the
        journal, is internal and not of the sum; nan for a rigid rotor.
    """
    r, d = revolution, revolution.design
    mass, load = d.mass_number(r.rotor_mass, r.bearing_number), d.load_number(r.rotor_mass)
    rotor = build_rotor(d, r.rotor_mass, r.bearing_number, room=r.film.room)
    ramp = np.minimum(r.tau / rotor.ramp, 1.0)
    eccentric = (1.0 - d.rotor.journal_mass_fraction) * mass * d.unbalance_number
    q = r.states
    pairs = zip(r.films, r.gas, q, strict=True)
    film = np.array([film_force(film, s.T, *x[:2]) for film, s, x in pairs])
    contact = np.array([contact_force(rotor, *x[[0, 1, 4, 5]]) for x in q])
    if r.film.slide:  # the wall is met where the gap is least
        whole = [
            wall_force(rotor, r.film.edge, (*x[:2], z), (*x[4:6], vz))
            for x, (z, vz) in zip(q, r.axial, strict=True)
        ]
        contact = np.array(whole)[:, :2]
    shaft = (
        np.full((len(q), 2), math.nan)
        if d.rigid
        else d.shaft_stiffness_number * (q[:, 2:4] - q[:, :2])
    )
    found = {
        "film": film,
        "contact": contact,
        "unbalance": (ramp * eccentric)[:, None] * np.column_stack([np.cos(r.tau), np.sin(r.tau)]),
        "gravity": np.column_stack([np.zeros_like(ramp), -ramp * load]),
        "shaft": shaft,
    }
    return {name: d.force_unit * value for name, value in found.items()}


@dataclass(frozen=True)
class Surface:
    """The film on a grid for drawing.

    Attributes
    ----------
    latitude : ndarray, (L,)
        From the lower to the upper edge, rad; of a cylinder the axial coordinate over R.
    radius, height : ndarray, (L,)
        Of the wall, distance from the axis of rotation and along it there, over R.
    azimuth : ndarray, (A + 1,)
        Once around, both ends, rad.
    angle : ndarray, (K,)
        Shaft angle of each picture, degrees.
    thickness, pressure : ndarray, (K, A + 1, L)
        H over C and P over ambient.
    """

    latitude: np.ndarray
    radius: np.ndarray
    height: np.ndarray
    azimuth: np.ndarray
    angle: np.ndarray
    thickness: np.ndarray
    pressure: np.ndarray


def surface(
    revolution: Revolution, every: int = 3, azimuths: int = 72, latitudes: int = 11
) -> Surface:
    """The film on a finer, regular grid: the solver's own polynomials in latitude, the
    trigonometric one around.

    Parameters
    ----------
    every : int
        Take each so many-th sample of the revolution; its end is left out, it is the next one's
        beginning.
    azimuths, latitudes : int
        Points around, more than the film has, and from edge to edge (odd: one on the equator).
    """
    r, m = revolution, revolution.film.latitudes
    s = np.linspace(-1.0, 1.0, latitudes)
    if r.film.whole:
        basis, nodes = np.eye(m), band_operators(m // 2)[0]
    else:
        basis, nodes = np.eye(2 * m)[:, ::2], latitude_operators(m)[0]

    def bubbles(x: np.ndarray) -> np.ndarray:
        return ((1.0 - x**2) * legendre.legval(x, basis)).T

    across = bubbles(s) @ np.linalg.inv(bubbles(nodes))  # of P² - 1
    picked = slice(0, max(len(r.tau) - 1, 1), every)
    column = np.moveaxis(r.pressure[picked] ** 2 - 1.0, 1, -1)
    around = np.moveaxis(on_azimuths(column, azimuths), -1, 1) @ across.T
    closed = np.concatenate([around, around[:, :1]], axis=1)
    azimuth = np.linspace(0.0, 2.0 * math.pi, azimuths + 1)
    x, y = r.states[picked, 0][:, None, None], r.states[picked, 1][:, None, None]
    radius, height = profile(r.design.bearing, s)
    base = 1.0 - r.axial[picked, 0][:, None, None] * height
    gap = base - radius * (x * np.cos(azimuth)[:, None] + y * np.sin(azimuth)[:, None])
    pressure = np.sqrt(np.maximum(1.0 + closed, 0.0))
    latitude = r.design.bearing.edge * s
    return Surface(latitude, radius, height, azimuth, r.angle[picked], gap, pressure)
