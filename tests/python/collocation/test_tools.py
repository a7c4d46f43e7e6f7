"""Guesses, smoothing, slack variables, derivative checks, diagnosis, files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from collocation.problems import METHODS, block, cart_pole
from trajopt import FileFormatError, Status
from trajopt import collocation as col


def least_work(limit: float = 10.0, objective: Any = None) -> col.Problem:
    """Kelly's block with least work (section 8), without its objective."""
    return block(
        objective=objective,
        u_bounds=(-limit, limit),
        guess={"t": [0, 1], "x": [[0, 1], [1, 1]], "u": [[0], [0]]},
    )


def work(t: Any, x: Any, u: Any) -> Any:
    return u[0] * x[1]


def test_slack_variables_reach_the_reference() -> None:
    problem = col.add_absolute(least_work(), work)
    s = col.solve(problem, method="trapezoidal", segments=50, tolerance=1e-10)
    assert s.objective == pytest.approx(1.2645222, abs=1e-7)
    power, slack = s.u[:, 0] * s.x[:, 1], s.u[:, 1:]
    np.testing.assert_allclose(slack[:, 0] - slack[:, 1], power, atol=1e-8)
    np.testing.assert_allclose(slack.sum(axis=1), np.abs(power), atol=1e-6)


@pytest.mark.parametrize(
    ("width", "expected"), [(0.01, 1.2639045), (1.0, 1.1937882), (5.0, 0.7116780)]
)
def test_smoothing_reaches_the_reference(width: float, expected: float) -> None:
    problem = least_work(objective=lambda t, x, u: col.smooth_abs(u[0] * x[1], width))
    s = col.solve(problem, method="trapezoidal", segments=50, tolerance=1e-10)
    assert s.status is Status.SOLVED
    assert s.objective == pytest.approx(expected, abs=1e-7)


def test_slack_keeps_what_the_problem_had() -> None:
    problem = block(
        objective=lambda t, x, u: u[0] ** 2,
        path=(lambda t, x, u: [x[0], u[0]], [-1, None], [2, 5.5]),
        u_bounds=(-8, 8),
    )
    both = col.solve(col.add_absolute(problem, lambda t, x, u: [u[0]], weight=1e-6), segments=12)
    plain = col.solve(problem, segments=12)
    assert both.objective == pytest.approx(plain.objective, abs=1e-4)
    assert both.u_names == ("u[0]", "slack+", "slack-")


def test_smooth_forms_close_in_on_the_exact_ones() -> None:
    x = np.linspace(-3, 3, 61)
    for kind, side in (("tanh", -1), ("sqrt", 1)):
        gap = col.smooth_abs(x, 0.01, kind) - np.abs(x)
        assert np.all(side * gap >= -1e-15)
        assert np.abs(gap).max() <= 0.01
        np.testing.assert_allclose(col.smooth_max(x, 1.0, 1e-3, kind), np.maximum(x, 1), atol=1e-3)
        np.testing.assert_allclose(col.smooth_min(x, 1.0, 1e-3, kind), np.minimum(x, 1), atol=1e-3)
    with pytest.raises(ValueError, match="width must be > 0"):
        col.smooth_abs(x, 0.0)
    with pytest.raises(ValueError, match="kind"):
        col.smooth_abs(x, 1.0, "cubic")


@pytest.mark.parametrize("slack", [False, True])
@pytest.mark.parametrize("limit", [3.9, 2.0])
def test_too_little_force_is_infeasible_with_the_reason(limit: float, slack: bool) -> None:
    """u_max < 4 cannot move the block in time."""
    problem = least_work(limit, None if slack else lambda t, x, u: col.smooth_abs(work(t, x, u), 1))
    problem = col.add_absolute(problem, work) if slack else problem
    s = col.solve(problem, method="trapezoidal", segments=50)
    assert s.status is Status.INFEASIBLE
    assert "dynamics of x[" in s.message
    assert f"u[0] is at a limit of [{-limit:g}, {limit:g}]" in s.message
    worst = s.violations[0]
    assert worst.name.startswith("dynamics of x[")
    assert 0 <= worst.time <= 1
    assert worst.amount == max(v.amount for v in s.violations) > 1e-5
    assert not s.converged


def test_contradicting_constraints_are_named() -> None:
    problem = block(path=(lambda t, x, u: [x[0] + 0 * u[0]], 2.0, 3.0))
    s = col.solve(problem, segments=6)
    assert s.status is Status.INFEASIBLE
    assert any(v.name.startswith("path[0]") for v in s.violations)
    assert "expected in [2, 3]" in str(next(v for v in s.violations if v.name == "path[0]"))


def test_iteration_limit() -> None:
    s = col.solve(cart_pole(), max_iterations=3)
    assert s.status is Status.MAX_ITERATIONS
    assert s.iterations == 3
    assert "3 iterations" in s.message
    assert [record["iteration"] for record in s.history] == [0, 1, 2, 3]


def test_warm_start_takes_the_multipliers() -> None:
    cold = col.solve(cart_pole())
    warm = col.solve(cart_pole(), warm_start=cold)
    assert warm.iterations <= 3 < cold.iterations
    assert warm.objective == pytest.approx(cold.objective, abs=1e-8)
    # Another mesh has other multipliers: only the trajectory is taken.
    finer = col.solve(cart_pole(), warm_start=cold, segments=40)
    assert finer.iterations < cold.iterations


