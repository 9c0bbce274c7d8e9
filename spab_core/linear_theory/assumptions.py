"""What the theory assumes, in numbers at an operating point: each value beside the limit up to
which the theory holds, and where that limit comes from.

The gas is taken as air at 20 °C where its kind matters, and as dense as at the larger of ambient
and supply pressure."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from spab_core.design.model import Design

AIR_CONSTANT = 287.05  # of dry air, J/(kg K)
TEMPERATURE = 293.15  # K
HEAT_RATIO = 1.4
# cells of the wall resolve a wave up to this nu sigma_w (benchmarks/wall.py)
RESOLVED = 4e4
USUAL_POROSITY = 0.15  # of porous carbon, for a wall whose porosity is not given
# the quasi-steady flow is late by nu sigma_w / 3: a sixth of a radian at half the speed
QUASI_STEADY = 1.0


@dataclass(frozen=True)
class Assumption:
    """A number that the theory wants small.

    Attributes
    ----------
    name : str
        Of the number.
    value, limit : float
        The theory holds up to the limit.
    source : str
        What the limit says and where it comes from, as a clause.
    broken : str
        What it means where it is exceeded, as a clause.
    watched : bool
        Whether a point beyond the limit is to be watched for that.
    """

    name: str
    value: float
    limit: float
    source: str
    broken: str
    watched: bool = True

    @property
    def holds(self) -> bool:
        """Whether the value is within the limit."""
        return self.value <= self.limit

    def record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "name": self.name,
            "value": self.value,
            "limit": self.limit,
            "holds": self.holds,
            "source": self.source,
        }

    @property
    def words(self) -> str:
        """Value, limit and meaning in a clause."""
        value = float(f"{self.value:.3g}")  # 1,410, not 1.41e+03
        told = f"{value:,.0f}" if 1e3 <= value < 1e9 else f"{value:.3g}"
        return f"{self.name} is {told}, limit {self.limit:.3g}: {self.broken}"


def mean_free_path(design: Design) -> float:
    """Mean free path of air at ambient pressure, m: mu/p_a (pi R_s T / 2)^1/2 (kinetic theory)."""
    gas = design.gas
    speed = math.sqrt(0.5 * math.pi * AIR_CONSTANT * TEMPERATURE)
    return gas.viscosity / gas.ambient_pressure * speed


def assumptions(
    design: Design, bearing_number: float, least_film: float | None = None
) -> tuple[Assumption, ...]:
    """What the theory assumes of a design at a speed.

    Parameters
    ----------
    design : Design
    bearing_number : float
    least_film : float, optional
        m; left out, the radial clearance.
    """
    b, gas = design.bearing, design.gas
    surface = design.speed(bearing_number) * b.radius
    largest = gas.ambient_pressure * max(b.supply_pressure_ratio, 1.0)
    density = largest / (AIR_CONSTANT * TEMPERATURE)
    film = b.clearance if least_film is None else least_film
    found = [
        Assumption(
            "Knudsen number at the least film",
            mean_free_path(design) / film,
            0.01,
            "slip adds 6 Kn to the film's flow: 6 % (Burgdorfer, J. Basic Eng. 81, 1959, 94)",
            "gas slips at the walls, the film carries less than computed",
        ),
        Assumption(
            "Reynolds number of the film",
            density * surface * b.clearance / gas.viscosity,
            41.1 * math.sqrt(b.radius / b.clearance),
            "Taylor vortices from Re (C/R)^1/2 = 41.1 on (Taylor, Phil. Trans. A 223, 1923, 289)",
            "the film's flow is not laminar",
        ),
        Assumption(
            "Mach number of the surface",
            surface / math.sqrt(HEAT_RATIO * AIR_CONSTANT * TEMPERATURE),
            0.5,
            "friction heats the gas by 0.14 Ma² of its temperature at most: 3.5 % (Couette flow; "
            "Schlichting, Boundary-Layer Theory)",
            "the film is not isothermal",
        ),
    ]
    if b.feeding_number > 0.0:
        found.append(_storage(design, bearing_number))
        found.append(
            Assumption(
                "wall thickness over radius",
                b.wall_thickness / b.radius,
                0.2,
                "the resistance of a spherical shell differs from that of the theory's flat wall "
                "by this share",
                "the wall is not thin",
            )
        )
    found.append(
        Assumption(
            "clearance over radius",
            b.clearance / b.radius,
            0.01,
            "the thin-film equation leaves out terms of this size (Elrod, Q. Appl. Math. 17, 1960, "
            "349)",
            "the film is not thin",
        )
    )
    return tuple(found)


def _storage(design: Design, bearing_number: float) -> Assumption:
    """Whether gas in the pores is taken into account, and resolved."""
    if design.bearing.stores_gas:
        return Assumption(
            "storage number of the wall, sigma_w",
            design.sigma_wall(bearing_number),
            RESOLVED,
            "the wall's cells follow waves up to this number times the whirl ratio to 0.5 % "
            "(docs/numerics.md)",
            "waves in the wall are shorter than its cells",
        )
    usual = design.replace(bearing__porosity=USUAL_POROSITY)
    fed = design.bearing.supply_pressure_ratio > 1.0
    return Assumption(
        f"storage number of the wall at a porosity of {USUAL_POROSITY:g}",
        usual.sigma_wall(bearing_number),
        QUASI_STEADY,
        "up to here the pores' gas follows half-speed whirl at once, within a sixth of a radian "
        "(docs/model.md)",
        "at porosity 0 the gas that the wall stores is left out, which takes damping"
        + ", and a fed bearing may then be unstable (pneumatic hammer)" * fed
        + ": give the porosity",
        watched=fed,
    )
