"""How the solver got there: objective terms, violations and radius."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.style import ACCENT, GRID, INK, MUTED, SERIES, tidy

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
    """Draw objective, violations and radius, once over iterations and once over seconds.

    Parameters
    ----------
    columns : sequence of (Axes, Axes, Axes)
        Axes for objective, violations and radius; the first column is over iterations, a second
        one over seconds.
    history : sequence of IterationRecord
        Records of the solve.
    """
    iterations = np.array([r.iteration for r in history], dtype=np.float64)
    seconds = np.array([r.elapsed for r in history])
    stages = np.array([r.stage for r in history])
    for k, ((objective, violation, radius), along) in enumerate(
        zip(columns, (iterations, seconds), strict=False)
    ):
        first = k == 0
        _draw_objective(objective, along, history, first)
        _draw_violations(violation, along, history, first)
        _draw_radius(radius, along, history, first)
        radius.set_xlabel("iteration" if first else "time [s]", fontsize=9, color=MUTED)
        for axes in (objective, violation, radius):
            for change in along[1:][np.diff(stages) != 0]:
                axes.axvline(change, color=MUTED, linewidth=0.7, linestyle=":", zorder=0)


def _draw_objective(
    axes: Axes, along: FloatArray, history: Sequence[IterationRecord], first: bool
) -> None:
    tidy(axes, "Objective and its terms" if first else "")
    total = _column(history, "objective")
    names = list(dict.fromkeys(name for record in history for name in record.objective_terms))
    for name, color in zip(names, np.resize(SERIES, len(names)), strict=True):
        values = np.array([r.objective_terms.get(name, np.nan) for r in history])
        if np.nanmax(values, initial=0.0) > SMALLEST_SHARE * np.nanmax(total, initial=0.0):
            _line(axes, along, values, str(color), name.replace("_", " "), 1.1)
    _line(axes, along, total, INK, "total", 1.8)
    _legend(axes, first)


def _draw_violations(
    axes: Axes, along: FloatArray, history: Sequence[IterationRecord], first: bool
) -> None:
    tidy(axes, "Violation of physics" if first else "")
    _line(axes, along, _column(history, "constraint_violation"), SERIES[0], "‖C‖∞ [N, N·m]", 1.4)
    _line(axes, along, _column(history, "frame_violation"), ACCENT, "worst frame / weight", 1.4)
    _legend(axes, first)


def _draw_radius(
    axes: Axes, along: FloatArray, history: Sequence[IterationRecord], first: bool
) -> None:
    tidy(axes, "Trust region" if first else "")
    step, accepted = _column(history, "step_norm"), np.array([r.accepted for r in history])
    _line(axes, along, _column(history, "radius"), INK, "radius", 1.4)
    for taken, color, label in ((True, SERIES[2], "step taken"), (False, ACCENT, "step refused")):
        shown = (accepted == taken) & (step > 0)
        if shown.any():
            axes.scatter(along[shown], step[shown], s=5, color=color, linewidths=0, label=label)
    _legend(axes, first)


def _line(
    axes: Axes, along: FloatArray, values: FloatArray, color: str, label: str, width: float
) -> None:
    """Draw the positive part of a curve on a logarithmic scale."""
    from matplotlib.ticker import NullFormatter

    positive = np.where(values > 0, values, np.nan)
    if np.isfinite(positive).any():
        axes.plot(along, positive, color=color, linewidth=width, label=label)
        axes.set_yscale("log")
        axes.yaxis.set_minor_formatter(NullFormatter())


def _column(history: Sequence[IterationRecord], name: str) -> FloatArray:
    return np.array([getattr(record, name) for record in history], dtype=np.float64)


def _legend(axes: Axes, shown: bool) -> None:
    if shown and axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=7.5, labelcolor=INK, edgecolor=GRID, framealpha=0.9, loc="best")
