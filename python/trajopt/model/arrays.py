"""A model as plain arrays: for files, and for the compiled core in units of its own."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import ModelError
from trajopt.kinematics import SLIDE

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from trajopt.model import Model

__all__ = ["core_arguments", "from_arrays", "to_arrays"]


def core_arguments(model: Model, mass: float, length: float) -> dict[str, Any]:
    """See :meth:`trajopt.Model.core_arguments`."""
    scale = np.array([1 / length] * 3 + [1.0])
    offset = model.joint_offset.copy()
    offset[:, :, 3] /= length
    slides = np.zeros(model.ndof, dtype=bool)
    slides[model.joint_dof[model.joint_type == SLIDE]] = True
    unit = np.where(slides, length, 1.0)
    return {
        "joint_type": model.joint_type,
        "joint_parent": model.joint_parent,
        "joint_offset": offset,
        "joint_axis": model.joint_axis,
        "link_inertia": model.link_inertia * np.outer(scale, scale) / mass,
        "lower": model.lower / unit,
        "upper": model.upper / unit,
        "actuated": model.actuated,
        "point_joint": model.point_joint,
        "point_position": model.point_position / length,
        "point_radius": model.point_radius / length,
        "sphere_joint": model.sphere_joint,
        "sphere_position": model.sphere_position / length,
        "sphere_radius": model.sphere_radius / length,
        "sphere_pairs": model.sphere_pairs,
    }


def to_arrays(model: Model) -> dict[str, NDArray[Any]]:
    """See :meth:`trajopt.Model.to_dict`."""
    out = {}
    for field in fields(model):
        value = getattr(model, field.name)
        if value is None:
            value = np.zeros(0)
        elif isinstance(value, tuple) and not value:
            value = np.zeros(0, dtype="U1")
        out[field.name] = np.asarray(value)
    return out


def from_arrays(kind: type[Model], data: Mapping[str, ArrayLike]) -> dict[str, Any]:
    """Return the arguments of `kind` that `to_arrays` described; see `trajopt.Model.from_dict`."""
    values: dict[str, Any] = {}
    for field in fields(kind):
        if field.name not in data:
            raise ModelError(f"saved model lacks '{field.name}'")
        array = np.asarray(data[field.name])
        if field.name in ("name", "xml"):
            values[field.name] = str(array)
        elif field.name in ("joint_names", "dof_names", "body_names", "notes"):
            values[field.name] = tuple(str(text) for text in array)
        elif field.name == "leg_length":
            values[field.name] = float(array) if array.size else None
        elif field.name == "ground":
            values[field.name] = tuple(float(v) for v in array) if array.size else None
        else:
            values[field.name] = array
    return values
