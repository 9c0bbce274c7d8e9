"""Exponents from elsewhere: read with care, ranked by the same protocol."""

import io
import zipfile

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spab_core
from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes
from spab_core.common.units import to_rpm
from spab_core.design.model import reference_design
from spab_core.design.presets import preset
from spab_core.reporting.export import map_table
from spab_core.shipped.manifest import load_reference_map
from spab_core.surrogates.metrics import score
from spab_core.surrogates.models import MODELS
from spab_core.surrogates.ranking import ranking, suggestion
from spab_core.surrogates.user_data import MIN_ROWS, Samples, rank_samples, read_samples


def grid(n=10, **columns):
    number, mass = (
        a.ravel() for a in np.meshgrid(np.linspace(0.5, 8.0, n), np.linspace(1.0, 20.0, n))
    )
    return {
        "bearing_number": number,
        "rotor_mass": mass,
        "mle": np.sin(number) * mass / 20.0,
    } | columns


def csv(columns, **options):
    return pd.DataFrame(columns).to_csv(index=False, **options).encode()


@pytest.mark.parametrize("semicolons", [False, True])
def test_our_own_download_is_read_back(semicolons):
    m = load_reference_map()
    samples = read_samples(csv_bytes(map_table(m), semicolons), m.design)
    assert len(samples.mle) == m.mle.size and samples.left_out == 0 and not samples.notes
    assert np.array_equal(samples.mle, m.mle.ravel())
    assert np.array_equal(samples.inputs[:, 1].reshape(m.shape)[0], m.rotor_mass)


def text(columns, separator=",", decimal=".", names=None):
    table = pd.DataFrame(columns)
    return table.to_csv(index=False, sep=separator, decimal=decimal, header=names or True)


SPREAD = grid()
PLAIN = text(SPREAD)
GERMAN = text(SPREAD, ";", ",")


def excel(columns, sheets=(), title=None):
    data = io.BytesIO()
    with pd.ExcelWriter(data, engine="xlsxwriter") as writer:
        for sheet in sheets:
            pd.DataFrame({title: [1.0]} if title else {}).to_excel(writer, sheet_name=sheet)
        pd.DataFrame(columns).to_excel(
            writer, sheet_name="run 3", index=False, startrow=3 * bool(title)
        )
        if title:
            writer.book.worksheets()[-1].write(0, 0, title)
    return data.getvalue()


with zipfile.ZipFile(io.BytesIO(excel(SPREAD))) as archive:
    WORKBOOK = {name: archive.read(name) for name in archive.namelist()}


def with_units(row):
    names, _, rest = PLAIN.partition("\n")
    return f"{names}\n{row}\n{rest}"


def matrix(corner, separator=",", decimal=".", across="bearing_number", factor=1.0):
    down = {"bearing_number": "rotor_mass", "rotor_mass": "bearing_number"}[across]
    table = pd.DataFrame(SPREAD).pivot(index=down, columns=across, values="mle")
    table.columns = [f"{v * factor!r}".replace(".", decimal) for v in table.columns]
    return table.rename_axis(corner).to_csv(sep=separator, decimal=decimal).encode()


def lines(*names, unit=1.0):
    return text(SPREAD | {"rotor_mass": SPREAD["rotor_mass"] / unit}, names=list(names)).encode()


