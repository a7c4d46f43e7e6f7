"""Batches of one-second problems on a GPU against the processor.

batch_device.py [SECONDS] [--small]     rows of JSON; every problem must have the bits of its single
                                        solve on the processor

The problem is the scenario mammal-walk, 40 frames, from starts that differ: a number of seeds, each
used as often as the batch is large. All take the same number of iterations, with cyclic reduction
on both sides (and on the GPU also with what `auto` chooses). Milliseconds are those of the whole
batch, of the core alone: what Python does before and after is the same on both sides. The processor
solves one problem a thread; of batches with more problems than there are seeds it solves as many as
there are seeds, and the time is scaled up (`cpu_problems` says how many there were). --small is for
a run without a GPU, on the emulated runtime.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from motions import Motion

import trajopt
from trajopt import _core

FRAMES, ITERATIONS, SEEDS = 40, 20, 32
BATCHES = tuple(2**k for k in range(14))  # 1 ... 8192
SMALL = (1, 3)


def solve(motions: list[Motion], device: str, ordering: str, iterations: int) -> list[Any]:
    """Return the answers of the core: status, message, iterations, state, ordering, records."""
    n = len(motions)
    answers = _core.solve_funnels(
        [motion.core for motion in motions],
        [motion.start for motion in motions],
        [None] * n,
        _core.StopFlag(),
        None,
        max_iterations=[iterations] * n,
        restore=[False] * n,
        constraint_tolerance=1e-9,
        objective_tolerance=0.0,  # nobody is done earlier
        ordering=ordering,
        device=device,
    )
    for answer in answers:
        if isinstance(answer, Exception):
            raise answer
    return list(answers)


def on_threads(motions: list[Motion], threads: int, iterations: int) -> list[Any]:
    """The same on the processor, a problem a thread."""
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(lambda m: solve([m], "cpu", "cyclic", iterations)[0], motions))


def timed(work: Any) -> tuple[float, Any]:
    """Milliseconds of a call, and what it returned."""
    begin = time.perf_counter()
    result = work()
    return 1e3 * (time.perf_counter() - begin), result


def best_of(seconds: float, work: Any) -> float:
    """The least milliseconds of calls that together take some seconds."""
    times = [timed(work)[0]]
    while sum(times) < 1e3 * seconds:
        times.append(timed(work)[0])
    return min(times)


def counts(threads: int) -> list[int]:
    return sorted({1, min(2, threads), threads})


def measure(batch: int, seconds: float, pool: list[Motion], iterations: int) -> dict[str, Any]:
    threads = _core.hardware_threads()
    row: dict[str, Any] = {
        "program": "batch",
        "batch": batch,
        "frames": pool[0].frames,
        "iterations": iterations,
        "cpu_threads": threads,
    }
    try:
        motions = [pool[k % len(pool)] for k in range(batch)]
        answers = solve(motions, "cuda", "cyclic", iterations)
        distinct = min(batch, len(pool))
        alone = on_threads(pool[:distinct], threads, iterations)
        row["same_bits"] = all(
            np.array_equal(answer[3], alone[k % distinct][3]) for k, answer in enumerate(answers)
        )
        for ordering, name in (("cyclic", "gpu"), ("auto", "gpu_auto")):
            work = solve, motions, "cuda", ordering, iterations
            row[f"{name}_batch_ms"] = best_of(seconds, lambda work=work: work[0](*work[1:]))
        phases = _core.time_requests(
            [m.core for m in motions], [m.start for m in motions], "cuda", "cyclic", 3
        )
        row["gpu_phases"] = {phase: 1e3 * value for phase, value in phases.items()}
    except (trajopt.DeviceError, MemoryError) as error:
        row["left_out"] = str(error)
    # Distinct problems only: a problem of the core's is one thread's.
    part = min(batch, len(pool))
    row["cpu_problems"] = part
    for count in counts(threads):
        took = best_of(seconds, lambda count=count: on_threads(pool[:part], count, iterations))
        row[f"cpu_{count}_batch_ms"] = took * batch / part
    return row


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("seconds", nargs="?", type=float, default=0.3)
    parser.add_argument("--small", action="store_true")
    chosen = parser.parse_args()
    if reason := _core.cuda_unavailable():
        parser.exit(1, f"batch_device.py needs a GPU: {reason}\n")
    frames, iterations, seeds = (20, 2, 2) if chosen.small else (FRAMES, ITERATIONS, SEEDS)
    seeds = max(seeds, 0 if chosen.small else 2 * _core.hardware_threads())
    pool = [Motion(frames, 1, seed) for seed in range(seeds)]
    for batch in SMALL if chosen.small else BATCHES:
        seconds = 0.0 if chosen.small else chosen.seconds
        print(json.dumps(measure(batch, seconds, pool, iterations)), flush=True)


if __name__ == "__main__":
    main()
