"""Pseudo-inertia: mass, centre of mass and inertia of a body in one symmetric 4×4 matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import rotations

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["pseudo_inertia"]


def pseudo_inertia(m: Any, body: int) -> NDArray[np.float64]:
    """∫ρ [p;1][p;1]ᵀ dp of a body of a compiled model, in the body's frame.

    Its 3×3 block is the second moment about the origin, Σ + m c cᵀ with Σ = ½ tr(I) 1 − I the one
    about the centre of mass c; its last column holds m c and m.

    Parameters
    ----------
    m : mujoco.MjModel
    body : int

    Returns
    -------
    ndarray, shape (4, 4)
        In kg m², kg m and kg.
    """
    mass, c = float(m.body_mass[body]), m.body_ipos[body]
    principal = m.body_inertia[body]
    # Rounding in the file may leave a thin body with a tiny negative second moment.
    second = np.maximum(0.5 * principal.sum() - principal, 0.0)
    axes = rotations.matrix_from_quaternion(m.body_iquat[body])
    p = np.append(c, 1.0)
    out = mass * np.outer(p, p)
    out[:3, :3] += (axes * second) @ axes.T
    return np.asarray(0.5 * (out + out.T))
