"""Everything a problem can state, on problems with known optima."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from collocation.problems import METHODS, block
from trajopt import Status
from trajopt import collocation as col


@pytest.mark.parametrize("method", METHODS)
def test_free_end_time(method: str) -> None:
    """Least time over one unit from rest to rest with |u| <= 1: two seconds."""
    problem = block(
        tf=None,
        tf_bounds=(0.1, 10),
        objective=None,
        terminal=lambda t0, tf, x0, xf: tf,
        u_bounds=(-1, 1),
    )
    solution = col.solve(problem, method=method, segments=20)
    assert solution.status is Status.SOLVED
    # A control that is continuous at the knots needs a segment to change its sign.
    assert solution.objective == pytest.approx(2.0, abs=6e-3)
    assert solution.objective >= 2.0 - 1e-6
    assert solution.t[-1] == pytest.approx(solution.objective, abs=1e-9)


def test_brachistochrone() -> None:
    """A bead falls from (0, 0) to (2, -1.2): the time along the cycloid."""
    g, across, down = 9.81, 2.0, 1.2
    angle = brentq(lambda a: (a - np.sin(a)) / (1 - np.cos(a)) - across / down, 0.1, 6.2)
    exact = angle * np.sqrt(down / (1 - np.cos(angle)) / g)
    problem = col.Problem(
        dynamics=lambda t, x, u: [x[2] * np.sin(u[0]), x[2] * np.cos(u[0]), g * np.cos(u[0])],
        nx=3,
        nu=1,
        tf_bounds=(0.1, 5),
        terminal=lambda t0, tf, x0, xf: tf - t0,
        x0_bounds=([0, 0, 0], [0, 0, 0]),
        xf_bounds=([across, down, None], [across, down, None]),
        u_bounds=(0, np.pi),
        guess={"t": [0, 1], "x": [[0, 0, 0], [2, 1.2, 4]], "u": [[0.5], [1.5]]},
    )
    solution = col.solve(problem, method="legendre", points="gauss", segments=10)
    assert solution.status is Status.SOLVED
    assert solution.objective == pytest.approx(exact, abs=1e-6)


def test_free_start_time() -> None:
    """Going backward in time changes nothing: the start is free, the end is fixed."""
    problem = block(
        tf=3.0,
        t0_bounds=(-5, 2.9),
        objective=None,
        terminal=lambda t0, tf, x0, xf: tf - t0,
        u_bounds=(-1, 1),
    )
    solution = col.solve(problem, segments=20)
    assert solution.t[0] == pytest.approx(1.0, abs=2e-3)
    assert solution.t[-1] == 3.0


def test_both_times_free_keep_their_order() -> None:
    problem = block(
        tf=None,
        t0_bounds=(0, 5),
        tf_bounds=(0, 8),
        terminal=lambda t0, tf, x0, xf: 12 * (tf - t0) + (t0 - 3) ** 2,
        guess={"t": [1, 4], "u": [[1], [-1]]},
    )
    # 12 / T³ + 12 T is least at T = √√3; the start goes where it costs nothing.
    solution = col.solve(problem, segments=5)
    assert solution.status is Status.SOLVED
    assert solution.t[0] == pytest.approx(3.0, abs=1e-6)
    assert solution.t[-1] - solution.t[0] == pytest.approx(3**0.25, abs=1e-6)


def test_parameters() -> None:
    problem = col.Problem(
        dynamics=lambda t, x, u, p: [-p[0] * x[0]],
        nx=1,
        nu=0,
        tf=1.0,
        parameters=1,
        parameter_bounds=(0, 5),
        x0_bounds=(1, 1),
        xf_bounds=(np.exp(-2), np.exp(-2)),
        guess={"x": [[1], [0.1]], "p": [1.0]},
    )
    solution = col.solve(problem, method="legendre", segments=4, degree=6)
    assert solution.parameters == pytest.approx([2.0], abs=1e-8)
    np.testing.assert_allclose(solution.state([0.5]), [[np.exp(-1)]], atol=1e-7)


def test_parameters_reach_every_function() -> None:
    problem = col.Problem(
        dynamics=lambda t, x, u, p: [u[0]],
        nx=1,
        nu=1,
        tf=1.0,
        parameters=2,
        objective=lambda t, x, u, p: (u[0] - p[0]) ** 2,
        terminal=lambda t0, tf, x0, xf, p: (p[1] - 3) ** 2,
        path=(lambda t, x, u, p: [x[0] - p[1] * t], 0, 0),
        boundary=(lambda t0, tf, x0, xf, p: [p[0] - 2 * xf[0] / 3], 1, 1),
        x0_bounds=(0, 0),
    )
    solution = col.solve(problem, segments=4)
    assert solution.parameters == pytest.approx([3.0, 3.0], abs=1e-7)


@pytest.mark.parametrize("method", METHODS)
def test_path_constraint(method: str) -> None:
    """Bryson and Denham: x <= 1/9 between x = 0, v = 1 and x = 0, v = -1 costs 4."""
    problem = col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0]],
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: 0.5 * u[0] ** 2,
        path=(lambda t, x, u: [x[0]], None, 1 / 9),
        x0_bounds=([0, 1], [0, 1]),
        xf_bounds=([0, -1], [0, -1]),
    )
    solution = col.solve(problem, method=method, segments=30)
    assert solution.status is Status.SOLVED
    assert solution.objective == pytest.approx(4.0, rel=1e-2)
    assert solution.x[:, 0].max() < 1 / 9 + 1e-6


def test_bounds_hold_at_the_midpoint_of_the_compressed_form() -> None:
    found = [
        col.solve(block(x_bounds=([None, None], [None, 1.3])), method=m, segments=5)
        for m in ("hermite_simpson", "hermite_simpson_compressed")
    ]
    assert found[0].objective == pytest.approx(found[1].objective, abs=1e-6)
    middle = found[1].t[:-1] + 0.5 * np.diff(found[1].t)
    assert found[1].state(middle)[:, 1].max() < 1.3 + 1e-7


def test_periodic() -> None:
    """Follow a sin ωt with effort: x = a/(1+ω²) sin ωt, cost a² ω² / (2 (1+ω²)) per period."""
    a, omega = 2.0, 2 * np.pi
    problem = col.Problem(
        dynamics=lambda t, x, u: [u[0]],
        nx=1,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: (x[0] - a * np.sin(omega * t)) ** 2 + u[0] ** 2,
        periodic=True,
    )
    for method in ("hermite_simpson", "legendre"):
        solution = col.solve(problem, method=method, segments=24)
        assert solution.objective == pytest.approx(a**2 * omega**2 / 2 / (1 + omega**2), abs=1e-4)
        assert solution.x[0, 0] == pytest.approx(solution.x[-1, 0], abs=1e-9)
        assert solution.x[0, 0] == pytest.approx(0.0, abs=1e-3)


def test_boundary_couples_both_ends() -> None:
    """xf = 2 x0 with free ends and x' = u: least (x0 - 1)² + ∫ u²; u = x0, so x0 = 1/2."""
    problem = col.Problem(
        dynamics=lambda t, x, u: [u[0], 0.0],
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: u[0] ** 2,
        terminal=lambda t0, tf, x0, xf: (x0[0] - 1) ** 2,
        boundary=(lambda t0, tf, x0, xf: [xf[0] - 2 * x0[0]], 0, 0),
        xf_bounds=([None, 7], [None, 7]),
    )
    for method in METHODS:
        solution = col.solve(problem, method=method, segments=4)
        assert solution.x[0, 0] == pytest.approx(0.5, abs=1e-7)
        assert solution.x[-1] == pytest.approx([1.0, 7.0], abs=1e-7)
        assert solution.objective == pytest.approx(0.5, abs=1e-7)


