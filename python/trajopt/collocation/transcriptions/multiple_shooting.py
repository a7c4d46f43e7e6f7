"""Multiple shooting: every segment is a simulation by the classical Runge–Kutta method."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.transcriptions.base import Segment, Slope, Transcription

__all__ = ["MultipleShooting"]

FloatArray = NDArray[np.float64]


class MultipleShooting(Transcription):
    """RK4 steps from knot to knot under a control that is linear in between.

    Parameters
    ----------
    substeps : int
        Runge–Kutta steps per segment.
    """

    name = "multiple_shooting"
    state_points = (0.0,)
    control_points = (0.0,)
    shared_end = True
    points = (0.0, 1.0)
    order = 4

    def __init__(self, substeps: int = 4) -> None:
        self.substeps = substeps

    def segment(
        self, f: Slope, w: Slope, h: Any, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> Segment:
        """Return the gap between a simulation and the next knot."""
        state, cost = x[0.0], 0.0
        for step in range(self.substeps):
            state, quadrature = self._step(f, w, h, state, u, step)
            cost = cost + quadrature
        return Segment(cost, [("dynamics", x[1.0] - state)])

    def _step(
        self, f: Slope, w: Slope, h: Any, x: Any, u: Mapping[float, Any], step: int
    ) -> tuple[Any, Any]:
        """Return the state and the integral of w after one step."""
        share = 1.0 / self.substeps
        d = h * share
        a, m, b = (min((step + c) * share, 1.0) for c in (0.0, 0.5, 1.0))
        ua, um, ub = (_linear(u, c) for c in (a, m, b))
        k1 = f(a, x, ua)
        k2 = f(m, x + d / 2 * k1, um)
        k3 = f(m, x + d / 2 * k2, um)
        k4 = f(b, x + d * k3, ub)
        slope = w(a, x, ua) + 2 * w(m, x + d / 2 * k1, um) + 2 * w(m, x + d / 2 * k2, um)
        after = x + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return after, d / 6 * (slope + w(b, x + d * k3, ub))

    def pieces(
        self, f: Slope, h: FloatArray, x: Mapping[float, Any], u: Mapping[float, Any]
    ) -> list[tuple[float, float, FloatArray, dict[float, FloatArray], dict[float, FloatArray]]]:
        """Return a cubic for every step: it meets states and slopes at both ends."""
        column, state = h[:, None], x[0.0]
        found = []
        for step in range(self.substeps):
            a, b = step / self.substeps, (step + 1) / self.substeps
            after, _ = self._step(f, lambda *_: 0.0, column, state, u, step)
            f0, f1 = f(a, state, _linear(u, a)), f(b, after, _linear(u, b))
            d = column / self.substeps
            # Slope in the middle of the Hermite cubic.
            fm = 1.5 * (after - state) / d - 0.25 * (f0 + f1)
            slopes = {0.0: f0, 0.5: fm, 1.0: f1}
            found.append((a, b, state, slopes, {0.0: _linear(u, a), 1.0: _linear(u, b)}))
            state = after
        return found


def _linear(u: Mapping[float, Any], c: float) -> Any:
    return (1 - c) * u[0.0] + c * u[1.0]
