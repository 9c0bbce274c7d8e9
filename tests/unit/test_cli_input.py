"""What people type into commands: speeds in rpm, presets, ranges, lists, files that are there."""

import csv
import io
import json
import math
import os
import shlex
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.active_learning.refine import load_refinement
from spab_core.cli import design_map as design_map_command
from spab_core.cli import maps, options, progress, refine
from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.form import BEARING_NUMBER_RANGE
from spab_core.design.model import load_design, reference_design
from spab_core.design.presets import preset
from spab_core.linear_theory.equilibrium import concentric_stiffness, static_equilibrium
from spab_core.linear_theory.whirl import linear_spectrum, whirl_thresholds
from spab_core.maps.bifurcation import compute_bifurcation, load_bifurcation
from spab_core.maps.compute import compute_map
from spab_core.maps.solved_margin import solve_margin
from spab_core.maps.stability_map import axis, load_map, save_map, steps_as_count
from spab_core.shipped.manifest import ARTIFACTS
from spab_core.shipped.preset_maps import MAPS
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.settings import Settings
from tests.commands import answer, refused
from tests.maps import map_of

SHORT = ["--mesh", "2x16", "--transient", "30", "--revolutions", "20"]


def rpm_of(number, design=None):
    return repr((design or reference_design()).speed_rpm(number))


def test_a_speed_in_rpm_is_its_bearing_number(capsys):
    fed = preset("fed_spindle").design
    for command in (
        ["simulate", "--rotor-mass", "4", *SHORT],
        ["stiffness", "--mesh", "2x16"],
        ["whirl-threshold", "--mesh", "2x16"],
    ):
        by_number = answer(capsys, *command, "--preset", "fed_spindle", "--bearing-number", "3")
        by_speed = answer(capsys, *command, "--preset", "fed_spindle", "--rpm", rpm_of(3.0, fed))
        numbers = [
            {k: v for k, v in found.items() if isinstance(v, float) and k != "wall_seconds"}
            for found in (by_number, by_speed)
        ]
        assert numbers[0] == pytest.approx(numbers[1], rel=1e-6), command
        assert numbers[0] or by_number == by_speed


def test_planes_and_lines_take_rpm(capsys, tmp_path):
    out = str(tmp_path / "x.npz")
    d = reference_design()
    ends = f"{rpm_of(2.0)}:{rpm_of(3.0)}:2"
    answer(capsys, "map", "--rpm", ends, "--rotor-mass", "4:5:2", "--out", out, *SHORT)
    assert load_map(out).bearing_number == pytest.approx([2.0, 3.0])
    line = ["bifurcation", "--out", out, "--sweeps", " cold , up", *SHORT]
    answer(capsys, *line, "--vary", "rotor-mass", "--rpm", rpm_of(2.0), "--range", "4:5:2")
    found = load_bifurcation(out)
    assert found.at == pytest.approx(2.0) and list(found.branches) == ["cold", "up"]
    answer(capsys, *line, "--vary", "bearing-number", "--rpm", ends, "--at", "4")
    assert load_bifurcation(out).values == pytest.approx([2.0, 3.0])
    assert d.speed_rpm(1.0) > 0.0


def test_refine_and_the_quick_map_take_rpm_and_presets(capsys, tmp_path, monkeypatch):
    """What they ask of the solver: it is not run."""
    asked = {}

    def stop(*values, **more):
        asked["values"] = values
        raise KeyboardInterrupt

    fed = preset("fed_spindle").design
    ends = f"{rpm_of(2.0, fed)}:{rpm_of(3.0, fed)}:20"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(refine, "live_oracle", stop)
    argv = ["--preset", "fed_spindle", "--rpm", ends, "--rotor-mass", "4:5:20", "--out", "r.npz"]
    with pytest.raises(SystemExit):
        main(["refine", *argv, "--budget", "100"])
    design, number = asked["values"][:2]
    assert design == fed and number == pytest.approx(np.linspace(2.0, 3.0, 20))
    monkeypatch.setattr(design_map_command, "quick_map", stop)
    with pytest.raises(SystemExit):
        main(["design", "map", *argv])
    design, number = asked["values"][:2]
    assert design == fed and number == pytest.approx(np.linspace(2.0, 3.0, 20))


