"""What `solve` refuses before any work."""

from __future__ import annotations

import pytest

import trajopt
from solve.chain import CHAIN, make
from trajopt import objectives as terms


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "magic"}, "method = 'magic', expected one of default, paper"),
        ({"ordering": "random"}, "ordering = 'random', expected one of auto, frontal"),
        ({"device": "tpu"}, "device = 'tpu', expected 'cpu', 'cuda' or 'auto'"),
        ({"threads": 0}, "threads must be a whole number >= 1, not 0"),
        ({"threads": 1.5}, "threads must be a whole number >= 1, not 1.5"),
        ({"max_iterations": 0}, "max_iterations must be a whole number >= 1, not 0"),
        ({"tolerance": 0.0}, "tolerance must be > 0"),
        ({"constraint_tolerance": -1.0}, "constraint_tolerance must be > 0"),
        ({"noise": -1.0}, "noise must be >= 0"),
        ({"seed": -1}, "seed must be a whole number >= 0"),
        ({"refine": 0.0}, "refine must be > 0"),
        ({"refine": -0.1}, "refine must be > 0"),
        ({"max_refinements": -1}, "max_refinements must be a whole number >= 0"),
        ({"refine": 0.1, "method": "paper"}, "refine needs frames"),
        ({"stages": []}, "stages must be a list of Stage"),
        ({"stages": [1.0]}, "stages must be a list of Stage"),
        ({"warm_start": "walk.npz"}, "warm_start must be a Solution, not str"),
        ({"callback": 3}, "callback must be callable"),
    ],
)
def test_bad_options_before_any_work(options, message, monkeypatch):
    monkeypatch.setattr("trajopt.run.Transcription", None)
    with pytest.raises(trajopt.TrajoptError) as caught:
        trajopt.solve(make(frames_per_knot=5), **options)
    assert message in str(caught.value)


def test_problem_must_be_one():
    with pytest.raises(trajopt.ArgumentTypeError, match="problem must be a Problem, not Model"):
        trajopt.solve(CHAIN)


def test_paper_needs_whole_segments():
    with pytest.raises(trajopt.ArgumentError, match="must be a multiple of frames_per_knot = 7"):
        trajopt.solve(make(frames_per_knot=7), method="paper")


@pytest.mark.parametrize("added", [[], [terms.ControlEffort(0.0), terms.Smoothness(0.0)]])
def test_an_objective_is_needed(added):
    problem = trajopt.Problem(CHAIN, duration=1.0, dt=0.05).add(*added)
    with pytest.raises(trajopt.ArgumentError, match="no objective term with a weight > 0"):
        trajopt.solve(problem)
