"""`solve_batch` on the processor: what `solve` finds for each, and how it ends."""

from __future__ import annotations

import io
import os
import pickle
import re
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import Future, ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import trajopt
from trajopt import _core
from trajopt.objectives import CenterOfMassVelocity, Residual, regularizers
from trajopt.progress import BatchProgress
from trajopt.solver import Stage

CHAIN = trajopt.load_model("chain")
COUNT = 5


def make(speed, **changes):
    problem = trajopt.Problem(CHAIN, **{"duration": 0.5, "dt": 0.05, **changes})
    return problem.add(CenterOfMassVelocity((speed, 0, 0), start=0.2), *regularizers())


def problems(count=COUNT):
    return [make(0.1 + 0.1 * k) for k in range(count)]


@cache
def alone():
    return [trajopt.solve(p, threads=1, max_iterations=60) for p in problems()]


def assert_same(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert (a.status, a.message, a.iterations) == (b.status, b.message, b.iterations)
        for name in ("x", "u", "control_points", "contact_forces", "fine_violation", "initial"):
            assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
        assert a.objective_terms == b.objective_terms
        assert [r.objective for r in a.history] == [r.objective for r in b.history]
        assert [(r.iteration, r.stage) for r in a.history] == [
            (r.iteration, r.stage) for r in b.history
        ]


# ---- the same motions ------------------------------------------------------------------------


@pytest.mark.parametrize("threads", [1, 2, 7, None])
def test_the_bits_of_solve_in_the_order_of_the_problems(threads):
    found = trajopt.solve_batch(problems(), threads=threads, max_iterations=60)
    assert_same(found, alone())
    for solution in found:
        elapsed = [r.elapsed for r in solution.history]
        assert elapsed == sorted(elapsed)
        assert elapsed[-1] <= solution.seconds
        assert all(r.snapshot is None for r in solution.history)


def test_watched_or_not_makes_no_difference():
    seen = {}

    def watch(index, record):
        seen.setdefault(index, []).append(record.iteration)
        assert record.snapshot().iterations == record.iteration

    found = trajopt.solve_batch(problems(), callback=watch, threads=2, max_iterations=60)
    assert_same(found, alone())
    assert {k: len(v) for k, v in seen.items()} == {k: s.iterations for k, s in enumerate(alone())}


def test_none_and_one_and_the_same_twice():
    assert trajopt.solve_batch([]) == []
    problem = problems(1)[0]
    found = trajopt.solve_batch([problem, problem], max_iterations=60, threads=2)
    assert_same(found, [alone()[0], alone()[0]])


def test_any_shape_method_and_option():
    mixed = [
        make(0.2),
        make(0.2, duration=0.6, periodic=True),
        make(0.2, formulation="spline", frames_per_knot=5),
    ]
    options = {"max_iterations": 8, "seed": 3, "noise": 1e-2, "ordering": "cyclic"}
    options["stages"] = [Stage(stiffness=0.1, iterations=4), Stage()]
    found = trajopt.solve_batch(mixed, **options)
    assert_same(found, [trajopt.solve(p, threads=1, **options) for p in mixed])
    unasked = trajopt.solve_batch(mixed, max_iterations=1)
    assert [s.ordering for s in unasked] == ["frontal", "chunked", "sequential"]
    spline = [make(0.2, frames_per_knot=5)]
    paper = trajopt.solve_batch(spline, method="paper", max_iterations=5)
    assert_same(paper, [trajopt.solve(spline[0], "paper", threads=1, max_iterations=5)])


def test_refinement():
    problem = make(0.3, duration=1.0)
    options = {"refine": 0.02, "max_refinements": 1}
    expected = trajopt.solve(problem, threads=1, **options)
    assert_same(trajopt.solve_batch([problem], **options), [expected])


def test_starts_and_seeds_are_of_each_problem():
    some = problems(3)
    starts = [None, alone()[0], alone()[1]]
    found = trajopt.solve_batch(some, warm_start=starts, seed=[4, 0, 0], max_iterations=60)
    each = zip(some, starts, [4, 0, 0], strict=True)
    expected = [
        trajopt.solve(p, warm_start=start, seed=seed, threads=1, max_iterations=60)
        for p, start, seed in each
    ]
    assert_same(found, expected)
    assert found[0].x.tobytes() != alone()[0].x.tobytes()


# ---- elsewhere -------------------------------------------------------------------------------


def test_problems_and_solutions_travel():
    problem = pickle.loads(pickle.dumps(problems(1)[0]))
    assert not problem.model.home.flags.writeable
    assert problem.model.dof_names == CHAIN.dof_names
    there = trajopt.solve(problem, threads=1, max_iterations=60)
    assert_same([pickle.loads(pickle.dumps(there))], alone()[:1])


def test_a_pool_of_processes():
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        found = trajopt.solve_batch(problems(), executor=pool, max_iterations=60)
    assert_same(found, alone())


class InTurn:
    """The least an executor can be: futures with nothing but a result."""

    class Promise:
        def __init__(self, call):
            self.result = call

    def submit(self, function, *arguments):
        return self.Promise(lambda: function(*arguments))


class Reluctant:
    """Begins nothing; its futures wait to be cancelled."""

    def __init__(self):
        self.futures = []

    def submit(self, function, *arguments):
        future = Future()
        if not self.futures:
            future.set_result(function(*arguments))
            signal.raise_signal(signal.SIGINT)
        self.futures.append(future)
        return future


def test_anything_that_submits():
    assert_same(trajopt.solve_batch(problems(2), executor=InTurn(), max_iterations=60), alone()[:2])


def test_control_c_cancels_what_has_not_begun_elsewhere():
    found = trajopt.solve_batch(problems(3), executor=Reluctant(), max_iterations=60)
    assert_same(found[:1], alone()[:1])
    assert [str(s.status) for s in found[1:]] == ["interrupted", "interrupted"]
    assert all(s.iterations == 1 and np.isfinite(s.x).all() for s in found[1:])


def test_what_cannot_travel_names_its_index():
    pytest.importorskip("casadi")
    some = problems(2)
    some[1].add(Residual(lambda _x2, _x1, x: x[6], name="bent joint"))
    with (
        ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool,
        pytest.raises(trajopt.BatchError, match=r"problems\[1\]: .*[Pp]ickl") as caught,
    ):
        trajopt.solve_batch(some, executor=pool, max_iterations=60)
    assert_same([caught.value.solutions[0]], alone()[:1])


# ---- endings ---------------------------------------------------------------------------------


def spoiled():
    some = problems(3)
    nowhere = Residual(lambda _x2, _x1, x: np.sqrt(x[0] - 10.0), name="far")
    some[1].add(nowhere)  # not finite where the solve begins: found out there
    return some


@pytest.mark.parametrize("elsewhere", [False, True])
def test_a_failing_problem_does_not_lose_the_others(elsewhere):
    options = {"executor": InTurn()} if elsewhere else {"threads": 2}
    with pytest.raises(trajopt.BatchError) as caught:
        trajopt.solve_batch(spoiled(), max_iterations=60, **options)
    error = caught.value
    assert list(error.errors) == [1]
    assert isinstance(error.errors[1], trajopt.ArgumentError)
    assert "1 of 3 problems failed: problems[1]: ArgumentError: solve: term 'far'" in str(error)
    assert error.solutions[1] is None
    assert_same([error.solutions[0], error.solutions[2]], [alone()[0], alone()[2]])


def test_what_the_core_refuses_is_the_same_error_as_alone(monkeypatch):
    # A check that Python lacks: the core finds it out by itself.
    monkeypatch.setattr("trajopt.settings._check_ordering", lambda *_: None)
    ring = make(0.1, duration=0.6, periodic=True)
    options = {"ordering": "frontal", "max_iterations": 2}
    with pytest.raises(trajopt.ArgumentError, match="expected formulation frames") as single:
        trajopt.solve(ring, threads=1, **options)
    with pytest.raises(trajopt.BatchError) as batch:
        trajopt.solve_batch([make(0.1), ring], **options)
    error = batch.value.errors[1]
    assert (type(error), str(error)) == (type(single.value), str(single.value))
    assert isinstance(error, ValueError)
    assert batch.value.solutions[0].iterations == 2


def test_a_callback_stops_one_problem_or_fails_it():
    found = trajopt.solve_batch(problems(2), callback=lambda k, r: k == 1 and r.iteration == 3)
    assert [str(s.status) for s in found] == ["solved", "interrupted"]
    assert found[1].iterations == 3

    def fails(index, record):
        if index == 0 and record.iteration == 2:
            raise RuntimeError("mine")

    with pytest.raises(trajopt.BatchError, match=r"problems\[0\]: RuntimeError: mine") as caught:
        trajopt.solve_batch(problems(2), callback=fails, max_iterations=60)
    assert_same([caught.value.solutions[1]], alone()[1:2])


def test_control_c_keeps_the_best_motions_of_all():
    def press(index, record):
        if index == 0 and record.iteration == 5:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    long = [make(0.1 * k, duration=5.0, dt=0.025) for k in range(1, 7)]
    started = time.perf_counter()
    found = trajopt.solve_batch(long, threads=2, callback=press, tolerance=1e-13)
    assert time.perf_counter() - started < 60
    assert [str(s.status) for s in found] == ["interrupted"] * 6
    assert all(s.iterations > 0 and np.isfinite(s.x).all() for s in found)
    assert found[0].iterations > found[-1].iterations == 1
    assert signal.getsignal(signal.SIGINT) is before


def test_control_c_in_a_callback_ends_all():
    def callback(index, record):
        if index == 0 and record.iteration == 3:
            raise KeyboardInterrupt

    found = trajopt.solve_batch(
        [make(0.2, duration=5.0)] * 3, threads=1, callback=callback, tolerance=1e-13
    )
    assert [str(s.status) for s in found] == ["interrupted"] * 3
    assert [s.iterations for s in found] == [3, 1, 1]


def test_the_third_control_c_raises():
    script = (
        "import os, signal, threading, trajopt\n"
        "from trajopt.objectives import ControlEffort\n"
        "chain = trajopt.load_model('chain')\n"
        "p = trajopt.Problem(chain, duration=5.0, dt=0.025).add(ControlEffort())\n"
        "def thrice(index, record):\n"
        "    if index == 0 and record.iteration == 2:\n"
        "        for _ in range(3):\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "            threading.Event().wait(0.3)\n"
        "try:\n"
        "    trajopt.solve_batch([p] * 4, threads=1, callback=thrice, tolerance=1e-15)\n"
        "except KeyboardInterrupt:\n"
        "    print('raised')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout == "raised\n", done.stderr
    assert "Traceback" not in done.stderr


# ---- documentation ---------------------------------------------------------------------------


def test_the_page_runs_as_printed(tmp_path):
    text = (Path(__file__).parents[2] / "docs/batches.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(blocks) == 3
    script = tmp_path / "page.py"  # a file: its functions travel to other processes
    script.write_text("if __name__ == '__main__':\n" + textwrap.indent("\n".join(blocks), "    "))
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.splitlines() == re.findall(r"print\(.*\)  # (.*)", text), done.stderr


# ---- progress --------------------------------------------------------------------------------


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_shown_when_it_is_asked_for(capsys):
    trajopt.solve_batch(problems(2), max_iterations=3)
    assert capsys.readouterr().err == ""
    trajopt.solve_batch(problems(2), max_iterations=3, progress=True)
    assert capsys.readouterr().err == "1 of 2 ended, 0 solved\n2 of 2 ended, 0 solved\n"


def test_progress_on_a_terminal_is_a_bar():
    terminal = Terminal()
    with BatchProgress(3, True, terminal) as show:
        for solution in (alone()[0], None, alone()[1]):
            show.ended(solution)
    assert "3 of 3 ended" in terminal.getvalue()


# ---- arguments -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"problems": [make(0.1), 3]}, r"problems\[1\] must be a Problem, not int"),
        ({"problems": make(0.1)}, "problems must be a sequence, not Problem"),
        (
            {"problems": [make(0.1), trajopt.Problem(CHAIN, duration=0.5, dt=0.05)]},
            r"problems\[1\]: no objective term",
        ),
        ({"warm_start": [None]}, "warm_start holds 1 values for 2 problems"),
        ({"warm_start": [None, "walk"]}, r"warm_start\[1\] must be a Solution, not str"),
        ({"seed": [1]}, "seed holds 1 values for 2 problems"),
        ({"seed": [0, -1]}, r"seed\[1\] must be a whole number >= 0"),
        ({"threads": 0}, "threads must be a whole number >= 1"),
        ({"executor": 3}, r"executor must have submit\(function"),
        ({"executor": InTurn(), "threads": 2}, "threads cannot be given with an executor"),
        ({"executor": InTurn(), "callback": print}, "callback cannot be given with an executor"),
        ({"callback": 3}, "callback must be callable"),
        ({"tolerance": 0.0}, "solve_batch: tolerance must be > 0"),
        ({"refine": 0.1, "problems": [make(0.1), make(0.1, periodic=True)]}, r"problems\[1\]: ref"),
        ({"ordering": "random"}, "ordering"),
        ({"stages": 5}, "stages must be a list of Stage, not 5"),
        (
            {"stages": [Stage(0.1), Stage(factors={"speed": 0.0})]},
            r"problems\[0\]: stages\[1\]: factors names 'speed', which is no term",
        ),
    ],
)
def test_bad_arguments_before_any_work(change, message, monkeypatch):
    monkeypatch.setattr("trajopt.run.Transcription", None)
    arguments = {"problems": [make(0.1), make(0.2)], **change}
    with pytest.raises(trajopt.TrajoptError, match=message):
        trajopt.solve_batch(arguments.pop("problems"), **arguments)


def test_a_start_of_another_robot_names_its_index():
    biped = trajopt.load_model("biped")
    problem = trajopt.Problem(biped, duration=0.5, dt=0.05).add(*regularizers())
    with pytest.raises(trajopt.TrajoptError, match=r"solve_batch: warm_start\[1\] moves"):
        trajopt.solve_batch([make(0.1), problem], warm_start=[None, alone()[0]])


def test_without_a_gpu_nothing_begins(monkeypatch):
    monkeypatch.setattr(_core, "cuda_unavailable", lambda: "the moon is full")
    monkeypatch.setattr("trajopt.run.Transcription", None)
    with pytest.raises(trajopt.DeviceError, match="device 'cuda': the moon is full"):
        trajopt.solve_batch(problems(1), device="cuda")
