"""A journal that moves along the axis: dynamic stiffness of the compiled equations against
independent values, vibrations in time against eigenvalues, and what symmetry asks for.

Dynamic stiffness: docs/model.md, from the linearised boundary-value problem, solved by other means.
"""

import dataclasses
import math

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.common.errors import DesignError
from spab_core.design.model import reference_design
from spab_core.design.presets import preset
from spab_core.linear_theory.equilibrium import (
    axial_position,
    find_equilibrium,
    resting_system,
)
from spab_core.linear_theory.spectrum import eigenvalues
from spab_core.linear_theory.summary import derive
from spab_core.reporting.datasets import point_dataset
from spab_core.solver.axial import PLACE, SPEED
from spab_core.solver.film import Mesh, gas_size, least_gap
from spab_core.solver.slope import slope_and_jacobian
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.trajectory.point_file import load_point, save_point
from spab_core.trajectory.revolution import integrate_revolution, surface
from spab_core.trajectory.run import path_table
from spab_core.trajectory.starts import whirling_start
from tests.conftest import fed_design

STILL = {"rotor__gravity": 0.0, "rotor__unbalance_eccentricity": 0.0, "rotor__axial_motion": True}
FED = fed_design(30, 6, 0.2).replace(rotor__axial_motion=True)
SETTINGS = Settings("2x16", transient=60, revolutions=60)
STIFFNESS = [
    (30, 6, 0.2, 1e-3, 0.0, 0.28085),
    (29, 5, 1, 1e-3, 0.0, 0.50813),
    (45, 5, 1, 1e-3, 0.0, 2.28305),
    (60, 5, 1, 1e-3, 0.0, 4.68602),
    (45, 1, 0, 3.45, 1.0, 0.16963 - 0.40110j),
    (45, 5, 1, 3.45, 0.5, 2.28761 - 0.06856j),
]


@pytest.mark.parametrize("edge, supply, beta, number, whirl, expected", STIFFNESS)
def test_the_equations_hold_the_axial_stiffness(edge, supply, beta, number, whirl, expected):
    """Z as exp(-i ν τ): gas eliminated from the Jacobian that is integrated in time."""
    design = fed_design(edge, supply, beta).replace(**STILL)
    system = resting_system(design, 1.0, number, Mesh(12, 8))
    n, state = gas_size(system.film), find_equilibrium(system).state
    _, jacobian = slope_and_jacobian(system, state, np.append(np.arange(n), n + PLACE))
    pickup = jacobian[n + SPEED] / system.rotor.axial_inverse_mass
    answer = np.linalg.solve(-1j * whirl * np.eye(n) - jacobian[:n, :n], jacobian[:n, n] + 0j)
    assert -(pickup[n] + pickup[:n] @ answer) == pytest.approx(expected, abs=2e-5)


def _along(design, mass, number, mesh, start, revolutions):
    """Z at sixteen instants of a revolution, after a kick of a thousandth of the clearance."""
    system = resting_system(design, mass, number, mesh)
    memory, k = build_memory(system.film), gas_size(system.film) + PLACE
    memory.state[:] = start
    memory.state[k] += 1e-3
    options, found = Options(1e-7, period=2.0 * math.pi / 16.0), []
    for instant in range(16 * revolutions):
        found.append(memory.state[k] - start[k])
        status, _ = advance(system, memory, options, instant, 1, build_record(1, 0, moving=True))
        assert status == 0
    return np.array(found)


@pytest.mark.parametrize(
    "design, load, mass, number, grows",
    [
        (FED, 0.0, 4.0, 3.0, False),
        (FED, 120.0, 4.0, 3.0, False),
        pytest.param(preset("fed_spindle").design, 60.0, 1.5, 4.0, True, marks=pytest.mark.slow),
    ],
    ids=["free", "loaded", "storing"],
)
def test_a_kick_along_the_axis_rings_as_the_eigenvalue_tells(design, load, mass, number, grows):
    """Frequency and decay of the vibration, at rest in the middle and under a load, and its growth
    where the wall's pores store gas (pneumatic hammer along the axis), by Prony's method: two
    samples tell the next.
    """
    design, mesh = design.replace(**STILL | {"rotor__axial_load": load}), Mesh(3, 16)
    system = resting_system(design, mass, number, mesh)
    state = find_equilibrium(system).state
    assert state[-8] * load >= 0.0 and (abs(state[-8]) > 0.5) == (load > 0.0)
    values = eigenvalues(system, state)
    # until what flows in the wall has died away
    z = _along(design, mass, number, mesh, state, 16 if grows else 6)[-80:]
    a, b = np.linalg.lstsq(np.array([z[1:-1], z[:-2]]).T, z[2:], rcond=None)[0]
    seen = np.log(np.roots([1.0, -a, -b]) + 0j) * 16.0 / (2.0 * math.pi)
    seen = seen[seen.imag.argmax()]
    nearest = values[np.abs(values - seen).argmin()]
    assert nearest.imag > 0.05 and (nearest.real > 1e-3) == grows
    assert seen == pytest.approx(nearest, rel=2e-3)
    told = derive(design, mass, number, mesh).axial
    assert told.growth == pytest.approx(2.0 * math.pi * nearest.real, rel=1e-6)
    assert told.ratio == pytest.approx(nearest.imag, rel=1e-6)


