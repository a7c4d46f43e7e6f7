"""Sequences of meshes, coarse to fine: given by the user, or chosen by the error (Kelly, 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.grids import Grid
from trajopt.collocation.hp import (
    Step,
    equal_parts,
    measured_rates,
    refine_orthogonal,
    relative_error,
)
from trajopt.collocation.phases import MultiPhaseSolution
from trajopt.collocation.solution import Solution
from trajopt.collocation.transcriptions import DEGREE, make_transcription
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.status import Status

__all__ = ["Once", "next_grid", "refine_automatically", "relative_error", "run_schedule"]

FloatArray = NDArray[np.float64]
Found = Solution | MultiPhaseSolution
# Solve once: a grid per phase, settings, an earlier solution as guess or None.
Once = Callable[[Sequence[Grid], Mapping[str, Any], Found | None], Found]
# Grids of what the user gives as segments, and of settings with a degree.
Grids = Callable[[Any, Mapping[str, Any]], list[Grid]]


def run_schedule(
    once: Once, grids: Grids, schedule: Sequence[Any], base: Mapping[str, Any]
) -> Found:
    """Solve on a list of meshes; each solution is the guess of the next (Kelly, 7.6)."""
    if not len(schedule):
        raise ArgumentError("solve: refine as a list of meshes is empty")
    plan: list[tuple[list[Grid], dict[str, Any]]] = []
    for entry in schedule:
        settings = dict(entry) if isinstance(entry, Mapping) else {"segments": entry}
        unknown = sorted(
            set(settings) - {"segments", "method", "degree", "points", "substeps", "tolerance"}
        )
        if unknown:
            raise ArgumentError(
                f"solve: refine has no setting {unknown[0]!r}, expected segments, method, "
                "degree, points, substeps, tolerance"
            )
        segments = settings.pop("segments", 25)
        settings = {**base, **settings}
        plan.append((grids(segments, settings), settings))
    found = None
    for meshes, settings in plan:
        found = _next(once, meshes, settings, found, None)
        if not found.converged:
            break
    assert found is not None
    return found


def refine_automatically(
    once: Once, grids: Sequence[Grid], settings: Mapping[str, Any], tolerance: float, most: int
) -> Found:
    """Solve, and refine where the error is above `tolerance`, until none is or `most` passes.

    Each phase is refined by its own error; one that is below the tolerance keeps its mesh.
    """
    lowest = [_lowest(grid) for grid in grids]
    found, before = once(grids, settings, None), None
    for _ in range(most):
        if not found.converged or _worst(found) <= tolerance:
            break
        olds = [None] * len(lowest) if before is None else _phases(before)
        steps = [
            next_grid(phase, settings, tolerance, low, old)
            for phase, low, old in zip(_phases(found), lowest, olds, strict=True)
        ]
        before = found
        found = _next(once, [step.grid for step in steps], settings, before, steps)
    worst = _worst(found)
    if found.converged and worst > tolerance:
        found.message += f"; error {worst:.1e} still above refine = {tolerance:g}"
        for phase in _phases(found):
            phase.message = found.message
    return found


def next_grid(
    solution: Solution,
    settings: Mapping[str, Any],
    tolerance: float,
    lowest: int = DEGREE,
    before: Solution | None = None,
) -> Step:
    """Return a finer grid for one phase: segments cut, or their degree raised.

    `lowest` is the degree of the parts of a segment that is cut because it is not smooth, and
    `before` the solution of the pass before.
    """
    error = relative_error(solution)
    if error.max() <= tolerance:
        return Step(Grid(solution.mesh, solution.degrees or None))
    if solution.degrees:

        def points(n: int) -> FloatArray:
            method = make_transcription(solution.method, n, settings.get("points"))
            return np.array(method.points)

        measured = {} if before is None else measured_rates(before, solution)
        return refine_orthogonal(solution, error, tolerance, lowest, points, measured)
    transcription = make_transcription(
        solution.method, None, settings.get("points"), settings.get("substeps")
    )
    # The error of a segment falls with the power q of its length; trapezoidal 3, Simpson 4.
    q = len(transcription.points) + 1
    knots: list[FloatArray] = []
    bad = error > tolerance
    for k, wrong in enumerate(bad):
        parts = equal_parts(error[k], tolerance, q) if wrong else 1
        begin, end = solution.mesh[k : k + 2]
        knots.append(begin + (end - begin) * np.arange(parts) / parts)
    return Step(Grid(np.append(np.concatenate(knots), 1.0)), cut=int(bad.sum()))


def _lowest(grid: Grid) -> int:
    """Return the lowest degree that a solve began with."""
    return int(np.min(DEGREE if grid.degree is None else grid.degree))


def _phases(found: Found) -> list[Solution]:
    return [found] if isinstance(found, Solution) else list(found.phases)


def _worst(found: Found) -> float:
    return max(float(relative_error(phase).max()) for phase in _phases(found))


def _next(
    once: Once,
    grids: Sequence[Grid],
    settings: Mapping[str, Any],
    before: Found | None,
    steps: Sequence[Step] | None,
) -> Found:
    """Solve from `before`, which stays what there is if Ctrl-C comes before the solver starts."""
    try:
        return _joined(before, once(grids, settings, before), steps)
    except KeyboardInterrupt:
        if before is None:
            raise
        message = f"interrupted before the next mesh was solved; {before.message}"
        for part in (before, *_phases(before)):
            part.status, part.message = Status.INTERRUPTED, message
        return before


def _joined(before: Found | None, after: Found, steps: Sequence[Step] | None) -> Found:
    """Return `after` with the passes of both, the last with what was refined for it."""
    if before is None:
        return after
    for k, (old, new) in enumerate(zip(_phases(before), _phases(after), strict=True)):
        entry = new.passes[-1]
        if steps is not None:
            entry = replace(entry, cut=steps[k].cut, raised=steps[k].raised)
        new.passes = [*old.passes, entry]
        new.iterations += old.iterations
        new.seconds += old.seconds
    if isinstance(after, MultiPhaseSolution):
        after.iterations += before.iterations
        after.seconds += before.seconds
    return after
    for k, (old, new) in enumerate(zip(_phases(before), _phases(after), strict=True)):
        entry = new.passes[-1]
        if steps is not None:
            entry = replace(entry, cut=steps[k].cut, raised=steps[k].raised)
        new.passes = [*old.passes, entry]
    for old, new in {
        id(b): (a, b)
        for a, b in zip((before, *_phases(before)), (after, *_phases(after)), strict=True)
    }.values():
        new.iterations += old.iterations
        new.seconds += old.seconds
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
