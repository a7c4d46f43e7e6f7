"""A gait that repeats: the last frame leads into the first, one stride further.

python examples/periodic_gait.py [--out DIR] [--quick]
"""

from __future__ import annotations

import numpy as np
from _common import finish, parse

import trajopt
from trajopt.objectives import CenterOfMassVelocity, regularizers

options = parse(__doc__)
model = trajopt.load_model("mammal")
stride = np.array([0.3, 0.0, 0.0])
problem = trajopt.Problem(
    model, duration=1.0, dt=0.05 if options.quick else 0.025, periodic=True, stride=stride
)
problem.add(CenterOfMassVelocity(stride / problem.duration), *regularizers())

solution = trajopt.solve(problem, max_iterations=options.iterations, threads=options.threads)
seam = solution.x[-1] - solution.initial[0]
print(f"moved by {seam[:3].round(6)} m in a period, all else by {np.abs(seam[3:]).max():.1e}")
finish("periodic_gait", solution, options)
