"""Film and forces over one revolution: they are those the rotor's equation moves by
(docs/model.md).
"""

import math

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.common.errors import DesignError
from spab_core.solver.film import film_size
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import build_work, slope
from spab_core.solver.system import System
from spab_core.trajectory.revolution import FORCES, forces, integrate_revolution, run_up, surface

POINTS = {"periodic": (7.0, 6.0), "chaotic, in contact": (18.0, 4.5)}
COARSE = Settings("3x16", transient=40, revolutions=40)


@pytest.fixture(scope="module", params=[*POINTS, "rigid"])
def case(request):
    from spab_core import reference_design

    design = reference_design()
    if request.param == "rigid":
        design = design.replace(rotor__shaft_stiffness=math.inf)
    point = solve_point(design, *POINTS.get(request.param, (10.0, 4.0)), COARSE, path_revolutions=1)
    assert point.trajectory.status == "ok"
    return point


def test_the_film_force_is_the_compiled_equations(case):
    """Out of the compiled slope: the journal's acceleration times its mass, less every other force
    on it.
    """
    r = integrate_revolution(case, samples=24)
    found, d = forces(r), r.design
    rotor = build_rotor(d, r.rotor_mass, r.bearing_number)
    n, work = film_size(r.film), build_work(r.film)
    u, out = np.zeros(n + 8), np.zeros(n + 8)
    u[:] = case.trajectory.final
    assert slope(System(r.film, rotor), r.tau[0], u, work, out)
    journal = out[n + 4 : n + 6] / rotor.inverse_mass * d.force_unit
    of_all = (1.0 if d.rigid else d.rotor.journal_mass_fraction) * found["gravity"][0]
    rest = found["contact"][0] + of_all + (found["unbalance"][0] if d.rigid else found["shaft"][0])
    assert np.allclose(found["film"][0], journal - rest, rtol=0, atol=1e-9 * abs(journal).max())


def test_forces_balance_mass_times_acceleration(case):
    """m a = sum of forces, a from differences of the velocities: the defect falls with the square
    of the spacing.
    """
    defects = []
    for samples in (180, 360):
        r = integrate_revolution(case, samples)
        total = sum(forces(r)[name] for name in FORCES)
        mu = 1.0 if r.design.rigid else r.design.rotor.journal_mass_fraction
        velocity = mu * r.states[:, 4:6] + (1.0 - mu) * r.states[:, 6:8]
        step = r.tau[1] - r.tau[0]
        acceleration = (velocity[2:] - velocity[:-2]) / (2.0 * step)  # per tau², over C
        speed = r.design.speed(r.bearing_number)
        inertia = r.rotor_mass * r.design.bearing.clearance * speed**2 * acceleration
        defects.append(abs(total[1:-1] - inertia).max() / abs(total).max())
    assert defects[1] < 0.0005 and defects[1] < 0.3 * defects[0]


def test_the_surface_drawn_carries_the_film_force(case):
    """F = -∬ (P - 1)(cos θ, sin θ) cos² λ dλ dθ over the drawn surface, by the trapezoidal rule, is
    the solver's force.
    """
    r = integrate_revolution(case, samples=12)
    s = surface(r, every=1, azimuths=144, latitudes=161)
    density = (s.pressure[:, :-1] - 1.0) * np.cos(s.latitude) ** 2 * (s.azimuth[1] - s.azimuth[0])
    across = np.trapezoid(density, s.latitude, axis=2)
    drawn = (
        -r.design.force_unit
        * across
        @ np.column_stack([np.cos(s.azimuth[:-1]), np.sin(s.azimuth[:-1])])
    )
    solved = forces(r)["film"][:-1]
    assert abs(drawn - solved).max() < 0.01 * abs(solved).max()
    assert np.allclose(s.pressure[:, :, [0, -1]], 1.0)  # the edges are open
    assert (s.thickness > 0.0).all()


def test_the_revolution_goes_on_where_the_run_ended(case):
    r = integrate_revolution(case, samples=12)
    assert r.status == "ok" and r.angle[-1] == pytest.approx(360.0)
    n = film_size(r.film)
    assert np.array_equal(r.states[0, :2], case.trajectory.final[n : n + 2])
    if case.regime.name == "periodic" and case.regime.period == 1:
        assert np.allclose(r.states[-1], r.states[0], atol=2e-3)
    assert (r.pressure > 0.0).all() and r.thickness.shape == r.pressure.shape == (13, 16, 3)


def test_the_run_up_starts_at_rest_and_is_the_runs_own(case):
    path = run_up(
        case.design, case.rotor_mass, case.bearing_number, COARSE, revolutions=4, samples=8
    )
    assert path.shape == (32, 8) and not path[0].any() and abs(path[-1, :4]).max() > 1e-3


def test_a_failed_run_has_a_run_up_but_no_film(design):
    """Without asperities 25 kg touch the wall during the run-up (tests/app/test_home.py)."""
    bare = design.replace(contact__force_at_closure=0.0)
    point = solve_point(bare, 25.0, 0.5, COARSE)
    assert point.trajectory.status == "touchdown"
    with pytest.raises(DesignError, match="did not complete"):
        integrate_revolution(point)
    path = run_up(bare, 25.0, 0.5, COARSE)
    assert 0 < len(path) < 60 * 48 and np.hypot(path[-1, 0], path[-1, 1]) > 0.9
