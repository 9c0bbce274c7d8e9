"""Shipped files: what the manifest does not name with its checksum is not read; maps that are no
maps are refused.
"""

import contextlib
import json
import shutil

import numpy as np
import pytest

from spab_core.design.model import reference_design
from spab_core.maps.stability_map import MapError, load_map
from spab_core.shipped.manifest import (
    ARTIFACTS,
    REFERENCE_MAP,
    ArtifactError,
    checked_path,
    load_reference_map,
    write_manifest,
)
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings


def test_every_shipped_file_is_in_the_manifest():
    named = json.loads((ARTIFACTS / "manifest.json").read_text())["files"]
    assert set(named) == {p.name for p in ARTIFACTS.iterdir() if p.name[0] != "."} - {
        "manifest.json"
    }
    for name in named:
        checked_path(name)


def test_reference_map_is_what_it_says():
    m = load_reference_map()
    assert m.design == reference_design()
    assert min(m.metadata["transient"], m.metadata["revolutions"]) >= 300
    assert m.shape == (170, 250)
    assert (m.status == "ok").mean() >= 0.99 and np.array_equal(
        np.isfinite(m.mle), m.status == "ok"
    )
    assert {"periodic", "quasi-periodic", "chaotic"} <= set(np.unique(m.regime))


@pytest.mark.slow
def test_cells_of_the_shipped_map_come_out_of_this_solver():
    """Twelve cells with settled exponents, drawn with a fixed seed: same regime, exponent within
    its error or 0.01.
    """
    m = load_reference_map()
    settled = np.argwhere(
        (m.regime == "periodic") & (m.mle < -0.02) & (m.mle_standard_error < 0.005)
    )
    for row, column in np.random.default_rng(5).choice(settled, 12, replace=False):
        settings = Settings(
            mesh=m.metadata["mesh"],
            transient=m.metadata["transient"],
            revolutions=m.metadata["revolutions"],
        )
        point = solve_point(
            m.design, float(m.rotor_mass[column]), float(m.bearing_number[row]), settings
        )
        assert (point.regime.name, point.regime.period) == (
            m.regime[row, column],
            m.period[row, column],
        )
        assert point.mle.value == pytest.approx(
            m.mle[row, column], abs=0.01 + 3.0 * m.mle_standard_error[row, column]
        )


@pytest.fixture
def copy(tmp_path):
    shutil.copytree(ARTIFACTS, tmp_path / "a")
    return tmp_path / "a"


def test_a_changed_file_is_refused(copy):
    data = bytearray((copy / REFERENCE_MAP).read_bytes())
    data[len(data) // 2] ^= 1
    (copy / REFERENCE_MAP).write_bytes(data)
    with pytest.raises(ArtifactError, match="SHA-256"):
        load_reference_map(copy)
    write_manifest(copy)  # on purpose now: the checksum holds, but the damage is still found
    with pytest.raises(MapError):
        load_reference_map(copy)


@pytest.mark.parametrize(
    "manifest", [None, "", "[]", "{}", '{"files": {}}', '{"files": {"reference_map.npz": 3}}']
)
def test_a_missing_or_broken_manifest_is_a_sentence(copy, manifest):
    (copy / "manifest.json").unlink()
    if manifest is not None:
        (copy / "manifest.json").write_text(manifest)
    with pytest.raises(ArtifactError, match="manifest"):
        load_reference_map(copy)


def test_a_missing_file_is_a_sentence(copy):
    (copy / REFERENCE_MAP).unlink()
    with pytest.raises(ArtifactError, match="cannot read"):
        load_reference_map(copy)


@pytest.mark.slow
def test_files_that_are_no_maps_are_refused(tmp_path, copy):
    bad = tmp_path / "bad.npz"
    with pytest.raises(MapError, match="cannot read"):
        load_map(bad)
    good = (copy / REFERENCE_MAP).read_bytes()
    for position in range(0, 8 * len(good), 8 * len(good) // 400 | 1):  # single flipped bits
        damaged = bytearray(good)
        damaged[position // 8] ^= 1 << position % 8
        bad.write_bytes(damaged)
        with contextlib.suppress(MapError):  # some bits mean nothing
            load_map(bad)
    for content in (b"", b"PK\x03\x04", b"not a zip", np.random.default_rng(0).bytes(500)):
        bad.write_bytes(content)
        with pytest.raises(MapError):
            load_map(bad)
    np.savez(bad, mle=np.array([object()], dtype=object))  # a pickle inside
    with pytest.raises(MapError):
        load_map(bad)
    with np.load(copy / REFERENCE_MAP) as data:
        good = dict(data)
    for name, value in {
        "mle": good["mle"][:1],
        "regime": np.full(good["mle"].shape, "dancing"),
        "period": good["period"] - 100,
        "metadata": np.array("[]"),
        "status": np.full(good["mle"].shape, "touchdown"),
        "rotor_mass": good["rotor_mass"].astype(str),
    }.items():
        np.savez(bad, **(good | {name: value}))
        with pytest.raises(MapError, match=r"not a map|is damaged"):
            load_map(bad)
