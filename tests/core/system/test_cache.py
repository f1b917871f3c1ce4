"""The cache: what was kept is what would be made; whatever happens to it, a stitch never notices."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from edf_stitch.core import alignment
from edf_stitch.core.cameras.matches import Matches
from edf_stitch.core.choices import FIELDS
from edf_stitch.core.commands.cli import main
from edf_stitch.core.fields import fit_field
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.pose import features
from edf_stitch.core.raster.grid import Grid
from edf_stitch.core.system import cache as cache_module
from edf_stitch.core.system.cache import Cache, default_folder
from edf_stitch.synthetic_scenes.two_planes import Pair

MATCHES = Matches(np.arange(6.0).reshape(3, 2), np.asfortranarray(np.eye(3)[:, :2]), 1.5, None, True)


def packed(value: Any) -> bytes:
    stream, arrays = io.BytesIO(), []
    cache_module._write(stream, "name", cache_module._plan(value, arrays), arrays)
    return stream.getvalue()


def members(data: bytes) -> dict[str, bytes]:
    """What an archive holds, without the time of day at which it was made."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def unpacked(data: bytes) -> Any:
    return cache_module._unpacked(io.BytesIO(data), "name")


def never() -> Matches:
    pytest.fail("made anew")


def entries(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.npz"))


# --- what is kept ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIELDS)
def test_geometry_and_every_field_come_back_bit_by_bit(result: StitchResult, name: str) -> None:
    view, cameras = result.edges[0].two_view, result.cameras
    used = result.edges[0].matches.subset(view.inliers)
    field = fit_field(name, "plane", view, used, cameras[0].size, cameras[1].size)
    data = packed((view, field, cameras, used))
    back = unpacked(data)
    assert members(packed(back)) == members(data), "as a whole, with the order of every array's axes"
    assert [type(part) for part in back] == [type(view), type(field), tuple, Matches]
    grid = Grid.over(-40, -30, 500, 400)
    ours, theirs = field.on_grid(grid), back[1].on_grid(grid)
    assert ours.inverse_depth.tobytes() == theirs.inverse_depth.tobytes()
    assert (ours.shift is None) == (theirs.shift is None)


def test_numbers_keep_their_kind() -> None:
    """NumPy 1 and 2 take a float32 array times a float or times a float64 differently."""
    back = unpacked(packed(replace(MATCHES, scale=np.float64(1.5))))
    assert type(back.scale) is np.float64 and type(unpacked(packed(MATCHES)).scale) is float
    assert back.y.flags.f_contiguous and not back.y.flags.c_contiguous
    odd = (float("nan"), float("inf"), -0.0, 5e-324, True, 7, None, "ü", Path("a"), np.float32(0.1))
    assert repr(unpacked(packed(odd))) == repr(odd)


def test_made_once_and_found_afterwards(tmp_path: Path) -> None:
    found = Cache(tmp_path).remember("matches", (np.arange(3), "a"), lambda: MATCHES)
    assert found is MATCHES and len(entries(tmp_path)) == 1
    found = Cache(tmp_path).remember("matches", (np.arange(3), "a"), never)
    assert np.array_equal(found.x, MATCHES.x) and found.weight is None and found.given is True
    assert Cache(None).remember("matches", (np.arange(3), "a"), lambda: MATCHES) is MATCHES


@pytest.mark.parametrize(
    ("what", "decided_by"),
    [
        ("others", (np.arange(3), 0.5)), ("matches", (np.arange(3), 0.25)), ("matches", (np.arange(4), 0.5)),
        ("matches", (np.arange(3, dtype=np.int32), 0.5)), ("matches", (np.arange(3)[None], 0.5)),
        ("matches", (np.arange(3), np.float64(0.5))), ("matches", (MATCHES, 0.5)), ("matches", ((np.arange(3), 0.5),)),
    ],
)  # fmt: skip
def test_whatever_decides_is_part_of_the_key(tmp_path: Path, what: str, decided_by: tuple) -> None:
    Cache(tmp_path).remember("matches", (np.arange(3), 0.5), lambda: MATCHES)
    other = replace(MATCHES, scale=9.0)
    assert Cache(tmp_path).remember(what, decided_by, lambda: other) is other


def test_arrays_lie_as_if_they_had_been_kept(tmp_path: Path) -> None:
    """Products of arrays that lie otherwise are rounded otherwise: a second stitch of a set gave another report."""
    columns = replace(MATCHES, x=np.arange(15.0).reshape(3, 5)[:, 1:3])
    caches = Cache(None), Cache(tmp_path), Cache(tmp_path)
    found = [cache.remember("matches", ("a",), lambda: columns).x for cache in caches]
    assert len({array.strides for array in found}) == 1 and found[0].flags.c_contiguous
    assert all(np.array_equal(array, columns.x) for array in found) and not columns.x.flags.forc


def test_other_code_makes_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Cache(tmp_path).remember("matches", (), lambda: MATCHES)
    Cache(tmp_path).remember("matches", (), never)
    monkeypatch.setattr(cache_module, "_code", lambda: "another version")
    assert Cache(tmp_path).remember("matches", (), lambda: MATCHES) is MATCHES


def test_what_cannot_be_kept_is_made_each_time(tmp_path: Path) -> None:
    for value in (object(), {"a": 1}, np.array([object()]), io.BytesIO()):
        assert Cache(tmp_path).remember("it", (), lambda value=value: value) is value
        assert Cache(tmp_path).remember("it", (value,), lambda: MATCHES) is MATCHES
    assert entries(tmp_path) == []


# --- what may befall it ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_a_rotten_entry_is_none(tmp_path: Path, seed: int) -> None:
    Cache(tmp_path).remember("matches", (), lambda: MATCHES)
    (path,) = entries(tmp_path)
    rng, data = np.random.default_rng(seed), bytearray(path.read_bytes())
    at = int(rng.integers(len(data)))
    if seed % 4 == 0:
        del data[at:]
    elif seed % 4 == 1:
        data[at : at + 20] = rng.bytes(20)
    elif seed % 4 == 2:
        data = bytearray(rng.bytes(len(data)))
    else:
        data[at] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)
    found = Cache(tmp_path).remember("matches", (), lambda: MATCHES)
    assert np.array_equal(found.x, MATCHES.x) and np.array_equal(found.y, MATCHES.y) and found.scale == 1.5
    again = Cache(tmp_path).remember("matches", (), never)  # mended
    assert np.array_equal(again.x, MATCHES.x)


