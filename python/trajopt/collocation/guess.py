"""Where a solve starts: values, a function of time, an earlier solution, or a straight line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import finite_array
from trajopt.errors import ArgumentError, ArgumentTypeError

if TYPE_CHECKING:
    from trajopt.collocation.phase import Phase

__all__ = ["Guess", "make_guess"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Guess:
    """A trajectory to start from: ends of time, parameters, and x, u at fractions of the time.

    Parameters
    ----------
    t0, tf : float
        Ends of the trajectory [s].
    parameters : (np,) array
    sample : callable
        Fractions (m,) in [0, 1] -> x (m, nx), u (m, nu).
    """

    t0: float
    tf: float
    parameters: FloatArray
    sample: Callable[[FloatArray], tuple[FloatArray, FloatArray]]


def make_guess(owner: str, phase: Phase, guess: Any) -> Guess:
    """Return `guess` in one form, after checking all of it."""
    from trajopt.collocation.solution import Solution

    if isinstance(guess, Solution):
        return _from_solution(owner, phase, guess)
    if guess is None:
        guess = {}
    if callable(guess):
        return _from_function(owner, phase, guess)
    if not isinstance(guess, Mapping):
        raise ArgumentTypeError(
            f"{owner}: guess must be a dict with t, x, u, a function of t, or an earlier "
            f"solution, not {type(guess).__name__}"
        )
    return _from_values(owner, phase, guess)


def _ends(phase: Phase, times: FloatArray | None) -> tuple[float, float]:
    """Return the ends of time: fixed ones as they are, free ones from `times` or the bounds."""
    ends = []
    for k, (lower, upper) in ((0, phase.t0), (-1, phase.tf)):
        if lower == upper:
            ends.append(lower)
        elif times is not None:
            ends.append(float(np.clip(times[k], lower, upper)))
        else:
            known = [bound for bound in (lower, upper) if np.isfinite(bound)]
            ends.append(sum(known) / len(known) if known else float("nan"))
    t0, tf = ends
    t0 = tf - 1.0 if np.isnan(t0) and not np.isnan(tf) else 0.0 if np.isnan(t0) else t0
    tf = t0 + 1.0 if np.isnan(tf) else tf
    return t0, tf if tf > t0 else t0 + 1.0


def _from_values(owner: str, phase: Phase, guess: Mapping[str, Any]) -> Guess:
    unknown = sorted(set(guess) - {"t", "x", "u", "p"})
    if unknown:
        raise ArgumentError(f"{owner}: guess has no entry {unknown[0]!r}, expected t, x, u, p")
    times = None
    if "t" in guess:
        times = finite_array(owner, "guess['t']", guess["t"], (None,))
        if len(times) < 2 or np.any(np.diff(times) <= 0):
            raise ArgumentError(f"{owner}: guess['t'] must rise and hold at least two times")
    x = _curve(owner, "x", guess.get("x", _line(phase)), times, phase.x_names)
    u = _curve(
        owner, "u", guess.get("u", np.zeros((2, phase.nu))), times if "u" in guess else None,
        phase.u_names,
    )  # fmt: skip
    parameters = phase.p_middle
    if "p" in guess:
        parameters = finite_array(owner, "guess['p']", guess["p"], (phase.np,))

    def sample(sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _interpolate(x, sigma), _interpolate(u, sigma)

    return Guess(*_ends(phase, times), parameters, sample)


def _curve(
    owner: str, name: str, values: Any, times: FloatArray | None, names: tuple[str, ...]
) -> tuple[FloatArray, FloatArray]:
    """Return fractions of time and values there, after checking shape and finiteness."""
    argument, count = f"guess['{name}']", len(names)
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{owner}: {argument} must be an array of numbers, not {values!r}"
        ) from error
    if array.ndim == 1 and count == 1:
        array = array[:, None]
    if times is not None:
        expected = f"({len(times)}, {count}): a row for every time in guess['t']"
        fits = array.shape == (len(times), count)
    else:
        expected = f"(m, {count}) with m >= 2 rows"
        fits = array.ndim == 2 and array.shape[1] == count and len(array) >= 2
    if not fits:
        raise ArgumentError(f"{owner}: {argument} has shape {array.shape}, expected {expected}")
    bad = np.argwhere(~np.isfinite(array))
    if len(bad):
        row, column = (int(i) for i in bad[0])
        raise ArgumentError(
            f"{owner}: {argument}[{row}, {column}] ({names[column]}) = {array[row, column]}, "
            "expected finite numbers"
        )
    if times is None:
        return np.linspace(0.0, 1.0, len(array)), array
    return (times - times[0]) / (times[-1] - times[0]), array


def _interpolate(curve: tuple[FloatArray, FloatArray], sigma: FloatArray) -> FloatArray:
    where, values = curve
    columns = [np.interp(sigma, where, column) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((len(sigma), 0))


def _line(phase: Phase) -> FloatArray:
    """Return the first and last state in the middle of their bounds."""
    return np.stack([_middle(*phase.x0), _middle(*phase.xf)])


def _middle(lower: FloatArray, upper: FloatArray) -> FloatArray:
    low = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, 0.0))
    high = np.where(np.isfinite(upper), upper, low)
    # With one bound at infinity, and both, the nearest admissible value to zero is a fair start.
    one_sided = np.isfinite(lower) != np.isfinite(upper)
    nearest = np.clip(0.0, lower, upper)
    return np.asarray(np.where(one_sided, nearest, 0.5 * (low + high)), dtype=np.float64)


def _from_function(owner: str, phase: Phase, function: Callable[[float], Any]) -> Guess:
    t0, tf = _ends(phase, None)

    def sample(sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        xs, us = [], []
        for t in t0 + sigma * (tf - t0):
            values = function(float(t))
            if not isinstance(values, (tuple, list)) or len(values) != 2:
                raise ArgumentTypeError(
                    f"{owner}: guess({t:g}) returned {values!r}, expected a pair x, u"
                )
            xs.append(_at(owner, "x", t, values[0], phase.x_names))
            us.append(_at(owner, "u", t, values[1], phase.u_names))
        return np.stack(xs), np.stack(us)

    sample(np.array([0.0, 0.5, 1.0]))  # refuse a function that does not fit before work starts
    return Guess(t0, tf, phase.p_middle, sample)


def _at(owner: str, name: str, t: float, values: Any, names: tuple[str, ...]) -> FloatArray:
    array = np.atleast_1d(np.array(values, dtype=np.float64))
    if array.shape != (len(names),):
        raise ArgumentError(
            f"{owner}: guess({t:g}) returned {name} of shape {array.shape}, "
            f"expected ({len(names)},)"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if len(bad):
        i = int(bad[0])
        raise ArgumentError(
            f"{owner}: guess({t:g}) returned {name}[{i}] ({names[i]}) = {array[i]}, "
            "expected finite numbers"
        )
    return array


def _from_solution(owner: str, phase: Phase, solution: Any) -> Guess:
    have = (solution.x.shape[1], solution.u.shape[1], len(solution.parameters))
    if have != (phase.nx, phase.nu, phase.np):
        raise ArgumentError(
            f"{owner}: the solution given as guess has nx, nu, parameters = {have}, "
            f"expected {(phase.nx, phase.nu, phase.np)}"
        )
    start, end = solution.t[0], solution.t[-1]

    def sample(sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
        times = start + sigma * (end - start)
        return solution.state(times), solution.control(times)

    return Guess(*_ends(phase, solution.t), solution.parameters, sample)
