"""A solved operating point as a file: NPZ without pickles, from which every figure of the point can
be drawn again.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.files import write_atomically
from spab_core.common.npz import UNREADABLE, npz_bytes, open_npz
from spab_core.design.model import Design
from spab_core.solver.stepping import STATUS
from spab_core.trajectory.lyapunov import Exponent
from spab_core.trajectory.periodic_orbit import Settled
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.provenance import map_metadata
from spab_core.trajectory.regimes import REGIMES, Regime
from spab_core.trajectory.run import Trajectory
from spab_core.trajectory.settings import Settings

_ARRAYS = {
    "section": 2,
    "growth": 1,
    "contact": 1,
    "peak": 1,
    "path": 3,
    "final": 1,
}  # of a Trajectory, with their dimensions
_ROTOR_STATES = {"section", "path"}


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
        "steps": t.steps,
        "wall_seconds": t.wall_seconds,
        "settled": dataclasses.asdict(t.settled) if t.settled else None,
        "mle": [point.mle.value, point.mle.standard_error] if point.mle else None,
        "regime": dataclasses.asdict(point.regime) if point.regime else None,
    }
    return arrays | {
        "trace": point.mle.trace if point.mle else np.empty(0),
        "metadata": np.array(json.dumps(about)),
    }


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
    try:
        with open_npz(path) as data:
            about = data.json("metadata")
            arrays = {name: data.fitting(name, float) for name in _ARRAYS}
            trace = data.fitting("trace", float)
        fits = all(arrays[name].ndim == n for name, n in _ARRAYS.items()) and trace.ndim == 1
        if (
            not fits
            or any(arrays[name].shape[-1] != 8 for name in _ROTOR_STATES)
            or about["status"] not in STATUS
        ):
            raise InputError(f"{path} is no operating point: its arrays do not fit together")
        settled = Settled(**about["settled"]) if about["settled"] else None
        mle = (
            Exponent(float(about["mle"][0]), float(about["mle"][1]), trace)
            if about["mle"]
            else None
        )
        regime = Regime(**about["regime"]) if about["regime"] else None
        if (mle is None) != (regime is None) or (regime and regime.name not in REGIMES):
            raise InputError(
                f"{path} is no operating point: regime and exponent do not fit together"
            )
        trajectory = Trajectory(
            about["status"],
            int(about["completed"]),
            **arrays,
            steps=int(about["steps"]),
            wall_seconds=float(about["wall_seconds"]),
            settled=settled,
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
    except InputError:
        raise
    except UNREADABLE as error:
        raise InputError(f"cannot read the operating point {str(path)!r}: {error}") from None
