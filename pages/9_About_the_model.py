"""About the model: equations, assumptions, validation and results, as docs/ tell them."""

import streamlit as st

from spab_core.plotting.surrogates import audit_figure
from spab_core.shipped import manifest
from spab_core.shipped.manifest import load_audit
from spab_core.ui.documents import read_sections, show_sections
from spab_core.ui.downloads import downloads
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.view import ABOUT_TABS

AUDIT, CHECKED, DIFFERS = (
    "Audit of the map",
    "Values to check against",
    "Where we differ from the paper",
)

page_head("model and validation")
head, button = st.columns([5, 1], vertical_alignment="center")
head.markdown("# Model and validation")
with errors_in_words():
    model, numerics, results = (
        read_sections(name, wanted)
        for name, wanted in (
            ("model.md", (CHECKED, DIFFERS)),
            ("numerics.md", ()),
            ("results.md", (AUDIT,)),
        )
    )
    audited = load_audit(manifest.AUDIT)

with button:
    downloads(
        "about",
        {"Audit": lambda: audit_figure(audited)},
        {"Audited cells": audited.copy},
        command="python benchmarks/audit_map.py",
    )


def _equations() -> None:
    show_sections(
        {heading: body for heading, body in model.items() if heading not in (CHECKED, DIFFERS)}
    )


def _validation() -> None:
    show_sections({AUDIT: results[AUDIT]})
    st.plotly_chart(audit_figure(audited), key="audit", width="stretch")
    show_sections({CHECKED: model[CHECKED]} | numerics)


def _results() -> None:
    show_sections({heading: body for heading, body in results.items() if heading != AUDIT})


def _differs() -> None:
    st.markdown(
        'The paper is Kuo, Lee and Wang, "A High-Precision Random Forest-Based Maximum Lyapunov '
        "Exponent Prediction "
        'Model for Spherical Porous Gas Bearing Systems", IEEE Access 8 (2020), doi '
        "10.1109/ACCESS.2020.3022854."
    )
    show_sections({DIFFERS: model[DIFFERS]})


for tab, show in zip(
    st.tabs(ABOUT_TABS, key="about_tab", on_change="rerun"),
    (_equations, _validation, _results, _differs),
    strict=True,
):
    if tab.open:
        with tab:
            show()
