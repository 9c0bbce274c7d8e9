"""Standing workers: calls answered in other processes, of lower priority; what becomes of a worker
that dies, idles or is left behind."""

import os
import subprocess
import sys
import time

import psutil
import pytest

from spab_core.common import workers as standing
from spab_core.common.processes import module_command
from spab_core.common.workers import StandingWorkers

PATIENCE = 60.0


def workers(count=1, **more):
    return StandingWorkers(count, os.getpid, **more)


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_calls_are_answered_by_other_processes():
    pool = workers(2)
    found = [pool.submit(divmod, number, 7) for number in range(20)]
    assert [run.result(PATIENCE) for run in found] == [divmod(number, 7) for number in range(20)]
    there = {pool.submit(os.getpid).result(PATIENCE) for _ in range(20)}
    assert os.getpid() not in there and len(there) <= 2


def test_they_give_way_to_this_process():
    there = psutil.Process(workers().submit(os.getpid).result(PATIENCE))
    assert there.nice() > psutil.Process().nice()


def test_what_is_printed_is_no_answer(capfd):
    assert workers().submit(print, "printed").result(PATIENCE) is None
    assert "printed" in capfd.readouterr().err


def test_a_variable_is_theirs_alone():
    pool = workers(environment={"SPAB_TRIAL": "theirs"})
    assert pool.submit(os.getenv, "SPAB_TRIAL").result(PATIENCE) == "theirs"
    assert "SPAB_TRIAL" not in os.environ


def test_an_exception_comes_back():
    pool = workers()
    with pytest.raises(ZeroDivisionError):
        pool.submit(divmod, 1, 0).result(PATIENCE)
    with pytest.raises(TypeError, match="cannot pickle"):
        pool.submit(os.scandir, ".").result(PATIENCE)
    assert pool.submit(abs, -1).result(PATIENCE) == 1


def test_a_worker_that_dies_is_told_and_replaced():
    pool = workers()
    first = pool.submit(os.getpid).result(PATIENCE)
    with pytest.raises(RuntimeError, match="a worker process ended with code 3"):
        pool.submit(os._exit, 3).result(PATIENCE)
    second = pool.submit(os.getpid).result(PATIENCE)
    assert second != first
    psutil.Process(second).kill()  # between two calls
    os.waitid(os.P_PID, second, os.WEXITED | os.WNOWAIT)
    assert pool.submit(abs, -1).result(PATIENCE) == 1


def test_a_call_that_waits_can_be_taken_back():
    pool = workers()
    slow = pool.submit(time.sleep, 0.5)
    waits = [pool.submit(time.sleep, PATIENCE) for _ in range(3)]
    assert all(call.cancel() for call in waits)
    assert slow.result(PATIENCE) is None
    assert pool.submit(abs, -1).result(PATIENCE) == 1


def test_an_idle_worker_ends_and_another_takes_its_place():
    pool = workers(idle=0.05)
    first = pool.submit(os.getpid).result(PATIENCE)
    until(lambda: not psutil.pid_exists(first))
    assert pool.submit(abs, -1).result(PATIENCE) == 1


def test_one_that_is_slow_to_end_leaves_nothing_open(monkeypatch):
    """Such as one of low priority beside others at work."""
    started, popen = [], subprocess.Popen

    def start(*args, **more):
        started.append(popen(*args, **more))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", start)
    monkeypatch.setattr(standing, "_ENDING", 0.0)
    assert workers(idle=0.05).submit(abs, -1).result(PATIENCE) == 1
    until(lambda: started[0].returncode is not None)
    until(lambda: started[0].stdin.closed and started[0].stdout.closed)


def test_without_processes_the_reason_is_told(monkeypatch):
    def refuse(*args, **kwargs):
        raise OSError(11, "Resource temporarily unavailable")

    pool = workers()
    monkeypatch.setattr(subprocess, "Popen", refuse)
    with pytest.raises(RuntimeError, match="no worker process could be started: Resource tempor"):
        pool.submit(abs, -1).result(PATIENCE)
    monkeypatch.undo()
    assert pool.submit(abs, -1).result(PATIENCE) == 1


BUSY = """
import os, time
from spab_core.common.workers import StandingWorkers
pool = StandingWorkers(1, os.getpid)
print(pool.submit(os.getpid).result(60.0), flush=True)
[pool.submit(time.sleep, 600.0) for _ in range(3)]
{end}
"""


@pytest.mark.parametrize("killed", [True, False])
def test_a_worker_ends_with_its_parent_in_the_middle_of_a_call(killed):
    """Killed, or at its end: an executor of the library would wait for all that it was given."""
    environment = module_command("json")[1]
    end = "time.sleep(600.0)" if killed else ""
    command = [sys.executable, "-P", "-c", BUSY.format(end=end)]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as parent:
        worker = int(parent.stdout.readline())
        if killed:
            parent.kill()
        parent.wait(PATIENCE)
    until(lambda: not psutil.pid_exists(worker))