@given(st.floats(*BEARING_NUMBER_RANGE), st.floats(*BEARING_NUMBER_RANGE), st.integers(1, 50))
def test_a_range_of_speeds_is_one_of_bearing_numbers(one, other, count):
    d = reference_design()
    low, high = sorted((d.speed_rpm(one), d.speed_rpm(other)))
    if not high > low:
        return
    values = axis(options.rpm_range(f"{low!r}:{high!r}:{count}", d), "--rpm")
    assert values == pytest.approx(np.linspace(*sorted((one, other)), count), rel=1e-12)


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["stiffness"], "one of the arguments --bearing-number --rpm is required"),
        (["stiffness", "--rpm", "9000", "--bearing-number", "3"], "not allowed with"),
        (["stiffness", "--rpm", "1e9"], "--rpm = 1e+09 rpm is out of range: allowed is from"),
        (["stiffness", "--rpm", "20.000"], "can be read in two ways: write 20000, or 20.0"),
        (["stiffness", "--rpm", "20,000"], "20.000, or 20000 for thousands"),
        (["stiffness", "--rpm", "10200rpm"], "write 10200, without its unit"),
        (["stiffness", "--rpm", "20krpm"], "write 20000"),
        (["stiffness", "--rpm", "20 000"], "write 20000, without signs between the thousands"),
        (["stiffness", "--rpm", "20'000"], "write 20000, without signs between the thousands"),
        (["stiffness", "--rpm", "9000", "--preset", "x"], "no preset 'x'"),
        (["stiffness", "--rpm", "9000", "--preset", "fed-spindle"], "is fed_spindle meant?"),
        (["export", "no.npz", "--out", "a.csv"], "'no.npz': No such file or directory"),
        (
            ["map", "--rpm", "5.000:30.000:3", "--rotor-mass", "1:2:2", "--out", "m.npz"],
            "--rpm = '5.000' can be read in two ways",
        ),
        (["simulate", "--rpm", "9000", "--rotor-mass", "4,52"], "decimal sign is a point, 4.52"),
        (["simulate", "--rpm", "9000", "--rotor-mass", "4 kg"], "write 4, without its unit"),
        (
            ["design", "coefficients", "--rotor-mass", "4", "--rpm", "20.000", "--out", "c.csv"],
            "--rpm = '20.000' can be read in two ways",
        ),
        (
            ["map", "--bearing-number", "0,5:1:25", "--rotor-mass", "1:2:2", "--out", "m.npz"],
            "the decimal sign is a point",
        ),
        (
            ["map", "--bearing-number", "1:0.1:2", "--rotor-mass", "1:2:2", "--out", "m.npz"],
            "for steps of 0.1 write 1:2:11",
        ),
        (
            ["map", "--bearing-number", "1:0.5:2.5", "--rotor-mass", "1:2:2", "--out", "m.npz"],
            "for steps of 0.5 write 1:2.5:4",
        ),
        (
            ["map", "--rpm", "1:2", "--rotor-mass", "1:2:2", "--out", "m.npz"],
            "--rpm = '1:2' is not",
        ),
        (
            ["bifurcation", "--vary", "rotor-mass", "--range", "1:2:2", "--out", "b.npz"],
            "--at is required, with --vary rotor-mass",
        ),
        (
            [
                *("bifurcation", "--vary", "rotor-mass", "--range", "1:2:2", "--out", "b.npz"),
                *("--at", "3", "--rpm", "9000"),
            ],
            "give either --at or --rpm",
        ),
        (
            [
                *("bifurcation", "--vary", "bearing-number", "--at", "4", "--out", "b.npz"),
                *("--range", "2:3:2", "--rpm", "9000:9100:2"),
            ],
            "give either --range or --rpm",
        ),
        (["predict", "--model", "tree", "--rpm", "9000"], "speed and mass belong together"),
        (["refine", "--budget", "99", "--out", "r.npz"], "give --bearing-number or --rpm"),
    ],
)
def test_what_was_meant_is_told(capsys, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, *argv)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "argv",
    [
        ["map", "--rpm", "9000:9100:2", "--rotor-mass", "1:2:2", "--out", "map.csv"],
        ["simulate", "--rpm", "9000", "--rotor-mass", "4", "--out", "point.csv"],
        ["simulate", "--rpm", "9000", "--rotor-mass", "4", "--orbit", "orbit.npz"],
        ["bifurcation", "--vary", "rotor-mass", "--rpm", "9000", "--range", "1:2:2", "--out", "b"],
        ["refine", "--rpm", "9000:9100:9", "--rotor-mass", "1:2:9", "--budget", "70", "--out", "r"],
        ["evaluate", "--models", "tree", "--out", "scores.xlsx"],
        ["predict", "--model", "tree", "--out", "map.csv"],
        ["train", "--model", "tree", "--divisor", "2", "--out", "model.npz"],
        ["design", "new", "--preset", "spab60", "--out", "my.json"],
        ["design", "map", "--out", "map.csv"],
        ["design", "map", "--out", "map.npz", "--map-out", "map.nc"],
        ["export", "map.npz", "--out", "map.xlsx"],
    ],
)
def test_an_ending_that_says_another_kind_is_refused(capsys, tmp_path, monkeypatch, argv):
    monkeypatch.chdir(tmp_path)
    assert "must end in ." in refused(capsys, *argv)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "text", "meant"),
    [
        ("--range", "0.5:1:25", "0.5:24.5:25"),
        ("--rotor-mass", "1:2:20", "1:19:10"),
        ("--rpm", "500:1000:30000", "500:29500:30"),
    ],
)
def test_steps_where_a_count_belongs_are_doubted(capsys, name, text, meant):
    assert len(options.values_of(text, name)) == int(text.split(":")[2])
    assert f"write {meant}" in capsys.readouterr().err
    start, step, stop = map(float, text.split(":"))
    values = axis(steps_as_count(start, step, stop), "x")
    assert values == pytest.approx(np.arange(start, stop + 1e-9, step))


