"""Designs: units, ranges, TOML round trip, dimensionless groups by hand."""

import math

import pytest
from hypothesis import given

from spab_core.common.errors import DesignError
from spab_core.design.model import (
    Design,
    design_toml,
    load_design,
    parse_design,
    reference_design,
    save_design,
)
from spab_core.solver.film import parse_mesh
from tests.designs import designs


def test_reference_design_is_the_default_and_has_the_settled_values():
    d = reference_design()
    assert d == Design()
    assert d.feeding_number == pytest.approx(0.1612, abs=5e-5)
    assert d.speed(3.45) == pytest.approx(1070, abs=2)
    assert d.speed_rpm(8.5) == pytest.approx(25_200, rel=2e-3)


def test_groups_follow_their_definitions():
    d = reference_design()
    omega = d.speed(2.0)
    assert 6.0 * 1.85e-5 * omega / 101325.0 * (0.060 / 35e-6) ** 2 == pytest.approx(2.0)
    assert d.bearing_number(omega) == pytest.approx(2.0)
    assert d.mass_number(10.0, 2.0) == pytest.approx(10.0 * 35e-6 * omega**2 / (101325.0 * 0.06**2))
    assert d.load_number(10.0) == pytest.approx(98.1 / (101325.0 * 0.06**2))
    assert d.shaft_stiffness_number == pytest.approx(5e7 * 35e-6 / (101325.0 * 0.06**2))
    assert d.unbalance_number == pytest.approx(13 / 35)
    assert d.stiffness_unit == pytest.approx(101325.0 * 0.06**2 / 35e-6)


def test_mass_scales_as_clearance_to_the_fifth_over_radius_to_the_sixth():
    """At fixed Lambda and M (docs/model.md)."""
    a = reference_design()
    b = a.replace(bearing__clearance=20e-6, bearing__radius=0.03)
    heavier = a.mass_number(1.0, 3.0) / b.mass_number(
        1.0, 3.0
    )  # mass of b over mass of a at the same M
    assert heavier == pytest.approx((0.030 / 0.060) ** 6 / (20 / 35) ** 5)


@given(designs())
def test_toml_round_trip_is_exact(design):
    assert parse_design(design_toml(design)) == design


def test_file_round_trip_and_rigid_rotor(tmp_path):
    d = reference_design().replace(rotor__shaft_stiffness=math.inf)
    save_design(d, tmp_path / "my.toml")
    assert load_design(tmp_path / "my.toml") == d
    assert d.rigid and [p.name for p in tmp_path.iterdir()] == ["my.toml"]


@pytest.mark.parametrize(
    "text, words",
    [
        ("[bearing]\nradius = -1", ["bearing.radius", "-1", "0.001", "1 m"]),
        ("[bearing]\nradius = 'x'", ["bearing.radius", "number", "'x'"]),
        ("[bearing]\nradius = nan", ["bearing.radius", "nan"]),
        ("[bearing]\nclearance = inf", ["bearing.clearance", "inf"]),
        ("[rotor]\nshaft_stiffness = 0", ["rotor.shaft_stiffness", "from 1000", "or inf"]),
        ("[rotor]\nshaft_stiffness = -inf", ["rotor.shaft_stiffness", "-inf"]),
        ("[bearing]\nradius = true", ["bearing.radius", "True"]),
        ("[bearing]\nradius = 1" + "0" * 400, ["bearing.radius", "inf"]),
        ("[bearing]\nradios = 1", ["radios", "bearing", "radius"]),
        ("[baring]\nradius = 1", ["baring", "bearing"]),
        ("bearing = 3", ["[bearing]", "section"]),
        ("[bearing]\nradius = 0.001\nclearance = 0.0001", ["bearing.clearance", "twentieth"]),
        (
            "[bearing]\npermeability = 1e-11\nclearance = 3e-6",
            ["bearing.permeability", "1e-11 m2", "feeding", "at most 1e+06"],
        ),
        ("[bearing", ["TOML"]),
        ('["a\\nb"]\nc = 1', ["unknown section"]),
        ("[contact]\nroughness = 0.1", ["contact.roughness", "0.1", "centre"]),
    ],
)
def test_wrong_values_name_field_value_and_range(text, words):
    with pytest.raises(DesignError) as error:
        parse_design(text)
    for word in words:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"x" * 200_000, b"a = " + b"[" * 5000])
def test_unreadable_files_are_one_sentence(tmp_path, content):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(DesignError, match=r"bad\.toml"):
        load_design(path)
    with pytest.raises(DesignError, match="cannot read"):
        load_design(tmp_path / "missing.toml")


def test_replace_refuses_unknown_names():
    with pytest.raises(DesignError, match="bearing__width"):
        reference_design().replace(bearing__width=1.0)


@pytest.mark.parametrize(
    "text",
    ["8", "8x", "x8", "4x41", "8x32x2", "0x32", "8x7", "1000x1000", "-8x32", "", "８x32", "9" * 9],
)
def test_wrong_meshes_are_refused(text):
    with pytest.raises(DesignError, match="mesh"):
        parse_mesh(text)


def test_meshes_are_read():
    assert parse_mesh("12X48") == (12, 48)
