"""What other programs leave is read in each of its forms, and what does not fit is said."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.compare.elsewhere import folders
from edf_stitch.core.compare.elsewhere.folders import outside_of, read_folder
from edf_stitch.core.compare.pairs import PairFiles
from edf_stitch.core.measure.placed.of_result import placed
from edf_stitch.core.measure.placed.overlaps import gained_figures, plain_figures
from edf_stitch.core.measure.placed.straightness import line_figures
from edf_stitch.core.output.outputs import OutputRequest, write
from edf_stitch.core.pictures import decoding
from edf_stitch.core.pipeline import StitchResult
from edf_stitch.core.system.errors import BadRequest, UnreadableImage
from edf_stitch.core.system.output_files import OutputFiles


@pytest.fixture
def left(small_result: StitchResult, tmp_path: Path) -> Path:
    """A folder with our own layers and maps, as any program's."""
    folder = tmp_path / "left"
    request = OutputRequest(panorama=tmp_path / "p.png", layers=folder, warp=tmp_path / "warp.npz")
    with OutputFiles() as files:
        write(small_result, request, files)
    (tmp_path / "warp.npz").rename(folder / "warp.npz")
    return folder


def test_our_own_files_measure_as_the_result_does(small_result: StitchResult, left: Path) -> None:
    direct, read = placed(small_result), read_folder(left, small_result.pictures)
    assert read.size == direct.size and len(read.pictures) == 2
    for name, value in gained_figures(direct).items():
        assert gained_figures(read)[name] == pytest.approx(value, rel=0.01), name
    lines = line_figures(direct, small_result.pictures)
    assert line_figures(read, small_result.pictures)["lines"] == lines["lines"]


def test_maps_alone_are_enough(small_result: StitchResult, left: Path) -> None:
    for path in left.glob("*.png"):
        path.unlink()
    found = read_folder(left, small_result.pictures)
    assert plain_figures(found)["overlap_psnr_db"] == pytest.approx(
        plain_figures(placed(small_result))["overlap_psnr_db"], abs=0.3
    )


def test_layers_with_masks_are_layers_and_black_is_not_nothing(
    small_result: StitchResult, left: Path, tmp_path: Path
) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    for path in left.glob("0?_*.png"):
        if path.stem.startswith("occluded"):
            continue
        layer = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(bare / path.name), layer[..., :3])
        cv2.imwrite(str(bare / f"{path.stem[:2]}_mask.png"), layer[..., 3])
    found = read_folder(bare, small_result.pictures)
    known = gained_figures(placed(small_result))["gained_ssim"]
    assert gained_figures(found)["gained_ssim"] == pytest.approx(known, rel=0.01)
    assert np.isnan(line_figures(found, small_result.pictures)["bent_px"]), "without maps nothing is known of lines"
    (bare / "01_mask.png").unlink()
    with pytest.raises(BadRequest, match="01_mask.png beside it.*black is not taken for nothing"):
        read_folder(bare, small_result.pictures)


def test_what_does_not_fit_is_refused(small_result: StitchResult, left: Path, tmp_path: Path) -> None:
    pictures = small_result.pictures
    with pytest.raises(UnreadableImage, match="no such folder"):
        read_folder(tmp_path / "nowhere", pictures)
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadRequest, match="neither layers"):
        read_folder(tmp_path / "empty", pictures)
    about = json.loads((left / "canvas.json").read_text())
    (left / "canvas.json").write_text(json.dumps(about | {"projection": about["projection"] | {"kind": "mercator"}}))
    with pytest.raises(BadRequest, match="'mercator' is not known"):
        read_folder(left, pictures)
    (left / "canvas.json").write_text("[]")
    with pytest.raises(BadRequest, match="not what --layers writes"):
        read_folder(left, pictures)
    (left / "canvas.json").unlink()
    cv2.imwrite(str(left / "02_stranger.png"), np.zeros((4, 4, 4), np.uint8))
    with pytest.raises(BadRequest, match="number 02, and there are 2 pictures"):
        read_folder(left, pictures)
    (left / "02_stranger.png").rename(left / "01_another.png")
    with pytest.raises(BadRequest, match="same number"):
        read_folder(left, pictures)
    (left / "01_another.png").rename(next(path for path in left.glob("01_*.png") if path.name != "01_another.png"))
    with pytest.raises(BadRequest, match="differ in size"):
        read_folder(left, pictures)
    (left / "warp.npz").write_bytes(b"nonsense")
    with pytest.raises(BadRequest, match="not a file of maps"):
        read_folder(left, pictures)


