"""Sets by every program: each is a column, and what one cannot do is a row that says why; runs go on and share."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.compare import sets
from edf_stitch.core.compare.elsewhere.hugin import HuginFailed
from edf_stitch.core.compare.pairs import PairFiles, find_pairs
from edf_stitch.core.compare.run import ComparisonRequest, run_comparison
from edf_stitch.core.measure.placed.placed import PlacedPicture, PlacedSet, union
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.system.errors import BadRequest

from ...pairs import ON_REFERENCE


@pytest.fixture
def folder_of_three(tmp_path: Path) -> Path:
    plane = cv2.resize(np.random.default_rng(0).normal(128, 40, (30, 70, 3)), (700, 300), interpolation=cv2.INTER_CUBIC)
    place = tmp_path / "street"
    place.mkdir()
    for number in range(3):
        part = np.clip(plane[:, 150 * number : 150 * number + 400], 0, 255).astype(np.uint8)
        cv2.imwrite(str(place / f"{number}.png"), part)
    return place


def pasted(pictures) -> PlacedSet:
    """Each 150 px from the one before: where they belong."""
    found = tuple(
        PlacedPicture(one.name, one.view, np.ones(one.view.shape[:2], bool), (150 * number, 0))
        for number, one in enumerate(pictures)
    )
    return PlacedSet((700, 300), found, None, union((700, 300), found))


@pytest.fixture
def programs(monkeypatch: pytest.MonkeyPatch) -> None:
    """OpenCV's does it right, leaving one out, and the others fail."""

    def fails(*_):
        raise HuginFailed("cpfind cannot be run: install Hugin")

    monkeypatch.setattr(sets, "hugin_panorama", fails)
    monkeypatch.setattr(sets, "stitcher_panorama", lambda pictures: pasted(pictures[:2]))
    monkeypatch.setattr(sets._Ours, "placed", fails)


def test_every_program_is_a_column_and_a_failure_says_why(
    folder_of_three: Path, tmp_path: Path, programs: None
) -> None:
    request = ComparisonRequest(tmp_path / "out", tuple(find_pairs([folder_of_three])))
    summary, code = run_comparison(request, StitchOptions(), "1.2.3")
    (entry,) = summary["sets"]["pairs"]
    assert code == 0 and list(entry["fields"]) == summary["sets"]["fields"] == list(sets.PROGRAMS)
    figures = entry["fields"]["opencv"]["figures"]
    assert figures["used"] == 2 and figures["gained_ssim"] == pytest.approx(1) and figures["fill"] == 1
    assert "2" in entry["fields"]["opencv"]["message"]
    text = (tmp_path / "out" / "compare.md").read_text()
    assert "- street, hugin: cpfind cannot be run: install Hugin" in text and "| street |" in text
    page = (tmp_path / "out" / "compare.html").read_text()
    assert "3 pictures: 0.png, 1.png, 2.png" in page and "street/opencv-panorama.jpg" in page
    assert (tmp_path / "out" / "pictures" / "street" / "opencv-difference.jpg").is_file()
    assert ",opencv,done," in (tmp_path / "out" / "compare.csv").read_text()


def test_a_picture_that_another_program_leaves_out_is_none_of_its_figures(folder: Path, tmp_path: Path) -> None:
    pair, theirs = find_pairs([folder]), tmp_path / "theirs"
    theirs.mkdir()
    cv2.imwrite(str(theirs / "01_target.png"), np.full((200, 300, 4), 255, np.uint8))
    request = ComparisonRequest(tmp_path / "out", tuple(pair), ("homography",), outside=(("one", theirs),))
    summary, code = run_comparison(request, StitchOptions(dense=False), "1")
    assert code == 0 and summary["pairs"][0]["fields"]["one"]["figures"]["used"] == 1


def test_copies_are_refused_since_others_take_them_for_pictures(
    folder_of_three: Path, tmp_path: Path, programs: None
) -> None:
    (folder_of_three / "3.png").write_bytes((folder_of_three / "2.png").read_bytes())
    request = ComparisonRequest(tmp_path / "out", tuple(find_pairs([folder_of_three])))
    summary, code = run_comparison(request, StitchOptions(), "1.2.3")
    assert code == 2 and "4 files are 3 pictures" in summary["sets"]["pairs"][0]["message"]
    assert "- street: 4 files are 3 pictures" in (tmp_path / "out" / "compare.md").read_text()


