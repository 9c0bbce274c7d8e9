"""Verdicts on pages: a box whose colour, icon and words tell what a motion is worth, and a point's
numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from spab_core.common.words import newtons, small
from spab_core.design.form import FIELDS, SUPPLY, grade_of_eccentricity, to_form, unused
from spab_core.plotting.theme import GRADE_MARKS
from spab_core.trajectory.assessment import GRADE_WORDS, Assessment
from spab_core.trajectory.point import OperatingPoint
from spab_core.ui.navigation import page_link
from spab_core.ui.view import (
    assumed_values,
    chosen_design,
    chosen_limits,
    chosen_point,
    with_unit,
)

_BOXES: dict[str, tuple[Callable[..., Any], str]] = {  # by grade
    "good": (st.success, ":material/check_circle:"),
    "watch": (st.warning, ":material/visibility:"),
    "avoid": (st.error, ":material/dangerous:"),
}
_TELLING = (  # values of a design, the first to be named among those assumed
    "rotor__unbalance_eccentricity",
    "rotor__shaft_stiffness",
    "bearing__wall_thickness",
    "bearing__permeability",
    SUPPLY,
    "bearing__clearance",
    "bearing__radius",
)
_NAMED = 4  # of them
_SHOWN = 3  # reasons; the others are behind the question mark


def grade_box(words: str, grade: str) -> None:
    """Show words in the box of a grade of :data:`~spab_core.trajectory.assessment.GRADES`."""
    box, icon = _BOXES[grade]
    box(words, icon=icon)


def grade_label(grade: str) -> str:
    """A grade in words behind its mark, for a table."""
    return f"{GRADE_MARKS[grade]} {GRADE_WORDS[grade]}"


def assessment_box(found: Assessment) -> None:
    """Show the two lines of a verdict, motion and equilibrium, and the gravest reasons."""
    grade_box(f"**{found.motion}**  \n{found.rest}", found.grade)
    if found.reasons:
        told, more = found.reasons[:_SHOWN], found.reasons[_SHOWN:]
        st.caption(
            "Why: " + "; ".join(told) + (f"; and {len(more)} more" if more else "") + ".",
            help="\n".join(f"- {reason}" for reason in found.reasons),
        )


def point_verdict(point: OperatingPoint) -> None:
    """Show what a solved point does and what that is worth, and what was assumed for it."""
    assessment_box(point.assessment(chosen_limits()))
    if words := point.push_words():
        st.caption(words)
    if point.design == chosen_design():
        assumed_line()


def assumed_words() -> list[str]:
    """What was assumed of the chosen design and not typed, such as "unbalance eccentricity 13 µm
    (G 27)"; the most telling first.
    """
    design = chosen_design()
    names = set(assumed_values()) - unused(design)
    values, told = to_form(design), []
    for name in sorted(names, key=lambda n: (*_TELLING, *FIELDS).index(n)):
        field = FIELDS[name]
        words = f"{small(field.label)} {with_unit(field, values[name])}"
        if name == _TELLING[0]:
            rpm = design.speed_rpm(chosen_point()[1])
            share = design.rotor.journal_mass_fraction
            grade = grade_of_eccentricity(design.rotor.unbalance_eccentricity, rpm, share)
            words += f" (G {grade:.2g})"
        told.append(words)
    return told


def assumed_line() -> None:
    """Say what was assumed and not typed, with a link to change it."""
    told = assumed_words()
    if not told:
        return
    if not chosen_design().rotor.conical:
        told.insert(_NAMED - 1, "no conical motion (its inertias are not given)")
    more = f" and {len(told) - _NAMED} more" if len(told) > _NAMED else ""
    with st.container(horizontal=True, vertical_alignment="center", gap="small", key="assumed"):
        st.caption(
            f"Assumed, not typed: {', '.join(told[:_NAMED])}{more}.",
            help="\n".join(f"- {words}" for words in told),
            width="stretch",
        )
        page_link("My_bearing", "Change what is assumed")


def point_numbers(point: OperatingPoint) -> list[tuple[str, str, str]]:
    """Return label, value and explanation of a point's numbers; none where the run failed."""
    if not point.mle:
        return []
    spread = point.mle.standard_error
    return [
        (
            "Exponent (MLE) per revolution",
            f"{point.mle.value:+.3f} ± {f'{spread:.3f}' if spread >= 0.0005 else '<0.001'}",
            "Maximum Lyapunov exponent, natural logarithm, ± its standard error by batch means (on "
            "a settled periodic orbit, the error of its leading multiplier's rate): below "
            "zero periodic, zero quasi-periodic, above zero chaotic",
        ),
        (
            "Largest eccentricity",
            f"{point.max_eccentricity:.3f}",
            "Largest eccentricity of the journal, over the clearance C",
        ),
        (
            "Contact share",
            f"{100 * point.contact_share:.1f} %",
            "Share of the time in which the asperities of the wall carry more than a tenth of the "
            "load, weight and unbalance together",
        ),
        (
            "Least film, µm",
            f"{1e6 * point.least_film:.1f}",
            "Clearance less the largest eccentricity",
        ),
        (
            "Largest asperity force, N",
            newtons(point.peak_contact_force),
            "Largest normal force of the wall's asperities on the journal",
        ),
        *(
            [
                (
                    "Along the axis",
                    "{:+.3f} to {:+.3f}".format(*point.axial_range),
                    "Least and largest displacement along the axis, over the clearance C; the "
                    "largest eccentricity beside it is one less the least film over C",
                )
            ]
            if point.axial_range
            else []
        ),
    ]


def point_rows(point: OperatingPoint) -> dict[str, str]:
    """Return a point's numbers with their units, by name, to stand beside another's."""
    found, rest = point.assessment(chosen_limits()), point.rest
    rows = {"assessment": grade_label(found.grade), "why": "; ".join(found.reasons[:1])}
    rows |= {label: value for label, value, _ in point_numbers(point)}
    if rest is None or rest.status != "ok" or rest.gas_flow is None:
        return rows
    rows |= {
        "Eccentricity at rest": f"{rest.eccentricity:.3f}",
        "Weight on the wall at rest, %": f"{100.0 * (rest.contact_load_share or 0.0):.2g}",
        "Gas flow, normal litres per minute": rest.gas_flow.words,
        "Balance quality G, mm/s": f"{rest.balance_grade:.3g}",
    }
    if rest.whirl:
        grows = "decays" if rest.whirl.stable else "grows"
        rows["Least stable whirl, cycles/min"] = f"{rest.whirl.speed_rpm:,.0f} ({grows})"
    if rest.axial:
        grows = "decays" if rest.axial.stable else "grows"
        rows["Along the axis at rest, cycles/min"] = f"{rest.axial.speed_rpm:,.0f} ({grows})"
    return rows
