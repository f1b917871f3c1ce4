"""From named primaries to those of Rec. 709."""

from __future__ import annotations

import numpy as np
import pytest
from edf_stitch.core.raster.primaries import REC709, columns_under_d50, rgb_to_xyz, to_rec709


def test_the_matrix_of_srgb_is_the_published_one() -> None:
    # IEC 61966-2-1, to four digits
    assert np.allclose(rgb_to_xyz(REC709), [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722],
                                            [0.0193, 0.1192, 0.9505]], atol=2e-4)  # fmt: skip
    assert np.allclose(to_rec709(REC709), np.eye(3), atol=1e-12)


def test_aces_comes_out_as_its_academy_says() -> None:
    """The matrix from ACES2065-1 to linear Rec. 709 of the ACES transforms (Bradford, D60 to D65)."""
    ap0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767)
    published = [[2.52169, -1.13413, -0.38756], [-0.27648, 1.37272, -0.09624], [-0.01538, -0.15298, 1.16835]]
    assert np.allclose(to_rec709(ap0), published, atol=2e-3)
    assert np.allclose(to_rec709(ap0) @ np.ones(3), 1, atol=1e-9), "white stays white"


def test_columns_of_a_profile() -> None:
    # those of the sRGB profile of the ICC
    assert np.allclose(columns_under_d50(REC709), [[0.4361, 0.2225, 0.0139], [0.3851, 0.7169, 0.0971],
                                                   [0.1431, 0.0606, 0.7141]], atol=5e-4)  # fmt: skip
    assert columns_under_d50([0.0] * 8) == columns_under_d50(REC709)


@pytest.mark.parametrize("wrong", [[0.0] * 8, [0.3] * 8, [*REC709[:6], 0.9, 0.9], [float("nan")] * 8])
def test_what_is_no_primaries_is_refused(wrong: list[float]) -> None:
    with pytest.raises(ValueError, match="no primaries"):
        rgb_to_xyz(wrong)
