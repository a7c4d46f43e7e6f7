"""Frame dynamics and a whole iteration against pinocchio and Crocoddyl, interleaved, on one core.

    pip install pin crocoddyl
    OMP_NUM_THREADS=1 python -m bench.compare dynamics [--rounds 9] [--out FILE]

Ours: residual FD and its three Jacobians by frames i, i-1, i-2 (`Model.dynamics_jacobians`; the
core's batch call, all frames of a motion at once). Theirs: `computeRNEADerivatives`, which gives
the force and its derivatives by position, velocity and acceleration: as many numbers, without
contact and self collision. The peer's trees are made from the same arrays, a free flyer in place of
three slides and a ball, revolute joints about coordinate axes where an axis is one; its figure is a
C++ call made from Python, less the time of a call on a tree of one joint.

Iteration: one of `trajopt.solve` on mammal-walk (400 frames, contacts found) beside one of
Crocoddyl's FDDP (derivatives, backward pass, one rollout) on the same tree with 400 nodes in free
flight, which is the easier problem: forward dynamics with contacts given cost more.

Every round measures each row of both sides once; a row's figure is its best round.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import crocoddyl
import numpy as np
import pinocchio as pin

import trajopt
from trajopt import _core
from trajopt.model import BALL, HINGE
from trajopt.transcription import Stage, Transcription

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
from _machine import RESULTS, describe, environment, write

FRAMES = 512  # of one batch call
CALLS = 2000  # of the peer
NODES = 400
DT = 0.025
TAIL = 5  # joints that make a humanoid's 33 dofs 38
MUST = {"mammal": 3.0, "humanoid": 8.0, "humanoid and tail": 8.0}  # microseconds, with Jacobians


def with_tail(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return a tree with five more hinges in a row behind its root link."""
    out = dict(arguments)
    joints = len(arguments["joint_type"])
    place = np.concatenate([np.eye(3), [[-0.1], [0.0], [0.0]]], axis=1)
    cloud = np.array([[-0.05, y, z, 1.0] for y in (-0.02, 0.02) for z in (-0.02, 0.02)])
    heavy = np.concatenate([cloud, cloud + [-0.05, 0, 0, 0]])
    extra = {
        "joint_type": np.full(TAIL, HINGE),
        "joint_parent": np.array([3, *range(joints, joints + TAIL - 1)]),
        "joint_offset": np.repeat(place[None], TAIL, axis=0),
        "joint_axis": np.eye(3)[[1, 2, 1, 2, 1]],
        "link_inertia": np.repeat(0.01 * (heavy.T @ heavy)[None], TAIL, axis=0),
        "lower": np.full(TAIL, -np.inf),
        "upper": np.full(TAIL, np.inf),
        "actuated": np.full(TAIL, True),
    }
    for key, value in extra.items():
        out[key] = np.concatenate([np.asarray(arguments[key]), value])
    return out


