"""What was chosen in mapping N pictures: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class RigWarpOptions:
    """Maps of N pictures (`rig_warp`)."""

    nodes: int = 60_000
    """Nodes of a grid over the canvas: N pictures together hold more than two."""

    deviation_nodes: int = 4_000
    """The same of the grid that the deviation of inverse range is worked out on: it changes slowly."""

    margin_nodes: int = 2
    """Nodes around those that show a picture up to which its map is worked out: its corner may lie between two rows."""

    outline_steps: int = 4
    """Steps by which the ray that shows a picture's border is found: each looks its range up where the last one ended.
    """

    least_share: float = 0.05
    """Range from a picture's camera, at least, in units of that from the viewpoint, where outlines are sought."""


@dataclass(frozen=True)
class RigSlideOptions:
    """A viewpoint that slides among N pictures (`rig_viewpoint`)."""

    headings: int = 1440
    """Headings all around at which its place is known: four to a degree."""

    smooth_deg: float = 2.0
    """Degrees, σ, over which places are smoothed: where a picture begins, nothing shall kink."""

    percentiles: tuple[float, float] = (1.0, 99.0)
    """Percent of a picture's border between whose headings it lies: a corner is not its side."""

    least_half: float = 1e-3
    """Radians of half a picture's width at least: what is divided by."""

    looks: int = 180
    """Headings at which it is looked whether a point is seen more than once."""

    nodes: int = 60_000
    """Nodes all over the sphere at which inverse range is known from the first place, to be carried over."""

    px_per_radian: float = 600.0
    """Of that sphere: nothing but what nodes are counted in."""

    steps: int = 12
    """Steps in which a ray's point, or a point's ray, is found."""

    damping: float = 0.7
    """Share of each step that is taken: where parallax is large, whole steps would swing."""

    least_range: float = 1e-6
    """Range that a point has at least, in units of that from the first place."""


RIG_WARP = RigWarpOptions()
RIG_SLIDE = RigSlideOptions()
