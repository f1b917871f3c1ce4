"""What a sliding viewpoint uncovers lies as far as what is behind, not as what was in front."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.field.carried_surface import filled_surface
from edf_stitch.core.field.options import CARRY

from ...asked import counting

NEAR, FAR = np.float32(0.07), np.float32(0.03)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("width", [4, 9, 18, 60])
def test_a_gap_beside_a_near_thing_is_filled_from_behind_it(width: int, turned: bool) -> None:
    """However wide: a post, and beside it what it hid from the reference's place."""
    points = np.full((90, 140), FAR, np.float32)
    points[:, 20:40] = NEAR
    points[:, 40 : 40 + width] = -1
    found = filled_surface(points.T.copy() if turned else points)
    found = found.T if turned else found
    # a point covers the cells to its right and below, too
    assert (found[:, 20:41] == NEAR).all() and (found[:, 41:] == FAR).all() and (found[:, :20] == FAR).all()


def test_a_crack_in_a_surface_is_closed_by_the_surface_around() -> None:
    points = np.full((60, 80), FAR, np.float32)
    points[20:40, 20:60] = NEAR
    points[20:40, 38:41] = -1
    found = filled_surface(points)
    assert (found[22:39, 22:59] == NEAR).all()


def test_what_has_no_other_side_goes_on_from_its_own() -> None:
    """Around a near and a far thing, and between the two, further apart than any gap."""
    points = np.full((60, 80 + CARRY.widest_gap_px), -1, np.float32)
    points[10:50, 10:30], points[10:50, -10:] = NEAR, FAR
    with counting() as count:
        found = filled_surface(points)
    assert count["_from_far"] > CARRY.rounds, "it may take long: whether to go on is asked at every round"
    assert (found[:, :10] == NEAR).all() and (found[:, -9:] == FAR).all()
    assert (found[12:48, 32:60] == NEAR).all()
