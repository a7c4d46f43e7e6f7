"""Iterations of the default solver on a GPU against the processor, for motions of growing length.

solve_device.py [SECONDS]       rows of JSON; the first iterations must have equal bits

The problem is the scenario mammal-walk with another duration, solved from its own start with cyclic
reduction on both sides. Milliseconds are of an iteration, by the wall clock. There is no batch of
problems to measure: one solve is one problem.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np

import trajopt
from trajopt import _core
from trajopt.transcription import Stage, Transcription

FRAMES = (400, 1000, 4000, 10000, 40000, 100000)
WARM_UP = 1  # iterations that are not counted


class Problem:
    """The first stage of the scenario with some number of frames."""

    def __init__(self, frames: int, threads: int) -> None:
        scenario = trajopt.load_scenario("mammal-walk")
        problem, _ = scenario.override([f"grid.duration={frames * 0.025}"]).build()
        transcription = Transcription(problem, threads)
        stage = Stage(stiffness=1 / 50, friction=0.2)
        initial = transcription.initial_frames(stage)
        self.core = transcription.core_problem(stage, initial)
        still = transcription.to_core(transcription.still(initial))
        noise = transcription.noise(np.random.default_rng(0), 1e-3)
        self.start = self.core.retract(self.core.state_from_frames(still), noise.ravel())

    def solve(self, device: str, seconds: float, limit: int) -> tuple[list[float], Any, list[Any]]:
        """Return milliseconds by iteration, the state, and the records of a solve."""
        times: list[float] = []
        records: list[Any] = []
        begin = last = time.perf_counter()

        def observe(record: dict[str, Any], _state: Any) -> bool:
            nonlocal last
            now = time.perf_counter()
            times.append(1e3 * (now - last))
            records.append((record["objective"], record["constraint_violation"]))
            last = now
            return len(times) < WARM_UP + 2 or now - begin < seconds

        *_, state = _core.solve_funnel(
            self.core,
            self.start,
            observe,
            max_iterations=limit,
            restore=False,
            ordering="cyclic",
            device=device,
        )
        return times[WARM_UP:], state, records


def measure(frames: int, seconds: float) -> dict[str, Any]:
    threads = _core.hardware_threads()
    row: dict[str, Any] = {"program": "solve", "frames": frames, "cpu_threads": threads}
    try:
        problem = Problem(frames, threads)
        # At most a few seconds, and the same number of iterations on both.
        count = 3 if frames > 4000 else 20
        few = {device: problem.solve(device, 1e9, count) for device in ("cpu", "cuda")}
        row["same_bits"] = few["cpu"][2] == few["cuda"][2] and bool(
            np.array_equal(few["cpu"][1], few["cuda"][1])
        )
        for device, name in (("cpu", "cpu_iteration"), ("cuda", "gpu_iteration")):
            times = problem.solve(device, seconds, 200)[0]
            row[f"{name}_ms"] = min(times)
            row[f"{name}_median_ms"] = float(np.median(times))
    except (trajopt.DeviceError, MemoryError) as error:
        row["left_out"] = str(error)
    return row


def main() -> None:
    seconds = max(float(sys.argv[1]) if len(sys.argv) > 1 else 0.3, 2.0)
    if reason := _core.cuda_unavailable():
        sys.exit(f"solve_device.py needs a GPU: {reason}")
    for frames in FRAMES:
        print(json.dumps(measure(frames, seconds)), flush=True)


if __name__ == "__main__":
    main()
