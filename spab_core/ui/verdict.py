"""Verdicts on pages: a box whose colour, icon and words tell what a motion is worth, and a point's
numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from spab_core.trajectory.assessment import Assessment
from spab_core.trajectory.point import OperatingPoint

_BOXES: dict[str, tuple[Callable[..., Any], str]] = {  # by grade
    "good": (st.success, ":material/check_circle:"),
    "watch": (st.warning, ":material/visibility:"),
    "avoid": (st.error, ":material/dangerous:"),
}
_SHOWN = 3  # reasons; the others are behind the question mark


def grade_box(words: str, grade: str) -> None:
    """Show words in the box of a grade of :data:`~spab_core.trajectory.assessment.GRADES`."""
    box, icon = _BOXES[grade]
    box(words, icon=icon)


def stability_box(words: str, stable: bool) -> None:
    """Show words on a border of regimes; that the motion repeats is no praise, so never in the
    colour of good.
    """
    if stable:
        st.info(words, icon=":material/info:")
    else:
        grade_box(words, "avoid")


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
    """Show what a solved point does and what that is worth."""
    assessment_box(point.assessment())
    if words := point.push_words():
        st.caption(words)


def point_numbers(point: OperatingPoint) -> list[tuple[str, str, str]]:
    """Return label, value and explanation of a point's numbers; none where the run failed."""
    if not point.mle:
        return []
    spread = point.mle.standard_error
    return [
        (
            "MLE per revolution",
            f"{point.mle.value:+.3f} ± {f'{spread:.3f}' if spread >= 0.0005 else '<0.001'}",
            "Maximum Lyapunov exponent, natural logarithm, ± its standard error by batch means (on "
            "a settled periodic orbit, the error of its leading multiplier's rate): below "
            "zero periodic, zero quasi-periodic, above zero chaotic",
        ),
        (
            "Max. eccentricity",
            f"{point.max_eccentricity:.3f}",
            "Largest eccentricity of the journal, over the clearance C",
        ),
        (
            "Time in contact",
            f"{100 * point.contact_share:.1f} %",
            "Share of the time in which the asperities of the wall carry more than a tenth of the "
            "load, weight and unbalance together",
        ),
        (
            "Least film, µm",
            f"{1e6 * point.least_film:.1f}",
            "Clearance less the largest eccentricity",
        ),
    ]
