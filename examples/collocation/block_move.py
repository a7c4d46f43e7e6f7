"""Move a block by one unit in one unit of time with the least force squared (Kelly, section 2).

python examples/collocation/block_move.py [--out DIR] [--solver ipopt|native]
"""

from __future__ import annotations

import numpy as np
from _common import finish, parse, report

from trajopt import collocation as col
from trajopt.plotting.collocation import plot_controls, plot_states


def problem() -> col.Problem:
    return col.Problem(
        dynamics=lambda t, x, u: [x[1], u[0]],
        nx=2,
        nu=1,
        tf=1.0,
        objective=lambda t, x, u: u[0] ** 2,
        x0_bounds=([0, 0], [0, 0]),
        xf_bounds=([1, 0], [1, 0]),
        x_names=["position", "speed"],
        u_names=["force"],
    )


def exact_states(t: np.ndarray) -> np.ndarray:
    return np.stack([3 * t**2 - 2 * t**3, 6 * t - 6 * t**2], axis=1)


def exact_control(t: np.ndarray) -> np.ndarray:
    return (6 - 12 * t)[:, None]


if __name__ == "__main__":
    options = parse(__doc__)
    for method in ("trapezoidal", "hermite_simpson"):
        report(method, col.solve(problem(), method=method, segments=25, solver=options.solver))
    coarse = col.solve(problem(), method="trapezoidal", segments=10, solver=options.solver)
    finish(
        "block-move",
        coarse,
        options.out,
        states=plot_states(coarse, exact_states),
        controls=plot_controls(coarse, exact_control),
    )
