"""Batches on the GPU: every problem as `solve` finds it on the CPU, bit for bit."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassVelocity, ControlEffort, regularizers

CHAIN = trajopt.load_model("chain")


def make(speed, terms=(), **changes):
    problem = trajopt.Problem(CHAIN, **{"duration": 0.5, "dt": 0.05, **changes})
    return problem.add(CenterOfMassVelocity((speed, 0, 0), start=0.2), *regularizers(), *terms)


def various():
    """Of two shapes; with other contact laws, starts, steps and time schemes."""
    return [
        make(0.1),
        make(0.4, integrator="verlet"),
        make(0.2, duration=0.6),
        make(0.3, contact=trajopt.Contact(friction=30.0)),
        make(0.1, initial={"height": 0.1}),
        make(-0.2, dt=np.repeat([0.04, 0.06], 5)),
        make(0.1, duration=0.6),
    ]


def assert_same(on_gpu, on_cpu):
    assert (on_gpu.device, on_cpu.device) == ("cuda", "cpu")
    assert (on_gpu.status, on_gpu.message) == (on_cpu.status, on_cpu.message)
    assert [r.objective for r in on_gpu.history] == [r.objective for r in on_cpu.history]
    assert [r.accepted for r in on_gpu.history] == [r.accepted for r in on_cpu.history]
    for name in ("x", "u", "contact_forces", "control_points"):
        assert getattr(on_gpu, name).tobytes() == getattr(on_cpu, name).tobytes(), name


@pytest.mark.parametrize("watched", [False, True])
def test_same_bits_as_the_cpu_alone(watched):
    options = {"ordering": "cyclic", "max_iterations": 12}
    seen = []

    def callback(index, record):
        seen.append(index)
        if record.iteration == 5:
            assert record.snapshot().frames in (10, 12)

    found = trajopt.solve_batch(
        various(), device="cuda", callback=callback if watched else None, **options
    )
    for problem, solution in zip(various(), found, strict=True):
        assert_same(solution, trajopt.solve(problem, device="cpu", threads=1, **options))
    assert len(seen) == watched * sum(solution.iterations for solution in found)


def test_auto_is_the_ordering_of_a_gpu():
    found = trajopt.solve_batch([make(0.1), make(0.2)], device="cuda", max_iterations=1)
    assert {s.ordering for s in found} <= {"cyclic", "chunked"}


def test_one_and_none():
    assert trajopt.solve_batch([], device="cuda") == []
    options = {"ordering": "cyclic", "max_iterations": 6}
    (found,) = trajopt.solve_batch([make(0.3)], device="cuda", **options)
    assert_same(found, trajopt.solve(make(0.3), device="cpu", **options))
    single = trajopt.solve(make(0.3), device="cuda", **options)
    assert single.x.tobytes() == found.x.tobytes()


def test_problems_of_all_kinds_are_solved_together():
    problems = [
        make(0.1),
        make(0.1, periodic=True),
        make(0.1, formulation="spline", frames_per_knot=5),
        make(0.2, terms=[ControlEffort(0.1)]),
    ]
    options = {"max_iterations": 3, "ordering": "cyclic"}
    found = trajopt.solve_batch(problems, device="cuda", **options)
    for problem, solution in zip(problems, found, strict=True):
        assert_same(solution, trajopt.solve(problem, **options))


def test_a_callback_stops_its_problem():
    found = trajopt.solve_batch(
        [make(0.1), make(0.2)],
        device="cuda",
        callback=lambda index, record: index == 0 and record.iteration == 2,
        max_iterations=6,
    )
    assert [(str(s.status), s.iterations) for s in found] == [
        ("interrupted", 2),
        ("max_iterations", 6),
    ]


def test_control_c_keeps_the_best_motions_of_all():
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    options = {"max_iterations": 10**6, "tolerance": 1e-14}
    found = trajopt.solve_batch([make(0.1), make(0.2)], device="cuda", **options)
    timer.join()
    assert [str(s.status) for s in found] == ["interrupted"] * 2
    assert all(s.iterations == len(s.history) > 0 for s in found)


def test_a_snapshot_of_the_past_is_refused():
    kept = []
    trajopt.solve(make(0.1), device="cuda", max_iterations=2, callback=kept.append)
    with pytest.raises(ValueError, match="during the callback only"):
        kept[0].snapshot()
