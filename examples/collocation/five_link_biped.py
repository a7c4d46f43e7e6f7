"""Walk with the least torque squared: a five-link biped (Kelly, section 7).

python examples/collocation/five_link_biped.py [--out DIR] [--solver ipopt|native]
"""

from __future__ import annotations

import numpy as np
from _biped_model import DURATION, Biped, problem
from _common import finish, parse, report

from trajopt import collocation as col
from trajopt.plotting.collocation import (
    plot_controls,
    plot_errors,
    plot_states,
    plot_stop_action,
)


def pose(biped: Biped, q: np.ndarray) -> list[np.ndarray]:
    p0, p1, p2, p3, p4, p5 = biped.points(q)
    return [np.array([p0, p1, p2, p4, p5]), np.array([p2, p3])]


if __name__ == "__main__":
    options = parse(__doc__)
    # Two meshes, as in section 7.6.
    meshes = [{"segments": 5, "tolerance": 1e-3}, {"segments": 25, "tolerance": 1e-8}]
    found = {
        side: col.solve(problem(side), refine=meshes, solver=options.solver)
        for side in ("hip", "shoulder")
    }
    for side, each in found.items():
        report(f"center of mass of the torso 0.2 m from the {side}", each)
    for side in ("hip", "shoulder"):
        other = col.solve(problem(side, knee_torque=0.0), segments=25, solver=options.solver)
        report(f"another gait, {side}", other)
    solution, times = found["hip"], np.linspace(0, DURATION, 9)
    poses = [pose(Biped(), x[:5]) for x in solution.state(times)]
    finish(
        "biped",
        solution,
        options.out,
        stop_action=plot_stop_action(poses, times),
        states=plot_states(solution),
        controls=plot_controls(solution),
        errors=plot_errors(solution),
    )
