"""What a model is made of: names, arrays, and what follows from them without a pose."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.kinematics import BALL
from trajopt.rigid import transform_pseudo_inertia

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

__all__ = ["Description"]


@dataclass(frozen=True, eq=False, repr=False)
class Description:
    """Attributes of a `trajopt.Model`, which documents them, with their sizes and sums."""

    name: str
    xml: str
    joint_names: tuple[str, ...]
    joint_type: Ints
    joint_parent: Ints
    joint_offset: Floats
    joint_axis: Floats
    dof_names: tuple[str, ...]
    lower: Floats
    upper: Floats
    actuated: NDArray[np.bool_]
    home: Floats
    body_names: tuple[str, ...]
    body_joint: Ints
    body_offset: Floats
    pseudo_inertia: Floats
    point_body: Ints
    point_position: Floats
    point_radius: Floats
    sphere_body: Ints
    sphere_position: Floats
    sphere_radius: Floats
    sphere_pairs: Ints
    leg_length: float | None = None
    ground: tuple[float, ...] | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value = value.copy()
                value.flags.writeable = False
                object.__setattr__(self, field.name, value)

    def __reduce__(self) -> tuple[type[Description], tuple[Any, ...]]:
        # By the constructor, so that a copy from another process is as immutable as this one.
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    def __repr__(self) -> str:
        return (
            f"<Model '{self.name}': {self.nbodies} bodies, {self.ndof} dofs"
            f" ({self.nactuated} actuated), {self.mass:.4g} kg, {self.npoints} contact points>"
        )

    # --- sizes and sums -------------------------------------------------------------------------

    @property
    def ndof(self) -> int:
        """Number of degrees of freedom D."""
        return len(self.dof_names)

    @property
    def nactuated(self) -> int:
        """Number of dofs with a motor."""
        return int(self.actuated.sum())

    @property
    def nbodies(self) -> int:
        """Number of moving bodies K."""
        return len(self.body_names)

    @property
    def npoints(self) -> int:
        """Number of contact points P."""
        return len(self.point_radius)

    @cached_property
    def mass(self) -> float:
        """Mass of all moving bodies [kg]."""
        return float(self.pseudo_inertia[:, 3, 3].sum())

    @cached_property
    def joint_dof(self) -> Ints:
        """First dof of every joint, shape (J,)."""
        sizes = np.where(self.joint_type == BALL, 3, 1)
        return np.asarray(np.cumsum(sizes) - sizes, dtype=np.int32)

    @cached_property
    def point_joint(self) -> Ints:
        """Joint that carries each contact point, shape (P,)."""
        return self.body_joint[self.point_body]

    @cached_property
    def sphere_joint(self) -> Ints:
        """Joint that carries each sphere, shape (S,)."""
        return self.body_joint[self.sphere_body]

    @cached_property
    def link_inertia(self) -> Floats:
        """Pseudo-inertia of all that is fixed to a joint, in the joint's frame, shape (J, 4, 4)."""
        out = np.zeros((len(self.joint_type), 4, 4))
        np.add.at(
            out, self.body_joint, transform_pseudo_inertia(self.body_offset, self.pseudo_inertia)
        )
        return out

    @cached_property
    def feet(self) -> dict[str, NDArray[np.intp]]:
        """Contact points by body: those of bodies called feet or hands, else of all bodies.

        Examples
        --------
        >>> import trajopt
        >>> list(trajopt.load_model("biped").feet)
        ['left_foot', 'right_foot']
        """
        groups = {
            self.body_names[k]: np.flatnonzero(self.point_body == k)
            for k in np.unique(self.point_body)
        }
        feet = {name: i for name, i in groups.items() if "foot" in name.lower()}
        return feet or groups
