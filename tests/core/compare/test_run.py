"""The comparison whole: on a small pair, with fields that fail, pairs that are none, and through the command."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch.core.cameras.sources import CameraRequest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.compare import pair_fields
from edf_stitch.core.compare.pairs import PairFiles, find_pairs
from edf_stitch.core.compare.run import FILES, ComparisonRequest, comparable, run_comparison
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.gpano import whole_sphere
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.system.errors import BadRequest, Cancelled, DegenerateGeometry, UnwritableOutput

from ...pairs import ON_REFERENCE

FIELDS = ("slack", "homography")


def compared(folder: Path, out: Path, *more: PairFiles, fields: tuple[str, ...] = FIELDS, **given):
    request = ComparisonRequest(out, (*find_pairs([folder]), *more), fields)
    return run_comparison(request, given.pop("options", ON_REFERENCE), "1.2.3", **given)


@pytest.fixture(scope="module")
def done(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """A comparison of the small pair."""
    out = tmp_path_factory.mktemp("compared") / "new" / "folder"
    summary, code = compared(folder, out)
    assert code == 0
    return summary, out


def test_everything_is_there_and_agrees(done: tuple[dict, Path], folder: Path) -> None:
    summary, out = done
    assert {path.name for path in out.iterdir()} == {*FILES, "pictures"}
    on_disk = json.loads((out / "compare.json").read_text())
    (entry,) = on_disk["pairs"]
    assert entry["status"] == "done" and list(entry["fields"]) == list(FIELDS) and entry["model"] == "general"
    for one in entry["fields"].values():
        for path in one["pictures"].values():
            assert (out / path).read_bytes()[:3] == b"\xff\xd8\xff"
            if "difference" in path:
                assert path in (out / "compare.html").read_text()
    slack, flat = (entry["fields"][name]["figures"] for name in FIELDS)
    assert slack["overlap_psnr_db"] > flat["overlap_psnr_db"] + 1 and slack["held_out_rms_px"] < flat["held_out_rms_px"]
    assert f"{slack['overlap_psnr_db']:.2f}" in (out / "compare.md").read_text()
    seconds = json.loads((out / "timing.json").read_text())[entry["name"]]
    assert list(seconds) == ["registration", *(f"{name}: {part}" for name in FIELDS
                                               for part in ("alignment", "composition"))]  # fmt: skip


def test_it_is_what_a_stitch_of_its_own_measures(done: tuple[dict, Path], folder: Path) -> None:
    """Sharing features and geometry changes nothing."""
    figures = done[0]["pairs"][0]["fields"]["slack"]["figures"]
    alone = stitch((folder / "reference.png", folder / "target.png"), ON_REFERENCE).report["measured"]
    for name in ("overlap_psnr_db", "overlap_ssim", "alignment_median_px", "held_out_rms_px", "off_line_mean_px"):
        assert figures[name] == pytest.approx(alone[name], abs=1e-9), name
    assert figures["projectivity_px"] == pytest.approx(alone["projectivity_own_px"], abs=1e-9)
    assert figures["projectivity_independent_px"] == pytest.approx(alone["projectivity_independent_px"], abs=1e-9)


def test_rivals_are_judged_by_the_lines_that_they_do_not_know(done: tuple[dict, Path]) -> None:
    figures = done[0]["pairs"][0]["fields"]["homography"]["figures"]
    assert figures["projectivity_px"] > 0 and figures["off_line_mean_px"] > 0


def test_the_same_call_gives_the_same_bytes_but_for_the_seconds(
    done: tuple[dict, Path], folder: Path, tmp_path: Path
) -> None:
    compared(folder, tmp_path / "again")
    for path in sorted(done[1].rglob("*")):
        if path.is_file() and not path.name.startswith("timing"):
            assert path.read_bytes() == (tmp_path / "again" / path.relative_to(done[1])).read_bytes(), path.name


def test_a_pair_that_fails_is_a_row_that_says_why(folder: Path, tmp_path: Path) -> None:
    lines: list[str] = []
    same = PairFiles("same", folder / "reference.png", folder / "reference.png")
    none = PairFiles("set", folder / "reference.png", folder / "target.png", trouble="the folder holds 3 pictures")
    summary, code = compared(folder, tmp_path, same, none, fields=("homography",), tell=lines.append)
    assert code == 3 and [entry["status"] for entry in summary["pairs"]] == ["done", "failed", "failed"]
    assert "same picture" in summary["pairs"][1]["message"] and "3 pictures" in (tmp_path / "compare.md").read_text()
    assert "homography" in lines[0] and "failed: " in lines[1] and "same picture" in lines[1]


def test_a_sphere_is_no_half_of_a_pair(folder: Path, tmp_path: Path) -> None:
    (pair,) = find_pairs([folder])
    wide = np.random.default_rng(0).random((60, 120, 3)).astype(np.float32)
    (tmp_path / "sphere.png").write_bytes(encode_picture(wide, None, 8, ".png", sphere=whole_sphere((120, 60)))[0])
    request = ComparisonRequest(tmp_path / "out", (replace(pair, target=tmp_path / "sphere.png"),), FIELDS)
    summary, code = run_comparison(request, ON_REFERENCE, "1.2.3")
    assert code == 2 and "compared on two flat pictures" in summary["pairs"][0]["message"]


def test_a_field_that_fails_stops_no_other(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = pair_fields.fit_and_warp

    def fit(geometry, frames, options, progress):
        if options.field == "apap":
            raise DegenerateGeometry("nothing to hold on to")
        return real(geometry, frames, options, progress)

    monkeypatch.setattr(pair_fields, "fit_and_warp", fit)
    summary, code = compared(folder, tmp_path, fields=("apap", "homography"))
    fields = summary["pairs"][0]["fields"]
    assert code == 0 and fields["apap"]["message"] == "nothing to hold on to" and fields["homography"]["figures"]
    assert "- " + summary["pairs"][0]["name"] + ", apap: nothing" in (tmp_path / "compare.md").read_text()


@dataclass(frozen=True)
class KnownTruth:
    """Stands in for a rendered pair's."""

    camera: CameraRequest

    def figures(self, results: Mapping[str, StitchResult]) -> dict[str, dict[str, float]]:
        return {name: {"truth_alignment_px": float(result.cameras[0].focal)} for name, result in results.items()}


