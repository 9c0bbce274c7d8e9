"""Regimes, intervals and probabilities on maps whose borders and noise are known."""

import dataclasses
import io

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.linear_theory.linear_table import LinearFeatures, shipped_table
from spab_core.shipped.build import CLASSIFIER_SEEDS
from spab_core.shipped.manifest import (
    BLOCK_CLASSIFIERS,
    CLASSIFIERS,
    FLOORED_SCORES,
    SCORES,
    UNCERTAINTY,
    checked_bytes,
    load_reference_map,
    load_reference_scores,
)
from spab_core.shipped.predicted_maps import load_shipped_map
from spab_core.surrogates.classifier import (
    ASSESSMENT,
    LABELS,
    REGIME,
    predict_labels,
    regimes_by_threshold,
)
from spab_core.surrogates.metrics import (
    evaluate,
    label_scores,
    regime_scores,
    score_labels,
    uncertainty_scores,
)
from spab_core.surrogates.models import DIVISORS, FLOOR, floored, model, predict_map, solved_cells
from spab_core.surrogates.ranking import comparison_words
from spab_core.surrogates.theory_trees import baseline
from spab_core.surrogates.uncertainty import (
    STEPS,
    TooFewCells,
    load_intervals,
    reliability,
    save_intervals,
    uncertain_map,
)
from spab_core.trajectory.assessment import GRADES
from spab_core.trajectory.lyapunov import Exponent
from tests.maps import map_of, striped_map, with_hole


def test_the_classifier_finds_slanted_borders():
    m = with_hole(striped_map())
    found = predict_labels(m, REGIME, 4, seed=1)
    assert (
        found.label[3, 4] == ""
        and np.isnan(found.probability[3, 4]).all()
        and not found.held_out[3, 4]
    )
    assert np.array_equal(
        found.trained, predict_map(m, model("nearest"), 4, seed=1).trained
    )  # the same cells
    tested = found.held_out
    assert (
        not (tested & found.trained).any() and tested.sum() + found.trained.sum() == m.mle.size - 1
    )
    assert (found.label[tested] == m.regime[tested]).mean() > 0.97
    assert found.probability[tested].sum(axis=1) == pytest.approx(1.0)
    again = predict_labels(m, REGIME, 4, seed=1)
    assert np.array_equal(found.probability, again.probability, equal_nan=True)


def test_the_classifier_of_the_assessment_is_right_on_held_out_cells_and_rarely_too_kind():
    m = with_hole(striped_map())
    found, known = predict_labels(m, ASSESSMENT, 4, seed=1), np.isfinite(m.mle)
    scores = score_labels(m, ASSESSMENT, 4, 1)
    assert scores["accuracy"] > 0.97 and scores["unsafe_share"] < 0.05
    assert np.allclose(found.probability[known].sum(-1), 1.0)
    assert np.isin(found.label[known], GRADES).all() and not found.label[~known].any()
    assert np.array_equal(found.held_out, predict_labels(m, REGIME, 4, seed=1).held_out)


@given(st.lists(st.tuples(st.sampled_from(GRADES), st.sampled_from(GRADES)), max_size=30))
def test_scores_of_labels_by_hand(pairs):
    truth, said = (np.array([pair[k] for pair in pairs], "<U5") for k in (0, 1))
    found = label_scores(ASSESSMENT, truth, said)
    called = [t for t, s in pairs if s == "good"]
    assert (found["cells"], found["called_best"]) == (len(pairs), len(called))
    assert found["unsafe"] == sum(t != "good" for t in called)
    assert found["worst_called_best"] == called.count("avoid")
    recalls = {}
    for grade in GRADES:
        of = [s for t, s in pairs if t == grade]
        recalls[grade] = of.count(grade) / len(of) if of else np.nan
    expected = {
        "accuracy": sum(t == s for t, s in pairs) / len(pairs) if pairs else np.nan,
        "balanced_accuracy": np.nanmean([*recalls.values()]) if pairs else np.nan,
        "unsafe_share": found["unsafe"] / len(called) if called else np.nan,
    } | {f"recall_{grade}": value for grade, value in recalls.items()}
    assert {k: found[k] for k in expected} == pytest.approx(expected, nan_ok=True)


