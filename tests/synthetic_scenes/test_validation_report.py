"""The report says what the verdict says, in three files that are the same for the same results."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from html.parser import HTMLParser
from typing import Any

import pytest
from edf_stitch.synthetic_scenes.thresholds import judge
from edf_stitch.synthetic_scenes.validation_report import report_files, summary_lines

WAYS = ("known/strict", "known/slack", "known/paper", "known/homography", "unknown/strict", "unknown/slack")
KINDS = ("reference", "target", "stitch", "truth", "difference", "lines", "error_map")
VOID = {"meta", "img", "br", "link", "hr", "input"}


def scene(name: str, model: str = "general", **changed: Any) -> dict[str, Any]:
    figures = {"rotation_deg": 0.0123, "focal_percent": -0.5, "h_inf_px": 0.2, "projectivity_px": 0.05,
               "alignment_px": 0.1, "covered": None, "overlap_psnr_db": 31.0, "whole_psnr_db": 30.0,
               "beyond_px": 0.3, "beyond_p90_px": 1.5, "slid_auto_px": 0.1, "slid_auto_p95_px": 0.5,
               "slid_half_px": 0.1, "slid_half_p95_px": 0.5, "slid_auto_reference_px": 0.0,
               "over_average_db": 1.0, "over_average_ssim": 0.01, "overlap_over_average_db": 9.0,
               "source_fidelity_mean": 0.99, "source_fidelity_p5": 0.95, "seam_visibility": 0.5,
               "new_figure": 7.0}  # fmt: skip
    runs = {
        way: {"model": None if way.endswith("homography") else model, "undetermined_said": False, "refused": "",
              "warnings": [], "figures": dict(figures)}
        for way in WAYS
    }  # fmt: skip
    runs["known/paper"]["figures"]["whole_psnr_db"] = 28.25
    runs["known/homography"] |= {"refused": "too <few> matches", "figures": {}}
    proof = {"position_px": 0.001, "depth_relative": 1e-7, "ray_cast_relative": 1e-6, "f_px": 0.001,
             "warp_psnr_db": 40.0, "half_pixel_psnr_db": 30.0, "wide_psnr_db": 50.0}  # fmt: skip
    return {
        "schema": 1, "scene": name, "title": "Façades & <poles>", "size": [640, 480], "expected_model": model,
        "parallax": model == "general", "focal_determined": True, "status": "done", "message": "", "proof": proof,
        "runs": runs, "pictures": {kind: f"scenes/{name.replace(':', '_')}/{kind}.jpg" for kind in KINDS},
    } | changed  # fmt: skip


def crashed() -> dict[str, Any]:
    message = "Fatal Python error:\nSegmentation fault </pre>"
    return scene("foliage", status="failed", message=message, proof={}, runs={}, pictures={})


@pytest.fixture
def results() -> list[dict[str, Any]]:
    wrong = scene("street:noise=2", "general")
    wrong["runs"]["unknown/slack"]["model"] = "plane"
    wrong["runs"]["known/strict"]["warnings"] = ["<script>alert(1)</script>"]
    return [scene("relief"), scene("turn", "rotation"), wrong, crashed()]


class Page(HTMLParser):
    """A page's tags, checked for balance, its pictures, links, names and visible text."""

    def __init__(self, data: bytes) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: dict[str, list[str]] = {}
        self.text = ""
        self.feed(data.decode())
        self.close()
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        for name, value in attrs:
            self.attributes.setdefault(name, []).append(value or "")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> within {self.open}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.text += data + "\n"


def rows(results: list[dict[str, Any]]) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(report_files(results, "quick", True, "1.2")["report.csv"].decode())))


