"""One trajectory from the cold start: rotor at rest at the centre, P = 1, load and unbalance raised
over 30 revolutions.
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spab_core.common.errors import DesignError, InputError
from spab_core.design.limits import check_point
from spab_core.design.model import Design
from spab_core.linear_theory.equilibrium import MAX_DENSE_CELLS
from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.solver.film import build_film, film_size
from spab_core.solver.rotor import RAMP_REVOLUTIONS, ROTOR_STATES, RotorCoefficients, build_rotor
from spab_core.solver.slope import slope_and_jacobian, unknown_places
from spab_core.solver.stepping import (
    DEFAULT_TOLERANCE,
    MAX_STEP,
    OK,
    REVOLUTION,
    STATUS,
    TOO_MANY_STEPS,
    Options,
    Record,
    advance,
    build_memory,
    build_record,
)
from spab_core.trajectory.periodic_orbit import (
    CHECK_EVERY,
    MEMORY,
    SWIFT,
    UNSTABLE,
    Settled,
    find_settled,
    is_near,
    push,
    repeating_period,
    strong_rate,
    swift_mode,
    window,
)
from spab_core.trajectory.settings import Settings

# last revolutions of the transient (at most half of it) in which the tangent already runs: on a
# sheared
ALIGNMENT = 100
# torus it grows like the time, which leaves a bias of ln(1 + T/a)/T after T measured and a aligning
# revolutions
STRONG, FINE_STEPS = (
    -2.0,
    768,
)  # rate per revolution under which the tangent is measured again, at so many steps a revolution
THIN, BUSY, FINER = (
    0.96,
    400,
    16.0,
)  # eccentricity, or steps a revolution, from which on, and where a run fails, the tolerance
# is divided by FINER: it is over the clearance, not over the film, and a vibration of many steps
# adds up the errors of each
MOST_STEPS = 10_000  # a revolution, at the default tolerance
# own vibrations over the shaft speed: from there on rounding of positions alone accelerates by 1e-5
# and more
FASTEST = 3e5
PHASES, PER_SWING = (
    4,
    12,
    # instants of a revolution at which swift vibrations are sought; steps for one swing of a growing
    # one
)
# last revolutions of a run without a check: recording paths there must not change where the run
# stops
_ATTENTION = 50

Progress = Callable[[int], None]


@dataclass(frozen=True)
class Trajectory:
    """What one run gave. Lengths over C, time as tau = omega t.

    Arrays cover the measured revolutions. Where the run settled on a periodic orbit these are its
    last whole periods, and ``growth`` covers all revolutions with a tangent.

    Attributes
    ----------
    status : str
        One of ``integrate.STATUS``; not ``ok`` means that the run ended at its revolution
        ``completed``.
    completed : int
        Revolutions done, transient included.
    section : ndarray, (revolutions, 8)
        Rotor state [X2, Y2, X1, Y1, X2', Y2', X1', Y1'] at tau = 2 pi k.
    growth : ndarray, (revolutions,)
        Natural log of the tangent's growth in each revolution.
    contact : ndarray, (revolutions,)
        Share of each revolution spent at an eccentricity above 0.9.
    peak : ndarray, (revolutions,)
        Largest eccentricity in each revolution.
    path : ndarray, (path revolutions, samples, 8)
        Rotor states in the last recorded revolutions.
    steps : int
        Integration steps taken.
    wall_seconds : float
    final : ndarray
        State vector at the end: gas content of the film, then the rotor.
    settled : Settled or None
        The periodic orbit on which the run stopped early.
    """

    status: str
    completed: int
    section: np.ndarray
    growth: np.ndarray
    contact: np.ndarray
    peak: np.ndarray
    path: np.ndarray
    steps: int
    wall_seconds: float
    final: np.ndarray
    settled: Settled | None = None


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
        For an operating point out of range, or a start that does not fit the mesh.
    """
    check_point(rotor_mass, bearing_number)
    given = (
        design,
        rotor_mass,
        bearing_number,
        settings or Settings(),
        path_revolutions,
        samples,
        start,
        progress,
    )
    if _out_of_steps(design, rotor_mass, bearing_number, given[3]):
        film, nothing = (
            build_film(design, bearing_number, given[3].mesh, given[3].scheme),
            np.empty(0),
        )
        return Trajectory(
            STATUS[TOO_MANY_STEPS],
            0,
            np.empty((0, ROTOR_STATES)),
            nothing,
            nothing,
            nothing,
            np.empty((0, samples, ROTOR_STATES)),
            0,
            0.0,
            build_memory(film).state,
        )
    found, growing = _run(*given, MAX_STEP)
    if growing:  # a vibration that long steps have damped away
        steps = 2.0 ** math.ceil(math.log2(PER_SWING * growing))
        if steps > MOST_STEPS:
            return dataclasses.replace(found, status=STATUS[TOO_MANY_STEPS], settled=None)
        found, _ = _run(*given, REVOLUTION / steps)
    return found


