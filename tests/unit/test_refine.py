"""Choosing cells: the same under a seed, never one twice, exactly the budget; killed runs; better
than chance.
"""

import dataclasses
import io
import os
import signal
import subprocess
import sys

import filelock
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core import Settings
from spab_core.active_learning.committee import (
    LABELS,
    POWERS,
    Prediction,
    exponent_scores,
    plane_inputs,
    predict_plane,
    scores,
)
from spab_core.active_learning.oracles import CHUNK, live_oracle, map_oracle
from spab_core.active_learning.refine import (
    EXPONENT_SHARE,
    MIN_START,
    choose_next,
    choose_start,
    last,
    load_refinement,
    refine,
    save_refinement,
)
from spab_core.common.errors import InputError
from spab_core.linear_theory.linear_table import shipped_table
from spab_core.maps.stability_map import FIELDS, OPTIONAL, MapError
from spab_core.shipped.manifest import load_reference_map, load_reference_refinement
from spab_core.surrogates.metrics import regime_scores
from spab_core.trajectory.point import solve_point
from tests.conftest import ROOT
from tests.maps import map_of

SHORT = Settings(mesh="6x24", transient=30, revolutions=30)
NUMBERS, MASSES = np.linspace(2.0, 4.0, 8), np.linspace(3.0, 9.0, 9)


def stepped():
    """A known map: steep at low bearing numbers, chaotic above a border."""
    return map_of(lambda number, mass: np.where(number * mass > 60.0, 0.3, -2.0 / number), 30, 30)


def prediction_of(rng, count):
    return Prediction(rng.normal(size=count), rng.random(count), rng.dirichlet(np.ones(4), count))


class Recording:
    """An oracle that remembers what it was asked."""

    def __init__(self, oracle):
        self.oracle, self.asked = oracle, []

    def __call__(self, cells):
        self.asked += cells.tolist()
        return self.oracle(cells)


def assert_same(a, b):
    assert np.array_equal(a.batch, b.batch) and np.array_equal(a.suggested, b.suggested)
    assert np.array_equal(a.regime, b.regime) and np.array_equal(a.unstable, b.unstable)
    for left, right in [
        (a.mle, b.mle),
        (a.deviation, b.deviation),
        *((a.values[k], b.values[k]) for k in FIELDS),
    ]:
        assert np.array_equal(left, right, equal_nan=left.dtype.kind == "f")


@given(st.integers(1, 12), st.integers(1, 12), st.data())
def test_a_batch_is_free_cells_exactly_as_many_and_the_same_under_a_seed(rows, columns, data):
    count, seed = rows * columns, data.draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
    free = rng.random(count) < data.draw(st.floats(0.1, 1.0))
    size = data.draw(st.integers(0, int(free.sum())))
    prediction = prediction_of(rng, count)
    cells, for_regime = choose_next(prediction, free, (rows, columns), size, seed, 3)
    assert len(cells) == len(set(cells.tolist())) == size == len(for_regime) and free[cells].all()
    assert (~for_regime).sum() == round(EXPONENT_SHARE * size)
    assert np.array_equal(cells, choose_next(prediction, free, (rows, columns), size, seed, 3)[0])


def test_another_seed_or_batch_draws_other_cells():
    prediction, free = prediction_of(np.random.default_rng(0), 400), np.ones(400, bool)
    draws = ((0, 1), (1, 1), (0, 2))
    first, *others = (
        set(choose_next(prediction, free, (20, 20), 20, seed, batch)[0].tolist())
        for seed, batch in draws
    )
    assert all(first != other for other in others)


def test_a_batch_has_no_neighbours_but_where_nothing_else_is_left():
    # all doubt is in one corner of 6 x 6 cells: a batch without the rule would be a clump there
    doubt = np.zeros((20, 20))
    doubt[:6, :6] = 1.0
    probability = np.column_stack(
        [1.0 - 0.5 * doubt.ravel(), 0.5 * doubt.ravel(), np.zeros(400), np.zeros(400)]
    )
    prediction, free = Prediction(np.zeros(400), doubt.ravel(), probability), np.ones(400, bool)
    cells, _ = choose_next(prediction, free, (20, 20), 12, 0, 1)
    row, column = np.divmod(cells, 20)
    apart = np.maximum(np.abs(row[:, None] - row), np.abs(column[:, None] - column))[
        np.triu_indices(12, 1)
    ]
    assert apart.min() >= 2 and ((row < 6) & (column < 6)).sum() >= 4
    assert len(choose_next(prediction, free, (20, 20), 400, 0, 1)[0]) == 400


