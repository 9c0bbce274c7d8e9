"""The command line: keys of the answers, files, and one sentence with exit code 2 for every wrong
input.
"""

import csv
import importlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from spab_core.cli.main import _GROUPS, main
from spab_core.cli.options import Parser
from spab_core.common.words import newtons
from spab_core.design.model import design_toml, reference_design
from spab_core.maps import compute as map_engine
from spab_core.maps.stability_map import load_map
from tests.commands import answer, refused

SHORT = ["--mesh", "3x16", "--transient", "30", "--revolutions", "30"]


def test_simulate_keys(capsys, tmp_path):
    orbit = tmp_path / "orbit.csv"
    found = answer(
        capsys,
        "simulate",
        "--rotor-mass",
        "18",
        "--bearing-number",
        "4.5",
        *SHORT,
        "--orbit",
        str(orbit),
    )
    assert list(found) == [
        "rotor_mass_kg",
        "bearing_number",
        "speed_rad_s",
        "speed_rpm",
        "mle_per_revolution",
        "mle_standard_error",
        "regime",
        "period",
        "contact_share",
        "thin_film_share",
        "peak_contact_force_n",
        "max_eccentricity",
        "least_film_m",
        "orbit_amplitude",
        "assessment",
        "assessment_reasons",
        "rest",
        "coexisting",
        "status",
        "mesh",
        "revolutions",
        "pushed",
        "wall_seconds",
    ]
    assert found["status"] == "ok" and found["mesh"] == "3x16" and found["revolutions"] == 60
    assert b"\r" not in orbit.read_bytes()
    rows = list(csv.DictReader(orbit.read_text().splitlines()))
    assert rows[0]["units"].startswith("tau: rad; X, Y, Z: over the clearance of 35 µm; ")
    assert not rows[1]["units"] and list(rows[0])[-1] == "units"
    assert len(rows) == 30 * 96 and set(rows[0]) >= {"tau", "X2", "Y2", "X1", "Y1"}
    assert (
        max(float(r["X2"]) ** 2 + float(r["Y2"]) ** 2 for r in rows)
        <= found["max_eccentricity"] ** 2 * 1.01
    )


def test_simulate_text(capsys):
    assert main(["simulate", "--rotor-mass", "4", "--bearing-number", "3", *SHORT]) == 0
    told = capsys.readouterr().out
    assert "MLE" in told
    found = answer(capsys, "simulate", "--rotor-mass", "4", "--bearing-number", "3", *SHORT)
    assert f"least film {1e6 * found['least_film_m']:.2f} µm, largest asperity force " in told
    assert f"{newtons(found['peak_contact_force_n'])} N; " in told


def test_stiffness_and_threshold_keys(capsys, tmp_path):
    found = answer(capsys, "stiffness", "--bearing-number", "3.45", "--mesh", "3x16")
    assert list(found) == ["kxx", "kyx", "kxx_n_per_m", "kyx_n_per_m"]
    assert found["kxx_n_per_m"] / found["kxx"] == pytest.approx(reference_design().stiffness_unit)
    found = answer(capsys, "whirl-threshold", "--bearing-number", "1", "--mesh", "3x16")
    assert found["critical_mass_kg"] > 0.0 and found["whirl_ratio"] == pytest.approx(0.5, abs=0.05)
    weightless = tmp_path / "free.toml"
    weightless.write_text(design_toml(reference_design().replace(rotor__gravity=0.0)))
    found = answer(
        capsys,
        "whirl-threshold",
        "--bearing-number",
        "1",
        "--mesh",
        "3x16",
        "--design",
        str(weightless),
    )
    assert (
        found["critical_mass_kg"] is None and found["whirl_ratio"] is None
    )  # unfed, unloaded: unstable at any mass


def test_threshold_says_which_side_is_stable(capsys):
    found = answer(capsys, "whirl-threshold", "--bearing-number", "1", "--mesh", "3x16")
    assert found["stable_side"] == found["thresholds"][0]["stable_side"] == "above"


def _map(out, *more):
    return [
        "map",
        "--bearing-number",
        "2:4:3",
        "--rotor-mass",
        "3:9:2",
        "--out",
        str(out),
        *SHORT,
        *more,
    ]


