"""Smooth forms of |x|, max and min (Kelly, 8.6), and |·| by slack variables (8.5).

All of them work on numbers, arrays and in traced functions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.checks import choice, positive
from trajopt.errors import ArgumentTypeError
from trajopt.tracing import Symbol

if TYPE_CHECKING:
    from trajopt.collocation.problem import Problem

__all__ = ["add_absolute", "smooth_abs", "smooth_max", "smooth_min"]

KINDS = ("tanh", "sqrt")


def smooth_abs(x: Any, width: float, kind: str = "tanh") -> Any:
    """Return a smooth |x|.

    Parameters
    ----------
    x : value or array
    width : float
        Size of the rounded region: α of (8.12), β of (8.13).
    kind : str
        ``tanh``: x tanh(x/α), never above |x|. ``sqrt``: √(x² + β²), never below.

    Examples
    --------
    >>> round(float(smooth_abs(-2.0, 0.1)), 6), round(float(smooth_abs(0.0, 0.1, "sqrt")), 6)
    (2.0, 0.1)
    """
    width = positive("smooth_abs", "width", width)
    if choice("smooth_abs", "kind", kind, KINDS) == "tanh":
        return x * np.tanh(x / width)
    return np.sqrt(x * x + width**2)


def smooth_max(a: Any, b: Any, width: float, kind: str = "sqrt") -> Any:
    """Return a smooth max(a, b) = (a + b + |a − b|) / 2.

    With ``sqrt`` it is never below the maximum, with ``tanh`` never above.

    Examples
    --------
    >>> round(float(smooth_max(1.0, 3.0, 0.01)), 4)
    3.0
    """
    return 0.5 * (a + b + smooth_abs(a - b, width, kind))


def smooth_min(a: Any, b: Any, width: float, kind: str = "sqrt") -> Any:
    """Return a smooth min(a, b) = (a + b − |a − b|) / 2.

    Examples
    --------
    >>> round(float(smooth_min(1.0, 3.0, 0.01)), 4)
    1.0
    """
    return 0.5 * (a + b - smooth_abs(a - b, width, kind))


def add_absolute(problem: Problem, argument: Callable[..., Any], weight: float = 1.0) -> Problem:
    """Return `problem` with weight · ∫ |argument(t, x, u)| dt added, exactly.

    Two controls s₁, s₂ ≥ 0 are added after the others, with the path constraint
    s₁ − s₂ = argument and the integrand s₁ + s₂ (8.9 to 8.11): at the optimum one of them is zero.

    Parameters
    ----------
    problem : Problem
    argument : callable
        ``argument(t, x, u)`` -> one value.
    weight : float
        Positive factor.

    Returns
    -------
    Problem
        A guess for the controls is extended by zeros.
    """
    weight = positive("add_absolute", "weight", weight)
    nu = problem.nu

    def hidden(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda t, x, u, *p: function(t, x, u[:nu], *p)

    changes_at_ends: dict[str, Any] = {}

    def integrand(t: Any, x: Any, u: Any, *p: Any) -> Any:
        own = 0.0 if problem.objective is None else problem.objective(t, x, u[:nu], *p)
        return _one(own) + weight * (u[nu] + u[nu + 1])

    for name in ("at_start", "at_end"):
        if (given := getattr(problem, name)) is not None:
            changes_at_ends[name] = (hidden(given[0]), *given[1:])
    own = problem.path

    def path(t: Any, x: Any, u: Any, *p: Any) -> list[Any]:
        slack = u[nu] - u[nu + 1] - _one(argument(t, x, u[:nu], *p))
        return [slack] if own is None else [slack, own[0](t, x, u[:nu], *p)]

    lower, upper = problem.phase.h_bounds
    changes: dict[str, Any] = changes_at_ends | {
        "dynamics": hidden(problem.dynamics),
        "nu": nu + 2,
        "objective": integrand,
        "path": (path, [0.0, *lower], [0.0, *upper]),
        "u_names": (*problem.phase.u_names, "slack+", "slack-"),
        "guess": _extended(problem, nu),
    }
    for name, ends in (
        ("u_bounds", problem.phase.u),
        ("u0_bounds", problem.phase.u0),
        ("uf_bounds", problem.phase.uf),
    ):
        changes[name] = ([*ends[0], 0.0, 0.0], [*ends[1], np.inf, np.inf])
    return replace(problem, **changes)


def _one(value: Any) -> Any:
    """Return the value of a function that may return it in a sequence of one."""
    while isinstance(value, (list, tuple, np.ndarray)) and np.size(value) == 1:
        value = value[0] if isinstance(value, (list, tuple)) else value.ravel()[0]
    if not isinstance(value, (Symbol, int, float, np.number)):
        raise ArgumentTypeError(f"add_absolute: expected one value, not {value!r}")
    return value


def _extended(problem: Problem, nu: int) -> Any:
    """Return the guess with zeros for the slack variables."""
    start = problem.start
    sigma = np.linspace(0.0, 1.0, 101)
    x, u = start.sample(sigma)
    t = start.t0 + sigma * (start.tf - start.t0)
    wide = np.zeros((len(sigma), nu + 2))
    wide[:, :nu] = u
    return {"t": t, "x": x, "u": wide, "p": start.parameters}
