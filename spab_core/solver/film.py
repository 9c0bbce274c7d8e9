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
at the faces, and differentiated back to the azimuths. On a cylinder the latitude is the axial
coordinate over R and its cosine 1. Gauss's rule integrates the derivative across exactly, and the sum
of a derivative around is zero, so that gas is conserved to rounding. What the wall's pores store is in
:mod:`spab_core.solver.wall`.
:func:`film_slope` is the readable formula; :mod:`spab_core.solver.slope` computes the same, fast.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from spab_core.common.errors import DesignError
from spab_core.design.model import Bearing, Design
from spab_core.solver.rotor import ROTOR_STATES
from spab_core.solver.simd import WIDTH, aligned_zeros, circulant
from spab_core.solver.wall import SHARE, SPACING, steady_wall


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
# of a state, where the journal moves along the axis: Z, Z' and what fills a register
MOTION_STATES = 8
THIN_FILM = 0.9  # eccentricity of a film that is called thin
MESH_LIMITS = ((2, 16), (8, 64))
_LONG_CYLINDERS = (0.7, 1.5, 2.5)  # length over diameter beyond which a latitude more is needed


def suitable_mesh(design: Design, azimuths: int = AZIMUTHS) -> Mesh:
    """Return a mesh that resolves a design's film (docs/numerics.md, benchmarks/mesh.py).

    A supply makes a layer at the open edge, thinner the more the wall passes; a wide band of a
    sphere has latitudes near the pole, where the film hardly changes; a long cylinder is that many
    diameters.
    """
    bearing = design.bearing
    if bearing.cylindrical:
        latitudes = 3 + sum(bearing.edge > limit for limit in _LONG_CYLINDERS)
    else:
        latitudes = 3 + (bearing.edge_latitude > 40.0) + (bearing.edge_latitude > 60.0)
    if bearing.supply_pressure_ratio != 1.0:
        latitudes += 1 + (bearing.steady_feeding_number > 2.0)
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
    node, flux_node : ndarray, (M,), (F,)
        cos(latitude) at the Gauss points and at the flux points.
    gradient : ndarray, (F * M,)
        1/(2 Lambda) times 1/2 times cos(latitude) d_l of a polynomial, at the flux points, from Q -
        1 at the Gauss points.
    divergence : ndarray, (M * F,)
        (1/cos l) d_l of the flux polynomial at the Gauss points, from its values at the flux
        points.
    across : ndarray, (4 * M * M,)
        divergence diag((flux_base - flux_node g)³) gradient as a cubic in g: its four coefficients.
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
        beta/(2 Lambda) of bulk and layer; where the wall stores gas, of what lies between the film
        and the wall's first cell.
    weight : ndarray, (M,)
        2 dtheta times the weight of the integral of cos²: the node's share of the force, both
        halves of the band (dtheta times it where the whole band is solved).
    cos, sin, cos_face, sin_face : ndarray, (N,)
        of the azimuths and of the faces, half a spacing further.
    supply : float
        P_s².
    area : ndarray, (M,)
        Weight of the integral of cos(latitude) times dtheta: the node's area on the unit sphere,
        half band (half the node's where the whole band is solved).
    depth : tuple
        As many zeros as the wall has cells through its thickness (:mod:`spab_core.solver.wall`); ()
        where it stores no gas.
    conductance : ndarray, (K + 1,)
        beta/(2 Lambda) of what lies between neighbours, from the film, whose is ``feed``, to the
        outer face.
    capacity, per_capacity : ndarray, (K,)
        Pore volume of the cells over the film's, per unit area, and one over it.
    fluxes : int
        F: M on the half band, M + 1 on the whole one.
    base, flux_base : ndarray, (M,), (F,)
        H of the centred journal, 1 - Z sin(latitude), at the Gauss points and at the flux points.
    axial : ndarray, (M,)
        dtheta times the weight of the integral of sin cos: the node's share of the axial force; 0
        on the half band, whose force is none.
    offset : float
        Z, axial displacement of the journal over C, at which ``base``, ``flux_base`` and ``across``
        are; where the journal moves along the axis (:func:`placed`) that of its rest.
    room, thin : float
        Radial eccentricity at which the journal would touch, and at which the least gap is a tenth
        of the clearance (:func:`radial_room`); 1 and 0.9 where Z = 0, or moves.
    slide : tuple
        One zero where the journal moves along the axis (:mod:`spab_core.solver.axial`), () where it
        is held.
    sine, flux_sine : ndarray, (M,), (F,)
        sin(latitude) at the Gauss points and at the flux points.
    edge_cosine, edge_sine : float
        Of the edge's latitude.
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
    depth: tuple[int, ...]
    conductance: np.ndarray
    capacity: np.ndarray
    per_capacity: np.ndarray
    fluxes: int
    base: np.ndarray
    flux_base: np.ndarray
    axial: np.ndarray
    offset: float
    room: float
    thin: float
    slide: tuple[int, ...]
    sine: np.ndarray
    flux_sine: np.ndarray
    edge_cosine: float
    edge_sine: float

    @property
    def edge(self) -> float:
        """Latitude of the edge of a sphere, rad."""
        return math.atan2(self.edge_sine, self.edge_cosine)

    @property
    def whole(self) -> bool:
        """Whether the whole band is solved, from edge to edge."""
        return self.fluxes > self.latitudes


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


def profile(bearing: Bearing, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of the wall from the axis of rotation and height along it, both over R, at
    latitudes s over that of the edge; cos(latitude) in all formulas is the former, 1 on a cylinder.
    """
    latitude = bearing.edge * s
    if bearing.cylindrical:
        return np.ones_like(latitude), latitude
    return np.cos(latitude), np.sin(latitude)


@functools.cache
def band_operators(
    count: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """:func:`latitude_operators` of the whole band, without symmetry: M = 2 ``count`` nodes on
    [-1, 1] and M + 1 flux nodes, the first and the last at the edges.
    """
    m = 2 * count
    node, weight = legendre.leggauss(m)
    inner = np.sort(legendre.Legendre.basis(m).deriv().roots().real)
    flux_node = np.concatenate([[-1.0], inner, [1.0]])
    basis, fluxes = np.eye(m), np.eye(m + 1)
    bubble = (1.0 - node[:, None] ** 2) * legendre.legval(node, basis).T
    slope = (1.0 - flux_node[:, None] ** 2) * legendre.legval(
        flux_node, legendre.legder(basis)
    ).T - 2.0 * flux_node[:, None] * legendre.legval(flux_node, basis).T
    gradient = slope @ np.linalg.inv(bubble)
    divergence = legendre.legval(node, legendre.legder(fluxes)).T @ np.linalg.inv(
        legendre.legval(flux_node, fluxes).T
    )
    divergence += 0.5 * (fluxes[-1] - fluxes[0] - weight @ divergence)
    found = (node, weight, flux_node, gradient, divergence)
    for array in found:
        array.flags.writeable = False  # they are shared
    return found


def radial_room(edge: float, offset: float, gap: float = 0.0) -> float:
    """Radial eccentricity at which a journal displaced along the axis by ``offset`` over C leaves
    the least gap ``gap`` in a sphere's band with edges at the latitude ``edge``.

    The gap 1 - Z sin l - e cos l is least at tan l = Z/e, or at the edge."""
    z, reach = abs(offset), 1.0 - gap
    if z <= reach * math.sin(edge):
        return math.sqrt(reach * reach - z * z)
    return max((reach - z * math.sin(edge)) / math.cos(edge), 0.0)


def least_gap(edge: float, offset: float, eccentricity: float) -> float:
    """Thinnest film over C of a sphere's band at an axial offset and a radial eccentricity."""
    z = abs(offset)
    if math.atan2(z, eccentricity) <= edge:
        return 1.0 - math.hypot(eccentricity, z)
    return 1.0 - z * math.sin(edge) - eccentricity * math.cos(edge)


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


def build_film(
    design: Design,
    bearing_number: float,
    mesh: Mesh = AUTO,
    axial_offset: float | None = None,
    *,
    moving: bool = False,
) -> Film:
    """Nodes and coefficients of the film at one bearing number.

    Parameters
    ----------
    design : Design
    bearing_number : float
        Lambda > 0.
    mesh : Mesh
    axial_offset : float, optional
        Z over C, of the whole band; left out: the half band, symmetric about the equator.
    moving : bool
        Whether the journal moves along the axis, about that offset.

    Returns
    -------
    Film
    """
    m, n = mesh if mesh != AUTO else suitable_mesh(design)
    edge, dt = design.bearing.edge, 2.0 * math.pi / n
    whole = axial_offset is not None
    offset = axial_offset or 0.0
    s, weight, flux_s, gradient, divergence = (band_operators if whole else latitude_operators)(m)
    (cosine, sine), (flux_cosine, flux_sine) = (profile(design.bearing, at) for at in (s, flux_s))
    base, flux_base = 1.0 - offset * sine, 1.0 - offset * flux_sine
    if not whole:
        base, flux_base = np.ones_like(cosine), np.ones_like(flux_cosine)
    scale = 0.5 / (2.0 * bearing_number)
    gradient = scale * flux_cosine[:, None] * gradient / edge
    divergence = divergence / (edge * cosine[:, None])
    to_face, from_face, couette, harmonics = _azimuth_operators(n)
    across = [
        divergence
        @ ((binomial * flux_base ** (3 - k))[:, None] * flux_cosine[:, None] ** k * gradient)
        for k, binomial in enumerate((1.0, -3.0, 3.0, -1.0))
    ]
    theta = np.arange(n) * dt
    conductance, capacity = _wall(design, bearing_number)
    return Film(
        latitudes=len(s),
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
        feed=float(conductance[0]),
        weight=(1.0 if whole else 2.0) * dt * edge * weight * cosine**2,
        cos=_aligned(np.cos(theta)),
        sin=_aligned(np.sin(theta)),
        cos_face=_aligned(np.cos(theta + 0.5 * dt)),
        sin_face=_aligned(np.sin(theta + 0.5 * dt)),
        supply=design.bearing.supply_pressure_ratio**2,
        area=(0.5 if whole else 1.0) * edge * weight * cosine * dt,
        depth=(0,) * len(capacity),
        conductance=conductance,
        capacity=capacity,
        per_capacity=1.0 / capacity,
        fluxes=len(flux_s),
        base=base,
        flux_base=flux_base,
        axial=(dt if whole else 0.0) * edge * weight * sine * cosine,
        offset=offset,
        room=radial_room(edge, offset) if offset and not moving else 1.0,
        thin=radial_room(edge, offset, 1.0 - THIN_FILM) if offset and not moving else THIN_FILM,
        slide=(0,) * moving,
        sine=sine,
        flux_sine=flux_sine,
        edge_cosine=math.cos(edge),
        edge_sine=math.sin(edge),
    )


def placed(film: Film, state: np.ndarray) -> Film:
    """Return the film with ``base`` at the state's Z, where the journal moves along the axis: what
    the readable formulas here take.
    """
    if not film.slide:
        return film
    z = float(state[-MOTION_STATES])
    return film._replace(base=1.0 - z * film.sine, flux_base=1.0 - z * film.flux_sine, offset=z)


def _wall(design: Design, bearing_number: float) -> tuple[np.ndarray, np.ndarray]:
    """``conductance`` and ``capacity`` of a :class:`Film`."""
    bearing = design.bearing
    if not bearing.stores_gas:
        return np.array([bearing.steady_feeding_number / (2.0 * bearing_number)]), np.zeros(0)
    resistance = np.array(SPACING) / bearing.feeding_number
    resistance[0] += 1.0 / bearing.layer_number
    pores = bearing.porosity * bearing.wall_thickness / bearing.clearance
    return 1.0 / (2.0 * bearing_number * resistance), pores * np.array(SHARE)


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


def gas_size(film: Film) -> int:
    """Number of entries of film and wall in the state vector: where the rotor's begin."""
    return film_size(film) * (1 + len(film.depth))


def rotor_size(film: Film) -> int:
    """Number of entries behind the gas in the state vector: the rotor's, then those of axial
    motion.
    """
    return ROTOR_STATES + MOTION_STATES * len(film.slide)


def gas_array(film: Film, state: np.ndarray) -> np.ndarray:
    """Film and wall part of a state vector, shape (1 + K, M, N): S of the film, then P of the
    wall's cells, the first next to the film. A view.
    """
    return state[: gas_size(film)].reshape(-1, film.latitudes, film.columns)


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
    """Film thickness H = 1 - Z sin l - cos l (X cos t + Y sin t) at the nodes, over C. Shape (M,
    N).
    """
    return film.base[:, None] - np.outer(film.node, x * film.cos + y * film.sin)


def film_fluxes(
    film: Film, s: np.ndarray, x: float, y: float, wall: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """The terms of dS/dtau, each of shape (M, N): the readable discrete Reynolds equation.

    Parameters
    ----------
    film : Film
    s : ndarray, (M, N)
        S = P H.
    x, y : float
        Journal centre over C.
    wall : ndarray, (K, M, N), optional
        P of the wall's cells, where it stores gas; left out: as steady flow leaves them.

    Returns
    -------
    dict
        ``latitude``, ``azimuth``, ``couette``, ``wall``, and ``edge``, (N,): gas that enters each
        azimuth through the open edge, per unit tau and azimuth.
    """
    m, n = film.latitudes, film.columns
    q = (s / thickness(film, x, y)) ** 2
    gap = film.flux_base[:, None] - np.outer(film.flux_node, x * film.cos + y * film.sin)
    flux = gap**3 * (film.gradient.reshape(film.fluxes, m) @ (q - 1.0))
    gap = film.base[:, None] - np.outer(film.node, x * film.cos_face + y * film.sin_face)
    face = film.around[:, None] * gap**3 * (q @ azimuth_derivative(n, 0.5).T)
    fed: np.ndarray | float = film.supply
    if film.depth:
        wall = steady_wall(film.conductance, q, film.supply) if wall is None else wall
        fed = wall[0] ** 2
    return {
        "latitude": film.divergence.reshape(m, film.fluxes) @ flux,
        "azimuth": face @ azimuth_derivative(n, -0.5).T,
        "couette": -0.5 * s @ azimuth_derivative(n, 0.0).T,
        "wall": film.feed * (fed - q),
        "edge": 0.5 * (flux[-1] - flux[0]) if film.whole else flux[-1],
    }


def film_slope(
    film: Film, s: np.ndarray, x: float, y: float, wall: np.ndarray | None = None
) -> np.ndarray:
    """dS/dtau of the semi-discrete Reynolds equation, shape (M, N). See :func:`film_fluxes`."""
    flux = film_fluxes(film, s, x, y, wall)
    return flux["latitude"] + flux["azimuth"] + flux["couette"] + flux["wall"]


def pore_slope(film: Film, q: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """dP/dtau of the wall's cells (:mod:`spab_core.solver.wall`), shape (K, M, N).

    Parameters
    ----------
    film : Film
    q : ndarray, (M, N)
        P² of the film.
    wall : ndarray, (K, M, N)
        P of the cells.
    """
    squares = np.concatenate([q[None], wall**2, np.full_like(q, film.supply)[None]])
    flow = film.conductance[:, None, None] * np.diff(squares, axis=0)
    return np.asarray(np.diff(flow, axis=0) / film.capacity[:, None, None])


def axial_force(film: Film, s: np.ndarray, x: float, y: float) -> float:
    """Axial force of the whole band on the journal, F_z over p_a R²; 0 of a half band."""
    return -float(film.axial @ (s / thickness(film, x, y) - 1.0).sum(axis=1))


def film_force(film: Film, s: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Force of the whole band on the journal, (F_x, F_y) over p_a R²."""
    excess = film.weight @ (s / thickness(film, x, y) - 1.0)
    return -float(excess @ film.cos), -float(excess @ film.sin)


def gas_content(film: Film, s: np.ndarray) -> float:
    """Gas in the half band: integral of P H over the unit sphere's surface."""
    return float(film.area @ s.sum(axis=1))


def pore_content(film: Film, wall: np.ndarray) -> float:
    """Gas in the wall behind the half band, in the unit of :func:`gas_content`."""
    return float(film.capacity @ (wall.sum(axis=2) @ film.area))


def without_storage(film: Film) -> Film:
    """Return the film on a wall that stores no gas and passes as much in steady flow."""
    if not film.depth:
        return film
    feed = 1.0 / float((1.0 / film.conductance).sum())
    none = np.zeros(0)
    return film._replace(
        feed=feed, depth=(), conductance=np.array([feed]), capacity=none, per_capacity=none
    )


def with_wall(film: Film, state: np.ndarray) -> np.ndarray:
    """Complete a state of film and rotor by the wall that steady flow leaves behind this film.

    Parameters
    ----------
    film : Film
    state : ndarray, (M N + 8,)
        S, then the rotor.

    Returns
    -------
    ndarray, (M N (1 + K) + 8,)
    """
    if not film.depth:
        return state
    n = film_size(film)
    s = film_array(film, state)
    gap = thickness(placed(film, state), *state[n : n + 2])
    wall = steady_wall(film.conductance, (s / gap) ** 2, film.supply)
    return np.concatenate([state[:n], wall.ravel(), state[n:]])