def test_cells_are_drawn_where_the_doubt_is():
    """Nine tenths of the squared deviation in a tenth of the cells: at least about that share of
    the draws for the exponent.
    """
    count = 100 * 100
    deviation = np.full(count, 1.0)
    deviation[: count // 10] = 9.0  # 81 x 1000 against 9000
    certain = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    prediction = Prediction(np.zeros(count), deviation, certain)
    cells, for_regime = choose_next(prediction, np.ones(count, bool), (100, 100), 200, 0, 1)
    share = (cells[~for_regime] < count // 10).mean()
    assert 0.75 < share < 1.0
    assert (
        cells[for_regime] < count // 10
    ).mean() < 0.3  # the regime is certain everywhere: exploring evenly


@given(st.integers(1, 20), st.integers(1, 20), st.integers(0, 50), st.data())
def test_the_start_is_allowed_cells_exactly_as_many(rows, columns, seed, data):
    allowed = np.random.default_rng(seed).random(rows * columns) < data.draw(st.floats(0.2, 1.0))
    count = data.draw(st.integers(0, int(allowed.sum())))
    cells = choose_start((rows, columns), count, seed, allowed)
    assert len(set(cells.tolist())) == len(cells) == count and allowed[cells].all()


def test_the_start_fills_the_plane():
    cells = choose_start((40, 60), 64, 5, np.ones(2400, bool))
    row, column = np.unravel_index(cells, (40, 60))
    found = np.histogram2d(row, column, bins=(4, 4), range=((0, 40), (0, 60)))[0]
    assert found.min() >= 2 and found.max() <= 6  # sixteen boxes, four cells each on average


def test_the_budget_is_met_exactly_and_no_cell_is_asked_twice():
    m = stepped()
    withheld = np.zeros(m.shape, bool)
    withheld[::3] = True
    for budget in (16, 17, 100):
        oracle = Recording(map_oracle(m))
        result = last(refine(m.bearing_number, m.rotor_mass, oracle, budget, 4, allowed=~withheld))
        assert len(oracle.asked) == len(set(oracle.asked)) == budget == result.solved.sum()
        assert not result.solved[withheld].any() and not withheld.ravel()[result.suggested].any()
        assert not result.solved.ravel()[result.suggested].any()
        assert sorted(oracle.asked) == np.flatnonzero(result.solved).tolist()


def test_a_refinement_is_the_same_under_a_seed_and_solved_cells_are_kept():
    m = stepped()
    first, again, other = (
        last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 120, seed)) for seed in (1, 1, 2)
    )
    assert_same(first, again)
    assert not np.array_equal(first.batch, other.batch)
    solved = first.solved
    assert (
        np.array_equal(first.values["mle"][solved], m.mle[solved])
        and np.isnan(first.values["mle"][~solved]).all()
    )
    assert np.allclose(first.mle[solved], m.mle[solved], rtol=1e-5) and np.array_equal(
        first.regime[solved], m.regime[solved]
    )


def test_a_larger_budget_solves_the_same_cells_first():
    m = stepped()
    budgets = (64, 100)  # 64: whole batches
    small, large = (
        last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), budget, 1)) for budget in budgets
    )
    assert np.array_equal(small.solved, large.solved & (large.batch < small.metadata["batches"]))


def test_all_cells_solved_leave_nothing_to_suggest():
    m = map_of(lambda number, mass: 0.1 * number - 0.5, 5, 5)
    result = last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 25, metadata=m.metadata))
    assert result.solved.all() and len(result.suggested) == 0 and len(result.suggestions()) == 0


def failing(m, where):
    mle, regime, status = m.mle.copy(), m.regime.copy(), m.status.astype("<U16")
    mle[where], regime[where], status[where] = np.nan, "", "touchdown"
    return dataclasses.replace(m, mle=mle, regime=regime, status=status)