def _run(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings,
    path_revolutions: int,
    samples: int,
    start: np.ndarray | None,
    progress: Progress | None,
    max_step: float,
) -> tuple[Trajectory, float]:
    """:func:`simulate` with steps of at most ``max_step``; and the frequency, over the shaft speed,
    of a growing vibration that they cannot follow, 0 for none."""
    began = time.perf_counter()
    film = build_film(design, bearing_number, settings.mesh, settings.scheme)
    rotor = build_rotor(design, rotor_mass, bearing_number)
    system = (film, rotor)
    memory = build_memory(film, settings.method)
    before = 0  # revolutions that the start has behind it: the load is raised over the first ones
    if start is not None:
        if np.shape(start) != memory.state.shape:
            raise DesignError(
                f"start has shape {np.shape(start)}; a state on mesh {settings.mesh} has "
                f"{memory.state.shape}"
            )
        memory.state[:] = start
        before = math.ceil(RAMP_REVOLUTIONS)
    # the steps of dtm are limited by stability, so a smaller tolerance costs nothing and keeps its
    # tangent clean
    tolerance = min(settings.tolerance, 1e-6) if settings.method == "dtm" else settings.tolerance
    transient, total = int(settings.transient), int(settings.transient) + int(settings.revolutions)
    kept = min(path_revolutions, int(settings.revolutions))
    aligned = min(ALIGNMENT, transient // 2)
    done, status, tangent = 0, OK, False
    records: list[Record] = []  # of the chunks so far
    first_tangent = total  # first revolution with a tangent
    settled, rates, pushed = None, dict[int, float](), False
    implicit, careful, growing = settings.method == "rodas", False, 0.0
    share = (DEFAULT_TOLERANCE / tolerance) ** 0.25  # of steps, over those at the default tolerance
    limits = {"max_step": max_step, "max_steps": int(MOST_STEPS * share)} if implicit else {}

    def run(count, keep=False, **more):
        nonlocal done, status, tolerance, careful
        at_first = memory.state.copy(), memory.tangent.copy(), memory.control[1]
        while True:
            record = build_record(
                count, samples if keep else 0, film_size(film) + ROTOR_STATES if tangent else 0
            )
            options = Options(tolerance, tangent=tangent, **(limits | more))
            status, completed = advance(system, memory, options, before + done, count, record)
            busy = implicit and memory.control[1] - at_first[2] > BUSY * share * count
            if (
                careful
                or more
                or status == TOO_MANY_STEPS
                or not (status != OK or busy or record.peak.max() > THIN)
            ):
                break
            careful, tolerance = (
                True,
                tolerance / FINER,
            )  # these revolutions once more, and all that follow
            memory.state[:], memory.tangent[:] = at_first[:2]
            memory.control[0] = memory.control[3] = 0.0  # the step is sought anew
        done += completed
        records.append(Record(*(a[:completed] for a in record)))
        if progress:
            progress(completed)

    def last(field, rows):
        """The last rows of a field of the records."""
        parts, found = [], 0
        for record in reversed(records):
            if found >= rows:
                break
            parts.append(getattr(record, field))
            found += len(parts[-1])
        empty = np.empty((0, *getattr(records[0], field).shape[1:]))
        return np.concatenate(parts[::-1])[-rows:] if rows > 0 and parts else empty

    while done < total - kept and status == OK and settled is None:
        if not tangent and done >= transient - aligned:
            tangent, first_tangent = True, done
        edges = (
            done + CHECK_EVERY - done % CHECK_EVERY,
            transient - aligned,
            transient,
            total - kept,
        )
        run(min(edge for edge in edges if edge > done) - done)
        if (
            status == OK
            and settings.early_stop
            and done % CHECK_EVERY == 0
            and done <= total - max(kept, _ATTENTION)
        ):
            section = last("section", 3 * MEMORY)
            if not tangent:
                if (before + done) * REVOLUTION > system[1].ramp and is_near(section):
                    tangent, first_tangent = True, done
            else:
                rows = min(MEMORY, done - first_tangent)
                found = find_settled(section, last("tangent", rows), last("growth", rows), rates)
                if found and found.rate < 0.0:
                    settled = found
                elif found and not pushed and done <= transient // 2:
                    push(memory.state, memory.tangent)
                    memory.control[0] = memory.control[3] = 0.0  # the step is sought anew
                    pushed = True
    measured = window(settled.period) if settled else max(done - transient, 0)
    if (
        settings.early_stop
        and settings.method == "rodas"
        and status == OK
        and (settled or measured)
    ):
        rate = settled.rate if settled else last("growth", measured).mean()
        period = repeating_period(last("section", 3 * MEMORY)) if rate < STRONG else None
        if (
            period is not None
            # its leading modes swing many times a step, and die too fast to be worth short ones before
        ):
            run(2 * CHECK_EVERY, max_step=min(max_step, REVOLUTION / FINE_STEPS), fixed=True)
            memory.control[0] = memory.control[3] = 0.0
            if status == OK:
                settled = strong_rate(records[-1].tangent, records[-1].growth, period)
                measured = window(settled.period)
    if (
        implicit
        and settings.early_stop
        and status == OK
        and (settled or measured)
        and _may_be_swift(design, rotor)
    ):
        rate = settled.rate if settled else last("growth", measured).mean()
        period = settled.period if settled else repeating_period(last("section", 3 * MEMORY))
        swift = (
            _swift_rate(system, memory, design.rigid, tolerance, before + done)
            if period is not None
            else None
        )
        if period and swift and swift[0] > rate - (3.0 * settled.error if settled else 0.0):
            if swift[0] < UNSTABLE:
                settled = Settled(period, *swift[:2])
                measured = window(period)
            elif max_step == MAX_STEP:
                growing = swift[2]
    if kept and status == OK:
        run(kept, keep=True)
        measured += len(records[-1].section)
    path = records[-1].path if kept and records else np.empty((0, samples, ROTOR_STATES))
    arrays = {name: last(name, measured) for name in ("section", "contact", "peak")}
    growth = last("growth", done - first_tangent if settled else measured)
    if design.rigid:  # the disc is the journal
        for array in (arrays["section"], path):
            array[..., 2:4], array[..., 6:8] = array[..., 0:2], array[..., 4:6]
    seconds, contact = time.perf_counter() - began, arrays["contact"] / REVOLUTION
    trajectory = Trajectory(
        STATUS[status],
        done,
        arrays["section"],
        growth,
        contact,
        arrays["peak"],
        path,
        int(memory.control[1]),
        seconds,
        memory.state.copy(),
        settled,
    )
    return trajectory, growing


def _own_frequency(design: Design, rotor: RotorCoefficients) -> float:
    """A generous bound of the frequency, over the shaft speed, at which the rotor vibrates on its
    film and shaft.
    """
    film = 4.0 * max(design.bearing.supply_pressure_ratio, 1.0)
    return math.sqrt(film * rotor.inverse_mass + rotor.coupling_journal + rotor.coupling_disc)


def _may_be_swift(design: Design, rotor: RotorCoefficients) -> bool:
    """Whether a vibration can be :data:`floquet.SWIFT` and not die at once: only a supply feeds it."""
    return design.bearing.supply_pressure_ratio != 1.0 and _own_frequency(design, rotor) > SWIFT


def _out_of_steps(
    design: Design, rotor_mass: float, bearing_number: float, settings: Settings
) -> bool:
    """Whether no affordable steps follow the rotor: its own vibration is too fast, or one that
    grows from rest is.
    """
    frequency = _own_frequency(design, build_rotor(design, rotor_mass, bearing_number))
    if frequency > FASTEST:
        return True
    if (
        PER_SWING * frequency < MOST_STEPS
        or design.bearing.supply_pressure_ratio == 1.0
        or settings.method != "rodas"
        or settings.mesh.latitude * settings.mesh.azimuth > MAX_DENSE_CELLS
    ):
        return False
    try:
        found = linear_spectrum(design, rotor_mass, bearing_number, settings.mesh)
    except (InputError, np.linalg.LinAlgError):  # no rest to start from: the run will tell
        return False
    return found is not None and any(
        v.real > UNSTABLE and PER_SWING * v.imag > MOST_STEPS for v in found[0]
    )


def _swift_rate(system, memory, rigid, tolerance, first) -> tuple[float, float, float] | None:
    """Rate per revolution of the least damped swift vibration on a periodic orbit, its error, and
    its frequency; or None.

    The mean over the instants of the next revolution; the error is how far the mean of every other
    one is from it."""
    film, rotor = system
    places, state = unknown_places(film, rigid), memory.state.copy()
    found: list[complex] = []
    options = Options(tolerance, period=REVOLUTION / PHASES)
    for k in range(PHASES):
        mode = swift_mode(slope_and_jacobian(film, rotor, memory.state, places)[1][places])
        status, _ = advance(system, memory, options, PHASES * first + k, 1, build_record(1, 0))
        if mode is None or status != OK:
            found = []
            break
        found.append(mode)
    memory.state[:] = state
    memory.control[0] = memory.control[3] = 0.0
    rates = 2.0 * math.pi * np.array([mode.real for mode in found])
    return (
        (float(rates.mean()), float(abs(rates[::2].mean() - rates.mean())), abs(found[0]))
        if found
        else None
    )


def path_angle(trajectory: Trajectory) -> np.ndarray:
    """Shaft angle tau of the flattened last path, shape (path revolutions * samples,)."""
    revolutions, samples, _ = trajectory.path.shape
    start = 2.0 * math.pi * (trajectory.completed - revolutions)
    return start + np.arange(revolutions * samples) * (2.0 * math.pi / max(samples, 1))
