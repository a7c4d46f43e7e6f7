"""Optimal control problems as staged programs, transcribed here in the plainest way, and IPOPT on
the same program as one flat problem: the oracle of the native solver's tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.staged import Names, StagedNLP

FloatArray = NDArray[np.float64]
INF = np.inf


@dataclass
class Control:
    """min integral of cost(x, u, p) + mayer(p) with x' = f(x, u, p), p = (t_f, ...) or constants.

    With `free_time` the first global is the duration. `path` rows of h(x, u, p) <= 0.
    """

    nx: int
    nu: int
    f: Callable[..., list[Any]]
    cost: Callable[..., Any]
    x0: list[float | None]
    xf: list[float | None]
    tf: float = 1.0
    free_time: tuple[float, float] | None = None
    x_bounds: tuple[list[float], list[float]] | None = None
    u_bounds: tuple[list[float], list[float]] | None = None
    path: Callable[..., list[Any]] | None = None
    terminal: Callable[..., Any] | None = None  # of x(tf), duration
    guess: Callable[[float], tuple[list[float], list[float]]] | None = None


def staged(problem: Control, segments: int, method: str = "hermite_simpson") -> StagedNLP:
    """Trapezoidal or separated Hermite-Simpson transcription (Kelly 3 and 4)."""
    nx, nu = problem.nx, problem.nu
    simpson = method == "hermite_simpson"
    nw = (nx + nu) * (2 if simpson else 1)
    free = problem.free_time is not None
    p_size = 1 if free else 0
    w, v, p, s = ca.SX.sym("w", nw), ca.SX.sym("v", nw), ca.SX.sym("p", p_size), ca.SX.sym("s", 1)
    h = (p[0] if free else problem.tf) / segments

    def split(y: Any, middle: bool = False) -> tuple[Any, Any]:
        y = y[nx + nu :] if middle else y[: nx + nu]
        return y[:nx], y[nx : nx + nu]

    def rates(x: Any, u: Any) -> tuple[Any, Any]:
        return ca.vertcat(*problem.f(x, u)), problem.cost(x, u)

    (x, u), (y, r) = split(w), split(v)
    f0, l0 = rates(x, u)
    f1, l1 = rates(y, r)
    rows = []
    if simpson:
        xm, um = split(w, middle=True)
        fm, lm = rates(xm, um)
        cost = h / 6 * (l0 + 4 * lm + l1)
        rows += [xm - (x + y) / 2 - h / 8 * (f0 - f1), y - x - h / 6 * (f0 + 4 * fm + f1)]
    else:
        cost = h / 2 * (l0 + l1)
        rows += [y - x - h / 2 * (f0 + f1)]
    equalities = ca.vertcat(*rows).numel()
    if problem.path:
        rows += problem.path(x, u)
        if simpson:
            rows += problem.path(xm, um)
    c = ca.vertcat(*rows)
    nc = c.numel()
    end_rows = problem.path(x, u) if problem.path else []
    mayer = problem.terminal(x, p[0] if free else problem.tf) if problem.terminal else 0.0
    stage = ca.Function("stage", [w, v, p, s], [cost, c])
    last = ca.Function("last", [w, p, s], [mayer, ca.vertcat(*end_rows)])
    glob = ca.Function("glob", [p], [0.0, ca.SX(0, 1)])

    n = segments + 1
    lower, upper = np.full((n, nw), -INF), np.full((n, nw), INF)
    for part in range(2 if simpson else 1):
        at = part * (nx + nu)
        if problem.x_bounds:
            lower[:, at : at + nx], upper[:, at : at + nx] = problem.x_bounds
        if problem.u_bounds:
            lower[:, at + nx : at + nx + nu], upper[:, at + nx : at + nx + nu] = problem.u_bounds
    for i in range(nx):
        if problem.x0[i] is not None:
            lower[0, i] = upper[0, i] = problem.x0[i]
        if problem.xf[i] is not None:
            lower[-1, i] = upper[-1, i] = problem.xf[i]
    guess = np.zeros((n, nw))
    for k in range(n):
        for part in range(2 if simpson else 1):
            a = (k + 0.5 * part) / segments
            if problem.guess:
                gx, gu = problem.guess(a)
            else:
                gx = [
                    (1 - a) * (b if b is not None else (e if e is not None else 0.0))
                    + a * (e if e is not None else (b if b is not None else 0.0))
                    for b, e in zip(problem.x0, problem.xf, strict=True)
                ]
                gu = [0.0] * nu
            guess[k, part * (nx + nu) : (part + 1) * (nx + nu)] = [*gx, *gu]
    if simpson:  # nobody uses the last node's midpoint
        lower[-1, nx + nu :] = upper[-1, nx + nu :] = guess[-1, nx + nu :] = 0.0
    p_lower = np.array([problem.free_time[0]] if free else [])
    p_upper = np.array([problem.free_time[1]] if free else [])
    c_lower = np.tile(np.r_[np.zeros(equalities), np.full(nc - equalities, -INF)], (n - 1, 1))
    m_last = len(end_rows)
    return StagedNLP(
        stage=stage,
        last=last,
        glob=glob,
        n=n,
        w_lower=lower,
        w_upper=upper,
        w_guess=guess,
        p_lower=p_lower,
        p_upper=p_upper,
        p_guess=np.array([problem.tf] if free else []),
        s=np.zeros((n, 1)),
        c_lower=c_lower,
        c_upper=np.zeros((n - 1, nc)),
        last_lower=np.full(m_last, -INF),
        last_upper=np.zeros(m_last),
        glob_lower=np.zeros(0),
        glob_upper=np.zeros(0),
        w_scale=np.ones(nw),
        p_scale=np.ones(p_size),
        c_scale=np.ones(nc),
        names=Names(
            tuple(f"w{i}" for i in range(nw)),
            tuple(f"p{i}" for i in range(p_size)),
            tuple(f"c{i}" for i in range(nc)),
            tuple(f"e{i}" for i in range(m_last)),
            (),
            np.linspace(0, problem.tf, n),
        ),
    )


def flat(nlp: StagedNLP) -> tuple[dict[str, Any], dict[str, Any]]:
    """The program as CasADi's nlpsol takes it: expressions and bounds."""
    symbol = ca.SX if nlp.stage.is_a("SXFunction") else ca.MX
    w = [symbol.sym(f"w{k}", nlp.nw) for k in range(nlp.n)]
    p = symbol.sym("p", nlp.np)
    cost, rows = 0, []
    for k in range(nlp.n - 1):
        value, c = nlp.stage(w[k], w[k + 1], p, nlp.s[k])
        cost += value
        rows.append(c)
    value, c = nlp.last(w[-1], p, nlp.s[-1])
    other, g = nlp.glob(p)
    rows += [c, g]
    expressions = {"x": ca.vertcat(*w, p), "f": cost + value + other, "g": ca.vertcat(*rows)}
    bounds = {
        "x0": np.concatenate([nlp.w_guess.ravel(), nlp.p_guess]),
        "lbx": np.concatenate([nlp.w_lower.ravel(), nlp.p_lower]),
        "ubx": np.concatenate([nlp.w_upper.ravel(), nlp.p_upper]),
        "lbg": np.concatenate([nlp.c_lower.ravel(), nlp.last_lower, nlp.glob_lower]),
        "ubg": np.concatenate([nlp.c_upper.ravel(), nlp.last_upper, nlp.glob_upper]),
    }
    return expressions, bounds


