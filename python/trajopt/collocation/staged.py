"""The nonlinear program of a transcription: stages along a mesh, and a few global unknowns.

Node k of the mesh carries unknowns ``w_k``; a stage couples two neighbours, and globals ``p``
(free times, parameters, copies of initial states) touch everything. So the KKT matrix is
block-tridiagonal with a border, whatever the transcription.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.tracing import casadi

__all__ = ["Names", "StagedNLP", "Values", "constraint_violation"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Names:
    """What rows and columns are called in messages, and the times of the nodes.

    Parameters
    ----------
    w, p : tuple of str
        Unknowns of a node, and globals.
    stage, last, glob : tuple of str
        Rows of the constraints.
    times : (n,) array
        Time of every node in the guess [s].
    """

    w: tuple[str, ...]
    p: tuple[str, ...]
    stage: tuple[str, ...]
    last: tuple[str, ...]
    glob: tuple[str, ...]
    times: FloatArray


@dataclass(frozen=True)
class Values:
    """Cost and constraint values at a point: stage (n-1, nc), last and glob."""

    cost: float
    stage: FloatArray
    last: FloatArray
    glob: FloatArray


@dataclass(frozen=True)
class StagedNLP:
    """Minimize Σ cost_k + cost_last + cost_glob within bounds; nodes k = 0..n-1, globals p.

    Equal bounds make an equality, infinite ones none; a variable with equal bounds is fixed (so
    are the midpoint unknowns of the last node, which no segment uses). A constraint row that is
    unbounded at a node is no constraint there.

    Parameters
    ----------
    stage : casadi.Function
        ``(w, w_next, p, s) -> (cost, c)`` for k = 0..n-2; s holds the data of the stage.
    last : casadi.Function
        ``(w, p, s) -> (cost, c)`` for the last node.
    glob : casadi.Function
        ``(p,) -> (cost, c)``.
    n : int
        Number of nodes.
    w_lower, w_upper, w_guess : (n, nw) arrays
    p_lower, p_upper, p_guess : (np,) arrays
    s : (n, ns) array
        Data of the stages, such as time and duration.
    c_lower, c_upper : (n-1, nc) arrays
        Bounds of the stage constraints.
    last_lower, last_upper, glob_lower, glob_upper : arrays
    w_scale, p_scale, c_scale : arrays
        Powers of two by which a solver divides; the numbers here are never scaled.
    names : Names
        For messages.
    """

    stage: Any
    last: Any
    glob: Any
    n: int
    w_lower: FloatArray
    w_upper: FloatArray
    w_guess: FloatArray
    p_lower: FloatArray
    p_upper: FloatArray
    p_guess: FloatArray
    s: FloatArray
    c_lower: FloatArray
    c_upper: FloatArray
    last_lower: FloatArray
    last_upper: FloatArray
    glob_lower: FloatArray
    glob_upper: FloatArray
    w_scale: FloatArray
    p_scale: FloatArray
    c_scale: FloatArray
    names: Names

    @property
    def nw(self) -> int:
        """Unknowns per node."""
        return int(self.w_guess.shape[1])

    @property
    def np(self) -> int:
        """Number of globals."""
        return len(self.p_guess)

    @property
    def nc(self) -> int:
        """Rows of the stage constraints."""
        return int(self.c_lower.shape[1])

    def evaluate(self, w: FloatArray, p: FloatArray) -> Values:
        """Return cost and constraints at w (n, nw), p (np,)."""
        stages = self.n - 1
        columns = [np.tile(p[:, None], (1, stages)), self.s[:-1].T]
        cost, c = self.stage.map(stages)(w[:-1].T, w[1:].T, *columns)
        last_cost, last = self.last(w[-1], p, self.s[-1])
        glob_cost, glob = self.glob(p)
        total = float(casadi.sum2(cost)) + float(last_cost) + float(glob_cost)
        return Values(total, _dense(c).T.reshape(stages, self.nc), _flat(last), _flat(glob))


def _dense(values: Any) -> FloatArray:
    return np.asarray(casadi.DM(values).full(), dtype=np.float64)


def _flat(values: Any) -> FloatArray:
    return _dense(values).ravel()


def constraint_violation(nlp: StagedNLP, w: FloatArray, p: FloatArray) -> float:
    """Return the largest amount by which w, p leave a bound or a constraint; inf for NaN."""
    values = nlp.evaluate(w, p)
    parts = (
        (w, nlp.w_lower, nlp.w_upper),
        (p, nlp.p_lower, nlp.p_upper),
        (values.stage, nlp.c_lower, nlp.c_upper),
        (values.last, nlp.last_lower, nlp.last_upper),
        (values.glob, nlp.glob_lower, nlp.glob_upper),
    )
    worst = 0.0
    for value, lower, upper in parts:
        for excess in (lower - value, value - upper):
            worst = max(
                worst, float(np.max(np.where(np.isnan(excess), np.inf, excess), initial=0.0))
            )
    return worst
