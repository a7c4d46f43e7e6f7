"""Physics between the frames: inverse dynamics of the C² interpolant, and the work of the error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trajopt.audit.motion import Motion, continuous, frame_times, setting, torque_rows, unactuated
from trajopt.interpolation import Interpolant
from trajopt.stepping import Stepper

__all__ = ["POINTS_PER_FRAME", "fine_residual", "fine_times", "fine_violation", "residual_work"]

FloatArray = NDArray[np.float64]

POINTS_PER_FRAME = 4

# The stencil's step as a share of the frame's. The points lie at 1/8, 3/8, 5/8, 7/8 of a frame, so
# that a stencil of twice this width stays inside one cubic. For dt = 0.025 s rounding is about
# 1e-16 · 10 m / h² = 1e-8 m/s², and the extrapolated error (ω h)⁴ below 1e-7 up to ω = 50 rad/s.
_STENCIL = 1.0 / 64.0


def fine_times(motion: Motion) -> FloatArray:
    """Return the (4N,) times between frames 0 to N at which physics is checked [s]."""
    knots = frame_times(motion)[1:]
    place = (np.arange(POINTS_PER_FRAME) + 0.5) / POINTS_PER_FRAME
    return np.asarray((knots[:-1, None] + np.diff(knots)[:, None] * place).ravel())


def fine_residual(motion: Motion, interpolant: Interpolant | None = None) -> FloatArray:
    """Return the force that the interpolated motion lacks between its frames.

    Parameters
    ----------
    motion : Motion
        N frames of a character with D degrees of freedom.
    interpolant : Interpolant, optional
        That of the motion, where it is already known.

    Returns
    -------
    (4N, D) array
        M(q)q̈ + C(q, q̇)q̇ + g(q) − contact forces − internal forces [N, N·m]: on the actuated
        rows the joint torques, on the others the error. Rows of ball joints are torques in the
        axes before the joint.

    Notes
    -----
    Inverse dynamics by the Störmer–Verlet residual of three points of the interpolant a tiny
    step h apart, extrapolated from h and 2h to fourth order. The frames' own time scheme takes no
    part in it, so neither do its damping nor its lag.
    """
    curve = continuous(motion) if interpolant is None else interpolant
    t = fine_times(motion)
    steps = np.diff(curve.times[1:])
    h = _STENCIL * float(np.min(steps))
    stepper = Stepper(motion.model, setting(motion, "verlet"))
    x = curve(t + h * np.arange(-2.0, 3.0)[:, None])
    middle = x[2]
    narrow = stepper.residual(x[3], middle, x[1], h)
    wide = stepper.residual(x[4], middle, x[0], 2.0 * h)
    return torque_rows(motion.model, middle, (4.0 * narrow - wide) / 3.0)


def fine_violation(motion: Motion) -> FloatArray:
    """Return the largest unactuated residual between the frames, four points a frame.

    Parameters
    ----------
    motion : Motion
        N frames, or a `Solution`.

    Returns
    -------
    (4N,) array
        Largest absolute value over the unactuated rows [N, N·m]; zero where every degree of
        freedom is actuated.

    Notes
    -----
    The number that remains when the frames obey physics to rounding: Kelly's error analysis
    (2017, §5.3) applied to the equations of motion.
    """
    rows = unactuated(motion.model)
    residual = fine_residual(motion)[:, rows]
    return np.asarray(np.max(np.abs(residual), axis=1, initial=0.0))


def residual_work(motion: Motion) -> tuple[float, float]:
    """Return the work that the missing forces do on the motion.

    Parameters
    ----------
    motion : Motion
        N frames, or a `Solution`.

    Returns
    -------
    gained, lost : float
        Integrals of the positive and of the negative power of the unactuated residual [J]:
        energy that the motion gets from nowhere, and that vanishes.
    """
    curve = continuous(motion)
    rows = unactuated(motion.model)
    residual = fine_residual(motion, curve)[:, rows]
    speed = curve.velocity(fine_times(motion))[:, rows]
    power = np.sum(residual * speed, axis=1)
    width = np.repeat(np.diff(curve.times[1:]), POINTS_PER_FRAME) / POINTS_PER_FRAME
    work = power * width
    return float(np.sum(np.maximum(work, 0.0))), float(np.sum(np.minimum(work, 0.0)))
