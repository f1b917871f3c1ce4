"""Blocks that two layers share: where they lie, what they hold, and what is clipped in one alone."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.compose.options import EXPOSURE
from edf_stitch.core.compose.tone.tone_blocks import shared_blocks
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.raster.picture_map import PictureMap

H, W = 120, 200
PX = EXPOSURE.block_px


def layer(light: np.ndarray, columns: slice = slice(None)) -> Layer:
    alpha = np.zeros((H, W), np.float32)
    alpha[:, columns] = 1
    return Layer(light.astype(np.float32), alpha)


def test_blocks_tell_where_they_lie_in_either_picture() -> None:
    """In a picture that is shown half as large and moved, too."""
    light = np.full((H, W, 3), 0.5)
    blocks = shared_blocks(layer(light, slice(40, W)), layer(light), np.zeros((H, W), bool), (False, False))
    assert blocks is not None and blocks.at.min(axis=0).tolist() == [0, 5] and len(blocks) == 15 * 20
    x, y = np.meshgrid(np.arange(W, dtype=np.float32), np.arange(H, dtype=np.float32))
    picture = PictureMap(2 * x - 30, 2 * y + 10, (400, 300))
    row, column = blocks.at.T
    across, down = 2 * (PX * column + PX / 2) - 30 - 399 / 2, 2 * (PX * row + PX / 2) + 10 - 299 / 2
    corner = (399 / 2) ** 2 + (299 / 2) ** 2
    assert blocks.radii(picture) == pytest.approx(np.minimum(1, (across**2 + down**2) / corner), abs=1e-5)


def test_what_is_clipped_in_one_alone_is_counted_and_left_out() -> None:
    first, second = np.full((2, H, W, 3), 0.5)
    first[:30, :, 2] = second[20:40] = 1.0
    blocks = shared_blocks(layer(first), layer(second), np.zeros((H, W), bool), (False, False))
    assert blocks is not None and blocks.overexposed == (20 / H, 10 / H) and len(blocks) == 25 * 10
    assert (blocks.means[0] == 0.5).all() and (blocks.means[1] == 0.5).all()
    floats = shared_blocks(layer(first), layer(second), np.zeros((H, W), bool), (True, True))
    assert floats is not None and floats.overexposed == (0, 0) and len(floats) == 25 * 15


def test_layers_that_do_not_meet_share_none() -> None:
    light = np.full((H, W, 3), 0.5)
    apart = layer(light, slice(0, 50)), layer(light, slice(50, W))
    assert shared_blocks(*apart, np.zeros((H, W), bool), (False, False)) is None
    assert shared_blocks(layer(light), layer(light), np.ones((H, W), bool), (False, False)) is None
