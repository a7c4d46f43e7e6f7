"""World, contact law and integrator as the numbers the core works with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import _core

if TYPE_CHECKING:
    from trajopt.scaling import Scales
    from trajopt.world import ResolvedContact, World

__all__ = ["INTEGRATORS", "InternalForces", "make_physics"]

INTEGRATORS = ("implicit", "verlet", "fox_goodwin", "linear_acceleration", "trapezoidal")


@dataclass(frozen=True)
class InternalForces:
    """Stiffness of joint limits and self collision, dimensionless.

    A limit exceeded by ε rad costs a torque of 3 · limit · ε² body weights times the length; two
    spheres overlapping by δ lengths push with 3 · self_collision · δ² body weights.

    Parameters
    ----------
    limit, self_collision : float
        Coefficients of the cubic penalties; 0 switches them off.
    """

    limit: float = 30.0
    self_collision: float = 300.0


def make_physics(
    world: World,
    contact: ResolvedContact | None,
    integrator: str,
    scales: Scales,
    internal: InternalForces,
) -> Any:
    """Return `_core.Physics` in the units of `scales`.

    Parameters
    ----------
    world : World
    contact : ResolvedContact or None
        None: nothing touches the ground.
    integrator : str
    scales : Scales
    internal : InternalForces
    """
    plane = world.obstacles[0] if world.obstacles else None
    settings: dict[str, Any] = {
        "gravity": tuple(np.array(world.gravity) / scales.acceleration),
        "ground": plane is not None and contact is not None,
        "limit": internal.limit,
        "self_collision": internal.self_collision,
        "integrator": integrator,
    }
    if plane is not None:
        settings["plane_normal"] = plane.normal
        settings["plane_offset"] = plane.offset / scales.length
    if contact is not None:
        settings["normal"] = contact.normal * scales.length**2 / scales.force
        settings["friction"] = contact.friction * scales.length**2 * scales.velocity / scales.force
        settings["damping"] = contact.damping * scales.velocity
        settings["coulomb"] = contact.model == "coulomb"
        settings["mu"] = contact.mu
        settings["slip_velocity"] = contact.slip_velocity / scales.velocity
    return _core.Physics(**settings)