def test_what_is_not_asked_for_is_not_measured(folder_of_three: Path, tmp_path: Path, programs: None) -> None:
    request = ComparisonRequest(tmp_path / "out", tuple(find_pairs([folder_of_three])), measures=("keep",))
    summary, _ = run_comparison(request, StitchOptions(), "1.2.3")
    figures = summary["sets"]["pairs"][0]["fields"]["opencv"]["figures"]
    assert "fill" in figures and not {"gained_ssim", "bent_px", "off_lines_px"} & set(figures)


def test_shards_share_the_work_and_a_resumed_run_puts_all_together(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pairs = tuple(PairFiles(name, folder / "reference.png", folder / "target.png") for name in ("one", "two"))
    out = tmp_path / "out"

    def run(**more):
        told: list[str] = []
        request = ComparisonRequest(out, pairs, ("homography",), measures=("overlap",), **more)
        return run_comparison(request, ON_REFERENCE, "1.2.3", tell=told.append), told

    (summary, _), told = run(shard=(1, 2))
    assert summary["missing"] == ["two"] and len(told) == 1 and not (out / "compare.md").exists()
    (summary, _), told = run(shard=(2, 2))
    assert summary["missing"] == [] and len(told) == 1 and [one["name"] for one in summary["pairs"]] == ["one", "two"]
    first = (out / "compare.json").read_bytes()
    (_, code), told = run(resume=True)
    assert told == [] and code == 0 and (out / "compare.json").read_bytes() == first
    part = out / "parts" / "two.json"
    part.write_text(json.dumps(json.loads(part.read_text()) | {"mark": "another"}))
    assert len(run(resume=True)[1]) == 1, "what was made otherwise is made again"
    part.write_text("nonsense")
    assert len(run(resume=True)[1]) == 1
    assert (out / "pictures" / "two" / "homography-panorama.jpg").is_file()


@pytest.mark.parametrize(("given", "words"), [
    ({"measures": ("beauty",)}, "no measure 'beauty'"), ({"measures": ()}, "no measure named"),
    ({"outside": (("hugin", Path()),)}, "--outside hugin"),
    ({"outside": (("a", Path()), ("a", Path()))}, "--outside a"),
    ({"outside": (("rotation_only", Path()),)}, "--outside rotation_only"),  # its pictures would be that program's
    ({"outside": (("a", Path()), ("A", Path()))}, "--outside a"),
    ({"shard": (3, 2)}, "shard 3/2"),
])  # fmt: skip
def test_what_cannot_be_asked_for_is_refused(given: dict, words: str, tmp_path: Path) -> None:
    with pytest.raises(BadRequest, match=words):
        ComparisonRequest(tmp_path, (), **given)


def test_the_command_takes_results_made_elsewhere(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    layers = tmp_path / "theirs"
    stitched = ["stitch", str(folder / "reference.png"), str(folder / "target.png"), "-o", str(tmp_path / "p.png"),
                "--projection", "reference", "--layers", str(layers), "--no-dense", "--no-cache"]  # fmt: skip
    assert main(stitched) == 0
    words = ["compare", str(folder), "-o", str(tmp_path / "out"), "--fields", "homography", "--measure", "overlap,keep",
             "--outside", f"UDIS2={layers}", "--no-cache"]  # fmt: skip
    assert main(words) == 0
    entry = json.loads((tmp_path / "out" / "compare.json").read_text())["pairs"][0]
    theirs, ours = (entry["fields"][name]["figures"] for name in ("UDIS2", "homography"))
    assert theirs["overlap_psnr_db"] > ours["overlap_psnr_db"] + 1
    assert main([*words[:-2], "UDIS2", "--overwrite"]) == 2 and "NAME=FOLDER" in capfd.readouterr().err
    assert main([*words[:-2], "UDIS2=nowhere", "--overwrite"]) == 4 and "no such folder" in capfd.readouterr().err
