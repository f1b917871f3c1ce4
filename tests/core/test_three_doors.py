"""A pair, a set and a sphere come out the same by every door, `edf`, `stitch()` and the worker that Blender starts, and
with any number of threads; on other processors' arithmetic, with other last digits, the same is decided of a pair."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import edf_stitch
import numpy as np
import pytest
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import load_picture, picture_from_array
from edf_stitch.synthetic_scenes.two_planes import make_pair

from ..sets import FOCAL, make_set
from .commands.test_worker import run

pytestmark = pytest.mark.slow
PAIR_FOCAL = 228.0
# What is asked for by keywords; the command line and the worker name the same by words of theirs.
ASKED: dict[str, dict[str, Any]] = {
    "pair": {"focal_px": PAIR_FOCAL},
    "set": {"focal_px": FOCAL, "dense": False},
    "sphere": {"focal_px": FOCAL, "dense": False, "projection": "equirectangular", "crop": "full"},
}
# Kernels of OpenBLAS that differ in their last digits: without AVX, with AVX2, and as this processor has them.
KERNELS = ("Nehalem", "Haswell", "")
# dB that panoramas made by different kernels are alike by at least.
ALIKE_DB = 45.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pair, a.png and b.png, and a set, 1.png to 3.png. Nothing is to be written there."""
    made, pair = tmp_path_factory.mktemp("pictures"), make_pair(240, 180)
    two = picture_from_array(pair.reference, "a.png"), picture_from_array(pair.target, "b.png")
    for picture in (*two, *make_set(3, size=(240, 180)).pictures):
        (made / picture.name).write_bytes(encode_picture(picture.pixels, None, 8, ".png")[0])
    return made


@pytest.fixture
def threads() -> Iterator[None]:
    """The number of threads is put back."""
    before = cv2.getNumThreads()
    yield
    cv2.setNumThreads(before)


def pictures_of(kind: str, folder: Path) -> list[Path]:
    return [folder / f"{name}.png" for name in ("ab" if kind == "pair" else "123")]


def words_of(asked: dict[str, Any]) -> list[str]:
    """A call's keywords as options of the command line."""
    words = []
    for name, value in asked.items():
        words += [f"--no-{name}"] if value is False else [f"--{name.replace('_', '-')}", str(value)]
    return words


def by_keywords(kind: str, folder: Path, out: Path, count: int) -> None:
    cv2.setNumThreads(count)
    edf_stitch.stitch(pictures_of(kind, folder), **ASKED[kind]).save(out / f"{count}.png")


def by_worker(kind: str, folder: Path, out: Path) -> Path:
    """The panorama's file of a job as the panel makes them."""
    asked = {name: value for name, value in ASKED[kind].items() if name != "focal_px"}
    job = {
        "pictures": [{"name": path.name, "path": str(path)} for path in pictures_of(kind, folder)],
        "options": {**asked, "camera": {"focal_px": [ASKED[kind]["focal_px"]]}},
    }
    status, _, index = run(out / "job", job)
    assert status == 0
    return out / "job" / index["files"]["panorama"]


@pytest.mark.usefixtures("threads")
@pytest.mark.parametrize("kind", ASKED)
def test_all_doors_and_numbers_of_threads_make_the_same_bytes(kind: str, folder: Path, tmp_path: Path) -> None:
    words = [*map(str, pictures_of(kind, folder)), *words_of(ASKED[kind])]
    assert main(["stitch", *words, "--no-cache", "--quiet", "-o", str(tmp_path / "out.png")]) == 0
    made = (tmp_path / "out.png").read_bytes()
    for count in (1, 2, 4):
        by_keywords(kind, folder, tmp_path, count)
        assert (tmp_path / f"{count}.png").read_bytes() == made, f"{count} threads"
    assert by_worker(kind, folder, tmp_path).read_bytes() == made


def decided(report: Any) -> Any:
    """All that a report says in words, yes or no, and how much of it there is; without its numbers."""
    if isinstance(report, dict):
        return {name: decided(value) for name, value in report.items()}
    if isinstance(report, list):
        return [decided(value) for value in report]
    if isinstance(report, str):
        return re.sub(r"[\d.]+", "#", report)
    return report if isinstance(report, bool) or report is None else 0


@pytest.mark.parametrize("kind", ["pair"])
def test_other_kernels_of_arithmetic_decide_the_same(kind: str, folder: Path, tmp_path: Path) -> None:
    reports, panoramas = [], []
    words = [*map(str, pictures_of(kind, folder)), *words_of(ASKED[kind]), "--no-cache", "--quiet"]
    for kernel in KERNELS:
        environment = {**os.environ, "OPENBLAS_CORETYPE": kernel}
        if not kernel:
            del environment["OPENBLAS_CORETYPE"]
        out = tmp_path / f"{kind}{kernel}"
        files = ["-o", str(out.with_suffix(".png")), "--report", str(out.with_suffix(".json"))]
        command = [sys.executable, "-m", "edf_stitch", "stitch", *words, *files]
        subprocess.run(command, check=True, env=environment, cwd=tmp_path)
        reports.append(json.loads(out.with_suffix(".json").read_text("utf-8")))
        panoramas.append(load_picture(out.with_suffix(".png")).pixels)
    for kernel, report, panorama in zip(KERNELS, reports, panoramas, strict=True):
        assert decided(report) == decided(reports[-1]), (kind, kernel)
        assert report["canvas"]["box"] == reports[-1]["canvas"]["box"], (kind, kernel)
        assert panorama.shape == panoramas[-1].shape, (kind, kernel)
        error = float(np.square(panorama - panoramas[-1]).mean())
        decibels = -10 * np.log10(error) if error else np.inf
        print(kind, kernel or "as it is", f"{decibels:.1f} dB")
        assert decibels > ALIKE_DB, (kind, kernel, decibels)
