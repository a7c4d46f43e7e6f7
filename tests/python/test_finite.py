"""What is not finite at the start is named: the term, the frame, the coordinate."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from trajopt.objectives import CenterOfMassPosition, ControlEffort, Pose, Residual

CHAIN = trajopt.load_model("chain")


def solve(*terms, warm_start=None, **options):
    problem = trajopt.Problem(CHAIN, duration=1.0, dt=0.05, **options).add(*terms)
    return trajopt.solve(problem, threads=1, max_iterations=2, warm_start=warm_start)


def speed(x2, x1, x):
    return np.sqrt((x1 - x2) @ (x1 - x2))


@pytest.mark.parametrize(
    ("terms", "options", "message"),
    [
        (
            [ControlEffort(), Residual(lambda x2, x1, x: [x[8], np.log(x[7] - 1)], name="far")],
            {},
            "term 'far' is nan at the initial guess: row 1 in frame 0 (t = 0.05 s)",
        ),
        (
            [Residual(lambda x2, x1, x: x[7] / x1[0], name="ratio")],
            {},
            "term 'ratio' is inf at the initial guess: row 0 in frame 0 (t = 0.05 s)",
        ),
        (
            [Residual(speed)],
            {},
            "term 'residual' has no finite derivative at the initial guess: row 0 by x1[0] "
            "(root_tx) in frame 0 (t = 0.05 s)",
        ),
        (
            [CenterOfMassPosition([(1, 0, 0), (1e200, 0, 0)], time=[0.3, 0.8]), ControlEffort()],
            {},
            "term 'center_of_mass_position' is inf at the initial guess, the first time in frame "
            "15 (t = 0.8 s)",
        ),
        (
            [Pose(time=0.1), Pose({CHAIN.dof_names[7]: 1e200}, time=0.4)],
            {"formulation": "spline", "frames_per_knot": 5},
            "term 'pose 2' is inf at the initial guess, the first time in frame 7 (t = 0.4 s)",
        ),
        (
            [ControlEffort()],
            {"initial": {"velocity": {"root_tx": 1e308}}},
            "solve: the force on",
        ),
    ],
)
def test_the_term_and_the_frame_are_named(terms, options, message):
    with pytest.raises(trajopt.ArgumentError) as caught:
        solve(*terms, **options)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_start_with_a_hole_names_the_frame():
    start = solve(ControlEffort())
    start.x[12, 4] = np.nan
    with pytest.raises(trajopt.ArgumentError, match=r"guess is not finite in frame 12 \(t = 0.65"):
        solve(ControlEffort(), warm_start=start)


def test_what_is_finite_at_the_start_that_is_given_is_solved():
    model = trajopt.load_model("chain")
    start = solve(ControlEffort())
    start.x[:, 7] += 2.0
    beyond = Residual(lambda x2, x1, x: np.log(x[7] - 1))
    with pytest.raises(trajopt.ArgumentError, match="is nan at the initial guess"):
        solve(beyond)
    assert model.dof_names == start.model.dof_names
    assert np.isfinite(solve(beyond, warm_start=start).objective)
