"""Problems from the literature whose optima are known, through every solver that is there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from trajopt import Status
from trajopt import collocation as col

SOLVERS = ["ipopt", *(["native"] if find_spec("trajopt.collocation.native") else [])]


@dataclass(frozen=True)
class Known:
    """A problem, its optimum, and how to solve it."""

    problem: Callable[[], col.Problem]
    optimum: float
    tolerance: float
    settings: dict[str, Any] = field(default_factory=dict)


def regulator() -> col.Problem:
    """Least ∫ x² + u² with x' = u from 1: tanh T."""
    return col.Problem(
        dynamics=lambda t, x, u: [u[0]],
        nx=1,
        nu=1,
        tf=2.0,
        objective=lambda t, x, u: x[0] ** 2 + u[0] ** 2,
        x0_bounds=(1, 1),
    )


def oscillator() -> col.Problem:
    """Least ∫ u² that stops an oscillator: the inverse of the controllability Gramian."""
    return col.Problem(
        dynamics=lambda t, x, u: [x[1], -4 * x[0] + u[0]],
        nx=2,
        nu=1,
        tf=1.7,
        objective=lambda t, x, u: u[0] ** 2,
        x0_bounds=([1, 0], [1, 0]),
        xf_bounds=(0, 0),
    )


def oscillator_optimum() -> float:
    a, b, end = np.array([[0, 1], [-4.0, 0]]), np.array([0, 1.0]), 1.7
    nodes, weights = np.polynomial.legendre.leggauss(40)
    columns = [expm(a * end * (1 + s) / 2) @ b for s in nodes]
    gramian = sum(0.5 * end * w * np.outer(c, c) for w, c in zip(weights, columns, strict=True))
    drift = expm(a * end) @ np.array([1.0, 0.0])
    return float(drift @ np.linalg.solve(gramian, drift))


def catenary() -> col.Problem:
    """The least surface of revolution between rings: y = a cosh(x / a)."""
    return col.Problem(
        dynamics=lambda t, x, u: [u[0]],
        nx=1,
        nu=1,
        t0=-0.5,
        tf=0.5,
        objective=lambda t, x, u: 2 * np.pi * x[0] * np.sqrt(1 + u[0] ** 2),
        x0_bounds=(1, 1),
        xf_bounds=(1, 1),
        guess={"x": [[1], [1]]},
    )


def catenary_optimum() -> float:
    a = brentq(lambda a: a * np.cosh(0.5 / a) - 1, 0.6, 1.0)
    return float(np.pi * a * (1 + a * np.sinh(1 / a)))


def dido() -> col.Problem:
    """The largest area under a rope of length π / 2 · 1.2 over a base: a circular arc."""
    length = 1.2 * np.pi / 2
    return col.Problem(
        dynamics=lambda t, x, u: [np.cos(u[0]), np.sin(u[0]), x[1] * np.cos(u[0])],
        nx=3,
        nu=1,
        tf=length,
        terminal=lambda t0, tf, x0, xf: -xf[2],
        x0_bounds=(0, 0),
        xf_bounds=([1, 0, None], [1, 0, None]),
        guess={"x": [[0, 0, 0], [1, 0, 0.5]], "u": [[1.5], [-1.5]]},
    )


def dido_optimum() -> float:
    length = 1.2 * np.pi / 2
    # Half opening angle a of the arc: chord 2 r sin a = 1, length 2 r a.
    a = brentq(lambda a: np.sin(a) / a - 1 / length, 0.5, 3.0)
    r = length / (2 * a)
    return float(-(r**2) * (a - np.sin(a) * np.cos(a)))


def zermelo() -> col.Problem:
    """A boat crosses a current of 0.6 at speed 1: least time 1 / √(1 − 0.36) straight across."""
    return col.Problem(
        dynamics=lambda t, x, u: [np.cos(u[0]), np.sin(u[0]) - 0.6],
        nx=2,
        nu=1,
        tf_bounds=(0.1, 10),
        terminal=lambda t0, tf, x0, xf: tf,
        x0_bounds=(0, 0),
        xf_bounds=([1, 0], [1, 0]),
        guess={"t": [0, 2], "x": [[0, 0], [1, 0]]},
    )


