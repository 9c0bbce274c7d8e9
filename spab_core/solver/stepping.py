"""Time integration of state and tangent, revolution by revolution.

:func:`advance` drives any system that offers the functions listed in :mod:`spab_core.solver.slope`;
:func:`bind` compiles it for another one (the tests run Lorenz, Duffing and Ueda through the very
code that runs the rotor). Two methods:

``rodas``
    RODAS4 (:mod:`spab_core.solver.rodas`), implicit. The step follows the embedded error estimate.
``dtm``
    The paper's differential transformation: Taylor recurrences of high order in time
    (:mod:`spab_core.solver.dtm`), explicit.
"""

from __future__ import annotations

import math
import types
from typing import NamedTuple

import numba
import numpy as np
from numba import njit
from numba.extending import overload

from spab_core.solver.axial import PLACE, SPEED, moves, nearness
from spab_core.solver.dtm import DTM_ORDER, build_series, dtm_step
from spab_core.solver.film import Film, film_size, gas_size, rotor_size, with_wall
from spab_core.solver.rodas import DEFAULT_TOLERANCE, Stages, build_stages, rodas_step
from spab_core.solver.rotor import CENTRE, ROTOR_STATES
from spab_core.solver.simd import (
    EIGHT,
    WIDTH,
    aligned_zeros,
    chosen,
    inlined,
    kernel,
    load,
    splat,
    store,
    total,
)
from spab_core.solver.slope import Work, build_work
from spab_core.solver.wall import gas_entries

METHODS = ("rodas", "dtm")
REVOLUTION = 2.0 * math.pi
TOUCHDOWN_ECCENTRICITY = 0.9995
OK, TOUCHDOWN, STEP_TOO_SMALL, TOO_MANY_STEPS, AXIAL_STOP = 0, 1, 2, 3, 4
STATUS = ("ok", "touchdown", "step-too-small", "too-many-steps", "axial-stop")
STATUS_TEXT = {
    "ok": "the run completed",
    "touchdown": "the journal touched the wall",
    "axial-stop": "the film does not carry the axial load: the journal lies at its axial stop",
    "step-too-small": "the step fell below its limit: somewhere near the wall the film lost all "
    "gas; a finer mesh may help, "
    "else less load, unbalance or suction",
    "too-many-steps": "a revolution takes too many steps: rotor and film vibrate, or bounce on or "
    "fall to the wall, far faster "
    "than the shaft turns; method rodas takes the fewest",
}

MAX_STEP = REVOLUTION / 8.0
_MIN_STEP = 1e-10
_SUBSAMPLES = 4  # of a step, for contact share and largest eccentricity


class Options(NamedTuple):
    """How to integrate.

    Attributes
    ----------
    tolerance : float
        Largest error estimate of a step (``slope.error_norm``), unless ``fixed``.
    max_step : float
        Largest step in tau; the step itself where ``fixed``.
    fixed : bool
        Keep the step, ignore the error estimate.
    tangent : bool
        Integrate the tangent too.
    period : float
        Length of a revolution in tau: 2 pi for the rotor.
    max_steps : int
        In one revolution.
    """

    tolerance: float = DEFAULT_TOLERANCE
    max_step: float = MAX_STEP
    fixed: bool = False
    tangent: bool = False
    period: float = REVOLUTION
    max_steps: int = 400_000


class Record(NamedTuple):
    """What :func:`advance` writes, a row a revolution.

    Attributes
    ----------
    section : ndarray, (revolutions, 8)
        Rotor state at the end of each revolution; (revolutions, 10) with Z and Z' where the journal
        moves along the axis.
    growth : ndarray, (revolutions,)
        Natural log of the tangent's growth in each revolution.
    contact, thin : ndarray, (revolutions,)
        Time in tau in contact (:func:`~spab_core.solver.rotor.contact_eccentricity`), and at an
        eccentricity above :data:`THIN_FILM`.
    peak, force : ndarray, (revolutions,)
        Largest eccentricity (where the journal moves along the axis one less the least gap over C),
        and largest normal force of the asperities over p_a R².
    box : ndarray, (revolutions, 4)
        Least and largest X, least and largest Y of the journal; (revolutions, 6) with those of Z.
    path : ndarray, (revolutions, samples, 8)
        Rotor states at equal spacing, the first at the start of the revolution; (revolutions,
        samples, 10) with Z and Z'.
    """

    section: np.ndarray
    growth: np.ndarray
    contact: np.ndarray
    thin: np.ndarray
    peak: np.ndarray
    force: np.ndarray
    box: np.ndarray
    path: np.ndarray


