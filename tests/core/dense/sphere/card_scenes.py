"""A card in front of a wall, both with texture, photographed from several places: pictures, rig and true ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from edf_stitch.core.cameras.lens import undistort
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.cameras.view import View
from edf_stitch.core.pictures.picture import Picture, picture_from_array

from ...field.sphere_scenes import rig_of

WALL, CARD = 16.0, 8.0
HALF = np.array([1.1, 1.4])
"""Half the card's sides."""


def on_card(points: np.ndarray) -> np.ndarray:
    """Whether points (…, 2) of the card's plane lie on it."""
    return (np.abs(points) < HALF).all(axis=-1)


def inverse_range(rays: np.ndarray) -> np.ndarray:
    """True inverse range (…) along rays (…, 3) from the first picture's place, 0 where there is nothing."""
    ahead = np.maximum(rays[..., 2], 1e-3)
    hit = on_card(CARD * rays[..., :2] / ahead[..., None])
    return np.where(rays[..., 2] > 0.05, ahead / np.where(hit, CARD, WALL), 0.0)


def card_rig(count: int = 4, lens: Sequence[float] = (), seed: int = 1) -> Rig:
    """Cameras that look about the same way."""
    return rig_of(np.linspace(0, 9, count), seed, inverse_range, lens=lens, points=30_000)


def texture(seed: int) -> np.ndarray:
    """Colours (1024, 1024, 3), blurred noise of two sizes."""
    random = np.random.default_rng(seed)
    fine, coarse = (random.normal(size=(side, side, 3)).astype(np.float32) for side in (512, 128))
    mixed = cv2.resize(fine, (1024, 1024), interpolation=cv2.INTER_CUBIC)
    mixed += 1.5 * cv2.resize(coarse, (1024, 1024), interpolation=cv2.INTER_CUBIC)
    return np.clip(128 + 40 * mixed, 0, 255)


TEXTURES = texture(0), texture(1)


def photograph(view: View, gain: float = 1.0) -> np.ndarray:
    """What a camera shows (h, w, 3) uint8."""
    width, height = view.size
    pixels = undistort(np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), -1),
                       view.camera)  # fmt: skip
    towards = np.concatenate([pixels, np.ones((height, width, 1))], axis=-1) @ np.linalg.inv(view.K).T @ view.R
    place = -view.R.T @ view.t
    colours = []
    for depth, colour, scale in ((WALL, TEXTURES[0], 22.0), (CARD, TEXTURES[1], 44.0)):
        points = place[:2] + towards[..., :2] * ((depth - place[2]) / towards[..., 2:])
        x, y = np.moveaxis((points * scale + 512).astype(np.float32), -1, 0)
        colours.append((cv2.remap(colour, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), on_card(points)))
    (wall, _), (card, hit) = colours
    return np.clip(np.where(hit[..., None], card, wall) * gain, 0, 255).astype(np.uint8)


def pictures_of(rig: Rig, gains: Sequence[float] = ()) -> list[Picture]:
    """Its pictures, each brighter by its gain."""
    gains = gains or [1.0] * len(rig)
    return [picture_from_array(photograph(view, gain), f"{k}.png")
            for k, (view, gain) in enumerate(zip(rig.views, gains, strict=True))]  # fmt: skip


def from_one_place(rig: Rig) -> Rig:
    """The same as if all had been taken from one place."""
    return replace(rig, t=np.zeros_like(rig.t))
