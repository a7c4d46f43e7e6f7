"""Pan's Algorithm 1 against the default method on the same scenarios.

The two do not solve the same equations. ``paper`` takes Pan's version of each problem: a Hermite
spline whose physics holds in the spline's own test space only, the implicit integrator, undamped
contact with w_t = w_n. So the sums of all objective terms belong to different contact laws. What
can be compared is: the terms of the task (the same numbers of the same motion), the unactuated
residual at every frame, each method by its own time scheme, and the residual between the frames by
one and the same audit, which knows neither scheme.

Curves and the first table show both methods on soft ground (`GROUND`, `GROUNDS`), in one stage
from the same start: that is where the paper's schedule begins (Pan 8.1) and where its
method works best. The second table shows whole solves, each method in its own stages up to the
scenario's own ground. Runs of ``paper`` are limited in iterations and seconds; its stages share the
limit of a whole solve in the proportions of `STAGE_SHARES`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from _figures import figures
from _machine import describe, environment, fingerprint, in_order, read, write
from rich.console import Console

import trajopt
from trajopt import IterationRecord
from trajopt.methods import METHODS
from trajopt.plotting.style import ACCENT, MUTED, SERIES, figure, tidy
from trajopt.scenarios.keys import snake_case
from trajopt.solver import Stage

# Pan 8.3: 40 s in 800 frames and 80 control points.
OVERRIDES = {"chain-jump": ["grid.dt=0.05"]}
STAGE_SHARES = (0.5, 0.25, 0.25)
GROUND = Stage(stiffness=0.03)
# Ground ten times as stiff as the others', and a term that forbids to sink in, which on soft ground
# forbids to jump: the scenario's own first passes are softer, too, and without it.
GROUNDS = {"chain-jump": Stage(stiffness=1e-3, factors={"contact_impact": 0.0})}
METHOD_NAMES = ("default", "paper")
WHOLE = "{} whole"
RUNS = (*METHOD_NAMES, *(WHOLE.format(method) for method in METHOD_NAMES))
SAMPLE_GROWTH = 1.3  # the audit looks at iterations 1, 2, 3, 4, 6, 8, ...
REACHED = 1.0 + 1e-9


class Watch:
    """Observer that keeps what is plotted, and asks for a stop when time is up.

    Its own time, above all that of the audits, is taken out of the seconds.
    """

    def __init__(self, tasks: list[str], limit: float | None) -> None:
        self.series: dict[str, list[float]] = {
            key: []
            for key in ("iteration", "seconds", "stage", "objective", "task", "frame", "reduced")
        }
        self.samples: dict[str, list[float]] = {
            key: [] for key in ("iteration", "seconds", "between", "frame_rms")
        }
        self._tasks, self._limit = tasks, limit
        self._spent, self._next = 0.0, 1.0

    def __call__(self, record: IterationRecord) -> bool:
        """Look at one iteration."""
        begin = perf_counter()
        seconds = record.elapsed - self._spent
        row = {
            "iteration": record.iteration,
            "seconds": seconds,
            "stage": record.stage,
            "objective": record.objective,
            "task": sum(record.objective_terms[name] for name in self._tasks),
            "frame": record.frame_violation,
            "reduced": record.constraint_violation,
        }
        for key, value in row.items():
            self.series[key].append(value)
        if record.iteration >= self._next and record.snapshot is not None:
            self._next = max(record.iteration + 1, self._next * SAMPLE_GROWTH)
            self._sample(record.iteration, seconds, record.snapshot)
        self._spent += perf_counter() - begin
        return self._limit is not None and seconds > self._limit

    def _sample(
        self, iteration: int, seconds: float, snapshot: Callable[[], trajopt.Solution]
    ) -> None:
        motion = snapshot()
        weight = motion.body_weight
        self.samples["iteration"].append(iteration)
        self.samples["seconds"].append(seconds)
        self.samples["between"].append(_rms(motion.fine_violation) / weight)
        self.samples["frame_rms"].append(_rms(motion.frame_violation) / weight)

    @property
    def own_seconds(self) -> float:
        """Time spent in the observer [s]."""
        return self._spent


def measure(path: Path, options: argparse.Namespace, console: Console) -> None:
    """Run both methods on the chosen scenarios; write after each run."""
    results = read(path)
    entries = results.setdefault("scenarios", {})
    limits = {"iterations": options.paper_iterations, "seconds": options.paper_seconds}
    for name in options.only:
        settings = trajopt.load_scenario(name).settings
        ground = repr(GROUNDS.get(name, GROUND))
        mark = fingerprint([settings, limits, OVERRIDES.get(name), ground])
        entry = entries.setdefault(name, {})
        if options.fresh or entry.get("fingerprint") != mark:
            entry.clear()
        entry |= {"fingerprint": mark, "limits": limits, "threads": options.threads}
        for key in RUNS:
            if key in entry:
                continue
            console.print(f"[dim]{name}, {key} ...[/dim]", end=" ")
            entry[key] = run = _run(name, key, limits, options.threads)
            entry["machine"] = environment()
            write(path, in_order(results))
            console.print(f"[dim]{run['status']}: {run['message']}[/dim]")


def _run(name: str, key: str, limits: dict[str, Any], threads: int) -> dict[str, Any]:
    method = key.split()[0]
    scenario = trajopt.load_scenario(name)
    if method == "paper":
        scenario = scenario.override(OVERRIDES.get(name, []))
    problem, settings = scenario.build()
    settings |= {"seed": 0, "threads": threads, "method": method}
    if method == "paper":
        settings["max_iterations"] = limits["iterations"]
    if key == method:
        settings["stages"] = [GROUNDS.get(name, GROUND)]
        settings.pop("refine", None)
    elif method == "paper":
        settings["stages"] = [
            replace(stage, iterations=max(1, round(share * limits["iterations"])))
            for stage, share in zip(METHODS["paper"].stages, STAGE_SHARES, strict=True)
        ]
        settings.pop("refine", None)
    watch = Watch(task_labels(problem), limits["seconds"] if method == "paper" else None)
    begin = perf_counter()
    solution = trajopt.solve(problem, callback=watch, **settings)
    seconds = perf_counter() - begin - watch.own_seconds
    found = figures(problem, solution)
    return {
        "status": str(solution.status),
        "message": solution.message,
        "frames": solution.frames,
        "control_points": len(solution.control_points) if method == "paper" else None,
        "dt": scenario.dt,
        "seconds": seconds,
        "iterations": len(solution.history),
        "last_stage": solution.settings.get("stage"),
        "task": sum(solution.objective_terms[label] for label in task_labels(problem)),
        "figures": {key: figure.to_dict() for key, figure in found.items()},
        "series": {key: _short(values) for key, values in watch.series.items()},
        "samples": {key: _short(values) for key, values in watch.samples.items()},
    }


def task_labels(problem: trajopt.Problem) -> list[str]:
    """Names of the objective's terms that say what to do, not how."""
    counts: dict[str, int] = {}
    labels = []
    for term in problem.terms:
        label = getattr(term, "name", snake_case(type(term).__name__))
        counts[label] = counts.get(label, 0) + 1
        if term.task:
            labels.append(f"{label} {counts[label]}" if counts[label] > 1 else label)
    return labels


