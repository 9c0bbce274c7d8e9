"""What all Plotly figures share.

Colours are the Okabe-Ito set; scales are safe for colour-blind eyes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import plotly.graph_objects as go

JOURNAL, DISC, SECTION, NEUTRAL = "#0072B2", "#E69F00", "#D55E00", "#808080"
GREEN, PINK = "#009E73", "#CC79A7"
REGIME_COLOURS = {  # by trajectory.regimes.REGIMES; "": the run failed
    "periodic": "#56B4E9",
    "quasi-periodic": "#F0E442",
    "chaotic": "#D55E00",
    "undecided": "#CC79A7",
    "": "#999999",
}
GRADE_COLOURS = {  # by trajectory.assessment.GRADES
    "good": "#009E73",
    "watch": "#F0E442",
    "avoid": "#D55E00",
}
GRADE_MARKS = {"good": "✓", "watch": "!", "avoid": "✕"}  # colour is never alone
PERIOD_COLOURS = (REGIME_COLOURS["periodic"], "#0072B2", "#00334d")  # period 1, 2, 3 and more
MORE_IS_WORSE = "OrRd"  # scale of what a designer wants little of: from pale to dark red
CHOSEN = "chosen point"  # name of the trace that marks it
MLE_LIMIT = 0.6  # the colours saturate there; exponents of settled cells go far below
BEARING_NUMBER_LABEL, MASS_LABEL = "Bearing number Λ", "Rotor mass on one bearing, kg"
LOG_TICKS = [digit * 10.0**k for k in range(-3, 2) for digit in (1, 2, 5)]  # of errors


def add_legend_square(figure: go.Figure, label: str, colour: str) -> None:
    """Add a square of a colour to the legend, for what has no trace of its own."""
    figure.add_scatter(
        x=[None],
        y=[None],
        mode="markers",
        name=label,
        showlegend=True,
        marker={"color": colour, "size": 11, "symbol": "square"},
    )


def class_layer(
    figure: go.Figure, classes: Iterable[tuple[str, str, np.ndarray]]
) -> dict[str, Any]:
    """Return a heatmap's values and colours for cells in classes, and name those in the legend.

    Parameters
    ----------
    figure : Figure
        Its legend gets a square for each class that has cells.
    classes : iterable of (label, colour, mask)
        Masks of bool, all of the map's shape; a cell in none of them stays blank.

    Returns
    -------
    dict
        ``z``, of the masks' shape, and options of the heatmap.
    """
    known = list(classes)
    code, scale = np.full(known[0][2].shape, np.nan, np.float32), []
    for k, (label, colour, mask) in enumerate(known):
        code[mask] = k
        scale += [(k / len(known), colour), ((k + 1) / len(known), colour)]
        if mask.any():
            add_legend_square(figure, label, colour)
    return {
        "z": code,
        "zmin": -0.5,
        "zmax": len(known) - 0.5,
        "colorscale": scale,
        "showscale": False,
    }
