"""How well a trajectory obeys its dynamics between the collocation points (Kelly, 5.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.interpolant import Interpolant
from trajopt.collocation.phase import Phase, evaluate

__all__ = ["dynamics_error", "path_integral", "segment_errors"]

FloatArray = NDArray[np.float64]

# Between two collocation points, where ε vanishes at both ends, as a rule with one sign: so many
# parts with a Gauss rule each. Where ε does change its sign, the kink of |ε| costs below 1 %.
PARTS = 4
RULE = np.polynomial.legendre.leggauss(3)


def dynamics_error(
    phase: Phase, interpolant: Interpolant, t: FloatArray, p: FloatArray
) -> FloatArray:
    """Return ε = ẋ(t) − f(t, x(t), u(t)) of the interpolated trajectory: (m, nx) [1/s]."""
    slopes = evaluate(phase.f, t, interpolant.state(t), interpolant.control(t), p)
    return np.asarray(interpolant.derivative(t) - slopes, dtype=np.float64)


def _rule(interpolant: Interpolant) -> tuple[FloatArray, FloatArray]:
    """Return times (M, q) and weights of a quadrature over every piece of the interpolant."""
    gaps = np.unique(np.concatenate([[0.0], interpolant.slope_points, [1.0]]))
    cuts = np.interp(np.arange(PARTS * (len(gaps) - 1) + 1) / PARTS, np.arange(len(gaps)), gaps)
    nodes, weights = RULE
    steps = np.diff(cuts)
    places = (cuts[:-1, None] + 0.5 * steps[:, None] * (nodes + 1.0)).ravel()
    shares = (0.5 * steps[:, None] * weights).ravel()
    edges = interpolant.edges
    h = np.diff(edges)[:, None]
    return edges[:-1, None] + h * places, h * shares


def segment_errors(
    phase: Phase, interpolant: Interpolant, p: FloatArray, segments: int
) -> FloatArray:
    """Return η = ∫ |ε| dt of every segment and state: (segments, nx)."""
    times, weights = _rule(interpolant)
    error = np.abs(dynamics_error(phase, interpolant, times.ravel(), p))
    per_piece = np.einsum("mq,mqi->mi", weights, error.reshape(*times.shape, -1))
    return np.asarray(per_piece.reshape(segments, -1, phase.nx).sum(axis=1), dtype=np.float64)


def path_integral(phase: Phase, interpolant: Interpolant, p: FloatArray) -> float:
    """Return ∫ w dt along the interpolated trajectory."""
    times, weights = _rule(interpolant)
    t = times.ravel()
    values = evaluate(phase.w, t, interpolant.state(t), interpolant.control(t), p)
    return float(np.sum(weights.ravel() * values[:, 0]))
