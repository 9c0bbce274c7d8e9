"""The report of one's own bearing: sections out of what a page knows, offered as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import streamlit as st

from spab_core.common.words import newtons
from spab_core.design.model import Design
from spab_core.maps.solved_margin import SolvedMargin
from spab_core.plotting.margin import margin_figure
from spab_core.plotting.point import orbit_figure, orbit_words, section_figure
from spab_core.reporting.datasets import bearings_words
from spab_core.reporting.export import browser_path
from spab_core.reporting.report import (
    Section,
    Summary,
    design_section,
    report_html,
    report_pdf,
)
from spab_core.trajectory.assessment import DEFAULT_LIMITS, Limits
from spab_core.trajectory.point import OperatingPoint
from spab_core.trajectory.provenance import film_nodes
from spab_core.ui.downloads import file_button
from spab_core.ui.drawings import sections_of
from spab_core.ui.margin import kept_margin
from spab_core.ui.own_map import Shown, cell_of, cell_words, own_figure
from spab_core.ui.shared import errors_in_words
from spab_core.ui.solving import live_point
from spab_core.ui.verdict import assumed_words
from spab_core.ui.view import OWN_LAYERS, chosen_limits, design_words, limits_option


def report_downloads(
    design: Design, shown: Shown | None, rotor_mass: float, bearing_number: float
) -> None:
    """A popover with the report (:func:`report_buttons`)."""
    with st.popover("Report", icon=":material/description:"):
        report_buttons(design, shown, rotor_mass, bearing_number)


def report_buttons(
    design: Design, shown: Shown | None, rotor_mass: float, bearing_number: float
) -> OperatingPoint | None:
    """Offer the report as HTML and PDF, made on the click; nothing as long as the solver is
    compiled.

    Parameters
    ----------
    design : Design
    shown : Shown, optional
        The map of the design.
    rotor_mass, bearing_number : float
        The operating point.

    Returns
    -------
    OperatingPoint or None
        What the report is of.
    """
    with errors_in_words():
        point = live_point(design, rotor_mass, bearing_number)
        if point is None:
            return None
        head = Head(
            st.session_state["project"],
            st.session_state["author"],
            design_words(),
            assumed_words(),
            chosen_limits(),
        )
        more = sections_of(design, rotor_mass, design.speed_rpm(bearing_number))
        html = partial(_html, head, shown, point, more)
        file_button("Report, HTML", lambda: html().encode(), "report.html")
        file_button(
            "Report, PDF",
            lambda: report_pdf(html()),
            "report.pdf",
            disabled=browser_path() is None,
            help="Printed by Chromium or Chrome on the server",
        )
    return point


@dataclass(frozen=True)
class Head:
    """What a report says of itself: taken on the page, as its file is made without one."""

    project: str
    author: str
    design: str
    assumed: list[str]
    limits: Limits


def _html(
    head: Head,
    shown: Shown | None,
    point: OperatingPoint,
    more: Sequence[Section],
) -> str:
    solved = kept_margin(point.design, point.rotor_mass, point.bearing_number, head.limits)
    told = solved.sentences() if solved else []
    if shown:
        cell = cell_of(shown.found[1], point.rotor_mass, point.bearing_number)
        told.append(
            cell_words(shown.found, cell) if cell else "The operating point is outside the map."
        )
    sections = [_point_section(point, head.limits)]
    if told:
        figures = {"What stands along speed and mass": margin_figure(solved)} if solved else {}
        sections.append(Section("Margin", told, figures=figures))
    if shown:
        sections.append(_map_section(shown, point))
    sections += more
    sections.append(design_section(point.design))
    at_point = f"--rotor-mass {point.rotor_mass:g} --bearing-number {point.bearing_number:.6g}"
    at_point += limits_option(head.limits)
    commands = [
        f"spab simulate --design my.toml {at_point}",
        f"spab margin --design my.toml {at_point}",
        *([shown.command] if shown else []),
    ]
    box = summary(point, solved, head.assumed, head.limits)
    lines = {"Project": head.project, "Author": head.author, "Design": head.design}
    title = f"Rotor on {bearings_words(point.design)}"
    return report_html(title, sections, commands, box=box, head=lines)


def summary(
    point: OperatingPoint,
    solved: SolvedMargin | None,
    assumed: Sequence[str],
    allowed: Limits = DEFAULT_LIMITS,
) -> Summary:
    """What a report begins with: verdict, limits in the machine's units, assumptions.

    Parameters
    ----------
    point : OperatingPoint
    solved : SolvedMargin, optional
        Its margin.
    assumed : sequence of str
        Values that nobody gave.
    allowed : Limits
        By which point and margin are judged.
    """
    judged = solved.assessment if solved else point.assessment(allowed)
    design, rpm = point.design, point.design.speed_rpm(point.bearing_number)
    clearance = 1e6 * design.bearing.clearance
    weight = point.rotor_mass * design.rotor.gravity
    rows = [
        ("Rotor mass on one bearing", f"{point.rotor_mass:.4g} kg, a load of {weight:.4g} N"),
        ("Shaft speed", f"{rpm:,.0f} rpm"),
    ]
    if point.mle is not None:
        rows += [
            (
                "Least film",
                f"{1e6 * point.least_film:.1f} µm of {clearance:.4g} µm, limit "
                f"{1e6 * allowed.film(design):.1f} µm",
            ),
            ("Contact", f"{100 * point.contact_share:.1f} % of the time"),
            ("Largest asperity force", f"{newtons(point.peak_contact_force)} N"),
        ]
    rows += [
        (f"Going {limit.towards()}", limit.words())
        for limit in (solved.limits if solved else ())
        if limit.begins and limit.grade == "avoid"
    ][:4]
    rows.append(("Margin", solved.headline() if solved else "not solved"))
    if assumed:
        rows.append(("Assumed, not given", "; ".join(assumed)))
    return Summary(judged.grade, judged.motion, judged.rest, rows)


def _point_section(point: OperatingPoint, allowed: Limits) -> Section:
    state, judged = point.rest, point.assessment(allowed)
    words = [point.verdict(), judged.rest]
    if judged.reasons:
        words.append(f"Why: {'; '.join(judged.reasons)}.")
    if state is not None and state.status == "ok":
        angle = state.attitude_angle
        words.append(
            f"Static equilibrium: eccentricity {state.eccentricity:.3f}"
            + ("." if angle is None else f", attitude angle {angle:.1f}°.")
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
    words += filter(None, [orbit_words(point)])
    return Section(title, words, figures=figures)


def _map_section(shown: Shown, point: OperatingPoint) -> Section:
    found, refined = shown.found, shown.found[0]
    words = (f"{shown.words}. " if shown.shipped else "") + (
        f"{int(refined.solved.sum()):,} of {refined.batch.size:,} cells solved (dots), the others "
        "predicted by trees on linear theory, with the probability of their assessment; "
        f"{film_nodes(refined.metadata)}, {refined.metadata['transient']} + "
        f"{refined.metadata['revolutions']} revolutions a cell."
    )
    figures = {
        f"{layer} over the plane": own_figure(found, layer, point.bearing_number, point.rotor_mass)
        for layer in OWN_LAYERS
    }
    return Section("Map", [words], figures=figures)
