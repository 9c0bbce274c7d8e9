"""Surrogates on maps whose exponent is a known function of the plane."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.surrogates.models import (
    MODELS,
    model,
    predict_map,
    solved_cells,
    train,
    training_mask,
)
from tests.maps import map_of, plane, with_hole


def test_the_papers_settings():
    paper = [k for k in MODELS.values() if k.group == "paper"]
    assert [k.name for k in paper] == ["mlp", "svr", "tree", "forest"]
    mlp, svr, tree, forest = (k.build(0) for k in paper)
    assert (mlp.hidden_layer_sizes, mlp.activation, mlp.solver, mlp.max_iter) == (
        (10,),
        "relu",
        "adam",
        500,
    )
    assert (svr.kernel, svr.C) == ("rbf", 1.0)
    assert tree.max_depth == forest.max_depth == 20 and forest.n_estimators == 100


@given(st.integers(16, 5000), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_training_cells_are_drawn_without_replacement(count, divisor, seed):
    if count < 8 * divisor:
        with pytest.raises(InputError, match=f"1/{divisor} of {count} cells"):
            training_mask(count, divisor, seed)
        return
    mask = training_mask(count, divisor, seed)
    assert mask.shape == (count,) and mask.sum() == count // divisor
    assert np.array_equal(mask, training_mask(count, divisor, seed))


def test_another_seed_draws_other_cells():
    assert not np.array_equal(training_mask(500, 4, 0), training_mask(500, 4, 1))


@pytest.mark.parametrize("name", ["linear", "cubic"])
def test_interpolation_is_exact_on_a_plane_inside_the_hull(name):
    m = map_of(plane)
    _, inputs, mle = solved_cells(m)
    corners = np.isin(inputs[:, 0], m.bearing_number[[0, -1]]) & np.isin(
        inputs[:, 1], m.rotor_mass[[0, -1]]
    )
    chosen = corners | training_mask(len(mle), 3, 1)
    found = train(model(name), inputs[chosen], mle[chosen])
    assert found.predict(inputs[:, 0], inputs[:, 1]) == pytest.approx(mle, abs=1e-6)
    outside = found.predict(np.array([0.1]), np.array([30.0]))  # the nearest corner's
    assert outside[0] == pytest.approx(plane(0.5, 25.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", list(MODELS))
def test_every_model_predicts_the_solved_cells_of_a_map(name):
    m = with_hole(map_of(lambda number, mass: np.sin(number) * mass / 25.0))
    found = predict_map(m, model(name), 2, seed=3)
    assert found.mle.shape == m.shape and np.isnan(found.mle[3, 4]) and not found.trained[3, 4]
    assert np.isfinite(np.delete(found.mle.ravel(), 3 * m.shape[1] + 4)).all()
    assert found.trained.sum() == (m.mle.size - 1) // 2 == found.surrogate.training_cells
    assert (found.surrogate.converged is None) == (name != "mlp")
    again = predict_map(m, model(name), 2, seed=3)
    assert np.array_equal(found.mle, again.mle, equal_nan=True)  # same seed, same bits
    number, mass = np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")
    by_points = found.surrogate.predict(number, mass)
    assert by_points[np.isfinite(found.mle)] == pytest.approx(
        found.mle[np.isfinite(found.mle)], abs=1e-12
    )


@pytest.mark.parametrize("name", ["nearest", "tree", "extra-trees", "linear", "cubic"])
def test_models_that_remember_return_their_training_cells(name):
    m = map_of(lambda number, mass: np.sin(3.0 * number) + np.cos(mass))
    found = predict_map(m, model(name), 2, seed=0)
    assert found.mle[found.trained] == pytest.approx(m.mle[found.trained], abs=1e-9)


def test_scaling_makes_units_irrelevant():
    """Inputs are scaled to [0, 1]: the same map in other units gives the same prediction."""
    m = map_of(lambda number, mass: np.sin(number) * mass / 25.0)
    in_small_units = dataclasses.replace(
        m, rotor_mass=1024.0 * m.rotor_mass
    )  # a power of two: no rounding, so the same bits
    for name in ("svr", "nearest", "linear"):
        a, b = (predict_map(k, model(name), 3, seed=2).mle for k in (m, in_small_units))
        assert np.array_equal(a, b)


def test_an_mlp_that_stops_at_its_limit_says_so():
    random = np.random.default_rng(0)
    inputs, noise = random.uniform(0.0, 1.0, (400, 2)), random.standard_normal(400)
    assert train(model("mlp"), inputs, inputs[:, 0]).converged
    kind = dataclasses.replace(
        model("mlp"), build=lambda seed: model("mlp").build(seed).set_params(max_iter=2)
    )
    assert train(kind, inputs, noise).converged is False


def test_errors_are_sentences():
    with pytest.raises(InputError, match="model = 'oracle'"):
        model("oracle")
    with pytest.raises(InputError, match="one line"):
        train(model("linear"), np.column_stack([np.arange(9.0), np.arange(9.0)]), np.arange(9.0))
