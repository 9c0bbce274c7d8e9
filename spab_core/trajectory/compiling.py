"""Compile the kernels before they are wanted, in a process of its own; one process of a user's
compiles at a time.

numba takes some twenty seconds for them and holds the interpreter for half a second at a time
meanwhile: no work for a server. Its cache on disk (:mod:`spab_core.solver.cache`) hands the kernels
from process to process; to load them takes under a second."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import filelock
import numba
import numpy as np

from spab_core.common.processes import end_with_parent, module_command
from spab_core.design.model import Design, reference_design
from spab_core.linear_theory.equilibrium import running_system
from spab_core.linear_theory.summary import derive
from spab_core.solver.cache import folder_for_others, is_kept
from spab_core.solver.slope import build_work, fill_jacobian
from spab_core.solver.stepping import Options, advance, build_memory, build_record
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings

USUAL = Settings()
SECONDS = 20  # of compiling with nothing else at work (docs/dashboard.md)
STORING_SECONDS = 50  # until those for a wall that stores gas have followed: half a minute more
AHEAD = "SPAB_COMPILE_AHEAD"  # "usual": only those for a wall that stores no gas
_LOCK = ".compiling.lock"
_PATIENCE = 600.0  # seconds; a process that compiles for longer has hung


def _like(design: Design | None) -> Design:
    """Return a design with the same kernels: they differ where the wall stores gas and where
    the journal moves along the axis.
    """
    storing = design is not None and design.bearing.stores_gas
    moving = design is not None and design.rotor.axial_motion
    return reference_design().replace(
        bearing__porosity=0.15 if storing else 0.0, rotor__axial_motion=moving
    )


def usual_seconds(design: Design | None = None) -> int:
    """Seconds from :func:`start` until the kernels for a wall as the design's are there."""
    return STORING_SECONDS if design is not None and design.bearing.stores_gas else SECONDS


def is_compiled(settings: Settings = USUAL, design: Design | None = None) -> bool:
    """Whether this process can solve operating points so without compiling: kernels of the method
    and of the mesh's width, for a wall as the design's (left out: one that stores no gas), are
    loaded, or kept for this processor.

    Raises :class:`DesignError` for a method that does not solve the design's motion.
    """
    if design is not None:
        settings.check_design(design)
    system = running_system(_like(design), 1.0, 1.0, settings.mesh)
    memory = build_memory(system.film, settings.method)
    return is_kept(advance, system, memory, Options(), 0, 1, build_record(1, 0))


def is_linear_compiled(design: Design | None = None) -> bool:
    """The same for what linear theory needs on the usual mesh, which is compiled first."""
    system = running_system(_like(design), 1.0, 1.0)
    state, work = np.zeros(system.size), build_work(system.film)
    return is_kept(
        fill_jacobian, system, state, system.unknowns, work, state, np.empty((1, system.size))
    )


@contextlib.contextmanager
def _turn() -> Iterator[None]:
    """Wait for another process that compiles into the same folder; without a word go on where
    nothing can be locked.
    """
    lock = filelock.FileLock(Path(numba.config.CACHE_DIR) / _LOCK, timeout=_PATIENCE)
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, NotImplementedError, filelock.Timeout):
            stack.enter_context(lock)
        yield


def compile_once(settings: Settings = USUAL, design: Design | None = None) -> None:
    """Have the kernels for such settings and a wall as the design's (left out: one that stores no
    gas): wait for a process that compiles them, or compile them here if none has.
    """
    if is_compiled(settings, design) and is_linear_compiled(design):
        return
    with _turn():
        if not is_linear_compiled(design):
            # first: pages with linear theory alone need not wait for the rest
            derive(_like(design), 4.0, 3.0)
        if not is_compiled(settings, design):
            _solve_shortly(settings, design)


def load() -> None:
    """Load the usual kernels into this process, where need be after :func:`compile_once`."""
    compile_once()
    derive(_like(None), 4.0, 3.0)
    _solve_shortly(USUAL)


def _solve_shortly(settings: Settings, design: Design | None = None) -> None:
    short = dataclasses.replace(settings, transient=30, revolutions=20)
    solve_point(_like(design), 4.0, 3.0, short)


def _ahead() -> tuple[Design, ...]:
    """Designs whose kernels are compiled before they are asked for, the usual first."""
    usual = reference_design()
    if os.environ.get(AHEAD) == "usual":
        return (usual,)
    return usual, usual.replace(bearing__porosity=0.15)


def _all_there() -> bool:
    return all(
        is_compiled(design=design) and is_linear_compiled(design=design) for design in _ahead()
    )


class _Background:
    """A process that compiles, and what became of it."""

    def __init__(self) -> None:
        self.began, self.failure, self.ended = time.monotonic(), "", threading.Event()
        command, environment = module_command("spab_core.trajectory.compiling", str(os.getpid()))
        try:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                env=environment | folder_for_others(),
            )
        except OSError as error:
            self._end(f"no process could be started: {error.strerror or error}")
        else:
            threading.Thread(target=self._wait, daemon=True).start()

    def _wait(self) -> None:
        last = self.process.communicate()[1].decode(errors="replace").strip().rpartition("\n")[2]
        if code := self.process.returncode:
            self._end(f"its process ended with code {code}{': ' if last else ''}{last[:200]}")
        else:
            self._end("" if _all_there() else f"no kernels were kept in {numba.config.CACHE_DIR}")

    def _end(self, failure: str) -> None:
        self.failure = failure
        self.ended.set()


_background: _Background | None = None
_decided, _mutex = False, threading.Lock()


def start() -> None:
    """Have another process compile the kernels unless they are there, those for a wall that stores
    gas after the others; returns at once, and does nothing when called again.
    """
    global _background, _decided
    with _mutex:
        if not _decided:
            _decided = True
            if not _all_there():
                _background = _Background()


def seconds_so_far() -> float | None:
    """Since :func:`start`, as long as its process is at work; else None."""
    found = _background
    return None if found is None or found.ended.is_set() else time.monotonic() - found.began


def failure() -> str:
    """Why the process of :func:`start` has left no kernels, as a clause; "" where it has, or is at
    work, or was not needed.
    """
    found = _background
    return found.failure if found is not None and found.ended.is_set() else ""


def _main(parent: int) -> int:
    end_with_parent(parent)
    for design in _ahead():
        compile_once(design=design)
    return 0


if __name__ == "__main__":
    raise SystemExit(_main(int(sys.argv[1])))