@pytest.mark.parametrize("solver", ["ipopt", "native"])
def test_multipliers_of_other_constraints_on_times_are_not_taken(solver: str) -> None:
    """Unknown start and duration, the same but for a limit on the end: one constraint more."""
    stated = {"t0_bounds": (0, 0.5), "tf": None, "terminal": lambda t0, tf, x0, xf: tf}
    limited = block(**stated, tf_bounds=(1, 2))
    free = block(**stated, tf_bounds=(-np.inf, np.inf))
    ends = {name: col.solve(p, solver=solver) for name, p in (("free", free), ("limited", limited))}
    assert [np.shape(s.result["multipliers"]["glob"]) for s in ends.values()] == [(0,), (1,)]
    for problem, start, cold in (
        (limited, ends["free"], ends["limited"]),
        (free, ends["limited"], ends["free"]),
    ):
        warm = col.solve(problem, solver=solver, warm_start=start)
        assert warm.status is Status.SOLVED
        assert warm.objective == pytest.approx(cold.objective, abs=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_more_equations_than_unknowns(method: str) -> None:
    problem = col.Problem(
        dynamics=lambda t, x, u: [x[0]],
        nx=1,
        nu=0,
        tf=1.0,
        x0_bounds=(1, 1),
        xf_bounds=(1, 1),
    )
    s = col.solve(problem, method=method, segments=4)
    assert s.status is Status.INFEASIBLE
    assert "equations for" in s.message
    assert "no freedom" in s.message
    assert s.violations


def test_check_derivatives() -> None:
    assert all(check.agrees for check in col.check_derivatives(cart_pole(), samples=4))
    full = block(
        terminal=lambda t0, tf, x0, xf: xf[0] ** 2,
        path=(lambda t, x, u: [np.sin(x[0]), t * u[0]], None, 5),
        boundary=(lambda t0, tf, x0, xf: [x0[0] * xf[1]], 0, 0),
        periodic=[1],
    )
    found = col.check_derivatives(full)
    assert [c.function for c in found] == ["dynamics", "objective", "path", "boundary", "terminal"]
    assert all(check.agrees for check in found)


def test_check_derivatives_finds_a_branch_and_a_kink() -> None:
    def rounded(t: Any, x: Any, u: Any) -> list[Any]:
        # Tracing sees a constant where numbers give another value.
        scale = 1.0 if isinstance(x[0], float) else 1.5
        return [x[1], scale * u[0] + 1.0]

    check = col.check_derivatives(block(dynamics=rounded))[0]
    assert not check.agrees
    assert check.value_error > 1e-3
    assert check.where == "dynamics[1] by u[0]"


def test_keyframes_and_line() -> None:
    guess = col.keyframes([0, 0.5, 1], [[0.0], [0.9], [1.0]], u=[0.0])
    np.testing.assert_allclose(guess["x"][[0, 50, 100], 0], [0, 0.9, 1], atol=1e-12)
    difference = np.gradient(guess["x"][:, 0], guess["t"])
    np.testing.assert_allclose(guess["x"][2:-2, 1], difference[2:-2], atol=2e-2)
    assert col.solve(block(guess=guess), segments=4).objective == pytest.approx(12, abs=1e-8)
    straight = col.line([0, 0], [1, 0], tf=1.0, u=[0])
    assert col.solve(block(guess=straight), segments=4).objective == pytest.approx(12, abs=1e-8)
    with pytest.raises(ValueError, match="one time for every pose"):
        col.keyframes([0, 1], [[0.0], [1.0], [2.0]], u=[0])
    with pytest.raises(ValueError, match="xf has shape"):
        col.line([0, 0], [1], tf=1, u=[0])


def test_continuation() -> None:
    """Smoothing is taken back step by step (Kelly, 8.6)."""
    found = col.continuation(
        lambda width: least_work(objective=lambda t, x, u: col.smooth_abs(u[0] * x[1], width)),
        [5.0, 1.0, 0.1],
        method="trapezoidal",
        segments=50,
    )
    objectives = [s.objective for s in found]
    assert objectives == sorted(objectives)
    assert objectives[-1] < 1.2645222
    stopped = col.continuation(least_work, [10.0, 3.0, 5.0], segments=10)
    assert [s.converged for s in stopped] == [True, False]


def test_file_round_trip(tmp_path: Path) -> None:
    s = col.solve(cart_pole(x_names=["q1", "q2", "dq1", "dq2"]), refine=[8, 12])
    s.save(tmp_path / "swing.npz")
    again = col.Solution.load(tmp_path / "swing.npz")
    t = np.linspace(0, 2, 50)
    np.testing.assert_array_equal(again.state(t), s.state(t))
    np.testing.assert_array_equal(again.control(t), s.control(t))
    np.testing.assert_array_equal(again.error, s.error)
    assert again.status is s.status
    assert again.passes == s.passes
    assert again.history == s.history
    assert again.x_names == ("q1", "q2", "dq1", "dq2")
    assert again.objective == s.objective
    with pytest.raises(ValueError, match="does not hold its problem"):
        again.defect(t)
    # A loaded solution is a guess like any other.
    assert col.solve(cart_pole(), guess=again).converged


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        col.Solution.load(tmp_path / "nothing.npz")
    np.savez(tmp_path / "other.npz", a=1)
    with pytest.raises(FileFormatError, match="not a collocation solution"):
        col.Solution.load(tmp_path / "other.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(FileFormatError, match="not a trajopt result"):
        col.Solution.load(tmp_path / "text.npz")
