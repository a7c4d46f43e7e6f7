"""From a `Problem` to the core's problem in scaled units, for one stage of a solve, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from trajopt import _core
from trajopt.checks import non_negative, positive, whole
from trajopt.errors import ArgumentTypeError
from trajopt.kinematics import SLIDE, ball_slices
from trajopt.physics import make_physics
from trajopt.rotations import unwrap
from trajopt.scaling import Scales
from trajopt.settle import free_bases, ground_gap, lower, settle, warn_of_gap, warn_of_unrest
from trajopt.terms import TermBuilder

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.problem import Problem
    from trajopt.traced import TracedResidual
    from trajopt.world import ResolvedContact

__all__ = ["Stage", "Transcription", "term_labels"]

FloatArray = NDArray[np.float64]

UNREACHED = 1e-9  # a task that costs less on the guess is met already: nothing to normalize by


@dataclass(frozen=True)
class Stage:
    """One pass of a solve: how much of the contact law's stiffness is switched on.

    Parameters
    ----------
    stiffness, friction : float
        Fractions of the final normal stiffness, and of the final ratio of friction to stiffness.
    iterations : int or None
        Limit of this pass; None is the solver's.
    factors : dict of str to float
        Factors of objective terms in this pass, by their names in ``Solution.objective_terms``; 0
        leaves a term out.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If a fraction is not a number > 0, a factor not a number >= 0, or the limit not a whole
        number.

    Examples
    --------
    >>> Stage(stiffness=0.1, iterations=100, factors={"contact_impact": 0.0}).friction
    1.0
    """

    stiffness: float = 1.0
    friction: float = 1.0
    iterations: int | None = None
    factors: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        positive("Stage", "stiffness", self.stiffness)
        positive("Stage", "friction", self.friction)
        if self.iterations is not None:
            whole("Stage", "iterations", self.iterations, 1)
        if not isinstance(self.factors, Mapping):
            raise ArgumentTypeError(
                f"Stage: factors must be a dict of term names and numbers, not {self.factors!r}"
            )
        for name, value in self.factors.items():
            non_negative("Stage", f"factors[{name!r}]", value)


class Transcription:
    """Scaled core problems of one `Problem`; D degrees of freedom, N frames.

    Parameters
    ----------
    problem : Problem
    threads : int
    """

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        self.problem = problem
        self.threads = threads
        self.scales = Scales.of(problem.model, problem.gravity)
        self.core = _core.Model(
            **problem.model.core_arguments(self.scales.mass, self.scales.length)
        )
        self.contact: ResolvedContact | None = (
            None
            if problem.contact is None
            else problem.contact.resolved(problem.model, problem.gravity)
        )
        self.factors: dict[str, float] | None = None  # of the tasks, once normalized
        self._place: FloatArray | None = None
        self.residuals: dict[str, TracedResidual] = {}  # of the user, by label
        self.settle_residual = 0.0

    def on_grid(self, steps: FloatArray) -> Transcription:
        """Return the same with other time steps [s]; terms keep the factors they have."""
        other = Transcription(self.problem.with_steps(steps), self.threads)
        other.factors = None if self.factors is None else dict(self.factors)
        other._place = self._place
        return other

    # ---- contact and start -----------------------------------------------------------------------

    def staged_contact(self, stage: Stage) -> ResolvedContact | None:
        """Contact law of a stage, SI."""
        if self.contact is None:
            return None
        normal = self.contact.normal * stage.stiffness
        ratio = self.contact.friction / self.contact.normal if self.contact.normal > 0 else 0.0
        return replace(
            self.contact,
            normal=normal,
            friction=normal * ratio * stage.friction,
            slip_velocity=self.contact.slip_velocity / stage.friction,
        )

    def physics(self, stage: Stage) -> Any:
        """`_core.Physics` of a stage."""
        return make_physics(
            self.problem.world,
            self.staged_contact(stage),
            self.problem.integrator,
            self.scales,
            self.problem.internal,
        )

    def initial_frames(self, stage: Stage) -> FloatArray:
        """Frames -1 and 0 of a stage in SI (2, D): settled, or placed in the air."""
        problem, model = self.problem, self.problem.model
        pose = np.array(problem.initial.pose)
        free = np.flatnonzero(~model.actuated)
        physics = self.physics(stage)
        gap = ground_gap(model, problem.world, pose)
        bases = list(free_bases(model))
        first = self._place is None
        if problem.initial.height is not None and gap is not None:
            pose[bases] += problem.initial.height - gap
        elif self.contact is not None and gap is not None and not bases:
            if first:
                warn_of_gap(model, gap, movable=False)
                self._place = pose
        elif self.contact is not None and gap is not None:
            if self._place is None:
                warn_of_gap(model, gap)
                weight = self.scales.force / max(len(model.support_points), 1)
                contact = self.staged_contact(stage)
                stiffness = contact.normal if contact is not None else 0.0
                sink = np.sqrt(weight / stiffness) if stiffness > 0 else 0.0
                pose = lower(model, problem.world, pose, min(sink, 0.2 * model.length))
            else:
                pose = self._place
            scaled, self.settle_residual = settle(
                self.core, physics, free, pose / self.scales.coordinate
            )
            pose = scaled * self.scales.coordinate
            self._place = pose
            if first:
                warn_of_unrest(self.settle_residual)
        before = pose
        if np.any(problem.initial.velocity):
            # x_{-1} = x_0 - h v + h^2/2 a would need the unknown start acceleration; first order.
            before = model.integrate(pose, -problem.steps[0] * problem.initial.velocity)
        return np.stack([before, pose])

    # ---- objective -------------------------------------------------------------------------------

    def _builder(
        self, initial: FloatArray, stage: Stage, counts: FloatArray | float = 1.0
    ) -> TermBuilder:
        problem, labels = self.problem, term_labels(self.problem)
        builder = TermBuilder(
            problem.model, self.core, self.scales, problem.times, problem.steps, initial
        )
        for label, term in zip(labels, problem.terms, strict=True):
            factor = (self.factors or {}).get(label, 1.0)
            builder.start(label, factor * stage.factors.get(label, 1.0), counts)
            term.emit(builder)
        self.residuals = builder.residuals
        return builder

    def normalize(self, initial: FloatArray) -> None:
        """Scale every task so that it costs its weight on the initial guess (Pan section 8)."""
        if self.factors is not None:
            return
        self.factors = {}
        guess = self.still(initial)
        core = self._core_problem(Stage(), initial, self._builder(initial[1], Stage()).objective)
        values = dict(zip(*self._term_values(core, guess), strict=True))
        tasks = {
            label: term
            for label, term in zip(term_labels(self.problem), self.problem.terms, strict=True)
            if term.task
        }
        for label, term in tasks.items():
            cost = values.get(label, 0.0)
            reached = not UNREACHED < cost < np.inf  # what is not finite is for check_start to name
            self.factors[label] = 1.0 if reached else term.weight / cost  # type: ignore[attr-defined]

    def task_weights(self, stage: Stage) -> dict[str, float]:
        """What the tasks cost at rest, where they were scaled to cost it, in a stage."""
        factors = self.factors or {}
        return {
            label: term.weight * stage.factors.get(label, 1.0)  # type: ignore[attr-defined]
            for label, term in zip(term_labels(self.problem), self.problem.terms, strict=True)
            if factors.get(label, 1.0) != 1.0 and stage.factors.get(label, 1.0) > 0
        }

    def _term_values(self, core: Any, guess: FloatArray) -> tuple[list[str], list[float]]:
        state = core.state_from_frames(self.to_core(guess))
        return self.term_names, list(core.evaluate(state)["terms"])

    # ---- core problem ----------------------------------------------------------------------------

    def core_problem(self, stage: Stage, initial: FloatArray) -> Any:
        """`_core.TrajectoryProblem` of a stage; `initial` holds frames -1 and 0 in SI."""
        self.normalize(initial)
        return self._core_problem(stage, initial, self._builder(initial[1], stage).objective)

    def counting(self, stage: Stage, initial: FloatArray, counts: FloatArray) -> Any:
        """Return the same with a factor for every frame's share of the objective."""
        builder = self._builder(initial[1], stage, counts)
        return self._core_problem(stage, initial, builder.objective)

    def _core_problem(self, stage: Stage, initial: FloatArray, objective: Any) -> Any:
        problem = self.problem
        self.term_names: list[str] = objective.names()
        steps = np.concatenate([[problem.steps[0]], problem.steps]) / self.scales.time
        segment = problem.frames_per_knot * steps[1]
        velocity = problem.initial.velocity * self.scales.time / self.scales.coordinate
        return _core.TrajectoryProblem(
            model=self.core,
            physics=self.physics(stage),
            dt=steps,
            objective=objective,
            initial=self.to_core(initial),
            velocity=velocity * segment,
            formulation=problem.formulation,
            frames_per_knot=problem.frames_per_knot,
            periodic=problem.periodic,
            stride=tuple(problem.stride / self.scales.length),
            threads=self.threads,
        )

    def still(self, initial: FloatArray) -> FloatArray:
        """Frames 1..N [m, rad] that rest in frame 0; a gait with a stride glides by it."""
        problem = self.problem
        frames = np.tile(initial[1], (problem.frames, 1))
        if problem.periodic:
            moved = leading_slides(problem.model)
            share = problem.times[:, None] / problem.duration
            frames[:, :moved] += share * problem.stride[:moved]
        return frames

    def noise(self, rng: np.random.Generator, amplitude: float) -> FloatArray:
        """Smooth random motion (N, D), scaled: leaves the symmetric saddle a settled start is."""
        problem = self.problem
        knots = max(problem.frames // 10, 4)
        values = rng.normal(scale=amplitude, size=(knots + 1, problem.model.ndof))
        curve = CubicSpline(np.linspace(0, problem.duration, knots + 1), values)
        return np.asarray(curve(problem.times))

    def to_core(self, x: FloatArray) -> FloatArray:
        """SI coordinates (n, D) to the core's configurations (n, nq)."""
        return np.asarray(_core.configuration_from_vector(self.core, x / self.scales.coordinate))

    def to_si(self, q: FloatArray) -> FloatArray:
        """The core's configurations (n, nq) to SI coordinates (n, D), continuous over frames."""
        x = np.asarray(_core.configuration_to_vector(self.core, q)) * self.scales.coordinate
        for where in ball_slices(self.problem.model):
            x[:, where] = unwrap(x[:, where])
        return x


def leading_slides(model: Model) -> int:
    """Return how many of the first three coordinates are slides: those a stride moves."""
    count = 0
    while count < min(3, len(model.joint_type)) and model.joint_type[count] == SLIDE:
        count += 1
    return count


def term_labels(problem: Problem) -> list[str]:
    """Return the names of a problem's terms, as in ``Solution.objective_terms``."""
    counts: dict[str, int] = {}
    labels = []
    for term in problem.terms:
        label = getattr(term, "name", _snake_case(type(term).__name__))
        counts[label] = counts.get(label, 0) + 1
        labels.append(f"{label} {counts[label]}" if counts[label] > 1 else label)
    return labels


@cache
def _snake_case(name: str) -> str:
    return "".join(("_" if c.isupper() and i else "") + c.lower() for i, c in enumerate(name))
