"""The gas film: a finite-volume mesh of the half band and the semi-discrete Reynolds equation (docs/model.md).

Unknown: S = P H, the gas mass in a cell, at M latitudes times N azimuths, so that

    dS/dtau = (1/2 Lambda) [ (1/cos l) d_l(cos l H³/2 d_l Q) + (1/cos² l) d_t(H³/2 d_t Q) + beta (P_s² - Q) ] - d_t S / 2

with P = S/H, Q = P². Fluxes are central and second order, each counted once for both its cells, so that gas is conserved
to rounding. In the default scheme differences around are exact for the first harmonic, which carries the force.
:func:`film_slope` is the readable formula; :mod:`spab_core.kernels` computes the same, fast.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from spab_core.design import Design, DesignError
from spab_core.simd import WIDTH, aligned_zeros


class Mesh(NamedTuple):
    """Cells of the half band: ``latitude`` M from the equator to the edge, ``azimuth`` N around."""

    latitude: int
    azimuth: int

    def __str__(self):
        return f"{self.latitude}x{self.azimuth}"


DEFAULT_MESH = Mesh(8, 40)
SCHEMES = ("fitted", "plain")
MESH_LIMITS = ((3, 64), (8, 256))


def parse_mesh(text: str) -> Mesh:
    """Read "8x32". Raises :class:`DesignError` for anything but two whole numbers in range."""
    (m_low, m_high), (n_low, n_high) = MESH_LIMITS
    parts = str(text).lower().split("x")
    if len(parts) == 2 and all(p.isascii() and p.isdigit() and len(p) < 6 for p in parts):
        mesh = Mesh(int(parts[0]), int(parts[1]))
        if m_low <= mesh.latitude <= m_high and n_low <= mesh.azimuth <= n_high:
            return mesh
    raise DesignError(f"mesh = {str(text)[:40]!r} is not allowed: give latitude x azimuth cells of the half band, such as "
                      f"8x32, from {m_low}x{n_low} to {m_high}x{n_high}")


class Film(NamedTuple):
    """Everything the film kernels need, at one bearing number.

    Vectors over latitude are padded to a multiple of eight; a padded cell keeps S = 1 and touches nothing.

    Attributes
    ----------
    cells, columns, padded : int
        M, N and the padded M.
    cos_centre, cos_up, cos_down : ndarray, (padded,)
        cos(latitude) at the cell's centre, its face towards the edge, its face towards the equator.
    flux_up, flux_down, flux_around : ndarray, (padded,)
        1/(2 Lambda) times 1/2 times the geometry of each face: multiply with H³ and the difference of Q. In the fitted
        scheme the last ``flux_down`` also holds the second cell's part of the slope at the edge, ``edge_correction``.
    couette, feed : ndarray, (padded,)
        Half the azimuthal difference quotient's factor, and beta/(2 Lambda).
    weight : ndarray, (padded,)
        2 dtheta times the integral of cos² over the cell: its share of the force, both halves of the band.
    cos, sin, cos_face, sin_face : ndarray, (N,)
        of the azimuth at the centres and at the faces half a cell further.
    supply : float
        P_s².
    eye : ndarray, ((padded + 2) * padded,)
        A row of zeros, the unit matrix, a row of zeros: unit vectors for the blocks of the linear solver.
    area : ndarray, (padded,)
        Integral of cos(latitude) over the cell times dtheta: the cell's area on the unit sphere, half band.
    edge_correction : float
        Part of the last ``flux_down`` that belongs to the open edge.
    """

    cells: int
    columns: int
    padded: int
    cos_centre: np.ndarray
    cos_up: np.ndarray
    cos_down: np.ndarray
    flux_up: np.ndarray
    flux_down: np.ndarray
    flux_around: np.ndarray
    couette: np.ndarray
    feed: np.ndarray
    weight: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    cos_face: np.ndarray
    sin_face: np.ndarray
    supply: float
    eye: np.ndarray
    area: np.ndarray
    edge_correction: float


def build_film(design: Design, bearing_number: float, mesh: Mesh = DEFAULT_MESH, scheme: str = "fitted") -> Film:
    """Mesh and coefficients of the film at one bearing number.

    Parameters
    ----------
    design : Design
    bearing_number : float
        Lambda > 0.
    mesh : Mesh
    scheme : str
        ``fitted``: differences around are exact for the first harmonic, and the slope at the open edge is second order.
        ``plain``: central differences and the slope over the last half cell. Both are second order; the Couette term of
        ``plain`` turns the film 0.6 % too slowly at N = 32, which is enough to unlock a half-speed whirl.

    Returns
    -------
    Film
    """
    m, n = mesh
    padded = -(-m // WIDTH) * WIDTH
    edge = math.radians(design.bearing.edge_latitude)
    face = np.linspace(0.0, edge, m + 1)
    centre = 0.5 * (face[1:] + face[:-1])
    dl, dt = edge / m, 2.0 * math.pi / n
    strip = np.diff(np.sin(face))  # integral of cos(latitude)
    scale = 0.5 / (2.0 * bearing_number)
    up = scale * np.cos(face[1:]) / (strip * dl)
    down = scale * np.cos(face[:-1]) / (strip * dl)
    down[0] = 0.0  # symmetry at the equator
    if scheme == "fitted":
        # slope at the open edge from Q there and at two centres: (8 (1 - Q[M]) - (Q[M] - Q[M-1])) / (3 dl)
        edge_flux = up[-1]
        up[-1] = edge_flux * 8.0 / 3.0
        down[-1] += edge_flux / 3.0
        # sin(dt) for dt and 2 - 2 cos(dt) for dt² make cos(t) and sin(t) exact
        span, span2 = math.sin(dt), 2.0 * (1.0 - math.cos(dt))
    else:
        up[-1] *= 2.0
        span, span2 = dt, dt**2

    def pad(values):
        out = aligned_zeros(padded)
        out[:m] = values
        return out

    theta = np.arange(n) * dt
    eye = aligned_zeros((padded + 2) * padded)
    eye[padded:-padded] = np.eye(padded).ravel()
    return Film(
        cells=m, columns=n, padded=padded,
        cos_centre=pad(np.cos(centre)), cos_up=pad(np.cos(face[1:])), cos_down=pad(np.cos(face[:-1])),
        flux_up=pad(up), flux_down=pad(down),
        flux_around=pad(scale * dl / (np.cos(centre) * strip * span2)),
        couette=pad(0.25 / span), feed=pad(design.feeding_number / (2.0 * bearing_number)),
        weight=pad(2.0 * dt * np.diff(0.5 * face + 0.25 * np.sin(2.0 * face))),
        cos=np.cos(theta), sin=np.sin(theta), cos_face=np.cos(theta + 0.5 * dt), sin_face=np.sin(theta + 0.5 * dt),
        supply=design.bearing.supply_pressure_ratio**2, eye=eye, area=pad(strip * dt),
        edge_correction=float(up[-1] / 8.0) if scheme == "fitted" else 0.0,
    )


def film_size(film: Film) -> int:
    """Number of film entries in the state vector, padding included."""
    return film.columns * film.padded


def film_array(film: Film, state: np.ndarray) -> np.ndarray:
    """The film part of a state vector as S[azimuth, latitude], without the padding. Shape (N, M)."""
    return state[: film_size(film)].reshape(film.columns, film.padded)[:, : film.cells]


def thickness(film: Film, x: float, y: float) -> np.ndarray:
    """Film thickness H = 1 - cos l (X cos t + Y sin t) at the cell centres, over C. Shape (N, M)."""
    return 1.0 - np.outer(x * film.cos + y * film.sin, film.cos_centre[: film.cells])


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
        ``latitude``, ``azimuth``, ``couette``, ``wall``, and ``edge``, the part of ``latitude`` that crosses the open edge.
    """
    m = film.cells
    q = (s / thickness(film, x, y)) ** 2
    g = (x * film.cos + y * film.sin)[:, None]
    upper = np.concatenate([q[:, 1:], np.ones((film.columns, 1))], axis=1)
    up = film.flux_up[:m] * (1.0 - film.cos_up[:m] * g) ** 3 * (upper - q)
    lower = np.concatenate([q[:, :1], q[:, :-1]], axis=1)
    down = film.flux_down[:m] * (1.0 - film.cos_down[:m] * g) ** 3 * (q - lower)
    gap = 1.0 - (x * film.cos_face + y * film.sin_face)[:, None] * film.cos_centre[:m]
    east = film.flux_around[:m] * gap**3 * (np.roll(q, -1, axis=0) - q)
    edge = np.zeros_like(q)
    correction = film.edge_correction * (1.0 - film.cos_down[m - 1] * g[:, 0]) ** 3 * (q[:, -1] - q[:, -2])
    edge[:, -1] = up[:, -1] - correction
    return {
        "latitude": up - down,
        "azimuth": east - np.roll(east, 1, axis=0),
        "couette": -film.couette[:m] * (np.roll(s, -1, axis=0) - np.roll(s, 1, axis=0)),
        "wall": film.feed[:m] * (film.supply - q),
        "edge": edge,
    }


def film_slope(film: Film, s: np.ndarray, x: float, y: float) -> np.ndarray:
    """dS/dtau of the semi-discrete Reynolds equation, shape (N, M). See :func:`film_fluxes`."""
    flux = film_fluxes(film, s, x, y)
    return flux["latitude"] + flux["azimuth"] + flux["couette"] + flux["wall"]


def film_force(film: Film, s: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Force of the whole band on the journal, (F_x, F_y) over p_a R²."""
    excess = ((s / thickness(film, x, y) - 1.0) * film.weight[: film.cells]).sum(axis=1)
    return -float(excess @ film.cos), -float(excess @ film.sin)


def gas_content(film: Film, s: np.ndarray) -> float:
    """Gas in the half band: integral of P H over the unit sphere's surface."""
    return float((s * film.area[: film.cells]).sum())
