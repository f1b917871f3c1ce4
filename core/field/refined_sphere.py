"""Inverse range that dense refinement found all over the sphere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..raster.arrays import Array, Plane
from ..raster.sampling import fetch
from .options import CARRY
from .sphere_chart import SphereChart


@dataclass(frozen=True, eq=False)
class RefinedSphere:
    """Inverse range on the nodes (h, w) of a chart, float32.

    inverse_range: d, the field's where nothing was found; confidence: 0 to 1; deviation: standard deviation of d;
    shown (h, w): which nodes any picture shows.
    """

    chart: SphereChart
    inverse_range: Plane
    confidence: Plane
    deviation: Plane
    shown: NDArray[np.bool_]

    def at(self, rays: NDArray[Any]) -> tuple[Plane, Plane, Plane]:
        """Inverse range, confidence and deviation (m, n) along unit rays (m, n, 3), bilinear between nodes; beyond the
        chart those of its nearest node."""
        column, row = self.chart.places(rays.astype(np.float32))
        height, width = self.chart.shape
        row = np.clip(row, np.float32(0), np.float32(height - 1))
        if self.chart.closed:
            column += np.float32(1)
        else:
            column = np.clip(column, np.float32(0), np.float32(width - 1))
        values = fetch(self._together, column, row, cv2.INTER_LINEAR)
        return values[..., 0], values[..., 1], values[..., 2]

    def seen_from(self, places: Array, rays: Array, d: Plane) -> tuple[Plane, Plane, Plane]:
        """Inverse range, confidence and deviation (…) along unit rays (…, 3) that begin at other places ((3,) or (…,
        3), as seen from this one's); d (…): their inverse ranges to within a node, as points that are put on nodes
        have them, and as they stay where this surface does not lie there."""
        rough = d.astype(np.float64)
        here = rays + rough[..., None] * places
        length = np.linalg.norm(here, axis=-1)
        own, confidence, deviation = self.at(here)
        own = own.astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            anew = own / ((here * rays).sum(axis=-1) / length - own * (rays * places).sum(axis=-1))
        same = np.abs(anew - rough) < CARRY.same_surface_px / self.chart.per_radian
        # what is off by an angle is off by less inverse range the farther away it is
        share = np.square(length).astype(np.float32)
        return np.where(same, anew, rough).astype(np.float32), confidence, deviation * share

    @cached_property
    def _together(self) -> Plane:
        """All three (h, w, 3); of a closed chart with the first and last columns on the other side as well."""
        together = np.dstack([self.inverse_range, self.confidence, self.deviation])
        if not self.chart.closed:
            return together
        return np.concatenate([together[:, -1:], together, together[:, :1]], axis=1)
