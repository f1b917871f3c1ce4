"""Where intrinsics come from: the order of the sources, what is believed of each, and what is refused or warned of."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.camera import Camera, Knowledge
from edf_stitch.core.cameras.options import INTRINSICS
from edf_stitch.core.cameras.projective import rotation_angle, rotation_from_vector
from edf_stitch.core.cameras.sources import (
    CameraRequest,
    cameras_for,
    read_camera_file,
)
from edf_stitch.core.pictures.metadata import Exif
from edf_stitch.core.system.errors import BadRequest, UnreadableImage
from hypothesis import given, settings
from hypothesis import strategies as st

ASSUMED_SIGMA, CROPPED_SIGMA, EXIF_SIGMA = INTRINSICS.assumed_sigma, INTRINSICS.cropped_sigma, INTRINSICS.exif_sigma

LANDSCAPE, PORTRAIT = (4000, 3000), (3000, 4000)
NAMES = ("left.jpg", "right.jpg")
NOTHING = Exif()
DIAGONAL = math.hypot(4000, 3000)  # 5000 px
FULL_FRAME = math.hypot(36, 24)  # 43.27 mm
K_LEFT, K_RIGHT = [[3100, 0, 2010.5], [0, 3090, 1490]], [[3300, 2.5, 1990], [0, 3310, 1500.25]]
R_LEFT, R_RIGHT = (rotation_from_vector(np.array(v)).tolist() for v in ((0.1, 0.2, 0.3), (0.1, 0.1, 0.25)))


def cameras(
    request: CameraRequest | None = None, exif: Exif = NOTHING, exif_prime: Exif | None = None,
    size: tuple[int, int] = LANDSCAPE, size_prime: tuple[int, int] | None = None,
) -> tuple[Camera, Camera, list[str]]:  # fmt: skip
    """Both cameras and the warnings; the target is like the reference unless something else is said."""
    exifs = (exif, exif if exif_prime is None else exif_prime)
    pair, warnings = cameras_for(request or CameraRequest(), NAMES, (size, size_prime or size), exifs)
    return *pair, warnings


def entry(K: list[list[float]], **more: object) -> dict[str, object]:
    return {"K": [*K, [0, 0, 1]], **more}


# --- what the user gives -------------------------------------------------------------------------------------------


def test_a_focal_length_in_pixels_is_taken_as_it_is_and_fixed() -> None:
    first, second, warnings = cameras(CameraRequest(focal_px=(2345.5,)))
    for camera in (first, second):
        assert np.array_equal(camera.K, [[2345.5, 0, 1999.5], [0, 2345.5, 1499.5], [0, 0, 1]])
        assert camera.fixed and not camera.assumed and camera.log_sigma == 0
        assert camera.size == LANDSCAPE and camera.pose is None and not camera.distortion.any()
        assert "given" in camera.source
    assert warnings == []


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
def test_millimetres_with_the_sensors_width_count_along_the_longer_side(size: tuple[int, int]) -> None:
    first, _, _ = cameras(CameraRequest(focal_mm=(18.0,), sensor_mm=(36.0,)), size=size)
    assert first.focal == pytest.approx(2000) and first.fixed
    assert np.array_equal(first.K[:2, 2], (np.array(size) - 1) / 2)


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
def test_a_given_35_mm_equivalent_counts_by_the_diagonal(size: tuple[int, int]) -> None:
    first, _, _ = cameras(CameraRequest(focal35=(28.0,)), size=size)
    assert first.focal == pytest.approx(28 * DIAGONAL / FULL_FRAME) and first.fixed


def test_two_values_are_reference_and_target_and_one_serves_both() -> None:
    sizes = {"size": (4000, 3000), "size_prime": (2000, 1500)}
    first, second, _ = cameras(CameraRequest(focal_px=(3000, 1700)), **sizes)
    assert (first.focal, second.focal) == (3000, 1700)
    first, second, _ = cameras(CameraRequest(focal35=(28, 50)), **sizes)
    assert first.focal == pytest.approx(28 * 5000 / FULL_FRAME)
    assert second.focal == pytest.approx(50 * 2500 / FULL_FRAME)
    first, second, _ = cameras(CameraRequest(focal_mm=(18, 35), sensor_mm=(36, 23.5)), **sizes)
    assert (first.focal, second.focal) == pytest.approx((2000, 35 / 23.5 * 2000))
    # one sensor, two focal lengths, and the other way round
    first, second, _ = cameras(CameraRequest(focal_mm=(18, 35), sensor_mm=(36,)), **sizes)
    assert (first.focal, second.focal) == pytest.approx((2000, 35 / 36 * 2000))
    first, second, _ = cameras(CameraRequest(focal_mm=(18,), sensor_mm=(36, 24)), **sizes)
    assert (first.focal, second.focal) == pytest.approx((2000, 1500))


def test_the_principal_point_moves_in_one_picture_or_in_both() -> None:
    first, second, _ = cameras(CameraRequest(focal_px=(3000,), principal=(1900, 1550)))
    assert np.array_equal(first.K, [[3000, 0, 1900], [0, 3000, 1550], [0, 0, 1]])
    assert np.array_equal(second.K, first.K)
    first, second, _ = cameras(CameraRequest(principal=(1900, 1550, 2100, 1400)))
    assert first.K[:2, 2].tolist() == [1900, 1550] and second.K[:2, 2].tolist() == [2100, 1400]
    assert first.focal == second.focal == 3600 and first.assumed


@pytest.mark.parametrize(
    "wrong",
    [
        {"focal_px": (3000,), "focal35": (28,)},
        {"focal_px": (3000,), "focal_mm": (18,), "sensor_mm": (36,)},
        {"focal35": (28,), "cameras": {}},
        {"focal_px": (3000,), "cameras": "file.json"},
        {"focal_mm": (18,)},
        {"sensor_mm": (36,)},
        {"focal_px": (3000,), "sensor_mm": (36,)},
        {"focal_px": (0,)},
        {"focal_px": (-3000,)},
        {"focal_px": (3000, math.nan)},
        {"focal35": (math.inf,)},
        {"focal_mm": (18,), "sensor_mm": (0,)},
        {"focal_px": (1, 2, 3)},
        {"focal_mm": (18,), "sensor_mm": (36, 36, 36)},
        {"principal": (1,)},
        {"principal": (1, 2, 3)},
        {"principal": (1, 2, 3, 4, 5)},
        {"principal": (1, math.nan)},
    ],
)
def test_calls_that_contradict_themselves_are_refused(wrong: dict[str, tuple[float, ...]]) -> None:
    with pytest.raises(BadRequest) as caught:
        CameraRequest(**wrong)
    assert caught.value.exit_code == 2 and len(str(caught.value)) > 20


# --- EXIF ----------------------------------------------------------------------------------------------------------

IPHONE = {"make": "Apple", "model": "iPhone 7", "focal_mm": 3.99}  # in the sensor table with 6.0 mm
PLANE = {"focal_mm": 20.0, "focal_plane_x_per_mm": 160.0, "width": 4000, "height": 3000}


def test_what_is_given_wins_over_exif() -> None:
    exif = Exif(focal35_mm=28.0)
    for request in (CameraRequest(focal_px=(1111,)), CameraRequest(focal_mm=(10,), sensor_mm=(36,))):
        first, second, _ = cameras(request, exif)
        assert "given" in first.source and first.fixed and second.fixed
    assert cameras(CameraRequest(focal_px=(1111,)), exif)[0].focal == 1111


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
def test_exifs_35_mm_equivalent_comes_first(size: tuple[int, int]) -> None:
    first, second, warnings = cameras(exif=Exif(**IPHONE, focal35_mm=28.0), size=size)
    for camera in (first, second):
        assert camera.focal == pytest.approx(28 * DIAGONAL / FULL_FRAME)
        assert camera.log_sigma == EXIF_SIGMA and not camera.fixed and not camera.assumed
        assert "35 mm" in camera.source
    assert warnings == []  # the table says 3325 px, the equivalent 3236 px


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
def test_then_the_focal_length_with_the_sensor_table(size: tuple[int, int]) -> None:
    first, _, warnings = cameras(exif=Exif(**IPHONE), size=size)
    assert first.focal == pytest.approx(3.99 / 6.0 * DIAGONAL)
    assert "table" in first.source and first.log_sigma == EXIF_SIGMA and warnings == []
    both = Exif(**IPHONE, focal_plane_x_per_mm=830.0, width=max(size), height=min(size))
    assert "table" in cameras(exif=both, size=size)[0].source


def test_then_the_sensors_resolution_also_for_a_shrunk_or_turned_picture() -> None:
    first, _, warnings = cameras(exif=Exif(**PLANE))
    assert first.focal == pytest.approx(20 * 160) and "resolution" in first.source and warnings == []
    first, _, warnings = cameras(exif=Exif(**PLANE), size=(1000, 750))
    assert first.focal == pytest.approx(20 * 160 / 4) and warnings == []
    turned = {**PLANE, "width": 3000, "height": 4000}
    first, _, warnings = cameras(exif=Exif(**turned), size=PORTRAIT)
    assert first.focal == pytest.approx(20 * 160) and warnings == []


@pytest.mark.parametrize("size", [LANDSCAPE, PORTRAIT])
def test_knowing_nothing_is_assumed_and_said(size: tuple[int, int]) -> None:
    for exif in (NOTHING, Exif(focal_mm=20.0), Exif(make="Apple", model="iPhone 7")):
        first, second, warnings = cameras(exif=exif, size=size)
        assert first.focal == second.focal == pytest.approx(0.9 * 4000)
        assert first.assumed and not first.fixed and first.log_sigma == ASSUMED_SIGMA
        assert "assumed" in first.source and warnings == []


def test_the_order_stands_as_a_whole() -> None:
    """Taking away one source after the other brings up the next."""
    everything = {**IPHONE, "focal35_mm": 28.0, "focal_plane_x_per_mm": 830.0, "width": 4000, "height": 3000}
    sources = [cameras(CameraRequest(focal_px=(3000,)), Exif(**everything))[0].source]
    for gone in (None, "focal35_mm", "model", "focal_plane_x_per_mm"):
        everything.pop(gone, None)
        sources.append(cameras(exif=Exif(**everything))[0].source)
    words = ("given", "35 mm", "table", "resolution", "assumed")
    assert all(word in source for word, source in zip(words, sources, strict=True)), sources


def test_a_digital_zoom_counts_beside_the_sensors_size() -> None:
    """It enlarges the middle of the sensor; in the 35 mm equivalent makers have counted it."""
    plain, _, _ = cameras(exif=Exif(**IPHONE))
    zoomed, _, _ = cameras(exif=Exif(**IPHONE, digital_zoom=2.0))
    assert zoomed.focal == pytest.approx(2 * plain.focal) and "digital zoom 2" in zoomed.source
    counted, _, _ = cameras(exif=Exif(focal35_mm=56.0, digital_zoom=2.0))
    assert counted.focal == pytest.approx(cameras(exif=Exif(focal35_mm=56.0))[0].focal)


def test_a_resolution_that_makes_no_sensor_counts_less() -> None:
    """4000 px at 650 a mm make the sensor of a small camera, 1000 px at the same resolution none that there is."""
    for width, height, sigma in ((4000, 3000, INTRINSICS.exif_sigma), (1000, 750, INTRINSICS.cropped_sigma)):
        exif = Exif(focal_mm=5.0, focal_plane_x_per_mm=650.0, focal_plane_y_per_mm=650.0, width=width, height=height)
        first, _, _ = cameras(exif=exif, size=(width, height))
        assert first.log_sigma == sigma


def test_nonsense_in_exif_is_passed_over() -> None:
    first, _, _ = cameras(exif=Exif(**IPHONE, focal35_mm=1.0))  # 116 px across 4000
    assert "table" in first.source
    first, _, _ = cameras(exif=Exif(focal35_mm=9000.0))
    assert first.assumed


def test_exif_that_contradicts_itself_is_warned_of() -> None:
    first, _, warnings = cameras(exif=Exif(**IPHONE, focal35_mm=50.0), exif_prime=Exif(focal35_mm=50.0))
    assert "35 mm" in first.source
    assert len(warnings) == 1
    for word in ("reference", "contradicts", "5778", "3325"):
        assert word in warnings[0]
    _, _, warnings = cameras(exif=Exif(focal35_mm=50.0), exif_prime=Exif(**IPHONE, focal35_mm=50.0))
    assert len(warnings) == 1 and "target" in warnings[0]


def test_a_cropped_picture_is_believed_less_and_warned_of() -> None:
    exif = Exif(focal35_mm=28.0, width=4000, height=3000)
    whole, cropped, warnings = cameras(exif=exif, size=LANDSCAPE, size_prime=(4000, 2000))
    assert whole.log_sigma == EXIF_SIGMA and cropped.log_sigma == CROPPED_SIGMA
    assert len(warnings) == 1
    for word in ("target", "cropped", "4000×3000", "4000×2000"):
        assert word in warnings[0]
    # shrunk or turned is not cropped
    for size in ((1000, 750), (3000, 4000), (1001, 750)):
        assert cameras(exif=exif, size=size)[0].log_sigma == EXIF_SIGMA
        assert cameras(exif=exif, size=size)[2] == []


@pytest.mark.parametrize("known_first", [True, False])
def test_an_unknown_picture_borrows_the_focal_length_of_the_other(known_first: bool) -> None:
    known, other = Exif(focal35_mm=28.0), NOTHING
    exifs = (known, other) if known_first else (other, known)
    sizes = (LANDSCAPE, (2000, 1500)) if known_first else ((2000, 1500), LANDSCAPE)
    first, second, _ = cameras(None, *exifs, *sizes)
    knows, borrows = (first, second) if known_first else (second, first)
    assert knows.focal == pytest.approx(28 * DIAGONAL / FULL_FRAME) and knows.log_sigma == EXIF_SIGMA
    assert borrows.focal == pytest.approx(knows.focal / 2)  # the same lens, half the pixels
    assert borrows.log_sigma == CROPPED_SIGMA and not borrows.assumed
    assert borrows.knowledge == knows.knowledge == Knowledge.EXIF  # one piece of knowledge: it must not count twice
    assert "other picture" in borrows.source and "35 mm" in borrows.source
    assert borrows.size == (2000, 1500) and borrows.K[:2, 2].tolist() == [999.5, 749.5]


@settings(max_examples=40)
@given(st.floats(8, 300), st.integers(400, 9000), st.integers(400, 9000), st.floats(0.2, 3))
def test_scaling_or_turning_a_picture_scales_its_focal_length(f35: float, w: int, h: int, factor: float) -> None:
    exif = Exif(focal35_mm=f35)
    scaled = (round(w * factor), round(h * factor))
    first, second, _ = cameras(exif=exif, size=(w, h), size_prime=scaled)
    if first.assumed or second.assumed:  # beyond what is believed of any lens
        assert f35 / FULL_FRAME * math.hypot(w, h) > 49 * max(w, h) or f35 < 0.3 * FULL_FRAME
        return
    assert second.focal / first.focal == pytest.approx(math.hypot(*scaled) / math.hypot(w, h))
    turned, _, _ = cameras(exif=exif, size=(h, w))
    assert turned.focal == pytest.approx(first.focal)


# --- the camera itself ---------------------------------------------------------------------------------------------


def test_a_camera_can_be_scaled() -> None:
    first, _ = read_camera_file({"cameras": {"reference": entry(K_RIGHT), "target": entry(K_LEFT)}}, NAMES,
                                (LANDSCAPE, LANDSCAPE))  # fmt: skip
    assert np.array_equal(first.scaled(2.0), [[6600, 2.5, 1990], [0, 6620, 1500.25], [0, 0, 1]])
    assert first.focal == 3300 and first.K[0, 0] == 3300  # the camera itself stays


# --- camera files --------------------------------------------------------------------------------------------------


def read(content: object, names: tuple[str, str] = NAMES) -> tuple[Camera, Camera]:
    return read_camera_file(content, names, (LANDSCAPE, PORTRAIT))  # type: ignore[arg-type]


@pytest.mark.parametrize("keys", [NAMES, ("reference", "target"), ("left.jpg", "target"), ("reference", "right.jpg")])
@pytest.mark.parametrize("wrapped", [True, False])
def test_a_camera_file_names_pictures_or_roles(keys: tuple[str, str], wrapped: bool) -> None:
    # the target first: the order in the file means nothing
    table = {"other.jpg": {"K": "nonsense"}, keys[1]: entry(K_RIGHT), keys[0]: entry(K_LEFT)}
    first, second = read({"cameras": table} if wrapped else table)
    assert np.array_equal(first.K, [*K_LEFT, [0, 0, 1]]) and np.array_equal(second.K, [*K_RIGHT, [0, 0, 1]])
    assert first.size == LANDSCAPE and second.size == PORTRAIT
    for camera in (first, second):
        assert camera.fixed and camera.pose is None and not camera.distortion.any()
        assert camera.source == "camera file"


def test_a_pictures_own_name_comes_before_its_role() -> None:
    table = {"reference": entry(K_RIGHT), "left.jpg": entry(K_LEFT), "target": entry(K_RIGHT)}
    assert read({"cameras": table})[0].focal == 3100


def test_poses_and_distortion_come_along() -> None:
    first, second = read({"cameras": {
        "reference": entry(K_LEFT, R=R_LEFT, t=[1, 2, 3], distortion=[-0.1, 0.02]),
        "target": entry(K_RIGHT, R=R_RIGHT, t=[-1, 0.5, 0], distortion=[-0.1, 0.02, 1e-3, -1e-3, 0.01]),
    }})  # fmt: skip
    assert first.pose is not None and second.pose is not None
    assert np.allclose(first.pose[0], R_LEFT, atol=1e-12) and first.pose[1].tolist() == [1, 2, 3]
    assert np.allclose(second.pose[0], R_RIGHT, atol=1e-12) and second.pose[1].tolist() == [-1, 0.5, 0]
    assert first.distortion.tolist() == [-0.1, 0.02, 0, 0, 0]
    assert second.distortion.tolist() == [-0.1, 0.02, 1e-3, -1e-3, 0.01]


def test_a_rotation_written_with_few_digits_becomes_a_true_rotation() -> None:
    rounded = np.round(R_LEFT, 4).tolist()
    table = {"reference": entry(K_LEFT, R=rounded, t=[0, 0, 0]), "target": entry(K_LEFT, R=R_RIGHT, t=[1, 0, 0])}
    R, _ = read({"cameras": table})[0].pose or pytest.fail("no pose")
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14) and np.linalg.det(R) == pytest.approx(1)
    assert rotation_angle(R, np.array(R_LEFT)) < 0.01


def test_the_file_is_read_and_its_principal_point_can_be_overruled(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"cameras": {"reference": entry(K_LEFT), "target": entry(K_RIGHT)}}), "utf-8")
    for source in (path, str(path)):
        first, second, warnings = cameras(CameraRequest(cameras=source), Exif(focal35_mm=28.0))
        assert (first.focal, second.focal) == (3100, 3300) and warnings == []
    first, second, _ = cameras(CameraRequest(cameras=path, principal=(1, 2, 3, 4)))
    assert first.K[:2, 2].tolist() == [1, 2] and second.K[:2, 2].tolist() == [3, 4]


def test_a_file_that_cannot_be_read_is_not_a_wrong_call(tmp_path: Path) -> None:
    for path in (tmp_path / "missing.json", tmp_path):
        with pytest.raises(UnreadableImage) as caught:
            read(path)
        assert caught.value.exit_code == 4


@pytest.mark.parametrize("text", ["{", "", "[1, 2]", '"text"', "null", "5", '{"cameras": [1]}', '{"cameras": null}',
                                  "{}", '{"cameras": {}}', "\x00"])  # fmt: skip
def test_a_file_of_another_kind_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(text, "utf-8")
    with pytest.raises(BadRequest):
        read(path)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(BadRequest):
        read(path)


REFLECTION = np.diag([1.0, 1, -1]).tolist()
MALFORMED: dict[str, object] = {
    "not a camera": 3100,
    "nothing in it": {},
    "K of the wrong shape": {"K": [[3100, 0], [0, 3100]]},
    "K a text": {"K": "3100"},
    "K with text in it": {"K": [["f", 0, 1], [0, 1, 1], [0, 0, 1]]},
    "K ragged": {"K": [[3100, 0, 1], [0, 3100], [0, 0, 1]]},
    "K with nothing in it": {"K": None},
    "K with a NaN": entry([[math.nan, 0, 1], [0, 3100, 1]]),
    "a negative focal length": entry([[-3100, 0, 1], [0, 3100, 1]]),
    "no focal length": entry([[3100, 0, 1], [0, 0, 1]]),
    "K transposed": {"K": [[3100, 0, 0], [0, 3100, 0], [2000, 1500, 1]]},
    "skew below the diagonal": entry([[3100, 0, 1], [2, 3100, 1]]),
    "too much distortion": entry(K_LEFT, distortion=[0.1] * 8),
    "distortion with a NaN": entry(K_LEFT, distortion=[math.nan]),
    "R without t": entry(K_LEFT, R=R_LEFT),
    "t without R": entry(K_LEFT, t=[1, 2, 3]),
    "R of the wrong shape": entry(K_LEFT, R=[0.1, 0.2, 0.3], t=[1, 2, 3]),
    "R a reflection": entry(K_LEFT, R=REFLECTION, t=[1, 2, 3]),
    "R no rotation": entry(K_LEFT, R=(1.01 * np.eye(3)).tolist(), t=[1, 2, 3]),
    "t of the wrong length": entry(K_LEFT, R=R_LEFT, t=[1, 2, 3, 4]),
    "t with a NaN": entry(K_LEFT, R=R_LEFT, t=[1, 2, math.nan]),
}


@pytest.mark.parametrize("malformed", MALFORMED.values(), ids=MALFORMED.keys())
@pytest.mark.parametrize("role", ["reference", "target"])
def test_malformed_cameras_are_refused_by_name(role: str, malformed: object) -> None:
    other = "target" if role == "reference" else "reference"
    with pytest.raises(BadRequest) as caught:
        read({"cameras": {role: malformed, other: entry(K_LEFT, R=R_LEFT, t=[1, 2, 3])}})
    assert NAMES[role == "target"] in str(caught.value)


def test_a_missing_camera_is_named_with_what_is_there() -> None:
    with pytest.raises(BadRequest, match=r"'right\.jpg'.*'target'.*left\.jpg, third\.jpg"):
        read({"cameras": {"left.jpg": entry(K_LEFT), "third.jpg": entry(K_LEFT)}})


def test_a_pose_for_one_picture_only_is_refused() -> None:
    with pytest.raises(BadRequest, match="both or neither"):
        read({"cameras": {"reference": entry(K_LEFT, R=R_LEFT, t=[1, 2, 3]), "target": entry(K_RIGHT)}})


@pytest.mark.parametrize("size", [(2000, 1500), (1333, 1000), (80, 61), (8000, 6000)])
def test_a_resized_picture_is_seen_by_the_resized_camera(size: tuple[int, int]) -> None:
    """Projecting and then scaling pixels about the picture's corner is projecting with the camera of the new size."""
    _, camera = read({"reference": entry(K_LEFT), "target": entry(K_RIGHT, distortion=[0.1, -0.02])})
    points = np.random.default_rng(0).normal((0, 0, 5), 1, (50, 3))
    scale, other = np.array(size) / camera.size, camera.resized(size)
    full, small = ((points @ one.K.T)[:, :2] / points[:, 2:] for one in (camera, other))
    assert np.allclose(small, (full + 0.5) * scale - 0.5, rtol=0, atol=1e-9)
    assert other.size == size and np.array_equal(other.distortion, camera.distortion) and other.distortion.any()
    assert (other.source, other.log_sigma) == (camera.source, camera.log_sigma) and other.pose is camera.pose
    assert camera.resized(camera.size).K.tolist() == camera.K.tolist()


def test_a_focal_length_that_is_held_counts_as_given() -> None:
    guess = Camera(np.diag([900.0, 900.0, 1.0]), (1000, 800), "assumed", ASSUMED_SIGMA, knowledge=Knowledge.ASSUMED)
    held = guess.with_focal_held()
    assert guess.assumed and not guess.fixed and held.fixed and not held.assumed and held.focal == guess.focal
