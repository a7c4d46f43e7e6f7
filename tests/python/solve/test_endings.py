"""How `solve` ends, and what it keeps when somebody stops it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import trajopt
from solve.chain import CHAIN, make, share, solve, solved


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
