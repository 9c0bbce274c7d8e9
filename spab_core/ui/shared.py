"""Cached loaders and the common page head."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
import plotly.graph_objects as go
import streamlit as st
from streamlit.runtime.scriptrunner import add_script_run_ctx, get_script_run_ctx

from spab_core.active_learning.refine import Refinement
from spab_core.common.errors import InputError
from spab_core.common.words import capital
from spab_core.jobs.store import Job
from spab_core.maps.margin import against_linear, critical_masses, margin
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.map import SURROGATE, map_figure, mark_trace
from spab_core.plotting.plain_picture import PlainPicture, picture_of_map
from spab_core.plotting.surrogates import ERROR_AXES, refinement_figure, surrogate_figure
from spab_core.shipped.manifest import (
    ARTIFACTS,
    BLOCK_CLASSIFIERS,
    BLOCK_SCORES,
    CLASSIFIERS,
    FLOORED_BLOCK_SCORES,
    FLOORED_PREDICTIONS,
    FLOORED_SCORES,
    PREDICTIONS,
    REFERENCE_MAP,
    REFINED,
    SCORES,
    ArtifactError,
    load_reference_map,
    load_reference_refinement,
    load_reference_scores,
)
from spab_core.shipped.model_store import PointPrediction, predict_point
from spab_core.shipped.predicted_maps import ServedMap, find_map
from spab_core.surrogates.classifier import ASSESSMENT
from spab_core.surrogates.metrics import score_labels
from spab_core.surrogates.models import FLOOR, floored, linear_table_of, model
from spab_core.surrogates.ranking import ranking
from spab_core.surrogates.uncertainty import MapIntervals, load_intervals
from spab_core.trajectory import compiling
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES
from spab_core.ui.drawn import drawn
from spab_core.ui.memory import bound_memory, spare_lasting_objects
from spab_core.ui.navigation import SCRIPT, sidebar
from spab_core.ui.plain_picture import want_plotly
from spab_core.ui.running import running_jobs
from spab_core.ui.view import open_view

HOME = "start"  # title of the only page with plain pictures


def page_head(title: str) -> None:
    """What every page begins with; ``title`` is shown in the browser's tab.

    The view is opened (:mod:`spab_core.ui.view`).
    """
    compiling.start()
    bound_memory()
    spare_lasting_objects(title)
    st.set_page_config(page_title=f"spab: {title}", page_icon="🌀", layout="wide")
    st.html(
        "<style>.block-container{padding:2.2rem 2rem 1rem} "
        "@media(max-width:640px){.block-container{padding:4rem 1rem 1rem}} "
        "section[data-testid=stSidebar]{width:14.5rem !important;"
        "min-width:14.5rem} [data-testid=stMetricValue]{font-size:1.5rem} "
        # headings by their rank, in the sizes of a page of instruments
        "[data-testid=stHeading] h1,.stMarkdown h1{font-size:1.5rem;padding:0 0 .25rem} "
        ".stMarkdown h2{font-size:1.15rem;padding:.5rem 0 .25rem} "
        ".stMarkdown h3{font-size:1rem;padding:.4rem 0 .2rem} "
        "section[data-testid=stSidebar] [data-testid=stSidebarContent]{padding:0 .6rem} "
        "section[data-testid=stSidebar] [data-testid=stSidebarUserContent]{padding:0 0 1rem} "
        "section[data-testid=stSidebar] [data-testid=stSidebarHeader]{height:2.2rem;margin:0} "
        "[class*=st-key-nav_] h2{font-size:.8rem;padding:.2rem .3rem .1rem} "
        "[class*=st-key-nav_] [data-testid=stMarkdownContainer]{margin-bottom:0} "
        "[class*=st-key-nav_] a{padding:.1rem .3rem} "
        ":is(a,button,input,[role=radio],[role=tab],[role=switch]):focus-visible"
        "{outline:2px solid currentColor;outline-offset:2px} "
        "[data-testid=stMetricLabel] p{font-size:.74rem} "
        # white on the dark theme's light blue cannot be read
        "[data-testid=stBaseButton-primary],[data-testid=stBaseButton-primary]:hover"
        "{color:light-dark(#fff,#08213a)} "
        # faded text, at a contrast that can be read
        "[data-testid=stCaptionContainer]{opacity:.82} "
        # a large screen is used by larger letters and fields
        "@media(min-width:1800px) and (min-height:1000px){html{font-size:18px !important}} "
        # figures that need a width scroll in their own box on a narrow screen
        "@media(max-width:640px){[class*=st-key-wide_]{overflow-x:auto} "
        "[class*=st-key-wide_]>*{min-width:48rem}} "
        # number fields come without their labels until their script is there
        ".st-key-rotor_mass,.st-key-bearing_number,.st-key-rpm{min-height:4.25rem}</style>"
        + SCRIPT,
        unsafe_allow_javascript=True,
    )
    if title != HOME:
        want_plotly()
    sidebar(running_jobs)
    for complaint in open_view(title):
        st.error(complaint)


@contextmanager
def errors_in_words() -> Iterator[None]:
    """Show an ``InputError``, or a file that cannot be read or written, and stop the page."""
    try:
        yield
    except InputError as error:
        st.error(str(error))
        st.stop()
    except OSError as error:
        st.error(f"{error.filename or 'A file could not be written'}: {error.strerror or error}.")
        st.stop()


@st.cache_resource(show_spinner=False)
def _map(stamp: float) -> StabilityMap:
    return load_reference_map(ARTIFACTS)


def _stamp(name: str = REFERENCE_MAP) -> float:
    try:
        return (ARTIFACTS / name).stat().st_mtime
    except OSError:
        return 0.0  # the loader says what is missing


@st.cache_resource(max_entries=4, show_spinner=False)
def _floored_map(stamp: float, floor: float) -> StabilityMap:
    return floored(_map(stamp), floor)


def reference_map(floor: float | None = None) -> StabilityMap:
    """The shipped map, read and checked once for each version of the file; with a floor its
    exponents end there (``models.floored``).

    Raises ``InputError``.
    """
    return _map(_stamp()) if floor is None else _floored_map(_stamp(), floor)


def _stamps() -> tuple[float, ...]:
    """Of all that figures of predicted maps depend on."""
    return tuple(map(_stamp, (REFERENCE_MAP, PREDICTIONS, FLOORED_PREDICTIONS)))


def _map_drawing(
    layer: str, name: str, divisor: int, seed: int
) -> tuple[tuple[Hashable, ...], Callable[[], go.Figure]]:
    """All that the map's figure depends on, and what draws it."""
    m, own = reference_map(), (name, divisor, seed) if layer == SURROGATE else ()
    predicted = predicted_map(*own) if own else None
    return ("map", *_stamps(), layer, *own), lambda: map_figure(
        m, layer, predicted, linear_table_of(m)
    )


