"""Tolerances: how they are written, what is drawn, shares against exact ones, what drives them."""

import dataclasses
import json
import sys
import types

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import truncnorm

from spab_core.cli.main import main
from spab_core.common.errors import InputError
from spab_core.design.form import FIELDS, eccentricity_of_grade
from spab_core.design.model import design_toml, parse_design, reference_design
from spab_core.design.presets import preset
from spab_core.design.tolerances import (
    VALUES,
    Machine,
    check_tolerances,
    parse_range,
    parse_tolerance,
    parse_tolerances,
    read_tolerances,
    tolerances_toml,
)
from spab_core.drawings import tolerance as within
from spab_core.drawings.drivers import drivers, narrowings, wilson
from spab_core.drawings.look import Look, empty_rows, look_at, read_row, read_rows
from spab_core.drawings.tolerance import (
    draw,
    load_study,
    machines_at,
    save_study,
    tolerance_study,
)
from spab_core.trajectory.assessment import Limits
from spab_core.trajectory.point import solve_point
from tests.conftest import quiet

SPINDLE = Machine(quiet("fed_spindle"), 4.0, 20000.0)
# a layer on the wall: what it stores is in the model, and nothing of it is outside the theory
BUILT = Machine(preset("fed_spindle_layered").design, 4.0, 20000.0)
UNBALANCE = "rotor.unbalance_eccentricity"
# grade by the calm eccentricity alone: nothing else of this machine is near a limit
CALM = Look("", limits=Limits(calm_eccentricity=0.4, separation=0.0, least_film=1e-6))


@pytest.mark.parametrize(
    ("key", "text", "bounds"),
    [
        ("bearing.clearance", "± 2 µm", (23.0, 27.0)),
        ("bearing.clearance", "+-2um", (23.0, 27.0)),
        ("bearing.clearance", "+/- 2e-6 m", (23.0, 27.0)),
        ("bearing.clearance", "±8% normal", (23.0, 27.0)),
        ("bearing.permeability", "± 50 %", (0.72, 2.16)),
        ("bearing.permeability", "± 0.72 10^-15 m2", (0.72, 2.16)),
        ("bearing.supply_pressure_ratio", "± 0.5 bar", (5.5795, 6.5795)),
        (UNBALANCE, "up to 1.5 µm", (0.0, 1.5)),
        ("rotor_mass", "± 0.5 kg", (3.5, 4.5)),
        ("speed", "± 2 %", (19600.0, 20400.0)),
    ],
)
def test_one_way_to_write_a_tolerance(key, text, bounds):
    tolerance = parse_tolerance(key, text)
    assert tolerance.bounds(SPINDLE) == pytest.approx(bounds)
    assert parse_tolerance(key, tolerance.text) == tolerance


def test_up_to_a_balance_grade():
    found = parse_tolerance(UNBALANCE, "up to G 2.5").bounds(SPINDLE)
    assert found == (0.0, pytest.approx(1e6 * eccentricity_of_grade(2.5, 20000.0, 0.3)))


def test_every_number_of_a_design_may_have_one():
    numbers = {name for name, f in FIELDS.items() if not getattr(f, "choices", ())}
    assert VALUES.keys() == numbers | {"rotor_mass", "speed"}


@pytest.mark.parametrize(
    ("key", "text", "word"),
    [
        ("bearing.clearence", "± 2 µm", "there is no value"),
        ("bearing.clearance", "2 µm", "not understood"),
        ("bearing.clearance", "± 2", "unit"),
        ("bearing.clearance", "± 2 mm2", "unit"),
        ("bearing.clearance", "± 1.2.3 µm", "not a number"),
        ("bearing.clearance", "± 0 µm", "out of range"),
        ("bearing.clearance", "± 150 %", "out of range"),
        ("bearing.clearance", "up to 2 µm", "may not be 0"),
        ("bearing.clearance", "up to G 2.5", "balance grade"),
        (UNBALANCE, "up to 20 %", "give the bound in µm"),
        (UNBALANCE, "up to 2 µm normal", "uniform"),
        ("bearing.clearance", 2.0, "not understood"),
    ],
)
def test_a_wrong_tolerance_is_told(key, text, word):
    with pytest.raises(InputError, match=word):
        parse_tolerance(key, text)