def build_record(revolutions: int, samples: int, *, moving: bool = False) -> Record:
    """Allocate a record, with what axial motion adds where the journal moves."""
    shapes: dict[str, tuple[int, ...]] = {
        "section": (ROTOR_STATES + 2 * moving,),
        "box": (4 + 2 * moving,),
        "path": (samples, ROTOR_STATES + 2 * moving),
    }
    return Record(
        *(np.full((revolutions, *shapes.get(name, ())), np.nan) for name in Record._fields)
    )


# places of Memory.control: step to try next (0: seek it), steps taken, those of them rejected, last
# accepted step (0: none) and its error over the tolerance
NEXT_STEP, STEPS, REJECTED, LAST_STEP, LAST_ERROR = range(5)


class Memory(NamedTuple):
    """State, tangent and scratch of one trajectory.

    ``series`` is None for ``rodas``: its type tells the compiler which of the methods to compile.
    ``control`` is what the step control carries on, by :data:`NEXT_STEP` to :data:`LAST_ERROR`.
    """

    work: Work
    stages: Stages
    series: np.ndarray | None
    state: np.ndarray
    tangent: np.ndarray
    control: np.ndarray


def build_memory(film: Film, method: str = "rodas") -> Memory:
    """Memory of one trajectory at the cold start: rotor at rest at the centre, P = 1, the wall as
    steady flow into such a film leaves it, a fixed generic tangent.

    The tangent's entries for the unused disc of a rigid rotor stay zero for all time."""
    n = gas_size(film)
    size = n + rotor_size(film)
    state, tangent = aligned_zeros(size), aligned_zeros(size)
    ambient = np.zeros(film_size(film) + rotor_size(film))
    # S = P H; a journal that moves along the axis begins in the middle
    base = np.ones_like(film.base) if film.slide else film.base
    ambient[: film_size(film)] = np.repeat(base, film.columns)
    state[:] = with_wall(film, ambient)
    tangent[:n] = np.random.default_rng(0).standard_normal(n) / math.sqrt(n)
    tangent[n], tangent[n + 1], tangent[n + 4], tangent[n + 5] = 0.5, 0.3, 0.4, -0.2
    if film.slide:
        tangent[n + PLACE], tangent[n + SPEED] = 0.35, 0.25
    tangent /= np.linalg.norm(tangent)
    return Memory(
        build_work(film),
        build_stages(size),
        build_series(film) if method == "dtm" else None,
        state,
        tangent,
        np.zeros(5),
    )


def seek_step(memory: Memory) -> None:
    """Have the next step sought anew, after a change of the state or of what steps must follow."""
    memory.control[NEXT_STEP] = memory.control[LAST_STEP] = 0.0


def take_step(system, memory, t, h, with_tangent):
    """One step of the method that the memory is for; returns the error norm and minus the
    reciprocal of its order.
    """
    raise NotImplementedError  # compiled only


@overload(take_step, jit_options={"error_model": "numpy", "nogil": True, "forceinline": True})
def _take_step(system, memory, t, h, with_tangent):
    if isinstance(memory.types[memory.fields.index("series")], numba.types.NoneType):
        return lambda system, memory, t, h, with_tangent: (
            rodas_step(
                system, memory.work, memory.stages, t, h, memory.state, memory.tangent, with_tangent
            ),
            -0.25,
        )
    return lambda system, memory, t, h, with_tangent: (
        dtm_step(
            system,
            memory.work,
            memory.stages,
            memory.series,
            t,
            h,
            memory.state,
            memory.tangent,
            with_tangent,
        ),
        -1.0 / DTM_ORDER,
    )


@inlined
def _hermite(a, b, da, db, s, h):
    """Cubic through values and slopes at the ends of a step, at the fraction s: value and
    derivative.
    """
    d = b - a
    c2, c3 = 3.0 * d - h * (2.0 * da + db), -2.0 * d + h * (da + db)
    return a + s * (h * da + s * (c2 + s * c3)), da + s * (2.0 * c2 + 3.0 * s * c3) / h


def closeness(film, u, new, n, x, y, vx, vy, s, h):
    """Return how near to the wall a journal at (x, y) is at the fraction s of a step: its
    eccentricity, or 1 less the least gap where it moves along the axis; times how fast that grows;
    and Z.
    """
    raise NotImplementedError  # compiled only


