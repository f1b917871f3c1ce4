"""What a stitch leaves on disk: the files that were asked for, with the meaning of docs/formats.md, or nothing."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.output import outputs
from edf_stitch.core.output.json_file import json_bytes
from edf_stitch.core.output.outputs import OutputRequest, check, layer_stem, write
from edf_stitch.core.output.warp_file import warp_bytes, write_npz
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.pictures.exr import ExrForm
from edf_stitch.core.pictures.masks import read_painted
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchOptions, StitchResult, stitch
from edf_stitch.core.pose.match_files import read_matches
from edf_stitch.core.raster.colour import encode
from edf_stitch.core.system.errors import BadRequest, UnwritableOutput
from edf_stitch.core.system.output_files import OutputFiles
from edf_stitch.core.system.progress import STAGES
from edf_stitch.synthetic_scenes.two_planes import Pair

from ...pairs import with_two_view

NPZ = {
    "format": ("<i8", ()), "sizes": ("<i8", (2, 2)), "canvas": ("<i8", (2,)), "offset": ("<i8", (2,)),
    "map_x_01": ("<f4", None), "map_y_01": ("<f4", None), "box_01": ("<i8", (4,)),
    "inverse_depth": ("<f4", None), "K": ("<f8", (2, 3, 3)),
    "R": ("<f8", (2, 3, 3)), "t": ("<f8", (2, 3)), "dist": ("<f8", (2, 5)), "H_inf": ("<f8", (2, 3, 3)),
    "e_prime": ("<f8", (2, 3)), "F": ("<f8", (1, 3, 3)), "edges": ("<i8", (1, 2)),
}  # fmt: skip


NAMES = ("reference.png", "target.png")


def everything(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def all_of(folder: Path, panorama: str = "out.png") -> OutputRequest:
    return OutputRequest(folder / panorama, folder / "report.json", folder / "layers", folder / "warp.npz")


def named(result: StitchResult) -> StitchResult:
    """The result of arrays as if they had come from files."""
    pictures = tuple(replace(picture, name=name) for picture, name in zip(result.pictures, NAMES, strict=True))
    return replace(result, pictures=pictures)


def write_all(result: StitchResult, folder: Path, panorama: str = "out.png") -> list[str]:
    result = named(result)
    with OutputFiles() as files:
        check(all_of(folder, panorama), files, NAMES)
        return write(result, all_of(folder, panorama), files)


@pytest.fixture(scope="module")
def written(small_result: StitchResult, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("written")
    write_all(small_result, folder)
    return folder


def raw(path: Path) -> np.ndarray:
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def test_all_files_and_no_others_are_there(written: Path) -> None:
    assert set(everything(written)) == {
        "out.png", "report.json", "report.timing.json", "report.matches.csv", "warp.npz", "layers/00_reference.png",
        "layers/01_target.png", "layers/occluded_01.png", "layers/confidence.png", "layers/labels.png",
        "layers/seam.png", "layers/canvas.json"}


def test_what_was_filled_is_marked(small_result: StitchResult, tmp_path: Path) -> None:
    filled = np.zeros_like(small_result.occluded[1])
    filled[30:60, 200:] = True
    report = {**small_result.report, "options": {**small_result.report["options"], "holes": "inpaint"}}
    write_all(replace(small_result, inpainted=filled, report=report), tmp_path)
    assert np.array_equal(raw(tmp_path / "layers" / "inpainted.png") > 0, filled)
    (tmp_path / "none").mkdir()
    write_all(small_result, tmp_path / "none")
    assert not (tmp_path / "none" / "layers" / "inpainted.png").exists()


def test_only_the_panorama_where_nothing_else_was_asked_for(small_result: StitchResult, tmp_path: Path) -> None:
    with OutputFiles() as files:
        write(small_result, OutputRequest(tmp_path / "out.jpg"), files)
    assert set(everything(tmp_path)) == {"out.jpg"}


def test_the_same_stitch_twice_gives_the_same_bytes(
    small_pair: Pair, known: StitchOptions, written: Path, tmp_path: Path
) -> None:
    write_all(stitch((small_pair.reference, small_pair.target), known), tmp_path)
    ours, theirs = everything(written), everything(tmp_path)
    assert ours.keys() == theirs.keys()
    assert [name for name in ours if ours[name] != theirs[name]] in ([], ["report.timing.json"])


def test_seconds_stand_in_a_file_of_their_own(written: Path) -> None:
    seconds = json.loads((written / "report.timing.json").read_text("utf-8"))["seconds"]
    assert set(seconds) <= set(STAGES) and {"features", "geometry", "warp"} <= set(seconds)
    assert all(value >= 0 for value in seconds.values()) and sum(seconds.values()) > 0
    assert "seconds" not in (written / "report.json").read_text("utf-8")


def test_the_report_is_the_results_with_what_writing_said(small_result: StitchResult, written: Path) -> None:
    text = (written / "report.json").read_text("utf-8")
    assert json.loads(text, parse_constant=pytest.fail) == small_result.report
    assert text.endswith("}\n")


def test_numbers_that_are_none_are_null() -> None:
    said = json_bytes({"a": float("nan"), "b": np.array([np.inf, 1.0]), "name": "Größe"})
    assert json.loads(said, parse_constant=pytest.fail) == {"a": None, "b": [None, 1.0], "name": "Größe"}
    assert "Größe".encode() in said


def test_the_panorama_is_the_result(small_result: StitchResult, written: Path) -> None:
    image = raw(written / "out.png")
    height, width = small_result.alpha.shape
    assert image.shape == (height, width, 4) and image.dtype == np.uint8
    assert np.array_equal(image[..., 3] == 255, small_result.alpha == 1)
    assert np.array_equal(image[..., 2::-1], encode(small_result.pixels, 8))


def test_the_warp_file_holds_what_design_says(small_pair: Pair, known: StitchOptions, written: Path) -> None:
    strict = stitch((small_pair.reference, small_pair.target), replace(known, field="strict"))
    with np.load(io.BytesIO(warp_bytes(strict)), allow_pickle=False) as file:
        found = dict(file)
    height, width = strict.alpha.shape
    assert set(found) == set(NPZ)
    for name, (kind, shape) in NPZ.items():
        expected = (height, width) if shape is None else shape
        assert found[name].dtype.str == kind and found[name].shape == expected, name
    assert found["format"] == 2 and found["canvas"].tolist() == [width, height]
    assert found["sizes"].tolist() == [[240, 180], [240, 180]]
    assert found["box_01"].tolist() == [0, 0, width, height] and found["edges"].tolist() == [[0, 1]]
    for name, own in (("R", np.eye(3)), ("t", np.zeros(3)), ("H_inf", np.eye(3)), ("e_prime", np.zeros(3))):
        assert np.array_equal(found[name][0], own), "the reference stands at the origin"
    # a reader's view of it: canvas pixel − offset is a reference pixel; x' ~ H_inf p + d e'; x'ᵀ F x = 0
    y, x = np.mgrid[:height, :width]
    p = np.stack([x - found["offset"][0], y - found["offset"][1], np.ones_like(x)], axis=-1).astype(float)
    q = p @ found["H_inf"][1].T + found["inverse_depth"][..., None].astype(float) * found["e_prime"][1]
    mapped = np.stack([found["map_x_01"], found["map_y_01"]], axis=-1)
    assert np.abs(q[..., :2] / q[..., 2:] - mapped).max() < 5e-4
    line = p @ found["F"][0].T
    off = np.abs((line[..., :2] * mapped).sum(axis=-1) + line[..., 2]) / np.hypot(line[..., 0], line[..., 1])
    assert off.max() < 1e-3
    (K, K_prime), R, t = found["K"], found["R"][1], found["t"][1]
    assert np.allclose(K_prime @ R @ np.linalg.inv(K), found["H_inf"][1])
    assert np.allclose(K_prime @ t, found["e_prime"][1])
    assert np.linalg.norm(t) == pytest.approx(1)
    # the map also says where it falls outside the target picture
    assert np.isfinite(mapped).all() and mapped[..., 0].min() < -1 and mapped[..., 0].max() > 240
    # the paste: the reference's first pixel lies at offset
    reference = raw(written / "layers" / "00_reference.png")
    left, top = found["offset"]
    assert reference[top, left, 3] == 255 and not reference[:top, :, 3].any() and not reference[:, :left, 3].any()


def test_what_a_model_lacks_is_nan_in_the_warp_file(small_result: StitchResult) -> None:
    lacking = replace(small_result.edges[0].two_view, F=np.full((3, 3), np.nan), t=np.full(3, np.nan))
    with np.load(io.BytesIO(warp_bytes(with_two_view(small_result, lacking)))) as file:
        assert np.isnan(file["F"]).all() and np.isnan(file["t"][1]).all() and not file["t"][0].any()
        assert np.isfinite(file["H_inf"]).all()


def test_an_npz_depends_on_its_arrays_only() -> None:
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.asfortranarray(np.eye(3)), "c": np.array([3])}

    def written_npz(arrays: dict[str, np.ndarray]) -> bytes:
        buffer = io.BytesIO()
        write_npz(buffer, arrays.items())
        return buffer.getvalue()

    data = written_npz(arrays)
    assert data == written_npz({**arrays, "b": np.eye(3)})
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        assert list(file) == ["a", "b", "c"] and all(np.array_equal(file[name], arrays[name]) for name in arrays)


def test_layers_are_both_pictures_on_the_whole_canvas_before_blending(
    small_pair: Pair, small_result: StitchResult, written: Path
) -> None:
    height, width = small_result.alpha.shape
    reference, target = (raw(written / "layers" / f"{name}.png") for name in ("00_reference", "01_target"))
    assert reference.shape == target.shape == (height, width, 4)
    x, y = small_result.warp.canvas.offset
    box = (slice(y, y + 180), slice(x, x + 240))
    assert np.array_equal(reference[box][..., 2::-1], small_pair.reference), "pixel for pixel"
    alpha = np.zeros((height, width), np.uint8)
    alpha[box] = 255
    assert np.array_equal(reference[..., 3], alpha)
    assert np.array_equal(target[..., 3], 255 * small_result.warp.maps[1].inside())
    assert (target[box][..., 3] > 0).sum() > 10_000, "nothing cut away where both show something"
    inner = cv2.erode(target[..., 3], np.ones((3, 3))) > 0
    fetched = cv2.remap(small_pair.target, small_result.warp.maps[1].x, small_result.warp.maps[1].y, cv2.INTER_LINEAR)
    assert np.median(np.abs(fetched.astype(int) - target[..., 2::-1])[inner]) <= 3


def test_what_the_target_cannot_see_is_white_in_a_mask(small_result: StitchResult, tmp_path: Path) -> None:
    hidden = np.zeros(small_result.alpha.shape, bool)
    hidden[10:20, 30:40] = True
    write_all(replace(small_result, occluded=(small_result.occluded[0], hidden)), tmp_path)
    assert np.array_equal(raw(tmp_path / "layers" / "occluded_01.png"), np.where(hidden, 255, 0))


def test_labels_say_which_picture_is_shown(small_result: StitchResult, written: Path) -> None:
    labels, found = small_result.labels, raw(written / "layers" / "labels.png")
    assert labels is not None and set(np.unique(labels)) == {-1, 0, 1}
    assert found.dtype == np.uint8 and np.array_equal(found, labels + 1)
    assert np.array_equal(labels >= 0, small_result.alpha > 0), "what is shown comes from somewhere"


def test_the_layers_folder_says_what_it_holds(small_result: StitchResult, written: Path) -> None:
    about = json.loads((written / "layers" / "canvas.json").read_text("utf-8"))
    height, width = small_result.alpha.shape
    assert about == {"format": 2, "size": [width, height], "names": list(NAMES),
                     "projection": small_result.report["canvas"]["projection"]}  # fmt: skip


def test_layers_of_other_pictures_are_not_mixed_with_these(small_result: StitchResult, tmp_path: Path) -> None:
    (tmp_path / "layers").mkdir()
    (tmp_path / "layers" / "01_other.png").write_bytes(b"mine")
    with pytest.raises(BadRequest, match="files of another stitch .* .01_other.png"):
        check(all_of(tmp_path), OutputFiles(overwrite=True), NAMES)


def test_layers_of_a_spheres_views_may_be_written_again(tmp_path: Path) -> None:
    """How many there are is known when the sphere was read; of another sphere they are another stitch's."""
    (tmp_path / "layers").mkdir()
    for name in ("00_reference (front).png", "07_reference (down).png", "08_target.png"):
        (tmp_path / "layers" / name).write_bytes(b"ours")
    check(all_of(tmp_path), OutputFiles(overwrite=True), ("reference.png", "target.png"))
    with pytest.raises(BadRequest, match="files of another stitch"):
        check(all_of(tmp_path), OutputFiles(overwrite=True), ("other.png", "target.png"))


