"""Straight lines of two pictures: which are the same, and which are pieces of one (SPW and LPC stand on them)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..cameras.matches import Matches
from ..cameras.projective import homogeneous, project
from ..raster.arrays import Array
from .options import LINES


@dataclass(frozen=True)
class PairLines:
    """Straight segments (N, 2, 2) of the reference and (M, 2, 2) of the target, by their ends, ideal px."""

    reference: Array
    target: Array

    @staticmethod
    def none() -> PairLines:
        """Where pictures are not at hand."""
        return PairLines(np.zeros((0, 2, 2)), np.zeros((0, 2, 2)))


@dataclass(frozen=True)
class MatchedLines:
    """ends (N, 2, 2): of segments of the target; lines (N, 3): the reference's lines that show them, n·(x, 1) = 0 with
    a unit normal."""

    ends: Array
    lines: Array


def matched_lines(found: PairLines, matches: Matches, G: Array) -> MatchedLines:
    """Which segments of both pictures are the same: each other's nearest, once those of the target are brought onto the
    reference by G (3, 3), from target to reference, and by what matches beside their ends are off it.

    The papers match lines by invariants of points beside them; what such points say of a line's place serves here.
    """
    if not len(found.reference) or not len(found.target) or len(matches) < LINES.neighbours:
        return MatchedLines(np.zeros((0, 2, 2)), np.zeros((0, 3)))
    brought = _brought(found.target.reshape(-1, 2), matches, G).reshape(-1, 2, 2)
    lines, ways, lengths = _lines_of(found.reference)
    along = brought[:, 1] - brought[:, 0]
    spans = np.linalg.norm(along, axis=1)
    unit = along / np.maximum(spans, 1e-9)[:, None]
    turn = np.abs(unit @ ways.T)  # cosines (M, N)
    off = np.abs(np.einsum("mek,nk->mne", brought, lines[:, :2]) + lines[:, 2][None, :, None]).max(axis=2)
    start = found.reference[:, 0]
    at = np.einsum("mek,nk->mne", brought, ways) - np.einsum("nk,nk->n", start, ways)[None, :, None]
    shared = np.minimum(at.max(axis=2), lengths) - np.maximum(at.min(axis=2), 0)
    fits = (turn > np.cos(np.radians(LINES.turn_deg))) & (off < LINES.off_px * matches.scale)
    fits &= shared > LINES.shared * np.minimum(spans[:, None], lengths[None])
    cost = np.where(fits, off, np.inf)
    best, back = cost.argmin(axis=1), cost.argmin(axis=0)
    mutual = np.flatnonzero(np.isfinite(cost.min(axis=1)) & (back[best] == np.arange(len(best))))
    return MatchedLines(found.target[mutual], lines[best[mutual]])


def joined(segments: Array, scale: float) -> Array:
    """Long lines (K, 2, 2) that several of the segments (N, 2, 2) are pieces of: LPC's global collinear structures.

    scale: px of the picture for one in which segments are as exact as detection makes them.
    """
    if len(segments) < 2:
        return np.zeros((0, 2, 2))
    lines, ways, lengths = _lines_of(segments)
    free = np.full(len(segments), True)
    found = []
    for first in np.argsort(-lengths, kind="stable"):
        if not free[first]:
            continue
        off = np.abs(segments @ lines[first, :2] + lines[first, 2]).max(axis=1)
        member = free & (off < LINES.joined_px * scale)
        member &= np.abs(ways @ ways[first]) > np.cos(np.radians(LINES.joined_deg))
        free &= ~member
        if member.sum() > 1:
            at = (segments[member].reshape(-1, 2) - segments[first, 0]) @ ways[first]
            found.append(segments[first, 0] + np.array([[at.min()], [at.max()]]) * ways[first])
    return np.array(found).reshape(-1, 2, 2)


def _lines_of(segments: Array) -> tuple[Array, Array, Array]:
    """Lines (N, 3) with unit normals, unit directions (N, 2) and lengths (N,) of segments (N, 2, 2)."""
    along = segments[:, 1] - segments[:, 0]
    lengths = np.linalg.norm(along, axis=1)
    ways = along / np.maximum(lengths, 1e-9)[:, None]
    normals = np.column_stack([-ways[:, 1], ways[:, 0]])
    return np.column_stack([normals, -np.einsum("nk,nk->n", normals, segments[:, 0])]), ways, lengths


def _brought(points: Array, matches: Matches, G: Array) -> Array:
    """Target points (N, 2) px on the reference: by G and the mean of what the nearest matches are off it."""
    off = matches.x - project(homogeneous(matches.y) @ G.T)
    near = cKDTree(matches.y).query(points, k=LINES.neighbours)[1]
    brought: Array = project(homogeneous(points) @ G.T) + np.median(off[near], axis=1)
    return brought
