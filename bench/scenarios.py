"""Solve the built-in scenarios from several starts and measure everything promised of them.

    python bench/scenarios.py [--only hop ...] [--seeds 5]     solve, audit, print, write JSON
    python bench/scenarios.py --cost                           time per iteration by phase
    python bench/scenarios.py --paper                          Pan's algorithm against the default
    python bench/scenarios.py --all --docs                     everything, and docs/results.md
    python bench/scenarios.py --report --docs                  the tables again, from the JSON files

Results are kept under bench/results after every solve. A run that was cut off goes on where it
stopped: solves are done again only if the scenario or the code has changed, or with --fresh.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import _compare
import _cost
import _report
import numpy as np
from _figures import Figure, figures
from _machine import NAMES, RESULTS, environment, fingerprint, in_order, read, write
from rich.console import Console

import trajopt
from trajopt import _core

# Wall time of a whole solve on two cores [s]: must, aim.
SECONDS = {"hop": (60.0, 10.0), "mammal-walk": (20.0, 1.0)}


def solve(name: str, seed: int, threads: int, **changes: Any) -> tuple[Any, Any, float]:
    """Problem, solution and wall time [s]."""
    problem, options = trajopt.load_scenario(name).build()
    begin = time.perf_counter()
    solution = trajopt.solve(problem, **{**options, "seed": seed, "threads": threads, **changes})
    return problem, solution, time.perf_counter() - begin


def measure(name: str, seed: int, threads: int, single: bool) -> dict[str, Any]:
    """Solve and audit one scenario from one start; with `single` once more on one thread."""
    solve(name, seed, threads, max_iterations=1)  # so that no time goes to first imports
    problem, solution, seconds = solve(name, seed, threads)
    found = figures(problem, solution)
    wall = {str(threads): seconds}
    record: dict[str, Any] = {
        "status": str(solution.status),
        "message": solution.message,
        "objective_terms": solution.objective_terms,
        "frames": solution.frames,
    }
    if single and threads > 1:
        _, again, wall["1"] = solve(name, seed, 1)
        record["bit_equal"] = np.array_equal(solution.x, again.x)
        found["bit_equal"] = Figure(
            f"same bits with 1 and {threads} threads",
            float(record["bit_equal"]),
            "yes",
            must=1.0,
            at_least=True,
        )
    for count, value in wall.items():
        limits = SECONDS.get(name, (None, None)) if count == "2" else (None, None)
        plural = "thread" if count == "1" else "threads"
        found[f"seconds_{count}"] = Figure(f"wall time, {count} {plural}", value, "s", *limits)
    record["figures"] = {key: figure.to_dict() for key, figure in found.items()}
    return record


def run_suite(options: argparse.Namespace, console: Console) -> None:
    """Measure all chosen scenarios and seeds; write after each."""
    results = read(options.out)
    entries = results.setdefault("scenarios", {})
    for name in options.only:
        scenario = trajopt.load_scenario(name)
        mark = fingerprint([scenario.settings, options.threads])
        entry = entries.setdefault(name, {})
        if options.fresh or entry.get("fingerprint") != mark:
            entry.clear()
        entry |= {
            "fingerprint": mark,
            "task": scenario.task,
            "character": scenario.character,
            "frames": scenario.frames,
            "dt": scenario.dt,
            "solver": scenario.settings.get("solver", {}),
        }
        runs = entry.setdefault("runs", {})
        for seed in range(options.seeds):
            if str(seed) in runs:
                continue
            console.print(f"[dim]{name}, seed {seed} ...[/dim]", end=" ")
            runs[str(seed)] = record = measure(name, seed, options.threads, seed == 0)
            entry["machine"] = environment()
            write(options.out, in_order(results))
            console.print(f"[dim]{record['status']}: {record['message']}[/dim]")
        for seed in [key for key in runs if int(key) >= options.seeds]:
            del runs[seed]


def main() -> None:
    """Parse options, measure, report."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=NAMES, default=list(NAMES), metavar="NAME")
    parser.add_argument("--seeds", type=int, default=5, help="starts of each scenario, from 0 on")
    parser.add_argument("--threads", type=int, default=min(2, _core.hardware_threads()))
    parser.add_argument("--out", type=Path, default=RESULTS / "scenarios.json")
    parser.add_argument("--fresh", action="store_true", help="forget what was measured before")
    parser.add_argument("--cost", action="store_true", help="only the time per iteration")
    parser.add_argument("--paper", action="store_true", help="only paper against default")
    parser.add_argument("--paper-iterations", type=int, default=800, help="limit of the paper runs")
    parser.add_argument("--paper-seconds", type=float, default=180.0, help="the same in seconds")
    parser.add_argument("--all", action="store_true", help="the suite, --cost and --paper")
    parser.add_argument("--report", action="store_true", help="measure nothing")
    parser.add_argument("--docs", action="store_true", help="write docs/results.md and its images")
    parser.add_argument("--images", type=Path, help="folder for the images; docs/images by --docs")
    options = parser.parse_args()
    console = Console()
    if not console.is_terminal:
        console.width = 150

    cost, paper = (options.out.with_stem(f"{options.out.stem}-{k}") for k in ("cost", "paper"))
    if not options.report:
        if options.all or not (options.cost or options.paper):
            run_suite(options, console)
        if options.all or options.cost:
            write(cost, _cost.measure())
        if options.all or options.paper:
            _compare.measure(paper, options, console)
    measured = [read(path) for path in (options.out, cost, paper)]
    _report.show(console, *measured)
    if options.docs:
        _report.write_docs(*measured)
    images = options.images or (_report.IMAGES if options.docs else None)
    if images is not None:
        _report.draw(images, *measured)


if __name__ == "__main__":
    main()
