"""`solve`: transcribe, hand to a solver, and return a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import choice, finite_array, positive, whole
from trajopt.collocation.assembly import Assembly, Part
from trajopt.collocation.diagnosis import explain, find_violations, limits_reached
from trajopt.collocation.errors import segment_errors
from trajopt.collocation.guess import make_guess
from trajopt.collocation.ipopt import solve_ipopt
from trajopt.collocation.problem import Problem
from trajopt.collocation.refinement import is_schedule, refine_automatically, run_schedule
from trajopt.collocation.solution import Pass, Solution
from trajopt.collocation.transcriptions import DEGREE, make_transcription
from trajopt.errors import ArgumentError, ArgumentTypeError

__all__ = ["SOLVERS", "solve", "solve_once"]

FloatArray = NDArray[np.float64]
SOLVERS = ("ipopt", "native")
# Violations kept with a solution.
KEPT = 50


def make_mesh(segments: Any) -> FloatArray:
    """Return the knots in [0, 1] of a number of segments, or of a list of knots."""
    if isinstance(segments, (int, np.integer)) or not np.ndim(segments):
        return np.linspace(0.0, 1.0, whole("solve", "segments", segments, 1) + 1)
    mesh = finite_array("solve", "segments", segments, (None,))
    if len(mesh) < 2 or np.any(np.diff(mesh) <= 0):
        raise ArgumentError("solve: segments as an array of knots must rise, at least two")
    return np.asarray((mesh - mesh[0]) / (mesh[-1] - mesh[0]), dtype=np.float64)


def run_solver(solver: str) -> Callable[..., dict[str, Any]]:
    """Return the function that solves a staged program."""
    if choice("solve", "solver", solver, SOLVERS) == "ipopt":
        return solve_ipopt
    solve_native: Callable[..., dict[str, Any]] = import_module(
        "trajopt.collocation.native"
    ).solve_native
    return solve_native


def solve_once(
    problem: Problem,
    mesh: FloatArray,
    *,
    guess: Any = None,
    method: str = "hermite_simpson",
    degree: int | None = None,
    points: str | None = None,
    substeps: int | None = None,
    solver: str = "ipopt",
    scaling: str = "none",
    warm_start: Mapping[str, Any] | None = None,
    **settings: Any,
) -> Solution:
    """Solve `problem` on one mesh; see `solve`."""
    transcription = make_transcription(method, degree, points, substeps)
    start = problem.start if guess is None else make_guess("solve", problem.phase, guess)
    scaled = choice("solve", "scaling", scaling, ("none", "auto")) == "auto"
    assembly = Assembly([Part(problem.phase, mesh, start)], transcription, scaled=scaled)
    result = run_solver(solver)(assembly.nlp, warm_start=warm_start, **settings)
    (solution,) = solutions(assembly, result, [problem], method, solver)
    degree = degree or (DEGREE if method in ("chebyshev", "legendre") else 0)
    solution.passes = [
        Pass(
            method,
            solution.segments,
            degree,
            solution.objective,
            float(solution.error.max(initial=0.0)),
            solution.iterations,
            solution.seconds,
            solution.status,
        )
    ]
    return solution


def solutions(
    assembly: Assembly,
    result: dict[str, Any],
    problems: Sequence[Problem],
    method: str,
    solver: str,
) -> list[Solution]:
    """Return the trajectory of every phase from what a solver returned."""
    w, p = result["w"], result["p"]
    message, violations = result["message"], []
    if not result["status"].converged:
        violations = find_violations(assembly.nlp, w, p, assembly.times(0, p))
        reason = explain(violations, limits_reached(assembly.nlp, w))
        message = f"{message}; {reason}" if reason else message
    found = []
    for index, problem in enumerate(problems):
        interpolant = assembly.interpolant(index, w, p)
        phase, parameters = problem.phase, assembly.parameters(index, p)
        t = assembly.times(index, p)
        found.append(
            Solution(
                status=result["status"],
                message=message,
                objective=result["objective"],
                t=t,
                x=assembly.states(index, w),
                u=interpolant.control(t),
                error=segment_errors(phase, interpolant, parameters, assembly.segments),
                iterations=result["iterations"],
                parameters=parameters,
                method=method,
                solver=solver,
                interpolant=interpolant,
                mesh=assembly.parts[index].mesh,
                history=result["history"],
                violations=violations[:KEPT],
                seconds=result["seconds"],
                x_names=phase.x_names,
                u_names=phase.u_names,
                result=result,
                problem=problem,
            )
        )
    return found


def solve(
    problem: Problem,
    method: str = "hermite_simpson",
    segments: Any = 25,
    solver: str = "ipopt",
    *,
    degree: int | None = None,
    points: str | None = None,
    substeps: int | None = None,
    guess: Any = None,
    tolerance: float = 1e-8,
    max_iterations: int = 3000,
    scaling: str = "none",
    options: Mapping[str, Any] | None = None,
    refine: Any = None,
    max_refinements: int = 8,
) -> Solution:
    """Transcribe a problem, solve it, and return the trajectory.

    Parameters
    ----------
    problem : Problem
    method : str
        ``trapezoidal``, ``hermite_simpson`` (separated), ``hermite_simpson_compressed``,
        ``multiple_shooting`` (RK4), ``chebyshev`` (Lobatto points) or ``legendre``.
    segments : int or (N+1,) array_like
        Number of equal segments, or the knots of a mesh.
    solver : str
        ``ipopt`` or ``native``.
    degree : int, optional
        Of the polynomials of ``chebyshev`` and ``legendre``. One segment makes them global.
    points : str, optional
        Of ``legendre``: ``gauss``, ``radau`` (default) or ``lobatto``.
    substeps : int, optional
        Runge–Kutta steps per segment of ``multiple_shooting``.
    guess : dict, callable, Solution, optional
        In place of the problem's.
    tolerance : float
        Of the solver.
    max_iterations : int
    scaling : str
        ``none``, or ``auto``: states and controls are divided by powers of two near their bounds.
    options : dict, optional
        More options of the solver, by its own names.
    refine : float or list, optional
        A number refines the mesh until the error of every segment and state, relative to
        1 + max |x|, is below it: segments are cut into two to four, or the degree of orthogonal
        methods is raised where the error is even. A list is a schedule of meshes in place of
        `segments`, coarse to fine, each a number of segments, knots, or a dict with ``segments``,
        ``method``, ``degree``, ``points``, ``substeps``, ``tolerance``. Every solution is the
        guess of the next; `Solution.passes` reports on all of them.
    max_refinements : int

    Returns
    -------
    Solution
        Also where the solver did not converge: `Solution.status` and `Solution.message` say why.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        For arguments that cannot be used, before the solver starts.
    """
    if not isinstance(problem, Problem):
        raise ArgumentTypeError(f"solve: problem must be a Problem, not {type(problem).__name__}")
    base: dict[str, Any] = {
        "method": method,
        "degree": degree,
        "points": points,
        "substeps": substeps,
        "tolerance": positive("solve", "tolerance", tolerance),
    }
    fixed: dict[str, Any] = {
        "solver": solver,
        "scaling": scaling,
        "max_iterations": whole("solve", "max_iterations", max_iterations, 0),
        "options": options,
    }

    def once(mesh: Any, changes: Mapping[str, Any], earlier: Any) -> Solution:
        start = guess if earlier is None else earlier
        return solve_once(problem, make_mesh(mesh), guess=start, **{**base, **changes}, **fixed)

    if refine is None:
        return once(segments, {}, None)
    if is_schedule(refine):
        return run_schedule(once, refine)
    most = whole("solve", "max_refinements", max_refinements, 0)
    return refine_automatically(once, segments, base, positive("solve", "refine", refine), most)
