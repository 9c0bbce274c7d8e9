"""Margins in kg and rpm, and how they move with the drawing."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.maps.sensitivity import (
    REACH,
    MachineMargin,
    is_stable,
    load_sensitivity,
    machine_margin,
    regime_intervals,
    save_sensitivity,
    sensitivity,
    variations,
)
from spab_core.trajectory.regimes import NO_EXPONENT
from spab_core.trajectory.settings import Settings

QUICK = Settings("2x16", transient=60, revolutions=40)


def test_the_border_found_is_one(design):
    margin = machine_margin(design, 4.52, design.speed_rpm(3.45), "speed", QUICK, scan=6)
    borders = [b for b in (margin.below, margin.above) if not np.isnan(b)]
    assert (
        borders
        and margin.low <= min(borders)
        and max(borders) <= margin.high == pytest.approx(REACH * margin.at)
    )
    for border, inward in zip((margin.below, margin.above), (1.02, 0.98), strict=True):
        if not np.isnan(border):
            assert is_stable(design, 4.52, border * inward, QUICK) == margin.stable
            assert is_stable(design, 4.52, border / inward, QUICK) != margin.stable
    assert abs(margin.distance) == pytest.approx(
        min(abs(b - margin.at) for b in borders) / margin.at
    )


def test_distance_tells_the_side_and_bounds_what_was_not_found():
    nan = float("nan")
    assert MachineMargin("mass", True, 10.0, 8.0, 11.0, 5.0, 20.0).distance == pytest.approx(0.1)
    assert MachineMargin("mass", False, 10.0, 8.0, nan, 5.0, 20.0).distance == pytest.approx(-0.2)
    assert MachineMargin("mass", True, 10.0, nan, nan, 5.0, 20.0).distance == pytest.approx(0.5)


def test_sensitivity_is_the_difference_of_margins(design, tmp_path):
    speed = design.speed_rpm(3.0)
    base, table = sensitivity(design, 8.0, speed, "mass", QUICK, step=0.2, scan=3)
    assert len(table) == len(variations(design, 0.2)) == 8
    row = table[(table["value"] == "clearance") & (table["factor"] == 0.8)].iloc[0]
    own = machine_margin(
        design.replace(bearing__clearance=0.8 * design.bearing.clearance),
        8.0,
        speed,
        "mass",
        QUICK,
        scan=3,
    )
    assert row["distance"] == own.distance and row["change"] == pytest.approx(
        own.distance - base.distance
    )
    save_sensitivity(base, table, tmp_path / "kept.json")
    again, rows = load_sensitivity(tmp_path / "kept.json")
    assert repr(again) == repr(base) and rows.equals(table)
    largest = table.groupby("value", sort=False)["change"].apply(lambda c: c.abs().max())
    assert list(largest) == sorted(largest, reverse=True)


def test_what_is_nought_or_infinite_is_left_out(design):
    rigid = design.replace(rotor__shaft_stiffness=float("inf"), rotor__unbalance_eccentricity=0.0)
    assert {name for name, _, _ in variations(rigid)} == {"clearance", "supply pressure"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"axis": "time"}, "axis = 'time' is not allowed: choose speed, mass"),
        ({"step": 2.0}, "step = 2 is out of range"),
        ({"speed_rpm": -1.0}, "speed = -1 rpm is out of range: allowed is from 29"),
        ({"rotor_mass": 0.0}, "rotor mass = 0 kg is out of range"),
    ],
)
def test_wrong_input_is_a_sentence(design, change, words):
    with pytest.raises(InputError, match=words):
        sensitivity(
            **{"design": design, "rotor_mass": 5.0, "speed_rpm": 9000.0, "settings": QUICK} | change
        )


@given(st.lists(st.sampled_from(["periodic", "quasi-periodic", "chaotic", ""]), max_size=30))
def test_intervals_cover_the_line_once(regimes):
    values = np.arange(len(regimes), dtype=float)
    found = regime_intervals(values, regimes)
    back = [
        ("" if row.regime == NO_EXPONENT else row.regime)
        for row in found.itertuples()
        for _ in range(row.points)
    ]
    assert back == regimes
    assert isinstance(found, pd.DataFrame) and all(
        a != b for a, b in zip(found["regime"], found["regime"][1:], strict=False)
    )
    assert all(row.stop - row.start == row.points - 1 for row in found.itertuples())
