"""Replay: does the character get where the trajectory says when nature moves its base?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.audit.motion import Motion, continuous, setting, unactuated
from trajopt.errors import ArgumentError
from trajopt.norms import rms
from trajopt.stepping import Stepper

__all__ = ["Replay", "replay_drift"]

FloatArray = NDArray[np.float64]

_SLIDE = 0

# Errors of single steps [m, rad] may pile up with the square of their number: a few µm in 320.
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class Replay:
    """Drift of the unactuated degrees of freedom after each replay.

    Parameters
    ----------
    duration : float
        Length of a replay [s].
    starts : (S,) array
        Times at which the replays start [s].
    drift : (S,) array
        Distance between the root of the replay and that of the motion at its end [m]; the largest
        coordinate error [rad] where no unactuated slide exists.
    """

    duration: float
    starts: FloatArray
    drift: FloatArray

    @property
    def rms(self) -> float:
        """Root mean square of the drift [m]."""
        return rms(self.drift)

    @property
    def max(self) -> float:
        """Largest drift [m]."""
        return float(np.max(self.drift, initial=0.0))


def replay_drift(
    motion: Motion, duration: float = 0.25, *, substeps: int = 32, stride: int = 1
) -> Replay:
    """Simulate the base from every frame while the joints follow the trajectory.

    Parameters
    ----------
    motion : Motion
        N frames, or a `Solution`.
    duration : float, optional
        Length of a replay [s]; shortened where the motion itself is shorter.
    substeps : int, optional
        Steps of the simulation in the shortest time step of the motion.
    stride : int, optional
        Start at every stride-th frame.

    Returns
    -------
    Replay

    Raises
    ------
    ArgumentError
        If `duration` is not positive, or `substeps` or `stride` is below 1.
    SimulationError
        If a replay breaks down.

    Notes
    -----
    All replays run side by side as one batch. The joints are prescribed by the C² interpolant, the
    unactuated rows of the residual decide about the rest; joint torques are not used. The frames
    are left behind after the start, so errors of single frames add up to what a user would see.
    """
    if not duration > 0.0 or substeps < 1 or stride < 1:
        raise ArgumentError(
            "replay_drift needs duration > 0, substeps >= 1 and stride >= 1, got "
            f"{duration}, {substeps} and {stride}"
        )
    model, curve = motion.model, continuous(motion)
    rows = unactuated(model)
    knots = curve.times[1:]
    step = float(np.min(np.diff(knots))) / substeps
    duration = min(duration, float(knots[-1] - knots[0]))
    count = max(1, int(np.floor(duration / step + 1e-9)))
    starts = knots[knots + count * step <= knots[-1] + 0.5 * step][::stride]
    if not len(rows):
        return Replay(count * step, starts, np.zeros(len(starts)))

    stepper = Stepper(model, setting(motion, "linear_acceleration"), rows, _TOLERANCE)
    nothing = np.zeros((len(starts), model.ndof))
    older, newer = curve(starts - step), curve(starts)
    last = model.difference(curve(starts - 2.0 * step), older)
    for k in range(1, count + 1):
        move = model.difference(older, newer)
        guess = curve(starts + k * step)
        guess[:, rows] = model.integrate(newer, 2.0 * move - last)[:, rows]
        last = move
        older, newer = newer, stepper.advance(guess, newer, older, step, nothing)
    error = model.difference(curve(starts + count * step), newer)
    slides = _slides(motion, rows)
    if len(slides):
        drift = np.linalg.norm(error[:, slides], axis=1)
    else:
        drift = np.max(np.abs(error[:, rows]), axis=1)
    return Replay(count * step, starts, np.asarray(drift))


def _slides(motion: Motion, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Unactuated degrees of freedom that are slides: the position of a free base."""
    kinds = np.asarray(motion.model.core_arguments()["joint_type"])
    kind_of_dof = np.repeat(kinds, np.where(kinds == 2, 3, 1))
    return np.asarray(rows[kind_of_dof[rows] == _SLIDE])
