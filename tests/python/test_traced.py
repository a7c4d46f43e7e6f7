"""A user's own residual: traced once, evaluated on all frames, differentiated in the tangent."""

from __future__ import annotations

import builtins

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


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x2, x1, x: 1.0 if x[0] > 0 else 0.0, "could not be traced"),
        (lambda x2, x1: x1[0], "could not be traced"),
        (lambda x2, x1, x: x[99], "could not be traced"),
        (lambda x2, x1, x: None, "it returned None; end it with `return ...`"),
        (lambda x2, x1, x: "far", "could not be traced"),
        (lambda x2, x1, x: x @ x.T, "returned shape (14, 14), expected a column"),
    ],
)
def test_functions_that_cannot_be_used(function, message):
    with pytest.raises(trajopt.ArgumentError) as caught:
        Scene(Residual(function, name="mine"))
    assert "Residual 'mine'" in str(caught.value)
    assert message in str(caught.value)


def test_without_casadi(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **kwargs):
        if name == "casadi":
            raise ImportError("No module named 'casadi'")
        return real(name, *rest, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(trajopt.MissingDependencyError, match=r"contact-trajopt\[casadi\]"):
        Scene(Residual(mixed))
