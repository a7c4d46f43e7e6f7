"""Move a block with the least work: a jump in the objective and in the force (Kelly, section 8).

python examples/collocation/block_move_work.py [--out DIR] [--solver ipopt|native]
"""

from __future__ import annotations

from typing import Any

import numpy as np
from _common import finish, parse, report

from trajopt import collocation as col
from trajopt.plotting.collocation import plot_controls, plot_states

LIMIT = 10.0
# (8.5): full force until t*, none, full force back.
SWITCH = 0.5 * (1 - np.sqrt(1 - 4 / LIMIT))
LEAST = (LIMIT * SWITCH) ** 2


def problem(objective: Any = None, limit: float = LIMIT) -> col.Problem:
    return col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0]],
        nx=2,
        nu=1,
        tf=1.0,
        objective=objective,
        x0_bounds=([0, 0], [0, 0]),
        xf_bounds=([1, 0], [1, 0]),
        u_bounds=(-limit, limit),
        guess={"t": [0, 1], "x": [[0, 1], [1, 1]], "u": [[0], [0]]},
        x_names=["position", "speed"],
        u_names=["force"],
    )


def with_slack(limit: float = LIMIT) -> col.Problem:
    return col.add_absolute(problem(limit=limit), lambda t, x, u: u[0] * x[1])


def with_smoothing(width: float) -> col.Problem:
    return problem(lambda t, x, u: col.smooth_abs(u[0] * x[1], width))


def with_phases() -> col.MultiPhase:
    """Full force, none, full force back, with free times between: the jumps fall on the joints."""
    rest: Any = ([0, 0], [0, 0])
    goal: Any = ([1, 0], [1, 0])

    def phase(force: float, **changes: Any) -> col.Problem:
        return col.Problem(
            dynamics=lambda t, x, u: [x[1], u[0]], nx=2, nu=1, u_bounds=(force, force), **changes
        )

    push = phase(
        LIMIT,
        tf_bounds=(0, 1),
        x0_bounds=rest,
        terminal=lambda t0, tf, x0, xf: 0.5 * xf[1] ** 2,
        guess={"t": [0, 0.2], "x": [[0, 0], [0.1, 1.5]]},
    )
    coast = phase(
        0.0,
        t0_bounds=(0, 1),
        tf_bounds=(0, 1),
        guess={"t": [0.2, 0.8], "x": [[0.1, 1.5], [0.9, 1.5]]},
    )
    brake = phase(
        -LIMIT,
        t0_bounds=(0, 1),
        tf=1.0,
        xf_bounds=goal,
        terminal=lambda t0, tf, x0, xf: 0.5 * x0[1] ** 2,
        guess={"t": [0.8, 1], "x": [[0.9, 1.5], [1, 0]]},
    )
    return col.MultiPhase([push, coast, brake])


def exact_control(t: np.ndarray) -> np.ndarray:
    return LIMIT * ((t < SWITCH).astype(float) - (t > 1 - SWITCH))[:, None]


if __name__ == "__main__":
    options = parse(__doc__)
    settings: dict[str, Any] = {
        "method": "trapezoidal",
        "segments": 50,
        "solver": options.solver,
    }
    print(f"exact: {LEAST:.12f}, switch at {SWITCH:.10f} s")
    slack = col.solve(with_slack(), **settings)
    report("slack variables", slack)
    light = col.solve(with_smoothing(0.01), **settings)
    report("tanh, 0.01", light)
    for width in (1.0, 5.0):
        report(f"tanh, {width:g}", col.solve(with_smoothing(width), **settings))
    phases = col.solve(with_phases(), segments=2, solver=options.solver)
    print(f"three phases: {phases.status}, {phases.objective:.12f}, {phases.switching_times}")
    hopeless = col.solve(with_slack(limit=3.0), **settings)
    print(f"force limit 3: {hopeless.status}: {hopeless.message}")
    finish(
        "block-move-work",
        light,
        options.out,
        states=plot_states(light),
        controls=plot_controls(light, exact_control),
    )
