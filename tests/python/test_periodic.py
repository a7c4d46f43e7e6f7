"""Gaits that repeat: the motion closes up to a stride, and physics holds across the seam."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassVelocity, Smoothness, regularizers
from trajopt.transcription import Stage, Transcription

STRIDE = (0.3, 0.0, 0.0)
MAMMAL = trajopt.load_model("mammal")


def make(**changes):
    arguments = {"duration": 1.0, "dt": 0.05, "periodic": True, "stride": STRIDE, **changes}
    problem = trajopt.Problem(MAMMAL, **arguments)
    return problem.add(CenterOfMassVelocity((0.3, 0, 0)), *regularizers())


@pytest.fixture(scope="module")
def gait():
    solution = trajopt.solve(make(), threads=1)
    assert solution.status == "solved", solution.message
    return solution


def test_the_gait_closes_up_to_its_stride(gait):
    moved = np.concatenate([STRIDE, np.zeros(MAMMAL.ndof - 3)])
    np.testing.assert_allclose(gait.initial[0], gait.x[-1] - moved, atol=1e-12)
    np.testing.assert_allclose(gait.initial[1], gait.x[-2] - moved, atol=1e-12)
    assert np.ptp(gait.x[:, 6:], axis=0).max() > 0.01  # it does walk
    speed = (gait.center_of_mass[-1] - MAMMAL.center_of_mass(gait.initial[0])) / 1.0
    np.testing.assert_allclose(speed, STRIDE, atol=1e-9)


def test_physics_holds_across_the_seam(gait):
    moved = np.concatenate([STRIDE, np.zeros(MAMMAL.ndof - 3)])
    twice = np.concatenate([gait.x, gait.x + moved])
    force = MAMMAL.dynamics_residual(
        twice[2:], twice[1:-1], twice[:-2], 0.05, gait.world, gait.contact
    )
    assert np.abs(force[:, :3]).max() < 1e-8 * gait.body_weight
    assert np.abs(force[:, 3:6]).max() < 1e-2 * gait.body_weight * MAMMAL.length
    torque = force[:, MAMMAL.actuated]
    np.testing.assert_allclose(torque[-20:], gait.u, atol=1e-8)
    np.testing.assert_allclose(torque[18], gait.u[0], atol=1e-8)


def test_impulse_of_a_period_balances_the_weight(gait):
    lift = gait.contact_forces.sum(axis=1).mean(axis=0)
    assert lift[2] == pytest.approx(gait.body_weight, rel=0.01)
    assert abs(lift[0]) < 0.01 * gait.body_weight


def test_the_guess_glides_and_has_no_seam():
    transcription = Transcription(make())
    initial = transcription.initial_frames(Stage())
    frames = transcription.still(initial)
    np.testing.assert_allclose(frames[-1, :3] - initial[1, :3], STRIDE)
    core = transcription.core_problem(Stage(), initial)
    values = dict(
        zip(
            transcription.term_names,
            core.evaluate(core.state_from_frames(transcription.to_core(frames)))["terms"],
            strict=True,
        )
    )
    assert values["center_of_mass_velocity"] < 1e-20
    assert values["smoothness"] < 1e-20


def test_a_gait_continues_from_a_gait(gait):
    finer = trajopt.solve(make(dt=0.025), threads=1, warm_start=gait)
    assert finer.status == "solved"
    assert finer.history[0].objective < 3 * gait.objective + 0.05


def test_standing_still_is_a_gait_without_a_stride():
    problem = make(stride=(0, 0, 0))
    problem.terms.clear()
    problem.add(Smoothness(1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solution = trajopt.solve(problem, threads=1, max_iterations=100)
    assert solution.objective < 1e-6
    np.testing.assert_allclose(solution.x, np.tile(solution.x[0], (20, 1)), atol=1e-2)


def test_uneven_steps_around_the_ring():
    steps = np.tile([0.04, 0.05, 0.06, 0.06, 0.05, 0.04, 0.04, 0.05, 0.06, 0.05], 2)
    steps[-1] = steps[0]
    problem = make(duration=float(steps.sum()), dt=steps)
    solution = trajopt.solve(problem, threads=1, max_iterations=400)
    assert solution.frame_violation.max() < 1e-6 * solution.body_weight
