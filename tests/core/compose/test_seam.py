"""The seam goes where nobody looks: around what differs, never through what is settled, at any size in bounded time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.compose.seams import seam
from edf_stitch.core.compose.seams.min_cut import FIRST, FREE, NOWHERE, SECOND
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.compose.seams.seam import find_seam, known_labels
from edf_stitch.core.compose.seams.seam_costs import seam_costs
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap

H, W = 200, 300
LEFT, RIGHT = slice(0, 220), slice(80, 300)
NOTHING = np.zeros((H, W), bool)


def layer(columns: slice, pixels: np.ndarray) -> Layer:
    out, alpha = np.zeros((H, W, 3), np.float32), np.zeros((H, W), np.float32)
    out[:, columns], alpha[:, columns] = pixels[:, columns], 1
    return Layer(out, alpha)


def gray() -> np.ndarray:
    return np.full((H, W, 3), 0.3, np.float32)


def flat_map(x: np.ndarray | None = None) -> PictureMap:
    """The identity, or with another x."""
    plain, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    return PictureMap(plain if x is None else x, y, (W, H))


def cut(first: Layer, second: Layer, hidden: np.ndarray = NOTHING, painted: np.ndarray | None = None,
        x: np.ndarray | None = None, confidence: np.ndarray | None = None) -> np.ndarray:
    overlap = overlap_of(first, second, hidden)
    assert overlap is not None
    return find_seam(known_labels(first, second, painted), seam_costs(overlap, flat_map(x), confidence, hidden))


def borders(labels: np.ndarray) -> np.ndarray:
    out = np.zeros(labels.shape, bool)
    out[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    out[:-1] |= labels[1:] != labels[:-1]
    return out


@pytest.fixture(params=["whole", "in bands"], autouse=True)
def coarse(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """The same must hold whether the cut is made at once or from a coarse one."""
    if request.param == "in bands":
        monkeypatch.setattr(seam, "SEAM", replace(seam.SEAM, coarse_cells=500))
    return str(request.param)


def test_each_picture_keeps_what_only_it_shows() -> None:
    labels = cut(layer(LEFT, gray()), layer(RIGHT, gray()))
    assert labels.dtype == bool and not labels[:, :80].any() and labels[:, 220:].all()
    assert borders(labels).sum() == H, "straight where all is alike"


def test_it_goes_round_what_only_one_of_them_shows() -> None:
    person = gray()
    person[60:200, 170:219] = 0.9  # stands where the reference ends, to the bottom
    person[120:200, 100:170] = 0.9
    labels = cut(layer(LEFT, person), layer(RIGHT, gray()))
    inside = np.zeros((H, W), bool)
    inside[60:200, 170:219] = inside[120:200, 100:170] = True
    inside[:, 215:] = False
    crossed = borders(labels)[inside].sum()
    assert crossed <= 5, "whole or not at all"


def test_it_crosses_where_the_pictures_agree_best() -> None:
    other = gray()
    other[:, :136], other[:, 152:] = 0.5, 0.8
    labels = cut(layer(LEFT, gray()), layer(RIGHT, other))
    assert (np.abs((~labels).sum(axis=1) - 144) <= 8).all()


def test_what_the_target_cannot_see_comes_from_the_reference() -> None:
    hidden = NOTHING.copy()
    hidden[50:90, 100:210] = True
    assert not cut(layer(LEFT, gray()), layer(RIGHT, gray()), hidden)[hidden].any()


def test_what_is_hidden_and_thin_is_patched_where_it_shows() -> None:
    """Among what comes from the target: a wire is patched, a pixel is not, whose patch's border would show more."""
    other, hidden, painted = gray(), NOTHING.copy(), np.ones((H, W), np.int8)
    wire, speck = np.s_[40:160, 140:144], np.s_[100:101, 180:181]
    for place in (np.s_[30:170, 125:160], np.s_[80:120, 165:195]):
        painted[place], other[place] = 0, 0.5
    for place in (wire, speck):
        hidden[place], other[place] = True, 0.9
    labels = cut(layer(LEFT, gray()), layer(RIGHT, other), hidden, painted)
    assert not labels[wire].any() and labels[speck].all()


