"""A solve as a sequence of passes of the core's solver, which somebody else runs.

`passes` is a generator: it yields what the core is to solve next and is sent what came of it. One
problem is driven by `solve`; of many, `solve_batch` drives all at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.finite import check_start
from trajopt.guess import first_guess
from trajopt.methods import CoreResult
from trajopt.records import IterationRecord
from trajopt.refinement import interval_errors, refine_until
from trajopt.result import build_solution
from trajopt.settings import Settings, Task, resample
from trajopt.solution import Solution
from trajopt.status import Status
from trajopt.transcription import Stage, Transcription

__all__ = ["Pass", "Passes", "drive", "passes"]

FloatArray = NDArray[np.float64]

UNMET = 0.2  # share of its cost at rest above which a task counts as not done


@dataclass
class _Run:
    """State of a solve shared by its passes."""

    transcription: Transcription
    callback: Callable[[IterationRecord], object] | None
    stopped: Callable[[], bool]
    settings: Settings
    seed: int
    history: list[IterationRecord] = field(default_factory=list)
    iterations: int = 0
    started: float = field(default_factory=time.perf_counter)
    stage_index: int = 0
    stage: Stage = field(default_factory=Stage)
    ordering: str = "auto"  # once a pass has begun: the one that the core took

    def record(self, values: dict[str, Any], elapsed: float, snapshot: Any) -> IterationRecord:
        """The core's record as ours, numbered through; it joins the history."""
        names = self.transcription.term_names
        self.ordering = values["ordering"]
        record = IterationRecord(
            iteration=self.iterations + values["iteration"] + 1,
            stage=self.stage_index,
            objective=values["objective"],
            objective_terms=dict(zip(names, values["terms"], strict=True)),
            constraint_violation=values["constraint_violation"] * self.transcription.scales.force,
            frame_violation=values["frame_violation"],
            merit_penalty=values["penalty"],
            radius=values["radius"],
            damping=values["damping"],
            step_norm=values["step_norm"],
            accepted=values["accepted"],
            seconds=values["seconds"],
            elapsed=elapsed,
            snapshot=snapshot,
        )
        self.history.append(replace(record, snapshot=None))
        return record

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
            device=self.settings.device,
            settings={"method": self.settings.method, "stage": self.stage_index},
        )


@dataclass
class Pass:
    """One call of the core's solver.

    Attributes
    ----------
    core, state : _core.TrajectoryProblem, array
        What to solve and where to start.
    max_iterations : int
    last : bool
        Whether to finish to the constraint tolerance.
    """

    core: Any
    state: FloatArray
    max_iterations: int
    last: bool
    run: _Run
    began: float = field(default_factory=time.perf_counter)

    @property
    def watched(self) -> bool:
        """Whether somebody wants to see every iteration while it happens."""
        return self.run.callback is not None

    def observe(self, values: dict[str, Any], state: Callable[[], FloatArray]) -> bool:
        """Note a record of the core's and show it to the callback; False: stop."""
        run = self.run

        def snapshot() -> Solution:
            return run.solution(self.core, state(), Status.INTERRUPTED, "checkpoint", run.stage)

        record = run.record(values, time.perf_counter() - run.started, snapshot)
        try:
            stop = run.callback(record) if run.callback is not None else False
        except KeyboardInterrupt:
            stop = True
        return stop is not True and not run.stopped()

    def note(self, records: list[dict[str, Any]]) -> None:
        """Add the core's records of a pass that nobody watched."""
        offset = self.began - self.run.started
        for values in records:
            self.run.record(values, offset + values["elapsed"], None)


Passes = Generator[Pass, CoreResult, Solution]


def passes(
    task: Task,
    settings: Settings,
    callback: Callable[[IterationRecord], object] | None,
    stopped: Callable[[], bool],
    threads: int,
) -> Passes:
    """Solve a task; yields the passes of the core's solver.

    Parameters
    ----------
    task : Task
    settings : Settings
    callback : callable or None
        As of `solve`.
    stopped : callable
        Whether the solve is to end with the motion at hand.
    threads : int
        Of the core's problems.
    """
    run = _Run(Transcription(task.problem, threads), callback, stopped, settings, task.seed)
    solution = yield from _stages(run, task.passes, task.guess, settings.max_iterations)
    if settings.refine is not None:
        solution = yield from _refine(run, solution, settings.refine)
    return solution


