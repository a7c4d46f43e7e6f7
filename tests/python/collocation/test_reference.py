"""Objectives against the numbers of an independent solve (tolerance 1e-10)."""

from __future__ import annotations

import numpy as np
import pytest

from collocation.problems import METHODS, block, cart_pole
from trajopt import Status
from trajopt import collocation as col


@pytest.mark.parametrize("segments", [1, 2, 7, 25])
def test_block_is_exact_under_hermite_simpson(segments: int) -> None:
    solution = col.solve(block(), segments=segments)
    assert solution.status is Status.SOLVED
    assert solution.objective == pytest.approx(12.0, abs=1e-9)
    t = np.linspace(0.0, 1.0, 33)
    np.testing.assert_allclose(solution.control(t)[:, 0], 6 - 12 * t, atol=1e-8)
    np.testing.assert_allclose(solution.state(t)[:, 0], 3 * t**2 - 2 * t**3, atol=1e-9)
    np.testing.assert_allclose(solution.error, 0.0, atol=1e-12)


def test_block_under_trapezoidal() -> None:
    solution = col.solve(block(), method="trapezoidal", segments=25, tolerance=1e-10)
    assert solution.objective == pytest.approx(12.07496136, abs=1e-8)


@pytest.mark.parametrize(
    ("method", "expected"), [("hermite_simpson", 58.80542546846), ("trapezoidal", 60.03551947)]
)
def test_cart_pole(method: str, expected: float) -> None:
    solution = col.solve(cart_pole(), method=method, segments=25, tolerance=1e-10)
    assert solution.status is Status.SOLVED
    assert solution.objective == pytest.approx(expected, abs=1e-8)


@pytest.mark.slow
def test_cart_pole_on_1600_segments() -> None:
    solution = col.solve(cart_pole(), segments=1600, tolerance=1e-10)
    assert solution.objective == pytest.approx(58.80766745815, abs=1e-8)


def test_compressed_and_separated_agree() -> None:
    found = [
        col.solve(cart_pole(), method=m, segments=10, tolerance=1e-10)
        for m in ("hermite_simpson", "hermite_simpson_compressed")
    ]
    assert found[0].objective == pytest.approx(found[1].objective, abs=1e-9)
    np.testing.assert_allclose(found[0].x, found[1].x, atol=1e-7)


@pytest.mark.parametrize(
    ("method", "options"),
    [
        ("hermite_simpson", {"segments": 60}),
        ("multiple_shooting", {"segments": 150, "substeps": 2}),
        ("chebyshev", {"segments": 15, "degree": 6}),
        ("chebyshev", {"segments": 1, "degree": 66}),
        ("legendre", {"segments": 15, "degree": 6, "points": "gauss"}),
        ("legendre", {"segments": 15, "degree": 6, "points": "radau"}),
        ("legendre", {"segments": 15, "degree": 6, "points": "lobatto"}),
        ("legendre", {"segments": 1, "degree": 66, "points": "radau"}),
    ],
)
def test_every_method_finds_the_same_swing_up(method: str, options: dict[str, object]) -> None:
    solution = col.solve(cart_pole(), method=method, **options)  # type: ignore[arg-type]
    assert solution.status is Status.SOLVED
    # Shooting keeps the control linear between knots, a smaller set of motions.
    loss = 1e-3 if method == "multiple_shooting" else 1e-4
    assert solution.objective == pytest.approx(58.80766746, abs=loss)


@pytest.mark.parametrize("method", METHODS)
def test_scaling_does_not_move_the_solution(method: str) -> None:
    plain = col.solve(cart_pole(), method=method, segments=8, tolerance=1e-10)
    scaled = col.solve(cart_pole(), method=method, segments=8, scaling="auto", tolerance=1e-10)
    assert scaled.objective == pytest.approx(plain.objective, abs=1e-7)