def test_where_the_film_does_not_hold_the_journal_it_drifts_off():
    """Under suction the film pulls along the axis: no vibration, a growth, in the verdict and in
    time alike.
    """
    design = fed_design(30, 0.5, 0.2).replace(**STILL)
    system = resting_system(design, 4.0, 3.0, Mesh(3, 16))
    state = find_equilibrium(system).state
    drift = derive(design, 4.0, 3.0, Mesh(3, 16))
    assert drift.axial.ratio == 0.0 and not drift.axial.stable
    z = _along(design, 4.0, 3.0, Mesh(3, 16), state, 4)
    rates = np.log(z[48:] / z[47:-1]) * 16.0
    assert rates[-1] == pytest.approx(drift.axial.growth, rel=5e-3)
    worst = drift.whirl if drift.whirl.growth > drift.axial.growth else drift.axial
    assert drift.leading[1] == worst and f"{worst.growth:.3g} per revolution" in drift.verdict()


def test_a_journal_that_nothing_holds_along_the_axis_is_not_called_stable():
    """Self-acting, concentric and without weight: ambient pressure everywhere, at any Z."""
    design = reference_design().replace(**STILL, bearing__supply_pressure_ratio=1.0)
    found = derive(design, 1.0, 0.5, Mesh(3, 16))
    assert found.status == "ok" and found.axial.growth == 0.0 and not found.axial.stable
    assert not found.leading[1].stable and "Stable at rest" not in found.verdict()


@pytest.mark.slow
def test_motion_across_is_as_with_a_journal_that_is_held():
    """By symmetry: without a load along the axis Z stays where it is, and the orbit and what
    disturbs it across do not know of it; the exponent is that of the slower of both.
    """
    fine = dataclasses.replace(SETTINGS, tolerance=1e-6)
    moving = solve_point(FED, 4.0, 3.0, fine)
    held = solve_point(FED.replace(rotor__axial_motion=False), 4.0, 3.0, fine)
    assert moving.trajectory.status == "ok" and moving.regime == held.regime
    assert np.abs(moving.trajectory.axial).max() < 1e-12
    apart = moving.trajectory.section[-1] - held.trajectory.section[-1]
    assert np.abs(apart).max() < 1e-5
    assert moving.least_film == pytest.approx(held.least_film, rel=1e-5)
    # what a disturbance along the axis dies by, slower here than one across
    axial = derive(FED, 4.0, 3.0, Mesh(2, 16)).axial.growth
    assert held.mle.value < 2.0 * axial
    assert moving.mle.value == pytest.approx(axial, rel=0.1)


def test_the_exponent_is_that_of_the_whole():
    """A balanced rotor at rest on its film: the exponent is the largest real part of all
    eigenvalues, here that of the vibration along the axis.
    """
    design = FED.replace(**STILL)
    point = solve_point(design, 4.0, 3.0, SETTINGS)
    system = resting_system(design, 4.0, 3.0, Mesh(2, 16))
    values = eigenvalues(system, find_equilibrium(system).state)
    assert point.mle.value == pytest.approx(2.0 * math.pi * values.real.max(), rel=2e-3, abs=1e-3)


