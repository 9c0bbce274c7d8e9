"""One trajectory from the cold start: rotor at rest at the centre, P = 1, load and unbalance raised
over 30 revolutions.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from spab_core.common.errors import DesignError, InputError
from spab_core.common.validation import check_whole
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import AxialStopError, running_system
from spab_core.linear_theory.spectrum import eigenvalues
from spab_core.linear_theory.whirl import spectrum_of
from spab_core.solver.film import (
    AUTO,
    MORE_AZIMUTHS,
    Mesh,
    gas_array,
    gas_size,
    least_gap,
    on_azimuths,
)
from spab_core.solver.rotor import RAMP_REVOLUTIONS, ROTOR_STATES, RotorCoefficients
from spab_core.solver.stepping import (
    AXIAL_STOP,
    DEFAULT_TOLERANCE,
    MAX_STEP,
    OK,
    REVOLUTION,
    STATUS,
    STEPS,
    TOO_MANY_STEPS,
    Options,
    Record,
    advance,
    build_memory,
    build_record,
    seek_step,
)
from spab_core.solver.system import System
from spab_core.trajectory.lyapunov import exponent
from spab_core.trajectory.periodic_orbit import (
    CHECK_EVERY,
    DISTANCE,
    REACH,
    SECTION,
    SWIFT,
    UNSTABLE,
    Settled,
    distance,
    mismatch,
    push,
    repeating_period,
    swift_mode,
    window,
)
from spab_core.trajectory.regimes import classify
from spab_core.trajectory.settings import MOST_REVOLUTIONS, Settings
from spab_core.trajectory.shooting import Shooting

# last revolutions of the transient (at most half of it) in which the tangent already runs: on a
# sheared torus it grows like the time, which leaves a bias of ln(1 + T/a)/T after T measured and a
# aligning revolutions
ALIGNMENT = 100
# eccentricity from which on a run takes the smaller tolerance: errors are measured over the
# clearance, not over the thin film
THIN = 0.96
# steps of a revolution from which on it does so too: a vibration of many steps adds up their errors
BUSY = 400
# by how much the smaller tolerance is smaller
FINER = 16.0
# allowed in a revolution, at the default tolerance
MOST_STEPS = 10_000
# own vibrations over the shaft speed: from there on rounding of positions alone accelerates by 1e-5
# and more
FASTEST = 3e5
# instants of a revolution at which swift vibrations are sought
PHASES = 4
# steps that one swing of a growing vibration takes
PER_SWING = 12
# columns of rotor states, and of a journal that moves along the axis
STATE = ("X2", "Y2", "X1", "Y1", "X2_dot", "Y2_dot", "X1_dot", "Y1_dot")
ALONG = ("Z", "Z_dot")
# last revolutions of a run: without a check, as recording paths there must not change where the run
# stops; a regime that they alone give or take is none yet
_ATTENTION = 50
# times the revolutions asked for, over which a motion is measured that has no regime yet
MOST_MEASURED = 4

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Trajectory:
    """What one run gave. Lengths over C, time as tau = omega t.

    Arrays cover the measured revolutions. Where the run settled on a periodic orbit these are its
    last whole periods, and ``growth`` covers all revolutions with a tangent, if any.

    Attributes
    ----------
    status : str
        One of ``stepping.STATUS``; not ``ok`` means that the run ended at its revolution
        ``completed``.
    completed : int
        Revolutions done, transient included.
    section : ndarray, (revolutions, 8)
        Rotor state [X2, Y2, X1, Y1, X2', Y2', X1', Y1'] at tau = 2 pi k.
    growth : ndarray, (revolutions,)
        Natural log of the tangent's growth in each revolution.
    contact, thin : ndarray, (revolutions,)
        Share of each revolution in which the asperities carry more than a tenth of the load
        (:func:`~spab_core.solver.rotor.contact_eccentricity`), and at an eccentricity above 0.9.
    peak, force : ndarray, (revolutions,)
        Largest eccentricity in each revolution (of a journal displaced along the axis one less the
        least film, over C), and largest normal force of the asperities over p_a R².
    box : ndarray, (revolutions, 4)
        Least and largest X2, least and largest Y2.
    path : ndarray, (path revolutions, samples, 8)
        Rotor states in the last recorded revolutions.
    axial : ndarray, (revolutions, 4)
        Z and Z' at tau = 2 pi k, and least and largest Z of each revolution, where the journal
        moves along the axis; else (0, 4).
    axial_path : ndarray, (path revolutions, samples, 2)
        Z and Z' with ``path``, where the journal moves along the axis; else (0, 0, 2).
    mesh : Mesh
        Of the film, at the end.
    steps : int
        Integration steps taken.
    wall_seconds : float
    final : ndarray
        State vector at the end: gas content of the film, then the rotor.
    settled : Settled or None
        The periodic orbit on which the run stopped early.
    pushed : int
        Revolution at which the run was pushed off an unstable periodic orbit, 0 if it was not.
    """

    status: str
    completed: int
    section: np.ndarray
    growth: np.ndarray
    contact: np.ndarray
    thin: np.ndarray
    peak: np.ndarray
    force: np.ndarray
    box: np.ndarray
    path: np.ndarray
    mesh: Mesh
    steps: int
    wall_seconds: float
    final: np.ndarray
    settled: Settled | None = None
    pushed: int = 0
    axial: np.ndarray = field(default_factory=lambda: np.empty((0, 4)))
    axial_path: np.ndarray = field(default_factory=lambda: np.empty((0, 0, 2)))

    @property
    def points(self) -> np.ndarray:
        """``section``, with Z and Z' where the journal moves along the axis."""
        if not len(self.axial):
            return self.section
        return np.concatenate([self.section, self.axial[:, :2]], axis=1)


