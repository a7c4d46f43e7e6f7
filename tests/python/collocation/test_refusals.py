"""Bad input is refused before the solver starts, with variable, value and expectation."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from collocation.problems import block
from trajopt import ArgumentError, TrajoptError
from trajopt import collocation as col


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"guess": {"x": [[0, 0], [np.nan, 1]]}}, ["guess['x'][1, 0]", "x[0]", "nan"]),
        ({"guess": {"x": [[0, 0, 0], [1, 1, 1]]}}, ["guess['x']", "(2, 3)", "(m, 2)"]),
        ({"guess": {"t": [0, 1, 2], "x": [[0, 0], [1, 1]]}}, ["(3, 2)", "guess['t']"]),
        ({"guess": {"t": [0, 0]}}, ["guess['t']", "rise"]),
        ({"guess": {"y": 1}}, ["'y'", "t, x, u, p"]),
        ({"guess": lambda t: ([t, np.inf], [0.0])}, ["x[1]", "inf"]),
        ({"guess": lambda t: ([t], [0.0])}, ["(1,)", "(2,)"]),
        ({"x_bounds": ([0, 3], [1, 2])}, ["x_bounds", "x[1]", "3", "2"]),
        ({"x_bounds": ([0, 0], [0.5, 1])}, ["xf_bounds and x_bounds", "x[0]", "0.5"]),
        ({"x_bounds": ([0], [1])}, ["x_bounds", "1 entries", "expected 2"]),
        ({"x_bounds": ([np.nan, 0], [1, 1])}, ["x_bounds", "x[0]", "nan"]),
        ({"x_bounds": 3}, ["x_bounds", "(lower, upper)"]),
        ({"u_bounds": (2, -2), "u_names": ["force"]}, ["u_bounds", "force"]),
        ({"tf": None}, ["tf or tf_bounds"]),
        ({"tf_bounds": (1, 2)}, ["tf and tf_bounds"]),
        ({"tf": -1.0}, ["no time"]),
        ({"nx": 0}, ["nx", ">= 1"]),
        ({"periodic": [2]}, ["periodic", "nx = 2"]),
        ({"path": (lambda t, x, u: [x[0]], 1, 0)}, ["bounds of path", "path[0]"]),
        ({"boundary": (lambda t0, tf, x0, xf: [xf[0]], [0, 0], [1, 1])}, ["2 entries, expected 1"]),
        ({"path": lambda t, x, u: [x[0]]}, ["path", "(function, lower, upper)"]),
        ({"dynamics": 3}, ["dynamics", "function", "int"]),
        ({"dynamics": lambda t, x, u: [x[1]]}, ["1 values, expected 2"]),
        ({"objective": lambda t, x, u: [1, 2]}, ["objective", "2 values, expected 1"]),
        ({"x_names": ["a"]}, ["x_names", "2 names"]),
    ],
)
def test_problem(changes: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(TrajoptError) as caught:
        block(**changes)
    assert isinstance(caught.value, (ValueError, TypeError))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"method": "euler"}, ["method", "euler", "trapezoidal"]),
        ({"segments": 0}, ["segments", ">= 1"]),
        ({"segments": [0, 0.5, 0.4, 1]}, ["segments", "rise"]),
        ({"solver": "magic"}, ["solver", "ipopt"]),
        ({"degree": 3}, ["degree", "hermite_simpson"]),
        ({"method": "legendre", "points": "random"}, ["points", "radau"]),
        ({"tolerance": 0.0}, ["tolerance", "> 0"]),
        ({"scaling": "some"}, ["scaling", "auto"]),
        ({"guess": {"u": [[np.nan], [0]]}}, ["solve", "guess['u'][0, 0]"]),
    ],
)
def test_solve(settings: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(TrajoptError) as caught:
        col.solve(block(), **settings)
    for word in words:
        assert word in str(caught.value)


def test_solve_needs_a_problem() -> None:
    with pytest.raises(TypeError, match="problem must be a Problem"):
        col.solve(3)  # type: ignore[arg-type]


def test_control_bound_at_an_end_without_control() -> None:
    with pytest.raises(ArgumentError, match="uf_bounds needs a method with a control"):
        col.solve(block(uf_bounds=(0, 0)), method="legendre")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"dynamics": lambda t, x, u: [np.sqrt(x[0] - 0.5), u[0]]}, r"dynamics of x\[0\] is nan"),
        ({"dynamics": lambda t, x, u: [1 / (x[0] * (x[0] - 1)), u[0]]}, r"dynamics of x\[0\] is"),
        ({"objective": lambda t, x, u: np.log(x[1] - 1)}, "objective is not finite"),
        (
            {"path": (lambda t, x, u: [np.log(x[0] - 2)], 0, 1), "x_names": ["s", "v"]},
            r"path\[0\] is nan for the guess at t = 0 s",
        ),
    ],
)
def test_guess_where_a_function_is_undefined(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        col.solve(block(**changes), segments=6)


def test_guess_and_warm_start() -> None:
    solution = col.solve(block(), segments=2)
    with pytest.raises(ArgumentError, match="expected one"):
        col.solve(block(), guess={}, warm_start=solution)
    with pytest.raises(TypeError, match="warm_start must be a solution of a Problem"):
        col.solve(block(), warm_start={})  # type: ignore[call-overload]


def branch(t: Any, x: Any, u: Any) -> list[Any]:
    if x[0] > 0:
        return [x[1], u[0]]
    return [x[1], 0]


def assign(t: Any, x: Any, u: Any) -> Any:
    slopes = np.zeros(2)
    slopes[0] = x[1]
    return slopes


@pytest.mark.parametrize(
    ("function", "line", "advice"),
    [
        (branch, "if x[0] > 0:", "np.where(condition, a, b)"),
        (assign, "slopes[0] = x[1]", "np.array([...])"),
        (lambda t, x, u: [math.sin(x[0]), u[0]], "math.sin(x[0])", "np.sin"),
        (lambda t, x, u: [x[5], u[0]], "x[5]", "x 2, u 1"),
        (lambda t, x, u: np.linalg.solve(np.diag(x), x), "np.linalg.solve", "linear_solve"),
        (lambda t, x, u: [max(x[0], 0), 1], "max(x[0], 0)", "np.maximum"),
        (lambda t, x, u: [np.interp(x[0], [0], [1]), 1], "np.interp", "cannot be traced"),
        (lambda t, x: [x[1], 0], "could not be traced", "it is called with (t, x, u)"),
        (lambda t, x, u: None, "NoneType", "return"),
        (lambda t, x, u: [x[0], float("nan")], "nan", "finite"),
    ],
)
def test_untraceable(function: Any, line: str, advice: str) -> None:
    with pytest.raises(TrajoptError) as caught:
        block(dynamics=function)
    assert line in str(caught.value)
    assert advice in str(caught.value)
