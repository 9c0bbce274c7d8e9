"""Axial load on the whole band: stiffness against independent values, agreement with the half band,
balance of forces, the axial stop.

Axial stiffness: docs/model.md, from the linearised boundary-value problem solved by other means."""

import json
import math
import pickle

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.cli.main import main
from spab_core.common.errors import DesignError
from spab_core.design.model import design_toml
from spab_core.linear_theory.equilibrium import (
    AxialStopError,
    axial_position,
    axial_stiffness,
    dense_system,
    find_equilibrium,
    running_system,
)
from spab_core.linear_theory.held import load_curves
from spab_core.linear_theory.summary import derive
from spab_core.linear_theory.whirl import spectrum_of
from spab_core.solver.film import (
    Mesh,
    axial_force,
    build_film,
    film_array,
    film_force,
    film_size,
    film_slope,
    least_gap,
    radial_room,
)
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.trajectory.revolution import integrate_revolution, surface
from tests.conftest import fed_design

STIFFNESS = [(30, 6, 0.2, 0.28085), (29, 5, 1, 0.50813), (45, 5, 1, 2.28305), (60, 5, 1, 4.68602)]
FED = fed_design(30, 6, 0.2)


@pytest.mark.parametrize("edge, supply, beta, expected", STIFFNESS)
def test_static_axial_stiffness_of_the_concentric_band(edge, supply, beta, expected):
    """With twelve latitudes a side to the last digit, on the mesh of a run to 0.2 %."""
    design = fed_design(edge, supply, beta)
    assert axial_stiffness(design, 1e-3, mesh=Mesh(12, 8)) == pytest.approx(expected, abs=1.1e-5)
    assert axial_stiffness(design, 1e-3) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    "supply, beta, whirl, expected",
    [(1, 0, 1.0, 0.16963 - 0.40110j), (5, 1, 0.5, 2.28761 - 0.06856j)],
)
def test_dynamic_axial_stiffness_of_the_concentric_band(supply, beta, whirl, expected):
    """Z as exp(-i ν τ) at Λ 3.45, edges at 45°: the film's gas answers the change of its gap."""
    design, step = fed_design(45, supply, beta), 1e-6
    mesh = Mesh(12, 8)
    system = dense_system(design, 1.0, 3.45, mesh, axial_offset=0.0)
    state = find_equilibrium(
        dense_system(design.replace(rotor__gravity=0.0), 1.0, 3.45, mesh, axial_offset=0.0)
    ).state
    s, n = film_array(system.film, state), film_size(system.film)
    moved = [build_film(design, 3.45, mesh, side * step) for side in (-1.0, 1.0)]
    drive = (film_slope(moved[1], s, 0, 0) - film_slope(moved[0], s, 0, 0)) / (2.0 * step)
    direct = (axial_force(moved[1], s, 0, 0) - axial_force(moved[0], s, 0, 0)) / (2.0 * step)
    gas = np.array(
        [
            (film_slope(system.film, s + d, 0, 0) - film_slope(system.film, s - d, 0, 0)).ravel()
            / (2.0 * step)
            for d in (step * np.eye(n)).reshape(n, *s.shape)
        ]
    ).T
    answer = np.linalg.solve(-1j * whirl * np.eye(n) - gas, drive.ravel() + 0j)
    pickup = -np.repeat(system.film.axial, mesh.azimuth)  # dF_z/dS where H = 1
    assert -(direct + pickup @ answer) == pytest.approx(expected, abs=2e-5)


def test_the_whole_band_is_the_half_band_where_both_hold(design):
    """Equilibrium and eigenvalues, to rounding."""
    half, whole = (dense_system(design, 10.0, 2.0, Mesh(3, 16), z) for z in (None, 0.0))
    assert whole.film.whole and not half.film.whole and whole.mesh == half.mesh
    a, b = find_equilibrium(half), find_equilibrium(whole)
    assert b.eccentricity == pytest.approx(a.eccentricity, rel=1e-12)
    assert b.attitude_angle == pytest.approx(a.attitude_angle, rel=1e-12)
    assert spectrum_of(whole)[0][0] == pytest.approx(spectrum_of(half)[0][0], rel=1e-9)


