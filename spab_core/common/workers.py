"""Worker processes of low priority that stay for the next call, as for work beside the pages:
threads would share the server's interpreter with the pages, and executors of processes keep a
server that is told to end until all their work is done.

A worker reads pickled calls from its standard input and writes pickled answers to its standard
output. It ends when that input does, and with its parent in the middle of a call.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from concurrent import futures
from contextlib import suppress
from typing import Any, BinaryIO, ParamSpec, TypeVar

from spab_core.common.processes import end_with_parent, give_way, module_command

MAX_WORKERS = 1024  # processes that a user may ask for

P = ParamSpec("P")
T = TypeVar("T")
IDLE = 600.0  # seconds without a call, after which a worker ends
_ENDING = 5.0  # seconds for a worker to end by itself
_NICE = 10
_Call = tuple["futures.Future[Any]", bytes]


class StandingWorkers(futures.Executor):
    """Worker processes, started as calls come; they end after ten idle minutes, and with this
    process, whatever they are doing.

    Parameters
    ----------
    count : int
        Processes at most.
    begin : callable
        Called by each without arguments before all else, to load what calls need; what it returns
        or raises is not looked at.
    environment : mapping of str
        Variables beside those of this process.
    idle : float
        Seconds without a call, after which a worker ends.
    """

    def __init__(
        self,
        count: int,
        begin: Callable[[], object],
        environment: Mapping[str, str] | None = None,
        idle: float = IDLE,
    ) -> None:
        self._calls: queue.SimpleQueue[_Call] = queue.SimpleQueue()
        self._begin, self._environment = pickle.dumps((begin, (), {})), dict(environment or {})
        self._idle = idle
        self._lock, self._count, self._here = threading.Lock(), count, 0

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> futures.Future[T]:
        """Have a worker make the call. The future fails with ``RuntimeError`` where no process can
        be started, or where it ends before it has answered.
        """
        future: futures.Future[T] = futures.Future()
        self._calls.put((future, pickle.dumps((fn, args, kwargs))))
        self.start()
        return future

    def start(self) -> None:
        """Start the workers that are not there."""
        with self._lock:
            new, self._here = self._count - self._here, self._count
        for _ in range(new):
            threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        """Pass calls on to one worker; start another if it has died."""
        worker: subprocess.Popen[bytes] | None = None
        while True:
            with suppress(RuntimeError):  # told by the call that needs it
                worker = self._alive(worker)
            try:
                future, call = self._calls.get(timeout=self._idle)
            except queue.Empty:
                break
            if not future.set_running_or_notify_cancel():
                continue
            try:
                worker = self._alive(worker)
                ok, answer = self._ask(worker, call)
            except Exception as error:
                ok, answer = False, error
            if ok:
                future.set_result(answer)
            else:
                future.set_exception(answer)
        if worker:
            _end(worker)
        with self._lock:
            self._here -= 1
        if not self._calls.empty():  # came just now
            self.start()

    def _alive(self, worker: subprocess.Popen[bytes] | None) -> subprocess.Popen[bytes]:
        if worker:
            if worker.poll() is None:
                return worker
            _end(worker)
        command, environment = module_command(__name__, str(os.getpid()))
        try:
            started = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment | self._environment,
            )
        except OSError as error:
            why = error.strerror or error
            raise RuntimeError(f"no worker process could be started: {why}") from error
        self._ask(started, self._begin)
        return started

    @staticmethod
    def _ask(worker: subprocess.Popen[bytes], call: bytes) -> tuple[bool, Any]:
        """Return whether the call succeeded, and its result or what it raised."""
        assert worker.stdin and worker.stdout
        try:
            worker.stdin.write(call)
            worker.stdin.flush()
            ok, answer = pickle.load(worker.stdout)
        except Exception as error:  # what follows in its output is not known then
            raise RuntimeError(f"a worker process ended with code {_end(worker)}") from error
        return ok, answer


def _end(worker: subprocess.Popen[bytes]) -> int:
    """End a worker that is idle or has died; return its exit code."""
    with worker:  # closes its pipes, however late it ends
        with suppress(subprocess.TimeoutExpired, OSError):
            worker.communicate(timeout=_ENDING)
        worker.kill()
    return worker.returncode


def _answer(call: tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]) -> bytes:
    function, args, kwargs = call
    try:
        return pickle.dumps((True, function(*args, **kwargs)))
    except Exception as error:
        with suppress(Exception):
            answer = pickle.dumps((False, error))
            pickle.loads(answer)  # some cannot be made again
            return answer
        return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))


def _main(parent: int, calls: BinaryIO, answers: BinaryIO) -> int:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C in a terminal is for the parent
    end_with_parent(parent)
    give_way(_NICE)
    while True:
        try:
            call = pickle.load(calls)
        except EOFError:
            return 0
        answers.write(_answer(call))
        answers.flush()


if __name__ == "__main__":
    pipe, sys.stdout = sys.stdout.buffer, sys.stderr  # what is printed is no answer
    raise SystemExit(_main(int(sys.argv[1]), sys.stdin.buffer, pipe))
