"""Figures of pictures that a program has placed: each moves when what it measures is spoilt."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.measure.placed.keep import keep_figures
from edf_stitch.core.measure.placed.off_lines import off_line_figures
from edf_stitch.core.measure.placed.overlaps import gained_figures, plain_figures
from edf_stitch.core.measure.placed.placed import PlacedPicture, PlacedSet, shrunk, union
from edf_stitch.core.measure.placed.straightness import line_figures
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.raster.picture_map import PictureMap

SIZE = (400, 300)
SHIFT = 160
CANVAS = (SIZE[0] + SHIFT, SIZE[1])
FOCAL = 500.0


def world(shift: int) -> np.ndarray:
    """A part (H, W, 3) uint8 of a plane with blotches and straight lines, from x = shift on."""
    random = np.random.default_rng(3)
    plane = cv2.resize(random.normal(140, 15, (30, 56, 3)), CANVAS, interpolation=cv2.INTER_CUBIC)
    for k in range(12):  # far darker than what they lie on, or they are found in pieces
        cv2.line(plane, (20 + 45 * k, 10), (55 + 43 * k, 280), (5,) * 3, 4)
    return np.clip(plane, 5, 200).astype(np.uint8)[:, shift : shift + SIZE[0]]


PICTURES = [replace(picture_from_array(world(shift)), name=name) for shift, name in ((0, "a"), (SHIFT, "b"))]


def placed_at(
    off: float = 0.0, gain: float = 1.0, bend: float = 0.0, where: tuple[float, float] = (0, SIZE[0])
) -> PlacedSet:
    """Both pictures on a plane; of the second what it shows is off by px, brighter, and bent by px in its middle, where
    its columns lie between two."""
    pictures = []
    for picture, shift in zip(PICTURES, (0, SHIFT), strict=True):
        y, x = np.mgrid[: SIZE[1], : SIZE[0]].astype(np.float32)
        if shift:
            bent = np.where((x >= where[0]) & (x < where[1]), bend * np.sin(np.pi * y / SIZE[1]), 0)
            x = x + np.float32(off) + bent.astype(np.float32)
        found = PictureMap(x, y, SIZE)
        colours = cv2.remap(picture.view, x, y, cv2.INTER_LINEAR)
        colours = np.clip(colours * (gain if shift else 1.0), 0, 255).astype(np.uint8)
        pictures.append(PlacedPicture.cut_out(picture.name, colours, found.inside(), found, (shift, 0)))

    def rays_at(at: np.ndarray) -> np.ndarray:
        rays = np.column_stack([(at - np.array(CANVAS) / 2) / FOCAL, np.ones(len(at))])
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    return PlacedSet(CANVAS, tuple(pictures), rays_at, union(CANVAS, pictures), FOCAL)


def test_a_gain_is_taken_out_and_a_shift_is_not() -> None:
    right, brighter, shifted = (gained_figures(placed_at(**change)) for change in ({}, {"gain": 1.2}, {"off": 3.0}))
    assert right["used"] == 2 and right["overlaps"] == 1 and right["gained_ssim"] == pytest.approx(1)
    assert brighter["gained_psnr_db"] > 40 and brighter["gained_ssim"] > 0.98
    assert shifted["gained_psnr_db"] < 35 and shifted["gained_ssim"] < 0.97
    assert right["gained_ssim_worst"] == right["gained_ssim"]
    assert plain_figures(placed_at(gain=1.2))["overlap_psnr_db"] < 30, "exposure is in it"


def test_pictures_that_share_little_are_not_compared() -> None:
    far = placed_at()
    alone = replace(far.pictures[1], corner=(SIZE[0] - 4, 0))
    figures = gained_figures(replace(far, pictures=(far.pictures[0], alone), size=(2 * SIZE[0], SIZE[1])))
    assert figures["overlaps"] == 0 and np.isnan(figures["gained_ssim"])


def test_lines_that_a_map_bends_are_found_where_it_bends_them() -> None:
    right, bent = (line_figures(placed_at(bend=bend), PICTURES) for bend in (0.0, 8.0))
    assert right["bent_px"] < 0.1 and right["lines"] > 10 and right["lines_alone"] >= 5
    # 8 px of the middle of a line is 5 off the straight line through it, at 500 px per radian, and so 9 at 900
    assert 2 < bent["bent_px"] < 15 and 2 < bent["bent_alone_px"] < 15
    both, alone = (line_figures(placed_at(bend=8.0, where=part), PICTURES) for part in ((0, 200), (240, 400)))
    assert both["bent_alone_px"] < 0.1 < 2 < both["bent_px"] and alone["bent_alone_px"] > 2
    assert np.isnan(line_figures(replace(placed_at(), rays_at=None), PICTURES)["bent_px"])


def test_what_is_off_the_epipolar_lines_is_measured_across_them() -> None:
    across = np.array([[0.0, 0, 1], [0, 0, 0], [-1, 0, SHIFT]])  # x' = x − SHIFT: upright lines
    found = off_line_figures(placed_at(off=3.0), PICTURES, lambda one, other: across)
    assert found["off_lines_px"] == pytest.approx(3.0, abs=0.05)
    unknown = off_line_figures(placed_at(), PICTURES, lambda one, other: np.full((3, 3), np.nan))
    assert np.isnan(unknown["off_lines_px"])


def test_gaps_holes_folds_and_enlargements_are_counted() -> None:
    right = keep_figures(placed_at())
    assert right["fill"] == right["inscribed"] == 1 and right["holes"] == right["turned_over"] == 0
    assert right["far_enlarged"] == pytest.approx(1, abs=1e-3)
    panorama = placed_at()
    alpha = panorama.alpha.copy()
    alpha[100:130, 200:240] = False
    holed = keep_figures(replace(panorama, alpha=alpha))
    share = 30 * 40 / alpha.size
    assert holed["holes"] == pytest.approx(share) and holed["fill"] == pytest.approx(1 - share)
    assert holed["inscribed"] < 0.7
    one, two = panorama.pictures
    assert two.map is not None
    x = two.map.x.copy()
    x[:, 350:] = x[:, 350:350 + 1] - (np.arange(x.shape[1] - 350) * 0.25).astype(np.float32)
    spoilt = replace(panorama, pictures=(one, replace(two, map=replace(two.map, x=x))))
    assert keep_figures(spoilt)["turned_over"] > 0.02 and keep_figures(spoilt)["far_enlarged"] > 1.5


def test_a_shrunk_picture_keeps_its_colours_at_the_rim() -> None:
    shows = np.zeros((90, 120), bool)
    shows[9:70, 10:100] = True
    colours = np.where(shows[..., None], 200, 0).astype(np.uint8).repeat(3, axis=2)
    found = PictureMap(*(np.mgrid[:90, :120][::-1].astype(np.float32)), (120, 90))
    small, there, coarse = shrunk(colours, shows, found, (40, 30))
    assert coarse is not None and (small[there] == 200).all()
    assert 19 * 28 <= there.sum() <= 21 * 31 and coarse.x[10, 20] == pytest.approx(61, abs=0.6)
