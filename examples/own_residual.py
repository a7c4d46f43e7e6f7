"""Residuals of your own: a chain keeps its middle joint bent and nods twice a second.

    python examples/own_residual.py [--out DIR] [--quick]

Needs CasADi: pip install 'contact-trajopt[casadi]'
"""

from __future__ import annotations

import numpy as np
from _common import finish, parse

import trajopt
from trajopt.objectives import Residual, regularizers

options = parse(__doc__)
model = trajopt.load_model("chain")
problem = trajopt.Problem(model, duration=1.0 if options.quick else 3.0, dt=0.05)
bent, nodding = 6, 8
omega = 2 * np.pi * 2.0


def bend(_x2, _x1, x):
    return x[bent] - 0.5


def nod(x2, x1, x):
    """An oscillator, without its time: the second difference is -omega² times the angle."""
    return (x[nodding] - 2 * x1[nodding] + x2[nodding]) / 0.05**2 / omega**2 + x1[nodding] - 0.2


problem.add(Residual(bend, weight=5.0, name="bent joint"), Residual(nod, name="nodding"))
problem.add(*regularizers(0.1))

solution = trajopt.solve(problem, max_iterations=options.iterations, threads=options.threads)
print(f"{model.dof_names[bent]}: {solution.x[len(solution.x) // 2, bent]:.3f} rad half way")
finish("own_residual", solution, options)