def test_bounds_that_are_no_machine_are_told():
    for texts, word in (
        ({"bearing.clearance": "± 24.9 µm"}, "reaches 0.1 µm"),
        ({"gas.viscosity": "± 99 %", "rotor_mass": "± 1 kg"}, "Viscosity"),
        ({}, "at least one"),
    ):
        with pytest.raises(InputError, match=word):
            check_tolerances(SPINDLE, parse_tolerances(texts))
    rigid = SPINDLE._replace(design=quiet("rigid_balanced"))
    for texts, word in (
        ({"rotor.shaft_stiffness": "± 5 %"}, "infinite"),
        ({UNBALANCE: "± 5 %"}, "is 0"),
    ):
        with pytest.raises(InputError, match=word):
            check_tolerances(rigid, parse_tolerances(texts))


def test_a_design_file_keeps_them():
    given = parse_tolerances({"bearing.clearance": "± 2 µm", "speed": "± 2 % normal"})
    text = design_toml(SPINDLE.design) + tolerances_toml(given)
    assert parse_design(text) == SPINDLE.design
    assert read_tolerances(text) == given
    assert read_tolerances(design_toml(SPINDLE.design)) == ()
    for wrong in ("tolerances = 3", '[tolerances]\n"bearing.clearance" = 2'):
        with pytest.raises(InputError, match=r"design file .x\.toml."):
            read_tolerances(wrong, "x.toml")


def test_a_range_is_read_in_the_same_units():
    assert parse_range("bearing.clearance", "15:40 µm", SPINDLE)[1] == (15.0, 40.0)
    low, high = parse_range(UNBALANCE, "1:2.5 G", SPINDLE)[1]
    assert high == pytest.approx(2.5 * low)
    for text in ("15:40", "40:15 µm", "1:2 G", "a:b µm"):
        with pytest.raises(InputError, match="range of"):
            parse_range("bearing.clearance", text, SPINDLE)


def test_drawn_values_have_their_distributions():
    given = parse_tolerances(
        {"bearing.clearance": "± 2 µm", "rotor_mass": "± 1 kg normal", UNBALANCE: "up to 2 µm"}
    )
    machines, values = machines_at(SPINDLE, given, draw(given, 512, 3))
    for column, (low, high) in zip(values.T, ((23, 27), (3, 5), (0, 2)), strict=True):
        assert low <= column.min() < column.max() <= high
        assert column.mean() == pytest.approx(0.5 * (low + high), rel=0.01)
    # of a normal distribution cut at two standard deviations, in its unit
    assert np.std(values[:, 1]) == pytest.approx(0.5 * truncnorm.std(-2, 2), rel=0.02)
    assert np.std(values[:, 2]) == pytest.approx(2.0 / np.sqrt(12.0), rel=0.02)
    assert machines[7].rotor_mass == values[7, 1]
    assert machines[7].design.bearing.clearance == pytest.approx(1e-6 * values[7, 0])


def test_wilson_against_its_formula():
    z = 1.959963984540054
    n, k = 80, 60
    ends = np.roots([n + z * z, -(2 * k + z * z), k * k / n])  # (k/n - p)² = z² p (1-p)/n
    assert wilson(k, n) == pytest.approx(sorted(ends))
    assert wilson(60.0 + 1e-9, 80.0) == pytest.approx(sorted(ends), abs=1e-6)
    assert wilson(0, 0) == (0.0, 1.0)


def test_sobol_indices_of_two_thresholds():
    # y = [u < a][v < b]: first order b (1 - a)/(1 - a b), total (1 - a)/(1 - a b)
    a, b = 0.5, 0.7
    u = draw(
        parse_tolerances(dict.fromkeys(["speed", "rotor_mass", "gas.viscosity"], "± 1 %")), 512, 0
    )
    y = (u[:, 0] < a) & (u[:, 1] < b)
    table = drivers(u, y, ["u", "v", "w"], 0).set_index("value")
    for name, own, other in (("u", a, b), ("v", b, a)):
        assert table["first"][name] == pytest.approx(other * (1 - own) / (1 - a * b), abs=0.06)
        assert table["total"][name] == pytest.approx((1 - own) / (1 - a * b), abs=0.06)
    assert table["total"]["w"] < 0.03
    assert table["total_spread"].max() < 0.1
    assert list(table.index) == ["u", "v", "w"]
    assert drivers(u, np.ones(512), ["u", "v", "w"], 0).empty


