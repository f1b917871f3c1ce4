"""Whatever a user hands over ends in a picture or in a StitchError that says something: never in anything else.

Picture files have a file of their own, test_decoder_fuzz.py.
"""

from __future__ import annotations

import json
import os
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.batch.list import read_list
from edf_stitch.core.cameras.sources import CameraRequest, read_camera_file
from edf_stitch.core.choices import FADES
from edf_stitch.core.commands.cli import main
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.masks import read_mask
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.pose.match_files import read_matches
from edf_stitch.core.system.errors import StitchError
from edf_stitch.synthetic_scenes.two_planes import Pair
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from ..pairs import ON_REFERENCE

SOAK = int(os.environ.get("EDF_SOAK_STITCHES", 300))
PLACE = tempfile.TemporaryDirectory()
SIZES = ((640, 480), (600, 500))


def ends(work: Any) -> Any:
    """What it returns, or None where it was refused in words."""
    try:
        return work()
    except StitchError as error:
        said = str(error)
        assert len(said) > 10 and "Traceback" not in said and "\n" not in said.strip(), said
        return None


def text_file(content: str | bytes) -> Path:
    path = Path(PLACE.name) / "file"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogatepass"))
    return path


# --- texts ----------------------------------------------------------------------------------------------------------

numbers = st.one_of(
    st.floats(), st.integers(-(10**40), 10**40), st.floats(-100, 700),
    st.sampled_from(("", "nan", "1e999", "-inf", "0x10", "1,5", "١", "x", "weight", '"', "1_0", "\0", "1" * 5000)),
).map(str)  # fmt: skip
lines = st.lists(st.lists(numbers, max_size=6), max_size=8)
tables = st.tuples(lines, st.sampled_from((",", ";", "\t", " ", ", ", "|"))).map(
    lambda it: "\n".join(it[1].join(cells) for cells in it[0])
)
contents = st.one_of(tables, st.text(max_size=300), st.binary(max_size=300))


@settings(max_examples=200)
@given(contents)
@example("x,y,x2,y2\n1,2,3,4")
@example("x;y;x2;y2;weight\n1,5;2;3;4;1e308\n9;9;9;9;1e308")
def test_files_of_matches(content: str | bytes) -> None:
    matches = ends(lambda: read_matches(text_file(content), *SIZES))
    if matches is not None:
        assert len(matches) and matches.x.shape == matches.y.shape == (len(matches), 2)
        assert np.isfinite(matches.x).all() and np.isfinite(matches.y).all() and (matches.weights > 0).all()


@settings(max_examples=100)
@given(contents)
@example("reference,target\na.png,b.png")
@example("a_%04d.png,b_%04d.png\n")
@example("a_%0999999999d.png,b_%0999999999d.png\n")
@example("x" * 5000)
@example("reference,target,first,last,step\na_####.png,b_####.png,0,99999999999,1")
def test_lists_of_pairs(content: str | bytes) -> None:
    items = ends(lambda: read_list(text_file(content)))
    assert items is None or all(item.name for item in items)


values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.integers(-(10**30), 10**30), st.text(max_size=5)),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(("K", "R", "a")), inner, max_size=3),
    max_leaves=12,
)
matrix = st.lists(st.lists(st.floats(-1000, 1000), min_size=3, max_size=3), min_size=3, max_size=3)
entry = st.fixed_dictionaries(
    {"K": st.one_of(values, matrix, st.just([[500, 0, 320], [0, 500, 240], [0, 0, 1]]))},
    optional={"R": st.one_of(values, matrix, st.just(np.eye(3).tolist())), "t": st.one_of(values, st.just([1, 0, 0])),
              "distortion": st.one_of(values, st.lists(st.floats(), max_size=15))},
)  # fmt: skip
camera_files = st.one_of(
    st.fixed_dictionaries({"cameras": st.fixed_dictionaries({"reference": entry, "target": entry})}).map(json.dumps),
    values.map(json.dumps), st.text(max_size=50), st.binary(max_size=50),
)  # fmt: skip


@settings(max_examples=150)
@given(camera_files)
def test_camera_files(content: str | bytes) -> None:
    cameras = ends(lambda: read_camera_file(text_file(content), ("a", "b"), SIZES))
    if cameras is not None:
        assert all(np.isfinite(camera.K).all() and np.isfinite(camera.distortion).all() for camera in cameras)


