"""A trajectory between the knots, by the polynomials of the method that found it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from trajopt.collocation.polynomials import barycentric_interpolate, legendre_integrals

__all__ = ["Interpolant"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Piecewise polynomials of M pieces: slopes through m points, states their integral.

    Parameters
    ----------
    edges : (M+1,) array
        Times at which the pieces meet [s].
    start : (M, nx) array
        States at the start of the pieces.
    slope_points : (m,) array
        Points of a piece in [0, 1] at which the slopes are given.
    slopes : (M, m, nx) array
        Slope of the state there [1/s].
    control_points : (k,) array
        Points of a piece in [0, 1] at which the controls are given.
    controls : (M, k, nu) array

    Notes
    -----
    With slope points (0, 1/2, 1) the state is Kelly's (4.13) in its corrected form, with (0, 1)
    his interpolant of trapezoidal collocation.
    """

    edges: FloatArray
    start: FloatArray
    slope_points: FloatArray
    slopes: FloatArray
    control_points: FloatArray
    controls: FloatArray

    def _locate(self, t: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """Return the piece of every time, and the place in it in [-1, 1]."""
        piece = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.start) - 1)
        begin, end = self.edges[piece], self.edges[piece + 1]
        # A solver may fail with a duration of zero; the one state there is still to be seen.
        length = np.where(end > begin, end - begin, 1.0)
        return piece, 2.0 * (t - begin) / length - 1.0

    def state(self, t: FloatArray) -> FloatArray:
        """Return the states (m, nx) at times t (m,)."""
        piece, place = self._locate(t)
        points = 2.0 * self.slope_points - 1.0
        count = len(points)
        half = 0.5 * (self.edges[piece + 1] - self.edges[piece])
        series = np.linalg.solve(legvander(points, count - 1), self.slopes)
        integrals = legendre_integrals(place, count)
        gain = np.einsum("tj,tji->ti", integrals, series[piece])
        return np.asarray(self.start[piece] + half[:, None] * gain, dtype=np.float64)

    def derivative(self, t: FloatArray) -> FloatArray:
        """Return the slopes of the interpolated states (m, nx) [1/s]."""
        piece, place = self._locate(t)
        return barycentric_interpolate(2.0 * self.slope_points - 1.0, self.slopes[piece], place)

    def control(self, t: FloatArray) -> FloatArray:
        """Return the controls (m, nu)."""
        piece, place = self._locate(t)
        return barycentric_interpolate(2.0 * self.control_points - 1.0, self.controls[piece], place)