def test_an_entry_under_anothers_name_is_none(tmp_path: Path) -> None:
    Cache(tmp_path).remember("matches", (1,), lambda: MATCHES)
    (first,) = entries(tmp_path)
    Cache(tmp_path).remember("matches", (2,), lambda: replace(MATCHES, scale=2.0))
    (second,) = (path for path in entries(tmp_path) if path != first)
    second.write_bytes(first.read_bytes())
    assert Cache(tmp_path).remember("matches", (2,), lambda: replace(MATCHES, scale=2.0)).scale == 2.0


@pytest.mark.parametrize(
    "kind",
    [["os", "system"], [".system.errors", "StitchError"], [".system.cache", "Cache"], [".commands.cli", "main"]],
)
def test_an_entry_runs_nothing(kind: list[str]) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        plan = f'{{"name": "name", "value": {{"class": {kind}, "fields": {{}}}}}}'.replace("'", '"')
        archive.writestr("plan.json", plan)
    with pytest.raises((ValueError, AttributeError)):
        unpacked(stream.getvalue())


def test_places_that_cannot_hold_anything(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", tmp_path / "file" / "below", Path(os.devnull), tmp_path / ("x" * 300)):
        assert Cache(folder).remember("matches", (), lambda: MATCHES) is MATCHES
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: IO[bytes], *_: object) -> None:
        file.write(b"begun")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache_module, "_write", full)
    assert Cache(tmp_path).remember("matches", (), lambda: MATCHES) is MATCHES
    assert list(tmp_path.iterdir()) == []


def test_interrupted_while_it_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Path) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Cache(tmp_path).remember("matches", (), lambda: MATCHES)
    assert list(tmp_path.iterdir()) == []


def test_the_oldest_go_when_it_is_full(tmp_path: Path) -> None:
    big = Matches(np.zeros((1000, 2)), np.zeros((1000, 2)))  # 32 kB
    cache = Cache(tmp_path, limit=180_000)
    cache.remember("matches", (0,), lambda: big)
    (first,) = entries(tmp_path)
    (tmp_path / ".left.tmp").write_bytes(bytes(5000))
    os.utime(tmp_path / ".left.tmp", (0, 0))
    for number in range(1, 9):
        for age, path in enumerate(reversed(entries(tmp_path))):
            os.utime(path, (10 + age, 10 + age))
        os.utime(first, (0, 0))
        cache.remember("matches", (0,), never)  # used: it is young again
        cache.remember("matches", (number,), lambda: big)
    kept = list(tmp_path.iterdir())
    assert sum(path.stat().st_size for path in kept) <= 180_000 and len(kept) == 5 and first in kept
    cache.remember("matches", (99,), lambda: Matches(np.zeros((4000, 2)), np.zeros((4000, 2))))
    assert sorted(tmp_path.iterdir()) == sorted(kept), "more than a quarter of all: not kept"


