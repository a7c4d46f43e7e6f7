"""A user's own residual: traced once, evaluated on all frames, differentiated in the tangent."""

from __future__ import annotations

import builtins
import math
import pickle
import sys

import casadi
import numpy as np
import pytest

import trajopt
from test_objectives import EVEN, SHARE, STEPS, Scene, check_gradient
from trajopt.objectives import ControlEffort, Residual


def mixed(x2, x1, x):
    """Rows of all three frames, of slides, hinges and the root's rotation vector."""
    return [
        x[0] - 2 * x1[1] * x2[2],
        np.sin(x[3]) * x1[4] + x2[5] ** 2,
        np.cos(x[8]) - x[9] * x2[10],
    ]


def test_value_is_the_weighted_mean_square():
    scene = Scene(Residual(mixed, weight=0.7, name="mixed"))
    a = scene.all
    rows = [mixed(a[i], a[i + 1], a[i + 2]) for i in range(len(STEPS))]
    expected = 0.7 * np.sum(SHARE[:, None] * np.array(rows) ** 2)
    assert scene.values()["mixed"] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_gradient_through_the_rotation_chart(formulation):
    turned = trajopt.load_model("chain").home.copy()
    turned[3:6] = [0.9, -1.1, 0.6]
    scene = Scene(
        Residual(mixed),
        steps=EVEN,
        formulation=formulation,
        initial={"pose": turned, "height": 0.3},
    )
    assert np.linalg.norm(scene.all[:, 3:6], axis=1).min() > 1.0
    check_gradient(scene, h=1e-5)


def test_one_expression_and_constants():
    def knee(x2, x1, x):
        return x[7] - 0.3

    scene = Scene(Residual(knee, weight=2.0, name="knee"), ControlEffort())
    expected = 2.0 * np.sum(SHARE * (scene.x[:, 7] - 0.3) ** 2)
    assert scene.values()["knee"] == pytest.approx(expected, rel=1e-12)


def test_names_are_kept_apart():
    def row(x2, x1, x):
        return x[0]

    scene = Scene(Residual(row, name="mine"), Residual(row, name="mine"))
    assert scene.transcription.term_names == ["mine", "mine 2"]


def test_a_solve_obeys_it():
    model = trajopt.load_model("chain")
    bend = Residual(lambda x2, x1, x: x[7] - 0.4, weight=10.0, name="bend")
    problem = trajopt.Problem(model, duration=1.0, dt=0.05).add(
        bend, *trajopt.objectives.regularizers(0.1)
    )
    solution = trajopt.solve(problem, threads=1, max_iterations=150)
    assert solution.x[5:-4, 7] == pytest.approx(0.4, abs=0.05)
    assert solution.objective_terms["bend"] < 1.0
    assert solution.frame_violation.max() / solution.body_weight < 1e-6


def branching(x2, x1, x):
    if x[0] > 0:
        return 1.0
    return x[0]


def with_math(x2, x1, x):
    height = x[2]
    return math.sin(height)


