"""Block tridiagonal systems against dense NumPy, and what happens when there is no answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import trajopt
from trajopt.linalg import SymmetricBlockTridiagonal

ORDERINGS = ("sequential", "cyclic", "chunked")


def random_blocks(blocks, size, signs=None, batch=(), seed=0):
    """Diagonal and lower blocks of a matrix with the given pivot signs."""
    rng = np.random.default_rng(seed)
    diagonal = rng.standard_normal((*batch, blocks, size, size))
    diagonal = diagonal + np.swapaxes(diagonal, -1, -2)
    signs = np.ones((blocks, size)) if signs is None else signs
    index = np.arange(size)
    diagonal[..., index, index] = signs * (4.0 * size + 4.0)
    return diagonal, rng.standard_normal((*batch, blocks - 1, size, size))


def mixed_signs(blocks, size):
    signs = np.ones((blocks, size))
    signs[:, 2::3] = -1.0
    return signs


def dense(diagonal, lower):
    blocks, size = diagonal.shape[0], diagonal.shape[1]
    full = np.zeros((blocks * size, blocks * size))
    for i in range(blocks):
        here = slice(i * size, (i + 1) * size)
        full[here, here] = np.tril(diagonal[i]) + np.tril(diagonal[i], -1).T
        if i + 1 < blocks:
            below = slice((i + 1) * size, (i + 2) * size)
            full[below, here] = lower[i]
            full[here, below] = lower[i].T
    return full


def kkt_blocks(blocks, variables, multipliers, seed=0):
    """[H Jt; J 0] with constraints of a block that reach back to the block before."""
    rng = np.random.default_rng(seed)
    size = variables + multipliers
    diagonal = np.zeros((blocks, size, size))
    lower = np.zeros((blocks - 1, size, size))
    for i in range(blocks):
        root = rng.standard_normal((variables, variables))
        diagonal[i, :variables, :variables] = root @ root.T + np.eye(variables)
        jacobian = rng.standard_normal((multipliers, variables))
        diagonal[i, variables:, :variables] = jacobian
        diagonal[i, :variables, variables:] = jacobian.T
    lower[:, variables:, :variables] = rng.standard_normal((blocks - 1, multipliers, variables))
    signs = np.ones((blocks, size))
    signs[:, variables:] = -1.0
    return diagonal, lower, signs


@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize("quasi_definite", [False, True])
@pytest.mark.parametrize(
    ("blocks", "size"),
    [(1, 1), (1, 5), (2, 1), (2, 7), (3, 3), (5, 8), (7, 4), (20, 12), (33, 5), (6, 48), (3, 82)],
)
def test_against_dense(blocks, size, ordering, quasi_definite):
    signs = mixed_signs(blocks, size) if quasi_definite else None
    diagonal, lower = random_blocks(blocks, size, signs)
    rhs = np.random.default_rng(1).standard_normal((blocks, size))
    factors = SymmetricBlockTridiagonal(diagonal, lower).factor(signs, ordering)
    assert factors.ordering == ordering
    expected = np.linalg.solve(dense(diagonal, lower), rhs.ravel())
    np.testing.assert_allclose(factors.solve(rhs).ravel(), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("ordering", ORDERINGS)
def test_kkt_system(ordering):
    diagonal, lower, signs = kkt_blocks(12, 10, 3)
    matrix = SymmetricBlockTridiagonal(diagonal, lower)
    rhs = np.random.default_rng(2).standard_normal((12, 13))
    expected = np.linalg.solve(dense(diagonal, lower), rhs.ravel()).reshape(rhs.shape)
    x = matrix.factor(signs, ordering, regularization=1e-6).solve(rhs, refinements=10)
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@settings(max_examples=60, deadline=None)
@given(
    blocks=st.integers(1, 12),
    size=st.integers(1, 20),
    columns=st.integers(0, 9),
    ordering=st.sampled_from(("auto", *ORDERINGS)),
    chunks=st.integers(1, 6),
    quasi_definite=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_multiplying_back_gives_the_right_hand_side(
    blocks, size, columns, ordering, chunks, quasi_definite, seed
):
    signs = mixed_signs(blocks, size) if quasi_definite else None
    matrix = SymmetricBlockTridiagonal(*random_blocks(blocks, size, signs, seed=seed))
    shape = (blocks, size, columns) if columns else (blocks, size)
    rhs = np.random.default_rng(seed).standard_normal(shape)
    x = matrix.factor(signs, ordering, chunks=chunks).solve(rhs)
    assert x.shape == rhs.shape
    np.testing.assert_allclose(matrix.matmul(x), rhs, rtol=0, atol=1e-10)


@settings(max_examples=40, deadline=None)
@given(blocks=st.integers(1, 6), size=st.integers(1, 12), seed=st.integers(0, 2**32 - 1))
def test_matmul_is_symmetric_and_linear(blocks, size, seed):
    diagonal, lower = random_blocks(blocks, size, seed=seed)
    matrix = SymmetricBlockTridiagonal(diagonal, lower)
    u, v = np.random.default_rng(seed).standard_normal((2, blocks, size))
    np.testing.assert_allclose(
        np.sum(u * matrix.matmul(v)), np.sum(v * matrix.matmul(u)), atol=1e-8
    )
    np.testing.assert_allclose(
        matrix.matmul(u).ravel(), dense(diagonal, lower) @ u.ravel(), atol=1e-10
    )


@settings(max_examples=40, deadline=None)
@given(
    blocks=st.integers(1, 8),
    size=st.integers(1, 8),
    row=st.integers(0, 63),
    ordering=st.sampled_from(ORDERINGS),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_wrong_sign_never_passes(blocks, size, row, ordering, seed):
    signs = mixed_signs(blocks, size)
    matrix = SymmetricBlockTridiagonal(*random_blocks(blocks, size, signs, seed=seed))
    signs.ravel()[row % signs.size] *= -1.0
    with pytest.raises(trajopt.FactorizationError):
        matrix.factor(signs, ordering)


@pytest.mark.parametrize("ordering", ORDERINGS)
def test_same_bits_for_any_number_of_threads(ordering):
    signs = mixed_signs(40, 31)
    matrix = SymmetricBlockTridiagonal(*random_blocks(40, 31, signs))
    rhs = np.random.default_rng(3).standard_normal((40, 31, 3))
    one = matrix.factor(signs, ordering, threads=1).solve(rhs)
    two = matrix.factor(signs, ordering, threads=2).solve(rhs)
    assert np.array_equal(one, two)
    assert np.array_equal(matrix.matmul(rhs, threads=1), matrix.matmul(rhs, threads=2))


def test_leading_axes():
    signs = mixed_signs(4, 5)
    diagonal, lower = random_blocks(4, 5, signs, batch=(2, 3))
    matrix = SymmetricBlockTridiagonal(diagonal, lower)
    rhs = np.random.default_rng(4).standard_normal((2, 3, 4, 5, 2))
    x = matrix.factor(signs).solve(rhs)
    for item in np.ndindex(2, 3):
        expected = np.linalg.solve(dense(diagonal[item], lower[item]), rhs[item].reshape(20, 2))
        np.testing.assert_allclose(x[item].reshape(20, 2), expected, atol=1e-10)
    assert matrix.batch_shape == (2, 3)
    assert matrix.shape == (2, 3, 20, 20)


def test_empty_batch_and_no_columns():
    empty = SymmetricBlockTridiagonal(np.zeros((0, 4, 3, 3)), np.zeros((0, 3, 3, 3)))
    assert empty.factor().solve(np.zeros((0, 4, 3))).shape == (0, 4, 3)
    one = SymmetricBlockTridiagonal(*random_blocks(4, 3))
    assert one.factor().solve(np.zeros((4, 3, 0))).shape == (4, 3, 0)


@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize(("block", "row"), [(0, 0), (2, 3), (4, 1)])
def test_failure_names_block_and_pivot(ordering, block, row):
    diagonal, lower = random_blocks(5, 4)
    lower[max(block - 1, 0) : block + 1] = 0.0
    diagonal[block] = np.diag([9.0, 9.0, 9.0, 9.0])
    diagonal[block, row, row] = 0.0
    with pytest.raises(trajopt.FactorizationError, match="zero") as caught:
        SymmetricBlockTridiagonal(diagonal, lower).factor(ordering=ordering)
    assert (caught.value.block, caught.value.pivot) == (block, row)


@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_matrix_that_is_not_finite(ordering, bad):
    for where in ("diagonal", "lower"):
        blocks = dict(zip(("diagonal", "lower"), random_blocks(5, 4), strict=True))
        blocks[where][1, 3, 2] = bad
        with pytest.raises(trajopt.FactorizationError, match="finite"):
            SymmetricBlockTridiagonal(**blocks).factor(ordering=ordering)


def test_bad_arguments():
    diagonal, lower = random_blocks(3, 2)
    matrix = SymmetricBlockTridiagonal(diagonal, lower)
    factors = matrix.factor()
    with pytest.raises(trajopt.ArgumentError, match="diagonal has shape"):
        SymmetricBlockTridiagonal(np.zeros((3, 2)), lower)
    with pytest.raises(trajopt.ArgumentError, match="diagonal has shape"):
        SymmetricBlockTridiagonal(np.zeros((0, 2, 2)), lower)
    with pytest.raises(trajopt.ArgumentError, match="lower has shape"):
        SymmetricBlockTridiagonal(diagonal, diagonal)
    with pytest.raises(trajopt.ArgumentTypeError, match="complex"):
        SymmetricBlockTridiagonal(diagonal * 1j, lower)
    with pytest.raises(trajopt.ArgumentError, match="signs has shape"):
        matrix.factor(signs=np.ones(6))
    with pytest.raises(trajopt.ArgumentError, match="other than"):
        matrix.factor(signs=np.zeros((3, 2)))
    with pytest.raises(trajopt.ArgumentError, match="ordering"):
        matrix.factor(ordering="best")
    with pytest.raises(trajopt.ArgumentError, match="chunks"):
        matrix.factor(chunks=0)
    with pytest.raises(trajopt.ArgumentError, match="regularization"):
        matrix.factor(regularization=np.nan)
    with pytest.raises(trajopt.ArgumentError, match="threads"):
        matrix.factor(threads=0)
    with pytest.raises(trajopt.ArgumentError, match="device = 'gpu'"):
        matrix.factor(device="gpu")
    with pytest.raises(trajopt.ArgumentError, match="rhs has shape"):
        factors.solve(np.zeros((2, 3)))
    with pytest.raises(trajopt.ArgumentError, match="NaN"):
        factors.solve(np.full((3, 2), np.nan))
    with pytest.raises(trajopt.ArgumentError, match="v has shape"):
        matrix.matmul(np.zeros(6))


def test_solution_that_overflows():
    matrix = SymmetricBlockTridiagonal(np.full((1, 1, 1), 1e-300), np.zeros((0, 1, 1)))
    with pytest.raises(trajopt.FactorizationError, match="overflow"):
        matrix.factor().solve([[1e300]])


def test_the_input_is_copied():
    diagonal, lower = random_blocks(3, 4)
    matrix = SymmetricBlockTridiagonal(diagonal, lower)
    before = matrix.matmul(np.ones((3, 4)))
    diagonal[:] = 0.0
    assert np.array_equal(matrix.matmul(np.ones((3, 4))), before)
