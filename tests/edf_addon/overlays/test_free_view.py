"""What the sidebar and the headers leave free of a picture."""

from types import SimpleNamespace

import pytest

pytest.importorskip("bpy")
free_view = pytest.importorskip("edf_stitch.edf_addon.overlays.free_view")


def region(kind: str, x: float, y: float, width: float, height: float, side: str = "NONE") -> SimpleNamespace:
    return SimpleNamespace(type=kind, x=x, y=y, width=width, height=height, alignment=side)


@pytest.fixture
def area() -> SimpleNamespace:
    """An editor at (100, 50) of 1000 × 600 px: a sidebar, an open toolbar, a header, and a tool header that is shut."""
    return SimpleNamespace(
        regions=[
            region("WINDOW", 100, 50, 1000, 600), region("UI", 900, 50, 200, 570, "RIGHT"),
            region("TOOLS", 100, 50, 40, 570, "LEFT"), region("HEADER", 100, 620, 1000, 30, "TOP"),
            region("TOOL_HEADER", 100, 50, 1000, 1, "BOTTOM"),
        ]
    )  # fmt: skip


def test_the_box_is_what_no_open_region_lies_over(area):
    assert free_view.free_box(area, area.regions[0]) == (40, 0, 800, 570)


@pytest.mark.parametrize(("low", "high", "covered"), [
    ((50, 10), (790, 560), False), ((50, 10), (810, 560), True), ((30, 10), (700, 560), True),
    ((50, 10), (700, 580), True), ((-300, -200), (1400, 900), False),
])  # fmt: skip
def test_a_side_beneath_a_region_is_covered_and_one_outside_of_the_editor_is_not(area, low, high, covered):
    window = area.regions[0]
    ends = {0.0: low, 1.0: high}
    window.view2d = SimpleNamespace(view_to_region=lambda x, y, clip: (ends[x][0], ends[y][1]))
    assert free_view.is_covered(area, window) == covered
