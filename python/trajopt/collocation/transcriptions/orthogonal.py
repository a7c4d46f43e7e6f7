"""Orthogonal collocation on Chebyshev–Lobatto and Legendre points (Kelly, appendix D).

One segment makes it global, several piecewise. All methods say: the slope of the interpolant is
the polynomial through f at the collocation points. Gauss and Radau points state it by the
differentiation matrix (D.6); on Lobatto points that matrix is singular and the equations of
neighbouring segments would collide at the shared point, so the integral of the same polynomial is
used: with two points it is trapezoidal, with three Hermite–Simpson collocation.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.polynomials import (
    chebyshev_lobatto,
    differentiation_matrix,
    integration_matrix,
    legendre_gauss,
    legendre_lobatto,
    legendre_radau,
    quadrature_weights,
)
from trajopt.collocation.transcriptions.base import Segment, Slope, Transcription

__all__ = ["Gauss", "Lobatto", "Orthogonal", "Radau", "chebyshev", "legendre"]

FloatArray = NDArray[np.float64]


def _shares(points: FloatArray) -> tuple[float, ...]:
    """Return points of [-1, 1] as shares of a segment, its ends exactly 0 and 1."""
    return tuple(float(c) for c in 0.5 * (points + 1.0))


class Orthogonal(Transcription):
    """What the three families share: `degree` points of a segment's own, a matrix and weights.

    Every equation is a row of the matrix, and every cost a sum with the weights, so that segments
    of another degree differ in numbers only.
    """

    degree: int
    # Whether the last entry of (points, rows of the matrix, its columns) belongs to the end.
    ends: tuple[bool, bool, bool]
    # Equations before those of the matrix's rows.
    leading = 0
    matrix: Any
    weights: Any
    _places: dict[float, Any] | None = None

    def degrees(self, segments: int) -> tuple[int, ...]:
        """Return the degree, once per segment."""
        return (self.degree,) * segments

    def place(self, c: float) -> Any:
        """Return c, or the symbol that stands for it."""
        return c if self._places is None else self._places.get(c, c)

    def with_numbers(self, places: Mapping[float, Any], matrix: Any, weights: Any) -> Orthogonal:
        """Return the method with others in place of its points, matrix and weights."""
        other = copy.copy(self)
        other._places, other.matrix, other.weights = dict(places), matrix, weights
        return other


class Lobatto(Orthogonal):
    """Collocation at points that include both ends of a segment.

    Parameters
    ----------
    name : str
    points : (n+1,) array
        Points in [-1, 1], rising, with the ends.
    order : int
        Order of the global error.
    """

    shared_end = True
    ends = (True, True, True)

    def __init__(self, name: str, points: FloatArray, order: int) -> None:
        self.name, self.order, self.degree = name, order, len(points) - 1
        self.points = _shares(points)
        self.state_points = self.control_points = self.points[:-1]
        self.matrix = 0.5 * integration_matrix(points)[1:]
        self.weights = 0.5 * quadrature_weights(points)

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return x_i = x_0 + h Σ_j A_ij f_j for every point but the first."""
        slopes = [f(c, x[c], u[c]) for c in self.points]
        cost = _sum(self.weights, [w(c, x[c], u[c]) for c in self.points])
        defects = []
        for c, row in zip(self.points[1:], self.matrix, strict=True):
            name = "dynamics" if c == 1 else f"collocation at {c:.3g}"
            defects.append((name, x[c] - x[0.0] - h * _sum(row, slopes)))
        return Segment(h * cost, defects)


class Radau(Orthogonal):
    """Collocation at n Legendre–Gauss–Radau points: the start of a segment and inside.

    Parameters
    ----------
    count : int
        Number of points n.
    """

    name = "legendre"
    shared_end = False
    ends = (False, False, True)

    def __init__(self, count: int) -> None:
        points = legendre_radau(count)
        self.order, self.degree = 2 * count - 1, count
        self.points = self.state_points = self.control_points = _shares(points)
        self.matrix = 2.0 * differentiation_matrix(np.append(points, 1.0))[:-1]
        self.weights = 0.5 * quadrature_weights(points)

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return Σ_j D_ij x_j = h f_i over the points and the end, which is not collocated."""
        states = [x[c] for c in (*self.points, 1.0)]
        defects = []
        for i, (c, row) in enumerate(zip(self.points, self.matrix, strict=True)):
            name = "dynamics" if i == 0 else f"collocation at {c:.3g}"
            defects.append((name, _sum(row, states) - h * f(c, x[c], u[c])))
        cost = _sum(self.weights, [w(c, x[c], u[c]) for c in self.points])
        return Segment(h * cost, defects)


class Gauss(Orthogonal):
    """Collocation at n Legendre–Gauss points, all inside the segment.

    Parameters
    ----------
    count : int
        Number of points n.
    """

    name = "legendre"
    shared_end = False
    ends = (False, False, False)
    leading = 1

    def __init__(self, count: int) -> None:
        points = legendre_gauss(count)
        self.order, self.degree = 2 * count, count
        self.points = self.control_points = _shares(points)
        self.state_points = (0.0, *self.points)
        self.matrix = 2.0 * differentiation_matrix(np.append(-1.0, points))[1:]
        self.weights = 0.5 * quadrature_weights(points)

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return Σ_j D_ij x_j = h f_i over start and points, and the quadrature to the end."""
        states = [x[c] for c in self.state_points]
        slopes = [f(c, x[c], u[c]) for c in self.points]
        end = x[1.0] - x[0.0] - h * _sum(self.weights, slopes)
        defects = [("dynamics", end)]
        for c, row, slope in zip(self.points, self.matrix, slopes, strict=True):
            defects.append((f"collocation at {c:.3g}", _sum(row, states) - h * slope))
        cost = _sum(self.weights, [w(c, x[c], u[c]) for c in self.points])
        return Segment(h * cost, defects)


def chebyshev(degree: int) -> Orthogonal:
    """Return collocation on degree + 1 Chebyshev–Lobatto points."""
    # Clenshaw–Curtis quadrature is exact to the degree, one more if the rule is symmetric.
    exact = degree + 1 if degree % 2 == 0 else degree
    return Lobatto("chebyshev", chebyshev_lobatto(degree), exact + 1)


def legendre(degree: int, points: str) -> Orthogonal:
    """Return collocation on Legendre points of the kind gauss, radau or lobatto."""
    if points == "gauss":
        return Gauss(degree)
    if points == "radau":
        return Radau(degree)
    return Lobatto("legendre", legendre_lobatto(degree), 2 * degree)


def _sum(weights: Any, values: list[Any]) -> Any:
    total: Any = 0.0
    for weight, value in zip(weights, values, strict=True):
        if not isinstance(weight, float):
            total = total + weight * value
        elif weight != 0.0:
            total = total + float(weight) * value
    return total
