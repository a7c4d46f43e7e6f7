"""The same systems with socu (Cholesky by nested dissection, on NVIDIA Warp): factorization.

peer_socu.py [SECONDS]       rows of JSON
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import numpy as np
import warp as wp
from socu.block_tridiag_solver import calculate_off_diag_storage_len, create_cholesky_factor_launch

# Single systems of bench/device/systems.h; socu has no batch axis.
SHAPES = [
    (20, 96),
    (80, 72),
    (20, 176),
    (512, 64),
    (2048, 32),
    (8192, 16),
    (200, 48),
    (400, 40),
    (200, 82),
    (200, 36),
    (2000, 36),
    (50000, 36),
    (20, 36),
    (20, 72),
]


def system(blocks: int, size: int) -> tuple[Any, Any]:
    rng = np.random.default_rng(1)
    diagonal = rng.uniform(-1.0, 1.0, (blocks, size, size))
    diagonal = 0.5 * (diagonal + diagonal.transpose(0, 2, 1))
    diagonal[:, np.arange(size), np.arange(size)] = 1.5 * size + 2.0
    lower = np.zeros((calculate_off_diag_storage_len(blocks), size, size))
    lower[: blocks - 1] = rng.uniform(-1.0, 1.0, (blocks - 1, size, size))
    return diagonal, lower


def measure(blocks: int, size: int, seconds: float, device: str) -> tuple[float, float]:
    host_diagonal, host_lower = system(blocks, size)
    source = [wp.from_numpy(x, dtype=wp.float64, device=device) for x in system(blocks, size)]
    diagonal = wp.from_numpy(host_diagonal, dtype=wp.float64, device=device)
    lower = wp.from_numpy(host_lower, dtype=wp.float64, device=device)
    factor = create_cholesky_factor_launch(diagonal, lower, device=device, dtype=wp.float64)
    times: list[float] = []
    for round_ in range(1000):
        wp.copy(diagonal, source[0])
        wp.copy(lower, source[1])
        wp.synchronize()
        begin = time.perf_counter()
        factor()
        wp.synchronize()
        if round_ >= 2:  # the first ones compile
            times.append(1e3 * (time.perf_counter() - begin))
        if len(times) >= 3 and sum(times) > 1e3 * seconds:
            break
    if not np.all(np.isfinite(diagonal.numpy())):
        raise FloatingPointError("the factors are not finite")
    return min(times), float(np.median(times))


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 0.3
    device = sys.argv[2] if len(sys.argv) > 2 else "cuda"
    wp.config.quiet = True
    wp.init()
    for blocks, size in SHAPES:
        row: dict[str, Any] = {"program": "peer", "peer": "socu"}
        row.update(blocks=blocks, size=size, batch=1)
        try:
            best, median = measure(blocks, size, seconds, device)
            row.update(gpu_factor_ms=best, gpu_factor_median_ms=median)
        except Exception as error:  # noqa: BLE001  a peer's failure is a result
            row["left_out"] = f"{type(error).__name__}: {error}"[:300]
        print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
