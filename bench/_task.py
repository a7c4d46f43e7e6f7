"""How well a motion does what it was asked: speed, places at given times, flights.

Definitions
-----------
Speed error: |v − v*| / |v*| with v the mean velocity of the center of mass over the time that
counts, along the axes that count.

Place error: horizontal distance between the center of mass and its target at the target's time,
over the length of one jump: the horizontal distance between two targets of the same term, or the
height of the apex where the jump stays in place. Targets of height alone do not count. Root mean
square over all targets.

Apex: a target is one when it lies at least half as high above the start as the highest target.
Flight: no more than 1 % of the body weight on all contact points together, at the frame nearest to
the apex's time and at its two neighbours. Height: that of the center of mass at its highest point
in this flight (at the target's time where there is no flight), counted from the start; its error is
relative to the target's height above the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt import Problem, Solution
from trajopt.audit import ContactState
from trajopt.audit.contacts import BREAK_SHARE
from trajopt.objectives import CenterOfMassPosition, CenterOfMassVelocity

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Target:
    """Where the center of mass is to be, and when."""

    time: float
    place: FloatArray  # [m]
    counts: NDArray[np.bool_]  # axes


@dataclass(frozen=True)
class Apex:
    """What became of one apex target."""

    time: float
    target: float  # height above the start [m]
    height: float  # reached
    flight: tuple[float, float] | None  # the flight around the target's time [s]

    @property
    def error(self) -> float:
        """Relative error of the height."""
        return abs(self.height - self.target) / self.target


def start_of(solution: Solution) -> FloatArray:
    """Center of mass of frame 0 (3,) [m]."""
    return np.asarray(solution.model.center_of_mass(solution.initial[0]))


def path_of(solution: Solution) -> FloatArray:
    """Center of mass of frames 0 to N (N + 1, 3) [m]."""
    return np.concatenate([start_of(solution)[None], solution.center_of_mass])


def times_of(solution: Solution) -> FloatArray:
    """Times of frames 0 to N [s]."""
    first = float(np.ravel(solution.dt)[0])
    return np.concatenate([[solution.times[0] - first], solution.times])


def speed_error(problem: Problem, solution: Solution) -> float | None:
    """Relative error of the mean velocity; None where no velocity is asked for."""
    terms = [term for term in problem.terms if isinstance(term, CenterOfMassVelocity)]
    if not terms:
        return None
    times, path = times_of(solution), path_of(solution)
    errors = []
    for term in terms:
        first = int(np.argmax(solution.times >= term.start))  # frame first + 1 is the first counted
        mean = (path[-1] - path[first]) / (times[-1] - times[first])
        wanted, counts = np.asarray(term.velocity), np.asarray(term.axes) > 0
        scale = np.linalg.norm(wanted[counts])
        errors.append(np.linalg.norm((mean - wanted)[counts]) / scale)
    return float(max(errors))


def targets(problem: Problem, solution: Solution) -> list[list[Target]]:
    """Targets of every position term, in the order of time."""
    start = start_of(solution)
    found = []
    for term in problem.terms:
        if not isinstance(term, CenterOfMassPosition):
            continue
        times = problem.times if term.time is None else np.atleast_1d(np.asarray(term.time))
        places = np.broadcast_to(np.asarray(term.position, dtype=float), (len(times), 3))
        counts = np.asarray(term.axes) > 0
        offset = start if term.relative else np.zeros(3)
        found.append(
            [Target(float(t), p + offset, counts) for t, p in zip(times, places, strict=True)]
        )
    return found


def place_errors(problem: Problem, solution: Solution) -> FloatArray | None:
    """Horizontal error at every target over the length of a jump; None without targets."""
    groups = [[t for t in g if t.counts[:2].any()] for g in targets(problem, solution)]
    if not any(groups):
        return None
    start = start_of(solution)
    height = max(
        (t.place[2] - start[2] for g in targets(problem, solution) for t in g if t.counts[2]),
        default=0.0,
    )
    errors = []
    for group in groups:
        steps = np.diff([t.place[:2] for t in group], axis=0)
        jump = float(np.max(np.linalg.norm(steps, axis=1), initial=0.0)) if len(steps) else 0.0
        scale = jump if jump > 1e-6 else height if height > 0.0 else float(solution.model.length)
        for target in group:
            error = (_at(solution, target.time) - target.place)[:2][target.counts[:2]]
            errors.append(np.linalg.norm(error) / scale)
    return np.asarray(errors)


def apexes(problem: Problem, solution: Solution, state: ContactState) -> list[Apex]:
    """What became of every target in the air."""
    start = start_of(solution)[2]
    everything = [t for group in targets(problem, solution) for t in group if t.counts[2]]
    highest = max((t.place[2] - start for t in everything), default=0.0)
    if highest <= 0.0:
        return []
    free = np.sum(state.normal_force, axis=1) < BREAK_SHARE * state.body_weight
    found = []
    for target in everything:
        wanted = float(target.place[2] - start)
        if wanted < 0.5 * highest:
            continue
        middle = int(np.argmin(np.abs(state.times - target.time)))
        flight, height = None, _at(solution, target.time)[2] - start
        if np.all(free[max(middle - 1, 0) : middle + 2]):
            first, last = _run_around(free, middle)
            flight = (float(state.times[first]), float(state.times[last]))
            height = np.max(path_of(solution)[first : last + 1, 2]) - start
        found.append(Apex(target.time, wanted, float(height), flight))
    return sorted(found, key=lambda apex: apex.time)


def _run_around(free: NDArray[np.bool_], middle: int) -> tuple[int, int]:
    """First and last index of the run of True around `middle`."""
    before = np.flatnonzero(~free[:middle])
    after = np.flatnonzero(~free[middle:])
    first = int(before[-1]) + 1 if len(before) else 0
    last = middle + int(after[0]) - 1 if len(after) else len(free) - 1
    return first, last


def _at(solution: Solution, time: float) -> FloatArray:
    """Center of mass at a time, linear between frames."""
    times, path = times_of(solution), path_of(solution)
    return np.array([np.interp(time, times, path[:, k]) for k in range(3)])


def iterations_to(history: list[Any], share: float = 0.01) -> int:
    """Iterations until the objective stays within `share` of the final one.

    Counted over all stages; only the last stage can get there, since the ground of the others is
    softer and their objective that of another problem.
    """
    final, stage = history[-1].objective, history[-1].stage
    settled = int(history[-1].iteration)
    for record in reversed(history):
        if record.stage != stage or abs(record.objective - final) > share * abs(final):
            break
        settled = int(record.iteration)
    return settled


def feet(solution: Solution) -> list[str]:
    """Bodies the character stands on, if it has other bodies that can touch the ground, too."""
    model = solution.model
    touching = {model.body_names[k] for k in model.point_body}
    standing = {model.body_names[model.point_body[k]] for k in model.support_points}
    return sorted(standing) if standing != touching else []
