"""Margins in kg and rpm, and how they move with the drawing."""

import numpy as np
import pytest

from spab_core.common.errors import InputError
from spab_core.maps.sensitivity import (
    REACH,
    MachineMargin,
    judge,
    load_sensitivity,
    machine_margin,
    save_sensitivity,
    sensitivity,
    variations,
)
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
            for value, avoided in ((border * inward, True), (border / inward, False)):
                assert (judge(design, 4.52, value, QUICK)[0] == "avoid") == avoided
    assert margin.is_avoided and margin.grade == "avoid" and margin.why == "contact"
    assert abs(margin.distance) == pytest.approx(
        min(abs(b - margin.at) for b in borders) / margin.at
    )


def test_distance_tells_the_side_and_bounds_what_was_not_found():
    nan = float("nan")

    def margin(grade, below, above, what="contact"):
        kinds = ("" if np.isnan(below) else what, "" if np.isnan(above) else what)
        return MachineMargin("mass", grade, "", 10.0, below, above, *kinds, 5.0, 20.0)

    assert margin("good", 8.0, 11.0).distance == pytest.approx(0.1)
    assert margin("watch", 8.0, 11.0).distance == pytest.approx(0.1)
    assert margin("avoid", 8.0, nan).distance == pytest.approx(-0.2)
    assert margin("good", nan, nan).distance == pytest.approx(0.5)
    assert margin("good", 8.0, 11.0).verdict() == (
        "Good at 10 kg; rubbing begins at 8 kg, going down; rubbing begins at 11 kg, going up, "
        "searched from 5 to 20 kg."
    )
    assert "rubbing ends at 8 kg" in margin("avoid", 8.0, nan).verdict()
    assert "nothing is to be avoided, searched" in margin("watch", nan, nan).verdict()


@pytest.mark.slow
def test_a_rubbing_machine_has_no_margin_that_regimes_would_give(design):
    """The machine of 4 kg at 20,000 rpm, on its resonance: to be avoided, though its motion repeats
    every revolution; a little slower it is not.
    """
    machine = design.replace(
        bearing__radius=0.04,
        bearing__clearance=25e-6,
        bearing__supply_pressure_ratio=7.01325 / 1.01325,
    )
    found = machine_margin(machine, 4.0, 20_000.0, "speed", scan=8)
    assert found.grade == "avoid" and found.why == "resonance" and found.distance < 0.0
    assert found.below_what == "resonance" and 17_000.0 < found.below < 20_000.0
    slow = machine_margin(machine, 4.0, 14_000.0, "speed", scan=8)
    assert slow.grade != "avoid" and slow.distance == pytest.approx(
        slow.above / 14_000.0 - 1.0, rel=1e-9
    )
    assert 17_000.0 < slow.above < 20_000.0


@pytest.mark.slow
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
