"""Formulations, time schemes and contact laws."""

from __future__ import annotations

import numpy as np
import pytest

import trajopt
from solve.chain import CHAIN, make, share, solve
from trajopt import objectives as terms


def test_spline_and_frames_start_from_each_other():
    spline = solve(make(formulation="spline", frames_per_knot=5), max_iterations=300)
    assert spline.constraint_violation < 1e-6 * spline.body_weight
    assert share(spline) > 1e-3  # its physics holds in the spline's test space only
    assert spline.control_points.shape == (4, 2, CHAIN.ndof)
    frames = solve(make(), warm_start=spline)
    assert (frames.status, share(frames) < 1e-9) == ("solved", True)
    back = solve(make(formulation="spline", frames_per_knot=5), warm_start=frames)
    assert back.status == "solved"


def test_control_points_draw_the_motion():
    spline = solve(make(formulation="spline", frames_per_knot=5), max_iterations=30)
    knots = np.concatenate(
        [[np.stack([spline.initial[0], 0 * spline.initial[0]])], spline.control_points]
    )
    s = np.arange(1, 6)[:, None] / 5
    span = 0.25
    for k in range(4):
        (a, va), (b, vb) = knots[k], knots[k + 1]
        curve = (
            (2 * s**3 - 3 * s**2 + 1) * a
            + (s**3 - 2 * s**2 + s) * span * va
            + (3 * s**2 - 2 * s**3) * b
            + (s**3 - s**2) * span * vb
        )
        found = spline.x[5 * k : 5 * k + 5]
        plain = np.r_[0:3, 6:14]  # all but the rotation
        np.testing.assert_allclose(found[:, plain], curve[:, plain], atol=1e-10)


def test_the_penalty_on_the_physics_of_every_frame_works():
    plain = solve(make(formulation="spline", frames_per_knot=5), max_iterations=200)
    problem = make(formulation="spline", frames_per_knot=5).add(terms.PhysicsPenalty(10.0))
    honest = solve(problem, max_iterations=200)
    rms = [np.sqrt(np.mean(s.frame_violation**2)) for s in (plain, honest)]
    assert rms[1] < 0.5 * rms[0]


def test_paper_method():
    problem = make(frames_per_knot=5)
    solution = solve(problem, method="paper", max_iterations=50)
    assert solution.integrator == "implicit"
    assert solution.contact.damping == 0
    assert solution.contact.friction == pytest.approx(solution.contact.normal)
    assert solution.history[-1].objective < 0.8 * solution.history[0].objective
    # It reports what its constraints do not see.
    assert share(solution) > solution.constraint_violation / solution.body_weight / 10
    assert share(solution) == pytest.approx(solution.history[-1].frame_violation, rel=1e-6)
    assert (problem.formulation, problem.integrator) == ("frames", "linear_acceleration")


@pytest.mark.parametrize("integrator", ["implicit", "verlet", "fox_goodwin", "trapezoidal"])
def test_every_time_scheme(integrator):
    solution = solve(make(integrator=integrator), max_iterations=250)
    assert solution.integrator == integrator
    assert share(solution) < 1e-8
    assert solution.objective < 0.4


def test_coulomb_friction():
    law = trajopt.Contact(model="coulomb", mu=0.6)
    solution = solve(make(contact=law), max_iterations=400)
    assert share(solution) < 1e-8
    assert solution.objective < 0.5
    assert solution.contact.model == "coulomb"
    tangent = np.linalg.norm(solution.contact_forces[..., :2], axis=-1)
    assert np.all(tangent <= 0.6 * solution.contact_forces[..., 2] + 1e-9)


def test_uneven_time_steps():
    steps = np.tile([0.03, 0.05, 0.04, 0.08], 5)
    solution = solve(make(dt=steps), max_iterations=400)
    np.testing.assert_array_equal(solution.dt, steps)
    assert share(solution) < 1e-9
    assert solution.objective < 0.4
