"""Quasi-static settling: let a pose sink into the ground until it stands by itself."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ModelWarning

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.world import World

__all__ = ["ground_gap", "settle", "warn_of_gap"]

FloatArray = NDArray[np.float64]

MAX_STEPS = 300
TOLERANCE = 1e-11  # body weights
MAX_MOVE = 0.1  # lengths or radians a step


def ground_gap(model: Model, world: World, x: FloatArray) -> float | None:
    """Return the height of the lowest contact sphere above the ground [m]; None without either.

    Parameters
    ----------
    model : Model
    world : World
    x : (D,) array
        Pose [m, rad].
    """
    if not world.obstacles or len(model.point_radius) == 0:
        return None
    plane = world.obstacles[0]
    points = model.contact_positions(x)
    return float(np.min(points @ np.array(plane.normal) - model.point_radius) - plane.offset)


def warn_of_gap(model: Model, gap: float) -> None:
    """Warn when a start pose hangs in the air or is buried by more than 5 % of the length."""
    if gap > 0.05 * model.length:
        where = f"{gap:.3g} m above"
    elif gap < -0.1 * model.length:
        where = f"{-gap:.3g} m inside"
    else:
        return
    warnings.warn(
        f"initial pose: the lowest contact point lies {where} the ground; "
        "the pose is moved until it stands",
        ModelWarning,
        stacklevel=4,
    )


def settle(core: Any, physics: Any, free: NDArray[np.intp], x: FloatArray) -> tuple[FloatArray, float]:
    """Move the unactuated coordinates until the static residual vanishes.

    Levenberg-Marquardt on the rows `free`, joints held: position in the plane and heading are null
    directions, so Newton alone would not do.

    Parameters
    ----------
    core : _core.Model
    physics : _core.Physics
    free : array of int
        Unactuated degrees of freedom.
    x : (D,) array
        Pose in the core's units, touching the ground.

    Returns
    -------
    x : (D,) array
        Settled pose.
    residual : float
        Largest entry of the static residual that is left, body weights.
    """
    x = np.array(x)
    step_time = np.ones(1)

    def evaluate(pose: FloatArray) -> tuple[FloatArray, FloatArray]:
        row = pose[None]
        force, *jacobians = core.jacobians(row, row, row, step_time, physics)
        return force[0, free], sum(jacobians)[0][np.ix_(free, free)]

    residual, jacobian = evaluate(x)
    damping = 1e-3
    for _ in range(MAX_STEPS):
        if np.max(np.abs(residual), initial=0.0) < TOLERANCE:
            break
        normal = jacobian.T @ jacobian + damping * np.eye(len(free))
        step = np.linalg.solve(normal, -jacobian.T @ residual)
        step *= min(1.0, MAX_MOVE / max(np.max(np.abs(step)), 1e-300))
        trial = x.copy()
        trial[free] += step
        trial_residual, trial_jacobian = evaluate(trial)
        if np.linalg.norm(trial_residual) < np.linalg.norm(residual):
            x, residual, jacobian = trial, trial_residual, trial_jacobian
            damping = max(damping / 5, 1e-14)
        else:
            damping *= 4
            if damping > 1e8:
                break
    return x, float(np.max(np.abs(residual), initial=0.0))
