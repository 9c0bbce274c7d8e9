"""A wall that stores gas: dynamic stiffness and threshold against an independent Chebyshev solution
of film and wall (docs/model.md), one node against its exact flow, motions in time.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from spab_core import solve_point
from spab_core.design.model import reference_design
from spab_core.design.presets import preset
from spab_core.linear_theory.impedance import impedance
from spab_core.linear_theory.whirl import linear_spectrum, whirl_thresholds
from spab_core.solver.film import Mesh, film_array, thickness
from spab_core.solver.wall import SHARE, SPACING
from tests.conftest import Run, fed_design
from tests.physics.test_coefficients import root_near

RIGID = {
    "rotor__shaft_stiffness": math.inf,
    "rotor__unbalance_eccentricity": 0.0,
    "rotor__gravity": 0.0,
}
WHIRLS = (0.0, 0.25, 0.5, 1.0, 2.0)
# P_s, beta, beta_l, Lambda, sigma_w; K_r, K_t at each whirl; whirl and M at the threshold
TABLE = {
    "sigma 0": (
        (6.0, 0.2, 0.0, 6.0, 0.0),
        (3.13145, 3.03584, 2.99959, 3.13145, 3.60366),
        (0.36233, 0.19888, 0.0, -0.36233, -0.56360),
        (0.5, 11.998),
    ),
    "sigma 10": (
        (6.0, 0.2, 0.0, 6.0, 10.0),
        (3.13145, 3.03824, 2.99284, 3.07751, 3.43948),
        (0.36233, 0.23318, 0.06810, -0.24391, -0.45594),
        (0.598, 8.362),
    ),
    "sigma 100": (
        (6.0, 0.2, 0.0, 6.0, 100.0),
        (3.13145, 2.94506, 2.72915, 2.62610, 2.88640),
        (0.36233, 0.48452, 0.37328, 0.00171, -0.40259),
        (1.003, 2.613),
    ),
    "sigma 1000": (
        (6.0, 0.2, 0.0, 6.0, 1000.0),
        (3.13145, 2.26776, 1.90962, 1.73806, 1.91521),
        (0.36233, 0.88071, 0.65826, 0.19454, -0.31217),
        (1.286, 1.064),
    ),
    "layer": (
        (6.0, 10.0, 0.204082, 6.0, 1000.0),
        (3.13145, 3.03373, 2.99734, 3.12922, 3.60215),
        (0.36233, 0.19940, 0.00019, -0.36275, -0.56475),
        (0.500, 11.978),
    ),
    "unfed 0": (
        (1.0, 0.2, 0.0, 3.45, 0.0),
        (0.26615, 0.07238, 0.0, 0.26615, 1.28804),
        (0.77481, 0.42103, 0.0, -0.77481, -1.26185),
        None,
    ),
    "unfed 100": (
        (1.0, 0.2, 0.0, 3.45, 100.0),
        (0.26615, 0.01105, 0.0, 0.27879, 0.94621),
        (0.77481, 0.39338, 0.0, -0.55709, -0.91616),
        None,
    ),
}


def storing_design(supply, beta, layer, bearing_number, sigma):
    """A rigid, balanced, unloaded rotor on a wall of these numbers."""
    c = fed_design(30, supply, beta).bearing.clearance
    # sigma_w = phi Lambda H_p / (C beta): the porosity, then the thickness that it needs
    porosity = min(max(sigma * c * beta / (bearing_number * 4.5e-3), 0.0), 0.8)
    thickness = sigma * c * beta / (bearing_number * porosity) if sigma else 4.5e-3
    d = fed_design(30, supply, beta, **RIGID)
    b = d.bearing
    d = d.replace(
        bearing__wall_thickness=thickness,
        bearing__permeability=b.permeability * thickness / b.wall_thickness,
        bearing__porosity=porosity,
    )
    if not layer:
        return d
    return d.replace(
        bearing__layer_thickness=1e-4,
        bearing__layer_permeability=layer * 1e-4 * c**3 / (6.0 * b.radius**2),
    )


def circular(z, nu):
    """K_r and K_t of a forward whirl x = cos(nu tau), y = sin(nu tau): force -Z q."""
    k = (z.at(1j * nu) @ np.array([1.0, -1.0j]))[0]
    return k.real, -k.imag


@pytest.mark.parametrize("name", TABLE)
def test_dynamic_stiffness(name):
    """K_r to 0.5 % of itself, K_t to 0.5 % of |K|; the table has five decimals, its zeros are
    exact.
    """
    numbers, restoring, driving, _ = TABLE[name]
    d = storing_design(*numbers)
    assert d.sigma_wall(numbers[3]) == pytest.approx(numbers[4], rel=1e-9)
    z = impedance(d, 1.0, numbers[3])
    for nu, radial, tangential in zip(WHIRLS, restoring, driving, strict=True):
        k_r, k_t = circular(z, nu)
        size = math.hypot(radial, tangential)
        assert k_r == pytest.approx(radial, rel=0.005, abs=5e-6)
        assert k_t == pytest.approx(tangential, abs=max(0.005 * size, 5e-6))


WITH_THRESHOLD = [name for name in TABLE if TABLE[name][3]]


@pytest.mark.parametrize("name", WITH_THRESHOLD)
def test_threshold_by_coefficients(name):
    """Where K_t = 0 nothing drives or damps the whirl: there M = K_r / nu²."""
    numbers, _, _, (ratio, mass_number) = TABLE[name]
    z = impedance(storing_design(*numbers), 1.0, numbers[3])
    nu = brentq(lambda v: circular(z, v)[1], 0.25, 2.0, xtol=1e-10)
    assert nu == pytest.approx(ratio, rel=0.01)
    assert circular(z, nu)[0] / nu**2 == pytest.approx(mass_number, rel=0.01)


@pytest.mark.parametrize("name", WITH_THRESHOLD)
def test_threshold_by_eigenvalues(name):
    numbers, _, _, (ratio, mass_number) = TABLE[name]
    d = storing_design(*numbers)
    unit = d.mass_number(1.0, numbers[3])
    (below, _), (above, _) = (
        linear_spectrum(d, share * mass_number / unit, numbers[3]) for share in (0.99, 1.01)
    )
    assert below[0].real < 0.0 < above[0].real
    assert 0.5 * abs(below[0].imag + above[0].imag) == pytest.approx(ratio, abs=0.005)


def test_flow_of_one_node_is_the_exact_one():
    """Flow over the quasi-steady one for a small oscillation, x coth x, x² = -i nu sigma_w / P
    (docs/model.md), from where storage is nothing to a depth of 1/140; and the slowest decay of the
    pores' gas under a held film, pi².
    """
    s = -1j * np.geomspace(1e-2, 4e4, 400)
    admittance = s * SHARE[-1] + 1.0 / SPACING[-1]
    for share, spacing in zip(SHARE[-2::-1], SPACING[-2:0:-1], strict=True):
        admittance = s * share + 1.0 / (spacing + 1.0 / admittance)
    found = 1.0 / (SPACING[0] + 1.0 / admittance)
    x = np.sqrt(s)
    exact = x / np.tanh(x)
    assert np.abs(found / exact - 1.0).max() < 0.005
    links = 1.0 / np.array(SPACING)
    matrix = np.diag(links[:-1] + links[1:]) - np.diag(links[1:-1], 1) - np.diag(links[1:-1], -1)
    slowest = np.linalg.eigvals(matrix / np.array(SHARE)[:, None]).real.min()
    assert slowest == pytest.approx(math.pi**2, rel=0.01)


SPINDLE = preset("fed_spindle").design.replace(
    bearing__porosity=0.0,
    bearing__permeability=1.44e-15,
    bearing__layer_permeability=0.0,
    bearing__layer_thickness=0.0,
)
POROUS = {"bearing__porosity": 0.15}
LAYERED = POROUS | {
    "bearing__permeability": 1e-13,
    "bearing__layer_permeability": 3.24675e-17,
    "bearing__layer_thickness": 1e-4,
}


# half of the flow's resistance in the layer, in the bulk a wave's depth as without
HALF_LAYER = POROUS | {
    "bearing__permeability": 2.88e-15,
    "bearing__layer_permeability": 6.4e-17,
    "bearing__layer_thickness": 1e-4,
}


class WholeWall:
    """Z of a bearing whose wall is not cut into cells.

    The film is that of the quasi-steady wall. Behind each node w, P_w times its change, follows
    w'' = sigma_w p w / P_w with the steady P_w² = Q_0 + (P_s² - Q_0) eta, and w = 0 at the outer
    face (the wall's equation in docs/model.md, linearised), by Chebyshev collocation (Trefethen,
    Spectral Methods in MATLAB, chapter 6) on 48 points; a layer is in series."""

    def __init__(self, design, mass, bearing_number, mesh, points=48):
        quiet = design.replace(bearing__porosity=0.0)
        self.z = z = impedance(quiet, mass, bearing_number, mesh)
        self.design, self.rotor_mass, self.bearing_number = design, mass, bearing_number
        film, state, b = z.system.film, z.equilibrium.state, design.bearing
        position = state[film.latitudes * film.columns :][:2]
        gap = thickness(film, *position).ravel()
        gas = film_array(film, state).ravel() / gap
        self.by_gas = 2.0 * gas / gap  # dQ/dS, and dQ of a displacement
        around = np.array([film.cos, film.sin])[:, None, :] * film.node[:, None]
        self.by_journal = (2.0 * gas**2 / gap) * around.reshape(2, -1)
        self.beta, self.layer = b.feeding_number, b.layer_number
        self.quiet = film.feed
        x = np.cos(math.pi * np.arange(points + 1) / points)
        c = np.array([2.0, *np.ones(points - 1), 2.0]) * (-1.0) ** np.arange(points + 1)
        d = np.outer(c, 1.0 / c) / (x[:, None] - x + np.eye(points + 1))
        d = 2.0 * (d - np.diag(d.sum(axis=1)))  # d/d eta, eta = (1 + x)/2: 1 first, 0 last
        self.first, self.second = d[-1], (d @ d)[1:-1]
        eta = 0.5 * (1.0 + x[1:-1])
        supply = b.supply_pressure_ratio**2
        face = gas**2 + (supply - gas**2) * self.beta / (self.beta + self.layer)
        steady = np.sqrt(face[:, None] + (supply - face)[:, None] * eta)
        self.slow = design.sigma_wall(bearing_number) / steady

    def at(self, p):
        """Z(p) by the formula of :class:`spab_core.linear_theory.impedance.Impedance`."""
        inner = self.second[:, 1:-1] - p * self.slow[:, :, None] * np.eye(len(self.second))
        w = np.linalg.solve(inner, np.broadcast_to(-self.second[:, -1:], (*self.slow.shape, 1)))
        flow = -(w[..., 0] @ self.first[1:-1] + self.first[-1])  # over the quasi-steady one
        more = 1.0 / (2.0 * self.bearing_number * (1.0 / self.layer + 1.0 / (self.beta * flow)))
        more = more - self.quiet
        film = self.z.film - np.diag(more * self.by_gas)
        drive = self.z.drive - (more * self.by_journal).T
        answer = np.linalg.solve(p * np.eye(len(film)) - film, drive)
        return -self.z.direct - p * self.z.wall_damping - self.z.pickup @ answer


@pytest.mark.parametrize("name", [name for name in TABLE if TABLE[name][0][-1]])
def test_the_wall_that_is_not_cut_is_that_of_the_table(name):
    """All digits of the independent solution but one in the last: what is off in
    :func:`test_dynamic_stiffness` is the cells'.
    """
    numbers, restoring, driving, _ = TABLE[name]
    wall = WholeWall(storing_design(*numbers), 1.0, numbers[3], Mesh(6, 16))
    for nu, radial, tangential in zip(WHIRLS, restoring, driving, strict=True):
        assert circular(wall, nu) == pytest.approx((radial, tangential), abs=1e-5)


@pytest.mark.parametrize("name", ["bare", "layered", "unfed"])
def test_the_cells_agree_with_a_wall_that_is_not_cut(name):
    """More cells would change nothing: Z of a loaded journal, steady whirls, growing and decaying
    ones, to 0.5 % of its largest entry.
    """
    d, mass, number = {
        "bare": (SPINDLE.replace(**POROUS), 4.0, 5.87),
        "layered": (SPINDLE.replace(**HALF_LAYER), 4.0, 5.87),
        "unfed": (reference_design().replace(**POROUS), 20.0, 2.0),
    }[name]
    mesh = Mesh(3, 16)
    cells, whole = impedance(d, mass, number, mesh), WholeWall(d, mass, number, mesh)
    for p in (1e-9j, 0.1j, 0.5j, 1j, 3j, 0.5j - 0.05, 1j + 0.1):
        exact = whole.at(p)
        size = np.abs(exact).max()
        assert np.abs(cells.at(p) - exact).max() < 5e-3 * size
        if abs(p) >= 0.1:
            assert np.abs(whole.z.at(p) - exact).max() > 0.01 * size


def test_the_slowest_flows_of_a_wall_that_is_not_cut():
    """The reference design with pores at rest, 20 kg, Λ 2: its unstable whirl, and the three
    slowest flows of its wall, one of which is the exponent of its orbit, to 1.5 %.
    """
    d, mass, number = reference_design().replace(**POROUS), 20.0, 2.0
    whole = WholeWall(d, mass, number, Mesh(3, 16))
    values = linear_spectrum(d, mass, number, Mesh(3, 16))[0][:4]
    assert values[0].real > 0.0 > values[1].real > values[3].real > -0.04
    for value in values:
        assert abs(root_near(whole, value) - value) < 0.015 * abs(value)


@pytest.mark.parametrize("layer", [False, True], ids=["bare", "layered"])
@pytest.mark.parametrize("mass, number", [(4.0, 2.0), (4.0, 5.87), (10.0, 8.5)])
def test_a_porosity_of_next_to_nothing_is_none(mass, number, layer):
    """Z and the eigenvalues of the quasi-steady wall are the limit, to 1e-7. For x -> 0 the flow of
    a node is 1 + x²/3 of the quasi-steady one, |x²| = |p| sigma_w / P, sigma_w at most 8e-6: what
    is left is of first order, ten times as much at a porosity of 1e-8.
    """
    quiet = SPINDLE.replace(**(HALF_LAYER if layer else {})).replace(bearing__porosity=0.0)
    mesh, left = Mesh(3, 16), []
    exact = impedance(quiet, mass, number, mesh)
    modes = [v for v in linear_spectrum(quiet, mass, number, mesh)[0] if v.imag > -v.real][:3]
    for porosity in (1e-9, 1e-8):
        d = quiet.replace(bearing__porosity=porosity)
        z = impedance(d, mass, number, mesh)
        assert 0.0 < d.sigma_wall(number) < 8e-6 * (porosity / 1e-9)
        for p in (0.0, 0.5j, 1j, 2j, 1j + 0.1):
            wanted = exact.at(p)
            off = np.abs(z.at(p) - wanted).max() / np.abs(wanted).max()
            assert off < 1e-7 * (porosity / 1e-9)
        left.append(off)
        values = linear_spectrum(d, mass, number, mesh)[0]
        for mode in modes:
            assert np.abs(values - mode).min() < 1e-7 * (porosity / 1e-9) * abs(mode)
    assert left[1] == pytest.approx(10.0 * left[0], rel=1e-3)


def test_the_threshold_of_next_to_no_porosity_is_the_quasi_steady_one():
    """To what bisection leaves of it, a millionth, and sigma_w's share."""
    masses = [
        whirl_thresholds(
            SPINDLE.replace(bearing__porosity=porosity), 8.5, Mesh(3, 16), (4.0, 20.0), 3
        )[0].critical_mass
        for porosity in (0.0, 1e-9)
    ]
    assert masses[1] == pytest.approx(masses[0], rel=1e-5)


