"""`solve`: transcribe, hand to a solver, and return a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import choice, finite_array, positive, whole
from trajopt.collocation.assembly import Assembly, Part
from trajopt.collocation.diagnosis import check_start, explain, find_violations, limits_reached
from trajopt.collocation.errors import segment_errors
from trajopt.collocation.guess import make_guess
from trajopt.collocation.ipopt import solve_ipopt
from trajopt.collocation.phases import MultiPhase, MultiPhaseSolution
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
    check_start(assembly.nlp, _phase_times(assembly, assembly.nlp.p_guess))
    known = warm_start if warm_start and _fits(assembly, warm_start) else None
    result = run_solver(solver)(assembly.nlp, warm_start=known, **settings)
    (solution,) = _solutions(assembly, result, [problem], method, solver)
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


def _fits(assembly: Assembly, result: Mapping[str, Any]) -> bool:
    """Return whether an earlier result has the unknowns and constraints of this program."""
    nlp, multipliers = assembly.nlp, result["multipliers"]
    shapes = nlp.c_lower.shape, nlp.last_lower.shape, nlp.w_guess.shape, nlp.p_guess.shape
    names = ("stage", "last", "bounds", "p_bounds")
    return all(
        np.shape(multipliers[name]) == shape for name, shape in zip(names, shapes, strict=True)
    )


def _phase_times(assembly: Assembly, p: FloatArray) -> dict[str, FloatArray]:
    """Return the times of the knots of every phase, by the prefix of its names."""
    return {part.prefix: assembly.times(k, p) for k, part in enumerate(assembly.parts)}


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
        t = assembly.times(index, p)
        found.append(
            Solution(
                status=result["status"],
                message=message,
                objective=assembly.objective(index, w, p),
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


def solve_phases(
    problem: MultiPhase,
    mesh: FloatArray,
    guess: Any,
    method: str,
    solver: str,
    options_of: Mapping[str, Any],
    **settings: Any,
) -> MultiPhaseSolution:
    """Solve all phases at once, each on the same shares of its own time."""
    transcription = make_transcription(method, **options_of)
    if isinstance(guess, MultiPhaseSolution):
        guess = guess.phases
    count = len(problem.phases)
    guesses = [None] * count if guess is None else list(guess)
    if len(guesses) != count:
        raise ArgumentError(f"solve: guess has {len(guesses)} entries, expected one per phase")
    scaled = choice("solve", "scaling", settings.pop("scaling"), ("none", "auto")) == "auto"
    parts = [
        Part(
            phase.phase,
            mesh,
            phase.start if own is None else make_guess("solve", phase.phase, own),
            f"phase {k}: ",
        )
        for k, (phase, own) in enumerate(zip(problem.phases, guesses, strict=True))
    ]
    assembly = Assembly(parts, transcription, problem.traced, scaled)
    check_start(assembly.nlp, _phase_times(assembly, assembly.nlp.p_guess))
    result = run_solver(solver)(assembly.nlp, **settings)
    found = _solutions(assembly, result, list(problem.phases), method, solver)
    return MultiPhaseSolution(
        found,
        result["objective"],
        result["status"],
        found[0].message,
        result["iterations"],
        result["seconds"],
    )


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
    degree: int | None = None,
    points: str | None = None,
    substeps: int | None = None,
    guess: Any = None,
    warm_start: Solution | None = None,
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
        In place of the problem's; for several phases a list with one entry per phase, or an
        earlier solution.
    warm_start : Solution, optional
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
        A number refines the mesh until the error of every segment and state, relative to
        1 + max |x|, is below it: segments are cut into two to four, or the degree of orthogonal
        methods is raised where the error is even. A list is a schedule of meshes in place of
        `segments`, coarse to fine, each a number of segments, knots, or a dict with ``segments``,
        ``method``, ``degree``, ``points``, ``substeps``, ``tolerance``. Every solution is the
        guess of the next; `Solution.passes` reports on all of them.
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
        if not isinstance(warm_start, Solution) or isinstance(problem, MultiPhase):
            raise ArgumentTypeError(
                "solve: warm_start must be a Solution of one phase, "
                f"not {type(warm_start).__name__}"
            )
    if isinstance(problem, MultiPhase):
        if refine is not None:
            raise ArgumentError("solve: refine is for problems of one phase")
        shape = {name: base.pop(name) for name in ("degree", "points", "substeps")}
        return solve_phases(problem, make_mesh(segments), guess, options_of=shape, **base, **fixed)
    single = problem

    def once(mesh: Any, changes: Mapping[str, Any], earlier: Any) -> Solution:
        start = guess if earlier is None else earlier
        known = None
        if earlier is None and warm_start is not None:
            start, known = warm_start, warm_start.result or None
        return solve_once(
            single,
            make_mesh(mesh),
            guess=start,
            warm_start=known,
            **{**base, **changes},
            **fixed,
        )

    if refine is None:
        return once(segments, {}, None)
    if is_schedule(refine):
        return run_schedule(once, refine)
    most = whole("solve", "max_refinements", max_refinements, 0)
    return refine_automatically(once, segments, base, positive("solve", "refine", refine), most)
