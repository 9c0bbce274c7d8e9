"""The gas film: polynomials in latitude times a ring of columns, and the semi-discrete Reynolds
equation (docs/model.md).

Unknown: S = P H, the gas content, at M latitudes of the half band times N azimuths, so that

    dS/dtau = (1/2 Lambda) [ (1/cos l) d_l(cos l H³/2 d_l Q) + (1/cos² l) d_t(H³/2 d_t Q) + beta
    (P_s² - Q) ] - d_t S / 2

with P = S/H, Q = P². Across the band Q - 1 is an even polynomial that vanishes at the open edge,
through its values at the positive Gauss points; the flux is an odd polynomial through its values at
the positive Gauss-Lobatto points, whose exact derivative is taken at the Gauss points (a staggered
pair as in Kopriva and Kolias, J. Comput. Phys. 125, 1996). Gauss's rule integrates that derivative
exactly, so that gas is conserved to rounding. Around, fluxes are central and second order, and in
the default scheme differences are exact for the first harmonic, which carries the force.
:func:`film_slope` is the readable formula; :mod:`spab_core.solver.slope` computes the same, fast.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from spab_core.common.errors import DesignError
from spab_core.design.model import Design
from spab_core.solver.row_ops import span
from spab_core.solver.simd import HALF, WIDTH, aligned_zeros


class Mesh(NamedTuple):
    """Nodes of the half band: ``latitude`` M from the equator to the edge, ``azimuth`` N around
    (even).
    """

    latitude: int
    azimuth: int

    def __str__(self) -> str:
        return f"{self.latitude}x{self.azimuth}"


DEFAULT_MESH = Mesh(4, 48)
SCHEMES = ("fitted", "plain")
MESH_LIMITS = ((2, 16), (8, 256))


def parse_mesh(text: str) -> Mesh:
    """Read "4x48".

    Raises :class:`DesignError` for anything but a whole number and an even one in range.
    """
    (m_low, m_high), (n_low, n_high) = MESH_LIMITS
    parts = str(text).lower().split("x")
    if len(parts) == 2 and all(p.isascii() and p.isdigit() and len(p) < 6 for p in parts):
        mesh = Mesh(int(parts[0]), int(parts[1]))
        if (
            m_low <= mesh.latitude <= m_high
            and n_low <= mesh.azimuth <= n_high
            and mesh.azimuth % 2 == 0
        ):
            return mesh
    raise DesignError(
        f"mesh = {str(text)[:40]!r} is not allowed: give latitudes x azimuths of the half band, "
        "such as "
        f"4x48, from {m_low}x{n_low} to {m_high}x{n_high}, the azimuths even"
    )


class Film(NamedTuple):
    """Everything the film kernels need, at one bearing number.

    A row of the state holds two opposite columns, r and r + N/2, each padded to four or a multiple
    of eight latitudes; a padded place keeps S = 1 and touches nothing. Opposite columns have
    opposite cosines, so vectors over a row hold the negative in their second half wherever a
    formula multiplies by cos(theta) or sin(theta) of the column.

    Attributes
    ----------
    latitudes, columns : int
        M and N.
    row : tuple
        () where a row fills one register, else (half,): its type tells the compiler which case to
        compile.
    rows : int
        N/2.
    node, flux_node : ndarray, (2 half,)
        cos(latitude) at the Gauss points and at the flux points; signed.
    gradient : ndarray, (half * 2 half,)
        1/(2 Lambda) times 1/2 times cos(latitude) d_l of a polynomial, at the flux points, from Q -
        1 at the Gauss points; by columns.
    divergence : ndarray, (half * 2 half,)
        (1/cos l) d_l of the flux polynomial at the Gauss points, from its values at the flux
        points; by columns.
    across : ndarray, (4 * half * 2 half,)
        divergence diag((1 - flux_node g)³) gradient as a cubic in g: its four coefficients.
    flux_around : ndarray, (2 half,)
        The same scale times the geometry of a face between columns: multiply with H³ and the
        difference of Q.
    couette, feed : ndarray, (2 half,)
        Half the azimuthal difference quotient's factor, and beta/(2 Lambda).
    weight : ndarray, (2 half,)
        2 dtheta times the weight of the integral of cos²: the node's share of the force, both
        halves of the band; signed.
    cos, sin, cos_face, sin_face : ndarray, (rows,)
        of the azimuth at the first half's columns and half a column further.
    supply : float
        P_s².
    unit : ndarray, (half * 2 half,)
        Unit vectors of both halves, by columns.
    eye : ndarray, ((2 half)²,)
        The unit matrix of a row.
    area : ndarray, (M,)
        Weight of the integral of cos(latitude) times dtheta: the node's area on the unit sphere,
        half band.
    """

    latitudes: int
    columns: int
    row: tuple[int, ...]
    rows: int
    node: np.ndarray
    flux_node: np.ndarray
    gradient: np.ndarray
    divergence: np.ndarray
    across: np.ndarray
    flux_around: np.ndarray
    couette: np.ndarray
    feed: np.ndarray
    weight: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    cos_face: np.ndarray
    sin_face: np.ndarray
    supply: float
    unit: np.ndarray
    eye: np.ndarray
    area: np.ndarray

    @property
    def padded_latitudes(self) -> int:
        """Places for latitudes in a column of the state: M or more."""
        return int(span(self.row))


@functools.cache
def latitude_operators(
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The staggered pair of polynomials on [0, 1], symmetric about 0.

    Parameters
    ----------
    count : int
        M.

    Returns
    -------
    node, weight : ndarray, (M,)
        Positive Gauss points of order 2 M and their weights.
    flux_node : ndarray, (M,)
        Positive Gauss-Lobatto points of order 2 M + 1; the last is 1.
    gradient : ndarray, (M, M)
        From values at the nodes of an even polynomial that vanishes at 1 to its derivative at the
        flux nodes.
    divergence : ndarray, (M, M)
        From values at the flux nodes of an odd polynomial to its derivative at the nodes.
    """
    points, weights = legendre.leggauss(2 * count)
    node, weight = points[count:], weights[count:]
    inner = legendre.Legendre.basis(2 * count).deriv().roots().real
    flux_node = np.append(np.sort(inner[inner > 1e-9]), 1.0)
    even, odd = (
        np.eye(2 * count)[:, first::2] for first in (0, 1)
    )  # Legendre coefficients of the bases
    even_slope, odd_slope = legendre.legder(even), legendre.legder(odd)
    bubble = (1.0 - node[:, None] ** 2) * legendre.legval(node, even).T
    bubble_slope = (1.0 - flux_node[:, None] ** 2) * legendre.legval(
        flux_node, even_slope
    ).T - 2.0 * flux_node[:, None] * legendre.legval(flux_node, even).T
    gradient = bubble_slope @ np.linalg.inv(bubble)
    divergence = legendre.legval(node, odd_slope).T @ np.linalg.inv(
        legendre.legval(flux_node, odd).T
    )
    divergence += (
        np.eye(count)[-1] - weight @ divergence
    )  # the integral is the flux at the edge to the last bit of rounding
    for array in (node, weight, flux_node, gradient, divergence):
        array.flags.writeable = False  # they are shared
    return node, weight, flux_node, gradient, divergence


