"""A seam is priced by what the eye sees: in cells of the picture's size, away from rims, around what moved."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.compose.seams.seam import find_seam, known_labels
from edf_stitch.core.compose.seams.seam_costs import averaged_costs, means, seam_costs
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap

H, W = 200, 300
LEFT, RIGHT = slice(0, 220), slice(80, 300)
NOTHING = np.zeros((H, W), bool)


def layer(columns: slice, pixels: np.ndarray) -> Layer:
    out, alpha = np.zeros(pixels.shape, np.float32), np.zeros(pixels.shape[:2], np.float32)
    out[:, columns], alpha[:, columns] = pixels[:, columns], 1
    return Layer(out, alpha)


def gray(size: int = 1) -> np.ndarray:
    return np.full((size * H, size * W, 3), 0.3, np.float32)


def cut(first: Layer, second: Layer, painted: np.ndarray | None = None, size: int = 0, **more: np.ndarray | None
        ) -> np.ndarray:  # fmt: skip
    """Where the panorama comes from the second; size: px of the added picture's longer side, by default the canvas's.
    """
    overlap = overlap_of(first, second, np.zeros(first.alpha.shape, bool))
    assert overlap is not None
    height, width = first.alpha.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    hidden = more.pop("hidden", None)
    costs = seam_costs(
        overlap, PictureMap(x, y, (size or width, height)), None,
        np.zeros(first.alpha.shape, bool) if hidden is None else hidden, **more,
    )  # fmt: skip
    return find_seam(known_labels(first, second, painted), costs)


def borders(labels: np.ndarray) -> np.ndarray:
    out = np.zeros(labels.shape, bool)
    out[:, :-1] |= labels[:, 1:] != labels[:, :-1]
    out[:-1] |= labels[1:] != labels[:-1]
    return out


def test_cost_is_high_where_tones_or_gradients_differ() -> None:
    random = np.random.default_rng(0)
    other = gray()
    other[50:100, 100:150] += 0.2
    other[120:160, 100:150] += random.normal(0, 0.05, (40, 50, 3)).astype(np.float32)
    overlap = overlap_of(layer(LEFT, gray()), layer(RIGHT, other), NOTHING)
    assert overlap is not None
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    (cost,) = seam_costs(overlap, PictureMap(x, y, (W, H)), None, NOTHING).levels
    quiet = cost[:40, 5:-5].mean()
    assert cost.shape == overlap.both.shape and (cost >= 0).all() and (cost <= 1).all()
    assert cost[55:95, 25:65].mean() > 10 * quiet and cost[125:155, 25:65].mean() > 10 * quiet


def test_texture_that_is_a_pixel_off_does_not_send_the_seam_through_a_leg() -> None:
    """At full size the leg, which is smooth, is cheaper to cross than gravel all around it."""
    random = np.random.default_rng(3)
    reference = gray(4) + random.normal(0, 0.15, (4 * H, 4 * W, 1)).astype(np.float32)
    target = np.roll(reference, 1, axis=1)
    leg = np.s_[:, 500:700]
    reference[leg], target[leg] = 0.25, 0.45
    labels = cut(layer(slice(0, 880), reference), layer(slice(320, 1200), target), size=1800)
    assert not borders(labels)[leg][:, 4:-4].any()
    at_full_size = cut(layer(slice(0, 880), reference), layer(slice(320, 1200), target), size=400)
    assert borders(at_full_size)[leg].any(), "or the test tells nothing"


def test_the_seam_keeps_off_the_rim_where_it_may() -> None:
    labels = cut(layer(LEFT, gray()), layer(RIGHT, gray()))
    assert 215 <= (~labels).sum(axis=1).max() < 220


def test_a_sliding_viewpoint_puts_the_seam_where_both_are_equally_near() -> None:
    """At its own end each picture is exact, so it is shown there."""
    slide = np.broadcast_to(np.clip((np.arange(W) - 80) / 140, 0, 1).astype(np.float32), (H, W))
    labels = cut(layer(LEFT, gray()), layer(RIGHT, gray()), slide=slide)
    assert (np.abs((~labels).sum(axis=1) - 150) <= 10).all()
    half = cut(layer(LEFT, gray()), layer(RIGHT, gray()), slide=slide / 2)
    assert (~half).sum(axis=1).min() > 200, "a viewpoint that goes half the way stays nearer to the reference"


def moved() -> tuple[Layer, Layer, np.ndarray, tuple[slice, slice]]:
    """A person who stands in the reference only, to the bottom; labels in the overlap's box, from which picture he is
    to be shown; his place."""
    reference, place = gray(), np.s_[60:200, 120:180]
    reference[place] = 0.45
    labels = np.zeros((H, 140), np.int8)
    labels[60:200, 40:100] = -1
    return layer(LEFT, reference), layer(RIGHT, gray()), labels, place


def test_a_person_is_whole_or_not_there() -> None:
    first, second, labels, place = moved()
    assert not cut(first, second, moving=labels)[place].any()
    assert cut(first, second, moving=-labels)[place].all()
    # settled below, free above: he is not cut at the border of what is settled, but shown as far as that allows
    painted = np.zeros((H, W), np.int8)
    painted[150:, :] = 1
    found = cut(first, second, painted, moving=labels)
    assert found[150:, 80:].all(), "the artist has the last word"
    assert not borders(found)[62:146, 122:178].any()


def priced(**more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a seam costs, and the price of the second picture, which is lighter in one half."""
    other = gray()
    other[:100] = 0.5
    overlap = overlap_of(layer(LEFT, gray()), layer(RIGHT, other), NOTHING)
    assert overlap is not None
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    costs = seam_costs(overlap, PictureMap(x, y, (W, H)), None, **{"hidden": NOTHING, **more})
    return costs.levels[0], costs.price


