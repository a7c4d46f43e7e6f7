"""Several phases: switches at free times, impacts, phases with different states."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from collocation.problems import block
from trajopt import Status
from trajopt import collocation as col
from trajopt.collocation.hp import relative_error

LIMIT = 10.0


def push_coast_brake(limit: float = LIMIT) -> col.MultiPhase:
    """Least work over the block's move: full force, none, full force back, at free times.

    The work of a force with one sign is v²/2. The force is fixed in every phase: between the
    collocation points a polynomial that is only bounded there would exceed the limit.
    """
    times: dict[str, Any] = {"tf": None, "t0_bounds": (0, 1), "tf_bounds": (0, 1)}
    free: dict[str, Any] = {"x0_bounds": None, "xf_bounds": None, "x_bounds": ([None, 0], None)}
    rest, end = ([0, 0], [0, 0]), ([1, 0], [1, 0])
    push = block(
        objective=None,
        terminal=lambda t0, tf, x0, xf: 0.5 * xf[1] ** 2,
        u_bounds=(limit, limit),
        **{**times, **free, "t0_bounds": (0, 0), "x0_bounds": rest},
        guess={"t": [0, 0.2], "x": [[0, 0], [0.1, 1.5]], "u": [[5], [5]]},
    )
    coast = block(
        objective=None,
        u_bounds=(0, 0),
        **{**times, **free},
        guess={"t": [0.2, 0.8], "x": [[0.1, 1.5], [0.9, 1.5]]},
    )
    brake = block(
        objective=None,
        terminal=lambda t0, tf, x0, xf: 0.5 * x0[1] ** 2,
        u_bounds=(-limit, -limit),
        **{**times, **free, "tf_bounds": (1, 1), "xf_bounds": end},
        guess={"t": [0.8, 1], "x": [[0.9, 1.5], [1, 0]], "u": [[-5], [-5]]},
    )
    return col.MultiPhase([push, coast, brake])


@pytest.mark.parametrize(
    "method", ["trapezoidal", "hermite_simpson", "multiple_shooting", "legendre"]
)
def test_least_work_with_switches_is_exact(method: str) -> None:
    """Kelly (8.5): 1.270166537925831 and t* = 0.1127016654, where one phase finds 1.2645."""
    found = col.solve(push_coast_brake(), method=method, segments=5)
    assert found.status is Status.SOLVED
    assert found.objective == pytest.approx(1.270166537925831, abs=1e-6)
    switch = 0.5 * (1 - np.sqrt(1 - 4 / LIMIT))
    np.testing.assert_allclose(found.switching_times, [switch, 1 - switch], atol=1e-5)
    assert sum(phase.objective for phase in found.phases) == pytest.approx(found.objective)
    np.testing.assert_allclose(found.phases[0].u, LIMIT, atol=1e-3)


def test_phases_join() -> None:
    found = col.solve(push_coast_brake(), segments=4)
    for before, after in zip(found.phases, found.phases[1:], strict=False):
        assert before.t[-1] == pytest.approx(after.t[0], abs=1e-9)
        np.testing.assert_allclose(before.x[-1], after.x[0], atol=1e-8)
    again = col.solve(push_coast_brake(), segments=8, guess=found)
    assert again.objective == pytest.approx(found.objective, abs=1e-6)


def test_too_little_force_names_the_phase() -> None:
    found = col.solve(push_coast_brake(3.0), segments=5)
    assert found.status is Status.INFEASIBLE
    assert "link of phases " in found.message
    assert found.phases[0].violations


def test_phases_with_different_states() -> None:
    """A mass that is let go: the second phase keeps the position only."""
    first = col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0]],
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: u[0] ** 2,
        x0_bounds=(0, 0),
    )
    second = col.Problem(
        dynamics=lambda t, x, u: [1.0],
        nx=1,
        nu=0,
        t0=1.0,
        tf=2.0,
        terminal=lambda t0, tf, x0, xf: (xf[0] - 2) ** 2 + x0[0] ** 2,
        x0_bounds=(-5, 5),
    )
    link = col.PhaseLink(first=0, second=1, function=lambda tf, xf, t0, x0: [x0[0] - xf[0]])
    found = col.solve(col.MultiPhase([first, second], [link]), segments=4)
    # Least 3 a² + (a - 1)² + a² over the position a at the switch.
    assert found.phases[1].x[0, 0] == pytest.approx(0.2, abs=1e-7)
    assert found.objective == pytest.approx(0.8, abs=1e-7)


FAST = 40.0


def decay() -> col.MultiPhase:
    """Least ∫ x² + u² under ẋ = -a x + u, a = 1 in the first second and FAST in the second."""

    def one(a: float, t0: float, **bounds: Any) -> col.Problem:
        return col.Problem(
            dynamics=lambda t, x, u: [-a * x[0] + u[0]],
            nx=1,
            nu=1,
            t0=t0,
            tf=t0 + 1,
            objective=lambda t, x, u: x[0] ** 2 + u[0] ** 2,
            **bounds,
        )

    return col.MultiPhase([one(1.0, 0.0, x0_bounds=(1, 1)), one(FAST, 1.0)])


def cost_to_go(a: float, after: float) -> float:
    """P(0) of -P' = 1 - 2 a P - P², P(1) = after."""
    root = np.sqrt(a * a + 1)
    high, low = root - a, -root - a
    c = (after - high) / (after - low) * np.exp(-2 * root)
    return float((high - low * c) / (1 - c))


