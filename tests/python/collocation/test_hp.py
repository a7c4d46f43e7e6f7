"""Degrees per segment, and the choice between more segments and higher degrees."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from collocation.problems import block, cart_pole
from trajopt import ArgumentError, Status
from trajopt import collocation as col
from trajopt.collocation import hp
from trajopt.collocation.hp import SMOOTH, decay_rate, relative_error
from trajopt.collocation.transcriptions import make_transcription

FAMILIES = [("legendre", "gauss"), ("legendre", "radau"), ("legendre", "lobatto")]
FAMILIES += [("chebyshev", None)]


def cubic(**changes: Any) -> col.Problem:
    """Least ∫ (x² + u²)/2 under ẋ = u - x³ from x(0) = 1 over two seconds."""
    stated: dict[str, Any] = {
        "dynamics": lambda t, x, u: [u[0] - x[0] ** 3],
        "nx": 1,
        "nu": 1,
        "tf": 2.0,
        "objective": lambda t, x, u: 0.5 * (x[0] ** 2 + u[0] ** 2),
        "x0_bounds": (1, 1),
    }
    return col.Problem(**{**stated, **changes})


def cubic_by_shooting() -> tuple[float, Any]:
    """Cost and state by the maximum principle: u = -λ, λ' = 3 x² λ - x, λ(2) = 0."""

    def slopes(t: float, y: np.ndarray) -> list[float]:
        x, costate, _ = y
        return [-costate - x**3, 3 * x**2 * costate - x, 0.5 * (x**2 + costate**2)]

    def run(costate: float) -> Any:
        start = [1.0, costate, 0.0]
        return solve_ivp(
            slopes, (0, 2), start, rtol=1e-12, atol=1e-14, method="DOP853", dense_output=True
        )

    found = run(brentq(lambda c: run(c).y[1, -1], 0.0, 1.0, xtol=1e-15))
    return float(found.y[2, -1]), found.sol


def shortest_time() -> col.Problem:
    """From rest to rest over 1 m with -2 <= u <= 1: the switch is at 2/3 of √3 seconds."""
    free: dict[str, Any] = {"tf": None, "objective": None, "tf_bounds": (0.5, 4)}
    return block(
        **free,
        terminal=lambda t0, tf, x0, xf: tf,
        u_bounds=(-2, 1),
        guess={"t": [0, 2], "x": [[0, 0], [1, 0]], "u": [[0.1], [0.1]]},
    )


@pytest.mark.parametrize(("method", "points"), FAMILIES[:2])
def test_degrees_per_segment_are_those_of_phases(method: str, points: str | None) -> None:
    """Two segments of degrees 6 and 3 are two phases of one segment each, solved together."""
    mixed = col.solve(cubic(), method=method, points=points, segments=2, degree=[6, 3])
    first, second = cubic(tf=1.0), cubic(t0=1.0, tf=2.0, x0_bounds=None)
    phases = col.solve(
        col.MultiPhase([first, second]), method=method, points=points, segments=1, degree=[6, 3]
    )
    assert mixed.degrees == (6, 3)
    assert mixed.objective == pytest.approx(phases.objective, abs=1e-12)
    for phase, times in zip(phases.phases, ([0.1, 0.7], [1.2, 1.9]), strict=True):
        np.testing.assert_allclose(mixed.state(times), phase.state(times), atol=1e-9)
        np.testing.assert_allclose(mixed.control(times), phase.control(times), atol=1e-7)
    np.testing.assert_allclose(mixed.error[1], phases.phases[1].error[0], rtol=0.02)


def points_of_all_segments(s: col.Solution, method: str, points: str | None) -> np.ndarray:
    shares = {n: np.array(make_transcription(method, n, points).points) for n in s.degrees}
    return np.unique(
        np.concatenate(
            [a + (b - a) * shares[n] for (a, b), n in zip(pairwise(s.t), s.degrees, strict=True)]
        )
    )


@pytest.mark.parametrize(("method", "points"), FAMILIES)
def test_solvers_agree(method: str, points: str | None) -> None:
    settings: dict[str, Any] = {"method": method, "points": points, "degree": [4, 6, 8, 10, 9, 5]}
    found = [
        col.solve(cart_pole(), segments=6, solver=solver, **settings)
        for solver in ("ipopt", "native")
    ]
    assert found[0].objective == pytest.approx(found[1].objective, abs=1e-8)
    assert found[0].degrees == tuple(settings["degree"])
    own = points_of_all_segments(found[0], method, points)
    assert np.abs(found[0].defect(own)).max() < 1e-6
    middle = 0.5 * (own[1:] + own[:-1])
    assert np.abs(found[0].defect(middle)).max() > 1e-3


def test_path_constraints_hold_in_every_segment() -> None:
    limited = cubic(path=(lambda t, x, u: [u[0] + 0.2 * x[0]], -0.15, None))
    found = col.solve(limited, method="legendre", points="lobatto", segments=3, degree=[3, 8, 5])
    times = points_of_all_segments(found, "legendre", "lobatto")
    values = found.control(times)[:, 0] + 0.2 * found.state(times)[:, 0]
    assert values.min() == pytest.approx(-0.15, abs=1e-7)