def test_the_motion_of_the_whole_band_is_that_of_the_half_one():
    """A load that displaces by a ten-millionth leaves the orbit as it is, and the exponent within
    what is told of a settled one's, 0.001 and 0.2 %.
    """
    settings = Settings("2x16", transient=40, revolutions=30)
    free = solve_point(FED, 4.0, 3.0, settings)
    light = FED.replace(rotor__axial_load=1e-5)
    assert 0.0 < axial_position(light, 4.0, 3.0) < 1e-6
    loaded = solve_point(light, 4.0, 3.0, settings)
    assert loaded.regime == free.regime
    assert loaded.mle.value == pytest.approx(free.mle.value, rel=2e-3, abs=1e-3)
    assert np.abs(loaded.trajectory.section[-1] - free.trajectory.section[-1]).max() < 1e-5


def test_dtm_agrees_with_rodas_under_an_axial_load():
    """On the whole band of a displaced journal, as on the half band: orbit and growth of the
    tangent from one state, at small steps.
    """
    design = FED.replace(rotor__axial_load=120.0)
    system = running_system(design, 4.0, 3.0, Mesh(2, 16))
    assert system.film.whole and system.film.offset > 0.2
    start = build_memory(system.film)
    assert advance(system, start, Options(tangent=True), 0, 40, build_record(40, 0))[0] == 0
    found = []
    for method, tolerance in (("rodas", 1e-10), ("dtm", 1e-8)):
        memory, record = build_memory(system.film, method), build_record(2, 0)
        memory.state[:], memory.tangent[:] = start.state, start.tangent
        assert advance(system, memory, Options(tolerance, tangent=True), 40, 2, record)[0] == 0
        found.append((memory, record))
    (implicit, a), (taylor, b) = found
    assert np.abs(implicit.state - taylor.state).max() < 1e-6
    assert np.abs(a.growth - b.growth).max() < 1e-6


@pytest.mark.parametrize("load", [-120.0, 1.0, 120.0])
def test_film_and_load_balance_along_the_axis(load):
    """F_z + W_z = 0 at rest under gravity; a small load is carried by the stiffness; the sign of Z
    is the load's.
    """
    design = FED.replace(rotor__axial_load=load)
    offset = axial_position(design, 4.0, 3.0)
    system = dense_system(design, 4.0, 3.0)
    state = find_equilibrium(system).state
    n = film_size(system.film)
    force = axial_force(system.film, film_array(system.film, state), *state[n : n + 2])
    assert force * design.force_unit == pytest.approx(-load, rel=1e-8)
    found = derive(design, 4.0, 3.0)
    assert found.axial_offset == offset and offset * load > 0.0
    if load == 1.0:
        displacement = offset * design.bearing.clearance
        assert displacement * found.axial_stiffness == pytest.approx(load, rel=1e-3)
    else:  # the film is thinner than the radial eccentricity alone tells
        assert found.least_film < design.bearing.clearance * (1.0 - found.eccentricity)
    assert axial_position(FED, 4.0, 3.0) is None


def test_the_least_gap_is_that_of_the_whole_band():
    """By trying all latitudes; and the radial room is where it closes."""
    for edge in (0.2, 0.5, 1.2):
        latitude = np.linspace(-edge, edge, 20001)
        for offset in (0.1, -0.4, 0.7):
            for e in (0.0, 0.2, 0.5):
                gap = 1.0 - offset * np.sin(latitude) - e * np.cos(latitude)
                assert least_gap(edge, offset, e) == pytest.approx(gap.min(), abs=1e-7)
            room = radial_room(edge, offset)
            assert least_gap(edge, offset, room) == pytest.approx(0.0, abs=1e-12)
            assert least_gap(edge, offset, radial_room(edge, offset, 0.1)) == pytest.approx(0.1)


