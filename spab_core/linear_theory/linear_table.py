"""What linear theory knows of a point of the plane before anything is solved there: inputs for
surrogates.

Without unbalance the rotor rests in a static equilibrium; the leading eigenvalue of the whole
system linearised about it (:mod:`spab_core.linear_theory.whirl`) says how fast it returns there, or
that it whirls. Where the rotor is strongly damped that rate is the exponent itself. Eigenvalues of
a cell cost hundredths of a second, so they are tabulated over the plane once for each design and
interpolated."""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.interpolate import NearestNDInterpolator, RegularGridInterpolator
from sklearn.base import BaseEstimator, TransformerMixin

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design, reference_design
from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.solver.film import Mesh

Plane = tuple[
    tuple[float, float], tuple[float, float]
]  # ends of the bearing number, of the rotor mass in kg
MESH = Mesh(3, 32)  # twice the azimuths of the map: rest may be near the wall
MESH_STORING = Mesh(3, 16)  # where the wall stores gas: a node of it costs ten times as much
NODES = (64, 50)  # bearing numbers, rotor masses
PLANE: Plane = ((0.05, 8.5), (0.1, 25.0))  # the map's, of the shipped table
SHIPPED = "spab60_linear.npz"  # beside the reference design
COLUMNS = ("rate", "frequency", "eccentricity")
FEATURES = (
    "bearing number",
    "rotor mass",
    "M",
    "linear rate",
    "whirl frequency",
    "static eccentricity",
)
_NODE = ("bearing_number", "rotor_mass")
_SCHEMA = Schema(
    "linear table",
    {name: Array(np.float64, (name,), rising=True) for name in _NODE}
    | {name: Array(np.float32, _NODE, finite=True) for name in COLUMNS},
    {"design": ()},
)


@dataclass(frozen=True)
class LinearTable:
    """Linear stability of a design over the plane.

    Attributes
    ----------
    design : Design
    bearing_number : ndarray, (B,)
        Rising, equally spaced in the logarithm.
    rotor_mass : ndarray, (M,)
        kg on one bearing, rising.
    rate : ndarray, (B, M)
        2 pi times the real part of the leading eigenvalue: growth per revolution, as the exponents
        of a map.
    frequency : ndarray, (B, M)
        Its frequency over the shaft speed, at least 0.
    eccentricity : ndarray, (B, M)
        Of the equilibrium, over C.
    """

    design: Design
    bearing_number: np.ndarray
    rotor_mass: np.ndarray
    rate: np.ndarray
    frequency: np.ndarray
    eccentricity: np.ndarray

    def at(self, bearing_number: np.ndarray, rotor_mass: np.ndarray) -> np.ndarray:
        """Rate, frequency and eccentricity at points given by arrays (n,); shape (n, 3).

        Interpolated linearly in ln(bearing number) and rotor mass; the nearest point of the table
        outside it. Rate and frequency are interpolated times the bearing number, which makes them
        smooth where it is small."""
        number = np.clip(bearing_number, self.bearing_number[0], self.bearing_number[-1])
        mass = np.clip(rotor_mass, self.rotor_mass[0], self.rotor_mass[-1])
        scale = self.bearing_number[:, None]
        values = np.stack([scale * self.rate, scale * self.frequency, self.eccentricity], axis=-1)
        found = RegularGridInterpolator((np.log(self.bearing_number), self.rotor_mass), values)(
            np.column_stack([np.log(number), mass])
        )
        found[:, :2] /= number[:, None]
        return found


def _without_gaps(values: np.ndarray) -> np.ndarray:
    """Nodes without an equilibrium take the nearest node's values."""
    missing = ~np.isfinite(values[..., 0])
    if missing.all():
        raise InputError(
            "linear stability: this design has no static equilibrium anywhere in the plane of the "
            "map"
        )
    if missing.any():
        values[missing] = NearestNDInterpolator(np.argwhere(~missing), values[~missing])(
            np.argwhere(missing)
        )
    return values


