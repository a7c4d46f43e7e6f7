"""What else the tutorial speaks of: costates, conditions at the ends, tables, other optima."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from collocation.problems import block, cart_pole
from collocation.test_hp import cubic, cubic_by_shooting
from trajopt import ArgumentError, Status
from trajopt import collocation as col


@pytest.mark.parametrize(
    ("method", "order"),
    [
        ("trapezoidal", 2),
        ("hermite_simpson", 4),
        ("hermite_simpson_compressed", 4),
        ("multiple_shooting", 3),
    ],
)
def test_costates_close_in_on_those_of_the_maximum_principle(method: str, order: int) -> None:
    _, exact = cubic_by_shooting()
    off = []
    for segments in (10, 20):
        s = col.solve(cubic(), method=method, segments=segments, tolerance=1e-11, solver="native")
        off.append(np.abs(s.costates()[:, 0] - exact(s.t)[1]).max())
    assert off[0] / off[1] > 0.8 * 2**order


@pytest.mark.parametrize("points", ["gauss", "radau", "lobatto"])
def test_costates_of_orthogonal_methods(points: str) -> None:
    _, exact = cubic_by_shooting()
    s = col.solve(
        cubic(), method="legendre", points=points, segments=4, degree=[7, 6, 5, 5], tolerance=1e-11
    )
    np.testing.assert_allclose(s.costates()[:, 0], exact(s.t)[1], atol=1e-6)
    np.testing.assert_allclose(s.control(s.t)[:, 0], -s.costates()[:, 0], atol=1e-3)


def test_costates_of_the_block() -> None:
    """H = u² + λ₁ v + λ₂ u: λ₁ is constant, λ₂ = -2 u = -12 + 24 t."""
    s = col.solve(block(), segments=[0, 0.2, 0.5, 0.6, 1.0])
    np.testing.assert_allclose(s.costates()[:, 0], -24.0, atol=1e-6)
    np.testing.assert_allclose(s.costates()[:, 1], -12 + 24 * s.t, atol=1e-6)


def test_costates_of_phases_join(tmp_path: Path) -> None:
    first, second = cubic(tf=0.7), cubic(t0=0.7, x0_bounds=None)
    found = col.solve(col.MultiPhase([first, second]), segments=[12, 20])
    _, exact = cubic_by_shooting()
    for phase in found.phases:
        np.testing.assert_allclose(phase.costates()[:, 0], exact(phase.t)[1], atol=1e-5)
    found.phases[0].save(tmp_path / "phase.npz")
    with pytest.raises(ArgumentError, match="does not hold the multipliers"):
        col.Solution.load(tmp_path / "phase.npz").costates()


@pytest.mark.parametrize("method", ["trapezoidal", "hermite_simpson", "chebyshev"])
@pytest.mark.parametrize("solver", ["ipopt", "native"])
def test_conditions_on_the_control_at_the_ends(method: str, solver: str) -> None:
    problem = cubic(
        at_start=(lambda t, x, u: [u[0] + x[0], t + u[0]], [0.7, None], [0.7, 0.0]),
        at_end=(lambda t, x, u: [2 * u[0] + t], 1.6, 1.6),
    )
    s = col.solve(problem, method=method, segments=8, solver=solver)
    assert s.status is Status.SOLVED
    np.testing.assert_allclose(s.u[[0, -1], 0], [-0.3, -0.2], atol=1e-8)
    assert s.objective > col.solve(cubic(), method=method, segments=8).objective
    assert all(check.agrees for check in col.check_derivatives(problem))


def test_conditions_at_the_ends_need_a_point_there() -> None:
    given = (lambda t, x, u: [u[0]], 0.0, 0.0)
    for points, name in (("gauss", "at_start"), ("radau", "at_end"), ("gauss", "at_end")):
        with pytest.raises(ArgumentError, match=f"{name} needs a method with a control"):
            col.solve(cubic(**{name: given}), method="legendre", points=points, segments=3)
    s = col.solve(cubic(at_start=given), method="legendre", points="radau", segments=3)
    assert s.u[0, 0] == pytest.approx(0.0, abs=1e-8)
    phases = col.MultiPhase([cubic(tf=1.0, at_end=given), cubic(t0=1.0, x0_bounds=None)])
    found = col.solve(phases, segments=[3, 5])
    assert found.phases[0].u[-1, 0] == pytest.approx(0.0, abs=1e-8)


def test_slack_variables_keep_the_conditions_at_the_ends() -> None:
    problem = col.add_absolute(
        cubic(at_end=(lambda t, x, u: [u[0]], 0.1, 0.1)), lambda t, x, u: u[0], weight=0.1
    )
    assert col.solve(problem, segments=8).u[-1, 0] == pytest.approx(0.1, abs=1e-8)


def test_a_table_is_the_natural_spline() -> None:
    x = np.array([0.0, 0.7, 1.0, 2.2, 3.0])
    y = np.array([1.0, -0.5, 0.3, 2.0, 1.8])
    look_up, spline = col.table(x, y), CubicSpline(x, y, bc_type="natural")
    places = np.linspace(0, 3, 61)
    np.testing.assert_allclose(look_up(places), spline(places), atol=1e-13)
    beyond = look_up(np.array([-2.0, -1.0, 3.0, 4.0, 5.0]))
    assert beyond[1] - beyond[0] == pytest.approx(spline(0.0, 1), abs=1e-12)
    assert beyond[4] - beyond[3] == pytest.approx(beyond[3] - beyond[2], abs=1e-12)
    with pytest.raises(ArgumentError, match=r"x must rise, but x\[0\] = 0 and x\[1\] = 0"):
        col.table([0, 0, 1], [0, 1, 2])


@pytest.mark.parametrize("solver", ["ipopt", "native"])
def test_a_table_in_the_dynamics(solver: str) -> None:
    """The drag x³ as a table of 25 values gives nearly the cost of the formula."""
    x = np.linspace(-0.5, 1.5, 25)
    drag = col.table(x, x**3)
    problem = cubic(dynamics=lambda t, x, u: [u[0] - drag(x[0])])
    s = col.solve(problem, segments=20, solver=solver)
    assert s.status is Status.SOLVED
    assert s.objective == pytest.approx(cubic_by_shooting()[0], abs=1e-4)
    assert all(check.agrees for check in col.check_derivatives(problem))


def test_a_lookup_with_corners_says_what_to_write() -> None:
    with pytest.raises(ArgumentError, match=r"np.interp cannot be traced.*collocation.table"):
        cubic(dynamics=lambda t, x, u: [u[0] - np.interp(x[0], [0, 1], [0, 1])])


def test_guesses_strewn_about_find_the_other_optimum() -> None:
    problem = cart_pole()
    guesses = col.scatter(problem, 8)
    for guess in guesses:
        assert np.abs(guess["x"][:, 0]).max() <= 2.0
        np.testing.assert_allclose(guess["x"][[0, -1]], [[0] * 4, [1, np.pi, 0, 0]], atol=1e-12)
    again = col.scatter(problem, 8)[3]
    np.testing.assert_array_equal(again["x"], guesses[3]["x"])
    found = [col.solve(problem, guess=guess, solver="native") for guess in guesses]
    best = min(s.objective for s in found if s.converged)
    assert best == pytest.approx(57.93871, abs=1e-4)


def test_an_integral_is_bounded_by_a_state() -> None:
    """∫ u² <= 14 over the block's move, for the least ∫ x² (Kelly, 4.1: integral expressions)."""

    def limited(most: float) -> col.Problem:
        stated: dict[str, Any] = {
            "dynamics": lambda t, x, u: [x[1], u[0], u[0] ** 2],
            "nx": 3,
            "objective": lambda t, x, u: x[0] ** 2,
            "x0_bounds": (0, 0),
            "xf_bounds": ([1, 0, 0], [1, 0, most]),
        }
        return block(**stated)

    costs = []
    for most in (12.5, 14.0):
        s = col.solve(limited(most), segments=20)
        assert s.status is Status.SOLVED
        assert s.x[-1, 2] == pytest.approx(most, abs=1e-5)
        costs.append(s.objective)
    assert costs[1] < costs[0]