def test_how_far_to_narrow():
    given = parse_tolerances(
        {"speed": "± 1 %", "rotor_mass": "± 1 % normal", UNBALANCE: "up to 2 µm"}
    )
    u = draw(given, 2048, 1)
    # bad in the upper quarter: narrowed to the factor k the share is (1/2 + k)/(2 k)
    table = narrowings(u, u[:, 0] < 0.75, given, 0.9).set_index("value")
    assert table["factor"]["speed"] == pytest.approx(0.5 / 0.8, abs=0.02)
    assert table["narrowed"]["speed"] == "± 0.62 %"
    assert table["low"]["speed"] < 0.9 <= table["share"]["speed"] < table["high"]["speed"]
    assert np.isnan(table["factor"]["rotor_mass"]) and table.index[0] == "speed"
    # a normal one that is bad beyond half a standard deviation above
    z = truncnorm.ppf(u[:, 1], -2, 2)
    factor = narrowings(u, z < 0.5, given, 0.9).set_index("value")["factor"]["rotor_mass"]
    assert truncnorm.cdf(0.5 / factor, -2, 2) == pytest.approx(0.9, abs=0.02)
    # up to a bound: bad above 60 % of it
    factor = narrowings(u, u[:, 2] < 0.6, given, 0.9).set_index("value")["factor"][UNBALANCE]
    assert factor == pytest.approx(0.6 / 0.9, abs=0.02)


@pytest.fixture(scope="module")
def known():
    """A study whose share of good machines is exact: the unbalance at which the eccentricity
    passes its limit, found on its own, over the bound.
    """

    def over(unbalance):
        design = BUILT.design.replace(rotor__unbalance_eccentricity=1e-6 * unbalance)
        return solve_point(design, 4.0, BUILT.bearing_number).max_eccentricity - 0.4

    threshold = brentq(over, 0.5, 6.0, xtol=1e-3)
    bound = threshold / 0.7
    given = parse_tolerances({UNBALANCE: f"up to {bound:.9g} µm", "rotor_mass": "± 0.01 %"})
    return tolerance_study(BUILT, given, CALM, most=64, half_width=0.0, seed=5)


@pytest.mark.slow
def test_the_share_of_a_threshold_is_exact(known):
    share, low, high = known.shares()["good"]
    assert share == pytest.approx(0.7, abs=1.5 / 64)  # a Sobol' sequence has each cell once
    assert low < 0.7 < high
    assert sum(known.shares()[grade][0] for grade in ("good", "watch", "avoid")) == 1.0
    what, table = known.drivers
    assert what == "not good"
    assert table["value"][0] == UNBALANCE and table["first"][0] > 0.95 and table["total"][1] < 0.05
    best = known.narrowings.iloc[0]
    assert best["value"] == UNBALANCE and best["factor"] == pytest.approx(0.7 / 0.95, abs=0.02)
    assert known.troubles() == {"raised eccentricity": pytest.approx(1 - share)}


@pytest.fixture
def few(monkeypatch):
    """Batches from 32 machines on."""
    monkeypatch.setattr(within, "FIRST", 32)


@pytest.mark.slow
def test_half_the_sample_says_the_same(known, few):
    given = known.tolerances
    assert draw(given, 32, 5).tolist() == known.quantiles[:32].tolist()
    other = tolerance_study(BUILT, given, CALM, most=32, half_width=0.0, seed=6)
    low, high = known.shares()["good"][1:]
    for good in (known.good[:32], other.good):
        assert low < good.mean() < high


@pytest.mark.slow
def test_narrowed_as_it_says_the_share_is_reached(known, few):
    """The estimate of the narrower tolerance, against machines solved within it."""
    best = known.narrowings.iloc[0]
    texts = {VALUES[t.name].key: t.text for t in known.tolerances}
    given = parse_tolerances(texts | {best["value"]: best["narrowed"]})
    solved = tolerance_study(BUILT, given, CALM, most=32, half_width=0.0, seed=7)
    share, low, high = solved.shares()["good"]
    assert known.shares()["good"][0] < known.wanted - 0.1
    assert share == pytest.approx(known.wanted, abs=0.05) and low < best["share"] < high


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_it_stops_by_itself_and_goes_on_on_a_cluster(known, few, tmp_path, monkeypatch):
    """Chunks that are lost are solved by two processes of a real Dask cluster, to the bit."""
    # new processes would run this process's main module again
    monkeypatch.setitem(sys.modules, "__main__", types.ModuleType("__main__"))
    distributed = pytest.importorskip("distributed")
    ran = []
    given = parse_tolerances({"rotor_mass": "± 1 %"})
    kept = {"checkpoint": tmp_path / "parts", "progress": ran.append}
    first = tolerance_study(BUILT, given, CALM, most=128, half_width=0.06, **kept)
    assert (first.stopped, first.count, first.shares()["good"][0]) == ("narrow", 32, 1.0)
    assert first.drivers[0] == "least film"
    assert "reached as it is" in first.sentences()[-1]
    for chunk in ("000001", "000003"):
        (tmp_path / "parts" / f"chunk-{chunk}.npz").unlink()
    ran.clear()
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        address = cluster.scheduler_address
        again = tolerance_study(
            BUILT, given, CALM, most=128, half_width=0.06, cluster=address, **kept
        )
    assert ran[0] == 16 and sum(ran) == 32  # the lost chunks alone are solved again
    for name in ("grade", "least_film", "eccentricity"):
        assert again.rows[name].tolist() == first.rows[name].tolist()
    with pytest.raises(InputError, match="another run"):
        tolerance_study(BUILT, given, CALM, most=128, half_width=0.06, seed=1, **kept)
    save_study(known, tmp_path / "study.json")
    back = load_study(tmp_path / "study.json")
    assert json.dumps(back.record(), allow_nan=False) == json.dumps(known.record())
    (tmp_path / "study.json").write_text('{"rows": 3}')
    with pytest.raises(InputError, match="cannot read"):
        load_study(tmp_path / "study.json")


