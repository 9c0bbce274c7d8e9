"""One operating point: trajectory, exponent and regime together, in words and as a record."""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from spab_core.common.errors import InputError
from spab_core.common.words import small
from spab_core.design.model import Design
from spab_core.linear_theory.summary import Derived, derive
from spab_core.solver.rotor import RAMP_REVOLUTIONS
from spab_core.trajectory.assessment import (
    COEXISTING,
    DEFAULT_LIMITS,
    Assessment,
    Limits,
    Motion,
    assess,
    motion_words,
)
from spab_core.trajectory.lyapunov import Exponent, exponent
from spab_core.trajectory.regimes import Regime, classify
from spab_core.trajectory.run import Progress, Trajectory, simulate
from spab_core.trajectory.settings import Settings
from spab_core.trajectory.starts import whirling_start

APART = 0.05  # by how much the largest eccentricities of two motions differ at least, over C


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
    from_rest : bool
        Whether the run began with the cold start.
    """

    design: Design
    rotor_mass: float
    bearing_number: float
    settings: Settings
    trajectory: Trajectory
    mle: Exponent | None
    regime: Regime | None
    from_rest: bool = True

    @property
    def contact_share(self) -> float:
        """Share of the measured time in contact, by force
        (:func:`~spab_core.solver.rotor.contact_eccentricity`); nan if none was measured.
        """
        return _share(self.trajectory.contact)

    @property
    def thin_film_share(self) -> float:
        """Share of the measured time at an eccentricity above 0.9; nan if none was measured."""
        return _share(self.trajectory.thin)

    @property
    def peak_contact_force(self) -> float:
        """Largest normal force of the asperities, N; nan where nothing was measured."""
        force = self.trajectory.force
        return self.design.force_unit * float(force.max()) if len(force) else math.nan

    @property
    def least_film(self) -> float:
        """Least film thickness, m, where the journal is nearest to the wall: at the equator unless
        it is displaced along the axis.
        """
        return self.design.bearing.clearance * (1.0 - self.max_eccentricity)

    @property
    def orbit_amplitude(self) -> float:
        """Half the longest side of the box around the journal's orbit, the axis included where it
        moves along it, over C; nan where nothing was measured.
        """
        box = self.trajectory.box
        if not len(box):
            return math.nan
        sides = box[:, 1::2].max(axis=0) - box[:, ::2].min(axis=0)
        if self.axial_range:
            sides = np.append(sides, self.axial_range[1] - self.axial_range[0])
        return 0.5 * float(sides.max())

    @property
    def axial_range(self) -> tuple[float, float] | None:
        """Least and largest axial displacement of the measured time, over C; None where the journal
        is held along the axis, or nothing was measured.
        """
        axial = self.trajectory.axial
        return (float(axial[:, 2].min()), float(axial[:, 3].max())) if len(axial) else None

    def axial_words(self) -> str:
        """Return a sentence on the motion along the axis, nothing where the journal is held."""
        if self.axial_range is None:
            return ""
        low, high = self.axial_range
        return f"Along the axis it moves between {low:+.3f} and {high:+.3f} of the clearance."

    @property
    def max_eccentricity(self) -> float:
        """Largest eccentricity of the measured time, over C; nan where nothing was measured."""
        peak = self.trajectory.peak
        return float(peak.max()) if len(peak) else float("nan")

    def record(self, limits: Limits = DEFAULT_LIMITS) -> dict[str, Any]:
        """The answer as plain values; the keys are those of ``spab simulate --json``."""
        judged = self.assessment(limits)

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
            "thin_film_share": number(self.thin_film_share),
            "peak_contact_force_n": number(self.peak_contact_force),
            "max_eccentricity": number(self.max_eccentricity),
            "least_film_m": number(self.least_film),
            "orbit_amplitude": number(self.orbit_amplitude),
            "assessment": judged.grade,
            "assessment_reasons": list(judged.reasons),
            "rest": judged.rest,
            "coexisting": next(
                (
                    r
                    for r, kind in zip(judged.reasons, judged.kinds, strict=True)
                    if kind == COEXISTING
                ),
                None,
            ),
            "status": self.trajectory.status,
            "mesh": str(self.trajectory.mesh),
            "revolutions": self.trajectory.completed,
            "pushed": self.trajectory.pushed,
            "wall_seconds": self.trajectory.wall_seconds,
            **dict(zip(("axial_least", "axial_largest"), self.axial_range or (), strict=False)),
        }

    @functools.cached_property
    def rest(self) -> Derived | None:
        """What linear theory says of the static equilibrium; None where it says nothing."""
        try:
            return derive(self.design, self.rotor_mass, self.bearing_number)
        except (InputError, np.linalg.LinAlgError):
            return None

    @property
    def motion(self) -> Motion:
        """What a motion is judged by."""
        return Motion(
            self.regime.name if self.regime else "",
            self.regime.period if self.regime else 0,
            self.trajectory.status,
            self.contact_share,
            self.max_eccentricity,
            self.orbit_amplitude,
            self.thin_film_share,
        )

    def assessment(
        self, limits: Limits = DEFAULT_LIMITS, *, rest: Derived | None = None
    ) -> Assessment:
        """Judge motion and equilibrium by a designer's limits.

        Where nothing is to be avoided the point is solved once more from another start
        (:attr:`beside`): another motion there is to be watched. ``rest`` takes the place of
        :attr:`rest`.
        """
        rest = rest or self.rest
        found = assess(self.design, self.motion, rest, limits)
        if self.on_circle:
            words = "Whirl of its own frequency on one circle (a limit cycle)"
            found = dataclasses.replace(found, motion=words)
        if found.grade == "avoid" or self.beside is None:
            return found
        return assess(self.design, self.motion, rest, limits, beside_words(self.beside))

    @property
    def on_circle(self) -> bool:
        """Whether a motion that does not repeat after whole revolutions is one circle, as of a
        rotor without unbalance and weight: a limit cycle, no torus.
        """
        radius = np.hypot(*self.trajectory.section[:, :2].T)
        return bool(
            self.motion.regime == "quasi-periodic"
            and self.design.rotor.unbalance_eccentricity == 0.0
            and np.ptp(radius) < 1e-3 * radius.mean()
            and (self.axial_range is None or np.ptp(self.axial_range) < 1e-3 * radius.mean())
        )

    @functools.cached_property
    def beside(self) -> OperatingPoint | None:
        """Another motion of the same point, reached from a large orbit
        (:func:`~spab_core.trajectory.starts.whirling_start`), or from rest where this one was not;
        None where that leads to the same. At most as long as a usual run.
        """
        where, usual = (self.design, self.rotor_mass, self.bearing_number), Settings()
        settings = dataclasses.replace(
            self.settings,
            transient=max(
                min(self.settings.transient, usual.transient), math.ceil(RAMP_REVOLUTIONS)
            ),
            revolutions=min(self.settings.revolutions, usual.revolutions),
        )
        start = whirling_start(*where, settings.mesh) if self.from_rest else None
        return self.kept_beside(solve_point(*where, settings, start=start))

    def kept_beside(self, other: OperatingPoint) -> OperatingPoint | None:
        """Return another run of the same point if it came to another motion than this one.

        A run that shrinks goes on as long again: what still decays is no motion.
        """
        if self.is_apart(other) and other.regime is not None and _shrinks(other.trajectory):
            where = self.design, self.rotor_mass, self.bearing_number
            on = solve_point(*where, other.settings, start=other.trajectory.final)
            other = dataclasses.replace(on, from_rest=other.from_rest)
        return other if self.is_apart(other) else None

    def is_apart(self, other: OperatingPoint) -> bool:
        """Whether two runs of a point came to two motions.

        Where one does not repeat, its regime may be a matter of where it was looked at, so only how
        large they are counts.
        """
        if self.regime is None or other.regime is None:
            return self.regime != other.regime
        apart = abs(self.max_eccentricity - other.max_eccentricity) > APART
        names = {self.regime.name, other.regime.name}
        if names == {"periodic"} and self.regime.period != other.regime.period:
            # next to where a period doubles both are all but the same orbit
            return apart or _section_distance(self.trajectory, other.trajectory) > APART
        return apart and names != {"chaotic"}

    def verdict(self, limits: Limits = DEFAULT_LIMITS) -> str:
        """What a designer needs to know, in a sentence or two: the motion and what it is worth."""
        words = (self.assessment(limits).motion, self.axial_words(), self.push_words())
        return " ".join(filter(None, words))

    def push_words(self) -> str:
        """A sentence where the run was pushed off an unstable orbit, else nothing."""
        pushed = self.trajectory.pushed
        if not pushed:
            return ""
        return f"Reached after a push off an unstable periodic orbit at revolution {pushed}."


def beside_words(other: OperatingPoint) -> str:
    """Say what another motion of a point is, as a clause."""
    start = "rest" if other.from_rest else "a large orbit"
    if other.regime is None:
        return f"started from {start}, the run fails ({other.trajectory.status})"
    words = motion_words(other.regime.name, other.regime.period)
    return (
        f"another motion of {100.0 * other.max_eccentricity:.0f} % of the clearance exists beside "
        f"it, reached from {start}: {small(words)}"
    )


def _shrinks(run: Trajectory) -> bool:
    """Whether a run may still be on its way: its eccentricity falls while it is measured."""
    quarter = max(len(run.peak) // 4, 1)
    falls = float(run.peak[:quarter].max() - run.peak[-quarter:].max())
    return run.settled is None and falls > 0.1 * APART


def _section_distance(one: Trajectory, other: Trajectory) -> float:
    """Return the largest distance of a point of either section from the other, over C."""
    steps = one.section[:, None, :2] - other.section[None, :, :2]
    distance = np.hypot(steps[..., 0], steps[..., 1])
    return float(max(distance.min(axis=0).max(), distance.min(axis=1).max()))


def _share(times: np.ndarray) -> float:
    return min(float(times.mean()), 1.0) if len(times) else math.nan


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

    Parameters are those of :func:`spab_core.trajectory.run.simulate`; a cold start needs a
    transient of at least 30 revolutions.

    Returns
    -------
    OperatingPoint

    Examples
    --------
    >>> from spab_core import reference_design, solve_point
    >>> design = reference_design()
    >>> answer = solve_point(design, rotor_mass=18.0, bearing_number=4.5)  # doctest: +SKIP
    >>> answer.regime.text, round(answer.mle.value, 2)  # doctest: +SKIP
    ('chaotic', 0.39)
    """
    settings = settings or Settings()
    if start is None:
        settings.check_cold_start()
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
    regime = classify(trajectory.points, mle, trajectory.settled) if mle else None
    return OperatingPoint(
        design,
        float(rotor_mass),
        float(bearing_number),
        settings,
        trajectory,
        mle,
        regime,
        start is None,
    )
