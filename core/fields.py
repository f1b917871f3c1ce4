"""The displacement fields by name, our own and the rivals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from .cameras.camera import Camera
from .cameras.edge import Edge
from .cameras.matches import Matches
from .cameras.two_view import TwoView
from .choices import LINE_FIELDS
from .field.field import Field
from .field.slack import fit_slack
from .field.strict import fit_strict
from .options import StitchOptions
from .panorama.upright_edges import ideal_ends
from .pictures.picture import Picture
from .raster.arrays import Array
from .rivals.apap import fit_apap
from .rivals.homography import fit_one_homography
from .rivals.line_fields import fit_line_field
from .rivals.lines import PairLines
from .rivals.paper import fit_paper
from .rivals.rew import fit_rew
from .system.cache import Cache


def fit_field(
    name: str, fade: str, two_view: TwoView, matches: Matches, size: tuple[int, int], target_size: tuple[int, int],
    seed: int = 0, lines: tuple[Array, Array] | None = None,
) -> Field:  # fmt: skip
    """Fits a displacement field to the inlier matches of a pair.

    Parameters
    ----------
    name : str
        One of FIELDS.
    fade : str
        What it fades to outside the overlap, one of FADES.
    two_view : TwoView
    matches : Matches
        Inliers, ideal px.
    size, target_size : (W, H)
        px of the reference and of the target.
    seed : int
        Of random choices.
    lines : tuple of (N, 2, 2) arrays, optional
        Straight segments of the reference and of the target by their ends, ideal px, for the fields of LINE_FIELDS.

    Returns
    -------
    Field
        Its `two_view` is what its map is built on: the given one, or what a rival knows of it.

    Raises
    ------
    DegenerateGeometry
        The matches determine no such field.
    """
    if name == "homography":
        return fit_one_homography(two_view, matches, seed)
    strict = fit_strict(two_view, matches, size, target_size, fade)
    on_top: dict[str, Callable[[], Field]] = {
        "strict": lambda: strict, "slack": lambda: fit_slack(strict, matches),
        "paper": lambda: fit_paper(strict, matches), "rew": lambda: fit_rew(strict, matches),
        "apap": lambda: fit_apap(strict, matches),
        **{
            one: partial(fit_line_field, one, strict, matches, PairLines.none() if lines is None else PairLines(*lines))
            for one in LINE_FIELDS
        },
    }  # fmt: skip
    return on_top[name]()


def field_of(edge: Edge, cameras: Sequence[Camera], pictures: Sequence[Picture], options: StitchOptions) -> Field:
    """The field that options name, fitted to a pair's inliers, or as the cache has it; cameras, pictures: of all.

    Raises DegenerateGeometry.
    """
    first, second = edge.pair(cameras)
    lines = None
    if options.field in LINE_FIELDS:
        reference, target = edge.pair(pictures)
        lines = ideal_ends(reference, first), ideal_ends(target, second)
    decided = (options.field, options.fade, edge.two_view, edge.inliers, first.size, second.size, options.seed, lines)
    return Cache(options.cache).remember("field", decided, lambda: fit_field(*decided))
