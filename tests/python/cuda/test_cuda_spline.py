"""Splines on the GPU against the CPU: the same motion and the same history, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassVelocity, PhysicsPenalty, regularizers

CHAIN = trajopt.load_model("chain")


def assert_same(gpu, cpu):
    assert (gpu.device, cpu.device) == ("cuda", "cpu")
    assert (gpu.status, gpu.message) == (cpu.status, cpu.message)
    for name in ("objective", "constraint_violation", "frame_violation", "damping", "accepted"):
        assert [getattr(r, name) for r in gpu.history] == [getattr(r, name) for r in cpu.history]
    for name in ("x", "u", "control_points"):
        np.testing.assert_array_equal(getattr(gpu, name), getattr(cpu, name))


# A hop: contact, a root that turns, stages of growing stiffness.
@pytest.mark.parametrize("frames_per_knot", [4, 10])
def test_same_bits_as_the_cpu(frames_per_knot):
    changes = ["grid.formulation=spline", f"grid.frames_per_knot={frames_per_knot}"]
    problem, options = trajopt.load_scenario("hop").override(changes).build()
    options |= {"max_iterations": 60, "ordering": "cyclic"}
    cpu = trajopt.solve(problem, device="cpu", **options)
    assert cpu.iterations >= 30
    assert_same(trajopt.solve(problem, device="cuda", **options), cpu)


def test_a_spline_starts_where_frames_ended():
    def problem(formulation):
        grid = {"duration": 0.8, "dt": 0.05, "formulation": formulation, "frames_per_knot": 4}
        return trajopt.Problem(CHAIN, **grid).add(
            CenterOfMassVelocity((0.2, 0, 0), start=0.2), *regularizers()
        )

    start = trajopt.solve(problem("frames"), device="cuda", max_iterations=10)
    options = {"warm_start": start, "ordering": "cyclic", "max_iterations": 10}
    cpu = trajopt.solve(problem("spline"), device="cpu", **options)
    assert_same(trajopt.solve(problem("spline"), device="cuda", **options), cpu)


def test_splines_and_frames_in_one_batch():
    def problem(speed, **grid):
        grid = {"duration": 0.8, "dt": 0.05, "formulation": "spline", **grid}
        return trajopt.Problem(CHAIN, **grid).add(
            CenterOfMassVelocity((speed, 0, 0), start=0.2), PhysicsPenalty(0.1), *regularizers()
        )

    problems = [
        problem(0.1, frames_per_knot=4),
        problem(0.3, frames_per_knot=8),
        problem(0.2, formulation="frames"),
        problem(0.4, frames_per_knot=4, integrator="implicit"),
        problem(0.2, frames_per_knot=2),
    ]
    options = {"ordering": "cyclic", "max_iterations": 8}
    found = trajopt.solve_batch(problems, device="cuda", **options)
    for gpu, one in zip(found, problems, strict=True):
        assert_same(gpu, trajopt.solve(one, device="cpu", threads=1, **options))


def test_the_method_of_the_paper_stays_on_the_cpu():
    problem = trajopt.Problem(CHAIN, duration=0.5, dt=0.05, formulation="spline", frames_per_knot=5)
    with pytest.raises(trajopt.DeviceError, match="'paper' runs on the CPU only"):
        trajopt.solve(problem, method="paper", device="cuda")
