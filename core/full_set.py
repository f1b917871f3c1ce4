"""A large set in full, beside the small pictures that its panorama is decided on (see `compose.enlarging`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .alignment import Alignment, Geometry
from .cameras.rig import Rig
from .compose.composition import Composition
from .compose.enlarging.draft import Draft
from .compose.enlarging.enlarged import EnlargedPanorama
from .frames.frame import Frame
from .panorama.canvas import Canvas
from .panorama.warp import Warp


@dataclass(frozen=True)
class FullSet:
    """More than two pictures as they came.

    Attributes
    ----------
    frame : Frame
    geometry : Geometry
        Of these pictures.
    times : int
        How many of their px lie along one of the small pictures'.
    """

    frame: Frame
    geometry: Geometry
    times: int

    @property
    def rig(self) -> Rig:
        """The cameras."""
        assert self.geometry.rig is not None
        return self.geometry.rig

    def canvas_of(self, warp: Warp) -> Canvas:
        """The canvas of a warp to the small pictures, as large as these ask for."""
        return warp.canvas.enlarged(self.times, self.rig.cameras[0].K)

    def enlarged(self, made: Composition, warp: Warp) -> EnlargedPanorama:
        """The panorama in full, by what was decided on the canvas of a warp to the small pictures."""
        return EnlargedPanorama.of(Draft.of(made, warp, self.times), self.canvas_of(warp), self.frame.pictures)

    def alignment(self, small: Alignment) -> Alignment:
        """The alignment of the small pictures, with these cameras; its field and warp stay as they are."""
        return replace(small, cameras=self.rig.cameras, views=self.rig.views, rig=self.rig)
