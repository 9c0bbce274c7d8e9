"""Pictures for docs/results.md from the shipped data, drawn in Chromium: ``make results``."""

import csv
import sys
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from take_pictures import browser_page

from spab_core.active_learning.learning_curve import LEARNING_CURVE, load_learning_curve
from spab_core.linear_theory.equilibrium import concentric_stiffness
from spab_core.plotting.lines import bifurcation_figure
from spab_core.plotting.map import map_figure
from spab_core.plotting.surrogates import learning_curve_figure, refinement_figure
from spab_core.shipped.manifest import (
    BIFURCATIONS,
    load_reference_bifurcation,
    load_reference_map,
    load_reference_refinement,
)
from spab_core.solver.film import Mesh

DOCS = Path(__file__).resolve().parent
PICTURES = DOCS / "pictures"
WIDTH, HEIGHT = 1000, 640


def draw(page, figure, name):
    """One figure as PNG."""
    figure.update_layout(width=WIDTH, height=HEIGHT, template="plotly_white")
    page.set_content(figure.to_html(include_plotlyjs=True, config={"staticPlot": True}))
    page.wait_for_selector(".main-svg")
    page.wait_for_timeout(800)
    page.locator(".plotly-graph-div").screenshot(path=PICTURES / f"{name}.png")


def audit_figure(m):
    """The regimes of the map with the audited cells: agreeing and disagreeing."""
    figure = map_figure(m, "Regime")
    figure.data = [t for t in figure.data if t.name != "cells"]
    with (DOCS / "audit.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for agrees, name, marker in (
        (True, "agrees", {"symbol": "circle-open", "color": "#000000", "size": 6}),
        (
            False,
            "disagrees",
            {
                "symbol": "x",
                "color": "#CC79A7",
                "size": 12,
                "line": {"color": "#000000", "width": 1},
            },
        ),
    ):
        chosen = [r for r in rows if (r["map_regime"] == r["regime"]) == agrees]
        x, y = ([float(r[key]) for r in chosen] for key in ("bearing_number", "rotor_mass_kg"))
        figure.add_trace(
            go.Scatter(x=x, y=y, mode="markers", name=f"{name} ({len(chosen)})", marker=marker)
        )
    return figure


def stiffness_figure():
    """Largest error of the film's stiffness over the latitudes, a line for each row of the table of
    docs/model.md.
    """
    sys.path.insert(0, str(DOCS.parent))
    from tests.conftest import fed_design
    from tests.physics.test_film import TABLE

    figure, latitudes = go.Figure(), (2, 3, 4, 5, 6, 8, 10)
    groups = {}
    for edge, supply, beta, number, *exact in TABLE:
        design = fed_design(edge, supply, beta)
        errors = [
            abs(complex(*concentric_stiffness(design, number, Mesh(m, 8))) / complex(*exact) - 1.0)
            for m in latitudes
        ]
        groups.setdefault(f"edge {edge}°, P_s {supply}, β {beta}", []).append(errors)
    for k, (name, errors) in enumerate(groups.items()):
        figure.add_scatter(
            x=latitudes,
            y=np.max(errors, axis=0),
            mode="lines+markers",
            name=name,
            line={"color": ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7")[k]},
        )
    return figure.update_layout(
        xaxis={"title": "latitudes of the half band"},
        legend={"x": 0.98, "xanchor": "right", "y": 0.98},
        yaxis={
            "title": "largest relative error of the stiffness",
            "type": "log",
            "exponentformat": "power",
        },
    )


def main():
    m = load_reference_map()
    with browser_page(WIDTH + 40, HEIGHT + 40) as page:
        for layer, name in (("MLE", "map_mle"), ("Regime", "map_regime")):
            figure = map_figure(m, layer)
            figure.data = [t for t in figure.data if t.name != "cells"]
            draw(page, figure, name)
        for file in BIFURCATIONS:
            line = load_reference_bifurcation(file)
            for coordinate in ("X2", "Y2"):
                draw(
                    page, bifurcation_figure(line, [coordinate]), f"{Path(file).stem}_{coordinate}"
                )
        draw(page, stiffness_figure(), "stiffness")
        if (DOCS / "audit.csv").exists():
            draw(page, audit_figure(m), "audit")
        draw(page, refinement_figure(load_reference_refinement(), "Regime"), "refined_cells")
        draw(page, learning_curve_figure(load_learning_curve(LEARNING_CURVE)), "learning_curve")


if __name__ == "__main__":
    main()
