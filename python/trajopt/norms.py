"""Root mean square and largest absolute value, of nothing too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["largest", "rms"]


def rms(values: NDArray[np.float64], of_nothing: float = 0.0) -> float:
    """Return the root mean square of all elements, or `of_nothing` where there are none.

    Examples
    --------
    >>> rms(np.array([1.0, -7.0])), rms(np.zeros(0))
    (5.0, 0.0)
    """
    return float(np.sqrt(np.mean(values**2))) if values.size else of_nothing


def largest(values: NDArray[np.float64], of_nothing: float = 0.0) -> float:
    """Return the largest absolute value, or `of_nothing` where there is none."""
    return float(np.max(np.abs(values))) if values.size else of_nothing
