"""Background jobs with real worker processes on small work: states, cancel, kill, resume, damage,
deletion.
"""

import dataclasses
import json
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.jobs import store as jobs
from spab_core.jobs.kinds import KINDS
from spab_core.jobs.store import (
    JobError,
    active_jobs,
    cancel,
    delete,
    find,
    job_id,
    list_jobs,
    rename,
    submit,
)
from spab_core.maps.bifurcation import compute_bifurcation, load_bifurcation
from spab_core.maps.stability_map import axis
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.point_file import load_point, save_point
from spab_core.trajectory.settings import Settings
from tests.background import until

TINY = {"mesh": "2x16", "transient": 30, "revolutions": 20}
LINE = {"vary": "rotor-mass", "at": 3.0, "range": "4:6:3", "sweeps": ["cold"], "settings": TINY}
LONG = LINE | {"range": "4:9:300", "settings": TINY | {"transient": 600, "early_stop": False}}


def worker_of(job):
    return json.loads((job.folder / "job.json").read_text())["pid"]


def group(pid):
    """Processes of a group that are not yet dead, from /proc."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == pid and fields[0] not in "ZX":
            found.append(path)
    return found


def test_a_line_is_computed_once_and_found_again(root, design):
    job = submit("bifurcation", LINE)
    assert job.state == "queued" and job.id == job_id("bifurcation", dict(reversed(LINE.items())))
    assert root.stat().st_mode & 0o777 == 0o700
    done = until(job.id, lambda j: not j.active)
    assert (done.state, done.done, done.total, done.message) == ("done", 3, 3, "")
    assert done.created <= done.started <= done.finished and done.seconds_left is None
    result, direct = (
        load_bifurcation(done.result),
        compute_bifurcation(
            design, "rotor-mass", 3.0, axis("4:6:3", "x"), Settings(**TINY), sweeps=["cold"]
        ),
    )
    assert np.array_equal(result.branches["cold"].section, direct.branches["cold"].section)
    assert not (done.folder / "parts").exists()
    stamp = done.result.stat().st_mtime_ns
    again = submit(
        "bifurcation", LINE
    )  # its chunks may have been there still when the end was told
    assert (
        dataclasses.replace(again, size=done.size) == done
        and done.result.stat().st_mtime_ns == stamp
    )
    assert [j.id for j in list_jobs()] == [job.id] and list_jobs()[
        0
    ].size > done.result.stat().st_size
    done.result.unlink()
    assert find(job.id).state == "failed" and "gone" in find(job.id).message
    delete(job.id)
    assert find(job.id) is None and list_jobs() == [] and not done.folder.exists()


@pytest.mark.slow
def test_one_runs_the_others_wait_and_a_cancel_stops_all_its_processes(root):
    job = submit("bifurcation", LONG)
    until(job.id, lambda j: j.state == "running" and j.total)
    other = submit("bifurcation", LINE)
    waiting = until(other.id, lambda j: j.message)
    assert waiting.state == "queued" and waiting.message == "waiting for bifurcation line to end"
    with pytest.raises(JobError, match="queued or running"):
        delete(other.id)
    until(job.id, lambda j: j.done)
    # a point has a lane of its own
    point = submit("point", {"rotor_mass": 4.0, "bearing_number": 3.0, "settings": TINY})
    assert until(point.id, lambda j: not j.active).state == "done"
    assert [j.id for j in active_jobs()] == [job.id, other.id]
    pids = [worker_of(find(name)) for name in (job.id, other.id)]
    assert len(group(pids[0])) > 1  # its own processes
    assert cancel(other.id).state == "cancelled"
    stopped = cancel(job.id)
    assert (
        stopped.state == "cancelled"
        and stopped.finished
        and 0 < stopped.done < stopped.total == 300
    )
    end = time.monotonic() + 30
    while any(group(pid) for pid in pids):
        assert time.monotonic() < end
        time.sleep(0.05)
    assert dataclasses.replace(cancel(job.id), size=stopped.size) == stopped  # nothing more to stop


@pytest.mark.slow
def test_cancelled_then_killed_it_goes_on_to_the_same_bits(root, design):
    short = LONG | {"range": "4:9:30", "sweeps": ["up", "cold"]}
    job = submit("bifurcation", short)
    until(job.id, lambda j: j.done >= 10)
    stopped = cancel(job.id)
    assert stopped.state == "cancelled" and 10 <= stopped.done < 60
    kept = len(list((stopped.folder / "parts").glob("chunk-*.npz")))
    assert kept >= 2
    again = submit("bifurcation", short)
    assert again.id == job.id and again.created == job.created
    resumed = until(job.id, lambda j: j.total)
    assert resumed.done >= 5 * kept
    os.kill(worker_of(resumed), signal.SIGKILL)
    killed = until(job.id, lambda j: not j.active)
    assert killed.state == "failed" and "start it again" in killed.message
    submit("bifurcation", short)
    done = until(job.id, lambda j: not j.active)
    assert done.state == "done" and done.done == done.total == 60
    result, direct = (
        load_bifurcation(done.result),
        compute_bifurcation(
            design,
            "rotor-mass",
            3.0,
            axis("4:9:30", "x"),
            Settings(**short["settings"]),
            sweeps=["up", "cold"],
        ),
    )
    for name, branch in direct.branches.items():
        for f in dataclasses.fields(branch):
            assert np.array_equal(
                getattr(result.branches[name], f.name),
                getattr(branch, f.name),
                equal_nan=f.name in ("mle", "mle_standard_error", "contact_share", "section"),
            ), (name, f.name)


def test_cancelled_before_its_worker_shows_up(root):
    job = submit("bifurcation", LINE)
    assert cancel(job.id).state == "cancelled"
    jobs._workers[job.id].wait(60)
    assert find(job.id).state == "cancelled"
    assert submit("bifurcation", LINE).state == "queued"
    assert until(job.id, lambda j: not j.active).state == "done"


def test_a_worker_that_never_shows_up_is_noticed(root, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    job = submit("bifurcation", LINE)
    assert until(job.id, lambda j: not j.active).state == "failed"
    monkeypatch.setattr(
        jobs, "_workers", {}
    )  # as another process sees it: it waits, but not for ever
    assert find(job.id).state == "queued"
    monkeypatch.setattr(jobs, "_START_SECONDS", 0.0)
    assert find(job.id).state == "failed"


def test_a_job_that_ends_while_it_is_read_is_told_as_it_ended(root):
    """job.json was read while the job ran; its worker has gone since: state and counts are both
    those of the end.
    """
    ended = until(submit("bifurcation", LINE).id, lambda j: not j.active)
    before = json.loads((ended.folder / "job.json").read_text()) | {
        "state": "running",
        "done": 1,
        "finished": None,
    }
    until(ended.id, lambda j: not jobs._alive(j.folder))
    found = jobs._job(ended.folder, before)
    assert (found.state, found.done, found.finished) == ("done", ended.total, ended.finished)


def test_what_the_work_raises_is_a_sentence(root):
    job = submit("bifurcation", LINE)
    until(job.id, lambda j: not j.active)
    until(job.id, lambda j: not (j.folder / "parts").exists())  # the worker's last deed
    job.result.unlink()
    (job.folder / "parts").write_text("no folder")
    submit("bifurcation", LINE)
    failed = until(job.id, lambda j: not j.active)
    assert failed.state == "failed" and "log.txt" in failed.message
    assert "Traceback" in (job.folder / "log.txt").read_text()


@pytest.mark.slow
def test_a_point_comes_back_whole(root, design, tmp_path):
    settings = TINY | {"method": "dtm"}
    job = submit(
        "point",
        {"rotor_mass": 4, "bearing_number": 3.0, "settings": settings, "path_revolutions": 5},
    )
    done = until(job.id, lambda j: not j.active)
    assert done.state == "done" and done.done == done.total == 50
    again, direct = (
        load_point(done.result),
        solve_point(design, 4.0, 3.0, Settings(**settings), path_revolutions=5),
    )
    assert again.record() | {"wall_seconds": 0} == direct.record() | {"wall_seconds": 0}
    assert (
        again.settings == direct.settings
        and again.design == design
        and again.verdict() == direct.verdict()
    )
    for name in ("section", "growth", "contact", "peak", "path", "final"):
        assert np.array_equal(getattr(again.trajectory, name), getattr(direct.trajectory, name)), (
            name
        )
    assert np.array_equal(again.mle.trace, direct.mle.trace)
    failed = solve_point(design, 4.0, 3.0, Settings(**TINY, tolerance=1e-10))
    failed = dataclasses.replace(failed, mle=None, regime=None)
    save_point(failed, tmp_path / "failed.npz")
    assert load_point(tmp_path / "failed.npz").mle is None
    (tmp_path / "no.npz").write_bytes(b"none")
    np.savez(tmp_path / "other.npz", metadata=np.array("{}"))
    for name in ("no.npz", "other.npz", "missing.npz"):
        with pytest.raises(InputError, match="cannot read"):
            load_point(tmp_path / name)


def test_a_damaged_state_is_a_sentence_and_can_be_started_again_or_deleted(root):
    job = submit("bifurcation", LINE)
    cancel(job.id)
    jobs._workers.pop(job.id).wait(60)
    for text in ("", "{", "[]", "null", '{"kind": "bifurcation"}', "[" * 100_000):
        (job.folder / "job.json").write_text(text)
        with pytest.raises(InputError, match="damaged"):
            find(job.id)
        with pytest.raises(InputError, match="damaged"):
            cancel(job.id)
        (listed,) = list_jobs()
        assert (
            listed.state == "failed"
            and listed.kind == "bifurcation"
            and "damaged" in listed.message
        )
    assert submit("bifurcation", LINE).active
    cancel(job.id)
    (job.folder / "job.json").write_text("")
    delete(job.id)
    assert list_jobs() == []


def test_foreign_files_are_neither_followed_nor_listed(root, tmp_path):
    job = submit("bifurcation", LINE)
    cancel(job.id)
    jobs._workers.pop(job.id).wait(60)
    (job.folder / "job.json").rename(tmp_path / "job.json")
    (job.folder / "job.json").symlink_to(tmp_path / "job.json")
    with pytest.raises(InputError, match="cannot be opened"):
        find(job.id)
    link = root / ("point-" + 16 * "0")
    link.symlink_to(tmp_path, target_is_directory=True)
    (root / "note.txt").write_text("mine")
    assert [j.id for j in list_jobs()] == [job.id]
    with pytest.raises(JobError, match="no job"):
        delete(link.name)


@pytest.mark.parametrize(
    "name",
    [
        "",
        "..",
        "../x",
        "bifurcation",
        "bifurcation-0123456789abcdeg",
        "a/../b-0123456789abcdef",
        "point-0123456789abcdef/..",
        "point-0123456789abcdef\n",
        None,
    ],
)
def test_bad_ids_are_refused(root, name):
    for ask in (find, cancel, delete):
        with pytest.raises(JobError, match="no job's id"):
            ask(name)


def test_a_job_has_the_name_that_it_was_given(root):
    job = submit("bifurcation", LINE)
    assert job.name == ""
    rename(job.id, "  the first   try ")
    assert find(job.id).name == list_jobs()[0].name == "the first try"
    for wrong in (("bifurcation-" + 16 * "0", "x"), (job.id, 61 * "x"), ("x", "y")):
        with pytest.raises(JobError):
            rename(*wrong)
    rename(job.id, "")
    assert until(job.id, lambda j: not j.active).name == ""


def test_unknown_ids(root):
    name = "point-0123456789abcdef"
    assert find(name) is None
    for ask in (cancel, delete):
        with pytest.raises(JobError, match="there is no job"):
            ask(name)


@pytest.mark.parametrize(
    "kind, change, words",
    [
        ("tea", {}, "kind"),
        ("bifurcation", {"vary": "speed"}, "--vary"),
        ("bifurcation", {"range": "1:2"}, "start:stop:count"),
        ("bifurcation", {"range": None}, "start:stop:count"),
        ("bifurcation", {"at": "3"}, "at must be a number"),
        ("bifurcation", {"at": float("nan")}, "at"),
        ("bifurcation", {"sweeps": "cold"}, "sweeps"),
        ("bifurcation", {"settings": {"turns": 3}}, "settings"),
        ("bifurcation", {"settings": 3}, "settings"),
        ("bifurcation", {"colour": 1}, "unknown"),
        ("bifurcation", {"design": {"bearing": {"clearance": -1.0}}}, "clearance"),
        ("point", {}, "missing"),
        ("point", {"rotor_mass": -1, "bearing_number": 3}, "rotor mass"),
    ],
)
def test_wrong_requests_are_sentences(root, kind, change, words):
    with pytest.raises(InputError, match=words):
        submit(kind, (LINE if kind == "bifurcation" else {}) | change)
    assert not root.exists() or list_jobs() == []


def test_a_folder_that_others_can_enter_is_refused(tmp_path, monkeypatch):
    folder = tmp_path / "open"
    folder.mkdir(mode=0o755)
    folder.chmod(0o755)
    monkeypatch.setenv("SPAB_JOBS", str(folder))
    with pytest.raises(InputError, match="yours alone"):
        list_jobs()
    monkeypatch.delenv("SPAB_JOBS")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert jobs.jobs_folder() == tmp_path / "data" / "spab" / "jobs"


def test_the_command_lists_cancels_and_deletes(root, capsys):
    def said(*arguments, code=0):
        assert main(["jobs", *arguments]) == code
        told = capsys.readouterr()
        return told.out if code == 0 else told.err

    assert said("list") == "no jobs\n" and json.loads(said("list", "--json")) == {"jobs": []}
    job = submit("bifurcation", LONG)
    until(job.id, lambda j: j.total)
    assert said("delete", job.id, code=2).startswith("spab jobs delete: ") and find(job.id)
    assert json.loads(said("list", "--json"))["jobs"][0]["state"] == "running"
    assert json.loads(said("cancel", job.id, "--json"))["state"] == "cancelled"
    assert "cancelled" in said("list") and "of 300" in said("list")
    assert said("delete", job.id) == f"{job.id}: deleted\n" and not list_jobs()
    assert "no job's id" in said("cancel", "../x", code=2) and "there is no job" in said(
        "delete", job.id, code=2
    )


def test_equal_requests_are_one():
    for kind, given in (
        ("bifurcation", LINE),
        ("point", {"rotor_mass": 4, "bearing_number": 3}),
        ("intervals", {"model": "tree", "divisor": 8}),
    ):
        checked = KINDS[kind].check(given)
        assert KINDS[kind].check(checked) == checked == json.loads(json.dumps(checked))
    assert job_id("bifurcation", LINE | {"range": "4.0:6:3", "at": 3}) == job_id(
        "bifurcation", LINE
    )
    assert job_id("bifurcation", LINE | {"at": 3.1}) != job_id("bifurcation", LINE)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"model": "oracle"}, "oracle"),
        ({"divisor": 9}, "divisor = '9' is not allowed"),
        ({"seed": 1000}, "seed"),
        ({"made_from": {}}, "has changed since"),
    ],
)
def test_wrong_requests_of_intervals_are_refused(root, wrong, words):
    with pytest.raises(InputError, match=words):
        submit("intervals", {"model": "tree", "divisor": 8} | wrong)
