"""The numbers that the theory wants small, written down anew; what is said where they are not."""

import math

import pytest

from spab_core.design.presets import preset
from spab_core.linear_theory.assumptions import assumptions, mean_free_path
from spab_core.linear_theory.summary import derive
from spab_core.solver.film import Mesh
from spab_core.trajectory.assessment import OUTSIDE, WATCH, rest_rules
from tests.conftest import quiet

NUMBER = 5.87
MESH = Mesh(4, 16)


def by_name(design, *more):
    return {one.name.split(",")[0]: one for one in assumptions(design, NUMBER, *more)}


def test_mean_free_path_of_air(design):
    """66 nm at 20 °C and 1.013 bar (66.4: Jennings, J. Aerosol Sci. 19, 1988, 159)."""
    assert mean_free_path(design) == pytest.approx(66.4e-9, rel=0.02)


def test_numbers_and_limits():
    d = preset("fed_spindle").design
    speed = NUMBER * 101325.0 / (6.0 * 1.85e-5) * (25e-6 / 0.04) ** 2
    found = by_name(d, 10e-6)
    expected = {
        "Knudsen number at the least film": (mean_free_path(d) / 10e-6, 0.01),
        "Reynolds number of the film": (
            6.0 * 1.204 * speed * 0.04 * 25e-6 / 1.85e-5,
            41.1 * math.sqrt(0.04 / 25e-6),
        ),
        "Mach number of the surface": (speed * 0.04 / 343.2, 0.5),
        "storage number of the wall": (
            0.15 * 1.85e-5 * speed * 4.5e-3**2 / (1.44e-15 * 101325.0),
            4e4,
        ),
        "wall thickness over radius": (4.5 / 40.0, 0.2),
        "clearance over radius": (25e-6 / 0.04, 0.01),
    }
    assert found.keys() == expected.keys()
    for name, (value, limit) in expected.items():
        assert found[name].value == pytest.approx(value, rel=1e-3)
        assert found[name].limit == pytest.approx(limit, rel=1e-9)
        assert found[name].holds == (value <= limit)


def test_each_limit_can_be_passed():
    d = preset("fed_spindle").design
    assert not by_name(d, 5e-6)["Knudsen number at the least film"].holds
    assert not by_name(d.replace(bearing__wall_thickness=9e-3))["wall thickness over radius"].holds
    wide = d.replace(bearing__clearance=500e-6)
    assert not by_name(wide)["clearance over radius"].holds
    assert not by_name(wide)["Reynolds number of the film"].holds
    assert not by_name(wide)["Mach number of the surface"].holds
    sealed = d.replace(bearing__permeability=0.0)
    assert not any("storage" in name for name in by_name(sealed))


def test_a_wall_without_porosity_is_told_and_watched_where_it_is_fed(design):
    fed, own = derive(quiet("fed_spindle"), 4.0, NUMBER, MESH), derive(design, 4.0, 3.0)
    for found in (fed, own):
        assert "at porosity 0 the gas that the wall stores is left out" in found.verdict()
    assert "pneumatic hammer" in fed.verdict() and "pneumatic hammer" not in own.verdict()
    watched = [
        [r for r in rest_rules(found) if r.kind == OUTSIDE and r.holds] for found in (fed, own)
    ]
    assert [len(rules) for rules in watched] == [1, 0] and watched[0][0].grade == WATCH
    assert "limit 1" in watched[0][0].words()


def test_what_is_told_of_a_wall_that_stores_gas():
    d = preset("fed_spindle").design
    found = derive(d, 4.0, NUMBER, MESH)
    record = found.record()
    assert record["sigma_wall"] == pytest.approx(d.sigma_wall(NUMBER))
    # 27 times the film's volume, at a mean pressure between the film's and the supply's
    pores = 0.15 * 4.5e-3 / 25e-6
    assert pores < record["pore_gas_over_film_gas"] < 6.0 * pores
    assert 0.1e-3 < record["penetration_depth_m"] < 1e-3
    assert record["whirl_growth_quasi_steady_per_revolution"] < 0.0
    assert record["whirl_growth_per_revolution"] > 0.0
    assert "unsafe side" in found.verdict() and "Unstable at rest" in found.verdict()
    assert all(row["holds"] for row in record["assumptions"])
    layered = derive(preset("fed_spindle_layered").design, 4.0, NUMBER, MESH)
    assert "Stable at rest" in layered.verdict() and "unsafe side" not in layered.verdict()
    assert layered.gas_flow.normal_litres == pytest.approx(found.gas_flow.normal_litres, rel=1e-4)