def ipopt(nlp: StagedNLP, tolerance: float = 1e-8, **options: Any) -> dict[str, Any]:
    """Solve with IPOPT; objective, x, iterations and its return status."""
    expressions, bounds = flat(nlp)
    settings = {
        "print_time": False,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": tolerance,
        "ipopt.bound_relax_factor": 0.0,
        **options,
    }
    solver = ca.nlpsol("solver", "ipopt", expressions, settings)
    result = solver(**bounds)
    stats = solver.stats()
    return {
        "objective": float(result["f"]),
        "x": np.asarray(result["x"]).ravel(),
        "multipliers": np.asarray(result["lam_g"]).ravel(),
        "bound_multipliers": np.asarray(result["lam_x"]).ravel(),
        "iterations": stats["iter_count"],
        "status": stats["return_status"],
    }


# --- The problems -------------------------------------------------------------------------------


def block_move() -> Control:
    return Control(2, 1, lambda x, u: [x[1], u[0]], lambda x, u: u[0] ** 2, [0, 0], [1, 0])


def cart_pole() -> Control:
    """Kelly 6, appendix E.1: force-optimal swing-up."""
    m1, m2, length, g = 1.0, 0.3, 0.5, 9.81

    def f(x: Any, u: Any) -> list[Any]:
        sin, cos = ca.sin(x[1]), ca.cos(x[1])
        d = m1 + m2 * (1 - cos**2)
        q1 = (length * m2 * sin * x[3] ** 2 + u[0] + m2 * g * cos * sin) / d
        q2 = -(length * m2 * cos * sin * x[3] ** 2 + u[0] * cos + (m1 + m2) * g * sin) / (
            length * d
        )
        return [x[2], x[3], q1, q2]

    return Control(
        4,
        1,
        f,
        lambda x, u: u[0] ** 2,
        [0, 0, 0, 0],
        [1, np.pi, 0, 0],
        tf=2.0,
        x_bounds=([-2, -INF, -INF, -INF], [2, INF, INF, INF]),
        u_bounds=([-20], [20]),
    )


