"""Trapezoidal collocation (Kelly, section 3): linear slopes and controls, quadratic states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from trajopt.collocation.transcriptions.base import Segment, Slope, Transcription

__all__ = ["Trapezoidal"]


class Trapezoidal(Transcription):
    """x_{k+1} − x_k = h/2 (f_k + f_{k+1})."""

    name = "trapezoidal"
    state_points = (0.0,)
    control_points = (0.0,)
    shared_end = True
    points = (0.0, 1.0)
    order = 2

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return (3.1) and (3.2)."""
        f0, f1 = (f(c, x[c], u[c]) for c in self.points)
        w0, w1 = (w(c, x[c], u[c]) for c in self.points)
        defect = x[1.0] - x[0.0] - 0.5 * h * (f0 + f1)
        return Segment(0.5 * h * (w0 + w1), [("dynamics", defect)])
