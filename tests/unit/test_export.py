"""Files for others say what the map says."""

import dataclasses
import io
import json

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import loadmat, netcdf_file

from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes
from spab_core.common.words import newtons
from spab_core.design.model import reference_design
from spab_core.design.presets import preset
from spab_core.maps.bifurcation import line_of_map, load_bifurcation, save_bifurcation
from spab_core.maps.stability_map import FIELDS, load_map
from spab_core.reporting.datasets import (
    line_dataset,
    map_dataset,
    matlab_bytes,
    netcdf_bytes,
    point_dataset,
)
from spab_core.reporting.export import (
    WRITERS,
    browser_path,
    figure_html,
    figure_png,
    map_netcdf,
    map_table,
    result_dataset,
)
from spab_core.shipped.manifest import ARTIFACTS, REFINED, load_reference_map
from spab_core.solver.film import Mesh
from spab_core.trajectory.assessment import DEFAULT_LIMITS
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.point_file import save_point
from spab_core.trajectory.settings import Settings
from spab_core.ui.own_report import Head, _html, summary
from tests.maps import map_of


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
    film = m.design.bearing.clearance * (1.0 - m.max_eccentricity[3, 7])
    assert row["least_film_m"] == pytest.approx(film) and 0.0 < film < 35e-6


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


@pytest.fixture(scope="module")
def point():
    settings = Settings(Mesh(2, 16), transient=30, revolutions=20, early_stop=False)
    return solve_point(reference_design(), 4.0, 3.0, settings, path_revolutions=2)


@pytest.fixture(scope="module")
def line(m):
    return line_of_map(m, "rotor-mass", 3.45)


def test_an_exported_map_is_read_back_to_the_bit(m, tmp_path):
    (tmp_path / "map.nc").write_bytes(map_netcdf(m))
    found = load_map(tmp_path / "map.nc")
    for name in ("bearing_number", "rotor_mass", *FIELDS):
        assert np.array_equal(
            getattr(found, name), getattr(m, name), equal_nan=getattr(m, name).dtype.kind == "f"
        ), name
        assert getattr(found, name).dtype == getattr(m, name).dtype
    assert found.metadata == m.metadata


