"""A report is one file that needs no network."""

import re

import pandas as pd
import plotly.graph_objects as go

from spab_core.reporting.report import ASSUMPTIONS, Section, design_section, report_html, report_pdf


def report(design):
    figure = go.Figure(go.Scatter(x=[1, 2], y=[1, 3]))
    return report_html(
        "My <spindle>",
        [
            design_section(design),
            Section(
                "Margin",
                ["2.1 kg below & above"],
                {"Numbers": pd.DataFrame({"kg": [1.5, float("nan")]})},
                {"Orbit": figure},
            ),
        ],
        ["spab simulate --rotor-mass 4.52"],
    )


def test_one_file_with_everything(design):
    page = report(design)
    shown = page[page.index("<body>") :]
    for text in (
        "My &lt;spindle&gt;",
        "2.1 kg below &amp; above",
        "radial clearance C",
        "3.5e-05",
        "spab simulate",
        "Plotly.newPlot",
        ASSUMPTIONS[0],
    ):
        assert text in shown
    assert not re.search(r"<(script|link|img)[^>]* (src|href)=", page)
    assert (
        "rigid"
        in design_section(design.replace(rotor__shaft_stiffness=float("inf")))
        .tables.popitem()[1][""]
        .tolist()
    )


def test_printed_as_pdf(design, chromium):
    assert report_pdf(report(design)).startswith(b"%PDF-")
