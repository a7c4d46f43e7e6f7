"""Every figure that is promised of a scenario, with what it must be and what it aims at."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from _task import apexes, feet, iterations_to, place_errors, speed_error

from trajopt import Problem, Solution
from trajopt.audit import audit, contact_state, count_changes
from trajopt.simulate import SimulationError

CHANGES_PER_SECOND = 4 / 10  # every foot makes and breaks contact four times in 10 s


@dataclass(frozen=True)
class Figure:
    """One number, and its limits where something was promised.

    Parameters
    ----------
    title : str
    value : float or None
        None where it could not be evaluated.
    unit : str
        "yes" for a figure that is 1 or 0.
    must, aim : float or None
        Limits: upper ones, lower ones if `at_least`.
    at_least : bool
    note : str
        Details for the reader.
    """

    title: str
    value: float | None
    unit: str = ""
    must: float | None = None
    aim: float | None = None
    at_least: bool = False
    note: str = ""

    @property
    def verdict(self) -> str:
        """``aim``, ``must``, ``missed``, or empty where nothing was promised."""
        return verdict(asdict(self))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, with the verdict."""
        return {**asdict(self), "verdict": self.verdict}


def verdict(figure: dict[str, Any]) -> str:
    """Verdict on a figure as plain values."""

    def within(limit: float) -> bool:
        value = figure["value"]
        if value is None or not math.isfinite(value):
            return False
        return bool(value >= limit if figure["at_least"] else value <= limit)

    if figure["aim"] is not None and within(figure["aim"]):
        return "aim"
    if figure["must"] is not None:
        return "must" if within(figure["must"]) else "missed"
    return ""


def figures(problem: Problem, solution: Solution) -> dict[str, Figure]:
    """All figures of one solve but its times, by key.

    Parameters
    ----------
    problem : Problem
    solution : Solution
    """
    weight = solution.body_weight
    state = contact_state(solution)
    jumps = apexes(problem, solution, state)
    walks = speed_error(problem, solution) is not None
    out = {
        "solved": Figure("solved", float(solution.converged), "yes", 1.0, at_least=True),
        "frame": Figure(
            "residual at the frames, max / weight",
            float(np.max(solution.frame_violation)) / weight,
            "",
            1e-5,
            1e-8,
        ),
    }
    out |= _audited(solution, walks)
    out |= _task(problem, solution, jumps)
    out |= _contacts(solution, jumps)
    out["settled"] = Figure(
        "iterations to 1 % of the objective", iterations_to(solution.history), "", 300, 50
    )
    out["iterations"] = Figure("iterations in all", len(solution.history))
    out["objective"] = Figure("objective", solution.objective)
    return out


def _audited(solution: Solution, walks: bool) -> dict[str, Figure]:
    """Figures of the audit: between the frames, replay, depth, slip."""
    try:
        found = audit(solution)
    except SimulationError as error:  # a motion so wrong that its replay explodes
        return {"replay": Figure("drift of a replay over 0.25 s, rms", None, "mm", note=str(error))}
    leg = solution.model.leg_length or solution.model.length
    weight = solution.body_weight
    return {
        "between": Figure(
            "residual between frames, rms / weight",
            100 * found.fine_violation_rms / weight,
            "%",
            *((0.5, 0.1) if walks else (8.0, 1.0)),
        ),
        "between_max": Figure(
            "residual between frames, max / weight", 100 * found.fine_violation_max / weight, "%"
        ),
        "replay": Figure(
            f"drift of a replay over {found.replay_duration:.2g} s, rms",
            1e3 * found.replay_rms,
            "mm",
            *((1.0, 0.2) if walks else (10.0, 1.0)),
        ),
        "penetration": Figure(
            "penetration, max / leg length", 100 * found.penetration_max / leg, "%", 2.0, 0.5
        ),
        "slip": Figure(
            "speed of loaded contact points, rms", 100 * found.slip_rms, "cm/s", 3.0, 0.5
        ),
        "slip_max": Figure("speed of loaded contact points, max", 100 * found.slip_max, "cm/s"),
        "cone": Figure("friction / normal force, max", found.cone_max),
        "limits": Figure("joint limits exceeded by, max", found.limit_excess, "rad, m"),
    }


def _task(problem: Problem, solution: Solution, jumps: list[Any]) -> dict[str, Figure]:
    out = {}
    speed = speed_error(problem, solution)
    if speed is not None:
        out["speed"] = Figure("error of the mean velocity", 100 * speed, "%", 5.0)
    places = place_errors(problem, solution)
    if places is not None:
        out["place"] = Figure(
            "horizontal error at the targets, rms / jump",
            100 * float(np.sqrt(np.mean(places**2))),
            "%",
            5.0,
            note=f"largest {100 * float(np.max(places)):.3g} % of a jump",
        )
    if jumps:
        lengths = [b - a for a, b in (j.flight for j in jumps if j.flight is not None)]
        out["flight"] = Figure(
            "share of apexes in flight",
            100.0 * len(lengths) / len(jumps),
            "%",
            100.0,
            at_least=True,
            note=f"{len(lengths)} of {len(jumps)}"
            + (f", {min(lengths):.2f} to {max(lengths):.2f} s" if lengths else ""),
        )
        reached = [100 * j.height / j.target for j in jumps]
        out["apex"] = Figure(
            "error of the apex height, largest",
            100 * max(j.error for j in jumps),
            "%",
            15.0,
            5.0,
            note=f"reached {min(reached):.3g} to {max(reached):.3g} % of the height",
        )
    return out


def _contacts(solution: Solution, jumps: list[Any]) -> dict[str, Figure]:
    """Fewest times that a foot (or a character without feet) makes and breaks contact."""
    state = contact_state(solution)
    load = {solution.model.body_names[k]: value for k, value in state.load().items()}
    counted = {foot: load[foot] for foot in feet(solution)}
    counted = counted or {"whole character": np.sum(state.normal_force, axis=1)}
    changes = {foot: count_changes(value, state.body_weight) for foot, value in counted.items()}
    duration = float(state.times[-1] - state.times[0])
    required = max(1, math.floor(CHANGES_PER_SECOND * duration + 1e-6))
    if jumps:
        required = min(required, len(jumps))
    return {
        "changes": Figure(
            "contacts made and broken, fewest of a foot",
            float(min(min(pair) for pair in changes.values())),
            "",
            float(required),
            at_least=True,
            note=", ".join(f"{foot} {a}/{b}" for foot, (a, b) in changes.items()),
        )
    }