RPM = {
    "speed_rpm": reference_design().speed_rpm(1.0) * SPREAD["bearing_number"],
    "rotor_mass_kg": SPREAD["rotor_mass"],
    "mle": SPREAD["mle"],
}
READ = {
    "semicolons and decimal commas": GERMAN.encode(),
    "as a German Excel saves it": GERMAN.replace("\n", "\r\n").encode("utf-8-sig"),
    "tabs": text(SPREAD, "\t").encode(),
    "tabs, decimal commas": text(SPREAD, "\t", ",").encode(),
    "bars": text(SPREAD, "|").encode(),
    "spaces": text(SPREAD, " ").encode(),
    "two blanks, names of two words": text(
        SPREAD, "@", names=["Bearing Number", "Rotor Mass", "MLE"]
    )
    .replace("@", "   ")
    .encode(),
    "sep=,": b"sep=,\n" + PLAIN.encode(),
    "sep=;": b"\xef\xbb\xbfsep=;\r\n" + GERMAN.encode(),
    "sep=tab": b"sep=\t\n" + text(SPREAD, "\t").encode(),
    "separators at the ends": PLAIN.replace("\n", ",\n").encode(),
    "separators at the ends of rows": PLAIN.replace("\n", ",,\n").replace(",,", "", 1).encode(),
    "comments": b"# made by X\n\n% 2026\n" + PLAIN.encode() + b"# end\n",
    "numpy.savetxt": b"# " + text(SPREAD, " ").encode(),
    "numpy.savetxt, names between commas": ("# " + PLAIN.replace("\n", "\0", 1).replace(",", " "))
    .replace("bearing_number rotor_mass mle\0", "bearing_number,rotor_mass,mle\n")
    .encode(),
    "UTF-16": PLAIN.encode("utf-16"),
    "UTF-16, big end first": b"\xfe\xff" + PLAIN.encode("utf-16-be"),
    "UTF-16 without a mark": PLAIN.encode("utf-16-le"),
    "UTF-32": PLAIN.encode("utf-32"),
    "Windows' letters": text(SPREAD | {"Größe": ["größer"] * 100}).encode("cp1252"),
    "old Macintosh": PLAIN.replace("\n", "\r").encode(),
    "quoted, with decimal commas": text(SPREAD, ",", ",").encode(),
    "a row of units": with_units("-,kg,1/rev").encode(),
    "a row of units in brackets": with_units("[1],[kg],[1/rev]").encode(),
    "a row of units, some empty": with_units(",kg,").encode(),
    "units in brackets": lines("bearing number [-]", "rotor mass [kg]", "MLE [1/rev]"),
    "units in parentheses": lines("Λ (-)", "m_r (kg)", "MLE (rev⁻¹)"),
    "grams": lines("Lambda", "Rotor mass, g", "MLE per revolution", unit=1e-3),
    "pounds": lines("Lambda", "rotor mass [lb]", "mle", unit=0.45359237),
    "grams in a row of units": text(
        SPREAD | {"rotor_mass": 1e3 * SPREAD["rotor_mass"]}, names=["lambda", "mass", "mle"]
    )
    .replace("\n", "\n-,g,1/rev\n", 1)
    .encode(),
    "speeds in rpm": text(RPM).encode(),
    "speeds in 1/min": text(RPM, names=["Drehzahl [1/min]", "Masse [kg]", "MLE"]).encode(),
    "speeds in Hz": text(
        RPM | {"speed_rpm": RPM["speed_rpm"] / 60.0}, names=["n [Hz]", "m", "mle"]
    ).encode(),
    "speeds in rad/s": text(
        RPM | {"speed_rpm": RPM["speed_rpm"] * np.pi / 30.0}, names=["ω / (rad/s)", "m", "mle"]
    ).encode(),
    "radians in 1/s": text(
        RPM | {"speed_rpm": RPM["speed_rpm"] * np.pi / 30.0}, names=["ω [s⁻¹]", "m", "mle"]
    ).encode(),
    "turns in 1/s, in a row of units": text(
        RPM | {"speed_rpm": RPM["speed_rpm"] / 60.0}, names=["n", "m", "mle"]
    )
    .replace("\n", "\n1/s,kg,1/rev\n", 1)
    .encode(),
    "units behind in": text(RPM, names=["Drehzahl in U/min", "m_R in kg", "mle in 1/U"]).encode(),
    **{
        f"thousands between {sign!r}": text(
            RPM
            | {
                "speed_rpm": [f"{v:,.12f}".replace(",", sign) for v in RPM["speed_rpm"]],
            },
            ";",
        ).encode()
        for sign in (" ", "\u00a0", "\u202f", "'", "’")
    },
    "colons": text(SPREAD, ":").encode(),
    "single quotes": PLAIN.replace("\n", "'\n'").replace(",", "','").join("''").encode(),
    "Markdown": "\n".join(f"| {line.replace(',', ' | ')} |" for line in PLAIN.splitlines())
    .replace("\n", "\n|---|:-:|---|\n", 1)
    .encode(),
    "powers of ten as Fortran writes them": text(
        SPREAD | {"mle": [f"{v!r}D+00" for v in SPREAD["mle"].tolist()]}
    ).encode(),
    "λ beside Λ": lines("Λ", "m_r", "λ"),
    "λ alone": lines("λ", "m_r", "MLE"),
    "exponent per second": text(
        SPREAD | {"mle": SPREAD["mle"] * RPM["speed_rpm"] / 60.0},
        names=["bearing_number", "rotor_mass", "lyapunov [1/s]"],
    ).encode(),
    "exponent per radian": text(
        SPREAD | {"mle": SPREAD["mle"] / (2.0 * np.pi)}, names=["Λ", "m_r", "mle (1/τ)"]
    ).encode(),
    "a matrix": matrix("mass/Lambda"),
    "a matrix, bearing numbers down": matrix("Λ \\ m_r [kg]", across="rotor_mass"),
    "a matrix, semicolons": matrix("mass/Lambda", ";", ","),
    "a matrix over rpm": matrix(
        "rotor mass [kg] / speed [1/min]", factor=reference_design().speed_rpm(1.0)
    ),
    "a workbook": excel(SPREAD),
    "a workbook of rpm behind an empty sheet": excel(RPM, sheets=["cover"]),
    "a title above": b"Test stand 3;rotor 12\n\nspeed steps:;10\n" + GERMAN.encode(),
    "empty rows of Excel above": b",,,\n,,,\n" + PLAIN.encode(),
    "a workbook with a title": excel(SPREAD, title="Test stand 3"),
    "a workbook whose first sheet is something else": excel(SPREAD, sheets=["cover"], title="T"),
    "capital exponents": PLAIN.replace("e-", "E-").encode(),
    "missing cells": PLAIN.encode() + b"9,1,\n9,2,NaN\n9,3,#N/A\n9,4,n/a\n9,5\n",
}


