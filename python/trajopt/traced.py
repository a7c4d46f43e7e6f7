"""A user's residual, traced once by CasADi and evaluated for all frames in one call."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt import _core
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.interpolation import ball_slices
from trajopt.rotations import left_jacobian_inverse

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.scaling import Scales

__all__ = ["TracedResidual"]

FloatArray = NDArray[np.float64]


class TracedResidual:
    """Values and derivatives of ``f(x2, x1, x)`` over N frames, in the core's tangent.

    Rows are scaled by the roots of the weights, so that their sum of squares is the term's cost.

    Parameters
    ----------
    name : str
    function : callable
        See `trajopt.objectives.Residual`.
    model : Model
    core : _core.Model
    scales : Scales
    weight : (N,) array
        Weight of every frame's squared residual.
    """

    def __init__(
        self,
        name: str,
        function: Callable[..., Any],
        model: Model,
        core: Any,
        scales: Scales,
        weight: FloatArray,
    ) -> None:
        try:
            import casadi
        except ImportError as error:
            raise MissingDependencyError("casadi", "Residual", extra="casadi") from error
        self._core, self._scales = core, scales
        self._frames, self._root = len(weight), np.sqrt(weight)[:, None]
        self._nq = core.nq
        self._balls = ball_slices(model)
        nodes = [casadi.SX.sym(label, model.ndof) for label in ("x2", "x1", "x")]
        try:
            with warnings.catch_warnings():  # CasADi announces its NumPy support to every user
                warnings.simplefilter("ignore", FutureWarning)
                result = function(*nodes)
            if result is None:
                raise ValueError("it returned None; end it with `return ...`")
            rows = casadi.vertcat(*result) if isinstance(result, (list, tuple)) else result
            rows = casadi.SX(rows)
        except Exception as error:
            raise ArgumentError(
                f"Residual {name!r}: the function could not be traced ({error}); "
                "use NumPy functions and arithmetic on x[i], no branches on values"
            ) from error
        if rows.shape[1] != 1:
            raise ArgumentError(
                f"Residual {name!r}: the function returned shape {rows.shape}, expected a column"
            )
        self.rows = int(rows.shape[0])
        newest_first = casadi.vertcat(*nodes[::-1])
        value = casadi.Function("value", nodes, [rows])
        jacobian = casadi.densify(casadi.jacobian(rows, newest_first))
        both = casadi.Function("both", nodes, [rows, jacobian])
        self._value, self._both = value.map(self._frames), both.map(self._frames)

    def evaluate(self, address: int, derivatives: bool) -> tuple[FloatArray, ...]:
        """Return residuals (N, rows) and, if asked, their Jacobians (N, rows, 3 D)."""
        n = self._frames
        q = _core.frames_from_address(address, n + 2, self._nq)
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