def marked_map_figure(
    point: tuple[float, float] | None, layer: str, name: str, divisor: int, seed: int
) -> go.Figure:
    """The map's figure with a cross at (bearing number, rotor mass), if any; ``name``,
    ``divisor``, ``seed``: of the surrogate's layer.

    Raises ``InputError``.
    """
    key, draw = _map_drawing(layer, name, divisor, seed)
    return drawn(key, draw, *([mark_trace(*point)] if point else []))


@st.cache_resource(max_entries=8, show_spinner=False)
def _picture(key: tuple[Hashable, ...], _draw: Callable[[], go.Figure]) -> PlainPicture:
    return picture_of_map(_draw())


def map_picture(layer: str, name: str, divisor: int, seed: int) -> PlainPicture:
    """The map as a plain picture; parameters and errors of :func:`marked_map_figure`."""
    return _picture(*_map_drawing(layer, name, divisor, seed))


def marked_surrogate_figure(
    point: tuple[float, float] | None,
    name: str,
    divisor: int,
    seed: int,
    floor: float | None = None,
) -> go.Figure:
    """Solved map, predicted map and its error, a cross at (bearing number, rotor mass) on the
    error, if any. Raises ``InputError``.
    """
    m, predicted = reference_map(floor), predicted_map(name, divisor, seed, floor)
    return drawn(
        ("surrogate", *_stamps(), name, divisor, seed, floor),
        lambda: surrogate_figure(m, predicted),
        *([mark_trace(*point, **ERROR_AXES)] if point else []),
    )