@pytest.mark.parametrize("how", READ)
def test_what_other_programs_write_is_read(how):
    found = spab_core.read_samples(READ[how], reference_design())
    order = np.lexsort(found.inputs.T[::-1])
    wanted = np.column_stack([SPREAD["bearing_number"], SPREAD["rotor_mass"]])
    right = np.lexsort(wanted.T[::-1])
    assert found.inputs[order] == pytest.approx(wanted[right], rel=1e-12)
    assert found.mle[order] == pytest.approx(SPREAD["mle"][right], rel=1e-12)
    assert found.left_out == (5 if how == "missing cells" else 0)


@given(st.data())
def test_numbers_are_the_same_in_any_dress(data):
    separator = data.draw(st.sampled_from([",", ";", "\t", "|"]))
    decimal = "." if separator == "," else data.draw(st.sampled_from([".", ","]))
    order = data.draw(st.permutations(["bearing_number", "rotor_mass", "mle", "remark"]))
    encoding = data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]))
    end = data.draw(st.sampled_from(["\n", "\r\n", "\r"]))
    columns = SPREAD | {"remark": ['schön; 1,5 | "ja"'] * 100}
    content = text({name: columns[name] for name in order}, separator, decimal)
    dressed = data.draw(st.sampled_from(["", "\n", "# x\n", f"sep={separator}\n"])) + content
    if data.draw(st.booleans()):
        dressed = dressed.replace("\n", separator + "\n") if "sep=" not in dressed else dressed
    found = read_samples(dressed.replace("\n", end).encode(encoding))
    assert np.array_equal(found.mle, SPREAD["mle"]) and not found.notes
    assert np.array_equal(found.inputs[:, 0], SPREAD["bearing_number"])


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["Λ", "m_r", "mle", "MLE"], "'mle' and 'MLE' both mean the exponent"),
        (["Λ", "m_r", "λ", "MLE"], "λ .lambda. may be the bearing number or the exponent"),
        (["Lambda", "mass", "lambda", "lyapunov"], "ambiguous"),
        (["Lambda", "mass", "lambda", "x"], "ambiguous"),
        (["Λ", "mass", "mass_kg", "mle"], "'mass' and 'mass_kg' both mean the rotor mass"),
        (["Λ", "rotor_mass", "mass", "mle"], "both mean the rotor mass"),
        (["Λ", "bearing number", "mass", "mle"], "both mean the bearing number"),
        (["Λ", "mass", "mle", "mle"], "both mean the exponent"),
        (["Λ", "mass", "mle [1/s]", "mle [1/rev]"], "both mean the exponent"),
        (["speed_rpm", "speed [Hz]", "mass", "mle"], "both mean the shaft speed"),
        (
            ["Λ", "mass [stone]", "mle", "x"],
            r"unit in 'mass \[stone\]' is not known: give one of kg",
        ),
        (["speed", "mass", "mle", "x"], "does not state its unit: name it speed_rpm"),
        (["speed [1/s]", "mass", "mle", "x"], "turns or radians in a second: write rev/s"),
        (["Λ", "mass", "mle [%]", "x"], r"unit in 'mle \[%\]' is not known"),
        (["mass_number", "Λ", "mle", "x"], "no column 'rotor_mass'"),
    ],
)
def test_what_two_columns_may_mean_is_refused(names, words):
    table = text(SPREAD | {"last": 0.5 * SPREAD["mle"]}, names=names)
    with pytest.raises(InputError, match=words):
        read_samples(table.encode(), reference_design())


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\xd0\xcf\x11\xe0" + b"\0" * 99, "workbook of Excel before 2007"),
        (b"CDF\x01" + b"\0" * 99, "NetCDF file"),
        (b"\x89HDF\r\n", "HDF5"),
        (b"MATLAB 5.0 MAT-file, Platform", "MATLAB file"),
        (b"\x1f\x8b\x08", "packed by gzip"),
        (b"PAR1" + b"x" * 99, "Parquet"),
        (b"{\\rtf1 a}", "RTF"),
        (b"<table><tr>", "page of HTML"),
        (b'{"mle": [1, 2]}', "it is JSON"),
        (b"<!DOCTYPE html><p>", "page of HTML"),
        (b"PK\x03\x04nothing", "not a workbook"),
        (b"   \n\n", "it is empty"),
        (b"# only\n# comments\n", "no line of names"),
        (PLAIN.split("\n", 1)[1].encode(), "its first line holds numbers"),
        (matrix(""), "first cell '' does not say"),
        (matrix("mass/stiffness"), "does not say what its rows and columns are"),
        (PLAIN.replace("0.5,", '"0,5",', 1).encode(), "decimal signs are mixed: '0,5' and"),
        (PLAIN.encode() + b'9,"1,500.0",0.1\n9,"1.600,0",0.1\n', "cannot be told"),
        (text({k: [f"{j},{100 + j}" for j in range(1, 90)] for k in SPREAD}).encode(), "two ways"),
        (
            PLAIN.replace("\n1", "\n\n\n1").encode() + b"\nx,1,1\n",
            f"bearing_number in line {len(PLAIN.splitlines()) + 2 + 10 * 2} is 'x'",
        ),
        (
            b'"a\nb",' + PLAIN.replace("\n", "\n,").encode().rstrip(b",") + b",x,1,1\n",
            "line 103 is 'x'",
        ),
        (PLAIN.encode() + b"9,1,-\n", "mle in line 102 is '-'"),
        (PLAIN.encode() + "9,1,−0.5\n".encode(), "its minus sign is not that of a keyboard"),
        (PLAIN.encode() + b"1500,1,0.5\n", "speeds in rpm belong in a column speed_rpm"),
        (PLAIN.encode() + b"9,1,0.5,7\n", "line 102 has 4 values, longer than the line of names"),
        (PLAIN.encode() + b"9,0x10,0.5\n", "rotor_mass in line 102 is '0x10'"),
        (PLAIN.encode() + b"9,1_0,0.5\n", "rotor_mass in line 102 is '1_0'"),
    ],
)
def test_what_is_no_table_is_named(data, words):
    with pytest.raises(InputError, match=words):
        read_samples(data, reference_design())


