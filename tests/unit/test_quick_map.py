"""A refinement as one map: solved cells untouched, predicted ones told apart."""

import json
import sys
import types

import numpy as np
import pytest

from spab_core.active_learning import quick_map as quick_maps
from spab_core.active_learning.committee import PARTS, kinds_of_motion
from spab_core.active_learning.oracles import map_oracle
from spab_core.active_learning.quick_map import (
    as_map,
    check_cluster,
    check_quick_map,
    quick_map,
    usual_plane,
)
from spab_core.active_learning.refine import (
    batch_goals,
    last,
    load_refinement,
    refine,
    save_refinement,
)
from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.model import parse_design, reference_design
from spab_core.design.presets import PRESETS
from spab_core.linear_theory.linear_table import shipped_table
from spab_core.maps.stability_map import FIELDS, OPTIONAL, load_map, save_map
from spab_core.shipped.manifest import load_reference_map, load_reference_refinement
from spab_core.trajectory.assessment import CONTACT
from spab_core.trajectory.settings import Settings


def test_solved_cells_are_untouched_and_the_whole_is_a_map(tmp_path):
    refined = load_reference_refinement()
    m = as_map(refined)
    for name in FIELDS:
        assert np.array_equal(
            getattr(m, name)[refined.solved],
            refined.values[name][refined.solved],
            equal_nan=name in OPTIONAL,
        )
    open_cells = ~refined.solved
    assert (
        np.array_equal(m.regime[open_cells], refined.regime[open_cells])
        and not m.revolutions[open_cells].any()
    )
    periodic = m.regime == "periodic"
    assert (
        (m.period[periodic] > 0).all()
        and not m.period[~periodic].any()
        and np.isfinite(m.mle).all()
    )
    save_map(
        m, tmp_path / "filled.npz"
    )  # its checks hold: regime, status and exponent fit together
    assert np.array_equal(load_map(tmp_path / "filled.npz").regime, m.regime)
    assert (m.regime == load_reference_map().regime).mean() > 0.97


@pytest.fixture(scope="module")
def judged():
    """The reference map, of which 700 cells are solved and the others judged by prediction."""
    m = load_reference_map()
    return m, last(
        refine(
            m.bearing_number,
            m.rotor_mass,
            map_oracle(m),
            700,
            table=shipped_table(),
            judge=True,
            metadata=m.metadata,
        )
    )


def test_a_kind_of_motion_names_what_a_cell_is():
    m = load_reference_map()
    values = {name: getattr(m, name).ravel() for name in FIELDS}
    kinds = kinds_of_motion(m.design, values)
    names, where = np.unique(kinds, return_index=True)
    parts = dict(zip(PARTS, zip(*(name.split("|") for name in names), strict=True), strict=True))
    for kind, regime, grade, rubs in zip(
        names, parts["regime"], parts["assessment"], parts["contact"], strict=True
    ):
        those = kinds == kind
        assert set(m.regime.ravel()[those]) == {regime}
        assert set(m.grades().ravel()[those]) == {grade}
        assert ((values["contact_share"][those] > CONTACT) == (rubs == "rubs")).all()
    assert len(where) < 30 and set(parts["period"]) == {"0", "1", "2", "3"}


@pytest.mark.slow
def test_assessment_and_contact_are_predicted_with_their_probability(judged, tmp_path):
    m, r = judged
    filled, worth = as_map(r), m.grades()
    # one source for all that is told of a cell: nothing contradicts itself
    assert np.array_equal(filled.grades(), r.assessment)
    assert np.array_equal(filled.grades()[r.solved], worth[r.solved])
    assert np.array_equal(filled.regime[~r.solved], r.regime[~r.solved])
    open_cells = ~r.solved
    right = (r.assessment == worth)[open_cells]
    assert right.mean() > 0.97
    rubs, truth = filled.contact_share > CONTACT, m.contact_share > CONTACT
    assert (rubs == truth)[open_cells].mean() > 0.97
    assert (rubs != (r.rubs > 0.5))[open_cells].mean() < 0.02  # kinds compete, contact does not
    # the probability is honest: where it is high more is right, and about as much as it says
    sure = r.certainty[open_cells]
    assert np.all(r.good + r.avoid < 1.0 + 1e-9) and np.all(r.certainty[r.solved] == 1.0)
    assert right[sure > 0.95].mean() > 0.99 and right[sure < 0.8].mean() < 0.9
    save_refinement(r, tmp_path / "judged.npz")
    again = load_refinement(tmp_path / "judged.npz")
    assert np.array_equal(again.assessment, r.assessment) and again.judged
    assert np.allclose(again.certainty, r.certainty, atol=1e-6)
    with np.load(tmp_path / "judged.npz") as file:
        assert np.array_equal(file["predicted_assessment"], r.assessment)


def test_a_map_of_regimes_alone_has_no_probability_of_the_assessment():
    r = load_reference_refinement()
    assert not r.judged and np.isnan(r.certainty).all()
    assert np.array_equal(r.source.ravel()[r.solved.ravel()], np.flatnonzero(r.solved))


def test_linear_theory_counts_against_the_time(tmp_path, design, monkeypatch):
    """A table that takes all the time leaves the coarse plane alone."""
    now, told = 0.0, []

    def slow(*_):
        nonlocal now
        now += 100.0

    monkeypatch.setattr(quick_maps, "_table", slow)
    found = last(
        quick_map(
            design,
            np.linspace(2.0, 4.0, 10),
            np.linspace(3.0, 9.0, 10),
            Settings("2x16", transient=30, revolutions=20),
            seconds=50.0,
            checkpoint=tmp_path / "parts",
            clock=lambda: now,
            tell=told.append,
        )
    )
    assert found.solved.sum() == 25
    assert tuple(told) == (*quick_maps.DOING[:3], quick_maps.DOING[-1])


