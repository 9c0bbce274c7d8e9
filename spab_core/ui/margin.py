"""The solved margin of the chosen point on a page: solved beside the page, without asking, then
kept.
"""

from __future__ import annotations

import functools
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable
from concurrent import futures
from typing import Any, ParamSpec, TypeVar

import joblib
import streamlit as st

from spab_core.common.errors import InputError
from spab_core.common.workers import StandingWorkers
from spab_core.design.model import Design
from spab_core.maps.solved_margin import SolvedMargin, solve_margin
from spab_core.plotting.margin import margin_figure
from spab_core.solver.cache import folder_for_others
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits
from spab_core.trajectory.compiling import compile_once, load
from spab_core.ui.jobs import solves_unasked
from spab_core.ui.plain_picture import plotly_wanted
from spab_core.ui.solving import LIVE, waits_for_compiler
from spab_core.ui.view import chosen_limits

P = ParamSpec("P")
T = TypeVar("T")
USUAL = 280  # points of a margin, for its progress
# what is looked at first: a short way, points as near each other as all are, rougher brackets
NEAR: dict[str, Any] = {
    "axes": ("speed", "mass"),
    "span": (0.8, 1.25),
    "points": 2,
    "precision": 0.02,
}
_KEPT = 64
_LEFT = 8.0  # seconds without a page that looks at it, after which it is given up
_EVERY = 0.5  # seconds between two looks
_WORKERS = min(4, joblib.cpu_count())
_LOOKED_AT = "_margin"  # the margin that the session looks at
_ASKED = "_margins_asked"  # those whose button it pressed
_Key = tuple[Design, float, float, Limits]  # of a point, and by which it is judged


class _Run(futures.Executor):
    """A margin being solved by the workers, as long as a page looks at it."""

    def __init__(self, key: _Key, pool: futures.Executor, keep: Callable[[SolvedMargin], None]):
        self.solved, self.problem, self._pool = 0, "", pool
        self.near: SolvedMargin | None = None  # of the nearest trouble, told before all is solved
        self.wanted = time.monotonic()
        self._pending: set[futures.Future[Any]] = set()
        self._thread = threading.Thread(target=self._solve, args=(key, keep), daemon=True)
        self._thread.start()

    @property
    def ended(self) -> bool:
        return not self._thread.is_alive()

    @property
    def _left(self) -> bool:
        return time.monotonic() - self.wanted > _LEFT

    def leave(self) -> None:
        """Give up unless a page of another session looks at it as well, as each does twice a
        second.
        """
        self.wanted = min(self.wanted, time.monotonic() + 2.0 * _EVERY - _LEFT)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> futures.Future[T]:
        """Have a worker make the call; raises ``CancelledError`` where nobody waits any more."""
        if self._left:
            raise futures.CancelledError
        call = self._pool.submit(fn, *args, **kwargs)
        self._pending.add(call)
        call.add_done_callback(self._done)
        return call

    def _done(self, call: futures.Future[Any]) -> None:
        self._pending.discard(call)
        if self._left:
            pending, self._pending = self._pending, set()
            for other in pending:
                other.cancel()

    def _progress(self, count: int) -> None:
        self.solved += count

    def _solve(self, key: _Key, keep: Callable[[SolvedMargin], None]) -> None:
        try:
            design, mass, number, limits = key
            self.submit(compile_once, LIVE, design).result()  # by one, before several would
            self.near = solve_margin(design, mass, number, LIVE, limits, pool=self, **NEAR)
            keep(
                solve_margin(design, mass, number, LIVE, limits, pool=self, progress=self._progress)
            )
        except futures.CancelledError:
            pass
        except InputError as error:
            self.problem = str(error)
        except Exception as error:  # told on the page
            traceback.print_exc()
            self.problem = f"the margin could not be solved: {type(error).__name__}: {error}"


