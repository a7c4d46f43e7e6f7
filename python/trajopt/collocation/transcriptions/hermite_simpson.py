"""Hermite–Simpson collocation (Kelly, section 4): quadratic slopes and controls, cubic states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.transcriptions.base import Segment, Slope, Transcription

__all__ = ["HermiteSimpson", "HermiteSimpsonCompressed"]

FloatArray = NDArray[np.float64]


class HermiteSimpson(Transcription):
    """The separated form: the state at the midpoint is an unknown with an equation of its own."""

    name = "hermite_simpson"
    state_points = (0.0, 0.5)
    control_points = (0.0, 0.5)
    shared_end = True
    points = (0.0, 0.5, 1.0)
    order = 4

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return (6.10), (6.11) and (6.12)."""
        f0, fm, f1 = (f(c, x[c], u[c]) for c in self.points)
        w0, wm, w1 = (w(c, x[c], u[c]) for c in self.points)
        midpoint = x[0.5] - 0.5 * (x[0.0] + x[1.0]) - h / 8 * (f0 - f1)
        simpson = x[1.0] - x[0.0] - h / 6 * (f0 + 4 * fm + f1)
        return Segment(h / 6 * (w0 + 4 * wm + w1), [("dynamics", simpson), ("midpoint", midpoint)])


class HermiteSimpsonCompressed(Transcription):
    """The compressed form: the state at the midpoint is an expression of the ends."""

    name = "hermite_simpson_compressed"
    state_points = (0.0,)
    control_points = (0.0, 0.5)
    shared_end = True
    points = (0.0, 0.5, 1.0)
    order = 4

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return (6.10) and (6.12) with (6.11) put in."""
        f0, f1 = f(0.0, x[0.0], u[0.0]), f(1.0, x[1.0], u[1.0])
        middle = 0.5 * (x[0.0] + x[1.0]) + h / 8 * (f0 - f1)
        fm = f(0.5, middle, u[0.5])
        w0, w1 = w(0.0, x[0.0], u[0.0]), w(1.0, x[1.0], u[1.0])
        wm = w(0.5, middle, u[0.5])
        simpson = x[1.0] - x[0.0] - h / 6 * (f0 + 4 * fm + f1)
        return Segment(h / 6 * (w0 + 4 * wm + w1), [("dynamics", simpson)], {0.5: middle})

    def inner_states(
        self, f: Slope, h: FloatArray, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> dict[float, FloatArray]:
        """Return the midpoints by (6.11)."""
        f0, f1 = f(0.0, x[0.0], u[0.0]), f(1.0, x[1.0], u[1.0])
        return {0.5: 0.5 * (x[0.0] + x[1.0]) + h[:, None] / 8 * (f0 - f1)}
