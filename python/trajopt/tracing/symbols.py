"""Scalars that stand for values not known yet, so that plain NumPy code can be traced.

A user's function is called once with NumPy arrays of `Symbol`; arithmetic and NumPy's elementwise
functions on them build a CasADi expression. What cannot be traced (branches, ``math`` functions,
conversions to numbers) raises `TraceError` that says what to write instead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.tracing._casadi import casadi

__all__ = ["Symbol", "TraceError", "expression", "linear_solve", "symbols"]

ObjectArray = NDArray[np.object_]


class TraceError(ArgumentError):
    """Something in a user's function needs a number where there is only a symbol."""


# NumPy's name of a function -> what CasADi calls it.
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "true_divide": lambda a, b: a / b,
    "power": lambda a, b: a**b,
    "float_power": lambda a, b: a**b,
    "negative": lambda a: -a,
    "positive": lambda a: a,
    "square": lambda a: a * a,
    "reciprocal": lambda a: 1 / a,
    "conjugate": lambda a: a,
    "sin": casadi.sin,
    "cos": casadi.cos,
    "tan": casadi.tan,
    "arcsin": casadi.asin,
    "arccos": casadi.acos,
    "arctan": casadi.atan,
    "arctan2": casadi.atan2,
    "sinh": casadi.sinh,
    "cosh": casadi.cosh,
    "tanh": casadi.tanh,
    "arcsinh": casadi.asinh,
    "arccosh": casadi.acosh,
    "arctanh": casadi.atanh,
    "exp": casadi.exp,
    "expm1": casadi.expm1,
    "log": casadi.log,
    "log1p": casadi.log1p,
    "log10": casadi.log10,
    "log2": lambda a: casadi.log(a) / np.log(2.0),
    "exp2": lambda a: casadi.exp(a * np.log(2.0)),
    "sqrt": casadi.sqrt,
    "cbrt": lambda a: casadi.sign(a) * casadi.power(casadi.fabs(a), 1 / 3),
    "hypot": lambda a, b: casadi.sqrt(a * a + b * b),
    "absolute": casadi.fabs,
    "fabs": casadi.fabs,
    "sign": casadi.sign,
    "floor": casadi.floor,
    "ceil": casadi.ceil,
    "maximum": casadi.fmax,
    "fmax": casadi.fmax,
    "minimum": casadi.fmin,
    "fmin": casadi.fmin,
    "clip": lambda a, lower, upper: casadi.fmin(casadi.fmax(a, lower), upper),
    "less": lambda a, b: a < b,
    "less_equal": lambda a, b: a <= b,
    "greater": lambda a, b: a > b,
    "greater_equal": lambda a, b: a >= b,
    "equal": lambda a, b: a == b,
    "not_equal": lambda a, b: a != b,
    "logical_and": casadi.logic_and,
    "logical_or": casadi.logic_or,
    "logical_not": casadi.logic_not,
    "deg2rad": lambda a: a * (np.pi / 180),
    "radians": lambda a: a * (np.pi / 180),
    "rad2deg": lambda a: a * (180 / np.pi),
    "degrees": lambda a: a * (180 / np.pi),
}


# What to write instead of NumPy functions that cannot be traced.
_REPLACEMENTS = {
    "interp": "write trajopt.collocation.table(x, y), once, outside, and call what it returns",
}


class Symbol:
    """A scalar expression that behaves like a number in NumPy code.

    Examples
    --------
    >>> x = symbols("x", 2)
    >>> np.sin(x[0]) * 2.0 - x[1]
    Symbol(((2.*sin(x_0))-x_1))
    """

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        return f"Symbol({self.value})"

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """Apply a NumPy function elementwise."""
        if method != "__call__" or options:
            raise TraceError(f"np.{ufunc.__name__}.{method} or its options cannot be traced")
        arrays = np.broadcast_arrays(*(_boxed(value) for value in inputs))
        result = np.empty(arrays[0].shape, dtype=object)
        for index in np.ndindex(result.shape):
            result[index] = apply(ufunc.__name__, *(array[index] for array in arrays))
        return result[()]

    def __array_function__(
        self, function: Any, types: Any, arguments: Sequence[Any], options: Any
    ) -> Any:
        """Serve ``np.where`` on scalars; everything else names its replacement."""
        if function is np.where and len(arguments) == 3:
            return Symbol(casadi.if_else(*(expression(value) for value in arguments)))
        if function is np.clip:
            return apply("clip", *arguments)
        raise TraceError(_untraced(function.__name__))

    def __SX__(self) -> Any:
        return self.value

    def __bool__(self) -> bool:
        raise TraceError(
            "decides on a value that is not known while the function is traced; write "
            "np.where(condition, a, b), np.maximum(a, b) or np.minimum(a, b) on single components, "
            "or a smooth form from trajopt.collocation (smooth_abs, smooth_max, smooth_min)"
        )

    def __float__(self) -> float:
        raise TraceError(
            "needs a number where there is only a symbol; write np.sin(...) for math.sin(...), "
            "leave out float(), and build arrays with np.array([...]) without dtype"
        )

    def __int__(self) -> int:
        raise TraceError("needs a whole number where there is only a symbol; leave out int()")

    __index__ = __int__

    def __len__(self) -> int:
        raise TypeError("a component is a single value, it has no length")

    def __iter__(self) -> Any:
        raise TypeError("a component is a single value, it cannot be iterated")

    __hash__ = object.__hash__