def test_cells_that_fail_count_are_not_asked_again_and_are_predicted_to_fail():
    m = stepped()
    m = failing(m, np.broadcast_to((m.rotor_mass > 20.0)[None], m.shape))
    oracle = Recording(map_oracle(m))
    result = last(refine(m.bearing_number, m.rotor_mass, oracle, 150, 0))
    assert len(oracle.asked) == len(set(oracle.asked)) == 150
    failed = result.solved & (m.regime == "")
    assert (
        failed.any()
        and (result.regime[failed] == "").all()
        and (result.unstable[failed] == 1.0).all()
    )
    held_out = ~result.solved
    assert (result.regime == m.regime)[held_out & (m.regime == "")].mean() > 0.8
    assert np.isfinite(result.mle).all()


def test_a_plane_where_every_run_fails():
    m = failing(stepped(), np.ones((30, 30), bool))
    result = last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 40, 0))
    assert result.solved.sum() == 40 and np.isnan(result.mle).all() and (result.regime == "").all()
    assert len(set(result.suggested.tolist())) == len(result.suggested) > 0


@pytest.mark.parametrize(
    "budget, seed, words",
    [
        (15, 0, ["budget", "15", "16"]),
        (901, 0, ["budget", "901", "900"]),
        (100.5, 0, ["budget", "whole number"]),
        (100, -1, ["seed", "-1"]),
        (float("nan"), 0, ["budget"]),
    ],
)
def test_wrong_input_is_said(budget, seed, words):
    m = stepped()
    with pytest.raises(InputError) as error:
        last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), budget, seed))
    assert all(word in str(error.value) for word in words)


def test_planes_out_of_range_are_said():
    m = stepped()
    with pytest.raises(InputError, match="9 cells"):
        last(refine(m.bearing_number[:3], m.rotor_mass[:3], map_oracle(m), 9))
    with pytest.raises(InputError, match="30 of 900 cells may be solved"):
        last(
            refine(
                m.bearing_number,
                m.rotor_mass,
                map_oracle(m),
                40,
                allowed=np.arange(900).reshape(30, 30) < 30,
            )
        )


def test_exponent_scores_by_hand():
    m = map_of(lambda number, mass: 0.0 * number, 4, 4)
    m = dataclasses.replace(failing(m, (1, 1)), bearing_number=np.array([0.05, 0.15, 1.0, 2.0]))
    predicted = np.zeros(16)
    predicted[[0, 5, 4]] = 4.0, 100.0, -2.0  # the second one fails in truth: not judged
    found = exponent_scores(m, predicted, np.ones(16, bool))
    assert found == pytest.approx(
        {"rmse": (20 / 15) ** 0.5, "rmse_undamped": (4 / 11) ** 0.5, "mae": 6 / 15}
    )
    assert np.isnan(list(exponent_scores(m, predicted, np.arange(16) == 5).values())).all()


def test_regime_scores_by_hand():
    truth = np.array(["chaotic", "chaotic", "periodic", "quasi-periodic", ""])
    said = np.array(["chaotic", "periodic", "chaotic", "quasi-periodic", ""])
    assert regime_scores(truth, said) == {"regime_accuracy": 0.6, "chaos_f1": 0.5}
    assert np.isnan(regime_scores(truth[2:4], said[3:4].repeat(2))["chaos_f1"])
    assert all(np.isnan(value) for value in regime_scores(truth[:0], said[:0]).values())


def test_the_committee_predicts_between_samples_and_doubts_far_from_them():
    m = map_of(lambda number, mass: -3.0 / number, 30, 30)
    inputs = plane_inputs(m.bearing_number, m.rotor_mass)
    solved = np.zeros(m.shape, bool)
    solved[::3, ::3] = True
    p = predict_plane(inputs, solved.ravel(), m.mle.ravel(), m.regime.ravel())
    assert inputs.features.shape == (900, 2 + len(POWERS)) and np.isfinite(inputs.features).all()
    assert np.allclose(
        p.mle, m.mle.ravel(), rtol=1e-5
    )  # MLE x bearing number is constant here: learnt exactly
    assert (
        p.deviation.max() < 1e-5
        and (p.regime == "periodic").all()
        and np.allclose(p.probability.sum(1), 1.0)
    )


def test_the_committee_starts_from_linear_theory():
    """An exponent that is linear theory's needs no learning: two cells of a damped plane give all
    the others.
    """
    number, mass = np.linspace(0.1, 1.0, 12), np.linspace(1.0, 20.0, 10)
    inputs = plane_inputs(number, mass, shipped_table())
    rate = shipped_table().at(np.repeat(number, 10), np.tile(mass, 12))[:, 0]
    assert inputs.features.shape == (120, 5 + len(POWERS)) and np.array_equal(
        inputs.baseline, np.minimum(rate, 0.0)
    )
    solved = np.isin(np.arange(120), (0, 119))
    found = predict_plane(inputs, solved, inputs.baseline, np.full(120, "periodic"))
    assert inputs.baseline.min() < -1.0 and np.allclose(found.mle, inputs.baseline, atol=1e-9)


