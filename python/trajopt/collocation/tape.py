"""CasADi's scalar functions as tapes: lists of operations that the core runs for many copies."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.tracing import casadi

__all__ = ["make_tape"]

# In the order of trajopt::interior_point::Operation.
# fmt: off
OPERATIONS = (
    "ASSIGN", "ADD", "SUB", "MUL", "DIV", "NEG", "EXP", "LOG", "POW", "CONSTPOW", "SQRT", "SQ",
    "TWICE", "SIN", "COS", "TAN", "ASIN", "ACOS", "ATAN", "LT", "LE", "EQ", "NE", "NOT", "AND",
    "OR", "FLOOR", "CEIL", "FMOD", "FABS", "SIGN", "COPYSIGN", "IF_ELSE_ZERO", "ERF", "FMIN",
    "FMAX", "INV", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "ATAN2", "CONST", "INPUT",
    "OUTPUT",
)
# fmt: on


def make_tape(
    function: Any, inputs: list[NDArray[np.float64]], outputs: list[NDArray[np.float64]]
) -> dict[str, Any] | None:
    """Return the tape of a function on given memory, or None when the core cannot run it.

    Parameters
    ----------
    function : casadi.Function
        Of one copy.
    inputs, outputs : list of arrays
        For all copies, one behind the other.
    """
    if not function.is_a("SXFunction"):
        return None
    codes = {getattr(casadi, f"OP_{name}"): code for code, name in enumerate(OPERATIONS)}
    constant, given, result = (codes[getattr(casadi, f"OP_{n}")] for n in OPERATIONS[-3:])
    count = function.n_instructions()
    # CasADi answers for one operation at a time: past its Python layer, and into one flat list, as
    # tens of thousands of lists would keep the garbage collector busy.
    wrapped: Any = import_module("casadi._casadi")
    kind, ins, outs = (
        getattr(wrapped, f"Function_instruction_{what}") for what in ("id", "input", "output")
    )
    code: list[int] = []
    constants: list[float] = []
    for k in range(count):
        operation = codes.get(kind(function, k))
        if operation is None:
            return None
        results = outs(function, k)
        if operation == constant:
            code += (operation, results[0], len(constants), 0)
            constants.append(function.instruction_constant(k))
            continue
        arguments = ins(function, k)
        if operation == given:
            code += (operation, results[0], *arguments)
        elif operation == result:
            code += (operation, results[0], arguments[0], results[1])
        else:
            code += (operation, results[0], arguments[0], arguments[-1])
    return {
        "code": np.array(code, dtype=np.int32).reshape(count, 4),
        "constants": np.array(constants, dtype=np.float64),
        "registers": int(function.sz_w()),
        "inputs": [(a, function.nnz_in(i), function.nnz_in(i)) for i, a in enumerate(inputs)],
        "outputs": [(a, function.nnz_out(i), function.nnz_out(i)) for i, a in enumerate(outputs)],
    }
