"""Writes bench/data/*.txt: built-in characters as the core sees them, for dynamics_bench.cpp.

Numbers only, separated by white space, in the solver's scaled units; dynamics_bench.cpp reads them
in the same order. ``python bench/characters.py`` after a change of a character or a contact law;
with ``--motion FILE.npz`` the frames of a solved mammal-walk are taken from there, else the
scenario is solved.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trajopt
from trajopt.transcription import Stage, Transcription

DATA = Path(__file__).with_name("data")
FRAMES = 64  # of the gait that is written: every phase of the walk
START = 120


def words(values: Any) -> str:
    """One line of numbers that read back to the same bits."""
    return " ".join(f"{v:.17g}" for v in np.ravel(values).astype(float))


def character(problem: trajopt.Problem, frames: NDArray[np.float64] | None) -> str:
    """Model, force law and frames (n, D) [m, rad] of a problem; without frames its settled pose."""
    task = Transcription(problem)
    model, scales = problem.model, task.scales
    core = model.core_arguments(scales.mass, scales.length)
    contact = task.staged_contact(Stage())
    internal = problem.internal
    if frames is None:
        frames = task.initial_frames(Stage())[1:]
    lines = [words([len(model.joint_type), model.npoints, len(model.sphere_radius)])]
    lines[0] += " " + words([len(model.sphere_pairs), len(frames), problem.steps[0] / scales.time])
    for j in range(len(model.joint_type)):
        lines.append(words([core["joint_type"][j], core["joint_parent"][j]]))
        lines[-1] += " " + words(core["joint_offset"][j]) + " " + words(core["joint_axis"][j])
        lines[-1] += " " + words(core["link_inertia"][j])
    lower, upper = (np.clip(core[k], -1e300, 1e300) for k in ("lower", "upper"))
    lines += [words(lower), words(upper), words(core["actuated"])]
    for kind in ("point", "sphere"):
        for joint, place, radius in zip(
            core[f"{kind}_joint"], core[f"{kind}_position"], core[f"{kind}_radius"], strict=True
        ):
            lines.append(words([joint, *place, radius]))
    lines.append(words(core["sphere_pairs"]))
    if contact is None:
        raise SystemExit(f"{model.name}: nothing to stand on")
    lines.append(
        words(
            [
                contact.normal * scales.length**2 / scales.force,
                contact.friction * scales.length**2 * scales.velocity / scales.force,
                contact.damping * scales.velocity,
                contact.model == "coulomb",
                contact.mu,
                contact.slip_velocity / scales.velocity,
                internal.limit,
                internal.self_collision,
            ]
        )
    )
    lines += [words(x) for x in frames / scales.coordinate]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--motion", type=Path, help="a solved mammal-walk")
    args = parser.parse_args()
    problem, options = trajopt.load_scenario("mammal-walk").build()
    if args.motion:
        x = np.load(args.motion)["x"]
    else:
        x = trajopt.solve(problem, **{**options, "threads": 1}).x
    DATA.mkdir(exist_ok=True)
    (DATA / "mammal-walk.txt").write_text(character(problem, x[START : START + FRAMES]))
    for name in ("mammal", "humanoid"):
        standing = trajopt.Problem(trajopt.load_model(name), duration=1.0, dt=0.025)
        (DATA / f"{name}.txt").write_text(character(standing, None))


if __name__ == "__main__":
    main()