def linear_table(
    design: Design,
    plane: Plane = PLANE,
    nodes: tuple[int, int] = NODES,
    progress: Callable[[int], None] | None = None,
) -> LinearTable:
    """Tabulate linear stability; about half a minute for the usual number of nodes, two minutes
    where the wall stores gas.

    Parameters
    ----------
    design : Design
    plane : Plane
        Smallest and largest bearing number, smallest and largest rotor mass in kg.
    nodes : tuple of int
        Bearing numbers and rotor masses of the table.
    progress : callable
        Called with the number of nodes done since the last call.

    Raises
    ------
    InputError
        Where the design has no static equilibrium anywhere in the plane.
    """
    number, mass = np.geomspace(*plane[0], nodes[0]), np.linspace(*plane[1], nodes[1])
    mesh = MESH_STORING if design.bearing.stores_gas else MESH
    values = np.full((*nodes, len(COLUMNS)), np.nan)
    for i, b in enumerate(number):
        guess = None
        for j, kg in enumerate(mass):  # along the mass each equilibrium starts from its neighbour's
            found = linear_spectrum(design, float(kg), float(b), mesh, guess)
            if found is None and guess is not None:
                found = linear_spectrum(design, float(kg), float(b), mesh)
            if found is not None:
                leading, guess = found[0][0], found[1].state
                values[i, j] = (
                    2.0 * math.pi * leading.real,
                    abs(leading.imag),
                    found[1].eccentricity,
                )
        if progress:
            progress(len(mass))
    return LinearTable(design, number, mass, *np.moveaxis(_without_gaps(values), -1, 0))


def save_table(table: LinearTable, path: str | Path) -> None:
    """Write a table as NPZ, atomically."""
    arrays = {"bearing_number": table.bearing_number, "rotor_mass": table.rotor_mass}
    arrays |= {name: getattr(table, name).astype(np.float32) for name in COLUMNS}
    write_atomically(
        path, npz_bytes(arrays | {"design": np.array(json.dumps(table.design.to_dict()))})
    )


def load_table(data: bytes) -> LinearTable:
    """Read the bytes of a table; raises ``InputError`` for other bytes."""
    found = load(data, _SCHEMA)
    return LinearTable(
        Design.from_dict(found.pop("design")),
        **{name: array.astype(float, copy=False) for name, array in found.items()},
    )


@functools.lru_cache(maxsize=1)
def shipped_table() -> LinearTable:
    """The table of the reference design (``python -m spab_core.linear_theory.linear_table`` writes
    it).
    """
    return load_table(resources.files("spab_core").joinpath("design/data", SHIPPED).read_bytes())


@functools.lru_cache(maxsize=4)
def table_for(design: Design, plane: Plane = PLANE) -> LinearTable:
    """The shipped table where it is of this design and covers the plane; else one computed now,
    kept in memory.

    A table covers at least :data:`PLANE`.

    Raises
    ------
    InputError
        As :func:`linear_table`.
    """
    shipped = shipped_table()
    covered = all(
        axis[0] * (1.0 - 1e-9) <= low and high <= axis[-1] * (1.0 + 1e-9)
        for axis, (low, high) in zip(
            (shipped.bearing_number, shipped.rotor_mass), plane, strict=True
        )
    )
    if design == shipped.design and covered:
        return shipped
    number, mass = ((min(a[0], b[0]), max(a[1], b[1])) for a, b in zip(plane, PLANE, strict=True))
    return linear_table(design, (number, mass))


class LinearFeatures(TransformerMixin, BaseEstimator):
    """Bearing number and rotor mass -> :data:`FEATURES`.

    W and the shaft speed are left out: they are the rotor mass and the bearing number in other
    units.

    Parameters
    ----------
    table : LinearTable
    """

    def __init__(self, table: LinearTable):
        self.table = table

    def fit(self, X, y=None):
        """Nothing is learnt."""
        return self

    def transform(self, X: np.ndarray) -> np.ndarray:
        """Features (n, 6) of X (n, 2)."""
        number, mass = np.asarray(X, float).T
        group = (
            self.table.design.mass_number(1.0, 1.0) * mass * number**2
        )  # M grows as the mass and the speed squared
        return np.column_stack([number, mass, group, self.table.at(number, mass)])


if __name__ == "__main__":
    target = Path(__file__).resolve().parent.parent / "design" / "data" / SHIPPED
    save_table(linear_table(reference_design()), target)
    print(f"{target}: {target.stat().st_size} bytes")
