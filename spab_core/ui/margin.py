"""The solved margin of the chosen point on a page: solved on a click, then kept."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

import streamlit as st

from spab_core.design.model import Design
from spab_core.maps.solved_margin import SolvedMargin, solve_margin
from spab_core.ui.solving import LIVE, waits_for_compiler

_KEPT = 64
_Key = tuple[Design, float, float]


class _Store:
    """The last margins solved, of all sessions."""

    def __init__(self) -> None:
        self._found: OrderedDict[_Key, SolvedMargin] = OrderedDict()
        self._lock = Lock()

    def get(self, key: _Key) -> SolvedMargin | None:
        with self._lock:
            return self._found.get(key)

    def keep(self, key: _Key, found: SolvedMargin) -> None:
        with self._lock:
            self._found[key] = found
            while len(self._found) > _KEPT:
                self._found.popitem(last=False)


@st.cache_resource(show_spinner=False)
def _store() -> _Store:
    return _Store()


def kept_margin(design: Design, rotor_mass: float, bearing_number: float) -> SolvedMargin | None:
    """The solved margin of a point, if it was asked for before."""
    return _store().get((design, rotor_mass, bearing_number))


def margin_words(found: SolvedMargin) -> str:
    """A solved margin as Markdown: a bold sentence and a list."""
    told = [f"- :small[{text}]" for text in found.sentences()]
    return "\n".join([f"**{found.headline()}**", "", *told])


def margin_panel(design: Design, rotor_mass: float, bearing_number: float) -> None:
    """The solved margin of a point in words; where it is not solved yet, the button that solves
    it.
    """
    found = kept_margin(design, rotor_mass, bearing_number)
    if found is None:
        place = st.empty()
        asked = place.button(
            "Solve the margin",
            key="solve_margin",
            icon=":material/straighten:",
            help="Where rubbing, a thin film, whirl, chaos or resonance begin or end along speed "
            "and mass: some 100 points, solved from rest; about 10 s",
        )
        if not asked or waits_for_compiler(design, rotor_mass, bearing_number):
            return
        place.empty()
        with st.spinner("Solving the margin …"):
            found = solve_margin(design, rotor_mass, bearing_number, LIVE)
        _store().keep((design, rotor_mass, bearing_number), found)
    st.markdown(margin_words(found))
