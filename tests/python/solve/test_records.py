"""Records, snapshots, and equal bits: what `solve` tells of itself."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from solve.chain import make, solve, solved


def test_history_is_numbered_through_all_stages():
    solution = solved()
    history = solution.history
    assert [r.iteration for r in history] == list(range(1, len(history) + 1))
    assert solution.iterations == len(history)
    stages = [r.stage for r in history]
    assert stages == sorted(stages)
    assert set(stages) == {0, 1, 2}
    elapsed = [r.elapsed for r in history]
    assert elapsed == sorted(elapsed)
    assert elapsed[-1] <= solution.seconds
    for record in history:
        assert set(record.seconds) == {"dynamics", "assembly", "factorization", "solve"}
        assert all(value >= 0 for value in record.seconds.values())
        assert set(record.objective_terms) == set(solution.objective_terms)
        assert record.snapshot is None


def test_snapshots_are_whole_solutions(tmp_path):
    kept = []

    def callback(record):
        if record.iteration == 10:
            kept.append(record.snapshot())

    solve(make(), callback=callback, max_iterations=12)
    (snapshot,) = kept
    assert (snapshot.status, snapshot.iterations) == ("interrupted", 10)
    assert snapshot.objective == snapshot.history[-1].objective
    snapshot.save(tmp_path / "checkpoint.npz")
    assert trajopt.Solution.load(tmp_path / "checkpoint.npz").iterations == 10


@pytest.mark.parametrize("formulation", ["frames", "spline"])
def test_same_bits_every_time_and_for_every_number_of_threads(formulation):
    first, again, two = (
        solve(make(formulation=formulation), threads=threads, max_iterations=60)
        for threads in (1, 1, 2)
    )
    for other in (again, two):
        assert other.x.tobytes() == first.x.tobytes()
        assert other.u.tobytes() == first.u.tobytes()
        assert other.objective == first.objective


def test_seeds_differ():
    one, two = (solve(make(), seed=seed, max_iterations=20) for seed in (0, 1))
    assert not np.array_equal(one.x, two.x)
    assert (one.seed, two.seed) == (0, 1)
