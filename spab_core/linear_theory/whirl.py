"""Eigenvalues of film and rotor linearised about the static equilibrium, and the rotor masses where
the equilibrium gains or loses stability.

The Jacobian is that of the equations that the integrator solves, by its compiled tangent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spab_core.design.limits import check_linear_point
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import (
    AxialStopError,
    Equilibrium,
    find_equilibrium,
    resting_system,
)
from spab_core.linear_theory.spectrum import eigenvalues
from spab_core.solver.film import AUTO, Mesh
from spab_core.solver.system import System

THRESHOLD_RANGE = (1e-2, 1e2)  # kg, searched for the whirl threshold


@dataclass(frozen=True)
class Threshold:
    """Where the static equilibrium loses or gains linear stability as the rotor mass changes, at
    one bearing number.

    Attributes
    ----------
    critical_mass : float
        kg on one bearing.
    critical_mass_number : float
        M at that mass.
    whirl_ratio : float
        Whirl frequency over the shaft speed.
    stable_side : str
        ``below`` or ``above``: the side of ``critical_mass`` where the equilibrium is stable.
    """

    critical_mass: float
    critical_mass_number: float
    whirl_ratio: float
    stable_side: str


def linear_spectrum(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
    guess: np.ndarray | None = None,
) -> tuple[np.ndarray, Equilibrium] | None:
    """Eigenvalues per unit tau of the whole system, film and rotor, linearised about the static
    equilibrium.

    Parameters are those of :func:`~spab_core.linear_theory.equilibrium.static_equilibrium`.

    Returns
    -------
    eigenvalues : ndarray of complex
        Real part first to last falling; imaginary part = frequency over the shaft speed. Where the
        wall stores gas, the leading ones, of a pair one
        (:func:`~spab_core.linear_theory.spectrum.leading_eigenpairs`). None where no equilibrium
        is.
    equilibrium : Equilibrium

    Raises
    ------
    DesignError
        For a point out of range.
    """
    check_linear_point(rotor_mass, bearing_number)
    try:
        system = resting_system(design, rotor_mass, bearing_number, mesh)
    except AxialStopError:
        return None
    return spectrum_of(system, guess)


def spectrum_of(
    system: System, guess: np.ndarray | None = None
) -> tuple[np.ndarray, Equilibrium] | None:
    """:func:`linear_spectrum` of a system without unbalance."""
    equilibrium = find_equilibrium(system, guess)
    if equilibrium is None:
        return None
    values = eigenvalues(system, equilibrium.state)
    return values[np.argsort(-values.real)], equilibrium


def whirl_thresholds(
    design: Design,
    bearing_number: float,
    mesh: Mesh = AUTO,
    masses: tuple[float, float] = THRESHOLD_RANGE,
    scan: int = 25,
) -> list[Threshold]:
    """Rotor masses where the static equilibrium changes its linear stability, in rising order.

    Parameters
    ----------
    design : Design
    bearing_number : float
    mesh : Mesh
    masses : tuple
        Range searched, kg.
    scan : int
        Masses tried, equally spaced in the logarithm, before each sign change is bisected; two
        changes between neighbours go unseen.

    Returns
    -------
    list of Threshold
        Empty where the stability is the same over the whole range.

    Raises
    ------
    DesignError
        For a bearing number or a mass out of range.
    """
    for mass in masses:
        check_linear_point(mass, bearing_number)

    def leading(
        log_mass: float, guess: np.ndarray | None
    ) -> tuple[complex, np.ndarray] | tuple[None, None]:
        """Leading eigenvalue and equilibrium, (None, None) where no equilibrium was found."""
        mass = min(max(math.exp(log_mass), masses[0]), masses[1])
        spectrum = linear_spectrum(design, mass, bearing_number, mesh, guess)
        if spectrum is None and guess is not None:  # the guess may be too far away
            spectrum = linear_spectrum(design, mass, bearing_number, mesh)
        return (None, None) if spectrum is None else (spectrum[0][0], spectrum[1].state)

    logs = np.linspace(math.log(masses[0]), math.log(masses[1]), scan)
    values, state = [], None
    for x in logs:
        value, state = leading(x, state)
        values.append((value, state))
    found = []
    for k in range(scan - 1):
        (a, start), (b, _) = values[k], values[k + 1]
        if a is None or b is None or (a.real < 0.0) == (b.real < 0.0):
            continue
        low, high = logs[k], logs[k + 1]
        while (
            high - low > 1e-6
        ):  # bisection: one more equilibrium may be missing anywhere in between
            middle = 0.5 * (low + high)
            value, _ = leading(middle, start)
            if value is None:
                break
            low, high = (middle, high) if (value.real < 0.0) == (a.real < 0.0) else (low, middle)
        value, _ = leading(0.5 * (low + high), start)
        if value is not None:
            mass = math.exp(0.5 * (low + high))
            found.append(
                Threshold(
                    mass,
                    design.mass_number(mass, bearing_number),
                    abs(value.imag),
                    "below" if a.real < 0.0 else "above",
                )
            )
    return found
