"""The poses that a pair's matches allow: where they begin."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.core.rig.averaging import candidates as room
from edf_stitch.core.rig.averaging.matched_rays import SharedLens, matched_rays
from edf_stitch.core.rig.averaging.pairs import verified

from .known_rigs import known_rig


def test_given_rotations_are_tried_with_baselines_all_around(monkeypatch: pytest.MonkeyPatch) -> None:
    rig, matched = known_rig(3)
    world = [rotation_from_vector(np.array([0.3, 0.1 * k, -0.2 * k])) for k in range(3)]
    cameras = [replace(camera, start=R) for camera, R in zip(rig.cameras[:2], world, strict=False)] + [rig.cameras[2]]
    found = verified(matched.points, matched.matches, 1.0, 0)
    rays, ends = matched_rays(cameras, matched.points, found)
    begun: list[Any] = []
    real = room._refined
    monkeypatch.setattr(room, "_refined", lambda *args: begun.extend(args[4]) or real(*args))
    tried = room.candidates(rays, SharedLens(), 1.0, 0)
    for k, poses in zip(tried.numbers, begun, strict=True):
        i, j = ends[k]
        given = sorted((i, j)) == [0, 1]
        turn = world[j] @ world[i].T if given else np.full((3, 3), np.nan)
        near = np.abs(poses.R - turn).max(axis=(1, 2)) < 1e-12
        assert near.sum() == (len(room.DIRECTIONS) if given else 0)
        if given:
            assert np.array_equal(poses.t[near], room.DIRECTIONS)
