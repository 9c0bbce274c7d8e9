"""The learning curve: what it compares, its file, and the verdict on the goal."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from spab_core.active_learning.learning_curve import (
    COLUMNS,
    COMMITTEE,
    DIVISORS,
    WITHHELD_DIVISORS,
    goal,
    learning_curve,
    load_learning_curve,
    summary,
)
from spab_core.common.errors import InputError
from spab_core.maps.stability_map import FIELDS
from spab_core.plotting.surrogates import learning_curve_figure
from spab_core.shipped.manifest import load_reference_map
from tests.maps import made_up_curve, map_of


@pytest.fixture(scope="module")
def rows():
    m = load_reference_map()
    cells = {name: getattr(m, name)[::2, ::5].copy() for name in FIELDS}
    m = dataclasses.replace(
        m, bearing_number=m.bearing_number[::2], rotor_mass=m.rotor_mass[::5], **cells
    )
    return learning_curve(m, (0,), ("tree",))


@pytest.mark.slow
def test_both_strategies_at_the_same_numbers_of_cells(rows):
    assert tuple(rows.columns) == COLUMNS and np.isfinite(
        rows[["rmse", "rmse_undamped", "mae", "chaos_f1"]]
    ).all(axis=None)
    for judged, divisors in (("unsolved", DIVISORS), ("withheld", WITHHELD_DIVISORS)):
        found = rows[(rows["judged"] == judged) & (rows["model"] == COMMITTEE)]
        solved = {
            s: found[found["strategy"] == s].set_index("divisor")["solved"]
            for s in ("refine", "random")
        }
        assert (
            tuple(solved["refine"].index) == divisors and tuple(solved["random"].index) == DIVISORS
        )
        assert (solved["refine"] == solved["random"][list(divisors)]).all()
    tree = rows[rows["model"] == "tree"]
    assert set(tree["divisor"]) == {4} and len(tree) == 2 and tree["accuracy"].isna().all()


@pytest.mark.slow
def test_file_and_figure(rows, tmp_path):
    rows.to_csv(tmp_path / "c.csv", index=False)
    found = load_learning_curve(tmp_path / "c.csv")
    pd.testing.assert_frame_equal(found, rows, check_dtype=False)
    for judged in ("unsolved", "withheld"):
        figure = learning_curve_figure(found, judged)
        names = [t.name for t in figure.data]
        assert names.count("chosen by spab refine") == names.count("drawn at random") == 2
        chosen = next(t for t in figure.data if t.name == "chosen by spab refine")
        expected = summary(rows, judged).loc[("refine", COMMITTEE)]["rmse"]["mean"]
        assert np.allclose(chosen.y, expected)


def test_the_goal_by_hand():
    found = goal(made_up_curve((0.2, 0.95), (0.3, 0.94), (0.1, 0.96)))
    assert found.loc["rmse", "refined"] == pytest.approx(0.25) and found.loc[
        "rmse", "best"
    ] == pytest.approx(0.15)
    assert (
        found["met"].all() and not found["met_best"].any() and set(found["best_model"]) == {"tree"}
    )
    found = goal(made_up_curve((0.4, 0.95), (0.3, 0.96), (0.5, 0.90)))
    assert (
        not found["met"].any()
        and not found["met_best"].any()
        and set(found["best_model"]) == {COMMITTEE}
    )


def test_what_cannot_be_read_or_is_too_small_is_said(tmp_path):
    (tmp_path / "c.csv").write_text("a,b\n1,2\n")
    for name in ("c.csv", "missing.csv"):
        with pytest.raises(InputError, match="learning curve"):
            load_learning_curve(tmp_path / name)
    with pytest.raises(InputError, match="252 cells is too small"):
        learning_curve(map_of(lambda number, mass: 0.2 * number - 0.05 * mass))
