"""A regressor that starts from linear theory, on exponents made from it."""

import numpy as np
import pytest

from spab_core.linear_theory.linear_table import LinearFeatures, shipped_table
from spab_core.surrogates.models import model, train
from spab_core.surrogates.theory_trees import baseline


def plane(rows=24, columns=30):
    number, mass = np.meshgrid(
        np.geomspace(0.05, 8.5, rows), np.linspace(0.1, 25.0, columns), indexing="ij"
    )
    inputs = np.column_stack([number.ravel(), mass.ravel()])
    return inputs, baseline(LinearFeatures(shipped_table()).transform(inputs))


def split(count, seed=0):
    chosen = np.zeros(count, bool)
    chosen[np.random.default_rng(seed).permutation(count)[: count // 3]] = True
    return chosen


def test_where_linear_theory_is_right_nothing_is_left_to_learn():
    inputs, linear = plane()
    chosen = split(len(inputs))
    found = train(model("theory-trees"), inputs[chosen], linear[chosen])
    assert found.predict(*inputs[~chosen].T) == pytest.approx(linear[~chosen], abs=1e-9)


def test_what_linear_theory_leaves_is_learnt():
    """A jump across a line and a smooth part that linear theory does not know of."""
    inputs, linear = plane(40, 40)
    truth = linear + np.where(inputs[:, 1] > 12.0, 0.5, 0.0) + 0.05 * np.sin(inputs[:, 0])
    chosen = split(len(inputs))
    held_out = ~chosen
    found = train(model("theory-trees"), inputs[chosen], truth[chosen]).predict(*inputs[held_out].T)
    error = np.sqrt(np.mean((found - truth[held_out]) ** 2))
    without = np.sqrt(np.mean((linear - truth)[held_out] ** 2))
    assert error < 0.25 * without