def _boxed(value: Any) -> ObjectArray:
    """Return `value` as an object array; a symbol as one without dimensions."""
    if isinstance(value, np.ndarray):
        return value.astype(object)
    if isinstance(value, (list, tuple)):
        return np.array(value, dtype=object)
    box: ObjectArray = np.empty((), dtype=object)
    box[()] = value
    return box


def _untraced(name: str) -> str:
    if name in _REPLACEMENTS:
        return f"np.{name} cannot be traced; {_REPLACEMENTS[name]}"
    return (
        f"np.{name} cannot be traced; write it with arithmetic, np.where and the functions that "
        f"can: {', '.join(sorted(_FUNCTIONS))}"
    )


def apply(name: str, *arguments: Any) -> Symbol:
    """Return the symbol of the NumPy function `name` applied to scalars."""
    if name not in _FUNCTIONS:
        raise TraceError(_untraced(name))
    return Symbol(_FUNCTIONS[name](*(expression(value) for value in arguments)))


def expression(value: Any) -> Any:
    """Return the CasADi expression of a symbol, or the number that `value` is."""
    if isinstance(value, Symbol):
        return value.value
    if isinstance(value, casadi.SX):  # of a user who called CasADi; float() would make it a NaN
        return value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return expression(value[()])
    return float(value)


def _binary(name: str, swapped: bool = False) -> Callable[..., Any]:
    def operator(self: Symbol, other: Any) -> Any:
        if isinstance(other, np.ndarray) and other.ndim:
            return NotImplemented
        try:
            return apply(name, other, self) if swapped else apply(name, self, other)
        except (TypeError, ValueError):
            return NotImplemented

    return operator


def _unary(name: str) -> Callable[..., Any]:
    return lambda self: apply(name, self)


for _special, _name in {
    "add": "add",
    "sub": "subtract",
    "mul": "multiply",
    "truediv": "divide",
    "pow": "power",
}.items():
    setattr(Symbol, f"__{_special}__", _binary(_name))
    setattr(Symbol, f"__r{_special}__", _binary(_name, swapped=True))
for _special, _name in {
    "lt": "less",
    "le": "less_equal",
    "gt": "greater",
    "ge": "greater_equal",
    "eq": "equal",
    "ne": "not_equal",
    "and": "logical_and",
    "or": "logical_or",
}.items():
    setattr(Symbol, f"__{_special}__", _binary(_name))
for _special, _name in {"neg": "negative", "pos": "positive", "abs": "absolute"}.items():
    setattr(Symbol, f"__{_special}__", _unary(_name))
# NumPy applies its functions to an array of objects by calling the method of the same name.
for _name in _FUNCTIONS:
    if not hasattr(Symbol, _name):
        setattr(Symbol, _name, lambda self, *others, _name=_name: apply(_name, self, *others))


def symbols(name: str, count: int) -> ObjectArray:
    """Return an array of `count` symbols."""
    return wrap(casadi.SX.sym(name, count))


def wrap(vector: Any) -> ObjectArray:
    """Return the entries of a CasADi column as an array of symbols."""
    result: ObjectArray = np.empty(vector.shape[0], dtype=object)
    for i in range(vector.shape[0]):
        result[i] = Symbol(vector[i])
    return result


def linear_solve(matrix: Any, right: Any) -> Any:
    """Solve M y = b for a symmetric positive definite M, in traced functions and on numbers.

    Parameters
    ----------
    matrix : (n, n) array_like
        Mass matrix; only the lower triangle is read.
    right : (n,) array_like

    Returns
    -------
    (n,) array

    Notes
    -----
    An LDLᵀ factorization without pivoting, written out: the same operations on every call, as
    Kelly (5.5) asks of functions under an optimizer.

    Examples
    --------
    >>> linear_solve([[4.0, 2.0], [2.0, 3.0]], [2.0, 5.0])
    array([-0.5,  2. ])
    """
    m, b = np.array(matrix, dtype=object), np.array(right, dtype=object)
    n = len(b)
    if m.shape != (n, n) or b.shape != (n,):
        raise ArgumentError(
            f"linear_solve: matrix has shape {m.shape} and right {b.shape}, expected (n, n), (n,)"
        )
    lower: ObjectArray = np.zeros((n, n), dtype=object)
    pivot: ObjectArray = np.zeros(n, dtype=object)
    for j in range(n):
        pivot[j] = m[j, j] - sum(lower[j, k] ** 2 * pivot[k] for k in range(j))
        for i in range(j + 1, n):
            inner = sum(lower[i, k] * lower[j, k] * pivot[k] for k in range(j))
            lower[i, j] = (m[i, j] - inner) / pivot[j]
    y = b.copy()
    for i in range(n):
        y[i] = y[i] - sum(lower[i, k] * y[k] for k in range(i))
    for i in reversed(range(n)):
        y[i] = y[i] / pivot[i] - sum(lower[k, i] * y[k] for k in range(i + 1, n))
    numeric = not any(isinstance(value, Symbol) for value in y)
    return y.astype(np.float64) if numeric else y