@chosen(closeness)
def _closeness(film, u, new, n, x, y, vx, vy, s, h):
    if not moves(film):
        return lambda film, u, new, n, x, y, vx, vy, s, h: (
            math.sqrt(x * x + y * y),
            x * vx + y * vy,
            0.0,
        )

    def moving(film, u, new, n, x, y, vx, vy, s, h):
        z, vz = _hermite(u[n + 8], new[n + 8], u[n + 9], new[n + 9], s, h)
        near, e = nearness(film.edge_cosine, film.edge_sine, x, y, z), math.sqrt(x * x + y * y)
        if abs(z) * film.edge_cosine <= e * film.edge_sine:
            return near, x * vx + y * vy + z * vz, z
        across = film.edge_cosine * (x * vx + y * vy) / max(e, 1e-9)
        return near, near * (across + math.copysign(film.edge_sine, z) * vz), z

    return moving


def rotor_entries(system, u):
    """Return where the rotor's entries begin in a state: its last eight, unless axial motion
    follows.
    """
    raise NotImplementedError  # compiled only


@chosen(rotor_entries)
def _rotor_entries(system, u):
    if "film" in getattr(system, "fields", ()):
        return lambda system, u: gas_entries(
            system.film.latitudes, system.film.ring, system.film.depth
        )
    return lambda system, u: u.size - ROTOR_STATES


@inlined
def observe(system, u, new, h, row, record):
    """Contact, thin film, largest eccentricity and force, and touchdown within one step, from its
    cubic interpolant.
    """
    film, rotor = system
    n = gas_entries(film.latitudes, film.ring, film.depth)
    touchdown = False
    for k in range(1, _SUBSAMPLES + 1):
        s = k / _SUBSAMPLES
        x, vx = _hermite(u[n], new[n], u[n + 4], new[n + 4], s, h)
        y, vy = _hermite(u[n + 1], new[n + 1], u[n + 5], new[n + 5], s, h)
        e, growing, z = closeness(film, u, new, n, x, y, vx, vy, s, h)
        box = record.box[row]
        box[0], box[1] = min(box[0], x), max(box[1], x)
        box[2], box[3] = min(box[2], y), max(box[3], y)
        if box.size > 4:
            box[4], box[5] = min(box[4], z), max(box[5], z)
        if e > record.peak[row]:
            record.peak[row] = e
        if e > film.thin:
            record.thin[row] += h / _SUBSAMPLES
        if e > rotor.contact_eccentricity:
            record.contact[row] += h / _SUBSAMPLES
        # the radial speed moves the largest force by less than one roughness
        if e > CENTRE and e > record.peak[row] - rotor.roughness:
            normal = rotor.contact_force * math.exp((e - 1.0) / rotor.roughness)
            normal *= 1.0 + rotor.damping * growing / e
            record.force[row] = max(record.force[row], normal)
        touchdown = touchdown or e >= TOUCHDOWN_ECCENTRICITY * film.room
    return touchdown


@inlined
def sample(u, new, n, t, h, start, spacing, row, record):
    """Fill the path samples that fall into the step [t, t + h); the rotor's entries begin at n."""
    samples = record.path.shape[1]
    k = max(0, math.ceil((t - start) / spacing - 1e-9))
    while k < samples and start + k * spacing < t + h * (1.0 - 1e-12):
        s = (start + k * spacing - t) / h
        for c in range(4):
            x, v = _hermite(u[n + c], new[n + c], u[n + 4 + c], new[n + 4 + c], s, h)
            record.path[row, k, c], record.path[row, k, 4 + c] = x, v
        if record.path.shape[2] > SPEED:
            z, v = _hermite(u[n + PLACE], new[n + PLACE], u[n + SPEED], new[n + SPEED], s, h)
            record.path[row, k, PLACE], record.path[row, k, SPEED] = z, v
        k += 1


@inlined
def _step_factor(control, h, size, exponent):
    """By how much to change the step h after an error of ``size`` tolerances."""
    if not math.isfinite(size):
        return 0.25
    factor = 0.9 * max(size, 1e-12) ** exponent
    if size <= 1.0 and control[LAST_STEP] > 0.0 and size > 1e-3:
        # Gustafsson's predictive control: where errors grow from step to step, shrink ahead of them
        ahead = factor * h / control[LAST_STEP] * (size / control[LAST_ERROR]) ** exponent
        factor = min(factor, ahead)
    return min(4.0, max(0.2, factor))


@inlined
def _renormalise(new, out):
    """Copy a tangent at unit length to ``out``; return the length it had."""
    squares = splat(0.0, EIGHT)
    for k in range(0, out.size, WIDTH):
        squares = squares + load(new, k, EIGHT) * load(new, k, EIGHT)
    norm = math.sqrt(total(squares))
    for k in range(0, out.size, WIDTH):
        store(out, k, load(new, k, EIGHT) * (1.0 / norm))
    return norm