def test_a_bearing_at_its_axial_stop_is_a_status(tmp_path, capsys):
    design = FED.replace(rotor__axial_load=5000.0)
    with pytest.raises(
        AxialStopError, match=r"at most [\d.]+ N .* rotor\.axial_load is 5000 N"
    ) as stop:
        axial_position(design, 4.0, 3.0)
    # as a worker process answers
    again = pickle.loads(pickle.dumps(stop.value))
    assert str(again) == str(stop.value) and again.capacity == stop.value.capacity
    found = derive(design, 4.0, 3.0)
    assert found.status.startswith("at its axial stop") and found.whirl is None
    point = solve_point(design, 4.0, 3.0, Settings("2x16", transient=30, revolutions=20))
    assert point.trajectory.status == "axial-stop" and point.regime is None and point.mle is None
    path = tmp_path / "loaded.toml"
    path.write_text(design_toml(design.replace(rotor__axial_load=50.0)))
    ask = ["--design", str(path), "--rotor-mass", "4", "--bearing-number", "3"]
    assert main(["design", "show", *ask, "--mesh", "2x16", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["axial_offset"] > 0.0 and answer["axial_stiffness_n_per_m"] > 0.0


def test_the_drawn_film_of_a_loaded_bearing_carries_both_forces():
    """Trapezoids over the drawn surface against the solver's sums of the same film."""
    design = FED.replace(rotor__axial_load=100.0)
    point = solve_point(design, 4.0, 3.0, Settings("4x16", transient=30, revolutions=20))
    r = integrate_revolution(point, samples=2)
    s = surface(r, every=1, azimuths=96, latitudes=401)
    step = s.azimuth[1] - s.azimuth[0]
    excess = (s.pressure[0, :-1] - 1.0) * s.radius * step
    along = -np.trapezoid(excess * s.height, s.latitude, axis=1).sum()
    across = -np.trapezoid(excess * s.radius, s.latitude, axis=1) @ np.cos(s.azimuth[:-1])
    x, y = r.states[0, :2]
    gas = r.gas[0].T
    assert along == pytest.approx(axial_force(r.film, gas, x, y), rel=2e-3)
    assert across == pytest.approx(film_force(r.film, gas, x, y)[0], rel=2e-2, abs=2e-5)
    least = design.bearing.clearance * (1.0 - point.trajectory.peak.max())
    assert least < design.bearing.clearance * s.thickness.min() * 1.01


def test_load_curves_rise_and_begin_with_the_stiffness():
    found = load_curves(FED, 3.0)
    assert len(found.radial) == len(found.axial) == 12
    assert (np.diff(found.radial_force) > 0.0).all() and (np.diff(found.axial_force) > 0.0).all()
    slope = np.gradient(found.axial_force, found.axial * FED.bearing.clearance)[0]
    stiffness = axial_stiffness(FED, 3.0) * FED.stiffness_unit
    assert slope == pytest.approx(stiffness, rel=0.05)
    tube = FED.replace(bearing__shape="cylinder", bearing__length=0.06)
    assert len(load_curves(tube, 3.0).axial) == 0 and derive(tube, 4.0, 3.0).axial_stiffness is None


@pytest.mark.parametrize(
    "changes, words",
    [
        (
            {"bearing__shape": "cylinder", "rotor__axial_load": 5.0},
            r"rotor\.axial_load = 5 N is not allowed with a cylinder",
        ),
        ({"rotor__axial_load": math.inf}, r"rotor\.axial_load = inf N is out of range"),
    ],
)
def test_what_is_not_modelled_is_refused(changes, words):
    with pytest.raises(DesignError, match=words):
        FED.replace(**changes)