def test_shipped_scores_of_classifiers_are_those_of_the_shipped_map():
    """Each fraction and seed, the same regimes as those beside the intervals, and the scores that
    a training here gives, whatever ties another processor breaks.
    """
    m = load_reference_map()
    tables = {
        "random": load_reference_scores(name=CLASSIFIERS),
        "blocks": load_reference_scores(name=BLOCK_CLASSIFIERS),
    }
    intervals = pd.read_csv(io.BytesIO(checked_bytes(UNCERTAINTY)))
    rows = tables["random"].merge(intervals, on=["divisor", "seed"], suffixes=("", "_theory"))
    rows = rows[rows["model"] == "regime"]
    assert len(rows) == len(DIVISORS) * CLASSIFIER_SEEDS
    assert rows["accuracy"].to_numpy() == pytest.approx(rows["classifier_accuracy"].to_numpy())
    for split, scores in tables.items():
        assert len(scores) == 2 * len(rows)
        (row,) = scores[
            (scores["model"] == "assessment") & (scores["divisor"] == 8) & (scores["seed"] == 3)
        ].to_dict("records")
        found = score_labels(m, LABELS["assessment"], 8, 3, split)
        assert found["cells"] == row["cells"]
        assert found["accuracy"] == pytest.approx(row["accuracy"], abs=0.003)
        assert found["unsafe_share"] == pytest.approx(row["unsafe_share"], abs=0.03)


@pytest.mark.parametrize(
    "name, floor", [(SCORES, None), (FLOORED_SCORES, FLOOR)], ids=["solved", "floored"]
)
def test_no_accuracy_of_a_classifier_stands_under_a_model(name, floor):
    """That of the MLP is by its own exponents, which the shipped map has."""
    m = floored(load_reference_map(), floor)
    scores = load_reference_scores(name=name).set_index(["model", "divisor", "seed"])
    predicted = load_shipped_map(m, model("mlp"), 8)
    own = regimes_by_threshold(
        predicted.mle[predicted.held_out], m.mle[predicted.trained], m.regime[predicted.trained]
    )
    right = (own == m.regime[predicted.held_out]).mean()
    assert scores.loc[("mlp", 8, 0), "regime_accuracy"] == pytest.approx(right, abs=0.002)
    assert right < 0.8  # as no classifier's
    assert not [c for c in scores.columns if "classifier" in c or "assessment" in c]
    intervals = pd.read_csv(io.BytesIO(checked_bytes(UNCERTAINTY)))
    assert "regime_accuracy" not in intervals and "chaos_f1" not in intervals


def test_a_map_with_one_regime_only():
    m = map_of(lambda number, mass: -number)
    found = uncertain_map(m, model("tree"), 2)
    assert (found.regimes.label == "periodic").all() and (found.unstable == 0.0).all()
    scores = uncertainty_scores(m, found)
    assert (
        scores["classifier_accuracy"] == 1.0
        and np.isnan(scores["classifier_chaos_f1"])
        and np.isnan(scores["coverage_chaotic"])
    )


def test_thresholds_part_the_regimes():
    mle = np.array([-0.5, -0.4, -0.02, 0.0, 0.001, 0.2, 0.4])
    regime = np.array(["periodic"] * 2 + ["quasi-periodic"] * 3 + ["chaotic"] * 2)
    found = regimes_by_threshold(np.array([[-2.0, 0.0], [0.9, np.nan]]), mle, regime)
    assert found.tolist() == [["periodic", "quasi-periodic"], ["chaotic", ""]]


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=30))
def test_f1_by_hand(pairs):
    truth, told = np.array(pairs).T
    hits, said, there = sum(a and b for a, b in pairs), int(told.sum()), int(truth.sum())
    names = np.array(["periodic", "chaotic"])
    found = regime_scores(names[truth.astype(int)], names[told.astype(int)])["chaos_f1"]
    if not said + there:
        assert np.isnan(found)
    elif not hits:
        assert found == 0.0
    else:
        precision, recall = hits / said, hits / there
        assert found == pytest.approx(2.0 * precision * recall / (precision + recall))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["theory-trees", "forest"])
def test_intervals_cover_what_they_promise(name):
    """Nine in ten, also within each regime, though noise is a hundred times larger in chaos."""
    coverages, widths = [], []
    for seed in range(4):
        m = striped_map(seed=seed)
        if model(name).theory:  # on a map that linear theory knows something of
            _, inputs, mle = solved_cells(m)
            linear = baseline(LinearFeatures(shipped_table()).transform(inputs))
            m = dataclasses.replace(m, mle=(mle + linear).reshape(m.shape))
        found = uncertain_map(m, model(name), 2, seed)
        scores = uncertainty_scores(m, found)
        coverages.append(
            [scores["coverage"]]
            + [scores[f"coverage_{r}"] for r in ("periodic", "quasi-periodic", "chaotic")]
        )
        width = found.high - found.low
        widths.append([np.median(width[m.regime == r]) for r in ("periodic", "chaotic")])
        assert found.calibrated.calibration_cells == 250
    means = np.mean(coverages, axis=0)
    assert 0.87 < means[0] < 0.94 and means[1:].min() > 0.8
    narrow, wide = np.mean(widths, axis=0)
    # a normal deviate lies within 1.645 deviations nine times in ten; the model's own error widens
    # that
    assert narrow < 0.1 and 2 * 1.645 * 0.1 * 0.9 < wide < 2 * 1.645 * 0.1 * 1.7


