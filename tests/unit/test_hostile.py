"""Hostile and clumsy input: every option of the command line, damaged files of every kind
(benchmarks/fuzz.py in short).
"""

import argparse
import contextlib
import dataclasses
import io
import json
import os
import subprocess
import sys
import tracemalloc
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from joblib.externals.loky import cpu_count

from spab_core.cli.main import _build_parser, main
from spab_core.common.errors import InputError
from spab_core.common.npz import MAX_BYTES, UNREADABLE, npz_bytes, open_npz
from spab_core.design.model import (
    MAX_DESIGN_BYTES,
    design_toml,
    load_design,
    parse_design,
    read_design_bytes,
    reference_design,
)
from spab_core.jobs import store as jobs
from spab_core.maps.stability_map import FIELDS, StabilityMap, load_map, save_map
from spab_core.shipped.manifest import load_reference_map
from tests.conftest import ROOT, load_script

NUMBERS = [
    "nan",
    "inf",
    "-inf",
    "-1",
    "0",
    "1e999",
    "-0.0",
    "9" * 400,
    "1e-320",
    "",
    "0x10",
    "1_000_000_000_000",
    "٣",
    "ten",
]
TEXTS = [
    "",
    " ",
    "\0",
    "\udcff",
    "Λ½",
    "x" * 5000,
    "../../etc/passwd",
    "nan",
    "--",
    "%s",
    "[",
    "1e9x1e9",
    "99999999x99999999",
]
RANGES = [
    "1:2:1000000000",
    "1:2:0",
    "2:1:3",
    "nan:1:2",
    "1:inf:2",
    "0:1:2",
    "::",
    "1:2",
    "a:b:c",
    "1:2:3:4",
    "1:2:-5",
    "1:1e9:2",
]
MISSING = ["", "\0", "missing.file", ".", "/dev/null", "x" * 5000, "\udcff", "damaged"]
OUTPUTS = ["", "\0", "nowhere/out.npz", ".", "x" * 5000, "out", "Λ.npz", "\udcff.npz", "out.npz/x"]
LIST = ["", ",", "1,,2", "nan", "2,-1", "tree,oracle", "999999999"]
ADDRESSES = ["", "\0", "x" * 300, "::::", "é" * 70, "127.0.0.1"]
FILES = {"--design", "--map", "map", "--folder", "--start"}

# the least work of every command, and what cannot be left out
LEAST = {
    ("simulate",): {
        "--rotor-mass": "4",
        "--bearing-number": "3",
        "--transient": "30",
        "--revolutions": "20",
    },
    ("stiffness",): {"--bearing-number": "3"},
    ("whirl-threshold",): {"--bearing-number": "3"},
    ("map",): {
        "--bearing-number": "3:3:1",
        "--rotor-mass": "4:4:1",
        "--out": "m.npz",
        "--transient": "30",
        "--revolutions": "20",
    },
    ("bifurcation",): {
        "--vary": "rotor-mass",
        "--at": "3",
        "--range": "4:4:1",
        "--out": "b.npz",
        "--sweeps": "cold",
        "--transient": "30",
        "--revolutions": "20",
    },
    ("evaluate",): {"--map": "small.npz", "--models": "tree", "--divisors": "4", "--seeds": "1"},
    ("predict",): {"--map": "small.npz", "--model": "tree", "--divisor": "4", "--out": "p.npz"},
    ("refine",): {
        "--bearing-number": "3:4:2",
        "--rotor-mass": "4:5:2",
        "--budget": "16",
        "--out": "r.npz",
    },  # too few cells
    ("train",): {"--map": "small.npz", "--model": "tree", "--divisor": "4", "--out": "m.joblib"},
    ("verify",): {"--folder": "nowhere"},
    ("jobs", "list"): {},
    ("jobs", "cancel"): {"id": "point-0123456789abcdef"},
    ("jobs", "delete"): {"id": "x"},
    ("design", "show"): {"--rotor-mass": "4", "--bearing-number": "3"},
    ("design", "presets"): {},
    ("design", "new"): {"--preset": "spab60", "--out": "d.toml"},
    ("design", "coefficients"): {
        "--rotor-mass": "4",
        "--bearing-number": "3:4:2",
        "--out": "c.csv",
    },
    ("design", "tolerance"): {
        "--rotor-mass": "4",
        "--bearing-number": "3",
        "--machines": "2",
        "--axis": "none",
        "--transient": "30",
        "--revolutions": "20",
    },  # without a tolerance
    ("design", "improve"): {
        "--rotor-mass": "4",
        "--bearing-number": "3",
        "--vary": "bearing.clearance",
    },  # without a range
    ("design", "map"): {"--minutes": "0", "--out": "q.npz"},  # refused
    ("dashboard",): {"--port": "0"},  # refused
    ("margin",): {"--map": "small.npz", "--rotor-mass": "4", "--bearing-number": "3"},
    ("export",): {"map": "small.npz", "--out": "e.csv"},
}


