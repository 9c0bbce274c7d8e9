"""Windows and macOS, which are not at hand: what they lack is taken away, what they do otherwise is
done here as they do it.
"""

import contextlib
import errno
import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numba
import pandas as pd
import psutil
import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.cli.dashboard import check_free
from spab_core.common import private_folders as private_folder
from spab_core.common.errors import InputError
from spab_core.common.files import check_writable, csv_bytes, write_atomically
from spab_core.common.npz import npz_bytes, open_npz
from spab_core.design.model import design_toml, load_design, read_design_bytes
from spab_core.jobs import store as jobs
from spab_core.maps.bifurcation import load_bifurcation
from spab_core.maps.checkpoints import remove_temporaries
from spab_core.maps.stability_map import load_map
from spab_core.reporting import export, report
from spab_core.shipped import model_cache
from spab_core.shipped.manifest import ARTIFACTS, SCORES
from spab_core.solver import cache as _kernel_cache
from spab_core.trajectory.compiling import compile_once
from tests.conftest import ROOT

TINY = {"mesh": "2x16", "transient": 30, "revolutions": 20}
LINE = {
    "vary": "rotor-mass",
    "at": 3.0,
    "range": "4:9:30",
    "sweeps": ["up", "cold"],
    "settings": TINY | {"transient": 300, "early_stop": False},
}
# what Python on Windows does not have; a parent's number stays after its death, and a file that
# another process has open for a moment cannot be replaced: here every second time
WINDOWS = """
import errno, os

for name in ("killpg", "getpgrp", "nice", "O_NOFOLLOW", "getuid"):
    vars(os).pop(name, None)
parent, replace, calls = os.getppid(), os.replace, []
os.getppid = lambda: parent

def denied_every_second_time(source, target, **options):
    calls.append(source)
    kernel = "spab-kernels-" in str(target)  # numba has a guard of its own there, on Windows alone
    if len(calls) % 2 and not kernel:
        raise PermissionError(errno.EACCES, "Permission denied", source)
    return replace(source, target, **options)

os.replace = denied_every_second_time
"""
# the C library of Windows is not had without a name, that of macOS has no mallopt
LIBRARIES = {
    "windows": """
    def __init__(self, name, *arguments, **options):
        if name is None:
            raise TypeError("bad argument type for built-in operation")
        super().__init__(name, *arguments, **options)
""",
    "macos": """
    def __getattr__(self, name):
        if name == "mallopt":
            raise AttributeError("dlsym(RTLD_DEFAULT, mallopt): symbol not found")
        return super().__getattr__(name)
""",
}


