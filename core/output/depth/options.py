"""What was chosen in giving depth out: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshOptions:
    """The mesh of a panorama's depth (`surface`, `mesh`)."""

    most_nodes: int = 250_000
    """Nodes of the grid: half a million triangles are still turned and edited without delay."""

    editable_nodes: int = 195_000
    """The same of a surface in Blender's scene, where it is drawn beside all else; with what the borders add it has no
    more than 200 000 faces."""

    farthest: float = 20.0
    """Medians of range, where everything beyond ends, infinity too: a sky has to stand somewhere."""

    near_percentile: float = 5.0
    """Per cent of all nodes that lie nearer than what counts as the nearest thing: single wrong ones do not."""

    least_distance: float = 0.1
    """Distance from the viewpoint, in ranges of the nearest thing, by which the plane of a face has to pass it: a real
    surface that is seen at all passes beside it, a skin between near and far almost through it."""

    ramp_nodes: int = 10
    """Nodes from either side over which a step of depth may be spread and still be one: a smooth field and dense
    refinement blur it by so much (with 4 a person before a wall was smeared over it); wider slopes are real ones, like
    the ground of a telephoto."""

    texture_px: int = 8192
    """px along the longer side of the texture: what every graphics card takes."""


MESH = MeshOptions()
