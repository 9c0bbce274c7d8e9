"""Published cases of journal bearings on the film that is shipped, beside the published values.

    python benchmarks/published_cases.py

Prints the tables of docs/published_cases.md, which names the sources; the same cases are asserted
in tests/physics/test_published_cases.py."""

import cmath
import math
from typing import NamedTuple

import numpy as np

from spab_core.design.model import reference_design
from spab_core.linear_theory.equilibrium import concentric_state, concentric_stiffness, dense_system
from spab_core.linear_theory.held import held_force, held_state
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.summary import gas_flow
from spab_core.solver.film import (
    Mesh,
    azimuth_derivative,
    film_array,
    film_force,
    film_size,
    thickness,
)
from spab_core.solver.slope import slope_and_jacobian

SLOW = 1e-4  # bearing number at which the gas is all but incompressible
RESTING = 1e-6  # and at which the shaft is all but at rest


class Porous(NamedTuple):
    """A case of openAirBearing: length in m, eccentricity, load in N, gas flow in l/min."""

    length: float
    eccentricity: float
    load: float
    flow: float


ECCENTRICITIES = (0.1, 0.3, 0.5, 0.7)
POROUS = [
    Porous(length, *row)
    for length, loads, flows in (
        (0.025, (26.2234, 83.9238, 157.2607, 249.6441), (6.4797, 6.3845, 6.1500, 5.7203)),
        (0.050, (71.7838, 218.0806, 369.4652, 518.8948), (10.6921, 10.4947, 10.1115, 9.6067)),
    )
    for row in zip(ECCENTRICITIES, loads, flows, strict=True)
]
ROTATING = [  # B/D, eccentricity, Sommerfeld number, angle in degrees
    (1.0, 0.1, 0.1196, 79.410),
    (1.0, 0.5, 0.8903, 56.705),
    (1.0, 0.9, 8.4352, 26.482),
    (0.5, 0.3, 0.1304, 68.493),
    (0.5, 0.8, 1.7339, 32.938),
    (0.25, 0.5, 0.0888, 54.069),
    (0.25, 0.95, 6.9248, 15.632),
    (0.125, 0.9, 0.6776, 21.089),
]
SQUEEZED = [  # B/D, eccentricity (negative: opening), Sommerfeld number
    (1.0, -0.8, 0.6293),
    (1.0, 0.0, 2.4076),
    (1.0, 0.5, 9.7319),
    (1.0, 0.9, 160.25),
    (0.5, 0.6, 6.0649),
    (1.0 / 3.0, 0.8, 15.282),
    (0.125, 0.7, 1.0027),
]
AUSMAN = [  # bearing number, stiffness of L/D 1 along and across
    (1.0, 0.392188, 1.385115),
    (3.45, 2.546630, 2.645113),
    (10.0, 4.640962, 1.828710),
]


def cylinder(ratio):
    """An unfed cylinder of the reference bearing's radius, length over diameter ``ratio``, whose
    wall is tight.
    """
    d = reference_design()
    length = 2.0 * d.bearing.radius * ratio
    return d.replace(
        bearing__shape="cylinder",
        bearing__length=length,
        bearing__permeability=0.0,
        rotor__gravity=0.0,
    )


def sphere(edge):
    """The reference's sphere with edges at ``edge`` degrees, its wall tight."""
    return reference_design().replace(
        bearing__edge_latitude=edge, bearing__permeability=0.0, rotor__gravity=0.0
    )


def porous_design(length):
    """The bearing of openAirBearing's cases."""
    return reference_design().replace(
        bearing__shape="cylinder",
        bearing__length=length,
        bearing__radius=0.025,
        bearing__clearance=15e-6,
        bearing__permeability=2e-15,
        bearing__wall_thickness=4.5e-3,
        bearing__supply_pressure_ratio=5.046385,
    )


def porous(case, mesh):
    """Load in N and gas flow in l/min at ambient pressure, the shaft at rest."""
    design = porous_design(case.length)
    system = dense_system(design, 1.0, RESTING, mesh)
    state = held_state(system, case.eccentricity, 0.0)
    s = film_array(system.film, state)
    load = -design.force_unit * film_force(system.film, s, case.eccentricity, 0.0)[0]
    flow = gas_flow(design, RESTING, system.film, s, case.eccentricity, 0.0)
    return load, 6e4 * flow.wall


