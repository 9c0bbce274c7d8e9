"""What follows a user from page to page and stands in the address."""

import pytest
from hypothesis import given
from hypothesis import strategies as strings
from streamlit.testing.v1 import AppTest

from spab_core.design import InputError, reference_design
from spab_core.ui.view import VIEW
from tests.app.conftest import address


def page():
    import streamlit as st

    from spab_core.ui.shared import page_head
    from spab_core.ui.view import chosen_design, design_words, set_design

    page_head("test")
    st.number_input("Mass", 0.001, 1000.0, key="rotor_mass")
    if st.button("thin", key="thin"):
        set_design(chosen_design().replace(bearing__clearance=30e-6))
        st.rerun()
    st.text(design_words())
    st.text(chosen_design().bearing.clearance)


def opened(**address):
    at = AppTest.from_function(page)
    for key, value in address.items():
        at.query_params[key] = value
    return at.run()


def test_a_copied_address_opens_the_same_view():
    at = opened()
    assert not at.query_params and not at.error
    at.number_input(key="rotor_mass").set_value(7.25).run()
    at.button(key="thin").click().run()
    assert address(at) == {"rotor_mass": "7.25", "bearing.clearance": "3e-05"}
    copy = opened(**address(at))
    assert copy.number_input(key="rotor_mass").value == 7.25
    assert [t.value for t in copy.text] == ["own design (radial clearance 30 µm)", "3e-05"]
    assert not copy.error


@pytest.mark.parametrize(("key", "value", "words"), [
    ("rotor_mass", "-5", "rotor_mass = -5 kg is out of range: allowed is from 0.001 to 1000 kg"),
    ("rotor_mass", "nan", "rotor_mass = nan kg is out of range"), ("bearing_number", "1e999", "out of range"),
    ("model", "oracle", "model = 'oracle' is not allowed: choose mlp"), ("divisor", "7.5", "not allowed"),
    ("draw", "1.5", "draw = '1.5' is not a whole number"), ("mesh", "9999x9999", "mesh"),
    ("bearing.clearance", "1", "bearing.clearance = 1 m is out of range"), ("bearing.clearance", "x", "is not a number"),
    ("contact.roughness", "0.1", "the contact force at the centre"), ("../../etc", "1", "unknown value '../../etc'"),
])
def test_a_wrong_address_is_told_and_the_page_stands(key, value, words):
    at = opened(**{key: value})
    assert not at.exception and len(at.error) == 1 and words in at.error[0].value
    assert at.text[1].value == repr(reference_design().bearing.clearance)
    assert not at.run().error  # said once, and the address is mended
    assert not at.query_params


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
