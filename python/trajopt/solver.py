"""`solve`: from a problem to a motion, in stages of growing contact stiffness."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt import _core
from trajopt.checks import choice, non_negative, positive, whole
from trajopt.devices import choose_device
from trajopt.errors import ArgumentError, ArgumentTypeError, DeviceError
from trajopt.finite import check_start
from trajopt.interrupt import InterruptFlag
from trajopt.methods import METHODS, paper_problem, run_core
from trajopt.records import IterationRecord
from trajopt.refinement import interval_errors, refine_until
from trajopt.result import build_solution
from trajopt.status import Status
from trajopt.transcription import Stage, Transcription

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.solution import Solution

__all__ = ["Stage", "solve"]

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 1000
ORDERINGS = ("auto", "sequential", "cyclic", "chunked")


@dataclass
class _Run:
    """State of a solve shared by its stages."""

    transcription: Transcription
    callback: Callable[[IterationRecord], object] | None
    seed: int
    method: str
    ordering: str
    device: str
    interrupt: InterruptFlag
    history: list[IterationRecord] = field(default_factory=list)
    iterations: int = 0
    started: float = field(default_factory=time.perf_counter)
    stage_index: int = 0
    stage: Stage = field(default_factory=Stage)

    def observer(self, core: Any) -> Callable[[dict[str, Any], FloatArray], bool]:
        """Turn the core's records into ours, number them through, ask the callback."""
        offset = self.iterations
        force = self.transcription.scales.force

        def observe(values: dict[str, Any], state: FloatArray) -> bool:
            names = self.transcription.term_names
            record = IterationRecord(
                iteration=offset + values["iteration"] + 1,
                stage=self.stage_index,
                objective=values["objective"],
                objective_terms=dict(zip(names, values["terms"], strict=True)),
                constraint_violation=values["constraint_violation"] * force,
                frame_violation=values["frame_violation"],
                merit_penalty=values["penalty"],
                radius=values["radius"],
                damping=values["damping"],
                step_norm=values["step_norm"],
                accepted=values["accepted"],
                seconds=values["seconds"],
                elapsed=time.perf_counter() - self.started,
                snapshot=lambda: self.solution(
                    core, state, Status.INTERRUPTED, "checkpoint", self.stage
                ),
            )
            self.history.append(IterationRecord.from_dict(record.to_dict()))
            try:
                stop = self.callback(record) if self.callback is not None else False
            except KeyboardInterrupt:
                stop = True
            return stop is not True and not self.interrupt.raised

        return observe

    def solution(
        self, core: Any, state: FloatArray, status: Status, message: str, stage: Stage
    ) -> Solution:
        """Package a state."""
        return build_solution(
            self.transcription,
            core,
            state,
            stage,
            status=status,
            message=message,
            iterations=len(self.history),
            seconds=time.perf_counter() - self.started,
            history=list(self.history),
            seed=self.seed,
            ordering=self.ordering,
            device=self.device,
            settings={"method": self.method, "stage": self.stage_index},
        )


