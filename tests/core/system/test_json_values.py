"""Values as JSON can hold them."""

from __future__ import annotations

import json

import numpy as np
from edf_stitch.core.system.json_values import plain


def test_numbers_json_has_no_word_for_become_null() -> None:
    value = {
        "nan": float("nan"), "inf": [np.inf, -np.float32("inf")], "array": np.array([[1.5, np.nan], [np.inf, 2]]),
        "deep": [{"tuple": (np.float64("nan"), 1)}],
    }  # fmt: skip
    assert plain(value) == {
        "nan": None, "inf": [None, None], "array": [[1.5, None], [None, 2.0]], "deep": [{"tuple": [None, 1]}]}


def test_numpys_numbers_become_pythons() -> None:
    value = plain({"i": np.int64(3), "b": np.bool_(True), "f": np.float32(0.5), "a": np.arange(2), "s": "word",
                   "n": None, "t": True, "flags": np.array([True]), "scalar": np.array(4.0)})  # fmt: skip
    assert value == {"i": 3, "b": True, "f": 0.5, "a": [0, 1], "s": "word", "n": None, "t": True, "flags": [True],
                     "scalar": 4.0}  # fmt: skip
    assert type(value["i"]) is int and type(value["b"]) is bool and type(value["f"]) is float
    json.dumps(value, allow_nan=False)
