"""What a transcription needs of a problem: traced functions and checked bounds as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.collocation.bounds import Pair

__all__ = ["Phase", "evaluate"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Phase:
    """One continuous stretch of motion, ready to be transcribed.

    Parameters
    ----------
    nx, nu, np : int
        Numbers of states, controls and parameters.
    f, w, h : casadi.Function
        Dynamics, integrand and path constraint of (t, x, u, p).
    at_start, at_end : casadi.Function
        Constraints of (t, x, u, p) at one end.
    g, terminal : casadi.Function
        Boundary constraint and Mayer term of (t0, tf, x0, xf, p).
    t0, tf : (float, float)
        Bounds of the ends of time [s].
    x, u, x0, xf, u0, uf, p : (lower, upper)
        Bounds as arrays; those of the ends lie within those of the path.
    h_bounds, g_bounds, start_bounds, end_bounds : (lower, upper)
    x_names, u_names, p_names : tuple of str
    """

    nx: int
    nu: int
    np: int
    f: Any
    w: Any
    h: Any
    g: Any
    terminal: Any
    t0: tuple[float, float]
    tf: tuple[float, float]
    x: Pair
    u: Pair
    x0: Pair
    xf: Pair
    u0: Pair
    uf: Pair
    p: Pair
    h_bounds: Pair
    g_bounds: Pair
    at_start: Any
    at_end: Any
    start_bounds: Pair
    end_bounds: Pair
    x_names: tuple[str, ...]
    u_names: tuple[str, ...]
    p_names: tuple[str, ...]

    @property
    def p_middle(self) -> FloatArray:
        """Middle of the parameters' bounds: where a solve starts unless told otherwise."""
        from trajopt.collocation.guess import _middle

        return _middle(*self.p)


def evaluate(
    function: Any, t: FloatArray, x: FloatArray, u: FloatArray, p: FloatArray
) -> FloatArray:
    """Return a traced function of (t, x, u, p) at m points: (m, rows)."""
    count = len(t)
    mapped = function.map(count)
    values = mapped(t[None, :], x.T, u.T, np.tile(p[:, None], (1, count)))
    return np.asarray(values.full().T, dtype=np.float64)
