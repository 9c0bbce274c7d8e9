"""Does anything that a person can hand in break spab? Valid files and values, damaged at random, to
all that reads them.

    python benchmarks/fuzz.py [--cases 100000] [--seed 1] [--only NAME ...]

A case passes where it is read or refused by a sentence (an ``InputError``). It fails where anything
else is raised, where it takes more than 5 s, unpickles, starts a process, connects, or writes
outside a folder of its own; the run has 1 GB beyond what the imports take. Failures are printed
with the target and the number of the case, which give the same case again. Exit code 1 where there
are any."""

import argparse
import collections
import contextlib
import dataclasses
import io
import json
import os
import random
import resource
import shutil
import signal
import string
import sys
import tempfile
import threading
import time
import warnings
import zipfile
from importlib import resources
from pathlib import Path

import numpy as np

LIMIT, MEMORY = 5.0, 1_000_000_000
NASTY = [
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
    " ",
    "\0",
    "\ud800",
    "Λ½٣",
    "true",
    "null",
    "../../../etc/passwd",
    "..\\..\\x",
    "/etc/passwd",
    "x" * 5000,
    "[" * 3000,
    "{" * 3000,
    "a." * 3000,
    "=",
    "\n",
    "#",
    "'''",
    '"',
    "1:2:1000000000",
    "1e9:2e9:3",
    "4294967296",
    "2,2,2,2",
    "%s%n",
    "${HOME}",
    "<script>",
    "=1+1",
    "\r\n",
    "\ufeff",
]
VALUES = [
    None,
    True,
    False,
    0,
    -1,
    1,
    10**400,
    -(10**30),
    1e308,
    float("nan"),
    float("inf"),
    -float("inf"),
    "",
    "x",
    "nan",
    [],
    {},
    [1],
    {"a": 1},
    [[[]]],
    "../../x",
    "\ud800",
    "chaotic",
    "Ω" * 99,
]


class TooSlow(BaseException):
    """Not caught by any loader."""


class Watch:
    """An audit hook: what a case does besides computing, in the thread that makes the watch: others
    tidy up after earlier cases.
    """

    def __init__(self, unpickling=True):
        self.folder, self.found, self.thread = None, None, threading.get_ident()
        self.refused = {"subprocess.Popen", "os.system", "os.exec", "os.fork", "socket.connect"}
        if unpickling:
            self.refused.add("pickle.find_class")
        sys.addaudithook(self)

    def __call__(self, event, arguments):
        if self.folder is None or threading.get_ident() != self.thread:
            return
        if event in self.refused:
            self.found = f"{event} {str(arguments)[:100]}"
        elif event == "open":
            path, mode, flags = arguments
            writes = (flags or 0) & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC) or set(
                str(mode or "")
            ) & set("wax+")
            if isinstance(path, (str, bytes)) and writes:
                self._check(path)
        elif event in (
            "os.mkdir",
            "os.rename",
            "os.remove",
            "os.rmdir",
            "os.link",
            "os.symlink",
            "os.chmod",
            "os.truncate",
        ):
            self._check(
                arguments[1] if event in ("os.rename", "os.link", "os.symlink") else arguments[0]
            )

    def _check(self, path):
        place = (
            str(Path(os.fsdecode(path)).absolute())
            if isinstance(path, (str, bytes, os.PathLike))
            else ""
        )
        if place and not place.startswith((self.folder, "/dev/null")):
            self.found = f"writes {place}"


# ---- damage


