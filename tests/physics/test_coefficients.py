"""The eight coefficients: exact limits, finite differences, tabulated boundary values, eigenvalues
of the whole system.
"""

import math

import numpy as np
import pytest

from spab_core.common.errors import DesignError, InputError
from spab_core.design.presets import preset
from spab_core.linear_theory.coefficients import (
    LEAST_STABLE,
    NAMES,
    coefficients,
    coefficients_over_speed,
    impedance,
    least_stable_whirl,
)
from spab_core.linear_theory.equilibrium import concentric_stiffness
from spab_core.linear_theory.whirl import linear_spectrum, whirl_thresholds
from spab_core.solver.film import Mesh, build_film, film_index, film_size
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import build_work, slope
from spab_core.solver.system import System
from tests.conftest import fed_design

MESH = Mesh(3, 24)
UNLOADED = {
    "rotor__shaft_stiffness": math.inf,
    "rotor__unbalance_eccentricity": 0.0,
    "rotor__gravity": 0.0,
}


def circular(z):
    """Force per displacement of a forward circular whirl x = cos nu tau, y = sin nu tau: -(F_x + i
    F_y)/(x + i y).
    """
    assert z[0, 0] == pytest.approx(z[1, 1], abs=1e-9) and z[0, 1] == pytest.approx(
        -z[1, 0], abs=1e-9
    )
    return z[0, 0] - 1j * z[0, 1]


def static_force(design, mass, number, mesh, state, x, y):
    """Force on the journal held at (x, y), the film settled there: Newton's method by plain finite
    differences.
    """
    film, rotor = (
        build_film(design, number, mesh),
        build_rotor(design, mass, number)._replace(ramp=0.0),
    )
    cells, n, work = film_index(film).ravel(), film_size(film), build_work(film)
    state, out = state.copy(), np.zeros_like(state)
    rate = np.empty((len(cells), len(cells)))

    def residual(s):
        assert slope(System(film, rotor), 0.0, s, work, out)
        return out[cells].copy()

    state[n : n + 2] = x, y
    state[n + 2 : n + 4] = x, y  # no force of the shaft
    for _ in range(6):
        r = residual(state)
        for k, cell in enumerate(cells):
            near = state.copy()
            near[cell] += 1e-6
            rate[:, k] = (residual(near) - r) / 1e-6
        state[cells] -= np.linalg.solve(rate, r)
    residual(state)
    weightless = np.array(
        [out[n + 4] - rotor.unbalance_journal, out[n + 5] + rotor.gravity_journal]
    )
    return weightless / rotor.inverse_mass


def test_static_stiffness_is_the_slope_of_the_static_force(design):
    mass, number, mesh, h = 15.0, 2.0, Mesh(2, 16), 1e-4
    z = impedance(design, mass, number, mesh)
    state = z.equilibrium.state
    x, y = state[-8:-6]
    assert math.hypot(x, y) > 0.3

    def force(dx, dy):
        return static_force(design, mass, number, mesh, state, x + dx, y + dy)

    found = np.column_stack(
        [(force(-h, 0) - force(h, 0)) / (2 * h), (force(0, -h) - force(0, h)) / (2 * h)]
    )
    np.testing.assert_allclose(z.at(0.0), found, atol=2e-6 * np.abs(found).max())


def test_static_damping_is_the_limit_of_a_slow_whirl(design):
    z = impedance(design, 15.0, 2.0, MESH)
    slow = coefficients(z, [0.0, 1e-4])
    np.testing.assert_allclose(slow.damping[0], slow.damping[1], rtol=1e-6)
    np.testing.assert_allclose(slow.stiffness[0], slow.stiffness[1], rtol=1e-6)
    assert np.isrealobj(slow.damping) and slow.whirl_ratio[0] == 0.0


