"""Conical motion: the second family of a symmetric rotor on two equal bearings, which tilts about
its centre while the first moves all of it to one side.

A bearing's centre is half the span a from the rotor's; tilting moves it by q, one bearing against
the other. A sphere's film feels its displacement alone, so that on each bearing

    J_t q'' + J_p S q' = -Z q,   J = I C omega² / (2 a² p_a R²),   S = [[0, 1], [-1, 0]]

with the transverse inertia I_t and the polar one I_p of the whole rotor, and with the same film as
in the first family: both bearings rest alike, so that the two families do not mix. A circular
whirl at nu times the shaft speed feels (I_t - I_p/nu) / (2 a²) in place of the mass on one bearing;
whirls are circular where the rotor rests in the middle, and under gravity the eigenvalues here are
those of the equations above. The shaft is taken as rigid in this family. A cylinder's film feels
the tilt itself: it is refused (:class:`spab_core.design.model.Design`)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.design.model import Design
from spab_core.linear_theory.impedance import Impedance, impedance
from spab_core.linear_theory.modes import Mode, modes_of
from spab_core.linear_theory.spectrum import coupled_eigenpairs
from spab_core.linear_theory.whirl import THRESHOLD_RANGE
from spab_core.solver.film import AUTO, Mesh

_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
_STILL = 1e-9  # motion of the rotor in a vector of length 1: what moves less is the film's alone


@dataclass(frozen=True)
class ConicalThreshold:
    """Where conical motion loses or gains linear stability as the rotor's inertias change together,
    the rotor at rest in the middle of its bearings.

    Attributes
    ----------
    transverse_inertia : float
        Critical I_t of the whole rotor, kg m², at the design's I_p/I_t.
    whirl_ratio : float
        Whirl frequency over the shaft speed.
    stable_side : str
        ``below`` or ``above``: the side of ``transverse_inertia`` where it is stable.
    """

    transverse_inertia: float
    whirl_ratio: float
    stable_side: str


def inertia_numbers(design: Design, bearing_number: float) -> tuple[float, float]:
    """J_t and J_p: mass numbers (:meth:`Design.mass_number`), I/(2 a²) in place of the mass."""
    rotor = design.rotor
    lever = 2.0 * (0.5 * rotor.span) ** 2
    unit = design.mass_number(1.0, bearing_number) / lever
    return rotor.transverse_inertia * unit, rotor.polar_inertia * unit


def _spectrum(z: Impedance, transverse: float, polar: float) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues per unit tau and the tilt in their vectors; of a wall that stores gas the leading
    ones (:func:`~spab_core.linear_theory.spectrum.leading_eigenpairs`).
    """
    n = len(z.film)
    matrix = np.zeros((n + 4, n + 4))
    matrix[:n, :n], matrix[:n, n : n + 2] = z.film, z.drive
    matrix[n : n + 2, n + 2 :] = np.eye(2)
    matrix[n + 2 :, :n], matrix[n + 2 :, n : n + 2] = z.pickup, z.direct
    matrix[n + 2 :, n + 2 :] = z.wall_damping - polar * _TURN
    matrix[n + 2 :] /= transverse
    if z.system.film.depth:
        values, vectors = coupled_eigenpairs(matrix, z.system, z.equilibrium.state)
    else:
        values, vectors = np.linalg.eig(matrix)
    return values, vectors[n : n + 2]


@one_thread
def conical_modes(z: Impedance) -> list[Mode]:
    """Vibrations of the tilting rotor on its films, the least stable first; empty for a design
    without inertias.

    Parameters
    ----------
    z : Impedance
        One bearing under its load; both are equal.
    """
    if not z.design.rotor.conical:
        return []
    values, tilt = _spectrum(z, *inertia_numbers(z.design, z.bearing_number))
    shapes = np.concatenate([tilt, tilt])
    return modes_of(values, shapes, np.linalg.norm(shapes, axis=0) > _STILL)


@one_thread
def conical_thresholds(
    design: Design, bearing_number: float, mesh: Mesh = AUTO, scan: int = 25
) -> list[ConicalThreshold]:
    """Transverse inertias where the tilting rotor, at rest in the middle, changes its stability.

    Parameters
    ----------
    design : Design
        With a transverse inertia and a span; the ratio of its inertias is held.
    bearing_number : float
    mesh : Mesh
    scan : int
        Inertias tried, equally spaced in the logarithm, before each change is bisected; they are
        those of masses of :data:`spab_core.linear_theory.whirl.THRESHOLD_RANGE` on each bearing.

    Raises
    ------
    InputError
        For a design without a transverse inertia.
    """
    rotor = design.rotor
    if not rotor.conical:
        raise InputError(
            "conical motion needs rotor.transverse_inertia and rotor.span above 0 in the design"
        )
    z = impedance(design.replace(rotor__gravity=0.0), 1.0, bearing_number, mesh)
    if z is None:
        raise InputError("no steady film of the centred journal was found; try a finer mesh")
    transverse, polar = inertia_numbers(design, bearing_number)

    def leading(log_scale: float) -> complex:
        scale = math.exp(log_scale)
        values, _ = _spectrum(z, scale * transverse, scale * polar)
        return complex(values[np.argmax(values.real)])

    lever = 2.0 * (0.5 * rotor.span) ** 2
    low, high = (math.log(mass * lever / rotor.transverse_inertia) for mass in THRESHOLD_RANGE)
    found = []
    logs = np.linspace(low, high, scan)
    values = [leading(x) for x in logs]
    for k in range(scan - 1):
        if (values[k].real < 0.0) != (values[k + 1].real < 0.0):
            at = _bisect(lambda x: leading(x).real, logs[k], logs[k + 1])
            found.append(
                ConicalThreshold(
                    rotor.transverse_inertia * math.exp(at),
                    abs(leading(at).imag),
                    "below" if values[k].real < 0.0 else "above",
                )
            )
    return found


def _bisect(function: Callable[[float], float], low: float, high: float) -> float:
    sign = function(low) < 0.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if (function(middle) < 0.0) == sign else (low, middle)
    return 0.5 * (low + high)