def watch():
    cpu_count(only_physical_cores=True)  # asks lscpu once, then it is known
    fuzz = load_script("benchmarks/fuzz.py")
    return fuzz.Watch(unpickling=False)  # numba's own cache of kernels


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
    known = {"--out": OUTPUTS, "--orbit": OUTPUTS, "--map-out": OUTPUTS} | dict.fromkeys(
        FILES, MISSING
    )
    if name in known:
        return name, st.sampled_from(known[name])
    return name, st.sampled_from([*NUMBERS, *TEXTS, *RANGES, *LIST]) | st.text(max_size=12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("hostile")
    m = load_reference_map()
    save_map(
        StabilityMap(
            m.bearing_number[::24],
            m.rotor_mass[::30],
            **{name: getattr(m, name)[::24, ::30] for name in FIELDS},
            metadata=m.metadata,
        ),
        place / "small.npz",
    )
    (place / "damaged").write_bytes((place / "small.npz").read_bytes()[:-900])
    return place


@pytest.fixture(scope="module")
def watching():
    return watch()


def test_every_command_is_driven():
    assert set(LEAST) == set(COMMANDS)


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
@settings(
    max_examples=25,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(data=st.data())
def test_any_value_of_any_option_is_taken_or_refused_in_a_sentence(
    path, folder, watching, monkeypatch, data
):
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
            argv += (
                [f"{name}={value}" if value else name]
                if name in _flags(path)
                else [value]
                if not name.startswith("-")
                else [f"{name}={value}"]
            )
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
    own = [
        os.environ[name]
        for name in ("SPAB_CACHE", "SPAB_JOBS", "NUMBA_CACHE_DIR")
        if name in os.environ
    ]
    assert watching.found is None or any(place in watching.found for place in own), argv


def _flags(path):
    return {a.option_strings[-1] for a in COMMANDS[path] if a.nargs == 0}


@pytest.mark.slow
def test_damaged_files_and_values_of_every_kind():
    """A few hundred of the cases of benchmarks/fuzz.py; the script says which failed."""
    found = subprocess.run(
        [sys.executable, ROOT / "benchmarks" / "fuzz.py", "--cases", "400", "--seed", "7"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert found.returncode == 0, found.stdout + found.stderr[-2000:]
    assert "400 cases" in found.stdout and " 0 failed" in found.stdout


def zipped(path, how=zipfile.ZIP_DEFLATED, **members):
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, data in members.items():
            archive.writestr(f"{name}.npy", data)


def header(shape, descr="<f8"):
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    return buffer.getvalue()


@contextlib.contextmanager
def little_memory():
    """No more than 3 MB are taken in between."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < 3_000_000
    finally:
        tracemalloc.stop()


def test_a_bomb_is_refused_before_it_goes_off(tmp_path):
    """A file of some thousandths of the size that it unpacks to, whether its directory says so or
    not, takes no memory.
    """
    path = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("mle.npy", "w", force_zip64=True) as file,
    ):
        file.write(header((125_000_000,)))
        for _ in range(1000):
            file.write(bytes(1_000_000))
    assert path.stat().st_size < 10_000_000
    with (
        little_memory(),
        pytest.raises(
            InputError, match=f"unpacks to 1,000,000,128 bytes: allowed are at most {MAX_BYTES:,}"
        ),
    ):
        load_map(path)
    data = path.read_bytes()  # the directory now says that it is small
    path.write_bytes(
        data[:-200]
        + data[-200:].replace((1_000_000_128).to_bytes(4, "little"), (10_000).to_bytes(4, "little"))
    )
    with (
        little_memory(),
        open_npz(path) as file,
        pytest.raises(UNREADABLE, match="larger than the file"),
    ):
        file["mle"]


@pytest.mark.parametrize(
    ("shape", "descr"),
    [
        ((10**9,), "<f8"),
        ((31623, 31623), "<f8"),
        ((10**9, 10**9), "<f8"),
        ((-5,), "<f8"),
        ((2**62, 4), "<f8"),
        ((10**12,), "<U0"),
        ((3,), "<U1000000000"),
        ((2,), "|O"),
        ((2,), "<M8[s]"),
        ((2,), [("a", "<f8")]),
        ((1,) * 80, "<f8"),
    ],
)
def test_a_header_that_lies_takes_no_memory(tmp_path, shape, descr):
    path = tmp_path / "lie.npz"
    zipped(path, bearing_number=header(shape, descr) + bytes(16))
    with little_memory(), open_npz(path) as data, pytest.raises(UNREADABLE):
        data["bearing_number"]


def test_what_is_packed_otherwise_or_no_regular_file_is_refused(tmp_path):
    for how in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        zipped(tmp_path / "other.npz", how, mle=header((1,)) + bytes(8))
        with pytest.raises(InputError, match="compressed in another way"):
            load_map(tmp_path / "other.npz")
    zipped(tmp_path / "many.npz", zipfile.ZIP_STORED, **{f"{k:0100d}": b"" for k in range(7000)})
    with pytest.raises(InputError, match="too many parts"):
        load_map(tmp_path / "many.npz")
    os.mkfifo(tmp_path / "pipe")
    for path in ("/dev/zero", tmp_path / "pipe", tmp_path):  # none is waited for
        with pytest.raises(InputError, match="cannot read the map"):
            load_map(path)


def test_arrays_come_back_as_they_were_written(tmp_path):
    arrays = {
        "a": np.arange(6.0).reshape(2, 3),
        "b": np.array(["x", "Λ"]),
        "c": np.empty((0, 4), np.int16),
        "d": np.array(True),
        "f": np.asfortranarray(np.arange(6).reshape(2, 3)),
    }
    for source in (npz_bytes(arrays), tmp_path / "a.npz"):
        if source == tmp_path / "a.npz":
            np.savez(source, **arrays)
        with open_npz(source) as data:
            for name, array in arrays.items():
                assert np.array_equal(data[name], array) and data[name].dtype == array.dtype
            assert "e" not in data


def test_maps_whose_axes_do_not_rise_are_refused(tmp_path, folder):
    m = load_map(folder / "small.npz")
    for wrong in (np.nan, np.inf, 0.0, 1e9):
        axis = m.rotor_mass.copy()
        axis[-1] = wrong
        save_map(dataclasses.replace(m, rotor_mass=axis), tmp_path / "m.npz")
        with pytest.raises(InputError, match=r"rise|finite|out of range"):
            load_map(tmp_path / "m.npz")


@pytest.mark.parametrize(
    "argv",
    [
        ["map", "--bearing-number", "1:2:100000", "--rotor-mass", "1:2:10000", "--out", "x.npz"],
        ["map", "--bearing-number", "1:2:1000000000", "--rotor-mass", "1:2:1", "--out", "x.npz"],
        [
            "design",
            "map",
            "--bearing-number",
            "1:2:100000",
            "--rotor-mass",
            "1:2:10000",
            "--out",
            "x.npz",
        ],
        [
            "refine",
            "--bearing-number",
            "1:2:100000",
            "--rotor-mass",
            "1:2:10000",
            "--budget",
            "100",
            "--out",
            "x.npz",
        ],
    ],
)
def test_a_map_of_a_billion_cells_is_a_sentence(argv, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(argv) == 2
    assert "out of range: allowed is from" in capsys.readouterr().err and not list(
        tmp_path.iterdir()
    )


def test_a_csv_of_very_many_rows_is_a_sentence():
    from spab_core.surrogates.user_data import MAX_BYTES, read_samples

    with pytest.raises(InputError, match="200,000 rows"):
        read_samples(b"bearing_number,rotor_mass,mle\n" + b"1,2,3\n" * 300_000)
    with pytest.raises(InputError, match=f"at most {MAX_BYTES:,}"):
        read_samples(b"x" * (MAX_BYTES + 1))


def test_a_design_file_that_costs_by_its_square_is_refused(tmp_path, capsys):
    """8 GB in tomllib, by whatever way it comes in: library, command, upload; and only design.py
    has a reader of its own.
    """
    text = design_toml(reference_design()).encode()
    assert read_design_bytes(text) == reference_design() and len(text) * 5 < MAX_DESIGN_BYTES
    path, costly = tmp_path / "long.toml", "a." * 45_000 + "a = 1"
    path.write_text(costly)
    for read, content in (
        (parse_design, costly),
        (read_design_bytes, costly.encode()),
        (load_design, path),
    ):
        with pytest.raises(InputError, match="more than 20,000 bytes"):
            read(content)
    assert (
        main(["simulate", "--design", str(path), "--rotor-mass", "4", "--bearing-number", "3"]) == 2
    )
    assert "more than 20,000 bytes" in capsys.readouterr().err
    sources = [*ROOT.glob("*.py"), *ROOT.glob("pages/*.py"), *ROOT.glob("spab_core/**/*.py")]
    assert [p.name for p in sources if "tomllib" in p.read_text("utf-8")] == ["model.py"]


def test_an_infinite_stiffness_is_listed_as_json(capsys):
    name, parameters = jobs._request(
        "point",
        {
            "design": {"rotor": {"shaft_stiffness": float("inf")}},
            "rotor_mass": 5.0,
            "bearing_number": 3.0,
        },
    )
    (jobs.jobs_folder() / name).mkdir()
    now = {
        "kind": "point",
        "parameters": parameters,
        "state": "cancelled",
        "done": 0,
        "total": 0,
        "kept": 0,
        "created": 1e9,
        "queued": 1e9,
        "started": None,
        "finished": None,
        "message": "",
        "pid": None,
    }
    jobs.write_state(jobs.jobs_folder() / name, now)
    assert main(["jobs", "list", "--json"]) == 0
    found = [job for job in json.loads(capsys.readouterr().out)["jobs"] if job["id"] == name]
    assert found[0]["parameters"]["design"]["rotor"]["shaft_stiffness"] == "inf"
    for field, value in (
        ("created", float("nan")),
        ("started", 10**400),
        ("done", -1),
        ("total", True),
        ("kind", {}),
    ):
        jobs.write_state(jobs.jobs_folder() / name, now | {field: value})
        with pytest.raises(InputError, match="damaged"):
            jobs.find(name)
    jobs.delete(name)
