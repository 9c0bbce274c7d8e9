"""Every page: each control at its ends, each choice taken and taken back, texts too long, every
download made.
"""

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.maps.bifurcation import VARY
from spab_core.plotting.map import LAYERS
from spab_core.shipped.predicted_maps import FIGURE_DIVISORS
from spab_core.surrogates.models import DIVISORS
from spab_core.trajectory.assessment import GRADES
from spab_core.ui.point_bar import LIMIT_FIELDS
from spab_core.ui.view import (
    CELLS,
    JUDGED,
    LINES,
    METRICS,
    PAPER_MODELS,
    PAPER_PARTS,
    SAME,
    TARGETS,
    VIEW,
)
from tests.app.conftest import complaints
from tests.conftest import ROOT

PAGES = {"Stability_map": ROOT / "app.py"} | {
    path.stem.partition("_")[2]: path for path in sorted((ROOT / "pages").glob("*.py"))
}
# at 100 bar its point is solved in 3 s, that of the usual 4.5 kg in 44
HEAVY = {"rotor_mass": 30.0}
LIGHT = {"rotor_mass": 0.1}  # which every preset carries without a finer mesh, and its kernels
STATES = [(name, HEAVY if name == "Stability_map" else {}) for name in PAGES] + [
    ("What_if", {"what_tab": "Run-up"}),
    ("What_if", {"what_tab": "Two designs"} | LIGHT),
    ("Bifurcation", {"line": "rotor-mass"}),
    ("Surrogate_map", {"sure": True}),
    *(("Reproduce_the_paper", {"paper": part}) for part in PAPER_PARTS if part != "claims"),
    (
        "Operating_point",
        {
            "bearing.clearance": "3e-05",
            "compare": "True",
            "mesh": "2x16",
            "transient": 30,
            "revolutions": 20,
        },
    ),
]
RAW = {
    "layer": LAYERS,
    "line": LINES,
    "same": SAME,
    "divisor": DIVISORS,
    "cells": CELLS,
    "metric": METRICS,
    "judged": JUDGED,
    "target": TARGETS,
    "ranked": TARGETS,
    "paper": PAPER_PARTS,
    "paper_line": VARY,
    "paper_model": PAPER_MODELS,
    "paper_divisor": FIGURE_DIVISORS,
    "worst_grade": GRADES[:2],
}  # shown otherwise
# one bar, the same on all pages
BAR = ("rotor_mass", "rpm", "bearing_number", "supply", "name", *LIMIT_FIELDS)
BARS = (
    "Stability_map",
    "Operating_point",
)  # where it is tried: a page of a map, and one that solves
FINE = ("4x48", "6x64")  # meshes whose kernels nothing else here compiles
BEYOND = {  # what is typed there is checked by us, in a sentence
    (key, end): value
    for key in ("rotor_mass", "rpm", "bearing_number", "supply")
    for end, value in (("min", -1.0), ("max", 1e9))
}
FREE = ("name", "project", "author")  # any text is a good one
# views whose files come with the result of a job that nobody has asked for yet
WAITING = ("My_map", "What_if", "Tolerances_and_improvements")
WORDS = ("Reproduce_the_paper", {})  # what opens there is words alone
LONG = "9" * 10_000
pytestmark = pytest.mark.usefixtures("own_jobs")


def opened(name, state):
    at = AppTest.from_file(str(PAGES[name]), default_timeout=240)
    for key, value in state.items():
        at.query_params[key] = str(value)
    at.session_state["plotly_wanted"] = True
    return at.run()


def stands(at, what):
    assert not at.exception, (what, at.exception)


def refused(at, key, end):
    """A number of the bar that is beyond what is allowed is told, and the field has the last."""
    if (key, end) in BEYOND:
        assert any("is out of range: allowed is from" in e for e in complaints(at)), (key, end)
        assert at.number_input(key=key).value != BEYOND[key, end]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "state"),
    [(name, state) for name, state in STATES if state or name != "Operating_point"],
)
def test_every_control_at_its_ends(name, state):
    at = opened(name, state)
    stands(at, "opened")
    shared = () if name in BARS else BAR
    for key in [w.key for w in at.number_input if w.key not in shared]:
        for end in ("min", "max"):
            field = at.number_input(key=key)
            if field.disabled:
                continue
            field.set_value(BEYOND.get((key, end), getattr(field, end))).run()
            stands(at, (key, end))
            refused(at, key, end)
        at = opened(name, state)
    for key in [w.key for w in at.text_input if w.key not in shared]:
        for text in (LONG, "", "x:y:z"):
            at.text_input(key=key).set_value(text).run()
            stands(at, (key, text[:10]))
            if key in FREE:
                assert not complaints(at) and 0 < at.text_input(key=key).proto.max_chars < 100
            else:
                assert complaints(at) or not text, (key, text[:10])
        at = opened(name, state)
    for group in at.button_group:
        choices = RAW.get(group.key, group.options)
        assert [group.format_func(choice) for choice in choices] == group.options
        several = isinstance(group.value, list)
        for value in (
            [[choice] for choice in choices] + [[], list(choices)] if several else [*choices, None]
        ):
            at.button_group(key=group.key).set_value(value).run()
            stands(at, (group.key, value))
            assert not value or at.session_state[group.key] == value
            assert (
                group.key not in VIEW or at.session_state[group.key] is not None
            )  # what is taken back stays
        at = opened(name, state)
    for box in at.selectbox:
        for k, option in enumerate(box.options):
            if option in FINE:
                continue
            at.selectbox(key=box.key).select_index(k).run()
            stands(at, (box.key, k))
        at = opened(name, state)
    for kind in ("toggle", "checkbox"):
        for box in at.get(kind):
            if not box.disabled:
                getattr(at, kind)(key=box.key).set_value(not box.value).run()
                stands(at, box.key)
                at = opened(name, state)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "state"), STATES)
def test_every_download_is_made(name, state, monkeypatch):
    made = {}
    real = st.delta_generator.DeltaGenerator.download_button

    def seen(self, label, data, file_name, *more, **options):
        made[file_name] = data
        return real(self, label, data, file_name, *more, **options)

    monkeypatch.setattr(st.delta_generator.DeltaGenerator, "download_button", seen)
    monkeypatch.setattr(st, "download_button", lambda *a, **k: seen(st._main, *a, **k))
    at = opened(name, state)
    stands(at, "opened")
    assert bool(made) == (name not in WAITING and (name, state) != WORDS)
    for file_name, data in made.items():
        if not file_name.endswith(".png"):
            content = data() if callable(data) else data
            assert len(content) > 20, file_name