@pytest.mark.parametrize("supply, feeding", [(1.0, 0.2168), (5.0, 1.0)])
def test_the_centred_journal_has_the_concentric_stiffness(supply, feeding):
    d = fed_design(29, supply, feeding, **UNLOADED)
    kxx, kyx = concentric_stiffness(d, 3.45, MESH)
    static = impedance(d, 1.0, 3.45, MESH).at(0.0).real
    np.testing.assert_allclose(static, [[kxx, kyx], [-kyx, kxx]], atol=1e-9)


@pytest.mark.parametrize(
    "edge, supply, feeding, number, kxx, kyx",
    [
        (29, 1.0, 0.0, 1.0, 0.02303, 0.23639),
        (29, 1.0, 0.2168, 3.45, 0.23024, 0.71509),
        (29, 5.0, 1.0, 10.0, 5.06661, 0.25962),
        (45, 1.0, 0.0, 3.45, 1.22106, 1.63378),
        (45, 5.0, 1.0, 3.45, 6.80388, 0.68071),
    ],
)
@pytest.mark.parametrize("ratio", [0.2, 0.75, 1.0])
def test_whirl_of_the_centred_journal_is_a_change_of_bearing_number(
    edge, supply, feeding, number, kxx, kyx, ratio
):
    """Seen from axes that turn with a circular whirl of ratio nu the film is steady, with Lambda (1
    - 2 nu) for Lambda. The values are those of the linearised boundary-value problem, solved to
    1e-9 independently of this code (docs/model.md)."""
    factor = 1.0 - 2.0 * ratio
    d = fed_design(edge, supply, feeding, **UNLOADED)
    found = circular(impedance(d, 1.0, number / abs(factor), Mesh(6, 48)).at(1j * ratio))
    wanted = complex(kxx, -math.copysign(kyx, factor))
    assert abs(found - wanted) < 2e-3 * abs(wanted)


def test_closed_sphere():
    """The whole sphere, exact: K_xx + i K_yx = (4 pi/3) i L/(2 + i L) with L = Lambda (1 - 2 nu)
    under whirl (docs/model.md). The last half degree of latitude is open here."""
    d = fed_design(89.5, 1.0, 0.0, **UNLOADED)
    for number, ratio in ((0.3, 0.0), (2.0, 0.2), (5.0, 0.9)):
        turned = 1j * number * (1.0 - 2.0 * ratio)
        wanted = (4.0 * math.pi / 3.0 * turned / (2.0 + turned)).conjugate()
        found = circular(impedance(d, 1.0, number, Mesh(8, 48)).at(1j * ratio))
        assert abs(found - wanted) < 0.02 * abs(wanted)


def test_incompressible_limit():
    """Lambda -> 0: the gas is not compressed, and the cross-coupled stiffness is half damping times
    speed (Lund 1987).
    """
    d = fed_design(30, 1.0, 0.0, **UNLOADED)
    number = 0.02
    found = coefficients(impedance(d, 1.0, number, MESH), [0.0, 0.5, 1.0])
    speed = d.speed(number)
    np.testing.assert_allclose(found.column("kxy"), 0.5 * found.column("cxx")[0] * speed, rtol=1e-3)
    np.testing.assert_allclose(found.column("cxx"), found.column("cxx")[0], rtol=1e-3)
    assert np.abs(found.column("kxx")).max() < 0.02 * found.column("kxy")[0]


def root_near(z, p):
    """A root of the characteristic determinant by the secant method."""
    a, b = p * (1.0 + 1e-3), p * (1.0 - 1e-3j)
    fa, fb = z.characteristic(a), z.characteristic(b)
    for _ in range(40):
        if abs(b - a) < 1e-13 * abs(b):
            break
        a, fa, b = b, fb, b - fb * (b - a) / (fb - fa)
        fb = z.characteristic(b)
    return b