@pytest.fixture
def windows(tmp_path, monkeypatch):
    """Processes started by the test find Python as it is on Windows; this one has no users, groups
    and flags either.
    """
    folder = tmp_path / "windows"
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(WINDOWS)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(folder), str(ROOT)]))
    for name in ("killpg", "getpgrp", "nice", "O_NOFOLLOW", "getuid"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.setattr(private_folder, "_FLAGS", os.O_RDONLY)


@pytest.fixture
def root(tmp_path, monkeypatch):
    """Jobs of this test alone; none is left at work."""
    folder = tmp_path / "jobs"
    monkeypatch.setenv("SPAB_JOBS", str(folder))
    yield folder
    for job in jobs.list_jobs():
        if job.active:
            jobs.cancel(job.id)
    for name in list(jobs._workers):
        jobs._workers.pop(name).wait(60)


def until(look, seconds=120):
    """What ``look`` gives, once it is true."""
    end = time.monotonic() + seconds
    while not (found := look()):
        assert time.monotonic() < end, "nothing came of it"
        time.sleep(0.05)
    return found


def lives(process):
    with contextlib.suppress(psutil.NoSuchProcess):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def job_once(name, wanted):
    return until(lambda: (job := jobs.find(name)) and wanted(job) and job)


@pytest.mark.slow
def test_a_job_runs_is_cancelled_with_its_processes_goes_on_and_is_deleted(windows, root):
    compile_once()
    job = jobs.submit("bifurcation", LINE)
    job_once(job.id, lambda j: j.done >= 5)
    worker = psutil.Process(json.loads((job.folder / "job.json").read_text())["pid"])
    processes = [worker, *worker.children(recursive=True)]
    assert len(processes) > 2  # with those that solve
    assert jobs.cancel(job.id).state == "cancelled"
    until(lambda: not any(map(lives, processes)), 10)
    jobs.submit("bifurcation", LINE)
    done = job_once(job.id, lambda j: not j.active)
    assert (done.state, done.done) == ("done", 60), (
        done.message,
        (job.folder / "log.txt").read_text(),
    )
    assert load_bifurcation(done.result).branches["up"].section.shape[0] == 30
    jobs._workers.pop(job.id).wait(60)
    jobs.delete(job.id)
    assert jobs.list_jobs() == [] and not done.folder.exists()


@pytest.mark.slow
@pytest.mark.parametrize("pool", ["loky", "processes"])
def test_worker_processes_end_with_a_parent_whose_number_stays(windows, pool):
    """Also where nobody has waited for the dead parent, as for some minutes in a container."""
    module = {"loky": "joblib.externals.loky", "processes": "concurrent.futures"}[pool]
    program = (
        f"import os, time\nfrom {module} import ProcessPoolExecutor\n"
        "from spab_core.common.processes import end_with_parent\n"
        "if __name__ == '__main__':\n"
        "    e = ProcessPoolExecutor(max_workers=1, initializer=end_with_parent, "
        "initargs=(os.getpid(),))\n"
        "    print(e.submit(os.getpid).result(), flush=True)\n"
        "    time.sleep(100)\n"
    )
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    worker = psutil.Process(int(parent.stdout.readline()))
    time.sleep(2.5)
    assert lives(worker)
    parent.kill()
    until(lambda: not lives(worker), 20)
    parent.stdout.close()
    parent.wait()


def denied(times, real):
    """The function as Windows has it while another process has the file open: the first calls are
    denied.
    """
    left = [times]

    def call(*arguments, **options):
        if left[0] > 0:
            left[0] -= 1
            raise PermissionError(errno.EACCES, "Permission denied", str(arguments[0]))
        return real(*arguments, **options)

    return call


def test_a_file_that_is_open_elsewhere_is_replaced_when_it_is_closed(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_atomically(path, b"old")
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", denied(2, os.replace))
        write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", denied(1000, os.replace))
        with pytest.raises(PermissionError):
            write_atomically(path, b"newer")
    assert path.read_bytes() == b"new" and [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_folder_closed_by_access_lists_is_told_at_once_and_before_the_work(tmp_path, monkeypatch):
    """tempfile of Python up to 3.13 takes such a denial for a name that is taken, and os.access
    says that all is well.
    """
    monkeypatch.setattr(os, "access", lambda *a, **k: True)
    monkeypatch.setattr(os, "open", denied(10**9, os.open))
    monkeypatch.setattr(io, "open", denied(10**9, io.open))
    began = time.monotonic()
    with pytest.raises(PermissionError):
        write_atomically(tmp_path / "file", b"data")
    assert time.monotonic() - began < 60
    with pytest.raises(InputError, match=r"--out cannot be written: the folder .* is read-only"):
        check_writable(tmp_path, "--out")
    monkeypatch.undo()
    check_writable(tmp_path, "--out")
    assert not list(tmp_path.iterdir())


def test_what_a_killed_writer_left_is_removed_under_its_names(tmp_path, monkeypatch):
    def killed(handle):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", killed)
    monkeypatch.setattr(Path, "unlink", lambda *a, **k: None)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "chunk-000001.npz", b"half")
    monkeypatch.undo()
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".chunk-000001.npz.")
    monkeypatch.setattr(os, "unlink", denied(2, os.unlink))
    remove_temporaries(tmp_path, "chunk-*")
    assert not list(tmp_path.iterdir())


def test_files_of_ones_own_are_read_between_two_writes_and_no_links(windows, tmp_path, monkeypatch):
    path, link = tmp_path / "file", tmp_path / "link"
    path.write_bytes(b"mine")
    link.symlink_to(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "open", denied(2, os.open))
        assert private_folder.own_bytes(path, 10) == b"mine"
    with pytest.raises(OSError, match="symbolic"):
        private_folder.own_bytes(link, 10)
    (tmp_path / "a.npz").write_bytes(npz_bytes({"a": [1.0, 2.0]}))
    monkeypatch.delattr(os, "O_NONBLOCK", raising=False)  # in the fixture, filelock would miss it
    with open_npz(tmp_path / "a.npz") as data:
        assert list(data["a"]) == [1.0, 2.0]


def test_a_job_whose_last_process_has_not_ended_is_deleted(root, monkeypatch):
    job = jobs.submit("bifurcation", LINE)
    jobs.cancel(job.id)
    jobs._workers.pop(job.id).wait(60)
    with monkeypatch.context() as patch:
        patch.setattr(jobs.shutil, "rmtree", denied(1000, shutil.rmtree))
        with pytest.raises(InputError, match="cannot be deleted: Permission denied"):
            jobs.delete(job.id)
    with monkeypatch.context() as patch:
        patch.setattr(jobs.shutil, "rmtree", denied(2, shutil.rmtree))
        jobs.delete(job.id)
    assert jobs.list_jobs() == []


def test_models_and_jobs_lie_in_the_local_profile(windows, tmp_path, monkeypatch):
    for name in ("SPAB_CACHE", "SPAB_JOBS", "XDG_CACHE_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "Local"))
    assert jobs.jobs_folder() == tmp_path / "Local" / "spab" / "jobs"
    kept = model_cache.keep("a.joblib", b"model", {"map": "x"})
    assert kept == tmp_path / "Local" / "spab" / "a.joblib" and model_cache.read("a.joblib") == (
        b"model",
        {"map": "x"},
    )
    kept.write_bytes(b"other")
    with pytest.raises(InputError, match="SHA-256"):
        model_cache.read("a.joblib")
    # a model that another process reads cannot be dropped: the new one is kept all the same
    monkeypatch.setattr(model_cache, "MAX_BYTES", 5)
    with monkeypatch.context() as patch:
        patch.setattr(os, "unlink", denied(1000, os.unlink))
        model_cache.keep("b.joblib", b"newer", {})
    assert model_cache.read("b.joblib") == (b"newer", {})
    monkeypatch.delenv("LOCALAPPDATA")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert model_cache.wanted_folder() == tmp_path / ".cache" / "spab"


def test_kernels_are_kept_where_their_whole_names_fit(tmp_path, monkeypatch):
    """A path may have 260 characters on Windows, 4,096 here."""
    deep = tmp_path
    while len(str(deep)) < 3900:
        deep /= "d" * min(200, 3960 - len(str(deep)))
    deep.mkdir(parents=True)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(deep))
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    _kernel_cache.choose()
    assert numba.config.CACHE_DIR and not numba.config.CACHE_DIR.startswith(str(tmp_path))
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "short"))
    _kernel_cache.choose()
    assert Path(numba.config.CACHE_DIR).parent == tmp_path / "short" and not list(
        Path(numba.config.CACHE_DIR).iterdir()
    )


