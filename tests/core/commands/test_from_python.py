"""`edf_stitch.stitch`: the command line's options as keywords, a panorama that saves and shows itself."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import edf_stitch
import numpy as np
import pytest
from edf_stitch import BadRequest, CameraRequest, DegenerateGeometry, Panorama, StitchOptions, UnwritableOutput, stitch
from edf_stitch.core.commands import from_python, python_result
from edf_stitch.core.commands.parser import edf_parser
from edf_stitch.core.commands.python_result import panorama_of
from edf_stitch.core.output.camera_file import camera_table
from edf_stitch.core.output.depth.range_image import range_image
from edf_stitch.core.panorama.layers import Layer
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.core.pipeline import StitchResult

# Said to the command only: files and words on its streams, and one option that has another form in Python.
OF_THE_COMMAND = {
    "help", "help_all", "config", "json", "output", "report", "layers", "warp", "depth", "mesh", "cameras_out",
    "exr_depth", "exr_compression", "overwrite", "quiet", "verbose", "strict_verdict", "ignore_ref", "ignore_target",
}  # fmt: skip


@pytest.fixture
def chosen(monkeypatch: pytest.MonkeyPatch, small_result: StitchResult) -> Callable[..., StitchOptions]:
    """Calls stitch() with keywords, without the work; gives the options that the pipeline would get."""

    def call(*positional: object, **keywords: object) -> StitchOptions:
        got = []
        work = lambda _, options, *more: got.append(options) or small_result  # noqa: E731
        monkeypatch.setattr(from_python, "stitch_pictures", work)
        stitch(["left.jpg", "right.jpg"], *positional, **keywords)
        return got[0]

    return call


@pytest.fixture
def panorama(small_result: StitchResult, folder: Path) -> Panorama:
    return panorama_of(small_result, [folder / "reference.png", folder / "target.png"])


def test_every_option_of_the_command_line_is_a_keyword_with_its_default() -> None:
    keywords = inspect.signature(stitch).parameters
    command = edf_parser().commands["stitch"]
    options = {one.dest for one in command._actions if one.option_strings} - OF_THE_COMMAND
    assert options == {name for name, one in keywords.items() if one.kind is one.KEYWORD_ONLY} - {"measure"}
    for name in options - {"ignore", "show", "vertical", "horizontal", "cache"}:
        assert keywords[name].default == command.get_default(name), name


def test_what_is_public_is_exactly_this() -> None:
    """A name that goes, or comes, is a change of the interface: say so in CHANGELOG.md."""
    assert set(edf_stitch.__all__) == {
        "BadRequest", "CameraRequest", "Cancelled", "DegenerateGeometry", "NoOverlap", "NotEnoughMemory",
        "OutputTooLarge", "Panorama", "StitchError", "StitchOptions", "TooFewMatches", "UnreadableImage",
        "UnwritableOutput", "__version__", "register", "stitch", "unregister",
    }  # fmt: skip
    kinds = [one for one in vars(edf_stitch.core.system.errors).values() if isinstance(one, type)]
    assert all(one.__name__ in edf_stitch.__all__ for one in kinds if issubclass(one, edf_stitch.StitchError))
    assert all(getattr(edf_stitch, name) is not None for name in edf_stitch.__all__)


def test_keywords_become_options(chosen: Callable[..., StitchOptions], tmp_path: Path) -> None:
    assert chosen() == StitchOptions()
    assert chosen(projection="cylindrical", dense=False, slide=0.5, exposure=-1.0) == StitchOptions(
        projection="cylindrical", dense=False, slide=0.5, exposure=-1.0
    )
    assert chosen(focal_px=1200).camera == CameraRequest(focal_px=(1200.0,))
    assert chosen(focal_mm=(4, 5), sensor_mm=6).camera == CameraRequest(focal_mm=(4, 5), sensor_mm=(6.0,))
    assert chosen(ignore={"left.jpg": "m.png"}).ignore_in == (("left.jpg", Path("m.png")),)
    assert chosen(horizontal=[("a.jpg", [1, 2, 3, 4])]).guides == (("a.jpg", "horizontal", (1, 2, 3, 4)),)
    assert chosen(show={"left.jpg": "m.png"}).show == (("left.jpg", Path("m.png")),)
    assert chosen(ignore=[None, "m.png"]).ignore == (None, Path("m.png"))
    assert chosen(matches="m.csv", mask="p.png").files_read == [Path("m.csv"), Path("p.png")]
    kept = chosen(cache=tmp_path, memory=2.5)
    assert kept.cache == tmp_path and kept.memory_gb == 2.5 and chosen().cache is None


def test_it_knows_the_files_that_it_was_made_of(monkeypatch: pytest.MonkeyPatch, small_result: StitchResult) -> None:
    monkeypatch.setattr(from_python, "stitch_pictures", lambda *_: small_result)
    made = stitch(["left.jpg", np.zeros((9, 9, 3), np.uint8)], ignore=[None, "m.png"])
    assert made.sources == (Path("left.jpg"), Path("m.png"))


def test_options_are_accepted_whole_but_not_beside_keywords(chosen: Callable[..., StitchOptions]) -> None:
    options = StitchOptions(crop="full")
    assert chosen(options) is options
    for wrong in ({"projection": "cylindrical"}, {"memory": 1.0}, {"matches": np.ones((9, 4))}):
        with pytest.raises(BadRequest, match="beside options"):
            chosen(options, **wrong)


def test_a_panorama_says_what_it_is_in_a_line(panorama: Panorama) -> None:
    height, width = panorama.alpha.shape
    assert repr(panorama) == f"<Panorama {width}×{height} of 2 pictures, perspective: good>"
    assert panorama.report is not None and len(panorama.layers) == len(panorama.cameras) == 2
    assert np.array_equal(panorama.depth, range_image(panorama).range, equal_nan=True)
    assert str(panorama.found_cameras) == str(camera_table(panorama))


def test_a_notebook_shows_a_small_copy_and_the_verdict(
    panorama: Panorama, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(python_result, "NOTEBOOK", python_result.NOTEBOOK.__class__(side=120))
    (tmp_path / "small.png").write_bytes(panorama._repr_png_())
    small = load_picture(tmp_path / "small.png")
    height, width = small.light.shape[:2]
    assert 60 < max(height, width) <= 120
    assert small.light[small.alpha == 1].mean() == pytest.approx(panorama.pixels[panorama.alpha > 0].mean(), rel=0.05)
    assert "verdict" not in panorama._repr_html_() and "perspective: good&gt;" in panorama._repr_html_()


def test_what_is_transparent_lends_no_colour_to_the_small_copy(panorama: Panorama) -> None:
    """Columns by turns: gray that is shown, and white that is not."""
    odd = np.arange(300) % 2 == 1
    light, alpha = np.full((30, 300, 3), 0.25, np.float32), np.repeat(~odd[None], 30, axis=0)
    light[:, odd] = 1.0
    colours, covered = python_result._small(replace(panorama, panorama=Layer(light, alpha)), 150)
    assert colours.shape == (15, 150, 3) and np.allclose(colours, 0.25) and np.allclose(covered, 0.5)


def test_it_saves_what_the_command_would(panorama: Panorama, tmp_path: Path) -> None:
    panorama.save(tmp_path / "out.exr", depth=tmp_path / "d.exr", report=str(tmp_path / "r.json"), exr_depth="half")
    assert {path.name for path in tmp_path.iterdir()} == {
        "out.exr", "d.exr", "r.json", "r.timing.json", "r.matches.csv"
    }  # fmt: skip
    assert load_picture(tmp_path / "out.exr").light.shape[:2] == panorama.alpha.shape
    with pytest.raises(UnwritableOutput, match="out.exr"):
        panorama.save(tmp_path / "out.exr")
    panorama.save(tmp_path / "out.exr", overwrite=True)


def test_it_never_replaces_what_it_was_made_of(panorama: Panorama) -> None:
    with pytest.raises(BadRequest, match="reference.png"):
        panorama.save(panorama.sources[0], overwrite=True)
    with pytest.raises(BadRequest, match="exr"):
        panorama.save("x.exr", exr_depth="quarter")


def test_where_there_is_no_depth_that_is_said(small_pair: object) -> None:
    flat = stitch([small_pair.reference, small_pair.target], field="homography")
    with pytest.raises(DegenerateGeometry, match="no depth"):
        flat.depth  # noqa: B018


@pytest.mark.parametrize(("keywords", "told"), [
    ({"scale": "0.5"}, "scale is '0.5': it takes a number"), ({"dense": "no"}, "dense is 'no': it takes True or False"),
    ({"seed": 1.5}, "a whole number"), ({"fov": "90"}, "fov"), ({"projection": None}, "projection is None"),
    ({"ignore": None}, "ignore is None"), ({"scale_metres": (1, 2)}, "two pictures and a distance"),
    ({"focal_px": "wide"}, "focal_px is 'wide': give a number"), ({"seed": True}, "a whole number"),
])  # fmt: skip
def test_a_value_of_another_kind_is_named(
    keywords: dict[str, object], told: str, chosen: Callable[..., StitchOptions]
) -> None:
    with pytest.raises(BadRequest, match=re.escape(told)):
        chosen(**keywords)


def test_numbers_of_numpy_are_numbers(chosen: Callable[..., StitchOptions]) -> None:
    options = chosen(focal_px=np.array([190.0, 191.0]), brackets=np.int64(2), scale=np.float32(0.5))
    assert options.camera.focal_px == (190.0, 191.0) and options.brackets == 2 and options.scale == 0.5
    assert chosen(focal35="28").camera.focal35 == (28.0,)


def test_a_folder_stands_for_the_pictures_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, small_result: StitchResult
) -> None:
    for name in ("2.png", "10.png"):
        (tmp_path / name).touch()
    got: list[list[object]] = []
    monkeypatch.setattr(from_python, "stitch_pictures", lambda pictures, *_: got.append(pictures) or small_result)
    found = stitch([tmp_path, "more.png"])
    assert got == [[tmp_path / "2.png", tmp_path / "10.png", "more.png"]] and len(found.sources) == 3
    with pytest.raises(BadRequest, match="as a list"):
        stitch("left.png")
