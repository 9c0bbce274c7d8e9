"""The margin against brute force on synthetic maps, its words, its edges; linear theory beside a
map.
"""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from spab_core.common.errors import InputError
from spab_core.design.model import reference_design
from spab_core.linear_theory.linear_table import MESH, shipped_table
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.maps.margin import against_linear, critical_masses, margin
from spab_core.maps.stability_map import MapError
from spab_core.shipped.manifest import load_reference_map
from tests.maps import KINDS, map_of_regimes

axes = some.lists(
    some.floats(0.05, 30.0), min_size=1, max_size=6, unique_by=lambda v: round(v, 3)
).map(sorted)


@some.composite
def maps_and_points(draw):
    numbers, masses = draw(axes), draw(axes)
    codes = [[draw(some.integers(0, len(KINDS) - 1)) for _ in masses] for _ in numbers]
    inside = [draw(some.floats(a[0], a[-1])) for a in (masses, numbers)]
    return map_of_regimes(numbers, masses, codes), *inside


def boxes(m):
    """(row, column, lowest and highest number, lowest and highest mass) of every cell."""

    def ends(axis, k):
        return (axis[k] + axis[max(k - 1, 0)]) / 2, (axis[k] + axis[min(k + 1, len(axis) - 1)]) / 2

    return [
        (i, j, *ends(m.bearing_number, i), *ends(m.rotor_mass, j))
        for i in range(m.shape[0])
        for j in range(m.shape[1])
    ]


@given(maps_and_points())
def test_margin_equals_brute_force(case):
    m, mass, number = case
    found = margin(m, mass, number)
    row, column = m.nearest(mass, number)
    for borders, kind in (
        (found.instability, m.regime == "periodic"),
        (found.chaos, m.regime == "chaotic"),
    ):
        others = [box for box in boxes(m) if kind[box[0], box[1]] != kind[row, column]]
        changes = [
            math.hypot(
                max(a - number, number - b, 0.0) / number, max(c - mass, mass - d, 0.0) / mass
            )
            for _, _, a, b, c, d in others
        ]
        assert (borders.both is None) == (not others)
        if others:
            assert borders.both.change == pytest.approx(min(changes), abs=1e-12)
        in_column = [(box[2], box[3], box[0]) for box in others if box[1] == column]
        in_row = [(box[4], box[5], box[1]) for box in others if box[0] == row]
        for name, cells, k, point in (
            ("number", in_column, row, number),
            ("mass", in_row, column, mass),
        ):
            below, above = [c[1] for c in cells if c[2] < k], [c[0] for c in cells if c[2] > k]
            for border, expected in (
                (getattr(borders, f"{name}_below"), max(below, default=None)),
                (getattr(borders, f"{name}_above"), min(above, default=None)),
            ):
                assert (border is None) == (expected is None)
                if border is not None:
                    assert border.value == pytest.approx(expected)
                    assert border.distance == pytest.approx(abs(expected - point), abs=1e-9)
                    # no change in both is larger than a change in one alone
                    assert borders.both.change <= border.distance / point + 1e-9
    assert all(
        "nan" not in text and "inf" not in text for text in (found.headline(), *found.sentences())
    )
    json.dumps(found.record(), allow_nan=False)


