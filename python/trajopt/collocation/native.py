"""`solver="native"`: the interior point method of the core on a staged nonlinear program.

CasADi differentiates the terms of one stage once. The compiled solver then evaluates all stages in
one call without a line of Python in between: scalar functions as tapes of its own, several stages
per instruction, others through the addresses of CasADi's function buffers.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt import _core
from trajopt.collocation.staged import StagedNLP
from trajopt.collocation.tape import make_tape
from trajopt.collocation.watch import Callback, Watch
from trajopt.errors import ArgumentError
from trajopt.interrupt import InterruptFlag
from trajopt.status import Status
from trajopt.tracing import casadi

__all__ = ["OPTIONS", "NativeSolver", "solve_native"]

FloatArray = NDArray[np.float64]


# Options beyond tolerance and iteration limit, with their defaults.
OPTIONS: dict[str, Any] = {
    "barrier": 0.1,  # barrier parameter at the start; 1e-6 of a warm start
    "barrier_rule": "monotone",  # or adaptive: how it changes
    "bound_push": 1e-2,  # share by which the start is pushed away from its bounds
    "scale": True,  # scale objective and constraints by their gradients at the start
    "refinements": 10,  # most refinement steps of a linear solve
    "threads": 1,  # of evaluation and linear algebra; the result does not depend on them
    "ordering": "auto",  # of the block elimination: auto, sequential, cyclic or chunked
}
WARM_BARRIER = 1e-6


@dataclass
class _Part:
    """The functions of one copy of some terms, and the memory all copies share."""

    count: int
    rows: int
    jacobian: Any
    hessian: Any
    values: Any
    derivatives: Any
    buffers: dict[str, Any] = field(default_factory=dict)
    keep: list[Any] = field(default_factory=list)

    def connect(self, nodes: list[FloatArray], p_size: int, s: FloatArray | None) -> None:
        """Give both functions the memory of their arguments and results."""
        count, locals_ = self.count, self.jacobian.size2()
        b = self.buffers
        b["globals"] = np.zeros(count * p_size)
        b["multipliers"] = np.zeros(count * self.rows)
        b["factor"] = np.zeros(count)
        b["cost"] = np.zeros(count)
        b["constraint"] = np.zeros(count * self.rows)
        b["gradient"] = np.zeros(count * locals_)
        b["jacobian"] = np.zeros(count * self.jacobian.nnz())
        b["hessian"] = np.zeros(count * self.hessian.nnz())
        data = np.zeros(0) if s is None else np.ascontiguousarray(s, dtype=np.float64).ravel()
        point = [*nodes, b["globals"], data]
        b["values_call"] = self._evaluation(self.values, point, [b["cost"], b["constraint"]])
        b["derivatives_call"] = self._evaluation(
            self.derivatives,
            [*point, b["multipliers"], b["factor"]],
            [b["gradient"], b["jacobian"], b["hessian"]],
        )

    def _evaluation(self, function: Any, inputs: list[Any], outputs: list[Any]) -> Any:
        """Return a tape, or what the core needs to call CasADi."""
        self.keep += [inputs, outputs]
        return make_tape(function, inputs, outputs) or self._buffer(function, inputs, outputs)

    def _buffer(self, function: Any, inputs: list[Any], outputs: list[Any]) -> tuple[int, int]:
        function = function.map(self.count)
        buffer: Any = casadi.FunctionBuffer(function)
        for i, array in enumerate(inputs):
            _check_size(function, array, function.nnz_in(i))
            if array.size:
                buffer.set_arg(i, memoryview(array))
        for i, array in enumerate(outputs):
            _check_size(function, array, function.nnz_out(i))
            if array.size:
                buffer.set_res(i, memoryview(array))
        self.keep.append(buffer)
        return _evaluation_address(), _address(buffer._self())

    def description(self) -> dict[str, Any]:
        """Return what the core needs to know."""
        return {
            "count": self.count,
            "constraints": self.rows,
            "jacobian_pattern": (self.jacobian.row(), self.jacobian.get_col()),
            "hessian_pattern": (self.hessian.row(), self.hessian.get_col()),
            **self.buffers,
        }


def _check_size(function: Any, array: FloatArray, expected: int) -> None:
    if array.size != expected:
        raise ArgumentError(
            f"{function.name()} has a sparse argument or result: {array.size} values, "
            f"{expected} nonzeros"
        )


def _evaluation_address() -> int:
    extension: Any = import_module("casadi._casadi")
    library = ctypes.CDLL(extension.__file__)  # finds the symbols of libcasadi too
    function = library._ZN6casadi21_function_buffer_evalEPv
    return int(ctypes.cast(function, ctypes.c_void_p).value or 0)


def _address(capsule: Any) -> int:
    api = ctypes.pythonapi
    api.PyCapsule_GetName.restype = ctypes.c_char_p
    api.PyCapsule_GetName.argtypes = [ctypes.py_object]
    api.PyCapsule_GetPointer.restype = ctypes.c_void_p
    api.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return int(api.PyCapsule_GetPointer(capsule, api.PyCapsule_GetName(capsule)))


def _symbolic(function: Any) -> tuple[Any, Any]:
    """Return the function with scalar operations where it can be expanded, and its symbol type."""
    if function.is_a("SXFunction"):
        return function, casadi.SX
    try:
        return function.expand(), casadi.SX
    except RuntimeError:  # calls something that has no scalar form
        return function, casadi.MX


class NativeSolver:
    """The native solver for one program: derivative functions are built here, once.

    Parameters
    ----------
    nlp : StagedNLP
    """

    def __init__(self, nlp: StagedNLP) -> None:
        self.nlp = nlp
        self._x = np.zeros(nlp.n * nlp.nw)
        nw, stages = nlp.nw, nlp.n - 1
        self._stages = self._last = self._global = None
        if stages > 0:
            self._stages = self._part(nlp.stage, 2, True, nlp.c_scale, stages)
            self._stages.connect([self._x[: stages * nw], self._x[nw:]], nlp.np, nlp.s[:-1])
        self._last = self._part(nlp.last, 1, True, None, 1)
        self._last.connect([self._x[stages * nw :]], nlp.np, nlp.s[-1:])
        if nlp.np > 0:
            self._global = self._part(nlp.glob, 0, False, None, 1)
            self._global.connect([], nlp.np, None)

    def _part(
        self, function: Any, span: int, data: bool, row_scale: FloatArray | None, count: int
    ) -> _Part:
        nlp = self.nlp
        function, kind = _symbolic(function)
        # The nodes are arguments of their own: those of neighbouring copies overlap in memory.
        parts = [kind.sym(f"w{i}", nlp.nw) for i in range(span)] + [kind.sym("p", nlp.np)]
        # Scalar symbols side by side are again what one can differentiate with respect to.
        scalar = kind is casadi.SX
        v = casadi.vertcat(*parts) if scalar else kind.sym("v", span * nlp.nw + nlp.np)
        scale = np.concatenate([np.tile(nlp.w_scale, span), nlp.p_scale])
        u = v if np.all(scale == 1.0) else v * casadi.DM(scale)
        arguments = [u[i * nlp.nw : (i + 1) * nlp.nw] for i in range(span)]
        arguments.append(u[span * nlp.nw :])
        s = kind.sym("s", nlp.s.shape[1] if data else 0)
        if data:
            arguments.append(s)
        cost, c = function(*arguments)
        cost, c = casadi.densify(cost), casadi.densify(casadi.vec(c))
        if row_scale is not None and not np.all(row_scale == 1.0):
            c = c / casadi.DM(np.asarray(row_scale, dtype=np.float64))
        rows = c.numel()
        multipliers, factor = kind.sym("multipliers", rows), kind.sym("factor")
        gradient = casadi.densify(casadi.gradient(cost, v))
        jacobian: Any = casadi.jacobian(c, v)
        lagrangian = factor * cost + casadi.dot(multipliers, c)
        hessian: Any = casadi.tril(casadi.hessian(lagrangian, v)[0])
        values, derivatives = (
            _function(name, v, parts, more, results)
            for name, more, results in (
                ("values", [s], [cost, c]),
                ("derivatives", [s, multipliers, factor], [gradient, jacobian, hessian]),
            )
        )
        return _Part(
            count,
            rows,
            jacobian.sparsity(),
            hessian.sparsity(),
            values,
            derivatives,
        )

    @cached_property
    def _bounds(self) -> dict[str, FloatArray]:
        nlp = self.nlp
        scale = np.concatenate([np.tile(nlp.w_scale, nlp.n), nlp.p_scale])
        row_scale = self._row_scale
        rows = [[nlp.c_lower.ravel()], [nlp.c_upper.ravel()]]
        rows[0].append(nlp.last_lower)
        rows[1].append(nlp.last_upper)
        if nlp.np > 0:
            rows[0].append(nlp.glob_lower)
            rows[1].append(nlp.glob_upper)
        return {
            "lower": np.concatenate([nlp.w_lower.ravel(), nlp.p_lower]) / scale,
            "upper": np.concatenate([nlp.w_upper.ravel(), nlp.p_upper]) / scale,
            "constraint_lower": np.concatenate(rows[0]) / row_scale,
            "constraint_upper": np.concatenate(rows[1]) / row_scale,
        }

    @cached_property
    def _scale(self) -> FloatArray:
        return np.concatenate([np.tile(self.nlp.w_scale, self.nlp.n), self.nlp.p_scale])

    @cached_property
    def _row_scale(self) -> FloatArray:
        nlp = self.nlp
        others = len(nlp.last_lower) + (len(nlp.glob_lower) if nlp.np > 0 else 0)
        return np.concatenate([np.tile(nlp.c_scale, nlp.n - 1), np.ones(others)])

    def solve(
        self,
        *,
        tolerance: float = 1e-8,
        max_iterations: int = 3000,
        options: Mapping[str, Any] | None = None,
        warm_start: Mapping[str, Any] | None = None,
        callback: Callback | None = None,
        guess: tuple[FloatArray, FloatArray] | None = None,
    ) -> dict[str, Any]:
        """Solve from the program's guess w (n, nw), p (np,), or from another one.

        Parameters
        ----------
        tolerance : float
            Of the scaled optimality error.
        max_iterations : int
        options : mapping, optional
            Of `OPTIONS`.
        warm_start : mapping, optional
            An earlier result for the same mesh. Its multipliers are taken, and the guess is not
            pushed away from its bounds.
        callback : callable, optional
            ``callback(record, x)`` after every iteration, x the nodes then the globals; returning
            False stops the solver. Ctrl-C stops it too, and the last iterate is kept.
        guess : tuple of arrays, optional

        Returns
        -------
        dict
            ``status``, ``message``, ``w`` (n, nw), ``p``, ``multipliers``, ``objective``,
            ``iterations``, ``history`` (one dict per iteration), ``violation`` (by constraint row,
            positive above the upper bound) and ``seconds``.
        """
        nlp = self.nlp
        settings = OPTIONS | ({"barrier": WARM_BARRIER} if warm_start else {}) | dict(options or {})
        for name in settings:
            if name not in OPTIONS:
                raise ArgumentError(
                    f"options: '{name}' is not one of the native solver's, which are "
                    + ", ".join(OPTIONS)
                )
        w, p = guess or (nlp.w_guess, nlp.p_guess)
        x = np.concatenate([np.ravel(w), np.ravel(p)]) / self._scale
        rows = bounds = None
        if warm_start is not None:
            m = warm_start["multipliers"]
            parts = [np.ravel(m["stage"]), m["last"]] + ([m["glob"]] if nlp.np > 0 else [])
            rows = np.concatenate(parts) * self._row_scale
            bounds = np.concatenate([np.ravel(m["bounds"]), m["p_bounds"]]) * self._scale
        problem = {
            "nodes": nlp.n,
            "node_size": nlp.nw,
            "globals": nlp.np,
            "x": self._x,
            **self._bounds,
            "stages": self._stages and self._stages.description(),
            "last": self._last and self._last.description(),
            "global": self._global and self._global.description(),
        }
        with InterruptFlag() as interrupt:
            began = time.perf_counter()
            result: dict[str, Any] = _core.solve_staged(
                problem,
                x,
                rows,
                bounds,
                self._observer(callback, interrupt),
                interrupt,
                tolerance=tolerance,
                max_iterations=max_iterations,
                warm_start=warm_start is not None,
                **settings,
            )
            seconds = time.perf_counter() - began
        return self._unpack(result, seconds)

    def _observer(self, callback: Callback | None, interrupt: InterruptFlag) -> Any:
        """Return what the core calls; without a callback it looks at the flag by itself."""
        if callback is None:
            return None
        watch, scale = Watch(callback, interrupt), self._scale
        return lambda record, x: watch.go_on(record, x * scale)

    def _unpack(self, result: dict[str, Any], seconds: float) -> dict[str, Any]:
        nlp = self.nlp
        x = result.pop("x") * self._scale
        rows = result.pop("multipliers") / self._row_scale
        bounds = result.pop("bound_multipliers") / self._scale
        violation = result.pop("violation") * self._row_scale
        if nlp.np == 0:
            result["objective"] += float(nlp.glob(casadi.DM(0, 1))[0])
        nodes, stage_rows = nlp.n * nlp.nw, (nlp.n - 1) * nlp.nc
        last = stage_rows + len(nlp.last_lower)
        result["status"] = Status(result["status"])
        return {
            **result,
            "w": x[:nodes].reshape(nlp.n, nlp.nw),
            "p": x[nodes:],
            "multipliers": {
                "stage": rows[:stage_rows].reshape(nlp.n - 1, nlp.nc),
                "last": rows[stage_rows:last],
                "glob": rows[last:] if nlp.np > 0 else np.zeros(len(nlp.glob_lower)),
                "bounds": bounds[:nodes].reshape(nlp.n, nlp.nw),
                "p_bounds": bounds[nodes:],
            },
            "violation": violation,
            "seconds": seconds,
        }


def _function(name: str, v: Any, parts: list[Any], others: list[Any], results: list[Any]) -> Any:
    """Make a function of the parts v consists of."""
    if isinstance(v, casadi.SX):
        # CasADi's search for common subexpressions takes longer than all of its differentiation
        # and finds a twentieth of the operations; the tape does not ask for it.
        return casadi.Function(name, [*parts, *others], results)
    inner = casadi.Function(name, [v, *others], results)
    results = inner(casadi.vertcat(*parts), *others)
    return casadi.Function(name, [*parts, *others], results, {"cse": True})


def solve_native(
    nlp: StagedNLP,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 3000,
    options: Mapping[str, Any] | None = None,
    warm_start: Mapping[str, Any] | None = None,
    callback: Callback | None = None,
) -> dict[str, Any]:
    """Build the derivatives of a program and solve it; see `NativeSolver.solve`."""
    return NativeSolver(nlp).solve(
        tolerance=tolerance,
        max_iterations=max_iterations,
        options=options,
        warm_start=warm_start,
        callback=callback,
    )