def peer_tree(arguments: dict[str, Any]) -> pin.Model:
    """The same tree for pinocchio: free flyer, then hinges."""
    model = pin.Model()
    kinds = list(arguments["joint_type"])
    if kinds[:4] != [0, 0, 0, BALL] or any(k != HINGE for k in kinds[4:]):
        raise SystemExit("expected a free base and hinges")
    aligned = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)
    ids = [0, 0, 0, model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")]
    for j in range(3, len(kinds)):
        if j > 3:
            axis, offset = arguments["joint_axis"][j], arguments["joint_offset"][j]
            kind = (
                aligned[int(np.argmax(axis))]()
                if np.max(axis) == 1.0
                else pin.JointModelRevoluteUnaligned(axis)
            )
            place = pin.SE3(offset[:, :3], offset[:, 3])
            ids.append(model.addJoint(ids[arguments["joint_parent"][j]], kind, place, f"j{j}"))
        pseudo = arguments["link_inertia"][j]
        mass = pseudo[3, 3]
        if mass > 0:
            center = pseudo[:3, 3] / mass
            second = pseudo[:3, :3] - mass * np.outer(center, center)
            about = np.trace(second) * np.eye(3) - second
            model.appendBodyToJoint(ids[j], pin.Inertia(mass, center, about), pin.SE3.Identity())
    return model


def seconds(call: Callable[[], Any]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


class Best:
    """Least time of each row over the rounds."""

    def __init__(self) -> None:
        self.calls: dict[str, Callable[[], float]] = {}
        self.least: dict[str, float] = {}

    def add(self, name: str, call: Callable[[], float]) -> None:
        self.calls[name] = call

    def round(self) -> None:
        for name, call in self.calls.items():
            self.least[name] = min(call(), self.least.get(name, np.inf))


def characters() -> dict[str, tuple[dict[str, Any], Any, Any]]:
    """Core arguments, settled pose and contact law of the trees that are measured."""
    out = {}
    for name in ("mammal", "humanoid"):
        problem = trajopt.Problem(trajopt.load_model(name), duration=1.0, dt=DT)
        task = Transcription(problem)
        arguments = problem.model.core_arguments(task.scales.mass, task.scales.length)
        pose = task.initial_frames(Stage())[1] / task.scales.coordinate
        out[name] = (arguments, pose, task.physics(Stage()))
    arguments, pose, physics = out["humanoid"]
    out["humanoid and tail"] = (
        with_tail(arguments),
        np.concatenate([pose, np.zeros(TAIL)]),
        physics,
    )
    return out


def add_dynamics(best: Best, name: str, arguments: dict[str, Any], pose: Any, law: Any) -> int:
    core = _core.Model(**arguments)
    sway = 0.01 * np.sin(0.3 * np.arange(FRAMES + 2)[:, None] + np.arange(core.ndof))
    dt = np.full(FRAMES, 0.1)
    empty = _core.Physics(ground=False, gravity=(0.0, 0.0, -1.0), integrator="implicit")
    for label, physics in (("free", empty), ("standing", law)):
        x = pose + sway * (np.arange(core.ndof) != 2)
        for part, call in (("residual", core.residual), ("jacobians", core.jacobians)):
            best.add(
                f"{name}: {part}, {label}",
                lambda call=call, x=x, physics=physics: (
                    seconds(lambda: call(x[2:], x[1:-1], x[:-2], dt, physics, threads=1))
                    / FRAMES
                    * 1e6
                ),
            )
    model = peer_tree(arguments)
    if model.nv != core.ndof:
        raise SystemExit(f"{name}: {model.nv} velocities, expected {core.ndof}")
    data = model.createData()
    q, rng = pin.neutral(model), np.random.default_rng(0)
    v, a = rng.normal(size=model.nv), rng.normal(size=model.nv)

    def peer(function: Callable[..., Any]) -> float:
        begin = time.perf_counter()
        for _ in range(CALLS):
            function(model, data, q, v, a)
        return (time.perf_counter() - begin) / CALLS * 1e6

    best.add(f"{name}: residual, pinocchio", lambda: peer(pin.rnea))
    best.add(f"{name}: jacobians, pinocchio", lambda: peer(pin.computeRNEADerivatives))
    return int(core.ndof)


def add_call(best: Best) -> None:
    """What it costs to call pinocchio from Python: a tree of one joint."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "j")
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    data = model.createData()
    q = v = a = np.zeros(1)
    for part, function in (("residual", pin.rnea), ("jacobians", pin.computeRNEADerivatives)):

        def call(function: Callable[..., Any] = function) -> float:
            begin = time.perf_counter()
            for _ in range(CALLS):
                function(model, data, q, v, a)
            return (time.perf_counter() - begin) / CALLS * 1e6

        best.add(f"call: {part}", call)


def add_iteration(best: Best) -> None:
    problem, options = trajopt.load_scenario("mammal-walk").build()
    options = {**options, "seed": 0, "threads": 1, "max_iterations": 20}

    def ours() -> float:
        history = trajopt.solve(problem, **options).history
        return float(np.median([sum(r.seconds.values()) for r in history])) * 1e3

    best.add("iteration: trajopt", ours)

    task = Transcription(trajopt.Problem(trajopt.load_model("mammal"), duration=1.0, dt=DT))
    arguments = task.problem.model.core_arguments()
    model = peer_tree(arguments)
    model.effortLimit = np.full(model.nv, 1e3)
    state = crocoddyl.StateMultibody(model)
    actuation = crocoddyl.ActuationModelFloatingBase(state)
    alive: list[Any] = [model, state, actuation]  # Crocoddyl's objects do not keep each other
    costs = crocoddyl.CostModelSum(state, actuation.nu)
    control = crocoddyl.ResidualModelControl(state, actuation.nu)
    rest = crocoddyl.ResidualModelState(state, state.zero(), actuation.nu)
    speed = crocoddyl.ResidualModelCoMPosition(state, np.array([0.3, 0.0, 0.3]), actuation.nu)
    for name, residual, weight in (
        ("control", control, 1e-2),
        ("state", rest, 1e-2),
        ("speed", speed, 1.0),
    ):
        cost = crocoddyl.CostModelResidual(state, residual)
        costs.addCost(name, cost, weight)
        alive += [residual, cost]
    step = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
    node = crocoddyl.IntegratedActionModelEuler(step, DT)
    x0 = np.concatenate([pin.neutral(model), np.zeros(model.nv)])
    shooting = crocoddyl.ShootingProblem(x0, [node] * NODES, node)
    solver = crocoddyl.SolverFDDP(shooting)
    still = [np.zeros(actuation.nu)] * NODES
    solver.setCandidate([x0] * (NODES + 1), still, False)

    alive += [costs, step, node, shooting, solver]

    def theirs() -> float:
        assert alive
        begin = time.perf_counter()
        solver.computeDirection(True)
        solver.tryStep(1.0)
        return (time.perf_counter() - begin) * 1e3

    best.add("iteration: crocoddyl", theirs)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--out", type=Path, default=RESULTS / "dynamics.json")
    args = parser.parse_args(arguments)

    best = Best()
    add_call(best)
    dofs = {name: add_dynamics(best, name, *rest) for name, rest in characters().items()}
    add_iteration(best)
    for _ in range(args.rounds):
        best.round()

    rows = []
    for name, d in dofs.items():
        for part in ("residual", "jacobians"):
            peer = best.least[f"{name}: {part}, pinocchio"] - best.least[f"call: {part}"]
            for label in ("free", "standing"):
                ours = best.least[f"{name}: {part}, {label}"]
                must = MUST[name] if part == "jacobians" else None
                rows.append(
                    {
                        "character": name,
                        "D": d,
                        "what": f"{part}, {label}",
                        "trajopt_us": ours,
                        "pinocchio_us": peer,
                        "ratio": peer / ours,
                        "must_us": must,
                        "met": None if must is None else ours <= must,
                    }
                )
    machine = {
        **environment(),
        "pinocchio": pin.__version__,
        "crocoddyl": crocoddyl.__version__,
    }
    iteration = {
        "trajopt_ms": best.least["iteration: trajopt"],
        "crocoddyl_ms": best.least["iteration: crocoddyl"],
    }
    results = {"machine": machine, "call_us": best.least["call: jacobians"], "frame": rows}
    results["iteration"] = iteration
    print(describe(machine), f"pinocchio {pin.__version__}, Crocoddyl {crocoddyl.__version__}")
    for row in rows:
        print(
            f"{row['character']:18s} D {row['D']:2d}  {row['what']:20s}"
            f" {row['trajopt_us']:7.2f} us   pinocchio {row['pinocchio_us']:6.2f} us"
            f"   {row['ratio']:5.1f} x"
        )
    print(
        f"iteration, D 18, N {NODES}: {iteration['trajopt_ms']:.2f} ms, "
        f"Crocoddyl {iteration['crocoddyl_ms']:.1f} ms"
    )
    write(args.out, results)


if __name__ == "__main__":
    main(sys.argv[1:])