def test_rows_of_an_earlier_version_are_read_without_what_they_lack():
    told = {name: values.tolist() for name, values in empty_rows(2).items()}
    force = told.pop("peak_contact_force")
    old = read_rows(told)["peak_contact_force"]
    assert np.isnan(old).all() and len(old) == 2
    assert read_rows(told | {"peak_contact_force": force})["peak_contact_force"].tolist() == force
    assert np.isnan(read_row({k: v[0] for k, v in told.items()})["peak_contact_force"])
    del told["orbit"]
    with pytest.raises(KeyError):
        read_rows(told)


@pytest.mark.slow
def test_the_short_line_ends_where_the_margin_does():
    """At its end the eccentricity is the limit, between the two solved ends."""
    look = Look("speed", reach=1.6, limits=Limits(eccentricity=0.45, calm_eccentricity=0.45))
    look = dataclasses.replace(look, limits=dataclasses.replace(look.limits, separation=0.0))
    row = look_at(BUILT, look)
    assert row["meets"] == "large eccentricity" and 0.0 < row["ends"] - row["margin"] <= 0.01 * (
        1 + row["margin"]
    )
    below, above = (
        solve_point(BUILT.design, 4.0, BUILT.bearing_number * (1 + row[name]))
        for name in ("margin", "ends")
    )
    assert below.max_eccentricity <= 0.45 < above.max_eccentricity
    heavy = look_at(
        BUILT, dataclasses.replace(look, limits=Limits(eccentricity=0.05, calm_eccentricity=0.0))
    )
    assert (heavy["grade"], heavy["margin"], heavy["ends"], heavy["points"]) == (2, 0.0, 0.0, 1)


def test_the_command_refuses_in_a_sentence(capsys, tmp_path):
    machine = ["design", "tolerance", "--rotor-mass", "4", "--rpm", "20000"]
    for more, word in (
        ([], "no value has a tolerance"),
        (["--within", "bearing.clearance", "2"], "not understood"),
        (["--within", "rotor_mass", "± 1 %", "--machines", "100"], "power of two"),
        (["--within", "rotor_mass", "± 1 %", "--axis", "radius"], "--axis"),
        (["--within", "rotor_mass", "± 1 %", "--wanted", "2"], "wanted share"),
        (["--within", "rotor_mass", "± 1 %"] * 2, "given twice"),
    ):
        assert main(machine + more) == 2
        err = capsys.readouterr().err
        assert word in err and "Traceback" not in err


@pytest.mark.slow
def test_the_command_reads_the_file(capsys, tmp_path):
    file, out = tmp_path / "my.toml", tmp_path / "out.json"
    file.write_text(design_toml(reference_design()) + '[tolerances]\nrotor_mass = "± 1 %"\n')
    command = ["design", "tolerance", "--design", str(file), "--rotor-mass", "1", "--rpm", "1000"]
    more = ["--within", "speed", "+-1 %", "--machines", "64", "--axis", "none", "--workers", "1"]
    assert main([*command, *more, "--json", "--out", str(out)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["tolerances"] == {"speed": "± 1 %", "rotor_mass": "± 1 %"}
    assert set(answer["peak_contact_force_n"]) == set(answer["least_film_m"])
    assert any(text.startswith("Largest asperity force: ") for text in answer["sentences"])
    assert answer["machines"] == 64 and answer["shares"]["good"]["share"] in (0.0, 1.0)
    assert load_study(out).count == 64 and not (tmp_path / "out.json.parts").exists()
