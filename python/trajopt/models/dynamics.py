"""A model's discrete dynamics, evaluated by the compiled core in SI units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.world import Contact, World

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from trajopt.model import Model

__all__ = ["INTEGRATORS", "jacobians", "physics", "residual"]

INTEGRATORS = ("implicit", "verlet", "fox_goodwin", "linear_acceleration", "trapezoidal")

# Building the core's model costs more than a residual; one is kept for every model in use.
_cores: WeakKeyDictionary[Model, Any] = WeakKeyDictionary()


def core_model(model: Model) -> Any:
    """Core's model in SI units, built on first use."""
    if model not in _cores:
        from trajopt import _core

        _cores[model] = _core.Model(**model.core_arguments())
    return _cores[model]


def physics(model: Model, world: World | None, contact: Contact | None, integrator: str) -> Any:
    """Core's description of gravity, ground and contact law, in SI units.

    Without a contact law a world with an obstacle gets the default one; without a world a contact
    law gets the ground z = 0; without both there is gravity alone.
    """
    if integrator not in INTEGRATORS:
        raise ArgumentError(f"integrator must be one of {INTEGRATORS}, not {integrator!r}")
    for argument, value, kind in (("world", world, World), ("contact", contact, Contact)):
        if value is not None and not isinstance(value, kind):
            what = f"{type(value).__name__} {value!r}"
            raise ArgumentTypeError(f"{argument} must be a {kind.__name__}, not {what}")
    if world is None:
        world = World() if contact is not None else World([])
    contact = contact or Contact()
    arguments: dict[str, Any] = {"gravity": world.gravity, "ground": False}
    if world.obstacles:
        plane = world.obstacles[0]
        law = contact.resolved(model, float(np.linalg.norm(world.gravity)))
        arguments = {
            "gravity": world.gravity,
            "ground": True,
            "plane_normal": plane.normal,
            "plane_offset": plane.offset,
            "normal": law.normal,
            "friction": law.friction,
            "damping": law.damping,
            "coulomb": law.model == "coulomb",
            "mu": law.mu,
            "slip_velocity": law.slip_velocity,
        }
    from trajopt import _core

    return _core.Physics(**arguments, integrator=integrator)


def residual(
    model: Model,
    x: ArrayLike,
    x1: ArrayLike,
    x2: ArrayLike,
    dt: ArrayLike,
    world: World | None,
    contact: Contact | None,
    integrator: str,
) -> NDArray[np.float64]:
    """See :meth:`trajopt.Model.dynamics_residual`."""
    law = physics(model, world, contact, integrator)
    shape, frames = _flatten(model, x, x1, x2, dt)
    return np.asarray(core_model(model).residual(*frames, law)).reshape(*shape, model.ndof)


def jacobians(
    model: Model,
    x: ArrayLike,
    x1: ArrayLike,
    x2: ArrayLike,
    dt: ArrayLike,
    world: World | None,
    contact: Contact | None,
    integrator: str,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """See :meth:`trajopt.Model.dynamics_jacobians`."""
    law = physics(model, world, contact, integrator)
    shape, frames = _flatten(model, x, x1, x2, dt)
    _, j0, j1, j2 = core_model(model).jacobians(*frames, law)
    full = (*shape, model.ndof, model.ndof)
    return (
        np.asarray(j0).reshape(full),
        np.asarray(j1).reshape(full),
        np.asarray(j2).reshape(full),
    )


def _flatten(
    model: Model, x: ArrayLike, x1: ArrayLike, x2: ArrayLike, dt: ArrayLike
) -> tuple[tuple[int, ...], list[NDArray[np.float64]]]:
    """Broadcast the leading axes and merge them into one."""
    arrays = [
        model.check_configuration(name, value) for name, value in (("x", x), ("x1", x1), ("x2", x2))
    ]
    try:
        steps = np.asarray(dt, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(f"dt must be a number or an array, not {dt!r}") from error
    if not (np.isfinite(steps).all() and (steps > 0).all()):
        raise ArgumentError(f"dt must be positive and finite, not {dt!r}")
    try:
        shape = np.broadcast_shapes(steps.shape, *(a.shape[:-1] for a in arrays))
    except ValueError as error:
        shapes = ", ".join(str(a.shape) for a in arrays)
        raise ArgumentError(
            f"x, x1, x2 of shapes {shapes} and dt of shape {steps.shape} do not broadcast"
        ) from error
    flat = [
        np.ascontiguousarray(np.broadcast_to(a, (*shape, model.ndof)).reshape(-1, model.ndof))
        for a in arrays
    ]
    flat.append(np.ascontiguousarray(np.broadcast_to(steps, shape).reshape(-1)))
    return shape, flat
