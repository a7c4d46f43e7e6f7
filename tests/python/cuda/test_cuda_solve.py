"""Whole solves on the GPU against the CPU: the same motion and the same history, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt

SAME = (
    "objective",
    "objective_terms",
    "constraint_violation",
    "frame_violation",
    "damping",
    "step_norm",
    "accepted",
)


@pytest.mark.parametrize("scenario", ["hop", "mammal-walk", "biped-walk"])
def test_same_bits_as_the_cpu(scenario):
    problem, options = trajopt.load_scenario(scenario).build()
    options |= {"max_iterations": 100, "ordering": "cyclic"}
    cpu = trajopt.solve(problem, device="cpu", **options)
    gpu = trajopt.solve(problem, device="cuda", **options)
    assert (cpu.device, gpu.device) == ("cpu", "cuda")
    assert len(cpu.history) == len(gpu.history)
    for a, b in zip(cpu.history, gpu.history, strict=True):
        for name in SAME:
            assert getattr(a, name) == getattr(b, name), f"iteration {a.iteration}: {name}"
    np.testing.assert_array_equal(gpu.x, cpu.x)
    np.testing.assert_array_equal(gpu.u, cpu.u)
