"""More segments or higher degrees: the refinement of orthogonal methods, segment by segment.

A segment whose error is above the tolerance is smooth or not. The Legendre coefficients of a smooth
function fall like exp(-σ j): after Mavriplis (1994) the degree is raised where σ > 1, and the
segment cut where the coefficients fall more slowly, as they do at a switch of the control. Liu,
Hager and Rao (2018) use the same rates for optimal control: since the error of degree n falls like
exp(-σ n), it is raised by log(error / tolerance) / σ. As in Patterson, Hager and Rao (2015) a
segment that has reached the highest degree is cut. Few coefficients say little, so a rate that was
measured counts too: where a segment had a lower degree in the pass before, σ is at most the
logarithm of the ratio of both errors by the difference of the degrees.

References
----------
C. Mavriplis, "Adaptive mesh strategies for the spectral element method", Computer Methods in
Applied Mechanics and Engineering 116 (1994).
M. A. Patterson, W. W. Hager, A. V. Rao, "A ph mesh refinement method for optimal control", Optimal
Control Applications and Methods 36 (2015).
F. Liu, W. W. Hager, A. V. Rao, "Adaptive mesh refinement method for optimal control using decay
rates of Legendre polynomial coefficients", IEEE Transactions on Control Systems Technology 26
(2018).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from trajopt.collocation.grids import Grid
from trajopt.collocation.solution import Solution

__all__ = [
    "Step",
    "decay_rate",
    "equal_parts",
    "measured_rates",
    "refine_orthogonal",
    "relative_error",
]

FloatArray = NDArray[np.float64]

# Coefficients that fall at least like exp(-SMOOTH j) belong to a smooth function.
SMOOTH = 1.0
# Beyond this degree more segments are cheaper than higher polynomials: the blocks are dense.
HIGHEST_DEGREE = 16
# With one segment the user asked for a global polynomial, which may grow further before it is cut.
HIGHEST_GLOBAL_DEGREE = 96
# The degree of one segment grows by at most so much in a pass: rates are estimates.
MOST_RAISED = 6
# A segment is cut into at most so many (Kelly, figure 7).
MOST_PARTS = 4
# Coefficients below this share of the largest are rounding.
ROUNDING = 1e-13


@dataclass(frozen=True)
class Step:
    """The grid of the next pass; how many segments were cut for it, how many raised."""

    grid: Grid
    cut: int = 0
    raised: int = 0


def equal_parts(error: float, tolerance: float, power: int) -> int:
    """Return into how many parts to cut, where the error falls with a power of the length."""
    return int(np.clip(np.ceil((error / tolerance) ** (1.0 / power)), 2, MOST_PARTS))


def decay_rate(coefficients: FloatArray) -> float:
    """Return σ of the fit exp(a - σ j) to the sizes of Legendre coefficients.

    Fitted is what remains from each coefficient on, max |c_i| over i >= j, because those of even
    and odd functions vanish in turn; for the same reason the last two count as one.

    Examples
    --------
    >>> round(decay_rate(np.exp(-2.0 * np.arange(6))), 3)
    2.0
    """
    rest = np.maximum.accumulate(np.abs(coefficients)[::-1])[::-1][:-1]
    rest = rest[rest > ROUNDING * rest[:1]]
    if len(rest) < 2:
        return np.inf
    return float(-np.polyfit(np.arange(len(rest)), np.log(rest), 1)[0])


def refine_orthogonal(
    solution: Solution,
    error: FloatArray,
    tolerance: float,
    lowest: int,
    points_of: Callable[[int], FloatArray],
    measured: Mapping[tuple[float, float], float],
) -> Step:
    """Return the grid in which every segment with too large an error is cut or of higher degree.

    Parameters
    ----------
    solution : Solution
    error : (N,) array
        Relative error of every segment.
    tolerance : float
    lowest : int
        Degree of the parts of a segment that is not smooth.
    points_of : callable
        Degree -> collocation points in [0, 1].
    measured : dict
        Ends of segments -> rate measured there.
    """
    if solution.segments == 1:
        return _refine_global(solution)
    series = _series(solution)
    size = 1.0 + np.abs(solution.x).max(axis=0)
    knots, degrees, cut, raised = [0.0], [], 0, 0
    for k, degree in enumerate(solution.degrees):
        begin, end = solution.mesh[k : k + 2]
        if error[k] <= tolerance:
            knots.append(end)
            degrees.append(degree)
            continue
        wrong = np.flatnonzero(solution.error[k] / size > tolerance)
        count = degree + series.shape[1] - max(solution.degrees)
        rate = min(decay_rate(series[k, :count, i]) for i in wrong)
        rate = min(rate, measured.get((begin, end), np.inf))
        if rate >= SMOOTH and degree < HIGHEST_DEGREE:
            needed = np.ceil(np.log(error[k] / tolerance) / rate)
            raised += 1
            knots.append(end)
            degrees.append(min(degree + int(np.clip(needed, 1, MOST_RAISED)), HIGHEST_DEGREE))
            continue
        cut += 1
        if rate >= SMOOTH:
            parts = equal_parts(error[k], tolerance, degree + 1)
            inner, lower = np.arange(1, parts + 1) / parts, degree
        else:
            points = points_of(degree)
            slopes = legvander(2.0 * points - 1.0, count - 1) @ series[k, :count]
            inner, lower = _around_jump(slopes, points), min(lowest, degree)
        knots += list(begin + (end - begin) * inner)
        degrees += [lower] * len(inner)
    knots[-1] = 1.0
    return Step(Grid(np.array(knots), tuple(degrees)), cut, raised)


def relative_error(solution: Solution) -> FloatArray:
    """Return the error of every segment (N,): the worst state, relative to 1 + max |x|."""
    size = 1.0 + np.abs(solution.x).max(axis=0)
    return np.asarray((solution.error / size).max(axis=1), dtype=np.float64)


def measured_rates(before: Solution, after: Solution) -> dict[tuple[float, float], float]:
    """Return σ of exp(-σ n) from the errors of segments whose degree n is another than before."""
    found, errors = {}, relative_error(after)
    known = dict(
        zip(
            pairwise(before.mesh),
            zip(before.degrees, relative_error(before), strict=True),
            strict=True,
        )
    )
    for ends, degree, error in zip(pairwise(after.mesh), after.degrees, errors, strict=True):
        lower, earlier = known.get(ends, (degree, error))
        if lower < degree and error > 0:
            found[ends] = float(np.log(earlier / error) / (degree - lower))
    return found


def _refine_global(solution: Solution) -> Step:
    """Return one segment of a degree half as high again, or, at the highest, equal parts of it."""
    degree = solution.degrees[0]
    if degree < HIGHEST_GLOBAL_DEGREE:
        higher = min(degree + max(4, degree // 2), HIGHEST_GLOBAL_DEGREE)
        return Step(Grid(solution.mesh, (higher,)), raised=1)
    parts = max(HIGHEST_GLOBAL_DEGREE // HIGHEST_DEGREE, 2)
    return Step(Grid(np.linspace(0.0, 1.0, parts + 1), (HIGHEST_DEGREE,) * parts), cut=1)


def _series(solution: Solution) -> FloatArray:
    """Return the Legendre coefficients of the slopes of every segment: (N, m, nx)."""
    found = solution.interpolant
    points = 2.0 * found.slope_points - 1.0
    values = np.linalg.solve(legvander(points, len(points) - 1), found.slopes)
    return np.asarray(values, dtype=np.float64)


def _around_jump(slopes: FloatArray, points: FloatArray) -> FloatArray:
    """Return the ends of the parts of a segment with a jump, as shares of it.

    The jump is between the points where the slopes, each relative to its range in the segment,
    change most; the parts are what lies before, between and after them. It may be a kink instead,
    anywhere: so no part is longer than half of the segment.
    """
    change = np.abs(np.diff(slopes, axis=0))
    span = np.ptp(slopes, axis=0)
    shares = np.divide(change, span, out=np.zeros_like(change), where=span > 0).max(axis=1)
    knots = [0.0, 1.0]
    if len(shares):
        where = int(np.argmax(shares))
        knots = sorted({0.0, *(float(c) for c in points[where : where + 2]), 1.0})
    halved = [0.5 * (a + b) for a, b in pairwise(knots) if b - a > 0.5]
    return np.array(sorted([*knots[1:], *halved]))
