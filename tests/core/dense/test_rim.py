"""What was found near the overlap's border, or without texture, goes where nothing bears it out, and stays where
anything does."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.dense.epipolar_lines import EpipolarLines
from edf_stitch.core.dense.rim import Found, borne_out
from edf_stitch.core.dense.rim_options import RIM
from edf_stitch.core.raster.distance import distance_to_border

from ..line_scenes import SIZE, Scene, scene

WIDTH = 20
"""Nodes from the border that are doubted in these tests: of pictures so small 5 % are few."""


@pytest.fixture(params=["sideways", "aslant"])
def made(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> tuple[Scene, EpipolarLines]:
    """A wall and a floor, and the true field of them."""
    pair = scene(request.param)
    lines = pair.lines(pair.field(truth=True))
    rows, columns = (np.ptp(np.flatnonzero(shown(lines).any(axis=axis))) + 1 for axis in (1, 0))
    monkeypatch.setattr("edf_stitch.core.dense.rim.RIM", type(RIM)(width=WIDTH / min(rows, columns)))
    return pair, lines


def shown(lines: EpipolarLines, along: np.ndarray | float = 0.0) -> np.ndarray:
    x, y = lines.target(np.zeros(lines.shape, np.float32) + np.float32(along))
    with np.errstate(invalid="ignore"):
        return (x >= 0) & (y >= 0) & (x <= SIZE[0] - 1) & (y <= SIZE[1] - 1)


def patch(lines: EpipolarLines, start: int, stop: int) -> np.ndarray:
    """The mask of nodes so many px inside the overlap's border, of some rows on the side where the target ends."""
    inside = shown(lines)
    depth = distance_to_border(inside)
    depth[:40] = depth[110:] = 0
    middle = int(np.median(np.nonzero(inside)[1]))
    depth[:, middle:] = 0 if inside[75, -1] else depth[:, middle:]
    depth[:, :middle] = 0 if inside[75, 0] else depth[:, :middle]
    mask: np.ndarray = (depth > start) & (depth <= stop)
    return mask


def settled(
    pair: Scene, lines: EpipolarLines, along: np.ndarray, confidence: np.ndarray, field: np.ndarray | None = None,
    guide: np.ndarray | None = None, plain: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    zero = np.zeros(lines.shape, np.float32)
    found = Found(
        along, zero, zero if field is None else field, confidence, zero if plain is None else plain.astype(np.float32)
    )
    overlap = shown(lines) & shown(lines, found.field)
    colours = (pair.reference if guide is None else guide).astype(np.float32)
    return borne_out(lines, found, overlap, colours, pair.views())


def led_astray(lines: EpipolarLines, at: np.ndarray, doubted: float) -> tuple[np.ndarray, np.ndarray]:
    """Moves that are right, 0, and sure, but in a patch, where they are smooth noise; its confidence is `doubted`."""
    along, confidence = np.zeros(lines.shape, np.float32), np.full(lines.shape, 0.95, np.float32)
    noise = cv2.GaussianBlur(np.random.default_rng(0).normal(0, 1, along.shape), (0, 0), 3.0)
    along[at] = 6 + 3 * noise[at] / noise.std()
    confidence[at] = doubted
    return along, confidence


def test_noise_at_the_border_goes(made: tuple[Scene, EpipolarLines]) -> None:
    pair, lines = made
    at = patch(lines, 0, 14)
    along, confidence = led_astray(lines, at, 0.2)
    found = settled(pair, lines, along, confidence)
    assert np.median(np.abs(found[at])) < 0.2 < 4 < np.median(np.abs(along[at]))
    far = cv2.dilate(at.astype(np.uint8), np.ones((9, 9), np.uint8)) == 0
    assert np.array_equal(found[far], along[far]), "and nothing else changes"


@pytest.mark.parametrize("start, doubted", [(0, 0.95), (WIDTH + 6, 0.2)])
def test_what_is_sure_or_lies_inside_stays(made: tuple[Scene, EpipolarLines], start: int, doubted: float) -> None:
    pair, lines = made
    along, confidence = led_astray(lines, patch(lines, start, start + 14), doubted)
    assert np.array_equal(settled(pair, lines, along, confidence), along)


@pytest.mark.parametrize("side", [-1, 1])
def test_without_texture_a_patch_inside_goes_where_the_field_looks_better(
    made: tuple[Scene, EpipolarLines], side: int
) -> None:
    """However sure it is: its depth is that of what borders it."""
    pair, lines = made
    at = patch(lines, WIDTH + 6, WIDTH + 36)
    along, confidence = led_astray(lines, at, 0.95)
    along[at] = side * 7
    found = settled(pair, lines, along, confidence, plain=at)
    inner = cv2.erode(at.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert np.mean(np.abs(found[inner]) < 0.2) > 0.9, "but for corners of it"
    assert np.array_equal(settled(pair, lines, along, confidence), along), "with texture it stays"


def test_without_texture_a_patch_stays_where_the_field_looks_no_better(made: tuple[Scene, EpipolarLines]) -> None:
    """Of a bare wall nobody sees how deep it is: it goes with its edges."""
    pair, lines = made
    gray = np.full_like(pair.reference, 128)
    at = patch(lines, WIDTH + 6, WIDTH + 36)
    along, confidence = led_astray(lines, at, 0.95)
    bare = replace(pair, reference=gray, target=gray)
    assert np.array_equal(settled(bare, lines, along, confidence, plain=at), along)


def test_without_texture_a_patch_stays_where_the_field_looks_worse(made: tuple[Scene, EpipolarLines]) -> None:
    pair, lines = made
    at = patch(lines, WIDTH + 6, WIDTH + 36)
    along, field = np.zeros(lines.shape, np.float32), np.zeros(lines.shape, np.float32)
    field[at] = 7
    confidence = np.where(at, np.float32(0.95), np.float32(0.2))
    assert np.array_equal(settled(pair, lines, along, confidence, field, plain=at), along)


def test_what_is_right_stays_though_the_field_is_wrong(made: tuple[Scene, EpipolarLines]) -> None:
    """A near thing at the border that the field knows nothing of: the pictures look alike only as it was found."""
    pair, lines = made
    at = patch(lines, 0, 14)
    along, field = np.zeros(lines.shape, np.float32), np.zeros(lines.shape, np.float32)
    confidence = np.full(lines.shape, 0.95, np.float32)
    field[at], confidence[at] = 6.0, 0.2
    # what surrounds it says nothing of it
    confidence[cv2.dilate(at.astype(np.uint8), np.ones((41, 41), np.uint8)) > 0] = 0.2
    assert np.array_equal(settled(pair, lines, along, confidence, field), along)


def test_a_doubtful_patch_gets_what_its_surface_does(made: tuple[Scene, EpipolarLines]) -> None:
    """The field is 5 px off throughout: what surer nodes of the same colour found is nearer to the truth."""
    pair, lines = made
    at = patch(lines, 0, 14)
    along, confidence = led_astray(lines, at, 0.2)
    field = np.full(lines.shape, 5.0, np.float32)
    found = settled(pair, lines, along, confidence, field, np.full_like(pair.reference, 128))
    assert np.median(np.abs(found[at])) < 2.5


def test_without_texture_the_field_stays(made: tuple[Scene, EpipolarLines]) -> None:
    pair, lines = made
    gray = np.full_like(pair.reference, 128)
    bare = replace(pair, reference=gray, target=gray)
    at = patch(lines, 0, 14)
    along, confidence = led_astray(lines, at, 0.0)
    confidence[:] = 0.0
    assert np.median(np.abs(settled(bare, lines, along, confidence)[at])) < 0.1
