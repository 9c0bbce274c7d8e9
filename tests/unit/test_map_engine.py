"""The engine for maps: the same bits for any number of workers and on a cluster that loses a
worker; one run at a time.
"""

import os
import signal
import sys
import threading
import types

import filelock
import numpy as np
import pytest

from spab_core import Settings
from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.maps.checkpoints import Checkpoint, run_plan
from spab_core.maps.compute import compute_map
from spab_core.maps.stability_map import FIELDS, MapError

SHORT = Settings(mesh="3x16", transient=30, revolutions=30)
NUMBERS, MASSES = np.linspace(2.0, 4.0, 10), np.linspace(3.0, 9.0, 20)  # eight chunks


@pytest.fixture(scope="module")
def alone(design):
    return compute_map(design, NUMBERS, MASSES, SHORT)


def assert_same(a, b):
    for name in FIELDS:
        left, right = getattr(a, name), getattr(b, name)
        assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f"), name


@pytest.mark.slow
@pytest.mark.parametrize("workers", [2, 4])
def test_workers_do_not_change_a_bit(design, alone, workers):
    assert_same(alone, compute_map(design, NUMBERS, MASSES, SHORT, workers=workers))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_loses_a_worker_completes_with_the_same_bits(
    design, alone, tmp_path, monkeypatch
):
    """A real Dask cluster of two worker processes; one of them is killed when the first chunk is
    done.
    """
    # new processes would run this process's main module again, which an earlier AppTest replaced by
    # the page
    monkeypatch.setitem(sys.modules, "__main__", types.ModuleType("__main__"))
    distributed = pytest.importorskip(
        "distributed", reason="the extra spab-core[dask] is not installed"
    )
    killed = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:

        def kill_one(done):
            if done and not killed:
                with distributed.Client(cluster.scheduler_address) as client:
                    killed.append(next(iter(client.run(os.getpid).values())))
                os.kill(killed[0], signal.SIGKILL)

        found = compute_map(
            design,
            NUMBERS,
            MASSES,
            SHORT,
            cluster=cluster.scheduler_address,
            checkpoint=tmp_path / "parts",
            progress=kill_one,
        )
    assert killed
    assert_same(alone, found)
    assert found.metadata["workers"] == "dask"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_does_not_answer_is_a_sentence(capsys, tmp_path, monkeypatch):
    pytest.importorskip("distributed", reason="the extra spab-core[dask] is not installed")
    monkeypatch.setattr("spab_core.maps.parallel.CLUSTER_SECONDS", 1)
    for address in ("tcp://127.0.0.1:9", "nonsense", ""):
        code = main(
            [
                "map",
                "--bearing-number",
                "2:4:2",
                "--rotor-mass",
                "3:9:2",
                "--out",
                str(tmp_path / "m.npz"),
                "--dask",
                address,
            ]
        )
        error = capsys.readouterr().err
        assert code == 2 and "--dask" in error.splitlines()[-1] and "Traceback" not in error


def test_two_runs_do_not_share_their_parts(design, tmp_path):
    Checkpoint(tmp_path / "parts", run_plan(design, NUMBERS, MASSES, SHORT), {}).open()
    with (
        filelock.FileLock(tmp_path / "parts" / "lock"),
        pytest.raises(MapError, match="another run is at work"),
    ):
        compute_map(design, NUMBERS, MASSES, SHORT, checkpoint=tmp_path / "parts")


@pytest.mark.slow
def test_an_interrupted_run_goes_on_to_the_same_bits(design, alone, tmp_path):
    done = 0

    def interrupt(count):
        nonlocal done
        done += count
        if done >= 75:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        compute_map(
            design, NUMBERS, MASSES, SHORT, checkpoint=tmp_path / "parts", progress=interrupt
        )
    kept = len(list((tmp_path / "parts").glob("chunk-*.npz")))
    assert 3 <= kept < 8
    counts = []
    assert_same(
        alone,
        compute_map(
            design, NUMBERS, MASSES, SHORT, checkpoint=tmp_path / "parts", progress=counts.append
        ),
    )
    assert counts[0] == 25 * kept and sum(counts) == 200


def test_workers_with_another_solver_are_refused(design, monkeypatch):
    monkeypatch.setattr("spab_core.maps.compute.solver_hash", iter(["worker", "here"]).__next__)
    with pytest.raises(InputError, match="another version"):
        compute_map(design, NUMBERS[:1], MASSES[:1], SHORT)


def test_progress_never_runs_in_two_threads(design):
    threads = set()
    compute_map(
        design,
        NUMBERS[:2],
        MASSES[:15],
        SHORT,
        workers=2,
        progress=lambda n: threads.add(threading.get_ident()),
    )
    assert threads == {threading.get_ident()}
