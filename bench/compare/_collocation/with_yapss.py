"""yapss: three Legendre–Gauss–Lobatto points a segment, its form of Hermite–Simpson collocation."""

# ruff: noqa: I001
from __future__ import annotations

import time
from importlib.metadata import version
from typing import Any

import casadi
import five_link_biped as walker
from yapss._private import solver as inner

# user code: begin
import numpy as np
from yapss import Problem
from yapss.math import cos, sin


def cart_pole(segments: int) -> Any:
    p = Problem(name="cart-pole", nx=[4], nu=[1], nq=[1])

    def objective(a: Any) -> None:
        a.objective = a.phase[0].integral[0]

    def continuous(a: Any) -> None:
        _, q, v, w = a.phase[0].state
        (u,) = a.phase[0].control
        s, c = sin(q), cos(q)
        pull, d = 0.15 * s * w**2 + u, 1.0 + 0.3 * s**2
        a.phase[0].dynamics[:] = (
            v, w, (pull + 2.943 * c * s) / d, -(pull * c + 12.753 * s) / (0.5 * d),
        )  # fmt: skip
        a.phase[0].integrand[:] = (u**2,)

    p.functions.objective, p.functions.continuous = objective, continuous
    b, g = p.bounds.phase[0], p.guess.phase[0]
    b.initial_time.lower = b.initial_time.upper = 0.0
    b.final_time.lower = b.final_time.upper = 2.0
    b.initial_state.lower[:] = b.initial_state.upper[:] = 0.0
    b.final_state.lower[:] = b.final_state.upper[:] = [1, np.pi, 0, 0]
    b.state.lower[0], b.state.upper[0] = -2, 2
    b.control.lower[:], b.control.upper[:] = -20, 20
    g.time, g.state, g.control = [0, 2], [[0, 1], [0, np.pi], [0, 0], [0, 0]], [[0, 0]]
    return options(p, segments)


def options(p: Any, segments: int) -> Any:
    p.spectral_method = "lgl"
    p.mesh.phase[0].collocation_points = (3,) * segments
    p.mesh.phase[0].fraction = (1 / segments,) * segments
    p.ipopt_options.tol = 1e-8
    p.ipopt_options.print_level, p.ipopt_options.sb = 0, "yes"
    return p


# user code: end


def biped(segments: int) -> Any:
    p = Problem(name="biped", nx=[10], nu=[5], nq=[1], nd=14)

    def objective(a: Any) -> None:
        a.objective = a.phase[0].integral[0]

    def continuous(a: Any) -> None:
        x, u = list(a.phase[0].state), list(a.phase[0].control)
        a.phase[0].dynamics[:] = walker.dynamics(0.0, x, u)
        a.phase[0].integrand[:] = (sum(each**2 for each in u),)

    def discrete(a: Any) -> None:
        x0, xf = list(a.phase[0].initial_state), list(a.phase[0].final_state)
        a.discrete[:] = walker.boundary(0.0, 0.0, x0, xf)

    f = p.functions
    f.objective, f.continuous, f.discrete = objective, continuous, discrete
    b, g = p.bounds.phase[0], p.guess.phase[0]
    b.initial_time.lower = b.initial_time.upper = 0.0
    b.final_time.lower = b.final_time.upper = walker.STEP_TIME
    b.control.lower[:], b.control.upper[:] = [0, *[-100] * 4], [0, *[100] * 4]
    p.bounds.discrete.lower[:] = [0.0] * 13 + [-np.inf]
    p.bounds.discrete.upper[:] = [0.0] * 12 + [np.inf, 0.0]
    first = np.array([-0.3, 0.7, 0.0, -0.5, -0.6])
    rate = (first[::-1] - first) / walker.STEP_TIME
    ends = np.array([[*first, *rate], [*first[::-1], *rate]])
    g.time, g.state, g.control = [0, walker.STEP_TIME], ends.T, np.zeros((5, 2))
    return options(p, segments)


spent: list[float] = []
count = [0]
run, passing = inner._solve_ipopt_problem, inner.MseipoptProblem.set_intermediate_callback


def timed(*arguments: Any) -> Any:
    began = time.perf_counter()
    result = run(*arguments)
    spent.append(time.perf_counter() - began)
    return result


def counting(problem: Any, callback: Any) -> None:
    def count_iterations(*arguments: Any) -> bool:
        count[0] = int(arguments[1])
        return bool(callback(*arguments))

    passing(problem, count_iterations)


inner._solve_ipopt_problem, inner.MseipoptProblem.set_intermediate_callback = timed, counting


def solve(program: Any) -> dict[str, Any]:
    found = program.solve()
    return {
        "seconds": spent[-1],
        "objective": float(found.objective),
        "iterations": count[0],
        "status": found.nlp_info.ipopt_status_message,
    }


def versions() -> dict[str, str]:
    return {"yapss": version("yapss"), "casadi": casadi.__version__}
