"""A user's function, traced once: from plain NumPy-style Python to a CasADi function."""

from __future__ import annotations

import linecache
import re
import sysconfig
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.tracing._casadi import casadi
from trajopt.tracing.symbols import Symbol, TraceError, wrap

__all__ = ["flatten", "trace"]

_LIBRARIES = tuple(
    str(path)
    for path in {
        Path(__file__).parents[1],
        # Where they are: not always in this environment's own folders.
        *(Path(module.__path__[0]) for module in (np, casadi)),
        *(Path(sysconfig.get_path(kind)) for kind in ("stdlib", "purelib", "platlib")),
    }
)


def trace(
    owner: str,
    argument: str,
    function: Callable[..., Any],
    inputs: Sequence[tuple[str, int]],
    rows: int | None,
) -> Any:
    """Return the CasADi function of `function`.

    Parameters
    ----------
    owner, argument : str
        For messages.
    function : callable
    inputs : sequence of (str, int)
        Name and length of every argument; -1 stands for a scalar. Parameters ``p`` of length 0
        are left out of the call.
    rows : int, optional
        Number of values to be returned; None takes what comes.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If it cannot be traced: with the line, and what to write instead.
    """
    if not callable(function):
        raise ArgumentTypeError(
            f"{owner}: {argument} must be a function, not {type(function).__name__}"
        )
    columns = [casadi.SX.sym(name, abs(length)) for name, length in inputs]
    given: list[Any] = []
    for column, (name, length) in zip(columns, inputs, strict=True):
        if length or name != "p":
            given.append(Symbol(column[0]) if length < 0 else wrap(column))
    try:
        returned = function(*given)
    except Exception as error:
        raise ArgumentError(
            f"{owner}: {argument} {_where(error)}{_reason(error, inputs)}"
        ) from error
    values = flatten(owner, argument, returned)
    if rows is not None and len(values) != rows:
        raise ArgumentError(
            f"{owner}: {argument} returned {len(values)} values, expected {rows}"
            + (" (one for every state)" if argument == "dynamics" else "")
        )
    result = casadi.vertcat(*values) if values else casadi.SX(0, 1)
    return casadi.Function(argument, columns, [casadi.densify(casadi.cse(casadi.SX(result)))])


def flatten(owner: str, argument: str, returned: Any) -> list[Any]:
    """Return the expressions in what a function returned: a value, or sequences of values."""
    if isinstance(returned, Symbol):
        return [returned.value]
    if isinstance(returned, casadi.SX) and 1 in returned.shape:
        return casadi.vertsplit(casadi.vec(returned))
    if isinstance(returned, (list, tuple)):
        return [value for part in returned for value in flatten(owner, argument, part)]
    if isinstance(returned, np.ndarray):
        return [value for part in returned.ravel() for value in flatten(owner, argument, part)]
    if isinstance(returned, (int, float, np.integer, np.floating)):
        if not np.isfinite(returned):
            raise ArgumentError(f"{owner}: {argument} returned {returned}, expected finite values")
        return [float(returned)]
    raise ArgumentTypeError(
        f"{owner}: {argument} returned {type(returned).__name__}, expected a sequence of values "
        "(a missing `return`?)"
    )


def _where(error: BaseException) -> str:
    """Say in which line of the user's code `error` arose."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith(_LIBRARIES)]
    if not own:
        return "could not be traced: "
    frame = own[-1]
    text = frame.line or linecache.getline(frame.filename, frame.lineno or 0).strip()
    shown = f" `{text}`" if text else ""
    return f"could not be traced: {Path(frame.filename).name}, line {frame.lineno}:{shown} "


def _reason(error: BaseException, inputs: Sequence[tuple[str, int]]) -> str:
    """Return what is wrong with the line, and what to write instead."""
    inside = " ".join(frame.filename for frame in traceback.extract_tb(error.__traceback__))
    if re.search(r"numpy\W+linalg\b", inside) or re.search(
        r"ufunc '(solve|inv|det|eig|lstsq|svd)", str(error)
    ):
        return (
            "calls np.linalg, which works on numbers only; write "
            "trajopt.collocation.linear_solve(M, b) for a mass matrix, np.sqrt(v @ v) for a norm"
        )
    if isinstance(error, TraceError):
        return str(error)
    if isinstance(error, TypeError) and "positional argument" in str(error):
        names = ", ".join(name for name, length in inputs if length or name != "p")
        return f"({error}); it is called with ({names})"
    if isinstance(error, IndexError):
        counts = ", ".join(f"{name} {length}" for name, length in inputs if length > 0)
        return f"({error}); components there are: {counts}"
    return (
        f"({type(error).__name__}: {error}); use arithmetic and NumPy functions on components, "
        "such as np.sin(x[1])"
    )
