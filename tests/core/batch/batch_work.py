"""What the tests of `edf batch` share: a folder of pairs with lists, a stitch that takes no time, what was said."""

from __future__ import annotations

import json
import os
import shutil
import signal
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.batch import run as batch
from edf_stitch.core.commands.cli import main
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pipeline import StitchOptions, StitchResult
from edf_stitch.core.system.output_files import OutputFiles

from ...pairs import KNOWN_WORDS


def files(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def lasting(folder: Path) -> dict[str, bytes]:
    """What the same call makes the same: all but seconds, summaries and stamps (which know when inputs were made)."""
    return {
        name: data for name, data in files(folder).items()
        if not (name.endswith(".timing.json") or name.startswith((".edf/", "batch.")))
    }  # fmt: skip


def killed_at(place: int) -> None:
    """This process goes when it would put its n-th file in place."""
    original, calls = OutputFiles._place, 0

    def put(self: OutputFiles, temporary: Path, target: Path) -> None:
        nonlocal calls
        calls += 1
        if calls == place:
            os.kill(os.getpid(), signal.SIGKILL)
        original(self, temporary, target)

    OutputFiles._place = put


def summary(folder: Path, name: str = "batch.json") -> dict:
    return json.loads((folder / name).read_text("utf-8"))


def save(path: Path, array: np.ndarray) -> None:
    picture = picture_from_array(array.astype(np.uint8))
    path.write_bytes(encode_picture(picture.pixels, picture.alpha, 8, ".png")[0])


def raw(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return image


@pytest.fixture
def work(folder: Path, tmp_path: Path) -> Path:
    """A folder with three good pairs in in/, and lists: good.csv, and bad.csv whose second pair cannot be stitched."""
    for number in (1, 2, 3):
        for side in ("reference", "target"):
            (tmp_path / "in").mkdir(exist_ok=True)
            shutil.copy(folder / f"{side}.png", tmp_path / "in" / f"{side}{number}.png")
    save(tmp_path / "in" / "noise.png", np.random.default_rng(0).integers(0, 256, (90, 120, 3), np.uint8))
    good = [f"in/reference{n}.png,in/target{n}.png,p{n}" for n in (1, 2, 3)]
    (tmp_path / "good.csv").write_text("\n".join(good), "utf-8")
    bad = [good[0], "in/reference2.png,in/noise.png,p2", good[2]]
    (tmp_path / "bad.csv").write_text("reference,target,name\n" + "\n".join(bad), "utf-8")
    return tmp_path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, small_result: StitchResult) -> list[str]:
    """Stitches nothing: gives the small pair's result, and keeps the names of the references."""
    calls: list[str] = []

    def stitched(pictures: Sequence[Path], options: StitchOptions, progress: Callable, *_: object) -> StitchResult:
        calls.append(pictures[0].stem)
        progress("features", 0.5)
        names = [path.name for path in pictures]
        named = (replace(one, name=name) for one, name in zip(small_result.pictures, names, strict=True))
        return replace(small_result, pictures=tuple(named))

    monkeypatch.setattr(batch, "stitch", stitched)
    return calls


@pytest.fixture
def said(capfd: pytest.CaptureFixture[str]) -> Callable[[], list[str]]:
    """The lines on stderr since the last time; stdout stays empty, and nobody sees a traceback."""

    def read() -> list[str]:
        out, err = capfd.readouterr()
        assert out == "" and "Traceback" not in err and "internal error" not in err
        return err.splitlines()

    return read


OF_A_PAIR = (".png", ".report.json", ".matches.csv", ".timing.json")


def of_pairs(*names: str) -> set[str]:
    return {name + suffix for name in names for suffix in OF_A_PAIR} | {f".edf/{name}.json" for name in names}


def run(work: Path, *arguments: str, items: str = "good.csv", out: str = "out") -> int:
    return main(["batch", str(work / items), "-o", str(work / out), *KNOWN_WORDS, *arguments])
