"""Functions of the user, written with NumPy: called once with symbols, differentiated by CasADi."""

from trajopt.tracing._casadi import casadi
from trajopt.tracing.symbols import Symbol, TraceError, linear_solve, symbols, wrap
from trajopt.tracing.trace import flatten, trace

__all__ = [
    "Symbol",
    "TraceError",
    "casadi",
    "flatten",
    "linear_solve",
    "symbols",
    "trace",
    "wrap",
]
