"""Solutions made by hand, for what has to work on any solution, however it was found."""

from __future__ import annotations

import numpy as np

import trajopt
from trajopt.records import IterationRecord


def history(count: int = 60) -> list[IterationRecord]:
    """Records that look like those of a solve with two stages."""
    records = []
    for k in range(count):
        decay = np.exp(-k / 12.0)
        terms = {"center_of_mass_velocity": 0.9 * decay, "control_effort": 0.02 + 0.05 * decay}
        records.append(
            IterationRecord(
                k,
                stage=int(k > count // 2),
                objective=sum(terms.values()),
                objective_terms=terms,
                constraint_violation=10.0 ** (1 - k / 8),
                frame_violation=10.0 ** (-k / 8),
                merit_penalty=1.0,
                radius=0.5 + 0.3 * np.sin(k),
                step_norm=0.4 * decay + 0.01,
                accepted=k % 5 != 3,
                seconds={"dynamics": 1e-3, "factorization": 2e-3},
                elapsed=0.004 * k * (1 + 0.2 * (k > 30)),
            )
        )
    return records


def motion(
    name: str = "mammal",
    *,
    frames: int = 80,
    dt: float = 0.025,
    speed: float = 0.6,
    hop: float = 0.0,
) -> trajopt.Solution:
    """A character that swings its legs while it glides, or flies a parabola."""
    model = trajopt.load_model(name)
    times = dt * np.arange(1, frames + 1)
    x = np.tile(model.home, (frames, 1))
    x[:, 0] += speed * times
    x[:, 2] += hop * np.sin(np.pi * times / times[-1]) ** 2
    phase = np.arange(model.ndof - 6) * 2.1
    x[:, 6:] += 0.25 * np.sin(2 * np.pi * times[:, None] - phase)
    points = model.contact_positions(x)
    weight = 9.81 * model.mass
    forces = np.zeros_like(points)
    share = np.maximum(np.sin(2 * np.pi * times[:, None] - np.arange(model.npoints)), 0.0) ** 2
    forces[..., 2] = weight * share / np.maximum(share.sum(axis=1, keepdims=True), 0.3)
    rng = np.random.default_rng(0)
    return trajopt.Solution(
        model,
        trajopt.Status.SOLVED,
        "step 1e-7 < 1e-6 and ‖C‖∞ 3e-9 N < 1e-8 N",
        x=x,
        times=times,
        dt=dt,
        initial=np.tile(model.home, (2, 1)),
        world=trajopt.World([trajopt.Plane()]),
        contact=trajopt.Contact(damping=0.5),
        u=rng.normal(size=(frames, model.nactuated)),
        control_points=rng.normal(size=(frames // 10, 2, model.ndof)),
        contact_forces=forces,
        contact_points=points,
        center_of_mass=model.center_of_mass(x),
        iterations=59,
        objective=0.0256,
        objective_terms={"control_effort": 0.0206, "center_of_mass_velocity": 0.005},
        constraint_violation=3e-9,
        frame_violation=1e-8 * rng.random(frames),
        fine_violation=1e-2 * rng.random(4 * frames),
        body_weight=weight,
        seconds=1.25,
        seed=3,
        history=history(),
        settings={"scenario": {"name": f"{name}-test"}},
    )
