"""Trajectories between the knots: Kelly's formulas, collocation, error estimates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collocation.problems import METHODS, cart_pole, cart_pole_dynamics
from trajopt import ArgumentError
from trajopt import collocation as col


def f(solution: col.Solution, t: Any) -> Any:
    """Dynamics along the trajectory, by plain NumPy."""
    x, u = solution.state(t), solution.control(t)
    return np.stack(cart_pole_dynamics(t, x.T, u.T), axis=1)


def test_hermite_simpson_is_the_corrected_4_13() -> None:
    s = col.solve(cart_pole(), segments=9)
    for k in range(s.segments):
        h = s.t[k + 1] - s.t[k]
        tau = np.linspace(0, h, 7)[:-1, None]
        fk, fm, fn = f(s, np.array([s.t[k], s.t[k] + h / 2, s.t[k + 1]]))
        um = s.control(s.t[k] + h / 2)
        state = (
            s.x[k]
            + fk * tau
            + (-3 * fk + 4 * fm - fn) * tau**2 / (2 * h)
            + (2 * fk - 4 * fm + 2 * fn) * tau**3 / (3 * h**2)
        )
        control = (
            2 / h**2 * (tau - h / 2) * (tau - h) * s.u[k]
            - 4 / h**2 * tau * (tau - h) * um
            + 2 / h**2 * tau * (tau - h / 2) * s.u[k + 1]
        )  # (4.10)
        t = s.t[k] + tau[:, 0]
        np.testing.assert_allclose(s.state(t), state, atol=1e-9)
        np.testing.assert_allclose(s.control(t), control, atol=1e-9)


def test_trapezoidal_is_quadratic_with_linear_controls() -> None:
    s = col.solve(cart_pole(), method="trapezoidal", segments=9)
    slopes = f(s, s.t)
    for k in range(s.segments):
        h = s.t[k + 1] - s.t[k]
        tau = np.linspace(0, h, 5)[:-1, None]
        state = s.x[k] + slopes[k] * tau + tau**2 / (2 * h) * (slopes[k + 1] - slopes[k])
        control = s.u[k] + tau / h * (s.u[k + 1] - s.u[k])
        np.testing.assert_allclose(s.state(s.t[k] + tau[:, 0]), state, atol=1e-9)
        np.testing.assert_allclose(s.control(s.t[k] + tau[:, 0]), control, atol=1e-9)


@pytest.mark.parametrize(
    ("method", "points"),
    [*((method, None) for method in METHODS), ("legendre", "gauss"), ("legendre", "lobatto")],
)
def test_dynamics_hold_at_the_collocation_points(method: str, points: str | None) -> None:
    s = col.solve(cart_pole(), method=method, segments=12, points=points)
    pieces, h = s.interpolant, np.diff(s.interpolant.edges)
    # Shooting meets the dynamics at the ends of its steps, not in the middle of the cubic.
    places = (0.0, 1.0) if method == "multiple_shooting" else pieces.slope_points
    for c in places:
        # A hair inside the piece, because controls may jump at the knots.
        t = pieces.edges[:-1] + np.clip(c, 1e-12, 1 - 1e-12) * h
        np.testing.assert_allclose(s.derivative(t), f(s, t), atol=1e-6)
    np.testing.assert_allclose(s.state(s.t), s.x, atol=1e-7)
    # The state is continuous where segments meet.
    before, after = s.state(s.t[1:-1] - 1e-12), s.state(s.t[1:-1])
    np.testing.assert_allclose(before, after, atol=1e-7)


def test_derivative_is_that_of_the_state() -> None:
    for method in METHODS:
        s = col.solve(cart_pole(), method=method, segments=8)
        t, d = np.random.default_rng(0).uniform(0.01, 1.99, 40), 1e-6
        t = t[np.min(np.abs(t[:, None] - s.interpolant.edges), axis=1) > 2 * d]
        difference = (s.state(t + d) - s.state(t - d)) / (2 * d)
        np.testing.assert_allclose(s.derivative(t), difference, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_error_is_the_integral_of_the_defect(method: str) -> None:
    s = col.solve(cart_pole(), method=method, segments=10)
    for k in (0, 4, 9):
        t = np.linspace(s.t[k], s.t[k + 1], 4001)
        middle = 0.5 * (t[1:] + t[:-1])
        brute = np.sum(np.abs(s.derivative(middle) - f(s, middle)), axis=0) * (t[1] - t[0])
        np.testing.assert_allclose(s.error[k], brute, rtol=1e-2, atol=1e-9)
        np.testing.assert_allclose(
            s.defect(middle), s.derivative(middle) - f(s, middle), atol=1e-10
        )


@pytest.mark.parametrize(
    ("method", "settings", "order"),
    [
        ("trapezoidal", {}, 2),
        ("hermite_simpson", {}, 4),
        ("hermite_simpson_compressed", {}, 4),
        ("legendre", {"degree": 2, "points": "gauss"}, 4),
        ("legendre", {"degree": 2, "points": "radau"}, 3),
        ("legendre", {"degree": 2, "points": "lobatto"}, 4),
    ],
)
def test_objective_converges_with_the_order(
    method: str, settings: dict[str, Any], order: int
) -> None:
    exact = 58.80766745815
    gaps = [
        abs(col.solve(cart_pole(), method=method, segments=n, **settings).objective - exact)
        for n in (80, 160)
    ]
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(order, abs=0.35)


def test_quadrature_along_the_path() -> None:
    s = col.solve(cart_pole(), segments=12)
    t = np.linspace(0, 2, 200001)
    u = s.control(t)[:, 0]
    assert s.objective_along_path() == pytest.approx(
        np.sum(0.5 * (u[1:] ** 2 + u[:-1] ** 2) * np.diff(t)), rel=1e-8
    )


def test_shapes_and_ends() -> None:
    s = col.solve(cart_pole(), segments=5)
    assert s.state(0.3).shape == (4,)
    assert s.state([0.3, 0.4]).shape == (2, 4)
    assert s.control(np.zeros((2, 3))).shape == (2, 3, 1)
    assert s.error.shape == (5, 4)
    with pytest.raises(ArgumentError, match="outside of the trajectory"):
        s.state(2.1)
    with pytest.raises(ArgumentError, match="outside"):
        s.control(float("nan"))
