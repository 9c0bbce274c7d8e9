"""The form of a design: units, an exact way there and back, refusals in the form's own words;
presets; balance grades.
"""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import DesignError, InputError
from spab_core.design.form import (
    FIELDS,
    GROUPS,
    bearing_number_of,
    contact_words,
    eccentricity_of_grade,
    from_form,
    grade_of_eccentricity,
    to_form,
    unused,
)
from spab_core.design.limits import BEARING_NUMBER_RANGE
from spab_core.design.model import (
    Design,
    design_toml,
    load_design,
    read_design_bytes,
    reference_design,
)
from spab_core.design.presets import PRESETS, preset
from spab_core.linear_theory.equilibrium import static_equilibrium
from tests.designs import designs


def test_every_design_value_is_in_the_form_once():
    assert list(FIELDS) == [
        f"{g.lower()}__{f.name}" for g, cls in GROUPS.items() for f in dataclasses.fields(cls)
    ]
    assert len({f.title for f in FIELDS.values()}) == len(FIELDS)


def test_the_reference_design_reads_as_on_its_drawing():
    shown = to_form(reference_design())
    expected = {
        "bearing__radius": 60.0,
        "bearing__clearance": 35.0,
        "bearing__edge_latitude": 30.0,
        "bearing__permeability": 1.44,
        "bearing__wall_thickness": 4.5,
        "bearing__supply_pressure_ratio": 1.01325,
        "bearing__shape": "sphere",
        "gas__viscosity": 18.5,
        "gas__ambient_pressure": 1.01325,
    }
    assert {name: shown[name] for name in expected} == expected
    assert (
        shown["rotor__shaft_stiffness"] == 50.0 and shown["rotor__unbalance_eccentricity"] == 13.0
    )


def test_the_supply_is_explained_as_the_pressure_that_is_typed():
    field = FIELDS["bearing__supply_pressure_ratio"]
    assert field.unit == "bar" and "over vacuum" in field.help and "ratio" not in field.help
    assert field.help.endswith("From 0.1 to 100 times the ambient pressure.")


def test_the_contact_law_is_told_in_newton_and_micrometres():
    # p_a R² = 101325 Pa (60 mm)² = 364.8 N, C = 35 µm
    assert contact_words(reference_design()) == (
        "In this bearing f₀ = 36,477 N (p_a R² = 364.8 N), s = 0.7 µm (C = 35 µm)"
    )


@given(designs())
def test_from_si_to_the_form_and_back_nothing_changes(design):
    assert from_form(to_form(design), design) == design


@st.composite
def typed(draw):
    """A number as a person types it: up to 12 digits, inside the range of a field."""
    name = draw(
        st.sampled_from(
            [
                n
                for n in FIELDS
                if not FIELDS[n].choices
                and n not in ("bearing__radius", "contact__roughness", "contact__force_at_closure")
                and n != "rotor__transverse_inertia"
                and n not in unused(reference_design())
            ]
        )
    )
    field = FIELDS[name]
    ambient = 1.01325 if field.over_ambient else 1.0
    low, high = field.low * ambient, field.high * ambient
    digits = draw(st.integers(1, 12))
    value = float(f"{draw(st.floats(low, high, exclude_min=field.open_low)):.{digits}g}")
    value = (
        value if value > 1e-250 else 0.0
    )  # below lie numbers that a double in SI units cannot hold
    return name, min(max(value, low), high) or high


@given(typed())
def test_from_the_form_to_si_and_back_every_digit_stays(pair):
    name, value = pair
    base = Design()
    if "layer" in name:  # nothing without the other
        value = min(max(value, 1e-9), FIELDS[name].high / 5.0)
        layer = {"bearing__layer_thickness": 1e-4, "bearing__layer_permeability": 1e-17}
        base = base.replace(**layer)
    assert to_form(from_form({name: value}, base))[name] == value


@pytest.mark.parametrize(
    "name, shown, si",
    [
        ("bearing__clearance", 35.0, 35e-6),
        ("bearing__radius", 60.3, 60.3e-3),
        ("gas__viscosity", 18.1, 18.1e-6),
        ("gas__ambient_pressure", 0.7, 0.7e5),
        ("rotor__shaft_stiffness", math.inf, math.inf),
        ("rotor__journal_mass_fraction", 30.0, 0.3),
        ("bearing__supply_pressure_ratio", 4.053, 4.0),
    ],
)
def test_factors(name, shown, si):
    section, key = name.split("__")
    assert getattr(getattr(from_form({name: shown}), section), key) == pytest.approx(si, rel=1e-15)


def test_a_supply_pressure_keeps_its_bars_when_the_ambient_changes():
    """5 bar at 0.7 bar ambient are a ratio of 50/7, typed together or one after the other."""
    together = from_form({"gas__ambient_pressure": 0.7, "bearing__supply_pressure_ratio": 5.0})
    assert together.bearing.supply_pressure_ratio == pytest.approx(50.0 / 7.0, rel=1e-15)
    first = from_form({"bearing__supply_pressure_ratio": 5.0})
    then = from_form(to_form(first) | {"gas__ambient_pressure": 0.7}, first)
    assert then == together


