"""What a stitch takes is told beforehand: it goes within the limit, by fewer threads, or is refused with what fits."""

from __future__ import annotations

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from edf_stitch.core.compose.enlarging import memory_need
from edf_stitch.core.compose.enlarging.memory_need import threads_that_fit, threads_that_fit_merged
from edf_stitch.core.compose.enlarging.options import MEMORY
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pictures.encoding import save_picture
from edf_stitch.core.pictures.picture import picture_from_array
from edf_stitch.core.system.errors import BadRequest, NotEnoughMemory

from ..pictures.raw_and_heic import dng, heic

PHONE = np.broadcast_to(np.uint8(0), (3000, 4000, 3))


def asked(gb: float | None, **options: object) -> StitchOptions:
    return StitchOptions(memory_gb=gb, **options)  # type: ignore[arg-type]


@pytest.fixture(autouse=True)
def eight_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_need, "count", lambda: 8)
    monkeypatch.setattr(memory_need, "free_bytes", lambda: 64_000_000_000)


def test_thirty_pictures_of_a_phone_fit_in_what_was_measured() -> None:
    pictures = [PHONE] * 30
    fitting = [threads_that_fit(pictures, asked(gb)) for gb in (3.4, 3.6, 4.5, 64)]
    assert fitting == sorted(fitting) and 1 <= fitting[0] <= 4 and fitting[-1] == 8
    with pytest.raises(NotEnoughMemory):
        threads_that_fit(pictures, asked(2.0))


def test_what_is_refused_is_told_what_would_fit() -> None:
    with pytest.raises(NotEnoughMemory, match="30 pictures of 360 megapixels together take about 3.* --memory") as told:
        threads_that_fit([PHONE] * 30, asked(2.5))
    assert told.value.exit_code == 3
    fewer = int(re.search(r"the first (\d+) of them", str(told.value))[1])
    assert threads_that_fit([PHONE] * fewer, asked(2.5)) >= 1
    with pytest.raises(NotEnoughMemory):
        threads_that_fit([PHONE] * (fewer + 1), asked(2.5))
    with pytest.raises(NotEnoughMemory) as told:
        threads_that_fit([PHONE] * 30, asked(2.0))
    scale = float(re.search(r"--scale ([\d.]+)", str(told.value))[1])
    assert threads_that_fit([PHONE] * 30, asked(2.0, scale=scale)) >= 1
    with pytest.raises(NotEnoughMemory):
        threads_that_fit([PHONE] * 30, asked(2.0, scale=scale + 0.05))
    with pytest.raises(NotEnoughMemory, match="use smaller pictures"):
        threads_that_fit([PHONE] * 30, asked(0.1))


def test_without_a_limit_half_of_what_is_free_is_taken_or_all_if_need_be(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_free(gb: float | None, count: int = 30) -> int:
        monkeypatch.setattr(memory_need, "free_bytes", lambda: None if gb is None else int(gb * 1e9))
        return threads_that_fit([PHONE] * count, asked(None))

    assert with_free(64) == 8 and with_free(None) == 8
    assert with_free(9) == threads_that_fit([PHONE] * 30, asked(4.5)) > with_free(3.4) == 1
    with pytest.raises(NotEnoughMemory, match="only this much is free: 1.0 GB"):
        with_free(1)
    assert with_free(1, count=2) == 8, "a pair goes as it always did"


def test_files_are_counted_by_their_headers(tmp_path: Path) -> None:
    picture = np.zeros((300, 400, 3), np.float32)
    kinds = {".jpg": (8, 3), ".png": (8, 3), "16.png": (16, 9), ".exr": (32, 15), "16.tif": (16, 9)}
    for suffix, (bits, each) in kinds.items():
        path = tmp_path / f"a{suffix}"
        save_picture(path, picture, None, bits)
        assert memory_need._facts(path) == ((400, 300), each), suffix
    assert memory_need._facts(picture_from_array(picture))[1] == 15
    assert memory_need._facts(np.zeros((300, 400), np.uint16)) == ((400, 300), 6)
    (tmp_path / "text.png").write_text("no picture")
    for lacking in ("text.png", "none.png"):
        assert memory_need._facts(tmp_path / lacking) == ((0, 0), 0), "reading says what is wrong with it"


@pytest.mark.parametrize("gb", [0, -1, float("nan")])
def test_no_memory_is_no_limit(gb: float) -> None:
    with pytest.raises(BadRequest, match="GB of memory"):
        asked(gb)


def test_a_jpegs_header_is_enough(tmp_path: Path) -> None:
    encoded = cv2.imencode(".jpg", np.zeros((30, 40, 3), np.uint8))[1].tobytes()
    (tmp_path / "cut.jpg").write_bytes(encoded[:-40])
    assert memory_need._facts(tmp_path / "cut.jpg")[0] == (40, 30)


def test_heic_and_camera_raw_count_with_what_their_decoders_take(tmp_path: Path) -> None:
    def needed(data: bytes, name: str) -> float:
        (tmp_path / name).write_bytes(data)
        with pytest.raises(NotEnoughMemory) as told:
            threads_that_fit([tmp_path / name] * 3, asked(0.1, scale=0.1))
        assert "3 pictures of 36 megapixels together" in str(told.value)
        return float(re.search(r"take about ([\d.]+) GB", str(told.value))[1])

    raw = needed(dng(np.zeros(PHONE.shape[:2], np.uint16)), "a.dng")
    shrunk = 3 * 400 * 300 * MEMORY.float_bytes
    assert raw == pytest.approx((MEMORY.program_bytes + 36e6 * MEMORY.raw_bytes + shrunk) / 1e9, abs=0.06)
    levels = np.zeros(PHONE.shape, np.uint16)
    assert needed(heic(levels, "RGB;16"), "deep.heic") > needed(heic(PHONE), "a.heic") + 0.15


def test_brackets_count_with_what_merging_takes_and_as_floats() -> None:
    """Ten views of three exposures: fewer pictures to compose than thirty, but each takes five times the bytes."""
    need = memory_need._need([memory_need._facts(PHONE)] * 30, asked(None, brackets=3), 1.0)
    assert len(need.sizes) == 10 and need.held == 10 * 12e6 * MEMORY.float_bytes
    assert need.read == need.held + 12e6 * MEMORY.merging_bytes
    looked_for = memory_need._need([memory_need._facts(PHONE)] * 30, asked(None), 1.0)
    assert looked_for.read == looked_for.held == 30 * 12e6 * 3, "they may be none"
    with pytest.raises(NotEnoughMemory, match="the first (6|9|12|15|18|21|24) of them"):
        threads_that_fit([PHONE] * 30, asked(2.5, brackets=3))


def test_once_they_are_merged_it_is_known_how_many_views_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    views = [(4000, 3000)] * 10
    fitting = [threads_that_fit_merged(views, asked(gb)) for gb in (4.6, 64)]
    assert 1 <= fitting[0] < fitting[1] == 8
    with pytest.raises(NotEnoughMemory, match="10 pictures of 120 megapixels"):
        threads_that_fit_merged(views, asked(3.0))
    monkeypatch.setattr(memory_need, "free_bytes", lambda: int(3.5e9))
    assert threads_that_fit_merged(views, asked(None)) == 1, "what they hold already is not free, and theirs"
    assert threads_that_fit_merged(views[:2], asked(None)) == 8