@st.cache_resource(max_entries=1, show_spinner=False)
def _refinement(stamp: float) -> Refinement:
    return load_reference_refinement(ARTIFACTS)


def reference_refinement() -> Refinement:
    """The shipped refined map, read and checked once for each version of the file.

    Raises ``InputError``.
    """
    return _refinement(_stamp(REFINED))


def drawn_refinement(layer: str) -> go.Figure:
    """The figure of the shipped refined map. Raises ``InputError``."""
    r = reference_refinement()
    return drawn(("refinement", _stamp(REFINED), layer), lambda: refinement_figure(r, layer))


@st.cache_resource(max_entries=1, show_spinner=False)
def _linear_words(stamp: float) -> str:
    return " ".join(against_linear(_map(stamp), linear_table_of(_map(stamp))).sentences())


def linear_words() -> str:
    """Where the reference map and linear stability disagree."""
    return _linear_words(_stamp())


@st.cache_resource(max_entries=1, show_spinner=False)
def _grade_words(stamp: float) -> str:
    found = _map(stamp).grades()
    told = ", ".join(f"{100.0 * (found == g).mean():.0f} % {w}" for g, w in GRADE_WORDS.items())
    none = "" if (found == GRADES[0]).any() else "No cell of this map is good. "
    return (
        f"{none}{capital(told)}, by the motion alone: resonance, and what grows at "
        "rest, are judged at the point. "
    )


def grade_words() -> str:
    """How much of the reference map is good, and by what."""
    return _grade_words(_stamp())


def map_margin(rotor_mass: float, bearing_number: float) -> str:
    """The margin of a point of the reference map and the linear threshold at its speed, as a list
    in Markdown.
    """
    m = reference_map()
    try:
        found = margin(m, rotor_mass, bearing_number)
    except InputError as error:
        return f"**No margin:** {error}."
    critical = [f"{c:.3g} kg" for c in critical_masses(linear_table_of(m), bearing_number)]
    told = [
        *found.sentences(),
        f"Linear stability threshold at this speed: {', '.join(critical) or 'none in the map'}.",
    ]
    return "\n".join(
        [
            f"**Regimes alone, read off the map.** {found.headline()}",
            "",
            *(f"- :small[{text}]" for text in told),
        ]
    )


def digits(value: float) -> str:
    """Four significant digits; from a thousand on a whole number."""
    return f"{value:,.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


@st.cache_resource(show_spinner=False)
def _predicted() -> dict[tuple[Hashable, ...], ServedMap]:
    # filled by hand: a cached function may not draw on the page, and training tells its progress
    # there
    return {}


def predicted_map(name: str, divisor: int, seed: int, floor: float | None = None) -> ServedMap:
    """The reference map, with a floor if one is given, predicted from 1/divisor of its cells:
    shipped, or out of the last forty, or trained now with progress.

    Raises ``InputError``.
    """
    known, key = _predicted(), (*_stamps(), name, divisor, seed, floor)
    found = known.get(key)
    if found is None:
        m, kind = reference_map(floor), model(name)
        context, place = get_script_run_ctx(), st.empty()

        def show(done: int, total: int) -> None:
            add_script_run_ctx(
                threading.current_thread(), context
            )  # trees are counted on another thread
            place.progress(done / total, f"Training: {kind.label} on n/{divisor} of the cells …")

        found = known[key] = find_map(m, kind, divisor, seed, folder=ARTIFACTS, progress=show)
        place.empty()
        for old in list(known)[:-40]:
            known.pop(old, None)
    return found


