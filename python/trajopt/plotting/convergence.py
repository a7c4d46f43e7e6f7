"""How the solver got there: objective terms, violations and steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.style import ACCENT, INK, MUTED, SERIES, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from trajopt.records import IterationRecord

__all__ = ["draw_convergence"]

FloatArray = NDArray[np.float64]

# Terms below this share of the largest objective are left out: they only crowd the picture.
SMALLEST_SHARE = 1e-6


def draw_convergence(
    columns: Sequence[tuple[Axes, Axes, Axes]], history: Sequence[IterationRecord]
) -> None:
    """Draw objective, violations and steps, once over iterations and once over seconds.

    Parameters
    ----------
    columns : sequence of (Axes, Axes, Axes)
        Axes for objective, violations and steps; the first column is over iterations, a second
        one over seconds.
    history : sequence of IterationRecord
        Records of the solve.
    """
    iterations = np.array([r.iteration for r in history], dtype=np.float64)
    seconds = np.array([r.elapsed for r in history])
    stages = np.array([r.stage for r in history])
    for axes, along, label in zip(
        columns, (iterations, seconds), ("iteration", "time [s]"), strict=False
    ):
        objective, violation, step = axes
        _draw_objective(objective, along, history)
        _draw_violations(violation, along, history)
        _draw_steps(step, along, history)
        step.set_xlabel(label, fontsize=9, color=MUTED)
        for row in axes:
            for change in along[1:][np.diff(stages) != 0]:
                row.axvline(change, color=MUTED, linewidth=0.7, linestyle=":", zorder=0)
    titles = ("Objective and its terms", "Violation of physics", "Steps")
    for left, right, title in zip(columns[0], columns[-1], titles, strict=True):
        left.set_title(title, loc="left", fontsize=10, color=INK, fontweight="bold")
        if right.get_legend_handles_labels()[0]:
            right.legend(
                fontsize=7.5, labelcolor=INK, frameon=False, loc="upper left", bbox_to_anchor=(1, 1)
            )


def _draw_objective(axes: Axes, along: FloatArray, history: Sequence[IterationRecord]) -> None:
    tidy(axes)
    total = _column(history, "objective")
    names = list(dict.fromkeys(name for record in history for name in record.objective_terms))
    _line(axes, along, total, INK, "total", 1.8)
    for number, name in enumerate(names):
        color = SERIES[number % len(SERIES)]
        dashes = "-" if number < len(SERIES) else "--"  # colours come again: another line
        values = np.array([r.objective_terms.get(name, np.nan) for r in history])
        if np.nanmax(values, initial=0.0) > SMALLEST_SHARE * np.nanmax(total, initial=0.0):
            _line(axes, along, values, color, name.replace("_", " "), 1.1, dashes)


def _draw_violations(axes: Axes, along: FloatArray, history: Sequence[IterationRecord]) -> None:
    tidy(axes)
    _line(axes, along, _column(history, "constraint_violation"), SERIES[0], "‖C‖∞ [N, N·m]", 1.4)
    _line(axes, along, _column(history, "frame_violation"), ACCENT, "worst frame / weight", 1.4)


def _draw_steps(axes: Axes, along: FloatArray, history: Sequence[IterationRecord]) -> None:
    """Draw what was tried, and the trust region's radius or the damping that bounded it."""
    tidy(axes)
    _line(axes, along, _column(history, "radius"), INK, "radius", 1.4)
    _line(axes, along, _column(history, "damping"), MUTED, "damping λ", 1.2)
    step, accepted = _column(history, "step_norm"), np.array([r.accepted for r in history])
    for taken, color, label in ((True, SERIES[2], "step taken"), (False, ACCENT, "step refused")):
        shown = (accepted == taken) & (step > 0)
        if shown.any():
            axes.scatter(along[shown], step[shown], s=5, color=color, linewidths=0, label=label)
            axes.set_yscale("log")


def _line(
    axes: Axes,
    along: FloatArray,
    values: FloatArray,
    color: str,
    label: str,
    width: float,
    dashes: str = "-",
) -> None:
    """Draw the positive part of a curve on a logarithmic scale."""
    from matplotlib.ticker import NullFormatter

    positive = np.where(values > 0, values, np.nan)
    if np.isfinite(positive).any():
        axes.plot(along, positive, color=color, linewidth=width, linestyle=dashes, label=label)
        axes.set_yscale("log")
        axes.yaxis.set_minor_formatter(NullFormatter())


def _column(history: Sequence[IterationRecord], name: str) -> FloatArray:
    return np.array([getattr(record, name) for record in history], dtype=np.float64)
