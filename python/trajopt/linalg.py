"""Symmetric block tridiagonal systems: definite and quasi-definite, single and in batches.

The matrices of trajectory problems couple each block of unknowns with the next one only.  This
module factors them without pivoting in a number of operations linear in the number of blocks; the
same code runs inside the optimizers.

Examples
--------
>>> import numpy as np
>>> diagonal = np.tile(4.0 * np.eye(2), (3, 1, 1))
>>> lower = np.tile(np.eye(2), (2, 1, 1))
>>> S = SymmetricBlockTridiagonal(diagonal, lower)
>>> x = S.factor().solve(np.ones((3, 2)))
>>> bool(np.allclose(S.matmul(x), 1.0))
True
"""

from __future__ import annotations

from typing import Any, Literal, cast

import numpy as np
import numpy.typing as npt

import trajopt._core as _core
from trajopt.devices import Device, check_threads, choose_device
from trajopt.errors import ArgumentError, ArgumentTypeError, FactorizationError

__all__ = ["Factorization", "Ordering", "Precision", "SymmetricBlockTridiagonal"]

Ordering = Literal["auto", "sequential", "cyclic", "chunked"]
Array = npt.NDArray[np.float64]
Precision = Literal["float64", "float32"]

_PRECISIONS = ("float64", "float32")
_SINGLE_REFINEMENTS = 10  # the loop ends where a step no longer halves the residual
_ORDERINGS = ("auto", "sequential", "cyclic", "chunked")