@pytest.mark.slow
def test_a_run_under_load_comes_to_the_static_position(tmp_path):
    """Load raised over the ramp; then the journal whirls about the position that statics tells, and
    the thinnest film is where that of both displacements is.
    """
    design = FED.replace(rotor__axial_load=120.0, rotor__unbalance_eccentricity=1e-7)
    point = solve_point(
        design, 4.0, 3.0, Settings(transient=60, revolutions=60), path_revolutions=2
    )
    offset = axial_position(design, 4.0, 3.0)
    assert point.regime.text == "periodic-1"
    low, high = point.axial_range
    assert low <= high < low + 1e-3 and low == pytest.approx(offset, abs=2e-3)
    radial = np.hypot(*point.trajectory.section[-1, :2])
    assert point.least_film < design.bearing.clearance * (1.0 - radial) * 0.99
    assert point.least_film == pytest.approx(point.rest.least_film, rel=0.01)
    record = point.record()
    assert (record["axial_least"], record["axial_largest"]) == (low, high)
    assert "Along the axis it moves" in point.verdict()
    # what is recorded along the axis is that motion
    z, speed = point.trajectory.axial_path[-1].T
    assert np.ptp(z) == pytest.approx(np.ptp(point.trajectory.axial[-1, 2:]), rel=0.01)
    slope = np.gradient(z, 2.0 * math.pi / len(z))[1:-1]
    np.testing.assert_allclose(speed[1:-1], slope, atol=5e-3 * abs(speed).max())
    columns = path_table(point.trajectory)
    assert [*columns][-2:] == ["Z", "Z_dot"] and columns["Z"].shape == columns["tau"].shape
    arrays = point_dataset(point).variables
    np.testing.assert_array_equal(arrays["axial_path"].values[..., 0].ravel(), columns["Z"])
    save_point(point, tmp_path / "point.npz")
    again = load_point(tmp_path / "point.npz")
    assert again.axial_range == (low, high)
    np.testing.assert_array_equal(again.trajectory.axial_path, point.trajectory.axial_path)
    r = integrate_revolution(point, samples=2)
    s = surface(r, every=1, azimuths=72, latitudes=41)
    least = design.bearing.clearance * s.thickness[0].min()
    assert least == pytest.approx(point.least_film, rel=2e-3)


def test_the_vibration_along_the_axis_converges_with_the_mesh():
    """Under a load, displaced and eccentric: from the mesh of a run to twice as many latitudes it
    moves by under 0.5 %, from there on by under a tenth of that.
    """
    design = FED.replace(rotor__axial_load=120.0)
    found = []
    for latitudes in (4, 8, 12):
        axial = derive(design, 4.0, 3.0, Mesh(latitudes, 16)).axial
        found.append(complex(axial.growth, 2.0 * math.pi * axial.ratio))
    coarse, fine = (abs(value - found[-1]) / abs(found[-1]) for value in found[:-1])
    assert coarse < 5e-3 and fine < 0.1 * max(coarse, 1e-5)


def test_a_start_on_a_large_orbit_has_a_film_all_around():
    """Where the journal is displaced along the axis the orbit is smaller."""
    for design in (FED, FED.replace(rotor__axial_motion=False)):
        design = design.replace(rotor__axial_load=120.0)
        start = whirling_start(design, 4.0, 3.0, Mesh(4, 16))
        offset, radial = axial_position(design, 4.0, 3.0), start[8 * 16]
        assert 0.3 < radial < 0.8 and start[: 8 * 16].min() > 0.05
        assert least_gap(design.bearing.edge, offset, radial) > 0.05


def test_what_cannot_move_along_the_axis_is_refused():
    with pytest.raises(DesignError, match=r"axial_motion = true is not allowed with a cylinder"):
        FED.replace(bearing__shape="cylinder", bearing__length=0.06)
    with pytest.raises(DesignError, match=r"method = dtm holds the journal along the axis"):
        solve_point(FED, 4.0, 3.0, Settings("2x16", method="dtm"))


def test_unbalance_drives_a_vibration_along_the_axis_under_an_axial_load():
    """At its frequency the amplitude in time is a half to the whole of what the shape and the
    damping allow, off it a fraction; that is a resonance. Without an axial load nothing couples.
    """
    design = preset("fed_spindle").design.replace(
        bearing__porosity=0.0,
        rotor__axial_motion=True,
        rotor__axial_load=150.0,
        rotor__unbalance_eccentricity=2e-7,
    )
    unit = design.rotor.unbalance_eccentricity / design.bearing.clearance
    settings = Settings("3x16", transient=100, revolutions=20)
    on = 2.0 * derive(design, 4.0, 2.0).axial_modes[0].ratio
    swings = []
    for number in (0.8 * on, on):
        point = solve_point(design, 4.0, number, settings)
        swings.append(0.5 * np.ptp(point.trajectory.axial[-1, 2:]) / unit)
    mode = point.rest.axial_modes[0]
    assert mode.ratio == pytest.approx(1.0, abs=0.01)
    assert 0.5 * mode.axial_amplification < swings[1] < mode.axial_amplification
    assert swings[0] < 0.3 * swings[1]
    (reason,) = [r for r in point.assessment().reasons if r.startswith("resonance")]
    assert reason.startswith("resonance: a vibration along the axis at")
    free = derive(design.replace(rotor__axial_load=0.0), 4.0, on)
    assert free.axial_modes and all(m.axial_amplification < 1e-6 for m in free.axial_modes)
