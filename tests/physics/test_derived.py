"""Derived numbers: gas is conserved, the flow of a concentric fed bearing by hand, groups, failures
as a status.
"""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from spab_core.common.errors import DesignError
from spab_core.common.units import from_rpm
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.equilibrium import concentric_stiffness, static_equilibrium
from spab_core.linear_theory.summary import NO_EQUILIBRIUM, derive
from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.solver.film import Mesh, suitable_mesh
from tests.conftest import fed_design

MESH = Mesh(4, 24)


@pytest.mark.parametrize("name", PRESETS)
def test_what_the_wall_feeds_leaves_through_the_edges(name):
    p = preset(name)
    flow = derive(
        p.design, p.rotor_mass, p.design.bearing_number(from_rpm(p.speed_rpm)), MESH
    ).gas_flow
    assert flow.wall == pytest.approx(flow.edges, rel=1e-9)
    if p.design.bearing.supply_pressure_ratio > 1.0:
        assert flow.normal_litres > 1.0
    # drawn in at the edges where the load opens the film, pressed out through the wall under it
    else:
        assert -0.1 < flow.normal_litres < 0.0


@pytest.mark.parametrize("name", PRESETS)
def test_a_thick_film_needs_no_more_azimuths_than_a_run(name):
    """Fourier's coefficients of a smooth film fall geometrically: from twice the azimuths, which a
    thin film is given, come the same numbers.
    """
    p, thick, thin = preset(name), 0, 0
    number = p.design.bearing_number(from_rpm(p.speed_rpm))
    for share in (0.25, 1.0, 5.0, 40.0):
        where = p.design, min(share * p.rotor_mass, 1000.0), number
        found, many = derive(*where), derive(*where, suitable_mesh(p.design, 32))
        if many.status != "ok" or many.eccentricity > 0.3:
            thin += found.record() == many.record()
            continue
        thick += found.eccentricity != many.eccentricity  # to the last bit
        assert found.eccentricity == pytest.approx(many.eccentricity, rel=1e-9)
        assert found.whirl.growth == pytest.approx(many.whirl.growth, rel=1e-8)
        assert found.whirl.ratio == pytest.approx(many.whirl.ratio, rel=1e-8)
        np.testing.assert_allclose(
            found.coefficients.stiffness,
            many.coefficients.stiffness,
            atol=1e-8 * np.abs(many.coefficients.stiffness).max(),
        )
        for one, other in zip(found.modes, many.modes, strict=True):
            assert one.log_decrement == pytest.approx(other.log_decrement, rel=1e-8)
    assert thick and thick + thin == 4


def test_flow_of_the_concentric_bearing():
    """At rest at the centre the film is one-dimensional: (cos l Q'/2)'/cos l + beta (P_s² - Q) = 0,
    Q = 1 at the edge, solved with scipy. Through the film flows h³/(12 mu) P dp/dx = C³ p_a/(24 mu
    R) Q' per length, at ambient pressure; each edge is 2 pi R cos l_e long."""
    d = fed_design(30, 5.0, 1.0, rotor__gravity=0.0)
    b, g, edge, beta, fed = d.bearing, d.gas, math.radians(30.0), d.feeding_number, 25.0

    def slope(l, v):  # v = Q, cos l Q'/2
        return np.array([2.0 * v[1] / np.cos(l), -beta * np.cos(l) * (fed - v[0])])

    grid = np.linspace(0.0, edge, 50)
    found = solve_bvp(
        slope,
        lambda a, e: np.array([a[1], e[0] - 1.0]),
        grid,
        np.array([1.0 + 0 * grid, -grid]),
        tol=1e-9,
    )
    unit = b.clearance**3 * g.ambient_pressure / (12.0 * g.viscosity * b.radius)
    out = -2.0 * 2.0 * math.pi * b.radius * unit * found.y[1, -1]
    flow = derive(d, 1.0, 2.0, MESH).gas_flow
    assert flow.wall == pytest.approx(out, rel=1e-5)
    assert flow.mass == pytest.approx(out * 101325.0 / (287.05 * 293.15), rel=1e-5)
    assert flow.normal_litres == pytest.approx(out * 6e4 * 273.15 / 293.15, rel=1e-5)


def test_numbers_agree_with_their_own_commands(design):
    found = derive(design, 4.52, 3.0, MESH)
    rest = static_equilibrium(design, 4.52, 3.0, MESH)
    # derive keeps BLAS on one thread, the other has all: the same solve, rounded in another order
    assert found.status == "ok" and found.eccentricity == pytest.approx(
        rest.eccentricity, rel=1e-12
    )
    assert found.attitude_angle == pytest.approx(rest.attitude_angle, rel=1e-12)
    assert found.least_film == pytest.approx(35e-6 * (1.0 - rest.eccentricity))
    leading = linear_spectrum(design, 4.52, 3.0, MESH)[0][0]
    assert (
        found.whirl.growth == pytest.approx(2.0 * math.pi * leading.real) and not found.whirl.stable
    )
    assert found.whirl.speed_rpm == pytest.approx(abs(leading.imag) * design.speed_rpm(3.0))
    assert found.balance_grade == pytest.approx(0.8 * 13e-3 * design.speed(3.0))
    assert found.mass_number == design.mass_number(
        4.52, 3.0
    ) and found.load_number == design.load_number(4.52)


def test_stiffness_of_an_unloaded_journal(design):
    d = design.replace(rotor__gravity=0.0)
    kxx, kxy = concentric_stiffness(d, 3.0, MESH)
    static = derive(d, 4.52, 3.0, MESH).coefficients.stiffness[0]
    np.testing.assert_allclose(static / d.stiffness_unit, [[kxx, kxy], [-kxy, kxx]], atol=1e-9)


def test_the_record_is_plain_and_says_units(design):
    record = derive(design, 4.52, 3.0, MESH).record()
    assert record["status"] == "ok" and len(record["stiffness_synchronous_n_m"]) == 2
    of_pores = {
        "pore_gas_over_film_gas",
        "penetration_depth_m",
        "whirl_growth_quasi_steady_per_revolution",
    }
    assert {name for name, value in record.items() if value is None} == of_pores


def test_no_equilibrium_is_a_status(design):
    heavy = design.replace(contact__force_at_closure=0.0)
    found = derive(heavy, 1000.0, 0.1, Mesh(2, 16))
    assert found.status == NO_EQUILIBRIUM and found.coefficients is None and found.gas_flow is None
    assert found.record()["eccentricity"] is None and found.record()["bearing_number"] == 0.1


def test_points_out_of_range_are_refused(design):
    with pytest.raises(DesignError, match="rotor mass"):
        derive(design, 0.0, 3.0)