class SymmetricBlockTridiagonal:
    """A symmetric block tridiagonal matrix, or a batch of them.

    Parameters
    ----------
    diagonal : array_like, shape (..., n, B, B)
        Blocks on the diagonal.  Only their lower triangles are read.
    lower : array_like, shape (..., n - 1, B, B)
        Blocks below the diagonal: ``lower[i]`` is ``A[i + 1, i]``.

    Raises
    ------
    ArgumentError
        If the shapes do not fit each other.

    Examples
    --------
    >>> S = SymmetricBlockTridiagonal([[[2.0]], [[2.0]]], [[[1.0]]])
    >>> S.shape, S.blocks, S.block_size
    ((2, 2), 2, 1)
    >>> S.matmul([[1.0], [0.0]]).ravel()
    array([2., 1.])
    """

    def __init__(self, diagonal: npt.ArrayLike, lower: npt.ArrayLike) -> None:
        d = _real(diagonal, "diagonal")
        c = _real(lower, "lower")
        if d.ndim < 3 or d.shape[-1] != d.shape[-2] or 0 in d.shape[-3:]:
            raise ArgumentError(
                f"diagonal has shape {d.shape}, expected (..., n, B, B) with n and B at least 1"
            )
        expected = d.shape[:-3] + (d.shape[-3] - 1,) + d.shape[-2:]
        if c.shape != expected:
            raise ArgumentError(
                f"lower has shape {c.shape}, expected {expected} to go with diagonal {d.shape}"
            )
        self._batch_shape = d.shape[:-3]
        self._blocks, self._size = int(d.shape[-3]), int(d.shape[-1])
        self._batch = int(np.prod(self._batch_shape, dtype=np.int64))
        block = (self._size, self._size)
        self._core = _core.BlockTridiagonal(
            d.reshape((self._batch, self._blocks, *block)),
            c.reshape((self._batch, self._blocks - 1, *block)),
        )

    @property
    def blocks(self) -> int:
        """Number of diagonal blocks n."""
        return self._blocks

    @property
    def block_size(self) -> int:
        """Rows B of a block."""
        return self._size

    @property
    def batch_shape(self) -> tuple[int, ...]:
        """Leading axes; ``()`` for a single matrix."""
        return self._batch_shape

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape as a (batch of) dense matrices: ``(..., n * B, n * B)``."""
        rows = self._blocks * self._size
        return (*self._batch_shape, rows, rows)

    def matmul(self, v: npt.ArrayLike, threads: int | None = None) -> Array:
        """Product with vectors or with matrices of m columns.

        Parameters
        ----------
        v : array_like, shape (..., n, B) or (..., n, B, m)
        threads : int, optional
            Default: all processors.  The result has the same bits for any number.

        Returns
        -------
        ndarray
            Same shape as `v`.
        """
        x, shape = self._columns(v, "v")
        return cast("Array", self._core.matmul(x, _threads(threads)).reshape(shape))

    def factor(
        self,
        signs: npt.ArrayLike | None = None,
        ordering: Ordering = "auto",
        device: str = "cpu",
        threads: int | None = None,
        *,
        regularization: float = 0.0,
        chunks: int = 2,
        precision: Precision = "float64",
    ) -> Factorization:
        """Factor the matrix without pivoting.

        Parameters
        ----------
        signs : array_like, shape (n, B) or (..., n, B), optional
            +1 and -1: the known signs of the pivots of a quasi-definite matrix, such as +1 for
            variables and -1 for multipliers.  Default: positive definite.
        ordering : {"auto", "sequential", "cyclic", "chunked"}
            Order of elimination.  On the processor ``"auto"`` sweeps from both ends towards the
            middle, and sequentially for short chains and batches; on a GPU it is ``"cyclic"``
            except for large batches.  Equal orderings give equal bits, on any device.
        device : {"cpu", "cuda", "auto"}
            ``"auto"`` is the GPU where there is one.  The factors stay in its memory;
            :meth:`Factorization.solve` copies right-hand sides there and solutions back.
        threads : int, optional
            Of the processor; default: all.  The result has the same bits for any number.  An error
            with ``device="cuda"``; with ``"auto"`` they are for where that is the processor.
        regularization : float
            Added to the diagonal times `signs`; :meth:`Factorization.solve` can refine it away.
        chunks : int
            Number of sweeps of ``ordering="chunked"``.
        precision : {"float64", "float32"}
            Of the factors.  With ``"float32"`` a solution is refined to the accuracy of float64 by
            default, as long as the matrix is not ill-conditioned beyond float32.

        Returns
        -------
        Factorization

        Raises
        ------
        FactorizationError
            If a pivot is not finite, zero to working accuracy or of the wrong sign; it names the
            block and the row inside it.
        DeviceError
            If `device` is ``"cuda"`` and there is no GPU to use, or too little memory on it.

        Examples
        --------
        >>> S = SymmetricBlockTridiagonal([[[1.0]], [[-2.0]]], [[[1.0]]])
        >>> S.factor(signs=[[1], [-1]]).solve([[1.0], [1.0]]).ravel()
        array([1., 0.])
        >>> S.factor()
        Traceback (most recent call last):
            ...
        trajopt.errors.FactorizationError: pivot 0 of block 1 is -2, which has the wrong sign: \
