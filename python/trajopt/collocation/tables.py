"""Tables of measured values inside dynamics and constraints (Kelly, 5.5)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from trajopt.checks import finite_array
from trajopt.errors import ArgumentError

__all__ = ["table"]


def table(x: ArrayLike, y: ArrayLike) -> Callable[[Any], Any]:
    """Return a smooth function through the points of a table.

    Looking values up with straight lines in between has jumps in the slope, over which optimizers
    stumble. This function has two continuous derivatives.

    Parameters
    ----------
    x : (n,) array_like
        Where values are known, rising, two at least.
    y : (n,) array_like
        The values.

    Returns
    -------
    callable
        Works on numbers, arrays and in traced functions. Beyond the table it goes on straight.

    Notes
    -----
    The natural cubic spline, as a sum of max(0, x - x_k)³: the same operations on every call.

    Examples
    --------
    >>> lift = table([0, 1, 2, 3], [0.0, 0.8, 1.0, 0.7])
    >>> round(float(lift(2.0)), 12)
    1.0
    """
    where = finite_array("table", "x", x, (None,))
    values = finite_array("table", "y", y, where.shape)
    if len(where) < 2:
        raise ArgumentError(f"table: x must hold at least two values, not {len(where)}")
    falls = np.flatnonzero(np.diff(where) <= 0)
    if len(falls):
        k = int(falls[0])
        raise ArgumentError(
            f"table: x must rise, but x[{k}] = {where[k]:g} and x[{k + 1}] = {where[k + 1]:g}"
        )
    spline = CubicSpline(where, values, bc_type="natural")
    cubic = np.append(spline.c[0], 0.0)
    steps = np.diff(cubic, prepend=0.0)
    first, slope = float(values[0]), float(spline.c[2, 0])

    def look_up(at: Any) -> Any:
        total = first + slope * (at - where[0])
        for knot, step in zip(where, steps, strict=True):
            total = total + float(step) * np.maximum(at - float(knot), 0.0) ** 3
        return total

    return look_up