def test_masks_that_this_stitch_does_not_write_are_not_left_beside_its_own(written: Path, tmp_path: Path) -> None:
    (tmp_path / "layers").mkdir()
    (tmp_path / "layers" / "labels.png").write_bytes((written / "layers" / "labels.png").read_bytes())
    with pytest.raises(BadRequest, match=r"does not write \(labels.png\)"):
        check(all_of(tmp_path), OutputFiles(overwrite=True), NAMES, seam=False)
    check(all_of(tmp_path), OutputFiles(overwrite=True), NAMES)


def test_a_layer_has_a_name_that_every_file_system_takes() -> None:
    assert layer_stem(3, "a:b*c?.jpg") == "03_a_b_c_"
    assert len(layer_stem(0, 250 * "漢" + ".png").encode()) < 240
    assert json_bytes({"name": "a\udcff.png"}) == b'{\n "name": "a?.png"\n}\n'


def test_the_seam_is_a_mask_to_paint_on(small_result: StitchResult, written: Path) -> None:
    seam, sides = raw(written / "layers" / "seam.png"), small_result.labels == 1
    shown = small_result.alpha > 0
    assert sides.any() and (shown & ~sides).any()
    assert np.array_equal(seam[..., 3], np.where(shown, 255, 0))
    painted = read_painted(written / "layers" / "seam.png")
    assert np.array_equal(painted[shown], np.where(sides, 1, -1)[shown]) and not painted[~shown].any()


