"""A small panorama of a set, composed again of what its stitch found."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from edf_stitch.core.commands import recomposing
from edf_stitch.core.commands.drawn_places import with_circles
from edf_stitch.core.options import StitchOptions
from edf_stitch.core.pipeline import StitchResult, stitch
from edf_stitch.core.system.cache import _plan, _value
from edf_stitch.core.system.errors import BadRequest

from ...sets import make_set

PLAIN = StitchOptions(dense=False, measure=False, crop="full")
SAY: Callable[[str, float], None] = lambda stage, share: None  # noqa: E731


@pytest.fixture(scope="module")
def stitched() -> tuple[StitchResult, recomposing.Kept]:
    """A set whose second picture is masked on the left, and what is kept of it, through the cache's form."""
    pictures = make_set(3).pictures
    mask = np.zeros((240, 320), bool)
    mask[:, :40] = True
    options = StitchOptions(dense=False, measure=False, crop="full", ignore=(None, mask))
    result = stitch(pictures, options)
    kept = recomposing.kept_of(result, pictures, options, (1, 1, 1))
    arrays: list = []
    return result, _value(_plan(kept, arrays), arrays)


def again(kept: recomposing.Kept, **options: object) -> StitchResult:
    return recomposing.recomposed(kept, StitchOptions(dense=False, measure=False, **options), SAY, lambda: False)


def test_it_shows_the_same_smaller_without_masks_and_in_px_of_the_full_pictures(
    stitched: tuple[StitchResult, recomposing.Kept]
) -> None:
    result, kept = stitched
    assert all(picture.alpha is None or (picture.alpha == 1).all() for picture in kept.frame.pictures)
    small = again(kept, crop="full")
    assert small.canvas.width == pytest.approx(kept.share * result.canvas.width, abs=3)
    assert small.full_sizes == result.full_sizes and small.rig is not None
    box = (20, 10, 200, 100)
    part = again(kept, crop=box)
    assert part.panorama.alpha.shape == (int(100 * kept.share), int(200 * kept.share))
    assert part.report["canvas"]["box"] == [int(side * kept.share) for side in box]
    assert part.report["canvas"]["whole"] == list(small.panorama.alpha.shape[::-1])


def test_masks_and_guides_of_now_count(stitched: tuple[StitchResult, recomposing.Kept]) -> None:
    _, kept = stitched
    names = [picture.name for picture in kept.frame.pictures]
    number = names.index("2.png")
    usual = again(kept, crop="full")
    nowhere = np.zeros((240, 320), bool)
    nowhere[:, :300] = True
    masked = again(kept, crop="full", ignore=(None, nowhere))
    wanted = again(kept, crop="full", show=((2, nowhere),))
    usual_px, masked_px, wanted_px = (int((one.labels == number).sum()) for one in (usual, masked, wanted))
    assert masked_px < usual_px / 2 and wanted_px > 1.2 * usual_px
    turned = again(kept, crop="full", guides=((1, "vertical", (150.0, 30.0, 175.0, 200.0)),))
    assert turned.canvas.projection is not None and usual.canvas.projection is not None
    assert not np.allclose(turned.canvas.projection.rotation, usual.canvas.projection.rotation, atol=0.02)


def test_it_is_seen_from_another_picture_as_if_it_had_been_stitched_from_there(
    stitched: tuple[StitchResult, recomposing.Kept]
) -> None:
    result, kept = stitched
    assert kept.seen_from(None) is kept and kept.seen_from(1) is kept
    other = again(kept, crop="full", viewpoint=3, slide=0.0)
    assert [picture.name for picture in other.pictures] == ["3.png", "1.png", "2.png"]
    assert result.rig is not None and other.rig is not None and not other.rig.t[0].any()
    from_there = result.rig.R[0] @ result.rig.R[2].T
    assert np.allclose(other.rig.R[1], from_there), "pixel for pixel the geometry that was found"
    back = kept.seen_from(3).seen_from(None)
    assert back.frame.names == kept.frame.names and back.geometry.rig is not None
    assert np.allclose(back.geometry.rig.t, kept.geometry.rig.t)
    unused = replace(kept, frame=kept.frame.only((0, 1)), geometry=replace(kept.geometry, numbers=(0, 1)))
    with pytest.raises(BadRequest, match="3.png cannot be the viewpoint"):
        unused.seen_from(3)


def test_circles_are_drawn_over_what_was_painted() -> None:
    painted = np.zeros((30, 40), np.uint8)
    painted[:5] = 255
    drawn = with_circles(painted, [(20.0, 20.0, 4.0)], (40, 30), "a")
    assert drawn.shape == (30, 40) and drawn[:5].all() and drawn[20, 20] and drawn[20, 24] and not drawn[20, 26]
    assert with_circles(None, [(4000.0, 100.0, 50.0)], (8192, 4096), "a").shape == (1024, 2048)
