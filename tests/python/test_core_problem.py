"""The compiled problem and its solvers, driven directly: equal bits, callbacks, records."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import trajopt
from trajopt import _core

FRAMES = 20
DT = 0.15  # in units of sqrt(length / gravity)


def make_problem(formulation="frames", threads=1, callback=None):
    """A chain on the ground that is to walk off, in units of its mass, length and gravity."""
    model = trajopt.load_model("chain")
    core = _core.Model(**model.core_arguments(model.mass, model.length))
    physics = _core.Physics(gravity=(0, 0, -1), normal=50.0, friction=50.0, damping=1.0, limit=3.0)
    x = model.home.copy()
    x[:3] /= model.length
    q = _core.configuration_from_vector(core, x[None])[0]
    objective = _core.Objective()
    weight = np.full(FRAMES, 1 / FRAMES)
    target = np.tile([0.3, 0.0, 0.0], (FRAMES, 1))
    objective.add_dense("velocity", "center_of_mass_velocity", 10 * weight, target)
    objective.add_dense("effort", "effort", 1e-3 * weight)
    objective.add_local("smoothness", "acceleration", 1e-2 * weight, np.ones(model.ndof))
    if callback is not None:
        objective.add_callback("callback", 1, 0.5, FRAMES, core, callback)
    problem = _core.TrajectoryProblem(
        model=core,
        physics=physics,
        dt=np.full(FRAMES + 1, DT),
        objective=objective,
        initial=np.array([q, q]),
        velocity=np.zeros(model.ndof),
        formulation=formulation,
        frames_per_knot=5,
        threads=threads,
    )
    noise = 1e-3 * np.random.default_rng(3).normal(size=problem.nodes * problem.primal)
    state = problem.state_from_frames(np.tile(q, (FRAMES, 1)))
    return problem, problem.retract(state, noise)


def digest(formulation, threads, ordering):
    """Solve, and return a digest of the result's bits."""
    problem, state = make_problem(formulation, threads)
    solution = _core.solve_funnel(problem, state, max_iterations=12, ordering=ordering)
    return hashlib.sha256(solution[3].tobytes()).hexdigest()


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_same_bits_for_every_instruction_set_and_thread_count(formulation):
    orderings = ["auto", "sequential", "cyclic", "chunked"]  # of frames, the first is frontal
    script = (
        f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from test_core_problem import digest\n"
        "from trajopt import _core\n"
        f"print(_core.isa(), *[digest({formulation!r}, t, o) for o in {orderings} for t in (1, 2)])"
    )
    results = {}
    for isa in ("portable", "avx2", "avx512"):
        run = subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "TRAJOPT_ISA": isa, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        )
        used, *digests = run.stdout.split()
        results[used] = digests
        assert digests[0::2] == digests[1::2], f"threads change the bits with {used}"
    assert "portable" in results
    for digests in results.values():
        assert digests == results["portable"]


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_gradient_with_a_callback_term(formulation):
    def callback(frames, derivatives):
        ndof = frames.shape[1] - 1
        residual = (frames[2:, 0] - 2 * frames[1:-1, 1] * frames[:-2, 2])[:, None]
        if not derivatives:
            return (residual,)
        jacobian = np.zeros((FRAMES, 1, 3 * ndof))
        jacobian[:, 0, 0] = 1
        jacobian[:, 0, ndof + 1] = -2 * frames[:-2, 2]
        jacobian[:, 0, 2 * ndof + 2] = -2 * frames[1:-1, 1]
        return residual, jacobian

    problem, state = make_problem(formulation, callback=callback)
    gradient = problem.linearize(state)["gradient"].ravel()
    rng = np.random.default_rng(0)
    for _ in range(10):
        direction = rng.normal(size=gradient.size)

        def objective(h, direction=direction):
            return problem.evaluate(problem.retract(state, h * direction))["objective"]

        h = 1e-5
        numeric = (objective(h) - objective(-h)) / (2 * h)
        assert numeric == pytest.approx(gradient @ direction, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    ("rows", "jacobian", "message"),
    [
        (FRAMES + 1, (FRAMES, 1, 3), "residual of a callback has shape"),
        (FRAMES, (FRAMES, 1, 3), "Jacobian of a callback has shape"),
        (FRAMES, None, "Jacobian of a callback is missing"),
    ],
)
def test_what_a_callback_returns_has_to_fit(rows, jacobian, message):
    def callback(frames, derivatives):
        assert derivatives
        residual = np.zeros((rows, 1))
        return (residual,) if jacobian is None else (residual, np.zeros(jacobian))

    problem, state = make_problem(callback=callback)
    with pytest.raises(ValueError, match=message):
        problem.linearize(state)


def test_a_state_has_to_fit():
    problem, state = make_problem()
    for wrong in (state[:-1], np.append(state, 0.0)):
        with pytest.raises(ValueError, match="state holds"):
            problem.evaluate(wrong)
        with pytest.raises(ValueError, match="state holds"):
            _core.solve_funnel(problem, wrong)


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_paper_keeps_its_records(formulation):
    problem, state = make_problem(formulation)
    records = []
    status, message, iterations, final, _ = _core.solve_paper(
        problem,
        state,
        lambda record, _: records.append(record),
        max_iterations=60,
        constraint_limit=100.0,
    )
    assert status in {"solved", "max_iterations"}, message
    assert iterations == len(records)
    penalty = [r["penalty"] for r in records]
    assert penalty == sorted(penalty)
    assert any(r["accepted"] for r in records)
    for before, after in pairwise(records):
        expected = 1.2 * before["radius"] if before["accepted"] else 0.8 * before["step_norm"]
        assert after["radius"] == pytest.approx(expected)
        assert after["accepted"] or after["objective"] == before["objective"]
    assert problem.evaluate(final)["objective"] == records[-1]["objective"]
    start = problem.evaluate(state)  # neither settled nor feasible
    assert records[-1]["constraint_violation"] < 0.1 * start["constraint_norm"]


@pytest.mark.parametrize(
    ("solve", "ordering"), [(_core.solve_funnel, "frontal"), (_core.solve_paper, "chunked")]
)
def test_the_ordering_is_named_where_no_iteration_was_made(solve, ordering):
    problem, state = make_problem()
    status, _, iterations, _, used = solve(problem, np.nan * state)
    assert (status, iterations, used) == ("numerical_failure", 0, ordering)


def test_paper_says_why_it_never_moved():
    problem, state = make_problem("spline")
    status, message, _, final, _ = _core.solve_paper(problem, state, constraint_limit=1e-12)
    assert status == "stalled"
    assert "C_max" in message
    np.testing.assert_array_equal(final, state)


def test_observer_stops_the_paper_solver():
    problem, state = make_problem()
    status, _, iterations, *_ = _core.solve_paper(problem, state, lambda r, _: r["iteration"] < 4)
    assert (status, iterations) == ("interrupted", 5)


def test_spline_needs_two_frames_a_knot():
    model = trajopt.load_model("chain")
    core = _core.Model(**model.core_arguments())
    q = _core.configuration_from_vector(core, model.home[None])[0]
    with pytest.raises(ValueError, match="frames_per_knot = 1"):
        _core.TrajectoryProblem(
            model=core,
            physics=_core.Physics(),
            dt=np.full(11, 0.1),
            objective=_core.Objective(),
            initial=np.array([q, q]),
            velocity=np.zeros(model.ndof),
            formulation="spline",
            frames_per_knot=1,
        )