def drive(run: Passes, answer: Callable[[Pass], CoreResult]) -> Solution:
    """Run the passes of one solve, one after the other."""
    request = next(run)
    while True:
        try:
            request = run.send(answer(request))
        except StopIteration as end:
            solution: Solution = end.value
            return solution


def _stages(
    run: _Run, todo: list[tuple[int, Stage]], guess: FloatArray | None, limit: int
) -> Passes:
    """Solve stage by stage, each from the motion of the one before."""
    transcription, noise = run.transcription, run.settings.noise
    for index, stage in todo:
        run.stage_index, run.stage = index, stage
        initial = transcription.initial_frames(stage)
        core = transcription.core_problem(stage, initial)
        if guess is None:
            frames = first_guess(run.settings, transcription.problem, transcription.still(initial))
            state = core.state_from_frames(transcription.to_core(frames))
            rng = np.random.default_rng(run.seed)
            state = _perturb(transcription, core, state, transcription.noise(rng, noise))
        else:
            state = core.state_from_frames(transcription.to_core(guess))
        if index == todo[0][0]:
            check_start(transcription, core, state, stage, initial)
        last = index == todo[-1][0]
        budget = limit - len(run.history)
        if stage.iterations is not None and not last:
            budget = min(budget, stage.iterations)
        found = yield Pass(core, state, max(budget, 1), last, run)
        state, run.ordering = found.state, found.ordering
        run.iterations += found.iterations
        status = Status(found.status)
        if last or status in (Status.INTERRUPTED, Status.NUMERICAL_FAILURE):
            break
        guess = transcription.to_si(core.evaluate(state)["frames"])[2:]
        if len(run.history) >= limit:
            break
    message = found.message
    if status is Status.SOLVED:
        message += unmet_tasks(transcription, core, state, stage)
    return run.solution(core, state, status, message, stage)


def unmet_tasks(transcription: Transcription, core: Any, state: FloatArray, stage: Stage) -> str:
    """Return what to add to the message of a solve that ended with its tasks largely undone."""
    values = dict(zip(transcription.term_names, core.evaluate(state)["terms"], strict=True))
    shares = [
        f"{label} still costs {100 * share:.0f} % of what it costs at rest"
        for label, weight in transcription.task_weights(stage).items()
        if (share := values.get(label, 0.0) / weight) > UNMET
    ]
    if not shares:
        return ""
    return (
        f"; {', '.join(shares)}: perhaps a poor local minimum, which another seed or guess avoids"
    )


def _refine(run: _Run, solution: Solution, tolerance: float) -> Passes:
    """Halve the steps where the residual between frames is large, and solve again."""
    best = solution
    if solution.status is not Status.SOLVED:
        return best

    def solve_on(steps: FloatArray) -> Generator[Pass, CoreResult, bool]:
        nonlocal best
        run.transcription = run.transcription.on_grid(steps)
        guess = resample(run.transcription.problem, best, "refine")
        last = [(run.stage_index, run.stage)]
        limit = max(run.settings.max_iterations, len(run.history) + 1)
        found = yield from _stages(run, last, guess, limit)
        if found.status is not Status.SOLVED:
            best.message += (
                f"; refined to {len(steps)} frames it ended as {found.status}, and was dropped"
            )
            return False
        best = found
        return True

    yield from refine_until(
        lambda: interval_errors(best, best.fine_violation, best.body_weight),
        solve_on,
        run.transcription.problem.steps,
        tolerance,
        run.settings.max_refinements,
    )
    return best


def _perturb(
    transcription: Transcription, core: Any, state: FloatArray, noise: FloatArray
) -> FloatArray:
    if transcription.problem.formulation == "frames":
        return np.asarray(core.retract(state, noise.ravel()))
    per = transcription.problem.frames_per_knot
    knots = noise[per - 1 :: per]
    step = np.concatenate([knots, np.zeros_like(knots)], axis=1)
    return np.asarray(core.retract(state, step.ravel()))
