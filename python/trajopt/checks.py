"""Checks of arguments: one clear line naming argument, value and expectation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError, ArgumentTypeError

__all__ = ["choice", "finite_array", "non_negative", "number", "numbers", "positive", "whole"]


def number(owner: str, argument: str, value: Any) -> float:
    """Return `value` as a finite float.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If it is not finite, or not a number.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ArgumentTypeError(
            f"{owner}: {argument} must be a number, not {type(value).__name__} {value!r}"
        )
    if not np.isfinite(value):
        raise ArgumentError(f"{owner}: {argument} must be finite, not {value!r}")
    return float(value)


def positive(owner: str, argument: str, value: Any) -> float:
    """Return `value` as a float > 0.

    Examples
    --------
    >>> positive("Problem", "dt", -0.1)
    Traceback (most recent call last):
    ...
    trajopt.errors.ArgumentError: Problem: dt must be > 0, not -0.1
    """
    checked = number(owner, argument, value)
    if checked <= 0:
        raise ArgumentError(f"{owner}: {argument} must be > 0, not {value!r}")
    return checked


def non_negative(owner: str, argument: str, value: Any) -> float:
    """Return `value` as a float >= 0."""
    checked = number(owner, argument, value)
    if checked < 0:
        raise ArgumentError(f"{owner}: {argument} must be >= 0, not {value!r}")
    return checked


def whole(owner: str, argument: str, value: Any, minimum: int) -> int:
    """Return `value` as an int >= `minimum`.

    Examples
    --------
    >>> whole("solve", "threads", 0, 1)
    Traceback (most recent call last):
    ...
    trajopt.errors.ArgumentError: solve: threads must be a whole number >= 1, not 0
    """
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ArgumentTypeError(
            f"{owner}: {argument} must be a whole number >= {minimum}, not {value!r}"
        )
    if value < minimum:
        raise ArgumentError(
            f"{owner}: {argument} must be a whole number >= {minimum}, not {value!r}"
        )
    return int(value)


def choice(owner: str, argument: str, value: Any, valid: Iterable[str]) -> str:
    """Return `value` if it is one of `valid`."""
    names = list(valid)
    if not isinstance(value, str) or value not in names:
        raise ArgumentError(f"{owner}: {argument} = {value!r}, expected one of {', '.join(names)}")
    return value


def numbers(owner: str, argument: str, value: Any) -> NDArray[np.float64]:
    """Return `value` as an array of numbers of whatever shape."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{owner}: {argument} must be an array of numbers, not {value!r}"
        ) from error


def finite_array(
    owner: str, argument: str, value: Any, shape: tuple[int | None, ...]
) -> NDArray[np.float64]:
    """Return `value` as a finite array of `shape`; None stands for any length.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Names the shape, or the first entry that is not finite.
    """
    array = numbers(owner, argument, value)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        expected = str(tuple("n" if n is None else n for n in shape)).replace("'", "")
        raise ArgumentError(f"{owner}: {argument} has shape {array.shape}, expected {expected}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        index = ", ".join(str(i) for i in bad[0])
        raise ArgumentError(
            f"{owner}: {argument}[{index}] = {array[tuple(bad[0])]}, expected finite numbers"
        )
    return array