@pytest.mark.parametrize(
    "name, number", [("fed_spindle", 8.5), ("rigid_balanced", 8.5), ("spab60", 2.0)]
)
def test_the_rotor_on_the_coefficients_whirls_as_the_whole_system(name, number):
    """At the threshold mass: the determinant's root is the leading eigenvalue of film and rotor, to
    1e-8 and better.
    """
    d = preset(name).design
    threshold = whirl_thresholds(d, number, MESH, masses=(4.0, 20.0), scan=3)[0]
    z = impedance(d, threshold.critical_mass, number, MESH)
    values, _ = linear_spectrum(d, threshold.critical_mass, number, MESH)
    leading = values[0] if values[0].imag > 0 else values[0].conjugate()
    found = root_near(z, leading)
    assert abs(found - leading) < 1e-8
    assert abs(found.real) < 1e-5 and found.imag == pytest.approx(threshold.whirl_ratio, abs=1e-6)
    assert least_stable_whirl(z) == pytest.approx(leading, abs=1e-9)


def test_coefficients_at_the_whirl_frequency_balance_the_rotor_there():
    """Undamped at the threshold, the rotor feels K(nu) and C(nu) alone: in N, kg and s, its
    determinant is zero.
    """
    d, number = preset("fed_spindle").design, 8.5
    threshold = whirl_thresholds(d, number, MESH, masses=(4.0, 20.0), scan=3)[0]
    found = coefficients_over_speed(d, threshold.critical_mass, [number], LEAST_STABLE, MESH)
    w, shaft, share = (
        found.whirl_frequency[0],
        d.rotor.shaft_stiffness,
        d.rotor.journal_mass_fraction,
    )
    disc = -(1.0 - share) * threshold.critical_mass * w**2
    rotor = -share * threshold.critical_mass * w**2 + disc * shaft / (disc + shaft)
    dynamic = found.stiffness[0] + 1j * w * found.damping[0] + rotor * np.eye(2)
    assert abs(np.linalg.det(dynamic)) < 1e-4 * np.abs(dynamic).max() ** 2


def test_mesh_convergence(design):
    """A loaded journal: second order around, faster across."""
    fine = impedance(design, 10.0, 2.0, Mesh(5, 96)).at(0.5j)
    errors = [
        np.abs(impedance(design, 10.0, 2.0, Mesh(m, n)).at(0.5j) - fine).max() / np.abs(fine).max()
        for m, n in ((2, 16), (3, 24), (4, 48))
    ]
    assert errors[0] > 2.0 * errors[1] > 4.0 * errors[2] and errors[2] < 1e-3


def test_columns_and_units(design):
    z = impedance(design, 10.0, 2.0, MESH)
    found = coefficients(z, [0.5, 1.0])
    assert NAMES == ("kxx", "kxy", "kyx", "kyy", "cxx", "cxy", "cyx", "cyy")
    assert found.column("kyx")[1] == pytest.approx(z.at(1j)[1, 0].real * design.stiffness_unit)
    assert found.column("cxy")[0] == pytest.approx(
        z.at(0.5j)[0, 1].imag / (0.5 * design.speed(2.0)) * design.stiffness_unit
    )
    assert found.whirl_frequency[0] == pytest.approx(0.5 * design.speed(2.0))


def test_speeds_without_equilibrium_are_told_and_none_at_all_is_refused():
    heavy = fed_design(30, 0.5, 5.0)  # sucked to the wall
    light = fed_design(29, 1.0, 0.2)
    found = coefficients_over_speed(light, 5.0, [1.0, 2.0], 0.5, MESH)
    assert len(found.speed) == 2 and not found.missing and (found.whirl_ratio == 0.5).all()
    with pytest.raises(InputError, match="static equilibrium"):
        coefficients_over_speed(
            heavy.replace(contact__force_at_closure=0.0), 1000.0, [1.0], 1.0, MESH
        )
    with pytest.raises(DesignError, match="whirl ratio"):
        coefficients_over_speed(light, 5.0, [1.0], -1.0, MESH)
