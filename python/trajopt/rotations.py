r"""Rotation vectors, rotation matrices and quaternions, vectorised over leading axes.

A rotation vector :math:`r` stands for the rotation by the angle :math:`\theta = |r|` about the axis
:math:`r/\theta`, that is :math:`R = \exp([r]_\times)`.  Quaternions are ordered ``(w, x, y, z)`` as
in MuJoCo.  All angles are in radians.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "exp",
    "from_quaternion",
    "hat",
    "left_jacobian",
    "left_jacobian_inverse",
    "log",
    "matrix_from_quaternion",
    "nearest",
    "to_quaternion",
    "unwrap",
]

# Below this squared angle the closed forms lose digits and their series are exact in double.
_SMALL = 1e-4

_BLOCK = 64  # frames that are unwrapped at once


def hat(r: ArrayLike) -> NDArray[np.float64]:
    """Cross-product matrix: ``hat(r) @ p == np.cross(r, p)``.

    Parameters
    ----------
    r : array_like, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> hat([1.0, 2.0, 3.0]) @ [1.0, 0.0, 0.0]
    array([ 0.,  3., -2.])
    """
    r = np.asarray(r, dtype=np.float64)
    out = np.zeros((*r.shape, 3))
    out[..., 2, 1] = r[..., 0]
    out[..., 0, 2] = r[..., 1]
    out[..., 1, 0] = r[..., 2]
    return out - np.swapaxes(out, -1, -2)


def _coefficients(t: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return sin θ/θ, (1 − cos θ)/θ² and (θ − sin θ)/θ³ for t = θ²."""
    safe = np.where(t < _SMALL, 1.0, t)
    theta = np.sqrt(safe)
    a = np.where(t < _SMALL, 1 - t / 6 * (1 - t / 20 * (1 - t / 42)), np.sin(theta) / theta)
    # 1 - cos(theta) = 2 sin^2(theta/2) keeps its digits where the cosine is close to one.
    b = np.where(
        t < _SMALL, 0.5 - t / 24 * (1 - t / 30 * (1 - t / 56)), 2 * np.sin(theta / 2) ** 2 / safe
    )
    c = np.where(t < _SMALL, 1 / 6 - t / 120 * (1 - t / 42 * (1 - t / 72)), (1 - a) / safe)
    return a, b, c


def exp(r: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrix of a rotation vector.

    Parameters
    ----------
    r : array_like, shape (..., 3)
        Rotation vector [rad].

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> exp([0.0, 0.0, np.pi / 2]).round(12) @ [1.0, 0.0, 0.0]
    array([0., 1., 0.])
    """
    r = np.asarray(r, dtype=np.float64)
    a, b, _ = _coefficients(np.sum(r * r, axis=-1)[..., None, None])
    k = hat(r)
    return np.asarray(np.eye(3) + a * k + b * (k @ k))


def log(rotation: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector of a rotation matrix, of length at most π.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)

    Returns
    -------
    ndarray, shape (..., 3)

    Examples
    --------
    >>> log(exp([0.3, -0.2, 0.1])).round(12)
    array([ 0.3, -0.2,  0.1])
    """
    rotation = np.asarray(rotation, dtype=np.float64)
    flat = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat, dtype=np.float64).reshape(rotation.shape[:-1])


def from_quaternion(q: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector of a quaternion, of length at most π.

    Parameters
    ----------
    q : array_like, shape (..., 4)
        Quaternion (w, x, y, z), of any positive length.

    Returns
    -------
    ndarray, shape (..., 3)

    Examples
    --------
    >>> from_quaternion([0.0, 1.0, 0.0, 0.0]).round(12)
    array([3.14159265, 0.        , 0.        ])
    """
    q = np.asarray(q, dtype=np.float64)
    flat = Rotation.from_quat(np.roll(q.reshape(-1, 4), -1, axis=-1)).as_rotvec()
    return np.asarray(flat, dtype=np.float64).reshape(*q.shape[:-1], 3)


def to_quaternion(r: ArrayLike) -> NDArray[np.float64]:
    """Unit quaternion (w, x, y, z) of a rotation vector.

    Parameters
    ----------
    r : array_like, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 4)

    Examples
    --------
    >>> to_quaternion([np.pi, 0.0, 0.0]).round(12) + 0.0
    array([0., 1., 0., 0.])
    """
    r = np.asarray(r, dtype=np.float64)
    half_a, _, _ = _coefficients(np.sum(r * r, axis=-1) / 4)
    w = np.cos(np.linalg.norm(r, axis=-1) / 2)
    return np.concatenate([w[..., None], half_a[..., None] * r / 2], axis=-1)


def matrix_from_quaternion(q: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrix of a quaternion (w, x, y, z), of any positive length.

    Parameters
    ----------
    q : array_like, shape (..., 4)

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> matrix_from_quaternion([1.0, 0.0, 0.0, 0.0]).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    q = np.asarray(q, dtype=np.float64)
    flat = Rotation.from_quat(np.roll(q.reshape(-1, 4), -1, axis=-1)).as_matrix()
    return np.asarray(flat, dtype=np.float64).reshape(*q.shape[:-1], 3, 3)


def left_jacobian(r: ArrayLike) -> NDArray[np.float64]:
    """Matrix J with world angular velocity ω = J(r) dr/dt.

    Parameters
    ----------
    r : array_like, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Singular where the angle is a multiple of 2π other than 0.

    Examples
    --------
    >>> left_jacobian(np.zeros(3)).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    r = np.asarray(r, dtype=np.float64)
    _, b, c = _coefficients(np.sum(r * r, axis=-1)[..., None, None])
    k = hat(r)
    return np.asarray(np.eye(3) + b * k + c * (k @ k))


