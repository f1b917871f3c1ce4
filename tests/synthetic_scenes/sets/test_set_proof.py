"""The truth of a set proves itself, and whatever is wrong with it fails the proof."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector
from edf_stitch.synthetic_scenes.recipes import View
from edf_stitch.synthetic_scenes.scene_camera import SceneCamera
from edf_stitch.synthetic_scenes.sets.bent_lens import ideal_camera, through_lens
from edf_stitch.synthetic_scenes.sets.set_proof import SphereProof
from edf_stitch.synthetic_scenes.sets.set_thresholds import PROOF
from edf_stitch.synthetic_scenes.sets.sphere_camera import SphereCamera

from .analytic_room import camera_passes, camera_rays, sphere_passes, sphere_rays

SIZE = (160, 120)
VIEWS = (View(lens=24.0), View((0.3, 0.1, 1.4), 25.0, 5.0, 3.0, 24.0), View((-0.4, 0.2, 1.6), -28.0, -4.0, 2.0, 24.0))
Change = Callable[[dict[str, Any]], None]


def made() -> dict[str, Any]:
    """All that a proof is made of."""
    cameras = [view.camera(SIZE) for view in VIEWS]
    sphere = SphereCamera(cameras[0].place, (600, 300))
    return {
        "sphere": sphere, "passes": sphere_passes(sphere), "rays": sphere_rays(sphere, cameras), "cameras": cameras,
        "seen": [camera_passes(camera) for camera in cameras], "cast": [camera_rays(camera) for camera in cameras],
    }  # fmt: skip


def missed(parts: dict[str, Any]) -> set[str]:
    """Which limits the proof misses."""
    proof = SphereProof(parts["sphere"], parts["passes"], parts["rays"])
    for seen, camera, cast in zip(parts["seen"], parts["cameras"], parts["cast"], strict=True):
        proof.add(seen, camera, cast)
    figures = proof.figures()
    return {limit.measure for limit in PROOF if not limit.holds(figures[limit.measure])}


def test_the_truth_is_proved() -> None:
    assert missed(made()) == set()


def bent_missed(told: float) -> set[str]:
    """Which limits are missed where a lens with k1 = -0.08 is said to have another."""
    parts = made()
    camera = replace(parts["cameras"][1], k1=-0.08)
    ideal, corner = ideal_camera(camera)
    seen = camera_passes(ideal)
    proof = SphereProof(parts["sphere"], parts["passes"], parts["rays"][:, [0, 1, 2, 4]])
    proof.add(seen, ideal, camera_rays(ideal))
    proof.add_bent(*through_lens(seen, camera, corner), replace(camera, k1=told))
    figures = proof.figures()
    return {limit.measure for limit in PROOF if not limit.holds(figures[limit.measure])}


def test_a_bent_picture_is_proved_and_one_without_its_distortion_fails() -> None:
    assert bent_missed(-0.08) == set()
    for told in (0.0, 0.08):
        assert "sphere_psnr_db" in bent_missed(told), told


def turned(camera: SceneCamera, degrees: float) -> SceneCamera:
    R = rotation_from_vector(np.radians([0, degrees, 0])) @ camera.R
    return SceneCamera(camera.K, R, -R @ camera.place, camera.size)


def moved(camera: SceneCamera, metres: float) -> SceneCamera:
    return replace(camera, t=camera.t + np.array([metres, 0, 0]))


def change_camera(by: Callable[[SceneCamera], SceneCamera]) -> Change:
    def change(parts: dict[str, Any]) -> None:
        parts["cameras"][1] = by(parts["cameras"][1])

    return change


def change_passes(of: str, **by: Callable[[np.ndarray], np.ndarray]) -> Change:
    def change(parts: dict[str, Any]) -> None:
        if of == "sphere":
            old = parts["passes"]
            parts["passes"] = replace(old, **{name: way(getattr(old, name)) for name, way in by.items()})
        else:
            old = parts["seen"][1]
            parts["seen"][1] = replace(old, **{name: way(getattr(old, name)) for name, way in by.items()})

    return change


def change_sphere(**by: Any) -> Change:
    return lambda parts: parts.update(sphere=replace(parts["sphere"], **by))


def change_rays(column: int, factor: float) -> Change:
    def change(parts: dict[str, Any]) -> None:
        parts["rays"][:, column] *= factor

    return change


def swapped(parts: dict[str, Any]) -> None:
    parts["seen"][1], parts["seen"][2] = parts["seen"][2], parts["seen"][1]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (change_camera(lambda camera: turned(camera, 0.01)), "position_px"),
        (change_camera(lambda camera: replace(camera, R=camera.R.T)), "position_px"),
        (change_camera(lambda camera: moved(camera, 1e-3)), "position_px"),
        (change_camera(lambda camera: replace(camera, t=-camera.t)), "position_px"),
        (change_camera(lambda camera: replace(camera, K=camera.K * [[1.001], [1.001], [1]])), "position_px"),
        (swapped, "position_px"),
        (change_passes("camera", depth=lambda depth: depth * np.float32(1.0001)), "depth_relative"),
        (change_passes("camera", depth=lambda depth: depth * np.float32(1.0001)), "ray_cast_relative"),
        (change_passes("camera", depth=lambda depth: depth[:, ::-1]), "visibility_wrong"),
        (change_passes("camera", light=lambda light: np.roll(light, 1, axis=1)), "sphere_psnr_db"),
        (change_passes("sphere", position=lambda position: np.roll(position, 1, axis=1)), "direction_deg"),
        (change_passes("sphere", position=lambda position: position * np.float32([1, 1, -1])), "direction_deg"),
        (change_passes("sphere", light=lambda light: np.roll(light, 1, axis=1)), "sphere_psnr_db"),
        (change_sphere(place=np.array([0.0, 0.001, 1.5])), "distance_relative"),
        (change_rays(2, 1.0001), "distance_relative"),
        (change_rays(4, 0.5), "visibility_wrong"),
    ],
)  # fmt: skip
def test_a_break_of_any_fails_it(change: Change, expected: str) -> None:
    parts = made()
    change(parts)
    assert expected in missed(parts)
