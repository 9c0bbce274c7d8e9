"""The page "Where to solve next" without a browser, on a small refinement: layers, table, download,
failures in words.
"""

import io
import json

import numpy as np
import pandas as pd
import pytest
import streamlit as st
from streamlit.delta_generator import DeltaGenerator
from streamlit.testing.v1 import AppTest

from spab_core.active_learning import learning_curve
from spab_core.active_learning.oracles import map_oracle
from spab_core.active_learning.refine import last, refine, save_refinement
from spab_core.plotting.surrogates import REFINE_LAYERS
from spab_core.shipped import manifest
from spab_core.shipped.manifest import REFINED, write_manifest
from spab_core.ui import shared
from tests.app.conftest import complaints
from tests.conftest import ROOT
from tests.maps import made_up_curve, map_of, with_hole

PAGE = str(next((ROOT / "pages").glob("*_Where_to_solve_next.py")))


@pytest.fixture
def small(tmp_path, monkeypatch):
    """A folder with a refinement of a known map and a made-up learning curve, in which refining
    meets its goal.
    """
    m = with_hole(map_of(lambda number, mass: 0.2 * number - 0.05 * mass))
    save_refinement(
        last(refine(m.bearing_number, m.rotor_mass, map_oracle(m), 60, metadata=m.metadata)),
        tmp_path / REFINED,
    )
    write_manifest(tmp_path)
    curve(tmp_path, (0.2, 0.95), (0.3, 0.94), (0.4, 0.90))
    for module in (manifest, shared):
        monkeypatch.setattr(module, "ARTIFACTS", tmp_path)
    monkeypatch.setattr(learning_curve, "LEARNING_CURVE", tmp_path / "curve.csv")
    st.cache_resource.clear()
    return tmp_path


def curve(folder, *values):
    rows = made_up_curve(*values)
    pd.concat([rows, rows.assign(judged="withheld", rmse=2.0 * rows["rmse"])]).to_csv(
        folder / "curve.csv", index=False
    )


def figure(at, k):
    return json.loads(at.get("plotly_chart")[k].proto.spec)


def test_every_layer_and_both_judgements(small):
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    assert not at.exception and not complaints(at)
    assert (
        "0.250" in at.success[0].value and "0.350" in at.success[0].value
    )  # the means of the made-up curve
    seen = set()
    for layer in REFINE_LAYERS:
        at.button_group(key="refine_layer").select(layer).run()
        assert not at.exception and not complaints(at)
        traces = {t.get("name"): t for t in figure(at, 0)["data"]}
        assert {"solved (60)", "solve next (24)"} <= traces.keys()
        seen.add(json.dumps(next(t for t in figure(at, 0)["data"] if t["type"] == "heatmap")["z"]))
    assert len(seen) == len(REFINE_LAYERS)
    before = figure(at, 1)
    at.button_group(key="judged").select("withheld").run()
    assert not at.exception and figure(at, 1) != before


def test_the_points_to_solve_next_are_cells_not_solved(small, monkeypatch):
    downloaded = []
    real = DeltaGenerator.download_button

    def seen(
        self, label, data, *more, **options
    ):  # AppTest does not hand out what a button downloads
        downloaded.append((label, data))
        return real(self, label, data, *more, **options)

    monkeypatch.setattr(DeltaGenerator, "download_button", seen)
    monkeypatch.setattr(
        st, "download_button", lambda *more, **options: seen(st._main, *more, **options)
    )
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    table = at.dataframe[0].value
    assert len(table) == 24 and {"bearing_number", "rotor_mass_kg", "in_doubt"} <= set(
        table.columns
    )
    refined = manifest.load_reference_refinement(small)
    row = [int(np.abs(refined.bearing_number - b).argmin()) for b in table["bearing_number"]]
    column = [int(np.abs(refined.rotor_mass - m).argmin()) for m in table["rotor_mass_kg"]]
    assert not refined.solved[row, column].any()
    assert [label for label, _ in downloaded] == [
        "Plane, HTML",
        "Plane, PNG",
        "Points, CSV",
        "Learning curve, CSV",
        "Data, NPZ",
    ]
    points, curve, data = (make() for _, make in downloaded[2:])
    pd.testing.assert_frame_equal(pd.read_csv(io.BytesIO(points)), table)
    assert len(pd.read_csv(io.BytesIO(curve))) == len(
        learning_curve.load_learning_curve(small / "curve.csv")
    )
    assert len(np.load(io.BytesIO(data))["bearing_number"]) == len(refined.bearing_number)


def test_a_missed_goal_is_no_success(small):
    curve(small, (0.2, 0.93), (0.3, 0.94), (0.4, 0.90))
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    assert not at.exception and not at.success and "0.930" in at.warning[0].value


def test_missing_files_are_said_in_words(small):
    (small / "curve.csv").unlink()
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    assert not at.exception and "benchmarks/learning_curve.py" in at.error[0].value
    (small / REFINED).write_bytes(b"changed")
    at = AppTest.from_file(PAGE, default_timeout=60).run()
    assert not at.exception and REFINED in at.error[0].value
