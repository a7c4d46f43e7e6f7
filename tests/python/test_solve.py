"""`solve`: how it ends, what it reports, where it starts, and the motions it finds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import trajopt
from trajopt import objectives as terms
from trajopt.objectives import CenterOfMassVelocity, regularizers
from trajopt.solver import Stage

CHAIN = trajopt.load_model("chain")
TARGET = CenterOfMassVelocity((0.3, 0, 0), start=0.2)


def make(**changes):
    problem = trajopt.Problem(CHAIN, **{"duration": 1.0, "dt": 0.05, **changes})
    return problem.add(TARGET, *regularizers())


def solve(problem, **options):
    return trajopt.solve(problem, **{"threads": 1, **options})


@cache
def solved():
    solution = solve(make())
    assert solution.status == "solved", solution.message
    return solution


def share(solution):
    """Largest residual of any frame, as a share of the body weight."""
    return solution.frame_violation.max() / solution.body_weight


# ---- endings ---------------------------------------------------------------------------------


def test_solved():
    solution = solved()
    assert solution.converged
    assert "fell by less than" in solution.message
    assert share(solution) < 1e-9
    assert solution.constraint_violation < 1e-9 * solution.body_weight
    assert solution.body_weight == pytest.approx(9.81 * CHAIN.mass)
    assert solution.objective == pytest.approx(sum(solution.objective_terms.values()))
    assert solution.objective < 0.4  # the task alone costs 1 at rest
    np.testing.assert_allclose(solution.center_of_mass, CHAIN.center_of_mass(solution.x))


def test_physics_by_the_public_residual():
    solution = solve(make(limit=0.0, self_collision=0.0))  # which the public residual leaves out
    frames = np.concatenate([solution.initial[::-1], solution.x])
    force = CHAIN.dynamics_residual(
        frames[2:], frames[1:-1], frames[:-2], 0.05, solution.world, solution.contact
    )
    assert np.abs(force[:, :3]).max() < 1e-9 * solution.body_weight
    np.testing.assert_allclose(solution.u, force[:, CHAIN.actuated], atol=1e-9)
    # Tested along rotation vectors, not in the solver's tangent: equal to the order of the scheme.
    assert np.abs(force[:, 3:6]).max() < 5e-3 * solution.body_weight * CHAIN.length


def test_iteration_limit():
    solution = solve(make(), max_iterations=5)
    assert solution.status == "max_iterations"
    assert "iteration limit" in solution.message
    assert solution.iterations == 5
    assert solution.settings["stage"] == 0


@pytest.mark.parametrize("at", [3, 200])
def test_callback_stops_and_the_best_iterate_is_kept(at):
    solution = solve(make(), callback=lambda record: record.iteration >= at)
    assert solution.status == "interrupted"
    assert solution.iterations == len(solution.history) == at
    assert solution.objective == pytest.approx(solution.history[-1].objective)
    assert np.isfinite(solution.x).all()


def test_keyboard_interrupt_in_the_callback():
    def callback(record):
        if record.iteration == 7:
            raise KeyboardInterrupt

    solution = solve(make(), callback=callback)
    assert (solution.status, solution.iterations) == ("interrupted", 7)


def test_other_errors_in_the_callback_are_the_users():
    def callback(record):
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        solve(make(), callback=callback)


def test_control_c_during_the_run():
    before = signal.getsignal(signal.SIGINT)
    timer = threading.Timer(0.02, os.kill, (os.getpid(), signal.SIGINT))

    def callback(record):
        if record.iteration == 2:
            timer.start()

    solution = solve(
        make(duration=5.0, dt=0.025), callback=callback, max_iterations=20000, tolerance=1e-13
    )
    timer.join()
    assert solution.status == "interrupted"
    assert solution.iterations > 0
    assert signal.getsignal(signal.SIGINT) is before


def test_control_c_on_the_command_line(tmp_path):
    target = tmp_path / "walk.npz"
    arguments = ["solve", "mammal-walk", "--threads", "1", "--out", str(target)]
    arguments += ["--max-iterations", "100000", "--set", "solver.tolerance=1e-15"]
    script = f"import sys; from trajopt.cli import main; sys.exit(main({arguments!r}))"
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", script],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    while "0.0" not in process.stderr.readline():  # wait for the first iteration's line
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert "Traceback" not in err
    assert out.startswith("interrupted: ")
    assert trajopt.Solution.load(target).status == "interrupted"


def test_solve_outside_of_the_main_thread():
    found = []
    thread = threading.Thread(target=lambda: found.append(solve(make(), max_iterations=3)))
    thread.start()
    thread.join()
    assert found[0].status == "max_iterations"


# ---- records ---------------------------------------------------------------------------------


def test_history_is_numbered_through_all_stages():
    solution = solved()
    history = solution.history
    assert [r.iteration for r in history] == list(range(1, len(history) + 1))
    assert solution.iterations == len(history)
    stages = [r.stage for r in history]
    assert stages == sorted(stages)
    assert set(stages) == {0, 1, 2}
    elapsed = [r.elapsed for r in history]
    assert elapsed == sorted(elapsed)
    assert elapsed[-1] <= solution.seconds
    for record in history:
        assert set(record.seconds) == {"dynamics", "assembly", "factorization", "solve"}
        assert all(value >= 0 for value in record.seconds.values())
        assert set(record.objective_terms) == set(solution.objective_terms)
        assert record.snapshot is None


def test_snapshots_are_whole_solutions(tmp_path):
    kept = []

    def callback(record):
        if record.iteration == 10:
            kept.append(record.snapshot())

    solve(make(), callback=callback, max_iterations=12)
    (snapshot,) = kept
    assert (snapshot.status, snapshot.iterations) == ("interrupted", 10)
    assert snapshot.objective == snapshot.history[-1].objective
    snapshot.save(tmp_path / "checkpoint.npz")
    assert trajopt.Solution.load(tmp_path / "checkpoint.npz").iterations == 10


# ---- determinism -----------------------------------------------------------------------------


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_same_bits_every_time_and_for_every_number_of_threads(formulation):
    first, again, two = (
        solve(make(formulation=formulation), threads=threads, max_iterations=60)
        for threads in (1, 1, 2)
    )
    for other in (again, two):
        assert other.x.tobytes() == first.x.tobytes()
        assert other.u.tobytes() == first.u.tobytes()
        assert other.objective == first.objective


def test_seeds_differ():
    one, two = (solve(make(), seed=seed, max_iterations=20) for seed in (0, 1))
    assert not np.array_equal(one.x, two.x)
    assert (one.seed, two.seed) == (0, 1)


@pytest.mark.parametrize("ordering", ["frontal", "sequential", "cyclic", "chunked"])
def test_orderings_agree(ordering):
    solution = solve(make(), ordering=ordering, stages=[Stage()], max_iterations=10)
    other = solve(make(), stages=[Stage()], max_iterations=10)
    assert solution.ordering == ordering
    np.testing.assert_allclose(solution.x, other.x, atol=1e-5)


@pytest.mark.parametrize(
    ("problem", "options", "used"),
    [
        ({}, {}, "frontal"),
        ({"periodic": True}, {}, "chunked"),
        ({"formulation": "spline", "frames_per_knot": 2}, {}, "chunked"),
        ({"formulation": "spline", "frames_per_knot": 10}, {}, "sequential"),  # one block
        ({"frames_per_knot": 2}, {"method": "paper"}, "chunked"),
        ({}, {"ordering": "cyclic"}, "cyclic"),
    ],
)
def test_a_solution_names_the_ordering_that_was_used(problem, options, used, tmp_path):
    seen = []
    found = solve(
        make(**problem),
        max_iterations=2,
        callback=lambda record: seen.append(record.snapshot().ordering),
        **options,
    )
    assert found.ordering == found.summary()["ordering"] == used
    assert seen == [used] * found.iterations
    found.save(tmp_path / "a.npz")
    assert trajopt.Solution.load(tmp_path / "a.npz").ordering == used


def test_frames_that_are_not_periodic_are_eliminated_one_by_one():
    frontal, other = (
        solve(make(), ordering=ordering, stages=[Stage()], max_iterations=10)
        for ordering in ("frontal", "auto")
    )
    assert frontal.x.tobytes() == other.x.tobytes()


@pytest.mark.parametrize(
    ("problem", "options", "found"),
    [
        ({"formulation": "spline"}, {}, "formulation 'spline'"),
        ({"periodic": True}, {}, "periodic=True"),
        ({}, {"method": "paper"}, "method 'paper', formulation 'spline'"),
    ],
)
def test_frontal_is_refused_where_it_does_not_exist(problem, options, found):
    with pytest.raises(trajopt.ArgumentError, match=f"ordering 'frontal' .* not for {found}"):
        solve(make(**problem), ordering="frontal", **options)


# ---- warm starts -----------------------------------------------------------------------------


def test_warm_start_on_the_same_problem_is_there_at_once():
    again = solve(make(), warm_start=solved())
    assert again.status == "solved"
    assert {r.stage for r in again.history} == {2}
    assert again.iterations <= 40
    assert again.objective <= solved().objective * 1.001


def test_warm_start_on_another_grid():
    finer = solve(make(dt=0.025), warm_start=solved())
    assert finer.status == "solved"
    assert finer.frames == 40
    assert finer.history[0].objective < 2 * solved().objective + 0.1
    assert share(finer) < 1e-9


def test_warm_start_on_a_longer_horizon():
    longer = solve(make(duration=1.5), warm_start=solved(), max_iterations=200)
    assert longer.frames == 30
    assert share(longer) < 1e-6


def test_warm_start_with_another_contact():
    law = trajopt.Contact(normal=3 * solved().contact.normal)
    harder = solve(make(contact=law), warm_start=solved(), max_iterations=400)
    assert share(harder) < 1e-9
    assert harder.contact.normal == pytest.approx(law.normal)
    assert harder.objective < 0.5


def test_checkpoint_resumes_at_its_stage(tmp_path):
    solve(
        make(), callback=lambda r: r.stage == 1 and (r.snapshot().save(tmp_path / "c.npz") or True)
    )
    checkpoint = trajopt.Solution.load(tmp_path / "c.npz")
    assert checkpoint.settings["stage"] == 1
    resumed = solve(make(), warm_start=checkpoint)
    assert resumed.history[0].stage == 1
    assert resumed.history[0].objective < 1.2 * checkpoint.objective
    assert {r.stage for r in resumed.history} == {1, 2}


def test_warm_start_from_a_file_that_says_which_ordering_was_asked_for(tmp_path):
    old = replace(solved(), ordering="auto")
    old.save(tmp_path / "old.npz")
    loaded = trajopt.Solution.load(tmp_path / "old.npz")
    assert loaded.ordering == "auto"
    again = solve(make(), warm_start=loaded)
    assert again.ordering == "frontal"
    assert again.x.tobytes() == solve(make(), warm_start=solved()).x.tobytes()


def test_warm_start_of_another_character_is_refused():
    other = trajopt.Problem(trajopt.load_model("mammal"), duration=1.0, dt=0.05).add(TARGET)
    with pytest.raises(trajopt.ArgumentTypeError, match=r"moves 14 degrees of freedom.* has 18"):
        solve(other, warm_start=solved())


# ---- formulations, schemes, laws -------------------------------------------------------------


def test_spline_and_frames_start_from_each_other():
    spline = solve(make(formulation="spline", frames_per_knot=5), max_iterations=300)
    assert spline.constraint_violation < 1e-6 * spline.body_weight
    assert share(spline) > 1e-3  # its physics holds in the spline's test space only
    assert spline.control_points.shape == (4, 2, CHAIN.ndof)
    frames = solve(make(), warm_start=spline)
    assert (frames.status, share(frames) < 1e-9) == ("solved", True)
    back = solve(make(formulation="spline", frames_per_knot=5), warm_start=frames)
    assert back.status == "solved"


def test_control_points_draw_the_motion():
    spline = solve(make(formulation="spline", frames_per_knot=5), max_iterations=30)
    knots = np.concatenate(
        [[np.stack([spline.initial[0], 0 * spline.initial[0]])], spline.control_points]
    )
    s = np.arange(1, 6)[:, None] / 5
    span = 0.25
    for k in range(4):
        (a, va), (b, vb) = knots[k], knots[k + 1]
        curve = (
            (2 * s**3 - 3 * s**2 + 1) * a
            + (s**3 - 2 * s**2 + s) * span * va
            + (3 * s**2 - 2 * s**3) * b
            + (s**3 - s**2) * span * vb
        )
        found = spline.x[5 * k : 5 * k + 5]
        plain = np.r_[0:3, 6:14]  # all but the rotation
        np.testing.assert_allclose(found[:, plain], curve[:, plain], atol=1e-10)


def test_the_penalty_on_the_physics_of_every_frame_works():
    plain = solve(make(formulation="spline", frames_per_knot=5), max_iterations=200)
    problem = make(formulation="spline", frames_per_knot=5).add(terms.PhysicsPenalty(10.0))
    honest = solve(problem, max_iterations=200)
    rms = [np.sqrt(np.mean(s.frame_violation**2)) for s in (plain, honest)]
    assert rms[1] < 0.5 * rms[0]


def test_paper_method():
    problem = make(frames_per_knot=5)
    solution = solve(problem, method="paper", max_iterations=50)
    assert solution.integrator == "implicit"
    assert solution.contact.damping == 0
    assert solution.contact.friction == pytest.approx(solution.contact.normal)
    assert solution.history[-1].objective < 0.8 * solution.history[0].objective
    # It reports what its constraints do not see.
    assert share(solution) > solution.constraint_violation / solution.body_weight / 10
    assert share(solution) == pytest.approx(solution.history[-1].frame_violation, rel=1e-6)
    assert (problem.formulation, problem.integrator) == ("frames", "linear_acceleration")


@pytest.mark.parametrize("integrator", ["implicit", "verlet", "fox_goodwin", "trapezoidal"])
def test_every_time_scheme(integrator):
    solution = solve(make(integrator=integrator), max_iterations=250)
    assert solution.integrator == integrator
    assert share(solution) < 1e-8
    assert solution.objective < 0.4


def test_coulomb_friction():
    law = trajopt.Contact(model="coulomb", mu=0.6)
    solution = solve(make(contact=law), max_iterations=400)
    assert share(solution) < 1e-8
    assert solution.objective < 0.5
    assert solution.contact.model == "coulomb"
    tangent = np.linalg.norm(solution.contact_forces[..., :2], axis=-1)
    assert np.all(tangent <= 0.6 * solution.contact_forces[..., 2] + 1e-9)


def test_uneven_time_steps():
    steps = np.tile([0.03, 0.05, 0.04, 0.08], 5)
    solution = solve(make(dt=steps), max_iterations=400)
    np.testing.assert_array_equal(solution.dt, steps)
    assert share(solution) < 1e-9
    assert solution.objective < 0.4


# ---- turning ---------------------------------------------------------------------------------


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


# ---- models of every kind --------------------------------------------------------------------


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


# ---- arguments -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "magic"}, "method = 'magic', expected one of default, paper"),
        ({"ordering": "random"}, "ordering = 'random', expected one of auto, frontal"),
        ({"device": "tpu"}, "device = 'tpu', expected 'cpu', 'cuda' or 'auto'"),
        ({"threads": 0}, "threads must be a whole number >= 1, not 0"),
        ({"threads": 1.5}, "threads must be a whole number >= 1, not 1.5"),
        ({"max_iterations": 0}, "max_iterations must be a whole number >= 1, not 0"),
        ({"tolerance": 0.0}, "tolerance must be > 0"),
        ({"constraint_tolerance": -1.0}, "constraint_tolerance must be > 0"),
        ({"noise": -1.0}, "noise must be >= 0"),
        ({"seed": -1}, "seed must be a whole number >= 0"),
        ({"refine": 0.0}, "refine must be > 0"),
        ({"refine": -0.1}, "refine must be > 0"),
        ({"max_refinements": -1}, "max_refinements must be a whole number >= 0"),
        ({"refine": 0.1, "method": "paper"}, "refine needs frames"),
        ({"stages": []}, "stages must be a list of Stage"),
        ({"stages": [1.0]}, "stages must be a list of Stage"),
        ({"warm_start": "walk.npz"}, "warm_start must be a Solution, not str"),
        ({"callback": 3}, "callback must be callable"),
    ],
)
def test_bad_options_before_any_work(options, message, monkeypatch):
    monkeypatch.setattr("trajopt.run.Transcription", None)
    with pytest.raises(trajopt.TrajoptError) as caught:
        trajopt.solve(make(frames_per_knot=5), **options)
    assert message in str(caught.value)


def test_problem_must_be_one():
    with pytest.raises(trajopt.ArgumentTypeError, match="problem must be a Problem, not Model"):
        trajopt.solve(CHAIN)


def test_paper_needs_whole_segments():
    with pytest.raises(trajopt.ArgumentError, match="must be a multiple of frames_per_knot = 7"):
        trajopt.solve(make(frames_per_knot=7), method="paper")


@pytest.mark.parametrize("added", [[], [terms.ControlEffort(0.0), terms.Smoothness(0.0)]])
def test_an_objective_is_needed(added):
    problem = trajopt.Problem(CHAIN, duration=1.0, dt=0.05).add(*added)
    with pytest.raises(trajopt.ArgumentError, match="no objective term with a weight > 0"):
        trajopt.solve(problem)
