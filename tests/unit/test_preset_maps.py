"""Maps of the presets that come with spab: what they are of, what refuses them, what stamps them
anew.
"""

import json
import shutil

import numpy as np
import pytest

from spab_core.active_learning.quick_map import as_map
from spab_core.active_learning.refine import load_refinement
from spab_core.design.presets import PRESETS
from spab_core.linear_theory.whirl import linear_spectrum
from spab_core.maps.stability_map import load_map, save_map
from spab_core.shipped import preset_maps
from spab_core.shipped.manifest import ARTIFACTS, MANIFEST, ArtifactError, write_manifest
from spab_core.shipped.preset_maps import (
    MAPS,
    limit_of_mass,
    load_preset_map,
    map_of_design,
    others,
    prove,
    restamp,
    stale,
)
from spab_core.shipped.verify import verify

FED, QUASI_STEADY = MAPS[0], MAPS[1]


@pytest.fixture
def copy(tmp_path):
    """The first map alone."""
    shutil.copy(ARTIFACTS / FED.file, tmp_path)
    noted = json.loads((ARTIFACTS / MANIFEST).read_text())["files"][FED.file]["made_from"]
    write_manifest(tmp_path, {FED.file: noted})
    return tmp_path


def test_every_preset_but_the_reference_has_its_map_around_its_own_point():
    assert {one.preset.name for one in MAPS} == set(PRESETS) - {preset_maps.REFERENCE}
    for one in MAPS:
        r = load_preset_map(one)
        speed = r.bearing_number * one.design.speed_rpm(1.0)
        assert speed[[0, -1]] == pytest.approx(np.array([0.25, 3.0]) * one.preset.speed_rpm, 1e-4)
        assert r.rotor_mass[[0, -1]] == pytest.approx(
            np.array([0.25, 3.0]) * one.preset.rotor_mass, 1e-4
        )
        assert r.judged and (r.values["status"][r.solved] == "ok").mean() > 0.9
        assert map_of_design(one.design) == one
        assert map_of_design(one.design.replace(bearing__clearance=3.1e-5)) is None
    assert sum((ARTIFACTS / one.file).stat().st_size for one in MAPS) < 1_500_000
    assert [one.file for one in others(QUASI_STEADY)] == [
        "map_fed_spindle.npz",
        "map_fed_spindle_layered.npz",
    ]


def test_the_border_of_the_shipped_map_is_the_hammer_of_linear_theory():
    """Up to three steps of the plane at the preset's speed; without storage no mass of the plane is
    to be avoided there.
    """
    m, quiet = (as_map(load_preset_map(one)) for one in (FED, QUASI_STEADY))
    step = m.rotor_mass[1] - m.rotor_mass[0]
    number = float(FED.design.bearing_number(FED.preset.speed_rpm * np.pi / 30.0))
    limit = limit_of_mass(m, number)
    for mass, stable in ((limit - 3 * step, True), (limit + 3 * step, False)):
        values, _ = linear_spectrum(FED.design, mass, number)
        assert (values[0].real < 0.0) == stable
    assert limit_of_mass(quiet, number) == quiet.rotor_mass[-1]


def test_a_stale_map_is_refused_in_a_sentence(copy, monkeypatch):
    assert stale(FED, copy) is None
    monkeypatch.setattr(preset_maps, "code_hash", lambda: "another")
    with pytest.raises(ArtifactError, match="solver's code has changed since; `make preset-maps`"):
        load_preset_map(FED, copy)
    monkeypatch.undo()
    write_manifest(copy, {FED.file: QUASI_STEADY.stamp()})
    with pytest.raises(ArtifactError, match="made for another design"):
        load_preset_map(FED, copy)
    problems = {check.name: check.problem for check in verify(copy) if FED.file in check.name}
    assert problems[f"SHA-256 of {FED.file}"] == ""
    assert "another design" in problems[f"{FED.file}: design, solver's code"]


def test_a_map_is_stamped_anew_only_where_its_cells_come_out_the_same(copy, monkeypatch):
    monkeypatch.setattr(preset_maps, "MAPS", (FED,))
    write_manifest(copy, {FED.file: FED.stamp() | {"solver": "before"}})
    (line,) = restamp(copy)
    assert "3 cells come out the same" in line and stale(FED, copy) is None
    assert list(restamp(copy)) == [f"{FED.file}: as it was"]
    r = load_refinement(copy / FED.file)
    r.values["mle"][:] += 1e-3
    with pytest.raises(ArtifactError, match="the solver finds periodic"):
        prove(FED, r)
    r.values["mle"][:] -= 1e-3
    save_map(as_map(r), copy / "filled.npz")  # a whole map, with which margins can be read
    assert load_map(copy / "filled.npz").design == FED.design
