"""What an audit needs to know of a motion, and the C² interpolant it works on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.interpolation import Interpolant
from trajopt.kinematics import ball_slices
from trajopt.rotations import left_jacobian_inverse
from trajopt.stepping import Setting

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Motion", "continuous", "frame_times", "setting", "torque_rows", "unactuated"]

FloatArray = NDArray[np.float64]


class Motion(Protocol):
    """Anything that can be audited: a `Solution`, or a stand-in with the same attributes.

    Attributes
    ----------
    model : Model
        The character, D degrees of freedom.
    x : (N, D) array
        Frames 1 to N [m, rad].
    times : (N,) array
        Their times [s].
    dt : float or (N,) array
        Time steps that lead to the frames [s].
    initial : (2, D) array
        Frames 0 and -1, which the first equations of motion need [m, rad].
    world, contact : World, Contact or None
        What the character touches and how, SI units.
    integrator : str
        Time scheme that the frames obey.
    frame_violation : (N,) array
        Unactuated residual of every frame [N, N·m].
    """

    model: Model
    x: FloatArray
    times: FloatArray
    dt: Any
    initial: FloatArray
    world: Any
    contact: Any
    integrator: str
    frame_violation: FloatArray


def continuous(motion: Motion) -> Interpolant:
    """Return the C² interpolant of frames -1, 0, 1, ..., N.

    Raises
    ------
    ArgumentError
        If the motion does not know its initial frames.
    """
    initial = np.asarray(motion.initial)
    if initial.shape != (2, motion.model.ndof):
        raise ArgumentError(
            f"initial must hold frames 0 and -1 with shape {(2, motion.model.ndof)}, "
            f"got {initial.shape}"
        )
    frames = np.concatenate([initial[::-1], motion.x])
    return Interpolant(motion.model, frame_times(motion), frames)


def frame_times(motion: Motion) -> FloatArray:
    """Return the times of frames -1, 0, 1, ..., N [s]."""
    first = float(np.ravel(motion.dt)[0])
    before = motion.times[0] - first * np.array([2.0, 1.0])
    return np.concatenate([before, motion.times])


def setting(motion: Motion, integrator: str) -> Setting:
    """Return world and contact of the motion with another time scheme."""
    return Setting(motion.world, motion.contact, integrator)


def unactuated(model: Model) -> NDArray[np.intp]:
    """Return the degrees of freedom that no motor drives."""
    return np.flatnonzero(~np.asarray(model.actuated, dtype=bool))


def torque_rows(model: Model, x: FloatArray, force: FloatArray) -> FloatArray:
    """Turn forces along rotation-vector coordinates into torques.

    Along the coordinates of a ball joint the force is J_l(r)ᵀ τ, which depends on the chart; τ in
    the axes before the joint (world axes for a free base) does not, and belongs to the tangent
    velocity: power = τ · ω.

    Parameters
    ----------
    model : Model
    x : (M, D) array
        Coordinates [m, rad].
    force : (M, D) array
        Generalized force [N, N·m].

    Returns
    -------
    (M, D) array
        The same with torques [N·m] in the rows of ball joints.
    """
    out = np.array(force)
    for where in ball_slices(model):
        inverse = left_jacobian_inverse(x[:, where])
        out[:, where] = np.einsum("mji,mj->mi", inverse, force[:, where])
    return out
