"""Kernels of a wall that stores gas: readable formulas, derivatives, the exact solution of the
step's system, gas conserved to rounding; and the design values behind them.
"""

import math

import numpy as np
import pytest

from spab_core.common.errors import DesignError
from spab_core.design.model import design_toml, parse_design
from spab_core.linear_theory.equilibrium import dense_system, find_equilibrium
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.spectrum import GasSystem, leading_eigenpairs
from spab_core.shipped.provenance import design_hash
from spab_core.solver.curvature import add_curvature, prepare_curvature
from spab_core.solver.film import (
    Mesh,
    build_film,
    film_fluxes,
    film_slope,
    gas_array,
    gas_content,
    gas_size,
    pore_content,
    pore_slope,
    thickness,
    with_wall,
)
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.slope import build_work, slope, slope_and_jacobian, slope_tangent
from spab_core.solver.system import build_system
from spab_core.solver.wall import SHARE, SPACING

EPS = np.finfo(float).eps
STORING = {"bearing__porosity": 0.15, "bearing__supply_pressure_ratio": 4.0}
LAYER = {"bearing__layer_permeability": 2e-17, "bearing__layer_thickness": 1e-4}


class Case:
    def __init__(self, design, *, moving=False):
        offset = 0.0 if moving else None
        mesh = Mesh(1 if moving else 3, 16)
        self.system = build_system(design, 18.0, 3.45, mesh, offset, moving=moving)
        self.film, self.work = self.system.film, build_work(self.system.film)
        self.n, self.random = gas_size(self.film), np.random.default_rng(7)
        self.u = self.vector(0.05)
        self.u[: self.n] += 1.0
        self.u[self.n : self.n + 2] = 0.7, 0.62  # eccentricity 0.935: deep in contact

    def vector(self, scale=0.1):
        vector = scale * self.random.standard_normal(self.system.size)
        vector[self.n + 10 :] = 0.0  # they fill a register
        return vector

    def slope(self, u):
        out = np.zeros(self.n + 8)
        assert slope(self.system, 1.3, u, self.work, out)
        return out

    def tangent(self, u, v):
        out, out_v = np.zeros(self.system.size), np.zeros(self.system.size)
        assert slope_tangent(self.system, 1.3, u, v, self.work, out, out_v)
        return out_v


@pytest.fixture(scope="module")
def case(design):
    return Case(design.replace(**STORING, **LAYER))


def test_slope_is_the_readable_formula(case):
    film, u, n = case.film, case.u, case.n
    found, gas = gas_array(film, case.slope(u)), gas_array(film, u)
    x, y = u[n : n + 2]
    pressure = gas[0] / thickness(film, x, y)
    for readable, compiled in (
        (film_slope(film, gas[0], x, y, gas[1:]), found[0]),
        (pore_slope(film, pressure**2, gas[1:]), found[1:]),
    ):
        assert np.abs(compiled - readable).max() < 40.0 * EPS * np.abs(readable).max()


def test_gas_changes_by_what_crosses_the_edge_and_the_outer_face_alone(case):
    film, u, n = case.film, case.u, case.n
    found, gas = gas_array(film, case.slope(u)), gas_array(film, u)
    gained = gas_content(film, found[0]) + pore_content(film, found[1:])
    edge = film_fluxes(film, gas[0], *u[n : n + 2], gas[1:])["edge"].sum() * 2.0 * math.pi / 16
    outer = gas_content(film, film.conductance[-1] * (film.supply - gas[-1] ** 2))
    passed = pore_content(film, np.abs(found[1:]))
    assert gained == pytest.approx(edge + outer, abs=20.0 * EPS * passed)


def test_derivatives_are_those_of_the_slope(case):
    v, w, step = case.vector(), case.vector(), 1e-6
    difference = (case.slope(case.u + step * v) - case.slope(case.u - step * v)) / (2.0 * step)
    exact = case.tangent(case.u, v)
    assert np.abs(difference - exact).max() < 1e-8 * np.abs(exact).max()
    ahead, behind = (case.tangent(case.u + sign * step * w, v) for sign in (1.0, -1.0))
    assert linearise(case.system, 0.1, case.u, case.work)
    prepare_curvature(case.system, case.u, v, case.work)
    second = np.zeros(case.n + 8)
    add_curvature(case.system, case.u, v, w, 1.0, case.work, second)
    assert np.abs((ahead - behind) / (2.0 * step) - second).max() < 1e-8 * np.abs(second).max()


@pytest.mark.parametrize("step, moving", [(1e-4, False), (0.1, False), (10.0, False), (0.1, True)])
def test_solve_inverts_identity_minus_step_times_jacobian(design, case, step, moving):
    if moving:
        case = Case(design.replace(**STORING, **LAYER), moving=True)
    jacobian = np.array([case.tangent(case.u, column) for column in np.eye(case.system.size)]).T
    right = case.vector(1.0)
    x = right.copy()
    assert linearise(case.system, step, case.u, case.work)
    solve(case.system, case.work, x)
    scale = max(1.0, step * np.abs(jacobian).max())
    assert np.abs(x - step * jacobian @ x - right).max() < 1e-10 * scale


