"""A chain that is to crawl, which most tests of `solve` solve."""

from __future__ import annotations

from functools import cache

import trajopt
from trajopt.objectives import CenterOfMassVelocity, regularizers

CHAIN = trajopt.load_model("chain")
TARGET = CenterOfMassVelocity((0.3, 0, 0), start=0.2)


def make(**changes):
    problem = trajopt.Problem(CHAIN, **{"duration": 1.0, "dt": 0.05, **changes})
    return problem.add(TARGET, *regularizers())


def solve(problem, **options):
    return trajopt.solve(problem, **{"threads": 1, **options})


@cache
def solved():
    solution = solve(make())
    assert solution.status == "solved", solution.message
    return solution


def share(solution):
    """Largest residual of any frame, as a share of the body weight."""
    return solution.frame_violation.max() / solution.body_weight
