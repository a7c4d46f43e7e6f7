"""The state a motion starts from, as the user writes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from trajopt.checks import finite_array, non_negative, number
from trajopt.errors import ArgumentError, ArgumentTypeError
from trajopt.settle import free_bases

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.world import World

__all__ = ["InitialState", "parse_initial"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class InitialState:
    """Pose, velocity and whether the pose is set on the ground.

    Parameters
    ----------
    pose : (D,) array
        Coordinates [m, rad].
    velocity : (D,) array
        Velocities in the tangent [m/s, rad/s].
    height : float or None
        Height of the lowest point above the ground [m] for a start in the air; None settles.
    """

    pose: FloatArray
    velocity: FloatArray
    height: float | None = None


def parse_initial(model: Model, world: World, initial: Any) -> InitialState:
    """Read `initial` of `Problem`; what was read already is returned as it is.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Names the key or coordinate, its value and the expectation.
    """
    if isinstance(initial, InitialState):
        return initial
    if not isinstance(initial, Mapping):
        initial = {"pose": "home" if initial is None else initial}
    unknown = set(initial) - {"pose", "height", "velocity"}
    if unknown:
        raise ArgumentError(
            f"initial: unknown key {sorted(unknown)[0]!r}, expected pose, height or velocity"
        )
    pose = initial.get("pose", "home")
    height = initial.get("height")
    if height is not None:
        height = non_negative("initial", "height", height)
        if not (free_bases(model) and model.npoints and world.obstacles):
            raise ArgumentError(
                f"initial: height = {height:g} needs a model with a free base and contact points, "
                "and a ground below it"
            )
    return InitialState(
        model.home.copy()
        if isinstance(pose, str) and pose == "home"
        else _coordinates(model, "pose", pose, model.home),
        _coordinates(model, "velocity", initial.get("velocity", {}), np.zeros(model.ndof)),
        height,
    )


def _coordinates(model: Model, what: str, value: Any, default: FloatArray) -> FloatArray:
    if isinstance(value, str):
        home = "'home', " if what == "pose" else ""
        raise ArgumentTypeError(
            f"initial: {what} must be {home}an array or values by name, not {value!r}"
        )
    if not isinstance(value, Mapping):
        return finite_array("initial", what, value, (model.ndof,))
    out = default.copy()
    names = list(model.dof_names)
    for name, entry in value.items():
        if name not in names:
            raise ArgumentError(
                f"initial: {what} names {name!r}, but the model's coordinates are "
                f"{', '.join(names)}"
            )
        out[names.index(name)] = number("initial", f"{what} of {name}", entry)
    return out
