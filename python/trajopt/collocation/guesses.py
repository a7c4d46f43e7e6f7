"""Ways to a first guess (Kelly, 5.1): a line, poses to pass through, many at random, a family."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.checks import finite_array, positive, whole
from trajopt.collocation.problem import Problem
from trajopt.collocation.solution import Solution
from trajopt.collocation.solver import solve
from trajopt.errors import ArgumentError

__all__ = ["continuation", "keyframes", "line", "scatter"]

FloatArray = NDArray[np.float64]


def line(x0: ArrayLike, xf: ArrayLike, *, t0: float = 0.0, tf: float, u: ArrayLike) -> Any:
    """Return a guess that goes straight from x0 to xf with a constant control.

    Parameters
    ----------
    x0, xf : (nx,) array_like
    t0, tf : float
        Ends of time [s].
    u : (nu,) array_like

    Returns
    -------
    dict
        For `Problem` or `solve`.

    Examples
    --------
    >>> line([0, 0], [1, 0], tf=2.0, u=[0])["t"]
    array([0., 2.])
    """
    start = finite_array("line", "x0", x0, (None,))
    states = np.stack([start, finite_array("line", "xf", xf, start.shape)])
    control = finite_array("line", "u", u, (None,))
    return {"t": np.array([t0, tf]), "x": states, "u": np.stack([control, control])}


def keyframes(
    t: ArrayLike, positions: ArrayLike, *, u: ArrayLike, rates: bool = True, samples: int = 101
) -> Any:
    """Return a guess through poses at given times, smooth in between.

    Parameters
    ----------
    t : (m,) array_like
        Times of the poses, rising [s].
    positions : (m, n) array_like
        Poses.
    u : (nu,) array_like
        Constant control.
    rates : bool
        Whether the state is made of positions and their rates, as in second-order systems; the
        rates then follow from the curve. Otherwise `positions` is the whole state.
    samples : int
        Number of points of the guess.

    Returns
    -------
    dict
        For `Problem` or `solve`.

    Notes
    -----
    Cubic between poses, with zero rate at the ends and the slope of the neighbours at inner poses.

    Examples
    --------
    >>> keyframes([0, 1, 2], [[0.0], [1.0], [0.0]], u=[0])["x"][50]
    array([1., 0.])
    """
    times = finite_array("keyframes", "t", t, (None,))
    poses = finite_array("keyframes", "positions", positions, (None, None))
    control = finite_array("keyframes", "u", u, (None,))
    if len(times) < 2 or len(poses) != len(times) or np.any(np.diff(times) <= 0):
        raise ArgumentError(
            f"keyframes: t must rise and have one time for every pose, {len(times)} times and "
            f"{len(poses)} poses are given"
        )
    slopes = np.zeros_like(poses)
    slopes[1:-1] = (poses[2:] - poses[:-2]) / (times[2:] - times[:-2])[:, None]
    where = np.linspace(times[0], times[-1], samples)
    k = np.clip(np.searchsorted(times, where, side="right") - 1, 0, len(times) - 2)
    h = (times[k + 1] - times[k])[:, None]
    s = (where - times[k])[:, None] / h
    curve = (
        (1 + 2 * s) * (1 - s) ** 2 * poses[k]
        + s * (1 - s) ** 2 * h * slopes[k]
        + s**2 * (3 - 2 * s) * poses[k + 1]
        + s**2 * (s - 1) * h * slopes[k + 1]
    )
    rate = (
        6 * s * (1 - s) * (poses[k + 1] - poses[k]) / h
        + (1 - s) * (1 - 3 * s) * slopes[k]
        + s * (3 * s - 2) * slopes[k + 1]
    )
    x = np.hstack([curve, rate]) if rates else curve
    return {"t": where, "x": x, "u": np.tile(control, (samples, 1))}


def scatter(problem: Problem, count: int, spread: float = 0.5, seed: int = 0) -> list[Any]:
    """Return guesses strewn about the one of a problem, for a search for other optima (5.4).

    Parameters
    ----------
    problem : Problem
    count : int
    spread : float
        Size of the changes, relative to the range of bounds, or to 1 + max |x| where there is none.
    seed : int

    Returns
    -------
    list of dict
        Guesses for `solve`, within the bounds of `problem`.

    Notes
    -----
    To every state and control a sum of three sines is added that vanishes at the ends.

    Examples
    --------
    >>> from trajopt import collocation as col
    >>> problem = col.Problem(dynamics=lambda t, x, u: [u[0]], nx=1, nu=1, tf=1.0, u_bounds=(-1, 1))
    >>> len(scatter(problem, 3))
    3
    """
    count = whole("scatter", "count", count, 0)
    spread = positive("scatter", "spread", spread)
    start, phase, random = problem.start, problem.phase, np.random.default_rng(seed)
    sigma = np.linspace(0.0, 1.0, 51)
    waves = np.sin(np.pi * np.outer(sigma, [1.0, 2.0, 3.0]))
    known = start.sample(sigma)
    guesses = []
    for _ in range(count):
        curves = []
        for values, (lower, upper) in zip(known, (phase.x, phase.u), strict=True):
            span = upper - lower
            size = np.where(np.isfinite(span), 0.5 * span, 1.0 + np.abs(values).max(axis=0))
            changes = waves @ random.uniform(-1.0, 1.0, (3, values.shape[1]))
            curves.append(np.clip(values + spread * size * changes, lower, upper))
        t = start.t0 + sigma * (start.tf - start.t0)
        guesses.append({"t": t, "x": curves[0], "u": curves[1], "p": start.parameters})
    return guesses


def continuation(
    family: Callable[[float], Problem], values: Sequence[float], **settings: Any
) -> list[Solution]:
    """Solve a family of problems, each from the solution before.

    Parameters
    ----------
    family : callable
        Value -> `Problem`; for instance the width of a smoothing, or a load that grows.
    values : sequence of float
        From the easy problem to the one that is wanted.
    **settings
        For `solve`.

    Returns
    -------
    list of Solution
        One per value, up to the first that is not solved; the last is the one wanted, if all are.
    """
    if not len(values):
        raise ArgumentError("continuation: values is empty")
    found: list[Solution] = []
    for value in values:
        guess = {"guess": found[-1]} if found else {}
        found.append(solve(family(value), **{**settings, **guess}))
        if not found[-1].converged:
            break
    return found
