"""Files for others say what the map says."""

import io

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from scipy.io import netcdf_file

from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes
from spab_core.reporting.export import browser_path, figure_html, figure_png, map_netcdf, map_table
from spab_core.shipped.manifest import load_reference_map


@pytest.fixture(scope="module")
def m():
    return load_reference_map()


def test_netcdf_holds_the_map_with_units_and_flags(m):
    with netcdf_file(io.BytesIO(map_netcdf(m)), mmap=False) as file:
        assert (
            np.array_equal(file.variables["mle"][:], m.mle)
            and file.variables["mle"].units == b"per revolution"
        )
        assert (
            np.array_equal(file.variables["rotor_mass"][:], m.rotor_mass)
            and file.variables["rotor_mass"].units == b"kg"
        )
        assert file.variables["mle"].dimensions == ("bearing_number", "rotor_mass")
        flags = file.variables["regime"]
        words = np.array(flags.flag_meanings.decode().split())[flags[:]]
        assert np.array_equal(words, m.regime)


def test_csv_has_one_row_a_cell(m):
    table = pd.read_csv(io.BytesIO(csv_bytes(map_table(m))))
    assert len(table) == m.mle.size
    row = table.iloc[250 * 3 + 7]
    assert row["bearing_number"] == pytest.approx(m.bearing_number[3])
    assert row["rotor_mass_kg"] == pytest.approx(m.rotor_mass[7])
    assert row["mle"] == pytest.approx(m.mle[3, 7]) and row["regime"] == m.regime[3, 7]


def test_figures_need_no_network(chromium):
    figure = go.Figure(go.Scatter(x=[1, 2], y=[1, 3]))
    page = figure_html(figure)
    assert b"plotly" in page[:100_000] and b'src="http' not in page
    assert figure_png(figure, 300, 200).startswith(b"\x89PNG")


def test_no_browser_is_a_sentence(monkeypatch):
    monkeypatch.setattr("choreographer.browsers.chromium.Chromium.find_browser", lambda **_: None)
    browser_path.cache_clear()
    try:
        with pytest.raises(InputError, match="take the HTML instead"):
            figure_png(go.Figure())
    finally:
        browser_path.cache_clear()
