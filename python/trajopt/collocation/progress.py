"""One line per iteration of a collocation solve, for either solver."""

from __future__ import annotations

import math
import sys
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import whole

__all__ = ["IterationPrinter"]

# Title, width, key of the record, format.
_COLUMNS = (
    ("it", 4, "iteration", "d"),
    ("objective", 14, "objective", ".7e"),
    ("violation", 9, "constraint_violation", ".1e"),
    ("dual", 8, "dual_infeasibility", ".1e"),
    ("μ", 8, "barrier", ".1e"),
    ("step", 8, "step_norm", ".1e"),
    ("α", 8, "step_length", ".1e"),
    ("δ", 8, "regularization", ".1e"),
    ("s", 7, "elapsed", ".2f"),
)


class IterationPrinter:
    """A `callback` of `solve` that writes a table: what the iterations did so far.

    Parameters
    ----------
    stream : file, optional
        Where to write; the standard error stream by default.
    every : int, optional
        Write every k-th iteration.

    Examples
    --------
    >>> show = IterationPrinter(sys.stdout)
    >>> show({"iteration": 0, "objective": 12.0, "barrier": 0.1}, np.zeros(0))
      it      objective violation     dual        μ     step        α        δ       s
       0  1.2000000e+01         -        -  1.0e-01        -        -        -       -
    """

    def __init__(self, stream: TextIO | None = None, every: int = 1) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._every = whole("IterationPrinter", "every", every, 1)

    def __call__(self, record: dict[str, Any], _x: NDArray[np.float64]) -> None:
        """Write a record."""
        if record["iteration"] == 0:
            self._write([title.rjust(width) for title, width, _, _ in _COLUMNS])
        if record["iteration"] % self._every == 0:
            cells = [_cell(record.get(key), spec).rjust(width) for _, width, key, spec in _COLUMNS]
            self._write(cells)

    def _write(self, cells: list[str]) -> None:
        print(" ".join(cells), file=self._stream, flush=True)


def _cell(value: float | None, spec: str) -> str:
    return "-" if value is None or math.isnan(value) else format(value, spec)