def van_der_pol() -> Control:
    """Minimum of the integral of x0^2 + x1^2 + u^2 over 5 s, u <= 1 (CasADi's standard case)."""
    return Control(
        2,
        1,
        lambda x, u: [(1 - x[1] ** 2) * x[0] - x[1] + u[0], x[0]],
        lambda x, u: x[0] ** 2 + x[1] ** 2 + u[0] ** 2,
        [0, 1],
        [None, None],
        tf=5.0,
        x_bounds=([-0.25, -INF], [INF, INF]),
        u_bounds=([-1.0], [1.0]),
    )


def brachistochrone() -> Control:
    """Bead from rest at (0, 0) to (2, 2) below, g = 9.81: a cycloid."""
    g = 9.81
    return Control(
        3,
        1,
        lambda x, u: [x[2] * ca.sin(u[0]), x[2] * ca.cos(u[0]), g * ca.cos(u[0])],
        lambda x, u: 0.0 * u[0],
        [0, 0, 0],
        [2, 2, None],
        tf=1.0,
        free_time=(0.1, 10.0),
        u_bounds=([0.0], [np.pi]),
        terminal=lambda x, t: t,
        guess=lambda a: ([2 * a, 2 * a, 6 * a], [0.8]),
    )


def double_integrator_time() -> Control:
    """Rest to rest over a distance of 1 with |u| <= 1: 2 s, bang-bang."""
    return Control(
        2,
        1,
        lambda x, u: [x[1], u[0]],
        lambda x, u: 0.0 * u[0],
        [0, 0],
        [1, 0],
        tf=3.0,
        free_time=(0.1, 10.0),
        u_bounds=([-1.0], [1.0]),
        terminal=lambda x, t: t,
    )


def bryson_denham() -> Control:
    """x <= 1/9, minimum energy: 4 / (9 l) = 4 for l = 1/9 (Bryson and Ho 1975, 3.11)."""
    return Control(
        2,
        1,
        lambda x, u: [x[1], u[0]],
        lambda x, u: u[0] ** 2 / 2,
        [0, 1],
        [0, -1],
        x_bounds=([-INF, -INF], [1 / 9, INF]),
    )


def linear_tangent() -> Control:
    """Linear tangent steering in minimum time (Betts 2001; COPS), a = 100, y = 5."""
    return Control(
        4,
        1,
        lambda x, u: [x[2], x[3], 100 * ca.cos(u[0]), 100 * ca.sin(u[0])],
        lambda x, u: 0.0 * u[0],
        [0, 0, 0, 0],
        [None, 5, 45, 0],
        tf=1.0,
        free_time=(0.05, 2.0),
        u_bounds=([-np.pi / 2], [np.pi / 2]),
        terminal=lambda x, t: t,
        guess=lambda a: ([10 * a, 5 * a, 45 * a, 0.0], [0.5 - a]),
    )


def goddard() -> Control:
    """Goddard's rocket to its greatest height, normalized (Bryson 1999; COPS 3)."""
    tc, mf, dc, hc, c = 3.5, 0.6, 310.0, 500.0, 0.5

    def f(x: Any, u: Any) -> list[Any]:
        h, v, m = x[0], x[1], x[2]
        drag = dc * v**2 * ca.exp(-hc * (h - 1))
        return [v, (u[0] - drag) / m - 1 / h**2, -u[0] / c]

    return Control(
        3,
        1,
        f,
        lambda x, u: 0.0 * u[0],
        [1, 0, 1],
        [None, None, mf],
        tf=0.2,
        free_time=(0.02, 1.0),
        x_bounds=([1, 0, mf], [INF, INF, 1]),
        u_bounds=([0.0], [tc]),
        terminal=lambda x, t: -x[0],
        guess=lambda a: ([1 + 0.01 * a, 0.3 * a * (1 - a), 1 - 0.4 * a], [tc / 2]),
    )


