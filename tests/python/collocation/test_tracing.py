"""Traced functions give the numbers that plain NumPy gives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from trajopt import collocation as col
from trajopt.tracing import trace

A = np.array([[1.0, 2.0, 0.5], [0.3, -1.0, 2.0], [0.1, 0.2, 0.7]])

FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "components": lambda x: [x[0] * x[1] - 2 / x[2], x[0] ** 3, 2 ** x[1], -x[2], abs(x[0])],
    "vector functions": lambda x: np.sin(x) + np.cos(2 * x) * np.exp(-x) - np.tanh(x) ** 2,
    "matrix": lambda x: A @ x + x @ A,
    "dot and outer": lambda x: np.outer(x, x) @ np.ones(3) * np.dot(x, x),
    "assembly": lambda x: np.concatenate([x[1:], [x[0] * 2.0]]),
    "array of mixed": lambda x: np.array([[x[0], 0.0], [1.0, x[1]]]) @ x[1:],
    "sums": lambda x: [x.sum(), np.sum(x**2), np.prod(x), x.mean()],
    "where": lambda x: [np.where(x[0] > 0.2, x[1], x[2]), np.where(x[0] < 0.2, 1.0, x[2])],
    "extrema": lambda x: [np.maximum(x[0], x[1]), np.minimum(x[0], 0.1), np.clip(x[0], 0, 0.25)],
    "inverse": lambda x: [
        np.arctan2(x[0], x[1]),
        np.arcsin(x[0]),
        np.arccos(x[0]),
        np.arctan(x[1]),
    ],
    "hyperbolic": lambda x: np.sinh(x) * np.cosh(x) + np.arcsinh(x) + np.arctanh(x),
    "logs": lambda x: [np.log(x[0]), np.log1p(x[0]), np.log10(x[0]), np.log2(x[0]), np.expm1(x[0])],
    "roots": lambda x: [np.sqrt(x[0]), np.cbrt(x[0]), np.hypot(x[0], x[1]), np.square(x[1])],
    "numpy scalars": lambda x: [np.float64(2) * x[0], x[1] * np.float64(3), np.float64(1) / x[2]],
    "array times scalar": lambda x: np.arange(3.0) * x[0] + x[1] * np.ones(3),
    "degrees": lambda x: [np.deg2rad(x[0]), np.rad2deg(x[0]), np.radians(x[1]), np.degrees(x[1])],
    "signs": lambda x: [np.sign(x[0]), np.floor(x[0]), np.ceil(x[0]), np.abs(x[0])],
    "cross": lambda x: np.cross(x, A[0]),
    "linear solve": lambda x: col.linear_solve(
        np.outer(x, x) + 2.0 * np.eye(3), np.array([x[0], 1.0, x[2]])
    ),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_same_numbers(name: str) -> None:
    function = FUNCTIONS[name]
    traced = trace("test", "function", function, [("x", 3)], None)
    for seed in range(5):
        x = np.random.default_rng(seed).uniform(0.05, 0.9, 3)
        plain = np.concatenate([np.ravel(part) for part in _parts(function(x))])
        np.testing.assert_allclose(np.ravel(traced(x).full()), plain, rtol=1e-13)


def _parts(values: Any) -> list[Any]:
    return list(values) if isinstance(values, (list, tuple)) else [values]


def test_linear_solve_on_numbers() -> None:
    random = np.random.default_rng(1)
    half = random.normal(size=(6, 6))
    matrix, right = half @ half.T + np.eye(6), random.normal(size=6)
    np.testing.assert_allclose(
        col.linear_solve(matrix, right), np.linalg.solve(matrix, right), rtol=1e-12
    )
    with pytest.raises(ValueError, match=r"shape \(6, 6\)"):
        col.linear_solve(matrix, right[:5])


def test_a_function_is_called_once() -> None:
    calls = []

    def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
        calls.append(t)
        return [x[1], u[0]]

    problem = col.Problem(
        dynamics=dynamics,
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: u[0] ** 2,
        x0_bounds=(0, 0),
        xf_bounds=([1, 0], [1, 0]),
    )
    for segments in (3, 6):
        col.solve(problem, segments=segments)
    assert len(calls) == 1