def test_control_bounds_at_the_ends() -> None:
    solution = col.solve(block(u0_bounds=(0, 0), uf_bounds=(0, 0)), segments=20)
    assert solution.u[[0, -1], 0] == pytest.approx([0, 0], abs=1e-8)
    assert solution.objective > 12.0


def test_guesses_of_all_kinds_agree() -> None:
    values: dict[str, Any] = {"t": [0, 1], "x": [[0, 0], [1, 0]], "u": [[6], [-6]]}
    first = col.solve(block(guess=values), segments=8)
    for guess in (lambda t: ([t, 1.0], [6 - 12 * t]), first, {"u": [6.0, -6.0]}, None):
        again = col.solve(block(), segments=8, guess=guess)
        np.testing.assert_allclose(again.x, first.x, atol=1e-7)


def test_uneven_mesh() -> None:
    knots = np.array([0, 0.1, 0.15, 0.5, 0.9, 1.0])
    solution = col.solve(block(), segments=knots)
    np.testing.assert_allclose(solution.t, knots)
    assert solution.objective == pytest.approx(12.0, abs=1e-8)


def test_time_may_appear_in_all_functions() -> None:
    """x' = u + t, least ∫ (u - t)²: u = t + c with c = -(1 - 1) / 1 for x(1) = 1."""
    problem = col.Problem(
        dynamics=lambda t, x, u: [u[0] + t],
        nx=1,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: (u[0] - t) ** 2,
        x0_bounds=(0, 0),
        xf_bounds=(2, 2),
    )
    for method in METHODS:
        solution = col.solve(problem, method=method, segments=4)
        assert solution.objective == pytest.approx(1.0, abs=1e-7)
        np.testing.assert_allclose(solution.control([0.3]), [[1.3]], atol=1e-6)
