"""From pictures to their rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from edf_stitch.core.cameras.bodies import Bodies
from edf_stitch.core.cameras.sources import CameraRequest, cameras_for
from edf_stitch.core.pictures.picture import Picture
from edf_stitch.core.rig.from_pictures import content_order, matched_pictures, registered
from edf_stitch.core.system.cache import Cache

from ...sets import FOCAL, make_set


def test_a_mirrored_picture_is_left_out_and_called_so() -> None:
    pictures: list[Picture] = list(make_set(3).pictures)
    pictures[2] = replace(pictures[2], view=np.ascontiguousarray(pictures[2].view[:, ::-1]))
    names, sizes = [one.name for one in pictures], [one.view.shape[1::-1] for one in pictures]
    cameras, _ = cameras_for(CameraRequest(focal_px=(FOCAL,)), names, sizes, [one.exif for one in pictures])
    order, cache = content_order(pictures), Cache(None)
    matched = matched_pictures(pictures, order, Bodies.alone(len(pictures)), False, cache, lambda *_: None)
    found = registered(pictures, order, cameras, matched, 0, cache, lambda *_: None)
    assert sorted(found.numbers) == [0, 1] and list(found.left_out) == [2]
    assert "it is mirrored" in found.left_out[2] and "points of 2.png" in found.left_out[2]
