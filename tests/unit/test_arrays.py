"""Array files against their schema: what is right comes back, what is wrong is one sentence that
names file, array, value and what is allowed.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from spab_core.common.arrays import Array, Schema, load
from spab_core.common.errors import InputError
from spab_core.common.npz import npz_bytes


class OtherError(InputError):
    pass


SCHEMA = Schema(
    "plate",
    {
        "width": Array(np.float64, ("width",), rising=True),
        "height": Array(np.float64, ("width", 2), low=0.0, high=4.0),
        "count": Array(np.int16, ("width",), low=0),
        "name": Array("<U4", ("width",), texts=("flat", "")),
        "note": Array("<U4"),
        "clean": Array(bool, ("grain",), required=False),
    },
    {"metadata": ("made",)},
    OtherError,
    "; make it again",
)
GOOD = {
    "width": np.array([1.0, 2.0, 3.0]),
    "height": np.array([[0.0, 4.0], [np.nan, 1.0], [2.0, 2.0]]),
    "count": np.array([0, 1, 32767]),
    "name": np.array(["flat", "", "flat"]),
    "note": np.array("ab"),
    "metadata": np.array(json.dumps({"made": 1})),
}


def test_a_good_file_comes_back_as_the_schema_says(tmp_path):
    (tmp_path / "a.npz").write_bytes(npz_bytes(GOOD | {"more": np.array(3)}))
    for source in (npz_bytes(GOOD), tmp_path / "a.npz"):
        found = load(source, SCHEMA)
        assert found.keys() == GOOD.keys() and found["metadata"] == {"made": 1}
        for name in ("width", "height", "count", "name"):
            assert np.array_equal(found[name], GOOD[name], equal_nan=name == "height")
            assert found[name].dtype == np.dtype(SCHEMA.arrays[name].dtype)
    swapped = GOOD | {"width": GOOD["width"].astype(">f8"), "clean": np.array([True])}
    found = load(npz_bytes(swapped), SCHEMA, {"width": 3, "grain": 1})
    assert found["width"].dtype == np.float64 and found["clean"].tolist() == [True]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"width": None, "metadata": None}, "it lacks width, metadata"),
        ({"width": np.array([])}, "width is empty: allowed is at least one number"),
        (
            {"width": np.array([1, 2, 3])},
            "width holds whole numbers: allowed is floating-point numbers",
        ),
        (
            {"width": np.array([1.0, np.inf, 3.0])},
            "width holds inf at [1]: allowed is a finite number",
        ),
        (
            {"width": np.array([1.0, 3.0, 3.0])},
            "width holds 3 at [2]: allowed is numbers that rise",
        ),
        (
            {"height": np.zeros((3, 3))},
            "height has the shape 3 x 3: allowed is width (3) x 2",
        ),
        ({"height": np.zeros(3)}, "height has the shape 3: allowed is width (3) x 2"),
        (
            {"height": np.array([[0.0, 4.0], [0.0, 4.5], [9.0, 0.0]])},
            "height holds 4.5 at [1, 1]: allowed is from 0 to 4",
        ),
        ({"count": np.array([0, 0, -1])}, "count holds -1 at [2]: allowed is 0 or more"),
        (
            {"count": np.array([0, 65536, 1])},
            "count holds 65536 at [1]: allowed is what fits int16",
        ),
        (
            {"name": np.array(["flat", "flatter", "x"])},
            "name holds 'flatter' at [1]: allowed is flat, nothing",
        ),
        ({"note": np.array("abcdef")}, "note holds 'abcdef': allowed is what fits 4 characters"),
        ({"note": np.array(["ab"])}, "note has the shape 1: allowed is () of a single value"),
        ({"metadata": np.array("[1]")}, "metadata is no JSON object"),
        ({"metadata": np.array("{}")}, "its metadata lacks made"),
        ({"metadata": np.array("{")}, "Expecting property name"),
    ],
)
def test_what_is_wrong_is_one_sentence(tmp_path, change, said):
    path = tmp_path / "a.npz"
    arrays = {name: array for name, array in (GOOD | change).items() if array is not None}
    path.write_bytes(npz_bytes(arrays))
    with pytest.raises(OtherError) as error:
        load(path, SCHEMA)
    text = str(error.value)
    assert text.startswith(f"cannot read the plate {str(path)!r}: {said}")
    assert text.endswith("; make it again") and "\n" not in text


def test_a_wrong_shape_is_refused_before_it_is_unpacked(monkeypatch):
    unpacked = []
    read = np.lib.format.read_array
    monkeypatch.setattr(
        np.lib.format, "read_array", lambda *a, **k: unpacked.append(1) or read(*a, **k)
    )
    with pytest.raises(OtherError, match="width has the shape 3: allowed is"):
        load(npz_bytes(GOOD), SCHEMA, {"width": 4})
    assert not unpacked
    load(npz_bytes(GOOD), SCHEMA)
    assert unpacked


def test_errors_of_a_loader_become_the_same_sentence():
    said = r"^cannot read the plate 'x': bad; make it again$"
    with pytest.raises(OtherError, match=said), SCHEMA.reading("x"):
        raise TypeError("bad")
    with pytest.raises(InputError, match=r"^mine$"), SCHEMA.reading("x"):
        raise InputError("mine")
