"""How far the viewpoint slides: each thing that an artist sees has a say, and nothing slides for nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.view import View, views_of
from edf_stitch.core.panorama import choosing_slide
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.choosing_slide import SlideChoice, choose_slide
from edf_stitch.core.panorama.options import CHOICE
from edf_stitch.core.panorama.projection import round_projection
from edf_stitch.core.panorama.upright_edges import StraightEdges
from edf_stitch.core.panorama.viewpoint import viewpoint_between
from edf_stitch.core.panorama.warp import Warp
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.core.system.errors import Cancelled

from ...pairs import own_map

SIZE, FOCAL = (320, 240), 300.0
PLACE = np.array([1.0, 0, 0.001])
DOWN = np.array([0.0, 1.0, 0.0])
Seam = Callable[[Warp], float]


def steady(warp: Warp) -> float:
    return 0.0


def better_far(px: float) -> Seam:
    """So many px of seam less at the end of the way."""
    return lambda warp: px * (1 - slid(warp))


def choice_for(base: Warp, views: tuple[View, ...], *given: Any) -> SlideChoice:
    viewpoint = viewpoint_between(base, views)
    assert viewpoint is not None
    return choose_slide(base, views, viewpoint, *given)


def slid(warp: Warp) -> float:
    return 0.0 if warp.viewpoint is None else warp.viewpoint.s1


def rig(by_hand: SimpleNamespace, depth: Callable, turn: float = 28.0) -> tuple[Warp, tuple[View, ...]]:
    """Two cameras side by side, the target on the right, turned to the right, and the panorama of depth(heading, rise):
    d along rays of that heading and tan of elevation."""
    camera = by_hand.camera(SIZE, FOCAL)
    first, second = views_of(by_hand.view(camera, camera, (0, -turn, 0), (-1.0, 0, 0)), (camera, camera))
    t = -second.R @ PLACE
    views = first, replace(second, t=t, e_prime=second.K @ t)
    projection = replace(round_projection("cylindrical", views[0].K, np.eye(3)), focal=CHOICE.base_px_per_radian)
    canvas = Canvas(840, 400, (420, 200), projection=projection)
    heading, rise = np.meshgrid(canvas.xs / projection.focal, canvas.ys / projection.focal)
    d = depth(heading, rise)
    a, b, c = (
        far + d * towards for far, towards in zip(
            canvas.project_rows(views[1].H_inf, canvas.xs, canvas.ys), views[1].e_prime, strict=True
        )
    )  # fmt: skip
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = (np.where(c > 1e-6, v / c, np.nan).astype(np.float32) for v in (a, b))
    return Warp(canvas, (own_map(canvas, camera), PictureMap(x, y, SIZE)), d.astype(np.float32)), views


def lines(*ends: tuple[tuple[float, float, float], tuple[float, float, float]]) -> list[StraightEdges]:
    """Straight lines in space, as the reference and as the target see them."""
    found = np.array(ends)
    lengths = np.full(len(found), 0.2)
    return [StraightEdges(found - place, lengths) for place in (np.zeros(3), PLACE)]


NONE = [StraightEdges(np.zeros((0, 2, 3)), np.zeros(0))] * 2


def wall(heading: np.ndarray, rise: np.ndarray) -> np.ndarray:
    """z = 4."""
    return np.cos(heading) / np.hypot(1, rise) / 4


def beyond(heading: np.ndarray) -> np.ndarray:
    """Radians beyond what the reference shows."""
    return np.maximum(0, heading - np.arctan(SIZE[0] / 2 / FOCAL))


def chosen_without(monkeypatch: pytest.MonkeyPatch, price: str, choose: Callable[[], SlideChoice]) -> float:
    """The choice if this price were nothing."""
    with monkeypatch.context() as patch:
        patch.setattr(choosing_slide, "CHOICE", replace(CHOICE, **{price: 0.0}))
        return choose().s1


def test_long_lines_across_a_wall_keep_it_where_it_is(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, wall)
    # aslant: those along the way from one camera to the other stay straight in any case
    edges = lines(*(((1.1, y, 4.0), (1.9, y + 0.5, 4.0)) for y in (-1.3, -0.9, 0.1, 0.6)))
    choice = choice_for(base, views, edges, DOWN, better_far(20))
    assert choice.s1 == 0 and choice.costs[0].bend_px < 0.05, "the wall's own depth keeps them straight"
    bends = [one.bend_px for one in choice.costs]
    assert bends == sorted(bends) and bends[-1] > 1
    assert choice_for(base, views, NONE, DOWN, better_far(20)).s1 == 1, "without lines nothing holds it"


def test_uprights_that_lean_beyond_the_overlap_are_put_right(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a plane that comes nearer towards the ground, where truly there is a wall
    base, views = rig(by_hand, lambda heading, rise: 0.05 + 0.6 * beyond(heading) * np.clip(rise + 0.5, 0, 1))
    edges = lines(*(((x, -2.0, 9.0), (x, 2.0, 9.0)) for x in (8.0, 8.5, 9.0, 9.5)))

    def choose() -> SlideChoice:
        return choice_for(base, views, edges, DOWN, steady)

    choice = choose()
    assert choice.s1 == 1 and choice.costs[0].lean_deg > 1 and choice.costs[-1].lean_deg < 0.2
    monkeypatch.setattr(choosing_slide, "CHOICE", replace(CHOICE, max_bend_px=0.0, per_enlarged=0.0))
    assert choose().s1 == 1
    assert choice_for(base, views, edges, None, steady).s1 == 0, "who knows no down knows no lean"


def test_what_would_be_enlarged_beyond_the_overlap_is_shown_as_it_was_taken(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    base, views = rig(by_hand, lambda heading, rise: 0.05 + 0.6 * beyond(heading))

    def choose() -> SlideChoice:
        return choice_for(base, views, NONE, DOWN, steady)

    choice = choose()
    assert choice.s1 > 0 and choice.costs[0].enlarged > 0.03
    assert next(one for one in choice.costs if one.s1 == choice.s1).enlarged < 0.005
    assert chosen_without(monkeypatch, "per_enlarged", choose) == 0


def test_a_slide_that_folds_or_stretches_is_out_of_the_question(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    # from the right the target looks far to the left: the way goes against the parallax
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.3), turn=-52.0)

    def choose(**options: float) -> SlideChoice:
        with monkeypatch.context() as patch:
            patch.setattr(choosing_slide, "CHOICE", replace(CHOICE, per_enlarged=0.0, **options))
            return choice_for(base, views, NONE, DOWN, better_far(25))

    choice = choose(max_stretched=1.0)
    assert 0 < choice.s1 < 1 and choice.costs[-1].folded > 0.02 and "fold" in choice.why
    assert next(one for one in choice.costs if one.s1 == choice.s1).folded < 0.01
    stretched = choose()
    assert stretched.s1 < choice.s1 and "stretch" in stretched.why
    assert choose(max_stretched=1.0, max_folded=1.0, per_folded=0.0).s1 == 1, "nothing else holds it"


def test_a_seam_that_runs_unseen_is_worth_it(by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.05))

    def choose() -> SlideChoice:
        return choice_for(base, views, NONE, DOWN, better_far(10))

    choice = choose()
    assert choice.s1 == 1
    # with those of slides between interpolated
    finer = CHOICE.px_per_radian / CHOICE.base_px_per_radian
    assert np.allclose([one.seam_px for one in choice.costs], finer * np.array([10, 7.5, 5, 2.5, 0]))
    assert chosen_without(monkeypatch, "per_seam_px", choose) == 0
    assert choice_for(base, views, NONE, DOWN, lambda warp: 500 - 100 * slid(warp)).s1 == 0, "bad is bad"


def test_it_stays_where_sliding_gains_next_to_nothing(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.05))
    little, much = (choice_for(base, views, NONE, DOWN, better_far(px)) for px in (1.4, 10))
    assert little.s1 == 0 and little.costs[-1].cost < little.costs[0].cost and much.s1 == 1


def test_it_stays_where_sliding_gains_nothing(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.05))
    assert choice_for(base, views, NONE, DOWN, steady).s1 == 0
    assert choice_for(base, views, NONE, DOWN, better_far(0.1)).s1 == 0, "nor for what nobody sees"


def test_no_seam_is_cut_where_no_other_slide_could_be_chosen(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, wall)
    edges = lines(*(((1.1, y, 4.0), (1.9, y + 0.5, 4.0)) for y in (-1.3, -0.9, 0.1, 0.6)))
    cut: list[float] = []
    choice = choice_for(base, views, edges, DOWN, lambda warp: cut.append(slid(warp)) or 20.0)
    assert cut == [0.0, 0.5, 1.0], "an unseen one would be worth the bend of the smallest slide"
    seen = choice.costs[0].cost - choice.costs[0].bend_px
    cut.clear()
    choice = choice_for(base, views, edges, DOWN, lambda warp: cut.append(slid(warp)) or 0.0)
    assert cut == [0.0] and choice.s1 == 0 and seen > 0
    assert [one.seam_px for one in choice.costs] == [0.0, None, None, None, None]


def test_it_slides_within_a_part_of_the_way_where_that_cuts_less(by_hand: SimpleNamespace) -> None:
    """As where a person beside that part is torn otherwise."""
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.05))
    whole = viewpoint_between(base, views)
    assert whole is not None

    def cut_beside(part: tuple[float, float]) -> Callable[[Warp], float]:
        ends = whole.within(part).ends
        return lambda warp: 0.0 if warp.viewpoint is not None and warp.viewpoint.ends == ends else 60.0

    for part in CHOICE.parts:
        choice = choice_for(base, views, NONE, DOWN, cut_beside(part))
        assert (choice.s1, choice.part) == (1.0, part) and "of the way across" in choice.why
        assert choice.costs[-1].seam_px == 0 and choice.costs[0].seam_px > 100
    assert choice_for(base, views, NONE, DOWN, lambda warp: 60.0).part == (0.0, 1.0)
    # what a part costs more in bend is weighed, and where little is seen nothing is tried
    calls: list[Warp] = []
    assert choice_for(base, views, NONE, DOWN, lambda warp: calls.append(warp) or 4.0).part == (0.0, 1.0)
    assert len(calls) == len(CHOICE.seam_candidates)


def test_it_can_be_stopped_between_candidates(by_hand: SimpleNamespace) -> None:
    base, views = rig(by_hand, wall)
    said = []

    def stop(share: float) -> None:
        said.append(share)
        if share > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        choice_for(base, views, NONE, DOWN, better_far(20), stop)
    assert said == sorted(said) and said[0] == 0


def test_holes_between_the_pictures_count(by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    base, views = rig(by_hand, lambda heading, rise: np.full_like(heading, 0.05))
    torn = base.maps[1].arrays()
    # what only the target shows, with a hole that a slide closes
    px = CHOICE.base_px_per_radian
    left, top = (start + round(at * px) for start, at in zip(base.canvas.offset, (0.7, -0.03), strict=True))
    torn.x[top : top + round(0.053 * px), left : left + round(0.04 * px)] = np.nan

    def choose() -> SlideChoice:
        return choice_for(base, views, NONE, DOWN, steady)

    choice = choose()
    assert choice.s1 > 0 and choice.costs[0].holes > 1e-3 and choice.costs[-1].holes < 6e-4
    assert chosen_without(monkeypatch, "per_hole", choose) == 0


def test_what_runs_straight_away_on_the_floor_is_no_upright(
    by_hand: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the picture a rail below the camera looks upright; from elsewhere it does not, and should not."""
    base, views = rig(by_hand, lambda heading, rise: np.maximum(rise, 0) / np.hypot(1, rise) / 1.5)
    ahead = views[1].R.T @ np.array([0, 0, 1.0])
    rails = lines(*(
        (tuple(place + DOWN * 1.5 + 4.0 * ahead), tuple(place + DOWN * 1.5 + 9.0 * ahead)) for place in [PLACE] * 4
    ))  # fmt: skip
    edges = [NONE[0], rails[1]]
    assert all(one.lean_deg == 0 for one in choice_for(base, views, edges, DOWN, steady).costs)
    monkeypatch.setattr(choosing_slide, "_level", lambda rays, d, down: np.zeros(len(rays), bool))
    assert choice_for(base, views, edges, DOWN, steady).costs[0].lean_deg > 1, "as they are seen from the reference"


def test_an_upright_edge_that_ends_straight_below_the_camera_is_upright() -> None:
    """Warnings are errors: the sine of such a ray may be rounded to more than 1."""
    down = np.array([0.21, 0.97, 0.1])
    down /= np.linalg.norm(down) * (1 - 1e-15)
    ahead = np.cross([1.0, 0, 0], down) / np.linalg.norm(np.cross([1.0, 0, 0], down))
    # places on a pole that stands one baseline ahead
    places = ahead + np.array([[0.5], [2.0], [1e12]]) * down
    ranges = np.linalg.norm(places, axis=1)
    rays = places / ranges[:, None]
    assert (rays @ down).max() > 1
    assert not choosing_slide._level(rays[None], 1 / ranges[None], down)[0]