def solve(
    problem: Problem,
    method: str = "default",
    device: str = "auto",
    callback: Callable[[IterationRecord], object] | None = None,
    max_iterations: int | None = None,
    warm_start: Solution | None = None,
    seed: int = 0,
    threads: int | None = None,
    tolerance: float = 2e-3,
    constraint_tolerance: float = 1e-9,
    noise: float = 1e-3,
    stages: Sequence[Stage] | None = None,
    ordering: str = "auto",
    refine: float | None = None,
    max_refinements: int = 3,
) -> Solution:
    """Find a motion.

    Parameters
    ----------
    problem : Problem
    method : {"default", "paper"}
        ``default``: Levenberg-Marquardt SQP in a funnel, in stages of growing stiffness.
        ``paper``: Pan's Algorithm 1 on his version of the problem (Hermite spline, implicit
        integrator, undamped contact with w_t = w_n), in his three passes of stiffness.
    device : {"auto", "cpu", "cuda"}
        Where to run. ``"cuda"`` is for the default method on frames that are not periodic, without
        terms that are functions of the user; ``"auto"`` is the CPU. For one `ordering` other than
        ``"auto"`` both are written to give the same bits (so far tested by emulation only).
    callback : callable, optional
        Called with an `IterationRecord` after each iteration; returning True stops the solve.
    max_iterations : int, optional
        Limit over all stages; 1000 by default.
    warm_start : Solution, optional
        Motion to start from; a checkpoint continues with the stage it was written in.
    seed : int
        Seed of the noise on the start.
    threads : int, optional
        All processors by default. The result has the same bits for every number.
    tolerance : float
        Solved when the objective falls by less than this share in ten iterations ...
    constraint_tolerance : float
        ... and ‖C‖∞ is below this many body weights.
    noise : float
        Amplitude of the noise on the settled start [lengths, rad].
    stages : sequence of Stage, optional
        Passes of the solve; a warm start runs only the last by default.
    ordering : {"auto", "sequential", "cyclic", "chunked"}
        Elimination order of the KKT system.
    refine : float, optional
        Refine the time grid where the residual between frames exceeds this share of the body
        weight, and solve again.
    max_refinements : int
        Limit of such passes.

    Returns
    -------
    Solution
        Always the best motion found; `status` and `message` say why the solver stopped.

    Raises
    ------
    ArgumentError, DeviceError
        Bad arguments, before any work starts.
    """
    _check_problem(problem, warm_start, callback)
    choice("solve", "method", method, METHODS)
    choice("solve", "ordering", ordering, ORDERINGS)
    # A GPU only when it is asked for.
    device = "cpu" if device == "auto" else choose_device(device)
    if device == "cuda" and method != "default":
        raise DeviceError(f"solve: method {method!r} runs on the CPU only, not on device 'cuda'")
    if threads is not None:
        whole("solve", "threads", threads, 1)
    if max_iterations is not None:
        whole("solve", "max_iterations", max_iterations, 1)
    whole("solve", "seed", seed, 0)
    whole("solve", "max_refinements", max_refinements, 0)
    positive("solve", "tolerance", tolerance)
    positive("solve", "constraint_tolerance", constraint_tolerance)
    non_negative("solve", "noise", noise)
    if method == "paper":
        problem = paper_problem(problem)
    if refine is not None:
        positive("solve", "refine", refine)
        if problem.formulation != "frames" or problem.periodic:
            kind = "periodic" if problem.periodic else problem.formulation
            raise ArgumentError(f"solve: refine needs frames that are not periodic, not {kind}")
    passes = list(enumerate(_stages(METHODS[method].stages if stages is None else stages)))
    if problem.contact is None and stages is None:
        passes = passes[-1:]  # nothing that could grow stiffer
    if warm_start is not None and stages is None:
        passes = _remaining(passes, warm_start)
    limit = MAX_ITERATIONS if max_iterations is None else max_iterations
    guess = None if warm_start is None else _resample(problem, warm_start)
    options = {
        "constraint_tolerance": constraint_tolerance,
        "objective_tolerance": tolerance,
        "ordering": ordering,
    }
    with InterruptFlag() as interrupt:
        transcription = Transcription(problem, threads or _core.hardware_threads())
        run = _Run(transcription, callback, seed, method, ordering, device, interrupt)
        solution = _run_stages(run, passes, guess, limit, noise, options)
        if refine is not None:
            solution = _refine(run, solution, refine, max_refinements, limit, options)
    return solution


def _check_problem(problem: Any, warm_start: Any, callback: Any) -> None:
    from trajopt.problem import Problem
    from trajopt.solution import Solution

    if not isinstance(problem, Problem):
        raise ArgumentTypeError(f"solve: problem must be a Problem, not {type(problem).__name__}")
    if warm_start is not None and not isinstance(warm_start, Solution):
        raise ArgumentTypeError(
            f"solve: warm_start must be a Solution, not {type(warm_start).__name__}"
        )
    if callback is not None and not callable(callback):
        raise ArgumentTypeError(f"solve: callback must be callable, not {callback!r}")
    if not any(getattr(term, "weight", 1.0) > 0 for term in problem.terms):
        raise ArgumentError("Problem: no objective term with a weight > 0; add one with add()")


def _stages(stages: Sequence[Stage]) -> Sequence[Stage]:
    if not stages or not all(isinstance(stage, Stage) for stage in stages):
        raise ArgumentTypeError(f"solve: stages must be a list of Stage, not {stages!r}")
    return stages


