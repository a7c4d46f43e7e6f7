"""The options of a solve, checked before any work starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import choice, non_negative, positive, whole
from trajopt.devices import check_threads, choose_device
from trajopt.errors import ArgumentError, ArgumentTypeError, DeviceError
from trajopt.guess import asked_velocity
from trajopt.methods import METHODS, paper_problem
from trajopt.status import Status
from trajopt.transcription import Stage, term_labels

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.solution import Solution

__all__ = ["Settings", "Task", "check_factors", "make_settings", "make_task"]

FloatArray = NDArray[np.float64]

MAX_ITERATIONS = 1000
GUESSES = ("auto", "still", "gliding")
ORDERINGS = ("auto", "frontal", "sequential", "cyclic", "chunked")


@dataclass(frozen=True)
class Settings:
    """Options of `trajopt.solve` that do not depend on the problem."""

    method: str
    device: str
    max_iterations: int
    tolerance: float
    constraint_tolerance: float
    noise: float
    guess: str
    stages: tuple[Stage, ...] | None
    ordering: str
    refine: float | None
    max_refinements: int

    @property
    def core_options(self) -> dict[str, Any]:
        """What every pass of the core's solver is told."""
        return {
            "constraint_tolerance": self.constraint_tolerance,
            "objective_tolerance": self.tolerance,
            "ordering": self.ordering,
        }


@dataclass(frozen=True)
class Task:
    """One problem with what is particular to its solve."""

    problem: Problem
    passes: list[tuple[int, Stage]]
    guess: FloatArray | None
    seed: int


def make_settings(
    owner: str,
    *,
    method: str,
    device: str,
    threads: int | None,
    max_iterations: int | None,
    tolerance: float,
    constraint_tolerance: float,
    noise: float,
    guess: str,
    stages: Sequence[Stage] | None,
    ordering: str,
    refine: float | None,
    max_refinements: int,
) -> Settings:
    """Check options; `owner` is the function that errors name. `threads` is checked only.

    Raises
    ------
    ArgumentError, ArgumentTypeError, DeviceError
        The first option that cannot be used.
    """
    choice(owner, "method", method, METHODS)
    choice(owner, "ordering", ordering, ORDERINGS)
    if threads is not None:
        whole(owner, "threads", threads, 1)
    check_threads(owner, device, threads)
    # A GPU only when it is asked for.
    device = "cpu" if device == "auto" else choose_device(device)
    if device == "cuda" and method != "default":
        raise DeviceError(f"{owner}: method {method!r} runs on the CPU only, not on device 'cuda'")
    if max_iterations is not None:
        whole(owner, "max_iterations", max_iterations, 1)
    whole(owner, "max_refinements", max_refinements, 0)
    positive(owner, "tolerance", tolerance)
    positive(owner, "constraint_tolerance", constraint_tolerance)
    non_negative(owner, "noise", noise)
    choice(owner, "guess", guess, GUESSES)
    if refine is not None:
        positive(owner, "refine", refine)
    if stages is not None and not (
        isinstance(stages, Sequence) and stages and all(isinstance(s, Stage) for s in stages)
    ):
        raise ArgumentTypeError(f"{owner}: stages must be a list of Stage, not {stages!r}")
    return Settings(
        method=method,
        device=device,
        max_iterations=MAX_ITERATIONS if max_iterations is None else max_iterations,
        tolerance=tolerance,
        constraint_tolerance=constraint_tolerance,
        noise=noise,
        guess=guess,
        stages=None if stages is None else tuple(stages),
        ordering=ordering,
        refine=refine,
        max_refinements=max_refinements,
    )


