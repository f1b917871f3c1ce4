"""A long session of mixed work in one process through `stitch()`: pairs, sets, spheres, small panoramas composed again,
and what fails. It holds no more memory, handles, threads or files at its end than soon after its beginning."""

from __future__ import annotations

import gc
import os
import random
import re
import sys
import tempfile
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from edf_stitch import StitchError, stitch
from edf_stitch.core.choices import BLENDS, PROJECTIONS
from edf_stitch.core.commands.recomposing import Kept, kept_of, recomposed
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import encode_picture
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.pipeline import stitch as stitch_pictures
from edf_stitch.synthetic_scenes.two_planes import make_pair

from ..sets import FOCAL, make_set

pytestmark = [
    pytest.mark.slow,
    pytest.mark.soak,
    pytest.mark.skipif(sys.platform != "linux", reason="needs /proc"),
]
STITCHES = int(os.environ.get("EDF_SOAK_STITCHES", 300))
# Share of the stitches after which memory is measured, and the share that it may grow by after them.
WARM, GROWTH = 0.15, 0.05
SET = StitchOptions(dense=False, measure=False)
# px, of the pair's cameras.
PAIR_FOCAL = 228.0


@dataclass(frozen=True)
class Work:
    """What a session works on: files of a pair and of a set, what is kept of the set, and where results go."""

    pair: tuple[Path, ...]
    three: tuple[Path, ...]
    kept: Kept
    out: Path

    def do(self, number: int) -> str:
        """One piece of work, which follows from its number; returns its name."""
        chance = random.Random(number)
        kinds = (self.of_pair, self.of_pair, self.of_set, self.of_sphere, self.again, self.failing)
        kind = kinds[number % len(kinds)]
        kind(chance)
        return kind.__name__

    def of_pair(self, chance: random.Random) -> None:
        panorama = stitch(
            self.pair, focal_px=PAIR_FOCAL, seed=chance.randrange(5), dense=chance.random() < 0.3,
            blend=chance.choice(BLENDS), projection=chance.choice(PROJECTIONS), preview=chance.random() < 0.3,
            measure=chance.random() < 0.3, cache=self.out / "cache",
        )  # fmt: skip
        panorama.save(self.out / chance.choice(("out.png", "out.exr", "out.jpg")), overwrite=True)

    def of_set(self, chance: random.Random) -> None:
        stitch(self.three, focal_px=FOCAL, dense=chance.random() < 0.05, seed=chance.randrange(5), measure=False).save(
            self.out / "set.tif", overwrite=True, layers=self.out / "layers", report=self.out / "set.json"
        )

    def of_sphere(self, chance: random.Random) -> None:
        files = chance.choice((self.pair, self.three))
        made = stitch(files, projection="equirectangular", dense=False, crop=chance.choice(("auto", "full")))
        made.save(self.out / "sphere.exr", overwrite=True)

    def again(self, chance: random.Random) -> None:
        asked = replace(SET, viewpoint=chance.choice((None, 2, 3)), crop=chance.choice(("full", "auto")))
        recomposed(self.kept, asked, lambda *_: None, lambda: False)

    def failing(self, chance: random.Random) -> None:
        left, moment = self.pair[0], chance.randrange(15)
        plain = np.full((120, 160, 3), 128, np.uint8)
        asked = iter(range(10**6))
        fails: tuple[Callable[[], object], ...] = (
            lambda: stitch([left, left.parent / "none.png"]),
            lambda: stitch([left, self.out / "half.png"]),
            lambda: stitch([plain, plain[:, ::-1].copy()]),
            lambda: stitch([left, plain]),
            lambda: stitch(self.three, memory=0.01),
            lambda: stitch(self.three, require_all=True, matches=self.out / "none.csv"),
            lambda: stitch(self.pair, cancelled=lambda: next(asked) >= moment),
            lambda: stitch(self.three, cancelled=lambda: next(asked) >= moment, dense=False),
            lambda: stitch(self.pair, dense=False).save(self.out / "nowhere" / "out.png"),
        )
        (self.out / "half.png").write_bytes(left.read_bytes()[:20_000])
        with pytest.raises(StitchError):
            chance.choice(fails)()


@pytest.fixture
def work(tmp_path: Path) -> Work:
    made, pair = make_set(3, size=(240, 180)).pictures, make_pair(240, 180)
    two = picture_from_array(pair.reference, "a.png"), picture_from_array(pair.target, "b.png")
    for picture in (*made, *two):
        (tmp_path / picture.name).write_bytes(encode_picture(picture.pixels, None, 8, ".png")[0])
    (tmp_path / "out").mkdir()
    files = [tuple(tmp_path / picture.name for picture in pictures) for pictures in (two, made)]
    return Work(*files, kept_of(stitch_pictures(made, SET), made, SET, (1, 1, 1)), tmp_path / "out")


def resident_kb() -> int:
    gc.collect()
    return int(re.findall(r"VmRSS:\s+(\d+)", Path("/proc/self/status").read_text())[0])


def held() -> dict[str, int]:
    """Handles, threads and processes of this one."""
    tasks = Path("/proc/self/task").iterdir()
    started = sum(len((task / "children").read_text().split()) for task in tasks)
    return {"files": len(os.listdir("/proc/self/fd")), "threads": threading.active_count(), "processes": started}


def test_mixed_work_leaves_nothing(work: Work, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    memory, warm, begun = [], int(WARM * STITCHES), held()
    for number in range(STITCHES):
        kind = work.do(number)
        memory.append(resident_kb())
        begun = held() if number == warm else begun
        assert all(count <= begun[what] for what, count in held().items()) or number < warm, (number, kind, held())
        assert not list((tmp_path / "temporary").iterdir()), (number, kind)
        assert not [path for path in work.out.rglob(".*") if path.is_file()], (number, kind)
    # the most that was held, of halves: what a single stitch takes differs
    half = (STITCHES + warm) // 2
    before, after = max(memory[warm:half]), max(memory[half:])
    print(f"at most {before // 1024} MB soon after the beginning, {after // 1024} MB later")
    assert after < (1 + GROWTH) * before, (before, after)
