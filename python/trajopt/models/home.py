"""The pose a model starts from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.models.coordinates import from_qpos

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from trajopt.model import Model

__all__ = ["home_pose"]

_FREE = 0


def home_pose(m: Any, model: Model, *, settle: bool) -> NDArray[np.float64]:
    """Home pose of a model.

    Parameters
    ----------
    m : mujoco.MjModel
    model : Model
        All but its home is used.
    settle : bool
        Without a keyframe, shift the roots vertically until the lowest contact point touches the
        ground; for URDF, whose root starts at the origin whatever lies below it.

    Returns
    -------
    ndarray, shape (D,)
        The keyframe ``home``, else the first keyframe, else the pose of the file with joints moved
        inside their limits.
    """
    names = [m.key(i).name for i in range(m.nkey)]
    if names:
        return from_qpos(m, m.key_qpos[names.index("home") if "home" in names else 0])
    x = np.clip(from_qpos(m, m.qpos0), model.lower, model.upper)
    heights = [int(m.jnt_dofadr[j]) + 2 for j in range(m.njnt) if m.jnt_type[j] == _FREE]
    if settle and heights and len(model.point_radius):
        floor = 0.0 if model.ground is None else model.ground[3]
        x[heights] += floor - model.lowest_point(x)
    return np.asarray(x)
