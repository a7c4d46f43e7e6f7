"""The other libraries: where each is found, how it is called, what to install when it is missing.

A peer is a class with a `name`, the `install` command, and for one matrix a list of timed calls.
Peers that work in place get a fresh copy before every call, outside the clock.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
HERE = Path(__file__).parent


class Missing(Exception):
    """A library is not there; the message says how to get it."""


@dataclass
class Matrix:
    """A positive definite block tridiagonal matrix; `lower[i]` is `A[i + 1, i]`, row-major."""

    diagonal: Array
    lower: Array

    @classmethod
    def random(cls, blocks: int, size: int) -> Matrix:
        rng = np.random.default_rng(1)
        half = rng.standard_normal((blocks, size, size))
        diagonal = (half + half.transpose(0, 2, 1)) / 2
        diagonal[:, np.arange(size), np.arange(size)] = 4.0 * size
        return cls(diagonal, rng.standard_normal((max(blocks - 1, 0), size, size)))

    @property
    def blocks(self) -> int:
        return int(self.diagonal.shape[0])

    @property
    def size(self) -> int:
        return int(self.diagonal.shape[1])

    def sparse(self) -> Any:
        """The lower triangle, in compressed columns with every entry of the blocks."""
        from scipy.sparse import csc_array

        n, b = self.blocks, self.size
        r, c = np.tril_indices(b)
        at = np.arange(n)[:, None] * b
        d_rows, d_columns, d_values = at + r, at + c, self.diagonal[:, r, c]
        r, c = (i.ravel() for i in np.indices((b, b)))
        at = at[: n - 1]
        rows = np.concatenate([d_rows.ravel(), (at + b + r).ravel()])
        columns = np.concatenate([d_columns.ravel(), (at + c).ravel()])
        values = np.concatenate([d_values.ravel(), self.lower.reshape(n - 1, b * b).ravel()])
        matrix = csc_array((values, (rows, columns)), shape=(n * b, n * b))
        matrix.sort_indices()
        return matrix


@dataclass
class Call:
    """What is timed: `prepare` runs before each `run`, outside the clock."""

    run: Callable[[], Any]
    prepare: Callable[[], None] = field(default=lambda: None)


class Native:
    """peers.cpp as a shared library."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        target = Path(self._folder.name) / "peers.so"
        command = [os.environ.get("CXX", "c++"), "-std=c++17", "-O2", "-shared", "-fPIC"]
        subprocess.run([*command, str(HERE / "peers.cpp"), "-o", str(target), "-ldl"], check=True)
        self.library = ctypes.CDLL(str(target))
        for name in ("lapack_open", "blasfeo_open", "cholmod_open_matrix"):
            if hasattr(self.library, name):
                getattr(self.library, name).restype = ctypes.c_void_p