def damaged_bytes(rng, data):
    """A few bytes changed, cut out, doubled or put in; or the end cut off."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(data) + 1)
        length = rng.choice((1, 2, 8, 64, 1000))
        how = rng.randrange(6)
        if how == 0 and data:
            data[at % len(data)] = rng.randrange(256)
        elif how == 1:
            del data[at : at + length]
        elif how == 2:
            data[at:at] = data[at : at + length]
        elif how == 3:
            data[at:at] = rng.choice(NASTY).encode("utf-8", "surrogatepass")
        elif how == 4:
            data[at : at + length] = rng.randbytes(length)
        elif rng.random() < 0.2:
            del data[at:]
    return bytes(data)


def damaged_text(rng, data):
    """A word replaced by a nasty one, lines swapped or doubled; or :func:`damaged_bytes`."""
    if rng.random() < 0.4:
        return damaged_bytes(rng, data)
    lines = data.decode().split("\n")
    for _ in range(rng.choice((1, 1, 2, 5))):
        k = rng.randrange(len(lines))
        words = lines[k].replace(",", " , ").split(" ") or [""]
        how = rng.randrange(4)
        if how < 2:
            words[rng.randrange(len(words))] = rng.choice(NASTY)
            lines[k] = " ".join(words)
        elif how == 2:
            lines.insert(rng.randrange(len(lines)), lines[k])
        else:
            lines[k] = lines[k] + "".join(rng.choices(string.printable, k=rng.randrange(40)))
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def damaged_json(rng, data):
    """A value anywhere in the tree replaced, taken out or doubled; or :func:`damaged_bytes`."""
    if rng.random() < 0.3:
        return damaged_bytes(rng, data)
    root = [json.loads(data)]
    for _ in range(rng.choice((1, 1, 2, 4))):
        places = list(_places(root))
        if not places:
            break
        inside, key = rng.choice(places)
        how = rng.random()
        if how < 0.7:
            inside[key] = rng.choice((*VALUES, *NASTY))
        elif how < 0.85:
            del inside[key]
        elif isinstance(inside, dict):
            inside[rng.choice(NASTY)] = inside[key]
        else:
            inside.append(inside[key])
        root = root or [None]
    return json.dumps(root[0]).encode()


def _places(inside):
    for key in inside if isinstance(inside, dict) else range(len(inside)):
        yield inside, key
        if isinstance(inside[key], (dict, list)):
            yield from _places(inside[key])


def damaged_npz(rng, data):
    """An array of another kind, shape or value, a header that lies, a bomb; or
    :func:`damaged_bytes`.
    """
    if rng.random() < 0.35:
        return damaged_bytes(rng, data)
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        arrays = dict(file)
    parts = {}
    for _ in range(rng.choice((1, 1, 2, 3))):
        with contextlib.suppress(
            ValueError, TypeError, OverflowError
        ):  # a value that an earlier change left no room for
            _change(rng, arrays, parts)
    return packed(rng, arrays, parts)


def _change(rng, arrays, parts):
    name = rng.choice(sorted(arrays))
    array, how = arrays[name], rng.randrange(12)
    if how == 0:
        if len(arrays) > 1:
            del arrays[name]
    elif how == 1:
        arrays[rng.choice(("../../evil", "/tmp/evil", "a" * 300, "metadata", "Ω"))] = array
    elif how == 2 and name == "metadata":
        arrays[name] = np.array(damaged_json(rng, str(array).encode()).decode("utf-8", "replace"))
    elif how == 3 and array.size:
        kind = rng.choice(("O", "U3", "S2", "f2", "f4", "i1", "u8", "c16", "?", "i8", "f8"))
        arrays[name] = (
            array.astype(kind) if array.dtype.kind in "biuf" else np.array([None], object)
        )
    elif how == 4:
        arrays[name] = array.reshape(
            rng.choice(((-1,), (1, *array.shape), (*array.shape, 1), array.shape[::-1]))
        )
    elif how == 5:
        arrays[name] = np.repeat(array.ravel()[:1], rng.choice((0, 1, 2, 5, 1000)))
    elif how in (6, 7) and array.size and array.dtype.kind in "iuf":
        array = array.copy()
        values = (
            (0, -1, 10**6, 3)
            if array.dtype.kind != "f"
            else (np.nan, np.inf, -np.inf, -1.0, 1e308, 0.0, 5e-324, 1e30)
        )
        array.flat[rng.randrange(array.size)] = rng.choice(values) if array.dtype.kind != "u" else 3
        if rng.random() < 0.2:
            array[...] = rng.choice(values)
        arrays[name] = array
    elif how == 8 and array.size and array.dtype.kind == "U":
        array = array.astype("U20")
        array.flat[rng.randrange(array.size)] = rng.choice(
            ("", "chaotic", "ok", "../x", "\ud83d", "touchdown")
        )
        arrays[name] = array
    elif how == 9 and array.ndim:
        arrays[name] = array[: rng.randrange(len(array) + 1)]
    elif how == 10:
        parts[name] = lying_header(rng, array)
    elif how == 11 and rng.random() < 0.02:
        parts[name] = bomb(rng)


def lying_header(rng, array):
    """An array's header with another shape or dtype than the bytes behind it have."""
    shape = rng.choice(
        (
            (10**9,),
            (10**9, 10**9),
            (31623, 31623),
            (-1, 5),
            (0, 10**12),
            (2**63,),
            (array.ndim,) * 30,
            (3,),
        )
    )
    descr = rng.choice(
        (
            "<f8",
            "<f4",
            "<U14",
            "<U0",
            "|V0",
            "|O",
            "<i4",
            "<U100000000",
            "<M8[s]",
            "<c16",
            "|S0",
            "<f2",
            [("a", "<f8")],
        )
    )
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    return buffer.getvalue() + array.tobytes()[: rng.choice((0, 8, 10**6))]


