"""Rigid transforms as 3×4 matrices [R t], vectorised over leading axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["apply", "compose", "rigid", "transform_pseudo_inertia"]


def rigid(
    position: ArrayLike = (0.0, 0.0, 0.0), rotation: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Transform made of a translation and a rotation.

    Parameters
    ----------
    position : array_like, shape (3,)
    rotation : array_like, shape (3, 3), optional
        Default: identity.

    Returns
    -------
    ndarray, shape (3, 4)
    """
    r = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
    t = np.asarray(position, dtype=np.float64).reshape(3, 1)
    return np.concatenate([r, t], axis=1)


def compose(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Product a · b of transforms.

    Parameters
    ----------
    a, b : ndarray, shape (..., 3, 4)

    Returns
    -------
    ndarray, shape (..., 3, 4)

    Examples
    --------
    >>> compose(rigid([1, 2, 3]), rigid([0, 0, 1]))[:, 3]
    array([1., 2., 4.])
    """
    product = a[..., :3] @ b
    product[..., 3] += a[..., 3]
    return np.asarray(product)


def apply(transform: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Image of points under transforms.

    Parameters
    ----------
    transform : ndarray, shape (..., 3, 4)
    point : ndarray, shape (..., 3)

    Returns
    -------
    ndarray, shape (..., 3)
    """
    return np.asarray((transform[..., :3] @ point[..., None])[..., 0] + transform[..., 3])


def transform_pseudo_inertia(
    transform: NDArray[np.float64], inertia: NDArray[np.float64]
) -> NDArray[np.float64]:
    """T M Tᵀ: a pseudo-inertia seen from the frame that the transform maps to.

    Parameters
    ----------
    transform : ndarray, shape (..., 3, 4)
    inertia : ndarray, shape (..., 4, 4)

    Returns
    -------
    ndarray, shape (..., 4, 4)
    """
    t = np.zeros((*transform.shape[:-2], 4, 4))
    t[..., :3, :] = transform
    t[..., 3, 3] = 1.0
    return np.asarray(t @ inertia @ np.swapaxes(t, -1, -2))