def _pointer(array: npt.NDArray[Any]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _checked(name: str, function: Callable[..., int], *arguments: Any) -> Callable[[], None]:
    """A call that raises when it fails; it keeps its arrays alive."""
    passed = [_pointer(a) if isinstance(a, np.ndarray) else a for a in arguments]

    def run(_kept: tuple[Any, ...] = arguments) -> None:
        info = function(*passed)
        if info != 0:
            raise RuntimeError(f"{name} failed with {info}")

    return run


def _package_file(package: str, pattern: str) -> Path | None:
    spec = find_spec(package)
    if spec is None or spec.origin is None:
        return None
    found = sorted(Path(spec.origin).parent.parent.glob(pattern))
    return found[0] if found else None


class Lapack:
    """Block Thomas through dpotrf, dtrsm and dsyrk, in place; dpbtrf; one right-hand side."""

    def __init__(self, native: Native, name: str, path: Path, prefix: str, shared: bool) -> None:
        self.name = name
        self._library = native.library
        self._lapack = ctypes.c_void_p(
            native.library.lapack_open(str(path).encode(), prefix.encode(), int(shared))
        )
        if not self._lapack:
            raise Missing(f"{name}: {path} lacks LAPACK's symbols")

    def thomas(self, matrix: Matrix) -> Call:
        diagonal, lower = matrix.diagonal.copy(), matrix.lower.copy()

        def refresh() -> None:
            diagonal[:] = matrix.diagonal
            lower[:] = matrix.lower

        function = self._library.lapack_thomas
        arguments = (matrix.blocks, matrix.size, diagonal, lower)
        return Call(_checked(self.name, function, self._lapack, *arguments), refresh)

    def solve(self, matrix: Matrix, out: Array | None = None) -> Call:
        diagonal, lower = matrix.diagonal.copy(), matrix.lower.copy()
        blocks = (matrix.blocks, matrix.size, diagonal, lower)
        _checked(self.name, self._library.lapack_thomas, self._lapack, *blocks)()
        x = np.ones(matrix.blocks * matrix.size) if out is None else out

        def refresh() -> None:
            x[:] = 1.0

        function = self._library.lapack_solve
        return Call(_checked(self.name, function, self._lapack, *blocks, x), refresh)

    def band(self, matrix: Matrix) -> Call:
        rows, width = matrix.blocks * matrix.size, 2 * matrix.size - 1
        original = np.zeros((rows, width + 1))  # column-major band: column j at original[j]
        full = matrix.sparse()
        of_column = np.repeat(np.arange(rows), np.diff(full.indptr))
        original[of_column, full.indices - of_column] = full.data
        band = original.copy()

        def refresh() -> None:
            band[:] = original

        function = self._library.lapack_band
        return Call(_checked(self.name, function, self._lapack, rows, width, band), refresh)


def mkl(native: Native) -> Lapack:
    install = "MKL: pip install mkl"
    path = Path(sys.prefix) / "lib" / "libmkl_rt.so.3"
    if not path.exists():
        raise Missing(install)
    # libmkl_rt looks its parts up in the global scope.
    return Lapack(native, "MKL", path, "", shared=True)


def openblas(native: Native) -> Lapack:
    path = _package_file("scipy", "scipy.libs/libscipy_openblas-*.so")
    if path is None:
        raise Missing("OpenBLAS: pip install scipy (its wheel carries one)")
    return Lapack(native, "OpenBLAS", path, "scipy_", shared=False)


class Blasfeo:
    """Block Thomas in BLASFEO's panel-major storage, packed outside the clock."""

    name = "BLASFEO"

    def __init__(self, native: Native) -> None:
        path = _package_file("acados", "acados/install/lib/libblasfeo.so")
        spec = find_spec("acados")
        if path is None and spec is not None and spec.submodule_search_locations:
            folder = Path(next(iter(spec.submodule_search_locations)))
            path = folder / "install" / "lib" / "libblasfeo.so"
        if path is None or not path.exists():
            raise Missing("BLASFEO (Haswell build): pip install comma-deps-acados")
        self._library = native.library
        self._blasfeo = ctypes.c_void_p(native.library.blasfeo_open(str(path).encode()))
        if not self._blasfeo:
            raise Missing(f"BLASFEO: {path} lacks its symbols")

    def thomas(self, matrix: Matrix) -> Call:
        transposed = np.ascontiguousarray(matrix.lower.transpose(0, 2, 1))
        self._library.blasfeo_set(
            self._blasfeo,
            matrix.blocks,
            matrix.size,
            _pointer(matrix.diagonal),
            _pointer(transposed),
        )
        return Call(_checked(self.name, self._library.blasfeo_thomas, self._blasfeo))

    def last_factor(self, size: int) -> Array:
        factor = np.zeros((size, size))
        self._library.blasfeo_last(self._blasfeo, _pointer(factor))
        return factor.T


class Cholmod:
    """Supernodal factorization after one analysis, in the given order or CHOLMOD's own.

    To be made before MKL is opened: it then keeps the BLAS it was built for, Debian's OpenBLAS,
    which is the faster one here.
    """

    install = "CHOLMOD: apt-get install libsuitesparse-dev"
    _file = "libcholmod.so.3"

    def __init__(self, native: Native) -> None:
        if not hasattr(native.library, "cholmod_open_matrix"):
            raise Missing(self.install)
        self._library = native.library
        try:
            self._opened = ctypes.CDLL(self._file, os.RTLD_NOW | os.RTLD_LOCAL)
        except OSError:
            raise Missing(self.install) from None

    def factor(self, matrix: Matrix, own_ordering: bool) -> Call:
        a = matrix.sparse()
        keep = (a.indptr.astype(np.int32), a.indices.astype(np.int32), a.data)
        handle = ctypes.c_void_p(
            self._library.cholmod_open_matrix(
                self._file.encode(), a.shape[0], *map(_pointer, keep), int(own_ordering)
            )
        )
        if not handle:
            raise Missing(self.install)
        check = _checked("CHOLMOD", self._library.cholmod_refactor, handle)

        def run(_kept: tuple[Any, ...] = keep) -> None:
            check()

        return Call(run)


def qdldl(matrix: Matrix) -> Call:
    if find_spec("qdldl") is None:
        raise Missing("QDLDL: pip install qdldl")
    import qdldl as package
    from scipy.sparse import csc_matrix

    upper = csc_matrix(matrix.sparse().T)
    upper.sort_indices()
    solver = package.Solver(upper, upper=True)
    return Call(lambda: solver.update(upper, upper=True))


def pardiso(matrix: Matrix) -> Call:
    if find_spec("pypardiso") is None:
        raise Missing("Pardiso: pip install pypardiso")
    from pypardiso import PyPardisoSolver
    from scipy.sparse import csr_matrix

    upper = csr_matrix(matrix.sparse().T)
    upper.sort_indices()
    rhs = np.ones(upper.shape[0])
    solver = PyPardisoSolver(mtype=2)
    solver.set_phase(12)
    solver._call_pardiso(upper, rhs)
    solver.set_phase(22)
    return Call(lambda: solver._call_pardiso(upper, rhs))
