"""Sequences of meshes, coarse to fine: given by the user, or chosen by the error (Kelly, 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.solution import Solution
from trajopt.collocation.transcriptions import DEGREE, make_transcription
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.status import Status

__all__ = ["Once", "next_mesh", "refine_automatically", "relative_error", "run_schedule"]

FloatArray = NDArray[np.float64]
# Solve once: mesh (segments or knots), settings that override the others, guess or None.
Once = Callable[[Any, Mapping[str, Any], Any], Solution]

# A segment is cut into at most so many (Kelly, figure 7).
MOST_PARTS = 4
# The largest error above this multiple of the mean of the segments that need work is a spike:
# there the mesh is cut, elsewhere the degree is raised.
SPIKE = 3.0
# Beyond this degree more segments are cheaper than higher polynomials: the blocks are dense.
HIGHEST_DEGREE, DEGREE_STEP = 24, 4
# With one segment the user asked for a global polynomial, which may grow further.
HIGHEST_GLOBAL_DEGREE = 120


def relative_error(solution: Solution) -> FloatArray:
    """Return the error of every segment (N,): the worst state, relative to 1 + max |x|."""
    size = 1.0 + np.abs(solution.x).max(axis=0)
    return np.asarray((solution.error / size).max(axis=1), dtype=np.float64)


def run_schedule(once: Once, schedule: Sequence[Any]) -> Solution:
    """Solve on a list of meshes; each solution is the guess of the next (Kelly, 7.6)."""
    if not len(schedule):
        raise ArgumentError("solve: refine as a list of meshes is empty")
    plan: list[tuple[Any, dict[str, Any]]] = []
    for entry in schedule:
        if isinstance(entry, Mapping):
            settings = dict(entry)
            unknown = sorted(
                set(settings) - {"segments", "method", "degree", "points", "substeps", "tolerance"}
            )
            if unknown:
                raise ArgumentError(
                    f"solve: refine has no setting {unknown[0]!r}, expected segments, method, "
                    "degree, points, substeps, tolerance"
                )
            plan.append((settings.pop("segments", 25), settings))
        else:
            plan.append((entry, {}))
    solution: Solution | None = None
    for segments, settings in plan:
        solution = _next(once, segments, settings, solution)
        if not solution.converged:
            break
    assert solution is not None
    return solution


def refine_automatically(
    once: Once, segments: Any, settings: Mapping[str, Any], tolerance: float, most: int
) -> Solution:
    """Solve, and refine where the error is above `tolerance`, until none is or `most` passes."""
    settings = dict(settings)
    solution = once(segments, settings, None)
    for _ in range(most):
        if not solution.converged or relative_error(solution).max() <= tolerance:
            break
        mesh, degree = next_mesh(solution, settings, tolerance)
        if degree:
            settings["degree"] = degree
        solution = _next(once, mesh, settings, solution)
    worst = float(relative_error(solution).max())
    if solution.converged and worst > tolerance:
        solution.message += f"; error {worst:.1e} still above refine = {tolerance:g}"
    return solution


def next_mesh(
    solution: Solution, settings: Mapping[str, Any], tolerance: float
) -> tuple[FloatArray, int]:
    """Return the knots of a finer mesh in [0, 1], and the degree if it is raised, or 0."""
    error = relative_error(solution)
    bad = error > tolerance
    method = str(settings["method"])
    transcription = make_transcription(
        method, settings.get("degree"), settings.get("points"), settings.get("substeps")
    )
    if method in ("chebyshev", "legendre"):
        degree = settings.get("degree") or DEGREE
        highest = HIGHEST_GLOBAL_DEGREE if len(error) == 1 else HIGHEST_DEGREE
        smooth = error.max() <= SPIKE * error[bad].mean() and bad.mean() > 0.5
        if smooth and degree < highest:
            step = max(DEGREE_STEP, degree // 2) if len(error) == 1 else DEGREE_STEP
            return solution.mesh, min(degree + step, highest)
    # The error of a segment falls with the power q of its length; trapezoidal 3, Simpson 4.
    q = len(transcription.points) + 1
    parts = np.ones(len(error), dtype=int)
    parts[bad] = np.clip(np.ceil((error[bad] / tolerance) ** (1.0 / q)), 2, MOST_PARTS)
    knots = [
        solution.mesh[k] + (solution.mesh[k + 1] - solution.mesh[k]) * np.arange(m) / m
        for k, m in enumerate(parts)
    ]
    return np.append(np.concatenate(knots), 1.0), 0


def _next(
    once: Once, segments: Any, settings: Mapping[str, Any], before: Solution | None
) -> Solution:
    """Solve from `before`, which stays what there is if Ctrl-C comes before the solver starts."""
    try:
        return _joined(before, once(segments, settings, before))
    except KeyboardInterrupt:
        if before is None:
            raise
        before.status = Status.INTERRUPTED
        before.message = f"interrupted before the next mesh was solved; {before.message}"
        return before


def _joined(before: Solution | None, after: Solution) -> Solution:
    """Return `after` with the passes of both."""
    if before is not None:
        after.passes = [*before.passes, *after.passes]
        after.iterations += before.iterations
        after.seconds += before.seconds
    return after


def is_schedule(refine: Any) -> bool:
    """Return whether `refine` is a list of meshes; raise if it is neither that nor a number."""
    if isinstance(refine, (list, tuple)):
        return True
    if isinstance(refine, bool) or not isinstance(refine, (int, float, np.number)):
        raise ArgumentTypeError(
            f"solve: refine must be a tolerance or a list of meshes, not {refine!r}"
        )
    return False
