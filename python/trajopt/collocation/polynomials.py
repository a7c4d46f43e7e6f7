"""Orthogonal points, barycentric interpolation, differentiation and quadrature (Kelly, app. D)."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre as series
from numpy.typing import NDArray

__all__ = [
    "barycentric_interpolate",
    "barycentric_weights",
    "chebyshev_lobatto",
    "differentiation_matrix",
    "integration_matrix",
    "interpolation_matrix",
    "legendre_gauss",
    "legendre_integrals",
    "legendre_lobatto",
    "legendre_radau",
    "quadrature_weights",
]

FloatArray = NDArray[np.float64]


def chebyshev_lobatto(degree: int) -> FloatArray:
    """Return the degree + 1 Chebyshev points of the second kind (D.2), rising.

    Examples
    --------
    >>> chebyshev_lobatto(2)
    array([-1.,  0.,  1.])
    """
    k = np.arange(degree + 1)
    # The sine form is symmetric to the last bit.
    return np.asarray(np.sin(np.pi * (2 * k - degree) / (2 * degree)), dtype=np.float64)


def legendre_gauss(count: int) -> FloatArray:
    """Return the roots of P_n: `count` points inside (-1, 1)."""
    return np.asarray(series.leggauss(count)[0], dtype=np.float64)


def legendre_radau(count: int) -> FloatArray:
    """Return the roots of P_n + P_{n-1}: -1 and `count` - 1 points inside.

    Examples
    --------
    >>> legendre_radau(2)
    array([-1.        ,  0.33333333])
    """
    coefficients = np.zeros(count + 1)
    coefficients[-2:] = 1.0
    points = _roots(coefficients)
    points[0] = -1.0
    return points


def legendre_lobatto(degree: int) -> FloatArray:
    """Return -1, the roots of the derivative of P_n, and 1: degree + 1 points."""
    last = np.zeros(degree + 1)
    last[-1] = 1.0
    inner = _roots(np.asarray(series.legder(last), dtype=np.float64)) if degree > 1 else np.zeros(0)
    inner = 0.5 * (inner - inner[::-1])  # symmetric to the last bit
    return np.concatenate([[-1.0], inner, [1.0]])


def _roots(coefficients: FloatArray) -> FloatArray:
    """Return the real roots of a Legendre series, rising, polished by Newton's method."""
    points = np.sort(np.real(series.legroots(coefficients)))
    slope = series.legder(coefficients)
    for _ in range(3):
        points = points - series.legval(points, coefficients) / series.legval(points, slope)
    return np.asarray(points, dtype=np.float64)


def barycentric_weights(points: FloatArray) -> FloatArray:
    """Return the weights v of (D.4), scaled so that the largest is 1 in magnitude."""
    difference = points[:, None] - points[None, :]
    np.fill_diagonal(difference, 1.0)
    # Sums of logarithms, because products of hundreds of differences leave the range of floats.
    size = -np.sum(np.log(np.abs(difference)), axis=1)
    sign = np.prod(np.sign(difference), axis=1)
    return np.asarray(sign * np.exp(size - size.max()), dtype=np.float64)


def barycentric_interpolate(points: FloatArray, values: FloatArray, t: FloatArray) -> FloatArray:
    """Return the polynomial through `values` at `points`, evaluated at t by (D.3).

    Parameters
    ----------
    points : (n,) array
    values : (n, ...) array, or (m, n, ...) for another polynomial at every t
    t : (m,) array

    Returns
    -------
    (m, ...) array

    Examples
    --------
    >>> barycentric_interpolate(np.array([-1.0, 0, 1]), np.array([1.0, 0, 1]), np.array([0.5]))
    array([0.25])
    """
    matrix = interpolation_matrix(points, t)
    if values.ndim > 1 and values.shape[:2] == matrix.shape:
        return np.asarray(np.einsum("mn,mn...->m...", matrix, values), dtype=np.float64)
    return np.asarray(np.einsum("mn,n...->m...", matrix, values), dtype=np.float64)


def interpolation_matrix(points: FloatArray, t: FloatArray) -> FloatArray:
    """Return L (m, n) with L_ij the Lagrange polynomial of point j at t_i."""
    away = t[:, None] - points[None, :]
    hit = away == 0.0
    terms = barycentric_weights(points) / np.where(hit, 1.0, away)
    matrix = terms / terms.sum(axis=1, keepdims=True)
    rows = hit.any(axis=1)
    matrix[rows] = hit[rows]
    return np.asarray(matrix, dtype=np.float64)


def differentiation_matrix(points: FloatArray) -> FloatArray:
    """Return D of (D.6): values at the points -> derivative of the polynomial there.

    Examples
    --------
    >>> differentiation_matrix(np.array([-1.0, 1.0]))
    array([[-0.5,  0.5],
           [-0.5,  0.5]])
    """
    v = barycentric_weights(points)
    difference = points[:, None] - points[None, :]
    np.fill_diagonal(difference, 1.0)
    matrix = v[None, :] / v[:, None] / difference
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return np.asarray(matrix, dtype=np.float64)


def legendre_integrals(t: FloatArray, count: int) -> FloatArray:
    """Return ∫ from -1 to t of P_j for j < count: (m, count)."""
    values = series.legvander(t, count)
    integrals = np.empty((len(t), count))
    integrals[:, 0] = t + 1.0
    for j in range(1, count):
        integrals[:, j] = (values[:, j + 1] - values[:, j - 1]) / (2 * j + 1)
    return integrals


def integration_matrix(points: FloatArray) -> FloatArray:
    """Return A: values at the points -> ∫ from -1 to each point of their polynomial."""
    count = len(points)
    integrals = legendre_integrals(points, count)
    return np.asarray(
        np.linalg.solve(series.legvander(points, count - 1).T, integrals.T).T, dtype=np.float64
    )


def quadrature_weights(points: FloatArray) -> FloatArray:
    """Return w of (D.8): the integral over [-1, 1] of the polynomial through the points.

    Examples
    --------
    >>> quadrature_weights(np.array([-1.0, 0.0, 1.0])) * 3
    array([1., 4., 1.])
    """
    count = len(points)
    integrals = np.zeros(count)
    integrals[0] = 2.0
    return np.asarray(
        np.linalg.solve(series.legvander(points, count - 1).T, integrals), dtype=np.float64
    )