def as_float(result: StitchResult) -> StitchResult:
    """The same result as if it came from float pictures twice as bright."""
    layers = tuple(replace(layer, light=2 * layer.pixels) for layer in result.layers)
    brighter = Layer(2 * result.pixels, result.alpha)
    pictures = replace(result.pictures[0], bits=32), result.pictures[1]
    return replace(result, panorama=brighter, pictures=pictures, layers=layers)


def test_layers_of_float_pictures_have_exr_beside_them(small_result: StitchResult, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    bright = as_float(small_result)
    assert write_all(bright, tmp_path, "out.exr") == []
    assert set(everything(tmp_path)) == {
        "out.exr", "report.json", "report.timing.json", "report.matches.csv", "warp.npz", "layers/00_reference.png",
        "layers/00_reference.exr", "layers/01_target.png", "layers/01_target.exr", "layers/occluded_01.png",
        "layers/confidence.png", "layers/labels.png", "layers/seam.png", "layers/canvas.json"}
    for name, layer in zip(("00_reference", "01_target"), bright.layers, strict=True):
        back = load_picture(tmp_path / "layers" / f"{name}.exr")
        assert back.pixels.max() > 1 and back.bits == 32
        assert np.array_equal(back.alpha, layer.alpha) and np.array_equal(back.pixels, layer.pixels)
    back = load_picture(tmp_path / "out.exr")
    assert np.allclose(back.pixels, bright.pixels, rtol=1e-5) and np.array_equal(back.alpha, bright.alpha)


def test_exr_is_written_as_it_is_asked_for(small_result: StitchResult, tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR")
    request = OutputRequest(tmp_path / "out.exr", layers=tmp_path / "layers", exr=ExrForm("half", "dwab"))
    with OutputFiles() as files:
        assert write(named(as_float(small_result)), request, files) == []
    for path in (request.panorama, tmp_path / "layers" / "00_reference.exr", tmp_path / "layers" / "01_target.exr"):
        with OpenEXR.File(str(path), separate_channels=True) as file:
            assert file.channels()["R"].pixels.dtype == np.float16, path
            assert file.header()["compression"] == OpenEXR.DWAB_COMPRESSION


def test_float_into_png_is_clipped_and_said_in_the_report_too(small_result: StitchResult, tmp_path: Path) -> None:
    warnings = write_all(as_float(small_result), tmp_path, "out.png")
    assert len(warnings) == 1 and "clipped" in warnings[0] and ".exr keeps it" in warnings[0]
    assert json.loads((tmp_path / "report.json").read_text("utf-8"))["warnings"] == warnings


def test_jpeg_is_black_where_nothing_is_shown(small_result: StitchResult, tmp_path: Path) -> None:
    with OutputFiles() as files:
        write(small_result, OutputRequest(tmp_path / "out.jpg"), files)
    image = raw(tmp_path / "out.jpg")
    outside = small_result.alpha == 0
    outside = cv2.erode(outside.astype(np.uint8), np.ones((25, 25))) > 0
    # a block of colour is 16 px wide and may reach a few px further, with a few levels of what it shows there
    assert image.shape[2] == 3 and outside.any() and image[outside].max() <= 4


@pytest.mark.parametrize("suffix", [".png", ".tif", ".TIFF", ".exr", ".jpeg", ".JPG"])
def test_every_kind_of_panorama(small_result: StitchResult, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"out{suffix}"
    with OutputFiles() as files:
        check(OutputRequest(path), files, NAMES)
        assert write(small_result, OutputRequest(path), files) == []
    back = load_picture(path)
    assert back.view.shape == small_result.pixels.shape
    assert (back.alpha is None) == (suffix.lower() in (".jpg", ".jpeg"))


@pytest.mark.parametrize("name", ["out.gif", "out", "out.png.bak", "out.npz"])
def test_an_unknown_kind_of_panorama_is_refused_before_the_work(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadRequest, match=r"use \.png"):
        check(OutputRequest(tmp_path / name), OutputFiles(), NAMES)


@pytest.mark.parametrize("name", ["warp.np", "warp", "warp.exr"])
def test_an_unknown_kind_of_warp_is_refused_before_the_work(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadRequest, match=r"\.npz"):
        check(OutputRequest(tmp_path / "out.png", warp=tmp_path / name), OutputFiles(), NAMES)


@pytest.mark.parametrize("name", [
    "out.png", "report.json", "report.timing.json", "report.matches.csv", "warp.npz", "layers/00_reference.png",
    "layers/01_target.png", "layers/01_target.exr", "layers/occluded_01.png", "layers/confidence.png",
    "layers/seam.png", "layers/labels.png", "layers/canvas.json",
])  # fmt: skip
def test_what_exists_is_refused_before_the_work_and_not_touched(
    small_result: StitchResult, tmp_path: Path, name: str
) -> None:
    (tmp_path / "layers").mkdir()
    (tmp_path / name).write_bytes(b"mine")
    with pytest.raises(UnwritableOutput, match=f"{Path(name).name} exists: use --overwrite"):
        check(all_of(tmp_path), OutputFiles(), NAMES)
    assert everything(tmp_path) == {name: b"mine"}
    with OutputFiles(overwrite=True) as files:
        check(all_of(tmp_path), files, NAMES)
        write(named(small_result), all_of(tmp_path), files)
    assert everything(tmp_path)["out.png"] != b"mine" and (tmp_path / "layers" / "01_target.png").exists()


@pytest.mark.parametrize(("panorama", "report", "warp"), [
    ("a.png", "a.png", None), ("b.png", "a.npz", "a.npz"), ("b.png", "c/../a.npz", "a.npz"),
    ("layers/01_target.png", None, None), ("b.png", "layers/00_reference.png", None),
    ("layers/occluded_01.png", None, None), ("layers/confidence.png", None, None),
])  # fmt: skip
def test_two_outputs_of_one_name_are_refused_before_the_work(
    tmp_path: Path, panorama: str, report: str | None, warp: str | None
) -> None:
    for folder in ("layers", "c"):
        (tmp_path / folder).mkdir()
    request = OutputRequest(
        tmp_path / panorama, report and tmp_path / report, tmp_path / "layers", warp and tmp_path / warp)
    with pytest.raises(BadRequest, match="two outputs"):
        check(request, OutputFiles(), NAMES)


def stop_after(calls: int, original: Callable, trouble: type[BaseException]) -> Callable:
    def call(*args: object, **kwargs: object) -> object:
        nonlocal calls
        if calls == 0:
            raise trouble
        calls -= 1
        return original(*args, **kwargs)

    return call


@pytest.mark.parametrize("trouble", [MemoryError, KeyboardInterrupt, UnwritableOutput])
@pytest.mark.parametrize(("where", "calls"), [("encode_into", 0), ("encode_picture", 0), ("encode_picture", 1),
                                              ("write_warp", 0), ("json_bytes", 0), ("json_bytes", 1)])  # fmt: skip
def test_trouble_half_way_leaves_nothing(
    small_result: StitchResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str, calls: int,
    trouble: type[BaseException],
) -> None:
    monkeypatch.setattr(outputs, where, stop_after(calls, getattr(outputs, where), trouble))
    with pytest.raises(trouble):
        write_all(small_result, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_trouble_while_the_files_are_put_in_place_leaves_nothing(
    small_result: StitchResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import os

    for name in ("link", "replace"):  # the second where a file system has no links
        monkeypatch.setattr(os, name, stop_after(3, getattr(os, name), KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        write_all(small_result, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_timing_stands_beside_the_report_and_only_then() -> None:
    assert OutputRequest(Path("out.png")).timing is None
    assert OutputRequest(Path("out.png"), report=Path("a/b.c.json")).timing == Path("a/b.c.timing.json")


def test_the_matches_stand_beside_the_report_as_they_are_given(small_result: StitchResult, written: Path) -> None:
    assert OutputRequest(Path("out.png")).matches is None
    assert OutputRequest(Path("out.png"), report=Path("a/b.c.json")).matches == Path("a/b.c.matches.csv")
    back, found = read_matches(written / "report.matches.csv", (240, 180), (240, 180)), small_result.edges[0].matches
    assert np.array_equal(back.x, found.x) and np.array_equal(back.y, found.y)
    assert (back.scale, back.weight, back.given) == (found.scale, None, False)
    lines = (written / "report.matches.csv").read_text("utf-8").splitlines()
    states = [line.split(",")[5] for line in lines[1:]]
    report = json.loads((written / "report.json").read_text("utf-8"))
    assert states.count("used") == report["field"]["centres"]
    assert len(states) - states.count("left out by the geometry") == report["matches"]["inliers"]
    assert len(states) == report["matches"]["found"] > report["matches"]["inliers"]


def test_without_its_states_the_file_of_matches_holds_the_used_ones(small_result: StitchResult, written: Path) -> None:
    """As a program reads it that knows the first five columns: what was left out has no weight."""
    rows = np.genfromtxt(written / "report.matches.csv", delimiter=",", skip_header=1, usecols=range(5))
    back, used = read_matches(rows, (240, 180), (240, 180)), small_result.used_matches
    assert back.given and np.array_equal(back.x, used.x) and np.array_equal(back.y, used.y)
