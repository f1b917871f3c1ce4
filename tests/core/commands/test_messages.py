"""What the command says about a stitch."""

from __future__ import annotations

import io
import re
import sys
import time

import pytest
from edf_stitch.core.commands.messages import print_summary, progress_shown, verdict_line


@pytest.mark.parametrize(("degrees", "said"), [(0.126, "noise 0.50 px, worst loop 0.13°\n"), (None, "noise 0.50 px\n")])
def test_the_worst_loop_is_told_where_there_is_one(
    capsys: pytest.CaptureFixture[str], degrees: float | None, said: str
) -> None:
    report = {
        "rig": {"edges": [0, 1], "points": 9, "loop_degrees": degrees, "scale": "measured"},
        "pictures": [], "left_out": [],
        "field": {"kind": "slack", "centres": 9, "leave_one_out_px": None}, "matches": {"noise_px": 0.5},
        "measured": {"alignment_median_px": 1.0, "alignment_p95_px": 2.0},
    }  # fmt: skip
    print_summary(report, {})
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("scale", ["one place", "measured"])
def test_it_is_said_when_all_pictures_are_from_one_place(scale: str, capsys: pytest.CaptureFixture[str]) -> None:
    report = {
        "pictures": [], "left_out": [], "matches": {"noise_px": 0.1},
        "rig": {"edges": [], "points": 9, "loop_degrees": None, "scale": scale},
        "field": {"kind": "slack", "centres": 0, "leave_one_out_px": None},
        "measured": {"alignment_median_px": 0.1, "alignment_p95_px": 0.2},
    }  # fmt: skip
    print_summary(report, {})
    assert ("taken from one place" in capsys.readouterr().err) == (scale == "one place")


def test_what_is_doubtful_without_a_place_is_said_beside_the_places() -> None:
    verdict = {
        "is": "look", "because": "9 matches are wrong; near and far do not meet", "what_to_do": "correct them",
        "places": [{"box": [1, 2, 30, 40], "what": "near and far do not meet"}],
    }  # fmt: skip
    assert verdict_line(verdict) == (
        "look at these places: near and far do not meet (1,2 30×40); 9 matches are wrong; correct them"
    )


def test_a_field_without_smoothing_is_told_too(capsys: pytest.CaptureFixture[str]) -> None:
    report = {
        "two_view": {"model": "general", "why": "told", "focal_px": [9.0, 9.0], "focal_source": "EXIF",
                     "focal_deviation": None, "h_inf_spread_px": None},
        "field": {"kind": "homography", "centres": 9, "pruned": 0, "smoothing": None},
        "measured": dict.fromkeys((
            "alignment_median_px", "alignment_p95_px", "off_line_mean_px", "held_out_rms_px", "held_out_towards_rms_px",
            "projectivity_own_px", "projectivity_independent_px", "overlap_psnr_db", "overlap_ssim",
        )),
    }  # fmt: skip
    print_summary(report, {})
    assert "λ -" in capsys.readouterr().err


def test_a_terminal_is_told_how_long_it_will_still_take(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(shown, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", shown)
    with progress_shown(False) as show:
        time.sleep(1.1)
        show("seam", 0.2)
        time.sleep(0.2)
        show("seam", 0.25)
    told = re.findall(r"seam[^\r]* (\d+) % 00:\d\d, 00:(\d\d) left", shown.getvalue())
    seconds = [(int(percent), int(left)) for percent, left in told]
    assert [percent for percent, _ in seconds][-1] == 25, "it moves within a stage too"
    assert all(left >= 2 for _, left in seconds), "three or four times as much as is done"
