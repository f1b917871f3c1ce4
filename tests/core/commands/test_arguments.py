"""The command line's options: what each becomes, and that it offers what core offers, no more and no less."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.choices import BLENDS, CROPS, EXPOSURES, FADES, FIELDS, HOLES, PROJECTIONS, SEAMS
from edf_stitch.core.commands.arguments import add_options, numbered, options_from
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.system.errors import BadRequest


def parsed(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    add_options(parser)
    return parser.parse_args(words)


def options(*words: str) -> StitchOptions:
    return options_from(parsed(*words), measure=False)


def test_without_any_the_defaults_are_pythons() -> None:
    assert options() == StitchOptions(measure=False)
    assert options_from(parsed(), measure=True) == StitchOptions()


def test_it_offers_what_core_offers() -> None:
    for name, choices in (("field", FIELDS), ("fade", FADES), ("blend", BLENDS), ("seam", SEAMS), ("crop", CROPS)):
        for choice in choices:
            assert getattr(options(f"--{name}", choice), name) == choice


@pytest.mark.parametrize(("words", "expected"), [
    (["--focal-px", "1200"], CameraRequest(focal_px=(1200.0,))),
    (["--focal-px", "1200,1180.5"], CameraRequest(focal_px=(1200.0, 1180.5))),
    (["--focal-mm", "35", "--sensor-mm", "36"], CameraRequest(focal_mm=(35.0,), sensor_mm=(36.0,))),
    (["--focal-mm", "35,50", "--sensor-mm", "36,23.5"], CameraRequest(focal_mm=(35.0, 50.0), sensor_mm=(36.0, 23.5))),
    (["--focal35", "28"], CameraRequest(focal35=(28.0,))),
    (["--focal35", "28,35"], CameraRequest(focal35=(28.0, 35.0))),
    (["--principal", "119,90"], CameraRequest(principal=(119.0, 90.0))),
    (["--principal", "119,90,120,89", "--focal-px", "1e3"],
     CameraRequest(focal_px=(1000.0,), principal=(119.0, 90.0, 120.0, 89.0))),
    (["--principal=-5,90"], CameraRequest(principal=(-5.0, 90.0))),
    (["--cameras", "c.json"], CameraRequest(cameras=Path("c.json"))),
])  # fmt: skip
def test_what_is_known_of_the_cameras(words: list[str], expected: CameraRequest) -> None:
    assert options(*words) == StitchOptions(camera=expected, measure=False)


@pytest.mark.parametrize(("words", "expected"), [
    (["--field", "strict", "--fade", "plane", "--projection", "reference", "--seam", "none"],
     {"field": "strict", "fade": "plane", "projection": "reference", "seam": "none"}),
    (["--field", "paper", "--fade", "infinity"], {"field": "paper", "fade": "infinity"}),
    (["--brackets", "3"], {"brackets": 3}), (["--brackets", "off"], {"brackets": "off"}),
    (["--matches", "m.csv", "--ignore-ref", "a.png", "--ignore-target", "b.png"],
     {"matches": Path("m.csv"), "ignore": (Path("a.png"), Path("b.png"))}),
    (["--ignore-target", "b.png"], {"ignore": (None, Path("b.png"))}),
    (["--ignore", "a.jpg=m.png", "--ignore", "b=c=n.png"],
     {"ignore_in": (("a.jpg", Path("m.png")), ("b=c", Path("n.png")))}),
    (["--show", "a.jpg=m.png", "--show", "b=c=n.png"], {"show": (("a.jpg", Path("m.png")), ("b=c", Path("n.png")))}),
    (["--horizontal", "b=c=5,6,7,8", "--vertical", "a.jpg=1,2,3,4.5"],
     {"guides": (("a.jpg", "vertical", (1.0, 2.0, 3.0, 4.5)), ("b=c", "horizontal", (5.0, 6.0, 7.0, 8.0)))}),
    (["--viewpoint", "3"], {"viewpoint": 3}), (["--viewpoint", "3.png"], {"viewpoint": "3.png"}),
    (["--viewpoint", "centre"], {"viewpoint": "centre"}), (["--require-all"], {"require_all": True}),
    (["--scale", "0.5", "--crop", "inscribed"], {"scale": 0.5, "crop": "inscribed"}),
    (["--crop", "3,4,50,60"], {"crop": (3, 4, 50, 60)}), (["--crop", "reference"], {"crop": "reference"}),
    (["--dense"], {}),
    (["--no-dense", "--no-exposure"], {"dense": False, "exposure": "none"}), (["--exposure", "auto"], {}),
    (["--exposure", "reference"], {"exposure": "reference"}), (["--exposure", "none"], {"exposure": "none"}),
    (["--exposure=-1.5"], {"exposure": -1.5}), (["--exposure", "2"], {"exposure": 2.0}),
    (["--holes", "inpaint"], {"holes": "inpaint"}), (["--holes", "transparent"], {"holes": "transparent"}),
    (["--mask", "m.png"], {"mask": Path("m.png")}),
    (["--blend", "linear"], {"blend": "linear"}), (["--blend", "feather"], {"blend": "feather"}),
    (["--projection", "reference"], {"projection": "reference"}),
    (["--projection", "cylindrical"], {"projection": "cylindrical"}),
    (["--projection", "equirectangular", "--level=-5,2.5,0"],
     {"projection": "equirectangular", "level": (-5.0, 2.5, 0.0)}),
    (["--level", "auto"], {}), (["--level", "none"], {"level": "none"}),
    (["--projection", "auto", "--slide", "auto"], {"projection": "auto", "slide": "auto"}),
    (["--projection", "pannini", "--slide", "0.5"], {"projection": "pannini", "slide": 0.5}),
    (["--slide", "1,0.25,0.75"], {"slide": (1.0, 0.25, 0.75)}),
    (["--projection", "pannini:.25"], {"projection": "pannini:.25"}),
    (["--projection", "perspective", "--centre=-5,2", "--fov", "80"],
     {"projection": "perspective", "centre": (-5.0, 2.0), "fov": 80.0}),
    (["--crop", "auto", "--holes", "auto"], {"crop": "auto", "holes": "auto"}),
    (["--memory", "2.5"], {"memory_gb": 2.5}),
    (["--seed", "7"], {"seed": 7}), (["--seed", "2147483647"], {"seed": 2147483647}),
])  # fmt: skip
def test_how_it_is_done(words: list[str], expected: dict) -> None:
    assert options(*words) == StitchOptions(measure=False, **expected)


@pytest.mark.parametrize("words", [
    ["--field", "nonsense"], ["--field", ""], ["--fade", "slowly"], ["--blend", ""], ["--seam", "x"], ["--seed", "x"],
    ["--memory", "x"],
    ["--seed", "1.5"], ["--scale", "x"], ["--focal-px", "abc"], ["--focal-px", ""], ["--focal-px", "1,,2"],
    ["--focal-px"], ["--projection", "flat"], ["--sensor-mm", "1;2"],
    ["--slide", "x"], ["--slide", ""], ["--centre", "x"], ["--fov", "wide"],
    ["--brackets", "1"], ["--brackets", "on"],
], ids=" ".join)  # fmt: skip
def test_what_makes_no_sense_is_refused_by_the_parser(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        parsed(*words)
    assert leaving.value.code == 2 and words[0] in capsys.readouterr().err


@pytest.mark.parametrize("words", [
    *(["--focal-px", text] for text in ("0", "-5", "nan", "inf", "1,2,3")), ["--focal-mm", "35"], ["--sensor-mm", "36"],
    ["--sensor-mm", "0", "--focal-mm", "1"], ["--principal", "1"], ["--principal", "1,2,3"], ["--principal", "inf,1"],
    ["--focal-px", "9", "--focal35", "28"], ["--focal35", "28", "--cameras", "c.json"], ["--seed=-1"],
    ["--memory", "0"], ["--memory=-1"], ["--memory", "nan"],
    ["--seed", "2147483648"], *(["--scale", text] for text in ("0", "1.5", "nan", "inf")), ["--scale=-0.5"],
    *(["--projection", text] for text in ("pannini:x", "pannini:", "pannini:1.1", "pannini:nan", "perspective:0.5")),
    *(["--slide", text, "--projection", "auto"] for text in ("1.1", "nan", "inf")), ["--slide", "2"],
    *(["--projection", "auto", "--centre", text] for text in ("1", "1,2,3", "181,0", "nan,0")),
    *(["--projection", "auto", "--fov", text] for text in ("0", "361", "nan")),
    *(["--projection", "reference", *more] for more in (["--fov", "50"], ["--centre", "5,5"], ["--slide", "0.5"])),
    *(["--crop", text] for text in ("tight", "", "1,2,3", "1,2,3,4,5", "0,0,0,5", "0,0,5,0", "1.5,0,5,5", "Full")),
], ids=" ".join)  # fmt: skip
def test_what_cannot_be_is_refused_before_the_work(words: list[str]) -> None:
    with pytest.raises(BadRequest) as refused:
        options(*words)
    assert refused.value.exit_code == 2 and len(str(refused.value)) > 20


def test_the_help_names_every_option_and_choice() -> None:
    parser = argparse.ArgumentParser()
    add_options(parser)
    said = parser.format_help()
    for word in (*(f"--{name}" for name in (
        "focal-px", "focal-mm", "sensor-mm", "focal35", "principal", "cameras", "matches", "ignore-ref",
        "ignore-target", "scale", "crop", "field", "fade", "dense", "projection", "blend", "seam", "mask",
        "exposure", "holes", "seed", "slide", "level", "centre", "fov",
    )), *PROJECTIONS, *FIELDS, *FADES, *BLENDS, *SEAMS, *EXPOSURES, *HOLES, *CROPS):  # fmt: skip
        assert word in said, word


def test_reading_them_loads_nothing_heavy() -> None:
    code = (
        "import argparse, sys, edf_stitch.core.commands.arguments as a\n"
        "parser = argparse.ArgumentParser(); a.add_options(parser); parser.parse_args(['--field', 'strict'])\n"
        "print(sorted({'numpy', 'cv2', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize("words", ["a.png", "=m.png", "a.png="])
def test_a_mask_needs_the_name_of_its_picture(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--ignore", words)
    assert "is not like NAME=MASK" in capsys.readouterr().err


PLACES = [Path("A/1.png"), Path("A/2.png"), Path("B/1.png")]


def numbers(*words: str, of: int = 3) -> StitchOptions:
    return numbered(options_from(parsed(*words), measure=False), PLACES[:of])


def test_masks_of_ref_and_target_are_for_two_pictures() -> None:
    for words in (["--ignore-ref", "m.png"], ["--ignore-target", "m.png"]):
        assert numbers(*words, of=2).ignore == options_from(parsed(*words), measure=False).ignore
        with pytest.raises(BadRequest, match="--ignore NAME=MASK"):
            numbers(*words)


def test_pictures_are_named_by_any_end_of_their_paths() -> None:
    options = numbers("--viewpoint", "B/1", "--ignore", "A/1.png=m.png", "--ignore", "2.PNG=n.png")
    assert options.viewpoint == 3 and options.ignore == (Path("m.png"), Path("n.png"), None) and not options.ignore_in
    assert options.files_read == [Path("m.png"), Path("n.png")]
    assert numbers().ignore == () and numbers().viewpoint is None and numbers("--viewpoint", "2").viewpoint == 2
    for words in ("centre", "Centre", "center"):
        assert numbers("--viewpoint", words).viewpoint == "centre"


@pytest.mark.parametrize(("words", "said"), [
    ("--viewpoint 1.png", r"2 pictures are called '1\.png' \(A/1\.png, B/1\.png\)"),
    ("--viewpoint 4", "only 3 are given"),
    ("--viewpoint C/1.png", "--viewpoint: no picture is called"),
    ("--ignore 3=m.png", "--ignore: no picture is called"),
    ("--ignore 2=m.png --ignore A/2.png=n.png", "A/2.png has another mask already"),
])  # fmt: skip
def test_names_that_are_not_clear_are_refused(words: str, said: str) -> None:
    with pytest.raises(BadRequest, match=said):
        numbers(*words.split())


@pytest.mark.parametrize(("words", "expected"), [
    ("1,2,0.5", (1, 2, 0.5)), ("left.jpg,2,3", ("left.jpg", 2, 3.0)),
    ("a.jpg,b, c.jpg,1e1", ("a.jpg", "b, c.jpg", 10.0)),
])  # fmt: skip
def test_a_scale_is_two_pictures_and_their_distance(words: str, expected: tuple) -> None:
    assert options("--scale-metres", words).scale_metres == expected


@pytest.mark.parametrize("words", ["1,2", "1,2,far", "1,2,0", "1,2,-3", "1,2,nan", ",2,3", "1,,3"])
def test_a_scale_of_another_kind_is_refused(words: str, capsys: pytest.CaptureFixture) -> None:
    with pytest.raises(SystemExit):
        parsed("--scale-metres", words)
    assert "A,B,D" in capsys.readouterr().err


def test_the_pictures_of_a_scale_may_be_called_by_their_paths() -> None:
    pictures = [Path("east/1.jpg"), Path("west/1.jpg"), Path("north/2.jpg")]
    found = numbered(options("--scale-metres", "west/1.jpg,2.jpg,4"), pictures)
    assert found.scale_metres == (2, 3, 4.0)
    with pytest.raises(BadRequest, match="--scale-metres"):
        numbered(options("--scale-metres", "1.jpg,2.jpg,4"), pictures)


def test_a_preview_is_one_of_a_stitch() -> None:
    assert options("--preview").preview and not options().preview
    parser = argparse.ArgumentParser()
    add_options(parser, with_field=False)
    assert not options_from(parser.parse_args([]), measure=False).preview
    with pytest.raises(BadRequest, match="leave it out"):
        options("--preview", "--crop", "1,2,30,40")


def test_numbers_of_exposures_are_told_of(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed("--brackets", "0")
    assert "'0' is not known; choose from: auto, off, or a number from 2" in capsys.readouterr().err
