"""What the command says about a stitch."""

from __future__ import annotations

import pytest
from edf_stitch.core.commands.messages import print_summary


@pytest.mark.parametrize(("degrees", "said"), [(0.126, "noise 0.50 px, worst loop 0.13°\n"), (None, "noise 0.50 px\n")])
def test_the_worst_loop_is_told_where_there_is_one(
    capsys: pytest.CaptureFixture[str], degrees: float | None, said: str
) -> None:
    report = {
        "rig": {"edges": [0, 1], "points": 9, "loop_degrees": degrees}, "pictures": [], "left_out": [],
        "field": {"kind": "slack", "centres": 9, "leave_one_out_px": None}, "matches": {"noise_px": 0.5},
        "measured": {"alignment_median_px": 1.0, "alignment_p95_px": 2.0},
    }  # fmt: skip
    print_summary(report, {})
    assert said in capsys.readouterr().err
