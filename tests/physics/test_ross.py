"""The tables in ROSS (github.com/petrobras/ross) itself: they load, a rotor on them is built, its
modes and its limit of stability are ours.

ROSS 3 needs Python 3.13 and has pins of its own: it is looked for in this Python, or in the one
named by SPAB_ROSS_PYTHON; with SPAB_REQUIRE_ROSS, as in CI, its absence is a failure."""

import importlib.util
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from spab_core.design.presets import preset
from spab_core.linear_theory.coefficients import (
    FILM_WHIRL,
    coefficients_over_speed,
    coefficients_over_speed_and_frequency,
    coefficients_over_whirl,
)
from spab_core.linear_theory.film_whirl import follow_film_whirl
from spab_core.linear_theory.ross_table import save_table
from spab_core.linear_theory.whirl import whirl_thresholds
from spab_core.solver.film import Mesh
from tests.conftest import quiet

MESH = Mesh(3, 16)
RIGID = 1e12  # N/m, a shaft that does not bend

# A symmetric rotor on two bearings: a massless beam with the stiffness 2 K_s = 48 EI/L³ at midspan,
# the disc there, a journal at each end, with little inertia of rotation. Printed: damped natural
# frequencies and logarithmic decrements of run_modal at each speed; and, for the roots given there,
# the eigenvalue nearest to each with the coefficients at its own frequency.
IN_ROSS = """
import json, sys
import numpy as np
import ross as rs
length, young = 0.5, 2.1e11

def answer(j):
    diameter = (64.0 * (2.0 * j["shaft"] * length**3 / 48.0 / young) / np.pi) ** 0.25
    steel = rs.Material(name="massless", rho=1e-3, E=young, G_s=8e10)
    simple = dict.fromkeys(("shear_effects", "rotary_inertia", "gyroscopic"), False)
    beam = [rs.ShaftElement(length / 2, 0.0, diameter, material=steel, **simple)
            for _ in range(2)]
    disc, journal = (1.0 - j["share"]) * j["mass"], j["share"] * j["mass"]
    inertia = 2.5e-6 * j["mass"]
    discs = [rs.DiskElement(n, m, inertia, 2.0 * inertia)
             for n, m in ((0, journal), (1, 2.0 * disc), (2, journal))]
    if j["file"].endswith(".xlsx"):
        bearings = [rs.BearingElement.from_table(n=n, file=j["file"]) for n in (0, 2)]
    else:
        with open(j["file"]) as file:
            table = json.load(file)["BearingElement_spab"]
        bearings = [rs.BearingElement(**{**table, "n": n}) for n in (0, 2)]
        loaded = rs.BearingElement.load(j["file"])
        assert loaded.kxx == bearings[0].kxx and loaded.n == 0
    rotor = rs.Rotor(beam, discs, bearings)
    modal = [rotor.run_modal(v, num_modes=j["modes"], sparse=False, matched_whirl=j["matched"])
             for v in j["speeds"]]
    nearest = []
    for speed, roots in zip(j["speeds"], j["roots"]):
        for root in roots:
            wanted = found = complex(*root)
            for _ in range(40):
                values = np.linalg.eigvals(rotor.A(speed, frequency=found.imag))
                before, found = found, values[np.argmin(abs(values - wanted))]
                if abs(found - before) < 1e-9 * abs(found):
                    break
            nearest.append([found.real, found.imag])
    return {
        "nearest": nearest,
        "version": rs.__version__, "kind": bearings[0].kxx_interpolated.kind,
        "kxx": np.asarray(bearings[0].kxx).tolist(),
        "wd": [m.wd.tolist() for m in modal], "decrement": [m.log_dec.tolist() for m in modal]}

for line in sys.stdin:
    print("RESULT", json.dumps(answer(json.loads(line))), flush=True)
"""