def test_map_file_and_worker_count(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(map_engine, "CHUNK_CELLS", 2)  # three chunks for two workers
    assert answer(capsys, *_map(tmp_path / "a.npz"))["cells"] == 6
    answer(capsys, *_map(tmp_path / "b.npz", "--workers", "2"))
    with np.load(tmp_path / "a.npz", allow_pickle=False) as data:
        assert set(data) == {
            "bearing_number",
            "rotor_mass",
            "mle",
            "mle_standard_error",
            "regime",
            "period",
            "contact_share",
            "max_eccentricity",
            "status",
            "revolutions",
            "orbit_amplitude",
            "thin_film_share",
            "peak_contact_force",
            "metadata",
        }
        metadata = json.loads(str(data["metadata"]))
    assert {"design", "mesh", "steps", "revolutions", "versions", "date", "wall_seconds"} <= set(
        metadata
    )
    a, b = load_map(tmp_path / "a.npz"), load_map(tmp_path / "b.npz")
    assert a.shape == (3, 2) and np.array_equal(a.bearing_number, [2.0, 3.0, 4.0])
    for name in (
        "mle",
        "mle_standard_error",
        "regime",
        "period",
        "contact_share",
        "max_eccentricity",
        "status",
    ):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=name.startswith("mle"))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_map_cell_is_the_point_alone(capsys, tmp_path):
    answer(capsys, *_map(tmp_path / "a.npz"))
    m = load_map(tmp_path / "a.npz")
    found = answer(capsys, "simulate", "--rotor-mass", "9", "--bearing-number", "3", *SHORT)
    assert m.mle[1, 1] == found["mle_per_revolution"] and m.regime[1, 1] == found["regime"]


def test_map_cells_that_are_solved_on_are_the_points_alone(capsys, tmp_path):
    """Undecided after 100 measured revolutions, not after 200: nothing chaotic in map or point, and
    the same to the bit.
    """
    length = ["--mesh", "3x16", "--transient", "100", "--revolutions", "100"]
    axes = ["--bearing-number", "2.4:2.65:2", "--rotor-mass", "3.5:4.1:2"]
    answer(capsys, "map", *axes, "--out", str(tmp_path / "a.npz"), *length)
    m = load_map(tmp_path / "a.npz")
    assert (m.revolutions == 300).all() and set(m.regime.flat) <= {"quasi-periodic", "periodic"}
    assert m.regime[0, 1] == m.regime[1, 0] == "quasi-periodic"  # 2.4, 4.1 kg and 2.65, 3.5 kg
    for row, number in enumerate(m.bearing_number):
        for column, mass in enumerate(m.rotor_mass):
            point = ["--rotor-mass", repr(float(mass)), "--bearing-number", repr(float(number))]
            found = answer(capsys, "simulate", *point, *length)
            cell = row, column
            assert found["mle_per_revolution"] == m.mle[cell]
            assert found["regime"] == m.regime[cell] and found["revolutions"] == m.revolutions[cell]
            assert found["max_eccentricity"] == m.max_eccentricity[cell]


