"""Verdicts on pages: a box whose colour and icon tell the regime, and an operating point's numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import streamlit as st

from spab_core.trajectory.point import OperatingPoint

_BOXES: dict[str, tuple[Callable[..., Any], str]] = {  # by regime; "": the run failed
    "periodic": (st.success, ":material/check_circle:"),
    "quasi-periodic": (st.warning, ":material/warning:"),
    "chaotic": (st.error, ":material/dangerous:"),
    "": (st.error, ":material/error:"),
}


def verdict_box(words: str, regime: str) -> None:
    """Show words in the box of a regime; "" for a run that failed."""
    box, icon = _BOXES[regime]
    box(words, icon=icon)


def stability_box(words: str, stable: bool) -> None:
    """Show words in the box of a stable (periodic) or an unstable point."""
    verdict_box(words, "periodic" if stable else "chaotic")


def point_verdict(point: OperatingPoint) -> None:
    """Show what a solved point does, in a sentence."""
    verdict_box(point.verdict(), point.regime.name if point.regime else "")


def point_numbers(point: OperatingPoint) -> list[tuple[str, str, str]]:
    """Return label, value and explanation of a point's numbers; none where the run failed."""
    if not point.mle:
        return []
    spread, least = point.mle.standard_error, 1.0 - point.max_eccentricity
    return [
        (
            "MLE per revolution",
            f"{point.mle.value:+.3f} ± {f'{spread:.3f}' if spread >= 0.0005 else '<0.001'}",
            "Maximum Lyapunov exponent, natural logarithm, ± its standard error by batch means (on "
            "a settled periodic orbit, the last change of its leading multiplier's rate): below "
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
            "Share of the time with a film under a tenth of the clearance C",
        ),
        (
            "Least film, µm",
            f"{1e6 * point.design.bearing.clearance * least:.1f}",
            "Clearance less the largest eccentricity",
        ),
    ]
