"""What a problem makes of its arguments: grid, start, world; and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.objectives import ControlEffort
from trajopt.transcription import Stage, Transcription

CHAIN = trajopt.load_model("chain")


def make(**changes):
    return trajopt.Problem(CHAIN, **{"duration": 1.0, "dt": 0.05, **changes})


def first_frames(problem):
    return Transcription(problem).initial_frames(Stage())


def test_grid():
    problem = make()
    assert problem.frames == 20
    np.testing.assert_allclose(problem.times, 0.05 * np.arange(1, 21))


def test_uneven_grid():
    steps = np.array([0.1, 0.2, 0.3, 0.25, 0.15])
    problem = make(dt=steps)
    assert problem.frames == 5
    np.testing.assert_allclose(problem.times, np.cumsum(steps))
    finer = problem.with_steps(np.repeat(steps / 2, 2))
    assert (finer.frames, problem.frames) == (10, 5)


def test_terms_are_chained_and_not_shared():
    problem = make().add(ControlEffort())
    other = problem.with_steps(problem.steps).add(ControlEffort())
    assert (len(problem.terms), len(other.terms)) == (1, 2)


def test_pose_by_name():
    name = CHAIN.dof_names[8]
    problem = make(initial={"pose": {name: 0.25}})
    assert problem.initial.pose[8] == 0.25
    rest = np.arange(CHAIN.ndof) != 8
    np.testing.assert_array_equal(problem.initial.pose[rest], CHAIN.home[rest])


@pytest.mark.parametrize("initial", [None, "home", {}, {"pose": "home"}])
def test_home_is_the_default(initial):
    np.testing.assert_array_equal(make(initial=initial).initial.pose, CHAIN.home)


def test_start_in_the_air_with_a_velocity():
    name = CHAIN.dof_names[0]
    problem = make(initial={"height": 0.4, "velocity": {name: 1.5}})
    before, start = first_frames(problem)
    assert CHAIN.lowest_point(start) == pytest.approx(0.4)
    assert start[0] - before[0] == pytest.approx(1.5 * 0.05)


def test_velocity_as_an_array_turns_in_the_tangent():
    velocity = np.zeros(CHAIN.ndof)
    velocity[3:6] = [0.5, 1.0, -2.0]
    problem = make(initial={"height": 1.0, "velocity": velocity})
    before, start = first_frames(problem)
    np.testing.assert_allclose(CHAIN.difference(before, start), 0.05 * velocity, atol=1e-12)


def test_world_without_ground_has_no_contact():
    problem = make(world=trajopt.World([]))
    assert problem.contact is None
    solution = trajopt.solve(
        problem.add(trajopt.objectives.Smoothness()), threads=1, max_iterations=20
    )
    fall = -9.81 * (problem.times**2 + 0.05 * problem.times) / 2  # from equal frames -1 and 0
    start = CHAIN.center_of_mass(CHAIN.home)[2]
    np.testing.assert_allclose(solution.center_of_mass[:, 2] - start, fall, atol=1e-6)
    assert not solution.contact_forces.any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"dt": 0.0}, "dt must be > 0, not 0.0"),
        ({"dt": -0.1}, "dt must be > 0, not -0.1"),
        ({"dt": float("nan")}, "dt must be finite, not nan"),
        ({"dt": "fine"}, "dt must be a number, not str 'fine'"),
        ({"dt": 2.0}, "duration = 1 s must be a multiple of dt = 2 s, at least 4 frames"),
        ({"dt": 0.3}, "duration = 1 s must be a multiple of dt = 0.3 s"),
        ({"dt": [0.5, 0.5]}, "dt must hold at least 4 steps > 0"),
        ({"dt": [0.5, -0.5, 0.5, 0.5]}, "dt must hold at least 4 steps > 0"),
        ({"dt": [0.1] * 5}, "the steps dt add up to 0.5 s, duration is 1 s"),
        ({"duration": -1.0}, "duration must be > 0, not -1.0"),
        ({"duration": float("inf")}, "duration must be finite, not inf"),
        ({"duration": None}, "duration must be a number, not NoneType None"),
        ({"formulation": "collocation"}, "formulation = 'collocation', expected one of frames"),
        ({"integrator": "rk4"}, "integrator = 'rk4', expected one of implicit"),
        ({"frames_per_knot": 1}, "frames_per_knot must be a whole number >= 2, not 1"),
        ({"frames_per_knot": 2.5}, "frames_per_knot must be a whole number >= 2, not 2.5"),
        ({"formulation": "spline", "frames_per_knot": 7}, "20 frames (duration / dt) must be a"),
        (
            {"formulation": "spline", "frames_per_knot": 2, "dt": [0.1, 0.4, 0.25, 0.25]},
            "the spline needs one dt",
        ),
        ({"periodic": True, "formulation": "spline"}, "periodic = True needs formulation 'frames'"),
        ({"periodic": True, "dt": 0.2}, "an even number of at least 8 frames"),
        ({"periodic": True, "dt": [0.1] * 8 + [0.05] * 4}, "a first and a last step of the same"),
        ({"stride": (1, 2)}, "stride has shape (2,), expected (3,)"),
        ({"limit": -1.0}, "limit must be >= 0, not -1.0"),
        ({"self_collision": -1.0}, "self_collision must be >= 0, not -1.0"),
        ({"world": "moon"}, "world must be a World or None, not str"),
        ({"contact": {"normal": 1}}, "contact must be a Contact or None, not dict"),
        ({"initial": np.full(14, np.nan)}, "initial: pose[0] = nan, expected finite numbers"),
        ({"initial": np.zeros(13)}, "initial: pose has shape (13,), expected (14,)"),
        ({"initial": "standing"}, "initial: pose must be 'home', an array or values by name"),
        ({"initial": {"speed": 1}}, "initial: unknown key 'speed', expected pose, height or"),
        ({"initial": {"pose": {"tail": 1}}}, "initial: pose names 'tail', but the model"),
        ({"initial": {"velocity": np.zeros(3)}}, "initial: velocity has shape (3,)"),
        ({"initial": {"height": -1.0}}, "height must be >= 0, not -1.0"),
        ({"initial": {"height": 1.0}, "world": trajopt.World([])}, "height = 1 needs a model with"),
    ],
)
def test_bad_arguments(changes, message):
    with pytest.raises(trajopt.TrajoptError) as caught:
        make(**changes)
    assert isinstance(caught.value, (ValueError, TypeError))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_model_must_be_a_model():
    with pytest.raises(trajopt.ArgumentTypeError, match=r"model must be a Model .*, not str"):
        trajopt.Problem("chain", duration=1.0, dt=0.05)


@pytest.mark.parametrize("term", [ControlEffort, "effort", None, 3.0])
def test_only_terms_are_added(term):
    with pytest.raises(trajopt.ArgumentTypeError, match=r"Problem.add: expected a term"):
        make().add(term)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"normal": -1.0}, "normal must be >= 0, not -1.0"),
        ({"friction": float("nan")}, "friction must be finite, not nan"),
        ({"damping": -0.1}, "damping must be >= 0, not -0.1"),
        ({"normal": 0.0, "friction": 5.0}, "friction = 5 needs a normal stiffness > 0, not 0"),
        ({"model": "sticky"}, "model must be smooth or coulomb, not 'sticky'"),
        ({"slip_velocity": 0.0}, "slip_velocity must be > 0, not 0.0"),
    ],
)
def test_bad_contact(arguments, message):
    with pytest.raises(trajopt.ArgumentError) as caught:
        trajopt.Contact(**arguments)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "arguments", [{"stiffness": 0.0}, {"friction": -1.0}, {"iterations": 0}, {"stiffness": None}]
)
def test_bad_stage(arguments):
    name = next(iter(arguments))
    with pytest.raises(trajopt.TrajoptError, match=f"Stage: {name} must be"):
        Stage(**arguments)


def test_a_list_of_terms_is_told_to_be_unpacked():
    problem = trajopt.Problem(trajopt.load_model("chain"), duration=1.0, dt=0.05)
    with pytest.raises(trajopt.ArgumentTypeError, match=r"add\(\*regularizers"):
        problem.add(trajopt.objectives.regularizers())


def test_a_start_of_another_robot_with_as_many_coordinates_is_refused():
    chain, biped = (trajopt.load_model(name) for name in ("chain", "biped"))
    assert chain.ndof == biped.ndof
    times = np.arange(1, 21) * 0.05
    still = trajopt.Solution(
        biped, trajopt.Status.SOLVED, "at rest", np.tile(biped.home, (20, 1)), times, 0.05
    )
    problem = trajopt.Problem(chain, duration=1.0, dt=0.05).add(ControlEffort())
    first = next(a for a, b in zip(biped.dof_names, chain.dof_names, strict=True) if a != b)
    with pytest.raises(trajopt.ArgumentError, match=f"another robot.*{first!r}"):
        trajopt.solve(problem, warm_start=still)


def test_axes_of_a_term_are_checked_under_the_name_of_its_class():
    with pytest.raises(trajopt.ArgumentError, match=r"PointPosition: axes has shape \(2,\)"):
        trajopt.objectives.PointPosition("trunk", (0, 0, 1), axes=(1, 1))
