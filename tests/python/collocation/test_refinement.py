"""Meshes that follow the error, and schedules of meshes."""

from __future__ import annotations

import numpy as np
import pytest

from collocation.problems import block, cart_pole
from trajopt import ArgumentError, Status
from trajopt import collocation as col
from trajopt.collocation.refinement import relative_error


@pytest.mark.parametrize(
    ("method", "segments", "settings"),
    [
        ("trapezoidal", 25, {}),
        ("hermite_simpson", 12, {}),
        ("hermite_simpson_compressed", 12, {}),
        ("multiple_shooting", 25, {}),
        ("chebyshev", 8, {}),
        ("legendre", 6, {"points": "radau"}),
    ],
)
def test_refines_until_the_error_is_below(method: str, segments: int, settings: dict) -> None:  # type: ignore[type-arg]
    tolerance = 1e-3 if method == "trapezoidal" else 1e-5
    s = col.solve(cart_pole(), method=method, segments=segments, refine=tolerance, **settings)
    assert s.status is Status.SOLVED
    assert relative_error(s).max() <= tolerance
    assert len(s.passes) >= 2
    assert s.passes[0].segments == segments
    assert s.iterations == sum(entry.iterations for entry in s.passes)
    assert s.passes[-1].error < s.passes[0].error


def test_segments_are_cut_where_the_error_is() -> None:
    s = col.solve(cart_pole(), segments=20, refine=1e-4, max_refinements=1)
    before = col.solve(cart_pole(), segments=20)
    error = relative_error(before)
    for k in range(20):
        inside = np.sum((s.mesh > before.mesh[k] + 1e-12) & (s.mesh < before.mesh[k + 1] - 1e-12))
        assert (inside > 0) == (error[k] > 1e-4)
        assert inside <= 3


def test_nothing_to_refine() -> None:
    assert len(col.solve(block(), segments=3, refine=1e-6).passes) == 1


def test_says_when_the_error_remains() -> None:
    s = col.solve(cart_pole(), segments=10, refine=1e-9, max_refinements=1)
    assert "still above refine" in s.message


def test_schedule() -> None:
    """Kelly 7.6: a coarse mesh with a low tolerance, then a fine one."""
    s = col.solve(
        cart_pole(),
        refine=[{"segments": 5, "tolerance": 1e-3}, {"segments": 25, "tolerance": 1e-10}],
    )
    assert [entry.segments for entry in s.passes] == [5, 25]
    assert s.objective == pytest.approx(58.80542546846, abs=1e-8)
    cold = col.solve(cart_pole(), tolerance=1e-10)
    assert s.passes[1].iterations < cold.iterations


def test_schedule_changes_the_method() -> None:
    s = col.solve(cart_pole(), refine=[{"segments": 10, "method": "trapezoidal"}, 25])
    assert [entry.method for entry in s.passes] == ["trapezoidal", "hermite_simpson"]


@pytest.mark.parametrize(
    ("refine", "words"),
    [
        ([], "empty"),
        ([{"size": 3}], "no setting 'size'"),
        (0.0, "> 0"),
        ("fine", "tolerance or a list"),
        (True, "tolerance or a list"),
    ],
)
def test_refusals(refine: object, words: str) -> None:
    with pytest.raises((ArgumentError, TypeError), match=words):
        col.solve(block(), refine=refine)
