"""Where a figure's mark is drawn, so that the browser need not redraw the figure after a click."""

import pytest
from streamlit.testing.v1 import AppTest


def _page():
    import streamlit as st

    from spab_core.ui.clicks import mark_place

    st.text(repr(mark_place("map", st.session_state["shown"], st.session_state["point"])))


@pytest.fixture
def place():
    at = AppTest.from_function(_page)

    def run(point, shown="MLE", opened=False, clicked=False):
        at.session_state["point"], at.session_state["shown"] = point, shown
        if opened and "map_click" in at.session_state:
            del at.session_state["map_click"]  # as Streamlit does with a page that is left
        elif not opened:
            at.session_state["map_click"] = "there"
        if clicked:
            at.session_state["map_moved"] = True
        at.run()
        assert not at.exception
        return at.text[0].value

    return run


def test_the_mark_is_drawn_anew_only_where_the_browser_has_not_moved_it(place):
    assert place((3.45, 4.52), opened=True) == "(3.45, 4.52)"
    assert place((6.0, 7.0), clicked=True) == "(3.45, 4.52)"  # the same figure: zoom and mark stay
    assert place((6.0, 7.0)) == "(3.45, 4.52)"
    assert place((2.0, 1.0), clicked=True) == "(3.45, 4.52)"
    assert place((2.0, 1.0), shown="Regime") == "(2.0, 1.0)"  # another figure
    assert place((2.0, 1.5), shown="Regime") == "(2.0, 1.5)"  # typed
    assert place((6.0, 7.0), shown="Regime", clicked=True) == "(2.0, 1.5)"
    assert (
        place((6.0, 7.0), shown="Regime", opened=True) == "(6.0, 7.0)"
    )  # the page is opened again
