"""How an operating point is solved: mesh, method, length."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

from spab_core.common.errors import DesignError
from spab_core.common.validation import check_number
from spab_core.solver.film import DEFAULT_MESH, SCHEMES, Mesh, parse_mesh
from spab_core.solver.stepping import DEFAULT_TOLERANCE, METHODS


@dataclass(frozen=True)
class Settings:
    """How long and how finely to integrate.

    Attributes
    ----------
    mesh : Mesh
        Latitudes x azimuths of the half band.
    method : str
        ``rodas`` or ``dtm`` (:mod:`spab_core.solver.stepping`).
    transient, revolutions : int
        Revolutions before and during the measurement.
    tolerance : float
        Largest error estimate of a step, lengths over C.
    scheme : str
        Film differences, ``fitted`` or ``plain`` (:func:`spab_core.solver.film.build_film`).
    early_stop : bool
        Stop where the run has settled on a periodic orbit, and push it off an unstable one in the
        first half of the transient (:mod:`spab_core.trajectory.periodic_orbit`); where it decays by
        more than :data:`~spab_core.trajectory.run.STRONG`, measure that on finer steps.
    """

    mesh: Mesh = DEFAULT_MESH
    method: str = "rodas"
    transient: int = 300
    revolutions: int = 400
    tolerance: float = DEFAULT_TOLERANCE
    scheme: str = "fitted"
    early_stop: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(
            self,
            "mesh",
            parse_mesh(self.mesh if isinstance(self.mesh, str) else "x".join(map(str, self.mesh))),
        )
        for name, allowed in (("method", METHODS), ("scheme", SCHEMES)):
            if getattr(self, name) not in allowed:
                raise DesignError(
                    f"{name} = {str(getattr(self, name))[:40]!r} is not allowed: choose "
                    f"{' or '.join(allowed)}"
                )
        for name, low, high in (("transient", 0, 100_000), ("revolutions", 20, 100_000)):
            value = getattr(self, name)
            check_number(name, value, low, high, "revolutions")
            if value != int(value):
                raise DesignError(f"{name} = {value} must be a whole number of revolutions")
        check_number("tolerance", self.tolerance, 1e-10, 1e-2)
        if not isinstance(self.early_stop, bool):
            raise DesignError(
                f"early_stop = {str(self.early_stop)[:40]!r} is not allowed: True or False"
            )

    def to_dict(self) -> dict[str, Any]:
        """Plain dictionary, the mesh as text."""
        return {**dataclasses.asdict(self), "mesh": str(self.mesh)}