def build_film(
    design: Design, bearing_number: float, mesh: Mesh = DEFAULT_MESH, scheme: str = "fitted"
) -> Film:
    """Nodes and coefficients of the film at one bearing number.

    Parameters
    ----------
    design : Design
    bearing_number : float
        Lambda > 0.
    mesh : Mesh
    scheme : str
        ``fitted``: differences around are exact for the first harmonic. ``plain``: central
        differences. Both are second order; the Couette term of ``plain`` turns the film 0.6 % too
        slowly at N = 32, which is enough to unlock a half-speed whirl.

    Returns
    -------
    Film
    """
    m, n = mesh
    half = HALF if m <= HALF else -(-m // WIDTH) * WIDTH
    rows, width = n // 2, 2 * half
    edge, dt = math.radians(design.bearing.edge_latitude), 2.0 * math.pi / n
    s, weight, flux_s, gradient, divergence = latitude_operators(m)
    cosine, flux_cosine = np.cos(edge * s), np.cos(edge * flux_s)
    scale = 0.5 / (2.0 * bearing_number)
    gradient = scale * flux_cosine[:, None] * gradient / edge
    divergence = divergence / (edge * cosine[:, None])
    if scheme == "fitted":
        # sin(dt) for dt and 2 - 2 cos(dt) for dt² make cos(t) and sin(t) exact
        step, step2 = math.sin(dt), 2.0 * (1.0 - math.cos(dt))
    else:
        step, step2 = dt, dt**2

    def vector(values: np.ndarray | float, signed: bool = False) -> np.ndarray:
        out = aligned_zeros(width)
        out[:m] = values
        out[half : half + m] = -np.asarray(values) if signed else values
        return out

    def matrix(values: np.ndarray, signed: bool = False) -> np.ndarray:
        out = aligned_zeros(half * width)
        columns = out.reshape(half, width)
        columns[:m, :m] = values.T
        columns[:m, half : half + m] = -values.T if signed else values.T
        return out

    across = aligned_zeros(4 * half * width)
    for k, binomial in enumerate((1.0, -3.0, 3.0, -1.0)):
        power = divergence @ (binomial * flux_cosine[:, None] ** k * gradient)
        across[k * half * width : (k + 1) * half * width] = matrix(power, signed=k % 2 == 1)
    unit, eye = aligned_zeros(half * width), aligned_zeros(width * width)
    unit[:] = np.tile(np.eye(half), 2).ravel()
    eye[:] = np.eye(width).ravel()
    theta = np.arange(rows) * dt
    return Film(
        latitudes=m,
        columns=n,
        row=() if half == HALF else (half,),
        rows=rows,
        node=vector(cosine, signed=True),
        flux_node=vector(flux_cosine, signed=True),
        gradient=matrix(gradient),
        divergence=matrix(divergence),
        across=across,
        flux_around=vector(scale / (cosine**2 * step2)),
        couette=vector(0.25 / step),
        feed=vector(design.feeding_number / (2.0 * bearing_number)),
        weight=vector(2.0 * dt * edge * weight * cosine**2, signed=True),
        cos=np.cos(theta),
        sin=np.sin(theta),
        cos_face=np.cos(theta + 0.5 * dt),
        sin_face=np.sin(theta + 0.5 * dt),
        supply=design.bearing.supply_pressure_ratio**2,
        unit=unit,
        eye=eye,
        area=edge * weight * cosine * dt,
    )


def film_size(film: Film) -> int:
    """Number of film entries in the state vector, padding included."""
    return film.rows * 2 * film.padded_latitudes


def film_index(film: Film) -> np.ndarray:
    """Positions in the state vector of S[azimuth, latitude], shape (N, M)."""
    places = np.arange(film_size(film)).reshape(film.rows, 2, film.padded_latitudes)
    return places.transpose(1, 0, 2).reshape(film.columns, film.padded_latitudes)[
        :, : film.latitudes
    ]


def film_array(film: Film, state: np.ndarray) -> np.ndarray:
    """The film part of a state vector as S[azimuth, latitude], without the padding.

    Shape (N, M).
    """
    return state[film_index(film)]


def _geometry(film: Film) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """cos(latitude) at the nodes, and cosine and sine of the azimuth at the columns and at the
    faces east of them.
    """
    cos, sin, cos_face, sin_face = (
        np.concatenate([a, -a]) for a in (film.cos, film.sin, film.cos_face, film.sin_face)
    )
    return film.node[: film.latitudes], cos, sin, cos_face, sin_face


def _small(film: Film, matrix: np.ndarray) -> np.ndarray:
    """A matrix over latitudes without padding, (M, M)."""
    return matrix.reshape(film.padded_latitudes, 2 * film.padded_latitudes)[
        : film.latitudes, : film.latitudes
    ].T


def thickness(film: Film, x: float, y: float) -> np.ndarray:
    """Film thickness H = 1 - cos l (X cos t + Y sin t) at the nodes, over C. Shape (N, M)."""
    node, cos, sin, _, _ = _geometry(film)
    return 1.0 - np.outer(x * cos + y * sin, node)


def film_fluxes(film: Film, s: np.ndarray, x: float, y: float) -> dict[str, np.ndarray]:
    """The terms of dS/dtau, each of shape (N, M): the readable discrete Reynolds equation.

    Parameters
    ----------
    film : Film
    s : ndarray, (N, M)
        S = P H.
    x, y : float
        Journal centre over C.

    Returns
    -------
    dict
        ``latitude``, ``azimuth``, ``couette``, ``wall``, and ``edge``, (N,): gas that enters each
        column through the open edge, per unit tau and azimuth.
    """
    m = film.latitudes
    node, cos, sin, cos_face, sin_face = _geometry(film)
    q = (s / thickness(film, x, y)) ** 2
    gap = 1.0 - np.outer(x * cos + y * sin, film.flux_node[:m])
    flux = gap**3 * ((q - 1.0) @ _small(film, film.gradient).T)
    gap = 1.0 - np.outer(x * cos_face + y * sin_face, node)
    east = film.flux_around[:m] * gap**3 * (np.roll(q, -1, axis=0) - q)
    return {
        "latitude": flux @ _small(film, film.divergence).T,
        "azimuth": east - np.roll(east, 1, axis=0),
        "couette": -film.couette[:m] * (np.roll(s, -1, axis=0) - np.roll(s, 1, axis=0)),
        "wall": film.feed[:m] * (film.supply - q),
        "edge": flux[:, -1],
    }


def film_slope(film: Film, s: np.ndarray, x: float, y: float) -> np.ndarray:
    """dS/dtau of the semi-discrete Reynolds equation, shape (N, M). See :func:`film_fluxes`."""
    flux = film_fluxes(film, s, x, y)
    return flux["latitude"] + flux["azimuth"] + flux["couette"] + flux["wall"]


def film_force(film: Film, s: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Force of the whole band on the journal, (F_x, F_y) over p_a R²."""
    _, cos, sin, _, _ = _geometry(film)
    excess = ((s / thickness(film, x, y) - 1.0) * film.weight[: film.latitudes]).sum(axis=1)
    return -float(excess @ cos), -float(excess @ sin)


def gas_content(film: Film, s: np.ndarray) -> float:
    """Gas in the half band: integral of P H over the unit sphere's surface."""
    return float((s * film.area).sum())
