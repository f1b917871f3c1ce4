"""From medians to standard deviations of normal noise, which outliers do not disturb."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Median of |z| for z of a standard normal distribution; its inverse is the usual 1.4826.
NORMAL_MEDIAN = 0.6745
# Median length of a vector of two independent standard normal components: √(2 ln 2).
NORMAL_MEDIAN_LENGTH = 1.1774


def sigma_of(residuals: NDArray[Any]) -> float:
    """Standard deviation of residuals (N,) of mean 0, N > 0, in their unit, from the median of their magnitudes."""
    return float(np.median(np.abs(residuals))) / NORMAL_MEDIAN


def sigma_of_lengths(lengths: NDArray[Any]) -> float:
    """Standard deviation of each of the two components of vectors with lengths (N,), N > 0, from their median."""
    return float(np.median(lengths)) / NORMAL_MEDIAN_LENGTH
