"""A mirrored picture is told of, also where a symmetric scene would be stitched with it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pose.mirrored import mirrored_among, unless_mirrored
from edf_stitch.core.pose.options import MIRROR
from edf_stitch.core.system.errors import DegenerateGeometry, NoOverlap


def views(symmetric: bool, mirrored: bool) -> list[Picture]:
    """Two views of a wall with windows, each detail of it beside its mirror image, but for some."""
    rng = np.random.default_rng(3)
    wall = np.full((420, 900, 3), 130, np.uint8)
    for number in range(260):
        x, y, size = rng.integers(0, 440), rng.integers(0, 400), rng.integers(4, 26, 2)
        colour = rng.integers(0, 256, 3).tolist()
        cv2.rectangle(wall, (x, y), (x + size[0], y + size[1]), colour, cv2.FILLED)
        if symmetric and number % 3:
            cv2.rectangle(wall, (899 - x - size[0], y), (899 - x, y + size[1]), colour, cv2.FILLED)
        else:
            x = rng.integers(460, 880)
            cv2.rectangle(wall, (x, y), (x + size[1], y + size[0]), rng.integers(0, 256, 3).tolist(), cv2.FILLED)
    noise = cv2.GaussianBlur(rng.integers(0, 256, wall.shape, np.uint8), (0, 0), 2)
    wall = cv2.addWeighted(wall, 0.9, noise, 0.1, 0)
    corners = np.float32([[0, 0], [900, 0], [900, 420], [0, 420]])
    moved = np.float32([[15, 10], [880, -12], [890, 432], [-10, 410]])
    second = cv2.warpPerspective(wall, cv2.getPerspectiveTransform(corners, moved), (900, 420), borderValue=130)
    return [picture_from_array(one) for one in (wall, second[:, ::-1].copy() if mirrored else second)]


def found(inliers: int) -> Any:
    return SimpleNamespace(edges=(SimpleNamespace(two_view=SimpleNamespace(inliers=np.ones(inliers, bool))),))


@pytest.mark.parametrize("symmetric", [False, True])
def test_a_mirrored_picture_is_refused_with_what_to_do(symmetric: bool) -> None:
    for inliers in (0, MIRROR.enough - 1):
        with pytest.raises(DegenerateGeometry, match="one of the pictures is mirrored.*flip one of them"):
            unless_mirrored(views(symmetric, True), lambda n=inliers: found(n))


@pytest.mark.parametrize("symmetric", [False, True])
def test_one_that_is_not_is_taken(symmetric: bool) -> None:
    assert len(unless_mirrored(views(symmetric, False), lambda: found(100)).edges) == 1


def test_where_much_agrees_nobody_asks() -> None:
    mirrored = views(True, True)
    assert unless_mirrored(mirrored, lambda: found(MIRROR.enough)).edges
    assert unless_mirrored(mirrored, lambda: found(20), by_all=False).edges, "a preview"
    small = [picture_from_array(one.view[:100, :100]) for one in mirrored]
    assert unless_mirrored(small, lambda: found(30)).edges, "as many as a small picture has"


def test_another_reason_stays_what_it_is() -> None:
    def fail() -> Any:
        raise NoOverlap("nothing in common")

    with pytest.raises(NoOverlap, match="nothing in common"):
        unless_mirrored(views(False, False), fail)
    with pytest.raises(DegenerateGeometry, match="mirrored"):
        unless_mirrored(views(False, True), fail)


def test_of_several_the_one_that_is_so_beside_most_is_named() -> None:
    first, mirrored = views(False, True)
    _, second = views(False, False)
    stray = picture_from_array(np.random.default_rng(5).integers(0, 256, first.view.shape, np.uint8))
    pictures = [stray, first, mirrored, second]
    for asked in ([2], [0, 1, 2, 3]):
        found = mirrored_among(pictures, asked)
        assert list(found) == [2] and found[2][0] in (1, 3) and found[2][1] >= MIRROR.least
    assert mirrored_among(pictures, [0]) == {} and mirrored_among([first, second], [0, 1]) == {}
