"""How an operating point is solved: mesh, method, length."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from spab_core.common.errors import DesignError
from spab_core.common.validation import check_choice, check_number
from spab_core.design.model import Design
from spab_core.solver.film import AUTO, Mesh, parse_mesh
from spab_core.solver.rotor import RAMP_REVOLUTIONS
from spab_core.solver.stepping import DEFAULT_TOLERANCE, METHODS

MOST_REVOLUTIONS = 100_000


@dataclass(frozen=True)
class Settings:
    """How long and how finely to integrate.

    Attributes
    ----------
    mesh : Mesh
        Latitudes x azimuths of the half band; by default those that the design asks for, and more
        azimuths once the eccentricity does (:attr:`~spab_core.trajectory.run.Trajectory.mesh`).
    method : str
        ``rodas`` or ``dtm`` (:mod:`spab_core.solver.stepping`).
    transient, revolutions : int
        Revolutions before and during the measurement. A cold start needs a transient as long as the
        load's ramp (:meth:`check_cold_start`).
    tolerance : float
        Largest error estimate of a step, lengths over C.
    early_stop : bool
        Stop where the run has settled on a periodic orbit, push it off an unstable one in the first
        half of the transient (:mod:`spab_core.trajectory.periodic_orbit`), and measure for up to
        four times the revolutions where the motion has no regime yet.
    """

    mesh: Mesh = AUTO
    method: str = "rodas"
    transient: int = 300
    revolutions: int = 300
    tolerance: float = DEFAULT_TOLERANCE
    early_stop: bool = True

    def __post_init__(self) -> None:
        pair = isinstance(self.mesh, (tuple, list)) and len(self.mesh) == len(Mesh._fields)
        object.__setattr__(
            self,
            "mesh",
            parse_mesh(str(Mesh(*self.mesh) if pair else self.mesh)),
        )
        check_choice("method", self.method, METHODS)
        for name, low in (("transient", 0), ("revolutions", 20)):
            value = getattr(self, name)
            check_number(name, value, low, MOST_REVOLUTIONS, "revolutions")
            if value != int(value):
                raise DesignError(f"{name} = {value} must be a whole number of revolutions")
        check_number("tolerance", self.tolerance, 1e-10, 1e-2)
        if not isinstance(self.early_stop, bool):
            raise DesignError(
                f"early_stop = {str(self.early_stop)[:40]!r} is not allowed: True or False"
            )

    def check_design(self, design: Design) -> None:
        """Raise :class:`DesignError` where the method does not solve the design's motion."""
        if design.rotor.axial_motion and self.method != "rodas":
            raise DesignError(
                f"method = {self.method} holds the journal along the axis: take rodas, or set "
                "rotor.axial_motion = false"
            )

    def check_cold_start(self) -> None:
        """Raise :class:`DesignError` if a run from rest is measured while its load rises."""
        if self.transient < RAMP_REVOLUTIONS:
            raise DesignError(
                f"transient = {self.transient} revolutions is too short: a cold start raises load "
                f"and unbalance over {RAMP_REVOLUTIONS:g} revolutions; allowed is from "
                f"{RAMP_REVOLUTIONS:g} to 100000 revolutions"
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionary, the mesh as text."""
        return {**dataclasses.asdict(self), "mesh": str(self.mesh)}
