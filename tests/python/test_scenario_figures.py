"""What is promised of the built-in scenarios holds for two of them, solved from seed 0.

The figures and their limits are those of ``bench/scenarios.py``, which measures all scenarios.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import trajopt
from trajopt import IterationRecord

NAMES = ("hop", "mammal-walk")


def bench_module(name: str) -> ModuleType:
    folder = str(Path(__file__).resolve().parents[2] / "bench")
    if folder not in sys.path:
        sys.path.append(folder)
    return importlib.import_module(name)


class Solved:
    def __init__(self, name: str) -> None:
        self.problem, options = trajopt.load_scenario(name).build()
        self.options = {**options, "seed": 0}
        self.solution = trajopt.solve(self.problem, **self.options, threads=1)
        self.figures = bench_module("_figures").figures(self.problem, self.solution)

    def value(self, key: str) -> float:
        return float(self.figures[key].value)


@pytest.fixture(scope="module", params=NAMES)
def solved(request: pytest.FixtureRequest) -> Solved:
    return Solved(request.param)


def test_solves(solved: Solved) -> None:
    assert solved.solution.status is trajopt.Status.SOLVED, solved.solution.message
    assert solved.solution.iterations == len(solved.solution.history)


def test_physics_holds_at_every_frame(solved: Solved) -> None:
    assert solved.value("frame") <= 1e-8


def test_physics_holds_between_the_frames(solved: Solved) -> None:
    walks = "speed" in solved.figures
    assert solved.value("between") <= (0.5 if walks else 8.0)
    assert solved.value("replay") <= (1.0 if walks else 10.0)


def test_contacts_are_made_and_broken_and_hold(solved: Solved) -> None:
    figure = solved.figures["changes"]
    assert figure.value >= figure.must, figure.note
    assert solved.value("penetration") <= 2.0
    assert solved.value("slip") <= 3.0


def test_task_is_done(solved: Solved) -> None:
    if "speed" in solved.figures:
        assert solved.value("speed") <= 5.0
    else:
        assert solved.value("flight") == 100.0, solved.figures["flight"].note
        assert solved.value("apex") <= 15.0, solved.figures["apex"].note
        assert solved.value("place") <= 5.0


def test_iterations_are_few(solved: Solved) -> None:
    assert solved.value("settled") <= 300
    assert solved.value("settled") <= solved.value("iterations")


def test_bits_do_not_depend_on_threads(solved: Solved) -> None:
    short = {**solved.options, "max_iterations": 60}
    one, two = (trajopt.solve(solved.problem, **short, threads=count) for count in (1, 2))
    assert np.array_equal(one.x, two.x)
    assert np.array_equal(one.u, two.u)
    begun = [record.objective for record in solved.solution.history[:60]]
    assert begun == [record.objective for record in two.history]


def test_settling_counts_all_stages_but_happens_in_the_last() -> None:
    task = bench_module("_task")
    values = [1.0, 0.1, 0.5, 0.2, 0.1005, 0.1002, 0.1]
    stages = [0, 0, 1, 1, 1, 1, 1]
    records = [
        IterationRecord(k + 1, stage=stage, objective=value)
        for k, (value, stage) in enumerate(zip(values, stages, strict=True))
    ]
    assert task.iterations_to(records) == 5
    assert task.iterations_to(records[:2]) == 2


def test_verdicts_tell_aim_must_and_missed() -> None:
    figure = bench_module("_figures").Figure
    assert figure("", 1.0, must=2.0, aim=1.5).verdict == "aim"
    assert figure("", 1.8, must=2.0, aim=1.5).verdict == "must"
    assert figure("", 2.5, must=2.0, aim=1.5).verdict == "missed"
    assert figure("", 3.0, must=4.0, at_least=True).verdict == "missed"
    assert figure("", None, must=4.0).verdict == "missed"
    assert figure("", 7.0).verdict == ""