def _grows(design, mass, bearing_number, ratio):
    """Growth of a small disturbance per revolution, from the orbit in time."""
    run = Run(design, mass, bearing_number, mesh=Mesh(4, 16), ramp=0.0)
    run.memory.state[run.n] = 1e-3
    run.go(40, 1e-6)
    _, record = run.go(40, 1e-6, samples=24)
    path = record.path.reshape(-1, 8)
    radius, angle = np.hypot(path[:, 0], path[:, 1]), np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
    assert abs(angle[-1] - angle[0]) / (2.0 * math.pi * (len(angle) - 1) / 24) == pytest.approx(
        ratio, rel=0.05
    )
    return 24.0 * np.polyfit(np.arange(len(radius)), np.log(radius), 1)[0]


@pytest.mark.parametrize("name", ["sigma 10", "sigma 1000", "layer"])
def test_growth_in_time_on_both_sides_of_the_threshold(name):
    """With whirl faster than the shaft (pneumatic hammer) too."""
    numbers, _, _, (ratio, mass_number) = TABLE[name]
    d = storing_design(*numbers)
    unit = d.mass_number(1.0, numbers[3])
    for share in (0.95, 1.05):
        found = _grows(d, share * mass_number / unit, numbers[3], ratio)
        leading = linear_spectrum(d, share * mass_number / unit, numbers[3], Mesh(4, 16))[0][0]
        assert (found > 0.0) == (share > 1.0)
        assert found == pytest.approx(2.0 * math.pi * leading.real, rel=0.05)