def in_numpy(x2, x1, x):
    return np.interp(x[0], [0, 1], [0, 1])


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (branching, "`if x[0] > 0:` decides on a value that is not known while the function is"),
        (branching, "write np.where(condition, a, b)"),
        (with_math, "`return math.sin(height)` needs a number where there is only a symbol"),
        (with_math, "write np.sin(...) for math.sin(...)"),
        (in_numpy, "np.interp cannot be traced; write trajopt.collocation.table(x, y)"),
        (lambda x2, x1, x: np.round(x[0]), "np.round cannot be traced; write it with arithmetic"),
        (
            lambda x2, x1, x: np.linalg.inv(np.outer(x, x)),
            "calls np.linalg, which works on numbers",
        ),
        (lambda x2, x1, x: np.array(x, dtype=float), "build arrays with np.array([...]) without"),
        (lambda x2, x1, x: x[0] % 2, "unsupported operand type(s) for %"),
        (lambda x2, x1: x1[0], "it is called with (x2, x1, x)"),
        (lambda x2, x1, x: x[99], "components there are: x2 14, x1 14, x 14"),
        (lambda x2, x1, x: None, "returned NoneType, expected a sequence of values (a missing"),
        (lambda x2, x1, x: "far", "returned str, expected a sequence of values"),
        (lambda x2, x1, x: [x[0], np.nan], "returned nan, expected finite values"),
        (lambda x2, x1, x: [], "returned no values"),
        (lambda x2, x1, x: [1.0, 2.0], "returned what no motion changes, [1, 2]"),
        (lambda x2, x1, x: 0 * x[3], "returned what no motion changes, 0"),
        (lambda x2, x1, x: 1 / 0, "division by zero"),
    ],
)
def test_functions_that_cannot_be_used_are_refused_when_they_are_added(function, message):
    problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.05)
    with pytest.raises(trajopt.TrajoptError) as caught:
        problem.add(Residual(function, name="mine"))
    assert isinstance(caught.value, (ValueError, TypeError))
    assert str(caught.value).startswith("Residual 'mine': function ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert problem.terms == []


def test_the_line_of_the_user_is_named():
    problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.05)
    line = with_math.__code__.co_firstlineno + 2
    with pytest.raises(trajopt.ArgumentError, match=rf"test_traced.py, line {line}: `return math"):
        problem.add(Residual(with_math))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"function": 3.0}, "function must be a function f(x2, x1, x), not 3.0"),
        ({"function": mixed, "name": 7}, "name must be a string, not 7"),
        ({"function": mixed, "weight": -1.0}, "weight must be >= 0, not -1.0"),
    ],
)
def test_arguments_of_a_residual(arguments, message):
    with pytest.raises(trajopt.TrajoptError) as caught:
        Residual(**arguments)
    assert message in str(caught.value)


def test_a_function_is_called_once():
    calls = []

    def counted(x2, x1, x):
        calls.append(x)
        return x[7] - 0.1

    model = trajopt.load_model("chain")
    problem = trajopt.Problem(model, duration=1.0, dt=0.05)
    problem.add(Residual(counted), ControlEffort())
    trajopt.solve(problem, threads=1, max_iterations=3)
    assert len(calls) == 1


def test_a_problem_with_a_residual_can_be_sent_to_another_process():
    problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.05)
    problem.add(Residual(mixed), ControlEffort())
    copy = pickle.loads(pickle.dumps(problem))
    here, there = (trajopt.solve(p, threads=1, max_iterations=2) for p in (problem, copy))
    assert np.array_equal(here.x, there.x)


@pytest.mark.parametrize(
    "function",
    [
        lambda x2, x1, x: [casadi.sin(x[8]) + x1[7], x1[7] * casadi.cos(x[7])],
        lambda x2, x1, x: casadi.vertcat(casadi.sin(x[8]) + x1[7], casadi.cos(x[7]) * x1[7]),
    ],
)
def test_functions_of_casadi_are_as_good_as_those_of_numpy(function):
    def plain(x2, x1, x):
        return [np.sin(x[8]) + x1[7], np.cos(x[7]) * x1[7]]

    one, other = Scene(Residual(function)), Scene(Residual(plain))
    assert one.values() == other.values()
    check_gradient(one, h=1e-5)


def test_vectors_are_traced_as_a_whole():
    scene = Scene(Residual(lambda x2, x1, x: 0.5 * (x - 2 * x1 + x2)[6:] @ np.ones(8)))
    a = scene.all
    rows = 0.5 * (a[2:] - 2 * a[1:-1] + a[:-2])[:, 6:] @ np.ones(8)
    assert scene.values()["residual"] == pytest.approx(np.sum(SHARE * rows**2), rel=1e-10)


def test_without_casadi(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **kwargs):
        if name == "casadi":
            raise ImportError("No module named 'casadi'")
        return real(name, *rest, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    for module in [name for name in sys.modules if name.startswith("trajopt.tracing")]:
        monkeypatch.delitem(sys.modules, module)
    with pytest.raises(trajopt.MissingDependencyError, match=r"contact-trajopt\[casadi\]"):
        Scene(Residual(mixed))
