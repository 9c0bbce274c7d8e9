"""A report for the drawer: design, operating points, figures, versions and command lines in one
HTML file, or as PDF.
"""

from __future__ import annotations

import dataclasses
import datetime
import html
import math
import platform
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numba
import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from spab_core._version import __version__
from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.reporting.export import browser_path
from spab_core.solver.cache import solver_hash

PDF_SECONDS = 120
ASSUMPTIONS = (
    "Isothermal ideal gas in a thin film (compressible Reynolds equation) over a spherical band "
    "open at both edges; no slip, "
    "no misalignment, no axial motion.",
    "Thin porous wall with radial, quasi-steady Darcy flow from a chamber at constant supply "
    "pressure.",
    "Rotor of a disc and a journal on an elastic shaft, unbalance in the disc; rotor masses are "
    "the share on one bearing.",
    "Wall contact as an exponential asperity force with Coulomb friction; no wear, no heat.",
    "Every point starts cold: rotor at rest at the centre, load and unbalance raised over 30 "
    "revolutions. Other starts can "
    "lead to other motions where several coexist.",
    "The exponent is the growth of small disturbances per revolution: below zero periodic, zero "
    "quasi-periodic, above zero "
    "chaotic.",
)
_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2rem auto;padding:0 1rem;color:#1a1a1a;background:#fff}
h1{font-size:1.6rem} h2{font-size:1.2rem;margin-top:2rem;border-bottom:1px solid #ccc}
table{border-collapse:collapse;margin:.5rem 0} th,td{padding:.15rem .8rem .15rem 0;text-align:left;border-bottom:1px solid #eee}
pre{background:#f4f4f4;padding:.6rem;white-space:pre-wrap} figure{margin:1rem 0;break-inside:avoid}
figcaption{color:#555;font-size:.9rem} @page{margin:15mm} @media print{.modebar{display:none}} h2{break-after:avoid}"""


@dataclass(frozen=True)
class Section:
    """A part of a report: plain paragraphs, tables and figures by their captions, in this order.

    Attributes
    ----------
    title : str
    paragraphs : sequence of str
    tables, figures : mapping
        Table or Plotly figure by its caption.
    """

    title: str
    paragraphs: Sequence[str] = ()
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    figures: Mapping[str, go.Figure] = field(default_factory=dict)


def design_section(design: Design) -> Section:
    """The drawing: every value with its unit."""
    rows = []
    for part in dataclasses.fields(design):
        values = getattr(design, part.name)
        rows += [
            {
                "part": part.name,
                "value": f.metadata["text"],
                "": _digits(getattr(values, f.name)),
                "unit": f.metadata["unit"],
            }
            for f in dataclasses.fields(values)
        ]
    groups = (
        f"Porous feeding number β = {design.feeding_number:.4g}; shaft stiffness K = "
        f"{design.shaft_stiffness_number:.4g}; unbalance ρ = "
        f"{design.unbalance_number:.4g}; Λ = 1 is {design.speed_rpm(1.0):,.0f} rpm."
    )
    return Section("Design", [groups], {"Values of the design, SI units": pd.DataFrame(rows)})


def _digits(value: float) -> str:
    return "rigid" if math.isinf(value) else f"{value:.6g}"


def report_html(title: str, sections: Sequence[Section], commands: Sequence[str] = ()) -> str:
    """The report as one HTML page that needs no network.

    Parameters
    ----------
    title : str
    sections : sequence of Section
    commands : sequence of str
        Command lines that compute the same.
    """
    body = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{datetime.datetime.now():%Y-%m-%d %H:%M}, spab {__version__}</p>",
    ]
    for section in sections:
        body.append(f"<h2>{html.escape(section.title)}</h2>")
        body += [f"<p>{html.escape(text)}</p>" for text in section.paragraphs]
        for caption, table in section.tables.items():
            body.append(
                f"<p><b>{html.escape(caption)}</b></p>{table.to_html(index=False, border=0, na_rep='–')}"
            )
        for caption, figure in section.figures.items():
            drawn = go.Figure(figure).update_layout(template="plotly_white")
            body.append(
                f"<figure>{drawn.to_html(full_html=False, include_plotlyjs=False, config={'displaylogo': False})}"
                f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            )
    body.append(
        "<h2>Assumptions</h2><ul>"
        + "".join(f"<li>{html.escape(text)}</li>" for text in ASSUMPTIONS)
        + "</ul>"
    )
    versions = {
        "spab": __version__,
        "solver": solver_hash(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }
    body.append(
        "<h2>Versions</h2><p>"
        + ", ".join(f"{name} {version}" for name, version in versions.items())
        + "</p>"
    )
    if commands:
        body.append(
            "<h2>The same on the command line</h2><pre>"
            + html.escape("\n".join(commands))
            + "</pre>"
        )
    return (
        "<!doctype html><html lang=en><head><meta charset=utf-8><meta name=viewport "
        "content='width=device-width'>"
        f"<title>{html.escape(title)}</title><style>{_STYLE}</style><script>{get_plotlyjs()}</script></head><body>"
        + "".join(body)
        + "</body></html>"
    )


def report_pdf(page: str) -> bytes:
    """A page of :func:`report_html` printed as PDF by a browser of this machine.

    Raises
    ------
    InputError
        Where there is no browser, or it does not print.
    """
    browser = browser_path()
    if browser is None:
        raise InputError(
            "a PDF is printed by Chromium or Chrome, and none is found on this machine: take the "
            "HTML instead"
        )
    with tempfile.TemporaryDirectory(prefix="spab-report-", ignore_cleanup_errors=True) as folder:
        source, target = Path(folder) / "report.html", Path(folder) / "report.pdf"
        source.write_text(page, "utf-8")
        command = [
            browser,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-pdf-header-footer",
            "--virtual-time-budget=20000",
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={target}",
            source.as_uri(),
        ]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=PDF_SECONDS)
            return target.read_bytes()
        except (OSError, subprocess.SubprocessError) as error:
            raise InputError(
                f"the browser did not print the report ({type(error).__name__}): take the HTML "
                "instead"
            ) from None
