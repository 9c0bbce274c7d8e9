"""Hostile and clumsy input: every option of the command line, damaged files of every kind (benchmarks/fuzz.py in short)."""

import argparse
import contextlib
import importlib.util
import io
import os

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from spab_core.artifacts import load_reference_map
from spab_core.cli import _build_parser, main
from spab_core.stability_map import FIELDS, StabilityMap, save_map
from tests.conftest import ROOT

NUMBERS = ["nan", "inf", "-inf", "-1", "0", "1e999", "-0.0", "9" * 400, "1e-320", "", "0x10", "1_000_000_000_000", "٣", "ten"]
TEXTS = ["", " ", "\0", "\udcff", "Λ½", "x" * 5000, "../../etc/passwd", "nan", "--", "%s", "[", "1e9x1e9", "99999999x99999999"]
RANGES = ["1:2:1000000000", "1:2:0", "2:1:3", "nan:1:2", "1:inf:2", "0:1:2", "::", "1:2", "a:b:c", "1:2:3:4", "1:2:-5",
          "1:1e9:2"]
MISSING = ["", "\0", "missing.file", ".", "/dev/null", "x" * 5000, "\udcff", "damaged"]
OUTPUTS = ["", "\0", "nowhere/out.npz", ".", "x" * 5000, "out", "Λ.npz", "\udcff.npz", "out.npz/x"]
LIST = ["", ",", "1,,2", "nan", "2,-1", "tree,oracle", "999999999"]
ADDRESSES = ["", "\0", "x" * 300, "::::", "é" * 70, "127.0.0.1"]
FILES = {"--design", "--map", "map", "--folder"}

# the least work of every command, and what cannot be left out
LEAST = {
    ("simulate",): {"--rotor-mass": "4", "--bearing-number": "3", "--transient": "0", "--revolutions": "20"},
    ("stiffness",): {"--bearing-number": "3"},
    ("whirl-threshold",): {"--bearing-number": "3"},
    ("map",): {"--bearing-number": "3:3:1", "--rotor-mass": "4:4:1", "--out": "m.npz", "--transient": "0",
               "--revolutions": "20"},
    ("bifurcation",): {"--vary": "rotor-mass", "--at": "3", "--range": "4:4:1", "--out": "b.npz", "--sweeps": "cold",
                       "--transient": "0", "--revolutions": "20"},
    ("evaluate",): {"--map": "small.npz", "--models": "tree", "--divisors": "4", "--seeds": "1"},
    ("predict",): {"--map": "small.npz", "--model": "tree", "--divisor": "4", "--out": "p.npz"},
    ("refine",): {"--bearing-number": "3:4:2", "--rotor-mass": "4:5:2", "--budget": "16", "--out": "r.npz"},  # too few cells
    ("train",): {"--map": "small.npz", "--model": "tree", "--divisor": "4", "--out": "m.joblib"},
    ("verify",): {"--folder": "nowhere"},
    ("jobs", "list"): {}, ("jobs", "cancel"): {"id": "point-0123456789abcdef"}, ("jobs", "delete"): {"id": "x"},
    ("design", "show"): {"--rotor-mass": "4", "--bearing-number": "3"},
    ("design", "presets"): {}, ("design", "new"): {"--preset": "spab60", "--out": "d.toml"},
    ("design", "coefficients"): {"--rotor-mass": "4", "--bearing-number": "3:4:2", "--out": "c.csv"},
    ("design", "map"): {"--minutes": "0", "--out": "q.npz"},  # refused
    ("dashboard",): {"--port": "0"},  # refused
    ("margin",): {"--map": "small.npz", "--rotor-mass": "4", "--bearing-number": "3"},
    ("export",): {"map": "small.npz", "--out": "e.csv"},
}


def watch():
    spec = importlib.util.spec_from_file_location("fuzz", ROOT / "benchmarks" / "fuzz.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Watch(unpickling=False)  # numba's own cache of kernels


def commands(parser, path=()):
    """Every command with its options, as the parser has them."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, sub in action.choices.items():
                yield from commands(sub, (*path, name))
            return
    yield path, [a for a in parser._actions if not isinstance(a, argparse._HelpAction)]


COMMANDS = dict(commands(_build_parser()))


def values(path, action):
    """What to give an option: flags are set or not."""
    name = action.option_strings[-1] if action.option_strings else action.dest
    if action.nargs == 0:
        return name, st.sampled_from([None, ""])
    if name == "--dask":
        return name, st.sampled_from(["", "\0", "nonsense", "tcp://", "http://x"])
    if name == "--address":
        return name, st.sampled_from(ADDRESSES)
    known = {"--out": OUTPUTS, "--orbit": OUTPUTS, "--map-out": OUTPUTS} | dict.fromkeys(FILES, MISSING)
    if name in known:
        return name, st.sampled_from(known[name])
    return name, st.sampled_from([*NUMBERS, *TEXTS, *RANGES, *LIST]) | st.text(max_size=12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("hostile")
    m = load_reference_map()
    save_map(StabilityMap(m.bearing_number[::24], m.rotor_mass[::30],
                          **{name: getattr(m, name)[::24, ::30] for name in FIELDS}, metadata=m.metadata), place / "small.npz")
    (place / "damaged").write_bytes((place / "small.npz").read_bytes()[:-900])
    return place


@pytest.fixture(scope="module")
def watching():
    return watch()


def test_every_command_is_driven():
    assert set(LEAST) == set(COMMANDS)


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
@settings(max_examples=25, deadline=None, derandomize=True,
          suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(data=st.data())
def test_any_value_of_any_option_is_taken_or_refused_in_a_sentence(path, folder, watching, monkeypatch, data):
    monkeypatch.chdir(folder)
    chosen = dict(LEAST[path])
    if any(a.dest == "mesh" for a in COMMANDS[path]):
        chosen["--mesh"] = "2x16"
    for action in data.draw(st.lists(st.sampled_from(COMMANDS[path]), min_size=1, max_size=3)):
        name, strategy = values(path, action)
        chosen[name] = data.draw(strategy)
    if path == ("map",) and chosen.get("--dask"):
        chosen["--workers"] = "-1"
    argv = list(path)
    for name, value in chosen.items():
        if value is not None:
            argv += [f"{name}={value}" if value else name] if name in _flags(path) else \
                [value] if not name.startswith("-") else [f"{name}={value}"]
    out, err = io.StringIO(), io.StringIO()
    watching.folder, watching.found = str(folder), None
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(argv)
        except SystemExit as stop:
            code = stop.code
        finally:
            watching.folder = None
    assert code in (0, 1, 2, 130), (argv, code)
    assert "Traceback" not in out.getvalue() + err.getvalue()
    if code == 2:
        assert err.getvalue().strip() and not out.getvalue(), (argv, err.getvalue())
    own = [os.environ[name] for name in ("SPAB_CACHE", "SPAB_JOBS", "NUMBA_CACHE_DIR") if name in os.environ]
    assert watching.found is None or any(place in watching.found for place in own), argv


def _flags(path):
    return {a.option_strings[-1] for a in COMMANDS[path] if a.nargs == 0}
