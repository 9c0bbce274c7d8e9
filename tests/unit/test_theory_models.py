"""Regressors that start from linear theory, on exponents made from it."""

import numpy as np
import pytest

from spab_core.features import LinearFeatures, shipped_table
from spab_core.surrogates import model, train
from spab_core.theory_models import STRETCH, baseline, credible

NAMES = ("theory-trees", "theory-blend")


def plane(rows=24, columns=30):
    number, mass = np.meshgrid(np.geomspace(0.05, 8.5, rows), np.linspace(0.1, 25.0, columns), indexing="ij")
    inputs = np.column_stack([number.ravel(), mass.ravel()])
    return inputs, baseline(LinearFeatures(shipped_table()).transform(inputs))


def split(count, seed=0):
    chosen = np.zeros(count, bool)
    chosen[np.random.default_rng(seed).permutation(count)[:count // 3]] = True
    return chosen


@pytest.mark.parametrize("name", NAMES)
def test_where_linear_theory_is_right_nothing_is_left_to_learn(name):
    inputs, linear = plane()
    chosen = split(len(inputs))
    found = train(model(name), inputs[chosen], linear[chosen])
    assert found.predict(*inputs[~chosen].T) == pytest.approx(linear[~chosen], abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_what_linear_theory_leaves_is_learnt(name):
    """A jump across a line and a smooth part that linear theory does not know of."""
    inputs, linear = plane(40, 40)
    truth = linear + np.where(inputs[:, 1] > 12.0, 0.5, 0.0) + 0.05 * np.sin(inputs[:, 0])
    chosen = split(len(inputs))
    held_out = ~chosen
    found = train(model(name), inputs[chosen], truth[chosen]).predict(*inputs[held_out].T)
    error = np.sqrt(np.mean((found - truth[held_out])**2))
    without = np.sqrt(np.mean((linear - truth)[held_out]**2))
    assert error < 0.25 * without


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_cell_does_not_spoil_its_neighbours(name):
    inputs, linear = plane()
    wrong = int(np.argmin(linear))
    chosen = split(len(inputs))
    chosen[wrong] = True
    spoilt = linear.copy()
    spoilt[wrong] *= 0.3
    found = train(model(name), inputs[chosen], spoilt[chosen])
    assert found.predict(*inputs[~chosen].T) == pytest.approx(linear[~chosen], abs=1e-9)


def test_credible_judges_only_strongly_damped_cells():
    inputs, linear = plane()
    place = np.column_stack([STRETCH * np.log(inputs[:, 0]), inputs[:, 1] / 25.0])
    assert credible(place, 0.9 * linear, linear).all()  # wrong by the same everywhere: a matter for the trees
    damped, weak = int(np.argmin(linear)), int(np.argmax(linear))
    mle = linear.copy()
    mle[[damped, weak]] += 20.0
    assert np.flatnonzero(~credible(place, mle, linear)).tolist() == [damped]


def test_the_blend_follows_the_better_member():
    inputs, linear = plane(30, 30)
    truth = linear + np.sin(4.0 * inputs[:, 0]) * np.cos(inputs[:, 1])
    chosen = split(len(inputs), 2)
    blend = train(model("theory-blend"), inputs[chosen], truth[chosen]).estimator
    assert ((blend.trust_in_trees_ > 0.0) & (blend.trust_in_trees_ < 1.0)).all()
    _, features, place, base = blend._prepare(inputs[~chosen])
    number = inputs[~chosen, 0]
    errors = [np.mean((base + rest / number - truth[~chosen])**2) for rest in
              (blend.trees_.predict(features), blend.spline_(place))]
    errors.append(np.mean((blend.predict(inputs[~chosen]) - truth[~chosen])**2))
    assert errors[2] < max(errors[:2]) and errors[2] < 1.1 * min(errors[:2])