@pytest.mark.parametrize("text", ["0.05:8.5:170", "0.25:8.5:34", "1:25:25", "1:5:25", "0.5:0.5:1"])
def test_usual_ranges_are_not_doubted(capsys, text):
    options.values_of(text, "--range")
    assert capsys.readouterr().err == ""


def test_an_edited_design_is_not_overwritten(capsys, tmp_path):
    out = tmp_path / "Größe µ dir" / "Lager 25 µm.toml"
    out.parent.mkdir()
    new = ["design", "new", "--preset", "fed_spindle", "--out", str(out)]
    assert main(new) == 0
    told = shlex.split(capsys.readouterr().out.partition("then ")[2])
    assert told[:3] == ["spab", "design", "show"] and load_design(told[4])
    out.write_text(out.read_text().replace("2.5e-05", "1.9e-05"))
    assert "--force" in refused(capsys, *new)
    assert load_design(out).bearing.clearance == 1.9e-05
    assert main([*new, "--force"]) == 0 and load_design(out).bearing.clearance == 2.5e-05


def test_a_file_is_not_exported_over_itself(capsys, tmp_path):
    m = map_of(lambda number, mass: 0.2 * number - 0.05 * mass)
    path, link = tmp_path / "map.nc", tmp_path / "link.nc"
    save_map(m, path)  # a map under a wrong name, as older versions wrote it
    link.symlink_to(path)
    before = path.read_bytes()
    for out in (path, link):
        assert "is the file to read" in refused(capsys, "export", str(path), "--out", str(out))
    assert path.read_bytes() == before
    answer(capsys, "export", str(path), "--out", str(tmp_path / "a.nc"))
    for ending in ("csv", "mat"):
        answer(capsys, "export", str(tmp_path / "a.nc"), "--out", str(tmp_path / f"b.{ending}"))
    out = tmp_path / "c.csv"
    answer(capsys, "export", str(path), "--out", str(out), "--semicolons")
    rows = list(csv.DictReader(io.StringIO(out.read_text("utf-8-sig")), delimiter=";"))
    assert [float(r["mle"].replace(",", ".")) for r in rows] == list(m.mle.ravel())
    told = refused(capsys, "export", str(path), "--out", str(tmp_path / "d.nc"), "--semicolons")
    assert "belongs to a table" in told
    found = answer(capsys, "margin", "--map", str(tmp_path / "a.nc"), *_inside(m))
    assert found == answer(capsys, "margin", "--map", str(path), *_inside(m))
    told = refused(capsys, "margin", "--map", str(out), *_inside(m))
    assert "it is a table (CSV), not an NPZ file" in told


