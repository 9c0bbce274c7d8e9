"""Pages while the solver is still being compiled: they show what is known, said to be that, and the
solve takes its place.
"""

import shutil

import pytest
import streamlit as st
from streamlit.testing.v1 import AppTest

from spab_core.design.model import reference_design
from spab_core.shipped.manifest import (
    ARTIFACTS,
    REFERENCE_MAP,
    load_reference_map,
    write_manifest,
)
from spab_core.trajectory import compiling
from spab_core.ui import shared, solving
from tests.app.conftest import until_done, verdicts
from tests.conftest import ROOT

POINT = {"bearing_number": "4.5", "rotor_mass": "18"}
OWN = {"bearing.clearance": "3e-05"}
LIVE = ("app.py", "pages/1_Operating_point.py", "pages/3_Surrogate_map.py", "pages/8_What_if.py")


@pytest.fixture
def compiler(monkeypatch):
    """A compiler at work since twelve seconds; a function that has it end, or be at work for so
    many seconds.
    """
    st.cache_resource.clear()
    state: dict[str, float | None] = {"seconds": 12.0}
    monkeypatch.setattr(compiling, "seconds_so_far", lambda: state["seconds"])
    for name in ("is_compiled", "is_linear_compiled"):
        monkeypatch.setattr(solving, name, lambda *of, **by: state["seconds"] is None)
    solve = solving.solve_point
    monkeypatch.setattr(
        solving,
        "solve_point",
        lambda *a, **k: (
            pytest.fail("solved, though the solver is not there")
            if state["seconds"]
            else solve(*a, **k)
        ),
    )
    yield lambda seconds=None: state.update(seconds=seconds)
    st.cache_resource.clear()


def page(path, **query):
    at = AppTest.from_file(str(ROOT / path), default_timeout=240)
    at.query_params.update(query)
    at.run()
    assert not at.exception
    return at


def known(at):
    return [e.value for e in at.info if "Not solved yet" in e.value]


def progress(at):
    """Of the compiler, not of a job."""
    return [e.proto.text for e in at.get("progress") if "ompil" in e.proto.text]


@pytest.mark.parametrize("path", LIVE)
def test_what_is_known_comes_first_and_the_solve_takes_its_place(path, compiler, own_jobs):
    # the other design of What if would whirl with 18 kg, on a finer mesh and its kernels
    point = POINT | ({"rotor_mass": "0.1"} if "What_if" in path else {})
    at = page(path, **point, beside="True", what_tab="Two designs")
    m = load_reference_map()
    mass = float(point["rotor_mass"])
    cell = m.nearest(mass, 4.5)
    told = known(at)
    assert all(
        f"the cell nearest to it (Λ 4.5, {mass:g} kg): {m.cell_text(*cell)} per revolution, "
        f"largest eccentricity {m.max_eccentricity[cell]:.3f}"
        in text
        and "Predicted" in text
        and "90% interval" in text
        for text in told
        if "othing is known" not in text
    )
    assert any("From the shipped map" in text for text in told)
    end = "s in all, once on this machine"
    waits = {f"Compiling the solver: 12 s so far, some {compiling.SECONDS} {end}"}
    if "What_if" in path:  # the other design there is fed through a wall that stores gas
        gas = "Compiling the solver for a wall that stores gas"
        waits.add(f"{gas}: 12 s so far, some {compiling.STORING_SECONDS} {end}")
    assert waits == set(progress(at))
    compiler()
    until_done(at)  # intervals of the surrogate, too
    assert not at.exception and not known(at) and not progress(at)
    expected = ("not recommended",) if "What_if" in path else ("haotic", "olved live")
    assert any(
        any(words in e.value for words in expected)
        for e in (*at.error, *at.warning, *at.success, *at.info, *at.caption)
    )


def test_linear_theory_does_not_wait_for_the_rest(compiler, monkeypatch):
    at = page("pages/6_My_bearing.py", **POINT)
    assert known(at) and not at.metric
    assert progress(at) == ["Compiling the solver: 12 s so far, once on this machine"]
    monkeypatch.setattr(solving, "is_linear_compiled", lambda design: True)
    at.run()
    assert not at.exception and not known(at) and at.metric
    assert ["The motion with unbalance is not solved" in text for text in verdicts(at)] == [True]


def test_a_compiler_that_takes_long_is_not_said_to_take_less(compiler):
    compiler(compiling.SECONDS + 25.0)
    (told,) = progress(page("pages/1_Operating_point.py"))
    usual = compiling.SECONDS
    assert (
        told
        == f"Compiling the solver: {usual + 25} s so far, more than the usual {usual} s, once on "
        "this machine"
    )


def test_nothing_is_claimed_of_an_own_design(compiler):
    at = page("pages/1_Operating_point.py", **POINT, **OWN)
    assert known(at) == [
        "**Not solved yet.** Nothing is known of this design yet: the shipped map and its "
        "models are of the example bearing."
    ]


def test_no_page_without_a_live_solve_waits(compiler):
    for path in (
        "pages/2_Bifurcation.py",
        "pages/4_Model_ranking.py",
        "pages/9_About_the_model.py",
    ):
        at = page(path)
        assert not known(at) and not progress(at)


def test_a_failed_compiler_is_said_and_the_page_compiles_itself(compiler, monkeypatch):
    compiler()
    said = []
    monkeypatch.setattr(solving, "is_compiled", lambda *of, **by: False)
    monkeypatch.setattr(compiling, "failure", lambda: "its process ended with code 1: no room")
    real = st.spinner
    monkeypatch.setattr(solving.st, "spinner", lambda text: said.append(text) or real(text))
    at = page("app.py", **POINT)
    assert said == [
        "First run on this machine: compiling the solver here, as its process ended with code 1: "
        "no room. This takes about 20 s, once."
    ]
    assert not known(at)


def test_words_without_a_shipped_prediction_or_outside_the_map(monkeypatch, tmp_path):
    st.cache_resource.clear()
    design = reference_design()
    assert "Predicted" in solving.known_words(design, 18.0, 4.5)
    shutil.copy(ARTIFACTS / REFERENCE_MAP, tmp_path)
    write_manifest(tmp_path)
    monkeypatch.setattr(shared, "ARTIFACTS", tmp_path)
    st.cache_resource.clear()
    told = solving.known_words(design, 18.0, 4.5)
    assert "From the shipped map" in told and "Predicted" not in told
    assert "outside the shipped map" in solving.known_words(design, 60.0, 4.5)
    st.cache_resource.clear()
