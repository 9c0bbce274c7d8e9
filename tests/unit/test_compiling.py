"""Who compiles the kernels, when, and what is said where that fails.

Nothing is compiled here: the kernels are there.
"""

import importlib
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import filelock
import numba
import pytest

from spab_core.common.processes import module_command
from spab_core.solver import cache as _kernel_cache
from spab_core.solver.stepping import advance
from spab_core.trajectory import compiling
from tests.conftest import ROOT


@pytest.fixture
def empty(monkeypatch, tmp_path):
    """A process that has not decided yet, and believes that its kernels are not there; it keeps
    them in ``tmp_path``.
    """
    place = tmp_path / "kernels"
    place.mkdir()
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(place))
    for name in ("is_compiled", "is_linear_compiled"):
        monkeypatch.setattr(compiling, name, lambda *of, **by: False)
    monkeypatch.setattr(compiling, "_background", None)
    monkeypatch.setattr(compiling, "_decided", False)
    return place


def until_ended():
    assert compiling._background.ended.wait(60)


@pytest.mark.slow
def test_kernels_are_kept_for_one_processor(monkeypatch):
    """Those that another processor has left in a shared folder do not count."""
    program = (
        "from spab_core.trajectory.compiling import compile_once, is_compiled, is_linear_compiled\n"
        "print(is_compiled(), is_linear_compiled())"
    )

    def told(**changes):
        return subprocess.run(
            [sys.executable, "-c", program],
            cwd=ROOT,
            env=os.environ | changes,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()

    compiling.compile_once()
    assert told() == "True True"
    assert told(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="") == "False False"


def test_nothing_is_started_where_the_kernels_are_there(monkeypatch):
    compiling.compile_once()
    monkeypatch.setattr(compiling, "_decided", False)
    monkeypatch.setattr(compiling, "_Background", lambda: pytest.fail("started"))
    compiling.start()
    assert compiling.seconds_so_far() is None and compiling.failure() == ""


def test_a_private_temporary_folder_can_be_told_to_another_process(monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setattr(_kernel_cache, "_usable", lambda folder: False)
    _kernel_cache.choose()
    chosen = Path(numba.config.CACHE_DIR)
    monkeypatch.undo()
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(chosen.parent))
    _kernel_cache.choose()
    assert Path(numba.config.CACHE_DIR) == chosen
    chosen.rmdir()
    chosen.parent.rmdir()


def test_one_process_is_started_in_the_same_folder_and_its_end_is_seen(empty, monkeypatch):
    started, popen = [], subprocess.Popen

    def harmless(command, **options):
        started.append((command, options["env"]))
        return popen([sys.executable, "-c", "import time; time.sleep(1)"], stderr=options["stderr"])

    monkeypatch.setattr(compiling.subprocess, "Popen", harmless)
    compiling.start()
    compiling.start()
    ((command, env),) = started
    assert command[1:4] == ["-P", "-m", "spab_core.trajectory.compiling"] and command[4] == str(
        os.getpid()
    )
    assert env["NUMBA_CACHE_DIR"] == str(empty.parent)
    assert 0.0 <= compiling.seconds_so_far() < 60.0 and compiling.failure() == ""
    until_ended()
    assert compiling.seconds_so_far() is None
    assert compiling.failure() == f"no kernels were kept in {empty}"  # it ended well and left none


@pytest.mark.parametrize(
    "program, words",
    [
        (
            "import sys; sys.exit('the folder is gone')",
            "its process ended with code 1: the folder is gone",
        ),
        ("import os; os._exit(3)", "its process ended with code 3"),
    ],
)
def test_a_process_that_fails_is_told(empty, monkeypatch, program, words):
    popen = subprocess.Popen
    monkeypatch.setattr(
        compiling.subprocess,
        "Popen",
        lambda command, **options: popen([sys.executable, "-c", program], stderr=options["stderr"]),
    )
    compiling.start()
    until_ended()
    assert compiling.failure() == words and compiling.seconds_so_far() is None


def test_a_process_that_cannot_be_started_is_told(empty, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(empty / "none"))
    compiling.start()
    assert compiling.failure() == "no process could be started: No such file or directory"


@pytest.mark.slow
def test_the_process_ends_with_the_server(tmp_path):
    """Killed, a server leaves no compiler behind."""
    program = (
        "import subprocess, sys, time\n"
        "from spab_core.trajectory import compiling\n"
        "compiling.start()\n"
        "print('started', flush=True)\n"
        "time.sleep(60)"
    )
    server = subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        text=True,
    )
    with server:
        server.stdout.readline()
        lock = filelock.FileLock(next(tmp_path.glob("spab-kernels-*")) / ".compiling.lock")
        end = time.monotonic() + 60
        while not lock_is_held(lock):
            assert time.monotonic() < end
            time.sleep(0.1)
        server.kill()
        server.wait()
        while lock_is_held(lock):
            assert time.monotonic() < end
            time.sleep(0.1)


