"""Drake: DirectCollocation, cubic states and linear inputs, on a MultibodyPlant, by IPOPT."""

# ruff: noqa: E402
from __future__ import annotations

import os
import re
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

import five_link_biped as walker
from pydrake.multibody.tree import RotationalInertia
from pydrake.solvers import CommonSolverOption, SnoptSolver

SOLVER = "ipopt"
# user code: begin
import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)
from pydrake.planning import DirectCollocation
from pydrake.solvers import IpoptSolver, SolverOptions
from pydrake.trajectories import PiecewisePolynomial


def cart_pole(segments: int) -> Any:
    plant = MultibodyPlant(0.0)
    cart = plant.AddRigidBody("cart", SpatialInertia(1.0, [0, 0, 0], UnitInertia.SolidSphere(0.1)))
    tip = [0, 0, -0.5]
    pole = plant.AddRigidBody("pole", SpatialInertia(0.3, tip, UnitInertia.PointMass(tip)))
    slide = plant.AddJoint(PrismaticJoint("x", plant.world_frame(), cart.body_frame(), [1, 0, 0]))
    plant.AddJoint(RevoluteJoint("q", cart.body_frame(), pole.body_frame(), [0, -1, 0]))
    plant.AddJointActuator("force", slide)
    dircol, prog = transcribe(plant, 2.0, segments)
    x, u = dircol.state(), dircol.input()
    for bound in (x[0] <= 2, x[0] >= -2, u[0] <= 20, u[0] >= -20):
        dircol.AddConstraintToAllKnotPoints(bound)
    end = [1, np.pi, 0, 0]
    prog.AddBoundingBoxConstraint([0] * 4, [0] * 4, dircol.initial_state())
    prog.AddBoundingBoxConstraint(end, end, dircol.final_state())
    dircol.AddRunningCost(u[0] ** 2)
    guess(dircol, 2.0, [[0] * 4, end], 1)
    return prog


def transcribe(plant: Any, duration: float, segments: int) -> Any:
    plant.Finalize()
    step = duration / segments
    dircol = DirectCollocation(
        plant, plant.CreateDefaultContext(), segments + 1, step, step,
        input_port_index=plant.get_actuation_input_port().get_index(),
        assume_non_continuous_states_are_fixed=True,
    )  # fmt: skip
    return dircol, dircol.prog()


def guess(dircol: Any, duration: float, ends: Any, inputs: int) -> None:
    hold = PiecewisePolynomial.FirstOrderHold
    times = [0, duration]
    dircol.SetInitialTrajectory(
        hold(times, np.zeros((inputs, 2))), hold(times, np.array(ends, dtype=float).T)
    )


# user code: end


def biped(segments: int) -> Any:
    """Return the walker with the angles of its joints as states: sums of them are the links'."""
    plant = MultibodyPlant(0.0)
    center = [
        walker.TIBIA - walker.D_TIBIA, walker.FEMUR - walker.D_FEMUR, walker.D_TORSO,
        -walker.D_FEMUR, -walker.D_TIBIA,
    ]  # fmt: skip
    offset = [0.0, walker.TIBIA, walker.FEMUR, 0.0, -walker.FEMUR]
    parent = plant.world_frame()
    for i in range(5):
        inertia = RotationalInertia(*[walker.INERTIA[i]] * 3)
        link = plant.AddRigidBody(
            f"link{i}",
            SpatialInertia.MakeFromCentralInertia(walker.MASS[i], [0, 0, center[i]], inertia),
        )
        place = RigidTransform([0, 0, offset[i]])
        joint = plant.AddJoint(
            RevoluteJoint(f"q{i}", frame(plant, parent, place, i), link.body_frame(), [0, -1, 0])
        )
        if i:
            plant.AddJointActuator(f"u{i}", joint)
        parent = link.body_frame()
    dircol, prog = transcribe(plant, walker.STEP_TIME, segments)
    u = dircol.input()
    for each in u:
        dircol.AddConstraintToAllKnotPoints(each <= 100)
        dircol.AddConstraintToAllKnotPoints(each >= -100)
    dircol.AddRunningCost(u.dot(u))

    def ends(values: Any) -> Any:
        x0, xf = (absolute(v) for v in (values[:10], values[10:]))
        return np.array(walker.boundary(0.0, 0.0, x0, xf))

    prog.AddConstraint(
        ends, [0.0] * 13 + [-np.inf], [0.0] * 12 + [np.inf, 0.0],
        np.concatenate([dircol.initial_state(), dircol.final_state()]),
    )  # fmt: skip
    first = np.array([-0.3, 0.7, 0.0, -0.5, -0.6])
    rate = (first[::-1] - first) / walker.STEP_TIME
    relative = [np.concatenate([np.diff(q, prepend=0), np.diff(rate, prepend=0)])
                for q in (first, first[::-1])]  # fmt: skip
    guess(dircol, walker.STEP_TIME, relative, 4)
    return prog


def frame(plant: Any, parent: Any, place: Any, i: int) -> Any:
    return plant.AddFrame(FixedOffsetFrame(f"hinge{i}", parent, place))


def absolute(x: Any) -> list[Any]:
    return [*np.cumsum(x[:5]), *np.cumsum(x[5:])]


from pydrake.math import RigidTransform
from pydrake.multibody.tree import FixedOffsetFrame


def settings() -> SolverOptions:
    options = SolverOptions()
    options.SetOption(IpoptSolver.id(), "tol", 1e-8)
    options.SetOption(SnoptSolver.id(), "Major optimality tolerance", 1e-8)
    options.SetOption(SnoptSolver.id(), "Major feasibility tolerance", 1e-8)
    return options


def solve(program: Any) -> dict[str, Any]:
    options = settings()
    solver = IpoptSolver() if SOLVER == "ipopt" else SnoptSolver()
    began = time.perf_counter()
    found = solver.Solve(program, None, options)
    seconds = time.perf_counter() - began
    return {
        "seconds": seconds,
        "objective": found.get_optimal_cost(),
        "status": str(found.get_solution_result()).rpartition(".")[2],
    }


def iterations(program: Any) -> int | None:
    """Return the count from the file that the solver writes in another run."""
    options = settings()
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "log")  # noqa: PTH118
        if SOLVER == "ipopt":
            options.SetOption(IpoptSolver.id(), "output_file", path)
            options.SetOption(IpoptSolver.id(), "file_print_level", 5)
            IpoptSolver().Solve(program, None, options)
            pattern = r"Number of Iterations\.*: *(\d+)"
        else:
            options.SetOption(CommonSolverOption.kPrintFileName, path)
            SnoptSolver().Solve(program, None, options)
            pattern = r"No\. of major iterations *(\d+)"
        match = re.search(pattern, Path(path).read_text(errors="replace"))
    return int(match[1]) if match else None


def versions() -> dict[str, str]:
    return {"drake": version("drake")}