def left_jacobian_inverse(r: ArrayLike) -> NDArray[np.float64]:
    """Inverse of :func:`left_jacobian`: dr/dt = J⁻¹(r) ω.

    Parameters
    ----------
    r : array_like, shape (..., 3)
        Rotation vector [rad]; the inverse does not exist at the angles 2π, 4π, ...

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> r = np.array([0.4, -1.0, 0.2])
    >>> np.allclose(left_jacobian_inverse(r) @ left_jacobian(r), np.eye(3))
    True
    """
    r = np.asarray(r, dtype=np.float64)
    t = np.sum(r * r, axis=-1)[..., None, None]
    a, b, _ = _coefficients(t)
    safe = np.where(t < _SMALL, 1.0, t)
    # 1/t - a/(2 b t) = (1 - (theta/2) cot(theta/2)) / theta^2
    d = np.where(t < _SMALL, 1 / 12 + t / 720 * (1 + t / 42), (1 - a / (2 * b)) / safe)
    k = hat(r)
    return np.asarray(np.eye(3) - 0.5 * k + d * (k @ k))


def nearest(r: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Rotation vector of the same rotation that lies nearest to a reference.

    Adding 2π to the angle leaves the rotation as it is.  Choosing the representative nearest to
    the previous frame makes a trajectory of rotation vectors continuous through turns beyond π.

    Parameters
    ----------
    r : array_like, shape (..., 3)
        Rotation vector [rad].
    reference : array_like, shape (..., 3)
        Rotation vector to be close to [rad].

    Returns
    -------
    ndarray, shape (..., 3)

    Examples
    --------
    >>> nearest([0.0, 0.0, -3.0], [0.0, 0.0, 3.1]).round(6)
    array([0.      , 0.      , 3.283185])
    """
    r, reference = np.broadcast_arrays(
        np.asarray(r, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    )
    theta = np.linalg.norm(r, axis=-1, keepdims=True)
    length = np.linalg.norm(reference, axis=-1, keepdims=True)
    # The identity has no axis of its own: any full turn will do, so it turns about the reference's.
    fallback = reference / np.where(length > 0, length, 1.0)
    axis = np.where(theta > 1e-12, r / np.where(theta > 1e-12, theta, 1.0), fallback)
    turns = np.round((np.sum(axis * reference, axis=-1, keepdims=True) - theta) / (2 * np.pi))
    # Adding a multiple of the axis, not rescaling: unchanged bits where no turn is added.
    return np.asarray(r + 2 * np.pi * turns * axis)


def unwrap(r: ArrayLike) -> NDArray[np.float64]:
    """Rotation vectors of the same rotations, each nearest to the one before it.

    Parameters
    ----------
    r : array_like, shape (n, 3)
        Rotation vectors of a motion [rad], n frames.

    Returns
    -------
    ndarray, shape (n, 3)
        Continuous through turns beyond π.

    Examples
    --------
    >>> unwrap([[0.0, 0.0, 3.0], [0.0, 0.0, -3.1]]).round(6)
    array([[0.      , 0.      , 3.      ],
           [0.      , 0.      , 3.183185]])
    """
    out = np.array(r, dtype=np.float64)
    for begin in range(1, len(out), _BLOCK):
        block, before = out[begin : begin + _BLOCK], out[begin - 1 : begin - 1 + _BLOCK]
        # Where no frame turns away from its neighbour, none has to wait for the one before it.
        turned = nearest(block, before[: len(block)])
        if np.array_equal(turned, block):
            continue
        for i in range(begin, begin + len(block)):
            out[i] = nearest(out[i], out[i - 1])
    return out
