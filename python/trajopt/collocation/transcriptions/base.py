"""What every transcription is: unknowns at points of a segment, and the equations between them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Segment", "Slope", "Transcription"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
# f or w at a point of the segment: (position in [0, 1], x, u) -> value.
Slope = Callable[[float, Any, Any], Any]


@dataclass(frozen=True)
class Segment:
    """Cost and equations of one segment.

    Parameters
    ----------
    cost : expression
        Quadrature of the integrand.
    defects : list of (str, expression)
        Name and nx rows that have to vanish.
    states : dict of float to expression
        States at points where the method has an expression in place of an unknown.
    """

    cost: Any
    defects: list[tuple[str, Any]]
    states: dict[float, Any] = field(default_factory=dict)


class Transcription(ABC):
    """A method that turns a stretch of motion into unknowns and equations.

    Positions are shares of the segment in [0, 1].

    Attributes
    ----------
    state_points, control_points : tuple of float
        Where states and controls are unknowns of the segment's own, below 1.
    shared_end : bool
        Whether the control at the end is the one at the start of the next segment.
    points : tuple of float
        Collocation points: where the interpolant obeys the dynamics exactly.
    order : int
        Order of the global error in the length of the segments, for smooth problems.
    """

    name: str
    state_points: tuple[float, ...]
    control_points: tuple[float, ...]
    shared_end: bool
    points: tuple[float, ...]
    order: int

    @property
    def path_points(self) -> tuple[float, ...]:
        """Where the path constraint holds, below 1."""
        return tuple(c for c in self.points if c < 1)

    # Where segments differ (see `Mixed`), positions are only names of points, and the numbers in
    # which the segments differ are data of the stages.

    def degrees(self, segments: int) -> tuple[int, ...]:
        """Return the degree of every segment; empty where the method has a fixed one."""
        del segments
        return ()

    def data(self, segments: int) -> FloatArray:
        """Return the numbers of every segment that its equations read: (segments, m)."""
        return np.zeros((segments, 0))

    def given(self, data: Any) -> Transcription:
        """Return the method with a row of `data`, as symbols, in its equations."""
        del data
        return self

    def place(self, c: float) -> Any:
        """Return where in [0, 1] the point named c lies: a share, or one of every segment."""
        return c

    def uses(self, c: float, segments: int) -> BoolArray:
        """Return which segments have unknowns at the point named c."""
        del c
        return np.ones(segments, dtype=bool)

    def holds(self, rows: int, segments: int) -> BoolArray:
        """Return which of the equations hold in which segments: (rows, segments)."""
        return np.ones((rows, segments), dtype=bool)

    @abstractmethod
    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return the equations of a segment of duration h with states x and controls u."""

    def pieces(
        self, f: Slope, h: FloatArray, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> list[tuple[float, float, FloatArray, dict[float, FloatArray], dict[float, FloatArray]]]:
        """Return the interpolant's polynomials of all N segments, on numbers.

        Returns
        -------
        list of (start, end, x, slopes, controls)
            For every piece of a segment: its ends in [0, 1], the states (N, nx) at its start,
            and by position within the piece the slopes (N, nx) and controls (N, nu).
        """
        inner = self.inner_states(f, h, x, u)
        states = {**x, **inner}
        slopes = {c: f(c, states[c], u[c]) for c in self.points}
        return [(0.0, 1.0, x[0.0], slopes, {c: u[c] for c in self.points})]

    def inner_states(
        self, f: Slope, h: FloatArray, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> dict[float, FloatArray]:
        """Return the states at collocation points that are not unknowns."""
        del f, h, x, u
        return {}
