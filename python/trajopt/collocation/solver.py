"""`solve`: transcribe, hand to a solver, and return a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import choice, positive, whole
from trajopt.collocation.assembly import Assembly, Link, Part
from trajopt.collocation.diagnosis import check_start, explain, find_violations, limits_reached
from trajopt.collocation.errors import segment_errors
from trajopt.collocation.grids import Grid, make_grids
from trajopt.collocation.guess import make_guess
from trajopt.collocation.ipopt import solve_ipopt
from trajopt.collocation.phases import MultiPhase, MultiPhaseSolution
from trajopt.collocation.problem import Problem
from trajopt.collocation.refinement import is_schedule, refine_automatically, run_schedule
from trajopt.collocation.solution import Pass, Solution
from trajopt.collocation.transcriptions import make_transcription
from trajopt.errors import ArgumentError, ArgumentTypeError

__all__ = ["SOLVERS", "solve", "solve_once"]

FloatArray = NDArray[np.float64]
SOLVERS = ("ipopt", "native")
# Violations kept with a solution.
KEPT = 50


def run_solver(solver: str) -> Callable[..., dict[str, Any]]:
    """Return the function that solves a staged program."""
    if choice("solve", "solver", solver, SOLVERS) == "ipopt":
        return solve_ipopt
    solve_native: Callable[..., dict[str, Any]] = import_module(
        "trajopt.collocation.native"
    ).solve_native
    return solve_native


def solve_once(
    problems: Sequence[Problem],
    links: Sequence[Link],
    grids: Sequence[Grid],
    guesses: Sequence[Any],
    *,
    method: str,
    points: str | None,
    substeps: int | None,
    solver: str,
    scaling: str,
    warm_start: Mapping[str, Any] | None = None,
    **settings: Any,
) -> tuple[list[Solution], dict[str, Any]]:
    """Solve all phases on one mesh each; return their trajectories and the solver's result."""
    scaled = choice("solve", "scaling", scaling, ("none", "auto")) == "auto"
    methods = [
        make_transcription(method, grid.degree, points, substeps, len(grid.mesh) - 1)
        for grid in grids
    ]
    parts = [
        Part(
            problem.phase,
            grid.mesh,
            problem.start if guess is None else make_guess("solve", problem.phase, guess),
            f"phase {k}: " if len(problems) > 1 else "",
        )
        for k, (problem, grid, guess) in enumerate(zip(problems, grids, guesses, strict=True))
    ]
    assembly = Assembly(parts, methods, links, scaled)
    check_start(assembly.nlp, _phase_times(assembly, assembly.nlp.p_guess))
    known = warm_start if warm_start and _fits(assembly, warm_start) else None
    result = run_solver(solver)(assembly.nlp, warm_start=known, **settings)
    return _solutions(assembly, result, problems, method, solver), result


def _fits(assembly: Assembly, result: Mapping[str, Any]) -> bool:
    """Return whether an earlier result has the unknowns and constraints of this program."""
    nlp, multipliers = assembly.nlp, result["multipliers"]
    expected = {
        "stage": nlp.c_lower,
        "last": nlp.last_lower,
        "glob": nlp.glob_lower,
        "bounds": nlp.w_guess,
        "p_bounds": nlp.p_guess,
    }
    return all(np.shape(multipliers[name]) == np.shape(like) for name, like in expected.items())


def _phase_times(assembly: Assembly, p: FloatArray) -> dict[str, FloatArray]:
    """Return the times of every phase at all nodes, by the prefix of its names."""
    return {
        part.prefix: np.pad(assembly.times(k, p), (assembly.first[k], 0), mode="edge")
        for k, part in enumerate(assembly.parts)
    }


