"""Where features are sought: in what both pictures show with a margin, and in all of them where that is not sure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from edf_stitch.core.pictures.picture import Picture, picture_from_array
from edf_stitch.core.pose import features, pair_matches
from edf_stitch.core.pose.common_part import common_parts
from edf_stitch.core.pose.options import COMMON_PART, FEATURES

from .test_features import texture

SHIFT = 700


def side_by_side(shift: int = SHIFT, width: int = 1200, height: int = 900) -> list[Picture]:
    """Two pictures of one texture, the second of which begins so many px further to the right."""
    whole = texture(height, width + shift, 3)
    return [picture_from_array(np.ascontiguousarray(part)) for part in (whole[:, :width], whole[:, shift:])]


def test_both_parts_hold_what_both_show_and_a_margin_but_not_the_rest() -> None:
    parts = common_parts(side_by_side())
    assert parts is not None
    (left, top, width, height), (other_left, _, other_width, _) = parts
    margin = COMMON_PART.margin * 1200
    assert (top, height, left + width, other_left) == (0, 900, 1200, 0)
    assert left == pytest.approx(SHIFT - margin, abs=10) and other_width == pytest.approx(1200 - left, abs=20)


@pytest.mark.parametrize(
    "pictures",
    [side_by_side(60), side_by_side(400, 700, 500), [side_by_side()[0], picture_from_array(texture(900, 1200, 8))]],
    ids=["nearly all", "small", "unlike"],
)
def test_all_of_both_is_looked_at_where_a_part_is_not_sure_or_spares_little(pictures: list[Picture]) -> None:
    assert common_parts(pictures) is None


def test_matches_found_in_parts_are_px_of_the_whole_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    pictures, asked = side_by_side(), []
    real = features.detect

    def detect(view: np.ndarray, alpha: np.ndarray | None, *most: int) -> features.Features:
        asked.append((view.shape[1], *most))
        return real(view, alpha, *most)

    monkeypatch.setattr(pair_matches.features, "detect", detect)
    matches = pair_matches.found_in([pictures], lambda stage, share: None, False)
    assert len(matches) > 300
    assert np.median(np.abs(matches.x - matches.y - [SHIFT, 0]).max(axis=1)) < 0.1
    width, budget, pixels = asked[-1]
    # somewhat more to an area than in the whole picture
    assert width < 800 and budget == round(FEATURES.budget * (width / 1200) ** 0.5)
    assert pixels == round(FEATURES.pixels * width / 1200)


def test_as_many_pictures_at_once_as_their_memory_allows() -> None:
    def at_once(pixels: Sequence[int]) -> int:
        return features.at_once(FEATURES.pixels, pixels)

    assert at_once([10**5, 10**5]) > 2 and at_once([10**5, 10**8]) == 1 == at_once([10**8])
