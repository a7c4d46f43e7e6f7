"""Time grids that are fine where the physics between the frames needs it (Kelly section 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import positive

if TYPE_CHECKING:
    from trajopt.audit.motion import Motion

__all__ = ["interval_errors", "refine_steps", "refine_until"]

FloatArray = NDArray[np.float64]

Y = TypeVar("Y")
S = TypeVar("S")

POINTS = 4  # evaluations of the residual between two frames


def interval_errors(motion: Motion, fine_violation: FloatArray, body_weight: float) -> FloatArray:
    """Return the root-mean-square residual of every interval as a share of the body weight (N,)."""
    values = np.asarray(fine_violation).reshape(len(motion.x), POINTS) / body_weight
    return np.asarray(np.sqrt(np.mean(values**2, axis=1)))


def refine_steps(steps: FloatArray, errors: FloatArray, tolerance: float) -> FloatArray:
    """Halve the steps whose error exceeds a tolerance, and keep neighbours within a factor of two.

    Parameters
    ----------
    steps : (N,) array
        Time steps [s].
    errors : (N,) array
        Error of every interval.
    tolerance : float
        Largest error that is left alone.

    Returns
    -------
    (M,) array
        Steps of the refined grid, M >= N, of the same total duration.

    Examples
    --------
    >>> refine_steps(np.full(4, 0.1), np.array([0.0, 0.0, 1.0, 0.0]), 0.5)
    array([0.1 , 0.1 , 0.05, 0.05, 0.1 ])
    """
    positive("refine_steps", "tolerance", tolerance)
    split = errors > tolerance
    while True:  # a step may be at most twice its neighbour
        size = np.where(split, 0.5, 1.0) * steps
        neighbour = np.minimum(
            np.concatenate([size[1:], [np.inf]]), np.concatenate([[np.inf], size[:-1]])
        )
        wide = ~split & (size > 2.0 * neighbour * (1 + 1e-9))
        if not wide.any():
            break
        split |= wide
    return np.repeat(np.where(split, 0.5, 1.0) * steps, np.where(split, 2, 1))


def refine_until(
    errors_of: Callable[[], FloatArray],
    solve_on: Callable[[FloatArray], Generator[Y, S, bool]],
    steps: FloatArray,
    tolerance: float,
    passes: int,
) -> Generator[Y, S, int]:
    """Refine and solve until no interval's error exceeds the tolerance.

    A generator, because solving is one: it yields what `solve_on` yields.

    Parameters
    ----------
    errors_of : callable
        Errors of the intervals of the motion at hand.
    solve_on : callable
        Solves on a new grid, starting from that motion; what returns False stops.
    steps : (N,) array
        Steps of the first grid [s].
    tolerance : float
    passes : int
        Most grids to try.

    Returns
    -------
    int
        Grids that were solved on.
    """
    for count in range(passes):
        finer = refine_steps(steps, errors_of(), tolerance)
        if len(finer) == len(steps):
            return count
        steps = finer
        if not (yield from solve_on(steps)):
            return count + 1
    return passes
