"""What --verbose says of a stitch."""

from __future__ import annotations

import pytest
from edf_stitch.core.commands.messages import print_summary


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