def reached(entry: dict[str, Any]) -> tuple[int, float] | None:
    """Iteration and time at which the default method had caught up with paper's result.

    First iteration whose task and worst frame are no worse than where paper ended; None if it never
    had.
    """
    goal, series = entry["paper"], entry["default"]["series"]
    frame = goal["figures"]["frame"]["value"]
    for k, values in enumerate(zip(series["task"], series["frame"], strict=True)):
        if None in values or frame is None:
            continue
        if values[0] <= REACHED * goal["task"] and values[1] <= REACHED * frame:
            return int(series["iteration"][k]), float(series["seconds"][k])
    return None


MEASURES = (
    ("task", "task terms", ""),
    ("frame", "residual at the frames, max / weight", ""),
    ("between", "residual between frames, rms / weight", "%"),
    ("replay", "replay drift over 0.25 s, rms", "mm"),
    ("slip", "speed of loaded points, rms", "cm/s"),
    ("penetration", "penetration, max / leg length", "%"),
)


def rows(entry: dict[str, Any]) -> list[list[str]]:
    """Comparison on the same ground: measure, default, paper, who won."""
    first, second = entry["default"], entry["paper"]
    out = _heads(first, second) + _measures(first, second, without="penetration")
    caught = reached(entry) or (None, None)
    for k, (key, unit) in enumerate((("iterations", ""), ("seconds", "s"))):
        text = "never" if caught[k] is None else _number(caught[k], unit)
        end = second[key]
        out.append([f"{key} to paper's end", text, _number(end, unit), _winner(caught[k], end)])
    return out


def whole_rows(entry: dict[str, Any]) -> list[list[str]]:
    """The same for whole solves, each method in its own stages."""
    first, second = (entry[WHOLE.format(method)] for method in METHOD_NAMES)
    return _heads(first, second) + _measures(first, second)