@pytest.mark.parametrize("cell", [0.005, 0.1, 2.0])
def test_batches_end_in_time_whatever_a_cell_costs(cell):
    """Cells of one cost and half a second for each prediction: no more than asked for."""
    spent, solved = [0.0], 0
    goals = quick_maps._goals_in_time(batch_goals(16, 40_000, 3), 60.0, lambda: sum(spent))
    for goal in goals:
        spent.append(cell * (goal - solved) + 0.5)
        solved = goal
    assert 60.0 - 6.0 * (cell + 0.5) < sum(spent) <= 61.0


def test_the_usual_plane_of_every_preset_is_allowed():
    for design in (reference_design(), *(preset.design for preset in PRESETS.values())):
        number, mass = check_quick_map(*usual_plane(design), 300.0)
        assert number.size * mass.size == 42_500
        load = design.load_number(mass[-1]) / max(design.bearing.supply_pressure_ratio, 1.0)
        assert abs(load - 0.672) < 0.01 or design.rotor.gravity == 0.0


def test_wrong_planes():
    for number, mass, seconds in (
        ("0:1:10", "1:2:10", 60.0),
        ("1:2:10", "1:2000:10", 60.0),
        ("1:2:1000", "1:2:1000", 60.0),
        ("1:2:10", "1:2:10", 1.0),
        ("1:2", "1:2:10", 60.0),
        ("1:2:2", "1:2:2", 60.0),
    ):
        try:
            check_quick_map(number, mass, seconds)
        except InputError as error:
            assert "allowed" in str(error) or "start:stop:count" in str(error)
        else:
            raise AssertionError((number, mass, seconds))


def test_no_gravity_has_a_plane_too():
    design = parse_design("[rotor]\ngravity = 0.0")
    assert check_quick_map(*usual_plane(design), 60.0)[1][-1] > 1.0


@pytest.mark.slow
def test_on_a_cluster_the_same_cells_have_the_same_values(tmp_path, design, monkeypatch):
    monkeypatch.setitem(
        sys.modules, "__main__", types.ModuleType("__main__")
    )  # new processes would run this one's again
    distributed = pytest.importorskip("distributed")
    number, mass = np.linspace(2.0, 4.0, 4), np.linspace(3.0, 9.0, 5)
    settings = Settings("2x16", transient=30, revolutions=20)
    here = last(
        quick_map(design, number, mass, settings, seconds=300.0, checkpoint=tmp_path / "here")
    )
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        there = last(
            quick_map(
                design,
                number,
                mass,
                settings,
                seconds=300.0,
                checkpoint=tmp_path / "there",
                cluster=check_cluster(cluster.scheduler_address),
            )
        )
    assert here.solved.all() and there.solved.all()
    assert np.array_equal(here.values["mle"], there.values["mle"])


@pytest.mark.parametrize(
    "address", ["host", "file:///etc/passwd", "tcp://a b:1", "tcp://host", 7, "http://x:80"]
)
def test_what_is_no_scheduler(address):
    with pytest.raises(InputError, match="no address"):
        check_cluster(address)


@pytest.mark.slow
def test_the_command_maps_and_its_map_has_margins(tmp_path, capsys):
    plane = ["--bearing-number", "2:4:5", "--rotor-mass", "3:9:5"]
    out, filled = tmp_path / "own.npz", tmp_path / "filled.npz"
    assert (
        main(
            [
                "design",
                "map",
                *plane,
                "--minutes",
                "5",
                "--workers",
                "1",
                "--out",
                str(out),
                "--map-out",
                str(filled),
                "--json",
            ]
        )
        == 0
    )
    answer = json.loads(capsys.readouterr().out)
    assert answer["solved"] == answer["cells"] == 25 and load_refinement(out).solved.all()
    assert sum(answer["assessment_shares"].values()) == pytest.approx(1.0)
    assert not (tmp_path / "own.npz.parts").exists()
    assert main(["margin", "--map", str(filled), "--rotor-mass", "6", "--bearing-number", "3"]) == 0
    for wrong, told in (
        (["--minutes", "0"], "--minutes = 0 min is out of range"),
        (["--workers", "0"], "--workers = 0"),
        (["--dask", "nowhere"], "no address"),
        (["--preset", "none"], "no preset 'none'"),
    ):
        assert main(["design", "map", *plane, "--out", str(out), *wrong]) == 2
        assert told in capsys.readouterr().err


def test_a_map_ends_at_a_number_of_cells(tmp_path, design, monkeypatch):
    """Whatever the clock says: the same cells on a slow machine."""
    monkeypatch.setattr(quick_maps, "_table", lambda *_: None)
    plane = np.linspace(2.0, 4.0, 8), np.linspace(3.0, 9.0, 8)
    short = Settings("2x16", transient=30, revolutions=20)
    found = []
    for name, pace in (("slow", 1.0), ("fast", 0.001)):
        seconds = iter(np.arange(0.0, 1000.0, pace))
        found.append(
            last(
                quick_map(
                    design,
                    *plane,
                    short,
                    seconds=5000.0,
                    most=24,
                    checkpoint=tmp_path / name,
                    clock=lambda seconds=seconds: float(next(seconds)),
                )
            )
        )
    assert found[0].solved.sum() == 24 and np.array_equal(found[0].batch, found[1].batch)
    for cells in (15, 65):
        with pytest.raises(InputError, match=r"cells to solve = .* from 16 to 64"):
            quick_maps.check_cells(cells, 64)
