"""Quasi-static settling: let a pose sink into the ground until it stands by itself."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ModelWarning
from trajopt.model import BALL, SLIDE

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.world import World

__all__ = ["free_bases", "ground_gap", "lower", "settle", "warn_of_gap", "warn_of_unrest"]

FloatArray = NDArray[np.float64]

MAX_STEPS = 300
TOLERANCE = 1e-11  # body weights
MAX_MOVE = 0.1  # lengths or radians a step


UNREST = 1e-6  # body weights; more than that left is worth a word


def free_bases(model: Model) -> dict[int, NDArray[np.intp]]:
    """Return the vertical coordinate of every unactuated free body, and its contact points.

    Parameters
    ----------
    model : Model

    Returns
    -------
    dict of int to (n,) array
        Index of the third slide, and the contact points on the body and all that hangs on it.

    Examples
    --------
    >>> import trajopt
    >>> list(free_bases(trajopt.load_model("chain")))
    [2]
    """
    kinds, parents = list(model.joint_type), model.joint_parent
    root = np.arange(len(kinds))
    for j, parent in enumerate(parents):
        if parent >= 0:
            root[j] = root[parent]
    out = {}
    for j in map(int, np.flatnonzero(parents < 0)):
        first = int(model.joint_dof[j])
        free = not model.actuated[first : first + 6].any()
        if kinds[j : j + 4] == [SLIDE, SLIDE, SLIDE, BALL] and free:
            out[first + 2] = np.flatnonzero(root[model.point_joint] == j)
    return out


def ground_gap(
    model: Model, world: World, x: FloatArray, points: NDArray[np.intp] | None = None
) -> float | None:
    """Return the height of the lowest contact sphere above the ground [m]; None without either.

    Parameters
    ----------
    model : Model
    world : World
    x : (D,) array
        Pose [m, rad].
    points : array of int, optional
        Contact points that count; all by default.
    """
    chosen = np.arange(model.npoints) if points is None else points
    if not world.obstacles or len(chosen) == 0:
        return None
    plane = world.obstacles[0]
    height = model.contact_positions(x)[chosen] @ np.array(plane.normal)
    return float(np.min(height - model.point_radius[chosen]) - plane.offset)


def lower(model: Model, world: World, x: FloatArray, sink: float) -> FloatArray:
    """Move every free body up or down until its lowest point is `sink` [m] inside the ground."""
    out = np.array(x)
    for vertical, points in free_bases(model).items():
        gap = ground_gap(model, world, x, points)
        if gap is not None:
            out[vertical] -= gap + sink
    return out


def warn_of_unrest(residual: float) -> None:
    """Warn when settling ended with forces that do not balance [body weights]."""
    if residual > UNREST:
        warnings.warn(
            "initial pose: does not come to rest on the ground; the motion starts with "
            f"{residual:.2g} body weights unbalanced",
            ModelWarning,
            stacklevel=4,
        )


def warn_of_gap(model: Model, gap: float, movable: bool = True) -> None:
    """Warn when a start pose hangs in the air (5 % of the length) or is buried (10 %)."""
    if gap > 0.05 * model.length and movable:
        where = f"{gap:.3g} m above"
    elif gap < -0.1 * model.length:
        where = f"{-gap:.3g} m inside"
    else:
        return
    warnings.warn(
        f"initial pose: the lowest contact point lies {where} the ground; "
        + ("the pose is moved until it stands" if movable else "its base is fixed, it stays there"),
        ModelWarning,
        stacklevel=4,
    )


def settle(
    core: Any, physics: Any, free: NDArray[np.intp], x: FloatArray
) -> tuple[FloatArray, float]:
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