@pytest.mark.slow
def test_a_killed_map_goes_on_from_its_chunks(tmp_path):
    command = [
        sys.executable,
        "-m",
        "spab_core.cli.main",
        "map",
        "--bearing-number",
        "2:4:20",
        "--rotor-mass",
        "3:9:10",
        "--out",
        str(tmp_path / "k.npz"),
        *SHORT,
    ]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    parts = tmp_path / "k.npz.parts"
    deadline = time.monotonic() + 120
    while len(list(parts.glob("chunk-*.npz"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not (tmp_path / "k.npz").exists()
    # mark a finished chunk: its mark must be in the result, or it was computed again
    first = parts / "chunk-000000.npz"
    with np.load(first) as data:
        chunk = dict(data)
    chunk["max_eccentricity"][0] = 0.123456789
    np.savez(first, **chunk)
    # another setting refuses to go on
    other = subprocess.run([*command, "--tolerance", "1e-3"], capture_output=True, text=True)
    assert other.returncode == 2 and "settings" in other.stderr and other.stderr.count("\n") == 1
    subprocess.run(command, check=True, capture_output=True)
    whole = [*command]
    whole[whole.index("--out") + 1] = str(tmp_path / "w.npz")
    subprocess.run(whole, check=True, capture_output=True)
    a, b = load_map(tmp_path / "k.npz"), load_map(tmp_path / "w.npz")
    assert a.max_eccentricity[0, 0] == 0.123456789
    assert np.array_equal(a.mle, b.mle, equal_nan=True) and np.array_equal(a.regime, b.regime)
    assert np.array_equal(a.max_eccentricity.ravel()[1:], b.max_eccentricity.ravel()[1:])


@pytest.mark.parametrize(
    "argv, words",
    [
        ([], ["required: COMMAND"]),
        (["fly"], ["fly"]),
        (["simulate", "--rotor-mass", "1"], ["--bearing-number"]),
        (
            ["simulate", "--rotor-mass", "x", "--bearing-number", "1"],
            ["--rotor-mass", "'x'", "number"],
        ),
        (
            ["simulate", "--rotor-mass", "-1", "--bearing-number", "1"],
            ["rotor mass", "-1", "0.001 to 1000 kg"],
        ),
        (["simulate", "--rotor-mass", "nan", "--bearing-number", "1"], ["rotor mass", "nan"]),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "inf"],
            ["bearing number", "inf", "50"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--mesh", "1e9x3"],
            ["mesh", "1e9x3", "2x8 to 16x64"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--method", "magic"],
            ["magic", "rodas, dtm"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--transient", "29"],
            ["transient = 29", "30 revolutions"],
        ),
        (
            [
                *("map", "--bearing-number", "1:2:2", "--rotor-mass", "1:5:2"),
                *("--out", "x.npz", "--transient", "20"),
            ],
            ["transient = 20", "30 revolutions"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--max-orbit", "2"],
            ["largest orbit = 2", "0.01 to 1"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--revolutions", "2.5"],
            ["--revolutions", "2.5"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--design", "/nowhere.toml"],
            ["/nowhere.toml"],
        ),
        (
            [
                "simulate",
                "--rotor-mass",
                "1",
                "--bearing-number",
                "1",
                "--orbit",
                "/no/folder/x.csv",
            ],
            ["--orbit", "/no/folder"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--orbit", "/dev/null"],
            ["--orbit", "/dev/null"],
        ),
        (
            ["simulate", "--rotor-mass", "1", "--bearing-number", "1", "--design", ""],
            ["design file"],
        ),
        (["simulate", "a\nb"], ["required"]),
        (["stiffness", "--bearing-number", "0"], ["bearing number", "0.01 to 50"]),
        (
            ["map", "--bearing-number", "1:2", "--rotor-mass", "1:2:2", "--out", "x.npz"],
            ["--bearing-number", "start:stop:count"],
        ),
        (
            ["map", "--bearing-number", "2:1:3", "--rotor-mass", "1:2:2", "--out", "x.npz"],
            ["--bearing-number", "before"],
        ),
        (
            ["map", "--bearing-number", "1:2:0", "--rotor-mass", "1:2:2", "--out", "x.npz"],
            ["count", "0"],
        ),
        (
            ["map", "--bearing-number", "1:2:9999", "--rotor-mass", "1:2:99999", "--out", "x.npz"],
            ["cells", "2000000"],
        ),
        (
            ["map", "--bearing-number", "1:nan:3", "--rotor-mass", "1:2:2", "--out", "x.npz"],
            ["--bearing-number"],
        ),
        (
            ["map", "--bearing-number", "1:2:2", "--rotor-mass", "1:2:2", "--out", "/no/x.npz"],
            ["--out"],
        ),
        (
            [
                "map",
                "--bearing-number",
                "1:2:2",
                "--rotor-mass",
                "1:2:2",
                "--out",
                "x.npz",
                "--workers",
                "0",
            ],
            ["--workers", "1"],
        ),
        (
            ["map", "--bearing-number", "1:99:2", "--rotor-mass", "1:2:2", "--out", "x.npz"],
            ["bearing number", "99"],
        ),
    ],
    ids=lambda v: " ".join(v)[:60] if isinstance(v, list) else "",
)
def test_wrong_input_is_one_sentence(capsys, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    message = refused(capsys, *argv)
    for word in words:
        assert word in message, message
    assert list(tmp_path.iterdir()) == []


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    st.text(max_size=30),
    st.sampled_from(["--rotor-mass", "--bearing-number", "--mesh", "--method", "--design"]),
)
def test_no_text_makes_a_traceback(capsys, text, option):
    argv = ["simulate", "--rotor-mass", "-1", "--bearing-number", "1", f"{option}={text}"]
    if option == "--rotor-mass":
        argv = ["simulate", "--bearing-number", "-1", f"{option}={text}"]
    refused(capsys, *argv)


@pytest.mark.parametrize("group", _GROUPS)
def test_a_command_is_found_in_the_module_that_holds_it(group):
    parser = Parser(prog="spab")
    commands = parser.add_subparsers(parser_class=Parser)
    importlib.import_module(f"spab_core.cli.{group}").add_commands(commands)
    assert tuple(commands.choices) == _GROUPS[group]


def test_commands_that_solve_do_not_load_what_learns():
    """Half of a start's time would go into scikit-learn."""
    code = (
        "import sys; from spab_core.cli.main import main\n"
        "for command in ('simulate', 'margin', 'map', 'bifurcation', 'export', 'jobs'):\n"
        "    try: main([command, '--help'])\n"
        "    except SystemExit: pass\n"
        "assert 'spab_core.cli.maps' in sys.modules and 'sklearn' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_the_library_loads_what_only_some_need_where_they_do():
    """pandas and scipy's linear algebra would double the time of an import."""
    code = (
        "import sys, spab_core\n"
        "late = {'pandas', 'scipy.linalg', 'scipy.io', 'sklearn', 'plotly', 'streamlit'}\n"
        "assert 'numba' in sys.modules and not late & set(sys.modules), late & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
