"""Are the numbers honest over the whole allowed ranges? Random designs and points, each held to
four promises.

    python benchmarks/honesty.py [--designs 1000] [--first 0] [--minutes 60]

Every design value, the rotor mass and the bearing number are drawn over their whole allowed ranges
(:func:`draw`). Promised:

- a finite exponent with its error, or a status other than ``ok``; no exception, under 20 s of
  computing;
- gas is conserved: over a revolution after the run, its content changes by what crosses the edges
  and the wall;
- half the step (a tolerance of a sixteenth: the method is of order 4) fails too where the run fails
  (a chaotic one may touch down within ten times its length), and else gives the same exponent,
  within three of their standard errors and 0.02, or 0.01 + 2 % where both settle on a periodic
  orbit of one regime.

Runs of 40 + 40 revolutions on 4 x 24; cases that break one are printed with their number, which
gives them again."""

import argparse
import collections
import dataclasses
import math
import time

import numpy as np
from scipy.integrate import simpson

from spab_core import Settings, solve_point
from spab_core.common.errors import DesignError
from spab_core.design.limits import BEARING_NUMBER_RANGE, ROTOR_MASS_RANGE
from spab_core.design.model import Bearing, Contact, Design, Gas, Rotor
from spab_core.solver.film import build_film, film_array, film_fluxes, gas_content
from spab_core.solver.rotor import build_rotor
from spab_core.solver.stepping import (
    DEFAULT_TOLERANCE,
    OK,
    REVOLUTION,
    Options,
    advance,
    build_memory,
    build_record,
)
from spab_core.solver.system import System

SETTINGS = Settings("4x24", transient=40, revolutions=40)
HALF = dataclasses.replace(SETTINGS, tolerance=DEFAULT_TOLERANCE / 16.0)
PIECES = 192  # of the revolution over which gas is counted
SECONDS = 20.0
LONGER = 10
CONSERVED = 1e-5  # of the gas in the film and of what crosses


class TooSlow(Exception):
    """Raised in a run's progress."""


def draw(seed):
    """(design, rotor mass, bearing number) over all allowed ranges: evenly in the logarithm where
    these span a factor of 30.

    Three designs in ten are open to ambient: the supply pressure ratio is 1.
    """
    rng = np.random.default_rng(seed)
    while True:
        try:
            design = Design(
                *(
                    part(
                        **{
                            f.name: _value(rng, f.metadata)
                            for f in dataclasses.fields(part)
                            if not f.metadata["later"]  # lest every case be another
                        }
                    )
                    for part in (Bearing, Gas, Rotor, Contact)
                )
            )
            if rng.random() < 0.3:
                design = design.replace(bearing__supply_pressure_ratio=1.0)
        except (
            DesignError
        ):  # a clearance above a twentieth of the radius, a feeding number out of range
            continue
        return design, *(
            float(np.exp(rng.uniform(*np.log(ends))))
            for ends in (ROTOR_MASS_RANGE, BEARING_NUMBER_RANGE)
        )


def _value(rng, m):
    low, high = m["low"], m["high"]
    if m["infinite"] and rng.random() < 0.1:
        return math.inf
    if low == 0.0:
        if rng.random() < 0.1 and not m["open_low"]:
            return 0.0
        low = min(1e-12, 1e-12 * high)
    return float(
        np.exp(rng.uniform(math.log(low), math.log(high)))
        if high > 30.0 * low
        else rng.uniform(low, high)
    )


def solve(design, mass, number, settings, seconds):
    """The operating point; raises :class:`TooSlow` after so many seconds of computing."""
    until = time.thread_time() + seconds

    def progress(_):
        if time.thread_time() > until:
            raise TooSlow

    return solve_point(design, mass, number, settings, progress=progress)


def gas_lost(point, pieces=PIECES):
    """How far the content's change over the next revolution is from what crosses the boundary, over
    content and crossing gas.

    None where the run does not get through that revolution. What crosses is summed over ``pieces``
    by Simpson's rule, an eighth of a revolution later: the step is sought anew, and what long steps
    left of fast decays comes first."""
    film = build_film(point.design, point.bearing_number, point.settings.mesh)
    system = System(film, build_rotor(point.design, point.rotor_mass, point.bearing_number))
    memory = build_memory(film, point.settings.method)
    memory.state[:] = point.trajectory.final
    options = Options(point.settings.tolerance, period=REVOLUTION / pieces)
    contents, flows, sizes = [], [], []
    first = point.trajectory.completed * pieces + pieces // 8
    if (
        advance(
            system, memory, options, first - pieces // 8, pieces // 8, build_record(pieces // 8, 0)
        )[0]
        != OK
    ):
        return None
    for k in range(pieces + 1):
        s = film_array(film, memory.state)
        terms = film_fluxes(film, s, *memory.state[-8:-6])
        edge, wall = (
            terms["edge"].sum() * 2.0 * math.pi / film.columns,
            gas_content(film, terms["wall"]),
        )
        contents.append(gas_content(film, s))
        flows.append(edge + wall)
        sizes.append(abs(edge) + abs(wall))
        status, _ = advance(system, memory, options, first + k, 1, build_record(1, 0))
        if status != OK:
            return None
    apart = contents[-1] - contents[0] - simpson(flows, dx=REVOLUTION / pieces)
    return abs(apart) / (abs(contents[0]) + simpson(sizes, dx=REVOLUTION / pieces))


