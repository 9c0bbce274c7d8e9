"""When a rotor is in contact (docs/model.md): where the asperities' spring carries more than a
tenth of the load, weight and rotating force of the unbalance together, of at least 0.001 p_a R².
"""

import math

import numpy as np
import pytest

from spab_core.solver.rotor import build_rotor, contact_eccentricity
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.run import simulate
from spab_core.trajectory.settings import Settings


def load(design, mass, number):
    """Weight and unbalance, N: m g + (1 - mu_j) m e_u omega²; the disc alone is unbalanced."""
    r = design.rotor
    disc = (1.0 - r.journal_mass_fraction) * mass
    return mass * r.gravity + disc * r.unbalance_eccentricity * design.speed(number) ** 2


def unit(design):
    """p_a R², N."""
    return design.gas.ambient_pressure * design.bearing.radius**2


def spring(design, eccentricity):
    """Force of the asperities, N: p_a R² f0 exp(-(1 - e)/s)."""
    c = design.contact
    return unit(design) * c.force_at_closure * np.exp(-(1.0 - eccentricity) / c.roughness)


@pytest.mark.parametrize("changes", [{}, {"rotor__shaft_stiffness": math.inf}])
@pytest.mark.parametrize("mass, number", [(4.52, 3.45), (25.0, 0.2), (7.0, 6.0), (1.0, 8.5)])
def test_contact_begins_at_a_tenth_of_the_load(design, changes, mass, number):
    d = design.replace(**changes)
    e = contact_eccentricity(d, mass, number)
    assert spring(d, e) == pytest.approx(0.1 * load(d, mass, number), rel=1e-9)
    assert build_rotor(d, mass, number).contact_eccentricity == e
    # both count
    weight = contact_eccentricity(d.replace(rotor__unbalance_eccentricity=0.0), mass, number)
    thrown = contact_eccentricity(d.replace(rotor__gravity=0.0), mass, number)
    assert weight < e and thrown < e
    assert spring(d, weight) + spring(d, thrown) == pytest.approx(spring(d, e), rel=1e-9)


def test_a_rotor_without_a_load_is_in_contact_at_a_ten_thousandth(design):
    """Weightless and balanced, or all but: a tenth of 0.001 p_a R² at e = 1 - s ln(10^4 f0)."""
    c = design.contact
    exact = 1.0 - c.roughness * math.log(1e4 * c.force_at_closure)
    weightless = design.replace(rotor__gravity=0.0, rotor__unbalance_eccentricity=0.0)
    for mass, number in ((4.0, 3.0), (25.0, 8.5)):
        assert contact_eccentricity(weightless, mass, number) == pytest.approx(exact, rel=1e-12)
    # the limit is the load's: on both sides of it
    balanced = design.replace(rotor__unbalance_eccentricity=0.0)
    least = 1e-3 * unit(design) / design.rotor.gravity
    at = [contact_eccentricity(balanced, share * least, 3.0) for share in (0.5, 0.999, 1.001, 2.0)]
    assert at[0] == at[1] == pytest.approx(exact, rel=1e-12)
    assert at[2] == pytest.approx(exact + c.roughness * math.log(1.001), rel=1e-9)
    assert at[3] == pytest.approx(exact + c.roughness * math.log(2.0), rel=1e-9)


def test_asperities_too_weak_never_make_contact(design):
    mass, number = 4.0, 3.0
    tenth = 0.1 * load(design, mass, number) / unit(design)
    weak = design.replace(contact__force_at_closure=0.999 * tenth)
    enough = design.replace(contact__force_at_closure=1.001 * tenth)
    assert contact_eccentricity(weak, mass, number) == 1.0
    assert contact_eccentricity(enough, mass, number) < 1.0


def test_the_share_that_is_told_is_that_of_the_recorded_orbit(design):
    """Chaos against the wall, 30 revolutions of 3,000 samples: each crossing of the limit is late
    by a quarter of a step, the time is counted in quarters, and a sample at most. Contact at e >
    0.9, or at twice the force, would be told apart.
    """
    mass, number, samples = 18.0, 4.5, 3000
    settings = Settings("3x16", transient=40, revolutions=30, tolerance=1e-6, early_stop=False)
    run = simulate(design, mass, number, settings, path_revolutions=30, samples=samples)
    found = solve_point(design, mass, number, settings).contact_share
    assert run.status == "ok" and run.path.shape[:2] == (30, samples)
    force = spring(design, np.hypot(run.path[..., 0], run.path[..., 1])).ravel()
    tenth = 0.1 * load(design, mass, number)
    touches = force > tenth
    crossings = np.count_nonzero(np.diff(touches))
    assert crossings > 20
    late = crossings / 30.0 * (0.25 * run.completed / run.steps + 1.0 / samples)
    assert found == pytest.approx(touches.mean(), abs=late)
    assert late < 0.3 * abs(found - (force > 2.0 * tenth).mean())
    assert late < 0.3 * abs(found - run.thin.mean())
