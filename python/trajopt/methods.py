"""The solvers of the core under their public names, with their stages and their numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from trajopt import _core
from trajopt.transcription import Stage

if TYPE_CHECKING:
    from trajopt.interrupt import InterruptFlag
    from trajopt.problem import Problem
    from trajopt.run import Pass
    from trajopt.settings import Settings

__all__ = ["METHODS", "CoreResult", "Method", "paper_problem", "run_core", "run_together"]


@dataclass(frozen=True)
class Method:
    """A solver and the stages it runs in by default.

    Parameters
    ----------
    stages : tuple of Stage
    """

    stages: tuple[Stage, ...]


METHODS = {
    # Soft ground first: contacts are felt from afar, so the optimizer finds where to step; the
    # last stage is the user's ground.
    "default": Method(
        (
            Stage(stiffness=1 / 50, friction=0.2, iterations=120),
            Stage(stiffness=1 / 7, friction=0.5, iterations=80),
            Stage(),
        )
    ),
    # Pan 8.1: w = 3e3, 1e4, 1e5, friction growing with stiffness.
    "paper": Method(
        (
            Stage(stiffness=0.03, iterations=2000),
            Stage(stiffness=0.1, iterations=1000),
            Stage(),
        )
    ),
}


def paper_problem(problem: Problem) -> Problem:
    """Return Pan's version of a problem: spline, implicit integrator, w_t = w_n, no damping."""
    other = problem.with_steps(problem.steps)
    other.formulation = "spline"
    other.integrator = "implicit"
    if problem.contact is not None:
        law = problem.contact.resolved(problem.model, problem.gravity)
        other.contact = replace(
            problem.contact, normal=law.normal, friction=law.normal, damping=0.0, model="smooth"
        )
    other._check_grid()
    return other


class CoreResult(NamedTuple):
    """What a pass of the core's solver ends with."""

    status: str
    message: str
    iterations: int
    state: Any
    ordering: str


def run_core(
    request: Pass, settings: Settings, stop: Any = None, interrupt: InterruptFlag | None = None
) -> CoreResult:
    """Run one pass of a core solver.

    With `stop`, a `_core.StopFlag`, the default solver returns to Python only to show an iteration
    to a callback; on a device the motion then stays there until somebody asks for it.
    """
    core, state, options = request.core, request.state, settings.core_options
    quiet = not request.watched or settings.device == "cuda"
    if stop is not None and quiet and settings.method == "default":
        (answer,) = run_together([request], settings, stop, interrupt)
        if isinstance(answer, Exception):
            raise answer
        return answer

    def observe(values: dict[str, Any], now: Any) -> bool:
        return request.observe(values, lambda: now)

    if settings.method == "paper":
        result = _core.solve_paper(
            core,
            state,
            observe,
            max_iterations=request.max_iterations,
            ordering=options["ordering"],
        )
    else:
        result = _core.solve_funnel(
            core,
            state,
            observe,
            max_iterations=request.max_iterations,
            restore=request.last,
            device=settings.device,
            **options,
        )
    return CoreResult(*result)


def run_together(
    requests: Sequence[Pass], settings: Settings, stop: Any, interrupt: InterruptFlag | None
) -> list[CoreResult | Exception]:
    """Run passes of the default solver at once; a problem's exception stands in its place.

    Parameters
    ----------
    requests : sequence of Pass
    settings : Settings
    stop : _core.StopFlag
        Once set, all passes end after the iteration at hand.
    interrupt : InterruptFlag or None
        Is looked at now and then, and sets `stop`; None on threads that get no signals.
    """

    def poll() -> None:
        if interrupt is not None and interrupt.raised:
            stop.set()

    answers = _core.solve_funnels(
        [request.core for request in requests],
        [request.state for request in requests],
        [request.observe if request.watched else None for request in requests],
        stop,
        None if interrupt is None else poll,
        max_iterations=[request.max_iterations for request in requests],
        restore=[request.last for request in requests],
        device=settings.device,
        **settings.core_options,
    )
    results: list[CoreResult | Exception] = []
    for request, answer in zip(requests, answers, strict=True):
        if isinstance(answer, Exception):
            results.append(answer)
            continue
        if isinstance(answer, BaseException):  # a callback that ends the program
            raise answer
        *result, records = answer
        request.note(records)
        results.append(CoreResult(*result))
    return results
