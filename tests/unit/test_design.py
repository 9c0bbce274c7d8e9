"""Designs: units, ranges, TOML round trip, dimensionless groups by hand."""

import dataclasses
import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import DesignError
from spab_core.design.model import (
    Design,
    design_remarks,
    design_toml,
    load_design,
    parse_design,
    read_design_bytes,
    reference_design,
    save_design,
)
from spab_core.design.presets import PRESETS
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
        ('[bearing]\nshape = "cube"', ["bearing.shape", "'cube'", "sphere, cylinder"]),
        ("[bearing]\nshape = 1", ["bearing.shape", "sphere, cylinder"]),
        ("[bearing]\nlength = 0.05", ["bearing.length", "belongs to a cylinder", "sphere"]),
        (
            '[bearing]\nshape = "cylinder"\nedge_latitude = 30',
            ["bearing.edge_latitude", "belongs to a sphere"],
        ),
        (
            '[bearing]\nshape = "cylinder"\nlength = 1',
            ["bearing.length = 1 m", "from 0.0012 to 0.48 m"],
        ),
        (
            "[rotor]\ntransverse_inertia = 0.1",
            ["rotor.span", "0 m", "rotor.transverse_inertia = 0.1"],
        ),
        (
            "[rotor]\nspan = 0.3\ntransverse_inertia = 0.1\npolar_inertia = 0.3",
            ["rotor.polar_inertia = 0.3", "at most twice", "0.2 kg m2"],
        ),
        (
            '[bearing]\nshape = "cylinder"\n[rotor]\nspan = 0.3\ntransverse_inertia = 0.1',
            ["rotor.transverse_inertia", "cylinder", "tilt", "not modelled"],
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


def test_a_cylinder_in_its_file():
    design = parse_design('[bearing]\nshape = "cylinder"\nlength = 0.05\nradius = 0.025')
    text = design_toml(design)
    assert 'shape = "cylinder"' in text and "edge_latitude" not in text
    assert parse_design(text) == Design.from_dict(design.to_dict()) == design
    assert "length =" not in design_toml(reference_design())
    with pytest.raises(DesignError, match=r"bearing\.edge_latitude belongs to a sphere"):
        design.replace(bearing__edge_latitude=40.0)
    ball = design.replace(bearing__shape="sphere", bearing__edge_latitude=40.0)
    assert ball.bearing.length == reference_design().bearing.length


def test_what_came_later_says_nothing_at_its_default():
    """A hash of a design from before cylinders is that of the same design now."""
    told = reference_design().told()
    assert set(told["bearing"]) == {
        "radius",
        "clearance",
        "edge_latitude",
        "permeability",
        "wall_thickness",
        "supply_pressure_ratio",
    }
    other = reference_design().replace(bearing__shape="cylinder", bearing__length=0.05).told()
    assert other["bearing"]["length"] == 0.05 and other["bearing"]["shape"] == "cylinder"


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


FULL = design_toml(reference_design())


def changed(key, value):
    """A full design file with one value as it is written there."""
    text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", FULL)
    assert count == 1
    return text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "it is empty"),
        ("# nothing\n\n", "it is empty"),
        ("[bearing]\n[gas]\n", "it is empty"),
        ("name = 'x'\n", "it is empty"),
        (changed("radius", "0,060"), "decimal sign is a point: 0.060"),
        (changed("radius", ".060"), "before the point: 0.060"),
        (changed("radius", "-.5e3"), "before the point: -0.5e3"),
        (changed("ambient_pressure", "101325."), "behind the point: 101325.0"),
        (changed("clearance", "25.e-6"), "behind the point: 25.0e-6"),
        (changed("clearance", "25d-6"), "the exponent begins with e: 25e-6"),
        (changed("clearance", "2.5D-05"), "the exponent begins with e: 2.5e-05"),
        (changed("clearance", "25 µm"), "the number stands alone"),
        (changed("clearance", "25um"), "the number stands alone"),
        (changed("edge_latitude", "30°"), "the number stands alone"),
        (changed("journal_mass_fraction", "30 %"), "the number stands alone"),
        (changed("gravity", "009.81"), "does not begin with 0: 9.81"),
        (changed("shaft_stiffness", "rigid"), "inf is a rigid shaft"),
        (changed("radius", "\u00a00.06"), "non-breaking"),
        (changed("radius", "0.06\nradius = 0.07"), "radius stands twice"),
        (changed("clearance", "'25 um'"), "write 2.5e-05, the number alone"),
        (changed("clearance", "'25 μm'"), "write 2.5e-05, the number alone"),
        (changed("clearance", "'25e-6'"), "write 25e-6, without quotes"),
        (changed("radius", "'60 mm'"), "write 0.06, the number alone"),
        (changed("ambient_pressure", "'0.1 MPa'"), "write 100000, the number alone"),
        (changed("ambient_pressure", "'1013,25 mbar'"), "write 101325, the number alone"),
        (changed("shaft_stiffness", "'rigid'"), "write inf, without quotes"),
        (changed("radius", "60"), "if that is in mm, write 0.06"),
        (changed("clearance", "35"), "if that is in µm, write 3.5e-05"),
        (changed("edge_latitude", "0.5236"), "if that is in radians, write 30"),
        (changed("ambient_pressure", "1.01325"), "if that is in bar, write 101325"),
        (changed("ambient_pressure", "101.325"), "if that is in kPa, write 101325"),
        (changed("journal_mass_fraction", "20"), "if that is in %, write 0.2"),
        (changed("viscosity", "0.0185"), "if that is in mPa s (cP), write 1.85e-05"),
        (changed("viscosity", "1.85"), "if that is in 10⁻⁵ Pa s, write 1.85e-05"),
        (changed("ambient_pressure", "760"), "if that is in mmHg (Torr), write 1.01e+05"),
        (changed("clearance", "1.0"), "if that is in mil (0.001 inch), write 2.54e-05"),
        (changed("wall_thickness", "0.45"), "if that is in cm, write 0.0045"),
        (changed("supply_pressure_ratio", "600"), "if that is in kPa, write 5.92"),
        (changed("supply_pressure_ratio", "7013"), "if that is in mbar, write 6.921"),
        (changed("roughness", "2.0"), "if that is in %, write 0.02"),
        (changed("porosity", "15"), "if that is in %, write 0.15"),
        (changed("ambient_pressure", "101'325"), "thousands are not separated: 101325"),
        (changed("ambient_pressure", "101 325"), "thousands are not separated: 101325"),
        (changed("ambient_pressure", "101,325.0"), "thousands are not separated: 101325.0"),
        (changed("clearance", "35×10^-6"), "powers of ten are written with e: 35e-6"),
        (changed("clearance", "35e\u22126"), "the minus sign is not that of a keyboard"),
        (changed("radius", "0.06;"), "nothing stands behind the number: 0.06"),
        (FULL.replace("radius =", "radius:"), "a value is given as key = value"),
        (f"// mine\n{FULL}", "a comment begins with #"),
        (f"{FULL}\n[bearing]\n", "the section stands twice"),
        (f"name = “x”\n{FULL}", "straight quotes"),
        (changed("viscosity", "18.5"), "if that is in µPa s, write 1.85e-05"),
        (changed("shaft_stiffness", "50"), "if that is in N/µm, write 5e+07"),
        (changed("unbalance_eccentricity", "1.7"), "if that is in µm, write 1.7e-06"),
        ('{"bearing": {"radius": 0.06}}', "it is JSON"),
        (FULL.replace("clearance", "clearence"), "is clearance meant?"),
        (FULL.replace("[bearing]", "[Bearing]"), "is bearing meant?"),
        (f"name = 3\n{FULL}", "name = '3' must be a text"),
        (f'name = "a\\nb"\n{FULL}', "a name in one line"),
    ],
)
def test_a_slip_in_a_file_is_refused_with_what_to_write(text, words):
    with pytest.raises(DesignError) as error:
        read_design_bytes(text.encode(), "my.toml")
    assert words in str(error.value) and "'my.toml'" in str(error.value)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("edge_latitude", 1.0472, "if that is in radians, write 60"),
        ("ambient_pressure", 1013.25, "if that is in mbar (hPa), write 101325"),
        ("supply_pressure_ratio", 0.6, "if that is in MPa over ambient, write 6.92"),
        ("supply_pressure_ratio", 60.0, "is unusual"),
        ("clearance", 8e-5, "if that is the diametral one, write 4e-05"),
        ("radius", 0.4, "is unusual (usual: 0.003 to 0.3 m)"),
        ("unbalance_eccentricity", 9e-4, "is unusual"),
    ],
)
def test_a_likely_slip_of_unit_is_doubted(key, value, words):
    (remark,) = design_remarks(changed(key, value))
    assert f".{key} = " in remark and words in remark
    assert read_design_bytes(changed(key, value).encode())