def simulate(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings | None = None,
    *,
    path_revolutions: int = 0,
    samples: int = 96,
    start: np.ndarray | None = None,
    progress: Progress | None = None,
) -> Trajectory:
    """Run one operating point, from the cold start (docs/model.md) or from a given state.

    Parameters
    ----------
    design : Design
    rotor_mass : float
        Whole mass on one bearing, kg.
    bearing_number : float
        Lambda.
    settings : Settings
    path_revolutions : int
        How many of the last measured revolutions to keep as paths.
    samples : int
        Points a revolution of a path.
    start : ndarray, optional
        State vector at the end of a revolution, such as ``Trajectory.final`` of a neighbouring
        point on the same mesh, to go on from under full load.
    progress : callable
        Called with the number of revolutions done since the last call; an exception from it stops
        the run.

    Returns
    -------
    Trajectory
        A failed run is a status, not an exception.

    Raises
    ------
    DesignError
        For an operating point out of range, a method that does not solve the design's motion
        (:meth:`~spab_core.trajectory.settings.Settings.check_design`), or a start that does not
        fit the mesh.
    """
    check_point(rotor_mass, bearing_number)
    settings = settings or Settings()
    settings.check_design(design)
    check_whole("path_revolutions", path_revolutions, 0, MOST_REVOLUTIONS)

    def start_run(max_step: float) -> Run:
        return Run(
            design,
            (rotor_mass, bearing_number),
            settings,
            path_revolutions,
            samples,
            start,
            progress,
            max_step,
        )

    try:
        run = start_run(MAX_STEP)
    except AxialStopError:
        design = design.replace(rotor__axial_load=0.0)
        run = start_run(MAX_STEP)
        run.status = AXIAL_STOP
        return run.pack()
    if _out_of_steps(design, run.system, settings):
        run.status = TOO_MANY_STEPS
        return run.pack()
    found = run.solve()
    if run.growing:  # a vibration that long steps have damped away
        steps = 2.0 ** math.ceil(math.log2(PER_SWING * run.growing))
        if steps > MOST_STEPS:
            return dataclasses.replace(found, status=STATUS[TOO_MANY_STEPS], settled=None)
        found = start_run(REVOLUTION / steps).solve()
    return found


class Swift(NamedTuple):
    """The least damped swift vibration on a periodic orbit.

    Attributes
    ----------
    rate : float
        Per revolution, the mean over :data:`PHASES` instants of one.
    error : float
        Distance of that mean from the one over every other instant.
    frequency : float
        Over the shaft speed.
    """

    rate: float
    error: float
    frequency: float


