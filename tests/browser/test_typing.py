"""What is typed while a slow run of the page goes on, in real Chromium."""

import pytest

from spab_core.design.model import reference_design

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SLOW = """
import time

import streamlit as st

from spab_core.ui.point_bar import point_bar
from spab_core.ui.shared import page_head

page_head("slow")
st.title("Slow")
time.sleep(1.0)  # so that the next value comes before this run has drawn its fields
point_bar()
time.sleep(0.5)
st.write(f"solved {st.session_state['rotor_mass']:g} {st.session_state['bearing_number']:g}")
"""


@pytest.fixture
def slow(chromium, tools, tmp_path):
    """The slow page, solved once."""
    script = tmp_path / "slow.py"
    script.write_text(SLOW)
    with tools.dashboard(script) as address, tools.browser_page() as page:
        page.goto(address)
        page.get_by_text("solved 4.52 3.45").wait_for(timeout=60_000)
        yield page


def test_values_typed_one_after_the_other_all_stand(slow):

    def enter(label, value):
        field = slow.get_by_label(label, exact=True)
        field.fill(value)
        field.press("Enter")
        slow.wait_for_timeout(300)

    enter("Shaft speed, rpm", "6000")
    enter("Rotor mass, kg", "2.5")
    number = reference_design().bearing_number(6000.0 * 3.14159265 / 30.0)
    slow.get_by_text(f"solved 2.5 {number:.6g}").wait_for(timeout=20_000)
    enter("Bearing number Λ", "1.5")
    enter("Name of the design", "mine")
    enter("Rotor mass, kg", "3")
    slow.get_by_text("solved 3 1.5").wait_for(timeout=20_000)
    slow.get_by_label("Bearing number Λ", exact=True).fill("1.7")  # not entered yet
    enter("Rotor mass, kg", "3.5")
    slow.get_by_text("solved 3.5 1.7").wait_for(timeout=20_000)
    assert slow.get_by_label("Name of the design", exact=True).input_value() == "mine"


def test_a_value_typed_and_a_link_clicked_at_once_both_count(chromium, tools, tmp_path):
    script, other = tmp_path / "slow.py", tmp_path / "pages" / "1_Operating_point.py"
    other.parent.mkdir()
    script.write_text(SLOW)
    other.write_text(SLOW.replace("1.0", "0.1").replace("Slow", "Other"))
    with tools.dashboard(script) as address, tools.browser_page() as page:
        for mass in ("2.5", "3", "3.5"):
            page.goto(address)
            page.get_by_text("solved 4.52 3.45").wait_for(timeout=60_000)
            page.get_by_label("Rotor mass, kg", exact=True).fill(mass)
            page.get_by_role("link", name="Motion in detail").click()
            page.get_by_role("heading", name="Other").wait_for(timeout=20_000)
            page.get_by_text(f"solved {mass} 3.45").wait_for(timeout=20_000)
            assert page.url.endswith(f"/Operating_point?rotor_mass={mass}")


def test_a_decimal_comma_is_a_decimal_sign(slow):
    field = slow.get_by_label("Rotor mass, kg", exact=True)
    field.press("Control+a")
    field.press_sequentially("2,5")
    field.press("Enter")
    slow.get_by_text("solved 2.5 3.45").wait_for(timeout=20_000)
    field = slow.get_by_label("Bearing number Λ", exact=True)
    field.press("Control+a")
    field.evaluate(
        "f => { const d = new DataTransfer(); d.setData('text', ' 1,75 ');"
        "f.dispatchEvent(new ClipboardEvent('paste', {clipboardData: d, bubbles: true})); }"
    )
    field.press("Enter")
    slow.get_by_text("solved 2.5 1.75").wait_for(timeout=20_000)
    field = slow.get_by_label("Shaft speed, rpm", exact=True)  # thousands
    field.press("Control+a")
    field.press_sequentially("6,000")
    field.press("Enter")
    number = reference_design().bearing_number(6000.0 * 3.14159265 / 30.0)
    slow.get_by_text(f"solved 2.5 {number:.6g}").wait_for(timeout=20_000)


def test_a_number_that_is_not_allowed_is_told_and_the_field_has_its_last(slow):
    for label, typed, words, last in (
        ("Rotor mass, kg", "0", "rotor mass = 0 kg is out of range: allowed is", "4.520"),
        ("Shaft speed, rpm", "100000000", "shaft speed = 1e+08 rpm is out of range", "10233"),
        ("Supply, bar gauge", "-3", "supply pressure = -3 bar gauge is out of range", "0.000"),
    ):
        field = slow.get_by_label(label, exact=True)
        field.fill(typed)
        field.press("Enter")
        slow.get_by_text(words).wait_for(timeout=20_000)
        slow.wait_for_function(
            "([field, last]) => field.value === last", arg=[field.element_handle(), last]
        )
