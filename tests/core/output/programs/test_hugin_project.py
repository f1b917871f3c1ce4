"""Hugin projects of ours: lenses, angles, the frame, and whether Hugin's own maps are ours at infinity."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera
from edf_stitch.core.cameras.lens import distort, undistort
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.cameras.projective import homogeneous, project, rotation_from_angles
from edf_stitch.core.output.camera_file import FoundCamera, found_cameras
from edf_stitch.core.output.programs.hugin_frame import frame_of
from edf_stitch.core.output.programs.hugin_project import hugin_lens, hugin_project
from edf_stitch.core.output.programs.written import write_cameras
from edf_stitch.core.panorama.canvas import Canvas
from edf_stitch.core.panorama.projection import Projection
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.system.errors import UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles

K = np.array([[700.0, 0, 405.0], [0, 700.0, 290.5], [0, 0, 1]])
CAMERA = Camera(K, (800, 600), "test", 0.0)
with_hugin = pytest.mark.skipif(shutil.which("pano_trafo") is None, reason="hugin-tools are not installed")


@pytest.mark.parametrize("camera", [
    CAMERA, replace(CAMERA, distortion=np.array([-0.2, 0, 0, 0, 0])),
    replace(CAMERA, lens=Lens(LensProjection.EQUISOLID)),
    replace(CAMERA, lens=Lens(ptlens=(0.01, -0.03, 0.02), radius=0.6)),
    replace(CAMERA, lens=Lens(LensProjection.STEREOGRAPHIC, ptlens=(0.0, 0.02, 0.0), radius=0.4)),
])  # fmt: skip
def test_what_hugin_has_is_met(camera: Camera) -> None:
    lens = hugin_lens(camera, "a")
    assert lens.off < 1e-6
    assert np.allclose(lens.shift, (5.5, -9.0))


@pytest.mark.parametrize("lens", [Lens(LensProjection.EQUIDISTANT), Lens(LensProjection.EQUISOLID)])
def test_a_fisheyes_circle_is_met_by_what_is_used_of_it(lens: Lens) -> None:
    """Its corners lie beyond 180°, where no ray is, and what is further than 80° from the axis is not used."""
    circle = Camera(np.array([[180.0, 0, 309.5], [0, 180, 299.5], [0, 0, 1]]), (620, 600), "test", 0.0, lens=lens)
    found = hugin_lens(circle, "a")
    assert found.off < 1e-6 and np.allclose(found.abc, 0, atol=1e-9)
    bent = replace(circle, lens=Lens(LensProjection.EQUIDISTANT, angular=(0.02, -0.01, 0, 0)))
    assert hugin_lens(bent, "a").off < 1 and max(map(abs, hugin_lens(bent, "a").abc)) < 0.2


def test_what_hugin_lacks_is_fitted_and_said() -> None:
    camera = replace(CAMERA, distortion=np.array([-0.2, 0.1, 0.004, 0, 0]))
    lens = hugin_lens(camera, "a")
    assert 0.1 < lens.off < 6
    found = FoundCamera("a.png", camera, np.eye(3), np.zeros(3))
    canvas = Canvas(100, 50, (0, 0), projection=Projection("cylindrical", 300.0, (50, 25), np.eye(3), K))
    warnings = hugin_project([found], frame_of(canvas, K), [])[1]
    assert len(warnings) == 1 and "a.png: Hugin's lens" in warnings[0]


def test_names_and_pictures_that_its_lines_do_not_hold_are_refused() -> None:
    canvas = Canvas(100, 50, (0, 0), projection=Projection("cylindrical", 300.0, (50, 25), np.eye(3), K))
    frame = frame_of(canvas, K)
    with pytest.raises(UnwritableOutput, match="hold no such name"):
        hugin_project([FoundCamera('a"b.png', CAMERA, np.eye(3), np.zeros(3))], frame, [])
    wide = replace(CAMERA, K=np.array([[390.0, 0, 405.0], [0, 390.0, 290.5], [0, 0, 1]]), lens=Lens("orthographic"))
    with pytest.raises(UnwritableOutput, match="its picture is wider than the projection orthographic"):
        hugin_lens(wide, "a")


def off_hugin(
    project_file: Path, canvas: Canvas, corner: tuple[int, int], R: list[np.ndarray], cameras: list[Camera],
    own: np.ndarray,
) -> float:  # fmt: skip
    """px, at most, between where pano_trafo and we see points of a panorama at infinity."""
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 1, (300, 2)) * (canvas.width - 1, canvas.height - 1)
    flat = points - np.array(canvas.offset, float)
    rays = homogeneous(flat) @ np.linalg.inv(own).T if canvas.projection is None else canvas.projection.rays(flat)
    off = []
    for number, (turn, camera) in enumerate(zip(R, cameras, strict=True)):
        q = rays @ (camera.K @ turn).T
        ahead = np.flatnonzero(q[:, 2] > 0.1)
        ours = distort(project(q[ahead]), camera)
        inside = ((ours > 0) & (ours < np.array(camera.size) - 1)).all(axis=1)
        asked = "".join(f"{x} {y}\n" for x, y in points[ahead[inside]] + corner)
        out = subprocess.run(
            ["pano_trafo", "-r", project_file, str(number)], input=asked, capture_output=True, text=True, check=True
        ).stdout
        theirs = np.array([line.split() for line in out.splitlines()], float)
        assert len(theirs) == inside.sum() > 10
        off.append(np.abs(theirs - ours[inside]).max())
    return float(np.max(off))


@with_hugin
def test_hugin_sees_our_pictures_where_we_do_at_infinity(of_four: StitchResult, tmp_path: Path) -> None:
    with OutputFiles() as files:
        write_cameras(of_four, tmp_path / "a.pto", files)
    found, own = found_cameras(of_four), of_four.views[0].K
    corner = frame_of(of_four.canvas, own).corner
    turns = [view.R for view in of_four.views]
    assert off_hugin(tmp_path / "a.pto", of_four.canvas, corner, turns, [one.camera for one in found], own) < 0.01


@with_hugin
@pytest.mark.parametrize(("kind", "distance", "half", "most"), [
    ("perspective", 0.0, 0.0, 0.01), ("pannini", 0.0, 0.5, 0.01), ("pannini", 0.6, 0.5, 0.01),
    ("pannini", 1.0, 0.0, 0.01),
    ("cylindrical", 0.0, 0.3, 0.3), ("equirectangular", 0.0, 0.0, 0.01), (None, 0.0, 0.0, 0.01),
])  # fmt: skip
def test_every_projection_is_hugins(
    kind: str | None, distance: float, half: float, most: float, tmp_path: Path
) -> None:
    """The frame is cropped and looks aside; its middle may lie between pixels."""
    level = rotation_from_angles(20.0, -8.0, 5.0)
    projection = None if kind is None else Projection(kind, 400.0, (0.0, half), level, K, distance)
    canvas = Canvas(901, 500, (320, 170) if kind else (40, -20), projection=projection)
    cameras = [CAMERA, replace(CAMERA, lens=Lens(LensProjection.EQUIDISTANT))]
    turns = [np.eye(3), rotation_from_angles(15.0, 3.0, -20.0).T]
    found = [FoundCamera(name, camera, R, np.zeros(3)) for name, camera, R in zip("ab", cameras, turns, strict=True)]
    frame = frame_of(canvas, K)
    (tmp_path / "a.pto").write_bytes(hugin_project(found, frame, [])[0])
    # half a pixel at most lies between both panoramas; pictures have 1.75 times as many
    assert off_hugin(tmp_path / "a.pto", canvas, frame.corner, turns, cameras, K) < most * 1.75


def test_the_border_of_a_lens_is_where_it_was() -> None:
    """A polynomial that is read back moves every pixel as the one that was written."""
    camera = replace(CAMERA, distortion=np.array([0.05, 0, 0, 0, 0]))
    lens = hugin_lens(camera, "a")
    focal = 400 / np.tan(np.radians(lens.v) / 2)
    read = replace(
        camera, K=np.array([[focal, 0, 405.0], [0, focal, 290.5], [0, 0, 1]]), distortion=np.zeros(5),
        lens=Lens(ptlens=lens.abc, radius=300 / focal),
    )  # fmt: skip
    pixels = np.array([[0.0, 0], [799, 0], [400, 599], [10, 300]])
    first, second = (homogeneous(undistort(pixels, one)) @ np.linalg.inv(one.K).T for one in (camera, read))
    assert np.abs(first - second).max() < 1e-9
