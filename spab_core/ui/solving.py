"""Operating points solved live; until the solver is compiled, what is known of them without it."""

from __future__ import annotations

import streamlit as st

from spab_core.common.errors import InputError
from spab_core.common.words import capital
from spab_core.design.model import Design, reference_design
from spab_core.maps.stability_map import StabilityMap
from spab_core.surrogates.uncertainty import CONFIDENCE
from spab_core.trajectory import compiling
from spab_core.trajectory.compiling import is_compiled, is_linear_compiled
from spab_core.trajectory.point import OperatingPoint, solve_point
from spab_core.trajectory.settings import Settings
from spab_core.ui.own_map import cell_of, cell_words, find_example
from spab_core.ui.shared import predicted_point, reference_map

LIVE = Settings()  # those of the map, whose cells it meets
LIVE_PATHS = 48  # orders of the spectrum are 1/48 apart; halves and thirds fall on them
_EVERY = 1.0  # seconds between two looks at the compiler


@st.cache_resource(max_entries=64, show_spinner=False)
def _solve(
    design: Design, rotor_mass: float, bearing_number: float, settings: Settings
) -> OperatingPoint:
    compiled = is_compiled(settings, design)
    point = solve_point(design, rotor_mass, bearing_number, settings, path_revolutions=LIVE_PATHS)
    if not compiled:  # the seconds told are the compiler's
        point = solve_point(
            design, rotor_mass, bearing_number, settings, path_revolutions=LIVE_PATHS
        )
    return point


def live_point(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    settings: Settings = LIVE,
    *,
    words: bool = True,
) -> OperatingPoint | None:
    """Solve an operating point now, or take it from the last 64 solved.

    ``words``: whether what is known without the solver is shown while that is compiled.

    Returns
    -------
    OperatingPoint or None
        None as long as another process compiles the solver: what is known without it is on the
        page, which runs again by itself once the solver is there. Raises ``InputError``.
    """
    if waits_for_compiler(design, rotor_mass, bearing_number, words=words):
        return None
    text = "Solving this operating point …"
    if not is_compiled(settings, design):
        why = f" here, as {compiling.failure()}" if compiling.failure() else ""
        text = (
            f"First run on this machine: compiling the solver{_wall(design)}{why}. This takes "
            f"about {compiling.usual_seconds(design)} s, once."
        )
    with st.spinner(text):
        return _solve(design, rotor_mass, bearing_number, settings)


def waits_for_compiler(
    design: Design,
    rotor_mass: float,
    bearing_number: float,
    *,
    linear: bool = False,
    words: bool = True,
) -> bool:
    """Whether another process is still compiling; then what is known of the point (with ``words``),
    and how long it takes, are on the page.

    The page runs again by itself once the solver is there; with ``linear``, what linear theory
    needs of it, which is there before the rest."""
    if not _compiling(design, linear):
        return False
    if words:
        st.info(known_words(design, rotor_mass, bearing_number))
    st.fragment(_watch, run_every=_EVERY)(design, linear)
    return True


def _compiling(design: Design, linear: bool) -> bool:
    return compiling.seconds_so_far() is not None and not (
        is_linear_compiled(design) if linear else is_compiled(design=design)
    )


def _wall(design: Design) -> str:
    return " for a wall that stores gas" if design.bearing.stores_gas else ""


def _watch(design: Design, linear: bool) -> None:
    """What a fragment shows; the whole page runs again once the compiler is done."""
    gone = compiling.seconds_so_far()
    if gone is None or not _compiling(design, linear):
        st.rerun()
    seconds = compiling.usual_seconds(design)
    late = gone > seconds
    usual = (
        ""
        if linear
        else f", more than the usual {seconds} s"
        if late
        else f", some {seconds} s in all"
    )
    st.progress(
        min(gone / seconds, 1.0),
        f"Compiling the solver{_wall(design)}: {gone:.0f} s so far{usual}, once on this machine",
    )


def known_words(design: Design, rotor_mass: float, bearing_number: float) -> str:
    """What shipped results say of an operating point that is not solved, in Markdown."""
    head = "**Not solved yet.** "
    if design != reference_design():
        try:
            example = find_example(design)
        except InputError as error:
            return f"{head}{capital(str(error))}."
        cell = cell_of(example.found[1], rotor_mass, bearing_number) if example else None
        if example:
            there = (
                cell_words(example.found, cell)
                if cell
                else "The point lies outside that map: nothing is known of it yet."
            )
            return f"{head}**{example.words}.** {there}"
        return (
            head + "Nothing is known of this design yet: the shipped map and its models are of the "
            "example bearing."
        )
    try:
        m = reference_map()
    except InputError as error:
        return f"{head}{error}."
    plane = ((m.bearing_number, bearing_number), (m.rotor_mass, rotor_mass))
    if not all(axis[0] <= value <= axis[-1] for axis, value in plane):
        return head + "The point lies outside the shipped map: nothing is known of it yet."
    told = [_cell_words(m, m.nearest(rotor_mass, bearing_number))]
    if found := predicted_point(rotor_mass, bearing_number):
        told.append(
            f"**Predicted** for this point by the model {found.model.label}, trained on "
            f"{found.training_cells:,} cells of the map: MLE {found.mle:+.3f} per revolution, "
            f"{CONFIDENCE:.0%} interval {found.low:+.3f} to {found.high:+.3f}; {found.regime}, not "
            f"periodic with a probability of {found.probability_unstable:.0%}."
        )
    return "\n".join([f"{head}What is known of this point:", "", *(f"- {text}" for text in told)])


def _cell_words(m: StabilityMap, cell: tuple[int, int]) -> str:
    row, column = cell
    peak = f", largest eccentricity {m.max_eccentricity[cell]:.3f}" if m.regime[cell] else ""
    return (
        f"**From the shipped map**, the cell nearest to it (Λ {m.bearing_number[row]:.4g}, "
        f"{m.rotor_mass[column]:.4g} kg): {m.cell_text(row, column)} per revolution{peak}."
    )
