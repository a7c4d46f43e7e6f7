"""Meshes of the phases, with the degrees of their segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import finite_array, whole
from trajopt.errors import ArgumentError

__all__ = ["Grid", "make_grids", "make_mesh"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Grid:
    """Knots of a phase as shares of its time, and the degree of its segments, if any is chosen."""

    mesh: FloatArray
    degree: int | Sequence[int] | None = None


def make_mesh(segments: Any) -> FloatArray:
    """Return the knots in [0, 1] of a number of segments, or of a list of knots."""
    if isinstance(segments, (int, np.integer)) or not np.ndim(segments):
        return np.linspace(0.0, 1.0, whole("solve", "segments", segments, 1) + 1)
    mesh = finite_array("solve", "segments", segments, (None,))
    if len(mesh) < 2 or np.any(np.diff(mesh) <= 0):
        raise ArgumentError(
            f"solve: segments as an array of knots must rise, at least two, not {segments!r}"
        )
    return np.asarray((mesh - mesh[0]) / (mesh[-1] - mesh[0]), dtype=np.float64)


def make_grids(phases: int | None, segments: Any, degree: Any) -> list[Grid]:
    """Return one grid per phase; `phases` is None for a problem that has just one.

    For several phases `segments` may have an entry for each, a number above 0 or knots, and
    `degree` too, a number or one per segment.
    """
    if phases is None:
        return [Grid(make_mesh(segments), degree)]
    meshes = list(segments) if _one_each(segments, phases) else [segments] * phases
    degrees = [degree] * phases
    if isinstance(degree, (list, tuple, np.ndarray)):
        degrees = list(degree)
        if len(degrees) != phases:
            raise ArgumentError(
                f"solve: degree has {len(degrees)} entries, expected one for each of the "
                f"{phases} phases"
            )
    return [Grid(make_mesh(m), n) for m, n in zip(meshes, degrees, strict=True)]


def _one_each(segments: Any, phases: int) -> bool:
    """Return whether `segments` has an entry per phase, rather than knots for all of them."""
    if not isinstance(segments, (list, tuple)) or len(segments) != phases:
        return False
    numbers = (int, np.integer)
    lists = (list, tuple, np.ndarray)
    return all(isinstance(s, lists) or (isinstance(s, numbers) and s > 0) for s in segments)
