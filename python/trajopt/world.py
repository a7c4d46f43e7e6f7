"""The world a model moves in, and the law by which it pushes back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from trajopt.checks import finite_array, non_negative, number, positive
from trajopt.errors import ArgumentError, ArgumentTypeError

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["Contact", "Plane", "ResolvedContact", "World"]


def _vector(owner: str, argument: str, value: Any) -> tuple[float, float, float]:
    a, b, c = finite_array(owner, argument, value, (3,)).tolist()
    return (a, b, c)


@dataclass(frozen=True)
class Plane:
    """A half space: everything below the plane n·p = offset is solid.

    Parameters
    ----------
    normal : sequence of 3 floats
        Outward normal n; it is scaled to unit length.
    offset : float
        Signed distance of the plane from the origin along the normal [m].

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If the normal is zero, or a number is missing, NaN or infinite.

    Examples
    --------
    >>> Plane(normal=(0, 0, 2), offset=0.1)
    Plane(normal=(0.0, 0.0, 1.0), offset=0.1)
    """

    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    offset: float = 0.0

    def __post_init__(self) -> None:
        normal = np.array(_vector("Plane", "normal", self.normal))
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise ArgumentError("Plane: normal must not be the zero vector")
        unit = normal / length
        object.__setattr__(self, "normal", (float(unit[0]), float(unit[1]), float(unit[2])))
        object.__setattr__(self, "offset", number("Plane", "offset", self.offset))


@dataclass(frozen=True)
class World:
    """Obstacles and gravity.

    Parameters
    ----------
    obstacles : sequence of Plane
        At most one plane in this version; an empty sequence is free space.
    gravity : sequence of 3 floats
        Acceleration [m/s²].

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If an obstacle has a type that is not supported, or gravity is not finite.

    Examples
    --------
    >>> World([Plane()]).gravity
    (0.0, 0.0, -9.81)
    """

    obstacles: Sequence[Plane] = (Plane(),)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        if isinstance(self.obstacles, Plane):
            raise ArgumentTypeError("World: obstacles must be a list; write World([Plane()])")
        if not isinstance(self.obstacles, (list, tuple)):
            kind = type(self.obstacles).__name__
            raise ArgumentTypeError(f"World: obstacles must be a list of Plane, not {kind}")
        for i, obstacle in enumerate(self.obstacles):
            if not isinstance(obstacle, Plane):
                kind = type(obstacle).__name__
                raise ArgumentTypeError(
                    f"World: obstacles[{i}] is a {kind}; this version knows only Plane"
                )
        if len(self.obstacles) > 1:
            count = len(self.obstacles)
            raise ArgumentError(f"World: this version takes at most one Plane, not {count}")
        object.__setattr__(self, "obstacles", tuple(self.obstacles))
        object.__setattr__(self, "gravity", _vector("World", "gravity", self.gravity))


@dataclass(frozen=True)
class ResolvedContact:
    """A contact law whose every parameter is a number in SI units; see :class:`Contact`."""

    normal: float
    friction: float
    damping: float
    model: Literal["smooth", "coulomb"]
    mu: float
    slip_velocity: float


@dataclass(frozen=True)
class Contact:
    r"""Law of the contact force at a point with penetration depth d and velocity v.

    The normal force is :math:`w_n d^2 s(1 - k_d v_n)` with s a smooth maximum with zero, and the
    tangential force :math:`-w_t d^2 v_t` ("smooth") or
    :math:`-\mu f_n v_t / \sqrt{|v_t|^2 + \epsilon_v^2}` ("coulomb").

    Parameters
    ----------
    normal : float, optional
        Stiffness w_n [N/m²].  By default the model's weight, on the points on which it stands in
        its home pose, presses it 0.8 % of ``model.length`` into the ground.
    friction : float, optional
        Viscosity w_t [N s/m³] of the smooth law.  By default a tangential force of half the normal
        force slides at 2.5 % of the speed √(g · length).
    damping : float, optional
        Hunt–Crossley coefficient k_d [s/m]; 0 is Pan's undamped law.  By default 2 / √(g · length),
        so that bounces die out within two or three.
    model : {"smooth", "coulomb"}
        Law of friction.
    mu : float
        Coefficient of friction of the Coulomb law.
    slip_velocity : float
        Speed ε_v [m/s] at which the Coulomb law reaches 71 % of its bound.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        If a parameter is negative, NaN, not a number, or the law is unknown.

    Examples
    --------
    >>> Contact(normal=1e5, friction=1e6, damping=0.5).mu
    0.8
    """

    normal: float | None = None
    friction: float | None = None
    damping: float | None = None
    model: Literal["smooth", "coulomb"] = "smooth"
    mu: float = 0.8
    slip_velocity: float = 0.05

    def __post_init__(self) -> None:
        for argument in ("normal", "friction", "damping"):
            value = getattr(self, argument)
            if value is not None:
                object.__setattr__(self, argument, non_negative("Contact", argument, value))
        if self.normal == 0 and self.friction:
            raise ArgumentError(
                f"Contact: friction = {self.friction:g} needs a normal stiffness > 0, not 0"
            )
        if self.model not in ("smooth", "coulomb"):
            raise ArgumentError(f"Contact: model must be smooth or coulomb, not {self.model!r}")
        object.__setattr__(self, "mu", non_negative("Contact", "mu", self.mu))
        slip = positive("Contact", "slip_velocity", self.slip_velocity)
        object.__setattr__(self, "slip_velocity", slip)

    def resolved(self, model: Model, gravity: float = 9.81) -> ResolvedContact:
        """Fill in the parameters left to the model.

        Parameters
        ----------
        model : Model
            The model that shall stand on the ground.
        gravity : float
            Magnitude of gravity [m/s²].

        Returns
        -------
        ResolvedContact

        Examples
        --------
        >>> import trajopt
        >>> model = trajopt.load_model("mammal")
        >>> law = Contact().resolved(model)
        >>> depth = (model.mass * 9.81 / (len(model.support_points) * law.normal)) ** 0.5
        >>> round(depth / model.length, 6)
        0.008
        """
        speed = float(np.sqrt(max(gravity, 1e-9) * model.length))
        normal = self.normal
        if normal is None:
            count = max(1, len(model.support_points))
            normal = model.mass * gravity / (count * (0.008 * model.length) ** 2)
        friction = self.friction
        if friction is None:
            friction = normal * 0.5 / (0.025 * speed)
        damping = 2.0 / speed if self.damping is None else self.damping
        return ResolvedContact(normal, friction, damping, self.model, self.mu, self.slip_velocity)