@kernel
def advance(system, memory, options, first, revolutions, record):
    """Integrate whole revolutions from the state and tangent in ``memory``, in place.

    Parameters
    ----------
    system : System
        Or what a bound system takes.
    memory : Memory
    options : Options
    first : int
        Number of revolutions done since the start of the run: tau = first * period.
    revolutions : int
        How many to do; row r of ``record`` receives revolution r.
    record : Record

    Returns
    -------
    status, done : int
        Index into :data:`STATUS` and the number of complete revolutions.
    """
    u, v, control = memory.state, memory.tangent, memory.control
    new, new_v = memory.stages.new, memory.stages.new_tangent
    samples, n = record.path.shape[1], rotor_entries(system, u)
    for row in range(revolutions):
        start = (first + row) * options.period
        end = (first + row + 1) * options.period
        t, growth = start, 0.0
        record.contact[row] = record.thin[row] = record.peak[row] = record.force[row] = 0.0
        for c in range(0, record.box.shape[1], 2):
            record.box[row, c], record.box[row, c + 1] = math.inf, -math.inf
        steps = 0
        while t < end:
            natural = (
                min(control[NEXT_STEP], options.max_step)
                if control[NEXT_STEP] > 0.0
                else 0.1 * options.max_step
            )
            if options.fixed:
                natural = options.max_step
            # equal steps to the end of the revolution: they meet it, and a periodic orbit meets the
            # same steps every time
            remaining = end - t
            count = math.ceil(remaining / natural * (1.0 - 1e-9))
            h = remaining / count
            error, exponent = take_step(system, memory, t, h, options.tangent)
            steps += 1
            control[STEPS] += 1.0
            size = error / options.tolerance
            factor = _step_factor(control, h, size, exponent)
            if not size <= 1.0 and not (options.fixed and math.isfinite(size)):
                control[NEXT_STEP] = h * min(factor, 0.9)
                control[REJECTED] += 1.0
                if control[NEXT_STEP] < _MIN_STEP or options.fixed:
                    return STEP_TOO_SMALL, row
                if steps > options.max_steps:
                    return TOO_MANY_STEPS, row
                continue
            control[LAST_STEP], control[LAST_ERROR] = h, max(size, 1e-3)
            # a step cut short to meet the end of the revolution does not shrink the next one
            control[NEXT_STEP] = h * factor if h > 0.7 * natural else max(natural, h * factor)
            touchdown = observe(system, u, new, h, row, record)
            if samples > 0:
                sample(u, new, n, t, h, start, options.period / samples, row, record)
            for k in range(0, u.size, WIDTH):
                store(u, k, load(new, k, EIGHT))
            t = end if count == 1 else t + h
            if touchdown:
                return TOUCHDOWN, row
            if options.tangent:
                norm = _renormalise(new_v, v)
                if not (norm > 0.0 and math.isfinite(norm)):
                    return STEP_TOO_SMALL, row
                growth += math.log(norm)
            if steps > options.max_steps:
                return TOO_MANY_STEPS, row
        for c in range(record.section.shape[1]):
            record.section[row, c] = u[n + c]
        record.growth[row] = growth
    return OK, revolutions


def bind(function, **replacements):
    """Compile ``function`` for another system.

    The code object is the same; only the global names it calls are replaced, in it and in the
    Rosenbrock step that it calls.

    Parameters
    ----------
    function : dispatcher
        :func:`advance` or :func:`rodas_step`.
    **replacements : dispatcher
        Compiled functions by the name they replace: ``slope``, ``slope_tangent``, ``time_slope``,
        ``linearise``, ``solve``, ``prepare_curvature``, ``add_curvature``, ``error_norm``,
        ``observe``, or the whole ``rodas_step``.

    Returns
    -------
    dispatcher
    """
    source = function.py_func
    names = {**source.__globals__, **replacements}
    if function is advance:
        rodas = replacements.get("rodas_step") or bind(rodas_step, **replacements)
        names["take_step"] = njit(nogil=True)(
            lambda system, memory, t, h, with_tangent: (
                rodas(
                    system,
                    memory.work,
                    memory.stages,
                    t,
                    h,
                    memory.state,
                    memory.tangent,
                    with_tangent,
                ),
                -0.25,
            )
        )
    return njit(nogil=True)(types.FunctionType(source.__code__, names, source.__name__))


__all__ = [
    "DEFAULT_TOLERANCE",
    "MAX_STEP",
    "METHODS",
    "OK",
    "REVOLUTION",
    "STATUS",
    "STATUS_TEXT",
    "Memory",
    "Options",
    "Record",
    "advance",
    "bind",
    "build_memory",
    "build_record",
    "rodas_step",
    "seek_step",
]
