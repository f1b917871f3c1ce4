"""From frames to one warp: what is worked on, frames pooled, matches given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.alignment import Alignment, align
from edf_stitch.core.cameras.projective import rotation_angle
from edf_stitch.core.frames.frame import Frame, size_of
from edf_stitch.core.frames.reading import prepare
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pictures.resized import resized
from edf_stitch.core.pipeline import compose
from edf_stitch.core.pose import features, pair_matches
from edf_stitch.core.pose.options import FEATURES
from edf_stitch.core.system.errors import BadRequest, NoOverlap, TooFewMatches
from edf_stitch.core.system.progress import Progress, Stopwatch
from edf_stitch.synthetic_scenes.ground_truth import TrueGeometry
from edf_stitch.synthetic_scenes.two_planes import Pair, depth_at, make_pair

from ..pairs import ON_REFERENCE

HEIGHT, WIDTH = 180, 240


def silent(_stage: str, _share: float) -> None:
    pass


def frame_of(pair: Pair, options: StitchOptions) -> Frame:
    return prepare([picture_from_array(one) for one in (pair.reference, pair.target)], options)


@pytest.fixture(scope="module")
def quick(known: StitchOptions) -> StitchOptions:
    """Without dense refinement, which clips do not have."""
    return replace(known, measure=False, dense=False)


@pytest.fixture(scope="module")
def clip(small_pair: Pair) -> list[Pair]:
    """Three frames of two cameras that stand still, of a scene that changes its looks."""
    return [small_pair, *(make_pair(WIDTH, HEIGHT, seed=seed) for seed in (1, 2))]


@pytest.fixture(scope="module")
def alone(clip: list[Pair], quick: StitchOptions) -> list[Alignment]:
    return [align([frame_of(pair, quick)], quick, silent) for pair in clip]


@pytest.fixture(scope="module")
def pooled(clip: list[Pair], quick: StitchOptions) -> Alignment:
    return align([frame_of(pair, quick) for pair in clip], quick, silent)


# --- what is worked on ----------------------------------------------------------------------------------------------


def test_where_nothing_is_asked_the_pictures_stay_what_they_are(small_pair: Pair) -> None:
    pictures = picture_from_array(small_pair.reference), picture_from_array(small_pair.target)
    frame = prepare(pictures, ON_REFERENCE)
    assert frame.pictures[0] is pictures[0] and frame.pictures[1] is pictures[1]
    assert frame.full_sizes == ((WIDTH, HEIGHT), (WIDTH, HEIGHT)) and size_of(pictures[0]) == (WIDTH, HEIGHT)


def test_masks_hide_and_scale_shrinks(small_pair: Pair) -> None:
    mask, mask_too = np.zeros((2, HEIGHT, WIDTH), bool)
    mask[:40], mask_too[:, 200:] = True, True
    options = StitchOptions(ignore=(mask, mask_too), scale=0.5)
    frame = frame_of(small_pair, options)
    assert size_of(frame.pictures[0]) == size_of(frame.pictures[1]) == (120, 90)
    assert frame.full_sizes == ((WIDTH, HEIGHT), (WIDTH, HEIGHT))
    first, second = frame.pictures[0].alpha, frame.pictures[1].alpha
    assert first is not None and not first[:20].any() and (first[20:] == 1).all()
    assert second is not None and not second[:, 100:].any() and (second[:, :100] == 1).all()
    one = frame_of(small_pair, StitchOptions(ignore=(None, mask_too)))
    assert one.pictures[0].alpha is None and one.pictures[1].alpha is not None


def test_a_mask_of_another_shape_is_told_with_its_picture(small_pair: Pair) -> None:
    for number, name in enumerate(("the reference", "the target")):
        with pytest.raises(BadRequest, match=f"mask of {name} has 50×50"):
            frame_of(small_pair, StitchOptions(ignore=(None,) * number + (np.zeros((50, 50), bool),)))


def test_the_cameras_are_those_of_the_pictures_worked_on(quick: StitchOptions) -> None:
    """Odd sizes round, and each side of the camera follows its own."""
    pair = make_pair(241, 179, focal=230.0)
    options = replace(quick, scale=0.5)
    frame = frame_of(pair, options)
    found = align([frame], options, silent)
    width, height = size_of(frame.pictures[0])
    assert (width, height) == (120, 90)
    focal = options.camera.focal_px[0]
    for camera in found.cameras:
        assert camera.size == (width, height) and camera.fixed
        assert camera.K[0, 0] == pytest.approx(focal * width / 241)
        assert camera.K[1, 1] == pytest.approx(focal * height / 179)
        assert camera.K[:2, 2] == pytest.approx([(width - 1) / 2, (height - 1) / 2])


# --- pictures made smaller ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [1, 3])
def test_a_smaller_picture_shows_the_mean_light_of_what_it_covers(dtype: type, channels: int) -> None:
    noise = np.random.default_rng(0).random((60, 90, channels))
    array = (noise * (5 if dtype is np.float32 else np.iinfo(dtype).max)).astype(dtype)
    picture = picture_from_array(array)
    small = resized(picture, 1 / 3)
    light = picture.pixels.reshape(20, 3, 30, 3, channels).mean(axis=(1, 3))
    assert small.pixels.shape == small.view.shape == (20, 30, channels) and small.alpha is None
    assert small.pixels.dtype == np.float32 and small.view.dtype == np.uint8
    assert np.allclose(small.pixels, light, rtol=1e-5), "of light, not of code values"
    assert small.bits == picture.bits and small.name == picture.name and resized(picture, 1.0) is picture
    odd = resized(picture, 0.41)  # pixels that are covered in part count in part
    assert odd.pixels.shape == (25, 37, channels)
    assert odd.pixels.mean() == pytest.approx(picture.pixels.mean(), rel=1e-3)
    tiny = resized(picture, 0.004)
    assert tiny.pixels.shape == (1, 1, channels)
    assert tiny.pixels.mean() == pytest.approx(picture.pixels.mean(), rel=1e-4)


def test_alpha_stays_straight_and_what_is_transparent_lends_no_colour() -> None:
    array = np.zeros((8, 12, 4), np.float32)
    array[..., :3], array[..., 3] = (0.2, 0.4, 0.6), 1
    array[:, 5:, :3], array[:, 5:, 3] = (900, 0, 900), 0  # what nobody was meant to see
    array[:4, :2, :3], array[:4, :2, 3] = (0.8, 0, 0), 0.5
    array[:4, 0, :3], array[:4, 0, 3] = (0, 0.8, 0), 0.25
    small = resized(picture_from_array(array), 0.5)
    assert small.alpha is not None
    assert np.allclose(small.alpha[:2], [0.375, 1, 0.5, 0, 0, 0]) and np.allclose(small.alpha[2:], [1, 1, 0.5, 0, 0, 0])
    assert np.allclose(small.pixels[:2, 0], np.array([0.8 * 0.5, 0.8 * 0.25, 0]) / 0.75, atol=1e-6), "weighted by alpha"
    assert np.allclose(small.pixels[:, 1:3], (0.2, 0.4, 0.6), atol=1e-6)
    assert not small.pixels[:, 3:].any()


def test_the_view_of_a_smaller_picture_shows_nothing_of_what_is_transparent() -> None:
    """Features and metrics look at the view: what lies under transparent pixels must not be seen beside them."""
    array = np.full((8, 12, 4), 255, np.uint8)
    array[..., :3] = (40, 90, 160)
    array[:, 5:, :3], array[:, 5:, 3] = (255, 0, 255), 0
    small = resized(picture_from_array(array), 0.5)
    assert small.alpha is not None and small.alpha[0, 2] == pytest.approx(0.5)
    assert small.view.dtype == np.uint8 and (small.view[:, :3] == (40, 90, 160)).all()


# --- frames pooled --------------------------------------------------------------------------------------------------


def test_pooled_frames_have_all_their_matches(alone: list[Alignment], pooled: Alignment) -> None:
    assert np.array_equal(pooled.edges[0].matches.x, np.concatenate([one.edges[0].matches.x for one in alone]))
    assert np.array_equal(pooled.edges[0].matches.y, np.concatenate([one.edges[0].matches.y for one in alone]))
    assert len(pooled.edges[0].two_view.inliers) == len(pooled.edges[0].matches)


def pose_errors(pair: Pair, found: Alignment) -> np.ndarray:
    """Degrees of rotation and of the baseline's direction."""
    truth, view = TrueGeometry.of(pair.reference_camera, pair.target_camera), found.edges[0].two_view
    between = 2 * np.arcsin(min(1.0, np.linalg.norm(view.t - truth.t) / 2))
    return np.array([rotation_angle(view.R, truth.R), np.degrees(between)])