def test_speeds_need_the_design_and_follow_it():
    with pytest.raises(InputError, match="give the design"):
        read_samples(text(RPM).encode())
    design = preset("fed_spindle").design
    found = read_samples(text(RPM).encode(), design)
    omega = RPM["speed_rpm"] * np.pi / 30.0
    b, g = design.bearing, design.gas
    wanted = 6.0 * g.viscosity * omega / g.ambient_pressure * (b.radius / b.clearance) ** 2
    assert found.inputs[:, 0] == pytest.approx(wanted, rel=1e-12) and "the design" in found.notes[0]
    assert to_rpm(omega) == pytest.approx(RPM["speed_rpm"])


def test_speeds_of_another_design_beside_bearing_numbers_are_doubted():
    data = text(RPM | {"bearing_number": SPREAD["bearing_number"]}).encode()
    assert not read_samples(data, reference_design()).notes
    assert "another design" in read_samples(data, preset("fed_spindle").design).notes[0]


def test_the_unit_of_the_exponent_is_asked_or_doubted():
    bare = lines("Λ", "m_r", "lyapunov")
    assert "taken as per revolution" in read_samples(bare).notes[0]
    assert not read_samples(bare, per="revolution").notes
    fast = text(SPREAD | {"mle": 170.0 * SPREAD["mle"]}).encode()
    with pytest.raises(InputError, match="more than is usual per revolution"):
        read_samples(fast)
    assert read_samples(fast, per="revolution").mle.max() == pytest.approx(
        170 * SPREAD["mle"].max()
    )
    with pytest.raises(InputError, match="need the shaft speed"):
        read_samples(fast, per="second")
    found = read_samples(fast, reference_design(), per="second")
    seconds = 60.0 / (reference_design().speed_rpm(1.0) * SPREAD["bearing_number"])
    assert found.mle == pytest.approx(170.0 * SPREAD["mle"] * seconds)
    with pytest.raises(InputError, match="per second, and per tau was asked for"):
        read_samples(READ["exponent per second"], reference_design(), per="tau")
    with pytest.raises(InputError, match="per = 'hour' is not allowed"):
        read_samples(bare, per="hour")


