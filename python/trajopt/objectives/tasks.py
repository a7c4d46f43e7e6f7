"""Where a motion is to go, how fast, and through which poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from trajopt.checks import finite_array
from trajopt.objectives.base import Term, Times, Vector

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder

__all__ = ["CenterOfMassPosition", "CenterOfMassVelocity", "PointPosition", "PointVelocity", "Pose"]


@dataclass(frozen=True)
class CenterOfMassVelocity(Term):
    """Move the center of mass at a velocity (Pan eq. 17).

    Parameters
    ----------
    velocity : (3,) sequence
        Target velocity [m/s].
    weight : float
        Cost of the initial guess.
    axes : (3,) sequence
        Factor of each component's error.
    start : float
        Seconds at the beginning that do not count: time to get going from rest.

    Examples
    --------
    >>> CenterOfMassVelocity((0.5, 0, 0)).weight
    1.0
    """

    velocity: Vector
    weight: float = 1.0
    axes: Vector = (1.0, 1.0, 1.0)
    start: float = 0.0

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        target = finite_array("CenterOfMassVelocity", "velocity", self.velocity, (3,))
        build.dense(
            "center_of_mass_velocity",
            build.after("CenterOfMassVelocity", self.start, self.weight),
            target=target / build.scales.velocity,
            axes=self.axes,
        )


@dataclass(frozen=True)
class CenterOfMassPosition(Term):
    """Bring the center of mass to a point, or to several at given times (Pan eq. 18).

    Parameters
    ----------
    position : (3,) or (K, 3) sequence
        Target positions [m].
    time : float or K floats, optional
        When [s]; at all times when None.
    weight : float
        Cost of the initial guess.
    axes : (3,) sequence
        Factor of each component's error; 0 leaves a component free.
    relative : bool
        Whether positions are counted from the settled initial pose's center of mass.
    """

    position: Any
    time: Times = None
    weight: float = 1.0
    axes: Vector = (1.0, 1.0, 1.0)
    relative: bool = False

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        weight, target = build.targets(
            "CenterOfMassPosition", self.position, self.time, self.weight
        )
        if self.relative:
            target = target + build.initial_center_of_mass
        build.dense("center_of_mass_position", weight, target=target, axes=self.axes)


@dataclass(frozen=True)
class PointPosition(Term):
    """Bring a point of a body to a place.

    Parameters
    ----------
    body : str
        Name of the body.
    position : (3,) or (K, 3) sequence
        Target positions [m].
    point : (3,) sequence
        The point in the body's frame [m].
    time : float or K floats, optional
        When [s]; at all times when None.
    weight : float
        Cost of the initial guess.
    axes : (3,) sequence
        Factor of each component's error.
    """

    body: str
    position: Any
    point: Vector = (0.0, 0.0, 0.0)
    time: Times = None
    weight: float = 1.0
    axes: Vector = (1.0, 1.0, 1.0)

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        weight, target = build.targets("PointPosition", self.position, self.time, self.weight)
        place = build.body_point("PointPosition", self.body, self.point)
        build.dense("point_position", weight, target=target, axes=self.axes, place=place)


@dataclass(frozen=True)
class PointVelocity(Term):
    """Move a point of a body at a velocity.

    Parameters
    ----------
    body : str
        Name of the body.
    velocity : (3,) sequence
        Target velocity [m/s].
    point : (3,) sequence
        The point in the body's frame [m].
    time : float or floats, optional
        When [s]; at all times when None.
    weight : float
        Cost of the initial guess.
    axes : (3,) sequence
        Factor of each component's error.
    """

    body: str
    velocity: Vector
    point: Vector = (0.0, 0.0, 0.0)
    time: Times = None
    weight: float = 1.0
    axes: Vector = (1.0, 1.0, 1.0)

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        velocity = finite_array("PointVelocity", "velocity", self.velocity, (3,))
        weight = build.at_times("PointVelocity", self.time, self.weight)
        build.dense(
            "point_velocity",
            weight,
            target=velocity / build.scales.velocity,
            axes=self.axes,
            place=build.body_point("PointVelocity", self.body, self.point),
        )


@dataclass(frozen=True)
class Pose(Term):
    """Take a pose, or keyframes at given times.

    Parameters
    ----------
    pose : (D,) or (K, D) sequence, dict of str to float, or "initial"
        Coordinates [m, rad]; a dict names the ones that count, "initial" is the settled pose.
    time : float or K floats, optional
        When [s]; at all times when None.
    weight : float
        Cost of the initial guess.
    dofs : sequence of str, optional
        Coordinates that count; all joints without the unactuated base when None.
    """

    pose: Any = "initial"
    time: Times = None
    weight: float = 1.0
    dofs: Sequence[str] | None = None

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        poses, dof_weight = build.poses("Pose", self.pose, self.dofs)
        weight, target = build.pose_targets("Pose", poses, self.time, self.weight)
        build.local("pose", weight, dof_weight, target)
