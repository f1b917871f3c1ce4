"""A stitch under a hard limit of its address space: it goes through within it, or says what would fit."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.cameras.projective import rotation_from_vector

resource = pytest.importorskip("resource")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="limits the address space as Linux does"),
]
# Address space that is mapped and never held: libraries, and the stacks of threads.
MAPPED = 800_000_000
# A command whose sets are large from so many pixels on.
RUN = """
import sys
from dataclasses import replace
import edf_stitch.core.compose.enlarging.draft as draft
draft.DRAFT = replace(draft.DRAFT, most_pixels=int(sys.argv[1]))
from edf_stitch.core.commands.cli import main
sys.exit(main(sys.argv[2:]))
"""


def write_ring(folder: Path, count: int, rings: int, turn: float, enlarged: int) -> float:
    """JPEGs of a painted sphere, taken from its middle, 1000 × 750 px times `enlarged`; their focal length."""
    folder.mkdir()
    random, size, focal = np.random.default_rng(0), (1000, 750), 750.0
    sphere = np.zeros((2048, 4096, 3), np.float32)
    for side, share in ((16, 0.5), (128, 0.5), (512, 0.4), (2048, 0.25)):
        noise = random.standard_normal((side // 2, side, 3)).astype(np.float32)
        sphere += share * cv2.resize(noise, (4096, 2048), interpolation=cv2.INTER_CUBIC)
    sphere = np.clip(125 + 45 * sphere, 0, 255).astype(np.uint8)
    x, y = np.meshgrid(np.arange(size[0]) - (size[0] - 1) / 2, np.arange(size[1]) - (size[1] - 1) / 2)
    rays = np.stack([x / focal, y / focal, np.ones_like(x)], axis=-1)
    for number in range(count):
        ring, at = divmod(number, -(-count // rings))
        pitch = 0.0 if rings == 1 else 0.66 * ring - 0.33
        up, right = (rotation_from_vector(np.array(vector)) for vector in ((pitch, 0.0, 0.0), (0.0, at * turn, 0.0)))
        a, b, c = np.moveaxis(rays @ up @ right, -1, 0)
        column = (np.arctan2(a, c) / (2 * np.pi) * 4096) % 4096
        row = (np.arctan2(b, np.hypot(a, c)) / np.pi + 0.5) * 2048
        view = cv2.remap(sphere, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
        view = cv2.resize(view, None, fx=enlarged, fy=enlarged, interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(folder / f"{number:02d}.jpg"), view)
    return focal * enlarged


def stitched(folder: Path, most_pixels: int, limit: float, *more: str) -> subprocess.CompletedProcess[str]:
    """`edf stitch` of a folder of pictures with `limit` bytes of address space."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (int(limit), int(limit)))

    call = ["stitch", str(folder), "-o", str(folder.parent / "out.png"), "--no-cache", "--overwrite", *more]
    return subprocess.run(
        [sys.executable, "-c", RUN, str(most_pixels), *call], capture_output=True, text=True, preexec_fn=limited
    )


def test_a_set_goes_through_within_a_hard_limit_or_says_what_would_fit(tmp_path: Path) -> None:
    focal = write_ring(tmp_path / "ring", 6, 1, 0.5, 1)
    given = ("--focal-px", str(focal), "--quiet")
    done = stitched(tmp_path / "ring", 1_000_000, 700_000_000 + MAPPED, *given, "--memory", "0.7")
    assert done.returncode == 0, done.stderr
    with_one = (tmp_path / "out.png").read_bytes()
    again = stitched(tmp_path / "ring", 1_000_000, 64e9, *given)
    assert again.returncode == 0 and (tmp_path / "out.png").read_bytes() == with_one, "the limit changes no byte"
    refused = stitched(tmp_path / "ring", 1_000_000, 64e9, *given, "--memory", "0.4")
    assert refused.returncode == 3 and re.search(r"take about 0\.\d GB, and --memory allows 0\.4 GB", refused.stderr)
    assert "what would fit: --scale" in refused.stderr


@pytest.mark.slow
def test_thirty_pictures_of_12_megapixels_fit_in_three_and_a_half_gigabytes(tmp_path: Path) -> None:
    focal = write_ring(tmp_path / "ring", 30, 2, 2 * np.pi / 15, 4)
    done = stitched(tmp_path / "ring", 48_000_000, 3.5e9 + MAPPED, "--focal-px", str(focal), "--memory", "3.5")
    assert done.returncode == 0, done.stderr
    height, width = cv2.imread(str(tmp_path / "out.png")).shape[:2]
    assert width > 15_000 and height > 3000
