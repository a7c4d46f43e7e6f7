"""Order and energy of the five time schemes, measured by forward simulation.

    python bench/integrators.py [--image docs/images/integrators.png]
                                [--results bench/results/integrators.json]

Three experiments, each at halving time steps against a finely stepped simulation:

- tumbling: a chain of five links spins in free fall, joints loose; error of the motion;
- landing: the chain is dropped; what each scheme's residual says of samples of the exact motion;
- bounce: a capsule bounces without friction or damping; energy lost or made.
"""

from __future__ import annotations

import argparse
import json
import platform
import tempfile
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import trajopt
from trajopt.simulate import SimulationError, simulate
from trajopt.world import Contact

INTEGRATORS = ("implicit", "verlet", "fox_goodwin", "linear_acceleration", "trapezoidal")
STEPS = (0.05, 0.025, 0.0125, 0.00625, 0.003125)
ROOT = Path(__file__).resolve().parent.parent

CAPSULE = """<mujoco><worldbody><body name="capsule" pos="0 0 0.36"><freejoint/>
<geom type="capsule" size="0.06" fromto="-0.15 0 0 0.15 0 0" mass="0.3"/></body>
</worldbody></mujoco>
"""


def tumbling() -> dict[str, list[float]]:
    """Largest rms error over 0.6 s of free fall [m, rad]."""
    model = trajopt.load_model("chain")
    speed = np.zeros(model.ndof)
    speed[3:6] = (2.0, 3.0, 1.0)
    speed[6:] = np.random.default_rng(0).normal(size=model.ndof - 6)
    exact = simulate(model, model.home, speed, 0.6, 0.05, substeps=500).x

    def error(integrator: str, dt: float) -> float:
        run = simulate(
            model, model.home, speed, 0.6, 0.05, integrator=integrator, substeps=round(0.05 / dt)
        )
        return float(np.max(np.sqrt(np.mean(model.difference(exact, run.x) ** 2, axis=1))))

    return {name: [error(name, dt) for dt in STEPS] for name in INTEGRATORS}


def landing() -> dict[str, list[float]]:
    """Root force on exact samples of a drop from 0.5 m, rms, as a share of the weight."""
    model = trajopt.load_model("chain")
    start = model.home.copy()
    start[2] += 0.5
    stiffness = 9.81 * model.mass / (6 * 0.028**2)
    law = Contact(normal=stiffness, friction=stiffness, damping=0.0)
    fine = STEPS[-1]
    exact = simulate(model, start, np.zeros(model.ndof), 0.6, fine, contact=law, substeps=32).x

    def residual(integrator: str, dt: float) -> float:
        x = exact[:: round(dt / fine)]
        force = model.dynamics_residual(
            x[2:], x[1:-1], x[:-2], dt, contact=law, integrator=integrator
        )
        return float(np.sqrt(np.mean(force[:, :3] ** 2)) / (9.81 * model.mass))

    return {name: [residual(name, dt) for dt in STEPS] for name in INTEGRATORS}


def bounce() -> tuple[dict[str, list[float]], dict[str, Any]]:
    """Energy in the last flight of 2 s over that at the start, minus 1; heights at dt = 0.0125 s.

    Potential energy counts from where the capsule touches; without any flight all is lost: -1.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "capsule.xml"
        path.write_text(CAPSULE)
        model = trajopt.load_model(path)
    law = Contact(normal=3e3, friction=0.0, damping=0.0)
    heights: dict[str, Any] = {}

    def change(integrator: str, dt: float) -> float:
        try:
            run = simulate(
                model, model.home, np.zeros(6), 2.0, dt, contact=law, integrator=integrator
            )
        except SimulationError:
            return float("nan")
        z = run.x[:, 2]
        if dt == 0.0125:
            heights[integrator] = (run.times, z)
        energy = 9.81 * (z[1:-1] - 0.06) + 0.5 * ((z[2:] - z[:-2]) / (2 * dt)) ** 2
        free = np.minimum(np.minimum(z[2:], z[1:-1]), z[:-2]) > 0.06
        bounced = free & np.logical_or.accumulate(~free)
        return float(energy[bounced][-1] / energy[0] - 1.0) if np.any(bounced) else -1.0

    return {name: [change(name, dt) for dt in STEPS] for name in INTEGRATORS}, heights


def slopes(errors: list[float]) -> list[float]:
    """Observed order between neighbouring steps."""
    return [float(s) for s in np.diff(np.log(errors)) / np.diff(np.log(STEPS))]


def draw(tumble: Any, land: Any, energy: Any, heights: Any, path: Path) -> None:
    """Four panels: two orders, energy over dt, height over time."""
    figure, axes = plt.subplots(2, 2, figsize=(10, 7.5), layout="constrained")
    order, sample, loss, height = axes.ravel()
    for k, name in enumerate(INTEGRATORS):
        style = {"color": f"C{k}", "marker": "osv^D"[k], "label": name, "markersize": 5}
        order.loglog(STEPS, tumble[name], **style)
        sample.loglog(STEPS, land[name], **style)
        loss.semilogx(STEPS, np.clip(energy[name], -1.0, 1.0), **style)
        if name in heights:
            height.plot(*heights[name], color=f"C{k}", label=name)
    guide = np.array([0.05, 0.003125])
    order.loglog(guide, 3e-4 * (guide / 0.00625) ** 2, "k:", label="order 2")
    order.loglog(guide, 1e-2 * (guide / 0.00625), "k--", label="order 1")
    order.set(title="Tumbling in free fall", xlabel="dt [s]", ylabel="error, max of rms [m, rad]")
    sample.set(
        title="Residual of an exact landing", xlabel="dt [s]", ylabel="root force / weight, rms"
    )
    loss.set(
        title="Undamped bounce, 2 s", xlabel="dt [s]", ylabel="change of energy (clipped at ±1)"
    )
    height.set(title="The same at dt = 0.0125 s", xlabel="time [s]", ylabel="height [m]")
    for axis in (order, sample, loss):
        axis.minorticks_off()
        axis.set_xticks(STEPS, [f"{dt:g}" for dt in STEPS])
    for axis in axes.ravel():
        axis.grid(alpha=0.3)
    order.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, print, draw and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--image", type=Path, default=ROOT / "docs/images/integrators.png")
    parser.add_argument("--results", type=Path, default=ROOT / "bench/results/integrators.json")
    options = parser.parse_args()

    tumble, land = tumbling(), landing()
    energy, heights = bounce()
    print("dt [s]               " + "".join(f"{dt:>11g}" for dt in STEPS))
    for title, table in (("tumbling", tumble), ("landing", land), ("bounce", energy)):
        print(title)
        for name, row in table.items():
            print(f"  {name:<19}" + "".join(f"{value:>11.3g}" for value in row))
            if title != "bounce":
                print(f"  {'  slope':<30}" + "".join(f"{s:>11.2f}" for s in slopes(row)))
    draw(tumble, land, energy, heights, options.image)
    record = {
        "machine": platform.processor() or platform.machine(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "trajopt": trajopt.__version__,
        "steps": STEPS,
        "tumbling_error": tumble,
        "landing_residual_share_of_weight": land,
        "bounce_energy_change": {
            name: [value if np.isfinite(value) else None for value in row]
            for name, row in energy.items()
        },
    }
    options.results.parent.mkdir(parents=True, exist_ok=True)
    options.results.write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
