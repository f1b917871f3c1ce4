"""A program that is wrong in one thing does not get through the door: `edf validate` exits with 1.

Pictures are rendered once and cameras found once. Each change is then made to what was found, as a wrong sign or a
forgotten term in the engine would, and all that follows from it is done and measured anew; rivals are kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.alignment import Geometry
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.projective import fundamental_from_pose, infinite_homography
from edf_stitch.core.cameras.rig import Rig
from edf_stitch.core.cameras.two_view import TwoView
from edf_stitch.core.field.refined_sphere import RefinedSphere
from edf_stitch.core.frames.frame import Frame
from edf_stitch.core.system.errors import StitchError
from edf_stitch.synthetic_scenes import scene_process, stitches, validation
from edf_stitch.synthetic_scenes.sets import measured_set, set_stitches
from edf_stitch.synthetic_scenes.validation import ValidationRequest, run_validation

pytestmark = pytest.mark.slow

PAIR, SET = "tabletop", "small_room"
CHANGED_WAYS = ("known/strict", "known/slack", set_stitches.OURS)
Change = Callable[[Any], Any]


def same(one: Any) -> Any:
    return one


@dataclass
class Door:
    """`edf validate` of one scene, in this process. Changes are made to what is known of the cameras, and to the frame
    whose pixels are composed."""

    folder: Path
    cameras: Change = same
    frame: Change = same
    found: dict[Any, Geometry] = field(default_factory=dict)
    kept: dict[Any, Any] = field(default_factory=dict)

    def failures(self, scene: str) -> set[str]:
        """The measures that miss their bars; the exit code is 1 if there are any, else 0."""
        request = ValidationRequest(self.folder, scenes=(scene,), overwrite=True)
        done = run_validation(request, lambda _: None)
        assert done.verdict is not None
        failed = {check.measure for check in done.verdict.failed}
        assert done.exit_code == bool(failed)
        return failed

    def measure(self, scene: str, request: ValidationRequest, mark: str) -> str:
        """Instead of a process."""
        width, height = request.size
        code = scene_process.main([scene, str(width), str(height), str(self.folder), mark])
        return "" if code == 0 else f"ended with {code}"

    def geometry(self, estimate: Callable[..., Geometry]) -> Callable[..., Geometry]:
        """Found once for each way in which cameras are known, then changed."""

        def found(frames: list[Frame], options: Any, progress: Any) -> Geometry:
            known = len(frames[0].pictures), options.camera.focal_px
            if known not in self.found:
                self.found[known] = estimate(frames, options, progress)
            geometry = self.found[known]
            if geometry.rig is not None:
                return replace(geometry, rig=self.cameras(geometry.rig))
            if not options.camera.focal_px:
                return geometry
            (edge,) = geometry.edges
            return replace(geometry, edges=(replace(edge, two_view=self.cameras(edge.two_view)),))

        return found

    def stitched(self, stitch: Callable[..., Any]) -> Callable[..., Any]:
        """Rivals, and stitches that are told nothing of the cameras, are made once, without any change."""

        def one(rendered: Any, way: str, shared: Any = None) -> Any:
            if way in CHANGED_WAYS:
                return stitch(rendered, way, shared)
            if way not in self.kept:
                changes, self.cameras, self.frame = (self.cameras, self.frame), same, same
                try:
                    self.kept[way] = stitch(rendered, way, {})
                finally:
                    self.cameras, self.frame = changes
            return self.kept[way]

        return one


@pytest.fixture(scope="module")
def door(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Door]:
    pytest.importorskip("bpy")
    door = Door(tmp_path_factory.mktemp("door"))

    def absent(*_: object) -> Any:
        raise StitchError("not asked here")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation._Running, "scene", door.measure)
        patch.setattr(measured_set, "installed", lambda: False)
        patch.setattr(measured_set, "stitcher_panorama", absent)
        for module in (stitches, set_stitches):
            compose = module.compose
            patch.setattr(module, "estimate_geometry", door.geometry(module.estimate_geometry))
            patch.setattr(module, "compose", lambda frame, *rest, made=compose: made(door.frame(frame), *rest))
        for using in (scene_process, measured_set):
            patch.setattr(using, "stitched", door.stitched(using.stitched))
        yield door


@pytest.fixture
def unchanged(door: Door) -> Iterator[Door]:
    yield door
    door.cameras = door.frame = same


@pytest.mark.parametrize("scene", [PAIR, SET])
def test_what_is_right_gets_through(scene: str, unchanged: Door) -> None:
    assert unchanged.failures(scene) == set()


def derived(view: TwoView) -> TwoView:
    """With all that follows from K, K', R and t."""
    return replace(
        view, F=fundamental_from_pose(view.K, view.K_prime, view.R, view.t), e_prime=view.K_prime @ view.t,
        H_inf=infinite_homography(view.K, view.K_prime, view.R),
    )  # fmt: skip


def changed_K(K: np.ndarray, scale: float = 1.0, shift: float | np.ndarray = 0.0) -> np.ndarray:
    out = K.copy()
    out[[0, 1], [0, 1]] *= scale
    out[:2, 2] += shift
    return out


