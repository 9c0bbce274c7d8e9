"""Shipped files: what the manifest does not name with its checksum is not read; maps that are no maps are refused."""

import json
import shutil

import numpy as np
import pytest

from spab_core.artifacts import ARTIFACTS, REFERENCE_MAP, ArtifactError, checked_path, load_reference_map, write_manifest
from spab_core.design import reference_design
from spab_core.stability_map import MapError, load_map


def test_every_shipped_file_is_in_the_manifest():
    named = json.loads((ARTIFACTS / "manifest.json").read_text())["files"]
    assert set(named) == {p.name for p in ARTIFACTS.iterdir()} - {"manifest.json"}
    for name in named:
        checked_path(name)


def test_reference_map_is_what_it_says():
    m = load_reference_map()
    assert m.design == reference_design()
    assert min(m.metadata["transient"], m.metadata["revolutions"]) >= 300
    assert m.shape[0] >= 34 and m.shape[1] >= 50
    assert np.array_equal(np.isfinite(m.mle), m.status == "ok")
    assert {"periodic", "quasi-periodic", "chaotic"} <= set(np.unique(m.regime))


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


@pytest.mark.parametrize("manifest", [None, "", "[]", "{}", '{"files": {}}', '{"files": {"reference_map.npz": 3}}'])
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


def test_files_that_are_no_maps_are_refused(tmp_path, copy):
    bad = tmp_path / "bad.npz"
    with pytest.raises(MapError, match="cannot read"):
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
    for name, value in {"mle": good["mle"][:1], "regime": np.full(good["mle"].shape, "dancing"), "period": good["period"] - 100,
                        "metadata": np.array("[]"), "status": np.full(good["mle"].shape, "touchdown"),
                        "rotor_mass": good["rotor_mass"].astype(str)}.items():
        np.savez(bad, **(good | {name: value}))
        with pytest.raises(MapError, match="not a map"):
            load_map(bad)
