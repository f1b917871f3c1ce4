"""Cameras in the forms of other programs: written and read back they are the same; by which name which form."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.lens import undistort
from edf_stitch.core.cameras.lens_models import Lens, LensProjection
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.cameras.sources import read_camera_file
from edf_stitch.core.output.camera_file import FoundCamera, found_cameras
from edf_stitch.core.output.outputs import OutputRequest, check
from edf_stitch.core.output.programs.opencv_lens import opencv_model
from edf_stitch.core.output.programs.written import form_of, write_cameras
from edf_stitch.core.panorama.canvas import border
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.pose.match_files import read_matches_of_pairs
from edf_stitch.core.system.errors import BadRequest, DegenerateGeometry, UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles

FORMS = ["cameras.json", "transforms.json", "ab.pto", "model"]
LENSES = {
    "brown": (np.array([-0.1, 0.02, 0.001, -0.002, 0.003]), None),
    "fisheye": (np.zeros(5), Lens(LensProjection.EQUIDISTANT, (0.01, -0.002, 0.001, -0.0004))),
    "pinhole": (np.zeros(5), None),
}  # fmt: skip


def written(result: StitchResult, path: Path) -> list[str]:
    with OutputFiles() as files:
        return write_cameras(result, path, files)


def rays(K: np.ndarray, ideal: np.ndarray) -> np.ndarray:
    seen = homogeneous(ideal) @ np.linalg.inv(K).T
    unit: np.ndarray = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    return unit


@pytest.mark.parametrize("name", FORMS)
def test_what_is_written_is_read_back(name: str, of_four: StitchResult, tmp_path: Path) -> None:
    assert written(of_four, tmp_path / name) == []
    found = found_cameras(of_four)
    names = [one.name for one in found]
    read = read_camera_file(tmp_path / name, names, of_four.full_sizes)
    for one, camera in zip(found, read, strict=True):
        assert camera is not None and one.R is not None and one.t is not None
        pixels = border(camera.size)
        off = rays(camera.K, undistort(pixels, camera)) - rays(one.camera.K, undistort(pixels, one.camera))
        assert np.abs(off).max() < 1e-8
        if name.endswith(".pto"):
            assert camera.start is not None and read[0] is not None and read[0].start is not None
            assert np.abs(camera.start @ read[0].start.T - one.R).max() < 1e-9
        else:
            assert camera.pose is not None
            assert np.abs(camera.pose[0] - one.R).max() < 1e-9 and np.abs(camera.pose[1] - one.t).max() < 1e-9


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("name", ["transforms.json", "model"])
def test_every_lens_of_opencvs_is_read_back(lens: str, name: str, of_four: StitchResult, tmp_path: Path) -> None:
    distortion, model = LENSES[lens]
    views = tuple(
        replace(view, camera=replace(view.camera, distortion=distortion, lens=model)) for view in of_four.views
    )
    result = replace(of_four, views=views)
    written(result, tmp_path / name)
    names = [picture.name for picture in result.pictures]
    for camera in read_camera_file(tmp_path / name, names, result.full_sizes):
        assert camera is not None and np.allclose(camera.distortion, distortion, atol=1e-15) and camera.lens == model


def test_a_pair_is_written_too(small_result: StitchResult, tmp_path: Path) -> None:
    names = ["a.png", "b.png"]
    pictures = tuple(replace(one, name=name) for one, name in zip(small_result.pictures, names, strict=True))
    result = replace(small_result, pictures=pictures)
    for name in [*FORMS, "ab.chan"]:
        written(result, tmp_path / name)
    poses = [camera.pose for camera in read_camera_file(tmp_path / "model", names, result.full_sizes) if camera]
    assert len(poses) == 2 and poses[1] is not None
    assert np.abs(poses[1][0] - result.views[1].R).max() < 1e-9


def test_control_points_are_the_matches(of_four: StitchResult, tmp_path: Path) -> None:
    written(of_four, tmp_path / "ab.pto")
    names = [picture.name for picture in of_four.pictures]
    read = read_matches_of_pairs(tmp_path / "ab.pto", names, of_four.full_sizes, of_four.full_sizes)
    assert sorted(read) == sorted((edge.i, edge.j) for edge in of_four.edges)
    for edge in of_four.edges:
        ours = of_four.matches_of(edge).subset(of_four.used_of(edge))
        both = np.hstack([ours.x, ours.y])
        assert {tuple(row) for row in np.hstack([read[edge.i, edge.j].x, read[edge.i, edge.j].y]).round(9)} == {
            tuple(row) for row in both.round(9)
        }


@pytest.mark.parametrize(("name", "form"), [
    ("a.json", "json"), ("transforms.json", "transforms"), ("room_Transforms.JSON", "transforms"), ("a.PTO", "pto"),
    ("a.chan", "chan"), ("folder", "colmap"),
])  # fmt: skip
def test_the_name_says_the_form(name: str, form: str) -> None:
    assert form_of(Path(name)) == form


def test_a_folder_that_exists_may_have_an_ending(tmp_path: Path) -> None:
    folder = tmp_path / "model.1"
    folder.mkdir()
    assert form_of(folder) == "colmap"
    with pytest.raises(BadRequest, match=r"as .json, as transforms.json, as .pto"):
        form_of(tmp_path / "model.2")


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "images.txt").write_text("another one's")
    panorama = tmp_path / "p.png"
    for name, error in (("a.txt", BadRequest), ("model", Exception)):
        with OutputFiles() as files, pytest.raises(error, match=r"not as .txt|images.txt"):
            check(OutputRequest(panorama, cameras=tmp_path / name), files, ["a.png", "b.png"])
    with OutputFiles() as files:
        check(OutputRequest(panorama, cameras=tmp_path / "other"), files, ["a.png", "b.png"])


def test_a_lens_that_a_program_lacks_is_refused_by_name(of_four: StitchResult) -> None:
    found = found_cameras(of_four)[0]
    for lens, said in (
        (Lens(LensProjection.EQUISOLID), "equisolid lens as it is"),
        (Lens(ptlens=(0.0, 0.1, 0.0)), "rectilinear lens with a, b, c"),
    ):
        camera = replace(found.camera, distortion=np.zeros(5), lens=lens)
        with pytest.raises(UnwritableOutput, match=f"{found.name}: COLMAP has no model for its {said}; write"):
            opencv_model(FoundCamera(found.name, camera, found.R, found.t), "COLMAP")


def test_without_poses_only_our_own_form_is_written(small_result: StitchResult, tmp_path: Path) -> None:
    nowhere = tuple(replace(view, R=np.full((3, 3), np.nan)) for view in small_result.views)
    result = replace(small_result, views=nowhere)
    written(result, tmp_path / "a.json")
    with pytest.raises(DegenerateGeometry, match="no cameras were found"):
        written(result, tmp_path / "a.pto")