@pytest.fixture(scope="module")
def ross(tmp_path_factory):
    """A process that has imported ROSS (some eight seconds): a job a line in, an answer a line
    out.
    """
    named = os.environ.get("SPAB_ROSS_PYTHON")
    if named is None and importlib.util.find_spec("ross") is None:
        missing = (
            "no ross-rotordynamics 3 here (it needs Python 3.13), and SPAB_ROSS_PYTHON names no "
            "other Python"
        )
        (pytest.fail if os.environ.get("SPAB_REQUIRE_ROSS") else pytest.skip)(missing)
    folder = tmp_path_factory.mktemp("ross")
    with (
        (folder / "errors.txt").open("w+") as errors,
        subprocess.Popen(
            [named or sys.executable, "-c", IN_ROSS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            cwd=folder,
        ) as process,
    ):
        yield SimpleNamespace(process=process, errors=Path(errors.name))
        process.stdin.close()


def in_ross(ross, path, design, mass, speeds, matched, roots=()):
    """Modes in ROSS of the rotor on the table in a file: its answer, and an array of rad/s and
    logarithmic decrement a speed; ``roots``: a list of complex a speed, in 1/s.
    """
    job = {
        "file": str(path),
        "mass": mass,
        "share": design.rotor.journal_mass_fraction,
        "shaft": min(design.rotor.shaft_stiffness, RIGID),
        "speeds": list(speeds),
        "matched": matched,
        "modes": 12,
        "roots": [[[v.real, v.imag] for v in row] for row in roots],
    }
    ended = threading.Timer(900.0, ross.process.kill)
    ended.start()
    ross.process.stdin.write(json.dumps(job) + "\n")
    ross.process.stdin.flush()
    # ROSS prints words of its own too
    line = next((text for text in ross.process.stdout if text.startswith("RESULT")), None)
    ended.cancel()
    assert line is not None, ross.errors.read_text()[-2000:]
    answer = json.loads(line.removeprefix("RESULT"))
    assert int(answer["version"].split(".")[0]) >= 3
    return answer, [np.array(v) for v in zip(answer["wd"], answer["decrement"], strict=True)]


def limit_of(speeds, decrements):
    """The one speed at which the logarithmic decrement falls through zero, linear in between."""
    (k,) = np.flatnonzero(np.diff(np.sign(decrements)))
    a, b = decrements[k : k + 2]
    assert a > 0.0 > b
    return speeds[k] + a / (a - b) * (speeds[k + 1] - speeds[k])


def over(design, low, high, count):
    return [design.bearing_number(v) for v in np.linspace(low, high, count) * np.pi / 30.0]


# design; kg on a bearing; rpm from a fraction of the limit of stability to past it, how many; how
# far the limit may be off. On the wall that stores gas, where pneumatic hammer begins slowly, it is
# 0.25 %: 0.001 of the decrement
CASES = {
    "fed_spindle": (quiet("fed_spindle"), 4.0, 5_000.0, 60_000.0, 23, 2e-3),
    "rigid_balanced": (quiet("rigid_balanced"), 5.0, 5_000.0, 45_000.0, 17, 2e-3),
    "small_high_speed": (quiet("small_high_speed"), 0.05, 20_000.0, 150_000.0, 17, 2e-3),
    "storing": (preset("fed_spindle").design, 2.0, 5_000.0, 60_000.0, 23, 5e-3),
}
OTHERS = 0.05  # how far the other modes may be off


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "form"), [*((name, ".json") for name in CASES), ("fed_spindle", ".xlsx")]
)
def test_the_whirl_of_the_film_in_ross_is_ours(name, form, ross, tmp_path):
    """From a third of the limit of stability or less to past it, at the ends of the table and
    between its speeds, on quasi-steady walls and on one that stores gas: frequency and logarithmic
    decrement of the film's whirl to 2 % (5 % were asked for), its limit of stability to 0.2 %
    (0.5 % where pores store gas). In the table over speed and frequency the other modes of the
    rotor too: those that bend the shaft, and the backward whirl.
    """
    design, mass, low, high, count, off_limit = CASES[name]
    grid, path = form == ".json", tmp_path / f"bearing{form}"
    numbers = over(design, low, high, count)
    if grid:
        found = coefficients_over_speed_and_frequency(design, mass, numbers, mesh=MESH)
    else:
        found = coefficients_over_speed(design, mass, numbers, FILM_WHIRL, MESH)
    save_table(found, str(path))
    ours = follow_film_whirl(design, mass, over(design, low, high, 14), MESH)
    speeds = [design.speed(z.bearing_number) for z, _, _ in ours]
    # the other modes, below the limit and above
    roots = [
        [
            speed * mode.root
            for mode in every
            if mode is not followed and abs(mode.root.real) < 0.3 * mode.root.imag
        ]
        if grid
        else []
        for speed, (_, every, followed) in zip(speeds, ours, strict=True)
    ]
    answer, modes = in_ross(ross, path, design, mass, speeds, grid, roots)
    assert answer["kind"] == ("grid" if grid else "speed")
    np.testing.assert_allclose(np.ravel(answer["kxx"]), found.column("kxx"), rtol=1e-12)
    decrements = []
    for speed, (wd, decrement), (_, _, followed) in zip(speeds, modes, ours, strict=True):
        k = np.argmin(abs(wd / speed - followed.ratio) + abs(decrement - followed.log_decrement))
        decrements.append(decrement[k])
        assert wd[k] / speed == pytest.approx(followed.ratio, rel=2e-2)
        assert decrement[k] == pytest.approx(followed.log_decrement, rel=2e-2, abs=2e-3)
    wanted = np.array([root for row in roots for root in row])
    found_there = np.array([complex(*v) for v in answer["nearest"]])
    off = [abs(found_there.imag / wanted.imag - 1.0).max(initial=0.0)]
    ratio = found_there.real / found_there.imag / (wanted.real / wanted.imag)
    off.append(abs(ratio - 1.0).max(initial=0.0))
    assert len(wanted) >= 10 * grid and max(off) < OTHERS
    exact = limit_of(speeds, [mode.log_decrement for _, _, mode in ours])
    limit = limit_of(speeds, decrements)
    print(
        f"ROSS {answer['version']}, {form}: limit {limit:.1f} rad/s, ours {exact:.1f}, ratio "
        f"{limit / exact:.6f}; other modes off by {off}"
    )
    assert limit == pytest.approx(exact, rel=off_limit)


@pytest.mark.slow
def test_a_table_over_frequency_is_one_in_ross(ross, tmp_path):
    """At the threshold of whirl, at one speed: ROSS takes it for a table over frequency, and finds
    the whirl there, neither growing nor decaying.
    """
    design, number = quiet("fed_spindle"), 8.5
    threshold = whirl_thresholds(design, number, MESH, masses=(4.0, 20.0), scan=3)[0]
    mass, speed = threshold.critical_mass, design.speed(number)
    found = coefficients_over_whirl(design, mass, number, np.linspace(0.0, 4.0, 81), MESH)
    path = tmp_path / "frequency.json"
    save_table(found, str(path))
    answer, ((wd, decrement),) = in_ross(ross, path, design, mass, [speed], True)
    assert answer["kind"] == "frequency"
    k = np.argmin(abs(wd / speed - threshold.whirl_ratio) + abs(decrement))
    assert wd[k] / speed == pytest.approx(threshold.whirl_ratio, rel=1e-3)
    assert decrement[k] == pytest.approx(0.0, abs=2e-3)