def _inside(m):
    return ["--rotor-mass", str(m.rotor_mass[3]), "--bearing-number", str(m.bearing_number[3])]


def test_json_alone_is_on_stdout_on_a_first_run(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(progress, "is_compiled", lambda *asked: False)
    argv = ["simulate", "--rpm", "9000", "--rotor-mass", "4", *SHORT, "--json"]
    for design in ("[rotor]\ngravity = 0.0\n", None):  # remarks are told
        more = []
        if design:
            (tmp_path / "d.toml").write_text(design)
            more = ["--design", str(tmp_path / "d.toml")]
        assert main([*argv, *more]) == 0
        found = capsys.readouterr()
        assert json.loads(found.out)["status"] == "ok" and "compiling" in found.err
        assert ("of the reference design" in found.err) == bool(design)


def test_without_weight_there_is_no_attitude_angle(capsys, tmp_path):
    path = tmp_path / "d.toml"
    path.write_text("[rotor]\ngravity = 0.0\nunbalance_eccentricity = 0.0\n")
    argv = ["design", "show", "--design", str(path), "--rotor-mass", "4", "--rpm", "9000"]
    found = answer(capsys, *argv, "--mesh", "2x16")
    assert found["attitude_angle_deg"] is None and found["eccentricity"] == pytest.approx(0.0)
    assert main([*argv, "--mesh", "2x16"]) == 0
    assert "attitude" not in capsys.readouterr().out


def test_a_bar_has_an_end_even_where_the_work_takes_longer(capsys, tmp_path, monkeypatch):
    class Solved(Exception):
        pass

    def slow(*values, progress, **more):
        for _ in range(40):
            progress(1)
        raise Solved

    monkeypatch.setattr(design_map_command, "quick_map", slow)
    argv = ["design", "map", "--minutes", "0.1", "--out", str(tmp_path / "q.npz")]
    with pytest.raises(Solved):
        main(argv)
    assert "of None" not in capsys.readouterr().err


def test_a_map_that_takes_longer_than_asked_says_so(capsys, tmp_path, monkeypatch):
    """By the clock that the command reads, which is made up here; nothing is solved."""
    result = load_refinement(ARTIFACTS / MAPS[0].file)
    clock = iter((0.0, 39.0, 0.0, 12.0))
    monkeypatch.setattr(design_map_command, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    monkeypatch.setattr(design_map_command, "quick_map", lambda *a, **k: [result])
    argv = ["design", "map", "--minutes", "0.1", "--out", str(tmp_path / "q.npz")]
    assert main(argv) == 0
    told = capsys.readouterr()
    assert "spab: the map took 39 s instead of 6 s: linear theory, a coarse plane" in told.err
    assert "of 5,120 cells solved" in told.out
    assert main(argv) == 0  # what a machine needs to start and to write is no overrun
    assert "instead of" not in capsys.readouterr().err


def test_outside_the_map_no_interval_is_given(capsys, tmp_path):
    path = tmp_path / "m.npz"
    save_map(map_of(lambda number, mass: 0.2 * number - 0.05 * mass), path)
    argv = ["predict", "--map", str(path), "--model", "cubic", "--rotor-mass", "11"]
    number = BEARING_NUMBER_RANGE[1]
    found = answer(capsys, *argv, "--bearing-number", str(number))
    assert found["interval_90"] is found["probability_unstable"] is None and found["regime"]
    assert not found["inside_map"]
    assert main([*argv[:-1], "60", "--bearing-number", "3"]) == 0
    told = capsys.readouterr()
    assert "outside the map (bearing number 0.5 to 8.5, rotor mass 1 to 25 kg)" in told.err
    assert "interval" not in told.out and "probability" not in told.out
    by_speed = answer(capsys, *argv, "--rpm", rpm_of(number, load_map(path).design))
    assert by_speed["mle_per_revolution"] == pytest.approx(found["mle_per_revolution"])


def test_the_held_speed_of_a_line_is_not_a_range(capsys):
    args = SimpleNamespace(vary="rotor-mass", at=None, range="1:2:2", rpm="9000:9100:2")
    with pytest.raises(options.InputError, match="--rpm = '9000:9100:2' is not a number"):
        maps._line(args, reference_design())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("5000:30000:1000", "for steps of 1000 write 5000:30000:26"),
        ("5000:30000:100", ""),
        ("5000:30000:999", ""),
    ],
)
def test_a_count_that_looks_like_a_step_is_doubted(capsys, text, words):
    assert len(options.values_of(text, "--rpm")) == int(text.split(":")[2])
    told = capsys.readouterr().err
    assert words in told and bool(told) == bool(words)


