"""Passes of a multilayer EXR."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from edf_stitch.synthetic_scenes.blender_process import RenderFailed
from edf_stitch.synthetic_scenes.passes import read_passes

CHANNELS = [*(f"Combined.{c}" for c in "RGBA"), "Depth.Z", *(f"Position.{c}" for c in "XYZ"), "IndexOB.X"]


def values(name: str) -> np.ndarray:
    return np.arange(12, dtype=np.float32).reshape(3, 4) + 100 * CHANNELS.index(name)


def write(path: Path, names: list[str], in_parts: bool = False) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {f"ViewLayer.{name}": values(name) for name in names}
    channels["ViewLayer.Depth.Z"] = np.where(np.eye(3, 4) > 0, np.float32(1e10), values("Depth.Z"))
    if not in_parts:
        asked = {name: array for name, array in channels.items() if name.removeprefix("ViewLayer.") in names}
        OpenEXR.File(header, asked).write(str(path))
        return
    kinds = sorted({name.split(".")[1] for name in channels})
    parts = [
        OpenEXR.Part(dict(header), {k: v for k, v in channels.items() if f".{kind}." in k}, name=f"ViewLayer.{kind}")
        for kind in kinds
    ]
    OpenEXR.File(parts).write(str(path))


@pytest.mark.parametrize("in_parts", [False, True], ids=["interleaved", "multi-part"])
def test_what_blender_writes_is_read(tmp_path: Path, in_parts: bool) -> None:
    write(tmp_path / "a.exr", CHANNELS, in_parts)
    passes = read_passes(tmp_path / "a.exr")
    assert all(array.dtype == np.float32 for array in (passes.light, passes.depth, passes.position))
    for k, c in enumerate("RGB"):
        assert np.array_equal(passes.light[..., k], values(f"Combined.{c}"))
    for k, c in enumerate("XYZ"):
        assert np.array_equal(passes.position[..., k], values(f"Position.{c}"))
    assert np.array_equal(passes.things, values("IndexOB.X") % 256)
    nothing = np.eye(3, 4) > 0
    assert np.isinf(passes.depth[nothing]).all()
    assert np.array_equal(passes.depth[~nothing], values("Depth.Z")[~nothing])


@pytest.mark.parametrize("missing", ["Depth.Z", "Position.Y", "Combined.G", "IndexOB.X"])
def test_a_missing_pass_is_named(tmp_path: Path, missing: str) -> None:
    write(tmp_path / "a.exr", [name for name in CHANNELS if name != missing])
    with pytest.raises(RenderFailed, match=missing):
        read_passes(tmp_path / "a.exr")