def _solutions(
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
        violations = find_violations(assembly.nlp, w, p, _phase_times(assembly, p))
        reason = explain(violations, limits_reached(assembly.nlp, w))
        message = f"{message}; {reason}" if reason else message
    found = []
    for index, problem in enumerate(problems):
        interpolant = assembly.interpolant(index, w, p)
        phase, parameters = problem.phase, assembly.parameters(index, p)
        t, segments = assembly.times(index, p), len(assembly.parts[index].mesh) - 1
        error = segment_errors(phase, interpolant, parameters, segments)
        objective = assembly.objective(index, w, p)
        degrees = assembly.methods[index].degrees(segments)
        entry = Pass(
            method=method,
            segments=segments,
            degree=max(degrees, default=0),
            objective=objective,
            error=float(error.max(initial=0.0)),
            iterations=result["iterations"],
            seconds=result["seconds"],
            status=result["status"],
            degrees=degrees,
        )
        found.append(
            Solution(
                status=result["status"],
                message=message,
                objective=objective,
                t=t,
                x=assembly.states(index, w),
                u=interpolant.control(t),
                error=error,
                iterations=result["iterations"],
                parameters=parameters,
                method=method,
                solver=solver,
                interpolant=interpolant,
                mesh=assembly.parts[index].mesh,
                degrees=degrees,
                history=result["history"],
                passes=[entry],
                violations=violations[:KEPT],
                seconds=result["seconds"],
                x_names=phase.x_names,
                u_names=phase.u_names,
                result=result,
                problem=problem,
                adjoint=partial(
                    assembly.costates, index, w, p, np.asarray(result["multipliers"]["stage"])
                ),
            )
        )
    return found


@overload
def solve(problem: Problem, *arguments: Any, **settings: Any) -> Solution: ...


@overload
def solve(problem: MultiPhase, *arguments: Any, **settings: Any) -> MultiPhaseSolution: ...


def solve(
    problem: Problem | MultiPhase,
    method: str = "hermite_simpson",
    segments: Any = 25,
    solver: str = "ipopt",
    *,
    degree: int | Sequence[Any] | None = None,
    points: str | None = None,
    substeps: int | None = None,
    guess: Any = None,
    warm_start: Solution | MultiPhaseSolution | None = None,
    tolerance: float = 1e-8,
    max_iterations: int = 3000,
    scaling: str = "none",
    options: Mapping[str, Any] | None = None,
    callback: Callable[[dict[str, Any], FloatArray], Any] | None = None,
    refine: Any = None,
    max_refinements: int = 8,
) -> Solution | MultiPhaseSolution:
    """Transcribe a problem, solve it, and return the trajectory.

    Parameters
    ----------
    problem : Problem or MultiPhase
    method : str
        ``trapezoidal``, ``hermite_simpson`` (separated), ``hermite_simpson_compressed``,
        ``multiple_shooting`` (RK4), ``chebyshev`` (Lobatto points) or ``legendre``.
    segments : int or (N+1,) array_like
        Number of equal segments, or the knots of a mesh; for several phases one for all, or a
        list with a number or knots for each.
    solver : str
        ``ipopt`` or ``native``.
    degree : int or sequence, optional
        Of the polynomials of ``chebyshev`` and ``legendre``, 4 unless given: one for all segments
        or a list with one for each; for several phases one for all, or a list with an entry per
        phase. One segment makes the methods global.
    points : str, optional
        Of ``legendre``: ``gauss``, ``radau`` (default) or ``lobatto``.
    substeps : int, optional
        Runge–Kutta steps per segment of ``multiple_shooting``.
    guess : dict, callable, Solution, optional
        In place of the problem's; for several phases a list with one entry per phase, or an
        earlier solution.
    warm_start : Solution or MultiPhaseSolution, optional
        In place of a guess: start from an earlier solution and, if method and number of segments
        are the same, from its multipliers too.
    tolerance : float
        Of the solver.
    max_iterations : int
    scaling : str
        ``none``, or ``auto``: states and controls are divided by powers of two near their bounds.
    options : dict, optional
        More options of the solver, by its own names.
    callback : callable, optional
        ``callback(record, x)`` after every iteration of the solver: a dict of its numbers, as in
        `Solution.history`, and the unknowns, nodes then globals. Returning False stops the solver,
        as Ctrl-C does: the last iterate comes back with status ``interrupted``.
        `IterationPrinter` is one that writes a table.
    refine : float or list, optional
        A number refines the meshes of all phases until the error of every segment and state,
        relative to 1 + max |x|, is below it: segments are cut into two to four, or the degree of
        orthogonal methods is raised where the solution is smooth. A list is a schedule of meshes
        in place of `segments`, coarse to fine, each as `segments` may be, or a dict with
        ``segments``, ``method``, ``degree``, ``points``, ``substeps``, ``tolerance``. Every
        solution is the guess of the next; `Solution.passes` reports on all of them.
    max_refinements : int

    Returns
    -------
    Solution or MultiPhaseSolution
        Also where the solver did not converge: `Solution.status` and `Solution.message` say why.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        For arguments that cannot be used, before the solver starts.
    """
    if not isinstance(problem, (Problem, MultiPhase)):
        raise ArgumentTypeError(
            f"solve: problem must be a Problem or MultiPhase, not {type(problem).__name__}"
        )
    several = isinstance(problem, MultiPhase)
    problems = list(problem.phases) if isinstance(problem, MultiPhase) else [problem]
    links = problem.traced if isinstance(problem, MultiPhase) else ()
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
        "callback": callback,
    }
    if callback is not None and not callable(callback):
        raise ArgumentTypeError(f"solve: callback must be callable, not {callback!r}")
    if warm_start is not None:
        if guess is not None:
            raise ArgumentError("solve: guess and warm_start are given, expected one")
        if not isinstance(warm_start, MultiPhaseSolution if several else Solution):
            raise ArgumentTypeError(
                f"solve: warm_start must be a solution of a {type(problem).__name__}, "
                f"not {type(warm_start).__name__}"
            )

    def grids(mesh: Any, settings: Mapping[str, Any]) -> list[Grid]:
        return make_grids(len(problems) if several else None, mesh, settings.get("degree"))

    def once(
        meshes: Sequence[Grid], settings: Mapping[str, Any], earlier: Any
    ) -> Solution | MultiPhaseSolution:
        start = earlier or warm_start or guess
        known = warm_start.result if warm_start is not None and earlier is None else None
        found, result = solve_once(
            problems,
            links,
            meshes,
            _guesses(start, len(problems)) if several else [start],
            warm_start=known,
            **{name: value for name, value in settings.items() if name != "degree"},
            **fixed,
        )
        if not several:
            return found[0]
        return MultiPhaseSolution(
            phases=found,
            objective=result["objective"],
            status=result["status"],
            message=found[0].message,
            iterations=result["iterations"],
            seconds=result["seconds"],
            result=result,
        )

    if refine is None:
        return once(grids(segments, base), base, None)
    if is_schedule(refine):
        return run_schedule(once, grids, refine, base)
    most = whole("solve", "max_refinements", max_refinements, 0)
    first = grids(segments, base)
    return refine_automatically(once, first, base, positive("solve", "refine", refine), most)


def _guesses(guess: Any, phases: int) -> list[Any]:
    """Return one guess per phase."""
    if guess is None:
        return [None] * phases
    guesses = list(guess.phases if isinstance(guess, MultiPhaseSolution) else guess)
    if len(guesses) != phases:
        raise ArgumentError(f"solve: guess has {len(guesses)} entries, expected one per phase")
    return guesses
