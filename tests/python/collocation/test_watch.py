"""Callbacks, records and Ctrl-C: the same for both solvers, and no run is ever lost."""

from __future__ import annotations

import dataclasses
import io
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import casadi
import numpy as np
import pytest

from collocation.problems import block, cart_pole
from trajopt import ArgumentError, ArgumentTypeError, Status
from trajopt import collocation as col
from trajopt.collocation.grids import Grid, make_grids
from trajopt.collocation.refinement import refine_automatically, run_schedule

SOLVERS = ("ipopt", "native")
TESTS = Path(__file__).parent.parent


class Recorder:
    """Keeps what it is called with; at iteration `last` it does `then`."""

    def __init__(self, last: int = -1, then: Any = None) -> None:
        self.records: list[dict[str, Any]] = []
        self.iterates: list[np.ndarray] = []
        self._last, self._then = last, then

    def __call__(self, record: dict[str, Any], x: np.ndarray) -> Any:
        self.records.append(record)
        self.iterates.append(x.copy())
        if record["iteration"] == self._last:
            if isinstance(self._then, BaseException):
                raise self._then
            return self._then
        return None


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("then", [False, KeyboardInterrupt()], ids=["false", "ctrl_c"])
def test_a_stopped_run_comes_back(solver: str, then: Any) -> None:
    recorder = Recorder(4, then)
    found = col.solve(cart_pole(), segments=10, solver=solver, callback=recorder)
    assert found.status is Status.INTERRUPTED
    assert found.iterations == 4
    assert [r["iteration"] for r in found.history] == list(range(5))
    kept = np.concatenate([found.result["w"].ravel(), found.result["p"]])
    np.testing.assert_array_equal(kept, recorder.iterates[-1])
    assert not np.array_equal(kept, recorder.iterates[0])
    assert np.isfinite(found.objective)
    assert np.any(found.result["multipliers"]["stage"] != 0.0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_records_are_those_of_the_history(solver: str) -> None:
    recorder = Recorder()
    found = col.solve(cart_pole(), segments=10, solver=solver, callback=recorder)
    assert found.status is Status.SOLVED
    assert len(recorder.records) == found.iterations + 1
    for seen, kept in zip(recorder.records, found.history, strict=True):
        assert seen == kept
    last = recorder.records[-1]
    assert last["objective"] == pytest.approx(found.objective, rel=1e-9)
    assert last["constraint_violation"] < 1e-8 < recorder.records[0]["constraint_violation"]
    assert last["barrier"] < recorder.records[0]["barrier"]
    times = [r["elapsed"] for r in recorder.records]
    assert times == sorted(times)
    assert times[-1] <= found.seconds


def test_both_solvers_fill_the_same_fields() -> None:
    native, ipopt = (
        col.solve(cart_pole(), segments=10, solver=s).history for s in ("native", "ipopt")
    )
    assert set(ipopt[0]) <= set(native[0])
    assert len(native) == len(ipopt)
    # The same algorithm from the same start: the same numbers as long as rounding is all that
    # differs.
    for name in ("objective", "constraint_violation", "barrier", "step_length"):
        a, b = ([row[name] for row in history[:6]] for history in (native, ipopt))
        np.testing.assert_allclose(a, b, rtol=1e-4, err_msg=name)


@pytest.mark.parametrize("solver", SOLVERS)
def test_an_exception_of_the_callback_reaches_the_caller(solver: str) -> None:
    with pytest.raises(RuntimeError, match="enough"):
        col.solve(block(), segments=5, solver=solver, callback=Recorder(1, RuntimeError("enough")))


@pytest.mark.parametrize("solver", SOLVERS)
def test_phases_have_callbacks_too(solver: str) -> None:
    recorder = Recorder(1, False)
    problem = col.MultiPhase([block(xf_bounds=None, objective=None), block()], [])
    found = col.solve(problem, segments=4, solver=solver, callback=recorder)
    assert found.status is Status.INTERRUPTED
    assert len(recorder.records) == 2


def test_a_callback_must_be_callable() -> None:
    with pytest.raises(ArgumentTypeError, match="callback must be callable, not 3"):
        col.solve(block(), callback=3)  # type: ignore[call-overload]


def test_ipopt_without_a_callback_solves_what_it_solved() -> None:
    """The watch that Ctrl-C needs is always there; it must not change the iterates."""
    plain = col.solve(cart_pole(), segments=25)
    assert (plain.status, plain.iterations) == (Status.SOLVED, 11)
    assert plain.objective == pytest.approx(58.80542546846, abs=1e-7)


SCRIPT = """
    import os, signal, sys, threading
    import numpy as np
    from collocation.problems import cart_pole
    from trajopt import collocation as col
    from trajopt.collocation import ipopt, native

    def ctrl_c_soon():
        threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT)).start()

    # From a thread, when the solver has been running for a moment.
    begin = ipopt.IpoptWatch.begin
    observer = native.NativeSolver._observer
    ipopt.IpoptWatch.begin = lambda self, s: (ctrl_c_soon(), begin(self, s))[1]
    native.NativeSolver._observer = lambda self, *a: (ctrl_c_soon(), observer(self, *a))[1]
    callback = (lambda record, x: None) if sys.argv[2] == "watched" else None
    found = col.solve(cart_pole(), segments=4000, solver=sys.argv[1], callback=callback)
    print(found.status, len(found.history), np.all(np.isfinite(found.x)))
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
"""


@pytest.mark.parametrize("watched", ["watched", "unwatched"])
@pytest.mark.parametrize("solver", SOLVERS)
def test_ctrl_c_keeps_the_iterate(solver: str, watched: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(SCRIPT), solver, watched],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=TESTS,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    status, rows, finite = done.stdout.split()
    assert (status, finite) == ("interrupted", "True")
    assert 1 <= int(rows) <= 15  # it takes 15 iterations to solve


class Read(list[float]):
    """A column that counts how many of its numbers are looked at."""

    count = 0

    def __getitem__(self, index: Any) -> Any:
        Read.count += 1
        return super().__getitem__(index)


def test_a_record_costs_the_same_late_as_early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counted: how many of the numbers that CasADi hands over are made a record of."""
    make = casadi.nlpsol

    class Solver:
        def __init__(self, inner: Any) -> None:
            self.inner = inner

        def __call__(self, **arguments: Any) -> Any:
            return self.inner(**arguments)

        def stats(self) -> Any:
            columns = {k: Read(v) for k, v in self.inner.stats()["iterations"].items()}
            return self.inner.stats() | {"iterations": columns}

    monkeypatch.setattr(casadi, "nlpsol", lambda *given: Solver(make(*given)))
    monkeypatch.setattr(Read, "count", 0)
    costs: list[int] = []

    def callback(record: dict[str, Any], _x: np.ndarray) -> None:
        costs.append(Read.count - sum(costs))
        assert len(record) == 10

    found = col.solve(cart_pole(), segments=10, callback=callback)
    assert len(costs) == len(found.history) > 10
    assert costs == [8] * len(costs)


def test_an_insistent_ctrl_c_keeps_the_iterate_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is raised inside of CasADi, which throws the results away."""
    recorder = Recorder()

    class Solver:
        def __init__(self, inner: Any) -> None:
            self.inner = inner

        def __call__(self, **arguments: Any) -> Any:
            self.inner(**arguments)
            raise KeyboardInterrupt

        def stats(self) -> Any:
            return self.inner.stats()

    nlpsol = casadi.nlpsol
    monkeypatch.setattr(casadi, "nlpsol", lambda *given: Solver(nlpsol(*given)))
    found = col.solve(cart_pole(), segments=10, max_iterations=3, callback=recorder)
    assert found.status is Status.INTERRUPTED
    assert found.iterations == 3
    kept = np.concatenate([found.result["w"].ravel(), found.result["p"]])
    np.testing.assert_array_equal(kept, recorder.iterates[-1])
    assert found.result["objective"] == pytest.approx(recorder.records[-1]["objective"])


def test_ctrl_c_between_two_meshes_keeps_the_first() -> None:
    first = col.solve(cart_pole(), segments=5)
    calls: list[Any] = []

    def once(mesh: Any, changes: Any, earlier: Any) -> col.Solution:
        calls.append(earlier)
        if earlier is not None:
            raise KeyboardInterrupt
        return dataclasses.replace(first)

    def grids(mesh: Any, settings: Any) -> list[Grid]:
        return make_grids(None, mesh, None)

    for found in (
        run_schedule(once, grids, [5, 10], {}),
        refine_automatically(once, grids(5, {}), {"method": "hermite_simpson"}, 1e-9, 3),
    ):
        assert found.status is Status.INTERRUPTED
        assert found.objective == first.objective
        assert "before the next mesh" in found.message
    assert len(calls) == 4
    with pytest.raises(KeyboardInterrupt):
        run_schedule(lambda *_: once(*_[:2], first), grids, [5], {})


def test_printer() -> None:
    stream = io.StringIO()
    found = col.solve(
        block(), segments=5, solver="native", callback=col.IterationPrinter(stream, every=1)
    )
    lines = stream.getvalue().splitlines()
    assert lines[0].split()[:3] == ["it", "objective", "violation"]
    assert len(lines) == 1 + len(found.history)
    assert len({len(line) for line in lines}) == 1


def test_printer_leaves_out_what_is_not_its_turn() -> None:
    stream = io.StringIO()
    show = col.IterationPrinter(stream, every=3)
    for k in range(8):
        show({"iteration": k}, np.zeros(0))
    assert [line.split()[0] for line in stream.getvalue().splitlines()] == ["it", "0", "3", "6"]
    with pytest.raises(ArgumentError, match="IterationPrinter: every must be a whole number >= 1"):
        col.IterationPrinter(every=0)
