"""The solvers of the core under their public names, with their stages and their numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from trajopt import _core
from trajopt.transcription import Stage

if TYPE_CHECKING:
    from trajopt.problem import Problem

__all__ = ["METHODS", "Method", "paper_problem", "run_core"]


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


def run_core(
    method: str,
    core: Any,
    state: Any,
    observer: Any,
    max_iterations: int,
    last: bool,
    options: dict[str, Any],
    device: str = "cpu",
) -> tuple[str, str, int, Any]:
    """Run a core solver for one stage; only the last one finishes to the constraint tolerance.

    Returns
    -------
    status, message, iterations, state
    """
    if method == "paper":
        result = _core.solve_paper(
            core, state, observer, max_iterations=max_iterations, ordering=options["ordering"]
        )
    else:
        result = _core.solve_funnel(
            core,
            state,
            observer,
            max_iterations=max_iterations,
            restore=last,
            device=device,
            **options,
        )
    status, message, count, final = result
    return str(status), str(message), int(count), final
