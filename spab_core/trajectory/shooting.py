"""The periodic orbit that a run is near, and its leading multiplier: periods integrated beside the
run, on equal steps.

Products with the monodromy matrix feed Arnoldi's process
(:func:`spab_core.trajectory.periodic_orbit.leading_multiplier`); Newton's method takes the state to
the orbit itself, so that the matrix is the orbit's own. Steps are shortened until the rate is at
rest.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from spab_core.common.threads import one_thread
from spab_core.solver.film import MOTION_STATES
from spab_core.solver.rotor import ROTOR_STATES
from spab_core.solver.stepping import (
    OK,
    REVOLUTION,
    STEPS,
    Memory,
    Options,
    Record,
    advance,
    build_record,
)
from spab_core.solver.system import System
from spab_core.trajectory.periodic_orbit import (
    REACH,
    Multiplier,
    Settled,
    leading_multiplier,
    positions,
    shortest_period,
)

# of a revolution: at least, at most
FEWEST_STEPS, FINEST_STEPS = 16, 1536
# of these, for each unit of the rate: what dies fast may swing fast, and long steps would hide it
STEPS_PER_RATE, MOST_PER_RATE = 96, 384
# largest error of a rate, and relative one, that ask for no shorter steps
RATE_ERROR, RATE_SHARE = 0.001, 0.002
# share of a rate's change by steps two thirds as long that is told as its error: what steps of
# fourth order leave, 1/(1.5^4 - 1)
CHANGE_SHARE = 0.25


class Found(NamedTuple):
    """A periodic orbit near a run.

    Attributes
    ----------
    settled : Settled
    direction : ndarray, (n,)
        In which the orbit is approached or left.
    far : float
        Distance of the run from the orbit, over C.
    """

    settled: Settled
    direction: np.ndarray
    far: float


class Shooting:
    """Periods beside a run, from its state; :meth:`find` leaves the run as it is.

    Parameters
    ----------
    system : System
    memory : Memory
        Of the run: its state is near the orbit.
    first : int
        Revolutions done since the start of the run.
    period : int
        Of the orbit, in revolutions; may prove a multiple of the shortest one.
    options : Options
        Those of the run.
    implicit : bool
        Whether steps may have any length: else the method's own control lays them.
    moving : bool
        Whether the journal moves along the axis.
    """

    def __init__(
        self,
        system: System,
        memory: Memory,
        first: int,
        period: int,
        options: Options,
        implicit: bool,
        moving: bool = False,
    ) -> None:
        self.system, self.memory, self.first, self.period = system, memory, first, period
        self.options, self.implicit, self.moving = options, implicit, moving
        self.start = memory.state.copy()

    @one_thread
    def find(self, generic: np.ndarray, least_steps: float) -> Found | None:
        """Find the orbit and its rate; None where there is no multiplier.

        Parameters
        ----------
        generic : ndarray, (n,)
            Tangent to start from, at first.
        least_steps : float
            Of a revolution, that the run's own steps ask for.
        """
        tangent, control = self.memory.tangent.copy(), self.memory.control.copy()
        found = self._find(generic, least_steps)
        control[STEPS] = self.memory.control[STEPS]
        self.memory.state[:], self.memory.tangent[:] = self.start, tangent
        self.memory.control[:] = control
        return found

    def _find(self, generic: np.ndarray, least_steps: float) -> Found | None:
        found, before = None, math.inf
        steps = max(FEWEST_STEPS, math.ceil(least_steps))
        finest = max(FINEST_STEPS, 2 * steps)
        while steps <= finest:
            multiplier = leading_multiplier(partial(self._product, steps), generic)
            enough = 0
            if multiplier:
                history = tuple(size / self.period for size in multiplier.history)
                rate = history[-1]
                error = CHANGE_SHARE * abs(rate - before) + multiplier.error / self.period
                far = self._go_to_limit(steps, multiplier)
                settled = Settled(self.period, rate, error, history)
                found, before = Found(settled, multiplier.direction, far), rate
                generic = multiplier.fresh
                if error <= RATE_ERROR + RATE_SHARE * abs(rate) or (rate < 0.0 and far > REACH):
                    break
                enough = min(int(-STEPS_PER_RATE * rate), MOST_PER_RATE)
            elif self.system.film.depth:
                break  # slow flows in the wall lie too close together, on any steps
            steps = max(3 * steps // 2, enough)
        return found

    def _go_to_limit(self, steps: int, multiplier: Multiplier) -> float:
        """Take the state to the orbit by a step of Newton's method, where that is near; return how
        far over C it lies from the run.
        """
        state, before = self.memory.state, self.memory.state.copy()
        orbit = self._revolve(steps)
        if orbit is None:
            return math.inf
        limit = before + multiplier.to_limit(state - before)
        moved = (limit - self.start)[-ROTOR_STATES - MOTION_STATES * self.moving :]
        far = float(np.abs(positions(moved[None])).max())
        if far <= REACH:
            state[:], self.period = limit, shortest_period(orbit.section)
        return far

    def _product(self, steps: int, vector: np.ndarray) -> np.ndarray | None:
        """Multiply by the monodromy matrix; the orbit goes on from product to product."""
        self.memory.tangent[:] = vector
        orbit = self._revolve(steps, tangent=True)
        return self.memory.tangent * math.exp(orbit.growth.sum()) if orbit else None

    def _revolve(self, steps: int, *, tangent: bool = False) -> Record | None:
        """Do a period; None where it fails."""
        options = self.options._replace(tangent=tangent)
        record = build_record(self.period, 0, moving=self.moving)
        if self.implicit:
            options = options._replace(max_step=REVOLUTION / steps, fixed=True)
        status, _ = advance(self.system, self.memory, options, self.first, self.period, record)
        return record if status == OK else None