def lander() -> col.Problem:
    """Soft landing with the least fuel: fall, then full thrust."""
    return col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0] - 1.5],
        nx=2,
        nu=1,
        tf_bounds=(0.1, 20),
        objective=lambda t, x, u: u[0],
        u_bounds=(0, 3),
        x0_bounds=([10, -2], [10, -2]),
        xf_bounds=(0, 0),
        guess={"t": [0, 5], "x": [[10, -2], [0, 0]], "u": [[1], [1]]},
    )


def lander_optimum() -> float:
    # Fall for s seconds, then brake with a net 1.5: speed and height vanish together.
    def height(s: float) -> float:
        speed = 2 + 1.5 * s
        return float(10 - 2 * s - 0.75 * s**2 - speed**2 / 3.0)

    s = brentq(height, 0.0, 3.0)
    return float(3 * (2 + 1.5 * s) / 1.5)


def bryson_denham() -> col.Problem:
    """A ball thrown against a limit of 1/9: 4 / (9 · 1/9)."""
    return col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0]],
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: 0.5 * u[0] ** 2,
        x_bounds=([None, None], [1 / 9, None]),
        x0_bounds=([0, 1], [0, 1]),
        xf_bounds=([0, -1], [0, -1]),
    )


def brachistochrone() -> col.Problem:
    """The fastest slide over (1, 1): a cycloid."""
    return col.Problem(
        dynamics=lambda t, x, u: [
            x[2] * np.sin(u[0]),
            x[2] * np.cos(u[0]),
            9.81 * np.cos(u[0]),
        ],
        nx=3,
        nu=1,
        tf_bounds=(0.1, 5),
        terminal=lambda t0, tf, x0, xf: tf,
        x0_bounds=(0, 0),
        xf_bounds=([1, 1, None], [1, 1, None]),
        u_bounds=(0, np.pi),
        guess={"t": [0, 1], "x": [[0, 0, 0], [1, 1, 4]], "u": [[0.5], [1.5]]},
    )


def brachistochrone_optimum() -> float:
    angle = brentq(lambda a: (a - np.sin(a)) / (1 - np.cos(a)) - 1, 0.1, 6.0)
    return float(angle * np.sqrt(1 / (1 - np.cos(angle)) / 9.81))


def steering() -> col.Problem:
    """Particle steering (COPS 10): tan u is linear in time, 0.554570879."""
    return col.Problem(
        dynamics=lambda t, x, u: [x[2], x[3], 100 * np.cos(u[0]), 100 * np.sin(u[0])],
        nx=4,
        nu=1,
        tf_bounds=(0.05, 5),
        terminal=lambda t0, tf, x0, xf: tf,
        u_bounds=(-np.pi / 2, np.pi / 2),
        x0_bounds=(0, 0),
        xf_bounds=([None, 5, 45, 0], [None, 5, 45, 0]),
        guess={"t": [0, 1], "x": [[0, 0, 0, 0], [22, 5, 45, 0]], "u": [[0.5], [-0.5]]},
    )


def goddard() -> col.Problem:
    """The Goddard rocket (COPS 12): highest altitude 1.01283."""
    weight, end = 0.5 * 620, 0.5 * np.sqrt(1.0)

    def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
        drag = weight * x[1] ** 2 * np.exp(-500 * (x[0] - 1))
        return [x[1], (u[0] - drag) / x[2] - 1 / x[0] ** 2, -u[0] / end]

    return col.Problem(
        dynamics=dynamics,
        nx=3,
        nu=1,
        tf_bounds=(0.05, 1),
        terminal=lambda t0, tf, x0, xf: -xf[0],
        u_bounds=(0, 3.5),
        x_bounds=([1, 0, 0.6], [None, None, 1]),
        x0_bounds=([1, 0, 1], [1, 0, 1]),
        xf_bounds=([None, None, 0.6], [None, None, 0.6]),
        guess={"t": [0, 0.2], "x": [[1, 0.05, 1], [1.01, 0.05, 0.6]], "u": [[1.75], [1.75]]},
    )


