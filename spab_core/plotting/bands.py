"""Bands of what a motion is worth, behind a figure over a line of operating points: in colour, by a
mark and in words.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go

from spab_core.maps.bifurcation import Band
from spab_core.plotting.theme import GRADE_COLOURS, GRADE_MARKS, add_legend_square
from spab_core.trajectory.assessment import GRADE_WORDS, GRADES

_MARKED, _WORDED = 0.03, 0.25  # narrowest band with a mark, and with words, over the axis
_LETTER = 0.015  # width of one over the axis, in a figure half as wide as a page


def add_grade_bands(figure: go.Figure, values: np.ndarray, found: Sequence[Band]) -> None:
    """Shade the bands of a line behind all panels, and name each grade in the legend.

    Parameters
    ----------
    figure : Figure
        Over ``values`` on its axis x.
    values : ndarray, (n,)
        Rising.
    found : sequence of Band
        Of :func:`spab_core.maps.bifurcation.bands`. Each reaches halfway to its neighbours.
    """
    if not found:
        return
    # not the grade at rest
    figure.update_layout(legend_title={"text": "Motion:", "side": "left"})
    step = 0.5 * (values[1:] + values[:-1])
    half = 0.5 * float(np.diff(values).min()) if len(values) > 1 else 0.5
    edges = np.concatenate([[values[0] - half], step, [values[-1] + half]])
    whole = edges[-1] - edges[0]
    for grade in GRADES:
        if any(band.grade == grade for band in found):
            label = f"{GRADE_MARKS[grade]} {GRADE_WORDS[grade]}"
            add_legend_square(figure, label, GRADE_COLOURS[grade])
    shapes, marks = [], []
    for band in found:
        low, high = float(edges[band.first]), float(edges[band.last + 1])
        shapes.append(
            {
                "type": "rect",
                "x0": low,
                "x1": high,
                "xref": "x",
                "y0": 0,
                "y1": 1,
                "yref": "paper",
                "fillcolor": GRADE_COLOURS[band.grade],
                "opacity": 0.22,
                "line": {"width": 0},
                "layer": "below",
                "name": band.grade,
            }
        )
        share = (high - low) / whole
        if share < _MARKED:
            continue
        text = GRADE_MARKS[band.grade]
        if share >= _WORDED:
            told = GRADE_WORDS[band.grade], band.why
            words = (": ".join(filter(None, told)), told[0])  # the longest that fits
            text += next((f" {w}" for w in words if len(w) <= int(share / _LETTER)), "")
        marks.append(
            {
                "x": 0.5 * (low + high),
                "xref": "x",
                "y": 1.0,
                "yref": "paper",
                "yanchor": "top",
                "text": text,
                "hovertext": f"{GRADE_WORDS[band.grade]}{band.why and ': '}{band.why}",
                "showarrow": False,
                "font": {"size": 11},
            }
        )
    # all at once: added one by one each is checked again with each that follows
    figure.layout.shapes += tuple(go.layout.Shape(shape) for shape in shapes)
    figure.layout.annotations += tuple(go.layout.Annotation(mark) for mark in marks)
