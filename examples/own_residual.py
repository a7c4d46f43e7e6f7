"""Residuals of your own: a chain keeps a joint bent, head and tail swing twice a second.

    python examples/own_residual.py [--out DIR] [--quick]

Needs CasADi: pip install '.[casadi]'
"""

from __future__ import annotations

import numpy as np
from _common import finish, parse

import trajopt
from trajopt.objectives import Residual, regularizers

options = parse(__doc__)
model = trajopt.load_model("chain")
dt = 0.05
problem = trajopt.Problem(model, duration=1.0 if options.quick else 3.0, dt=dt)
front, head, tail = (model.dof_names.index(n) for n in ("front_pitch", "head_yaw", "tail_yaw"))
omega, amplitude = 2 * np.pi * 2.0, 0.3


def bend(_x2, _x1, x):
    return x[front] - 0.5


def swing(x2, x1, x):
    """Head and tail chase each other around a circle, which has no place to rest."""
    turn = (x - x2) / (2 * dt * omega)
    return [
        turn[head] - x1[tail],
        turn[tail] + x1[head],
        (x1[head] ** 2 + x1[tail] ** 2) / amplitude - amplitude,
    ]


problem.add(Residual(bend, name="bent joint"), Residual(swing, weight=5.0, name="swing"))
problem.add(*regularizers(0.1))

solution = trajopt.solve(problem, max_iterations=options.iterations, threads=options.threads)
angle = solution.x[:, head]
print(f"{model.dof_names[front]}: {solution.x[len(solution.x) // 2, front]:.3f} rad half way")
print(f"{model.dof_names[head]}: {angle.min():.2f} to {angle.max():.2f} rad")
finish("own_residual", solution, options)