@given(st.data())
def test_a_damaged_netcdf_map_is_a_sentence(small_netcdf, tmp_path_factory, data):
    content = bytearray(small_netcdf)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(3, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.getbasetemp() / "damaged.nc"
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
    try:
        found = load_map(path)
    except InputError:
        return
    assert found.mle.size  # what was changed is a value that may be


@pytest.fixture(scope="module")
def small_netcdf():
    return map_netcdf(map_of(lambda number, mass: 0.2 * number - 0.05 * mass, 3, 4))


def test_each_title_names_the_shape_of_the_bearings(m, line, point):
    cylinder = preset("carbon_bushing").design
    about = {"metadata": m.metadata | {"design": cylinder.to_dict()}}
    for found, dataset in ((m, map_dataset), (line, line_dataset)):
        assert "on spherical porous" in dataset(found).title
        assert "on cylindrical porous" in dataset(dataclasses.replace(found, **about)).title
    assert "on spherical porous" in point_dataset(point).title
    other = dataclasses.replace(point, design=cylinder)
    assert "on cylindrical porous" in point_dataset(other).title
    html = _html(Head("", "", "", [], DEFAULT_LIMITS), None, other, [])
    assert "<h1>Rotor on cylindrical porous gas bearings</h1>" in html


def test_the_box_of_a_report_has_film_and_force(point):
    rows = dict(summary(point, None, []).rows)
    assert rows["Least film"].startswith(f"{1e6 * point.least_film:.1f} µm of 35 µm")
    assert rows["Largest asperity force"] == f"{newtons(point.peak_contact_force)} N"


@pytest.mark.parametrize(
    ("force", "words"),
    [
        (0.0, "0"),
        (1e-9, "under 0.01"),
        (12.345, "12.3"),
        (3456.7, "3,457"),
        (np.nan, "not measured"),
    ],
)
def test_a_force_as_it_is_told(force, words):
    assert newtons(force) == words


def test_a_line_holds_its_sweeps_with_units(line):
    data = line_dataset(line)
    branch = line.branches["cold"]
    with netcdf_file(io.BytesIO(netcdf_bytes(data)), mmap=False) as file:
        v = file.variables
        assert np.array_equal(v["rotor_mass"][:], line.values)
        assert v["bearing_number"].getValue() == line.at and v["rotor_mass"].units == b"kg"
        assert np.array_equal(v["cold_mle"][:], branch.mle)
        words = np.array(v["cold_regime"].flag_meanings.decode().split())[v["cold_regime"][:]]
        assert np.array_equal(words, branch.regime)
        assert json.loads(file.metadata)["design"] == line.metadata["design"]
    found = loadmat(io.BytesIO(matlab_bytes(data)), simplify_cells=True)
    assert np.array_equal(found["cold_mle"], branch.mle)
    assert list(found["cold_regime"]) == list(branch.regime)
    assert found["units"]["cold_mle"] == "per revolution"
    assert len(data.table) == len(line.values)
    film = line.design.bearing.clearance * (1.0 - branch.max_eccentricity)
    assert np.allclose(data.table["least_film_m"], film, equal_nan=True)
    assert np.allclose(found["cold_least_film"], film, equal_nan=True)
    assert found["units"]["cold_least_film"] == "m" and np.isfinite(film).all()


def test_a_point_holds_its_motion(point):
    data = point_dataset(point)
    t = point.trajectory
    with netcdf_file(io.BytesIO(netcdf_bytes(data)), mmap=False) as file:
        assert np.array_equal(file.variables["path"][:], t.path)
        assert np.array_equal(file.variables["max_eccentricity"][:], t.peak)
        assert file.variables["mle"].getValue() == point.mle.value
    found = loadmat(io.BytesIO(matlab_bytes(data)), simplify_cells=True)
    assert np.array_equal(found["section"], t.section)
    assert found["rotor_mass"] == 4.0 and found["units"]["peak_contact_force"] == "N"
    assert np.allclose(found["peak_contact_force"], t.force * point.design.force_unit)
    assert np.array_equal(data.table["X2"], t.section[:, 0]) and len(data.table) == 20


def test_a_failed_run_is_exported_too(point):
    empty = dataclasses.replace(
        point.trajectory, growth=np.empty(0), path=np.empty((0, 96, 8)), status="diverged"
    )
    data = point_dataset(dataclasses.replace(point, trajectory=empty, mle=None, regime=None))
    with netcdf_file(io.BytesIO(netcdf_bytes(data)), mmap=False) as file:
        assert "path" not in file.variables and "mle" not in file.variables
    assert "section" in loadmat(io.BytesIO(matlab_bytes(data)))


@pytest.mark.slow
def test_the_kind_of_a_file_is_seen(m, line, point, tmp_path):
    save_bifurcation(line, tmp_path / "line.npz")
    save_point(point, tmp_path / "point.npz")
    (tmp_path / "map.nc").write_bytes(map_netcdf(m))
    titles = [
        result_dataset(tmp_path / name).title.split()[0]
        for name in ("line.npz", "point.npz", "map.nc")
    ]
    assert titles == ["Line", "Motion", "Stability"]
    refined = result_dataset(ARTIFACTS / REFINED)
    assert refined.variables["mle"].values.shape == m.shape
    for path, data, words in (
        ("line.nc", netcdf_bytes(line_dataset(line)), "NetCDF file of no map"),
        ("map.csv", csv_bytes(map_table(m)), "it is a table .CSV., not an NPZ"),
        ("map.mat", matlab_bytes(map_dataset(m)), "it is a MATLAB file"),
        ("map.h5", b"\x89HDF\r\n\x1a\n", "it is an HDF5 file"),
    ):
        (tmp_path / path).write_bytes(data)
        for load in (result_dataset, load_map):
            with pytest.raises(InputError, match=words):
                load(tmp_path / path)
    with pytest.raises(InputError, match="NetCDF file, of which maps alone are read"):
        load_bifurcation(tmp_path / "line.nc")


def test_files_are_the_same_for_the_same_result(line):
    for write in WRITERS.values():
        assert write(line_dataset(line)) == write(line_dataset(line))
    assert b"2026" not in matlab_bytes(line_dataset(line))[:116]
