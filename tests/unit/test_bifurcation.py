"""Bifurcation sweeps: shapes, hysteresis bookkeeping, files, and the command."""

import dataclasses
import json

import numpy as np
import pytest

from spab_core import Settings, solve_point
from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.model import Design
from spab_core.maps import bifurcation
from spab_core.maps.bifurcation import (
    SECTION_POINTS,
    chaotic_intervals,
    compute_bifurcation,
    interval_table,
    line_of_map,
    line_table,
    line_verdict,
    load_bifurcation,
    save_bifurcation,
)
from spab_core.trajectory.assessment import Limits, Motion, grades
from tests.maps import map_of

SHORT = Settings(mesh="3x16", transient=40, revolutions=60)
LINE = np.array([5.0, 6.0, 7.0])


@pytest.fixture(scope="module")
def result(design):
    return compute_bifurcation(design, "rotor-mass", 6.0, LINE, SHORT)


def test_sweeps_have_a_row_a_value(result):
    assert list(result.branches) == ["cold", "up", "down"]
    for branch in result.branches.values():
        assert branch.section.shape == (3, SECTION_POINTS, 4) and branch.section.dtype == np.float32
        assert np.isfinite(branch.mle).all() and (branch.status == "ok").all()
        assert np.abs(branch.section[:, :, :2]).max() < 1.0


def test_cold_points_are_the_points_alone(design, result):
    alone = solve_point(design, 6.0, 6.0, SHORT)
    cold = result.branches["cold"]
    assert cold.mle[1] == alone.mle.value and cold.regime[1] == alone.regime.name
    points = alone.trajectory.section[-2:, :2]
    distance = np.abs(cold.section[1, :, None, :2] - points[None]).max(axis=2).min(axis=1)
    assert distance[-10:].max() < 1e-3  # period 2: its two points, over and over


def test_up_and_down_start_where_the_neighbour_ended(design, result):
    first = solve_point(design, 5.0, 6.0, SHORT)
    second = solve_point(design, 6.0, 6.0, SHORT, start=first.trajectory.final)
    assert result.branches["up"].mle[1] == second.mle.value
    last = solve_point(design, 7.0, 6.0, SHORT)
    assert result.branches["down"].mle[2] == last.mle.value
    assert (
        result.branches["down"].mle[1]
        == solve_point(design, 6.0, 6.0, SHORT, start=last.trajectory.final).mle.value
    )


@pytest.mark.slow
def test_workers_do_not_change_a_bit(design, result):
    two = compute_bifurcation(design, "rotor-mass", 6.0, LINE, SHORT, workers=2)
    for name, branch in result.branches.items():
        assert np.array_equal(branch.section, two.branches[name].section)
        assert np.array_equal(branch.mle, two.branches[name].mle)


def test_files_come_back_and_others_are_refused(result, tmp_path):
    save_bifurcation(result, tmp_path / "b.npz")
    again = load_bifurcation(tmp_path / "b.npz")
    assert again.vary == "rotor-mass" and again.at == 6.0 and np.array_equal(again.values, LINE)
    assert np.array_equal(again.branches["up"].section, result.branches["up"].section)
    (tmp_path / "no.npz").write_bytes(b"not a file of numbers")
    np.savez(tmp_path / "other.npz", values=LINE)
    for name in ("no.npz", "other.npz", "missing.npz"):
        with pytest.raises(InputError, match="cannot read"):
            load_bifurcation(tmp_path / name)


def test_a_line_has_the_grades_of_its_points(design, result, tmp_path):
    """Each point alone, judged by its motion; so does what comes back from a file."""
    save_bifurcation(result, tmp_path / "line.npz")
    again = load_bifurcation(tmp_path / "line.npz")
    for line in (result, again):
        found, kinds = line.judged("cold")
        for k, mass in enumerate(LINE):
            point = solve_point(design, mass, 6.0, SHORT)
            assert found[k] == str(grades(design, point.motion))
            motion = Motion(*(getattr(line.branches["cold"], n)[k] for n in Motion._fields))
            assert np.isclose(motion.max_eccentricity, point.max_eccentricity)
            assert (kinds[k] == "") == (found[k] == "good")
    with np.load(tmp_path / "line.npz") as kept:  # of an earlier version
        old = {k: v for k, v in kept.items() if "eccentricity" not in k and "orbit" not in k}
    np.savez(tmp_path / "old.npz", **old)
    found, kinds = load_bifurcation(tmp_path / "old.npz").judged("cold")
    assert "good" not in found


