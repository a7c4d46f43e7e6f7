"""Elimination orders: they agree, are named, and are refused where there are none."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from solve.chain import make, solve
from trajopt.solver import Stage


@pytest.mark.parametrize("ordering", ["frontal", "sequential", "cyclic", "chunked"])
def test_orderings_agree(ordering):
    solution = solve(make(), ordering=ordering, stages=[Stage()], max_iterations=10)
    other = solve(make(), stages=[Stage()], max_iterations=10)
    assert solution.ordering == ordering
    np.testing.assert_allclose(solution.x, other.x, atol=1e-5)


@pytest.mark.parametrize(
    ("problem", "options", "used"),
    [
        ({}, {}, "frontal"),
        ({"periodic": True}, {}, "chunked"),
        ({"formulation": "spline", "frames_per_knot": 2}, {}, "chunked"),
        ({"formulation": "spline", "frames_per_knot": 10}, {}, "sequential"),  # one block
        ({"frames_per_knot": 2}, {"method": "paper"}, "chunked"),
        ({}, {"ordering": "cyclic"}, "cyclic"),
    ],
)
def test_a_solution_names_the_ordering_that_was_used(problem, options, used, tmp_path):
    seen = []
    found = solve(
        make(**problem),
        max_iterations=2,
        callback=lambda record: seen.append(record.snapshot().ordering),
        **options,
    )
    assert found.ordering == found.summary()["ordering"] == used
    assert seen == [used] * found.iterations
    found.save(tmp_path / "a.npz")
    assert trajopt.Solution.load(tmp_path / "a.npz").ordering == used


def test_frames_that_are_not_periodic_are_eliminated_one_by_one():
    frontal, other = (
        solve(make(), ordering=ordering, stages=[Stage()], max_iterations=10)
        for ordering in ("frontal", "auto")
    )
    assert frontal.x.tobytes() == other.x.tobytes()


@pytest.mark.parametrize(
    ("problem", "options", "found"),
    [
        ({"formulation": "spline"}, {}, "formulation 'spline'"),
        ({"periodic": True}, {}, "periodic=True"),
        ({}, {"method": "paper"}, "method 'paper', formulation 'spline'"),
    ],
)
def test_frontal_is_refused_where_it_does_not_exist(problem, options, found):
    with pytest.raises(trajopt.ArgumentError, match=f"ordering 'frontal' .* not for {found}"):
        solve(make(**problem), ordering="frontal", **options)
