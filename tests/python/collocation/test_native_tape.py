"""Tapes against CasADi's own evaluation of the same functions."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest

from collocation.examples import example
from trajopt import _core
from trajopt import collocation as col
from trajopt.collocation.tape import OPERATIONS, make_tape


def run(function: Any, inputs: list[np.ndarray], copies: int, threads: int = 1) -> list[np.ndarray]:
    outputs = [np.zeros(copies * function.nnz_out(i)) for i in range(function.n_out())]
    flat = [np.ascontiguousarray(a, dtype=np.float64).ravel() for a in inputs]
    tape = make_tape(function, flat, outputs)
    assert tape is not None
    _core.evaluate_tape(tape, copies, threads)
    return [o.reshape(copies, -1) for o in outputs]


def test_every_operation_casadi_can_emit() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    unary = (
        ca.exp, ca.log, ca.sqrt, ca.sin, ca.cos, ca.tan, ca.asin, ca.acos, ca.atan, ca.floor,
        ca.ceil, ca.fabs, ca.sign, ca.erf, ca.sinh, ca.cosh, ca.tanh, ca.asinh, ca.acosh, ca.atanh,
        ca.logic_not, lambda v: v**2, lambda v: 2 * v, lambda v: 1 / v, lambda v: -v,
        lambda v: v**2.5, lambda v: v**3,
    )  # fmt: skip
    binary = (
        ca.fmin, ca.fmax, ca.fmod, ca.atan2, ca.copysign, ca.logic_and, ca.logic_or,
        lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a / b,
        lambda a, b: a**b, lambda a, b: a < b, lambda a, b: a <= b, lambda a, b: a == b,
        lambda a, b: a != b, lambda a, b: ca.if_else(a > 0.5, b, 3.0),
    )  # fmt: skip
    results = [f(x) for f in unary] + [f(x, y) for f in binary]
    function = ca.Function("f", [x, y], [ca.vertcat(*results)])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    # All but the plain copy, which CasADi does not emit for scalars.
    missing = {n for n in OPERATIONS if getattr(ca, f"OP_{n}") not in used}
    assert missing <= {"ASSIGN", "POW", "CONSTPOW"}
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-2, 2, 19), rng.uniform(-2, 2, 19)
    a[3] = b[3] = 0.0
    (out,) = run(function, [a, b], 19)
    expected = np.array([np.asarray(function(u, v)).ravel() for u, v in zip(a, b, strict=True)])
    np.testing.assert_allclose(out, expected, rtol=4e-16, atol=4e-16)


@pytest.mark.parametrize("copies", [1, 7, 8, 9, 33])
def test_tails_and_threads(copies: int) -> None:
    x = ca.SX.sym("x", 3)
    f = ca.Function("f", [x], [ca.vertcat(ca.sin(x[0]) * x[1], x[2] ** 3), ca.dot(x, x)])
    points = np.random.default_rng(copies).normal(size=(copies, 3))
    one, two = run(f, [points], copies), run(f, [points], copies, threads=2)
    for a, b in zip(one, two, strict=True):
        assert np.array_equal(a, b)
    for k in range(copies):
        first, second = f(points[k])
        np.testing.assert_allclose(one[0][k], np.asarray(first).ravel(), rtol=1e-15)
        np.testing.assert_allclose(one[1][k], np.asarray(second).ravel(), rtol=1e-15)


def test_what_has_no_scalar_form_is_no_tape() -> None:
    x = ca.MX.sym("x", 2)
    assert make_tape(ca.Function("f", [x], [ca.mtimes(x, x.T)]), [], []) is None


def test_biped_against_ipopt() -> None:
    """Kelly 7: 390.79043694 with the torso's center measured from the hip."""
    problem = example("_biped_model").problem()
    native, ipopt = (col.solve(problem, segments=25, solver=s) for s in ("native", "ipopt"))
    assert native.status.value == "solved", native.message
    assert native.objective == pytest.approx(ipopt.objective, rel=1e-8)
    assert native.objective == pytest.approx(390.79043694, rel=1e-8)