def test_no_seam_goes_through_what_moved() -> None:
    assert (priced(moving=moved()[2])[0][60:200, 40:100] == 1).all()


def test_what_cannot_be_seen_costs_more_the_more_it_differs() -> None:
    plain, hidden, behind = priced()[1], priced(hidden=~NOTHING)[1], priced(behind=~NOTHING)[1]
    assert (hidden[:100] > hidden[100:]).all() and (hidden > plain).all()
    assert (behind[:100] < behind[100:]).all() and (behind < plain).all()


def test_what_one_picture_cannot_see_comes_from_the_other() -> None:
    place = NOTHING.copy()
    place[50:90, 100:210] = True
    other = gray()
    other[place] = 0.5
    assert not cut(layer(LEFT, gray()), layer(RIGHT, other), hidden=place)[place].any()
    place[:, 200:] = False
    assert cut(layer(LEFT, gray()), layer(RIGHT, other), behind=place)[place].all()


def test_what_is_placed_better_is_shown() -> None:
    """The seam runs where the added picture begins to be placed better than the panorama before."""
    both = layer(LEFT, gray()), layer(RIGHT, gray())
    across = np.zeros((H, W), np.float32)
    across[:] = np.linspace(20, -20, W)  # px, equal in the middle
    seam = np.flatnonzero(borders(cut(*both, misplaced=across)).any(axis=0))
    assert np.abs(seam - W / 2).max() <= 3
    far = [priced(misplaced=np.full((H, W), px, np.float32))[1].mean() for px in (0, 1, 2, 40, 80)]
    assert far[2] - far[1] == pytest.approx(far[1] - far[0], rel=1e-3) and far[1] > far[0]
    assert far[3] == far[4] > far[2], "beyond some px neither fits"


def test_frames_of_a_clip_share_the_mean_of_their_costs() -> None:
    overlap = overlap_of(layer(LEFT, gray()), layer(RIGHT, gray()), NOTHING)
    assert overlap is not None
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    one = seam_costs(overlap, PictureMap(x, y, (900, H)), None, NOTHING)
    other = seam_costs(overlap, PictureMap(x, y, (900, H)), None, ~NOTHING)
    both = averaged_costs([one, other])
    assert len(both.levels) == 2 and both.box == one.box
    assert np.allclose(both.price, (one.price + other.price) / 2) and not np.allclose(both.price, one.price)


def test_cells_are_means_of_all_their_pixels() -> None:
    values = np.arange(30, dtype=np.float32).reshape(5, 6)
    cells = means(values, 4)
    assert cells.shape == (2, 2) and cells[0, 0] == values[:4, :4].mean()
    assert np.isclose(cells[1, 1], values[4:, 4:].sum() / 16), "beyond the edges there is 0"