def map_error(pair: Pair, found: Alignment) -> float:
    """Median distance in px of the map from the truth, in the overlap."""
    warp, truth = found.warp, TrueGeometry.of(pair.reference_camera, pair.target_camera)
    rows, columns = np.nonzero(warp.maps[1].inside())
    points = np.column_stack([columns, rows]).astype(float) - warp.canvas.offset
    keep = ((points >= 0) & (points <= (WIDTH - 1, HEIGHT - 1))).all(axis=1)
    true = truth.target_pixels(points[keep], depth_at(pair.reference_camera, points[keep]))
    mapped = np.column_stack([warp.maps[1].x[rows, columns], warp.maps[1].y[rows, columns]])[keep]
    return float(np.median(np.linalg.norm(mapped - true, axis=1)))


def test_three_frames_tell_more_than_one(clip: list[Pair], alone: list[Alignment], pooled: Alignment) -> None:
    errors = np.array([pose_errors(clip[0], one) for one in alone])
    assert (pose_errors(clip[0], pooled) < np.sqrt((errors**2).mean(axis=0))).all()
    maps = [map_error(clip[0], one) for one in alone]
    assert map_error(clip[0], pooled) < np.mean(maps) and map_error(clip[0], pooled) < 0.3


def test_every_frame_is_made_by_the_same_warp(clip: list[Pair], quick: StitchOptions) -> None:
    quick = replace(quick, fade="continue")
    pooled = align([frame_of(pair, quick) for pair in clip], quick, silent)
    results = [compose(frame_of(pair, quick), pooled, quick, Stopwatch(Progress())) for pair in clip]
    for one, pair in zip(results, clip, strict=True):
        assert np.array_equal(one.warp.maps[1].x, pooled.warp.maps[1].x) and one.warp.canvas == pooled.warp.canvas
        assert one.edges[0].two_view is pooled.edges[0].two_view and one.field is pooled.field
        assert all(map(np.array_equal, [p.view for p in one.pictures], (pair.reference, pair.target)))
        assert one.report["options"]["fade"] == "plane", "as used: what goes on beyond the overlap is one frame's"
    assert not np.array_equal(results[0].pixels, results[1].pixels)