words = st.one_of(
    st.sampled_from((
        "--focal-px", "--focal35", "--principal", "--crop", "--scale", "--field", "--blend", "--seed", "-o",
        "--matches", "--report", "--warp", "--layers", "--ignore-ref", "--cameras", "--projection", "a.png",
        "0", "-1", "1e999", "nan", "1,2", "1,2,3,4", "full", "slack", "out.png", "out.xyz", "", ".", "/", "\0", "--",
    )),
    st.text(max_size=6),
)  # fmt: skip


@settings(max_examples=150)
@given(st.sampled_from(("stitch", "batch", "compare", "x")), st.lists(words, max_size=8))
def test_command_lines(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, command: str, arguments: list[str]
) -> None:
    monkeypatch.chdir(PLACE.name)
    assert main([command, *arguments]) in (0, 2, 3, 4)
    out, err = capfd.readouterr()
    assert "internal error" not in err and "Traceback" not in err
    assert out or err.strip(), "not without a word"


# --- arrays ---------------------------------------------------------------------------------------------------------

odd_arrays = st.one_of(
    arrays.arrays(
        st.sampled_from((np.uint8, np.uint16, np.float32, np.float64, np.int8, np.float16, np.complex64, bool)),
        arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=24),
    ),
    arrays.arrays(np.float32, (20, 20, 3), elements=st.floats(width=32)),
)


@settings(max_examples=40)
@given(odd_arrays, odd_arrays)
def test_arrays_as_pictures(first: np.ndarray, second: np.ndarray) -> None:
    with np.errstate(all="ignore"):
        assert ends(lambda: stitch((first, second))) is None, "nothing in them to hold on to"


@settings(max_examples=60)
@given(odd_arrays)
def test_arrays_as_masks_and_matches(array: np.ndarray) -> None:
    with np.errstate(all="ignore"):
        mask = ends(lambda: read_mask(array, (24, 18), "the reference"))
        ends(lambda: read_matches(array, *SIZES))
    assert mask is None or mask.shape == (18, 24)


@st.composite
def changes(draw: st.DrawFn) -> dict[str, Any]:
    """What is done to a sound pair and its options."""
    some = draw(st.sets(st.sampled_from(sorted(CHANGES)), max_size=3))
    return {name: draw(CHANGES[name]) for name in sorted(some)}


SEEDS = st.integers(0, 2**16)
CHANGES: dict[str, st.SearchStrategy] = {
    "turned": st.integers(1, 3), "flipped": st.booleans(), "swapped": st.booleans(),
    "cut": st.tuples(*[st.integers(0, 100)] * 4), "holes": SEEDS, "not_finite": SEEDS, "noise": st.floats(0, 100),
    "dtype": st.sampled_from((np.uint8, np.uint16, np.float32)), "channels": st.sampled_from((1, 3, 4)),
    "bright": st.sampled_from((1e-6, 0.1, 3.0, 1e6, 1e30)), "stretched": st.floats(0.3, 3),
    "focal": st.one_of(st.floats(0.01, 1e7), st.just(228.0)), "principal": st.tuples(*[st.floats(-1e4, 1e4)] * 2),
    "field": st.sampled_from(("slack", "strict", "paper")), "fade": st.sampled_from(FADES),
    "blend": st.sampled_from(("feather", "linear")), "scale": st.floats(0.02, 1), "seed": SEEDS,
    "crop": st.sampled_from(("full", "inscribed", "reference", (0, 0, 5, 5), (10, 10, 10**6, 3))),
    "matches": st.tuples(SEEDS, st.integers(1, 40)), "mask": SEEDS,
    "distortion": st.lists(st.floats(-3, 3), max_size=5),
}  # fmt: skip