@pytest.mark.parametrize("size", [1, 2])
def test_the_reference_keeps_what_it_can_at_every_size(size: int) -> None:
    """Of the overlap little is given up to cross where the pictures agree better, and half of it only for more than
    blending evens out; a preview decides as the whole picture does."""
    for agree, tone, kept in ((slice(185, 201), 0.35, 201), (slice(100, 116), 0.35, 218), (slice(100, 116), 0.5, 116)):
        other = np.full((H, W, 3), tone, np.float32)
        other[:, agree] = 0.3
        pair = [Layer(np.kron(part.pixels, np.ones((size, size, 1), np.float32)), np.kron(part.alpha, np.ones(
            (size, size), np.float32))) for part in (layer(LEFT, gray()), layer(RIGHT, other))]  # fmt: skip
        nothing = np.zeros(pair[0].alpha.shape, bool)
        overlap = overlap_of(pair[0], pair[1], nothing)
        assert overlap is not None
        x, y = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in nothing.shape[::-1]))
        costs = seam_costs(overlap, PictureMap(x, y, nothing.shape[::-1]), None, nothing)
        found = (~find_seam(known_labels(*pair), costs)).sum(axis=1)
        assert (np.abs(found - size * kept) <= 3 * size).all()


def test_the_artist_has_the_last_word() -> None:
    painted, hidden = np.zeros((H, W), np.int8), NOTHING.copy()
    painted[20:60, 100:140], painted[100:150, 180:215] = 1, -1
    hidden[30:50, 100:140] = True
    labels = cut(layer(LEFT, gray()), layer(RIGHT, gray()), hidden, painted)
    assert labels[20:60, 100:140].all() and not labels[100:150, 180:215].any()
    beyond = np.full((H, W), -1, np.int8)
    assert cut(layer(LEFT, gray()), layer(RIGHT, gray()), painted=beyond)[:, 220:].all(), "paint shows nothing new"


def test_it_keeps_away_from_edges_of_depth_and_from_doubt() -> None:
    x, _ = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    jumpy = x.copy()
    jumpy[:, 205:220:4] += 20
    confidence = np.ones((H, W), np.float32)
    confidence[:, 190:] = 0
    other = gray() + np.float32(0.1)
    for warp, most in (({"x": jumpy}, 207), ({"confidence": confidence}, 192)):
        assert ((~cut(layer(LEFT, gray()), layer(RIGHT, other), **warp)).sum(axis=1) <= most).all()
        alike = cut(layer(LEFT, gray()), layer(RIGHT, gray()), **warp)
        assert ((~alike).sum(axis=1) == 216).all(), "where nothing differs, any place but the very rim will do"


def test_soft_edges_give_way_to_what_is_whole() -> None:
    first, second = layer(LEFT, gray()), layer(RIGHT, gray())
    first.alpha[:, 150:220], second.alpha[:40] = 0.5, 0
    known = known_labels(first, second)
    assert (known[40:, 150:] == SECOND).all() and (known[:40, :220] == FIRST).all()
    assert (known[:40, 220:] == NOWHERE).all() and (known[40:, 80:150] == FREE).all()


def test_holes_and_islands_of_one_picture() -> None:
    first, second = layer(LEFT, gray()), layer(slice(80, 200), gray())
    first.alpha[90:97, 120:127] = 0
    labels = cut(first, second)
    assert labels[90:97, 120:127].all()
    assert labels[:, :200].sum() < 300, "a target inside the reference shows nothing but what it alone has"


def test_a_reference_inside_the_target_does_not_vanish() -> None:
    first, second = layer(slice(60, 240), gray()), layer(slice(0, 300), gray())
    first.alpha[:30] = first.alpha[170:] = 0
    labels = cut(first, second)
    assert not labels[80:120, 110:190].any() and labels[first.alpha == 0].all()


def test_pieces_at_many_places_stay_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """More border than any band may hold: then the coarse labels stay, and what is settled is still right."""
    monkeypatch.setattr(seam, "SEAM", replace(seam.SEAM, coarse_cells=50, band_pixels=50))
    painted = np.where(np.random.default_rng(0).random((H, W)) < 0.02, 1, 0).astype(np.int8)
    labels = cut(layer(LEFT, gray()), layer(RIGHT, gray()), painted=painted)
    assert labels[:, 220:].all() and not labels[:, :80].any()
    assert labels[(painted > 0) & (np.arange(W) >= 80)].all()