def test_a_frame_that_shows_nothing_takes_nothing_away(
    clip: list[Pair], alone: list[Alignment], quick: StitchOptions
) -> None:
    fog = np.full((HEIGHT, WIDTH, 3), 200, np.uint8)
    blank = prepare([picture_from_array(fog)] * 2, quick)
    for frames in ([blank, frame_of(clip[0], quick)], [frame_of(clip[0], quick), blank]):
        found = align(frames, quick, silent)
        assert np.array_equal(found.warp.maps[1].x, alone[0].warp.maps[1].x, equal_nan=True)
    with pytest.raises(TooFewMatches, match="only 0 .* at least 16"):
        align([blank, blank], quick, silent)


def test_frames_of_other_sizes_are_refused(clip: list[Pair], quick: StitchOptions) -> None:
    cut = picture_from_array(np.ascontiguousarray(clip[1].target[:, :-1]))
    for frame in (
        prepare([picture_from_array(clip[1].reference), cut], quick),
        prepare([cut, picture_from_array(clip[1].target)], quick),
    ):
        with pytest.raises(BadRequest, match="differ in size"):
            align([frame_of(clip[0], quick), frame], quick, silent)


def test_a_pair_is_refined_and_a_clip_says_why_not(clip: list[Pair], quick: StitchOptions) -> None:
    asked, said = replace(quick, dense=True), []
    pair = align([frame_of(clip[0], asked)], asked, lambda stage, _: said.append(stage))
    assert pair.dense is not None and pair.dense.refined is not None and pair.warp.confidence is not None
    assert list(dict.fromkeys(said)) == ["features", "geometry", "field", "dense", "warp"]
    several = align([frame_of(one, asked) for one in clip[:2]], asked, silent)
    assert several.dense is not None and several.dense.refined is None and "swims" in several.dense.why
    plain = align([frame_of(one, quick) for one in clip[:2]], quick, silent)
    assert plain.dense is None and np.array_equal(several.warp.maps[1].x, plain.warp.maps[1].x, equal_nan=True)


def test_each_stage_is_told_and_features_climb(clip: list[Pair], quick: StitchOptions) -> None:
    said: list[tuple[str, float]] = []
    align([frame_of(pair, quick) for pair in clip[:2]], quick, lambda stage, share: said.append((stage, share)))
    assert list(dict.fromkeys(stage for stage, _ in said)) == ["features", "geometry", "field", "warp"]
    shares = [share for stage, share in said if stage == "features"]
    assert shares == sorted(shares) and shares[0] == 0 and len(shares) == 5 and shares[-1] < 1