def test_chaotic_intervals_are_listed():
    regime = np.array(["chaotic", "periodic", "chaotic", "chaotic", "quasi-periodic", "chaotic"])
    assert chaotic_intervals(np.arange(6.0), regime) == [(0.0, 0.0), (2.0, 3.0), (5.0, 5.0)]
    assert chaotic_intervals(np.arange(2.0), regime[1:2].repeat(2)) == []


COMMAND = [
    "bifurcation",
    "--vary",
    "bearing-number",
    "--at",
    "7",
    "--range",
    "5.9:6.1:2",
    "--mesh",
    "3x16",
    "--transient",
    "40",
    "--revolutions",
    "60",
    "--json",
]


def test_command_writes_and_lists(capsys, tmp_path):
    assert main([*COMMAND, "--sweeps", "cold,down", "--out", str(tmp_path / "c.npz")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["points"] == 2 and answer["chaotic_intervals"] == {"cold": [], "down": []}
    for sweep in ("cold", "down"):
        (band,) = (row for row in answer["bands"] if row["sweep"] == sweep)
        assert answer["assessment"][sweep] == band["assessment"] == "avoid" and band["why"]
        assert (band["first"], band["last"]) == (5.9, 6.1)
    assert list(load_bifurcation(tmp_path / "c.npz").branches) == ["cold", "down"]
    assert [p.name for p in tmp_path.iterdir()] == ["c.npz"]


def test_a_stopped_command_goes_on_from_its_chunks(capsys, tmp_path, monkeypatch):
    line = ["--range", "5.5:6.5:7", "--sweeps", "up,cold"]
    assert main([*COMMAND, *line, "--out", str(tmp_path / "whole.npz")]) == 0
    real, calls = bifurcation._solve_chunk, []

    def stopped_in_the_third(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return real(*arguments)

    monkeypatch.setattr(bifurcation, "_solve_chunk", stopped_in_the_third)
    with pytest.raises(SystemExit) as stop:
        main([*COMMAND, *line, "--out", str(tmp_path / "c.npz")])
    assert (
        stop.value.code == 130
        and "goes on" in capsys.readouterr().err
        and not (tmp_path / "c.npz").exists()
    )
    chunks = sorted((tmp_path / "c.npz.parts").glob("chunk-*.npz"))
    assert [p.name for p in chunks] == ["chunk-up-000000.npz", "chunk-up-000001.npz"]
    assert (
        main([*COMMAND, "--range", "5.5:6.5:8", "--out", str(tmp_path / "c.npz")]) == 2
    )  # another line
    assert "another run" in capsys.readouterr().err
    chunks[1].write_bytes(b"damaged")
    assert main([*COMMAND, *line, "--out", str(tmp_path / "c.npz")]) == 2
    assert "cannot read the finished chunk" in capsys.readouterr().err
    chunks[1].unlink()
    del calls[:]
    calls += [()] * 3
    assert main([*COMMAND, *line, "--out", str(tmp_path / "c.npz")]) == 0
    assert (
        len(calls) == 3 + 3 and not (tmp_path / "c.npz.parts").exists()
    )  # of four chunks one was kept
    first, second = (load_bifurcation(tmp_path / f"{name}.npz") for name in ("whole", "c"))
    for sweep, branch in first.branches.items():
        assert np.array_equal(branch.mle, second.branches[sweep].mle)
        assert np.array_equal(branch.section, second.branches[sweep].section)


def test_tables_of_a_line(result):
    table = line_table(result)
    assert len(table) == 9 and list(table["sweep"].unique()) == ["cold", "up", "down"]
    assert table["bearing_number"].eq(6.0).all() and list(table["rotor_mass_kg"][:3]) == list(LINE)
    assert np.array_equal(table["mle"][3:6], result.branches["up"].mle)
    calm = {name: np.zeros(3) for name in ("contact_share", "thin_film_share")}
    calm |= {name: np.full(3, 0.2) for name in ("max_eccentricity", "orbit_amplitude")}
    calm |= {"period": np.array([0, 0, 1]), "regime": np.array(["chaotic", "chaotic", "periodic"])}
    branches = {
        name: dataclasses.replace(
            branch, **{k: v[::-1] if name == "up" else v for k, v in calm.items()}
        )
        for name, branch in result.branches.items()
    }
    made_up = dataclasses.replace(result, vary="bearing-number", branches=branches)
    found = interval_table(made_up, ["cold", "up"])
    assert found[["sweep", "assessment", "why", "first", "last"]].values.tolist() == [
        ["cold", "avoid", "chaos", 5.0, 6.0],
        ["cold", "good", "", 7.0, 7.0],
        ["up", "good", "", 5.0, 5.0],
        ["up", "avoid", "chaos", 6.0, 7.0],
    ]
    assert line_verdict(made_up, "up") == (
        "avoid",
        "By the motion alone: not recommended 66.7 % of the points (chaos); good 33.3 % of the "
        "points.",
    )
    # no chaotic point, yet nothing to be called good
    rubs = {"contact_share": np.full(3, 0.5), "regime": np.full(3, "periodic")}
    rubbing = dataclasses.replace(branches["cold"], **rubs, period=np.ones(3, int))
    only = dataclasses.replace(made_up, branches={"cold": rubbing})
    assert interval_table(only, ["cold"])[["assessment", "why"]].values.tolist() == [
        ["avoid", "rubbing"]
    ]
    assert line_verdict(only, "cold")[0] == "avoid"
    # by a designer's own limits a calm motion is not
    grave = dataclasses.replace(made_up, limits=Limits(least_film=1e-3))
    assert set(interval_table(grave, ["up"])["assessment"]) == {"avoid"}
    rpm = Design.from_dict(result.metadata["design"]).speed_rpm(5.0)
    assert found["first_rpm"][0] == pytest.approx(rpm) and len(interval_table(result, [])) == 0


def test_a_line_of_a_map_is_its_nearest_row_or_column():
    m = map_of(lambda number, mass: 0.2 * number - 0.05 * mass)
    for vary, at, values, mle in (
        ("rotor-mass", m.bearing_number[3] + 1e-6, m.rotor_mass, m.mle[3]),
        ("bearing-number", m.rotor_mass[2] - 1e-6, m.bearing_number, m.mle[:, 2]),
    ):
        line = line_of_map(m, vary, at)
        assert line.at == pytest.approx(at, abs=1e-5) and np.array_equal(line.values, values)
        assert (
            np.array_equal(line.branches["cold"].mle, mle)
            and np.isnan(line.branches["cold"].section).all()
        )


@pytest.mark.parametrize(
    "change, words",
    [
        (["--vary", "speed"], ["--vary", "rotor-mass"]),
        (["--sweeps", "left"], ["--sweeps", "cold"]),
        (["--sweeps", ""], ["--sweeps"]),
        (["--range", "1:2"], ["--range"]),
        (["--range", "1:1e9:5"], ["bearing number"]),
        (["--at", "-3"], ["rotor mass"]),
        (["--at", "x"], ["--at"]),
        (["--range", "1:2:50000"], ["--range", "20000"]),
        (["--workers", "0"], ["--workers"]),
        (["--out", "/nowhere/x.npz"], ["--out"]),
    ],
)
def test_wrong_input_is_a_sentence(capsys, tmp_path, change, words):
    try:
        code = main([*COMMAND, "--out", str(tmp_path / "c.npz"), *change])
    except SystemExit as stop:
        code = stop.code
    error = capsys.readouterr().err
    assert code == 2 and error.count("\n") == 1
    for word in words:
        assert word in error
