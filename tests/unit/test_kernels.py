"""The compiled kernels compute the readable formulas, their derivatives and the exact solution of
the step's system.
"""

import math

import numpy as np
import pytest

from spab_core.solver.curvature import add_curvature, prepare_curvature
from spab_core.solver.film import (
    Mesh,
    axial_force,
    build_film,
    film_array,
    film_force,
    film_size,
    film_slope,
    placed,
    rotor_size,
)
from spab_core.solver.linear_solve import linearise, solve
from spab_core.solver.rotor import build_rotor, rotor_slope, wall_force
from spab_core.solver.slope import build_work, slope, slope_tangent, time_slope
from spab_core.solver.system import System

EPS = np.finfo(float).eps


class Case:
    """A state deep in contact; ``moving`` along the axis: met inside the band, or at its edge."""

    def __init__(self, design, mesh, offset=None, moving="", tau=1.3):
        if moving:
            design = design.replace(rotor__axial_load=50.0)
        self.film = build_film(design, 3.45, mesh, offset, moving=bool(moving))
        self.rotor = build_rotor(design, 18.0, 3.45, room=self.film.room)
        self.system = System(self.film, self.rotor)
        self.work = build_work(self.film)
        self.n = film_size(self.film)
        self.tau = tau
        self.random = np.random.default_rng(7)
        self.u = self.vector(0.05)
        self.u[: self.n] += 1.0
        self.u[self.n : self.n + 2] = 0.7, 0.62  # eccentricity 0.935: deep in contact
        self.u[self.n + 4 : self.n + 6] = 0.3, -0.2
        if moving:
            x, y, z = (0.7, 0.58, 0.22) if moving == "inside" else (0.25, 0.15, -1.35)
            self.u[self.n : self.n + 2] = x, y
            self.u[-8:] = z, 0.25, *np.zeros(6)
        self.film = placed(self.film, self.u)

    @property
    def size(self):
        return self.n + rotor_size(self.film)

    def vector(self, scale=0.1):
        vector = scale * self.random.standard_normal(self.size)
        vector[self.n + 10 :] = 0.0  # they fill a register
        return vector

    def slope(self, u, tau=None):
        out = np.zeros(self.size)
        assert slope(self.system, self.tau if tau is None else tau, u, self.work, out)
        return out

    def tangent(self, u, v):
        out, out_v = np.zeros(self.size), np.zeros(self.size)
        assert slope_tangent(self.system, self.tau, u, v, self.work, out, out_v)
        return out_v


HALF = [(mesh, None) for mesh in (Mesh(3, 16), Mesh(4, 24), Mesh(8, 16), Mesh(5, 24))]
WHOLE = [(Mesh(2, 16), 0.2), (Mesh(3, 24), -0.15)]  # displaced along the axis
MOVING = [(Mesh(2, 16), 0.0, "inside"), (Mesh(2, 16), 0.0, "edge")]


@pytest.fixture(params=HALF + WHOLE + MOVING, ids=lambda p: f"{p[0]} {p[1:] or ''}".strip())
def case(request, design):
    return Case(design, *request.param)


def test_slope_is_the_readable_formula(case):
    film, rotor, u, n = case.film, case.rotor, case.u, case.n
    out = case.slope(u)
    s, x, y = film_array(film, u), u[n], u[n + 1]
    readable = film_slope(film, s, x, y)
    # Both are sums of N products, in another order and with fused products or without
    assert np.abs(film_array(film, out) - readable).max() < 40.0 * EPS * np.abs(readable).max()
    force = film_force(film, s, x, y)
    if film.slide:  # the wall is met elsewhere, and pushes along the axis too
        z, vz = u[-8:-6]
        fx, fy, fz = wall_force(
            rotor, math.asin(film.edge_sine), (x, y, z), (*u[n + 4 : n + 6], vz)
        )
        push = (fz + axial_force(film, s, x, y)) * rotor.axial_inverse_mass
        assert abs(fz) > 1e-3 and out[-8] == vz and not out[-6:].any()
        ramp = case.tau / rotor.ramp
        assert out[-7] == pytest.approx(push + ramp * rotor.axial_gravity, rel=1e-12)
        force = force[0] + fx, force[1] + fy
        rotor = rotor._replace(contact_force=0.0)
    expected = rotor_slope(rotor, case.tau, u[n : n + 8], force)
    assert np.allclose(out[n : n + 8], expected, rtol=1e-12, atol=1e-12)


def test_tangent_is_the_derivative_of_the_slope(case):
    v, step = case.vector(), 1e-6
    difference = (case.slope(case.u + step * v) - case.slope(case.u - step * v)) / (2.0 * step)
    exact = case.tangent(case.u, v)
    assert np.abs(difference - exact).max() < 1e-8 * np.abs(exact).max()


def test_curvature_is_the_derivative_of_the_tangent(case):
    v, w, step = case.vector(), case.vector(), 1e-6
    difference = (case.tangent(case.u + step * w, v) - case.tangent(case.u - step * w, v)) / (
        2.0 * step
    )
    assert linearise(case.system, 0.1, case.u, case.work)
    prepare_curvature(case.system, case.u, v, case.work)
    exact = np.zeros(case.size)
    add_curvature(case.system, case.u, v, w, 1.0, case.work, exact)
    assert np.abs(difference - exact).max() < 1e-8 * np.abs(exact).max()


@pytest.mark.parametrize("step", [1e-4, 0.1, 10.0])
def test_solve_inverts_identity_minus_step_times_jacobian(case, step):
    jacobian = np.array([case.tangent(case.u, column) for column in np.eye(case.size)]).T
    right = case.vector(1.0)
    x = right.copy()
    assert linearise(case.system, step, case.u, case.work)
    solve(case.system, case.work, x)
    assert np.abs(x - step * jacobian @ x - right).max() < 1e-10 * max(
        1.0, step * np.abs(jacobian).max()
    )


def test_time_slope_is_the_derivative_with_respect_to_tau(case):
    step = 1e-6
    difference = (case.slope(case.u, case.tau + step) - case.slope(case.u, case.tau - step)) / (
        2.0 * step
    )
    exact = np.zeros(case.size)
    time_slope(case.system, case.tau, exact)
    assert np.abs(difference - exact).max() < 1e-8


def test_a_journal_outside_the_clearance_is_refused(case):
    case.u[case.n] = 1.0
    assert not slope(case.system, 0.0, case.u, case.work, np.zeros(case.size))
    assert not linearise(case.system, 0.1, case.u, case.work)