DRAWN = ["--rotor-mass", "4", "--rpm", "9000", "--machines", "64", "--axis", "none", *SHORT]


def told(capsys, *command):
    """What a refused command says, remarks about the design before."""
    capsys.readouterr()
    assert main(list(command)) == 2
    err = capsys.readouterr().err
    assert "Traceback" not in err
    return err


def own_design(path, more=""):
    path.write_text(f"[bearing]\nclearance = 35e-6\n{more}")
    return str(path)


def test_no_command_writes_over_what_it_reads(capsys, tmp_path):
    own = own_design(tmp_path / "own.toml", '[tolerances]\nrotor_mass = "± 5 %"\n')
    before = (tmp_path / "own.toml").read_bytes()
    plane = str(tmp_path / "m.npz")
    answer(
        capsys, "map", "--bearing-number", "1:2:2", "--rotor-mass", "1:2:2", "--out", plane, *SHORT
    )
    vary = ["--vary", "bearing.clearance", "30:40 µm", "--wish", "stiffness", "--wish", "film"]
    improve = ["design", "improve", "--rotor-mass", "4", "--rpm", "9000", *vary]
    other = str(tmp_path / "other.toml")
    own_design(tmp_path / "other.toml")
    for command, words in (
        (
            ["design", "tolerance", "--design", own, "--rpm", "9000", *DRAWN, "--out", own],
            "to read",
        ),
        ([*improve, "--design", own, "--best-out", own], "to read"),
        ([*improve, "--design", own, "--best-out", other], "is there already"),
        ([*improve, "--design", own, "--best-out", f"{other}.txt"], "must end in .toml"),
        (["refine", "--map", plane, "--budget", "4", "--out", plane], "to read"),
        (["predict", "--model", "nearest", "--map", plane, "--out", plane], "to read"),
        (["design", "map", "--design", own, "--out", plane, "--map-out", plane], "of --out too"),
    ):
        assert words in told(capsys, *command), command
    assert (tmp_path / "own.toml").read_bytes() == before and load_map(plane).shape == (2, 2)


