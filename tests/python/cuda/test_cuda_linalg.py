"""Block tridiagonal systems on the GPU: the bits of the processor, and its errors."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt import _core
from trajopt.linalg import SymmetricBlockTridiagonal

ORDERINGS = ("sequential", "cyclic", "chunked")
PRECISIONS = ("float64", "float32")


def random_matrix(blocks, size, batch=(), seed=0):
    rng = np.random.default_rng(seed)
    signs = np.ones((blocks, size))
    signs[:, 2::3] = -1.0
    diagonal = rng.standard_normal((*batch, blocks, size, size))
    index = np.arange(size)
    diagonal[..., index, index] = signs * (4.0 * size + 4.0)
    lower = rng.standard_normal((*batch, blocks - 1, size, size))
    return SymmetricBlockTridiagonal(diagonal, lower), signs


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize(
    ("blocks", "size", "batch"),
    [
        (1, 1, ()),
        (1, 7, ()),
        (2, 3, ()),
        (5, 8, ()),
        (6, 9, (3,)),
        (33, 24, ()),
        (20, 36, (2, 2)),
        (12, 72, ()),
        (5, 96, (2,)),
        (3, 130, ()),
        (3, 256, ()),
        (400, 40, ()),
        (40, 14, (300,)),
        (4, 5, (0,)),
    ],
)
def test_same_bits_as_the_processor(blocks, size, batch, ordering, precision):
    matrix, signs = random_matrix(blocks, size, batch)
    kwargs = {
        "signs": signs,
        "ordering": ordering,
        "regularization": 1e-3,
        "chunks": 3,
        "precision": precision,
    }
    cpu = matrix.factor(device="cpu", **kwargs)
    gpu = matrix.factor(device="cuda", **kwargs)
    assert (gpu.device, gpu.precision) == ("cuda", precision)
    assert gpu.ordering == cpu.ordering
    rng = np.random.default_rng(1)
    for shape in ((), (1,), (5,), (19,)):
        rhs = rng.standard_normal((*batch, blocks, size, *shape))
        for refinements in (None, 0, 1, 10):
            expected = cpu.solve(rhs, refinements=refinements)
            actual = gpu.solve(rhs, refinements=refinements)
            assert actual.tobytes() == expected.tobytes(), (shape, refinements)


@pytest.mark.parametrize("precision", PRECISIONS)
def test_every_size_of_block(precision):
    for size in range(1, 129):
        matrix, signs = random_matrix(4, size)
        rhs = np.random.default_rng(size).standard_normal((4, size, 3))
        kwargs = {"signs": signs, "ordering": "cyclic", "precision": precision}
        expected = matrix.factor(**kwargs).solve(rhs)
        actual = matrix.factor(device="cuda", **kwargs).solve(rhs)
        assert actual.tobytes() == expected.tobytes(), size


def test_float32_refines_to_float64():
    matrix, signs = random_matrix(9, 14)
    rhs = np.random.default_rng(3).standard_normal((9, 14, 2))
    expected = matrix.factor(signs, device="cuda").solve(rhs)
    single = matrix.factor(signs, device="cuda", precision="float32")
    assert np.max(np.abs(single.solve(rhs, refinements=0) - expected)) > 1e-12
    np.testing.assert_allclose(single.solve(rhs), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, -0.0, -1e3, -1e39])
def test_same_failure_as_the_processor(ordering, value, precision):
    for block in range(9):
        diagonal = np.tile(8.0 * np.eye(4), (9, 1, 1))
        lower = np.random.default_rng(block).standard_normal((8, 4, 4)) * 0.3
        diagonal[block, 2, 2] = value
        matrix = SymmetricBlockTridiagonal(diagonal, lower)
        with pytest.raises(trajopt.FactorizationError) as on_cpu:
            matrix.factor(ordering=ordering, precision=precision)
        with pytest.raises(trajopt.FactorizationError) as on_gpu:
            matrix.factor(ordering=ordering, device="cuda", precision=precision)
        assert str(on_gpu.value) == str(on_cpu.value)
        assert on_gpu.value.block == on_cpu.value.block
        assert on_gpu.value.pivot == on_cpu.value.pivot


def test_failure_names_the_first_problem_of_a_batch():
    diagonal = np.tile(8.0 * np.eye(4), (50, 3, 1, 1))
    diagonal[40, 0, 1, 1] = -1.0
    diagonal[17, 2, 3, 3] = np.nan
    matrix = SymmetricBlockTridiagonal(diagonal, np.zeros((50, 2, 4, 4)))
    for precision in PRECISIONS:
        with pytest.raises(trajopt.FactorizationError, match="pivot 3 of block 2 of problem 17"):
            matrix.factor(device="cuda", precision=precision)


def test_values_that_float32_cannot_represent():
    diagonal = np.tile(8.0 * np.eye(4), (5, 1, 1))
    diagonal[3, 1, 1] = 1e39
    matrix = SymmetricBlockTridiagonal(diagonal, np.zeros((4, 4, 4)))
    matrix.factor(device="cuda")
    with pytest.raises(trajopt.FactorizationError, match="pivot 1 of block 3 is inf, which is not"):
        matrix.factor(device="cuda", precision="float32")


def test_too_large_for_the_memory():

    with pytest.raises(trajopt.DeviceError, match=r"cudaMalloc .* asked for \d+ bytes, \d+ of"):
        _core.CudaBlockFactorization(10_000, 200, "cyclic", 2, 10_000)
    with pytest.raises(trajopt.DeviceError, match="bytes of shared memory"):
        _core.CudaBlockFactorization(1, 100_000, "cyclic", 2, 1)
    matrix, signs = random_matrix(3, 8)  # and the device is still usable
    expected = matrix.factor(signs, ordering="cyclic").solve(np.ones((3, 8)))
    actual = matrix.factor(signs, ordering="cyclic", device="cuda").solve(np.ones((3, 8)))
    assert actual.tobytes() == expected.tobytes()
