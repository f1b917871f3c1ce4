"""Hugin projects: lenses and rotations as Panorama Tools have them, masks, control points."""

from __future__ import annotations

import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.lens import undistort
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.programs.hugin import read_cameras
from edf_stitch.core.cameras.projective import homogeneous
from edf_stitch.core.pose.match_files import read_matches, read_matches_of_pairs
from edf_stitch.core.system.errors import BadRequest

from .program_files import NAMES, PROJECT, SIZES, cameras, project

# Of Panorama Tools, by its pano_trafo: the lens, px of the image, and where it is on a sphere, degrees right and down.
SEEN = [
    ("f0 v60 r10 p20 y30 a0.01 b-0.03 c0.02 d10 e-7", (700, 100), (57.94089282, -28.3099842)),
    ("f3 v120", (700, 100), (49.01753538, -26.61911604)), ("f10 v120", (100, 400), (-47.50580646, 13.8972051)),
    ("f21 v120", (100, 400), (-44.9906058, 13.34597112)),
    ("f8 v120 b0.02", (700, 100), (45.55886022, -25.3609578)),
]  # fmt: skip


def directions(path: Path, pixel: tuple[float, float]) -> np.ndarray:
    """Degrees right and down of the panorama's middle in which the first camera sees a pixel."""
    camera = cameras(path)[0]
    assert camera.start is not None
    ray = homogeneous(undistort(np.array([pixel], float), camera)) @ np.linalg.inv(camera.K).T @ camera.start
    x, y, z = ray[0] / np.linalg.norm(ray[0])
    return np.degrees([np.arctan2(x, z), np.arcsin(y)])


def with_lens(folder: Path, lens: str) -> Path:
    return project(folder, f'p f2 w2000 h1000 v360\ni w800 h600 {lens} n"a.png"\ni w800 h600 f0 v50 n"b.png"\n')


@pytest.mark.parametrize(("lens", "pixel", "seen"), SEEN)
def test_a_pixel_is_seen_where_panorama_tools_see_it(
    lens: str, pixel: tuple[float, float], seen: tuple[float, float], tmp_path: Path
) -> None:
    assert np.abs(directions(with_lens(tmp_path, lens), pixel) - seen).max() < 1e-5


@pytest.mark.skipif(shutil.which("pano_trafo") is None, reason="hugin-tools are not installed")
@pytest.mark.parametrize("lens", [lens for lens, _, _ in SEEN] + ["f2 v170 r-40 p-30 y100 a0.01 b-0.02 c0.01 e20"])
def test_pano_trafo_itself_sees_the_same(lens: str, tmp_path: Path) -> None:
    path = with_lens(tmp_path, lens)
    for pixel in ((650.0, 130.0), (200.0, 380.0), (405.5, 290.5)):
        out = subprocess.run(
            ["pano_trafo", path, "0"], input=f"{pixel[0]} {pixel[1]}\n", capture_output=True, text=True, check=True
        ).stdout
        x, y = map(float, out.split())
        assert np.abs(directions(path, pixel) - ((x - 999.5) * 0.18, (y - 499.5) * 0.18)).max() < 1e-5


def test_lenses_are_shared_and_rotations_hold_nothing(tmp_path: Path) -> None:
    first, second = cameras(project(tmp_path))
    assert np.array_equal(first.K, second.K) and first.lens == second.lens and first.bent
    assert first.pose is None and first.log_sigma == INTRINSICS.exif_sigma and first.principal_sigma > 0
    assert second.start is not None and np.allclose(second.start[0, 2], np.sin(np.radians(5.5)))


def test_the_field_of_view_of_a_fisheye_holds(tmp_path: Path) -> None:
    assert cameras(with_lens(tmp_path, "f3 v120"))[0].fixed


