"""No code from data: a file that would make a folder when unpickled, put in each place that spab
reads from, never does.
"""

import io
import json
import os
import pickle
import socket
import subprocess
import sys
import time
import tomllib
import urllib.request
import zipfile

import joblib
import numpy as np
import pytest

from spab_core.active_learning.refine import load_refinement
from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.common.npz import UNREADABLE, open_npz
from spab_core.design.model import read_design_bytes
from spab_core.jobs import store as jobs
from spab_core.maps.bifurcation import load_bifurcation
from spab_core.maps.checkpoints import Checkpoint
from spab_core.maps.sensitivity import load_sensitivity
from spab_core.maps.stability_map import FIELDS, load_map, map_bytes, unsolved
from spab_core.shipped import model_cache
from spab_core.shipped.manifest import (
    ArtifactError,
    checked_bytes,
    load_reference_map,
    write_manifest,
)
from spab_core.shipped.model_files import model_file
from spab_core.shipped.model_store import find_model
from spab_core.shipped.predicted_maps import load_shipped_map
from spab_core.surrogates.models import model
from spab_core.surrogates.uncertainty import load_intervals
from spab_core.surrogates.user_data import load_samples, read_samples
from spab_core.trajectory.point_file import load_point
from tests.conftest import ROOT

TREE = model("tree")


class Bomb:
    """Makes a folder when it is unpickled."""

    def __init__(self, marker):
        self.marker = str(marker)

    def __reduce__(self):
        return os.mkdir, (self.marker,)


@pytest.fixture
def marker(tmp_path):
    return tmp_path / "exploded"


def dumped(marker, how):
    """The bomb in one of the forms that something could unpickle."""
    buffer = io.BytesIO()
    if how == "pickle":
        pickle.dump(Bomb(marker), buffer)
    elif how == "joblib":
        joblib.dump(Bomb(marker), buffer, compress=("xz", 6))
    elif how == "npy":
        np.save(buffer, np.array([Bomb(marker)], object), allow_pickle=True)
    else:
        np.savez(
            buffer,
            **dict.fromkeys(
                (
                    *FIELDS,
                    "bearing_number",
                    "rotor_mass",
                    "metadata",
                    "values",
                    "inputs",
                    "mle",
                    "low",
                    "section",
                    "trace",
                    "run",
                    "cells",
                    "batch",
                ),
                np.array([Bomb(marker)], object),
            ),
        )
    return buffer.getvalue()


HOW = ("pickle", "joblib", "npy", "npz")


@pytest.mark.parametrize("how", HOW)
def test_the_bomb_goes_off_where_it_is_unpickled(marker, how):
    """So the tests below can fail."""
    data = io.BytesIO(dumped(marker, how))
    if how == "joblib":
        joblib.load(data)
    elif how == "pickle":
        pickle.load(data)
    else:
        found = np.load(data, allow_pickle=True)
        if how == "npz":
            found["mle"]
    assert marker.is_dir()


@pytest.mark.parametrize("how", HOW)
def test_no_loader_of_files_unpickles(marker, tmp_path, how):
    path, data, m = tmp_path / "file", dumped(marker, how), load_reference_map()
    path.write_bytes(data)
    for load in (
        load_map,
        load_refinement,
        load_bifurcation,
        load_point,
        load_samples,
        load_sensitivity,
        lambda p: load_intervals(p, m),
        Checkpoint(None, {}, {name: unsolved(dtype, 1) for name, dtype in FIELDS.items()}).load,
    ):
        with pytest.raises(InputError):
            load(path)
    with pytest.raises(UNREADABLE), open_npz(data) as arrays:
        arrays["mle"]
    for read in (read_samples, read_design_bytes):  # uploads
        with pytest.raises(InputError):
            read(data)
    for argv in (
        ["margin", "--map", str(path), "--rotor-mass", "4", "--bearing-number", "3"],
        ["export", str(path), "--out", str(tmp_path / "x.csv")],
        ["stiffness", "--bearing-number", "3", "--design", str(path)],
        [
            "predict",
            "--map",
            str(path),
            "--model",
            "tree",
            "--rotor-mass",
            "4",
            "--bearing-number",
            "3",
        ],
    ):
        assert main(argv) == 2
    assert not marker.exists()


@pytest.mark.parametrize("name", [*FIELDS, "bearing_number", "rotor_mass", "metadata"])
def test_no_array_of_a_map_is_unpickled(marker, tmp_path, name):
    """An otherwise good map with one array of objects."""
    piece = io.BytesIO()
    np.lib.format.write_array(piece, np.array([Bomb(marker)], object), allow_pickle=True)
    path = tmp_path / "map.npz"
    with (
        zipfile.ZipFile(io.BytesIO(map_bytes(load_reference_map()))) as good,
        zipfile.ZipFile(path, "w") as spoilt,
    ):
        for member in good.namelist():
            spoilt.writestr(
                member, piece.getvalue() if member == f"{name}.npy" else good.read(member)
            )
    with pytest.raises(InputError, match="neither numbers nor text"):
        load_map(path)
    assert not marker.exists()


