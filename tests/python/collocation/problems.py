"""Problems that several tests solve."""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt import collocation as col

METHODS = (
    "trapezoidal",
    "hermite_simpson",
    "hermite_simpson_compressed",
    "multiple_shooting",
    "chebyshev",
    "legendre",
)


def block(**changes: Any) -> col.Problem:
    """Kelly's block: one unit in one unit of time, least force squared; 12, u = 6 - 12 t."""
    stated: dict[str, Any] = {
        "dynamics": lambda t, x, u: [x[1], u[0]],
        "nx": 2,
        "nu": 1,
        "tf": 1.0,
        "objective": lambda t, x, u: u[0] ** 2,
        "x0_bounds": ([0, 0], [0, 0]),
        "xf_bounds": ([1, 0], [1, 0]),
    }
    return col.Problem(**{**stated, **changes})


def cart_pole_dynamics(t: Any, x: Any, u: Any) -> list[Any]:
    """Kelly (6.1), (6.2) with the parameters of table 3."""
    m1, m2, length, g = 1.0, 0.3, 0.5, 9.81
    s, c = np.sin(x[1]), np.cos(x[1])
    d = m1 + m2 * s**2
    cart = (length * m2 * s * x[3] ** 2 + u[0] + m2 * g * c * s) / d
    pole = -(length * m2 * c * s * x[3] ** 2 + u[0] * c + (m1 + m2) * g * s) / (length * d)
    return [x[2], x[3], cart, pole]


def cart_pole(**changes: Any) -> col.Problem:
    """Kelly's swing-up, section 6."""
    stated: dict[str, Any] = {
        "dynamics": cart_pole_dynamics,
        "nx": 4,
        "nu": 1,
        "tf": 2.0,
        "objective": lambda t, x, u: u[0] ** 2,
        "x_bounds": ([-2, None, None, None], [2, None, None, None]),
        "u_bounds": (-20, 20),
        "x0_bounds": (0, 0),
        "xf_bounds": ([1, np.pi, 0, 0], [1, np.pi, 0, 0]),
    }
    return col.Problem(**{**stated, **changes})