@pytest.mark.parametrize(("kinds", "hidden"), [
    ("01", (1, 0)), ("11", (0, 0)), ("21", (1, 0)), ("41", (1, 1)), ("00", (1, 1)), ("44", (2, 2)),
])  # fmt: skip
def test_masks_that_exclude_are_left_out(kinds: str, hidden: tuple[int, int], tmp_path: Path) -> None:
    """Of the image, of its stack, or of its lens, which both share; those that include are only wishes."""
    text = PROJECT.replace("k i0 t0", f"k i0 t{kinds[0]}").replace("k i1 t1", f"k i1 t{kinds[1]}")
    entries = read_cameras(text, "ab.pto")
    assert tuple(len(entry.get("ignore", [])) for entry in entries.values()) == hidden
    if hidden[0]:
        assert next(iter(entries.values()))["ignore"][0] == [[0, 0], [99, 0], [99, 49], [0, 49]]


def test_control_points_are_matches(tmp_path: Path) -> None:
    path = project(tmp_path)
    matches = read_matches(path, *SIZES, names=NAMES)
    assert matches.given
    assert matches.x.tolist() == [[10.5, 20], [3, 4]] and matches.y.tolist() == [[30, 40.25], [1, 2]]
    by_pair = read_matches_of_pairs(path, [*NAMES, "c.png"], [*SIZES, (800, 600)], [*SIZES, (800, 600)])
    assert list(by_pair) == [(0, 1)] and np.array_equal(by_pair[0, 1].x, matches.x)


def test_a_point_outside_is_refused_with_its_line(tmp_path: Path) -> None:
    path = project(tmp_path, PROJECT.replace("x10.5", "x1e9"))
    with pytest.raises(BadRequest, match=r"ab.pto, line 11: .*1e\+09"):
        read_matches(path, *SIZES, names=NAMES)


@pytest.mark.parametrize(("old", "new", "said"), [
    ("f0 v60", "f4 v60", "line 7: the lens f4 is an equirectangular panorama"),
    ("f0 v60", "f99 v60", "f99 is not known"),
    ("v60 ", "", "line 7: the image has no v"), ("v60", "v180", "line 7: the field of view v is 180°"),
    ("v60", "v6x0", "line 7: v is '6x0'; a number"), ("w800", "w0", "line 7: a picture of 0 × 600"),
    ("g0 t0", "g3 t0", "line 7: the image is sheared"), ('n"b.png"', "", "line 8: the image has no name"),
    ('n"b.png"', 'n"C:\\pictures\\a.png"', "is in it twice"),
    ("c n0 N1", "c n0 N7", "line 11: a control point of images 0 and 7; there are 2"),
    ("x10.5", "xx", "line 11: x is"), ("k i0 t0", "k i5 t0", "a mask is of image 5"),
    ('p"0 0 99 0 99 49 0 49"', 'p"0 0 99"', "line 14: a mask needs"), ('p"0 0 99', 'p"0 0 no', "line 14: a corner"),
])  # fmt: skip
def test_damage_is_refused_with_its_line(old: str, new: str, said: str, tmp_path: Path) -> None:
    assert old in PROJECT
    with pytest.raises(BadRequest, match=said):
        cameras(project(tmp_path, PROJECT.replace(old, new, 1)))


def test_images_that_refer_to_each_other_in_a_circle_end(tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match="v is"):
        cameras(project(tmp_path, PROJECT.replace("v60", "v=1")))


def test_long_chains_of_lenses_and_masks_of_all_take_no_time() -> None:
    head = 'p f2\ni w8 h6 f0 v50 n"0.png"\n'
    chain = "".join(f'i w8 h6 f0 v={k} a={k} n"{k + 1}.png"\n' for k in range(3000))
    began = time.process_time()
    with pytest.raises(BadRequest, match="v is '=[0-9]+'; a number is needed"):
        read_cameras(head + chain, "x.pto")
    alike = "".join(f'i w8 h6 f0 v=0 n"{k + 1}.png"\n' for k in range(1000))
    masks = "".join(f'k i{k} t4 p"0 0 9 0 9 4"\n' for k in range(1000))
    assert {len(one["ignore"]) for one in read_cameras(head + alike + masks, "x.pto").values()} == {1000}
    assert time.process_time() - began < 5, "it took 15 s"
    with pytest.raises(BadRequest, match="at most 5000 of each"):
        read_cameras(head + alike * 6, "x.pto")
