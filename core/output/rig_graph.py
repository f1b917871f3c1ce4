"""How the pictures of a rig hang together, as one SVG picture: each where it looks to, and a line for each pair."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import cv2
import numpy as np
from numpy.typing import NDArray

from ..cameras.rig import Rig
from ..pictures.picture import Picture
from ..raster.arrays import Array
from .embedded import jpeg_uri
from .options import GRAPH


def rig_graph(pictures: Sequence[Picture], rig: Rig) -> str:
    """The contact sheet of a rig.

    Parameters
    ----------
    pictures : sequence of Picture
    rig : Rig
        Of these pictures.

    Returns
    -------
    str
        An `<svg>` element, with its thumbnails in it. The thicker a line, the more matches its pair has; dashed: the
        length between the two is not measured.
    """
    places = laid_out(rig)
    width, height = (round(float(side)) for side in places.max(axis=0) + GRAPH.thumbnail_px)
    most = max((edge.inliers for edge in rig.edges), default=1)
    parts = [
        f'<svg class="graph" viewBox="0 0 {width} {height}" width="{width}" role="img" '
        'aria-label="pictures, and the pairs that hold them together">'
    ]
    for edge in sorted(rig.edges, key=lambda edge: edge.inliers):
        (x, y), (x2, y2) = places[edge.i], places[edge.j]
        thick = GRAPH.thinnest_px + (GRAPH.thickest_px - GRAPH.thinnest_px) * (edge.inliers / most) ** 0.5
        dashed = "" if edge.baseline == "measured" else ' stroke-dasharray="6 4"'
        names = f"{pictures[edge.i].name} – {pictures[edge.j].name}: {edge.inliers} of {edge.matches} matches"
        parts.append(
            f'<line x1="{x:.0f}" y1="{y:.0f}" x2="{x2:.0f}" y2="{y2:.0f}" stroke-width="{thick:.1f}"{dashed}>'
            f"<title>{escape(names)}</title></line>"
        )
    for picture, (x, y) in zip(pictures, places, strict=True):
        thumbnail = thumbnail_of(picture)
        h, w = thumbnail.shape[:2]
        parts.append(
            f'<image x="{x - w / 2:.0f}" y="{y - h / 2:.0f}" width="{w}" height="{h}" href="{jpeg_uri(thumbnail)}"/>'
            f'<text x="{x:.0f}" y="{y + h / 2 + GRAPH.text_px:.0f}">{escape(picture.name)}</text>'
        )
    return "".join([*parts, "</svg>"])


def laid_out(rig: Rig) -> Array:
    """Where each picture stands on the sheet (N, 2), px: to the right and below as it looks, none upon another."""
    looks = rig.R[:, 2]  # the axis of each camera, in the first one's frame
    middle = looks.mean(axis=0)
    around = np.arctan2(middle[0], middle[2])
    yaw = (np.arctan2(looks[:, 0], looks[:, 2]) - around + np.pi) % (2 * np.pi) - np.pi
    pitch = np.arcsin(np.clip(looks[:, 1], -1, 1))
    angles = np.column_stack([yaw, pitch])
    apart = GRAPH.thumbnail_px * GRAPH.apart
    places = angles * GRAPH.px_per_radian
    for _ in range(GRAPH.rounds):
        between = places[:, None] - places[None]
        distance = np.linalg.norm(between, axis=-1)
        # two that stand in one place move apart by their order
        between[distance < 1e-6] = (1.0, 0.0)
        order = np.sign(np.arange(len(places))[:, None] - np.arange(len(places))[None])
        between *= np.where(distance < 1e-6, order, 1)[..., None]
        pushed = np.maximum(0, apart - distance) / (2 * np.maximum(distance, 1.0))
        np.fill_diagonal(pushed, 0)
        if not pushed.any():
            break
        places = places + (pushed[..., None] * between).sum(axis=1)
    corner = np.array([GRAPH.thumbnail_px, GRAPH.thumbnail_px]) * 0.75
    shifted: Array = places - places.min(axis=0) + corner
    return shifted


def thumbnail_of(picture: Picture) -> NDArray[np.uint8]:
    """A picture (h, w, C) no longer than a thumbnail."""
    height, width = picture.view.shape[:2]
    scale = GRAPH.thumbnail_px / max(width, height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    small: NDArray[np.uint8] = cv2.resize(picture.view, size, interpolation=cv2.INTER_AREA)
    return small.reshape(size[1], size[0], -1)