def _never_below_ambient(system, x, squeeze=0.0, ring=None):
    """Force of the film that gives way where its pressure would fall below the ambient.

    The steady film under P >= 1 by an active set: where P = 1 the film loses gas, elsewhere its
    slope is zero. ``squeeze``: speed of the journal along +X in clearances per radian, in place of
    the rotation; ``ring``: an azimuth at which P = 1 from the start, the film's beginning.
    """
    film, n = system.film, film_size(system.film)
    state, cells = np.zeros(system.size), np.arange(n)
    state[n] = x
    gap = thickness(film, x, 0.0).ravel()
    state[:n] = gap
    begin = np.zeros((film.latitudes, film.columns), bool)
    if ring is not None:
        begin[:, ring] = True
    active = begin = begin.ravel()
    carried = np.kron(np.eye(film.latitudes), -0.5 * azimuth_derivative(film.columns, 0.0))
    closing = squeeze * np.outer(film.node, film.cos).ravel()
    for step_number in range(200):
        value, jacobian = (a[:n] for a in slope_and_jacobian(system, state, cells))
        if squeeze:
            value, jacobian = value - carried @ state[:n] + closing, jacobian - carried
        before = active
        kept = (value <= 0.0) if step_number == 0 else before & (value <= 0.0)
        active = begin | kept | (~before & (state[:n] < gap))
        free, step = ~active, np.where(active, gap - state[:n], 0.0)
        right = -value[free] - jacobian[np.ix_(free, active)] @ step[active]
        step[free] = np.linalg.solve(jacobian[np.ix_(free, free)], right)
        state[:n] += step
        if (active == before).all() and np.abs(step).max() < 1e-13:
            return film_force(film, film_array(film, state), x, 0.0)
    raise RuntimeError("the active set did not settle")


