"""A pair and a set that Blender has rendered, small: seconds, once for all tests of a process."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import pytest
from edf_stitch.synthetic_scenes.recipes import RECIPES, Difficulty
from edf_stitch.synthetic_scenes.rendered import RenderedPair, rendered_pair
from edf_stitch.synthetic_scenes.sets.recipes import SETS
from edf_stitch.synthetic_scenes.sets.rendered_set import RenderedSet, rendered_set

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


@pytest.fixture(scope="session")
def small_set(rendered_folder: Path) -> RenderedSet:
    """Three pictures of the set `small_room`, 240 × 180, without noise."""
    return rendered_set(replace(SETS["small_room"], count=3, noise=0.0), (240, 180), rendered_folder)