def test_grams_taken_as_kilograms_are_doubted():
    heavy = text(SPREAD | {"rotor_mass": 40.0 * SPREAD["rotor_mass"]}).encode()
    assert "are these grams" in read_samples(heavy).notes[0]
    assert "more than its film can carry" in read_samples(heavy, reference_design()).notes[0]


@pytest.mark.parametrize(
    "names",
    [
        ("Λ", "m_r", "MLE"),
        ("lambda", "Rotor mass, kg", "Lyapunov"),
        (" LAMBDA ", "mass", "exponent"),
    ],
)
def test_names_as_people_write_them(names):
    g = grid()
    shuffled = {
        "remark": ["x"] * 100,
        names[2]: g["mle"],
        names[0]: g["bearing_number"],
        names[1]: g["rotor_mass"],
    }
    found = read_samples(csv(shuffled))
    assert np.allclose(found.inputs, np.column_stack([g["bearing_number"], g["rotor_mass"]]))
    assert np.allclose(found.mle, g["mle"])


def test_empty_exponents_are_left_out_and_counted():
    g = grid()
    g["mle"][:7] = np.nan
    assert read_samples(csv(g)).left_out == 7


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not a CSV table"),
        (b"\xff\xfe\x00", "not a CSV table"),
        (b"a,b\n1,2\n", "no column 'bearing_number'"),
        (csv(grid(n=7)), f"at least {MIN_ROWS} are needed"),
        (
            csv(grid(mle=["1e9"] * 100)),
            "mle in line 2 is '1e9': allowed is a number from -1000 to 1000 per revolution",
        ),
        (csv(grid(rotor_mass=["heavy"] * 100)), "rotor_mass in line 2 is 'heavy'"),
        (csv(grid(bearing_number=[""] * 100)), "bearing_number in line 2 is nothing"),
        (csv(grid(bearing_number=[1.0] * 100, rotor_mass=np.linspace(1, 9, 100))), "need a plane"),
        (csv(grid(bearing_number=[1.0] * 100)), "stands twice"),
        (csv(grid(mle=["inf"] * 100)), "line 2 is 'inf'"),
        (
            b"bearing_number,rotor_mass,mle\n" + b"1,2,3,4,5\n" * 100,
            "longer than the line of names",
        ),
    ],
)
def test_a_wrong_table_is_a_sentence(data, words):
    with pytest.raises(InputError, match=words):
        read_samples(data)


