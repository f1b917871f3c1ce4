"""A large set in full, beside the small pictures that its panorama is decided on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...cameras.edge import Edge
from ...cameras.rig import Rig
from ...panorama.canvas import Canvas
from ...panorama.warp import Warp
from ...pictures.picture import Picture
from .draft import Draft
from .enlarged import EnlargedPanorama

if TYPE_CHECKING:
    from ..composition import Composition


@dataclass(frozen=True)
class FullSet:
    """More than two pictures as they came, their edges and rig, and how many of their px lie along one of the small
    pictures'."""

    pictures: tuple[Picture, ...]
    edges: tuple[Edge, ...]
    rig: Rig
    times: int

    def canvas_of(self, warp: Warp) -> Canvas:
        """The canvas of a warp to the small pictures, as large as these ask for."""
        return warp.canvas.enlarged(self.times, self.rig.cameras[0].K)

    def enlarged(self, made: Composition, warp: Warp) -> EnlargedPanorama:
        """The panorama in full, by what was decided on the canvas of a warp to the small pictures."""
        return EnlargedPanorama.of(Draft.of(made, warp, self.times), self.canvas_of(warp), self.pictures)
