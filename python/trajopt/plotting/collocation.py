"""Pictures of collocation solutions: curves, errors, iterations, phase plane, stop action.

After figures 9 to 18 of Kelly's tutorial. Every function returns a matplotlib figure;
``figure.savefig(path)`` writes it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.checks import whole
from trajopt.errors import ArgumentError
from trajopt.plotting.style import ACCENT, INK, MUTED, SERIES, figure, tidy, time_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from trajopt.collocation import Solution

__all__ = [
    "plot_controls",
    "plot_errors",
    "plot_iterations",
    "plot_phase_plane",
    "plot_states",
    "plot_stop_action",
]

FloatArray = NDArray[np.float64]
# Points of a curve per segment, so that the method's polynomials are seen as they are.
PER_SEGMENT = 12
COLUMNS = 2
WIDTH, ROW = 8.0, 1.9


def _times(solution: Solution) -> FloatArray:
    shares = np.arange(PER_SEGMENT) / PER_SEGMENT
    fine = solution.t[:-1, None] + shares * np.diff(solution.t)[:, None]
    return np.append(fine.ravel(), solution.t[-1])


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    page = figure(WIDTH, ROW * rows + 0.4)
    return page, [page.add_subplot(rows, columns, k + 1) for k in range(count)]


def plot_states(solution: Solution, exact: Any = None) -> Figure:
    """Draw every state over time: a curve, and dots at the knots.

    Parameters
    ----------
    solution : Solution
    exact : callable, optional
        Times (m,) -> states (m, nx), drawn dashed.

    Returns
    -------
    Figure
    """
    return _curves(solution, solution.state, solution.x, solution.x_names, exact)


def plot_controls(solution: Solution, exact: Any = None) -> Figure:
    """Draw every control over time; see `plot_states`."""
    if not solution.u.shape[1]:
        raise ArgumentError("plot_controls: the problem has no controls")
    return _curves(solution, solution.control, solution.u, solution.u_names, exact)


def _curves(
    solution: Solution, curve: Any, knots: FloatArray, names: Sequence[str], exact: Any
) -> Figure:
    page, axes = _grid(knots.shape[1])
    t = _times(solution)
    values = curve(t)
    known = None if exact is None else np.asarray(exact(t), dtype=np.float64)
    for i, (ax, name) in enumerate(zip(axes, names, strict=True)):
        color = SERIES[i % len(SERIES)]
        tidy(ax, name, "time [s]" if i >= len(axes) - COLUMNS else "")
        if known is not None:
            ax.plot(t, known[:, i], color=MUTED, linewidth=1.2, linestyle="--", label="exact")
            ax.legend(fontsize=8, frameon=False)
        ax.plot(t, values[:, i], color=color, linewidth=1.6)
        ax.plot(solution.t, knots[:, i], ".", color=color, markersize=4)
    return page


def plot_errors(solution: Solution) -> Figure:
    """Draw ε(t) of every state, and its integral η over every segment (Kelly, figure 11)."""
    page = figure(WIDTH, 0.4 + 1.6 * solution.x.shape[1])
    count, t = solution.x.shape[1], _times(solution)
    middle, width = 0.5 * (solution.t[1:] + solution.t[:-1]), np.diff(solution.t)
    defect = solution.defect(t)
    for i, name in enumerate(solution.x_names):
        color, last = SERIES[i % len(SERIES)], i == count - 1
        left = page.add_subplot(count, 2, 2 * i + 1)
        tidy(left, f"error in the slope of {name}", "time [s]" if last else "")
        left.plot(t, defect[:, i], color=color, linewidth=1.0)
        left.plot(solution.t, np.zeros_like(solution.t), ".", color=INK, markersize=3)
        right = page.add_subplot(count, 2, 2 * i + 2)
        tidy(right, f"error in {name} per segment", "time [s]" if last else "")
        right.bar(middle, solution.error[:, i], 0.9 * width, color=color)
    return page


def plot_iterations(solution: Solution) -> Figure:
    """Draw objective, constraint violation and step over the iterations of the last pass."""
    if not solution.history:
        raise ArgumentError("plot_iterations: the solver left no history")
    page, axes = _grid(2)
    k = [record["iteration"] for record in solution.history]
    tidy(axes[0], "objective", "iteration")
    axes[0].plot(k, [record["objective"] for record in solution.history], color=SERIES[0])
    tidy(axes[1], "convergence", "iteration")
    for name, color in (
        ("constraint_violation", ACCENT),
        ("dual_infeasibility", SERIES[0]),
        ("barrier", MUTED),
    ):
        values = np.array([record.get(name, np.nan) for record in solution.history])
        shown = np.where(values > 0, values, np.nan)
        axes[1].plot(k, shown, color=color, linewidth=1.3, label=name.replace("_", " "))
    axes[1].set_yscale("log")
    axes[1].legend(fontsize=8, frameon=False)
    return page


def plot_phase_plane(solution: Solution, horizontal: int, vertical: int) -> Figure:
    """Draw one state over another, coloured by time.

    Parameters
    ----------
    solution : Solution
    horizontal, vertical : int
        Indices of the states.
    """
    from matplotlib.collections import LineCollection

    pair = []
    for name, index in (("horizontal", horizontal), ("vertical", vertical)):
        index = whole("plot_phase_plane", name, index, 0)
        if index >= solution.x.shape[1]:
            raise ArgumentError(
                f"plot_phase_plane: {name} = {index}, expected below {solution.x.shape[1]}"
            )
        pair.append(index)
    page, (axes,) = _grid(1)
    t = _times(solution)
    points = solution.state(t)[:, pair]
    tidy(axes, "", *(solution.x_names[i] for i in pair))
    lines = LineCollection(
        [points[k : k + 2] for k in range(len(points) - 1)], cmap=time_colors(), linewidths=1.8
    )
    lines.set_array(t[:-1])
    axes.add_collection(lines)
    knots = solution.x[:, pair]
    axes.plot(knots[:, 0], knots[:, 1], ".", color=MUTED, markersize=3)
    axes.margins(0.06)
    axes.autoscale_view()
    page.colorbar(lines, ax=axes, label="time [s]")
    return page


def plot_stop_action(
    frames: Sequence[Sequence[ArrayLike]], times: ArrayLike, ground: float | None = 0.0
) -> Figure:
    """Draw poses of a mechanism, coloured by time (Kelly, figures 9 and 13).

    Parameters
    ----------
    frames : sequence of poses
        A pose is a list of (m, 2) polylines [m].
    times : (frames,) array_like
        Times of the poses [s].
    ground : float, optional
        Height of a ground line [m]; None draws none.
    """
    when = np.asarray(times, dtype=np.float64)
    if len(when) != len(frames) or not len(frames):
        raise ArgumentError(
            f"plot_stop_action: {len(frames)} poses and {len(when)} times, expected as many"
        )
    page = figure(WIDTH, 3.4)
    axes = page.add_subplot()
    tidy(axes, "", "[m]", "[m]")
    colors, span = time_colors(), max(float(np.ptp(when)), 1e-12)
    for pose, t in zip(frames, when, strict=True):
        color = colors((t - when.min()) / span)
        for polyline in pose:
            points = np.asarray(polyline, dtype=np.float64)
            axes.plot(points[:, 0], points[:, 1], "-o", color=color, linewidth=1.8, markersize=3)
    if ground is not None:
        axes.axhline(ground, color=INK, linewidth=0.8, zorder=0)
    axes.set_aspect("equal")
    return page
