"""Conversion between trajopt's coordinates and MuJoCo's ``qpos`` and ``qvel``.

Dofs stand in the same order.  The differences: MuJoCo stores orientations as quaternions where
trajopt has rotation vectors, and measures the angular velocity of free and ball joints in the frame
after the rotation where trajopt has time derivatives of the rotation vector.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import rotations

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

__all__ = ["from_qpos", "to_qpos", "velocity_map"]

_FREE, _BALL = 0, 1


def _joints(m: Any) -> Iterator[tuple[int, int, int]]:
    """Yield type, address in qpos and address in qvel of every joint."""
    for j in range(m.njnt):
        yield int(m.jnt_type[j]), int(m.jnt_qposadr[j]), int(m.jnt_dofadr[j])


def to_qpos(m: Any, x: ArrayLike) -> NDArray[np.float64]:
    """MuJoCo's ``qpos`` for a configuration.

    Parameters
    ----------
    m : mujoco.MjModel
    x : array_like, shape (D,)

    Returns
    -------
    ndarray, shape (m.nq,)

    Examples
    --------
    >>> import mujoco
    >>> m = mujoco.MjModel.from_xml_string(
    ...     "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    ... )
    >>> to_qpos(m, [1.0, 2.0, 3.0, 0.0, 0.0, 0.0]).tolist()
    [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]
    """
    x = np.asarray(x, dtype=np.float64)
    q = np.empty(m.nq)
    for kind, a, d in _joints(m):
        if kind == _FREE:
            q[a : a + 3] = x[d : d + 3]
            q[a + 3 : a + 7] = rotations.to_quaternion(x[d + 3 : d + 6])
        elif kind == _BALL:
            q[a : a + 4] = rotations.to_quaternion(x[d : d + 3])
        else:
            q[a] = x[d]
    return q


def from_qpos(m: Any, qpos: ArrayLike) -> NDArray[np.float64]:
    """Inverse of :func:`to_qpos`; rotation vectors come out with a length of at most π.

    Parameters
    ----------
    m : mujoco.MjModel
    qpos : array_like, shape (m.nq,)

    Returns
    -------
    ndarray, shape (D,)
    """
    q = np.asarray(qpos, dtype=np.float64)
    x = np.empty(m.nv)
    for kind, a, d in _joints(m):
        if kind == _FREE:
            x[d : d + 3] = q[a : a + 3]
            x[d + 3 : d + 6] = rotations.from_quaternion(q[a + 3 : a + 7])
        elif kind == _BALL:
            x[d : d + 3] = rotations.from_quaternion(q[a : a + 4])
        else:
            x[d] = q[a]
    return x


def velocity_map(m: Any, x: ArrayLike) -> NDArray[np.float64]:
    """Matrix V with ``qvel = V dx/dt`` at a configuration.

    Generalized forces transform with the transpose: f_trajopt = Vᵀ f_mujoco.

    Parameters
    ----------
    m : mujoco.MjModel
    x : array_like, shape (D,)

    Returns
    -------
    ndarray, shape (D, D)
    """
    x = np.asarray(x, dtype=np.float64)
    v = np.eye(m.nv)
    for kind, _, d in _joints(m):
        if kind in (_FREE, _BALL):
            d += 3 if kind == _FREE else 0
            # Angular velocity in the frame after the rotation: Rᵀ J_l(r) = J_l(-r).
            v[d : d + 3, d : d + 3] = rotations.left_jacobian(-x[d : d + 3])
    return v
