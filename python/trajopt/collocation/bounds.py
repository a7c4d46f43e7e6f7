"""Bounds on vectors: from what a user writes to two arrays, with every contradiction named."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError, ArgumentTypeError

__all__ = ["Pair", "both", "pair"]

FloatArray = NDArray[np.float64]
Pair = tuple[FloatArray, FloatArray]


def pair(owner: str, argument: str, bounds: Any, names: Sequence[str]) -> Pair:
    """Return lower and upper bounds as arrays with one entry for every name.

    Parameters
    ----------
    owner, argument : str
        For messages.
    bounds : (lower, upper) or None
        Each a number for all entries, or one number an entry; None and ±inf mean unbounded.
    names : sequence of str
        Names of the entries.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Naming the entry whose bounds are no numbers or contradict each other.

    Examples
    --------
    >>> pair("Problem", "u_bounds", (-1.0, [2.0, None]), ["u[0]", "u[1]"])
    (array([-1., -1.]), array([ 2., inf]))
    """
    if bounds is None:
        return np.full(len(names), -np.inf), np.full(len(names), np.inf)
    if not isinstance(bounds, (tuple, list, np.ndarray)) or len(bounds) != 2:
        raise ArgumentTypeError(f"{owner}: {argument} must be (lower, upper), not {bounds!r}")
    lower = _side(owner, f"lower of {argument}", bounds[0], names, -np.inf)
    upper = _side(owner, f"upper of {argument}", bounds[1], names, np.inf)
    _agree(owner, argument, lower, upper, names)
    return lower, upper


def both(owner: str, argument: str, first: Pair, second: Pair, names: Sequence[str]) -> Pair:
    """Return the bounds that hold when both pairs do."""
    lower, upper = np.maximum(first[0], second[0]), np.minimum(first[1], second[1])
    _agree(owner, argument, lower, upper, names)
    return lower, upper


def _side(
    owner: str, argument: str, values: Any, names: Sequence[str], nothing: float
) -> FloatArray:
    count = len(names)
    try:
        entries = [values] * count if values is None or np.ndim(values) == 0 else list(values)
        array = np.array([nothing if v is None else float(v) for v in entries], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{owner}: {argument} must hold numbers or None, not {values!r}"
        ) from error
    if len(array) != count:
        raise ArgumentError(
            f"{owner}: {argument} has {len(array)} entries, expected {count} ({', '.join(names)})"
        )
    wrong = np.isnan(array) | (array == -nothing)
    if wrong.any():
        i = int(np.flatnonzero(wrong)[0])
        raise ArgumentError(f"{owner}: {argument} for {names[i]} is {array[i]}, expected a bound")
    return array


def _agree(
    owner: str, argument: str, lower: FloatArray, upper: FloatArray, names: Sequence[str]
) -> None:
    crossed = np.flatnonzero(lower > upper)
    if len(crossed):
        i = int(crossed[0])
        raise ArgumentError(
            f"{owner}: {argument} contradict each other for {names[i]}: "
            f"lower {lower[i]:g} > upper {upper[i]:g}"
        )
