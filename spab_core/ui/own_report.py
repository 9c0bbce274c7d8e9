"""The report of one's own bearing: sections out of what a page knows, offered as files."""

from __future__ import annotations

from functools import partial

import streamlit as st

from spab_core.active_learning.refine import Refinement
from spab_core.design.model import Design
from spab_core.maps.margin import Margin
from spab_core.maps.stability_map import StabilityMap
from spab_core.plotting.point import orbit_figure, section_figure
from spab_core.reporting.export import browser_path
from spab_core.reporting.report import Section, design_section, report_html, report_pdf
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.provenance import film_nodes
from spab_core.ui.downloads import file_button
from spab_core.ui.margin import kept_margin
from spab_core.ui.own_map import own_figure
from spab_core.ui.shared import errors_in_words
from spab_core.ui.solving import live_point
from spab_core.ui.view import OWN_LAYERS


def report_downloads(
    design: Design,
    found: tuple[Refinement, StabilityMap],
    at: Margin | None,
    rotor_mass: float,
    bearing_number: float,
    map_command: str,
) -> None:
    """A popover with the report as HTML and PDF, made on the click; nothing is in it as long as the
    solver is compiled.

    Parameters
    ----------
    design : Design
    found : tuple
        The published map of the design.
    at : Margin or None
        Of the operating point in that map; None outside it.
    rotor_mass, bearing_number : float
        The operating point.
    map_command : str
        Command line that computes the map.
    """
    with st.popover("Report", icon=":material/description:"), errors_in_words():
        point = live_point(design, rotor_mass, bearing_number)
        if point is None:
            return
        html = partial(_html, found, at, point, map_command)
        file_button("Report, HTML", lambda: html().encode(), "report.html")
        file_button(
            "Report, PDF",
            lambda: report_pdf(html()),
            "report.pdf",
            disabled=browser_path() is None,
            help="Printed by Chromium or Chrome on the server",
        )


def _html(
    found: tuple[Refinement, StabilityMap],
    at: Margin | None,
    point: OperatingPoint,
    map_command: str,
) -> str:
    solved = kept_margin(point.design, point.rotor_mass, point.bearing_number)
    margin = [solved.headline(), *solved.sentences()] if solved else []
    margin += (
        [f"Regimes alone, read off the map. {at.headline()}", *at.sentences()]
        if at
        else ["The operating point is outside the map."]
    )
    sections = [
        design_section(point.design),
        _point_section(point),
        Section("Margin", margin),
        _map_section(found, point),
    ]
    commands = [
        f"spab simulate --design my.toml --rotor-mass {point.rotor_mass:g} --bearing-number "
        f"{point.bearing_number:.6g}",
        map_command,
    ]
    return report_html("Rotor on spherical porous gas bearings", sections, commands)


def _point_section(point: OperatingPoint) -> Section:
    state, judged = point.rest, point.assessment()
    words = [point.verdict(), judged.rest]
    if judged.reasons:
        words.append(f"Why: {'; '.join(judged.reasons)}.")
    if state is not None and state.status == "ok":
        words.append(
            f"Static equilibrium: eccentricity {state.eccentricity:.3f}, attitude angle "
            f"{state.attitude_angle:.1f}°."
        )
    title = (
        f"Operating point: {point.rotor_mass:g} kg on one bearing at "
        f"{point.design.speed_rpm(point.bearing_number):,.0f} rpm (Λ = {point.bearing_number:.4g})"
    )
    if point.mle is None:  # the run did not complete
        return Section(title, words)
    figures = {
        "Orbits at the operating point": orbit_figure(point),
        "Poincaré section": section_figure(point),
    }
    return Section(title, words, figures=figures)


def _map_section(found: tuple[Refinement, StabilityMap], point: OperatingPoint) -> Section:
    refined = found[0]
    words = (
        f"{int(refined.solved.sum()):,} of {refined.batch.size:,} cells solved (dots), the others "
        f"predicted by trees on linear theory; {film_nodes(refined.metadata)}, "
        f"{refined.metadata['transient']} + {refined.metadata['revolutions']} revolutions a cell."
    )
    figures = {
        f"{layer} over the plane": own_figure(found, layer, point.bearing_number, point.rotor_mass)
        for layer in OWN_LAYERS
    }
    return Section("Map", [words], figures=figures)