@pytest.mark.parametrize(
    "changes, exponent",
    [({}, -0.166), ({"bearing__porosity": 1e-9}, -0.166), (LAYERED, -0.167)],
    ids=["quiet", "all but quiet", "layered"],
)
def test_fed_spindle_that_runs_round(changes, exponent):
    """An independent code on 6 and 8 latitudes has 0.334 and 0.338, which second order extrapolates
    to 0.343, and exponents of -0.163 to -0.169.
    """
    point = solve_point(SPINDLE.replace(**changes), 4.0, 5.87)
    assert point.regime.text == "periodic-1"
    assert point.max_eccentricity == pytest.approx(0.340, abs=0.006)
    assert point.mle.value == pytest.approx(exponent, abs=0.008)


def test_fed_spindle_with_storage_whirls_up_to_the_wall():
    point = solve_point(SPINDLE.replace(**POROUS), 4.0, 5.87)
    assert point.regime is None or point.regime.name != "periodic"
    assert point.max_eccentricity > 0.9


def test_unfed_bearing_with_storage(design):
    """The exponent is the slowest flow's in the wall: -0.235 and -0.232 by an independent code, on
    ten and sixteen cells that are slower than the wall itself by a per cent or two.
    """
    point = solve_point(design.replace(**POROUS), 20.0, 2.0)
    assert point.regime.text == "periodic-1"
    assert point.max_eccentricity == pytest.approx(0.9235, abs=0.003)
    assert point.mle.value == pytest.approx(-0.2335, abs=0.007)


@pytest.mark.slow
@pytest.mark.parametrize("wall", [POROUS, HALF_LAYER], ids=["bare", "layered"])
def test_both_methods_follow_the_same_orbit(wall):
    """The explicit series shares no formula of the implicit step but the mesh."""
    runs = {}
    for method, tolerance in (("rodas", 1e-8), ("dtm", 1e-8)):
        runs[method] = Run(
            SPINDLE.replace(**wall), 4.0, 5.87, mesh=Mesh(2, 16), method=method, ramp=0.0
        )
        runs[method].go(3, tolerance, tangent=True)
    difference = runs["rodas"].memory.state - runs["dtm"].memory.state
    assert np.abs(difference).max() < 1e-6
    angle = runs["rodas"].memory.tangent @ runs["dtm"].memory.tangent
    assert angle == pytest.approx(1.0, abs=1e-6)
    rates = [run.go(1, 1e-8, tangent=True)[1].growth[0] for run in runs.values()]
    assert rates[0] == pytest.approx(rates[1], abs=1e-6)
