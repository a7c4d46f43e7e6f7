"""Stroboscopic picture: poses of the whole motion in one side view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.shapes import Puppet, outline
from trajopt.plotting.style import ACCENT, INK, MUTED, tidy, time_colors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from trajopt.solution import Solution

__all__ = ["draw_motion", "row_count"]

FloatArray = NDArray[np.float64]

ROW_SECONDS = 10.0
MAX_ROWS = 4
# Space between poses as a share of the character's width: less and limbs cannot be told apart.
MIN_GAP, GOOD_GAP = 0.45, 0.75
MIN_POSES, MAX_POSES = 5, 16


@dataclass(frozen=True)
class View:
    """A camera that looks horizontally, across the direction of travel.

    Parameters
    ----------
    right, away : (3,) arrays
        World directions that point right in the picture and away from the camera.
    """

    right: FloatArray
    away: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Return the picture coordinates (..., 2) [m] of world points (..., 3)."""
        return np.stack([points @ self.right, points[..., 2]], axis=-1)


def row_count(solution: Solution) -> int:
    """Return in how many rows a motion is drawn: long ones are cut."""
    duration = float(solution.times[-1] - solution.times[0])
    return int(np.clip(np.ceil(duration / ROW_SECONDS - 0.05), 1, MAX_ROWS))


def draw_motion(figure: Figure, rows: list[Axes], solution: Solution) -> None:
    """Draw poses in equal steps of time, coloured by time, with the path of the center of mass.

    A motion that stays in place is pulled apart to the right, as if the camera moved; the axis
    then says so.

    Parameters
    ----------
    figure : Figure
        Receives the colour bar.
    rows : list of Axes
        One for each part of the motion, `row_count` of them.
    solution : Solution
        Motion to draw.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    puppet = Puppet(solution.model)
    view = _view(solution.center_of_mass)
    colors = ScalarMappable(Normalize(solution.times[0], solution.times[-1]), time_colors())
    parts = np.array_split(np.arange(solution.frames), len(rows))
    top = max(_draw_row(axes, solution, puppet, view, colors, p) for axes, p in zip(rows, parts))
    for axes in rows:
        axes.set_ylim(-0.06 * top, 1.06 * top)
    bar = figure.colorbar(colors, ax=rows, shrink=0.8, aspect=25, pad=0.01)
    bar.outline.set_visible(False)  # type: ignore[operator]
    bar.ax.tick_params(labelsize=8, colors=MUTED, length=0)
    bar.set_label("time [s]", fontsize=9, color=MUTED)


def _draw_row(
    axes: Axes,
    solution: Solution,
    puppet: Puppet,
    view: View,
    colors: object,
    frames: NDArray[np.intp],
) -> float:
    """Draw the poses of one row and return the height of its highest point [m]."""
    path = view.project(solution.center_of_mass[frames])
    width = _width(puppet, view, solution.x[frames[0]])
    count, shift = _spacing(path[:, 0], width)
    # Every frame is shifted in proportion to its time, so that the path stays smooth.
    offset = np.linspace(0.0, shift, len(frames))
    path[:, 0] += offset
    chosen = np.unique(np.linspace(0, len(frames) - 1, count).round().astype(int))
    highest = float(path[:, 1].max())
    for layer, k in enumerate(chosen):
        color = colors.to_rgba(solution.times[frames[k]])[:3]  # type: ignore[attr-defined]
        highest = max(
            highest,
            _draw_pose(axes, puppet.place(solution.x[frames[k]]), view, offset[k], color, layer),
        )
    axes.plot(path[:, 0], path[:, 1], color="white", linewidth=2.6, zorder=900)
    axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.1, zorder=901)
    axes.scatter(path[chosen, 0], path[chosen, 1], s=9, color=INK, zorder=902, linewidths=0)
    _finish(axes, path, width, shifted=shift > 0)
    return highest


def _draw_pose(
    axes: Axes,
    placed: list[tuple[FloatArray, float]],
    view: View,
    shift: float,
    color: tuple[float, float, float],
    layer: int,
) -> float:
    """Draw one pose, far limbs paler and behind, and return its height [m]."""
    from matplotlib.collections import PolyCollection

    depth = np.array([np.mean(points @ view.away) for points, _ in placed])
    order = np.argsort(-depth, kind="stable")
    spread = float(np.ptp(depth))
    base = np.array(color)
    outlines, faces, edges = [], [], []
    for k in order:
        points, radius = placed[k]
        outlines.append(outline(view.project(points), radius) + [shift, 0.0])
        pale = 0.15 + 0.4 * (depth[k] - depth.min()) / spread if spread > 1e-6 else 0.15
        faces.append(base + (1 - base) * pale)
        edges.append(0.72 * base)
    axes.add_collection(
        PolyCollection(outlines, facecolors=faces, edgecolors=edges, linewidths=0.5, zorder=layer + 5)
    )
    return max(float(polygon[:, 1].max()) for polygon in outlines)


def _finish(axes: Axes, path: FloatArray, width: float, *, shifted: bool) -> None:
    tidy(axes, x="distance, pulled apart in time [m]" if shifted else "distance [m]", y="height [m]")
    axes.grid(visible=False)
    axes.axhspan(-10.0, 0.0, color="#f1f2f4", zorder=0, linewidth=0)
    axes.axhline(0.0, color=ACCENT if False else MUTED, linewidth=1.0, zorder=1)
    axes.set_xlim(path[:, 0].min() - 0.75 * width, path[:, 0].max() + 0.75 * width)
    axes.set_aspect("equal", adjustable="box")


def _view(center: FloatArray) -> View:
    """Look across the travel of the center of mass; along y if it hardly travels."""
    travel = center[-1, :2] - center[0, :2]
    length = float(np.linalg.norm(travel))
    across = np.array([1.0, 0.0]) if length < 0.05 else travel / length
    if across[0] < -1e-6:  # keep x pointing right, whichever way the character goes
        across = -across
    return View(np.array([*across, 0.0]), np.array([-across[1], across[0], 0.0]))


def _width(puppet: Puppet, view: View, x: FloatArray) -> float:
    """Return how wide the character is in the picture [m]."""
    outlines = [outline(view.project(points), radius) for points, radius in puppet.place(x)]
    corners = np.concatenate(outlines)
    return float(max(np.ptp(corners[:, 0]), 0.35 * np.ptp(corners[:, 1])))


def _spacing(along: FloatArray, width: float) -> tuple[int, float]:
    """Return the number of poses and the shift [m] between the first and the last one."""
    travel = abs(float(along[-1] - along[0]))
    count = int(np.clip(round(travel / (GOOD_GAP * width)) + 1, MIN_POSES, MAX_POSES))
    if travel >= MIN_GAP * width * (count - 1):
        return count, 0.0
    count = max(count, 9)
    shift = 1.05 * width * (count - 1) - travel
    return count, shift if along[-1] >= along[0] else -shift