def test_names_of_kernels_are_no_longer_than_what_is_tried():
    compile_once()
    names = [
        str(p.relative_to(p.parent.parent)) for p in Path(numba.config.CACHE_DIR).glob("*/*.nb?")
    ]
    assert names and max(map(len, names)) + len(".tmp.0123456789abcdef") <= _kernel_cache._LONGEST


@pytest.mark.slow
@pytest.mark.parametrize("system", LIBRARIES)
def test_memory_is_bounded_as_far_as_another_c_library_lets(system):
    program = (
        f"import ctypes\nclass CDLL(ctypes.CDLL):{LIBRARIES[system]}\nctypes.CDLL = CDLL\n"
        "from spab_core.ui.memory import bound_memory\n"
        "import pyarrow as pa\n"
        "bound_memory()\n"
        "print(pa.default_memory_pool().backend_name)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.stdout == "system\n", done.stderr


COMMANDS = [
    (["--help"], 0),
    (["simulate", "--help"], 0),
    (["design", "show", "--rotor-mass", "4", "--rpm", "9000"], 0),
    (
        ["margin", "--rotor-mass", "4.52", "--rpm", "10200", "--points", "2", "--precision", "0.1"],
        0,
    ),
    (["design", "new", "--preset", "Λ", "--out", "µΩ.toml"], 2),
    (["design", "new", "--preset", "spab60", "--out", "µΩ.toml"], 0),
    (["jobs", "list"], 0),
]
# one process for all commands: it takes seconds to import what they need
ONE_BY_ONE = """
import json, sys
from spab_core.cli.main import main
for arguments in json.loads(sys.argv[1]):
    try:
        code = main(arguments)
    except SystemExit as ended:
        code = ended.code
    print("\\n--- ended with", code or 0, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "ascii"])
def test_a_terminal_of_another_alphabet_gets_words_and_no_traceback(
    encoding, windows, root, tmp_path
):
    done = subprocess.run(
        [sys.executable, "-c", ONE_BY_ONE, json.dumps([arguments for arguments, _ in COMMANDS])],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        cwd=tmp_path,
        env=os.environ | {"PYTHONIOENCODING": f"{encoding}:strict", "PYTHONUTF8": "0"},
    )
    told = done.stdout.decode(encoding)
    assert "Traceback" not in told and done.returncode == 0, told
    *words, rest = told.split("--- ended with ")
    codes = [int(text.split(maxsplit=1)[0]) for text in (*words[1:], rest)]
    assert codes == [code for _, code in COMMANDS], told
    assert all(len(text.strip()) > 5 for text in words), told
    assert load_design(str(tmp_path / "µΩ.toml"))


def test_a_design_file_of_a_windows_editor_is_read(design):
    text = design_toml(design).replace("\n", "\r\n")
    assert read_design_bytes(text.encode("utf-8-sig")) == design
    assert read_design_bytes(text.encode("utf-16")) == design
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        read_design_bytes("Größe".encode("cp1252"))


def test_tables_have_the_same_bytes_on_every_system(monkeypatch, tmp_path):
    shipped = (ARTIFACTS / SCORES).read_bytes()
    monkeypatch.setattr(os, "linesep", "\r\n")
    assert b"\r" not in csv_bytes(pd.read_csv(io.BytesIO(shipped)))
    assert b"\r" not in shipped


@pytest.mark.skipif(shutil.which("git") is None, reason="no git on this machine")
def test_files_come_out_of_a_clone_on_windows_as_they_went_in(tmp_path):
    """Git for Windows is set to turn line ends, and the manifest's checksums and the hash of the
    solver would not fit.
    """
    if not (ROOT / ".gitattributes").exists():
        pytest.skip("not a clone")
    names = [
        f"artifacts/{SCORES}",
        "artifacts/manifest.json",
        "spab_core/solver/film.py",
        "spab_core/design/data/spab60.toml",
    ]
    for name in [".gitattributes", *names]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    git = [
        "git",
        "-C",
        str(tmp_path),
        "-c",
        "core.autocrlf=true",
        "-c",
        "user.name=x",
        "-c",
        "user.email=x@y",
    ]
    for command in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "-m", "all"]):
        subprocess.run([*git, *command], check=True, capture_output=True)
    for name in names:
        (tmp_path / name).unlink()
    subprocess.run([*git, "checkout", "--quiet", "--", "."], check=True)
    for name in names:
        assert (tmp_path / name).read_bytes() == (ROOT / name).read_bytes(), name


def test_a_port_in_use_is_refused_where_windows_would_share_it(monkeypatch):
    class Shared(socket.socket):
        def bind(self, place):
            if not self.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR):
                super().bind(place)

    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        port = server.getsockname()[1]
        monkeypatch.setattr(socket, "SO_EXCLUSIVEADDRUSE", -5, raising=False)
        monkeypatch.setattr(socket, "socket", Shared)
        with pytest.raises(InputError, match=f"--port = {port} cannot be used"):
            check_free("127.0.0.1", port)
    check_free("127.0.0.1", port)


def test_a_date_that_windows_does_not_know_is_a_damaged_job(root):
    job = jobs.submit("bifurcation", LINE)
    jobs.cancel(job.id)
    jobs._workers.pop(job.id).wait(60)
    path = job.folder / "job.json"
    path.write_text(
        json.dumps(json.loads(path.read_text()) | {"created": 32_536_800_000})
    )  # January 3001
    with pytest.raises(InputError, match="damaged"):
        jobs.find(job.id)


def test_without_a_browser_pictures_and_pdf_are_a_sentence_or_greyed(monkeypatch):
    from choreographer.errors import ChromeNotFoundError

    def none(**options):
        raise ChromeNotFoundError

    monkeypatch.setattr(export.Chromium, "find_browser", none)
    export.browser_path.cache_clear()
    try:
        with pytest.raises(
            InputError, match="a PNG is drawn by Chromium or Chrome, and none is found"
        ):
            export.figure_png(None)
        with pytest.raises(
            InputError, match="a PDF is printed by Chromium or Chrome, and none is found"
        ):
            report.report_pdf("<html>")
        st.cache_resource.clear()
        at = AppTest.from_file(
            str(ROOT / "pages" / "9_About_the_model.py"), default_timeout=60
        ).run()
        assert not at.exception
        greyed = {b.label: b.proto.disabled for b in at.get("download_button")}
        assert greyed and all(grey == label.endswith("PNG") for label, grey in greyed.items()), (
            greyed
        )
    finally:
        export.browser_path.cache_clear()


def test_a_browser_that_keeps_its_profile_open_has_printed_all_the_same(tmp_path, monkeypatch):
    browser = tmp_path / "browser"
    browser.write_text(
        '#!/bin/sh\nfor a in "$@"; do case $a in --print-to-pdf=*) echo printed > "${a#*=}";;\n'
        '--user-data-dir=*) mkdir "${a#*=}"; touch "${a#*=}/lockfile";; esac; done\n'
    )
    browser.chmod(0o700)
    monkeypatch.setattr(report, "browser_path", lambda: str(browser))
    real = os.unlink

    def unlink(path, **options):
        if str(path).endswith("lockfile"):
            raise PermissionError(errno.EACCES, "Permission denied", path)
        real(path, **options)

    monkeypatch.setattr(os, "unlink", unlink)
    monkeypatch.setattr(report.tempfile, "tempdir", str(tmp_path))
    assert report.report_pdf("<html>") == b"printed\n"


@pytest.mark.slow
def test_a_map_on_two_processes_is_interrupted_and_goes_on(windows, tmp_path):
    compile_once()
    command = [
        sys.executable,
        "-m",
        "spab_core.cli.main",
        "map",
        "--bearing-number",
        "2:4.5:6",
        "--rotor-mass",
        "3:18:16",
        "--mesh",
        "2x16",
        "--transient",
        "200",
        "--revolutions",
        "20",
        "--full-length",
        "--workers",
        "2",
        "--out",
        str(tmp_path / "m.npz"),
    ]
    run = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    until(lambda: list(tmp_path.glob("m.npz.parts/chunk-*.npz")))
    os.kill(run.pid, signal.SIGINT)
    told = run.communicate(timeout=60)[0]
    assert (
        run.returncode == 130
        and "the same command goes on from them" in told
        and "Traceback" not in told
    ), told
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert load_map(tmp_path / "m.npz").shape == (6, 16) and not (tmp_path / "m.npz.parts").exists()
