"""Sets by name, and made harder."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from edf_stitch.core.system.errors import BadRequest
from edf_stitch.synthetic_scenes.recipes import EYE
from edf_stitch.synthetic_scenes.sets.recipes import SETS, parse_set
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera
from edf_stitch.synthetic_scenes.sets.sphere_truth import in_frame, seen_by

SIZE = (640, 480)


@pytest.mark.parametrize("name", sorted(SETS))
def test_the_first_camera_stands_at_the_viewpoint_and_each_overlaps_with_another(name: str) -> None:
    recipe = SETS[name]
    cameras = list(recipe.cameras(SIZE).values())
    assert np.allclose(cameras[0].place, [0, 0, EYE]) and len(cameras) == recipe.count
    assert recipe.cameras(SIZE).keys() == {f"{k:02d}" for k in range(recipe.count)}
    for number, camera in enumerate(cameras):
        others = [np.degrees(np.arccos(np.clip(camera.R[2] @ other.R[2], -1, 1)))
                  for k, other in enumerate(cameras) if k != number]  # fmt: skip
        assert min(others) < 45, number


def test_the_same_set_is_shot_every_time_and_another_by_another_seed() -> None:
    first, again = (parse_set("small_room").views for _ in range(2))
    assert first == again and first != parse_set("small_room:spread=0.2").views


def test_a_set_is_made_harder() -> None:
    recipe = parse_set("small_room:n=9,spread=0.3,noise=3")
    assert (recipe.count, recipe.spread, recipe.noise) == (9, 0.3, 3.0) and len(recipe.views) == 9
    places = np.array([view.place for view in parse_set("small_room:n=60,spread=0.5").views[1:]])
    assert places.std(axis=0) == pytest.approx([0.5, 0.5, 1 / 3], rel=0.3)


def test_pictures_of_another_place_stand_far_from_all_others_however_many_there_are() -> None:
    for text, expected in (("stray", (7, 8)), ("stray:n=5", (3, 4))):
        recipe = parse_set(text)
        away = [np.linalg.norm(camera.place[:2]) > 20 for camera in recipe.cameras(SIZE).values()]
        assert recipe.left_out == expected == tuple(np.flatnonzero(away))
    assert parse_set("small_room").left_out == ()


def test_on_a_tripod_all_are_at_one_place_but_those_that_are_meant_to_be_off() -> None:
    away = [float(np.linalg.norm(np.array(view.place) - [0, 0, EYE])) for view in SETS["tripod"].views]
    assert max(away[:-2]) == 0 and away[-2:] == pytest.approx([0.002, 0.002])
    away = [float(np.linalg.norm(np.array(view.place) - [0, 0, EYE])) for view in SETS["mixed"].views]
    assert max(away[:-4]) == 0 and min(away[-4:]) > 0.03, "four are taken from the hand"


@pytest.mark.parametrize("name", ["ring", "outdoor"])
def test_the_ends_of_a_ring_meet(name: str) -> None:
    ahead = np.array([camera.R[2] for camera in SETS[name].cameras(SIZE).values()])
    turns = np.sort(np.degrees(np.arctan2(ahead[:, 0], ahead[:, 1])))
    assert np.diff(turns, append=turns[0] + 360).max() < 45


def test_three_rings_show_all_but_what_is_overhead_and_underfoot() -> None:
    cameras = list(SETS["room_sphere"].cameras(SIZE).values())
    up = np.degrees([np.arcsin(camera.R[2, 2]) for camera in cameras])
    assert [int(part.sum()) for part in (np.abs(up) < 15, up > 25, up < -25)] == [11, 8, 8]
    sphere = SphereCamera(np.array([0, 0, EYE]), (360, 180))
    seen = np.sum([in_frame(seen_by(camera, sphere, sphere.all_directions(), np.full((180, 360), 3.0))[0], camera)
                   for camera in cameras], axis=0)  # fmt: skip
    assert (seen[40:145] > 0).all() and (seen[65:115] > 1).mean() > 0.95, "50° up to 55° down"
    away = np.array([camera.place for camera in cameras[1:]]) - cameras[0].place
    assert away.std(axis=0) == pytest.approx([0.15, 0.15, 0.1], rel=0.4)


def test_no_third_picture_sees_what_two_links_of_the_chain_have_in_common() -> None:
    sphere = SphereCamera(np.array([0, 0, EYE]), (720, 360))
    for away in (1.4, 4.0):  # all that the room holds lies between
        distance = np.full((360, 720), away)
        seen = [in_frame(seen_by(camera, sphere, sphere.all_directions(), distance)[0], camera)
                for camera in SETS["chain"].cameras(SIZE).values()]  # fmt: skip
        pairs = [first & second for first, second in pairwise(seen)]
        thirds = [(pair & (np.sum(seen, axis=0) > 2)).sum() / pair.sum() for pair in pairs]
        assert [k for k, share in enumerate(thirds) if not share] == [2, 5] and min(thirds[:2] + thirds[3:5]) > 0.05
        assert min(pair.mean() for pair in pairs) > 0.01, "but each two of them see something"
        assert not (seen[0] & seen[-1]).any(), "its ends do not meet"


def test_two_lenses_differ_in_size_orientation_and_distortion() -> None:
    cameras = list(SETS["two_lenses"].cameras(SIZE).values())
    wide, tele = [0, 3, 4], [1, 2, 5, 6]
    assert {(cameras[k].size, cameras[k].k1) for k in wide} == {((640, 480), -0.08)}
    assert {(cameras[k].size, cameras[k].k1) for k in tele} == {((384, 512), 0.0)}
    assert cameras[1].K[0, 0] / 512 == pytest.approx(2 * cameras[0].K[0, 0] / 640)


@pytest.mark.parametrize("text", ["smal_room", *(f"small_room:{setting}" for setting in (
    "n=2", "n=61", "n=3.5", "spread=-1", "turn=2", "spread=x", "noise=nan"))])  # fmt: skip
def test_what_is_no_set_is_refused(text: str) -> None:
    with pytest.raises(BadRequest, match=text.partition(":")[0]):
        parse_set(text)
