"""The suites by name, and what is known of a scene before it is measured: pairs and sets alike."""

from __future__ import annotations

from typing import Any

from ..core.system.errors import BadRequest
from .recipes import FULL, QUICK, RECIPES, parse_scene
from .sets.recipes import SETS, parse_set

SUITES = {"quick": (*QUICK, "small_room"), "full": FULL, "sets": tuple(SETS)}
SIZES = {"quick": (640, 480), "full": (1280, 960), "sets": (640, 480)}


def is_set(scene: str) -> bool:
    """Whether a scene's name is that of a set."""
    return scene.partition(":")[0] in SETS


def heading(scene: str, size: tuple[int, int]) -> dict[str, Any]:
    """The beginning of a scene's entry: what it is; size (W, H) px of landscape pictures. Raises BadRequest."""
    name = scene.partition(":")[0]
    if is_set(scene):
        a_set = parse_set(scene)
        return {
            "scene": scene, "kind": "set", "title": a_set.title, "size": list(size), "count": a_set.count,
            "parallax": a_set.parallax, "expected_left_out": [f"{k:02d}" for k in a_set.left_out],
        }  # fmt: skip
    if name not in RECIPES:
        raise BadRequest(f"no scene {name!r}; there are: {', '.join([*RECIPES, *SETS])}")
    recipe, _ = parse_scene(scene)
    return {
        "scene": scene, "kind": "pair", "title": recipe.title, "size": list(recipe.size(*size)),
        "expected_model": recipe.model, "parallax": recipe.parallax, "focal_determined": recipe.focal_determined,
    }  # fmt: skip