@pytest.mark.parametrize(
    "name, value, words",
    [
        ("bearing__clearance", 0.01, ["Radial clearance C", "0.01 µm", "1 to 1000 µm"]),
        ("bearing__radius", "x", ["Radius R", "mm", "'x'"]),
        ("bearing__supply_pressure_ratio", 1000.0, ["Supply pressure", "1000 bar", "101.325 bar"]),
        (
            "rotor__shaft_stiffness",
            0.0,
            ["Shaft stiffness K_s", "from 0.001 to 1e+06 N/µm", "or inf"],
        ),
        ("gas__viscosity", math.nan, ["Viscosity", "nan"]),
        ("bearing__width", 1.0, ["bearing__width"]),
    ],
)
def test_wrong_values_are_told_in_the_units_of_the_form(name, value, words):
    with pytest.raises(DesignError) as error:
        from_form({name: value})
    assert all(word in str(error.value) for word in words)


def test_values_that_do_not_fit_together_are_told():
    with pytest.raises(DesignError, match="twentieth"):
        from_form({"bearing__radius": 10.0, "bearing__clearance": 600.0})
    with pytest.raises(
        DesignError, match=r"bearing\.permeability = 1e-11 m2 .* feeding number .* at most 1e\+06"
    ):
        from_form({"bearing__permeability": 1e4, "bearing__clearance": 3.0})


def test_the_limits_themselves_are_allowed():
    alone = {
        "bearing__radius",
        "bearing__clearance",
        "contact__roughness",
        "contact__force_at_closure",
        "rotor__transverse_inertia",
        "bearing__layer_permeability",
        "bearing__layer_thickness",
    }  # tied to another
    for field in FIELDS.values():
        ambient = 1.01325 if field.over_ambient else 1.0
        for limit in field.choices or (field.low, field.high):
            if field.choices:
                assert isinstance(from_form({field.name: limit}), Design)
            elif field.name not in alone and not (field.open_low and limit == field.low):
                assert isinstance(from_form({field.name: limit * ambient}), Design)


def test_grade_of_a_rotor_by_hand():
    """ISO 21940-11:2016: G 6.3 at 3,000 rpm permits a specific unbalance of 20 g mm/kg, 20 µm, of
    the whole rotor.
    """
    e = eccentricity_of_grade(6.3, 3000.0, 0.2)
    assert 0.8 * e == pytest.approx(20.05e-6, rel=1e-3)
    assert grade_of_eccentricity(e, 3000.0, 0.2) == pytest.approx(6.3, rel=1e-14)
    with pytest.raises(DesignError, match="grade G"):
        eccentricity_of_grade(0.0, 3000.0, 0.2)
    with pytest.raises(DesignError, match="rpm"):
        eccentricity_of_grade(2.5, 0.0, 0.2)


def test_speed_or_bearing_number():
    d = reference_design()
    assert bearing_number_of(d, None, d.speed_rpm(3.45)) == pytest.approx(3.45, rel=1e-14)
    assert bearing_number_of(d, 3.45, None) == 3.45
    for limit in BEARING_NUMBER_RANGE:
        assert bearing_number_of(d, None, d.speed_rpm(limit)) == pytest.approx(limit)
    for given_ in ((None, None), (1.0, 1.0), (0.0, None), (None, 1e9)):
        with pytest.raises(DesignError):
            bearing_number_of(d, *given_)


@pytest.mark.parametrize(
    "data, words",
    [
        (b"\xff\x00", "UTF-8"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"\xff\xfe", "it is empty"),
        (b"x" * 200_000, "more than 20,000 bytes"),
        (b"[bearing", "TOML"),
        (b"[bearing]\nradius = -1", "radius"),
        (b"a = " + b"[" * 5000, "TOML"),
    ],
)
def test_wrong_files_are_one_sentence_with_their_name(data, words):
    with pytest.raises(DesignError, match=r"my\.toml") as error:
        read_design_bytes(data, "my.toml")
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_handed_in_file_is_the_design():
    d = reference_design().replace(rotor__shaft_stiffness=math.inf)
    assert read_design_bytes(design_toml(d).encode(), "d.toml") == d


@pytest.mark.parametrize("name", PRESETS)
def test_presets_load_and_rest_on_their_film(name, tmp_path):
    p = preset(name)
    number = bearing_number_of(p.design, None, p.speed_rpm)
    rest = static_equilibrium(p.design, p.rotor_mass, number, (3, 16))
    assert rest is not None and rest.eccentricity < 0.7
    path = tmp_path / "copy.toml"
    path.write_text(design_toml(p.design))
    assert load_design(path) == p.design
    if name != "spab60":
        assert p.design != reference_design()


def test_an_unknown_preset_is_told():
    with pytest.raises(InputError, match="fed_spindle"):
        preset("x")


def test_the_form_of_a_cylinder():
    """The shape brings its own extent; the other's is passed over, and back at its default."""
    typed = {"bearing__shape": "cylinder", "bearing__length": 50.0, "bearing__edge_latitude": 45.0}
    found = from_form(typed)
    assert found.bearing.length == 0.05 and found.bearing.edge == 0.05 / 0.12
    assert unused(found) == {"bearing__edge_latitude"}
    back = from_form({"bearing__shape": "sphere", "bearing__length": 50.0}, found)
    assert back == reference_design() and unused(back) == {"bearing__length"}
    with pytest.raises(DesignError, match="Shape = 'cube' is not allowed: choose sphere, cylinder"):
        from_form({"bearing__shape": "cube"})
