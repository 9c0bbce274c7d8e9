"""Worker processes of this machine, or of a Dask cluster."""

from __future__ import annotations

import contextlib
import gc
import os
from collections.abc import Callable, Iterator
from concurrent import futures
from typing import Any, ParamSpec, TypeVar

import joblib
from joblib.externals.loky import ProcessPoolExecutor

from spab_core.common.errors import InputError
from spab_core.common.processes import end_with_parent
from spab_core.design.model import Design
from spab_core.trajectory.compiling import compile_once
from spab_core.trajectory.settings import Settings

P = ParamSpec("P")
T = TypeVar("T")
CLUSTER_SECONDS = 20  # for a scheduler to answer and for its first worker


@contextlib.contextmanager
def cluster_or_processes(
    workers: int, settings: Settings, design: Design, cluster: str | None = None
) -> Iterator[joblib.Parallel]:
    """Yield worker processes of joblib or of a Dask cluster, with the solver compiled for
    ``settings`` and ``design``.
    """
    options = {"return_as": "generator_unordered", "pre_dispatch": "2*n_jobs"}
    if cluster is None:
        compile_once(settings, design)  # before several would at once
        yield joblib.Parallel(
            n_jobs=workers, initializer=end_with_parent, initargs=(os.getpid(),), **options
        )
        return
    try:
        import distributed
    except ImportError:
        raise InputError(
            "--dask needs the packages dask and distributed: pip install 'spab-core[dask]'"
        ) from None
    with contextlib.ExitStack() as stack:
        failure: str | None = None
        try:
            client: Any = distributed.Client
            client = stack.enter_context(client(cluster, timeout=CLUSTER_SECONDS))
            client.wait_for_workers(1, timeout=CLUSTER_SECONDS)
        except (OSError, ValueError, TypeError, TimeoutError) as error:
            failure = " ".join(str(error).split())[:200]
        if failure is not None:
            # a client that never connected closes itself when it is collected: now, while no other
            # thread of Dask starts, for which the two would wait for each other
            gc.collect()
            raise InputError(
                f"--dask = {cluster[:200]!r}: no scheduler with workers answers there within "
                f"{CLUSTER_SECONDS} s ({failure})"
            )
        stack.enter_context(joblib.parallel_config(backend="dask", client=client))
        yield joblib.Parallel(n_jobs=-1, **options)


class _Here(futures.Executor):
    """Executor that runs each call immediately, in this process."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> futures.Future[T]:
        future: futures.Future[T] = futures.Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextlib.contextmanager
def executor(workers: int, settings: Settings, design: Design) -> Iterator[futures.Executor]:
    """Start worker processes with the solver compiled for ``settings`` and ``design``; kill them if
    the block raises. With 1 worker solve in this process.
    """
    if workers == 1:
        yield _Here()
        return
    compile_once(settings, design)
    processes = ProcessPoolExecutor(
        max_workers=workers, initializer=end_with_parent, initargs=(os.getpid(),)
    )
    done = False
    try:
        yield processes
        done = True
    finally:
        processes.shutdown(wait=done, kill_workers=not done)