def _refine(
    run: _Run,
    solution: Solution,
    tolerance: float,
    passes: int,
    limit: int,
    options: dict[str, Any],
) -> Solution:
    """Halve the steps where the residual between frames is large, and solve again."""
    best = solution
    start = Transcription.on_grid

    def solve_on(steps: FloatArray) -> bool:
        nonlocal best
        run.transcription = start(run.transcription, steps)
        guess = _resample(run.transcription.problem, best)
        last = [(run.stage_index, run.stage)]
        found = _run_stages(run, last, guess, max(limit, len(run.history) + 1), 0.0, options)
        if found.status is not Status.SOLVED:
            best.message += (
                f"; refined to {len(steps)} frames it ended as {found.status}, and was dropped"
            )
            return False
        best = found
        return True

    if solution.status is Status.SOLVED:
        refine_until(
            lambda: interval_errors(best, best.fine_violation, best.body_weight),
            solve_on,
            run.transcription.problem.steps,
            tolerance,
            passes,
        )
    return best


def _run_stages(
    run: _Run,
    passes: Sequence[tuple[int, Stage]],
    guess: FloatArray | None,
    limit: int,
    noise: float,
    options: dict[str, Any],
) -> Solution:
    """Solve stage by stage, each from the motion of the one before."""
    transcription = run.transcription
    for index, stage in passes:
        run.stage_index, run.stage = index, stage
        initial = transcription.initial_frames(stage)
        core = transcription.core_problem(stage, initial)
        if guess is None:
            frames = transcription.still(initial)
            state = core.state_from_frames(transcription.to_core(frames))
            rng = np.random.default_rng(run.seed)
            state = _perturb(transcription, core, state, transcription.noise(rng, noise))
        else:
            state = core.state_from_frames(transcription.to_core(guess))
        if index == passes[0][0]:
            check_start(transcription, core, state, stage, initial)
        last = index == passes[-1][0]
        budget = limit - len(run.history)
        if stage.iterations is not None and not last:
            budget = min(budget, stage.iterations)
        name, message, count, state = run_core(
            run.method,
            core,
            state,
            run.observer(core),
            max(budget, 1),
            last,
            options,
            run.device,
        )
        run.iterations += count
        status = Status(name)
        if last or status in (Status.INTERRUPTED, Status.NUMERICAL_FAILURE):
            break
        guess = transcription.to_si(core.evaluate(state)["frames"])[2:]
        if len(run.history) >= limit:
            break
    return run.solution(core, state, status, message, stage)


def _perturb(
    transcription: Transcription, core: Any, state: FloatArray, noise: FloatArray
) -> FloatArray:
    if transcription.problem.formulation == "frames":
        return np.asarray(core.retract(state, noise.ravel()))
    per = transcription.problem.frames_per_knot
    knots = noise[per - 1 :: per]
    step = np.concatenate([knots, np.zeros_like(knots)], axis=1)
    return np.asarray(core.retract(state, step.ravel()))


def _remaining(passes: list[tuple[int, Stage]], warm_start: Solution) -> list[tuple[int, Stage]]:
    """Stages still to do: those from an unfinished solve's stage on, else the last."""
    stage = warm_start.settings.get("stage")
    if warm_start.status is not Status.SOLVED and isinstance(stage, int):
        return passes[min(stage, len(passes) - 1) :]
    return passes[-1:]


def _resample(problem: Problem, solution: Solution) -> FloatArray:
    """Frames (N, D) of another solution's motion at the times of this problem."""
    from trajopt.interpolation import Interpolant

    if solution.model.ndof != problem.model.ndof:
        raise ArgumentTypeError(
            f"solve: warm_start moves {solution.model.ndof} degrees of freedom, "
            f"the problem has {problem.model.ndof}"
        )
    pairs = zip(solution.model.dof_names, problem.model.dof_names, strict=True)
    for number, (theirs, ours) in enumerate(pairs):
        if theirs != ours:
            raise ArgumentError(
                f"solve: warm_start moves another robot: its degree of freedom {number} is "
                f"{theirs!r}, the problem's is {ours!r}"
            )
    if len(solution.times) == problem.frames and np.allclose(solution.times, problem.times):
        return np.array(solution.x)
    times, frames = solution.times, solution.x
    if solution.initial.shape == (2, solution.model.ndof):
        times = np.concatenate([[0.0], times])
        frames = np.concatenate([solution.initial[:1], frames])
    curve = Interpolant(solution.model, times, frames)
    return np.asarray(curve(np.minimum(problem.times, times[-1])))