OF_PAIRS: dict[str, tuple[Callable[[TwoView], TwoView], str]] = {
    "t's sign": (lambda view: derived(replace(view, t=-view.t)), "epipole_deg"),
    "the sign of e' alone": (lambda view: replace(view, e_prime=-view.e_prime), "slid_half_px"),
    "R transposed": (lambda view: derived(replace(view, R=view.R.T)), "rotation_deg"),
    "F transposed": (lambda view: replace(view, F=view.F.T), "f_px"),
    "principal points dropped": (
        lambda view: derived(replace(view, K=changed_K(view.K, shift=-view.K[:2, 2]),
                                     K_prime=changed_K(view.K_prime, shift=-view.K_prime[:2, 2]))), "h_inf_px",
    ),
    "the target's principal point half a pixel off": (
        lambda view: derived(replace(view, K_prime=changed_K(view.K_prime, shift=0.5))), "h_inf_px",
    ),
    "both principal points half a pixel off": (
        lambda view: derived(replace(view, K=changed_K(view.K, shift=0.5), K_prime=changed_K(view.K_prime, shift=0.5))),
        "slid_auto_reference_px",
    ),
    "both focal lengths 1 % off": (
        lambda view: derived(replace(view, K=changed_K(view.K, 1.01), K_prime=changed_K(view.K_prime, 1.01))),
        "h_inf_px",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_PAIRS)
def test_cameras_of_a_pair_that_are_wrong_do_not(name: str, unchanged: Door) -> None:
    unchanged.cameras, measure = OF_PAIRS[name]
    assert measure in unchanged.failures(PAIR)


def with_cameras(rig: Rig, change: Callable[[Camera], Camera], *numbers: int) -> Rig:
    return replace(rig, cameras=tuple(change(c) if k in numbers else c for k, c in enumerate(rig.cameras)))


def swapped(values: np.ndarray) -> np.ndarray:
    """Of the second and the third picture."""
    return values[[0, 2, 1, *range(3, len(values))]]


def of_one(values: np.ndarray, number: int, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    return np.array([change(value) if k == number else value for k, value in enumerate(values)])


OF_SETS: dict[str, tuple[Callable[[Rig], Rig], str]] = {
    "t's sign": (lambda rig: replace(rig, t=-rig.t), "left_out"),
    "the sign of one t": (lambda rig: replace(rig, t=of_one(rig.t, 2, np.negative)), "position_max_mm"),
    "the points' inverse ranges' sign": (lambda rig: replace(rig, inverse_ranges=-rig.inverse_ranges), "left_out"),
    "both signs": (lambda rig: replace(rig, t=-rig.t, inverse_ranges=-rig.inverse_ranges), "range_log"),
    "R transposed": (lambda rig: replace(rig, R=np.swapaxes(rig.R, 1, 2)), "left_out"),
    "one R transposed": (lambda rig: replace(rig, R=of_one(rig.R, 3, np.transpose)), "rotation_max_deg"),
    "two pictures' cameras swapped": (lambda rig: replace(rig, R=swapped(rig.R), t=swapped(rig.t)), "overlap_p90_px"),
    "two places swapped": (lambda rig: replace(rig, t=swapped(rig.t)), "position_max_mm"),
    "one focal length 1 % off": (
        lambda rig: with_cameras(rig, lambda c: replace(c, K=changed_K(c.K, 1.01)), 1), "focal_percent",
    ),
    "one principal point half a pixel off": (
        lambda rig: with_cameras(rig, lambda c: replace(c, K=changed_K(c.K, shift=0.5)), 3), "principal_px",
    ),
    "the distortion of one another lens's": (
        lambda rig: with_cameras(rig, lambda c: replace(c, distortion=c.distortion - np.eye(5)[0] * 0.02), 4),
        "k1_error",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_SETS)
def test_cameras_of_a_set_that_are_wrong_do_not(name: str, unchanged: Door) -> None:
    unchanged.cameras, measure = OF_SETS[name]
    assert measure in unchanged.failures(SET)


@pytest.mark.parametrize(("scene", "measure"), [(PAIR, "over_average_db"), (SET, "psnr_db")])
def test_two_pictures_pixels_swapped_do_not(scene: str, measure: str, unchanged: Door) -> None:
    unchanged.frame = lambda frame: replace(
        frame, pictures=(*frame.pictures[:-2], frame.pictures[-1], frame.pictures[-2])
    )
    assert measure in unchanged.failures(scene)


@pytest.mark.parametrize(("times", "plus"), [(1.05, 0.0), (1.0, 0.02), (-1.0, 0.0)])
def test_inverse_ranges_of_a_set_that_are_wrong_do_not(
    times: float, plus: float, unchanged: Door, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = RefinedSphere.at  # what is wrong with the smooth field alone, dense refinement mends

    def wrong(self: RefinedSphere, rays: np.ndarray) -> tuple[np.ndarray, ...]:
        d, *known = right(self, rays)
        return times * d + plus, *known

    monkeypatch.setattr(RefinedSphere, "at", wrong)
    assert unchanged.failures(SET) & {"range_log", "left_out"}
