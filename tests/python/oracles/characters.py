"""The built-in characters, random states of them, and one law for core and oracle alike."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import trajopt
from trajopt import _core

from .reference import Law, Reference

CHARACTERS = ["chain", "biped", "bird", "mammal", "spider", "humanoid"]
INTEGRATORS = ["implicit", "verlet", "fox_goodwin", "linear_acceleration", "trapezoidal"]
CENTRED = INTEGRATORS[1:]


@cache
def character(name: str) -> Any:
    return trajopt.load_model(name)


@cache
def arguments(name: str) -> dict[str, Any]:
    return dict(character(name).core_arguments())


@cache
def core(name: str) -> Any:
    return _core.Model(**arguments(name))


@cache
def reference(name: str, count: int = 6) -> Reference:
    return Reference(arguments(name), count)


def physics(law: Law) -> Any:
    """The same law for the core."""
    return _core.Physics(
        gravity=law.gravity,
        ground=law.ground,
        plane_normal=law.plane_normal,
        plane_offset=law.plane_offset,
        normal=law.normal,
        friction=law.friction,
        damping=law.damping,
        coulomb=law.coulomb,
        mu=law.mu,
        slip_velocity=law.slip_velocity,
        limit=law.limit,
        self_collision=law.self_collision,
        integrator=law.integrator,
    )


def natural_law(name: str, **changes: Any) -> Law:
    """Stiffnesses under which the character sinks in by about a fiftieth of its size."""
    model = character(name)
    weight = 9.81 * model.mass
    stiffness = weight / (4.0 * (0.02 * model.length) ** 2)
    defaults = {
        "normal": stiffness,
        "friction": stiffness / np.sqrt(9.81 * model.length) * 3.0,
        "limit": weight * model.length,
        "self_collision": weight / model.length**2,
    }
    return Law(**{**defaults, **changes})


def states(name: str, count: int, dt: float, seed: int, touching: bool) -> list[Any]:
    """Three frames (count, D) each: any orientation, limits overstepped, on the ground or above."""
    model, rng = character(name), np.random.default_rng(seed)
    x = model.home + 0.5 * rng.normal(size=(count, model.ndof))
    x[:, 3:6] = 1.5 * rng.normal(size=(count, 3))
    lowest = np.min(
        reference(name).frame(x).contact[..., 2] - reference(name).contact_radius, axis=1
    )
    x[:, 2] -= lowest + (0.05 if touching else -0.5) * model.length
    speed = np.sqrt(9.81 * model.length)
    return [x, *(x - dt * speed * (k + 0.5 * rng.normal(size=x.shape)) for k in (0.3, 0.6))]
