"""Time per iteration by phase on one core, next to what its arithmetic needs at least.

Floor: the larger of flops over the peak rate of multiply-adds of one core (fma_peak.cpp) and bytes
over the rate at which one core copies an array of the size of the KKT matrix; both rates measured.
Counted is the least that an accepted iteration of the frames formulation does:

- derivatives: 35 kflop a frame for FD, three Jacobians and the center of mass (counted for D = 18,
  scaled with D²), 10 kflop for one trial evaluation; belongs to phase ``dynamics``;
- Gram matrices: w² for an objective or physics row with w nonzero columns (2 flops for each element
  of the lower triangle), and the addition of neighbouring frames' windows to the KKT matrix by
  nodes, 3 D²; done while the derivatives are in cache, so phase ``dynamics``, too;
- factorization: W³/3 + W² K + W K² for a node of W = 2 D − nu rows that leaves K columns coupled,
  K = 2 D for the 4/7 of the nodes that are eliminated downwards and 2 W for the others;
- solve: 2 W² + 4 W K a node and right-hand side, and 2 W² + 8 W D for a residual; two of them, the
  tangential and the normal step.

Bytes: a node's rows of the matrix, W (2 D + W) numbers, are written once by the derivatives and
read by the factorization, which writes W K + W²/2; a solution reads these twice, down and up, for
both right-hand sides together, and the matrix once for the residual. A phase ``assembly`` is there
in other orderings than ``frontal`` only.

What comes on top of it in a real iteration: second-order corrections (up to two more trials and
solves), predicted decrease, a second factorization where the inertia was wrong.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from _machine import describe, environment

import trajopt
from trajopt import objectives
from trajopt.plotting.style import ACCENT, INK, MUTED, SERIES, figure, tidy

if TYPE_CHECKING:
    from collections.abc import Callable

    from trajopt.objectives.base import Term

PHASES = ("dynamics", "factorization", "solve")
MUST, AIM = 20.0, 8.0  # milliseconds
SCENARIO = "mammal-walk"


def measure(scenario: str = SCENARIO) -> dict[str, Any]:
    """Solve a scenario on one thread; medians over the iterations [ms]."""
    problem, options = trajopt.load_scenario(scenario).build()
    solution = trajopt.solve(problem, **{**options, "seed": 0, "threads": 1})
    phases = np.array([[r.seconds[p] for p in PHASES] for r in solution.history]) * 1e3
    accepted = np.array([r.accepted for r in solution.history])
    peak = peak_rate()
    flops, traffic = count_flops(problem), count_bytes(problem)
    rate = copy_rate(problem)
    floor = None
    if peak is not None:
        floor = {p: max(flops[p] / (peak * 1e6), traffic[p] / (rate * 1e6)) for p in PHASES}
    return {
        "machine": environment(),
        "scenario": scenario,
        "dofs": problem.model.ndof,
        "frames": solution.frames,
        "iterations": len(solution.history),
        "accepted": float(np.mean(accepted)),
        "milliseconds": {p: float(np.median(phases[:, k])) for k, p in enumerate(PHASES)},
        "total": float(np.median(phases.sum(axis=1))),
        "total_accepted": float(np.median(phases[accepted].sum(axis=1))),
        "wall_per_iteration": 1e3 * solution.seconds / max(len(solution.history), 1),
        "must": MUST,
        "aim": AIM,
        "peak_gflops": peak,
        "megaflops": {name: value * 1e-6 for name, value in flops.items()},
        "copy_gigabytes": rate,
        "megabytes": {name: value * 1e-6 for name, value in traffic.items()},
        "floor": floor,
    }


def count_flops(problem: trajopt.Problem) -> dict[str, float]:
    """Flops of each phase of the least iteration; see the module's text."""
    model, frames = problem.model, problem.frames
    d, dual = model.ndof, model.ndof - model.nactuated
    gram = frames * dual * (3 * d) ** 2  # the exact augmentation of the physics rows
    gram += sum(_gram(term, problem) for term in problem.terms)
    width = d + dual

    def mean(cost: Callable[[int], float]) -> float:
        return frames * (4 / 7 * cost(2 * d) + 3 / 7 * cost(2 * width))

    return {
        "dynamics": frames * ((35e3 + 10e3) * (d / 18) ** 2 + 3.0 * d * d) + gram,
        "factorization": mean(lambda k: width**3 / 3 + width**2 * k + width * k**2),
        "solve": 2 * mean(lambda k: 4.0 * width**2 + 4 * width * k + 8 * width * d),
    }