def test_words_of_a_stable_point():
    """Quasi-periodic up to 2 kg, periodic to 4, chaotic from 5; 3 kg: chaotic at the next speed."""
    m = map_of_regimes([3.4, 3.5], [1, 2, 3, 4, 5, 6], [[2, 2, 0, 0, 3, 3], [2, 2, 3, 0, 3, 3]])
    found = margin(m, 3.1, 3.4)
    assert found.stable and found.here == "periodic-1"
    assert found.instability.mass_below.value == 2.5 and found.instability.mass_above.value == 4.5
    assert found.instability.number_above.half == pytest.approx(0.05)
    rpm = m.design.speed_rpm
    assert found.headline() == (
        "Margin: the nearest motion that is not periodic is chaotic, at 3.1 kg and "
        f"{round(rpm(3.45), -1):,.0f} rpm (mass +0.0 %, speed +1.5 %)."
    )
    assert found.sentences() == [
        "At 10,090 rpm: 0.6 kg above the quasi-periodic band (up to 2.5 ± 0.5 kg); 1.4 kg below "
        "the chaotic band (from 4.5 ± 0.5 kg).",
        "At 3.1 kg: 100 rpm below the chaotic band (from 10,200 ± 100 rpm); no border down to "
        "10,085 rpm (edge of the map).",
        "Chaos is nearest at 3.1 kg and 10,230 rpm (mass +0.0 %, speed +1.5 %); at 10,090 rpm from "
        "4.5 ± 0.5 kg; at 3.1 kg from 10,200 ± 100 rpm.",
    ]


def test_words_of_an_unstable_point():
    m = map_of_regimes([3.0, 4.0], [1, 2, 3], [[4, 4, 0], [3, 3, 3]])
    found = margin(m, 1.0, 3.0)
    assert not found.stable and found.headline().startswith(
        "Not periodic here (touchdown): the nearest periodic motion is periodic-1"
    )
    assert found.sentences()[0].endswith(
        "1.5 kg below the periodic-1 band (from 2.5 ± 0.5 kg); no border down to 1 kg "
        "(edge of the map)."
    )


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (0, "Margin: no motion that is not periodic anywhere in the map."),
        (3, "Not periodic here (chaotic): no periodic motion anywhere in the map."),
    ],
)
def test_a_map_of_one_kind(code, words):
    found = margin(map_of_regimes([1.0, 2.0], [1.0, 2.0], np.full((2, 2), code)), 1.5, 1.5)
    assert found.headline() == words
    assert found.instability.both is None and "edge of the map" in found.sentences()[0]


@pytest.mark.parametrize(
    ("mass", "number", "words"),
    [
        (
            25.5,
            3.0,
            "rotor mass in this map = 25.5 kg is out of range: allowed is from 0.1 to 25 kg",
        ),
        (float("nan"), 3.0, "rotor mass"),
        (3.0, 9.0, "bearing number in this map = 9"),
    ],
)
def test_points_outside_the_map_are_refused(mass, number, words):
    with pytest.raises(InputError, match=words):
        margin(load_reference_map(), mass, number)


def test_a_map_with_axes_that_fall_is_refused():
    with pytest.raises(MapError, match="do not increase"):
        margin(map_of_regimes([2.0, 1.0], [1.0], [[0], [0]]), 1.0, 1.5)


@pytest.mark.slow
@pytest.mark.parametrize("number", [3.0, 3.4])
def test_the_table_knows_the_exact_linear_threshold(number):
    """Against the eigenvalues of the same system, bisected in the mass."""
    (about,) = critical_masses(shipped_table(), number)
    (exact,) = whirl_thresholds(
        reference_design(), number, MESH, (0.98 * about, 1.02 * about), scan=2
    )
    assert about == pytest.approx(exact.critical_mass, rel=5e-3) and exact.stable_side == "above"


def test_linear_theory_beside_a_map():
    """A light rotor at Lambda 4 is linearly unstable, a heavy one at Lambda 1 stable."""
    m = map_of_regimes([1.0, 4.0], [2.0, 20.0], [[0, 3], [0, 1]])
    found = against_linear(m, shipped_table())
    assert (found.calm.share, found.locked.share, found.driven.share) == (0.25, 0.25, 0.25)
    assert found.calm.numbers == (4.0, 4.0) and found.calm.masses == (2.0, 2.0)
    assert found.driven.numbers == (1.0, 1.0) and found.driven.masses == (20.0, 20.0)
    quiet = against_linear(
        dataclasses.replace(m, regime=np.full((2, 2), "periodic"), period=np.zeros((2, 2), int)),
        shipped_table(),
    )
    assert [s.endswith("no cell.") for s in quiet.sentences()] == [True] * 3
