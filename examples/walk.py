"""A four-legged character walks. Nobody says when, where or with which foot to step.

python examples/walk.py [--out DIR] [--quick]
"""

from __future__ import annotations

from _common import finish, parse

import trajopt
from trajopt.objectives import CenterOfMassVelocity, regularizers

options = parse(__doc__)
model = trajopt.load_model("mammal")
problem = trajopt.Problem(model, duration=1.0 if options.quick else 5.0, dt=0.025)
# The first part does not count: the motion starts from rest.
problem.add(CenterOfMassVelocity((0.3, 0.0, 0.0), start=0.2 * problem.duration))
problem.add(*regularizers())

solution = trajopt.solve(problem, max_iterations=options.iterations, threads=options.threads)
finish("walk", solution, options)
