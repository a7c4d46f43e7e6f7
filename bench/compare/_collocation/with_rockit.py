"""rockit: Radau collocation of degree 3 with a control that is linear in every segment."""

# ruff: noqa: SIM300
from __future__ import annotations

from importlib.metadata import version
from typing import Any

import casadi
import five_link_biped as walker

# user code: begin
import numpy as np
from casadi import cos, sin, vertcat
from rockit import DirectCollocation, Ocp


def cart_pole(segments: int) -> Any:
    ocp = Ocp(T=2.0)
    x, u = ocp.state(4), ocp.control(order=1)
    s, c = sin(x[1]), cos(x[1])
    pull, d = 0.15 * s * x[3] ** 2 + u, 1.0 + 0.3 * s**2
    cart, pole = (pull + 2.943 * c * s) / d, -(pull * c + 12.753 * s) / (0.5 * d)
    ocp.set_der(x, vertcat(x[2], x[3], cart, pole))
    ocp.add_objective(ocp.integral(u**2))
    ocp.subject_to(-20 <= (u <= 20))
    ocp.subject_to(-2 <= (x[0] <= 2))
    end = vertcat(1, np.pi, 0, 0)
    ocp.subject_to(ocp.at_t0(x) == 0)
    ocp.subject_to(ocp.at_tf(x) == end)
    ocp.set_initial(x, end * ocp.t / 2)
    return options(ocp, segments)


def options(ocp: Any, segments: int) -> Any:
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "record_time": True}
    ocp.solver("ipopt", {"ipopt.tol": 1e-8, "expand": True, **quiet})
    ocp.method(DirectCollocation(N=segments, degree=3, scheme="radau"))
    return ocp


# user code: end


def biped(segments: int) -> Any:
    ocp = Ocp(T=walker.STEP_TIME)
    x, u = ocp.state(10), ocp.control(4, order=1)
    torques = casadi.vertcat(0, u)
    # Components as scalar expressions: NumPy's functions of CasADi's matrices are not the same.
    slopes = scalar(walker.dynamics, 10, 5)
    ocp.set_der(x, slopes(x, torques))
    ocp.add_objective(ocp.integral(casadi.sumsqr(u)))
    ocp.subject_to(-100 <= (u <= 100))
    ends = scalar(walker.boundary, 10, 10)(ocp.at_t0(x), ocp.at_tf(x))
    ocp.subject_to(ends[:12] == 0)
    ocp.subject_to(ends[12] >= 0)
    ocp.subject_to(ends[13] <= 0)
    first = np.array([-0.3, 0.7, 0.0, -0.5, -0.6])
    rate = (first[::-1] - first) / walker.STEP_TIME
    ocp.set_initial(x, casadi.vertcat(first + rate * ocp.t, casadi.DM(rate)))
    return options(ocp, segments)


def scalar(function: Any, first: int, second: int) -> Any:
    a, b = casadi.SX.sym("a", first), casadi.SX.sym("b", second)
    parts = [a[i] for i in range(first)], [b[i] for i in range(second)]
    blanks = (0.0,) if second == 5 else (0.0, 0.0)
    return casadi.Function("f", [a, b], [casadi.vertcat(*function(*blanks, *parts))])


def solve(program: Any) -> dict[str, Any]:
    found = program.solve()
    return {
        "seconds": found.stats["t_wall_total"],
        "objective": float(found.value(program.objective)),
        "iterations": int(found.stats["iter_count"]),
        "status": found.stats["return_status"],
    }


def versions() -> dict[str, str]:
    return {"rockit-meco": version("rockit-meco"), "casadi": casadi.__version__}
