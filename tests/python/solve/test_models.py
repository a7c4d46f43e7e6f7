"""Models of every kind, thrown, turning and reaching."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from solve.chain import CHAIN, share, solve
from trajopt import objectives as terms
from trajopt.objectives import CenterOfMassVelocity, regularizers


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_somersaults(axis):
    velocity = np.zeros(CHAIN.ndof)
    velocity[3 + axis] = 4 * np.pi
    velocity[2] = 9.81 / 2
    problem = trajopt.Problem(
        CHAIN, duration=1.0, dt=0.025, initial={"height": 2.0, "velocity": velocity}
    )
    problem.add(terms.ControlEffort(0.01), terms.Smoothness(1e-4))
    solution = solve(problem, max_iterations=200)
    assert share(solution) < 1e-8
    step = CHAIN.difference(solution.x[:-1], solution.x[1:])[:, 3:6]
    assert np.linalg.norm(step, axis=1).max() < 1.0
    assert step[:, axis].sum() > 1.5 * np.pi
    frames = np.concatenate([solution.initial[::-1], solution.x])
    np.testing.assert_allclose(
        CHAIN.center_of_mass(frames[2:])
        - 2 * CHAIN.center_of_mass(frames[1:-1])
        + CHAIN.center_of_mass(frames[:-2]),
        np.tile([0, 0, -9.81 * 0.025**2], (40, 1)),
        atol=1e-5,
    )


@pytest.fixture
def mjcf(tmp_path):
    def load(body, extra=""):
        path = tmp_path / "robot.xml"
        path.write_text(f"<mujoco><worldbody>{body}</worldbody>{extra}</mujoco>")
        return trajopt.load_model(path)

    return load


LINK = "<geom type='capsule' fromto='0 0 0 .4 0 0' size='.03' mass='1'/>"
ARM = (
    f"<body name='upper' pos='0 0 1'><joint name='shoulder' axis='0 1 0'/>{LINK}"
    f"<body name='fore' pos='.4 0 0'><joint name='elbow' axis='0 1 0'/>{LINK}</body></body>"
)


def test_fixed_arm_reaches(mjcf):
    arm = mjcf(ARM)
    problem = trajopt.Problem(arm, duration=1.0, dt=0.05)
    problem.add(terms.PointPosition("fore", (0.3, 0, 1.5), point=(0.4, 0, 0), time=1.0))
    problem.add(terms.ControlEffort(1e-3), terms.Smoothness(1e-4))
    solution = solve(problem, max_iterations=200)
    hand = arm.transforms(solution.x[-1])[1]
    np.testing.assert_allclose(hand[:, :3] @ [0.4, 0, 0] + hand[:, 3], [0.3, 0, 1.5], atol=1e-3)
    assert not solution.frame_violation.any()  # every joint has a motor
    assert solution.status == "solved"  # at the optimum no step is left: that is not stalling


@pytest.mark.filterwarnings("ignore:.*gains and force ranges")
def test_cart_pole_swings_up(mjcf):
    cart = mjcf(
        "<body name='cart'><joint name='x' type='slide' axis='1 0 0'/>"
        "<geom type='box' size='.1 .1 .1' mass='1'/>"
        "<body name='pole'><joint name='angle' axis='0 1 0'/>"
        "<geom type='capsule' fromto='0 0 0 0 0 -.5' size='.02' mass='.3'/></body></body>",
        "<actuator><motor joint='x'/></actuator>",
    )
    problem = trajopt.Problem(cart, duration=2.0, dt=0.05, world=trajopt.World([]))
    problem.add(terms.Pose({"x": 0.0, "angle": np.pi}, time=2.0))
    problem.add(terms.ControlEffort(1e-3), terms.Smoothness(1e-4))
    solution = solve(problem, max_iterations=500)
    np.testing.assert_allclose(solution.x[-1], [0, np.pi], atol=1e-2)
    assert share(solution) < 1e-8
    assert solution.u.shape == (40, 1)


def test_actuated_ball_joint(mjcf):
    arm = mjcf(ARM.replace("name='shoulder' axis='0 1 0'", "name='shoulder' type='ball'"))
    assert arm.nactuated == 4
    goal = np.array([0.5, 1.0, -0.3, 0.4])
    problem = trajopt.Problem(arm, duration=1.0, dt=0.05)
    problem.add(terms.Pose(goal, time=1.0), terms.ControlEffort(1e-3), terms.Smoothness(1e-4))
    solution = solve(problem, max_iterations=200)
    np.testing.assert_allclose(solution.x[-1], goal, atol=1e-2)


@pytest.mark.filterwarnings("ignore:.*no collision geometry")
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_two_turns_count_on(mjcf, axis):
    body = mjcf(
        "<body pos='0 0 3'><freejoint/>"
        "<inertial pos='0 0 0' mass='1' diaginertia='.1 .15 .2'/></body>"
    )
    velocity = np.zeros(6)
    velocity[3 + axis] = 4 * np.pi
    problem = trajopt.Problem(body, duration=1.0, dt=0.025, initial={"velocity": velocity})
    solution = solve(problem.add(terms.Smoothness()), max_iterations=60)
    expected = np.zeros((40, 3))
    expected[:, axis] = 4 * np.pi * problem.times
    np.testing.assert_allclose(solution.x[:, 3:], expected, atol=1e-5)
    assert share(solution) < 1e-9


@pytest.mark.filterwarnings("ignore:.*no collision geometry")
def test_a_body_that_nothing_can_move_falls(mjcf):
    body = mjcf(
        "<body pos='0 0 .5'><freejoint/>"
        "<inertial pos='0 0 0' mass='1' diaginertia='.1 .1 .1'/></body>"
    )
    assert (body.npoints, body.nactuated) == (0, 0)
    problem = trajopt.Problem(body, duration=1.0, dt=0.05).add(CenterOfMassVelocity((1, 0, 0)))
    solution = solve(problem, max_iterations=30)
    assert solution.u.shape == (20, 0)
    assert share(solution) < 1e-9
    assert solution.x[-1, 2] == pytest.approx(0.5 - 9.81 * (1 + 0.05) / 2, abs=1e-6)


def test_a_loose_ball_beside_the_robot(mjcf):
    model = mjcf(
        "<body name='box' pos='0 0 .1'><freejoint/><geom type='box' size='.2 .2 .1' mass='2'/>"
        f"<body name='mast' pos='0 0 .1'><joint name='mast' axis='0 1 0'/>{LINK}</body></body>"
        "<body name='ball' pos='2 0 .1'><freejoint/><geom type='sphere' size='.1' mass='1'/></body>"
    )
    problem = trajopt.Problem(model, duration=1.0, dt=0.025)
    problem.add(terms.Pose({"mast": -1.0}, time=1.0), *regularizers(0.1))
    solution = solve(problem, max_iterations=400)
    assert share(solution) < 1e-6
    assert solution.x[-1, 6] == pytest.approx(-1.0, abs=0.2)
    ball = solution.x[:, 7:10]
    np.testing.assert_allclose(ball, np.tile([2, 0, 0.1], (40, 1)), atol=0.02)
