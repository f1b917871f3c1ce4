"""Light that is worked out part by part is the light of the whole, however it is cut up."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.blend import Cut, Evened, Mixed
from edf_stitch.core.compose.inpaint import Patch, Patched
from edf_stitch.core.compose.tone.toned import Exposed
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.arrays import meet, with_margin, within
from edf_stitch.core.raster.colour import decode, srgb_curve
from edf_stitch.core.raster.lazy import AnyImage, Coded, Held, Placed, SideBySide, Weighed, extent, whole
from hypothesis import given
from hypothesis import strategies as st

H, W = 23, 31


def kinds(channels: int) -> dict[str, AnyImage]:
    """One light of every kind, all H × W."""
    random = np.random.default_rng(5)

    def numbers(*shape: int) -> np.ndarray:
        """Light of any kind, some of it negative."""
        return random.normal(0.3, 1, shape).astype(np.float32)

    def layer() -> Layer:
        """With soft, whole and empty places."""
        return Layer(numbers(H, W, channels), np.clip(numbers(H, W), 0, 1))

    light, other = numbers(H, W, channels), numbers(H, W, channels)
    change = numbers(9, 17, channels)
    change[:4] = 0
    levels = random.integers(0, 256, (H, W, channels)).astype(np.uint8)
    return {
        "coded": Coded(levels, (srgb_curve(),)), "deep": Coded(levels.astype(np.uint16) * 257, (srgb_curve(),)),
        "weighed": Weighed(light, np.clip(numbers(H, W), 0, 1)), "exposed": Exposed(light, numbers(channels)),
        "held": Held(light, (4, 6), light[4:20, 6:].copy()),
        "placed": Placed(numbers(9, 12, channels), (5, 7), (H, W)),
        "beyond": Placed(numbers(40, 12, channels), (-5, 25), (H, W)),
        "mixed": Mixed(layer(), layer(), np.clip(numbers(H, W), 0, 1)),
        "cut": Cut(light, other, numbers(H, W) > 0.5),
        "evened": Evened(light, (6, 8), change.any(axis=2), change),
        "side by side": SideBySide(light, Placed(numbers(9, 12, channels), (5, 17), (H, W)), 15),
        "patched": Patched(light, (Patch((6, 8), numbers(9, 17) > 0.5, change),)),
    }  # fmt: skip


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", list(kinds(1)))
def test_parts_are_parts_of_the_whole_and_nothing_is_written_over(kind: str, channels: int) -> None:
    light = kinds(channels)[kind]
    all_of_it = whole(light).copy()
    assert all_of_it.shape == light.shape == (H, W, channels) and all_of_it.dtype == np.float32
    for rows, columns in ((slice(0, 5), slice(3, 9)), (slice(4, 20), slice(6, 31)), (slice(22, 23), slice(30, 31))):
        assert np.array_equal(light[rows, columns], all_of_it[rows, columns])
    assert np.array_equal(whole(light), all_of_it)
    assert extent(light) == (all_of_it.min(), all_of_it.max())


def test_what_each_kind_is() -> None:
    made, channels = kinds(3), 3
    coded, placed, cut, evened, mixed = (made[name] for name in ("coded", "placed", "cut", "evened", "mixed"))
    assert np.array_equal(whole(coded), decode(coded.levels))
    frame = np.zeros((H, W, channels), np.float32)
    frame[5:14, 7:19] = placed.light
    assert np.array_equal(whole(placed), frame)
    assert np.array_equal(whole(cut), np.where(cut.chosen[..., None], cut.added, cut.before))
    changed = np.zeros((H, W), bool)
    changed[6:15, 8:25] = evened.touched
    differs = (whole(evened) != evened.light).any(axis=2)
    assert not (differs & ~changed).any() and differs[changed].mean() > 0.9
    patched = made["patched"]
    frame = patched.light.copy()
    (patch,) = patched.patches
    frame[6:15, 8:25][patch.touched] = patch.light[patch.touched]
    assert np.array_equal(whole(patched), frame)
    first, second = mixed.before, mixed.layer
    alone = (first.alpha > 0) & (second.alpha == 0)
    assert np.array_equal(whole(mixed)[alone], first.light[alone])
    both = (first.alpha > 0) & (second.alpha > 0)
    weights = np.stack([mixed.share * first.alpha, (1 - mixed.share) * second.alpha])[..., None]
    mean = (weights * np.stack([first.light, second.light])).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-12)
    assert whole(mixed)[both] == pytest.approx(mean[both], abs=1e-4)


def spans(side: int) -> st.SearchStrategy[slice]:
    """Some rows or columns of so many."""
    ends = st.tuples(st.integers(0, side - 1), st.integers(1, side))
    return ends.map(lambda pair: slice(min(pair), max(pair[1], min(pair) + 1)))


@given(st.tuples(spans(12), spans(15)), st.integers(-20, 20), st.integers(-20, 20), st.integers(1, 18))
def test_where_parts_meet(part: tuple[slice, slice], top: int, left: int, side: int) -> None:
    frame, inner = np.zeros((12, 15), int), np.arange(1, side * side + 1).reshape(side, side)
    for (row, column), value in np.ndenumerate(inner):
        if 0 <= row + top < 12 and 0 <= column + left < 15:
            frame[row + top, column + left] = value
    meeting = meet(part, frame.shape, (top, left), inner.shape)
    if meeting is None:
        assert not frame[part].any()
        return
    here, there = meeting
    assert np.array_equal(frame[part][here], inner[there]) and (frame[part] > 0).sum() == inner[there].size


def test_what_is_held_is_not_asked_for_again_and_planes_may_have_no_number_beyond() -> None:
    held = Held(np.zeros((H, W, 3), np.float32), (4, 6), np.ones((9, 12, 3), np.float32))
    assert (held[5:13, 6:18] == 1).all() and (held[3:13, 6:18] == 0).all() and (held[5:13, 6:19] == 0).all()
    plane = whole(Placed(np.ones((4, 5), np.float32), (-1, 2), (6, 9), np.nan))
    assert np.isfinite(plane).sum() == 15 and (plane[:3, 2:7] == 1).all()


def test_no_part_reaches_beyond_the_picture() -> None:
    assert within((slice(2, 90), slice(None, 4)), (12, 15)) == (slice(2, 12), slice(0, 4))
    assert with_margin((slice(2, 9), slice(3, 4)), 4, (12, 15)) == (slice(0, 12), slice(0, 8))
