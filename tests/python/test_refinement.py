"""Time grids refined where the motion obeys physics least between its frames."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt import run
from trajopt.refinement import interval_errors, refine_steps, refine_until
from trajopt.status import Status


@pytest.fixture(scope="module")
def hop():
    problem, options = trajopt.load_scenario("hop").override(["grid.dt=0.05"]).build()
    options["threads"] = 1
    return problem, options, trajopt.solve(problem, **options)


def rms(solution):
    """Root mean square over time of the residual between frames, in body weights."""
    width = np.repeat(np.broadcast_to(solution.dt, solution.frames), 4)
    mean = np.sum(width * solution.fine_violation**2) / width.sum()
    return np.sqrt(mean) / solution.body_weight


def test_refinement_lowers_the_residual_between_frames(hop):
    problem, options, coarse = hop
    fine = trajopt.solve(problem, refine=0.02, max_refinements=2, **options)
    assert fine.status == "solved"
    assert fine.frames > coarse.frames
    assert np.ptp(fine.dt) > 0
    assert np.sum(fine.dt) == pytest.approx(problem.duration)
    assert rms(fine) < 0.6 * rms(coarse)
    assert fine.frame_violation.max() < 1e-8 * fine.body_weight
    assert [r.iteration for r in fine.history] == list(range(1, fine.iterations + 1))


def test_a_loose_tolerance_changes_nothing(hop):
    problem, options, coarse = hop
    again = trajopt.solve(problem, refine=100.0, **options)
    assert again.x.tobytes() == coarse.x.tobytes()


def test_no_passes_change_nothing(hop):
    problem, options, coarse = hop
    again = trajopt.solve(problem, refine=1e-3, max_refinements=0, **options)
    assert again.x.tobytes() == coarse.x.tobytes()


def test_the_earlier_motion_is_kept_when_a_pass_fails(hop, monkeypatch):
    problem, options, coarse = hop
    real = run._stages

    def spoiled(*arguments):
        found = yield from real(*arguments)
        if found.frames > coarse.frames:
            found.status = Status.STALLED
        return found

    monkeypatch.setattr(run, "_stages", spoiled)
    kept = trajopt.solve(problem, refine=0.02, **options)
    assert kept.status == "solved"
    assert kept.x.tobytes() == coarse.x.tobytes()
    assert "it ended as stalled, and was dropped" in kept.message


def test_interrupted_passes_keep_the_coarse_motion(hop):
    problem, options, coarse = hop
    count = coarse.iterations
    kept = trajopt.solve(problem, refine=0.02, callback=lambda r: r.iteration > count, **options)
    assert kept.frames == coarse.frames
    assert "ended as interrupted" in kept.message


def test_neighbours_differ_by_two_at_most():
    rng = np.random.default_rng(0)
    steps, errors = np.full(40, 0.1), np.zeros(40)
    errors[[7, 30]] = 1.0
    for _ in range(4):
        steps = refine_steps(steps, errors, 0.5)
        assert steps.sum() == pytest.approx(4.0)
        ratio = steps[1:] / steps[:-1]
        assert ratio.max() <= 2 + 1e-9
        assert ratio.min() >= 0.5 - 1e-9
        errors = (steps <= steps.min()) * rng.random(len(steps))


def test_refinement_ends_when_the_tolerance_is_met():
    grids = []

    def solve_on(steps):
        grids.append(steps)
        yield "a pass"
        return True

    def errors():
        steps = grids[-1] if grids else np.full(8, 0.1)
        return steps**2

    refinement = refine_until(errors, solve_on, np.full(8, 0.1), 0.003, passes=5)
    assert next(refinement) == "a pass"
    with pytest.raises(StopIteration) as end:
        next(refinement)
    assert end.value.value == 1
    assert len(grids[0]) == 16


def test_interval_errors_are_shares_of_the_weight(hop):
    _, _, coarse = hop
    errors = interval_errors(coarse, coarse.fine_violation, coarse.body_weight)
    assert errors.shape == (coarse.frames,)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(rms(coarse))


@pytest.mark.parametrize("changes", [{"formulation": "spline"}, {"periodic": True}])
def test_what_cannot_be_refined_is_refused(changes):
    model = trajopt.load_model("chain")
    problem = trajopt.Problem(model, duration=1.0, dt=0.05, **changes)
    problem.add(trajopt.objectives.ControlEffort())
    with pytest.raises(trajopt.ArgumentError, match="refine needs frames that are not periodic"):
        trajopt.solve(problem, refine=0.1)
