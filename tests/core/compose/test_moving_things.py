"""Who walked between the pictures is seen at one time: the nearer picture's; what parallax explains, nobody moved."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.seams import moving_things
from edf_stitch.core.compose.seams.moving_things import moving_labels
from edf_stitch.core.compose.seams.overlap import overlap_of
from edf_stitch.core.compose.seams.seam import find_seam, known_labels
from edf_stitch.core.compose.seams.seam_costs import seam_costs
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap

H, W = 240, 400
LEFT, RIGHT = slice(0, 280), slice(120, 400)
NOTHING = np.zeros((H, W), bool)
WALKER, FAR = np.s_[90:150, 240:262], np.s_[90:150, 130:152]


def ground() -> np.ndarray:
    noise = np.random.default_rng(3).random((H, W, 3)).astype(np.float32)
    return 0.3 + 0.2 * cv2.GaussianBlur(noise, (0, 0), 2)


def layer(columns: slice, pixels: np.ndarray) -> Layer:
    alpha = np.zeros((H, W), np.float32)
    alpha[:, columns] = 1
    return Layer(pixels * alpha[..., None], alpha)


def flat() -> PictureMap:
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    return PictureMap(x, y, (W, H))


def found(
    reference: np.ndarray, target: np.ndarray, hidden: np.ndarray = NOTHING, picture_map: PictureMap | None = None
) -> np.ndarray:
    """The times on the whole canvas."""
    first, second = layer(LEFT, reference), layer(RIGHT, target)
    overlap = overlap_of(first, second, hidden)
    assert overlap is not None
    out = np.zeros((H, W), np.int8)
    out[overlap.box] = moving_labels(overlap, picture_map or flat(), first, second, hidden)
    return out


@pytest.mark.parametrize("across", [1000, 120])
def test_who_moved_belongs_to_the_picture_that_is_alone_nearer_by(across: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moving_things, "MOVING_THINGS", replace(moving_things.MOVING_THINGS, side_cells=across))
    reference, target = ground(), ground()
    reference[WALKER], target[FAR] = 0.02, 0.9
    when = found(reference, target)
    assert (when[WALKER] == 1).mean() > 0.95 and (when[FAR] == -1).mean() > 0.95
    assert (when != 0).sum() < 2 * 72 * 34, "and nothing further than 6 px off did"


def test_legs_are_not_moved_without_the_body() -> None:
    """The belt looks like the ground behind it, and a shadow lies around the body in one of the pictures."""
    reference, target = ground(), ground()
    reference[80:115, 225:277] *= 0.6
    legs, body = np.s_[130:160, 240:262], np.s_[90:110, 240:262]
    for part in (legs, body):
        reference[part] = 0.02
    when = found(reference, target)
    assert (when[legs] != 0).mean() == pytest.approx((when[body] != 0).mean(), abs=0.1)


def test_who_moved_where_the_added_picture_shows_nothing_alone_belongs_to_what_does() -> None:
    reference, target = ground(), ground()
    reference[WALKER], target[FAR] = 0.02, 0.9
    first, second = layer(slice(0, W), reference), layer(RIGHT, target)
    overlap = overlap_of(first, second, NOTHING)
    assert overlap is not None
    when = moving_labels(overlap, flat(), first, second, NOTHING)
    assert (when == -1).sum() > 2 * 50 * 18 and not (when == 1).any()


def test_who_walks_out_of_the_reference_is_seen_once() -> None:
    """He stands in the overlap in the reference, beyond it in the target; the cheapest cut alone shows both."""
    reference, target = ground(), ground()
    reference[WALKER] = 0.02
    target[90:150, 300:322] = 0.02
    first, second = layer(LEFT, reference), layer(RIGHT, target)
    overlap = overlap_of(first, second, NOTHING)
    assert overlap is not None
    known, when = known_labels(first, second), moving_labels(overlap, flat(), first, second, NOTHING)
    alone, together = (
        find_seam(known, seam_costs(overlap, flat(), None, NOTHING, given)) for given in (None, when)
    )
    assert not alone[WALKER].any() and together[WALKER].all()


def test_what_parallax_hides_did_not_move() -> None:
    """A strip beside a near thing, as wide as that is nearer; or known to be hidden."""
    reference, target = ground(), ground()
    strip = np.s_[90:150, 230:242]
    reference[strip] = 0.02
    jump = flat()
    jump.x[:, 242:] += 12
    assert not found(reference, target, picture_map=jump).any()
    hidden = NOTHING.copy()
    hidden[strip] = True
    assert not found(reference, target, hidden).any()
    assert found(reference, target)[strip].any()


def test_leaves_light_and_large_parts_are_no_things() -> None:
    rng = np.random.default_rng(1)
    leaves = ground()
    leaves[:, 120:280] = cv2.resize(rng.random((60, 40, 3)).astype(np.float32), (160, H))
    assert not found(leaves, ground()).any()
    assert not found(ground(), 1.3 * ground()).any()
    half = ground()
    half[:, 160:280] = 0.9
    assert not found(half, ground()).any()
