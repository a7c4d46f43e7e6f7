"""Where `solve` starts without a warm start, and what it says of tasks that stay undone."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from solve.chain import CHAIN, TARGET, make, share, solve, solved
from trajopt.guess import asked_velocity, gliding
from trajopt.objectives import CenterOfMassVelocity, ControlEffort, Pose, regularizers


def test_gliding_gathers_speed_until_it_counts():
    problem = make(duration=2.0)
    still = np.tile(np.linspace(0.0, 1.0, CHAIN.ndof), (problem.frames, 1))
    way = gliding(problem, still) - still
    t = problem.times
    np.testing.assert_allclose(way[t >= 0.2, 0], 0.3 * (t[t >= 0.2] - 0.1), atol=1e-12)
    np.testing.assert_allclose(way[t < 0.2, 0], 0.3 * t[t < 0.2] ** 2 / 0.4, atol=1e-12)
    assert not way[:, 1:].any()


def test_gliding_is_level_and_as_the_heaviest_term_asks():
    problem = trajopt.Problem(CHAIN, duration=1.0, dt=0.05).add(
        CenterOfMassVelocity((9, 9, 9), weight=0.5),
        CenterOfMassVelocity((1, 2, 3), axes=(1, 0, 1), start=0.4),
    )
    velocity, start = asked_velocity(problem)
    np.testing.assert_allclose(velocity, [1, 0, 0])
    assert start == 0.4


def test_a_stride_says_where_a_periodic_motion_glides():
    problem = make(periodic=True, stride=np.array([0.2, 0, 0]))
    still = np.zeros((problem.frames, CHAIN.ndof))
    np.testing.assert_array_equal(gliding(problem, still), still)


@pytest.mark.parametrize(
    ("duration", "guess", "method", "glides"),
    [
        (10, "auto", "default", False),
        (80, "auto", "default", True),
        (80, "auto", "paper", False),
        (80, "still", "default", False),
        (10, "gliding", "default", True),
        (10, "gliding", "paper", True),
    ],
)
def test_long_ways_begin_on_the_way(duration, guess, method, glides, monkeypatch):
    starts = []

    def start(transcription, core, state, stage, initial):
        starts.append(core.evaluate(state)["frames"][-1, 0] - core.evaluate(state)["frames"][2, 0])
        raise RuntimeError("seen")

    monkeypatch.setattr("trajopt.run.check_start", start)
    problem = make(duration=duration, dt=0.1)
    with pytest.raises(RuntimeError, match="seen"):
        solve(problem, guess=guess, method=method)
    way = starts[0] * CHAIN.length
    assert way == pytest.approx(0.3 * (duration - 0.1) if glides else 0.0, abs=0.05)


def test_a_gliding_start_ends_as_true():
    found = solve(make(), guess="gliding")
    assert found.status == "solved"
    assert share(found) < 1e-9
    assert found.objective == pytest.approx(solved().objective, rel=0.1)


@pytest.mark.slow
def test_a_long_walk_does_not_lunge_back_where_nobody_looks():
    """From rest its beginning goes back by meters, in the second that does not count."""
    changes = ["grid.duration=80", "grid.dt=0.05"]
    problem, options = trajopt.load_scenario("mammal-walk").override(changes).build()
    found = trajopt.solve(problem, **options)
    way = found.center_of_mass[:, 0] - found.center_of_mass[0, 0]
    assert found.status == "solved"
    assert way.min() > -0.3
    assert way[-1] == pytest.approx(0.3 * 79, rel=0.05)


def test_a_task_left_undone_is_said_with_its_share():
    idle = trajopt.Problem(CHAIN, duration=1.0, dt=0.05).add(TARGET, ControlEffort(1e4))
    found = solve(idle)
    assert found.status == "solved"
    kept = 100 * found.objective_terms["center_of_mass_velocity"]
    assert f"center_of_mass_velocity still costs {kept:.0f} % of what it costs at rest" in (
        found.message
    )
    assert "at rest" not in solved().message  # a tenth: a second is short for a task like that


def test_gliding_needs_somewhere_to_go():
    posing = trajopt.Problem(CHAIN, duration=1.0, dt=0.05).add(Pose(), *regularizers())
    with pytest.raises(trajopt.ArgumentError, match="guess = 'gliding' needs a CenterOfMassVeloc"):
        solve(posing, guess="gliding")
    with pytest.raises(trajopt.ArgumentError, match=r"problems\[1\]: guess = 'gliding' needs"):
        trajopt.solve_batch([make(), posing], guess="gliding")
    with pytest.raises(
        trajopt.ArgumentError, match="guess = 'flying', expected one of auto, still"
    ):
        solve(make(), guess="flying")
    assert solve(posing, guess="gliding", warm_start=solved(), max_iterations=2).iterations == 2
