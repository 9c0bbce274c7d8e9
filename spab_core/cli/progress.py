"""What a long command shows while it runs, and says when it is stopped."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from joblib.externals.loky.process_executor import TerminatedWorkerError
from tqdm import tqdm

from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.maps.checkpoints import remove_checkpoint
from spab_core.trajectory.compiling import USUAL, is_compiled
from spab_core.trajectory.settings import Settings


def say_compiling(settings: Settings = USUAL, design: Design | None = None) -> None:
    """Say so where the kernels for such settings and design must be compiled first."""
    if not is_compiled(settings, design):
        text = "spab: compiling the kernels, once on this machine (about 20 s)"
        print(text, file=sys.stderr, flush=True)


@contextlib.contextmanager
def step_bar() -> Iterator[Callable[[int, int], None]]:
    """Show a bar for what takes more than half a second; yield a function of the steps done and
    the steps in all.
    """
    with tqdm(unit="step", leave=False, delay=0.5) as bar:

        def step(done: int, total: int) -> None:
            bar.total = total
            bar.update(done - bar.n)

        yield step


@contextlib.contextmanager
def resumable(bar: tqdm, parts: Path, what: str) -> Iterator[None]:
    """Delete the folder ``parts`` after the run under the bar; where the run is stopped or loses a
    worker process, say that the finished ``what`` are kept there.

    Raises
    ------
    SystemExit
        130, where the user stopped it.
    InputError
        Where a worker died, or a file could not be written.
    """
    kept = f"{what} are kept in {parts}: the same command goes on from them"
    try:
        yield
    except KeyboardInterrupt:
        bar.close()
        print(f"spab: stopped; {kept}", file=sys.stderr)
        raise SystemExit(130) from None
    except TerminatedWorkerError:
        bar.close()
        raise InputError(f"a worker process died (killed, or out of memory); {kept}") from None
    except OSError as error:  # a full disk, or a folder that can no longer be written
        bar.close()
        raise InputError(f"{error.filename or parts}: {error.strerror or error}; {kept}") from None
    remove_checkpoint(parts)