def _gram(term: Term, problem: trajopt.Problem) -> float:
    """Flops of a term's rows: rows per frame · columns² · frames that count."""
    model, d = problem.model, problem.model.ndof
    times = getattr(term, "time", None)
    frames = problem.frames if times is None else np.size(times)
    shape = {
        objectives.ControlEffort: (model.nactuated, 3 * d),
        objectives.CenterOfMassVelocity: (3, 2 * d),
        objectives.CenterOfMassPosition: (3, d),
        objectives.PointVelocity: (3, 2 * d),
        objectives.PointPosition: (3, d),
        objectives.ContactForceRate: (3 * model.npoints, 3 * d),
        objectives.ContactSlip: (2 * model.npoints, 2 * d),
        objectives.PhysicsPenalty: (d - model.nactuated, 3 * d),
    }.get(type(term), (0, 0))  # the others touch a few diagonals only
    return float(frames * shape[0] * shape[1] ** 2)


def count_bytes(problem: trajopt.Problem) -> dict[str, float]:
    """Bytes that each phase of the least iteration moves; see the module's text."""
    d, dual = problem.model.ndof, problem.model.ndof - problem.model.nactuated
    width = d + dual
    matrix = 8.0 * problem.frames * width * (2 * d + width)
    kept = 4 / 7 * 2 * d + 3 / 7 * 2 * width
    factors = 8.0 * problem.frames * (width * kept + width**2 / 2)
    return {
        "dynamics": matrix,
        "factorization": matrix + factors,
        "solve": 2 * factors + matrix,
    }


def copy_rate(problem: trajopt.Problem) -> float:
    """Bytes read and written in a second by a copy of an array as large as the matrix [GB/s]."""
    source = np.zeros(int(count_bytes(problem)["factorization"] / 16))
    target = np.ones_like(source)
    best = np.inf
    for _ in range(50):
        begin = time.perf_counter()
        np.copyto(target, source)
        best = min(best, time.perf_counter() - begin)
    return float(2 * source.nbytes / best * 1e-9)


def peak_rate() -> float | None:
    """Multiply-add peak of one core [GFLOP/s]; None without a compiler."""
    compiler = shutil.which(os.environ.get("CXX", "c++").split()[0])
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "fma_peak"
        source = Path(__file__).with_name("fma_peak.cpp")
        flags = ["-std=c++20", "-O3", "-march=native", "-ffp-contract=fast"]
        subprocess.run([compiler, *flags, source, "-o", program], check=True)
        answer = subprocess.run([program], check=True, capture_output=True, text=True)
    return float(answer.stdout)


def rows(cost: dict[str, Any]) -> list[list[str]]:
    """Table of phases: measured, floor, ratio."""
    floor = cost["floor"] or {}
    out = []
    for phase in PHASES:
        spent, least = cost["milliseconds"][phase], floor.get(phase)
        out.append(
            [
                phase,
                f"{spent:.3g}",
                f"{cost['megaflops'][phase]:.3g}",
                f"{cost['megabytes'][phase]:.3g}",
                "-" if least is None else f"{least:.2g}",
                "-" if least is None else f"{spent / least:.1f}",
            ]
        )
    least = sum(floor.values()) if floor else None
    out.append(
        [
            "iteration",
            f"{cost['total']:.3g}",
            f"{sum(cost['megaflops'].values()):.3g}",
            f"{sum(cost['megabytes'].values()):.3g}",
            "-" if least is None else f"{least:.2g}",
            "-" if least is None else f"{cost['total'] / least:.1f}",
        ]
    )
    return out


def draw(cost: dict[str, Any], path: Path) -> None:
    """Bars: measured and floor by phase."""
    page = figure(8.0, 3.4)
    axes = page.subplots()
    place = np.arange(len(PHASES))
    spent = [cost["milliseconds"][p] for p in PHASES]
    axes.barh(place - 0.2, spent, 0.38, color=SERIES[0], label="measured, median")
    if cost["floor"]:
        least = [cost["floor"][p] for p in PHASES]
        axes.barh(place + 0.2, least, 0.38, color=ACCENT, label="floor by flops and bytes")
        for k, (a, b) in enumerate(zip(spent, least, strict=True)):
            axes.text(a, k - 0.2, f" {a:.2g} ms", va="center", fontsize=8, color=INK)
            axes.text(b, k + 0.2, f" {b:.2g} ms", va="center", fontsize=8, color=MUTED)
    axes.set_yticks(place, PHASES)
    axes.invert_yaxis()
    title = (
        f"One iteration of {cost['scenario']} (D = {cost['dofs']}, N = {cost['frames']}) on one "
        f"core: {cost['total']:.3g} ms"
    )
    tidy(axes, title, "time [ms]")
    axes.legend(fontsize=8, frameon=False, labelcolor=INK, loc="lower right")
    page.text(0.01, -0.04, describe(cost["machine"]), fontsize=7, color=MUTED)
    path.parent.mkdir(parents=True, exist_ok=True)
    page.savefig(path, bbox_inches="tight")
