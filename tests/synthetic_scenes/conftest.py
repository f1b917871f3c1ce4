"""A pair that Blender has rendered, small: seconds, once for all tests of a process."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from edf_stitch.synthetic_scenes.recipes import RECIPES, Difficulty
from edf_stitch.synthetic_scenes.rendered import RenderedPair, rendered_pair

SMALL = (320, 240)


@pytest.fixture(scope="session")
def rendered_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the session's renders lie."""
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("nothing to render with: bpy is not installed")
    return tmp_path_factory.mktemp("rendered")


@pytest.fixture(scope="session")
def rendered(rendered_folder: Path) -> RenderedPair:
    """The scene `tabletop`, 320 × 240."""
    return rendered_pair(RECIPES["tabletop"], Difficulty(), SMALL, rendered_folder)