@pytest.fixture(scope="module")
def shipped():
    """Every fourth bearing number and fifth rotor mass of the shipped map."""
    m = load_reference_map()
    cells = {name: getattr(m, name)[::4, ::5].copy() for name in FIELDS}
    return dataclasses.replace(
        m, bearing_number=m.bearing_number[::4], rotor_mass=m.rotor_mass[::5], **cells
    )


@pytest.mark.slow
def test_refining_beats_random_cells_of_the_shipped_map(shipped):
    m = shipped
    inputs = plane_inputs(m.bearing_number, m.rotor_mass)
    budget, found = m.mle.size // 8, {"refine": [], "random": []}
    for seed in range(4):
        withheld = (
            np.random.default_rng(99 + seed).random(m.mle.size) < 0.2
        )  # cells that neither may solve
        refined = last(
            refine(
                m.bearing_number,
                m.rotor_mass,
                map_oracle(m),
                budget,
                seed,
                allowed=~withheld.reshape(m.shape),
            )
        )
        found["refine"].append(scores(m, refined.mle, refined.regime, withheld))
        solved = np.zeros(m.mle.size, bool)
        solved[np.random.default_rng(seed).permutation(np.flatnonzero(~withheld))[:budget]] = True
        drawn = predict_plane(inputs, solved, m.mle.ravel(), m.regime.ravel(), seed)
        found["random"].append(scores(m, drawn.mle, drawn.regime, withheld))
    mean = {
        strategy: {k: np.mean([row[k] for row in rows]) for k in rows[0]}
        for strategy, rows in found.items()
    }
    assert mean["refine"]["rmse"] < 0.8 * mean["random"]["rmse"]
    assert mean["refine"]["chaos_f1"] > mean["random"]["chaos_f1"]
    assert mean["refine"]["accuracy"] > mean["random"]["accuracy"]


def test_the_shipped_refinement_is_of_the_shipped_map():
    m, refined = load_reference_map(), load_reference_refinement()
    solved = refined.solved
    assert np.array_equal(refined.bearing_number, m.bearing_number) and np.array_equal(
        refined.rotor_mass, m.rotor_mass
    )
    for k in FIELDS:
        a, b = refined.values[k][solved], getattr(m, k)[solved]
        assert np.array_equal(a, b, equal_nan=k in OPTIONAL), k
    assert (
        solved.sum() == m.mle.size // 16
        and 0.97 < (refined.regime == m.regime)[~solved].mean() < 1.0
    )


def test_save_and_load(tmp_path):
    m = stepped()
    result = last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 60, metadata=m.metadata))
    save_refinement(result, tmp_path / "r.npz")
    found = load_refinement(tmp_path / "r.npz")
    assert np.array_equal(found.batch, result.batch) and np.array_equal(found.regime, result.regime)
    assert (
        np.array_equal(found.mle, result.mle.astype(np.float32))
        and found.metadata == result.metadata
    )
    assert all(
        np.array_equal(
            found.values[k], result.values[k], equal_nan=result.values[k].dtype.kind == "f"
        )
        for k in FIELDS
    )
    table = found.suggestions()
    assert (
        table["bearing_number"].isin(m.bearing_number).all()
        and table["rotor_mass_kg"].isin(m.rotor_mass).all()
    )
    assert (
        set(table["in_doubt"]) == {"regime", "exponent"}
        and table["predicted_regime"].isin(LABELS).all()
    )
    with np.load(tmp_path / "r.npz") as data:
        assert np.array_equal(data["solved"], result.solved)


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.pop("batch"),
        lambda a: a.update(predicted_mle=a["predicted_mle"][1:]),
        lambda a: a.update(metadata="{}"),
        lambda a: a.update(suggested=a["suggested"] + 10_000),
        lambda a: a["predicted_regime"].__setitem__((0, 0), "weird"),
        lambda a: a.update(metadata="[1]"),
        lambda a: a.update(rotor_mass=a["rotor_mass"].astype(int)),
    ],
)
def test_files_that_are_no_refinement_are_refused(tmp_path, change):
    m = stepped()
    save_refinement(
        last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 16, metadata=m.metadata)),
        tmp_path / "r.npz",
    )
    with np.load(tmp_path / "r.npz") as data:
        arrays = dict(data)
    change(arrays)
    np.savez(tmp_path / "x.npz", **arrays)
    with pytest.raises(InputError):
        load_refinement(tmp_path / "x.npz")
    (tmp_path / "y.npz").write_bytes(b"PK\x03\x04 not a file")
    with pytest.raises(MapError, match="cannot read"):
        load_refinement(tmp_path / "y.npz")


