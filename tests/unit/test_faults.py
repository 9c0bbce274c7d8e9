"""A kill, a full disk, a clock set back: nothing finished is lost, nothing half-written read, and
words say how to go on.
"""

import contextlib
import errno
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

from benchmarks.faults import run
from spab_core.cli.main import main
from spab_core.common.files import write_atomically
from spab_core.jobs import store as jobs
from spab_core.jobs import worker
from spab_core.jobs.kinds import KINDS
from spab_core.maps.checkpoints import locked
from spab_core.maps.stability_map import MapError, load_map
from spab_core.shipped.manifest import ARTIFACTS
from spab_core.solver import cache as _kernel_cache
from tests.conftest import ROOT

OPTIONS = ["--mesh", "2x16", "--transient", "30", "--revolutions", "20"]
MAP = ["map", "--bearing-number", "2:4.5:6", "--rotor-mass", "3:18:10", *OPTIONS]
LINE = {
    "vary": "rotor-mass",
    "at": 3.0,
    "range": "4:6:6",
    "sweeps": ["cold"],
    "settings": {"mesh": "2x16", "transient": 30, "revolutions": 20},
}


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Jobs of this test alone."""
    folder = tmp_path / "jobs"
    monkeypatch.setenv("SPAB_JOBS", str(folder))
    yield folder
    for name in list(jobs._workers):
        jobs._workers.pop(name).wait(60)


def ended(name, seconds=90):
    end = time.monotonic() + seconds
    while (job := jobs.find(name)).active:
        assert time.monotonic() < end, job
        time.sleep(0.05)
    return job


@pytest.mark.slow
def test_killed_at_random_moments_they_end_the_same(tmp_path):
    """Two of benchmarks/faults.py; a killed map is in test_cli.py, a killed worker in test_jobs.py,
    the rest by --kills 50.
    """
    works = run(2, 2, tmp_path, ["refine", "train"], tell=lambda words: None)
    assert [work.kills for work in works.values()] == [1, 1] and all(
        work.ends >= 2 for work in works.values()
    )


def full(monkeypatch, allowed):
    """A disk that is full after ``allowed`` files of this process."""
    real, count = os.fsync, [0]

    def fsync(handle):
        count[0] += 1
        if count[0] > allowed:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    return count


@pytest.mark.parametrize(
    "allowed", [0, 1, 2, 3]
)  # the plan, two chunks of 25 and one of 10; the map is the fifth
def test_a_disk_that_fills_up_is_a_sentence_and_what_is_finished_is_kept(
    allowed, tmp_path, monkeypatch, capsys
):
    out = tmp_path / "m.npz"
    with monkeypatch.context() as patch:
        full(patch, allowed)
        assert main([*MAP, "--out", str(out)]) == 2
    told = capsys.readouterr().err.splitlines()[-1]
    assert "No space left on device" in told and "Traceback" not in told and not out.exists()
    assert (
        allowed == 0 or f"finished chunks are kept in {out}.parts: the same command goes on" in told
    )
    kept = sorted(p.name for p in Path(f"{out}.parts").glob("*.npz"))
    assert len(kept) == max(allowed - 1, 0) and not list(tmp_path.rglob("*.tmp"))
    assert main([*MAP, "--out", str(out)]) == 0
    assert main([*MAP, "--out", str(tmp_path / "whole.npz")]) == 0
    a, b = load_map(out), load_map(tmp_path / "whole.npz")
    assert a.mle.tobytes() == b.mle.tobytes() and (a.regime == b.regime).all()


@pytest.mark.slow
def test_a_file_too_large_for_the_disk_leaves_the_old_one(tmp_path):
    """A limit of the system's own, in a process of its own."""
    write_atomically(tmp_path / "x", b"old")
    program = (
        "import resource, sys; from spab_core.common.files import write_atomically\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "try: write_atomically(sys.argv[1], bytes(5000))\n"
        "except OSError as error: print(error.strerror)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "x")],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.stdout == "File too large\n", done.stderr
    assert (tmp_path / "x").read_bytes() == b"old" and [p.name for p in tmp_path.iterdir()] == ["x"]
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


def work_here(name):
    """What the worker process does, in this one, where a fault can be planted."""
    return worker.work(jobs.jobs_folder() / name)


@pytest.fixture
def queued(root, monkeypatch):
    """A job whose worker has not come."""
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", "/bin/false")
        job = jobs.submit("bifurcation", LINE)
    jobs._workers.pop(job.id).wait(10)
    yield job.id


def start_again(name):
    folder = jobs.jobs_folder() / name
    data = jobs.read_state(folder)
    jobs.write_state(
        folder,
        data | {"state": "queued", "pid": None, "queued": time.time(), "done": 0, "message": ""},
    )


def test_a_job_on_a_full_disk_says_so_and_goes_on(queued, monkeypatch, capfd):
    monkeypatch.setattr(os, "nice", lambda n: 0)
    for allowed in (2, 3, 5):
        with monkeypatch.context() as patch:
            full(patch, allowed)
            assert work_here(queued) == 1
        job = jobs.find(queued)
        assert job.state == "failed" and "start it again" in job.message
        assert "No space left on device" in capfd.readouterr().err
        start_again(queued)
    assert work_here(queued) == 0
    done = jobs.find(queued)
    assert done.state == "done" and done.result.is_file() and not (done.folder / "parts").exists()


def test_a_kill_between_result_and_end_loses_nothing(queued, monkeypatch):
    monkeypatch.setattr(os, "nice", lambda n: 0)

    def killed(*_):
        raise KeyboardInterrupt  # as near to a kill as this process survives: nothing catches it

    with monkeypatch.context() as patch:
        patch.setattr(worker._Report, "end", killed)
        with pytest.raises(KeyboardInterrupt):
            work_here(queued)
    job = jobs.find(queued)
    assert job.state == "failed" and job.message == f"{jobs.STOPPED}; start it again to go on"
    written = job.result.stat().st_mtime_ns
    start_again(queued)
    monkeypatch.setattr(
        "spab_core.jobs.kinds.compute_bifurcation", None
    )  # it must not be asked again
    assert work_here(queued) == 0
    assert jobs.find(queued).state == "done" and job.result.stat().st_mtime_ns == written


@pytest.mark.slow
def test_what_a_killed_writer_left_is_removed_by_who_goes_on(tmp_path):
    out = tmp_path / "m.npz"
    program = (
        "import os, signal, sys; from spab_core.cli.main import main\n"
        "real, count = os.fsync, 0\n"
        "def fsync(handle):\n"
        "    global count; count += 1\n"
        # the plan, a chunk; the second one is cut off
        "    if count == 3: os.kill(os.getpid(), signal.SIGKILL)\n"
        "    real(handle)\n"
        "os.fsync = fsync; main(sys.argv[1:])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, *MAP, "--out", str(out)],
        capture_output=True,
        timeout=120,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    parts = Path(f"{out}.parts")
    left = {p.name for p in parts.iterdir()}
    assert done.returncode == -signal.SIGKILL and {"plan.json", "chunk-000000.npz"} < left
    assert [name[:11] for name in left if name.endswith(".tmp")] == [".chunk-0000"]
    with (
        jobs.FileLock(parts / "lock"),
        pytest.raises(MapError, match="another run is at work"),
        locked(parts),
    ):
        pass
    assert {p.name for p in parts.iterdir()} == left  # they may be of the other run
    with locked(parts):
        assert {p.name for p in parts.iterdir()} == {n for n in left if not n.endswith(".tmp")}


def test_a_job_removes_what_its_last_worker_left(queued, monkeypatch):
    monkeypatch.setattr(os, "nice", lambda n: 0)
    folder = jobs.jobs_folder() / queued
    for name in (".job.json.ab12.tmp", ".result.npz.ab12.tmp"):
        (folder / name).write_bytes(b"cut")
    assert work_here(queued) == 0
    assert not list(folder.glob("*.tmp")) and not list(folder.glob(".*.tmp"))


def test_a_job_whose_result_grows_is_not_taken_for_finished():
    assert [name for name, kind in KINDS.items() if kind.grows] == ["map"]


@pytest.mark.parametrize("jump", [-86_400.0, 86_400.0])
def test_a_clock_that_jumps_does_not_hang_a_job(jump, root, monkeypatch):
    real = time.time
    job = jobs.submit("bifurcation", LINE)
    monkeypatch.setattr(jobs.time, "time", lambda: real() + jump)
    assert jobs.find(job.id).active  # its worker is on its way
    assert ended(job.id).state == "done"
    assert [j.id for j in jobs.list_jobs()] == [job.id]


@pytest.mark.parametrize("jump", [-86_400.0, 86_400.0])
def test_a_worker_lost_before_a_jump_of_the_clock_is_noticed(jump, queued, monkeypatch):
    real = time.time
    assert jobs.find(queued).state == "queued"  # for two minutes, as nobody knows better
    monkeypatch.setattr(jobs.time, "time", lambda: real() + jump)
    found = jobs.find(queued)
    assert found.state == "failed" and found.message.startswith(jobs.STOPPED)


def test_time_left_is_not_told_after_the_clock_was_set_back(queued):
    folder = jobs.jobs_folder() / queued
    data = jobs.read_state(folder) | {
        "state": "running",
        "done": 3,
        "total": 6,
        "started": time.time() + 3600.0,
    }
    with jobs.FileLock(folder / ".lock"):
        assert jobs._job(folder, data).seconds_left is None


@pytest.mark.parametrize("cut", [0, 100, -1])
def test_a_chunk_cut_short_is_named(cut, tmp_path, capsys, monkeypatch):
    out, real = tmp_path / "m.npz", os.fsync
    with monkeypatch.context() as patch:
        full(patch, 3)
        assert main([*MAP, "--out", str(out)]) == 2
    assert os.fsync is real
    chunk = Path(f"{out}.parts") / "chunk-000000.npz"
    chunk.write_bytes(chunk.read_bytes()[:cut])
    capsys.readouterr()
    assert main([*MAP, "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert (
        str(chunk) in told
        and "delete it to compute that chunk again" in told
        and "Traceback" not in told
    )
    chunk.unlink()
    assert main([*MAP, "--out", str(out)]) == 0


def test_kernels_cut_short_are_compiled_again(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    _kernel_cache.choose()
    place = Path(numba.config.CACHE_DIR)
    assert place.parent == tmp_path
    (place / "spab_core_x").mkdir()
    for name, data in (
        ("a.nbi", b"whole."),
        ("b.nbc", b"whole."),
        ("c.nbi", b""),
        ("d.nbc", b"cut"),
        ("e.nbc", bytes(9)),
    ):
        (place / "spab_core_x" / name).write_bytes(data)
    _kernel_cache.choose()
    assert Path(numba.config.CACHE_DIR) == place
    assert sorted(p.name for p in place.glob("*/*")) == ["a.nbi", "b.nbc"]


@pytest.mark.parametrize("what", ["file", "room"])
def test_kernels_go_elsewhere_where_they_cannot_be_kept(what, tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    bad = tmp_path / "bad"
    if what == "file":
        bad.write_text("no folder")
    else:
        real = _kernel_cache.shutil.disk_usage
        monkeypatch.setattr(
            _kernel_cache.shutil,
            "disk_usage",
            lambda p: real(p)._replace(free=1000) if str(p).startswith(str(bad)) else real(p),
        )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(bad))
    _kernel_cache.choose()
    assert numba.config.CACHE_DIR and not numba.config.CACHE_DIR.startswith(str(bad))


@pytest.mark.slow
def test_a_worker_process_ends_with_the_one_that_started_it():
    """Killed, the parent can tell its processes nothing."""
    program = (
        "import os, time\n"
        "from joblib.externals.loky import ProcessPoolExecutor\n"
        "from spab_core.common.processes import end_with_parent\n"
        "e = ProcessPoolExecutor(max_workers=1, initializer=end_with_parent, "
        "initargs=(os.getpid(),))\n"
        "print(e.submit(os.getpid).result(), flush=True)\n"
        "time.sleep(100)\n"
    )
    parent = subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    child = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    parent.stdout.close()
    end = time.monotonic() + 20
    with contextlib.suppress(ProcessLookupError, FileNotFoundError):
        while Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
            assert time.monotonic() < end, "it lives on"
            time.sleep(0.1)


def test_two_processes_do_one_job_once(root):
    """Both submit it at the same moment; one worker does it, the other finds it taken or done."""
    program = (
        "import json, sys; from spab_core.jobs import store as jobs\n"
        "print(jobs.submit('bifurcation', json.loads(sys.argv[1])).id)"
    )
    both = [
        subprocess.Popen(
            [sys.executable, "-c", program, json.dumps(LINE)],
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
        for _ in range(2)
    ]
    names = {process.communicate(timeout=60)[0].strip() for process in both}
    assert len(names) == 1 and all(process.returncode == 0 for process in both)
    (name,) = names
    assert ended(name).state == "done" and len(jobs.list_jobs()) == 1
    assert "Traceback" not in (root / name / "log.txt").read_text()


READ_ONLY = """
import contextlib, io, json, sys
from streamlit.testing.v1 import AppTest
from spab_core.shipped import manifest as artifacts
from spab_core.cli.main import main
try:
    (artifacts.ARTIFACTS / "x").touch()
    raise SystemExit("it can be written")
except OSError:
    pass
told = []
for command in json.loads(sys.argv[1]):
    words = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(words):
        code = main(command) if command else artifacts._main()
    told.append([code, words.getvalue()])
for page in sys.argv[2:]:
    at = AppTest.from_file(page, default_timeout=240).run()
    assert not at.exception and all("not recommended" in e.value for e in at.error), page
print(json.dumps(told))
"""


@pytest.mark.slow
def test_read_only_artifacts_serve_and_refuse_in_a_sentence(tmp_path):
    """On a mount that is read-only for root too, seen by this process alone."""
    private = [
        "unshare",
        "--map-root-user",
        "--mount",
        "sh",
        "-ec",
        'mount --bind "$1" "$1"; mount -o remount,bind,ro "$1"; shift; exec "$@"',
        "sh",
        str(ARTIFACTS),
    ]
    if (
        not shutil.which("unshare")
        or subprocess.run([*private, "true"], capture_output=True).returncode
    ):
        pytest.skip("this system gives no mounts of one's own")
    x = str(ARTIFACTS / "x")
    plane = ["--bearing-number", "2:4:5", "--rotor-mass", "3:5:5", *OPTIONS]
    good = [["verify"], ["predict", "--model", "mlp", "--out", str(tmp_path / "p.npz")]]
    bad = [
        [],
        ["train", "--all"],
        ["train", "--model", "tree", "--divisor", "4", "--out", x],
        ["evaluate", "--out", x],
        ["predict", "--model", "tree", "--out", x],
        ["map", *plane, "--out", x],
        ["refine", *plane, "--budget", "16", "--out", x],
        [
            "bifurcation",
            "--vary",
            "rotor-mass",
            "--at",
            "3",
            "--range",
            "2:4:2",
            *OPTIONS,
            "--out",
            x,
        ],
        ["simulate", "--rotor-mass", "3", "--bearing-number", "3", *OPTIONS, "--orbit", x],
    ]
    pages = [str(ROOT / "app.py"), str(next((ROOT / "pages").glob("*_Surrogate_map.py")))]
    done = subprocess.run(
        [*private, sys.executable, "-c", READ_ONLY, json.dumps([*good, *bad]), *pages],
        text=True,
        capture_output=True,
        timeout=300,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert [code for code, _ in told] == [0] * len(good) + [2] * len(bad), told
    for _, words in told[len(good) :]:
        assert words.count("\n") == 1 and words.endswith(
            f"cannot be written: the folder {ARTIFACTS} is read-only\n"
        ), words
        assert "| 1/" not in words  # nothing was done before it was refused
