"""One operating point answered: trajectory, exponent and regime together, in words and as a record."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from spab_core.design.model import Design
from spab_core.solver.stepping import STATUS_TEXT
from spab_core.trajectory.lyapunov import Exponent, exponent
from spab_core.trajectory.regimes import Regime, classify
from spab_core.trajectory.run import Progress, Trajectory, simulate
from spab_core.trajectory.settings import Settings


@dataclass(frozen=True)
class OperatingPoint:
    """The answer at one rotor mass and bearing number.

    Attributes
    ----------
    design : Design
    rotor_mass : float
        kg on one bearing.
    bearing_number : float
    settings : Settings
    trajectory : Trajectory
    mle : Exponent or None
        None where the run failed.
    regime : Regime or None
    """

    design: Design
    rotor_mass: float
    bearing_number: float
    settings: Settings
    trajectory: Trajectory
    mle: Exponent | None
    regime: Regime | None

    @property
    def contact_share(self) -> float:
        """Share of the measured time at an eccentricity above 0.9; nan where nothing was measured."""
        contact = self.trajectory.contact
        return min(float(contact.mean()), 1.0) if len(contact) else float("nan")

    @property
    def max_eccentricity(self) -> float:
        """Largest eccentricity of the measured time, over C; nan where nothing was measured."""
        peak = self.trajectory.peak
        return float(peak.max()) if len(peak) else float("nan")

    def record(self) -> dict[str, Any]:
        """The answer as plain values; the keys are those of ``spab simulate --json``."""

        def number(value: float) -> float | None:
            return None if math.isnan(value) else value

        return {
            "rotor_mass_kg": self.rotor_mass,
            "bearing_number": self.bearing_number,
            "speed_rad_s": self.design.speed(self.bearing_number),
            "speed_rpm": self.design.speed_rpm(self.bearing_number),
            "mle_per_revolution": self.mle.value if self.mle else None,
            "mle_standard_error": self.mle.standard_error if self.mle else None,
            "regime": self.regime.name if self.regime else None,
            "period": self.regime.period or None if self.regime else None,
            "contact_share": number(self.contact_share),
            "max_eccentricity": number(self.max_eccentricity),
            "status": self.trajectory.status,
            "mesh": str(self.settings.mesh),
            "revolutions": self.trajectory.completed,
            "wall_seconds": self.trajectory.wall_seconds,
        }

    def verdict(self) -> str:
        """One sentence for a designer."""
        if self.regime is None or self.mle is None:
            return f"No exponent: {STATUS_TEXT[self.trajectory.status]}."
        if self.regime.name == "quasi-periodic" and abs(self.mle.value) > 0.01:
            return (
                f"Undecided: the orbit does not repeat and its exponent, {self.mle.value:+.3f} ± "
                f"{self.mle.standard_error:.3f}, is not clearly zero; measure more revolutions."
            )
        text = self.regime.sentence
        if self.contact_share >= 0.0005:
            text += f"; {100.0 * self.contact_share:.1f} % of the time the film is thinner than a tenth of the clearance"
        return text + "."


def solve_point(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings | None = None,
    *,
    path_revolutions: int = 0,
    start: np.ndarray | None = None,
    progress: Progress | None = None,
) -> OperatingPoint:
    """Solve one operating point: trajectory, exponent, regime.

    Parameters are those of :func:`spab_core.trajectory.run.simulate`.

    Returns
    -------
    OperatingPoint

    Examples
    --------
    >>> from spab_core import reference_design, solve_point
    >>> answer = solve_point(reference_design(), rotor_mass=18.0, bearing_number=4.5)  # doctest: +SKIP
    >>> answer.regime.text, round(answer.mle.value, 2)  # doctest: +SKIP
    ('chaotic', 0.39)
    """
    settings = settings or Settings()
    trajectory = simulate(
        design,
        rotor_mass,
        bearing_number,
        settings,
        path_revolutions=path_revolutions,
        start=start,
        progress=progress,
    )
    mle = exponent(trajectory.growth, trajectory.settled) if trajectory.status == "ok" else None
    regime = classify(trajectory.section, mle) if mle else None
    return OperatingPoint(
        design, float(rotor_mass), float(bearing_number), settings, trajectory, mle, regime
    )
