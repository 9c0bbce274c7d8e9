"""A solved operating point as a file: NPZ without pickles, from which every figure of the point can
be drawn again.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import npz_bytes
from spab_core.design.model import Design
from spab_core.solver.film import AUTO, Mesh, parse_mesh
from spab_core.solver.stepping import STATUS
from spab_core.trajectory.lyapunov import Exponent
from spab_core.trajectory.periodic_orbit import Settled
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.regimes import REGIMES, Regime
from spab_core.trajectory.run import Trajectory
from spab_core.trajectory.settings import Settings
from spab_core.trajectory.starts import WHIRLING, whirling_start

_ARRAYS = {  # of a Trajectory
    "section": Array(np.float64, ("revolution", 8)),
    "growth": Array(np.float64, ("tangent revolution",)),
    "contact": Array(np.float64, ("revolution",)),
    "thin": Array(np.float64, ("revolution",)),
    "peak": Array(np.float64, ("revolution",)),
    "force": Array(np.float64, ("revolution",)),
    "box": Array(np.float64, ("revolution", 4)),
    "path": Array(np.float64, ("path revolution", "sample", 8)),
    "final": Array(np.float64, ("state",)),
    # files from before the journal could move along the axis do not hold it
    "axial": Array(np.float64, ("axial revolution", 4), required=False),
    "axial_path": Array(np.float64, ("axial path revolution", "axial sample", 2), required=False),
}
_SCHEMA = Schema(
    "operating point",
    {**_ARRAYS, "trace": Array(np.float64, ("trace",))},
    {"metadata": ("design", "settings", "status", "mesh", "settled", "mle", "regime")},
)


def point_arrays(point: OperatingPoint) -> dict[str, np.ndarray]:
    """An operating point as arrays by name: its ``Trajectory``, the ``trace`` of its exponent,
    ``metadata``.
    """
    t = point.trajectory
    arrays = {name: getattr(t, name) for name in _ARRAYS}
    about = map_metadata(point.design, point.settings, ()) | {
        "settings": point.settings.to_dict(),
        "rotor_mass": point.rotor_mass,
        "bearing_number": point.bearing_number,
        "status": t.status,
        "completed": t.completed,
        "mesh": str(t.mesh),
        "steps": t.steps,
        "wall_seconds": t.wall_seconds,
        "settled": dataclasses.asdict(t.settled) if t.settled else None,
        "pushed": t.pushed,
        "mle": [point.mle.value, point.mle.standard_error] if point.mle else None,
        "regime": dataclasses.asdict(point.regime) if point.regime else None,
    }
    return arrays | {
        "trace": point.mle.trace if point.mle else np.empty(0),
        "metadata": np.array(json.dumps(about)),
    }


def path_units(design: Design) -> str:
    """What the columns of a recorded path (:func:`spab_core.trajectory.run.path_table`) are
    measured in.
    """
    return (
        f"tau: rad; X, Y, Z: over the clearance of {1e6 * design.bearing.clearance:g} µm; their "
        "derivatives: per rad"
    )


def _settled(about: dict[str, Any]) -> Settled:
    return Settled(**about | {"history": tuple(about.get("history", ()))})


def save_point(point: OperatingPoint, path: str | Path) -> None:
    """Write an operating point as NPZ, atomically."""
    write_atomically(path, npz_bytes(point_arrays(point)))


def load_point(path: str | Path) -> OperatingPoint:
    """Read what :func:`save_point` wrote; nothing in it is ever unpickled.

    Raises
    ------
    InputError
        For a file that is none.
    """
    arrays = load(path, _SCHEMA)
    about, trace = arrays.pop("metadata"), arrays.pop("trace")
    with _SCHEMA.reading(path):
        mle = None
        if about["mle"]:
            mle = Exponent(float(about["mle"][0]), float(about["mle"][1]), trace)
        regime = Regime(**about["regime"]) if about["regime"] else None
        if about["status"] not in STATUS or (regime and regime.name not in REGIMES):
            raise ValueError("its metadata name an unknown status or regime")
        if (mle is None) != (regime is None):
            raise ValueError("its metadata must have both exponent and regime, or neither")
        trajectory = Trajectory(
            about["status"],
            int(about["completed"]),
            **arrays,
            mesh=parse_mesh(about["mesh"]),
            steps=int(about["steps"]),
            wall_seconds=float(about["wall_seconds"]),
            settled=_settled(about["settled"]) if about["settled"] else None,
            pushed=int(about.get("pushed", 0)),
        )
        return OperatingPoint(
            Design.from_dict(about["design"]),
            float(about["rotor_mass"]),
            float(about["bearing_number"]),
            Settings(**about["settings"]),
            trajectory,
            mle,
            regime,
        )


# what gives a state its entries, besides the mesh: states of equal length may hold other things
_SHAPING: dict[str, Callable[[Design], bool]] = {
    "rotor.axial_motion": lambda design: design.rotor.axial_motion,
    "rotor.axial_load (none or some)": lambda design: bool(design.rotor.axial_load),
    "bearing.porosity (none or some)": lambda design: design.bearing.stores_gas,
}


def start_of(
    text: str, design: Design, rotor_mass: float, bearing_number: float, mesh: Mesh = AUTO
) -> np.ndarray:
    """Return the state that ``text`` names.

    Parameters
    ----------
    text : str
        "whirling" (:func:`~spab_core.trajectory.starts.whirling_start`), or a point file
        (:func:`save_point`), whose last state it is.
    design, rotor_mass, bearing_number, mesh
        Those of the run to start.

    Raises
    ------
    InputError
        For a file that cannot be read, whose run failed, or whose state has other entries.
    """
    if text == WHIRLING:
        return whirling_start(design, rotor_mass, bearing_number, mesh)
    point = load_point(Path(text))
    if point.trajectory.status != "ok":
        raise InputError(
            f"the run in {text[:200]!r} failed ({point.trajectory.status}): its last state is no "
            "start"
        )
    for name, of in _SHAPING.items():
        if of(point.design) != of(design):
            raise InputError(
                f"the run in {text[:200]!r} is no start: {name} is another in its design"
            )
    if mesh not in (AUTO, point.trajectory.mesh):
        raise InputError(
            f"the run in {text[:200]!r} is no start: it ended on mesh {point.trajectory.mesh}, "
            f"this one asks for {mesh}"
        )
    return point.trajectory.final