@pytest.mark.parametrize("points", ["gauss", "radau"])
def test_a_smooth_problem_gets_higher_degrees(points: str) -> None:
    cost, state = cubic_by_shooting()
    tolerance = 1e-9
    s = col.solve(
        cubic(), method="legendre", points=points, segments=4, refine=tolerance, solver="native"
    )
    assert relative_error(s).max() <= tolerance
    assert {entry.segments for entry in s.passes} == {4}
    assert s.passes[-1].raised > 0
    assert all(entry.cut == 0 for entry in s.passes)
    # Spectral convergence: every degree added gains a factor, e at least.
    first, last = s.passes[0], s.passes[-1]
    added = min(b - a for a, b in zip(first.degrees, last.degrees, strict=True))
    assert added >= 3
    assert first.error / last.error > np.exp(SMOOTH * added)
    assert s.objective == pytest.approx(cost, abs=tolerance)
    times = np.linspace(0, 2, 41)
    np.testing.assert_allclose(s.state(times)[:, 0], state(times)[0], atol=10 * tolerance)


@pytest.mark.parametrize("solver", ["ipopt", "native"])
def test_a_switch_is_cut_out(solver: str) -> None:
    s = col.solve(
        shortest_time(), method="legendre", segments=4, refine=1e-6, solver=solver,
        max_refinements=12,
    )  # fmt: skip
    switch, tf = 2 / np.sqrt(3), np.sqrt(3)
    assert relative_error(s).max() <= 1e-6
    assert sum(entry.cut for entry in s.passes) >= 2
    assert s.objective == pytest.approx(tf, abs=5e-6)
    # Only the segment with the switch is cut, again and again, and in the end it is short.
    k = int(np.searchsorted(s.t, switch)) - 1
    assert s.t[k + 1] - s.t[k] < 0.03
    assert s.segments <= 12
    np.testing.assert_allclose(s.mesh[[1, 2, -2]], [0.25, 0.5, 0.75])
    times = np.concatenate([np.linspace(0, s.t[k], 20), np.linspace(s.t[k + 2], s.t[-1], 20)])
    expected = np.where(times < switch, times**2 / 2, 1 - (tf - times) ** 2)
    np.testing.assert_allclose(s.state(times)[:, 0], expected, atol=1e-5)


def test_few_segments_of_many_degrees_solve_the_swing_up() -> None:
    s = col.solve(cart_pole(), method="legendre", segments=6, refine=1e-8, solver="native")
    assert relative_error(s).max() <= 1e-8
    assert sum(entry.cut for entry in s.passes) > 0
    assert sum(entry.raised for entry in s.passes) > 0
    assert s.objective == pytest.approx(58.80766746, abs=1e-7)
    assert len(set(s.degrees)) > 3


@pytest.mark.parametrize(
    ("function", "smooth"),
    [
        (np.exp, True),
        (np.cos, True),
        (lambda x: 1 / (1.3 - x), False),
        (lambda x: np.sign(x - 0.1), False),
        (lambda x: np.abs(x + 0.3), False),
    ],
)
def test_decay_of_coefficients(function: Any, smooth: bool) -> None:
    places = np.cos(np.pi * (np.arange(40) + 0.5) / 40)
    series = np.polynomial.legendre.legfit(places, function(places), 9)
    assert (decay_rate(series) >= SMOOTH) == smooth


def test_decay_of_a_pole_is_that_of_its_ellipse() -> None:
    """1/(a - x) has coefficients like √j ρ^-j, ρ = a + √(a² - 1); √j lowers the fit a little."""
    places, weights = np.polynomial.legendre.leggauss(60)
    for a in (1.5, 2.0, 4.0):
        basis = np.polynomial.legendre.legvander(places, 12)
        series = (np.arange(13) + 0.5) * (basis.T @ (weights / (a - places)))
        assert -0.15 < decay_rate(series) - np.log(a + np.sqrt(a * a - 1)) < 0.0


def test_one_segment_stays_one_while_its_degree_can_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    settings: dict[str, Any] = {"method": "legendre", "segments": 1, "degree": 3, "refine": 1e-9}
    s = col.solve(cubic(), **settings)
    assert [entry.segments for entry in s.passes] == [1] * len(s.passes)
    assert [entry.degree for entry in s.passes][:3] == [3, 7, 11]
    assert relative_error(s).max() <= 1e-9
    monkeypatch.setattr(hp, "HIGHEST_GLOBAL_DEGREE", 7)
    s = col.solve(cubic(), **settings)
    assert [entry.segments for entry in s.passes][:3] == [1, 1, 2]
    assert [entry.cut for entry in s.passes][:3] == [0, 0, 1]
    assert relative_error(s).max() <= 1e-9


def test_degrees_are_kept_in_files(tmp_path: Path) -> None:
    s = col.solve(cubic(), method="legendre", segments=2, refine=1e-5)
    s.save(tmp_path / "cubic.npz")
    again = col.Solution.load(tmp_path / "cubic.npz")
    assert again.degrees == s.degrees
    assert again.passes == s.passes


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"degree": [3, 4, 5]}, "degree has 3 entries, expected one for each of the 2"),
        ({"degree": [3, 0]}, r"degree\[1\] must be a whole number >= 1, not 0"),
        ({"degree": [3, 2], "method": "trapezoidal"}, "no option of method"),
    ],
)
def test_refusals(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        col.solve(cubic(), segments=2, **{"method": "legendre", **settings})


def test_schedule_with_degrees() -> None:
    s = col.solve(
        cubic(),
        method="legendre",
        refine=[{"segments": 2, "degree": [2, 3]}, {"segments": 2, "degree": [9, 7]}],
    )
    assert s.status is Status.SOLVED
    assert [entry.degrees for entry in s.passes] == [(2, 3), (9, 7)]