def test_a_design_file_that_windows_saved_as_unicode_is_read():
    for encoding in ("utf-8-sig", "utf-16"):
        assert read_design_bytes(FULL.encode(encoding)) == reference_design()


@pytest.mark.parametrize("name", PRESETS)
def test_nothing_is_doubted_in_the_presets(name):
    assert design_remarks(design_toml(PRESETS[name].design)) == []


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_a_preset_says_its_supply_as_the_absolute_pressure_it_has(preset):
    design = preset.design
    bar = 1e-5 * design.bearing.supply_pressure_ratio * design.gas.ambient_pressure
    told = re.findall(r"([\d.]+) bar( absolute)?", preset.text)
    assert all(
        absolute and float(value) == pytest.approx(bar, abs=0.05) for value, absolute in told
    )
    assert told or "fed with" not in preset.text


def test_what_a_file_leaves_out_is_told():
    (remark,) = design_remarks(b"\xef\xbb\xbf[bearing]\r\nradius = 0.05\r\nclearance = 3e-5\r\n")
    usual = reference_design().told()  # what came later and does nothing need not be told
    told = dict(re.findall(r"(\w+\.\w+) = ([-+.e\d]+)", remark))
    assert {k: float(v) for k, v in told.items()} == {
        f"{part}.{key}": pytest.approx(value, rel=1e-5)
        for part, values in usual.items()
        for key, value in values.items()
        if key not in ("radius", "clearance")
    }


def test_a_loaded_file_logs_its_remarks(tmp_path, caplog):
    (tmp_path / "part.toml").write_text("[bearing]\nedge_latitude = 1.0472\n")
    (tmp_path / "full.toml").write_text(FULL)
    load_design(tmp_path / "full.toml")
    assert not caplog.records
    load_design(tmp_path / "part.toml")
    assert ["of the reference design" in m or "radians" in m for m in caplog.messages] == [True] * 2


@given(st.text(max_size=40), st.text(max_size=80))
def test_a_name_and_notes_survive_the_file(name, notes):
    one_line = " ".join(name.split())
    d = dataclasses.replace(reference_design(), name=one_line, notes=notes.strip())
    found = read_design_bytes(design_toml(d).encode())
    assert found == d == reference_design() and (found.name, found.notes) == (d.name, d.notes)


def test_notes_may_be_a_section_and_change_no_number():
    d = parse_design(f'name = "spindle A"\n{FULL}\n[notes]\nauthor = "x"\nrevision = 3\n')
    assert (d.name, d.notes) == ("spindle A", "author: x\nrevision: 3")
    assert d.to_dict() == reference_design().to_dict() and hash(d) == hash(reference_design())
    assert d.replace(bearing__radius=0.05).name == "spindle A"