def whole_message(entry: dict[str, Any]) -> str:
    """What the paper's method said at the end of a whole solve."""
    return str(entry[WHOLE.format("paper")]["message"])


def _heads(first: dict[str, Any], second: dict[str, Any]) -> list[list[str]]:
    grids = [f"{run['frames']} frames of {run['dt']:g} s" for run in (first, second)]
    points = f"{grids[1]}, {second['control_points']} control points"
    return [["status", first["status"], second["status"], ""], ["grid", grids[0], points, ""]]


def _measures(first: dict[str, Any], second: dict[str, Any], without: str = "") -> list[list[str]]:
    out = []
    for key, title, unit in MEASURES:
        if key == without:
            continue
        values = [
            run["task"] if key == "task" else run["figures"].get(key, {}).get("value")
            for run in (first, second)
        ]
        out.append([title, *(_number(v, unit) for v in values), _winner(*values)])
    settled = [first["figures"]["settled"]["value"], second["figures"]["settled"]["value"]]
    done = second["status"] == "solved"
    for title, values, unit in (
        ("iterations until settled", settled if done else [settled[0], second["iterations"]], ""),
        ("iterations in all", [first["iterations"], second["iterations"]], ""),
        ("seconds in all", [first["seconds"], second["seconds"]], "s"),
    ):
        text = [_number(v, unit) for v in values]
        out.append([title, text[0], text[1] if done else f"> {text[1]}", _race(*values, done)])
    return out


def _race(first: float, second: float, done: bool) -> str:
    """Verdict on counts, where that of a run that was stopped is only a lower bound."""
    if done:
        return _winner(first, second)
    return f"won > {second / first:.3g}×" if first < second else "open: paper was stopped"


def _winner(first: float | None, second: float | None) -> str:
    """Verdict on the default method, with the ratio."""
    if first is None and second is None:
        return ""
    if second is None or (first is not None and first < second):
        ratio = "" if second is None or not first else f" {second / first:.3g}×"
        return f"won{ratio}"
    return "lost" if first is None or first > second else "even"


def _number(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.3g} {unit}".strip()


def draw(results: dict[str, Any], folder: Path) -> list[Path]:
    """Two pages: objective and violations, each over iterations and over seconds."""
    entries = {k: e for k, e in results["scenarios"].items() if all(m in e for m in RUNS)}
    pages = {
        "paper-vs-default.png": (
            ("series", "objective", "objective, all terms", "-", 1.5),
            ("series", "task", "task terms", ":", 1.5),
        ),
        "paper-vs-default-violations.png": (
            ("series", "frame", "worst frame / weight", "-", 1.2),
            ("samples", "between", "between frames, rms / weight", "--", 1.4),
        ),
    }
    written = []
    for file, lines in pages.items():
        page = figure(10.0, 2.4 * len(entries) + 0.6)
        grid = page.subplots(len(entries), 2, squeeze=False)
        for row, (name, entry) in zip(grid, entries.items(), strict=True):
            for axes, along in zip(row, ("iteration", "seconds"), strict=True):
                _panel(axes, entry, along, lines)
                label = "iteration" if along == "iteration" else "time [s]"
                tidy(axes, name if along == "iteration" else "", label)
                axes.set_xscale("log")
                axes.set_yscale("log")
        handles, labels = grid[0, 0].get_legend_handles_labels()
        page.legend(handles, labels, loc="outside upper center", ncols=4, fontsize=8, frameon=False)
        note = describe(next(iter(entries.values()))["machine"])
        page.text(0.01, -0.02, note, fontsize=7, color=MUTED)
        folder.mkdir(parents=True, exist_ok=True)
        page.savefig(folder / file, bbox_inches="tight")
        written.append(folder / file)
    return written


def _panel(axes: Any, entry: dict[str, Any], along: str, lines: tuple[Any, ...]) -> None:
    for method, color in zip(METHOD_NAMES, (SERIES[0], ACCENT), strict=True):
        for group, key, title, style, width in lines:
            data = entry[method][group]
            y = np.array([np.nan if v is None else v for v in data[key]], dtype=float)
            axes.plot(
                np.maximum(np.array(data[along], dtype=float), 1e-3),
                np.where(y > 0, y, np.nan),
                linestyle=style,
                linewidth=width,
                color=color,
                label=f"{method}: {title}",
            )


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.asarray(values) ** 2)))


def _short(values: list[float]) -> list[float]:
    """Five digits are enough for a plot."""
    return [float(f"{v:.5g}") for v in values]
