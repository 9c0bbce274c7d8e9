"""The gas film: polynomials in latitude times Fourier series around, and the semi-discrete Reynolds
equation (docs/model.md).

Unknown: S = P H, the gas content, at M latitudes of the half band times N azimuths, so that

    dS/dtau = (1/2 Lambda) [ (1/cos l) d_l(cos l H³/2 d_l Q) + (1/cos² l) d_t(H³/2 d_t Q) + beta
    (P_s² - Q) ] - d_t S / 2

with P = S/H, Q = P². Across the band Q - 1 is an even polynomial that vanishes at the open edge,
through its values at the positive Gauss points; the flux is an odd polynomial through its values at
the positive Gauss-Lobatto points, whose exact derivative is taken at the Gauss points (a staggered
pair as in Kopriva and Kolias, J. Comput. Phys. 125, 1996). Around, Q and S are trigonometric
polynomials through their values at N equidistant azimuths; the flux is taken half a spacing further,
at the faces, and differentiated back to the azimuths. Gauss's rule integrates the derivative across
exactly, and the sum of a derivative around is zero, so that gas is conserved to rounding.
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
from spab_core.solver.simd import WIDTH, aligned_zeros, circulant


class Mesh(NamedTuple):
    """Nodes of the half band: ``latitude`` M from the equator to the edge, ``azimuth`` N around (a
    multiple of eight). :data:`AUTO` leaves them to :func:`suitable_mesh`.
    """

    latitude: int
    azimuth: int

    def __str__(self) -> str:
        return f"{self.latitude}x{self.azimuth}" if self.latitude else "auto"


AUTO = Mesh(0, 0)
# azimuths, usually and at eccentricities that ask for more
AZIMUTHS, MORE_AZIMUTHS = 16, 24
MESH_LIMITS = ((2, 16), (8, 64))


def suitable_mesh(design: Design, azimuths: int = AZIMUTHS) -> Mesh:
    """Return a mesh that resolves a design's film (docs/numerics.md, benchmarks/mesh.py).

    A supply makes a layer at the open edge, thinner the more the wall passes; a wide band of a
    sphere has latitudes near the pole, where the film hardly changes.
    """
    bearing = design.bearing
    latitudes = 3 + (bearing.edge_latitude > 40.0) + (bearing.edge_latitude > 60.0)
    if bearing.supply_pressure_ratio != 1.0:
        latitudes += 1 + (design.feeding_number > 2.0)
    return Mesh(latitudes, azimuths)


def parse_mesh(text: str) -> Mesh:
    """Read "3x16", or "auto".

    Raises :class:`DesignError` for anything but a whole number and a multiple of eight in range.
    """
    if str(text).lower() == str(AUTO):
        return AUTO
    (m_low, m_high), (n_low, n_high) = MESH_LIMITS
    parts = str(text).lower().split("x")
    if len(parts) == 2 and all(p.isascii() and p.isdigit() and len(p) < 6 for p in parts):
        mesh = Mesh(int(parts[0]), int(parts[1]))
        if (
            m_low <= mesh.latitude <= m_high
            and n_low <= mesh.azimuth <= n_high
            and mesh.azimuth % WIDTH == 0
        ):
            return mesh
    raise DesignError(
        f"mesh = {str(text)[:40]!r} is not allowed: give latitudes x azimuths of the half band, "
        f"such as 3x16, from {m_low}x{n_low} to {m_high}x{n_high}, the azimuths a multiple of "
        f"{WIDTH}; or auto"
    )


class Film(NamedTuple):
    """Everything the film kernels need, at one bearing number.

    The film's part of a state holds S by latitudes, N azimuths each. Matrices over azimuths are
    stored by columns, those over latitudes by rows.

    Attributes
    ----------
    latitudes, columns : int
        M and N.
    ring : tuple
        N/8 zeros: its type tells the compiler how many registers hold a latitude.
    node, flux_node : ndarray, (M,)
        cos(latitude) at the Gauss points and at the flux points.
    gradient : ndarray, (M * M,)
        1/(2 Lambda) times 1/2 times cos(latitude) d_l of a polynomial, at the flux points, from Q -
        1 at the Gauss points.
    divergence : ndarray, (M * M,)
        (1/cos l) d_l of the flux polynomial at the Gauss points, from its values at the flux
        points.
    across : ndarray, (4 * M * M,)
        divergence diag((1 - flux_node g)³) gradient as a cubic in g: its four coefficients.
    around : ndarray, (M,)
        1/(2 Lambda) times 1/2 over cos²(latitude): times H³ and the derivative around of Q it is
        the flux through a face.
    to_face, from_face, couette : ndarray
        Derivative around at the faces, from values at the azimuths; and back; -1/2 times the one at
        the azimuths: as :func:`spab_core.solver.simd.circulant` stores them.
    harmonics : ndarray, (8 * N * N,)
        Products from_face diag(f) to_face for f = 1, cos t, sin t, cos 2t, sin 2t, cos 3t, sin 3t,
        of which H³ at the faces is a sum; then ``couette``, in full.
    feed : float
        beta/(2 Lambda).
    weight : ndarray, (M,)
        2 dtheta times the weight of the integral of cos²: the node's share of the force, both
        halves of the band.
    cos, sin, cos_face, sin_face : ndarray, (N,)
        of the azimuths and of the faces, half a spacing further.
    supply : float
        P_s².
    area : ndarray, (M,)
        Weight of the integral of cos(latitude) times dtheta: the node's area on the unit sphere,
        half band.
    """

    latitudes: int
    columns: int
    ring: tuple[int, ...]
    node: np.ndarray
    flux_node: np.ndarray
    gradient: np.ndarray
    divergence: np.ndarray
    across: np.ndarray
    around: np.ndarray
    to_face: np.ndarray
    from_face: np.ndarray
    couette: np.ndarray
    harmonics: np.ndarray
    feed: float
    weight: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    cos_face: np.ndarray
    sin_face: np.ndarray
    supply: float
    area: np.ndarray


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


def azimuth_derivative(count: int, shift: float) -> np.ndarray:
    """Derivative of the trigonometric polynomial through values at equidistant azimuths (Trefethen,
    Spectral Methods in MATLAB, ch. 3).

    Parameters
    ----------
    count : int
        N, even. The highest harmonic, N/2, is the cosine that the azimuths see.
    shift : float
        How much further than the azimuths the derivative is taken, in spacings.

    Returns
    -------
    ndarray, (N, N)
        Its columns sum to zero.
    """
    step = 2.0 * math.pi / count
    # a difference of two azimuths is one of N angles: all columns hold the same N numbers
    angle = step * (np.arange(count) + shift)
    order = np.arange(1, count // 2 + 1)
    weight = np.where(order < count // 2, 2.0, 1.0) * order / count
    kernel = -(np.sin(np.outer(angle, order)) @ weight)
    kernel -= kernel.mean()
    return kernel[(np.arange(count)[:, None] - np.arange(count)) % count]


def build_film(design: Design, bearing_number: float, mesh: Mesh = AUTO) -> Film:
    """Nodes and coefficients of the film at one bearing number.

    Parameters
    ----------
    design : Design
    bearing_number : float
        Lambda > 0.
    mesh : Mesh

    Returns
    -------
    Film
    """
    m, n = mesh if mesh != AUTO else suitable_mesh(design)
    edge, dt = math.radians(design.bearing.edge_latitude), 2.0 * math.pi / n
    s, weight, flux_s, gradient, divergence = latitude_operators(m)
    cosine, flux_cosine = np.cos(edge * s), np.cos(edge * flux_s)
    scale = 0.5 / (2.0 * bearing_number)
    gradient = scale * flux_cosine[:, None] * gradient / edge
    divergence = divergence / (edge * cosine[:, None])
    to_face, from_face, couette, harmonics = _azimuth_operators(n)
    across = [
        divergence @ (binomial * flux_cosine[:, None] ** k * gradient)
        for k, binomial in enumerate((1.0, -3.0, 3.0, -1.0))
    ]
    theta = np.arange(n) * dt
    return Film(
        latitudes=m,
        columns=n,
        ring=(0,) * (n // WIDTH),
        node=cosine,
        flux_node=flux_cosine,
        gradient=gradient.ravel(),
        divergence=divergence.ravel(),
        across=np.array(across).ravel(),
        around=scale / cosine**2,
        to_face=to_face,
        from_face=from_face,
        couette=couette,
        harmonics=harmonics,
        feed=design.feeding_number / (2.0 * bearing_number),
        weight=2.0 * dt * edge * weight * cosine**2,
        cos=_aligned(np.cos(theta)),
        sin=_aligned(np.sin(theta)),
        cos_face=_aligned(np.cos(theta + 0.5 * dt)),
        sin_face=_aligned(np.sin(theta + 0.5 * dt)),
        supply=design.bearing.supply_pressure_ratio**2,
        area=edge * weight * cosine * dt,
    )


def _aligned(values: np.ndarray) -> np.ndarray:
    """The values, flat, from the start of a cache line on; matrices by columns."""
    out = aligned_zeros(values.size)
    out[:] = values.T.ravel()
    return out


@functools.cache
def _azimuth_operators(count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """``to_face``, ``from_face``, ``couette`` and ``harmonics`` of a :class:`Film`."""
    to_face, from_face = azimuth_derivative(count, 0.5), azimuth_derivative(count, -0.5)
    face = 2.0 * math.pi / count * (np.arange(count) + 0.5)
    waves = [np.ones(count), *(f(k * face) for k in (1, 2, 3) for f in (np.cos, np.sin))]
    couette = -0.5 * azimuth_derivative(count, 0.0)
    products = [from_face @ (wave[:, None] * to_face) for wave in waves] + [couette]
    found = (
        circulant(to_face),
        circulant(from_face),
        circulant(couette),
        np.concatenate([_aligned(matrix) for matrix in products]),
    )
    for array in found:
        array.flags.writeable = False  # they are shared
    return found


def film_size(film: Film) -> int:
    """Number of film entries in the state vector."""
    return film.latitudes * film.columns


def film_array(film: Film, state: np.ndarray) -> np.ndarray:
    """The film part of a state vector as S[latitude, azimuth], shape (M, N): a view."""
    return state[: film_size(film)].reshape(film.latitudes, film.columns)


def on_azimuths(field: np.ndarray, count: int) -> np.ndarray:
    """Take a field over the film to more azimuths, by its trigonometric polynomial.

    Parameters
    ----------
    field : ndarray, (..., N)
        Values at the film's azimuths, N even.
    count : int
        Azimuths wanted, more than N.

    Returns
    -------
    ndarray, (..., count)
    """
    n = field.shape[-1]
    waves = np.fft.rfft(field)
    waves[..., n // 2] *= 0.5  # the azimuths see the cosine of the highest harmonic alone
    return np.fft.irfft(waves, count) * (count / n)


def thickness(film: Film, x: float, y: float) -> np.ndarray:
    """Film thickness H = 1 - cos l (X cos t + Y sin t) at the nodes, over C. Shape (M, N)."""
    return 1.0 - np.outer(film.node, x * film.cos + y * film.sin)


def film_fluxes(film: Film, s: np.ndarray, x: float, y: float) -> dict[str, np.ndarray]:
    """The terms of dS/dtau, each of shape (M, N): the readable discrete Reynolds equation.

    Parameters
    ----------
    film : Film
    s : ndarray, (M, N)
        S = P H.
    x, y : float
        Journal centre over C.

    Returns
    -------
    dict
        ``latitude``, ``azimuth``, ``couette``, ``wall``, and ``edge``, (N,): gas that enters each
        azimuth through the open edge, per unit tau and azimuth.
    """
    m, n = film.latitudes, film.columns
    q = (s / thickness(film, x, y)) ** 2
    gap = 1.0 - np.outer(film.flux_node, x * film.cos + y * film.sin)
    flux = gap**3 * (film.gradient.reshape(m, m) @ (q - 1.0))
    gap = 1.0 - np.outer(film.node, x * film.cos_face + y * film.sin_face)
    face = film.around[:, None] * gap**3 * (q @ azimuth_derivative(n, 0.5).T)
    return {
        "latitude": film.divergence.reshape(m, m) @ flux,
        "azimuth": face @ azimuth_derivative(n, -0.5).T,
        "couette": -0.5 * s @ azimuth_derivative(n, 0.0).T,
        "wall": film.feed * (film.supply - q),
        "edge": flux[-1],
    }


def film_slope(film: Film, s: np.ndarray, x: float, y: float) -> np.ndarray:
    """dS/dtau of the semi-discrete Reynolds equation, shape (M, N). See :func:`film_fluxes`."""
    flux = film_fluxes(film, s, x, y)
    return flux["latitude"] + flux["azimuth"] + flux["couette"] + flux["wall"]


def film_force(film: Film, s: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Force of the whole band on the journal, (F_x, F_y) over p_a R²."""
    excess = film.weight @ (s / thickness(film, x, y) - 1.0)
    return -float(excess @ film.cos), -float(excess @ film.sin)


def gas_content(film: Film, s: np.ndarray) -> float:
    """Gas in the half band: integral of P H over the unit sphere's surface."""
    return float(film.area @ s.sum(axis=1))
