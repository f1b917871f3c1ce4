"""What was chosen at the rim of the overlap and beyond it: each value with its unit, and why it is what it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BeyondOptions:
    """How refinement goes on beyond the overlap (`moved_depth`)."""

    fade_length: float = 5.0
    """Width of the fade outside the overlap in units of the moves (98th percentile), as the field has it."""

    min_fade_px: float = 8.0
    """px of that width at least."""

    max_fade: float = 0.15
    """Share of the picture's longer side of that width at most."""

    coarse_step: int = 8
    """Nodes between places where depth per px and the lines' directions are worked out: they are smooth."""

    ignored_confidence: float = 0.2
    """Confidence at and below which a move has no say in what goes on beyond the overlap."""

    trusted_confidence: float = 0.5
    """Confidence at and above which a move has its full say there; in between linear."""

    confidence_erosion: int = 9
    """Nodes of the side of the window over which the lowest confidence counts: it is an average, and reaches over the
    rim of what it is about."""

    yielding_share: float = 0.4
    """Share of the fade's width inside the overlap's border over which doubtful moves give way to what goes on beyond:
    twice their own size."""


@dataclass(frozen=True)
class RimOptions:
    """What is doubted near the overlap's border, and where there is no texture (`rim`)."""

    width: float = 0.05
    """Share of the overlap's shorter side within which moves are doubted."""

    beginning: float = 0.5
    """Share of that width in which a doubtful patch has to begin."""

    ignored_confidence: float = 0.4
    """Confidence at and below which a move has no say: chance alone reaches as much."""

    trusted_confidence: float = 0.7
    """Confidence from which on the pictures bear a move out, and it has its full say."""

    confidence_erosion: int = 9
    """Nodes of the side of the window over which the lowest confidence counts."""

    agreeing_px: float = 1.5
    """px from the smooth field within which it bears a move out."""

    large_px: float = 8.0
    """px from it beyond which moves make a patch of their own: the matcher was led astray, it is no rough surface."""

    usual_every: int = 8
    """One node in so many rows and columns says which way the map turns."""

    smoothness: float = 50.0
    """λ of the edge-aware smoothing that carries sure moves to doubtful nodes of the same surface."""

    field_confidence: float = 1e-3
    """What the smooth field counts in that, relative to a sure node."""

    coarse_step: int = 2
    """Nodes along the side of a cell for that: four times less work."""

    fold_tolerance: float = 1.0
    """By how much of their squared difference the pictures may differ more in a patch afterwards, for each node of it
    that folded before: a surface that folds is none."""

    shown_share: float = 0.25
    """Share of a patch that has to be shown afterwards, too, for the pictures to be compared."""

    plain: float = 0.5
    """Lack of texture, 0 to 1, from which a node's depth is only what borders it."""

    plain_px: float = 4.0
    """px from the smooth field beyond which that is doubted: less is the shape of a surface."""

    plain_difference: float = 0.5
    """Share of their squared difference to which the pictures have to come there for it to be wrong."""

    softness: int = 3
    """Nodes of the side of the window over which what a patch gets and what lies around it pass into each other."""


BEYOND = BeyondOptions()
RIM = RimOptions()
