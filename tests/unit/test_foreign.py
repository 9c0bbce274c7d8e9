"""Exponents from elsewhere: read with care, ranked by the same protocol."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spab_core.common.errors import InputError
from spab_core.common.files import csv_bytes
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


def test_our_own_download_is_read_back():
    m = load_reference_map()
    samples = read_samples(csv_bytes(map_table(m)))
    assert len(samples.mle) == m.mle.size and samples.left_out == 0
    assert np.allclose(samples.mle, m.mle.ravel()) and np.allclose(
        samples.inputs[:, 1].reshape(m.shape)[0], m.rotor_mass
    )


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
