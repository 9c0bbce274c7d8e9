"""The checkpoint under every long run: what was saved comes back, what does not fit is refused."""

import numpy as np
import pytest

from spab_core.maps.checkpoints import Checkpoint, remove_checkpoint
from spab_core.maps.stability_map import MapError, unsolved

PLAN = {"seed": 1}
CHUNK = {"mle": np.array([0.5, np.nan]), "regime": np.array(["chaotic", ""])}


def checkpoint(folder, plan=PLAN):
    values = {name: unsolved(dtype, 4) for name, dtype in (("mle", float), ("regime", "<U14"))}
    return Checkpoint(folder, plan, values)


@pytest.fixture
def saved(tmp_path):
    with checkpoint(tmp_path / "run").resume() as run:
        run.save("up-000000", np.array([2, 0]), CHUNK, state=np.array([1.0, 2.0]))
    return tmp_path / "run"


def test_what_was_saved_comes_back(saved):
    with checkpoint(saved).resume() as run:
        assert run.missing(np.array([3, 2, 1, 0])).tolist() == [3, 1]
        assert np.array_equal(run.values["mle"], [np.nan, np.nan, 0.5, np.nan], equal_nan=True)
        assert run.values["regime"].tolist() == ["", "", "chaotic", ""]
        assert run.states["up-000000"].tolist() == [1.0, 2.0]
    remove_checkpoint(saved)
    assert not saved.exists()


def test_another_plan_and_a_second_run_are_refused(saved):
    with pytest.raises(MapError, match="different: more, seed"):
        checkpoint(saved, {"seed": 2, "more": 0}).open()
    with (
        checkpoint(saved).resume(),
        pytest.raises(MapError, match="another run is at work"),
        checkpoint(saved).resume(),
    ):
        pass
    with checkpoint(saved).resume():  # the lock is given back
        pass


@pytest.mark.parametrize(
    "change",
    [
        {"run": np.array("other")},
        {"cells": np.array([2, 4])},
        {"cells": np.array([2, -1])},
        {"cells": np.array([2.0, 0.0])},
        {"cells": np.array([2, 0, 1])},
        {"mle": np.array(["0.5", "0.1"])},
        {"mle": np.zeros((2, 1))},
        {"state": np.array(["a"])},
    ],
)
def test_chunks_that_do_not_fit_are_refused(saved, change):
    path = saved / "chunk-up-000000.npz"
    with np.load(path) as data:
        arrays = dict(data)
    np.savez(path, **arrays)
    with checkpoint(saved).resume():  # written again as it was, it fits
        pass
    np.savez(path, **(arrays | change))
    with (
        pytest.raises(
            MapError, match=r"cannot read the finished chunk .*000000\.npz': .*; delete it"
        ),
        checkpoint(saved).resume(),
    ):
        pass


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with checkpoint(None).resume() as run:
        run.save("000000", np.array([1, 3]), CHUNK)
        assert run.missing(np.arange(4)).tolist() == [0, 2]
    assert not list(tmp_path.iterdir())
