"""Where the bodies of a model are: batched functions behind the methods of `trajopt.Model`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from trajopt import rotations
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.rigid import compose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from trajopt.model import Model

    Floats = NDArray[np.float64]

__all__ = [
    "BALL",
    "HINGE",
    "SLIDE",
    "ball_slices",
    "check_configuration",
    "difference",
    "integrate",
    "joint_transforms",
]

# Types of joints, as the compiled core numbers them.
SLIDE, HINGE, BALL = 0, 1, 2


def ball_slices(model: Model) -> list[slice]:
    """Return where the rotation vectors of the ball joints stand in x, from the root outward."""
    return [slice(dof, dof + 3) for dof in model.joint_dof[model.joint_type == BALL]]


def check_configuration(model: Model, argument: str, value: ArrayLike) -> Floats:
    """Return `value` as an array (..., D) of finite numbers.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Names the argument, and the degree of freedom that is not finite.
    """
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(f"{argument} must be an array of numbers: {error}") from error
    if array.ndim == 0 or array.shape[-1] != model.ndof:
        raise ArgumentError(
            f"{argument} has shape {array.shape}; model '{model.name}' needs (..., {model.ndof})"
        )
    if not np.isfinite(array).all():
        dof = int(np.argwhere(~np.isfinite(array))[0][-1])
        raise ArgumentError(f"{argument} is not finite at dof '{model.dof_names[dof]}'")
    return array


def joint_transforms(model: Model, x: ArrayLike) -> Floats:
    """See :meth:`trajopt.Model.joint_transforms`."""
    x = check_configuration(model, "x", x)
    motion = _joint_motions(model, x)
    out = np.empty_like(motion)
    for j, parent in enumerate(model.joint_parent):
        frame = model.joint_offset[j]
        if parent >= 0:
            frame = compose(out[..., parent, :, :], frame)
        out[..., j, :, :] = compose(frame, motion[..., j, :, :])
    return out


def _joint_motions(model: Model, x: Floats) -> Floats:
    """Return the transforms (..., J, 3, 4) by which the joints move, of all joints at once."""
    kind, dof = model.joint_type, model.joint_dof
    along = x[..., dof, None] * model.joint_axis
    for j in np.flatnonzero(kind == BALL):
        along[..., j, :] = x[..., dof[j] : dof[j] + 3]
    turn = np.where(kind[:, None] == SLIDE, 0.0, along)
    return np.concatenate([rotations.exp(turn), (along - turn)[..., None]], axis=-1)


def integrate(model: Model, x: ArrayLike, delta: ArrayLike) -> Floats:
    """See :meth:`trajopt.Model.integrate`."""
    x, delta = check_configuration(model, "x", x), check_configuration(model, "delta", delta)
    out = np.asarray(x + delta)
    for ball in ball_slices(model):
        turned = rotations.exp(delta[..., ball]) @ rotations.exp(x[..., ball])
        out[..., ball] = rotations.nearest(rotations.log(turned), x[..., ball])
    return out


def difference(model: Model, a: ArrayLike, b: ArrayLike) -> Floats:
    """See :meth:`trajopt.Model.difference`."""
    a, b = check_configuration(model, "a", a), check_configuration(model, "b", b)
    out = np.asarray(b - a)
    for ball in ball_slices(model):
        before = np.swapaxes(rotations.exp(a[..., ball]), -1, -2)
        out[..., ball] = rotations.log(rotations.exp(b[..., ball]) @ before)
    return out
