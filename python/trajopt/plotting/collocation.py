"""Pictures of collocation solutions: curves, errors, iterations, phase plane, stop action.

After figures 9 to 18 of Kelly's tutorial. Every function returns a matplotlib figure;
``figure.savefig(path)`` writes it. Units are taken from names that end with them, such as
``x_names=["cart [m]", "cart rate [m/s]"]``.
"""

from __future__ import annotations

import math
import re
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
    """Axes over the same time, column by column: positions stand beside their rates."""
    columns = min(COLUMNS, count)
    rows = -(-count // columns)
    page = figure(WIDTH, ROW * rows + 0.4)
    places = [(k % rows) * columns + k // rows + 1 for k in range(count)]
    axes = [page.add_subplot(rows, columns, place) for place in places]
    for k, ax in enumerate(axes):
        tidy(ax)
        if k + 1 < count and (k + 1) % rows:  # not the lowest of its column
            ax.tick_params(labelbottom=False)
        else:
            ax.set_xlabel("time [s]")
    return page, axes


def _name_and_unit(name: str) -> tuple[str, str]:
    """Return the parts of ``cart [m]``; no unit is "".

    Examples
    --------
    >>> _name_and_unit("cart rate [m/s]"), _name_and_unit("x[0]")
    (('cart rate', 'm/s'), ('x[0]', ''))
    """
    found = re.fullmatch(r"(.+?) +\[(.+)\]", name)
    return (found[1], found[2]) if found else (name, "")


def _rate(unit: str) -> str:
    """Return the unit of a time derivative.

    Examples
    --------
    >>> _rate("rad"), _rate("rad/s"), _rate("")
    ('rad/s', 'rad/s²', '')
    """
    return f"{unit}²" if unit.endswith("/s") else f"{unit}/s" if unit else ""


def _label_in_powers(axes: Axes, unit: str) -> None:
    """Label an axis of small numbers by multiples of a power of ten, which joins the unit."""
    largest = max(abs(v) for v in axes.get_ylim())
    power = 3 * math.floor(math.log10(largest) / 3) if 0 < largest < 0.1 else 0
    axes.yaxis.set_major_formatter(lambda value, _: f"{value / 10.0**power:g}".replace("-", "−"))
    exponent = str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    parts = [f"10{exponent}" if power else "", unit]
    label = " ".join(part for part in parts if part)
    axes.set_ylabel(f"[{label}]" if label else "")


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
        title, unit = _name_and_unit(name)
        tidy(ax, title, ax.get_xlabel(), f"[{unit}]" if unit else "")
        if known is not None:
            ax.plot(t, known[:, i], color=MUTED, linewidth=1.2, linestyle="--", label="exact")
            ax.legend(fontsize=8, frameon=False)
        ax.plot(t, values[:, i], color=color, linewidth=1.6)
        ax.plot(solution.t, knots[:, i], ".", color=color, markersize=4)
    page.align_ylabels()
    return page


def plot_errors(solution: Solution) -> Figure:
    """Draw ε(t) of every state, and its integral η over every segment (Kelly, figure 11)."""
    count, t = solution.x.shape[1], _times(solution)
    page = figure(WIDTH, 0.4 + 1.4 * count)
    middle, width = 0.5 * (solution.t[1:] + solution.t[:-1]), np.diff(solution.t)
    defect = solution.defect(t)
    for i, name in enumerate(solution.x_names):
        color, last = SERIES[i % len(SERIES)], i == count - 1
        title, unit = _name_and_unit(name)
        left = page.add_subplot(count, 2, 2 * i + 1)
        tidy(left, f"{title}: error in the slope", "time [s]" if last else "")
        left.plot(t, defect[:, i], color=color, linewidth=1.0)
        left.plot(solution.t, np.zeros_like(solution.t), ".", color=INK, markersize=3)
        right = page.add_subplot(count, 2, 2 * i + 2)
        tidy(right, f"{title}: error per segment", "time [s]" if last else "")
        right.bar(middle, solution.error[:, i], 0.9 * width, color=color)
        for axes, of in ((left, _rate(unit)), (right, unit)):
            _label_in_powers(axes, of)
            axes.tick_params(labelbottom=last)
    page.align_ylabels()
    return page


def plot_iterations(solution: Solution) -> Figure:
    """Draw objective, constraint violation and step over the iterations of the last pass."""
    if not solution.history:
        raise ArgumentError("plot_iterations: the solver left no history")
    page = figure(WIDTH, ROW + 0.4)
    axes = [page.add_subplot(1, 2, 1), page.add_subplot(1, 2, 2)]
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
    page = figure(WIDTH, ROW + 1.1)
    axes = page.add_subplot()
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
    _time_bar(page, axes, lines)
    return page


def plot_stop_action(
    frames: Sequence[Sequence[ArrayLike]], times: ArrayLike, ground: float | None = 0.0
) -> Figure:
    """Draw poses of a mechanism, coloured by time (Kelly, figures 9 and 13).

    The page is as wide as the motion needs.

    Parameters
    ----------
    frames : sequence of poses
        A pose is a list of (m, 2) polylines [m].
    times : (frames,) array_like
        Times of the poses [s].
    ground : float, optional
        Height of a ground line [m]; None draws none.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    when = np.asarray(times, dtype=np.float64)
    if len(when) != len(frames) or not len(frames):
        raise ArgumentError(
            f"plot_stop_action: {len(frames)} poses and {len(when)} times, expected as many"
        )
    poses = [[np.asarray(line, dtype=np.float64) for line in pose] for pose in frames]
    wide, high = np.ptp(np.concatenate([line for pose in poses for line in pose]), axis=0)
    page = figure(float(np.clip(1.8 + 3.0 * wide / max(high, 1e-9), 4.0, WIDTH)), 3.8)
    axes = page.add_subplot()
    tidy(axes, "", "horizontal [m]", "vertical [m]")
    colors = ScalarMappable(Normalize(when.min(), when.max()), time_colors())
    for pose, t in zip(poses, when, strict=True):
        color = colors.to_rgba(t)
        for line in pose:
            axes.plot(line[:, 0], line[:, 1], "-o", color=color, linewidth=1.8, markersize=3)
    if ground is not None:
        axes.axhline(ground, color=INK, linewidth=0.8, zorder=0)
    axes.set_aspect("equal")
    _time_bar(page, axes, colors)
    return page


def _time_bar(page: Figure, axes: Axes, colors: Any) -> None:
    bar = page.colorbar(colors, ax=axes)
    bar.set_label("time [s]", fontsize=9, color=MUTED)
    bar.ax.tick_params(labelsize=8, colors=MUTED)
    bar.outline.set_visible(False)
