"""The bearing's eight linearised coefficients: stiffness and damping at the static equilibrium,
against whirl frequency.

The linearised film is s' = A s + D q with the journal's displacement q, its force on the journal B
s + E q. At the complex frequency p (per unit tau) the film states are eliminated exactly,

    F = -Z(p) q,   Z(p) = -E - p G - B (p I - A)^-1 D,   Z(i nu) = K(nu) + i nu C(nu)

(a Schur complement; for the eight coefficients see J. W. Lund, J. Tribology 109, 1987, pp. 37-41).
In a gas film they depend on the frequency, because the gas is compressed. G is the damping of the
asperities, zero where the journal is clear of the wall. A, B, D, E come from the compiled tangent
of the very equations that are integrated in time, so the rotor on Z(p) has the eigenvalues of
:func:`spab_core.linear_theory.whirl.linear_spectrum`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.common.validation import check_number
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import Equilibrium, dense_system, find_equilibrium
from spab_core.linear_theory.whirl import spectrum_of
from spab_core.solver.film import DEFAULT_MESH, Mesh, film_size
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.system import System

WHIRL_RANGE = (0.0, 1000.0)  # whirl frequency over the shaft speed
LEAST_STABLE = "least-stable"  # in place of a whirl ratio: that of the rotor itself
SLOWEST_WHIRL = 1e-6  # likewise; below it nothing oscillates
NAMES = tuple(
    f"{kind}{i}{j}" for kind in "kc" for i in "xy" for j in "xy"
)  # the order of ROSS and of tables here


@dataclass(frozen=True)
class Impedance:
    """The linear bearing at one operating point.

    Attributes
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    system : System
        Without unbalance.
    equilibrium : Equilibrium
        What it is linearised about.
    film, drive, pickup : ndarray
        A (n, n), D (n, 2), B (2, n): per unit tau, lengths over C, forces over p_a R².
    direct, wall_damping : ndarray, (2, 2)
        E and G.
    """

    design: Design
    rotor_mass: float
    bearing_number: float
    system: System
    equilibrium: Equilibrium
    film: np.ndarray
    drive: np.ndarray
    pickup: np.ndarray
    direct: np.ndarray
    wall_damping: np.ndarray

    def at(self, p: complex | float) -> np.ndarray:
        """Z(p) (2, 2) over p_a R² / C at the complex frequency p per unit tau: the force is -Z q."""
        states = np.linalg.solve(p * np.eye(len(self.film)) - self.film, self.drive)
        return -self.direct - p * self.wall_damping - self.pickup @ states

    def _static_damping(self) -> np.ndarray:
        """dZ/dp at p = 0, the damping of a whirl that is infinitely slow."""
        twice = np.linalg.solve(self.film, np.linalg.solve(self.film, self.drive))
        return self.pickup @ twice - self.wall_damping

    def characteristic(self, p: complex) -> complex:
        """Determinant of the rotor on Z(p): zero at the eigenvalues of the whole linearised system.

        The disc is eliminated: it loads the journal with K - K²/(M_1 p² + K) (docs/model.md).
        """
        d = self.design
        mass, share = (
            d.mass_number(self.rotor_mass, self.bearing_number),
            d.rotor.journal_mass_fraction,
        )
        if d.rigid:
            inertia = mass * p * p
        else:
            disc, shaft = (1.0 - share) * mass * p * p, d.shaft_stiffness_number
            inertia = share * mass * p * p + disc * shaft / (disc + shaft)
        return complex(np.linalg.det(self.at(p) + inertia * np.eye(2)))


@dataclass(frozen=True)
class Coefficients:
    """The eight coefficients over a range of whirl frequencies at one shaft speed, or of shaft
    speeds.

    Attributes
    ----------
    speed : ndarray, (n,)
        Shaft speed, rad/s.
    whirl_ratio : ndarray, (n,)
        Whirl frequency over the shaft speed.
    stiffness : ndarray, (n, 2, 2)
        N/m: [[kxx, kxy], [kyx, kyy]], F = -k x - c x'.
    damping : ndarray, (n, 2, 2)
        N s/m, likewise.
    missing : tuple of float
        Shaft speeds in rad/s that were asked for and have no static equilibrium.
    """

    speed: np.ndarray
    whirl_ratio: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    missing: tuple[float, ...] = ()

    @property
    def whirl_frequency(self) -> np.ndarray:
        """rad/s."""
        return self.speed * self.whirl_ratio

    def column(self, name: str) -> np.ndarray:
        """One coefficient by its name in :data:`NAMES`, such as ``kxy``."""
        k = NAMES.index(name)
        return (self.stiffness if k < 4 else self.damping)[:, (k // 2) % 2, k % 2]


@one_thread
def impedance(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = DEFAULT_MESH,
    guess: np.ndarray | None = None,
) -> Impedance | None:
    """Linearise the bearing about its static equilibrium.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing: the load.
    bearing_number : float
    mesh : Mesh
    guess : ndarray, optional
        State to start from, such as that of a neighbouring point.

    Returns
    -------
    Impedance or None
        None where no equilibrium was found.
    """
    system = dense_system(design, rotor_mass, bearing_number, mesh)
    equilibrium = find_equilibrium(system, guess)
    if equilibrium is None and guess is not None:
        equilibrium = find_equilibrium(system)
    if equilibrium is None:
        return None
    rotor, cells, n = system.rotor, system.cells, film_size(system.film)
    journal = n + np.array([0, 1, 4, 5])
    _, jacobian = slope_and_jacobian(system, equilibrium.state, np.concatenate([cells, journal]))
    m, force = len(cells), jacobian[n + 4 : n + 6] / rotor.inverse_mass
    shaft = rotor.coupling_journal / rotor.inverse_mass
    return Impedance(
        design,
        float(rotor_mass),
        float(bearing_number),
        system,
        equilibrium,
        film=jacobian[cells, :m],
        drive=jacobian[cells, m : m + 2],
        pickup=force[:, :m],
        direct=force[:, m : m + 2] + shaft * np.eye(2),
        wall_damping=force[:, m + 2 :],
    )


@one_thread
def coefficients(at: Impedance, whirl_ratios: Sequence[float] | np.ndarray) -> Coefficients:
    """Stiffness and damping at whirl frequencies, given over the shaft speed; 0 is the static limit
    of both.

    Raises
    ------
    DesignError
        For a ratio out of :data:`WHIRL_RANGE`.
    """
    ratios = np.array([check_number("whirl ratio", float(v), *WHIRL_RANGE) for v in whirl_ratios])
    z = np.array([at.at(1j * v) for v in ratios]).reshape(-1, 2, 2)
    damping = np.array(
        [
            at._static_damping() if v == 0.0 else value.imag / v
            for v, value in zip(ratios, z, strict=True)
        ]
    )
    speed, unit = at.design.speed(at.bearing_number), at.design.stiffness_unit
    return Coefficients(
        np.full(len(ratios), speed), ratios, z.real * unit, damping.reshape(-1, 2, 2) * unit / speed
    )


@one_thread
def coefficients_over_speed(
    design: Design,
    rotor_mass: float,
    bearing_numbers: Sequence[float] | np.ndarray,
    whirl: float | str = 1.0,
    mesh: Mesh = DEFAULT_MESH,
) -> Coefficients:
    """Stiffness and damping against shaft speed, rotor mass held.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_numbers : sequence of float
    whirl : float or str
        Whirl ratio of every row (1: synchronous), or :data:`LEAST_STABLE`: at each speed that of
        :func:`least_stable_whirl`, and 1 where nothing oscillates. Those rows give the right limit
        of stability: a whirl that neither grows nor decays feels the coefficients at its own
        frequency and no others.
    mesh : Mesh

    Raises
    ------
    InputError
        For a whirl that is neither, or where no speed has a static equilibrium.
    """
    if whirl != LEAST_STABLE:
        check_number("whirl ratio", whirl, *WHIRL_RANGE)
    parts, missing, guess = [], [], None
    for number in bearing_numbers:
        z = impedance(design, rotor_mass, float(number), mesh, guess)
        if z is None:
            missing.append(design.speed(float(number)))
            continue
        guess = z.equilibrium.state
        root = least_stable_whirl(z) if whirl == LEAST_STABLE else complex(0.0, float(whirl))
        parts.append(coefficients(z, [1.0 if root is None else root.imag]))
    if not parts:
        raise InputError(
            "at none of these speeds does the film carry the load: there is no static equilibrium "
            "to linearise"
        )
    speed, ratio, stiffness, damping = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("speed", "whirl_ratio", "stiffness", "damping")
    )
    return Coefficients(speed, ratio, stiffness, damping, tuple(missing))


def least_stable_whirl(at: Impedance) -> complex | None:
    """The least stable oscillating eigenvalue of rotor and bearing, per unit tau, frequency > 0;
    None where all only decay.
    """
    found = spectrum_of(at.system, at.equilibrium.state)
    whirls = [] if found is None else [v for v in found[0] if v.imag > SLOWEST_WHIRL]
    return complex(whirls[0]) if whirls else None
