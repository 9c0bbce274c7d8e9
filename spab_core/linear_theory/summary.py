"""What a design means at one operating point: dimensionless groups, static equilibrium, gas flow,
stiffness, damping, whirl.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.threads import one_thread
from spab_core.common.words import capital
from spab_core.design.form import grade_of_eccentricity
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.linear_theory.assumptions import (
    AIR_CONSTANT,
    TEMPERATURE,
    Assumption,
    assumptions,
)
from spab_core.linear_theory.coefficients import Coefficients, coefficients
from spab_core.linear_theory.conical import conical_modes
from spab_core.linear_theory.equilibrium import (
    LIFTED,
    AxialStopError,
    axial_position,
    axial_stiffness,
    find_equilibrium,
    resting_system,
)
from spab_core.linear_theory.impedance import Impedance, impedance
from spab_core.linear_theory.modes import (
    AXIAL_MODE,
    Mode,
    axial_drift,
    lightly_damped,
    rotor_modes,
)
from spab_core.solver.film import (
    AUTO,
    AZIMUTHS,
    Film,
    Mesh,
    film_array,
    film_fluxes,
    film_size,
    gas_array,
    gas_content,
    gas_size,
    pore_content,
    suitable_mesh,
)
from spab_core.solver.system import System

NO_EQUILIBRIUM = "no static equilibrium: the film does not carry this rotor at this speed"
# share of its damping that a whirl loses to the pores' gas before that is told
LESS_DAMPED = 0.02
# least film over C for which the azimuths of a run are enough: eigenvalues to 1e-8
# (tests/physics/test_derived.py)
THICK = 0.7
# of normal litres, as in DIN 1343: Pa and K
NORMAL_PRESSURE = 101325.0
NORMAL_TEMPERATURE = 273.15


@dataclass(frozen=True)
class GasFlow:
    """Gas through the porous wall, whole band, net of what flows back.

    Attributes
    ----------
    wall, edges : float
        m³/s at ambient pressure, into the film through the wall and out of both open edges; equal
        in a steady film.
    mass : float
        kg/s of air at 20 °C.
    normal_litres : float
        Normal litres per minute at 0 °C and 1.01325 bar.
    """

    wall: float
    edges: float
    mass: float
    normal_litres: float

    @property
    def words(self) -> str:
        """Normal litres per minute as they are told: below a hundredth there is no flow."""
        return f"{self.normal_litres:.3g}" if abs(self.normal_litres) >= 0.01 else "0"


@dataclass(frozen=True)
class Whirl:
    """The least stable whirl of the linearised system about the static equilibrium.

    Attributes
    ----------
    ratio : float
        Frequency over the shaft speed.
    speed_rpm : float
        Frequency in cycles per minute.
    growth : float
        Growth rate, natural logarithm per revolution; negative: the rotor at rest on its film is
        stable.
    """

    ratio: float
    speed_rpm: float
    growth: float

    @property
    def stable(self) -> bool:
        """Whether it decays."""
        return self.growth < 0.0


def grows_words(name: str, whirl: Whirl) -> str:
    """Say that one of a family (:attr:`Derived.families`) grows, as a clause."""
    if not whirl.ratio and not whirl.growth:
        return "the film does not hold the journal along the axis"
    if not whirl.ratio:
        return (
            f"a drift of the journal, not held by its film, grows by {whirl.growth:.3g} per "
            "revolution"
        )
    article = "an" if name[0] in "aeiou" else "a"
    return (
        f"{article} {name} at {whirl.speed_rpm:,.0f} cycles/min grows by {whirl.growth:.3g} per "
        "revolution"
    )


@dataclass(frozen=True)
class Derived:
    """Everything derived at an operating point.

    Attributes
    ----------
    rotor_mass : float
        kg on one bearing.
    speed, speed_rpm : float
        Shaft speed in rad/s and rpm.
    bearing_number, mass_number, shaft_stiffness_number, feeding_number, load_number,
    unbalance_number : float
        Λ, M, K, β, W, ρ (docs/model.md); K is inf for a rigid rotor.
    supply_pressure : float
        Pa, absolute.
    balance_grade : float
        G = e_per ω in mm/s at this speed, of the whole rotor (ISO 21940-11).
    status : str
        ``ok``, or why what follows is None.
    eccentricity : float or None
        Static, over C.
    attitude_angle : float or None
        deg, from the load to the journal's displacement, positive with the rotation; None without
        a load.
    least_film : float or None
        C (1 - e), the thinnest film at rest on the film, m.
    contact_load_share : float or None
        Share of the weight that the asperities carry at rest.
    gas_flow : GasFlow or None
    coefficients : Coefficients or None
        Row 0: static (whirl ratio 0); row 1: synchronous (whirl ratio 1). N/m and N s/m.
    whirl : Whirl or None
        None too where nothing oscillates.
    modes : tuple of Mode
        Lightly damped vibrations, the least damped first.
    axial_offset : float
        Static axial displacement over C, along +z; 0 without an axial load.
    held : tuple or None
        Design and radial position over C, of which :attr:`axial_stiffness` is; None of a cylinder.
    axial : Whirl or None
        Where the journal moves along the axis: its least stable vibration along it, or a drift that
        does not oscillate, of ratio 0; None where it is held.
    axial_modes : tuple of Mode
        Of these vibrations, as ``modes``.
    conical : Whirl or None
        The least stable whirl of the family that tilts
        (:mod:`spab_core.linear_theory.conical`); None for a design without inertias.
    conical_modes : tuple of Mode
        Of that family, as ``modes``.
    assumptions : tuple of Assumption
        What the theory assumes, in numbers.
    sigma_wall : float
        Storage number of the wall; 0 where it stores no gas (docs/model.md).
    pore_gas_ratio : float or None
        Gas in the pores over that in the film.
    penetration_depth : float or None
        Depth in the wall at which a pressure wave of the whirl's frequency is down to 1/e, m; at
        half the speed where nothing whirls. None where the wall stores no gas.
    quiet : tuple or None
        System and state at rest were the wall quasi-steady, of which :attr:`quiet_growth` is; None
        where it is.
    """

    rotor_mass: float
    speed: float
    speed_rpm: float
    bearing_number: float
    mass_number: float
    shaft_stiffness_number: float
    feeding_number: float
    load_number: float
    unbalance_number: float
    supply_pressure: float
    balance_grade: float
    status: str
    eccentricity: float | None = None
    attitude_angle: float | None = None
    least_film: float | None = None
    contact_load_share: float | None = None
    gas_flow: GasFlow | None = None
    coefficients: Coefficients | None = None
    whirl: Whirl | None = None
    modes: tuple[Mode, ...] = ()
    axial_offset: float = 0.0
    held: tuple[Design, float, float] | None = None
    axial: Whirl | None = None
    axial_modes: tuple[Mode, ...] = ()
    conical: Whirl | None = None
    conical_modes: tuple[Mode, ...] = ()
    assumptions: tuple[Assumption, ...] = ()
    sigma_wall: float = 0.0
    pore_gas_ratio: float | None = None
    penetration_depth: float | None = None
    quiet: tuple[System, np.ndarray] | None = None

    @functools.cached_property
    def axial_stiffness(self) -> float | None:
        """N/m, static, the journal held radially where it rests; None of a cylinder, which has
        none, and where no steady film was found. Solved when asked for, as it takes long.
        """
        if self.held is None:
            return None
        design, x, y = self.held
        try:
            found = axial_stiffness(design, self.bearing_number, x, y, self.axial_offset)
        except InputError:
            return None
        return found * design.stiffness_unit

    @functools.cached_property
    @one_thread
    def quiet_growth(self) -> float | None:
        """What :attr:`whirl` would grow by, were the wall quasi-steady; None where it is, or where
        nothing would oscillate. Solved when asked for.
        """
        if self.quiet is None:
            return None
        swinging = [m.growth for m in rotor_modes(*self.quiet) if -m.root.real < m.root.imag]
        return max(swinging, default=None)

    @property
    def leading(self) -> tuple[str, Whirl] | None:
        """The least stable of all families and what to call it: a whirl, a conical whirl, an axial
        vibration or a drift.
        """
        found = [(name, whirl) for name, whirl in self.families if whirl]
        return max(found, key=lambda item: item[1].growth, default=None)

    @property
    def families(self) -> tuple[tuple[str, Whirl | None], ...]:
        """The least stable of each family, by what to call it."""
        along = AXIAL_MODE if self.axial is None or self.axial.ratio else "drift"
        return (("whirl", self.whirl), ("conical whirl", self.conical), (along, self.axial))

    def record(self) -> dict[str, Any]:
        """The answer as plain values, named with their units; the keys are those of ``spab design
        show --json``.
        """
        flow, whirl, c = self.gas_flow, self.whirl, self.coefficients
        conical = self.conical
        rigid = math.isinf(self.shaft_stiffness_number)
        return {
            "rotor_mass_kg": self.rotor_mass,
            "speed_rad_s": self.speed,
            "speed_rpm": self.speed_rpm,
            "bearing_number": self.bearing_number,
            "mass_number": self.mass_number,
            "shaft_stiffness_number": None if rigid else self.shaft_stiffness_number,
            "rigid": rigid,
            "feeding_number": self.feeding_number,
            "load_number": self.load_number,
            "unbalance_number": self.unbalance_number,
            "supply_pressure_pa": self.supply_pressure,
            "balance_grade_mm_s": self.balance_grade,
            "status": self.status,
            "eccentricity": self.eccentricity,
            "attitude_angle_deg": self.attitude_angle,
            "least_film_m": self.least_film,
            "contact_load_share": self.contact_load_share,
            "gas_mass_flow_kg_s": flow.mass if flow else None,
            "gas_flow_normal_l_min": flow.normal_litres if flow else None,
            "stiffness_static_n_m": c.stiffness[0].tolist() if c else None,
            "damping_static_n_s_m": c.damping[0].tolist() if c else None,
            "stiffness_synchronous_n_m": c.stiffness[1].tolist() if c else None,
            "damping_synchronous_n_s_m": c.damping[1].tolist() if c else None,
            "whirl_ratio": whirl.ratio if whirl else None,
            "whirl_rpm": whirl.speed_rpm if whirl else None,
            "whirl_growth_per_revolution": whirl.growth if whirl else None,
            "modes": [mode.record() for mode in self.modes],
            "axial_offset": self.axial_offset,
            "axial_stiffness_n_per_m": self.axial_stiffness,
            "sigma_wall": self.sigma_wall,
            "pore_gas_over_film_gas": self.pore_gas_ratio,
            "penetration_depth_m": self.penetration_depth,
            "whirl_growth_quasi_steady_per_revolution": self.quiet_growth,
            "assumptions": [one.record() for one in self.assumptions],
            **self._axial_record(),
        } | (
            {
                "conical_whirl_ratio": conical.ratio,
                "conical_whirl_rpm": conical.speed_rpm,
                "conical_whirl_growth_per_revolution": conical.growth,
                "conical_modes": [mode.record() for mode in self.conical_modes],
            }
            if conical
            else {}
        )

    def _axial_record(self) -> dict[str, Any]:
        if self.axial is None:
            return {}
        return {
            "axial_ratio": self.axial.ratio,
            "axial_rpm": self.axial.speed_rpm,
            "axial_growth_per_revolution": self.axial.growth,
            "axial_modes": [mode.record() for mode in self.axial_modes],
        }

    def verdict(self) -> str:
        """Return what the rotor does at rest on its film, without unbalance, and which assumptions
        of that do not hold.
        """
        return " ".join([self._rest_words(), *filter(None, [self.wall_words()]), *self.broken()])

    def broken(self) -> list[str]:
        """Return a sentence for each assumption that does not hold."""
        return [f"Outside the theory: {one.words}." for one in self.assumptions if not one.holds]

    def wall_words(self) -> str:
        """Return a sentence where a quasi-steady wall would have been on the unsafe side."""
        if self.whirl is None or self.quiet_growth is None:
            return ""
        quiet, found = self.quiet_growth, self.whirl.growth
        if quiet < 0.0 <= found:
            return (
                "Taken as quasi-steady the wall would have made it look stable, the unsafe side: "
                "the pores' gas drives this whirl (pneumatic hammer)."
            )
        if quiet < (1.0 + LESS_DAMPED) * found < 0.0:
            return (
                f"Taken as quasi-steady the wall would have damped it by {-quiet:.3g} per "
                "revolution, the unsafe side: the pores' gas takes damping."
            )
        return ""

    def _rest_words(self) -> str:
        if self.status != "ok":
            return f"{capital(self.status)}."
        if self.lies_on_wall:
            return f"{self.lift_words().capitalize()}."
        if self.leading is None:
            return "Stable at rest: every disturbance dies away without whirling."
        name, whirl = self.leading
        rpm, growth = whirl.speed_rpm, abs(whirl.growth)
        if whirl.stable:
            return (
                f"Stable at rest: the least stable {name}, at {rpm:,.0f} cycles/min, decays by "
                f"{growth:.3g} per revolution."
            )
        return f"Unstable at rest: {grows_words(name, whirl)}."

    @property
    def lies_on_wall(self) -> bool:
        """Whether the asperities carry more than :data:`LIFTED` of the weight."""
        return (self.contact_load_share or 0.0) > LIFTED

    def lift_words(self) -> str:
        """Return how much of the weight lies on the wall, as a clause."""
        share = 100.0 * (self.contact_load_share or 0.0)
        begin = "not lifted off" if self.lies_on_wall else "lifted off"
        return f"{begin}: the wall carries {share:.0f} % of the weight"


def gas_flow(
    design: Design, bearing_number: float, film: Film, s: np.ndarray, x: float, y: float
) -> GasFlow:
    """Gas that the wall feeds and the edges lose: the Darcy source and the edge flux of the
    discrete film, integrated; a wall that stores gas as steady flow leaves it.

    Parameters
    ----------
    design : Design
    bearing_number : float
    film : Film
    s : ndarray, (N, M)
        S = P H.
    x, y : float
        Journal over C.

    Notes
    -----
    The film holds the mass rho_a C R² ∫ S dΩ, with rho_a the density at ambient pressure; both
    halves of the band count."""
    b, flux = design.bearing, film_fluxes(film, s, x, y)
    unit = 2.0 * b.clearance * b.radius**2 * design.speed(bearing_number)
    wall = unit * gas_content(film, flux["wall"])
    edges = -unit * float(flux["edge"].sum()) * 2.0 * math.pi / film.columns
    pressure = design.gas.ambient_pressure
    normal = wall * pressure / NORMAL_PRESSURE * NORMAL_TEMPERATURE / TEMPERATURE
    return GasFlow(wall, edges, wall * pressure / (AIR_CONSTANT * TEMPERATURE), 6e4 * normal)


@one_thread
def derive(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    mesh: Mesh = AUTO,
    at: Impedance | None = None,
) -> Derived:
    """Everything derived at an operating point.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    mesh : Mesh
        Left out: of 16 azimuths where the least film at rest is at least :data:`THICK` times the
        clearance, of 32 where it is less.
    at : Impedance, optional
        The bearing linearised there, where it is known.

    Raises
    ------
    InputError
        For an operating point out of range or a mesh too fine for dense linear algebra.
    """
    check_point(rotor_mass, bearing_number)
    speed, rotor = design.speed(bearing_number), design.rotor
    rpm = design.speed_rpm(bearing_number)
    b = design.bearing
    found = Derived(
        assumptions=assumptions(design, bearing_number),
        sigma_wall=design.sigma_wall(bearing_number),
        rotor_mass=float(rotor_mass),
        speed=speed,
        speed_rpm=rpm,
        bearing_number=float(bearing_number),
        mass_number=design.mass_number(rotor_mass, bearing_number),
        shaft_stiffness_number=design.shaft_stiffness_number,
        feeding_number=design.feeding_number,
        load_number=design.load_number(rotor_mass),
        unbalance_number=design.unbalance_number,
        supply_pressure=design.bearing.supply_pressure_ratio * design.gas.ambient_pressure,
        balance_grade=grade_of_eccentricity(
            rotor.unbalance_eccentricity, rpm, rotor.journal_mass_fraction
        ),
        status=NO_EQUILIBRIUM,
    )
    z = at or _linearised(design, rotor_mass, bearing_number, mesh)
    if z is None:
        try:
            axial_position(design, rotor_mass, bearing_number)
        except AxialStopError as error:
            return dataclasses.replace(found, status=str(error))
        return found
    film, rest = z.system.film, z.equilibrium
    system, free = z.system, rest
    if rotor.axial_motion:
        system = resting_system(design, rotor_mass, bearing_number, system.mesh)
        loose = find_equilibrium(system)
        if loose is None:
            return found
        free = loose
    every = rotor_modes(system, free.state)
    modes = [mode for mode in every if mode.name != AXIAL_MODE]
    along = [mode for mode in every if mode.name == AXIAL_MODE]
    axial = _whirl(along, rpm)
    drift = axial_drift(system, free.state) if rotor.axial_motion else None
    if drift is not None and (axial is None or drift > axial.growth):
        axial = Whirl(0.0, 0.0, drift)
    least_film, conical = b.clearance * rest.gap, conical_modes(z)
    x, y = (float(v) for v in rest.state[-8:-6])
    found = dataclasses.replace(
        found,
        status="ok",
        eccentricity=rest.eccentricity,
        attitude_angle=rest.attitude_angle if design.rotor.gravity else None,
        least_film=least_film,
        contact_load_share=z.contact_load_share,
        gas_flow=gas_flow(design, bearing_number, film, film_array(film, rest.state), x, y),
        coefficients=coefficients(z, [0.0, 1.0]),
        whirl=_whirl(modes, rpm),
        modes=lightly_damped(modes),
        axial_offset=film.offset,
        held=None if b.cylindrical else (design, x, y),
        axial=axial,
        axial_modes=lightly_damped(along),
        conical=_whirl(conical, rpm),
        conical_modes=lightly_damped(conical),
        assumptions=assumptions(design, bearing_number, least_film),
    )
    return _with_wall(found, z) if film.depth else found


def _linearised(
    design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh
) -> Impedance | None:
    """Linearise the bearing: on fewer azimuths where none is asked for and the film is thick."""
    if mesh == AUTO:
        few = impedance(design, rotor_mass, bearing_number, suitable_mesh(design, AZIMUTHS))
        if few and few.equilibrium.gap >= THICK:
            return few
    return impedance(design, rotor_mass, bearing_number, mesh)


def _whirl(modes: list[Mode], speed_rpm: float) -> Whirl | None:
    """The least stable of modes in that order."""
    return Whirl(modes[0].ratio, modes[0].ratio * speed_rpm, modes[0].growth) if modes else None


def _with_wall(found: Derived, at: Impedance) -> Derived:
    """Add what is told of a wall that stores gas."""
    film, state = at.system.film, at.equilibrium.state
    ratio = found.whirl.ratio if found.whirl else 0.5
    gas = gas_array(film, state)
    pressure = float(film.area @ gas[1].mean(axis=1) / film.area.sum())
    wave = ratio * found.sigma_wall / (2.0 * pressure)
    rest = np.delete(state, np.s_[film_size(film) : gas_size(film)])
    return dataclasses.replace(
        found,
        pore_gas_ratio=pore_content(film, gas[1:]) / gas_content(film, gas[0]),
        penetration_depth=at.design.bearing.wall_thickness / max(math.sqrt(wave), 1.0),
        quiet=(at.system.without_storage(), rest),
    )
