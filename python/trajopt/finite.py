"""Names what is not finite at the start of a solve: the term and the frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError

if TYPE_CHECKING:
    from trajopt.transcription import Stage, Transcription

__all__ = ["check_start"]

FloatArray = NDArray[np.float64]


def check_start(
    transcription: Transcription, core: Any, state: FloatArray, stage: Stage, initial: FloatArray
) -> None:
    """Refuse a start at which the objective or the physics cannot be evaluated.

    Parameters
    ----------
    transcription : Transcription
    core : _core.TrajectoryProblem
        Problem of the stage.
    state : array
        The core's state that the solver would start from.
    stage : Stage
    initial : (2, D) array
        Frames -1 and 0 [m, rad].

    Raises
    ------
    ArgumentError
        Names the term, or the coordinate, and the frame.
    """
    found = core.evaluate(state)
    _check_physics(transcription, found)
    for label, residual in transcription.residuals.items():
        _check_residual(transcription, label, *residual.at(found["frames"], True))
    for label, value in zip(transcription.term_names, found["terms"], strict=True):
        if not np.isfinite(value):
            frame = _first_frame(transcription, state, stage, initial, label)
            raise ArgumentError(
                f"solve: term {label!r} is {value} at the initial guess, the first time in "
                f"{_frame(transcription, frame)}; is its target out of all proportion?"
            )


def _check_physics(transcription: Transcription, found: dict[str, Any]) -> None:
    model = transcription.problem.model
    frames = np.argwhere(~np.isfinite(found["frames"]))
    if len(frames):
        raise ArgumentError(
            f"solve: the initial guess is not finite in {_frame(transcription, frames[0][0] - 2)}"
        )
    for rows, names in (
        (found["frame_constraint"], np.array(model.dof_names)[~model.actuated]),
        (found["torque"], np.array(model.dof_names)[model.actuated]),
    ):
        bad = np.argwhere(~np.isfinite(rows))
        if len(bad):
            frame, row = bad[0]
            raise ArgumentError(
                f"solve: the force on {names[row]} is {rows[frame, row]} at the initial guess in "
                f"{_frame(transcription, frame)}; are velocities or stiffnesses out of all "
                "proportion?"
            )


def _check_residual(
    transcription: Transcription, label: str, rows: FloatArray, jacobian: FloatArray
) -> None:
    """Check the values (N, rows) and derivatives (N, rows, 3 D) of a user's residual."""
    bad = np.argwhere(~np.isfinite(rows))
    if len(bad):
        frame, row = bad[0]
        raise ArgumentError(
            f"solve: term {label!r} is {rows[frame, row]} at the initial guess: row {row} in "
            f"{_frame(transcription, frame)}; keep arguments of np.sqrt, np.log and divisors away "
            "from 0"
        )
    bad = np.argwhere(~np.isfinite(jacobian))
    if len(bad):
        frame, row, column = bad[0]
        names = transcription.problem.model.dof_names
        node, dof = divmod(int(column), len(names))
        raise ArgumentError(
            f"solve: term {label!r} has no finite derivative at the initial guess: row {row} by "
            f"{('x', 'x1', 'x2')[node]}[{dof}] ({names[dof]}) in {_frame(transcription, frame)}; "
            "np.sqrt has none at 0, np.sqrt(... + 1e-6) does"
        )


def _first_frame(
    transcription: Transcription, state: FloatArray, stage: Stage, initial: FloatArray, label: str
) -> int:
    """Return the first frame whose share of a term is not finite, by bisection."""
    count = transcription.problem.frames

    def finite(frames: slice) -> bool:
        counts = np.zeros(count)
        counts[frames] = 1.0
        core = transcription.counting(stage, initial, counts)
        terms = core.evaluate(state)["terms"]
        return bool(np.isfinite(terms[transcription.term_names.index(label)]))

    first, last = 0, count  # finite before `first`, not finite before `last`
    while last - first > 1:
        middle = (first + last) // 2
        first, last = (middle, last) if finite(slice(0, middle)) else (first, middle)
    return first


def _frame(transcription: Transcription, frame: int) -> str:
    """Say which frame of the motion `frame` is, counted from 0 as in `Solution.x`."""
    if frame < 0:
        return "the pose it starts from"
    return f"frame {frame} (t = {transcription.problem.times[frame]:.4g} s)"
