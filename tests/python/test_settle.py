"""Where a motion starts: settled on the ground, whatever the pose that was given."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassVelocity, regularizers
from trajopt.settle import free_bases, ground_gap, lower
from trajopt.transcription import Stage, Transcription

NAMES = ("chain", "biped", "bird", "mammal", "spider", "humanoid")


def start(problem, stage=None):
    return Transcription(problem).initial_frames(stage or Stage())


@pytest.fixture
def mjcf(tmp_path):
    def load(body, name="robot"):
        path = tmp_path / f"{name}.xml"
        path.write_text(f"<mujoco model='{name}'><worldbody>{body}</worldbody></mujoco>")
        return trajopt.load_model(path)

    return load


@pytest.mark.parametrize("name", NAMES)
def test_characters_stand_still_after_settling(name):
    model = trajopt.load_model(name)
    problem = trajopt.Problem(model, duration=1.0, dt=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        before, pose = start(problem)
    np.testing.assert_array_equal(before, pose)
    np.testing.assert_array_equal(pose[model.actuated], model.home[model.actuated])
    force = model.dynamics_residual(pose, pose, pose, 0.05, problem.world, trajopt.Contact())
    assert np.abs(force[~model.actuated]).max() < 1e-7 * 9.81 * model.mass
    assert -0.02 * model.length < model.lowest_point(pose) < 0


@pytest.mark.parametrize(
    ("offset", "message"), [(0.5, "0.5 m above the ground"), (-0.4, "0.4 m inside the ground")]
)
def test_poses_off_the_ground_are_moved_with_a_warning(offset, message):
    model = trajopt.load_model("chain")
    pose = model.home.copy()
    pose[2] += offset - model.lowest_point(pose)
    problem = trajopt.Problem(model, duration=1.0, dt=0.05, initial=pose)
    problem.add(CenterOfMassVelocity((0.3, 0, 0)), *regularizers())
    with pytest.warns(trajopt.ModelWarning, match=message) as caught:
        solution = trajopt.solve(problem, threads=1, max_iterations=400)
    assert len(caught) == 1
    assert "the pose is moved until it stands" in str(caught[0].message)
    assert abs(model.lowest_point(solution.initial[0])) < 0.02 * model.length
    assert solution.frame_violation.max() / solution.body_weight < 1e-6


def test_soft_ground_is_sunk_into_deeper():
    model = trajopt.load_model("mammal")
    problem = trajopt.Problem(model, duration=1.0, dt=0.05)
    soft, hard = (model.lowest_point(start(problem, Stage(stiffness=s))[1]) for s in (1 / 50, 1.0))
    assert soft < 5 * hard < 0


FREE_BALL = (
    "<body name='{0}' pos='{1} 0 {2}'><freejoint/><geom type='sphere' size='.1' mass='1'/></body>"
)


def test_every_free_body_comes_down(mjcf):
    model = mjcf(FREE_BALL.format("a", 0, 0.5) + FREE_BALL.format("b", 1, 0.1))
    assert list(free_bases(model)) == [2, 8]
    lowered = lower(model, trajopt.World(), model.home, 0.01)
    assert lowered[[2, 8]] == pytest.approx(0.09)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pose = start(trajopt.Problem(model, duration=1.0, dt=0.05))[1]
    assert pose[2] == pytest.approx(pose[8])
    assert 0.09 < pose[2] < 0.1


def test_a_slope_has_no_rest_and_says_so():
    model = trajopt.load_model("chain")
    slope = trajopt.World([trajopt.Plane(normal=(0.1, 0, 1))])
    assert ground_gap(model, slope, model.home) is not None
    with pytest.warns(trajopt.ModelWarning, match="does not come to rest on the ground"):
        start(trajopt.Problem(model, duration=1.0, dt=0.05, world=slope))


ARM = (
    "<body name='arm' pos='0 0 {0}'><joint name='turn' axis='0 1 0'/>"
    "<geom type='capsule' fromto='0 0 0 .4 0 0' size='.03' mass='1'/></body>"
)


def test_a_fixed_base_stays_and_only_burial_is_worth_a_word(mjcf):
    high = mjcf(ARM.format(1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        pose = start(trajopt.Problem(high, duration=1.0, dt=0.05))[1]
    np.testing.assert_array_equal(pose, high.home)
    buried = mjcf(ARM.format(-0.5))
    with pytest.warns(trajopt.ModelWarning, match=r"0\.53 m inside the ground; its base is fixed"):
        start(trajopt.Problem(buried, duration=1.0, dt=0.05))


def test_height_needs_something_to_lift(mjcf):
    with pytest.raises(trajopt.ArgumentError, match="needs a model with a free base"):
        trajopt.Problem(mjcf(ARM.format(1.0)), duration=1.0, dt=0.05, initial={"height": 0.3})
