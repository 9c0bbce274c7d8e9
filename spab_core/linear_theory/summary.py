"""What a design means at one operating point: dimensionless groups, static equilibrium, gas flow,
stiffness, damping, whirl.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from spab_core.common.threads import one_thread
from spab_core.design.form import grade_of_eccentricity
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.linear_theory.coefficients import Coefficients, coefficients
from spab_core.linear_theory.equilibrium import LIFTED, contact_load_share
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.modes import Mode, lightly_damped, rotor_modes
from spab_core.solver.film import AUTO, Film, Mesh, film_array, film_fluxes, gas_content

NO_EQUILIBRIUM = "no static equilibrium: the film does not carry this rotor at this speed"
# of dry air at 20 °C, whose mass flow is told: J/(kg K) and K
AIR_CONSTANT = 287.05
TEMPERATURE = 293.15
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
        Litres a minute at 0 °C and 1.01325 bar.
    """

    wall: float
    edges: float
    mass: float
    normal_litres: float


@dataclass(frozen=True)
class Whirl:
    """The least stable whirl of the linearised system about the static equilibrium.

    Attributes
    ----------
    ratio : float
        Frequency over the shaft speed.
    speed_rpm : float
        Frequency in whirls a minute.
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
        deg, from the load to the journal's displacement, positive with the rotation.
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

    def record(self) -> dict[str, Any]:
        """The answer as plain values, named with their units; the keys are those of ``spab design
        show --json``.
        """
        flow, whirl, c = self.gas_flow, self.whirl, self.coefficients
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
        }

    def verdict(self) -> str:
        """Return what the rotor does at rest on its film, without unbalance, in a sentence."""
        if self.status != "ok":
            return f"{self.status[0].upper()}{self.status[1:]}."
        if self.lies_on_wall:
            return f"{self.lift_words().capitalize()}."
        if self.whirl is None:
            return "Stable at rest: every disturbance dies away without whirling."
        rpm, growth = self.whirl.speed_rpm, abs(self.whirl.growth)
        if self.whirl.stable:
            return (
                f"Stable at rest: the least stable whirl, {rpm:,.0f} a minute, decays by "
                f"{growth:.3g} per revolution."
            )
        return (
            f"Unstable at rest: a whirl of {rpm:,.0f} a minute grows by {growth:.3g} per "
            "revolution."
        )

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
    discrete film, integrated.

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
def derive(design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO) -> Derived:
    """Everything derived at an operating point.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    mesh : Mesh

    Raises
    ------
    InputError
        For an operating point out of range or a mesh too fine for dense linear algebra.
    """
    check_point(rotor_mass, bearing_number)
    speed, rotor = design.speed(bearing_number), design.rotor
    rpm = design.speed_rpm(bearing_number)
    found = Derived(
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
    z = impedance(design, rotor_mass, bearing_number, mesh)
    if z is None:
        return found
    film, rest = z.system.film, z.equilibrium
    modes = rotor_modes(z.system, rest.state)
    leading = modes[0] if modes else None
    x, y = (float(v) for v in rest.state[-8:-6])
    return dataclasses.replace(
        found,
        status="ok",
        eccentricity=rest.eccentricity,
        attitude_angle=rest.attitude_angle,
        least_film=design.bearing.clearance * (1.0 - rest.eccentricity),
        contact_load_share=contact_load_share(design, rotor_mass, rest.eccentricity),
        gas_flow=gas_flow(design, bearing_number, film, film_array(film, rest.state), x, y),
        coefficients=coefficients(z, [0.0, 1.0]),
        whirl=Whirl(leading.ratio, leading.ratio * rpm, leading.growth) if leading else None,
        modes=lightly_damped(modes),
    )