def lock_is_held(lock):
    try:
        with lock.acquire(timeout=0):
            return False
    except filelock.Timeout:
        return True


def test_a_second_process_waits_for_the_first(empty, monkeypatch):
    """Solved by nobody: while it waits, the other one has left the kernels."""
    there = threading.Event()
    for name in ("is_compiled", "is_linear_compiled"):
        monkeypatch.setattr(compiling, name, lambda *of, **by: there.is_set())
    monkeypatch.setattr(compiling, "solve_point", lambda *a: pytest.fail("compiled twice"))
    monkeypatch.setattr(compiling, "derive", lambda *a: pytest.fail("compiled twice"))
    waiting = threading.Thread(target=compiling.compile_once)
    with filelock.FileLock(empty / ".compiling.lock", thread_local=False):
        waiting.start()
        waiting.join(0.5)
        assert waiting.is_alive()
        there.set()
    waiting.join(10)
    assert not waiting.is_alive()


def test_the_kernels_of_stored_gas_follow_the_others(empty, monkeypatch):
    done = []
    monkeypatch.setattr(compiling, "derive", lambda design, *of: done.append(design))
    monkeypatch.setattr(compiling, "solve_point", lambda design, *of: done.append(design))
    monkeypatch.setattr(compiling, "end_with_parent", lambda parent: None)
    assert compiling._main(1) == 0  # tests compile nothing ahead
    assert [design.bearing.stores_gas for design in done] == [False, False]
    done.clear()
    monkeypatch.delenv(compiling.AHEAD)
    assert compiling._main(1) == 0
    assert [design.bearing.stores_gas for design in done] == [False, False, True, True]
    assert compiling.usual_seconds(done[0]) < compiling.usual_seconds(done[-1])


def test_a_folder_that_cannot_be_locked_does_not_keep_the_kernels_from_being_compiled(
    empty, monkeypatch
):
    done = []
    (empty / ".compiling.lock").mkdir()
    monkeypatch.setattr(compiling, "solve_point", lambda *a: done.append("all"))
    monkeypatch.setattr(compiling, "derive", lambda *a: done.append("linear theory"))
    compiling.compile_once()
    assert done == ["linear theory", "all"]


def test_a_change_of_numba_means_that_nothing_is_announced(monkeypatch):
    monkeypatch.setattr(type(advance), "signatures", property(lambda self: []))
    monkeypatch.setattr(advance, "_cache", None)
    assert _kernel_cache.is_kept(advance)


def test_other_processes_find_this_very_package():
    """Also where it is not installed, in a clone that is not the working folder."""
    command, environment = module_command("spab_core.trajectory.compiling", "1")
    assert command[1:] == ["-P", "-m", "spab_core.trajectory.compiling", "1"]
    assert Path(environment["PYTHONPATH"].split(os.pathsep)[0]) == ROOT


def test_a_kernel_is_kept_for_the_types_it_was_called_with(tmp_path, monkeypatch):
    """As rows of another width, or another method's memory, are other types."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "one_kernel.py").write_text(
        "from numba import njit\n\n\n@njit(cache=True)\ndef twice(x):\n    return 2 * x\n"
    )
    twice = importlib.import_module("one_kernel").twice
    assert not _kernel_cache.is_kept(twice, 1.0)
    twice(1.0)
    assert _kernel_cache.is_kept(twice, 1.0) and not _kernel_cache.is_kept(twice, 1)
