"""A start that is on its way already.

From rest, the shortest step towards a velocity moves the middle of a long motion nowhere, its end
far forward and its beginning far back, in the time that no term counts. A start that glides has no
such way to go.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from trajopt.transcription import leading_slides

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.settings import Settings

__all__ = ["asked_velocity", "first_guess", "gliding"]

FloatArray = NDArray[np.float64]

# Walks of 14 lengths are found from rest, and slightly better ones; those of 18 are not any more.
LONG_WAY = 15.0


def first_guess(settings: Settings, problem: Problem, still: FloatArray) -> FloatArray:
    """Return the frames (N, D) that a solve starts from, made of those at rest."""
    asked = asked_velocity(problem)
    if settings.guess == "still" or asked is None:
        return still
    velocity, start = asked
    way = float(np.linalg.norm(velocity)) * max(problem.duration - start, 0.0)
    long = way > LONG_WAY * problem.model.length and settings.method == "default"
    return gliding(problem, still) if settings.guess == "gliding" or long else still


def asked_velocity(problem: Problem) -> tuple[FloatArray, float] | None:
    """Velocity (3,) [m/s] that the objective asks for, and the time [s] from which on.

    That of the heaviest `CenterOfMassVelocity`, without its vertical part and without components
    that do not count; None where there is no such term or no base that could slide.
    """
    from trajopt.objectives import CenterOfMassVelocity

    terms = [t for t in problem.terms if isinstance(t, CenterOfMassVelocity) and t.weight > 0]
    if not terms or not leading_slides(problem.model):
        return None
    term = max(terms, key=lambda t: t.weight)
    velocity = np.where(np.asarray(term.axes) != 0, np.asarray(term.velocity, dtype=np.float64), 0)
    if problem.gravity > 0:
        down = np.asarray(problem.world.gravity) / problem.gravity
        velocity = velocity - (velocity @ down) * down
    return velocity, term.start


def gliding(problem: Problem, still: FloatArray) -> FloatArray:
    """Frames (N, D) that glide as the objective asks, gathering speed until it counts.

    Parameters
    ----------
    problem : Problem
    still : (N, D) array
        The same at rest. A periodic motion keeps the stride that these have.
    """
    asked = asked_velocity(problem)
    frames = still.copy()
    if asked is None or problem.periodic:
        return frames
    (velocity, start), t, slides = asked, problem.times, leading_slides(problem.model)
    way = np.where(t < start, 0.5 * t**2 / max(start, 1e-12), t - 0.5 * start)
    frames[:, :slides] += way[:, None] * velocity[:slides]
    return frames