@functools.cache
def _workers() -> StandingWorkers:
    """The processes that solve margins, of all users."""
    return StandingWorkers(_WORKERS, load, folder_for_others())


class _Store:
    """The last margins solved, of all sessions, and those being solved."""

    def __init__(self) -> None:
        self._found: OrderedDict[_Key, SolvedMargin] = OrderedDict()
        self._runs: dict[_Key, _Run] = {}
        self._lock = threading.Lock()

    def get(self, key: _Key) -> SolvedMargin | None:
        with self._lock:
            return self._found.get(key)

    def keep(self, key: _Key, found: SolvedMargin) -> None:
        with self._lock:
            self._found[key] = found
            while len(self._found) > _KEPT:
                self._found.popitem(last=False)

    def leave(self, key: _Key) -> None:
        """A page that looked at a margin goes on to another."""
        with self._lock:
            if run := self._runs.get(key):
                run.leave()

    def run(self, key: _Key) -> _Run:
        """Return the run of a margin, started if there is none, and that a page waits for it."""
        with self._lock:
            for other, old in list(self._runs.items()):
                if old.ended and other != key:
                    del self._runs[other]
            run = self._runs.get(key)
            if run is None or (run.ended and not run.problem):
                run = self._runs[key] = _Run(key, _workers(), lambda found: self.keep(key, found))
            run.wanted = time.monotonic()
            return run


@st.cache_resource(show_spinner=False)
def _store() -> _Store:
    return _Store()


def kept_margin(
    design: Design, rotor_mass: float, bearing_number: float, limits: Limits = DEFAULT_LIMITS
) -> SolvedMargin | None:
    """The solved margin of a point, if it was asked for before."""
    return _store().get((design, rotor_mass, bearing_number, limits))


def margin_words(found: SolvedMargin) -> str:
    """A solved margin as Markdown: a list."""
    return "\n".join(f"- :small[{text}]" for text in found.sentences())


def margin_panel(design: Design, rotor_mass: float, bearing_number: float) -> None:
    """The solved margin of a point by the chosen limits, in words and as a figure; solved beside
    the page if it is not yet.
    """
    key = design, rotor_mass, bearing_number, chosen_limits()
    before, st.session_state[_LOOKED_AT] = st.session_state.get(_LOOKED_AT), key
    if before not in (None, key):
        _store().leave(before)
    found = _store().get(key)
    if found is None:
        if waits_for_compiler(design, rotor_mass, bearing_number, words=False):
            return
        if not _wanted(key):
            return
        _store().run(key)
        st.fragment(_watch, run_every=_EVERY)(key)
        return
    st.markdown(f"**{found.headline()}**")
    if plotly_wanted():
        st.plotly_chart(
            margin_figure(found),
            key="margin_figure",
            width="stretch",
            config={"displayModeBar": False},
        )
    with st.expander("All limits, and what was not looked at"):
        st.markdown(margin_words(found))


def _wanted(key: _Key) -> bool:
    """Whether to solve this margin now; where they are solved when asked for, show the button."""
    asked: set[_Key] = st.session_state.setdefault(_ASKED, set())
    if solves_unasked() or key in asked:
        return True
    st.button("Solve the margin", key="solve_margin", on_click=asked.add, args=(key,))
    return False


def _watch(key: _Key) -> None:
    """What a fragment shows of a margin at work; the whole page runs again once it has ended."""
    if _store().get(key) is not None:
        st.rerun()
    run = _store().run(key)
    if run.problem:
        st.error(run.problem)
        return
    if run.near:
        st.markdown(f"**{run.near.headline()}**")
        st.caption(
            "So far, looked at from {:g} to {:g} times speed and mass, each alone; both together "
            "and the rest follow.".format(*NEAR["span"])
        )
    some = f" of some {USUAL}" if run.solved <= USUAL else ""
    st.progress(
        min(run.solved / USUAL, 0.97),
        f"Solving the margin: {run.solved}{some} points along speed and mass",
    )
