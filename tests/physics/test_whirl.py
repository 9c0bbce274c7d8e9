"""Half-speed whirl: onset exactly at M = 4 K_0 for a rigid, balanced, unloaded, fed rotor
(docs/model.md).
"""

import math

import numpy as np
import pytest

from spab_core.linear_theory.equilibrium import concentric_stiffness, static_equilibrium
from spab_core.linear_theory.whirl import linear_spectrum, whirl_thresholds
from spab_core.solver.film import Mesh, build_film, film_array, film_force
from spab_core.solver.rotor import build_rotor, contact_force
from spab_core.trajectory.lyapunov import exponent
from tests.conftest import Run, fed_design

MESH = Mesh(3, 16)
BEARING_NUMBER = 3.45
RIGID = {
    "rotor__shaft_stiffness": math.inf,
    "rotor__unbalance_eccentricity": 0.0,
    "rotor__gravity": 0.0,
}


@pytest.fixture(scope="module")
def rotor():
    return fed_design(29, 5, 1, **RIGID)


@pytest.fixture(scope="module")
def critical_mass(rotor):
    """4 K_0 of the same mesh, in kg at BEARING_NUMBER; K_0 = K_xx as the speed goes to zero."""
    k0 = concentric_stiffness(rotor, 1e-2, MESH)[0]
    return 4.0 * k0 / rotor.mass_number(1.0, BEARING_NUMBER)


def test_eigenvalue_threshold(rotor, critical_mass):
    found = whirl_thresholds(
        rotor, BEARING_NUMBER, MESH, masses=(0.5 * critical_mass, 2.0 * critical_mass), scan=4
    )
    assert len(found) == 1
    assert found[0].critical_mass == pytest.approx(critical_mass, rel=0.005)
    assert found[0].whirl_ratio == pytest.approx(0.5, abs=0.005)
    assert found[0].stable_side == "below"


def test_static_equilibrium_carries_the_load(design):
    """Film, contact and weight balance; the journal sinks and is carried along with the rotation
    (attitude angle > 0).
    """
    mass, bearing_number = 10.0, 2.0
    rest = static_equilibrium(design, mass, bearing_number, MESH)
    film = build_film(design, bearing_number, MESH)
    x, y = rest.state[-8:-6]
    fx, fy = film_force(film, film_array(film, rest.state), x, y)
    cx, cy = contact_force(build_rotor(design, mass, bearing_number), x, y, 0.0, 0.0)
    assert fx + cx == pytest.approx(0.0, abs=1e-9)
    assert fy + cy == pytest.approx(design.load_number(mass), abs=1e-9)
    assert 0.0 < rest.attitude_angle < 90.0 and rest.eccentricity == pytest.approx(math.hypot(x, y))
    # the disc hangs below the journal by the shaft's deflection, (1 - mu_j) W / K
    assert rest.state[-7] - rest.state[-5] == pytest.approx(
        0.8 * design.load_number(mass) / design.shaft_stiffness_number
    )
    lighter = static_equilibrium(design, 1.0, bearing_number, MESH)
    assert lighter.eccentricity < rest.eccentricity and lighter.attitude_angle > rest.attitude_angle


def _whirl(design, mass):
    """Growth rate per sample and whirl ratio of a small disturbance, from the orbit in time."""
    run = Run(design, mass, BEARING_NUMBER, mesh=MESH)
    run.memory.state[run.n] = 1e-3
    run.go(60, 1e-7)  # the film settles, the faster decaying mode dies
    _, record = run.go(20, 1e-7, samples=64)
    path = record.path.reshape(-1, 8)
    radius, angle = np.hypot(path[:, 0], path[:, 1]), np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
    rate = np.polyfit(np.arange(len(radius)), np.log(radius), 1)[0]
    return rate, (angle[-1] - angle[0]) / (2.0 * math.pi * (len(angle) - 1) / 64)


@pytest.mark.parametrize("factor, grows", [(0.95, False), (1.05, True)])
def test_growth_in_time_on_both_sides_of_the_threshold(rotor, critical_mass, factor, grows):
    """At onset the whirl ratio is 1/2; five per cent away it follows sqrt(K/M), 1/2 over
    sqrt(factor).
    """
    rate, ratio = _whirl(rotor, factor * critical_mass)
    assert rate > 0.0 if grows else rate < 0.0
    assert ratio == pytest.approx(0.5 / math.sqrt(factor), abs=0.005)


def test_whirl_ratio_in_time_at_the_threshold(rotor, critical_mass):
    rate, ratio = _whirl(rotor, critical_mass)
    assert ratio == pytest.approx(0.5, abs=0.01)
    assert abs(rate * 64) < 1e-3  # per revolution: neither grows nor decays


def test_exponent_of_the_rotor_at_rest_is_its_leading_eigenvalue(rotor, critical_mass):
    """An unloaded, balanced rotor below its threshold rests: MLE = 2 pi times the largest real
    part, to 2 %.
    """
    mass = 0.8 * critical_mass
    leading = linear_spectrum(rotor, mass, BEARING_NUMBER, MESH)[0][0].real
    run = Run(rotor, mass, BEARING_NUMBER, mesh=MESH)
    run.go(150, tangent=True)  # the next mode decays 0.07 per revolution faster
    _, record = run.go(100, tangent=True)
    assert leading < 0.0
    assert exponent(record.growth).value == pytest.approx(2.0 * math.pi * leading, rel=0.02)


def test_unfed_concentric_rotor_is_unstable_at_any_mass():
    """Unfed: K_0 = 0, so the centred rotor whirls however light it is."""
    unfed = fed_design(29, 1, 0, **RIGID)
    for mass in (0.01, 1.0, 30.0):
        assert linear_spectrum(unfed, mass, BEARING_NUMBER, MESH)[0][0].real > 0.0
