"""What follows a user from page to page and stands in the address."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as strings
from streamlit.runtime.state.query_params_proxy import QueryParamsProxy
from streamlit.testing.v1 import AppTest

from spab_core.common.errors import InputError
from spab_core.design.model import reference_design
from spab_core.trajectory.assessment import Limits
from spab_core.ui.view import VIEW
from tests.app.conftest import address, complaints


def page():
    import streamlit as st

    from spab_core.ui.shared import page_head
    from spab_core.ui.view import (
        VIEW,
        chosen_design,
        chosen_limits,
        design_words,
        set_design,
        set_speed,
        show_usual,
    )

    for key in VIEW if st.session_state.pop("forget", False) else ():
        del st.session_state[key]
    page_head("test")
    st.number_input("Mass", 0.001, 1000.0, None, key="rotor_mass")
    st.text_input("Plane", **show_usual("own_numbers", "1:2:10"))
    st.number_input("Speed", 0.0, None, None, **show_usual("run_to", 900.0, (100.0, 1000.0)))
    st.button("fast", key="fast", on_click=lambda: set_speed(chosen_design(), 7.0, 1e7))
    if st.button("thin", key="thin"):
        set_design(chosen_design().replace(bearing__clearance=30e-6))
        st.rerun()
    st.text(design_words())
    st.text(chosen_design().bearing.clearance)
    st.text(chosen_limits())


def opened(**address):
    at = AppTest.from_function(page)
    for key, value in address.items():
        at.query_params[key] = value
    return at.run()


def test_a_copied_address_opens_the_same_view():
    at = opened()
    assert not at.query_params and not complaints(at)
    at.number_input(key="rotor_mass").set_value(7.25).run()
    at.button(key="thin").click().run()
    assert address(at) == {"rotor_mass": "7.25", "bearing.clearance": "3e-05"}
    copy = opened(**address(at))
    assert copy.number_input(key="rotor_mass").value == 7.25
    words = ["own design (radial clearance 30 µm)", "3e-05", str(Limits())]
    assert [t.value for t in copy.text] == words
    assert not copy.error


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "rotor_mass",
            "-5",
            "rotor_mass = -5 kg is out of range: allowed is from 0.001 to 1000 kg",
        ),
        ("rotor_mass", "nan", "rotor_mass = nan kg is out of range"),
        ("bearing_number", "1e999", "out of range"),
        ("model", "oracle", "model = 'oracle' is not allowed: choose mlp"),
        ("divisor", "7.5", "not allowed"),
        ("draw", "1.5", "draw = '1.5' is not a whole number"),
        ("mesh", "9999x9999", "mesh"),
        ("bearing.clearance", "1", "bearing.clearance = 1 m is out of range"),
        ("bearing.clearance", "x", "is not a number"),
        ("contact.roughness", "0.1", "the contact force at the centre"),
        ("../../etc", "1", "unknown value '../../etc'"),
    ],
)
def test_a_wrong_address_is_told_and_the_page_stands(key, value, words):
    at = opened(**{key: value})
    assert not at.exception and len(complaints(at)) == 1 and words in at.error[0].value
    assert at.text[1].value == repr(reference_design().bearing.clearance)
    assert not at.run().error  # said once, and the address is mended
    assert not at.query_params


def test_the_address_takes_the_speed_of_the_design_that_stands_there():
    at = opened(rpm="10200")
    assert not complaints(at) and not at.exception
    number = reference_design().bearing_number(10200 * math.pi / 30.0)
    assert at.session_state["bearing_number"] == pytest.approx(number, rel=1e-5)
    assert address(at) == {"bearing_number": f"{number:.6g}"}
    thin = opened(rpm="10200", **{"bearing.clearance": "3e-05"})
    ratio = thin.session_state["bearing_number"] / number
    assert ratio == pytest.approx((35.0 / 30.0) ** 2, rel=1e-5) and not complaints(thin)


@pytest.mark.parametrize(
    ("given", "number", "words"),
    [
        ({"rpm": "8899", "bearing_number": "3"}, 3.0, ""),  # the same, in whole rpm
        ({"rpm": "10200", "bearing_number": "3"}, 3.0, "two speeds. The bearing number counts."),
        ({"rpm": "x"}, 3.45, "rpm = 'x' is not a number"),
        ({"rpm": "1e9"}, 3.45, "rpm = 1e+09 rpm is out of range: allowed is from 29.6"),
        ({"rpm": "1e9", "bearing_number": "3"}, 3.0, "is out of range"),
    ],
)
def test_a_speed_beside_a_bearing_number_or_out_of_range(given, number, words):
    at = opened(**given)
    assert not at.exception and at.session_state["bearing_number"] == number
    assert words in " ".join(complaints(at)) and len(complaints(at)) == bool(words)


@given(strings.sampled_from(sorted(VIEW)), strings.text(max_size=30))
def test_any_text_in_the_address_is_a_value_or_a_sentence(key, text):
    try:
        value = VIEW[key].read(text)
    except InputError as error:
        assert key in str(error)
    else:
        assert VIEW[key].read(VIEW[key].write(value)) is not None


def test_values_survive_a_page_without_their_widgets():
    at = opened(rotor_mass="7.25", model="forest")
    assert at.session_state["model"] == "forest" and at.run().session_state["model"] == "forest"
    assert address(at)["model"] == "forest"


def test_an_emptied_or_dropped_value_is_the_last_one_not_the_usual():
    """Streamlit gives None for an emptied number, and forgets a widget's value where only a
    fragment of its page ran last.
    """
    at = opened(rotor_mass="7.25")
    at.number_input(key="rotor_mass").set_value(None).run()
    assert at.number_input(key="rotor_mass").value == 7.25 and address(at) == {"rotor_mass": "7.25"}
    at.session_state["forget"] = True
    at.run()
    assert at.number_input(key="rotor_mass").value == 7.25 and address(at) == {"rotor_mass": "7.25"}


def test_the_address_is_written_again_where_the_browser_had_not_got_the_last_one(monkeypatch):
    """Two quick clicks, there and back: the second comes with the address from before the first."""
    written, write = [], QueryParamsProxy.from_dict
    monkeypatch.setattr(
        QueryParamsProxy, "from_dict", lambda self, p: written.append(dict(p)) or write(self, p)
    )
    at = opened(rotor_mass="7.25")
    at.number_input(key="rotor_mass").set_value(9.0).run()
    at.query_params["rotor_mass"] = "7.25"
    at.number_input(key="rotor_mass").set_value(7.25).run()
    at.run()
    assert written == [{"rotor_mass": "9"}, {"rotor_mass": "7.25"}]


def test_a_speed_beyond_what_can_be_solved_is_told_and_the_nearest_taken():
    at = opened()
    at.button(key="fast").click().run()
    assert at.session_state["bearing_number"] == 50.0 and at.session_state["rotor_mass"] == 7.0
    assert "At 10,000,000 rpm the bearing number of this design would be" in at.error[0].value
    assert f"The speed is now {reference_design().speed_rpm(50.0):,.0f} rpm." in at.error[0].value
    assert not at.run().error  # said once


def test_a_usual_value_follows_its_design_until_another_is_typed():
    at = opened()
    assert at.text_input[0].value == "1:2:10" and at.number_input(key="run_to_shown").value == 900.0
    at.text_input[0].set_value("3:4:5").run()
    assert (
        address(at) == {"own_numbers": "3:4:5"}
        and opened(own_numbers="3:4:5").text_input[0].value == "3:4:5"
    )
    at.text_input[0].set_value("").run()
    assert at.text_input[0].value == "1:2:10" and not at.query_params
    at.number_input(key="run_to_shown").set_value(500.0).run()
    assert address(at) == {"run_to": "500"}
    assert (
        opened(run_to="5000").number_input(key="run_to_shown").value == 1000.0
    )  # the end of what is allowed now


def _given():
    import streamlit as st

    from spab_core.design.form import FIELDS
    from spab_core.ui.shared import page_head
    from spab_core.ui.view import assumed_values, chosen_design, note_typed, set_design, set_example

    page_head("test")
    if st.button("all", key="all"):
        note_typed(FIELDS)
    if st.button("example", key="example"):
        set_example()
    set_design(chosen_design().replace(bearing__clearance=30e-6))
    st.text(len(assumed_values()))


def test_what_was_given_for_one_design_does_not_count_for_the_next():
    """All values given, then the example bearing: a change of it assumes the others again."""
    at = AppTest.from_function(_given).run()
    assumed = int(at.text[0].value)
    assert assumed > 5
    at.button(key="all").click().run()
    assert at.text[0].value == "0"
    at.button(key="example").click().run()
    assert not at.exception and int(at.text[0].value) == assumed


def test_a_point_set_is_sent_even_to_a_field_that_seems_to_show_it():
    """A second quick click comes from a browser that has not got the first one's point yet."""

    def live_page():
        import streamlit as st

        from spab_core.ui.shared import page_head
        from spab_core.ui.view import note_live, set_point

        page_head("test")
        st.number_input("Mass", 0.001, 1000.0, None, key="rotor_mass")
        st.button("there", key="there", on_click=lambda: set_point(7.0, 4.5))
        note_live(("rotor_mass",))

    at = AppTest.from_function(live_page).run()
    at.number_input(key="rotor_mass").set_value(7.0).run()
    assert not at.number_input(key="rotor_mass").proto.set_value
    at.button(key="there").click().run()
    assert at.number_input(key="rotor_mass").value == 7.0
    assert at.number_input(key="rotor_mass").proto.set_value
    at.run()
    assert at.number_input(key="rotor_mass").value == 7.0
    assert not at.number_input(key="rotor_mass").proto.set_value


def test_limits_follow_a_user_and_stand_in_the_address():
    at = opened(least_film="12", max_eccentricity="0.45", separation="9")
    assert [c for c in complaints(at) if "separation" in c and "0 to 5" in c]
    copy = opened(**address(at))
    assert address(copy) == {"least_film": "12", "max_eccentricity": "0.45"}
    assert [t.value for t in copy.text][-1] == str(
        Limits(12e-6, 0.45, calm_eccentricity=0.45, separation=1.0)
    )
