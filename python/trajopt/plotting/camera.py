"""Where the camera of the stroboscopic picture stands, and which moments it takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trajopt.plotting.shapes import Puppet, outline

__all__ = ["Strip", "View", "look_across", "plan_strip", "silhouette_size"]

FloatArray = NDArray[np.float64]

# Step from pose to pose as a share of the character's width: below the first number limbs of
# neighbours cover each other; the second one is aimed at.
MIN_GAP, GOOD_GAP, PULLED_GAP = 0.4, 0.6, 1.05
MIN_POSES, MAX_POSES, PULLED_POSES = 5, 16, 9


@dataclass(frozen=True)
class View:
    """A camera that looks horizontally.

    Parameters
    ----------
    right, away : (3,) arrays
        World directions that point right in the picture and away from the camera.
    """

    right: FloatArray
    away: FloatArray

    def project(self, points: FloatArray) -> FloatArray:
        """Return the picture coordinates (..., 2) [m] of world points or vectors (..., 3)."""
        return np.stack([points @ self.right, points[..., 2]], axis=-1)


def look_across(center: FloatArray) -> View:
    """Return the view across the travel of the center of mass (N, 3); x and right agree.

    Examples
    --------
    >>> look_across(np.array([[0.0, 0.0, 1.0], [-2.0, 0.0, 1.0]])).right.tolist()
    [1.0, 0.0, 0.0]
    """
    travel = center[-1, :2] - center[0, :2]
    length = float(np.linalg.norm(travel))
    across = np.array([1.0, 0.0]) if length < 0.05 else travel / length
    if across[0] < -1e-6:
        across = -across
    across = across + 0.0  # no negative zeros
    return View(np.array([*across, 0.0]), np.array([-across[1], across[0], 0.0]))


@dataclass(frozen=True)
class Strip:
    """One row of the picture.

    Parameters
    ----------
    frames : (n,) array of int
        Frames of the row, without gaps.
    chosen : (m,) array of int
        Positions in `frames` of the poses that are drawn.
    offset : (n,) array
        How far each frame is moved to the right [m]: 0 where the motion itself leaves room.
    left, right, top : float
        Extent of the row [m].
    """

    frames: NDArray[np.intp]
    chosen: NDArray[np.intp]
    offset: FloatArray
    left: float
    right: float
    top: float

    @property
    def pulled_apart(self) -> bool:
        """Whether poses are moved, so that places in the picture are times, not distances."""
        return bool(self.offset.any())


def plan_strip(
    puppet: Puppet,
    view: View,
    x: FloatArray,
    center: FloatArray,
    frames: NDArray[np.intp],
    *,
    width: float | None = None,
    apart: bool = False,
) -> Strip:
    """Choose the poses of a row and how far they are pulled apart.

    Parameters
    ----------
    puppet : Puppet
        Draws the character.
    view : View
        Camera.
    x : (N, D) array
        Coordinates of all frames [m, rad].
    center : (N, 3) array
        Center of mass of all frames [m].
    frames : (n,) array of int
        Frames of the row.
    width : float, optional
        Room for a pose [m]; that of the first one by default.
    apart : bool
        Pull poses apart even where the motion leaves room for them.
    """
    along = view.project(center[frames])[:, 0]
    if width is None:
        width, _ = silhouette_size(puppet, view, x[frames[0]])
    count, shift = _spacing(float(along[-1] - along[0]), width, apart)
    # Every frame moves in proportion to its time, so that the path stays smooth.
    offset = np.linspace(0.0, shift, len(frames))
    chosen = np.unique(np.linspace(0, len(frames) - 1, count).round().astype(np.intp))
    tops = [silhouette_size(puppet, view, x[frames[k]])[1] for k in chosen]
    path = along + offset
    return Strip(
        frames,
        chosen,
        offset,
        left=float(path.min()) - 0.75 * width,
        right=float(path.max()) + 0.75 * width,
        top=max(*tops, float(center[frames, 2].max())),
    )


def silhouette_size(puppet: Puppet, view: View, x: FloatArray) -> tuple[float, float]:
    """Return width and top [m] of the character in the picture, at the coordinates `x` (D,)."""
    corners = np.concatenate([outline(view.project(p), r) for p, r in puppet.place(x)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    return float(max(high[0] - low[0], 0.35 * (high[1] - low[1]))), float(high[1])


def _spacing(travel: float, width: float, apart: bool) -> tuple[int, float]:
    """Return the number of poses and the shift [m] between the first and the last one."""
    count = int(np.clip(round(abs(travel) / (GOOD_GAP * width)) + 1, MIN_POSES, MAX_POSES))
    if not apart and abs(travel) >= MIN_GAP * width * (count - 1):
        return count, 0.0
    return PULLED_POSES, PULLED_GAP * width * (PULLED_POSES - 1) - travel
