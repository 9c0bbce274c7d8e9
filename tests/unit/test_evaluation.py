"""Metrics against sums by hand, tables and ranking against scores that were made up."""

import math

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from spab_core.surrogates.metrics import evaluate, mae, rmse, score
from spab_core.surrogates.models import model
from spab_core.surrogates.ranking import is_tie, ranking, spread, suggestion, table
from tests.maps import map_of, with_hole

VALUES = arrays(float, 7, elements=st.integers(-(10**6), 10**6).map(lambda k: k / 1024.0))


@given(VALUES, VALUES)
def test_metrics_are_the_papers_sums(truth, predicted):
    squares = sum((a - b) ** 2 for a, b in zip(truth, predicted, strict=True))
    assert rmse(truth, predicted) == pytest.approx(math.sqrt(squares / 7))
    assert mae(truth, predicted) == pytest.approx(
        sum(abs(a - b) for a, b in zip(truth, predicted, strict=True)) / 7
    )
    assert mae(truth, predicted) <= rmse(truth, predicted) * (1.0 + 1e-12)


def test_held_out_error_of_the_nearest_sample_by_hand():
    m = with_hole(map_of(lambda number, mass: np.sin(2.0 * number) + 0.1 * mass))
    found = score(m, model("nearest"), 2, 5)
    count = m.mle.size - 1
    held_out = count - count // 2
    # training cells are returned exactly, so their squares add nothing
    assert found["rmse_all"] ** 2 * count == pytest.approx(found["rmse_held_out"] ** 2 * held_out)
    assert found["mae_all"] * count == pytest.approx(found["mae_held_out"] * held_out)
    assert found["rmse_held_out"] > 0.0 and found["converged"] is None


def made_up(rows):
    return pd.DataFrame(
        [
            {"model": n, "divisor": d, "seed": s, "rmse_held_out": r, "mae_held_out": 0.5 * r}
            for n, d, s, r in rows
        ]
    )


def test_table_has_the_papers_rows():
    scores = made_up([("forest", d, s, 1.0 * d + s) for d in (2, 4) for s in (0, 2)])
    found = table(scores, "rmse_held_out")["forest"]
    assert list(found.index) == ["n/2", "n/4", "Average", "Standard deviation", "Max - Min"]
    assert list(found) == pytest.approx(
        [3.0, 5.0, 4.0, math.sqrt(2.0), 2.0]
    )  # n - 1 in the deviation
    assert list(spread(scores, "rmse_held_out")["forest"]) == pytest.approx([math.sqrt(2.0)] * 2)


def test_ranking_calls_chance_a_tie():
    random = np.random.default_rng(3)
    noise = random.standard_normal((3, 10))
    rows = [
        (name, d, s, level + 0.01 * noise[k, s] + 0.1 * d)
        for k, (name, level) in enumerate((("tree", 0.30), ("forest", 0.3001), ("mlp", 0.90)))
        for d in (2, 4)
        for s in range(10)
    ]
    scores = made_up(rows)
    ranked = ranking(scores)
    assert set(ranked.index[:2]) == {"tree", "forest"} and ranked.index[2] == "mlp"
    assert list(ranked["tied"]) == [False, True, False]
    assert ranked.loc["mlp", "rank_rmse"] == 3 and list(ranked["rmse"]) == sorted(ranked["rmse"])
    text = suggestion(ranked)
    assert (
        "Decision tree" in text
        and "Random forest" in text
        and "chance" in text
        and "MLP" not in text
    )
    assert is_tie(
        scores[scores.seed == 0], "rmse_held_out", "tree", "mlp"
    )  # one seed proves nothing


@pytest.mark.slow
def test_scores_do_not_depend_on_workers():
    m = map_of(lambda number, mass: np.sin(number) * mass / 25.0)
    kinds, done = [model("tree"), model("linear")], []
    one = evaluate(m, kinds, (2, 8), (0, 1), progress=done.append)
    two = evaluate(m, kinds, (2, 8), (0, 1), workers=2)
    assert sum(done) == len(one) == 8
    columns = [c for c in one.columns if not c.endswith("seconds")]
    assert {"rmse_held_out", "regime_accuracy", "chaos_f1"} <= set(columns)
    pd.testing.assert_frame_equal(one[columns], two[columns], check_exact=True)
