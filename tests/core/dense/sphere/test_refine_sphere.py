"""Dense refinement of a card before a wall: right at both, and at the edge between them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.dense.sphere.choice import Compared, compared_on
from edf_stitch.core.dense.sphere.patch import Patch, SweptPicture
from edf_stitch.core.dense.sphere.place import Place
from edf_stitch.core.dense.sphere.refine_sphere import DenseSphere, refine_sphere
from edf_stitch.core.dense.sphere.sweep import swept
from edf_stitch.core.field.refined_sphere import RefinedSphere
from edf_stitch.core.field.sphere_chart import SphereChart
from edf_stitch.core.field.sphere_field import SphereField, fit_sphere_field
from edf_stitch.core.system import threads
from edf_stitch.core.system.errors import Cancelled

from .card_scenes import card_rig, from_one_place, inverse_range, pictures_of

GAINS = (1.0, 0.8, 1.15, 0.9)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return card_rig()


@pytest.fixture(scope="module")
def field(rig: Rig) -> SphereField:
    return fit_sphere_field(rig, with_slack=False)


@pytest.fixture(scope="module")
def dense(rig: Rig, field: SphereField) -> DenseSphere:
    return refine_sphere(field, rig, pictures_of(rig, GAINS))


def seen_by_several(rig: Rig, chart: SphereChart, rays: np.ndarray, border: float = 30) -> np.ndarray:
    """Where (h, 2 h) the first picture and two others see the wall, away from their borders."""
    count = np.zeros(chart.shape, int)
    for view in rig.views:
        seen = rays @ (view.K @ view.R).T + (rays[..., 2:] / 16) * (view.K @ view.t)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = np.where(seen[..., 2:] > 0, seen[..., :2] / seen[..., 2:], np.nan)
            count += ((pixels > border) & (pixels < np.array(view.size) - border)).all(axis=-1)
    return count >= 3


def errors(rig: Rig, refined: RefinedSphere) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """px of the longest parallax by which inverse range is off, where (h, 2 h) that counts, and where it jumps."""
    chart = refined.chart
    rays = chart.all_rays
    true = inverse_range(rays)
    off = np.abs(refined.inverse_range - true) * chart.per_radian
    jumps = cv2.dilate(true, np.ones((7, 7))) - cv2.erode(true, np.ones((7, 7))) > 0.02
    return off, seen_by_several(rig, chart, rays), jumps


def test_card_and_wall_lie_where_they_are(rig: Rig, dense: DenseSphere) -> None:
    assert dense.refined is not None and dense.found > 0.7 and not dense.why
    off, where, jumps = errors(rig, dense.refined)
    assert where.sum() > 10_000
    assert np.median(off[where]) < 0.15
    assert np.percentile(off[where & ~jumps], 95) < 0.6
    # beside the edges of the card: within three nodes of them most are on one of the two surfaces, and on the right one
    assert (off[where & jumps] < 1).mean() > 0.6


def test_the_smooth_field_is_far_worse(rig: Rig, field: SphereField, dense: DenseSphere) -> None:
    assert dense.refined is not None
    chart = dense.refined.chart
    smooth = field.at(chart.all_rays)
    before = errors(rig, replace(dense.refined, inverse_range=smooth.astype(np.float32)))
    after = errors(rig, dense.refined)
    assert np.percentile(before[0][before[1]], 90) > 3 * np.percentile(after[0][after[1]], 90)


def test_confidence_is_high_where_it_is_right(rig: Rig, dense: DenseSphere) -> None:
    assert dense.refined is not None
    off, where, _ = errors(rig, dense.refined)
    sure = dense.refined.confidence > 0.5
    assert sure[where].mean() > 0.7 and (off[where & sure] < 1).mean() > 0.95
    nobody = cv2.dilate(dense.refined.shown.astype(np.uint8), np.ones((21, 21))) == 0
    assert nobody.any() and not dense.refined.confidence[nobody].any()
    told = dense.refined.deviation[where & sure] * dense.refined.chart.per_radian
    assert 0.1 < np.median(off[where & sure] / told) < 2


def test_a_bent_lens_changes_little(dense: DenseSphere) -> None:
    rig = card_rig(lens=(-0.12, 0.03))
    bent = refine_sphere(fit_sphere_field(rig, with_slack=False), rig, pictures_of(rig))
    assert bent.refined is not None
    off, where, jumps = errors(rig, bent.refined)
    assert np.median(off[where]) < 0.2 and np.percentile(off[where & ~jumps], 95) < 0.8


def test_as_many_threads_as_there_are_give_the_same(
    rig: Rig, field: SphereField, dense: DenseSphere, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert dense.refined is not None
    monkeypatch.setattr(threads, "count", lambda: 1)
    alone = refine_sphere(field, rig, pictures_of(rig, GAINS)).refined
    assert alone is not None
    assert alone.inverse_range.tobytes() == dense.refined.inverse_range.tobytes()
    assert alone.confidence.tobytes() == dense.refined.confidence.tobytes()


def test_what_is_masked_is_not_compared(rig: Rig) -> None:
    pictures = pictures_of(rig)
    hole = np.ones(pictures[0].view.shape[:2], np.float32)
    hole[80:160, 100:200] = 0
    seen = SweptPicture.of(0, rig.views[0], replace(pictures[0], alpha=hole), 1000.0)
    assert (seen.levels[..., 3] == 0).sum() == 80 * 100


def test_pictures_from_one_place_have_nothing_to_refine(rig: Rig, field: SphereField) -> None:
    dense = refine_sphere(field, from_one_place(rig), pictures_of(rig))
    assert dense.refined is None and "one place" in dense.why


def test_progress_goes_on_and_cancel_ends_it(rig: Rig, field: SphereField) -> None:
    told: list[float] = []

    def tick(share: float) -> None:
        told.append(share)
        if len(told) > 1:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        refine_sphere(field, rig, pictures_of(rig), tick)
    assert told == sorted(told) and told[0] < 0.1


def comparison(rig: Rig, field: SphereField, gains: tuple[float, ...] = ()) -> Compared | None:
    pictures = [SweptPicture.of(k, view, picture, 280.0)
                for k, (view, picture) in enumerate(zip(rig.views, pictures_of(rig, gains), strict=True))]  # fmt: skip
    chart = SphereChart.whole(np.eye(3), 880)
    return compared_on(Patch(chart, 380, 790, (120, 150)), pictures, before_a_wall(chart), field)


def before_a_wall(chart: SphereChart) -> Place:
    """The first picture's place, 16 from all around."""
    nothing = np.zeros(0)
    smooth = np.full(chart.shape, 1 / 16, np.float32)
    all_of_it = np.ones((1, 2), np.float32)
    return Place(0, np.zeros(3), chart, all_of_it > 0, all_of_it, smooth, (nothing, nothing, nothing))