@pytest.mark.parametrize(
    ("method", "tolerance", "settings"),
    [
        ("hermite_simpson", 1e-6, {"segments": 4, "solver": "ipopt"}),
        ("trapezoidal", 1e-3, {"segments": [4, np.linspace(0, 1, 9)], "solver": "native"}),
        ("legendre", 1e-6, {"segments": [2, 3], "degree": [4, [4, 5, 4]], "solver": "native"}),
    ],
)
def test_each_phase_is_refined_by_its_own_error(
    method: str, tolerance: float, settings: dict[str, Any]
) -> None:
    found = col.solve(decay(), method=method, refine=tolerance, **settings)
    assert found.status is Status.SOLVED
    slow, fast = found.phases
    for phase in found.phases:
        assert relative_error(phase).max() <= tolerance
    assert fast.segments > 2 * slow.segments
    assert len(found.passes) == len(fast.passes) >= 3
    for k, (entry, other) in enumerate(found.passes):
        assert entry is slow.passes[k]
        assert other is fast.passes[k]
    # A phase that is good enough keeps its mesh while the other is refined.
    assert slow.passes[-1].segments == slow.passes[-2].segments
    assert slow.passes[-1].cut == slow.passes[-1].raised == 0
    assert fast.passes[-1].cut + fast.passes[-1].raised > 0
    known = cost_to_go(1.0, cost_to_go(FAST, 0.0))
    assert found.objective == pytest.approx(known, abs=tolerance * (slow.segments + fast.segments))
    assert found.iterations == sum(entry.iterations for entry, _ in found.passes)
    assert found.iterations == slow.iterations
    assert slow.x[-1] == pytest.approx(fast.x[0], abs=1e-8)


def test_meshes_and_schedules_of_phases() -> None:
    plan = [[2, 4], {"segments": [4, np.linspace(0, 1, 13) ** 2], "method": "trapezoidal"}, 8]
    found = col.solve(decay(), refine=plan)
    assert [tuple(entry.segments for entry in row) for row in found.passes] == [
        (2, 4), (4, 12), (8, 8),
    ]  # fmt: skip
    assert [row[0].method for row in found.passes] == [
        "hermite_simpson", "trapezoidal", "hermite_simpson",
    ]  # fmt: skip
    again = col.solve(decay(), segments=8, warm_start=found)
    assert again.iterations <= 1
    assert again.objective == pytest.approx(found.objective, abs=1e-8)


def test_a_phase_with_fewer_segments_begins_where_it_should() -> None:
    """Free times, links and bounds at the start act on the first node of every phase's own."""
    found = col.solve(push_coast_brake(), segments=[2, 7, 4], solver="native")
    assert [phase.segments for phase in found.phases] == [2, 7, 4]
    assert found.objective == pytest.approx(1.270166537925831, abs=1e-7)
    for before, after in zip(found.phases, found.phases[1:], strict=False):
        np.testing.assert_allclose(before.x[-1], after.x[0], atol=1e-8)
    assert found.phases[0].t[0] == 0.0
    np.testing.assert_allclose(found.phases[0].x[0], 0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: col.MultiPhase([]), "sequence of Problem"),
        (lambda: col.MultiPhase([block(), 3]), "sequence of Problem"),  # type: ignore[list-item]
        (
            lambda: col.MultiPhase(
                [block()], [col.PhaseLink(first=0, second=1, function=lambda *a: [])]
            ),
            "second = 1",
        ),
        (
            lambda: col.MultiPhase(
                [block(), col.Problem(dynamics=lambda t, x, u: [0.0], nx=1, nu=0, tf=1.0)]
            ),
            "2 and 1 states",
        ),
        (
            lambda: col.solve(col.MultiPhase([block()]), method="legendre", degree=[2, 3]),
            "one for each of the 1 phases",
        ),
        (
            lambda: col.solve(col.MultiPhase([block()]), warm_start=col.solve(block(), segments=2)),
            "warm_start must be a solution of a MultiPhase",
        ),
        (lambda: col.solve(col.MultiPhase([block()]), guess=[None, None]), "one per phase"),
    ],
)
def test_refusals(build: Any, words: str) -> None:
    with pytest.raises((ValueError, TypeError), match=words):
        build()