def catalyst_mixing() -> Control:
    """Mixing of two catalysts in a tubular reactor (COPS 3; Li and Liu)."""

    def f(x: Any, u: Any) -> list[Any]:
        return [
            u[0] * (10 * x[1] - x[0]),
            u[0] * (x[0] - 10 * x[1]) - (1 - u[0]) * x[1],
        ]

    return Control(
        2,
        1,
        f,
        lambda x, u: 0.0 * u[0],
        [1, 0],
        [None, None],
        tf=1.0,
        u_bounds=([0.0], [1.0]),
        terminal=lambda x, t: x[0] + x[1] - 1,
        guess=lambda a: ([1.0, 0.0], [0.0]),
    )


def hanging_chain() -> Control:
    """Chain of length 4 between heights 1 and 3 with the least potential energy (COPS 3)."""
    return Control(
        2,
        1,
        lambda x, u: [u[0], ca.sqrt(1 + u[0] ** 2)],
        lambda x, u: x[0] * ca.sqrt(1 + u[0] ** 2),
        [1, 0],
        [3, 4],
        tf=1.0,
        u_bounds=([-10.0], [20.0]),
        guess=lambda a: ([3.6 * (a - 0.25) ** 2 + 1, 4 * a], [7.2 * (a - 0.25)]),
    )


def pendulum_swing_up() -> Control:
    """Torque-limited pendulum, three swings of energy pumping at least."""
    return Control(
        2,
        1,
        lambda x, u: [x[1], u[0] - 9.81 * ca.sin(x[0]) - 0.1 * x[1]],
        lambda x, u: u[0] ** 2,
        [0, 0],
        [np.pi, 0],
        tf=4.0,
        u_bounds=([-5.0], [5.0]),
    )


def dubins() -> Control:
    """Car of bounded turning rate around a disc (path constraint), shortest time."""

    def outside(x: Any, u: Any) -> list[Any]:
        return [1.0 - (x[0] - 2) ** 2 - (x[1] - 0.2) ** 2]

    return Control(
        3,
        1,
        lambda x, u: [ca.cos(x[2]), ca.sin(x[2]), u[0]],
        lambda x, u: 1e-3 * u[0] ** 2,
        [0, 0, 0],
        [4, 0, None],
        tf=4.5,
        free_time=(1.0, 20.0),
        u_bounds=([-1.5], [1.5]),
        path=outside,
        terminal=lambda x, t: t,
        guess=lambda a: ([4 * a, -2 * np.sin(np.pi * a), 0.0], [0.0]),
    )


def rayleigh() -> Control:
    """Rayleigh's tunnel diode oscillator with a mixed constraint (Maurer and Augustin 2000)."""
    return Control(
        2,
        1,
        lambda x, u: [x[1], -x[0] + x[1] * (1.4 - 0.14 * x[1] ** 2) + 4 * u[0]],
        lambda x, u: u[0] ** 2 + x[0] ** 2,
        [-5, -5],
        [None, None],
        tf=4.5,
        path=lambda x, u: [u[0] + x[0] / 6],
    )


def block_move_work(u_max: float = 10.0) -> Control:
    """Kelly 8 with slack variables: minimum work |u v|, the power split in two parts."""
    return Control(
        2,
        3,  # force, positive and negative power
        lambda x, u: [x[1], u[0]],
        lambda x, u: u[1] + u[2],
        [0, 0],
        [1, 0],
        u_bounds=([-u_max, 0, 0], [u_max, INF, INF]),
        path=lambda x, u: [u[0] * x[1] - u[1] + u[2], -(u[0] * x[1] - u[1] + u[2])],
    )


PROBLEMS: dict[str, Callable[[], Control]] = {
    "block_move": block_move,
    "cart_pole": cart_pole,
    "van_der_pol": van_der_pol,
    "brachistochrone": brachistochrone,
    "double_integrator_time": double_integrator_time,
    "bryson_denham": bryson_denham,
    "linear_tangent": linear_tangent,
    "goddard": goddard,
    "catalyst_mixing": catalyst_mixing,
    "hanging_chain": hanging_chain,
    "pendulum_swing_up": pendulum_swing_up,
    "dubins": dubins,
    "rayleigh": rayleigh,
}
