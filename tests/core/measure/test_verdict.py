"""What is wrong is seen, where it is, and what is right is not called wrong: at any size of the picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.tone.exposure import unchanged
from edf_stitch.core.measure.look import Look, look_at
from edf_stitch.core.measure.verdict import Verdict, judge
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.raster.picture_map import PictureMap
from edf_stitch.synthetic_scenes.two_planes import Pair

RIGHT = {
    "measured": {"alignment_p95_px": 1.0, "folds": 0.001}, "composition": {"holes": []},
    "options": {"projection": "auto", "slide": "auto"}, "matches": {"found": 200, "contradicting": 0},
}  # fmt: skip
# Rows and columns across the seam, which runs down the middle (column 200).
PATCH = np.s_[100:140, 180:220]


def look(step: int = 1) -> Look:
    """Two pictures of 400 × 300 px that agree, both shown everywhere, with a seam down the middle."""
    texture = np.random.default_rng(0).integers(60, 200, (300, 400, 3)).astype(np.uint8)
    tones = cv2.GaussianBlur(texture, (0, 0), 1)
    x, y = (values.astype(np.float32) for values in np.meshgrid(np.arange(400), np.arange(300)))
    one, everywhere = PictureMap(x, y, (400, 300)), np.ones((300, 400), bool)
    labels = np.where(x < 200, 0, 1).astype(np.int16)
    return Look(step, (one, one), (tones, tones), (tones, tones), (everywhere, everywhere), ~everywhere, labels)


def with_second(good: Look, tones: np.ndarray) -> Look:
    return replace(good, tones=(good.tones[0], tones), taken=(good.taken[0], tones))


def differing(good: Look, part: tuple[slice, slice]) -> Look:
    """Where the target shows something else: stripes brighter by 110 levels."""
    tones = good.tones[1].copy()
    tones[part] += np.where(np.arange(300) % 8 < 4, 110, 0).astype(np.uint8)[part[0], None, None]
    return with_second(good, tones)


def judged(seen: Look, **measured: float) -> Verdict:
    return judge(seen, (0, 0), {**RIGHT, "measured": {**RIGHT["measured"], **measured}})


def test_pictures_that_agree_are_good_and_so_is_light_that_changes_slowly() -> None:
    good = look()
    assert judged(good).rating == "good" and not judged(good).places
    ramp = np.linspace(-40, 40, 400).astype(np.float32)[:, None]
    assert judged(with_second(good, np.clip(good.tones[1] + ramp, 0, 255).astype(np.uint8))).rating == "good"
    away = differing(good, np.s_[100:140, 300:340])
    assert judged(away).rating == "good", "what differs away from the seam is not seen"


def test_a_seam_that_is_seen_is_a_place_with_its_cause() -> None:
    good = look()
    wrong = differing(good, PATCH)
    found = judged(wrong)
    assert found.rating == "look" and len(found.places) == 1 and "--mask" in found.what_to_do
    x, y, width, height = found.places[0].box
    assert 196 <= x and x + width <= 204 and 98 <= y and y + height <= 142 and height >= 30
    assert "moved" in found.places[0].what
    hides = good.hidden.copy()
    hides[PATCH] = True
    assert "near and far" in judged(replace(wrong, hidden=hides)).places[0].what
    for number, name in enumerate(("reference", "target")):
        shows = [good.shows[0].copy(), good.shows[1].copy()]
        shows[number][:, 204:] = False
        what = judged(replace(wrong, shows=(shows[0], shows[1]))).places[0].what
        assert what == f"a thing is cut by the border of the {name}"


def test_what_nearly_touches_is_one_place() -> None:
    for below, count in ((118, 1), (160, 2)):
        both = differing(differing(look(), np.s_[100:112, 180:220]), np.s_[below : below + 12, 180:220])
        assert len(judged(both).places) == count


def test_places_are_told_in_pixels_of_the_panorama() -> None:
    small = judged(differing(look(), PATCH)).places[0].box
    large = judge(differing(look(step=3), PATCH), (10, -20), RIGHT).places[0].box
    assert large == (3 * small[0] + 10, 3 * small[1] - 20, 3 * small[2], 3 * small[3])


@pytest.mark.parametrize("change", [lambda x: 2 * 316 - x, lambda x: 316 + 9 * (x - 316)], ids=["folds", "jumps"])
def test_a_map_that_folds_or_jumps_is_a_place_where_the_other_picture_does_not_agree(
    change: Callable[[np.ndarray], np.ndarray]
) -> None:
    part = np.s_[50:62, 310:322]
    wrong = differing(look(), part)
    x = wrong.maps[1].x.copy()
    x[part] = change(x[part])
    torn = replace(wrong, maps=(wrong.maps[0], replace(wrong.maps[1], x=x)))
    found = judged(torn)
    assert found.rating == "look" and len(found.places) == 1 and "torn" in found.places[0].what
    left, top, width, height = found.places[0].box
    assert 305 <= left and left + width <= 327 and 45 <= top and top + height <= 67
    assert judged(wrong).rating == "good" == judged(replace(torn, tones=look().tones)).rating
    elsewhere = replace(torn, maps=(torn.maps[1], torn.maps[0]))
    assert judged(elsewhere).rating == "good", "the reference is not shown there"


def test_a_large_part_that_is_bent_is_a_place_unless_the_frame_was_asked_for() -> None:
    good = look()
    x = good.maps[1].x.copy()
    part = np.s_[100:220, 260:380]
    x[part] += 0.8 * (good.maps[1].y[part] - 160)
    bent = replace(good, maps=(good.maps[0], replace(good.maps[1], x=x)))
    found = judged(bent)
    assert found.rating == "look" and len(found.places) == 1 and "bent" in found.places[0].what
    left, top, width, height = found.places[0].box
    assert 240 <= left and left + width <= 400 and 80 <= top and top + height <= 240 and min(width, height) > 70
    assert judge(bent, (0, 0), {**RIGHT, "options": {"projection": "perspective", "slide": "auto"}}).rating == "good"
    elsewhere = replace(bent, maps=(bent.maps[1], bent.maps[0]))
    assert judged(elsewhere).rating == "good", "the reference is not shown there"
    assert found.what_to_do.startswith("give the focal length"), "no mask mends that"
    assert found.what_to_do.endswith("(--slide 0)")
    stays = judge(bent, (0, 0), {**RIGHT, "options": {"projection": "auto", "slide": 0}})
    assert "--focal-px" in stays.what_to_do and "--slide" not in stays.what_to_do, "it stays there already"
    blank = [tones.copy() for tones in good.tones]
    for tones in blank:
        tones[80:240, 240:400] = 200
    assert judged(replace(bent, tones=tuple(blank))).rating == "good", "of a blank sky nobody sees how it is mapped"
    small = good.maps[1].x.copy()
    small[100:115, 300:315] += 0.8 * (good.maps[1].y[100:115, 300:315] - 107)
    assert judged(replace(good, maps=(good.maps[0], replace(good.maps[1], x=small)))).rating == "good", "outlines"


def test_light_that_is_lost_is_a_place() -> None:
    good = look()
    sky = np.s_[:60, 250:]
    for taken, shown, what, helps in (
        (240, 255, "blown", "--exposure=-1"), (255, 220, "too bright", "--exposure=1"),
    ):  # fmt: skip
        before, now = good.taken[1].copy(), good.tones[1].copy()
        before[sky], now[sky] = taken, shown
        found = judged(replace(good, tones=(good.tones[0], now), taken=(good.taken[0], before)))
        assert [what in place.what for place in found.places] == [True] and found.places[0].box == (250, 0, 150, 60)
        assert helps in found.what_to_do and "--mask" not in found.what_to_do
        alike = replace(good, tones=(np.where(now == shown, now, good.tones[0]), now), taken=(good.taken[0], before))
        assert (judged(alike).rating == "good") == (what == "too bright"), "darker, as the other picture has it"
        elsewhere = replace(good, tones=(now, good.tones[1]), taken=(before, good.taken[1]))
        assert judged(elsewhere).rating == "good", "the reference is not shown there"
        white = replace(good, tones=(good.tones[0], before), taken=(good.taken[0], before))
        assert judged(white).rating == "good", "nothing was lost by us"


def test_a_geometry_that_is_wrong_is_not_usable_and_says_why() -> None:
    good, off = look(), 400 * 0.05
    wrong = differing(good, np.s_[:, 150:250])
    assert judged(good, alignment_p95_px=off).rating == "good", "the picture is right all the same"
    found = judged(differing(good, np.s_[:, 190:200]), alignment_p95_px=off)
    assert found.rating == "not usable" and "matches" in found.because and "--focal35" in found.what_to_do
    assert judged(good, alignment_p95_px=400 * 0.2).rating == "not usable", "one picture alone is shown"
    assert "mirrored" in judged(good, folds=0.08).because
    assert "in common" in judged(wrong).because
    assert "too far apart" in judged(replace(differing(good, PATCH), hidden=~good.hidden)).because
    assert judged(differing(good, PATCH)).rating == "look"


def test_a_hole_is_a_place() -> None:
    found = judge(look(), (0, 0), {**RIGHT, "composition": {"holes": [(10, 20, 30, 40)]}})
    assert found.rating == "look" and len(found.places) == 1 and "hole" in found.places[0].what
    assert found.places[0].box == (10, 20, 30, 40)


def test_without_a_seam_only_geometry_and_light_are_judged() -> None:
    plain = replace(differing(look(), PATCH), labels=None)
    assert judged(plain).rating == "good" and judged(plain, folds=0.1).rating == "not usable"


def test_a_panorama_is_looked_at_small(small_result: StitchResult) -> None:
    """As large as it is where it is small; every second pixel where it is larger than that."""
    maps = [one.arrays() for one in small_result.warp.maps]
    twice = [
        PictureMap(*(np.repeat(np.repeat(v, 3, 0), 3, 1) for v in (one.x, one.y)), one.size)  # type: ignore[arg-type]
        for one in maps
    ]
    hidden = [np.zeros(one.shape, bool) for one in maps]
    as_it_is, smaller = (
        look_at(small_result.pictures, which, [unchanged(3)] * 2, [np.zeros(one.shape, bool) for one in which],
                np.zeros(which[0].shape, np.int16))
        for which in (maps, twice)
    )  # fmt: skip
    assert as_it_is.step == 1 and as_it_is.hidden.shape == hidden[0].shape
    assert smaller.step == -(-3 * max(maps[0].shape) // 600) > 1 and max(smaller.hidden.shape) <= 600
    rows, columns = np.nonzero(as_it_is.shows[0])
    x, y = (np.rint(values[rows, columns]).astype(int) for values in (maps[0].x, maps[0].y))
    apart = np.abs(as_it_is.tones[0][rows, columns].astype(int) - small_result.pictures[0].view[y, x])
    assert np.median(apart) <= 1
    dark = look_at(small_result.pictures, maps, [unchanged(3, 0.25)] * 2, hidden, np.zeros(maps[0].shape, np.int16))
    assert np.array_equal(dark.taken[0], as_it_is.tones[0]) and dark.tones[0].max() < 0.6 * as_it_is.tones[0].max()


def test_of_a_whole_sphere_only_what_the_pictures_cover_is_looked_at(small_pair: Pair, known: StitchOptions) -> None:
    changed = small_pair.target.copy()
    changed[40:140:8, 20:100] = 255
    sphere = replace(known, projection="equirectangular", seam="none")
    result = stitch((small_pair.reference, changed), sphere)
    seen = look_at(
        result.pictures, result.warp.maps, [one.exposure for one in result.decided], result.occluded, result.labels
    )
    here = [one.box for one in judge(seen, (0, 0), result.report).places]
    told = [tuple(one["box"]) for one in result.report["verdict"]["places"]]
    left, top = -result.spread[0], -result.spread[1]
    assert left > 0 and here and told == [(x + left, y + top, width, height) for x, y, width, height in here]


def test_the_report_has_the_verdict(small_pair: Pair, known: StitchOptions) -> None:
    result = stitch((small_pair.reference, small_pair.target), known)
    assert result.report["verdict"]["is"] == "good" and result.report["verdict"]["places"] == []
    # something that the target alone shows, cut by a painted seam
    changed = small_pair.target.copy()
    changed[80:100, 20:100] = np.where(np.arange(20) % 12 < 6, 255, 0)[:, None, None]
    height, width = result.alpha.shape
    found, cropped = (
        stitch((small_pair.reference, changed), replace(known, mask=mask, crop=crop)).report["verdict"]
        for mask in [np.repeat(np.where(np.arange(width) < 120, 0, 255).astype(np.uint8)[None], height, axis=0)]
        for crop in ("full", (60, 10, 120, 150))
    )  # fmt: skip
    assert found["is"] == cropped["is"] == "look"
    seams = [[one["box"] for one in told["places"] if "seam" in one["what"]] for told in (found, cropped)]
    for (x, y, wide, high), left, top in ((seams[0][0], 120, 96), (seams[1][0], 120 - 60, 96 - 10)):
        assert abs(x + wide / 2 - left) <= 2 and y <= top + 20 and top <= y + high, "where the changed rows are"


# --- more than two pictures -------------------------------------------------------------------------------------------

SURE = {
    **RIGHT, "pictures": [{"name": name} for name in ("a.png", "b.png", "c.png")], "left_out": [],
    "rig": {"scale": "measured", "focal_spread": 0.002, "edges": []}, "field": {"leave_one_out_px": 0.4},
}  # fmt: skip


def look_of_three() -> Look:
    """As `look`, with a third picture from column 300 on."""
    good = look()
    labels = good.labels.copy()
    labels[:, 300:] = 2
    three = {name: (*getattr(good, name), getattr(good, name)[0]) for name in ("maps", "tones", "taken", "shows")}
    return replace(good, labels=labels, **three)


def test_of_three_pictures_only_those_that_meet_are_compared() -> None:
    good = look_of_three()
    assert judge(good, (0, 0), SURE).rating == "good"
    stripes = np.where(np.arange(300) % 8 < 4, 110, 0).astype(np.uint8)[100:140, None, None]
    tones = good.tones[2].copy()
    tones[100:140, 180:220] += stripes
    away = replace(good, tones=(*good.tones[:2], tones))
    assert judge(away, (0, 0), SURE).rating == "good", "the third is not shown at the seam of the first two"
    tones = good.tones[2].copy()
    tones[100:140, 280:320] += stripes
    found = judge(replace(good, tones=(*good.tones[:2], tones)), (0, 0), SURE)
    assert found.rating == "look" and "--ignore NAME=MASK" in found.what_to_do
    x, y, width, height = found.places[0].box
    assert 296 <= x and x + width <= 304 and 98 <= y and y + height <= 142


def test_a_speck_at_one_of_many_seams_is_no_place() -> None:
    def rated(rows: int, good: Look, seam: int) -> str:
        part = np.s_[100 : 100 + rows, seam - 20 : seam + 20]
        tones = good.tones[1].copy()
        tones[part] = np.where(tones[part] < 128, 255, 0)
        shown = replace(good, tones=(good.tones[0], tones, *good.tones[2:]))
        return judge(shown, (0, 0), SURE if len(good.shows) > 2 else RIGHT).rating

    assert [rated(rows, look_of_three(), 200) for rows in (2, 12)] == ["good", "look"]
    assert rated(2, look(), 200) == "look", "of the one seam of two pictures it is"


def test_of_three_pictures_a_wrong_geometry_is_not_usable_wherever_the_seam_is() -> None:
    three = look_of_three()
    assert judged(three, alignment_p95_px=400 * 0.01).rating != "not usable", "this is where the pictures are right"
    found = judged(three, alignment_p95_px=400 * 0.07)
    assert found.rating == "not usable" and "missed by more than 7%" in found.because


def test_the_picture_whose_border_cuts_a_thing_is_named() -> None:
    good = look_of_three()
    tones, shows = good.tones[2].copy(), good.shows[2].copy()
    tones[100:140, 280:320] += np.where(np.arange(300) % 8 < 4, 110, 0).astype(np.uint8)[100:140, None, None]
    shows[:, :297] = False
    cut = replace(good, tones=(*good.tones[:2], tones), shows=(*good.shows[:2], shows))
    assert judge(cut, (0, 0), SURE).places[0].what == "a thing is cut by the border of c.png"


@pytest.mark.parametrize(("changes", "why", "advice"), [
    ({"left_out": [{"name": "d.png", "why": ""}]}, "left out: d.png", "take more pictures"),
    ({"rig": {**SURE["rig"], "scale": "none"}}, "how far apart", "take more pictures"),
    ({"rig": {**SURE["rig"], "focal_spread": 0.06}}, "focal length is not sure", "--focal35"),
    ({"measured": {"alignment_p95_px": 1.0, "folds": 0.2}}, "folds over in 20%", "take more pictures"),
    ({"field": {"leave_one_out_px": 2.5}}, "too near and deep", "take more pictures"),
])  # fmt: skip
def test_what_is_doubtful_about_the_cameras_is_said(changes: dict, why: str, advice: str) -> None:
    found = judge(look_of_three(), (0, 0), {**SURE, **changes})
    assert found.rating == "look" and why in found.because and advice in found.what_to_do and not found.places


def test_guesses_of_the_focal_length_that_nobody_tells_apart_are_no_doubt() -> None:
    assert judge(look_of_three(), (0, 0), {**SURE, "rig": {**SURE["rig"], "focal_spread": 0.04}}).rating == "good"


def test_given_matches_that_contradict_each_other_are_not_good() -> None:
    for contradicting, rating in ((0, "good"), (20, "good"), (21, "look"), (120, "look")):
        found = judge(look(), (0, 0), {**RIGHT, "matches": {"found": 200, "contradicting": contradicting}})
        assert found.rating == rating
        assert rating == "good" or f"{contradicting} of the 200 given matches contradict" in found.because


@pytest.mark.parametrize(("scale", "baseline", "count"), [
    ("continuity", "continuity", 1), ("none", "none", 1), ("none", "continuity", 0), ("measured", "none", 0),
])  # fmt: skip
def test_pictures_whose_distance_is_not_known_have_a_place_where_they_meet(
    scale: str, baseline: str, count: int
) -> None:
    seen = look_of_three()
    shows = [seen.shows[0].copy(), seen.shows[1].copy(), seen.shows[2].copy()]
    shows[0][:, 220:], shows[1][:, :180] = False, False
    seen = replace(seen, shows=tuple(shows))
    edges = [
        {"numbers": [0, 1], "baseline": baseline}, {"numbers": [1, 2], "baseline": "measured"},
    ]  # fmt: skip
    found = judge(seen, (7, 5), {**SURE, "rig": {"scale": scale, "focal_spread": 0.0, "edges": edges}})
    assert [place.box for place in found.places] == [(180 + 7, 5, 40, 300)] * count
    assert found.rating == ("good" if scale == "measured" else "look")
    if count:
        assert found.because == found.places[0].what, "it is said once"


def test_without_a_seam_nothing_is_compared_and_nothing_crashes() -> None:
    assert judge(replace(look_of_three(), labels=None), (0, 0), SURE).rating == "good"


def test_around_the_poles_of_a_sphere_nothing_is_bent_by_nature() -> None:
    """A picture that looks straight down, on a whole sphere: rows narrow towards the pole there."""
    v, u = np.mgrid[:200, :400].astype(np.float32)
    heading, fall = np.pi * ((u + 0.5) / 200 - 1), np.pi * ((v + 0.5) / 200 - 0.5)
    x, y, z = np.cos(fall) * np.sin(heading), np.cos(fall) * np.cos(heading), np.sin(fall)
    below = z > np.cos(np.radians(50))
    with np.errstate(divide="ignore"):
        down = PictureMap(np.where(below, 100 * x / z + 150, np.nan), np.where(below, 150 - 100 * y / z, np.nan),
                          (300, 300))  # fmt: skip
    ahead = PictureMap(64 * heading, 64 * fall, (400, 200))
    tones = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 256, (200, 400, 3)).astype(np.uint8), (0, 0), 1)
    level, labels = np.abs(fall) < 0.7, np.where(below, 1, -1).astype(np.int16)
    sphere = Look(1, (ahead, down), (tones,) * 2, (tones,) * 2, (level, below), np.zeros_like(below),
                  np.where(level & ~below, 0, labels).astype(np.int16))  # fmt: skip
    projection = {"kind": "equirectangular", "focal_px": 200 / np.pi, "centre": [199.5, 99.5]}
    report = {**RIGHT, "canvas": {"projection": projection}}

    def bent(seen: Look) -> list[str]:
        return [place.what for place in judge(seen, (0, 0), report).places if "bent" in place.what]

    assert bent(sphere) == []
    squeezed = PictureMap(150 + 2.5 * (down.x - 150), down.y, (600, 300))
    assert len(bent(replace(sphere, maps=(ahead, squeezed)))) > 0
