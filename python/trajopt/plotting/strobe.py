"""Stroboscopic picture: poses of the whole motion in one side view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.camera import Strip, View, look_across, plan_strip, silhouette_size
from trajopt.plotting.shapes import Puppet, outline
from trajopt.plotting.style import ACCENT, INK, MUTED, tidy, time_colors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure

    from trajopt.solution import Solution

__all__ = ["Strobe"]

FloatArray = NDArray[np.float64]

ROW_SECONDS = 10.0
MAX_ROWS = 4
# Height of the arrow of a force as large as the body weight, as a share of the picture's height;
# forces below the second share of the weight have no arrow.
ARROW, SMALLEST_ARROW = 0.3, 0.05
LEAST_ASPECT = 2.2  # of the ground in the picture to its height


class Strobe:
    """Poses in equal steps of time, coloured by time, with the path of the center of mass.

    A motion that stays in place is pulled apart to the right, as if the camera moved; the axis
    then shows time. Long motions are cut into rows.

    Parameters
    ----------
    solution : Solution
        Motion to draw.
    """

    def __init__(self, solution: Solution) -> None:
        self._solution = solution
        self._puppet = Puppet(solution.model)
        self._center = solution.model.center_of_mass(solution.x)
        self._view = look_across(self._center)
        duration = float(solution.times[-1] - solution.times[0])
        rows = int(np.clip(np.ceil(duration / ROW_SECONDS - 0.05), 1, MAX_ROWS))
        cuts = np.array_split(np.arange(solution.frames), rows)
        width = max(silhouette_size(self._puppet, self._view, solution.x[c[0]])[0] for c in cuts)

        def plan(*, apart: bool) -> list[Strip]:
            place = (self._puppet, self._view, solution.x, self._center)
            return [plan_strip(*place, frames, width=width, apart=apart) for frames in cuts]

        self.strips = plan(apart=False)
        if any(strip.pulled_apart for strip in self.strips):  # one kind of axis for all rows
            self.strips = plan(apart=True)
        self._top = 1.06 * max(strip.top for strip in self.strips)
        # A short motion gets more ground, so that the picture is never narrower than the page.
        spans = [strip.right - strip.left for strip in self.strips]
        self._span = max(*spans, LEAST_ASPECT * self._top)

    def height(self, width: float) -> float:
        """Return how high the picture is when it is `width` wide, labels and all [inch]."""
        row = (width - 1.6) * 1.06 * self._top / self._span
        return len(self.strips) * (max(row, 0.7) + 0.65)

    def draw(self, cell: SubFigure, rows: Sequence[Axes]) -> None:
        """Draw one strip into each of `rows`, and the colour bar into `cell`."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        times = self._solution.times
        colors = ScalarMappable(Normalize(times[0], times[-1]), time_colors())
        for axes, strip in zip(rows, self.strips, strict=True):
            self._draw_strip(axes, strip, colors)
        bar = cell.colorbar(colors, ax=list(rows), aspect=18, pad=0.01, fraction=0.03)
        bar.outline.set_visible(False)
        bar.ax.tick_params(labelsize=8, colors=MUTED, length=0)
        bar.set_label("time [s]", fontsize=9, color=MUTED)

    def _draw_strip(self, axes: Axes, strip: Strip, colors: Any) -> None:
        solution = self._solution
        path = self._view.project(self._center[strip.frames])
        path[:, 0] += strip.offset
        for layer, k in enumerate(strip.chosen):
            frame, shift = strip.frames[k], float(strip.offset[k])
            color = np.array(colors.to_rgba(solution.times[frame])[:3])
            placed = self._puppet.place(solution.x[frame])
            _draw_pose(axes, placed, self._view, shift, color, layer + 5)
            self._draw_forces(axes, int(frame), shift)
        axes.plot(path[:, 0], path[:, 1], color="white", linewidth=2.4, zorder=900)
        axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.0, zorder=901)
        marks = path[strip.chosen]
        axes.scatter(marks[:, 0], marks[:, 1], s=8, color=INK, zorder=902, linewidths=0)

        tidy(axes, x="distance [m]", y="height [m]")
        axes.grid(visible=False)
        axes.axhspan(-self._top, 0.0, color="#f1f2f4", zorder=0, linewidth=0)
        axes.axhline(0.0, color=MUTED, linewidth=1.0, zorder=1)
        left = strip.left - (self._span - strip.right + strip.left) / 2
        axes.set_xlim(left, left + self._span)
        axes.set_ylim(-0.06 * self._top, self._top)
        axes.set_aspect("equal", adjustable="box", anchor="W")
        if strip.pulled_apart:
            shown = solution.times[strip.frames[strip.chosen]]
            axes.set_xticks(marks[:, 0], [f"{time:.2f}" for time in shown])
            axes.set_xlabel("time [s]", fontsize=9, color=MUTED)

    def _draw_forces(self, axes: Axes, frame: int, shift: float) -> None:
        """Draw the contact forces of a frame as arrows that end where they act."""
        solution = self._solution
        if not solution.contact_forces.size:
            return
        force = self._view.project(solution.contact_forces[frame]) / solution.body_weight
        loaded = np.linalg.norm(force, axis=1) > SMALLEST_ARROW
        tip = self._view.project(solution.contact_points[frame])[loaded] + [shift, 0.0]
        arrow = ARROW * self._top * force[loaded]
        axes.quiver(
            *tip.T,
            *arrow.T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.0014,
            headwidth=4,
            headlength=5,
            color=ACCENT,
            zorder=800,
        )


def _draw_pose(
    axes: Axes,
    placed: list[tuple[FloatArray, float]],
    view: View,
    shift: float,
    color: FloatArray,
    layer: int,
) -> None:
    """Draw the silhouettes of one pose, those far from the camera paler and behind."""
    from matplotlib.collections import PolyCollection

    depth = np.array([np.mean(points @ view.away) for points, _ in placed])
    spread = float(np.ptp(depth))
    far = (depth - depth.min()) / spread if spread > 1e-6 else np.zeros_like(depth)
    order = np.argsort(-depth, kind="stable")
    moved = np.array([shift, 0.0])
    outlines = [outline(view.project(placed[k][0]), placed[k][1]) + moved for k in order]
    pale = (0.12 + 0.45 * far[order])[:, None]
    axes.add_collection(
        PolyCollection(
            outlines,
            facecolors=color + (1.0 - color) * pale,
            edgecolors=[0.7 * color],
            linewidths=0.5,
            zorder=layer,
        )
    )
