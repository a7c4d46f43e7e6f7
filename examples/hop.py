"""One hop, watched while the solver works: a callback prints, and could stop it.

python examples/hop.py [--out DIR] [--quick]
"""

from __future__ import annotations

from _common import finish, parse

import trajopt
from trajopt.objectives import (
    CenterOfMassPosition,
    ContactForceRate,
    ContactSlip,
    ControlEffort,
    Smoothness,
    TerminalPose,
)


def watch(record: trajopt.IterationRecord) -> bool:
    if record.iteration % 25 == 0:
        print(
            f"{record.iteration:5d}  stage {record.stage}  objective {record.objective:.4f}"
            f"  physics {record.frame_violation:.1e} body weights"
        )
    return record.elapsed > 120.0


options = parse(__doc__)
model = trajopt.load_model("biped")
problem = trajopt.Problem(model, duration=2.0, dt=0.05 if options.quick else 0.025)
problem.add(
    CenterOfMassPosition((0.0, 0.0, 0.3), time=1.0, relative=True),
    ControlEffort(0.01),
    Smoothness(3e-4),
    ContactForceRate(3e-3),
    ContactSlip(10.0),
    TerminalPose(0.1),
)
solution = trajopt.solve(
    problem, callback=watch, max_iterations=options.iterations, threads=options.threads
)
rise = solution.center_of_mass[:, 2] - model.center_of_mass(solution.initial[0])[2]
print(f"apex {rise.max():.3f} m above the start")
finish("hop", solution, options)