def check(design, mass, number, seconds=SECONDS):
    """What a point does and which promises it breaks: (name of the outcome, list of sentences, gas
    lost or None). A run may take so many ``seconds`` of computing.
    """
    try:
        point, lost = solve(design, mass, number, SETTINGS, seconds), None
        status = point.trajectory.status
        broken = []
        if status == "ok":
            value, error = (
                (point.mle.value, point.mle.standard_error) if point.mle else (math.nan, math.nan)
            )
            if not (math.isfinite(value) and math.isfinite(error)) or point.regime is None:
                broken.append(f"no finite exponent: {value} ± {error}")
            lost = gas_lost(point)
            for finer in (16, 64):  # where bounces on the asperities are shorter than the pieces
                if lost is not None and not lost < CONSERVED:
                    lost = gas_lost(point, finer * PIECES)
            if lost is not None and not lost < CONSERVED:
                broken.append(f"gas is not conserved: {lost:.2g} of it")
        elif point.mle is not None or point.regime is not None:
            broken.append("an exponent of a failed run")
        half = solve(design, mass, number, HALF, seconds)
        found = compare(point, half)
        chaotic = next((p for p in (point, half) if p.regime and p.regime.name == "chaotic"), None)
        if found and chaotic and "touchdown" in (status, half.trajectory.status):
            # chaos that bounces on the wall touches it by chance, sooner or later: then it does in
            # a longer run as well
            longer = dataclasses.replace(
                chaotic.settings, revolutions=LONGER * SETTINGS.revolutions
            )
            found = (
                found
                if solve(design, mass, number, longer, seconds).trajectory.status != "touchdown"
                else []
            )
        broken += found
    except TooSlow:
        return "too slow", [f"more than {seconds:g} s"], None
    except Exception as problem:  # what is looked for
        return "exception", [f"{type(problem).__name__}: {problem}"], None
    return status, broken, lost


def compare(point, half):
    """How a point and the same with half the step differ beyond their errors, in sentences."""
    names = [p.trajectory.status if p.regime is None else p.regime.text for p in (point, half)]
    if half.trajectory.status == "too-many-steps":  # twice as many as allowed: nothing to compare
        return []
    if point.mle is None or half.mle is None:  # both fail, by whatever limit, or one alone
        return [] if point.mle is half.mle else [f"{names[0]}, with half the step {names[1]}"]
    apart = abs(point.mle.value - half.mle.value)
    settled = point.trajectory.settled and half.trajectory.settled
    allowed = (0.01 + 0.02 * abs(half.mle.value) if settled else 0.02) + 3.0 * math.hypot(
        point.mle.standard_error, half.mle.standard_error
    )
    told = [f"{p.mle.value:+.4f} ± {p.mle.standard_error:.4f}" for p in (point, half)]
    found = (
        [f"{names[0]}, with half the step {names[1]} ({told[0]}, {told[1]})"]
        if settled and names[0] != names[1]
        else []
    )
    return found or (
        [f"{names[0]}: MLE {told[0]}, with half the step {told[1]}"] if apart > allowed else []
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--designs", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=60.0)
    options = parser.parse_args()
    outcomes, broken, losses, began, slowest = (
        collections.Counter(),
        0,
        [],
        time.perf_counter(),
        0.0,
    )
    for seed in range(options.first, options.first + options.designs):
        start = time.perf_counter()
        if start - began > 60.0 * options.minutes:
            print(f"stopped before {seed}: {options.minutes:g} minutes are over")
            break
        outcome, sentences, lost = check(*draw(seed))
        slowest = max(slowest, time.perf_counter() - start)
        outcomes[outcome] += 1
        broken += bool(sentences)
        losses += [] if lost is None else [lost]
        for sentence in sentences:
            print(f"{seed}: {sentence}", flush=True)
    print(
        f"{sum(outcomes.values())} designs from {options.first}: "
        + ", ".join(f"{name} {count}" for name, count in outcomes.most_common())
        + f"; {broken} break a promise; gas lost: median {np.median(losses or [0.0]):.1e}, largest "
        f"{max(losses, default=0.0):.1e} in {len(losses)} runs; slowest {slowest:.1f} s, "
        f"{time.perf_counter() - began:.0f} s in all"
    )


if __name__ == "__main__":
    main()
