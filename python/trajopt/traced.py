"""A user's residual, traced once by CasADi and evaluated for all frames in one call."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt import _core
from trajopt.errors import ArgumentError
from trajopt.kinematics import ball_slices
from trajopt.rotations import left_jacobian_inverse

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.scaling import Scales

__all__ = ["Trace", "TracedResidual"]

FloatArray = NDArray[np.float64]


class Trace:
    """A function ``f(x2, x1, x)`` of three frames with its derivatives, as CasADi functions.

    Parameters
    ----------
    name : str
        Of the term, for messages.
    function : callable
        See `trajopt.objectives.Residual`.
    ndof : int
        Number of coordinates of a frame.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If it cannot be traced: with the line, and what to write instead.
    """

    def __init__(self, name: str, function: Callable[..., Any], ndof: int) -> None:
        from trajopt.tracing import casadi, trace

        owner, labels = f"Residual {name!r}", ("x2", "x1", "x")
        traced = trace(owner, "function", function, [(label, ndof) for label in labels], None)
        nodes = [casadi.SX.sym(label, ndof) for label in labels]
        rows = traced(*nodes)
        self.rows = int(rows.shape[0])
        jacobian = casadi.jacobian(rows, casadi.vertcat(*nodes[::-1]))  # newest frame first
        if self.rows == 0:
            raise ArgumentError(f"{owner}: function returned no values, expected at least one")
        if jacobian.nnz() == 0:
            raise ArgumentError(
                f"{owner}: function returned what no motion changes, {rows}; return expressions "
                "that depend smoothly on components of x2, x1 or x"
            )
        self.value = traced
        self.both = casadi.Function("both", nodes, [rows, casadi.densify(jacobian)])


class TracedResidual:
    """Values and derivatives of ``f(x2, x1, x)`` over N frames, in the core's tangent.

    Rows are scaled by the roots of the weights, so that their sum of squares is the term's cost.

    Parameters
    ----------
    trace : Trace
    model : Model
    core : _core.Model
    scales : Scales
    weight : (N,) array
        Weight of every frame's squared residual.
    """

    def __init__(
        self, trace: Trace, model: Model, core: Any, scales: Scales, weight: FloatArray
    ) -> None:
        self.rows = trace.rows
        self._core, self._scales = core, scales
        self._frames, self._root = len(weight), np.sqrt(weight)[:, None]
        self._balls = ball_slices(model)
        self._value, self._both = trace.value.map(self._frames), trace.both.map(self._frames)

    def at(self, q: FloatArray, derivatives: bool) -> tuple[FloatArray, ...]:
        """Return residuals (N, rows) and, if asked, their Jacobians (N, rows, 3 D).

        Parameters
        ----------
        q : (N + 2, nq) array
            The core's frames -1 to N.
        derivatives : bool
            By tangent steps of frames i, i-1, i-2, in this order.
        """
        n = self._frames
        x = _core.configuration_to_vector(self._core, q) * self._scales.coordinate
        arguments = (x[:-2].T, x[1:-1].T, x[2:].T)
        if not derivatives:
            return (np.ascontiguousarray(self._root * np.asarray(self._value(*arguments)).T),)
        value, jacobian = (np.asarray(part) for part in self._both(*arguments))
        d = x.shape[1]
        # CasADi puts the frames' Jacobians side by side: (rows, N * 3 D).
        blocks = jacobian.reshape(self.rows, n, 3, d).transpose(1, 0, 2, 3).copy()
        for node in range(3):
            frames = x[2 - node : n + 2 - node]
            for where in self._balls:
                blocks[:, :, node, where] = blocks[:, :, node, where] @ left_jacobian_inverse(
                    frames[:, where]
                )
            blocks[:, :, node] *= self._scales.coordinate
        blocks *= self._root[:, :, None, None]
        return np.ascontiguousarray(self._root * value.T), blocks.reshape(n, self.rows, 3 * d)