class Run:
    """One trajectory on its way from the start to its :class:`Trajectory`.

    Parameters
    ----------
    design, settings, path_revolutions, samples, start, progress
        Those of :func:`simulate`.
    point : tuple of float
        Rotor mass in kg and bearing number.
    max_step : float
        Largest step in tau of ``rodas``.

    Attributes
    ----------
    system : System
        On the mesh taken so far.
    memory : Memory
        State, tangent and step control of the integrator.
    offset : int
        Revolutions that the start has behind it: the load is raised over the first ones.
    done : int
        Revolutions done.
    status : int
        Index into :data:`STATUS`.
    tolerance : float
        Of the steps.
    careful : bool
        Whether the run has gone over to the smaller tolerance.
    generic : ndarray
        Tangent with a part along every mode.
    tangent : bool
        Whether the tangent runs.
    first_tangent : int
        First revolution with a tangent.
    records : list of Record
        What the pieces of the run gave so far, none of length 0 but the first.
    path : ndarray, (path revolutions, samples, 8)
        Rotor states of the last revolutions.
    settled : Settled or None
        The periodic orbit reached.
    reached : Settled or None
        The one that the run nears.
    pushed : bool
        Whether the run has been pushed off an unstable orbit.
    moving : bool
        Whether the journal moves along the axis.
    growing : float
        Frequency, over the shaft speed, of a growing vibration that the steps cannot follow; 0 for
        none.
    """

    def __init__(
        self,
        design: Design,
        point: tuple[float, float],
        settings: Settings,
        path_revolutions: int = 0,
        samples: int = 96,
        start: np.ndarray | None = None,
        progress: Progress | None = None,
        max_step: float = MAX_STEP,
    ) -> None:
        self.began = time.perf_counter()
        self.design, self.point, self.settings = design, point, settings
        self.samples, self.progress, self.max_step = samples, progress, max_step
        self.system = running_system(design, *point, settings.mesh)
        self.memory = build_memory(self.system.film, settings.method)
        self.offset = 0
        if start is not None:
            if np.shape(start) != self.memory.state.shape and settings.mesh == AUTO:
                self._take_more_azimuths()
            if np.shape(start) != self.memory.state.shape:
                raise DesignError(
                    f"start has shape {np.shape(start)}; a state on mesh {settings.mesh} has "
                    f"{self.memory.state.shape}"
                )
            self.memory.state[:] = start
            self.offset = math.ceil(RAMP_REVOLUTIONS)
        self.implicit = settings.method == "rodas"
        # the steps of dtm are limited by stability, so a smaller tolerance costs nothing and keeps
        # its tangent clean
        self.tolerance = settings.tolerance if self.implicit else min(settings.tolerance, 1e-6)
        # of steps, over those at the default tolerance
        self.share = (DEFAULT_TOLERANCE / self.tolerance) ** 0.25
        self.transient = int(settings.transient)
        self.total = self.transient + int(settings.revolutions)
        self.kept = min(path_revolutions, int(settings.revolutions))
        self.done, self.status, self.careful = 0, OK, False
        self.tangent, self.first_tangent = False, self.total
        self.moving = bool(self.system.film.slide)
        self.records: list[Record] = [build_record(0, 0, moving=self.moving)]
        self.path = np.empty((0, samples, ROTOR_STATES + 2 * self.moving))
        self.settled: Settled | None = None
        self.reached: Settled | None = None  # what it will be, once the run is near enough
        self.generic = self.memory.tangent.copy()
        self.next_check = 0
        self.pushed = 0
        self.growing = 0.0
        self.steps_a_revolution = 0.0

    def solve(self) -> Trajectory:
        """Run until settled or decided or to the end; refine the rate; record the path of what
        settled.
        """
        self.run_to_end()
        while self._is_undecided():
            self.total += self.settings.revolutions
            self.run_to_end()
        if self._may_refine() and _may_be_swift(self.design, self.system.rotor):
            self.refine_swift_mode()
        if not len(self.path):
            self._record_path()
        return self.pack()

    def advance(self, count: int, samples: int = 0) -> Record:
        """Do so many revolutions, and keep their record.

        Where they fail, thin the film or take many steps, do them once more at the smaller
        tolerance, which then stays; where the film is thin, on more azimuths too, unless the mesh
        was asked for.
        """
        memory = self.memory
        state, tangent, steps = memory.state.copy(), memory.tangent.copy(), memory.control[STEPS]
        record, completed = self._attempt(count, samples)
        busy = self.implicit and memory.control[STEPS] - steps > BUSY * self.share * count
        thin = self.status != OK or record.peak.max() > THIN
        if not self.careful and self.status != TOO_MANY_STEPS and (busy or thin):
            self.careful, self.tolerance = True, self.tolerance / FINER
            memory.state[:], memory.tangent[:] = state, tangent
            if thin and self.settings.mesh == AUTO:
                self._take_more_azimuths()
            seek_step(self.memory)
            record, completed = self._attempt(count, samples)
        self.done += completed
        self.steps_a_revolution = (self.memory.control[STEPS] - steps) / max(completed, 1)
        self.records.append(Record(*(array[:completed] for array in record)))
        if self.progress:
            self.progress(completed)
        return self.records[-1]

    def _take_more_azimuths(self) -> None:
        """Go over to a mesh of more azimuths; stay where the film there would hold no gas."""
        old, before = self.memory, self.system.film
        mesh = Mesh(self.system.mesh.latitude, MORE_AZIMUTHS)
        system = running_system(self.design, *self.point, mesh)
        memory, n = build_memory(system.film, self.settings.method), gas_size(before)
        for vector, wanted in ((old.state, memory.state), (old.tangent, memory.tangent)):
            gas = on_azimuths(gas_array(before, vector), MORE_AZIMUTHS)
            wanted[:] = np.concatenate([gas.ravel(), vector[n:]])
        if memory.state[: gas_size(system.film)].min() > 0.0:
            memory.control[:] = old.control
            self.generic = build_memory(system.film).tangent
            self.system, self.memory = system, memory

    def _attempt(self, count: int, samples: int) -> tuple[Record, int]:
        """Integrate so many revolutions; return their record and how many are whole."""
        options = Options(self.tolerance, tangent=self.tangent)
        if self.implicit:
            options = options._replace(
                max_step=self.max_step, max_steps=int(MOST_STEPS * self.share)
            )
        record = build_record(count, samples, moving=self.moving)
        self.status, completed = advance(
            self.system, self.memory, options, self.offset + self.done, count, record
        )
        return record, completed

    def last(self, field: str, rows: int) -> np.ndarray:
        """Return the last rows of a field of the records."""
        parts = [getattr(self.records[0], field)]
        found = 0
        for record in reversed(self.records[1:]):
            if found >= rows:
                break
            parts.append(getattr(record, field))
            found += len(parts[-1])
        return np.concatenate(parts[:0:-1] or parts)[-rows:] if rows > 0 else parts[0]

    def _peak(self) -> np.ndarray:
        """Return the largest eccentricity of each revolution: with an axial offset one less the
        least film, over C.
        """
        peak, film = self.last("peak", self.measured), self.system.film
        if not film.offset or self.moving:
            return peak
        edge = self.design.bearing.edge
        return np.array([1.0 - least_gap(edge, film.offset, float(e)) for e in peak])

    @property
    def measured(self) -> int:
        """Revolutions that the result covers: whole periods of a settled orbit, and the path."""
        if self.settled:
            return window(self.settled.period) + len(self.path)
        return max(self.done - self.transient, 0)

    def run_to_end(self) -> None:
        """Run until settled, or to the end with the path of its last revolutions."""
        self.path = self.path[:0]
        self.run_until_settled()
        if self.settled is None:
            self._record_path()

    def _record_path(self) -> None:
        """Run the last revolutions, if they are asked for, and keep their path."""
        if self.kept and self.status == OK:
            self.path = self.advance(self.kept, self.samples).path

    def run_until_settled(self) -> None:
        """Run up to the recorded path, or until a check finds a periodic orbit that attracts."""
        end = self.total - self.kept
        tangent_from = self.transient - min(ALIGNMENT, self.transient // 2)
        last_check = self.total - max(self.kept, _ATTENTION)
        while self.done < end and self.status == OK and self.settled is None:
            if not self.tangent and self.done >= tangent_from:
                self.tangent, self.first_tangent = True, self.done
            next_check = self.done + CHECK_EVERY - self.done % CHECK_EVERY
            stops = (next_check, tangent_from, self.transient, end)
            self.advance(min(stop for stop in stops if stop > self.done) - self.done)
            if (
                self.status == OK
                and self.settings.early_stop
                and self.done % CHECK_EVERY == 0
                and self.next_check <= self.done <= last_check
            ):
                self._check()

    def _is_undecided(self) -> bool:
        """Whether the motion has no regime yet, with or without its last :data:`_ATTENTION`
        revolutions, and may be measured for longer: up to :data:`MOST_MEASURED` times the
        revolutions asked for.
        """
        if (
            self.status != OK
            or self.settled is not None
            or not self.settings.early_stop
            or self.measured <= _ATTENTION
            or self.measured >= MOST_MEASURED * self.settings.revolutions
        ):
            return False
        growth, section = self.last("growth", self.measured), self.last("section", self.measured)
        return "undecided" in [
            classify(section[:rows], mle).name
            for rows in (self.measured, self.measured - _ATTENTION)
            if (mle := exponent(growth[:rows])) is not None
        ]

    def _check(self) -> None:
        """Stop on a periodic orbit that attracts; push the run, once, off one that does not."""
        section = self.last("section", SECTION)
        period = repeating_period(section)
        if period is None or (self.offset + self.done) * REVOLUTION <= self.system.rotor.ramp:
            self.reached = None
            return
        if self.reached is None:
            self.next_check = self.done + self._find_orbit(period)
        if self.reached is not None:
            rate = self.reached.rate
            left = distance(mismatch(section, period), rate, period) / DISTANCE
            if left <= 1.0:
                self.settled = self.reached
            else:
                self.next_check = self.done + math.ceil(math.log(left) / -rate)

    def _find_orbit(self, period: int) -> int:
        """Look for the orbit that the run nears: note one that attracts, push the run off one that
        does not; return after how many revolutions to look again.
        """
        options, first = Options(self.tolerance), self.offset + self.done
        how = period, options, self.implicit, self.moving
        orbit = Shooting(self.system, self.memory, first, *how)
        found = orbit.find(self.generic, max(self.steps_a_revolution, REVOLUTION / self.max_step))
        rate, wait = found.settled.rate if found else 0.0, self.done // 2
        if found and rate < 0.0 and found.far <= REACH:
            self.reached = found.settled
        elif found and rate < 0.0 and math.isfinite(found.far):
            nearer = math.ceil(math.log(found.far / REACH) / -rate)
            wait = max(min(nearer, wait), self.done // 8)
        elif found and rate > UNSTABLE and not self.pushed and self.done <= self.transient // 2:
            push(self.memory.state, found.direction, self.system.film.edge if self.moving else None)
            seek_step(self.memory)
            self.pushed, wait = self.done, 0
        return wait

    def _may_refine(self) -> bool:
        return (
            self.implicit
            and self.settings.early_stop
            and self.status == OK
            and (self.settled is not None or self.measured > 0)
        )

    def _rate(self) -> float:
        """Rate per revolution found so far."""
        if self.settled:
            return self.settled.rate
        return float(self.last("growth", self.measured).mean())

    def refine_swift_mode(self) -> None:
        """Replace the rate where a vibration that long steps damp away dies more slowly; note one
        that grows, for shorter steps.
        """
        rate, slack = self._rate(), 3.0 * self.settled.error if self.settled else 0.0
        period = (
            self.settled.period if self.settled else repeating_period(self.last("section", SECTION))
        )
        swift = self._find_swift() if period is not None else None
        if period is None or swift is None or not swift.rate > rate - slack:
            return
        if swift.rate < UNSTABLE:
            self.settled = Settled(period, swift.rate, swift.error)
        elif self.max_step == MAX_STEP:
            self.growing = swift.frequency

    def _find_swift(self) -> Swift | None:
        """Find the least damped swift vibration along the next revolution; leave the state."""
        memory, first = self.memory, self.offset + self.done
        state = memory.state.copy()
        options = Options(self.tolerance, period=REVOLUTION / PHASES)
        fastest = max(2.0 * _own_frequency(self.design, self.system.rotor), 2.0 * SWIFT)
        modes: list[complex] = []
        for k in range(PHASES):
            mode = swift_mode(eigenvalues(self.system, memory.state, SWIFT, fastest))
            status, _ = advance(
                self.system,
                memory,
                options,
                PHASES * first + k,
                1,
                build_record(1, 0, moving=self.moving),
            )
            if mode is None or status != OK:
                break
            modes.append(mode)
        memory.state[:] = state
        seek_step(memory)
        if len(modes) < PHASES:
            return None
        rates = 2.0 * math.pi * np.array([mode.real for mode in modes])
        error = float(abs(rates[::2].mean() - rates.mean()))
        return Swift(float(rates.mean()), error, abs(modes[0]))

    def pack(self) -> Trajectory:
        """Return what the run gave so far."""
        section, box = self.last("section", self.measured), self.last("box", self.measured)
        section, along = section[:, :ROTOR_STATES], section[:, ROTOR_STATES:]
        axial = np.concatenate([along, box[:, 4:]], axis=1) if self.moving else np.empty((0, 4))
        path, axial_path = self.path[..., :ROTOR_STATES], self.path[..., ROTOR_STATES:]
        if self.design.rigid:  # the disc is the journal
            for array in (section, path):
                array[..., 2:4], array[..., 6:8] = array[..., 0:2], array[..., 4:6]
        with_tangent = max(self.done - self.first_tangent, 0)
        return Trajectory(
            STATUS[self.status],
            self.done,
            section,
            self.last("growth", with_tangent if self.settled else self.measured),
            self.last("contact", self.measured) / REVOLUTION,
            self.last("thin", self.measured) / REVOLUTION,
            self._peak(),
            self.last("force", self.measured),
            box[:, :4],
            path,
            self.system.mesh,
            int(self.memory.control[STEPS]),
            time.perf_counter() - self.began,
            self.memory.state.copy(),
            self.settled,
            self.pushed,
            axial,
            axial_path if self.moving else np.empty((0, 0, 2)),
        )


def _own_frequency(design: Design, rotor: RotorCoefficients) -> float:
    """A generous bound of the frequency, over the shaft speed, at which the rotor vibrates on its
    film and shaft.
    """
    bearing = design.bearing
    film = 2.0 * math.pi * bearing.edge if bearing.cylindrical else 4.0
    film *= max(bearing.supply_pressure_ratio, 1.0)
    return math.sqrt(film * rotor.inverse_mass + rotor.coupling_journal + rotor.coupling_disc)


def _may_be_swift(design: Design, rotor: RotorCoefficients) -> bool:
    """Whether a vibration can be :data:`SWIFT` and not die at once: only a supply feeds it."""
    return design.bearing.supply_pressure_ratio != 1.0 and _own_frequency(design, rotor) > SWIFT


def _out_of_steps(design: Design, system: System, settings: Settings) -> bool:
    """Whether no affordable steps follow the rotor: its own vibration is too fast, or one that
    grows from rest is.
    """
    frequency = _own_frequency(design, system.rotor)
    if frequency > FASTEST:
        return True
    if (
        PER_SWING * frequency < MOST_STEPS
        or design.bearing.supply_pressure_ratio == 1.0
        or settings.method != "rodas"
    ):
        return False
    try:
        found = spectrum_of(system.without_unbalance())
    except (InputError, np.linalg.LinAlgError):  # no rest to start from: the run will tell
        return False
    return found is not None and any(
        v.real > UNSTABLE and PER_SWING * v.imag > MOST_STEPS for v in found[0]
    )


def path_angle(trajectory: Trajectory) -> np.ndarray:
    """Shaft angle tau of the flattened last path, shape (path revolutions * samples,)."""
    revolutions, samples, _ = trajectory.path.shape
    start = 2.0 * math.pi * (trajectory.completed - revolutions)
    steps = np.arange(revolutions * samples) * (2.0 * math.pi / max(samples, 1))
    angles: np.ndarray = start + steps
    return angles


def path_table(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Return the last path as columns by name: tau, the states, and Z and its derivative where the
    journal moves along the axis; each of shape (path revolutions * samples,).
    """
    columns = {"tau": path_angle(trajectory)}
    columns |= dict(zip(STATE, trajectory.path.reshape(-1, ROTOR_STATES).T, strict=True))
    if trajectory.axial_path.size:
        columns |= dict(zip(ALONG, trajectory.axial_path.reshape(-1, 2).T, strict=True))
    return columns
