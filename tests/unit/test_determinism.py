"""The same version, seed and request give the same file to the bit, on one worker process or two,
from command or job.

What a file says of its making (date, seconds, number of workers) is left out, and nothing else.
"""

import json
import os
import time
import zipfile

import numpy as np
import pytest

from spab_core.cli.main import main
from spab_core.jobs.store import find, submit
from spab_core.trajectory.settings import Settings

TINY = {"mesh": "2x16", "transient": 30, "revolutions": 20}
OPTIONS = ["--mesh", "2x16", "--transient", "30", "--revolutions", "20"]
PLANE = ["--bearing-number", "2:4.5:6", "--rotor-mass", "3:18:6"]
LINE = ["--vary", "rotor-mass", "--at", "3", "--range", "4:12:12"]
MADE = ("date", "wall_seconds", "worker_seconds", "workers")  # of the metadata: how a file was made
COMMANDS = {
    "map": ["map", *PLANE, *OPTIONS],
    "refine": ["refine", *PLANE, *OPTIONS, "--budget", "30", "--seed", "3"],
    "design map": [
        "design",
        "map",
        "--bearing-number",
        "2:4:5",
        "--rotor-mass",
        "3:9:5",
        "--minutes",
        "60",
        "--seed",
        "3",
    ],
    "bifurcation": ["bifurcation", *LINE, *OPTIONS],
}


def contents(path):
    """Raw bytes of every array of an NPZ file by name; its metadata as a dictionary, without how it
    was made.
    """
    with zipfile.ZipFile(path) as file:
        found = {name: file.read(name) for name in file.namelist() if name != "metadata.npy"}
    with np.load(path, allow_pickle=False) as file:
        about = json.loads(str(file["metadata"]))
    return found | {"metadata": {k: v for k, v in about.items() if k not in MADE}}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_one_worker_or_two_the_same_file(name, tmp_path, capsys):
    files = []
    for workers in (1, 2):
        files.append(tmp_path / f"{len(files)}.npz")
        assert main([*COMMANDS[name], "--workers", str(workers), "--out", str(files[-1])]) == 0
    capsys.readouterr()
    one, two = map(contents, files)
    assert len(one) > 8 and two == one
    if name in ("refine", "design map"):
        assert main([*COMMANDS[name], "--seed", "4", "--out", str(tmp_path / "seed.npz")]) == 0
        assert contents(tmp_path / "seed.npz") != one  # or the comparison would see nothing


@pytest.mark.slow
def test_a_job_on_two_workers_makes_the_file_of_the_command_on_one(tmp_path, capsys):
    assert (
        main([*COMMANDS["bifurcation"], "--workers", "1", "--out", str(tmp_path / "line.npz")]) == 0
    )
    capsys.readouterr()
    job = submit(
        "bifurcation",
        {
            "vary": "rotor-mass",
            "at": 3.0,
            "range": "4:12:12",
            "settings": Settings(**TINY).to_dict(),
        },
    )
    end = time.monotonic() + 90
    while job.active:
        assert time.monotonic() < end
        time.sleep(0.1)
        job = find(job.id)
    assert job.state == "done", job.message
    assert min(os.cpu_count() or 1, 2) == 1 or job.total == 36  # more than 20 points: two workers
    assert contents(job.result) == contents(tmp_path / "line.npz")
