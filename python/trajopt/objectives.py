"""What a motion is asked for. Terms are data; each is a weighted sum of squares over time.

A term's cost is the time average of its squared residual in dimensionless units. Tasks (where to
go, how fast) are then rescaled so that they cost their `weight` on the initial guess, as Pan does
before optimizing; regularizers (effort, smoothness) are not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from trajopt.checks import finite_array, non_negative
from trajopt.errors import ArgumentTypeError

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder
    from trajopt.traced import Trace

__all__ = [
    "CenterOfMassPosition",
    "CenterOfMassVelocity",
    "ContactForceRate",
    "ContactImpact",
    "ContactSlip",
    "ControlEffort",
    "JointVelocity",
    "PhysicsPenalty",
    "PointPosition",
    "PointVelocity",
    "Pose",
    "Residual",
    "Smoothness",
    "TerminalPose",
    "regularizers",
]

Vector = Sequence[float]
Times = float | Sequence[float] | None


@dataclass(frozen=True)
class _Term:
    task: ClassVar[bool] = True

    def __post_init__(self) -> None:
        non_negative(type(self).__name__, "weight", getattr(self, "weight", 1.0))
        axes = getattr(self, "axes", None)
        if axes is not None:
            finite_array(type(self).__name__, "axes", axes, (3,))

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        raise NotImplementedError


@dataclass(frozen=True)
class CenterOfMassVelocity(_Term):
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
class CenterOfMassPosition(_Term):
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
class PointPosition(_Term):
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
class PointVelocity(_Term):
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
class Pose(_Term):
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


@dataclass(frozen=True)
class TerminalPose(_Term):
    """End at rest in the initial pose: without a word about the end the last second collapses.

    Parameters
    ----------
    weight : float
        Cost of an error of 1 rad (or 1 length, or a unit of velocity) in all coordinates.
    dofs : sequence of str, optional
        Coordinates that count; all but the base's place and heading when None.
    """

    task: ClassVar[bool] = False
    weight: float = 0.01
    dofs: Sequence[str] | None = None

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        poses, dof_weight = build.poses("TerminalPose", "initial", self.dofs, keep_height=True)
        last = build.last_frames(2, self.weight / max(float(dof_weight.sum()), 1.0))
        build.local("pose", last, dof_weight, np.tile(poses[0], (build.frames, 1)))
        build.local("velocity", last, np.ones_like(dof_weight), suffix=" velocity")


@dataclass(frozen=True)
class ControlEffort(_Term):
    """Spend little torque: the mean square of the joint torques in body weights times lengths.

    Parameters
    ----------
    weight : float
        Its factor; small, as in Pan's E_reg.
    """

    task: ClassVar[bool] = False
    weight: float = 0.1

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.dense("effort", build.all_frames(self.weight))


@dataclass(frozen=True)
class Smoothness(_Term):
    """Accelerate gently: the mean square of the coordinates' accelerations in units of g.

    Not optional in the frames formulation: without it a motion exploits the time grid.

    Parameters
    ----------
    weight : float
        Its factor.
    """

    task: ClassVar[bool] = False
    weight: float = 3e-3

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.local("acceleration", build.all_frames(self.weight), np.ones(build.model.ndof))


@dataclass(frozen=True)
class ContactForceRate(_Term):
    """Load and unload contacts gently: the mean square rate of every contact point's force.

    In body weights per unit of time √(length / g). A force that rises within one frame is what a
    time grid resolves worst; this term keeps footfalls soft.

    Parameters
    ----------
    weight : float
        Its factor.
    """

    task: ClassVar[bool] = False
    weight: float = 0.03

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.dense("contact_rate", build.all_frames(self.weight))


@dataclass(frozen=True)
class ContactSlip(_Term):
    """Let loaded points stand still: the mean of normal force times squared slip speed.

    In body weights and units of √(g · length). In the smooth friction law the slip is what friction
    costs, so this term also keeps tangential forces small where the load is small.

    Parameters
    ----------
    weight : float
        Its factor; 100 makes a slip of 1 % of the unit speed cost 0.01.
    """

    task: ClassVar[bool] = False
    weight: float = 100.0

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.dense("contact_slip", build.all_frames(self.weight))


@dataclass(frozen=True)
class ContactImpact(_Term):
    """Come down and lift slowly: the mean of normal force times squared speed along the normal.

    In body weights and units of √(g · length). The speed of a step between two frames is weighted
    with the normal forces of both: striking the ground costs, and so does pushing off while still
    loaded. `ContactForceRate` sees the difference of the forces at two frames; a point that crosses
    its whole depth between them makes a force in the middle that neither frame knows. On stiff
    ground this term is what makes a jumper retract its feet before they land.

    Parameters
    ----------
    weight : float
        Its factor; 10 makes the weight of the body coming down at a tenth of the unit speed cost
        0.1. On ground so soft that a jumper must sink in to push off it forbids the jump: leave it
        out of the first passes (``Stage(..., factors={"contact_impact": 0.0})``).
    """

    task: ClassVar[bool] = False
    weight: float = 10.0

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.dense("contact_impact", build.all_frames(self.weight))


@dataclass(frozen=True)
class JointVelocity(_Term):
    """Move the actuated joints slowly.

    Parameters
    ----------
    weight : float
        Its factor.
    """

    task: ClassVar[bool] = False
    weight: float = 1e-3

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.local("velocity", build.all_frames(self.weight), build.model.actuated.astype(float))


@dataclass(frozen=True)
class PhysicsPenalty(_Term):
    """Penalize the unactuated residual of every frame; for the spline formulation.

    The spline's constraints hold in its own test space only and can hide per-frame errors of
    several body weights; in the frames formulation this term is always zero at a solution.

    Parameters
    ----------
    weight : float
        Cost of a root-mean-square residual of one body weight.
    """

    task: ClassVar[bool] = False
    weight: float = 1.0

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.dense("physics", build.all_frames(self.weight))


@dataclass(frozen=True)
class Residual(_Term):
    """A residual of your own: a function of three consecutive frames, traced once with CasADi.

    Parameters
    ----------
    function : callable
        ``f(x2, x1, x)`` with the coordinates of frames i-2, i-1 and i [m, rad] as arrays of D
        symbols: NumPy functions and arithmetic, no branches on values. Returns one expression or
        a sequence. It is called once for a model's number of coordinates, when it is first added.
    weight : float
        Factor of the mean square.
    name : str
        Name in tables and plots.

    Examples
    --------
    >>> wave = Residual(lambda x2, x1, x: x[7] - 0.3, weight=0.1, name="bent knee")
    """

    task: ClassVar[bool] = False
    function: Callable[[Any, Any, Any], Any] = field(repr=False)
    weight: float = 1.0
    name: str = "residual"
    _traces: dict[int, Trace] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.function):
            raise ArgumentTypeError(
                f"Residual: function must be a function f(x2, x1, x), not {self.function!r}"
            )
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentTypeError(f"Residual: name must be a string, not {self.name!r}")

    def trace(self, ndof: int) -> Trace:
        """Return the function, traced for frames of `ndof` coordinates."""
        from trajopt.traced import Trace

        if ndof not in self._traces:
            self._traces[ndof] = Trace(self.name, self.function, ndof)
        return self._traces[ndof]

    def emit(self, build: TermBuilder) -> None:
        """Write the term into the core's objective."""
        build.traced(self.trace(build.model.ndof), self.weight)


def regularizers(effort: float = 1.0) -> list[_Term]:
    """Return the terms that make a motion one a body would choose and a time grid can resolve.

    Parameters
    ----------
    effort : float
        Factor of all their weights.

    Returns
    -------
    list of terms
        `ControlEffort`, `Smoothness`, `ContactForceRate`, `ContactSlip` and `TerminalPose` with
        their default weights times `effort`.

    Examples
    --------
    >>> [type(term).__name__ for term in regularizers()][:2]
    ['ControlEffort', 'Smoothness']
    """
    kinds = (ControlEffort, Smoothness, ContactForceRate, ContactSlip, TerminalPose)
    return [kind(weight=kind.weight * effort) for kind in kinds]
