"""From a rig to its maps: the frame that is chosen, and from where it is seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core import mapping
from edf_stitch.core.field.sphere_field import fit_sphere_field
from edf_stitch.core.mapping import Mapped, map_rig
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.panorama.choosing_slide import SlideChoice
from edf_stitch.core.panorama.rig_viewpoint import RigViewpoint
from edf_stitch.core.pictures.picture import picture_from_array

from .field.sphere_scenes import SIZE, rig_of

WALK = (0, 25, -20)
RING = tuple(range(0, 360, 30))


def mapped(yaws: tuple[int, ...], moves: float = 1.0, **options: object) -> Mapped:
    rig = rig_of(yaws, 1, points=1200, moves=moves)
    noise = np.random.default_rng(0).integers(0, 255, (SIZE[1], SIZE[0], 3), np.uint8)
    pictures = [picture_from_array(noise) for _ in yaws]
    stages: list[float] = []

    def progress(stage: str, share: float) -> None:
        assert stage == "warp"
        stages.append(share)

    out = map_rig(rig, fit_sphere_field(rig), pictures, StitchOptions(**options), progress)  # type: ignore[arg-type]
    assert stages == sorted(stages)
    assert stages[-1] <= 1
    return out


def test_a_slide_that_is_asked_for_is_taken() -> None:
    found = mapped(WALK, slide=0.5)
    assert found.slide.s1 == 0.5
    assert isinstance(found.warp.viewpoint, RigViewpoint)
    assert found.warp.viewpoint.s1 == 0.5
    assert found.warp.canvas.projection is not None


def test_a_slide_is_chosen_on_a_coarse_map(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapping, "choose_rig_slide", lambda *rest: SlideChoice(0.75, (), "by somebody"))
    found = mapped(WALK)
    assert found.slide.why == "by somebody"
    assert isinstance(found.warp.viewpoint, RigViewpoint)
    assert found.warp.viewpoint.s1 == 0.75


def test_with_a_cache_another_frame_has_the_same_slide_and_another_direction_of_down_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked: list[float] = []

    def choose(*_: object) -> SlideChoice:
        asked.append(0.25 * (len(asked) + 1))
        return SlideChoice(asked[-1], (), "by somebody")

    monkeypatch.setattr(mapping, "choose_rig_slide", choose)
    found = [mapped(WALK, cache=tmp_path, centre=(away, 0.0)).slide.s1 for away in (0.0, 5.0)]
    assert found == [0.25, 0.25]
    monkeypatch.setattr(mapping.AllEdges, "down_is_sure", True)
    assert mapped(WALK, cache=tmp_path).slide.s1 == 0.5


@pytest.mark.parametrize(("yaws", "moves", "options", "why"), [
    (WALK, 1.0, {"slide": 0}, "as asked for"),
    (WALK, 0.0, {}, "taken from one place"),
    (WALK, 1.0, {"projection": "equirectangular"}, "is seen from one place"),
    (RING, 1.0, {"projection": "equirectangular"}, "is seen from one place"),
    (WALK, 1.0, {"projection": "reference", "slide": "auto"}, "own plane has one viewpoint"),
])  # fmt: skip
def test_elsewhere_the_viewpoint_stays(yaws: tuple[int, ...], moves: float, options: dict, why: str) -> None:
    found = mapped(yaws, moves, **options)
    assert found.slide.s1 == 0
    assert why in found.slide.why
    assert found.warp.viewpoint is None


def test_a_ring_is_drawn_on_a_sphere_that_goes_all_around() -> None:
    projection = mapped(RING).warp.canvas.projection
    assert projection is not None
    assert projection.kind == "equirectangular"


def test_a_slide_around_a_ring_is_taken_where_it_is_asked_for() -> None:
    found = mapped(RING, slide=1.0)
    assert isinstance(found.warp.viewpoint, RigViewpoint)
    shown = np.logical_or.reduce([one.inside() for one in found.warp.maps])
    assert shown[shown.shape[0] // 2].mean() > 0.98
