"""Checks of a user's functions: traced derivatives against finite differences of plain Python."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import whole
from trajopt.collocation.problem import Problem
from trajopt.tracing import casadi

__all__ = ["DerivativeCheck", "check_derivatives"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class DerivativeCheck:
    """The largest disagreement found in one function.

    Parameters
    ----------
    function : str
        Name of the argument of `Problem`.
    value_error : float
        Traced value against the Python function on numbers, relative to 1 + |value|.
    derivative_error : float
        Exact Jacobian against central differences, relative to 1 + |derivative|.
    where : str
        The entry with the largest derivative error, such as ``dynamics[2] by x[1]``.
    """

    function: str
    value_error: float
    derivative_error: float
    where: str

    @property
    def agrees(self) -> bool:
        """Whether both errors are what rounding explains."""
        return self.value_error < 1e-9 and self.derivative_error < 1e-5


def check_derivatives(problem: Problem, samples: int = 10, seed: int = 0) -> list[DerivativeCheck]:
    """Compare all functions of a problem with themselves on plain numbers.

    The traced function is what the solver sees. It differs from the Python function if that has
    hidden state, takes a branch on something else than its arguments, or rounds numbers; and its
    derivatives differ from finite differences at kinks.

    Parameters
    ----------
    problem : Problem
    samples : int
        Random points around the guess.
    seed : int

    Returns
    -------
    list of DerivativeCheck
        One per function that was given.

    Examples
    --------
    >>> problem = Problem(dynamics=lambda t, x, u: [np.sin(x[0]) * u[0]], nx=1, nu=1, tf=1.0)
    >>> [check.agrees for check in check_derivatives(problem)]
    [True]
    """
    samples = whole("check_derivatives", "samples", samples, 1)
    phase, random = problem.phase, np.random.default_rng(seed)
    running = [("t", 1), ("x", phase.nx), ("u", phase.nu), ("p", phase.np)]
    ends = [("t0", 1), ("tf", 1), ("x0", phase.nx), ("xf", phase.nx), ("p", phase.np)]
    found = []
    for name, traced, inputs in (
        ("dynamics", phase.f, running),
        ("objective", phase.w, running),
        ("path", phase.h, running),
        ("at_start", phase.at_start, running),
        ("at_end", phase.at_end, running),
        ("boundary", phase.g, ends),
        ("terminal", phase.terminal, ends),
    ):
        given = getattr(problem, name)
        if given is None:
            continue
        function = given[0] if isinstance(given, (tuple, list)) else given
        points = [_point(problem, inputs, random) for _ in range(samples)]
        found.append(_compare(name, function, traced, inputs, points))
    return found


def _point(
    problem: Problem, inputs: list[tuple[str, int]], random: np.random.Generator
) -> list[FloatArray]:
    """Return arguments near the guess, shaken by a tenth of their size."""
    start = problem.start
    sigma = random.uniform(0.0, 1.0, 1)
    middle, u = (part[0] for part in start.sample(sigma))
    first, last = start.sample(np.array([0.0, 1.0]))[0]
    known = {
        "t": start.t0 + sigma * (start.tf - start.t0),
        "x": middle,
        "u": u,
        "p": start.parameters,
        "t0": np.array([start.t0]),
        "tf": np.array([start.tf]),
        "x0": first,
        "xf": last,
    }
    return [
        known[name] + 0.1 * (1.0 + np.abs(known[name])) * random.uniform(-1.0, 1.0, size)
        for name, size in inputs
    ]


def _compare(
    name: str,
    function: Any,
    traced: Any,
    inputs: list[tuple[str, int]],
    points: list[list[FloatArray]],
) -> DerivativeCheck:
    columns = [casadi.SX.sym(label, size) for label, size in inputs]
    value = traced(*columns)[: traced.numel_out(0)]
    jacobian = casadi.Function(
        "jacobian", columns, [casadi.jacobian(value, casadi.vertcat(*columns))]
    )
    labels = [
        label if label in ("t", "t0", "tf") else f"{label}[{i}]"
        for label, size in inputs
        for i in range(size)
    ]
    value_error, worst, where = 0.0, 0.0, ""
    for point in points:
        plain = _call(function, inputs, point)
        rows = len(plain)
        exact = np.ravel(traced(*point).full())[:rows]
        value_error = max(value_error, _largest(exact - plain, plain)[0])
        slopes = np.asarray(jacobian(*point).full())[:rows]
        flat, differences = np.concatenate(point), np.empty_like(slopes)
        sizes = np.cumsum([size for _, size in inputs])[:-1]
        for j in range(len(flat)):
            step = np.zeros_like(flat)
            step[j] = 1e-5 * (1.0 + abs(flat[j]))
            sides = [_call(function, inputs, np.split(flat + s * step, sizes)) for s in (1, -1)]
            differences[:, j] = (sides[0] - sides[1]) / (2 * step[j])
        error, index = _largest(slopes - differences, slopes)
        if error > worst or not where:
            row, column = divmod(index, len(labels))
            worst, where = error, f"{name}[{row}] by {labels[column]}"
    return DerivativeCheck(name, value_error, worst, where)


def _call(function: Any, inputs: list[tuple[str, int]], point: list[FloatArray]) -> FloatArray:
    """Return what the plain Python function gives on numbers."""
    arguments = [
        float(values[0]) if label in ("t", "t0", "tf") else values
        for (label, size), values in zip(inputs, point, strict=True)
        if size or label != "p"
    ]
    returned = function(*arguments)
    parts = returned if isinstance(returned, (list, tuple)) else [returned]
    flat = [np.ravel(np.asarray(part, dtype=np.float64)) for part in parts]
    return np.concatenate(flat) if flat else np.zeros(0)


def _largest(difference: FloatArray, value: FloatArray) -> tuple[float, int]:
    relative = np.abs(difference) / (1.0 + np.abs(value))
    index = int(np.argmax(relative)) if relative.size else 0
    return (float(relative.ravel()[index]) if relative.size else 0.0), index
