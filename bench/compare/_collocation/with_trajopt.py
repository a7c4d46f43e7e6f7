"""trajopt: Hermite–Simpson collocation by IPOPT, or by the interior point method of the core."""

# ruff: noqa: E402, ARG001, ARG005
from __future__ import annotations

from typing import Any

import casadi
from five_link_biped import biped as biped_problem

import trajopt

SOLVER = "native"
# user code: begin
import numpy as np

from trajopt import collocation as col


def dynamics(t: Any, x: Any, u: Any) -> Any:
    s, c = np.sin(x[1]), np.cos(x[1])
    pull, d = 0.15 * s * x[3] ** 2 + u[0], 1.0 + 0.3 * s**2
    return [x[2], x[3], (pull + 2.943 * c * s) / d, -(pull * c + 12.753 * s) / (0.5 * d)]


def cart_pole(segments: int) -> Any:
    problem = col.Problem(
        dynamics=dynamics, nx=4, nu=1, tf=2.0,
        objective=lambda t, x, u: u[0] ** 2,
        u_bounds=(-20, 20),
        x_bounds=([-2, None, None, None], [2, None, None, None]),
        x0_bounds=(0, 0), xf_bounds=([1, np.pi, 0, 0], [1, np.pi, 0, 0]),
    )  # fmt: skip
    return problem, segments


# user code: end


def biped(segments: int) -> Any:
    return biped_problem(), segments


def solve(program: Any) -> dict[str, Any]:
    found = col.solve(program[0], segments=program[1], solver=SOLVER, tolerance=1e-8)
    return {
        "seconds": found.seconds,
        "objective": found.objective,
        "iterations": found.iterations,
        "status": str(found.status),
    }


def versions() -> dict[str, str]:
    return {"trajopt": trajopt.__version__, "casadi": casadi.__version__}
