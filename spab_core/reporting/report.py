"""A report to file with the drawing: design, operating points, figures, versions and command lines
in one HTML file, or as PDF.
"""

from __future__ import annotations

import base64
import dataclasses
import datetime
import gzip
import math
import platform
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import jinja2
import numba
import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from spab_core._version import __version__
from spab_core.common.errors import InputError
from spab_core.design.model import Design, Value
from spab_core.reporting.export import browser_path
from spab_core.solver.cache import solver_hash

PDF_SECONDS = 120
WIDE, SQUARE = (680, 400), 335  # pixels: figures as wide as a printed page, and as half of it
ASSUMPTIONS = (
    "Isothermal ideal gas in a thin film (compressible Reynolds equation) over a spherical or "
    "cylindrical band open at both edges; no slip, no misalignment; the journal is held along the "
    "axis unless the design lets it move.",
    "Thin porous wall with radial Darcy flow from a chamber at constant supply pressure; its pores "
    "store gas where a porosity is given, else it is taken as quasi-steady.",
    "Rotor of a disc and a journal on an elastic shaft, unbalance in the disc; rotor masses are "
    "the share on one bearing.",
    "Wall contact as an exponential asperity force with Coulomb friction; no wear, no heat.",
    "Every point starts cold: rotor at rest at the centre, load and unbalance raised over 30 "
    "revolutions. Other starts can lead to other motions where several coexist.",
    "The exponent is the growth of small disturbances per revolution: below zero periodic, zero "
    "quasi-periodic, above zero chaotic.",
)
_TEMPLATE = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent),
    autoescape=True,
    trim_blocks=True,
    undefined=jinja2.StrictUndefined,
).get_template("report.html.j2")


@dataclass(frozen=True)
class Section:
    """A part of a report: paragraphs as plain text, then tables, then figures.

    Attributes
    ----------
    title : str
    paragraphs : sequence of str
    tables, figures : mapping
        Tables and Plotly figures by their captions.
    """

    title: str
    paragraphs: Sequence[str] = ()
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    figures: Mapping[str, go.Figure] = field(default_factory=dict)


def design_section(design: Design) -> Section:
    """Return the section with every value of the design and its unit."""
    rows = []
    for part in design.to_dict():
        values = getattr(design, part)
        rows += [
            {
                "part": part,
                "value": f.metadata["text"],
                "": _digits(getattr(values, f.name)),
                "unit": f.metadata["unit"],
            }
            for f in dataclasses.fields(values)
            if f.name not in values.unused
        ]
    groups = (
        f"Porous feeding number β = {design.feeding_number:.4g}; shaft stiffness K = "
        f"{design.shaft_stiffness_number:.4g}; unbalance ρ = "
        f"{design.unbalance_number:.4g}; Λ = 1 is {design.speed_rpm(1.0):,.0f} rpm."
    )
    told = [text for text in (design.name, design.notes) if text]
    return Section(
        "Design", [*told, groups], {"Values of the design, SI units": pd.DataFrame(rows)}
    )


def _digits(value: Value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    return "rigid" if math.isinf(value) else f"{value:.6g}"


@dataclass(frozen=True)
class Summary:
    """The box that a report begins with.

    Attributes
    ----------
    grade : str
        One of :data:`spab_core.trajectory.assessment.GRADES`.
    motion, rest : str
        The verdict's two sentences.
    rows : sequence of (str, str)
        What else counts, by its name: limits, assumptions.
    """

    grade: str
    motion: str
    rest: str
    rows: Sequence[tuple[str, str]] = ()


def _fitted(figure: go.Figure) -> go.Figure:
    """A figure as wide as a printed page, or as half of it if it is square."""
    square = figure.layout.yaxis.scaleanchor is not None
    height = min(figure.layout.height or WIDE[1], WIDE[1])
    size = {"width": SQUARE, "height": SQUARE} if square else {"width": WIDE[0], "height": height}
    return go.Figure(figure).update_layout(template="plotly_white", **size)


def _packed(text: str) -> str:
    """A text compressed, in base64; the browser unpacks it (Plotly alone has five megabytes)."""
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def report_html(
    title: str,
    sections: Sequence[Section],
    commands: Sequence[str] = (),
    *,
    box: Summary | None = None,
    head: Mapping[str, str] | None = None,
) -> str:
    """Return the report as one HTML page that needs no network.

    Parameters
    ----------
    title : str
    sections : sequence of Section
    commands : sequence of str
        Command lines that compute the same.
    box : Summary, optional
        What the page begins with.
    head : mapping, optional
        Words by their names, such as the author; empty ones are left out.
    """
    figures = [_fitted(figure) for section in sections for figure in section.figures.values()]
    return _TEMPLATE.render(
        box=box,
        head={name: words for name, words in (head or {}).items() if words},
        title=title,
        date=f"{datetime.datetime.now():%Y-%m-%d %H:%M}",
        sections=sections,
        commands=commands,
        assumptions=ASSUMPTIONS,
        versions={
            "spab": __version__,
            "solver": solver_hash(),
            "python": platform.python_version(),
            "numpy": np.__version__,
            "numba": numba.__version__,
        },
        sizes=[(figure.layout.width, figure.layout.height) for figure in figures],
        figures=_packed(f"[{','.join(figure.to_json() for figure in figures)}]"),
        plotly_js=_packed(get_plotlyjs()),
    )


def report_pdf(page: str) -> bytes:
    """Print a page of :func:`report_html` as PDF with a browser of this machine.

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
