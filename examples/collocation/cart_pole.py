"""Swing a pole up by moving its cart (Kelly, section 6).

python examples/collocation/cart_pole.py [--out DIR] [--solver ipopt|native]
"""

from __future__ import annotations

from typing import Any

import numpy as np
from _common import finish, parse, report

from trajopt import collocation as col
from trajopt.plotting.collocation import (
    plot_controls,
    plot_errors,
    plot_iterations,
    plot_phase_plane,
    plot_states,
    plot_stop_action,
)

CART, POLE, LENGTH, GRAVITY = 1.0, 0.3, 0.5, 9.81


def dynamics(t: Any, x: Any, u: Any) -> list[Any]:
    """(6.1) and (6.2): position of the cart, angle of the pole from hanging, their rates."""
    s, c = np.sin(x[1]), np.cos(x[1])
    d = CART + POLE * s**2
    pull = LENGTH * POLE * s * x[3] ** 2 + u[0]
    cart = (pull + POLE * GRAVITY * c * s) / d
    pole = -(pull * c + (CART + POLE) * GRAVITY * s) / (LENGTH * d)
    return [x[2], x[3], cart, pole]


def problem(guess: Any = None) -> col.Problem:
    return col.Problem(
        dynamics=dynamics,
        nx=4,
        nu=1,
        tf=2.0,
        objective=lambda t, x, u: u[0] ** 2,
        x_bounds=([-2, None, None, None], [2, None, None, None]),
        u_bounds=(-20, 20),
        x0_bounds=(0, 0),
        xf_bounds=([1, np.pi, 0, 0], [1, np.pi, 0, 0]),
        x_names=["cart [m]", "pole [rad]", "cart rate [m/s]", "pole rate [rad/s]"],
        u_names=["force [N]"],
        guess=guess,
    )


def pose(x: np.ndarray) -> list[np.ndarray]:
    tip = [x[0] + LENGTH * np.sin(x[1]), -LENGTH * np.cos(x[1])]
    return [np.array([[x[0], 0.0], tip])]


if __name__ == "__main__":
    options = parse(__doc__)
    solution = col.solve(problem(), segments=25, solver=options.solver)
    report("hermite_simpson", solution)
    report("trapezoidal", col.solve(problem(), method="trapezoidal", solver=options.solver))
    # A better local optimum: the pole swings the other way before it goes up.
    other = {"t": [0, 1, 2], "x": [[0, 0, 0, 0], [0.5, -1, 0, 0], [1, np.pi, 0, 0]]}
    report("from another guess", col.solve(problem(other), solver=options.solver))
    fine = col.solve(problem(), segments=10, refine=1e-6, solver=options.solver)
    report("refined where needed", fine)
    for entry in fine.passes:
        print(f"  {entry.segments:4d} segments, {entry.iterations:3d} iterations, "
              f"error {entry.error:.1e}, objective {entry.objective:.8f}")  # fmt: skip
    times = np.linspace(0, 2, 12)
    finish(
        "cart-pole",
        solution,
        options.out,
        stop_action=plot_stop_action([pose(x) for x in solution.state(times)], times),
        states=plot_states(solution),
        controls=plot_controls(solution),
        errors=plot_errors(solution),
        iterations=plot_iterations(solution),
        phase_plane=plot_phase_plane(solution, 1, 3),
    )