def test_the_picture_at_the_viewpoint_shows_a_node_best(rig: Rig, field: SphereField) -> None:
    compared = comparison(rig, field)
    assert compared is not None and compared.seen[0].picture.number == 0
    assert (compared.owner == 0).mean() > 0.9 and compared.several.mean() > 0.9


def test_a_darker_picture_gets_the_tones_of_the_first(rig: Rig, field: SphereField) -> None:
    compared = comparison(rig, field, GAINS)
    assert compared is not None
    means = [levels[..., :3][levels[..., 3] == 255].mean() for levels in compared.levels]
    assert max(means) - min(means) < 8


def test_one_picture_alone_is_not_compared(rig: Rig, field: SphereField) -> None:
    chart = SphereChart.whole(np.eye(3), 880)
    one = SweptPicture.of(0, rig.views[0], pictures_of(rig)[0], 280.0)
    assert compared_on(Patch(chart, 380, 790, (60, 60)), [one], before_a_wall(chart), field) is None


def test_the_sweep_finds_the_card_and_doubts_what_has_no_texture(rig: Rig, field: SphereField) -> None:
    compared = comparison(rig, field)
    assert compared is not None
    found = swept(compared, -20, 40)
    rays = compared.patch.chart.rays(np.arange(380, 500.0), np.arange(790, 940.0))
    true = (inverse_range(rays) - compared.base) / compared.per_px
    assert np.median(np.abs(found.along - true)) < 0.2 and (np.abs(found.along - true) < 1).mean() > 0.85
    assert found.unique.mean() > 0.8
    flat = [np.where(levels[..., 3:] == 255, np.uint8(100), levels) for levels in compared.levels]
    plain = [np.dstack([one[..., :3], levels[..., 3]]) for one, levels in zip(flat, compared.levels, strict=True)]
    between_levels = compared.field + np.float32(0.3) * compared.per_px  # on one, the field alone decides
    assert swept(replace(compared, levels=tuple(plain), field=between_levels), -20, 40).unique.mean() < 0.1
