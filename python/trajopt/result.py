"""Packages the core's state as a `Solution` in SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.audit import fine_violation
from trajopt.errors import TrajoptError
from trajopt.solution import Solution
from trajopt.world import Contact

if TYPE_CHECKING:
    from trajopt.transcription import Stage, Transcription

__all__ = ["build_solution"]

FloatArray = NDArray[np.float64]


def build_solution(
    transcription: Transcription,
    core: Any,
    state: FloatArray,
    stage: Stage,
    **report: Any,
) -> Solution:
    """Return the motion of a core state with all that is reported of it.

    Parameters
    ----------
    transcription : Transcription
    core : _core.TrajectoryProblem
        Problem of the stage.
    state : array
        The core's state.
    stage : Stage
        Whose contact law the motion obeys.
    **report
        Further fields of `Solution`.
    """
    problem, scales = transcription.problem, transcription.scales
    model = problem.model
    evaluation = core.evaluate(state)
    x = transcription.to_si(evaluation["frames"])
    frames = x[2:]
    rows = scales.generalized_force[~model.actuated]
    violation = np.abs(evaluation["frame_constraint"]) * rows
    law = transcription.staged_contact(stage)
    points = model.contact_positions(x)
    forces = _contact_forces(transcription, stage, x, points)
    uniform = np.allclose(problem.steps, problem.steps[0], rtol=1e-12)
    solution = Solution(
        model=model,
        x=frames,
        times=problem.times,
        dt=float(problem.steps[0]) if uniform else problem.steps,
        initial=x[1::-1].copy(),
        world=problem.world,
        contact=None
        if law is None
        else Contact(law.normal, law.friction, law.damping, law.model, law.mu, law.slip_velocity),
        integrator=problem.integrator,
        u=evaluation["torque"] * scales.generalized_force[model.actuated],
        control_points=_control_points(transcription, x, state),
        contact_forces=forces[2:],
        contact_points=points[2:],
        center_of_mass=model.center_of_mass(frames),
        objective=float(evaluation["objective"]),
        objective_terms=dict(zip(transcription.term_names, evaluation["terms"], strict=True)),
        constraint_violation=float(evaluation["constraint_norm"]) * scales.force,
        frame_violation=violation.max(axis=1, initial=0.0),
        body_weight=scales.force,
        **report,
    )
    try:
        solution.fine_violation = fine_violation(solution)
    except TrajoptError:  # a motion cut off while wild may have no interpolant
        solution.fine_violation = np.full(4 * len(frames), np.nan)
    return solution


def _contact_forces(
    transcription: Transcription, stage: Stage, x: FloatArray, points: FloatArray
) -> FloatArray:
    """Forces (N + 2, P, 3) [N] with velocities by central differences of the frames."""
    steps = np.concatenate([transcription.problem.steps[:1], transcription.problem.steps])
    times = np.concatenate([[0.0], np.cumsum(steps)])
    velocity = np.gradient(points, times, axis=0) if points.size else points
    scales = transcription.scales
    return (
        np.asarray(
            transcription.core.contact_forces(
                x / scales.coordinate, velocity / scales.velocity, transcription.physics(stage)
            )
        )
        * scales.force
    )


def _control_points(transcription: Transcription, x: FloatArray, state: FloatArray) -> FloatArray:
    """Pose and velocity at the knots (Z, 2, D): every frames_per_knot frames.

    The spline's own where there is one; else velocities by central differences.
    """
    problem = transcription.problem
    per = problem.frames_per_knot
    knots = np.arange(per + 1, len(x), per)
    if len(knots) == 0:
        return np.zeros((0, 2, problem.model.ndof))
    if problem.formulation == "spline":
        scaled = state[-len(knots) * problem.model.ndof :].reshape(len(knots), -1)
        velocity = scaled * transcription.scales.coordinate / (per * problem.steps[0])
        return np.stack([x[knots], velocity], axis=1)
    before = problem.model.difference(x[knots - 1], x[knots])
    step = problem.steps[knots - 2][:, None]
    after_index = np.minimum(knots + 1, len(x) - 1)
    after = problem.model.difference(x[knots], x[after_index])
    span = np.where(after_index > knots, 2.0, 1.0)[:, None] * step
    return np.stack([x[knots], (before + after) / span], axis=1)