def catalyst() -> col.Problem:
    """Catalyst mixing (COPS 14): -0.0480556."""

    def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
        first = 10 * x[1] - x[0]
        return [u[0] * first, -u[0] * first - (1 - u[0]) * x[1]]

    return col.Problem(
        dynamics=dynamics,
        nx=2,
        nu=1,
        tf=1.0,
        terminal=lambda t0, tf, x0, xf: xf[0] + xf[1] - 1,
        u_bounds=(0, 1),
        x0_bounds=([1, 0], [1, 0]),
        guess={"x": [[1, 0], [0.9, 0.05]], "u": [[0.5], [0.5]]},
    )


def orbit() -> col.Problem:
    """Orbit transfer (Bryson and Ho 2.5): the largest radius after 3.32 is 1.525."""

    def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
        r, v, w = x
        push = 0.1405 / (1 - 0.0749 * t)
        return [
            v,
            w**2 / r - 1 / r**2 + push * np.sin(u[0]),
            -v * w / r + push * np.cos(u[0]),
        ]

    return col.Problem(
        dynamics=dynamics,
        nx=3,
        nu=1,
        tf=3.32,
        terminal=lambda t0, tf, x0, xf: -xf[0],
        boundary=(lambda t0, tf, x0, xf: [xf[2] - 1 / np.sqrt(xf[0])], 0, 0),
        x0_bounds=([1, 0, 1], [1, 0, 1]),
        xf_bounds=([None, 0, None], [None, 0, None]),
        x_bounds=([0.5, None, None], [5, None, None]),
        guess={"x": [[1, 0, 1], [1.5, 0, 0.8]], "u": [[0.5], [5.5]]},
    )


CASES = {
    "regulator": Known(regulator, float(np.tanh(2.0)), 1e-6),
    "oscillator": Known(oscillator, oscillator_optimum(), 1e-6, {"segments": 100}),
    "catenary": Known(catenary, catenary_optimum(), 1e-6),
    "dido": Known(dido, dido_optimum(), 1e-6),
    "zermelo": Known(zermelo, 1 / np.sqrt(1 - 0.36), 1e-8),
    "lander": Known(lander, lander_optimum(), 5e-3, {"segments": 100}),
    "bryson_denham": Known(bryson_denham, 4.0, 1e-3, {"segments": 60}),
    "brachistochrone": Known(
        brachistochrone, brachistochrone_optimum(), 1e-6, {"method": "legendre", "points": "gauss"}
    ),
    "steering": Known(steering, 0.554570879, 1e-6, {"segments": 40}),
    "goddard": Known(goddard, -1.01283, 2e-5, {"segments": 60}),
    # Its control jumps onto and off a singular arc, which costs an order of accuracy.
    "catalyst": Known(catalyst, -0.0480556, 2e-5, {"segments": 120, "method": "trapezoidal"}),
    "orbit": Known(orbit, -1.525, 1e-3, {"segments": 30}),
}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("name", CASES)
def test_known_optimum(name: str, solver: str) -> None:
    case = CASES[name]
    found = col.solve(case.problem(), solver=solver, **case.settings)
    assert found.status is Status.SOLVED
    assert found.objective == pytest.approx(case.optimum, abs=case.tolerance)


@pytest.mark.skipif(len(SOLVERS) < 2, reason="this build has one solver")
@pytest.mark.parametrize("name", CASES)
def test_solvers_agree(name: str) -> None:
    case = CASES[name]
    values = [
        col.solve(case.problem(), solver=s, tolerance=1e-10, **case.settings).objective
        for s in SOLVERS
    ]
    assert values[0] == pytest.approx(values[-1], abs=1e-8)