def test_the_same_results_give_the_same_bytes(results: list[dict[str, Any]]) -> None:
    first = report_files(results, "quick", True, "1.2")
    again = report_files(json.loads(json.dumps(results)), "quick", True, "1.2")
    assert first == again and set(first) == {"report.json", "report.csv", "report.html"}
    # as another process would, where sets have another order
    code = (
        "import json, sys; from edf_stitch.synthetic_scenes.validation_report import report_files\n"
        "files = report_files(json.load(sys.stdin), 'quick', True, '1.2')\n"
        "heavy = {'bpy', 'cv2', 'numpy', 'scipy'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        "sys.stdout.buffer.write(b''.join(files[name] for name in sorted(files)))"
    )
    done = subprocess.run([sys.executable, "-c", code], input=json.dumps(results).encode(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == b"".join(first[name] for name in sorted(first))


def test_the_json_holds_verdict_medians_and_the_scenes_as_given(results: list[dict[str, Any]]) -> None:
    report = json.loads(report_files(results, "quick", True, "1.2")["report.json"])
    verdict = judge(results, True)
    assert (report["schema"], report["suite"], report["version"], report["complete"]) == (1, "quick", "1.2", True)
    assert report["passed"] is False and report["scenes"] == results
    assert report["counts"] == {"scenes": 4, "scenes_failed": 2, "checks": len(verdict.checks), "checks_failed": 2}
    assert [check["passed"] for check in report["checks"]] == [check.passed for check in verdict.checks]
    rotation = report["medians"][0]
    assert (rotation["measure"], rotation["value"], rotation["scenes"], rotation["missing"]) == (
        "rotation_deg", 0.0123, 3, 1,
    )  # fmt: skip
    assert rotation["judged"] and rotation["passed"]
    alone = json.loads(report_files(results, "quick", False, "1.2")["report.json"])
    assert not any(check["scene"] is None for check in alone["checks"])
    assert not any(middle["judged"] for middle in alone["medians"])


def test_the_csv_has_a_row_for_every_run_and_one_for_a_scene_without(results: list[dict[str, Any]]) -> None:
    table = rows(results)
    assert len(table) == 3 * len(WAYS) + 1
    assert [row["run"] for row in table] == 3 * list(WAYS) + [""]
    first = table[0]
    assert (first["scene"], first["title"], first["model"]) == ("relief", "Façades & <poles>", "general")
    assert (first["rotation_deg"], first["covered"], first["new_figure"]) == ("0.0123", "", "7.0")
    assert [(row["scene"], row["run"]) for row in table if row["run_passed"] == "false"] == [
        ("street:noise=2", "unknown/slack"), ("foliage", ""),
    ]  # fmt: skip
    assert {row["scene"] for row in table if row["scene_passed"] == "false"} == {"street:noise=2", "foliage"}


def test_the_page_is_whole_and_needs_nothing_but_its_pictures(results: list[dict[str, Any]]) -> None:
    data = report_files(results, "quick", True, "1.2")["report.html"]
    page = Page(data)
    pictures = {path for result in results for path in result["pictures"].values()}
    assert set(page.attributes["src"]) == pictures and page.tags.count("img") == len(pictures)
    assert set(page.attributes["loading"]) == {"lazy"} and not {"script", "link", "iframe"} & set(page.tags)
    assert b"http" not in data and b"url(" not in data and b"@import" not in data
    names = page.attributes["id"]
    assert len(set(names)) == len(names) == len(results)
    links = {link for link in page.attributes["href"] if link not in pictures}
    assert links == {"#", *(f"#{name}" for name in names)}


def test_the_page_escapes_what_others_wrote(results: list[dict[str, Any]]) -> None:
    results[0]["title"] = results[0]["runs"]["known/slack"]["refused"] = "<img src=x onerror=alert(2)>"
    results[0]["pictures"]["stitch"] = 'scenes/a"b/<x>.jpg'
    page = report_files(results, "<b>quick", True, "<i>1")["report.html"].decode()
    assert "<script" not in page and "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert "<img src=x" not in page and "</pre>" in page and "fault &lt;/pre&gt;" in page
    assert 'src="scenes/a%22b/%3Cx%3E.jpg"' in page and "<b>quick" not in page and "<i>1" not in page
    Page(page.encode())


@pytest.mark.parametrize("complete", [False, True])
def test_the_page_shows_the_verdict_and_what_failed(results: list[dict[str, Any]], complete: bool) -> None:
    text = Page(report_files(results, "quick", complete, "1.2")["report.html"]).text
    assert "✗ Validation failed" in text and "2 of 4 scenes" in text
    assert "unknown/slack model: plane (limit = general)" in text and "Segmentation fault" in text
    assert ("no medians judged" in text) == (not complete)
    fine = Page(report_files(results[:2], "quick", complete, "1.2")["report.html"]).text
    assert "✓ Validation passed" in fine and "✗" not in fine and "2 of 2 scenes" in fine


def test_a_bad_figure_is_marked_where_it_stands_and_the_best_picture_is_bold(results: list[dict[str, Any]]) -> None:
    results[0]["runs"]["known/strict"]["figures"]["h_inf_px"] = 5.4321
    results[0]["runs"]["known/paper"]["figures"]["whole_psnr_db"] = 33.25
    page = report_files(results, "quick", True, "1.2")["report.html"].decode()
    assert '<td class="n bad">5.432 <b class="mark">✗</b></td>' in page
    assert '<td class="n good">0.012 <b class="mark">✓</b></td>' in page
    assert '<td class="n bad">30.00 <b class="mark">✗</b></td>' in page, "a rival is better by 3.25 dB"
    assert "<td class=n><b>33.25</b></td>" in page and "<td class=n>–</td>" in page
    assert "whole picture PSNR, lead over known/paper: -3.25 dB (limit ≥ -0.2)" in page


def test_where_nothing_is_measured_there_still_is_a_report() -> None:
    for results in ([], [crashed()]):
        files = report_files(results, "full", True, "1.2")
        assert "✗ Validation failed" in Page(files["report.html"]).text
        assert not json.loads(files["report.json"])["passed"]
        assert len(rows(results)) == len(results)
        assert summary_lines(judge(results, True), results)[0].startswith("FAILED")


def test_the_terminal_gets_the_verdict_the_medians_and_the_first_failures(results: list[dict[str, Any]]) -> None:
    lines = summary_lines(judge(results[:2], True), results[:2])
    assert lines[0].startswith("PASSED: 2 of 2 scenes") and "failed:" not in lines
    assert any("rotation: 0.012 ° (limit ≤ 0.02)" in line and "ok" in line for line in lines)
    lines = summary_lines(judge(results, True), results)
    assert lines[0].startswith("FAILED: 2 of 4 scenes")
    assert lines[-2:] == ["  street:noise=2 unknown/slack: model plane (limit = general)",
                          "  foliage: status failed (limit = done)"]  # fmt: skip
    alone = summary_lines(judge(results, False), results)
    assert not any("median over" in line or "0.03" in line for line in alone)
    many = [crashed() | {"scene": f"scene {k}"} for k in range(16)]
    lines = summary_lines(judge(many, False), many)
    assert lines[-1] == "  and 1 more: see report.html" and "scene 14" in lines[-2]
    assert "more" not in summary_lines(judge(many[:15], False), many[:15])[-1]