@given(st.binary(max_size=300))
def test_any_bytes_are_a_sentence(data):
    with pytest.raises(InputError):
        read_samples(data)


@settings(max_examples=60)
@given(st.data())
def test_a_damaged_workbook_is_read_or_a_sentence(data):
    parts = dict(WORKBOOK)
    name = data.draw(st.sampled_from(sorted(parts)))
    place = data.draw(st.integers(0, len(parts[name])))
    more = data.draw(
        st.sampled_from([b"<", b'"', b"&a;", b"1e999", b"ZZZ1", b"d", b"#REF!", b"\xff"])
    )
    cut = data.draw(st.integers(0, 12))
    parts[name] = parts[name][:place] + more + parts[name][place + cut :]
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for part, content in parts.items():
            archive.writestr(part, content)
    content = bytearray(packed.getvalue())
    if data.draw(st.booleans()):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    try:
        assert np.isfinite(read_samples(bytes(content), reference_design()).mle).all()
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.slow
@given(st.lists(st.tuples(*[st.text(max_size=6)] * 3), min_size=MIN_ROWS, max_size=MIN_ROWS))
def test_any_rows_are_samples_or_a_sentence(rows):
    try:
        found = read_samples(
            csv(pd.DataFrame(rows, columns=["bearing_number", "rotor_mass", "mle"]))
        )
    except InputError:
        return
    assert np.isfinite(found.mle).all()


def test_ranked_as_the_map_itself(design):
    m = load_reference_map()
    number, mass = np.meshgrid(m.bearing_number, m.rotor_mass, indexing="ij")
    samples = Samples(np.column_stack([number.ravel(), mass.ravel()]), m.mle.ravel())
    rows = rank_samples(samples, design, [MODELS["tree"]], [8], [3])
    own = score(m, MODELS["tree"], 8, 3)
    for name in ("rmse_held_out", "mae_held_out", "rmse_all"):
        assert rows[name].iloc[0] == pytest.approx(own[name], rel=1e-12)


@pytest.mark.slow
def test_few_points_are_ranked_too(design):
    steps = []
    scores = rank_samples(
        read_samples(csv(grid())),
        design,
        [MODELS[k] for k in ("nearest", "cubic", "tree")],
        (2, 8),
        (0, 1),
        progress=steps.append,
    )
    assert sum(steps) == 12 and len(scores) == 12
    assert ranking(scores).index[0] == "cubic" and "Cubic interpolation" in suggestion(
        ranking(scores)
    )