expected a positive one (regularization 0)
        """
        if ordering not in _ORDERINGS:
            raise ArgumentError(f"ordering = {ordering!r}, expected one of {_ORDERINGS}")
        if precision not in _PRECISIONS:
            raise ArgumentError(f"precision is {precision!r}, expected one of {_PRECISIONS}")
        check_threads("factor", device, threads)
        where = choose_device(device)
        _require_integer(chunks, "chunks", 1)
        if not (np.isfinite(regularization) and regularization >= 0.0):
            raise ArgumentError(
                f"regularization is {regularization!r}, expected a finite number >= 0"
            )
        return Factorization(
            self,
            self._signs(signs),
            ordering,
            where,
            _threads(threads),
            float(regularization),
            chunks,
            precision,
        )

    def _signs(self, signs: npt.ArrayLike | None) -> npt.NDArray[np.int8] | None:
        if signs is None:
            return None
        s = _real(signs, "signs")
        one = (self._blocks, self._size)
        if s.shape not in (one, self._batch_shape + one):
            raise ArgumentError(f"signs has shape {s.shape}, expected {one}")
        if not np.all(np.abs(s) == 1.0):
            raise ArgumentError("signs holds values other than +1 and -1")
        full = np.broadcast_to(s, self._batch_shape + one)
        return full.reshape((self._batch, self._blocks * self._size)).astype(np.int8)

    def _columns(self, v: npt.ArrayLike, name: str) -> tuple[Array, tuple[int, ...]]:
        """`v` folded to (batch, rows, m), and its shape."""
        x = _real(v, name)
        one = (*self._batch_shape, self._blocks, self._size)
        if x.shape != one and x.shape[:-1] != one:
            raise ArgumentError(f"{name} has shape {x.shape}, expected {one} or {(*one, 'm')}")
        m = 1 if x.shape == one else x.shape[-1]
        return x.reshape((self._batch, self._blocks * self._size, m)), x.shape


class Factorization:
    """The factors of a :class:`SymmetricBlockTridiagonal`; made by its method ``factor``."""

    def __init__(
        self,
        matrix: SymmetricBlockTridiagonal,
        signs: npt.NDArray[np.int8] | None,
        ordering: Ordering,
        device: Device,
        threads: int,
        regularization: float,
        chunks: int,
        precision: Precision = "float64",
    ) -> None:
        self._matrix = matrix
        self._precision: Precision = precision
        self._threads = threads
        self._device: Device = device
        kind = _core.CudaBlockFactorization if device == "cuda" else _core.BlockFactorization
        self._core = kind(
            matrix.blocks, matrix.block_size, ordering, chunks, matrix._batch, precision
        )
        self._core.factor(matrix._core, signs, regularization, threads)

    @property
    def ordering(self) -> str:
        """The order of elimination that was used; never ``"auto"``."""
        return cast("str", self._core.ordering)

    @property
    def device(self) -> Device:
        """Where the factors are: ``"cpu"`` or ``"cuda"``; never ``"auto"``."""
        return self._device

    @property
    def precision(self) -> str:
        """Scalar type of the factors."""
        return self._precision

    def solve(self, rhs: npt.ArrayLike, *, refinements: int | None = None) -> Array:
        """Solve for one or many right-hand sides.

        Parameters
        ----------
        rhs : array_like, shape (..., n, B) or (..., n, B, m)
        refinements : int, optional
            Steps of iterative refinement, at most, against the matrix without regularization.
            Default: none with float64 factors, ten with float32 ones.

        Returns
        -------
        ndarray
            Same shape as `rhs`; all finite.

        Raises
        ------
        ArgumentError
            If `rhs` has another shape or is not finite.
        FactorizationError
            If the solution overflows.

        Examples
        --------
        >>> S = SymmetricBlockTridiagonal([[[4.0]], [[4.0]]], [[[0.0]]])
        >>> F = S.factor(regularization=0.1)
        >>> bool(np.allclose(F.solve([[8.0], [4.0]], refinements=20), [[2.0], [1.0]], atol=1e-12))
        True
        """
        b, shape = self._matrix._columns(rhs, "rhs")
        if not np.all(np.isfinite(b)):
            raise ArgumentError("rhs holds NaN or infinity")
        if refinements is None:
            refinements = 0 if self._precision == "float64" else _SINGLE_REFINEMENTS
        _require_integer(refinements, "refinements", 0)
        x = self._core.solve(b, self._threads)
        if refinements and x.size:
            x, _, _ = self._core.refine(self._matrix._core, b, x, refinements, 1e-15, self._threads)
        if not np.all(np.isfinite(x)):
            raise FactorizationError("the solution overflows: the matrix is close to singular")
        return cast("Array", x.reshape(shape))


def _real(value: npt.ArrayLike, name: str) -> Array:
    """`value` as contiguous float64, or an error that names it."""
    array: npt.NDArray[Any]
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ArgumentError(f"{name} is not a rectangular array: {error}") from None
    if array.dtype.kind not in "biuf":
        raise ArgumentTypeError(f"{name} has type {array.dtype}, expected real numbers")
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def _threads(threads: int | None) -> int:
    if threads is None:
        return int(_core.hardware_threads())
    _require_integer(threads, "threads", 1)
    return threads


def _require_integer(value: object, name: str, least: int) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
        raise ArgumentError(f"{name} is {value!r}, expected an integer >= {least}")
