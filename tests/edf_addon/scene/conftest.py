"""A scene with a panorama whose geometry and depth are known."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from edf_stitch.edf_addon.bridge import ownership, result  # noqa: E402

SIZE, SIZE_PRIME, CANVAS = (400, 300), (320, 480), (560, 360)
COLUMNS, ROWS = 15, 10


@pytest.fixture
def stitched(blender, by_hand, monkeypatch):
    """A scene with a panorama whose geometry and depth are known."""
    view = by_hand.view(by_hand.camera(SIZE, 350.0), by_hand.camera(SIZE_PRIME, 410.0), (3, -8, 2), (1, 0.1, 0.2))
    K_canvas = view.K.copy()
    K_canvas[:2, 2] += 40, 25
    d = np.random.default_rng(4).uniform(0.05, 0.3, ROWS * COLUMNS)
    geometry = {
        "full_sizes": [SIZE, SIZE_PRIME], "K": view.K, "K_prime": view.K_prime, "R": view.R, "t": view.t,
        "K_canvas": K_canvas, "canvas": CANVAS,
    }  # fmt: skip
    depth = {"columns": COLUMNS, "rows": ROWS, "inverse_depth": d, "shows": np.ones(ROWS * COLUMNS, int)}
    report = {"canvas": {"projection": {"kind": "perspective"}}}
    pictures = [{"name": name, "fingerprint": ""} for name in ("reference", "target")]
    known = {
        "geometry": geometry, "depth": depth, "has_depth": True, "report": report, "pictures": pictures,
        "cameras": None,
    }  # fmt: skip
    settings = blender.settings
    for side, size in (("reference", SIZE), ("target", SIZE_PRIME), ("result", CANVAS)):
        setattr(settings, side, bpy.data.images.new(side, *size))
    ownership.hold(settings.result, [settings.reference, settings.target], {})
    monkeypatch.setattr(result, "read", lambda image: known if image == settings.result else None)
    return known