def test_spacing_and_shares_are_those_of_one_thickness():
    assert sum(SPACING) == pytest.approx(1.0, abs=1e-12)
    assert sum(SHARE) == pytest.approx(1.0, abs=1e-12)


def test_a_steady_wall_passes_what_bulk_and_layer_pass_in_series(design):
    storing = design.replace(**STORING, **LAYER)
    film, quiet = (build_film(d, 3.0) for d in (storing, storing.replace(bearing__porosity=0.0)))
    state = np.zeros(film.latitudes * film.columns + 8)
    state[:-8] = np.linspace(0.9, 2.0, len(state) - 8)
    full = gas_array(film, with_wall(film, state))
    flow = film_fluxes(film, full[0], 0.0, 0.0, full[1:])["wall"]
    assert flow == pytest.approx(film_fluxes(quiet, full[0], 0.0, 0.0)["wall"], rel=1e-12)
    assert np.abs(pore_slope(film, full[0] ** 2, full[1:])).max() < 1e-10 * np.abs(flow).max() * (
        1.0 / film.capacity.min()
    )


@pytest.mark.parametrize("rotor_mass", [5.0, 20.0])
def test_leading_eigenvalues_are_those_of_the_dense_jacobian(design, rotor_mass):
    system = dense_system(design.replace(**STORING), rotor_mass, 4.0, Mesh(2, 16))
    rest = find_equilibrium(system)
    found, vectors = leading_eigenpairs(system, rest.state)
    unknowns = system.unknowns
    jacobian = slope_and_jacobian(system, rest.state, unknowns)[1][unknowns]
    every = np.linalg.eigvals(jacobian)
    assert max(np.abs(every - value).min() / abs(value) for value in found) < 1e-8
    assert np.abs(jacobian @ vectors - vectors * found).max() < 1e-6
    # every one that swings is among them, and the slowest that does not
    swinging = every[(every.imag > 0.0) & (-every.real < every.imag)]
    assert max(np.abs(found - value).min() for value in swinging) < 1e-8
    assert found[0].real == pytest.approx(every.real.max(), rel=1e-8)


@pytest.mark.parametrize("more", [{}, LAYER])
def test_the_columns_of_a_wall_are_solved_exactly(design, more):
    """Against the Jacobian as it is, at rest, at a whirl's frequency and far above; what is real
    stays real.
    """
    z = impedance(design.replace(**STORING, **more), 5.0, 4.0, Mesh(2, 16))
    gas, sides = (
        GasSystem(z.film, 32),
        np.random.default_rng(0).standard_normal((gas_size(z.system.film), 3)),
    )
    assert gas.size == len(sides) == len(z.film)
    assert gas.solve(0.0, sides).dtype == float
    for p in (0.0, 0.1 + 0.5j, 1e4j):
        found = gas.solve(p, sides)
        left = p * found - z.film @ found
        assert np.abs(left - sides).max() < 1e-9
        np.testing.assert_allclose(gas.apply(found), z.film @ found, rtol=1e-9, atol=1e-9)


def test_the_rest_of_a_storing_wall_is_that_of_a_quiet_one(design):
    storing = find_equilibrium(dense_system(design.replace(**STORING), 8.0, 4.0))
    quiet = design.replace(bearing__supply_pressure_ratio=4.0)
    assert storing.eccentricity == pytest.approx(
        find_equilibrium(dense_system(quiet, 8.0, 4.0)).eccentricity, rel=1e-9
    )


def test_keys_of_the_wall_are_checked_and_written(design):
    full = design.replace(**STORING, **LAYER)
    assert parse_design(design_toml(full)) == full
    assert design.bearing.porosity == 0.0 and not design.bearing.stores_gas
    assert not design.replace(bearing__porosity=0.2, bearing__permeability=0.0).bearing.stores_gas
    for wrong in (
        {"bearing__porosity": 0.95},
        {"bearing__porosity": -0.1},
        {"bearing__layer_permeability": 1e-17},
        {"bearing__layer_thickness": 1e-4},
        {"bearing__layer_permeability": 1e-17, "bearing__layer_thickness": 3e-3},
        {"bearing__layer_permeability": 1e-38, "bearing__layer_thickness": 1e-4},
    ):
        with pytest.raises(DesignError, match=next(iter(wrong)).replace("__", ".")[:14]):
            design.replace(**wrong)


def test_designs_without_the_new_keys_are_told_as_before(design):
    assert "porosity" not in design.told()["bearing"]
    assert design_hash(design) != design_hash(design.replace(bearing__porosity=0.1))
