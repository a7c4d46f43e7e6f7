"""Iterations of the default solver on a GPU against the processor, for motions of growing length.

solve_device.py [SECONDS] [--small]     rows of JSON; the first iterations must have equal bits

The problem is the scenario mammal-walk with another duration, as frames and as a spline with ten
frames a segment, solved from its own start with cyclic reduction on both sides. Milliseconds are of
an iteration, by the wall clock; `phases` are those of one question to the executor: linearize,
steps (assembly, factorization, solution), trial, correction. --small is for a run without a GPU, on
the emulated runtime.
"""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

import numpy as np
from motions import Motion

import trajopt
from trajopt import _core

FRAMES = (400, 1000, 4000, 10000, 40000, 100000)
SPLINE = (400, 4000, 40000)
SMALL, SMALL_SPLINE = (20, 41), (40,)
WARM_UP = 1  # iterations that are not counted


def solve(
    motion: Motion, device: str, seconds: float, limit: int
) -> tuple[list[float], Any, list[Any]]:
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

    *_, state, _ = _core.solve_funnel(
        motion.core,
        motion.start,
        observe,
        max_iterations=limit,
        restore=False,
        ordering="cyclic",
        device=device,
    )
    return times[WARM_UP:], state, records


def measure(frames: int, formulation: str, seconds: float, small: bool) -> dict[str, Any]:
    threads = _core.hardware_threads()
    row: dict[str, Any] = {
        "program": "solve",
        "formulation": formulation,
        "frames": frames,
        "cpu_threads": threads,
    }
    try:
        motion = Motion(frames, threads, formulation=formulation)
        # At most a few seconds, and the same number of iterations on both.
        count = 3 if frames > 4000 or small else 20
        few = {device: solve(motion, device, 1e9, count) for device in ("cpu", "cuda")}
        row["same_bits"] = few["cpu"][2] == few["cuda"][2] and bool(
            np.array_equal(few["cpu"][1], few["cuda"][1])
        )
        rounds = 2 if small else 10
        for device, name in (("cpu", "cpu"), ("cuda", "gpu")):
            times = few[device][0] if small else solve(motion, device, seconds, 200)[0]
            row[f"{name}_iteration_ms"] = min(times)
            row[f"{name}_iteration_median_ms"] = float(np.median(times))
            phases = _core.time_requests([motion.core], [motion.start], device, "cyclic", rounds)
            row[f"{name}_phases"] = {phase: 1e3 * value for phase, value in phases.items()}
    except (trajopt.DeviceError, MemoryError) as error:
        row["left_out"] = str(error)
    return row


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", nargs="?", type=float, default=0.3)
    parser.add_argument("--small", action="store_true")
    chosen = parser.parse_args()
    if reason := _core.cuda_unavailable():
        parser.exit(1, f"solve_device.py needs a GPU: {reason}\n")
    lengths = {
        "frames": SMALL if chosen.small else FRAMES,
        "spline": SMALL_SPLINE if chosen.small else SPLINE,
    }
    for formulation, all_frames in lengths.items():
        for frames in all_frames:
            row = measure(frames, formulation, max(chosen.seconds, 2.0), chosen.small)
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
