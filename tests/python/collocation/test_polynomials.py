"""Points, weights and matrices against the properties that define them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre

from trajopt.collocation import polynomials as poly

FAMILIES = {
    "chebyshev": lambda n: poly.chebyshev_lobatto(n),
    "gauss": lambda n: poly.legendre_gauss(n + 1),
    "radau": lambda n: poly.legendre_radau(n + 1),
    "lobatto": lambda n: poly.legendre_lobatto(n),
}


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("degree", [1, 2, 3, 6, 11])
def test_polynomials_of_the_degree_are_exact(family: str, degree: int) -> None:
    points = FAMILIES[family](degree)
    assert len(points) == degree + 1
    assert np.all(np.diff(points) > 0)
    curve = Polynomial(np.random.default_rng(degree).normal(size=degree + 1))
    values, t = curve(points), np.linspace(-1, 1, 17)
    np.testing.assert_allclose(
        poly.barycentric_interpolate(points, values, t), curve(t), atol=1e-12
    )
    np.testing.assert_allclose(
        poly.differentiation_matrix(points) @ values, curve.deriv()(points), atol=1e-10
    )
    integral = curve.integ(lbnd=-1)
    np.testing.assert_allclose(
        poly.integration_matrix(points) @ values, integral(points), atol=1e-12
    )
    assert poly.quadrature_weights(points) @ values == pytest.approx(integral(1.0), abs=1e-12)


@pytest.mark.parametrize(
    ("family", "exact"), [("gauss", lambda m: 2 * m - 1), ("radau", lambda m: 2 * m - 2),
                          ("lobatto", lambda m: 2 * m - 3)],
)  # fmt: skip
@pytest.mark.parametrize("count", [2, 3, 5, 9])
def test_quadrature_is_exact_beyond_the_degree(family: str, exact: object, count: int) -> None:
    degree = exact(count)  # type: ignore[operator]
    points = FAMILIES[family](count - 1)
    weights = poly.quadrature_weights(points)
    for power, holds in ((degree, True), (degree + 1, False)):
        curve = Legendre.basis(power)
        error = abs(weights @ curve(points) - (2.0 if power == 0 else 0.0))
        assert (error < 1e-13) == holds


def test_roots_of_the_definitions() -> None:
    n = 7
    radau = poly.legendre_radau(n)
    np.testing.assert_allclose((Legendre.basis(n) + Legendre.basis(n - 1))(radau), 0, atol=1e-14)
    lobatto = poly.legendre_lobatto(n)
    np.testing.assert_allclose(Legendre.basis(n).deriv()(lobatto[1:-1]), 0, atol=1e-12)
    np.testing.assert_allclose(poly.chebyshev_lobatto(n), -np.cos(np.pi * np.arange(n + 1) / n),
                               atol=1e-15)  # fmt: skip


def test_weights_of_d9_and_d10() -> None:
    """Kelly's (D.9), (D.10): quadrature weights from the barycentric ones."""
    points = poly.legendre_gauss(6)
    w = poly.barycentric_weights(points) ** 2 / (1 - points**2)
    np.testing.assert_allclose(2 * w / w.sum(), poly.quadrature_weights(points), rtol=1e-12)
    points = poly.legendre_lobatto(6)
    w = poly.barycentric_weights(points) ** 2
    np.testing.assert_allclose(2 * w / w.sum(), poly.quadrature_weights(points), rtol=1e-12)


def test_many_points_stay_finite() -> None:
    points = poly.chebyshev_lobatto(600)
    values = np.exp(points)
    t = np.linspace(-1, 1, 41)
    np.testing.assert_allclose(
        poly.barycentric_interpolate(points, values, t), np.exp(t), rtol=1e-12
    )


def test_a_point_itself_gives_its_value() -> None:
    points = poly.legendre_lobatto(5)
    values = np.random.default_rng(0).normal(size=(6, 2))
    np.testing.assert_array_equal(poly.barycentric_interpolate(points, values, points), values)
