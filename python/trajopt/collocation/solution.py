"""The result of a solve: a trajectory that can be evaluated anywhere, and how good it is."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.collocation.diagnosis import Violation
from trajopt.collocation.errors import dynamics_error, path_integral
from trajopt.collocation.interpolant import Interpolant
from trajopt.errors import ArgumentError
from trajopt.status import Status

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from trajopt.collocation.problem import Problem

__all__ = ["Pass", "Solution"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Pass:
    """One solve of a mesh refinement.

    Parameters
    ----------
    method : str
    segments, degree : int
        Size of the mesh; degree is the highest of all segments, 0 where the method has a fixed one.
    objective : float
    error : float
        Largest entry of the error per segment.
    iterations : int
    seconds : float
    status : Status
    degrees : tuple of int
        Degree of every segment; empty where the method has a fixed one.
    cut, raised : int
        How many segments of the mesh before were cut, and how many got a higher degree.
    """

    method: str
    segments: int
    degree: int
    objective: float
    error: float
    iterations: int
    seconds: float
    status: Status
    degrees: tuple[int, ...] = ()
    cut: int = 0
    raised: int = 0


@dataclass(eq=False, repr=False)
class Solution:
    """A trajectory found by `trajopt.collocation.solve`.

    Parameters
    ----------
    status : Status
        Why the solver stopped.
    message : str
        The same in a sentence, with numbers; for an infeasible problem with what was in the way.
    objective : float
        Value of the objective by the method's own quadrature.
    t : (N+1,) array
        Times of the knots [s].
    x : (N+1, nx) array
        States at the knots.
    u : (N+1, nu) array
        Controls at the knots; for Gauss and Radau points by the interpolant.
    error : (N, nx) array
        η = ∫ |ẋ − f| dt of every segment and state (Kelly, 5.3), in units of the state.
    iterations : int
        Iterations of the solver, over all passes.
    parameters : (np,) array
    method, solver : str
    interpolant : Interpolant
        The trajectory between the knots.
    mesh : (N+1,) array
        Knots as shares of the duration.
    degrees : tuple of int
        Degree of every segment; empty where the method has a fixed one.
    history : list of dict
        One record per iteration of the last pass.
    passes : list of Pass
        One entry per mesh.
    violations : list of Violation
        The most violated constraints, largest first; empty if all hold.
    seconds : float
        Wall time of the solver calls [s].
    x_names, u_names : tuple of str
    result : dict
        What the solver returned: unknowns and multipliers, for a warm start on the same mesh.
    """

    status: Status
    message: str
    objective: float
    t: FloatArray
    x: FloatArray
    u: FloatArray
    error: FloatArray
    iterations: int
    parameters: FloatArray
    method: str
    solver: str
    interpolant: Interpolant
    mesh: FloatArray
    degrees: tuple[int, ...] = ()
    history: list[dict[str, float]] = field(default_factory=list)
    passes: list[Pass] = field(default_factory=list)
    violations: list[Violation] = field(default_factory=list)
    seconds: float = 0.0
    x_names: tuple[str, ...] = ()
    u_names: tuple[str, ...] = ()
    result: dict[str, Any] = field(default_factory=dict)
    problem: Problem | None = None
    adjoint: Callable[[], FloatArray] | None = None

    def __repr__(self) -> str:
        return (
            f"<collocation Solution: {self.method}, {self.segments} segments, {self.status}, "
            f"objective {self.objective:.8g}>"
        )

    @property
    def segments(self) -> int:
        """Number of segments N."""
        return len(self.t) - 1

    @property
    def converged(self) -> bool:
        """Whether the tolerances were met."""
        return self.status.converged

    def state(self, t: ArrayLike) -> FloatArray:
        """Return the state at time t, by the polynomials of the method.

        Parameters
        ----------
        t : float or (m,) array_like
            Times within the trajectory [s].

        Returns
        -------
        (nx,) or (m, nx) array
        """
        return self._at(t, self.interpolant.state)

    def control(self, t: ArrayLike) -> FloatArray:
        """Return the control at time t: (nu,) or (m, nu)."""
        return self._at(t, self.interpolant.control)

    def derivative(self, t: ArrayLike) -> FloatArray:
        """Return the time derivative of `state` at time t: (nx,) or (m, nx) [1/s]."""
        return self._at(t, self.interpolant.derivative)

    def defect(self, t: ArrayLike) -> FloatArray:
        """Return ε(t) = ẋ(t) − f(t, x(t), u(t)) (Kelly, 5.3): (nx,) or (m, nx) [1/s]."""
        phase, p = self._stated("defect").phase, self.parameters
        return self._at(t, lambda times: dynamics_error(phase, self.interpolant, times, p))

    def costates(self) -> FloatArray:
        """Return λ = ∂(cost to go)/∂x at the knots (N+1, nx), as the multipliers have it.

        What an indirect method starts from (Kelly, 9.11): along the solution λ' = -∂H/∂x and u
        minimizes H = w + λ·f. Exact for the discrete problem, so as near to those of the
        continuous one as the method is. Where a bound of a state holds, λ jumps, and this is its
        value just before.
        """
        if self.adjoint is None:
            raise ArgumentError(
                "costates: a solution read from a file does not hold the multipliers"
            )
        return self.adjoint()

    def objective_along_path(self) -> float:
        """Return the objective integrated along the interpolated trajectory.

        It differs from `objective` by the error of the method's quadrature.
        """
        phase, p = self._stated("objective_along_path").phase, self.parameters
        mayer = phase.terminal(self.t[0], self.t[-1], self.x[0], self.x[-1], p)
        return path_integral(phase, self.interpolant, p) + float(mayer)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory to a ``.npz`` file; `path` is replaced in one step or not at all.

        Functions are not stored: `defect` and `objective_along_path` need the problem.
        """
        from trajopt.collocation.files import save_solution

        save_solution(self, path)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Solution:
        """Read what `save` wrote. No code in the file is ever executed.

        Raises
        ------
        FileFormatError
            If the file is missing, damaged or of another kind.
        """
        from trajopt.collocation.files import load_solution

        return load_solution(path)

    def summary(self) -> str:
        """Return the figures of the solve as JSON."""
        return json.dumps(
            {
                "status": str(self.status),
                "message": self.message,
                "objective": self.objective,
                "method": self.method,
                "solver": self.solver,
                "segments": self.segments,
                "iterations": self.iterations,
                "error_max": float(self.error.max(initial=0.0)),
                "seconds": self.seconds,
            }
        )

    def _stated(self, what: str) -> Problem:
        if self.problem is None:
            raise ArgumentError(f"{what}: a solution read from a file does not hold its problem")
        return self.problem

    def _at(self, t: ArrayLike, function: Any) -> FloatArray:
        times = np.asarray(t, dtype=np.float64)
        slack = 1e-9 * (self.t[-1] - self.t[0])
        flat = times.ravel()
        outside = ~((flat >= self.t[0] - slack) & (flat <= self.t[-1] + slack))
        if outside.any():
            raise ArgumentError(
                f"Solution: t = {flat[outside][0]:g} is outside of the trajectory, "
                f"{self.t[0]:g} to {self.t[-1]:g} s"
            )
        values: FloatArray = function(np.atleast_1d(flat))
        return values.reshape(*times.shape, -1)