def test_a_preview_makes_do_with_fewer_features_and_lands_in_the_same_place(
    small_pair: Pair, quick: StitchOptions, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pair_matches, "FEATURES", replace(FEATURES, preview_budget=500))
    frame = frame_of(small_pair, quick)
    real = features.detect
    asked: list[tuple[int, ...]] = []

    def detect(view: np.ndarray, alpha: np.ndarray | None, *most: int) -> features.Features:
        asked.append(most)
        return real(view, alpha, *most)

    monkeypatch.setattr(features, "detect", detect)
    found = {blend: align([frame], replace(quick, blend=blend), silent) for blend in ("feather", "linear")}
    assert asked == [(FEATURES.budget, FEATURES.pixels)] * 2 + [(500, FEATURES.preview_pixels)] * 2
    points = np.stack(np.meshgrid(np.linspace(60, 180, 7), np.linspace(30, 150, 7)), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(found["feather"].field.predict(points) - found["linear"].field.predict(points), axis=1)
    few, many = (len(found[blend].edges[0].matches) for blend in ("linear", "feather"))
    assert few < 0.8 * many and np.median(away) < 0.5


# --- matches given --------------------------------------------------------------------------------------------------


def rows_of(found: Alignment) -> np.ndarray:
    """The matches that the field stands on, as an array of the user's."""
    edge = found.edges[0]
    used = edge.matches.subset(np.flatnonzero(edge.two_view.inliers)[found.field.fit.inliers_used])
    return np.column_stack([used.x, used.y])


@pytest.fixture
def no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def forbidden(*_: object, **__: object) -> None:
        pytest.fail("nothing is searched where matches are given")

    monkeypatch.setattr(features, "detect", forbidden)
    monkeypatch.setattr(features, "match", forbidden)


@pytest.mark.usefixtures("no_search")
def test_given_matches_are_used_as_they_are(
    small_pair: Pair, alone: list[Alignment], quick: StitchOptions
) -> None:
    rows = np.column_stack([rows_of(alone[0]), np.linspace(0.5, 2, len(rows_of(alone[0])))])
    rows[7, 2:4] += 6  # off its line: the user knows better
    options = replace(quick, matches=rows)
    found = align([frame_of(small_pair, options)], options, silent)
    given = found.edges[0].matches
    assert np.array_equal(np.column_stack([given.x, given.y, given.weights]), rows)
    assert given.given and found.edges[0].two_view.inliers.all() and found.field.fit.inliers_used.all()
    assert any("given matches contradict the rest" in warning for warning in found.warnings)
    assert map_error(small_pair, found) < 0.4


@pytest.mark.usefixtures("no_search")
def test_given_matches_follow_the_scale(small_pair: Pair, alone: list[Alignment], quick: StitchOptions) -> None:
    """They are px of the full pictures, whatever is worked on."""
    rows = rows_of(alone[0])
    camera = replace(quick.camera, principal=((WIDTH - 1) / 2, (HEIGHT - 1) / 2))
    full, half = (replace(quick, camera=camera, matches=rows, scale=scale) for scale in (1.0, 0.5))
    at_full, at_half = (align([frame_of(small_pair, one)], one, silent) for one in (full, half))
    halved = at_half.edges[0].matches
    assert np.allclose(np.column_stack([halved.x, halved.y]), (rows + 0.5) / 2 - 0.5, atol=1e-12)
    ideal = at_full.edges[0].two_view.K.copy()
    ideal[:2] /= 2
    ideal[:2, 2] -= 0.25
    assert np.allclose(at_half.edges[0].two_view.K, ideal)
    assert rotation_angle(at_half.edges[0].two_view.R, at_full.edges[0].two_view.R) < 0.02
    sent = (at_half.field.predict((rows[:, :2] + 0.5) / 2 - 0.5) + 0.5) * 2 - 0.5
    assert np.abs(sent - at_full.field.predict(rows[:, :2])).max() < 0.5


@pytest.mark.usefixtures("no_search")
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_given_matches_in_masked_parts_are_dropped(
    small_pair: Pair, alone: list[Alignment], quick: StitchOptions, scale: float
) -> None:
    rows = rows_of(alone[0])
    mask, mask_too = np.zeros((2, HEIGHT, WIDTH), bool)
    mask[140:], mask_too[:60] = True, True
    options = replace(quick, matches=rows, ignore=(mask, mask_too), scale=scale)
    found = align([frame_of(small_pair, options)], options, silent)
    back = (np.column_stack([found.edges[0].matches.x, found.edges[0].matches.y]) + 0.5) / scale - 0.5
    expected = (rows[:, 1] < 139.5) & (rows[:, 3] > 59.5)
    assert 16 < expected.sum() < len(rows) - 20 and np.allclose(back, rows[expected], atol=1e-9)


def test_given_matches_that_are_all_masked_are_refused(
    small_pair: Pair, alone: list[Alignment], quick: StitchOptions
) -> None:
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[:, :20] = False  # the left edge, which the target does not see
    options = replace(quick, matches=rows_of(alone[0]), ignore=(mask,))
    with pytest.raises(NoOverlap, match="all the given matches lie in parts .* masked or transparent"):
        align([frame_of(small_pair, options)], options, silent)


def test_too_few_given_matches_are_refused(small_pair: Pair, alone: list[Alignment], quick: StitchOptions) -> None:
    options = replace(quick, matches=rows_of(alone[0])[:15])
    with pytest.raises(TooFewMatches, match="only 15 .*at least 16"):
        align([frame_of(small_pair, options)], options, silent)