@pytest.mark.parametrize("how", HOW)
def test_no_file_in_artifacts_is_unpickled_that_the_manifest_does_not_name(
    marker, tmp_path, how, monkeypatch
):
    monkeypatch.setenv("SPAB_CACHE", str(tmp_path / "cache"))
    folder, m = tmp_path / "artifacts", load_reference_map()
    folder.mkdir()
    write_manifest(folder)
    for name in (model_file(TREE, 8), "surrogate_maps.npz", "reference_map.npz"):
        (folder / name).write_bytes(dumped(marker, how))
        with pytest.raises(ArtifactError, match="is not named"):
            checked_bytes(name, folder)
    with pytest.raises(ArtifactError):
        load_shipped_map(m, TREE, 8, folder=folder)
    assert find_model(m, TREE, 8, folder=folder).origin == "trained"  # not the file there
    write_manifest(folder)  # named, but made from nothing that is known
    with pytest.raises(ArtifactError):
        load_shipped_map(m, TREE, 8, folder=folder)
    assert main(["verify", "--folder", str(folder)]) in (1, 2)
    assert not marker.exists()


@pytest.mark.parametrize("how", HOW)
def test_no_file_in_the_cache_is_unpickled_without_its_note(marker, tmp_path, how, monkeypatch):
    cache, m = tmp_path / "cache", load_reference_map()
    monkeypatch.setenv("SPAB_CACHE", str(cache))
    find_model(m, TREE, 8, seed=5, folder=None)
    kept = next(cache.glob("*.joblib"))
    good = kept.read_bytes()
    kept.write_bytes(dumped(marker, how))
    assert (
        find_model(m, TREE, 8, seed=5, folder=None).origin == "trained"
        and kept.read_bytes() == good
    )
    (cache / "other.joblib").write_bytes(dumped(marker, how))
    assert model_cache.read("other.joblib") is None
    assert not marker.exists()


@pytest.mark.parametrize("how", HOW)
def test_no_file_of_a_job_is_unpickled(marker, how):
    kind, request = "point", {"rotor_mass": 4.0, "bearing_number": 3.0}
    name, parameters = jobs._request(kind, request)
    folder = jobs.jobs_folder() / name
    folder.mkdir()
    state = {
        "kind": kind,
        "parameters": parameters,
        "state": "done",
        "done": 1,
        "total": 1,
        "kept": 0,
        "created": 1e9,
        "queued": 1e9,
        "started": 1e9,
        "finished": 1e9,
        "message": "",
        "pid": None,
    }
    jobs.write_state(folder, state)
    (folder / "result.npz").write_bytes(dumped(marker, how))
    with pytest.raises(InputError):
        load_point(jobs.find(name).result)
    (folder / "job.json").write_bytes(dumped(marker, how))
    with pytest.raises(InputError, match="damaged"):
        jobs.find(name)
    assert any(job.id == name and job.state == "failed" for job in jobs.list_jobs())
    jobs.delete(name)
    assert not marker.exists()


def test_nothing_else_in_the_sources_unpickles():
    """The one call of joblib.load stands behind the checks of model_files.py; workers.py reads the
    pipes between a server and the processes that it started itself, no file and no address; nothing
    else allows pickles, evaluates or executes.
    """
    found = []
    for path in sorted(
        [*(ROOT / "spab_core").rglob("*.py"), *(ROOT / "pages").glob("*.py"), ROOT / "app.py"]
    ):
        for line in path.read_text().splitlines():
            if any(
                word in line
                for word in (
                    "joblib.load(",
                    "pickle.load",
                    "allow_pickle=True",
                    "read_pickle",
                    " eval(",
                    " exec(",
                    "shell=True",
                    "os.system",
                    "yaml.load",
                    "np.load(",
                )
            ):
                found.append(f"{path.relative_to(ROOT)}: {line.strip()}")
    assert found == [
        "spab_core/common/workers.py: ok, answer = pickle.load(worker.stdout)",
        "spab_core/common/workers.py: pickle.loads(answer)  # some cannot be made again",
        "spab_core/common/workers.py: call = pickle.load(calls)",
        "spab_core/shipped/model_files.py: found = joblib.load(io.BytesIO(data))",
    ]


@pytest.mark.slow
def test_served_to_this_machine_alone(tmp_path):
    """The configuration says so, and so does the socket of ``spab dashboard``: no other address of
    this machine answers.
    """
    assert (
        tomllib.loads((ROOT / ".streamlit" / "config.toml").read_text())["server"]["address"]
        == "127.0.0.1"
    )
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        port = trial.getsockname()[1]
    with (tmp_path / "log").open("wb") as log:
        server = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "spab_core.cli.main",
                "dashboard",
                "--port",
                str(port),
                "--headless",
            ],
            cwd=tmp_path,
            stdout=log,
            stderr=log,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
        )
    try:
        until = time.monotonic() + 60
        while True:
            try:
                with urllib.request.urlopen(
                    f"http://127.0.0.1:{port}/_stcore/health", timeout=5
                ) as answer:
                    assert answer.status == 200
                break
            except OSError:
                assert time.monotonic() < until and server.poll() is None, (
                    tmp_path / "log"
                ).read_text()
                time.sleep(0.2)
        with socket.socket() as other:
            other.settimeout(5)
            with pytest.raises(OSError):
                other.connect(("127.0.0.2", port))
        assert "0.0.0.0" not in (tmp_path / "log").read_text()
    finally:
        server.terminate()
        server.wait(20)


def test_json_of_the_address_is_never_evaluated():
    for text in ("__import__('os').mkdir('x')", "${7*7}", "{{7*7}}"):
        with pytest.raises(InputError):
            read_design_bytes(json.dumps({"bearing": {"radius": text}}).encode())
