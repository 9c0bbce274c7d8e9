"""Film: stiffness against boundary-value solutions, exact limits, order of convergence,
conservation of gas.

Stiffness table: docs/model.md, from the linearised boundary-value problem solved to 1e-9 by other
means."""

import math

import numpy as np
import pytest

from spab_core.linear_theory.equilibrium import concentric_stiffness, static_equilibrium
from spab_core.solver.film import (
    Mesh,
    build_film,
    film_array,
    film_fluxes,
    film_size,
    gas_content,
    on_azimuths,
    suitable_mesh,
)
from spab_core.solver.rotor import build_rotor
from spab_core.solver.slope import build_work, slope
from spab_core.solver.system import System
from tests.conftest import fed_design

TABLE = [  # edge latitude, P_s, beta, Lambda, K_xx, K_xy
    (29, 5, 1, 1e-6, 4.97716, 0.0),
    (45, 5, 1, 1e-6, 6.69098, 0.0),  # K_0
    (29, 1, 0, 1.0, 0.02303, 0.23639),
    (29, 1, 0, 3.45, 0.24822, 0.73916),
    (29, 1, 0, 10.0, 1.18239, 1.22492),
    (29, 1, 0.2168, 1.0, 0.02121, 0.22698),
    (29, 1, 0.2168, 3.45, 0.23024, 0.71509),
    (29, 1, 0.2168, 10.0, 1.13235, 1.22297),
    (29, 5, 1, 1.0, 4.97816, 0.02906),
    (29, 5, 1, 3.45, 4.98895, 0.09896),
    (29, 5, 1, 10.0, 5.06661, 0.25962),
    (45, 1, 0, 1.0, 0.15364, 0.70688),
    (45, 1, 0, 3.45, 1.22106, 1.63378),
    (45, 1, 0, 10.0, 2.79095, 1.32069),
    (45, 5, 1, 1.0, 6.70071, 0.20227),
    (45, 5, 1, 3.45, 6.80388, 0.68071),
    (45, 5, 1, 10.0, 7.48257, 1.64673),
]


def _rows(function):
    return pytest.mark.parametrize(
        "row", TABLE, ids=lambda r: f"edge{r[0]}-Ps{r[1]}-beta{r[2]}-L{r[3]}"
    )(function)


@_rows
def test_stiffness_table_to_its_last_digit(row):
    """Ten latitudes; the first harmonic is exact on eight azimuths."""
    edge, supply, beta, bearing_number, *expected = row
    found = concentric_stiffness(fed_design(edge, supply, beta), bearing_number, Mesh(10, 8))
    assert np.allclose(found, expected, rtol=0, atol=1e-5)


@_rows
def test_stiffness_on_the_mesh_of_a_run_within_a_thousandth(row):
    edge, supply, beta, bearing_number, *expected = row
    design = fed_design(edge, supply, beta)
    found = concentric_stiffness(design, bearing_number, suitable_mesh(design))
    assert abs(complex(*found) - complex(*expected)) < 0.001 * abs(complex(*expected))


@pytest.mark.parametrize("edge, supply, beta", [(29, 5, 1), (45, 5, 1), (29, 1, 0.2168)])
def test_stiffness_converges_faster_than_any_order_in_latitude(edge, supply, beta):
    """From two latitudes to four the observed order is above 3, from four to eight above that, or
    at rounding.
    """
    k = [
        np.array(concentric_stiffness(fed_design(edge, supply, beta), 3.45, Mesh(m, 8)))
        for m in (2, 4, 8, 14)
    ]
    errors = [np.abs(x - k[-1]).max() for x in k[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[0] > 3.0 and (orders[1] > orders[0] or errors[2] < 1e-10), (errors, orders)


def test_static_equilibrium_converges_geometrically_around(design):
    """Eight azimuths more divide the error by the same factor again and again, as for an analytic
    film; differences of successive meshes, no reference value used.
    """
    rest = [static_equilibrium(design, 10.0, 2.0, Mesh(3, n)) for n in (8, 16, 24, 32)]
    k = np.array([[r.eccentricity, math.radians(r.attitude_angle)] for r in rest])
    change = np.abs(np.diff(k, axis=0)).max(axis=1)
    assert (change[1:] < 0.05 * change[:-1]).all(), change


@pytest.mark.parametrize("bearing_number", [0.5, 3.45, 10.0])
def test_closed_sphere_limit(bearing_number):
    """K_xx + i K_xy = (4 pi / 3) i L / (2 + i L) as the band closes over the sphere (exact,
    docs/model.md).
    """
    exact = 4.0 * math.pi / 3.0 * 1j * bearing_number / (2.0 + 1j * bearing_number)
    found = concentric_stiffness(fed_design(89.5, 1, 0), bearing_number, Mesh(12, 8))
    assert abs(complex(*found) - exact) < 2e-4 * abs(exact)  # the part of half a degree


def test_unfed_film_at_rest_has_no_stiffness():
    """Without speed or feeding there is no pressure: K_0 = 0."""
    assert np.abs(concentric_stiffness(fed_design(29, 1, 0), 1e-2, Mesh(3, 16))).max() < 0.01


@pytest.mark.parametrize("offset", [None, 0.25])
@pytest.mark.parametrize("mesh", [Mesh(3, 16), Mesh(4, 24), Mesh(12, 8)], ids=str)
def test_gas_changes_only_through_edge_and_wall(design, mesh, offset):
    """d/dtau of the film's content equals the flow through the open edge and the wall, to rounding,
    in the kernel.
    """
    film = build_film(design, 3.45, mesh, offset)
    random = np.random.default_rng(1)
    s = 1.0 + 0.3 * random.random((film.latitudes, mesh.azimuth))
    x, y = 0.6, -0.5
    state = np.zeros(film_size(film) + 8)
    state[:-8] = s.ravel()
    state[-8:-6] = x, y
    out = np.zeros_like(state)
    slope(System(film, build_rotor(design, 5.0, 3.45)), 0.0, state, build_work(film), out)
    rate = gas_content(film, film_array(film, out))
    flux = film_fluxes(film, s, x, y)
    crossing = flux.pop("edge").sum() * 2.0 * math.pi / mesh.azimuth + gas_content(
        film, flux["wall"]
    )
    scale = sum(gas_content(film, np.abs(f)) for f in flux.values())
    assert abs(rate - crossing) < 1e-14 * scale
    assert abs(rate) > 1e-3 * scale  # something did cross


def test_more_azimuths_hold_the_same_field():
    """A trigonometric polynomial of degree 7 and the cosine that 16 azimuths see, exactly."""
    random = np.random.default_rng(3)
    cosines, sines = random.standard_normal((2, 3, 9))
    sines[:, 8] = 0.0

    def field(count):
        angle = np.outer(np.arange(9), 2.0 * math.pi * np.arange(count) / count)
        return cosines @ np.cos(angle) + sines @ np.sin(angle)

    more = on_azimuths(field(16), 24)
    assert np.abs(more - field(24)).max() < 1e-13
