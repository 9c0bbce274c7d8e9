"""Which map of a design is shown at a point: its own where the point lies in it, else the one that
comes with spab.
"""

from types import SimpleNamespace

import pytest

from spab_core.shipped.preset_maps import MAPS
from spab_core.ui import own_map


@pytest.fixture
def two_maps(monkeypatch):
    """A design with a shipped map, and another shipped map as if it were its own."""
    by_mass = sorted(map(own_map.shown_example, MAPS), key=lambda x: x.found[1].rotor_mass[-1])
    shipped, other = by_mass[0], by_mass[-1]
    design = next(one.design for one in MAPS if one.file == shipped.id)
    job = SimpleNamespace(parameters={"design": design.to_dict()})
    monkeypatch.setattr(own_map, "finished_maps", lambda: [job])
    monkeypatch.setattr(own_map, "shown_job", lambda job: other)
    return design, shipped, other


def test_an_own_map_gives_way_where_only_the_shipped_one_holds_the_point(two_maps):
    design, shipped, other = two_maps
    (small, small_number), (large, large_number) = (
        (x.found[1].rotor_mass, x.found[1].bearing_number) for x in (shipped, other)
    )
    assert small[0] < large[0] and small[-1] < large[-1]
    assert own_map.map_of(design, large[-1], large_number[-1]).id == other.id
    assert own_map.map_of(design, small[0], small_number[0]).id == shipped.id
    # in neither: what the user has computed
    assert own_map.map_of(design, 10.0 * large[-1], large_number[-1]).id == other.id


def test_a_cell_is_judged_with_its_equilibrium_too():
    """Good by its motion; but of a fed bearing whose pores are taken to store no gas."""
    name = next(one for one in MAPS if "quasi_steady" in one.file)
    found = own_map.shown_example(name).found
    m = found[1]
    row, column = (int(k[0]) for k in (m.grades() == "good").nonzero())
    judged = own_map.cell_assessment(found, (row, column))
    assert judged.grade == "watch" and "outside the theory" in judged.kinds