@pytest.mark.parametrize("data", [b"---\n", b"===\n---|---\n", b"-" * 100_000 + b"x\n"])
def test_rules_alone_are_no_table_and_take_no_time(data):
    """The last one held a pattern that tried all pairs of places."""
    with pytest.raises(InputError):
        read_samples(data)


def rows_of(header, row):
    """A table of 90 points; ``row`` takes k, bearing number and mass."""
    points = [(b, m) for b in np.linspace(0.5, 8.0, 10) for m in np.linspace(1.0, 9.0, 9)]
    return "\n".join([header, *(row(k, *p) for k, p in enumerate(points)), ""]).encode()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        # a speed turned round would turn the exponents' sign
        (
            rows_of("Λ,rpm,m,mle [1/s]", lambda k, b, m: f"{b},{-9000 * b},{m},5"),
            "speed_rpm in line 2",
        ),
        (
            rows_of("Λ,rpm,m,mle [1/s]", lambda k, b, m: f"{b},,{m},5"),
            "speed_rpm in line 2 is nothing",
        ),
        (rows_of("Λ,M [-],mle", lambda k, b, m: f"{b},{m},0.1"), "the mass number M is no mass"),
        (rows_of("Λ,mass [dimensionless],mle", lambda k, b, m: f"{b},{m},0.1"), "no unit"),
        (rows_of("Λ,M,mle", lambda k, b, m: f"{b},{m},0.1"), r"name a mass 'mass \[kg\]'"),
        (rows_of("Λ,m,mle\n-,-,1/rev", lambda k, b, m: f"{b},{m},0.1"), "told to have no unit"),
        # R's names of rows, beside an empty last column
        (
            rows_of("m,Λ,mle,note", lambda k, b, m: f"{k + 1},{m},{b},-0.1,"),
            "give that column a name",
        ),
        (rows_of("mle,Λ,m", lambda k, b, m: f"{'#DIV/0!' if k == 7 else 0.1},{b},{m}"), "#DIV/0!"),
        (rows_of("Λ,rotor mass (total) [kg],mle", lambda k, b, m: f"{b},{m},0.1"), "one bearing"),
    ],
)
def test_what_would_be_read_wrongly_is_refused(data, words):
    with pytest.raises(InputError, match=words):
        read_samples(data)


def test_what_is_clear_enough_is_read():
    plain = read_samples(rows_of("Λ,m,mle", lambda k, b, m: f"{b},{m},0.1"))
    for data in (
        rows_of("n,Lambda,mass,mle", lambda k, b, m: f"{k},{b},{m},0.1"),
        rows_of('"Λ,m,mle"', lambda k, b, m: f'"{b},{m},0.1"'),
        rows_of("Λ,m,mle", lambda k, b, m: f"{b},{m},0.1").decode().encode("utf-16-be"),
        rows_of("Λ,M [kg],mle", lambda k, b, m: f"{b},{m},0.1"),
        rows_of("Λ,m,mle", lambda k, b, m: f"{b},{m},0.1,"),
    ):
        found = read_samples(data)
        assert np.array_equal(found.inputs, plain.inputs) and np.array_equal(found.mle, plain.mle)
    missing = rows_of("mle,Λ,m", lambda k, b, m: f"{'#N/A' if k == 7 else 0.1},{b},{m}")
    assert read_samples(missing).left_out == 1
    matrix = "mass/Λ," + ",".join(map(str, range(1, 11))) + "\n"
    matrix += "".join(f"{m}," + ",".join(["5"] * 10) + "\n" for m in range(1, 9))
    assert any("does not state its unit" in note for note in read_samples(matrix.encode()).notes)


@pytest.mark.parametrize("data", ["file.csv", None, 3])
def test_what_is_no_file_is_refused(data):
    with pytest.raises(InputError, match="must be the bytes of a file"):
        read_samples(data)
    with pytest.raises(InputError, match="must be a Design"):
        read_samples(PLAIN.encode(), "my.toml")
