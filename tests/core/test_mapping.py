"""From a field to maps: who tells which way is down, when a viewpoint slides, and what a slide set by hand reuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from edf_stitch.core import mapping
from edf_stitch.core.alignment import align, estimate_geometry, fit_and_warp
from edf_stitch.core.continuation.continuation import continue_beyond
from edf_stitch.core.frames.frame import Frame
from edf_stitch.core.frames.reading import prepare
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.synthetic_scenes.two_planes import Pair

QUICK = StitchOptions(dense=False, measure=False, projection="cylindrical")


def silent(stage: str, share: float) -> None:
    pass


@pytest.fixture(scope="module")
def frame(small_pair: Pair) -> Frame:
    return prepare([picture_from_array(small_pair.reference), picture_from_array(small_pair.target)], QUICK)


def test_a_camera_whose_rotation_is_unknown_has_no_say_in_the_level(frame: Frame) -> None:
    views = align([frame], QUICK, silent).views
    unknown = replace(views[1], R=np.full((3, 3), np.nan))
    both, one, alone = (
        mapping.AllEdges(pictures, some).down
        for pictures, some in (
            (frame.pictures, views), (frame.pictures, (views[0], unknown)), (frame.pictures[:1], views[:1]),
        )
    )  # fmt: skip
    assert np.array_equal(one, alone) and not np.array_equal(both, one)


def test_nothing_slides_where_the_model_is_a_plane(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(mapping, "choose_slide", lambda *given: asked.append(given) or mapping.SlideChoice(0, (), "no"))
    options = replace(QUICK, slide="auto", dense=True)
    geometry = estimate_geometry([frame], options, silent)
    assert fit_and_warp(geometry, [frame], options, silent).slide.why == "no" and len(asked) == 1
    plane = replace(geometry.edges[0], two_view=replace(geometry.edges[0].two_view, model="plane"))
    found = fit_and_warp(replace(geometry, edges=(plane,)), [frame], options, silent)
    assert found.slide.s1 == 0 and "plane" in found.slide.why and len(asked) == 1


def test_a_slide_that_is_asked_for_in_vain_is_not_said_to_be_taken(frame: Frame) -> None:
    aligned = align([frame], QUICK, silent)
    unknown = replace(aligned.views[1], R=np.full((3, 3), np.nan))
    options = replace(QUICK, slide=0.5)
    found = mapping.map_pictures(aligned.field, (aligned.views[0], unknown), None, frame.pictures, options, silent)
    assert found.slide.s1 == 0 and "plane" in found.slide.why


@pytest.mark.parametrize("slide", ["auto", 0.5])
def test_nothing_is_tried_where_there_is_nothing_to_slide_along(
    frame: Frame, monkeypatch: pytest.MonkeyPatch, slide: str | float
) -> None:
    asked = []
    monkeypatch.setattr(mapping, "choose_slide", lambda *given: asked.append(given) or mapping.SlideChoice(1, (), "no"))
    aligned = align([frame], replace(QUICK, dense=True, slide=0.0), silent)
    assert aligned.dense is not None
    still = aligned.views[0], replace(aligned.views[1], t=np.zeros(3), e_prime=np.zeros(3))
    options = replace(QUICK, slide=slide)
    found = mapping.map_pictures(aligned.field, still, aligned.dense.refined, frame.pictures, options, silent)
    choice = found.slide
    assert choice.s1 == 0 and choice.costs == () and choice.why and not asked, "nothing is tried"


def test_what_goes_on_beyond_the_overlap_is_kept_for_the_same_pictures_only(
    frame: Frame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(mapping, "continue_beyond", lambda *given: asked.append(given) or continue_beyond(*given))
    aligned = align([frame], replace(QUICK, fade="plane"), silent)
    options = replace(QUICK, slide=0.0, fade="continue", cache=tmp_path)
    reference, target = frame.pictures
    turned = replace(reference, view=np.ascontiguousarray(reference.view[::-1]))
    masked = replace(target, alpha=np.ones(target.view.shape[:2], np.float32))
    for pictures, count in (
        ((reference, target), 1), ((reference, target), 1), ((turned, target), 2), ((reference, masked), 3),
    ):  # fmt: skip
        mapping.map_pictures(aligned.field, aligned.views, None, pictures, options, silent)
        assert len(asked) == count


@pytest.mark.parametrize(("frames", "dense"), [(1, False), (2, True)])
def test_nothing_slides_by_itself_where_depth_is_not_known_to_the_pixel(
    frame: Frame, monkeypatch: pytest.MonkeyPatch, frames: int, dense: bool
) -> None:
    """Near things would bend by the smooth field, a clip's too."""
    monkeypatch.setattr(mapping, "choose_slide", lambda *given: mapping.SlideChoice(1.0, (), "chosen"))
    found = align([frame] * frames, replace(QUICK, slide="auto", dense=dense), silent)
    assert found.slide.s1 == 0 and "smooth" in found.slide.why and found.warp.viewpoint is None


def test_it_slides_within_the_part_that_was_chosen(frame: Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    options = replace(QUICK, slide="auto", dense=True)
    ends = []
    for part in ((0.0, 1.0), (0.25, 0.75)):
        chosen = mapping.SlideChoice(0.5, (), "chosen", part)
        monkeypatch.setattr(mapping, "choose_slide", lambda *given, chosen=chosen: chosen)
        viewpoint = align([frame], options, silent).warp.viewpoint
        assert viewpoint is not None and viewpoint.s1 == 0.5
        ends.append(viewpoint.ends)
    (start, end), within = ends
    assert within == pytest.approx((start + (end - start) / 4, end - (end - start) / 4))
    by_hand = align([frame], replace(options, slide=(0.5, 0.25, 0.75)), silent)
    assert by_hand.slide.part == (0.25, 0.75) and by_hand.warp.viewpoint is not None
    assert (by_hand.warp.viewpoint.s1, by_hand.warp.viewpoint.ends) == (0.5, within), "goes on from what was chosen"


def test_another_slide_set_by_hand_starts_from_what_is_kept(
    frame: Frame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    built = []
    build = mapping.build_warp

    def counted(*given: Any) -> Any:
        built.append(given)
        return build(*given)

    monkeypatch.setattr(mapping, "build_warp", counted)
    kept = replace(QUICK, cache=tmp_path)
    align([frame], replace(kept, slide=0.25), silent)
    first = len(built)
    again = align([frame], replace(kept, slide=0.5), silent).warp
    assert len(built) - first == first - 1, "all but the full map, which is the dearest"
    anew = align([frame], replace(QUICK, slide=0.5), silent).warp
    assert again.viewpoint is not None and again.viewpoint.s1 == 0.5
    for one, other in zip(again.maps, anew.maps, strict=True):
        assert np.array_equal(one.arrays().x, other.arrays().x, equal_nan=True)
    assert np.array_equal(again.inverse_depth, anew.inverse_depth, equal_nan=True)