def test_results_of_a_pair_lie_in_a_folder_of_its_name(small_result: StitchResult, left: Path, tmp_path: Path) -> None:
    pair = PairFiles("desk", tmp_path / "a.png", tmp_path / "b.png")
    (alone,) = outside_of([("mine", left)], pair, 1).values()
    assert len(alone(small_result.pictures).pictures) == 2
    (among,) = outside_of([("mine", left)], pair, 2).values()
    with pytest.raises(UnreadableImage, match="desk"):
        among(small_result.pictures)
    (own,) = outside_of([("mine", left.parent)], replace(pair, name="left"), 2).values()
    assert len(own(small_result.pictures).pictures) == 2


@pytest.mark.parametrize("damage", [
    lambda raw: b"",
    lambda raw: raw[: len(raw) // 2],
    lambda raw: b"PK\3\4" + b"nonsense" * 40,
    lambda raw: raw[:500] + b"\xff" * 400 + raw[900:],
])  # fmt: skip
def test_damaged_maps_are_said_and_nothing_else_breaks(
    small_result: StitchResult, left: Path, damage: Callable[[bytes], bytes]
) -> None:
    whole = (left / "warp.npz").read_bytes()
    (left / "warp.npz").write_bytes(damage(whole))
    with pytest.raises(BadRequest, match="not a file of maps"):
        read_folder(left, small_result.pictures)


@pytest.mark.parametrize(("name", "data", "said"), [
    ("jp2", bytes.fromhex("0000000c6a5020200d0a870a") + b"\0" * 200, "layers and masks are PNG, TIFF or JPEG"),
    ("cut", cv2.imencode(".png", np.zeros((9, 9, 4), np.uint8))[1].tobytes()[:-20], "it is cut off"),
    ("bomb", cv2.imencode(".png", np.zeros((9, 9, 4), np.uint8))[1].tobytes(), "cannot come out of"),
])  # fmt: skip
def test_a_layer_is_checked_before_it_is_decoded(
    small_result: StitchResult, left: Path, name: str, data: bytes, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name == "bomb":
        header = b"IHDR" + struct.pack(">II", 30_000, 10_000) + data[24:29]
        data = data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]
    next(left.glob("01_*.png")).write_bytes(data)
    monkeypatch.setattr(decoding, "decoded", lambda _: pytest.fail("it was decoded"))
    monkeypatch.setattr(cv2, "imread", lambda *_: pytest.fail("OpenCV chose its decoder by the content"))
    with pytest.raises(UnreadableImage, match=said):
        folders._layer(left, next(left.glob("01_*.png")))


def test_maps_of_a_canvas_that_nothing_could_hold_are_refused(small_result: StitchResult, left: Path) -> None:
    with np.load(left / "warp.npz") as whole:
        content = dict(whole)
    np.savez(left / "warp.npz", **(content | {"canvas": np.array([10**6, 10**6])}))
    with pytest.raises(BadRequest, match="not a file of maps .a canvas of 1000000 × 1000000"):
        read_folder(left, small_result.pictures)


@pytest.mark.parametrize(("wrong", "said"), [
    ({"focal_px": 0}, "focal_px above 0"),
    ({"focal_px": -300.0}, "focal_px above 0"),
    ({"focal_px": float("inf")}, "focal_px above 0"),
    ({"centre": [float("nan"), 0.0]}, "a finite centre"),
    ({"rotation": [0.0] * 9}, "its rotation is none"),
    ({"rotation": [float("nan")] * 9}, "its rotation is none"),
])  # fmt: skip
def test_a_surface_that_cannot_be_is_refused(
    small_result: StitchResult, left: Path, wrong: dict[str, object], said: str
) -> None:
    told = json.loads((left / "canvas.json").read_text("utf-8"))
    told["projection"] |= wrong
    (left / "canvas.json").write_text(json.dumps(told), "utf-8")
    with pytest.raises(BadRequest, match=said):
        read_folder(left, small_result.pictures)


def test_maps_that_point_further_than_floats_reach_show_nothing(small_result: StitchResult, left: Path) -> None:
    for path in left.glob("*.png"):
        path.unlink()
    with np.load(left / "warp.npz") as content:
        maps = dict(content)
    maps["map_x_01"] = np.full(maps["map_x_01"].shape, 1e300)
    np.savez(left / "warp.npz", **maps)
    found = read_folder(left, small_result.pictures)
    assert not found.pictures[1].shows.any()