def predicted_point(rotor_mass: float, bearing_number: float) -> PointPrediction | None:
    """What the usual model says of a point of the reference map; None where no shipped one can be
    opened.
    """
    try:
        return predict_point(reference_map(), rotor_mass, bearing_number, folder=ARTIFACTS)
    except ArtifactError:
        return None


def time_text(predicted: ServedMap) -> str:
    """How long training and predicting took, and where."""
    train, predict = predicted.surrogate.seconds, predicted.predict_seconds
    if predicted.origin == "shipped":
        told = (
            ""
            if math.isnan(train)
            else f"; training took {train:.2f} s, the whole map {predict:.2f} s, as measured once"
        )
        return f"Predicted beforehand and shipped with spab{told}."
    begin = f"Trained in {train:.2f} s" if predicted.origin == "trained" else "Trained before"
    return f"{begin} on this machine, the whole map predicted in {predict:.2f} s."


@st.cache_resource(max_entries=16, show_spinner=False)
def _intervals(path: Path, finished: float | None, stamp: float) -> MapIntervals:
    return load_intervals(path, _map(stamp))


@st.cache_resource(max_entries=8, show_spinner="Training the classifier of the assessment …")
def _assessments(stamp: float, divisor: int, seed: int) -> dict[str, Any]:
    return score_labels(_map(stamp), ASSESSMENT, divisor, seed)


def scores_of_assessment(divisor: int, seed: int) -> dict[str, Any]:
    """How well the assessment is predicted from 1/divisor of the reference map's cells
    (:func:`~spab_core.surrogates.metrics.score_labels`), trained here once.

    Raises ``InputError``.
    """
    return _assessments(_stamp(), divisor, seed)


def intervals_of_job(job: Job) -> MapIntervals:
    """What a finished job of the kind "intervals" has found for the shipped map.

    Raises ``InputError``.
    """
    return _intervals(job.result, job.finished, _stamp())


_SCORES = {None: SCORES, FLOOR: FLOORED_SCORES}
_BLOCK_SCORES = {None: BLOCK_SCORES, FLOOR: FLOORED_BLOCK_SCORES}


@st.cache_resource(max_entries=8, show_spinner=False)
def _scores(stamp: float, name: str) -> pd.DataFrame:
    return load_reference_scores(ARTIFACTS, name)


@st.cache_resource(max_entries=4, show_spinner=False)
def _ranking(stamp: float, name: str, kind: str) -> pd.DataFrame:
    return ranking(_scores(stamp, name), kind)


def reference_scores(floor: float | None = None) -> pd.DataFrame:
    """The shipped scores of all surrogates, read and checked once for each version of the file.

    ``floor``: None or ``models.FLOOR``. Raises ``InputError``.
    """
    name = _SCORES[floor]
    return _scores(_stamp(name), name)


def reference_ranking(kind: str, floor: float | None = None) -> pd.DataFrame:
    """Models by the shipped scores, the best first; ``kind`` of cells as for
    ``ranking.ranking``. Raises ``InputError``.
    """
    name = _SCORES[floor]
    return _ranking(_stamp(name), name, kind)


def block_scores(floor: float | None = None) -> pd.DataFrame | None:
    """The shipped scores on withheld rectangles (``spab evaluate --split blocks``); ``floor`` as
    for :func:`reference_scores`. None where none are shipped. Raises ``InputError``.
    """
    return _shipped_scores(_BLOCK_SCORES[floor])


def classifier_scores(split: str) -> pd.DataFrame | None:
    """The shipped scores of the classifiers of regime and assessment (``spab evaluate
    --classifiers``), ``split`` of ``surrogates.models.SPLITS``. None where none are shipped. Raises
    ``InputError``.
    """
    return _shipped_scores(BLOCK_CLASSIFIERS if split == "blocks" else CLASSIFIERS)


def _shipped_scores(name: str) -> pd.DataFrame | None:
    return _scores(_stamp(name), name) if (ARTIFACTS / name).exists() else None
