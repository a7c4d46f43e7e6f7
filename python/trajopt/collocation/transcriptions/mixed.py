"""Orthogonal collocation with a degree of its own in every segment."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.polynomials import interpolation_matrix
from trajopt.collocation.transcriptions.base import Segment, Slope, Transcription
from trajopt.collocation.transcriptions.orthogonal import Orthogonal

__all__ = ["Mixed"]

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Mixed(Transcription):
    """A family of orthogonal methods, of another degree from segment to segment.

    All segments have the unknowns and equations of the highest degree. Those that a segment does
    not have are fixed and free, and the points, matrix and weights of every segment are
    data. So one traced function serves all segments, whatever their degrees.

    Parameters
    ----------
    family : callable
        Degree -> method.
    degrees : sequence of int
        One per segment.
    """

    def __init__(self, family: Callable[[int], Orthogonal], degrees: Sequence[int]) -> None:
        self._degrees = np.array(degrees, dtype=int)
        self._own = {int(n): family(int(n)) for n in np.unique(self._degrees)}
        self._full = full = self._own[int(self._degrees.max())]
        self.name, self.shared_end, self.points = full.name, full.shared_end, full.points
        self.state_points, self.control_points = full.state_points, full.control_points
        self.order = min(method.order for method in self._own.values())
        # Points other than the start of a segment that Gauss' method does not collocate at.
        self._names = full.points[: full.degree]

    def degrees(self, segments: int) -> tuple[int, ...]:
        """Return the degree of every segment."""
        del segments
        return tuple(int(n) for n in self._degrees)

    def data(self, segments: int) -> FloatArray:
        """Return points, matrix and weights of every segment, with zeros where it has none."""
        del segments
        rows = {n: self._numbers(method) for n, method in self._own.items()}
        return np.array([rows[int(n)] for n in self._degrees])

    def _numbers(self, method: Orthogonal) -> FloatArray:
        full = self._full
        end, last_row, last_column = full.ends
        places = np.array(method.points[: method.degree])
        return np.concatenate(
            [
                _spread(places, (full.degree,), (False,)),
                _spread(method.matrix, full.matrix.shape, (last_row, last_column)).ravel(),
                _spread(method.weights, full.weights.shape, (end,)),
            ]
        )

    def given(self, data: Any) -> Transcription:
        """Return the method of the highest degree with these numbers in place of its own."""
        full, size = self._full, self._full.degree
        entries = [data[i] for i in range(data.shape[0])]
        rows, columns = full.matrix.shape
        matrix = [entries[size + i * columns : size + (i + 1) * columns] for i in range(rows)]
        places = dict(zip(self._names, entries[:size], strict=True))
        return full.with_numbers(places, matrix, entries[size + rows * columns :])

    def place(self, c: float) -> Any:
        """Return the share of every segment at which the point named c lies."""
        if c not in self._names:
            return c
        return self.data(0)[:, self._names.index(c)]

    def uses(self, c: float, segments: int) -> BoolArray:
        """Return which segments have so many points."""
        if c not in self._names:
            return np.ones(segments, dtype=bool)
        return np.asarray(self._names.index(c) < self._degrees)

    def holds(self, rows: int, segments: int) -> BoolArray:
        """Return which segments have so many equations."""
        full, found = self._full, np.ones((rows, segments), dtype=bool)
        _, last_row, _ = full.ends
        for k, n in enumerate(self._degrees):
            count = len(self._own[int(n)].matrix)
            own = _spread(np.ones(count), (len(full.matrix),), (last_row,))
            found[full.leading :, k] = own > 0
        return found

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Refuse: the equations depend on the segment; see `given`."""
        raise NotImplementedError("the equations of a segment need its data: use given(data)")

    def pieces(
        self, f: Slope, h: FloatArray, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> list[tuple[float, float, FloatArray, dict[float, FloatArray], dict[float, FloatArray]]]:
        """Return every segment's polynomials by their values at the points of the highest degree.

        That is exact: polynomials of a lower degree are among those of the highest.
        """
        del h
        slopes = np.stack([f(c, x[c], u[c]) for c in self.points], axis=1)
        controls = np.stack([u[c] for c in self.points], axis=1)
        to, end = np.array(self.points), self._full.ends[0]
        for n, method in self._own.items():
            rows = self._degrees == n
            own = [*range(n), *([len(self.points) - 1] if end else [])]
            matrix = interpolation_matrix(2 * np.array(method.points) - 1, 2 * to - 1)
            for values in (slopes, controls):
                values[rows] = np.einsum("ij,kjm->kim", matrix, values[rows][:, own])
        by_point = [
            {c: values[:, i] for i, c in enumerate(self.points)} for values in (slopes, controls)
        ]
        return [(0.0, 1.0, x[0.0], by_point[0], by_point[1])]


def _spread(array: FloatArray, shape: tuple[int, ...], last: tuple[bool, ...]) -> FloatArray:
    """Return `array` among zeros: at the front, but the last entry at the end where `last`."""
    wide = np.zeros(shape)
    where = [
        [*range(size - 1), whole - 1] if keep else list(range(size))
        for size, whole, keep in zip(array.shape, shape, last, strict=True)
    ]
    wide[np.ix_(*where)] = array
    return wide