def test_the_truth_beside_a_pair_is_asked_and_tells_the_cameras(folder: Path, tmp_path: Path) -> None:
    asked: list[Path] = []

    def truths(place: Path) -> KnownTruth:
        asked.append(place)
        return KnownTruth(CameraRequest(focal_px=(333.0,)))

    summary, _ = compared(folder, tmp_path, fields=("homography",), truths=truths)
    entry = summary["pairs"][0]
    assert asked == [folder] and entry["rendered"]
    assert entry["fields"]["homography"]["figures"]["truth_alignment_px"] == 333.0
    assert "Off the true map, median, px:" in (tmp_path / "compare.md").read_text()


def test_nothing_is_replaced_unasked_and_nothing_is_left_of_what_was_cancelled(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "compare.md").write_text("mine")
    with pytest.raises(UnwritableOutput, match="--overwrite"):
        compared(folder, tmp_path)
    with pytest.raises(Cancelled):
        compared(folder, tmp_path / "new", cancelled=lambda: True)
    assert [path.name for path in tmp_path.iterdir()] == ["compare.md"]


@pytest.mark.parametrize(("change", "words"), [
    ({"crop": "inscribed"}, "--crop"), ({"matches": np.zeros((20, 4))}, "--matches belongs to one pair"),
    ({"ignore": (None, np.zeros((5, 5)))}, "--ignore-target belongs to one pair"),
])  # fmt: skip
def test_what_makes_no_sense_for_several_pairs_is_refused(
    folder: Path, tmp_path: Path, change: dict, words: str
) -> None:
    again = PairFiles("again", folder / "reference.png", folder / "target.png")
    with pytest.raises(BadRequest, match=words):
        compared(folder, tmp_path, again, options=replace(ON_REFERENCE, **change))


@pytest.mark.parametrize(("change", "words"), [
    ({"projection": "pannini"}, "leave --projection"), ({"projection": "auto", "fov": 60.0}, "--fov out"),
    ({"projection": "auto", "centre": (1.0, 2.0)}, "--centre"), ({"projection": "auto", "slide": 0.5}, "leave --slide"),
    ({"projection": "auto", "crop": (0, 0, 9, 9)}, "--crop"),
])  # fmt: skip
def test_figures_are_compared_on_the_plane_where_all_fields_exist(change: dict, words: str) -> None:
    with pytest.raises(BadRequest, match=words):
        comparable(StitchOptions(**change), ())


def test_what_would_be_chosen_by_itself_is_what_can_be_compared() -> None:
    by_itself = StitchOptions(
        projection="auto", slide="auto", crop="auto", holes="auto", fade="continue", seed=7, blend="feather"
    )
    plain = StitchOptions(
        projection="reference", slide=0.0, crop="full", holes="transparent", fade="plane", seed=7, blend="feather"
    )
    assert comparable(by_itself, ()) == comparable(plain, ()) == plain
    for asked in ({"fade": "infinity"}, {"holes": "inpaint"}):
        assert comparable(replace(by_itself, **asked), ()) == replace(plain, **asked)


@pytest.mark.parametrize("fields", [(), ("slack", "hugin"), ("slack", "slack")])
def test_fields_that_are_not_there_are_refused(fields: tuple[str, ...], tmp_path: Path) -> None:
    with pytest.raises(BadRequest):
        ComparisonRequest(tmp_path, (), fields)


def test_the_command_compares(folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = ["compare", str(folder), "-o", str(tmp_path / "out"), "--fields", "homography", "--no-cache"]
    assert main(words) == 0
    out, err = capfd.readouterr()
    assert out.strip() == str(tmp_path / "out" / "compare.html") and "homography" in err
    assert main(words) == 4 and "--overwrite" in capfd.readouterr().err
    assert main([*words, "--overwrite", "--quiet"]) == 0 and capfd.readouterr().err == ""
    for wrong, said in ((["--fields", "hugin"], "'hugin'"), (["--crop", "inscribed"], "--crop")):
        assert main([*words, "--overwrite", *wrong]) == 2
        assert said in capfd.readouterr().err