@pytest.mark.slow
def test_probability_of_instability_is_calibrated():
    """Labels drawn with a known probability, from sure to sure: no forest tells a cell's, but what
    is told holds on average.
    """
    m = map_of(lambda number, mass: number, 60, 60)
    truth = (m.mle - 0.5) / 8.0
    unstable = np.random.default_rng(0).random(m.shape) < truth
    m = dataclasses.replace(
        m,
        regime=np.where(unstable, "quasi-periodic", "periodic").astype("<U14"),
        mle=np.where(unstable, 0.0, -0.2),
    )
    found = uncertain_map(m, model("tree"), 2)
    tested = found.regimes.held_out
    _, error = reliability(unstable[tested], found.unstable[tested])
    raw = 1.0 - found.calibrated.classifier.predict_proba(
        np.column_stack(
            [a.ravel() for a in np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")]
        )
    )[:, 0].reshape(m.shape)
    assert (
        error < 0.05 < reliability(unstable[tested], raw[tested])[1]
    )  # better than the trees' own


def test_reliability_by_hand():
    bins, error = reliability(
        np.array([False, True, True, True]), np.array([0.04, 0.06, 0.95, 1.0])
    )
    assert bins["cells"].tolist() == [2, 2] and bins["observed"].tolist() == [0.5, 1.0]
    assert bins["predicted"].tolist() == pytest.approx([0.05, 0.975])
    assert error == pytest.approx((2 * 0.45 + 2 * 0.025) / 4)


def test_too_few_cells_are_said():
    with pytest.raises(TooFewCells, match=r"31 training cells.*80"):
        uncertain_map(map_of(lambda number, mass: number), model("tree"), 8)


def test_blocks_withhold_whole_rectangles():
    m = with_hole(striped_map(40, 50))
    found = predict_map(m, model("nearest"), 4, 2, "blocks")
    assert (
        found.trained.sum() == (m.mle.size - 1) // 4 and not (found.trained & found.held_out).any()
    )
    blocks = found.held_out.reshape(10, 4, 10, 5).sum(axis=(1, 3))
    assert set(blocks.ravel().tolist()) <= {0, 19, 20} and (blocks > 0).sum() == 25
    assert np.array_equal(found.held_out, predict_labels(m, REGIME, 4, 2, "blocks").held_out)
    random = predict_map(m, model("nearest"), 4, 2)
    assert not np.array_equal(found.trained, random.trained)


def test_blocks_are_harder_for_neighbours():
    m = map_of(lambda number, mass: np.sin(number) + 0.1 * mass, 40, 50)
    random, blocks = (
        evaluate(m, [model("nearest")], (4,), (0, 1), split=split)["rmse_held_out"].mean()
        for split in ("random", "blocks")
    )
    assert blocks > 1.5 * random


def test_intervals_are_kept_in_a_file(tmp_path):
    m, path, steps = with_hole(striped_map()), tmp_path / "intervals.npz", []
    found = uncertain_map(m, model("tree"), 2, progress=steps.append)
    assert sum(steps) == STEPS
    save_intervals(found, path)
    again = load_intervals(path, m)
    assert np.allclose(again.low, found.low, equal_nan=True) and np.array_equal(
        again.regime, found.regime
    )
    assert uncertainty_scores(m, again) == pytest.approx(
        uncertainty_scores(m, found), abs=2e-3, nan_ok=True
    )
    with pytest.raises(InputError, match=r"low has the shape .* allowed is bearing_number"):
        load_intervals(path, striped_map(rows=41))
    for data in (b"", path.read_bytes()[:-200], b"PK\x03\x04"):
        path.write_bytes(data)
        with pytest.raises(InputError, match="cannot read the intervals"):
            load_intervals(path, m)


def test_a_prediction_beside_the_solved_value_in_words():
    solved = Exponent(-0.5, 0.001, np.array([-0.5]))
    assert comparison_words(-0.48, solved, (-0.55, -0.45), False) == (
        True,
        "Predicted -0.480, solved live -0.500 ± 0.001 per revolution: 0.020 apart. The solved "
        "value lies inside the "
        "model's 90% interval, -0.550 to -0.450.",
    )
    inside, words = comparison_words(-0.40, solved, (-0.45, -0.35), True)
    assert (
        inside is False
        and "outside" in words
        and "one cell in ten" in words
        and words.endswith("trained on this cell.")
    )
    assert comparison_words(-0.48, solved, None, False)[0] is None
    for predicted, exponent in ((np.nan, solved), (-0.48, None)):
        assert comparison_words(predicted, exponent, (-1.0, 0.0), False)[1].startswith(
            "There is nothing to compare"
        )