def test_many_at_once(tmp_path: Path) -> None:
    """Threads stand for processes: all there is between them is the folder."""
    wrong: list[object] = []

    def work(seed: int) -> None:
        rng = np.random.default_rng(seed)
        for number in rng.integers(0, 6, 60).tolist():
            mine = Matches(np.full((500, 2), float(number)), np.zeros((500, 2)))
            found = Cache(tmp_path, limit=70_000).remember("matches", (number,), lambda mine=mine: mine)
            if not np.array_equal(found.x, mine.x):
                wrong.append(number)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and not list(tmp_path.glob(".*"))


# --- where it is ----------------------------------------------------------------------------------------------------


def test_where_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    home = str(tmp_path)
    for platform, environ, expected in (
        ("linux", {"HOME": home}, tmp_path / ".cache" / "edf_stitch"),
        ("linux", {"HOME": home, "XDG_CACHE_HOME": home + "/x"}, tmp_path / "x" / "edf_stitch"),
        ("darwin", {"HOME": home}, tmp_path / "Library" / "Caches" / "edf_stitch"),
        ("win32", {"USERPROFILE": home, "LOCALAPPDATA": home + "/l"}, tmp_path / "l" / "edf_stitch"),
        ("win32", {"USERPROFILE": home}, tmp_path / "AppData" / "Local" / "edf_stitch"),
        ("linux", {"HOME": home, "EDF_CACHE": home + "/mine"}, tmp_path / "mine"),
        ("linux", {}, None), ("win32", {}, None), ("linux", {"HOME": "", "XDG_CACHE_HOME": "relative"}, None),
    ):  # fmt: skip
        monkeypatch.setattr(sys, "platform", platform)
        assert default_folder(environ) == expected


# --- in a stitch ----------------------------------------------------------------------------------------------------


def test_a_second_stitch_looks_for_nothing(
    small_pair: Pair, known: StitchOptions, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = replace(known, dense=True)
    options = replace(known, cache=tmp_path)
    first = stitch((small_pair.reference, small_pair.target), options)
    plain = stitch((small_pair.reference, small_pair.target), known)
    monkeypatch.setattr(features, "detect", lambda *_: pytest.fail("features were looked for"))
    monkeypatch.setattr(alignment, "refine", lambda *_: pytest.fail("was refined"))
    for change in ({}, {"blend": "linear"}, {"crop": "inscribed"}, {"projection": "cylindrical"}):
        again = stitch((small_pair.reference, small_pair.target), replace(options, **change))
        if not change:
            for other in (first, plain):
                assert again.report == other.report
                assert again.pixels.tobytes() == other.pixels.tobytes()
                assert again.warp.maps[1].x.tobytes() == other.warp.maps[1].x.tobytes()
    with pytest.raises(pytest.fail.Exception):
        stitch((small_pair.reference[:-1], small_pair.target), options)


@pytest.mark.slow
def test_the_same_bytes_with_it_and_without_and_with_any_number_of_threads(folder: Path, tmp_path: Path) -> None:
    """The worth of everything else here: nobody can tell from a result whether it was kept."""
    found = []
    for number, (threads, more) in enumerate(((1, []), (2, []), (1, []), (2, ["--no-cache"]), (1, ["--no-cache"]))):
        out = tmp_path / str(number)
        out.mkdir()
        code = "import sys, cv2; cv2.setNumThreads(int(sys.argv[1]))\n"
        code += "from edf_stitch.core.commands.cli import main; sys.exit(main(sys.argv[2:]))"
        environment = {**os.environ, "EDF_CACHE": str(tmp_path / f"cache{number // 3}"), "OPENBLAS_NUM_THREADS": "1"}
        pictures = [folder / "reference.png", folder / "target.png", "--focal-px", "228", *more]
        files = ["-o", "out.png", "--warp", "warp.npz", "--report", "report.json", "--quiet"]
        subprocess.run(
            [sys.executable, "-c", code, str(threads), "stitch", *map(str, [*pictures, *files])], cwd=out, check=True,
            env=environment, timeout=120,
        )  # fmt: skip
        found.append({path.name: path.read_bytes() for path in out.iterdir() if "timing" not in path.name})
    assert all(other == found[0] for other in found[1:]) and len(found[0]) == 4
    assert len(entries(tmp_path / "cache0")) >= 3 and not (tmp_path / "cache1").exists()


def test_it_is_asked_for_on_the_command_line(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EDF_CACHE", str(tmp_path / "cache"))
    line = ["stitch", str(folder / "reference.png"), str(folder / "target.png"), "--focal-px", "228", "--quiet"]
    assert main([*line, "-o", str(tmp_path / "a.png"), "--no-cache"]) == 0 and not (tmp_path / "cache").exists()
    assert main([*line, "-o", str(tmp_path / "b.png")]) == 0 and entries(tmp_path / "cache")
