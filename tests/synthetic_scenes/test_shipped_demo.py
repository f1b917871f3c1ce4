"""`edf demo --no-render`: what ships is enough for a first look, and its cameras are those of its pictures."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.picture import load_picture
from edf_stitch.synthetic_scenes import shipped_demo
from edf_stitch.synthetic_scenes.demo import LABEL
from edf_stitch.synthetic_scenes.shipped_demo import SHIPPED


@pytest.mark.slow
def test_what_ships_is_stitched_and_beside_the_truth(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing renders; the figures are those of a good stitch; every file that is named is there."""
    assert main(["demo", "--no-render", "-o", str(tmp_path / "out"), "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    figures = [line for line in lines if re.search(r"\d (degrees|px|dB|mm|%)$", line)]
    found = {line[:LABEL].strip(): float(line[LABEL:].split()[0]) for line in figures}
    assert found["rotation error"] < 0.2 and found["overlap of the two pictures, PSNR"] > 25
    assert found["rotation error, worst of all"] < 0.3
    assert found["place of a camera, error, worst of all"] < 30
    named = [Path(line) for line in lines if line.startswith(str(tmp_path))]
    assert {path for path in (tmp_path / "out").rglob("*") if path.is_file()} == set(named) and len(named) == 17
    assert main(["demo", "--no-render", "-o", str(tmp_path / "out"), "--quiet"]) == 4, "nothing is replaced"


def test_what_ships_is_small_and_has_a_camera_each() -> None:
    pictures = sorted(SHIPPED.glob("*/*.jpg"))
    assert sum(path.stat().st_size for path in SHIPPED.rglob("*") if path.is_file()) < 600_000
    entries = json.loads((SHIPPED / "cameras.json").read_text("utf-8"))
    assert {(folder, name) for folder, views in entries.items() for name in views} == {
        (path.parent.name, path.stem) for path in pictures}  # fmt: skip
    cameras = shipped_demo.shipped_cameras()
    for path, camera in zip(pictures, [*cameras["pair"], *cameras["room"]], strict=True):
        height, width = load_picture(path).light.shape[:2]
        assert camera.size == (width, height)