def make_task(
    owner: str,
    settings: Settings,
    problem: Problem,
    warm_start: Solution | None,
    seed: int,
    index: str = "",
) -> Task:
    """Check a problem and its start; `index` is what follows an argument's name: "[3]" of many.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        What cannot be used.
    """
    from trajopt.problem import Problem
    from trajopt.solution import Solution

    what = f"problems{index}" if index else "problem"
    if not isinstance(problem, Problem):
        raise ArgumentTypeError(f"{owner}: {what} must be a Problem, not {type(problem).__name__}")
    if warm_start is not None and not isinstance(warm_start, Solution):
        raise ArgumentTypeError(
            f"{owner}: warm_start{index} must be a Solution, not {type(warm_start).__name__}"
        )
    whole(owner, f"seed{index}", seed, 0)
    if not any(getattr(term, "weight", 1.0) > 0 for term in problem.terms):
        name = f"{owner}: {what}" if index else "Problem"
        raise ArgumentError(f"{name}: no objective term with a weight > 0; add one with add()")
    if settings.method == "paper":
        problem = paper_problem(problem)
    if settings.refine is not None and (problem.formulation != "frames" or problem.periodic):
        kind = "periodic" if problem.periodic else problem.formulation
        where = f"{what}: " if index else ""
        raise ArgumentError(
            f"{owner}: {where}refine needs frames that are not periodic, not {kind}"
        )
    _check_ordering(f"{owner}: {what}: " if index else f"{owner}: ", settings, problem)
    if settings.guess == "gliding" and warm_start is None and asked_velocity(problem) is None:
        raise ArgumentError(
            f"{owner}: {f'{what}: ' if index else ''}guess = 'gliding' needs a "
            "CenterOfMassVelocity with a weight > 0 and a model whose base can slide"
        )
    stages = settings.stages or METHODS[settings.method].stages
    check_factors(f"{owner}: {what}: " if index else f"{owner}: ", problem, stages)
    passes = list(enumerate(stages))
    if problem.contact is None and settings.stages is None:
        passes = passes[-1:]  # nothing that could grow stiffer
    if warm_start is not None:
        passes = _remaining(passes, warm_start)
    guess = None
    if warm_start is not None:
        guess = resample(problem, warm_start, f"{owner}: warm_start{index}")
    return Task(problem, passes, guess, seed)


def _check_ordering(where: str, settings: Settings, problem: Problem) -> None:
    if settings.ordering != "frontal":
        return
    found = []
    if settings.device != "cpu":
        found.append(f"device {settings.device!r}")
    if settings.method != "default":
        found.append(f"method {settings.method!r}")
    if problem.formulation != "frames":
        found.append(f"formulation {problem.formulation!r}")
    if problem.periodic:
        found.append("periodic=True")
    if found:
        raise ArgumentError(
            f"{where}ordering 'frontal' is for the default method on the CPU and frames that are "
            f"not periodic, not for {', '.join(found)}"
        )


def check_factors(where: str, problem: Problem, stages: Sequence[Stage]) -> None:
    """Find misspelt terms of a later stage before the earlier ones are solved.

    Parameters
    ----------
    where : str
        What the message begins with.
    problem : Problem
    stages : sequence of Stage

    Raises
    ------
    ArgumentError
        Names stage and term.
    """
    labels = term_labels(problem)
    for number, stage in enumerate(stages):
        for name in stage.factors:
            if name not in labels:
                raise ArgumentError(
                    f"{where}stages[{number}]: factors names {name!r}, which is no term of the "
                    f"objective; its terms: {', '.join(labels)}"
                )


def _remaining(passes: list[tuple[int, Stage]], warm_start: Solution) -> list[tuple[int, Stage]]:
    """Stages still to do: those from an unfinished solve's stage on, else the last."""
    stage = warm_start.settings.get("stage")
    if warm_start.status is not Status.SOLVED and isinstance(stage, int):
        return passes[min(stage, len(passes) - 1) :]
    return passes[-1:]


def resample(problem: Problem, solution: Solution, name: str) -> FloatArray:
    """Frames (N, D) of another solution's motion at the times of this problem."""
    from trajopt.interpolation import Interpolant

    if solution.model.ndof != problem.model.ndof:
        raise ArgumentTypeError(
            f"{name} moves {solution.model.ndof} degrees of freedom, "
            f"the problem has {problem.model.ndof}"
        )
    pairs = zip(solution.model.dof_names, problem.model.dof_names, strict=True)
    for number, (theirs, ours) in enumerate(pairs):
        if theirs != ours:
            raise ArgumentError(
                f"{name} moves another robot: its degree of freedom {number} is "
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
