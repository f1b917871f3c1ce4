"""What was chosen in showing a finished stitch: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InspectionOptions:
    """What a window shows of a finished stitch (`inspection`)."""

    longest_side: int = 1600
    """px along the longer side of the pictures that lie over the panorama: as many as a window has."""

    longest_grid: int = 160
    """Nodes along the longer side of the depth grid: a mesh this fine is still edited without delay."""

    colour_range: tuple[float, float] = (1.0, 99.0)
    """Percentiles of the displacement that the two ends of the colour scale stand for: a few gross errors do not
    bleach the rest."""

    min_range_px: float = 1e-6
    """px between the two ends at least, so that nothing is divided by 0."""

    shown: float = 0.5
    """Alpha, or covered share of a reduced pixel, above which something is shown."""

    compared: float = 0.999
    """Share of a reduced pixel that both pictures must cover to be compared: all of it, but for rounding."""


@dataclass(frozen=True)
class GraphOptions:
    """The page about more than two pictures (`rig_graph`, `rig_page`)."""

    thumbnail_px: int = 110
    """px along the longer side of a thumbnail: sixty of them still fit on a page."""

    apart: float = 1.55
    """Distance of two thumbnails at least, in units of the longer side: the line between them has to be seen."""

    px_per_radian: float = 260.0
    """px by which two pictures stand apart that look one radian apart: a full turn is as wide as the page."""

    rounds: int = 60
    """Times that thumbnails which lie upon another are pushed apart, at most."""

    thinnest_px: float = 1.0
    """Width of the line of a pair without matches."""

    thickest_px: float = 9.0
    """Width of the line of the pair with the most."""

    text_px: int = 12
    """px from a thumbnail down to the line of its name."""

    panorama_px: int = 1500
    """px along the longer side of the panorama on the page, at most."""


@dataclass(frozen=True)
class SphereFillOptions:
    """What fills the holes of a whole sphere (`filled_sphere`)."""

    columns: int = 512
    """Cells along the sphere: no detail is made up, and light has no more of it than 0.7°."""

    least_shown: float = 1e-6
    """px that a cell shows at least, so that nothing is divided by 0."""


INSPECTION = InspectionOptions()
GRAPH = GraphOptions()
SPHERE_FILL = SphereFillOptions()