PLAN = {"refine_seed": 3, "refine_start": MIN_START}


def solve_live(design, parts, budget=30, progress=None, workers=1, plan=PLAN, settings=SHORT):
    with live_oracle(
        design,
        NUMBERS,
        MASSES,
        settings,
        checkpoint=parts,
        plan=plan,
        workers=workers,
        progress=progress,
    ) as oracle:
        return last(refine(NUMBERS, MASSES, oracle, budget, 3))


@pytest.fixture(scope="module")
def alone(design, tmp_path_factory):
    return solve_live(design, tmp_path_factory.mktemp("alone") / "parts")


def test_live_cells_are_the_solvers(design, alone):
    assert alone.solved.sum() == 30 and set(alone.values["status"][alone.solved]) == {"ok"}
    row, column = np.argwhere(alone.batch == alone.batch.max())[0]
    point = solve_point(design, float(MASSES[column]), float(NUMBERS[row]), SHORT)
    assert (
        alone.values["mle"][row, column] == point.mle.value
        and alone.values["regime"][row, column] == point.regime.name
    )


_KILLED = """
import os, signal, sys
from pathlib import Path
from spab_core import reference_design
from tests.unit.test_refine import solve_live
done = 0
def progress(n):
    global done
    done += n
    if done >= int(sys.argv[2]):
        os.kill(os.getpid(), signal.SIGKILL)
solve_live(reference_design(), Path(sys.argv[1]), progress=progress)
"""


@pytest.mark.slow
@pytest.mark.parametrize("after", [CHUNK, 22])  # in the start, and in a later batch
def test_a_killed_run_goes_on_to_the_same_bits(design, alone, tmp_path, after):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    killed = subprocess.run(
        [sys.executable, "-c", _KILLED, str(tmp_path / "parts"), str(after)],
        env=environment,
        cwd=ROOT,
        timeout=300,
    )
    assert killed.returncode == -signal.SIGKILL
    kept = len(list((tmp_path / "parts").glob("chunk-*.npz")))
    assert kept
    solved_before = {p: p.stat().st_mtime_ns for p in (tmp_path / "parts").glob("chunk-*.npz")}
    counts = []
    assert_same(alone, solve_live(design, tmp_path / "parts", progress=counts.append))
    assert sum(counts) == 30 and counts[0] >= min(after, 16)
    assert all(p.stat().st_mtime_ns == before for p, before in solved_before.items())


@pytest.mark.slow
def test_workers_do_not_change_a_bit(design, alone, tmp_path):
    assert_same(alone, solve_live(design, tmp_path / "parts", workers=2))


def test_parts_of_another_run_are_refused(design, tmp_path):
    parts = tmp_path / "parts"
    solve_live(design, parts, budget=16)
    for kwargs, word in (
        ({"plan": PLAN | {"refine_seed": 4}}, "refine_seed"),
        ({"settings": dataclasses.replace(SHORT, revolutions=31)}, "settings"),
    ):
        with pytest.raises(MapError, match=f"different: {word}"):
            solve_live(design, parts, **kwargs)
    with pytest.raises(MapError, match="different: design"):
        solve_live(design.replace(rotor__gravity=9.0), parts)
    with filelock.FileLock(parts / "lock"), pytest.raises(MapError, match="another run is at work"):
        solve_live(design, parts)
    chunk = sorted(parts.glob("chunk-*.npz"))[0]
    whole = chunk.read_bytes()
    chunk.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(MapError, match="cannot read the finished chunk"):
        solve_live(design, parts)
    with np.load(io.BytesIO(whole)) as data:
        np.savez(chunk, **(dict(data) | {"run": "other"}))
    with pytest.raises(MapError, match="belongs to another run"):
        solve_live(design, parts)