def changed(pair: Pair, how: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, StitchOptions]:
    """The pair's arrays and options after the changes."""
    pictures = [pair.reference, pair.target]
    plain = ("field", "fade", "blend", "scale", "seed", "crop")
    options: dict[str, Any] = {name: how[name] for name in plain if name in how}
    if how.get("swapped"):
        pictures.reverse()
    second = pictures[1]
    second = np.rot90(second, how.get("turned", 0))
    second = second[:, ::-1] if how.get("flipped") else second
    if "cut" in how:
        top, left, bottom, right = how["cut"]
        second = second[top : max(top + 1, len(second) - bottom), left : max(left + 1, second.shape[1] - right)]
    if "stretched" in how:
        size = max(1, int(second.shape[1] * how["stretched"])), second.shape[0]
        second = cv2.resize(np.ascontiguousarray(second), size)
    rng = np.random.default_rng(how.get("holes", how.get("not_finite", how.get("mask", 0))))
    kind = how.get("dtype", np.uint8)
    light = second.astype(np.float32) / 255 + rng.normal(0, how.get("noise", 0) / 255, second.shape).astype(np.float32)
    light = np.clip(light * np.float32(how.get("bright", 1)), 0, None if kind == np.float32 else 1)
    if "not_finite" in how and kind == np.float32:
        light[rng.random(light.shape[:2]) < rng.random()] = rng.choice((np.nan, np.inf, -np.inf))
    channels = how.get("channels", 3)
    if channels == 1:
        light = light[..., :1]
    if "holes" in how or channels == 4:
        shown = rng.random(light.shape[:2]) < rng.random() if "holes" in how else np.ones(light.shape[:2])
        light = np.dstack([light, shown.astype(np.float32)])
    second = light if kind == np.float32 else np.rint(light * np.iinfo(kind).max).astype(kind)
    camera: dict[str, Any] = {}
    if "distortion" in how:
        entry = {"K": [[228, 0, 120], [0, 228, 90], [0, 0, 1]], "distortion": how["distortion"]}
        camera["cameras"] = {"reference": entry, "target": entry}
    elif "focal" in how:
        camera["focal_px"] = (how["focal"],)
    if "principal" in how:
        camera["principal"] = how["principal"]
    if "matches" in how:
        seed, count = how["matches"]
        size = [pictures[0].shape[1], pictures[0].shape[0], second.shape[1], second.shape[0]]
        options["matches"] = np.random.default_rng(seed).random((count, 4)) * (np.array(size) - 1)
    if "mask" in how:
        options["ignore"] = (rng.random(pictures[0].shape[:2]) < rng.random(),)
    return pictures[0], second, replace(ON_REFERENCE, measure=False, camera=CameraRequest(**camera), **options)


def sound(result: StitchResult) -> None:
    """What everybody may rely on."""
    shape = result.alpha.shape
    assert result.pixels.shape[:2] == shape == result.warp.maps[1].x.shape == result.layers[1].alpha.shape
    assert np.isfinite(result.pixels).all() and np.isfinite(result.alpha).all()
    assert result.alpha.min() >= 0 and result.alpha.max() <= 1
    assert shape[0] * shape[1] < 60 * 240 * 180, "no panorama is out of all proportion to its pictures"
    json.dumps(result.report, allow_nan=False)


def tried(pair: Pair, how: dict[str, Any]) -> None:
    with np.errstate(all="ignore"):
        first, second, options = changed(pair, how)
        result = ends(lambda: stitch((first, second), options))
    if result is not None:
        sound(result)


@settings(max_examples=8)
@given(changes())
def test_sound_pairs_maltreated(small_pair: Pair, how: dict[str, Any]) -> None:
    tried(small_pair, how)


@pytest.mark.slow
@pytest.mark.soak
@settings(max_examples=SOAK)
@given(changes())
def test_many_sound_pairs_maltreated(small_pair: Pair, how: dict[str, Any]) -> None:
    tried(small_pair, how)


def test_nested_beyond_what_python_bears(tmp_path: Path) -> None:
    (tmp_path / "cameras.json").write_text("[" * 100_000)
    with pytest.raises(StitchError, match="the camera file is not JSON"):
        read_camera_file(tmp_path / "cameras.json", ("a", "b"), SIZES)


def test_a_mirrored_picture_is_refused_in_words(small_pair: Pair) -> None:
    with pytest.raises(StitchError, match="one of the pictures is mirrored: .* flip one of them"):
        tried_first, second, options = changed(small_pair, {"flipped": True, "principal": (0.0, 322.0)})
        stitch((tried_first, second), options)