def rotating(ratio, eccentricity, mesh):
    """Sommerfeld number and attitude angle in degrees of a film that is all but incompressible."""
    system = dense_system(cylinder(ratio), 1.0, SLOW, mesh)
    fx, fy = _never_below_ambient(system, eccentricity, ring=mesh.azimuth // 2)
    return 1.5 * math.hypot(fx, fy) / (SLOW * ratio), math.degrees(math.atan2(fy, -fx))


def squeezed(ratio, eccentricity, mesh):
    """Sommerfeld number of a pure squeeze of the same film."""
    system = dense_system(cylinder(ratio), 1.0, SLOW, mesh)
    fx, _ = _never_below_ambient(system, eccentricity, squeeze=SLOW)
    return 1.5 * -fx / (SLOW * ratio * SLOW)


def endless_speed(shape, eccentricity, mesh=None):
    """Load over p_a R² for Λ to infinity, from Λ = 1e3 and 1e4; edges at 30°, or L/D 1."""
    design = sphere(30.0) if shape == "sphere" else cylinder(1.0)
    mesh = mesh or Mesh(16, 32)
    loads = [-held_force(design, number, eccentricity, mesh=mesh)[0] for number in (1e3, 1e4)]
    share = math.sqrt(0.1)  # what the edges take goes as 1/√Λ
    return (loads[1] - share * loads[0]) / (1.0 - share)


def endless_speed_exact(shape, eccentricity):
    """The same by Elrod and Burgdorfer's PH, constant along the edges and carried round."""
    e, root = eccentricity, math.sqrt(1.0 - eccentricity**2)
    if shape == "cylinder":  # L/D 1: p_a L D is 4 p_a R²
        return 4.0 * math.pi / e * math.sqrt(1.0 + 1.5 * e * e) * (1.0 / root - 1.0)
    edge = math.radians(30.0)
    carried = math.sqrt(1.0 + 1.5 * (e * math.cos(edge)) ** 2)
    sine = math.sin(edge)
    return 4.0 * math.pi * carried / e * (math.asinh(e * sine / root) / e - sine)


def ausman(bearing_number):
    """Ausman's stiffness of L/D 1 over p_a R² per clearance, along + i across."""
    if bearing_number == 0.0:
        return 0j
    number = 1j * bearing_number
    q = cmath.sqrt(1.0 + number)
    return 2.0 * math.pi * number / (1.0 + number) * (1.0 - cmath.tanh(q) / q)


def small_eccentricity(bearing_number, whirl, mesh):
    """The same of the shipped film: of a forward circular whirl at ``whirl`` times the speed."""
    design = cylinder(1.0)
    if not whirl:
        return complex(*concentric_stiffness(design, bearing_number, mesh))
    z = impedance(
        design,
        1.0,
        bearing_number,
        mesh,
        concentric_state(dense_system(design, 1.0, bearing_number, mesh)),
    )
    forward = z.at(-1j * whirl) @ np.array([1.0, 1j])  # x + i y turns as exp(i nu tau)
    return complex(forward[0])


def narrow(shape, eccentricity, edge):
    """Load over DuBois and Ocvirk's, and its angle to the displacement in degrees; half the width
    is ``edge`` degrees.
    """
    width = math.radians(edge)
    number = 1e-2
    design = sphere(edge) if shape == "sphere" else cylinder(width)
    radial, across = held_force(design, number, eccentricity, mesh=Mesh(3, 64))
    published = 2.0 * math.pi / 3.0 * number * width**3
    published *= eccentricity / (1.0 - eccentricity**2) ** 1.5
    return math.hypot(radial, across) / published, math.degrees(math.atan2(across, -radial))


def table(head, rows):
    """Print a table of Markdown."""
    print("\n| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(row) + " |", flush=True)


def percent(found, published):
    """Deviation as text."""
    return f"{100.0 * (found / published - 1.0):+.3f} %"


def main():
    rows = []
    for case in POROUS:
        load, flow = porous(case, Mesh(8, 32))
        rows.append(
            (
                f"{1e3 * case.length:g} mm",
                f"{case.eccentricity}",
                f"{case.load:.4f}",
                f"{load:.4f}",
                percent(load, case.load),
                f"{case.flow:.4f}",
                f"{flow:.4f}",
                percent(flow, case.flow),
            )
        )
    table(("L", "ε", "load, N", "ours", "", "flow, l/min", "ours", ""), rows)
    rows = []
    for ratio, eccentricity, sommerfeld, angle in ROTATING:
        found, at = rotating(ratio, eccentricity, Mesh(5, 96))
        shown = (f"{ratio:g}", f"{eccentricity}", f"{sommerfeld}", f"{found:.4f}")
        rows.append((*shown, percent(found, sommerfeld), f"{angle:.3f}", f"{at:.3f}"))
    table(("B/D", "ε", "So", "ours", "", "angle, °", "ours"), rows)
    rows = []
    for ratio, eccentricity, sommerfeld in SQUEEZED:
        found = squeezed(ratio, eccentricity, Mesh(5, 96))
        shown = (f"{ratio:.4g}", f"{eccentricity}", f"{sommerfeld}", f"{found:.4f}")
        rows.append((*shown, percent(found, sommerfeld)))
    table(("B/D", "ε", "So", "ours", ""), rows)
    rows = []
    for shape in ("sphere", "cylinder"):
        for eccentricity in (0.3, 0.6, 0.9):
            found, exact = (f(shape, eccentricity) for f in (endless_speed, endless_speed_exact))
            shown = ("30°" if shape == "sphere" else "L/D 1", f"{eccentricity}")
            rows.append((*shown, f"{exact:.5f}", f"{found:.5f}", percent(found, exact)))
    table(("band", "ε", "W/(p_a R²)", "ours", ""), rows)
    rows = []
    for number, *_ in AUSMAN:
        for whirl in (0.0, 0.2, 1.0):
            exact, found = (
                ausman(number * (1.0 - 2.0 * whirl)),
                small_eccentricity(number, whirl, Mesh(4, 16)),
            )
            shown = (f"{k.real:.6f}, {k.imag:.6f}" for k in (exact, found))
            rows.append((f"{number:g}", f"{whirl:g}", *shown, f"{abs(found / exact - 1.0):.1e}"))
    table(("Λ", "whirl", "K along, across", "ours, 4 x 16", "deviation"), rows)
    rows = []
    for shape in ("sphere", "cylinder"):
        for eccentricity in (0.1, 0.5, 0.9, 0.95):
            load, angle = narrow(shape, eccentricity, 1.0)
            rows.append((shape, f"{eccentricity}", percent(load, 1.0), f"{angle:.2f}"))
    table(("shape", "ε", "load", "angle, °"), rows)


if __name__ == "__main__":
    main()
