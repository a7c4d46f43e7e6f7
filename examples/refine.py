"""Physics between the frames: refine the time grid only where the motion needs it.

python examples/refine.py [--out DIR] [--quick]
"""

from __future__ import annotations

from _common import finish, parse

import trajopt

options = parse(__doc__)
problem, settings = trajopt.load_scenario("hop").override(["grid.dt=0.05"]).build()
settings |= {"threads": options.threads, "max_iterations": options.iterations}

coarse = trajopt.solve(problem, **settings)
fine = trajopt.solve(
    problem, refine=0.02, max_refinements=1 if options.quick else 3, warm_start=coarse, **settings
)
for name, solution in (("coarse", coarse), ("refined", fine)):
    share = solution.summary()["fine_violation_rms"]
    print(f"{name:8} {solution.frames:4d} frames, residual between frames {100 * share:.2f} %")
finish("refine", fine, options)