def bomb(rng):
    """Numbers that unpack to much more than they are packed in: 60 MB, or 600 MB."""
    count = rng.choice((7_500_000, 75_000_000))
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": "<f8", "fortran_order": False, "shape": (count,)}
    )
    return buffer.getvalue(), 8 * count


def packed(rng, arrays, parts):
    buffer, how = (
        io.BytesIO(),
        rng.choice(
            (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2)
        ),
    )
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", how) as archive:
        warnings.simplefilter("ignore")  # the same name twice
        for name, array in arrays.items():
            part = parts.get(name)
            if isinstance(part, tuple):
                with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w", force_zip64=True) as file:
                    file._compressor, file._zinfo.compress_type = (
                        zipfile._get_compressor(zipfile.ZIP_DEFLATED, 1),
                        8,
                    )
                    file.write(part[0])
                    for _ in range(part[1] // 1_000_000):
                        file.write(bytes(1_000_000))
                continue
            if part is None:
                piece = io.BytesIO()
                np.lib.format.write_array(piece, array, allow_pickle=True)
                part = piece.getvalue()
            archive.writestr(f"{name}.npy", part)
    return buffer.getvalue()


def damaged_address(rng, data):
    """Pairs of an address with keys and values changed."""
    pairs = json.loads(data)
    for _ in range(rng.choice((1, 2, 4))):
        key = rng.choice((*pairs, *NASTY)) if rng.random() < 0.2 else rng.choice(list(pairs))
        length = rng.randrange(12)
        pairs[key] = rng.choice(
            (
                rng.choice(NASTY),
                "".join(rng.choices(string.printable + "Λ½٣é", k=length)),
                repr(rng.uniform(-10, 10) * 10 ** rng.randrange(-20, 20)),
            )
        )
    return json.dumps(pairs).encode()


# ---- what is read


def read_request(data):
    from spab_core.jobs import store as jobs

    given = json.loads(data)
    if isinstance(given, dict) and isinstance(given.get("parameters"), dict):
        wanted = given.get("kind")
        jobs.job_id(wanted if isinstance(wanted, str) else "point", given["parameters"])
        jobs.find(given.get("id"))


def read_address(data):
    import spab_core.ui.view as view
    from spab_core.common.errors import InputError

    changes = {}
    for key, text in json.loads(data).items():
        text = str(text)[: view._LONGEST]
        with contextlib.suppress(InputError):
            if key in view.VIEW:
                entry = view.VIEW[key]
                entry.read(entry.write(entry.read(text)))
            elif key.replace(".", "__") in view.FIELDS:
                changes[key] = view._design_value(key, text)
    view._changed(changes)


def open_page(data):
    from streamlit.testing.v1 import AppTest

    at = AppTest.from_function(_page, default_timeout=LIMIT)
    for key, text in json.loads(data).items():
        at.query_params[_sendable(key)] = _sendable(str(text))
    at.run()
    assert not at.exception, at.exception[0].value


def targets(folder):
    """By name: how often, the valid bytes to start from, what damages them, what reads them."""
    import spab_core.ui.view as view
    from spab_core.active_learning.quick_map import as_map
    from spab_core.active_learning.refine import load_refinement, save_refinement
    from spab_core.cli import jobs as cli_jobs
    from spab_core.common.errors import InputError
    from spab_core.common.files import csv_bytes
    from spab_core.common.npz import npz_bytes
    from spab_core.design.model import design_toml, read_design_bytes, reference_design
    from spab_core.design.presets import PRESETS
    from spab_core.jobs import kinds as job_kinds
    from spab_core.jobs import store as jobs
    from spab_core.linear_theory import linear_table as features
    from spab_core.maps import bifurcation
    from spab_core.maps.checkpoints import Checkpoint, run_plan
    from spab_core.maps.margin import margin
    from spab_core.maps.sensitivity import MachineMargin, load_sensitivity
    from spab_core.maps.stability_map import FIELDS, StabilityMap, load_map, map_bytes, unsolved
    from spab_core.reporting.export import map_table
    from spab_core.shipped import manifest as artifacts
    from spab_core.shipped import model_cache
    from spab_core.surrogates.uncertainty import load_intervals
    from spab_core.surrogates.user_data import load_samples, read_samples, samples_bytes
    from spab_core.trajectory import point_file
    from spab_core.trajectory.point import solve_point
    from spab_core.trajectory.settings import Settings

    design = reference_design()
    whole = artifacts.load_reference_map()
    small = StabilityMap(
        whole.bearing_number[::24],
        whole.rotor_mass[::30],
        **{name: getattr(whole, name)[::24, ::30] for name in FIELDS},
        metadata=whole.metadata,
    )
    refined = artifacts.load_reference_refinement()
    cut = (slice(0, 6), slice(0, 7))
    refined = dataclasses.replace(
        refined,
        bearing_number=refined.bearing_number[:6],
        rotor_mass=refined.rotor_mass[:7],
        batch=refined.batch[cut],
        values={name: array[cut] for name, array in refined.values.items()},
        suggested=np.array([3, 5]),
        suggested_for_regime=np.array([True, False]),
        **{
            name: getattr(refined, name)[cut] for name in ("mle", "deviation", "regime", "unstable")
        },
    )
    line = bifurcation.load_bifurcation(artifacts.ARTIFACTS / artifacts.BIFURCATIONS[0])
    line = dataclasses.replace(
        line,
        values=line.values[:4],
        branches={
            name: bifurcation.Branch(
                **{f.name: getattr(branch, f.name)[:4] for f in dataclasses.fields(branch)}
            )
            for name, branch in line.branches.items()
        },
    )
    point = solve_point(
        design, 4.52, 3.45, Settings("2x16", transient=30, revolutions=20), path_revolutions=1
    )
    file, home = folder / "case", folder / "jobs"

    def saved(save, result):
        save(result, file)
        return file.read_bytes()

    def from_file(load, use=lambda found: None):
        def read(data):
            file.write_bytes(data)
            use(load(file))

        return read

    def look_at_map(m):
        csv_bytes(map_table(m))
        margin(m, 5.0, 3.0)
        m.cell_text(0, 0)

    def read_csv(data):
        load_samples_file = folder / "samples"
        load_samples_file.write_bytes(samples_bytes(read_samples(data)))
        load_samples(load_samples_file)

    grid = map_table(small)
    short = grid[["rotor_mass_kg", "bearing_number", "mle"]]
    samples = samples_bytes(read_samples(csv_bytes(map_table(whole).iloc[::501])))
    chunk = {name: getattr(small, name)[0, :4] for name in FIELDS}
    kind = "point"
    request = {
        "design": {"rotor": {"shaft_stiffness": float("inf")}},
        "rotor_mass": 5.0,
        "bearing_number": 3.0,
    }
    name, parameters = jobs._request(kind, request)
    state = {
        "kind": kind,
        "parameters": parameters,
        "state": "running",
        "done": 3,
        "total": 9,
        "kept": 0,
        "created": 1.7e9,
        "queued": 1.7e9,
        "started": 1.7e9,
        "finished": None,
        "message": "",
        "pid": 7,
    }

    def read_job(data):
        place = home / name
        place.mkdir(parents=True, exist_ok=True)
        (place / "job.json").write_bytes(data)
        for job in jobs.list_jobs():
            json.dumps(cli_jobs._record(job), allow_nan=False)
            print(
                cli_jobs._line(job),
                file=io.TextIOWrapper(io.BytesIO(), "utf-8", errors="backslashreplace"),
            )
        found = jobs.find(name)
        if found:
            assert found.state in jobs.STATES and found.result.parent == place
        assert {path.name for path in home.iterdir()} <= {name, ".running.lock"}

    requests = [
        (kind, job_kinds.KINDS[kind].check(given))
        for kind, given in (
            ("point", request),
            ("bifurcation", {"vary": "rotor-mass", "at": 3.0, "range": "1:9:9"}),
            ("map", {"bearing_number": "1:8:20", "rotor_mass": "1:20:20"}),
            ("sensitivity", {"rotor_mass": 4.0, "speed_rpm": 9e3}),
        )
    ]
    requests += [
        ("ranking", {"samples": "0" * 64, "models": ["tree"]}),
        ("intervals", {"model": "tree", "divisor": 4}),
    ]

    shipped = folder / "artifacts"
    shipped.mkdir()
    (shipped / "scores.csv").write_bytes(b"model,divisor\n")
    artifacts.write_manifest(shipped)

    def read_shipped(data):
        (shipped / artifacts.MANIFEST).write_bytes(data)
        for entry in artifacts.read_manifest(shipped):
            assert (shipped / entry).parent == shipped
            with contextlib.suppress(InputError):
                artifacts.checked_bytes(entry, shipped)

    cache = Path(os.environ["SPAB_CACHE"])
    model_cache.keep("model.joblib", b"some bytes", {"versions": {}, "map": "0"})
    side = (cache / "model.joblib.json").read_bytes()

    def read_kept(data):
        (cache / "model.joblib.json").write_bytes(data)
        model_cache.read("model.joblib")

    plan = run_plan(design, small.bearing_number, small.rotor_mass, Settings())

    def read_plan(data):
        parts = folder / "parts"
        parts.mkdir(exist_ok=True)
        (parts / "plan.json").write_bytes(data)
        Checkpoint(parts, plan, {}).open()

    for left in ("plan", "chunks"):
        shutil.rmtree(folder / left, ignore_errors=True)
    Checkpoint(folder / "plan", plan, {}).open()
    checkpoint = Checkpoint(
        folder / "chunks", plan, {n: unsolved(d, 99) for n, d in FIELDS.items()}
    )
    with checkpoint.resume():
        checkpoint.save("0", np.arange(4), chunk)
    nan = float("nan")
    base = MachineMargin("speed", "good", "", 9e3, 8e3, nan, "contact", "", 4500.0, 18000.0)
    rows = {
        "value": ["clearance"],
        "factor": [0.9],
        "assessment": ["good"],
        "why": [""],
        "below": [8e3],
        "below_what": ["contact"],
        "above": [None],
        "above_what": [""],
        "distance": [0.1],
        "change": [0.0],
    }
    numbers = {
        key: None if value != value else value for key, value in dataclasses.asdict(base).items()
    }
    address = {key: entry.write(entry.default) for key, entry in view.VIEW.items()} | {
        "bearing.clearance": "3e-05",
        "rotor.shaft_stiffness": "inf",
    }
    pairs = json.dumps(address).encode()
    intervals = {
        "low": small.mle,
        "high": small.mle,
        "unstable": small.contact_share,
        "regime": small.regime,
        "held_out": small.mle > 0,
        "seconds": np.array(1.0),
    }
    return {
        "design file": (
            14,
            [design_toml(p.design).encode() for p in PRESETS.values()],
            damaged_text,
            read_design_bytes,
        ),
        "CSV upload": (14, [csv_bytes(grid), csv_bytes(short)], damaged_text, read_csv),
        "map": (10, [map_bytes(small)], damaged_npz, from_file(load_map, look_at_map)),
        "refinement": (
            8,
            [saved(save_refinement, refined)],
            damaged_npz,
            from_file(load_refinement, lambda r: (r.suggestions(), as_map(r))),
        ),
        "bifurcation": (
            8,
            [saved(bifurcation.save_bifurcation, line)],
            damaged_npz,
            from_file(
                bifurcation.load_bifurcation,
                lambda b: [
                    (bifurcation.chaotic_intervals(b.values, branch.regime), b.judged(name))
                    for name, branch in b.branches.items()
                ],
            ),
        ),
        "point": (
            8,
            [saved(point_file.save_point, point)],
            damaged_npz,
            from_file(
                point_file.load_point, lambda p: (p.verdict(), p.record(), p.max_eccentricity)
            ),
        ),
        "samples": (6, [samples], damaged_npz, from_file(load_samples)),
        "intervals": (
            4,
            [npz_bytes(intervals)],
            damaged_npz,
            from_file(lambda path: load_intervals(path, small)),
        ),
        "chunk of a run": (
            8,
            [(folder / "chunks" / "chunk-0.npz").read_bytes()],
            damaged_npz,
            from_file(checkpoint.load),
        ),
        "linear table": (
            2,
            [(resources.files("spab_core.design") / "data" / features.SHIPPED).read_bytes()],
            damaged_npz,
            features.load_table,
        ),
        "plan of a run": (
            3,
            [(folder / "plan" / "plan.json").read_bytes()],
            damaged_json,
            read_plan,
        ),
        "job state": (12, [json.dumps(state).encode()], damaged_json, read_job),
        "job request": (
            8,
            [json.dumps({"kind": k, "parameters": p, "id": name}).encode() for k, p in requests],
            damaged_json,
            read_request,
        ),
        "manifest": (8, [(shipped / artifacts.MANIFEST).read_bytes()], damaged_json, read_shipped),
        "model cache": (4, [side], damaged_json, read_kept),
        "sensitivity": (
            8,
            [json.dumps({"base": numbers, "rows": rows}).encode()],
            damaged_json,
            from_file(load_sensitivity),
        ),
        "address": (14, [pairs], damaged_address, read_address),
        "page by address": (0.3, [pairs], damaged_address, open_page),
    }


def _sendable(text):
    """As a browser's address has it: no halves of characters."""
    return text.encode("utf-8", "replace").decode()


def _page():
    import streamlit as st

    from spab_core.ui.shared import page_head
    from spab_core.ui.view import design_words

    page_head("test")
    st.text(design_words())


def run(cases, seed, only=()):
    """Number of cases, refused ones and the slowest by target; failures."""
    folder = Path(tempfile.mkdtemp(prefix="spab-fuzz-"))
    os.chdir(folder)
    tempfile.tempdir = str(folder)  # Streamlit's page tests write there
    for variable, place in (("SPAB_JOBS", "jobs"), ("SPAB_CACHE", "cache")):
        (folder / place).mkdir(mode=0o700)
        os.environ[variable] = str(folder / place)
    from spab_core.common.errors import InputError  # numba's folder is chosen by now

    found = {name: entry for name, entry in targets(folder).items() if not only or name in only}
    rng = random.Random(seed)
    names = rng.choices(list(found), [entry[0] for entry in found.values()], k=cases)
    for name, (_, valid, _, read) in found.items():  # they are valid, and everything is imported
        for data in valid:
            with (
                contextlib.suppress(InputError)
                if name in ("job request", "plan of a run")
                else contextlib.nullcontext()
            ):
                read(data)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    counts, refused, slowest = (
        collections.Counter(),
        collections.Counter(),
        collections.defaultdict(float),
    )
    failures, watch, seen = [], Watch(), collections.Counter()

    def too_slow(*_):
        raise TooSlow

    signal.signal(signal.SIGALRM, too_slow)
    for k, name in enumerate(names):
        _, valid, damage, read = found[name]
        case = random.Random(f"{seed} {k}")
        data = damage(case, case.choice(valid))
        problem, watch.folder, watch.found = None, str(folder), None
        began = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, LIMIT)
        try:
            read(data)
        except InputError as error:
            refused[name] += 1
            if not str(error).strip():
                problem = "refused without a word"
        except TooSlow:
            problem = f"more than {LIMIT:g} s"
        except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
            if name not in (
                "job request",
                "address",
                "page by address",
            ):  # of this script's own packing
                problem = f"{type(error).__name__}: {error}"
        except Exception as error:
            problem = f"{type(error).__name__}: {str(error)[:150]}"
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            watch.folder = None
        slowest[name] = max(slowest[name], time.perf_counter() - began)
        counts[name] += 1
        problem = watch.found or problem
        if problem:
            failures.append((name, k, problem))
            seen[name, problem[:40]] += 1
            if seen[name, problem[:40]] <= 3:
                print(f"FAILED {name}, case {k}: {problem}", flush=True)
                (folder / f"failed-{k}").write_bytes(data)
    if not failures:
        shutil.rmtree(folder)
    else:
        print(f"failed cases are kept in {folder}")
    return counts, refused, slowest, failures


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=())
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    began = time.perf_counter()
    counts, refused, slowest, failures = run(options.cases, options.seed, options.only)
    for name in counts:
        print(
            f"{name:22s} {counts[name]:7,} cases, {refused[name]:7,} refused in words, slowest "
            f"{slowest[name]:.2f} s"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(
        f"{sum(counts.values()):,} cases with seed {options.seed} in "
        f"{time.perf_counter() - began:.0f} s, peak {peak:.2f} GB "
        f"with all imports; {len(failures)} failed"
    )
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
