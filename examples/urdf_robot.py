"""A robot from a URDF file: it floats, stands on its feet, and is asked to look around.

python examples/urdf_robot.py [--out DIR] [--quick]
"""

from __future__ import annotations

from pathlib import Path

from _common import finish, parse

import trajopt
from trajopt.objectives import PointPosition, regularizers

options = parse(__doc__)
model = trajopt.load_model(Path(__file__).with_name("stool.urdf"))
print(model)
problem = trajopt.Problem(model, duration=1.0 if options.quick else 2.0, dt=0.05)
# At the end the tip of the neck is to be 15 cm further to the front than at the start.
tip = (0.0, 0.0, 0.25)
frame = model.transforms(model.home)[model.body_names.index("neck")]
start = frame[:, :3] @ tip + frame[:, 3]
problem.add(PointPosition("neck", start + [0.15, 0.0, -0.03], point=tip, time=problem.duration))
problem.add(*regularizers(0.1))

solution = trajopt.solve(problem, max_iterations=options.iterations, threads=options.threads)
frame = model.transforms(solution.x[-1])[model.body_names.index("neck")]
print(f"tip moved by {(frame[:, :3] @ tip + frame[:, 3] - start).round(3)} m")
finish("urdf_robot", solution, options)
