"""Whole solves on the GPU against the CPU: the same motion and the same history, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassVelocity, Residual, regularizers
from trajopt.traced import TracedResidual

SAME = (
    "objective",
    "objective_terms",
    "constraint_violation",
    "frame_violation",
    "damping",
    "step_norm",
    "accepted",
)


def assert_same(problem, **options):
    options |= {"ordering": "cyclic"}
    cpu = trajopt.solve(problem, device="cpu", **options)
    gpu = trajopt.solve(problem, device="cuda", **options)
    assert (cpu.device, gpu.device) == ("cpu", "cuda")
    assert len(cpu.history) == len(gpu.history) > 30
    for a, b in zip(cpu.history, gpu.history, strict=True):
        for name in SAME:
            assert getattr(a, name) == getattr(b, name), f"iteration {a.iteration}: {name}"
    np.testing.assert_array_equal(gpu.x, cpu.x)
    np.testing.assert_array_equal(gpu.u, cpu.u)
    return gpu


@pytest.mark.parametrize("scenario", ["hop", "mammal-walk", "biped-walk"])
def test_same_bits_as_the_cpu(scenario):
    problem, options = trajopt.load_scenario(scenario).build()
    assert_same(problem, **(options | {"max_iterations": 100}))


def test_a_gait_that_repeats_itself():
    stride = np.array([0.3, 0.0, 0.0])
    problem = trajopt.Problem(
        trajopt.load_model("mammal"), duration=1.0, dt=0.05, periodic=True, stride=stride
    ).add(CenterOfMassVelocity(stride), *regularizers())
    found = assert_same(problem, max_iterations=40)
    np.testing.assert_allclose(found.x[-1, :3] - found.initial[0, :3], stride, atol=1e-12)


def bent(goal):
    """A chain that is to move and to bend as a function says."""
    pytest.importorskip("casadi")
    rows = Residual(
        lambda x2, x1, x: [np.sin(x[7]) - goal, x[3] * x[4], x[8] - 2 * x1[8] + x2[8]],
        weight=5.0,
        name="bent",
    )
    return trajopt.Problem(trajopt.load_model("chain"), duration=0.8, dt=0.05).add(
        rows, CenterOfMassVelocity((0.3, 0.0, 0.0), start=0.2), *regularizers()
    )


def test_a_function_of_the_user():
    found = assert_same(bent(0.4), max_iterations=40)
    assert found.objective_terms["bent"] > 0


def test_functions_of_the_user_in_a_batch():
    problems = [bent(0.1), bent(0.4), bent(-0.3)]
    options = {"ordering": "cyclic", "max_iterations": 12}
    for problem, gpu in zip(
        problems, trajopt.solve_batch(problems, device="cuda", **options), strict=True
    ):
        cpu = trajopt.solve(problem, device="cpu", **options)
        assert [r.objective for r in gpu.history] == [r.objective for r in cpu.history]
        np.testing.assert_array_equal(gpu.x, cpu.x)


@pytest.mark.parametrize("after", [0, 3, 10])
def test_what_a_function_raises_arrives_as_on_the_cpu(monkeypatch, after):
    at, calls = TracedResidual.at, []

    def fails(self, q, derivatives):
        if len(calls) > after and self.rows == 3:
            raise ZeroDivisionError("mine")
        calls.append(derivatives)
        return at(self, q, derivatives)

    monkeypatch.setattr(TracedResidual, "at", fails)
    for device in ("cpu", "cuda"):
        calls.clear()
        with pytest.raises(ZeroDivisionError, match="mine"):
            trajopt.solve(bent(0.1), device=device, max_iterations=20)


def test_what_a_function_raises_ends_its_problem_alone(monkeypatch):
    at = TracedResidual.at

    def fails(self, q, derivatives):
        if self.rows == 3:
            raise ZeroDivisionError("mine")
        return at(self, q, derivatives)

    monkeypatch.setattr(TracedResidual, "at", fails)
    other = trajopt.Problem(trajopt.load_model("chain"), duration=0.8, dt=0.05).add(
        Residual(lambda x2, x1, x: x[7] - 0.2, name="bent"),
        CenterOfMassVelocity((0.3, 0.0, 0.0), start=0.2),
        *regularizers(),
    )
    with pytest.raises(trajopt.BatchError) as caught:
        trajopt.solve_batch([bent(0.1), other], device="cuda", max_iterations=3)
    assert list(caught.value.errors) == [0]
    assert isinstance(caught.value.errors[0], ZeroDivisionError)
    assert caught.value.solutions[1].device == "cuda"
