"""The problems of the device programs: mammal-walk of any length, as frames or as a spline."""

from __future__ import annotations

from typing import Any

import numpy as np

import trajopt
from trajopt.transcription import Stage, Transcription

STEP = 0.025  # [s]


class Motion:
    """The first stage of the scenario with some number of frames and a seed of its own."""

    def __init__(
        self, frames: int, threads: int, seed: int = 0, formulation: str = "frames"
    ) -> None:
        self.frames = frames
        scenario = trajopt.load_scenario("mammal-walk")
        duration = frames * STEP
        start = min(1.0, 0.5 * duration)  # of what counts of the velocity
        changes = [
            f"grid.duration={duration}",
            f"grid.formulation={formulation}",
            f"objective.center_of_mass_velocity.start={start}",
        ]
        problem, _ = scenario.override(changes).build()
        transcription = Transcription(problem, threads)
        stage = Stage(stiffness=1 / 50, friction=0.2)
        initial = transcription.initial_frames(stage)
        self.core: Any = transcription.core_problem(stage, initial)
        still = transcription.to_core(transcription.still(initial))
        noise = transcription.noise(np.random.default_rng(seed), 1e-3)
        if formulation == "spline":  # at the control points; their velocities stay
            knots = noise[problem.frames_per_knot - 1 :: problem.frames_per_knot]
            noise = np.stack([knots, np.zeros_like(knots)], axis=1)
        self.start = self.core.retract(self.core.state_from_frames(still), noise.ravel())
