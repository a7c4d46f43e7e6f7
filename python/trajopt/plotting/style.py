"""Colours and axes shared by all pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from trajopt.errors import MissingDependencyError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["ACCENT", "GRID", "INK", "MUTED", "SERIES", "figure", "tidy", "time_colors"]

INK = "#22252b"
MUTED = "#7a808c"
GRID = "#e6e8ec"
ACCENT = "#d1495b"
# Distinguishable with the common kinds of colour blindness (after Okabe and Ito).
SERIES = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#7a6f45", "#5b4b8a")


def figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches.

    Raises
    ------
    MissingDependencyError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingDependencyError("matplotlib", "Plotting", extra="plot") from error
    return Figure(figsize=(width, height), dpi=150, facecolor="white", layout="constrained")


def time_colors() -> Any:
    """Return the colormap for time: dark blue at the start, warm at the end, never too pale."""
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    plasma = colormaps["plasma"]
    return LinearSegmentedColormap.from_list("time", [plasma(0.86 * k / 31) for k in range(32)])


def tidy(axes: Axes, title: str = "", x: str = "", y: str = "") -> None:
    """Give axes the common look and their labels."""
    axes.set_title(title, loc="left", fontsize=10, color=INK, fontweight="bold")
    axes.set_xlabel(x, fontsize=9, color=MUTED)
    axes.set_ylabel(y, fontsize=9, color=MUTED)
    axes.tick_params(labelsize=8, colors=MUTED)
    axes.grid(visible=True, color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(GRID)