def test_tolerances_come_through_a_pipe(capsys, tmp_path):
    own = own_design(tmp_path / "own.toml", '[tolerances]\nrotor_mass = "± 5 %"\n')
    os.mkfifo(tmp_path / "pipe")
    asked = ["--within", "bearing.permeability", "± 10 %", *DRAWN]
    writer = threading.Thread(
        target=lambda: (tmp_path / "pipe").write_bytes(Path(own).read_bytes())
    )
    writer.start()
    # refused after all was read
    args = ["design", "tolerance", "--design", str(tmp_path / "pipe"), *asked, "--half-width", "9"]
    assert "half width" in told(capsys, *args)
    writer.join(10)
    assert not writer.is_alive()


def test_a_speed_in_two_readings_is_refused_by_all(capsys):
    for command in ("tolerance", "improve"):
        more = [] if command == "tolerance" else ["--vary", "bearing.clearance", "30:40 µm"]
        said = refused(capsys, "design", command, "--rotor-mass", "4", "--rpm", "40.000", *more)
        assert "can be read in two ways" in said


def test_slips_are_told(capsys, tmp_path):
    for text, words in (
        (f"[bearing]\nradius = {'9' * 5000}\n", "not a TOML file"),
        ('[gas]\nviscosity = "18.5 µPas"\n', "write 1.85e-05"),
        ('[gas]\nviscosity = "15 cSt"\n', "kinematic"),
    ):
        path = tmp_path / "d.toml"
        path.write_text(text)
        said = refused(capsys, "stiffness", "--bearing-number", "3", "--design", str(path))
        assert words in said, said
    for values, words in (
        ("[rotor]\ngravity = 981\n", "if that is in cm/s², write 9.81"),
        ("[rotor]\nunbalance_eccentricity = 0.0025\n", "if that is in mm, write 2.5e-06"),
    ):
        path.write_text(values)
        main(["stiffness", "--bearing-number", "3", "--design", str(path)])
        assert words in capsys.readouterr().err
    said = refused(
        capsys,
        "design",
        "tolerance",
        *DRAWN,
        "--within",
        "bearing.clearance",
        "± 2,5 µm",
    )
    assert "the decimal sign is a point: write 2.5" in said


def test_a_margin_off_a_map_takes_no_options_of_the_solver(capsys):
    asked = ["margin", "--rotor-mass", "4", "--rpm", "8900", "--map", "--points", "9"]
    assert "--points: not allowed with --map" in refused(capsys, *asked)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda d: compute_map(d, [2.0, 1.0], [2.0, 3.0]), "rise"),
        (lambda d: compute_map(d, [1.0, 1.0], [2.0, 3.0]), "rise"),
        (lambda d: compute_map(d, 1.0, [2.0, 3.0]), "must be an array"),
        (lambda d: compute_map(d, [1.0], [2.0], workers=0), "workers = 0"),
        (lambda d: compute_bifurcation(d, "rotor-mass", 3.0, np.array([2.0, 1.0])), "rise"),
        (lambda d: solve_point(d, 4.0, 3.0, path_revolutions=-1), "path_revolutions = -1"),
        (lambda d: solve_point(d, 4.0, 3.0, path_revolutions=2.5), "whole number"),
        (lambda d: Settings(mesh=3), "mesh = '3' is not allowed"),
        (lambda d: Settings(mesh=None), "mesh = 'None' is not allowed"),
        (lambda d: solve_margin(d, 4.0, 3.0, points=2.5), "whole number"),
        (lambda d: concentric_stiffness(d, "3"), "bearing number must be a number"),
        (lambda d: concentric_stiffness(d, 100.0), "bearing number = 100 is out of range"),
        (lambda d: static_equilibrium(d, -1.0, 3.0), "rotor mass = -1 kg is out of range"),
        (lambda d: static_equilibrium(d, math.nan, 3.0), "rotor mass = nan"),
        (lambda d: linear_spectrum(d, -1.0, 3.0), "rotor mass = -1"),
        (lambda d: whirl_thresholds(d, 100.0), "bearing number = 100"),
    ],
)
def test_the_library_refuses_in_a_sentence_too(design, call, words):
    with pytest.raises(InputError, match=words):
        call(design)
