"""A model: where its parts are in a pose, and what a motion asks of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt import kinematics
from trajopt.kinematics import SLIDE
from trajopt.model.arrays import core_arguments, from_arrays, to_arrays
from trajopt.model.description import Description
from trajopt.rigid import apply, compose

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from trajopt.world import Contact, World

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

__all__ = ["Model"]


@dataclass(frozen=True, eq=False, repr=False)
class Model(Description):
    """A tree of rigid bodies, joined by slides, hinges and ball joints.  Immutable.

    Made by :func:`trajopt.load_model`.  Shapes use J = joints, D = degrees of freedom, K = bodies,
    P = contact points, S = spheres for self collision.  SI units, radians, z up.

    The frame of joint j is ``T_j = T_parent · joint_offset[j] · E_j``, with ``E_j`` a translation
    along or a rotation about ``joint_axis[j]``, or the rotation exp([r]×) of a ball joint.  A free
    body has three slides along the world's axes followed by a ball, so its six coordinates are its
    position and a rotation vector in the world.

    Attributes
    ----------
    name : str
    xml : str
        MJCF text that stands for the model without any other file.
    joint_names : tuple of str, length J
    joint_type : ndarray of int32, shape (J,)
        0 slide, 1 hinge, 2 ball.
    joint_parent : ndarray of int32, shape (J,)
        Index of the parent joint, smaller than the joint's own; -1 is the world.
    joint_offset : ndarray, shape (J, 3, 4)
    joint_axis : ndarray, shape (J, 3)
        Unit axis in the joint's frame; without meaning for balls.
    dof_names : tuple of str, length D
    lower, upper : ndarray, shape (D,)
        Limits [m, rad], infinite where there are none.
    actuated : ndarray of bool, shape (D,)
        Whether the dof has a motor.
    home : ndarray, shape (D,)
        Pose to start from.
    body_names : tuple of str, length K
        Bodies that move; those without joints of their own move with their parent.
    body_joint : ndarray of int32, shape (K,)
    body_offset : ndarray, shape (K, 3, 4)
        The body's frame is ``T_joint · body_offset``.
    pseudo_inertia : ndarray, shape (K, 4, 4)
        ∫ρ [p;1][p;1]ᵀ dp in the body's frame.
    point_body : ndarray of int32, shape (P,)
        Body of each contact point.
    point_position : ndarray, shape (P, 3)
        Its centre in the frame of the body's joint [m].
    point_radius : ndarray, shape (P,)
    sphere_body, sphere_position, sphere_radius
        The same for the spheres of self collision.
    sphere_pairs : ndarray of int32, shape (Q, 2)
        Pairs of spheres that may collide.
    leg_length : float or None
        Nominal length of a leg [m], from ``<custom><numeric name="leg_length">``.
    ground : tuple of 4 floats or None
        Normal and offset of the file's ground plane.
    notes : tuple of str
        What the loader decided: base, passive joints, ground.
    """

    @cached_property
    def length(self) -> float:
        """Characteristic length [m].

        The largest distance, in the home pose, from the centre of mass to a contact point or to
        the anchor of a joint.  The solver measures lengths in this unit.
        """
        center = self.center_of_mass(self.home)
        frames = self.joint_transforms(self.home)
        # The slides of a free base have their anchors at the origin of the world: not of the body.
        anchors = frames[self.joint_type != SLIDE, :, 3]
        places = np.concatenate([anchors, self.contact_positions(self.home), center[None]])
        longest = float(np.linalg.norm(places - center, axis=1).max())
        if longest > 1e-9:
            return longest
        spread = np.trace(self.link_inertia[:, :3, :3].sum(axis=0)) / self.mass
        return float(np.sqrt(spread)) if spread > 1e-18 else 1.0

    @cached_property
    def support_points(self) -> NDArray[np.intp]:
        """Contact points on which the model stands at home: within 2 % of length of the lowest."""
        if not self.npoints:
            return np.zeros(0, dtype=np.intp)
        height = self._heights(self.home)
        return np.flatnonzero(height <= height.min() + 0.02 * self.length)

    # --- kinematics -----------------------------------------------------------------------------

    def joint_transforms(self, x: ArrayLike) -> Floats:
        """World transforms of the joint frames.

        Parameters
        ----------
        x : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., J, 3, 4)
        """
        return kinematics.joint_transforms(self, x)

    def transforms(self, x: ArrayLike) -> Floats:
        """World transforms [R t] of the bodies' frames.

        Parameters
        ----------
        x : array_like, shape (..., D)
            Configurations.

        Returns
        -------
        ndarray, shape (..., K, 3, 4)

        Raises
        ------
        ArgumentError
            If the last axis is not D long, or a number is not finite.

        Examples
        --------
        >>> import trajopt
        >>> model = trajopt.load_model("chain")
        >>> model.transforms(model.home).shape
        (5, 3, 4)
        """
        frames = self.joint_transforms(x)
        return compose(frames[..., self.body_joint, :, :], self.body_offset)

    def center_of_mass(self, x: ArrayLike) -> Floats:
        """Centre of mass in the world.

        Parameters
        ----------
        x : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., 3)
            In m.
        """
        moments = self.transforms(x) @ self.pseudo_inertia[:, :, 3:]
        return np.asarray(moments[..., 0].sum(axis=-2) / self.mass)

    def contact_positions(self, x: ArrayLike) -> Floats:
        """Centres of the contact points in the world.

        Parameters
        ----------
        x : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., P, 3)
            In m.
        """
        frames = self.joint_transforms(x)
        return apply(frames[..., self.point_joint, :, :], self.point_position)

    def sphere_centers(self, x: ArrayLike) -> Floats:
        """Centres of the spheres of self collision in the world.

        Parameters
        ----------
        x : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., S, 3)
            In m.
        """
        frames = self.joint_transforms(x)
        return apply(frames[..., self.sphere_joint, :, :], self.sphere_position)

    def lowest_point(self, x: ArrayLike) -> Floats:
        """Height [m] of the lowest point of all contact spheres; infinite without any.

        Parameters
        ----------
        x : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (...)
        """
        return np.asarray(self._heights(x).min(axis=-1, initial=np.inf))

    def _heights(self, x: ArrayLike) -> Floats:
        return np.asarray(self.contact_positions(x)[..., 2] - self.point_radius)

    def integrate(self, x: ArrayLike, delta: ArrayLike) -> Floats:
        """Move a configuration along a tangent vector: x ⊕ δ.

        Slides and hinges are added to; a ball turns by exp(δ) in the frame before its rotation (the
        world's for a free body) and comes back as the rotation vector nearest to the one it had.

        Parameters
        ----------
        x, delta : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., D)
        """
        return kinematics.integrate(self, x, delta)

    def difference(self, a: ArrayLike, b: ArrayLike) -> Floats:
        """Tangent vector that leads from a to b: ``integrate(a, difference(a, b))`` is b.

        Parameters
        ----------
        a, b : array_like, shape (..., D)

        Returns
        -------
        ndarray, shape (..., D)
            Rotations of balls are at most π.
        """
        return kinematics.difference(self, a, b)

    def check_configuration(self, argument: str, value: ArrayLike) -> Floats:
        """Check the shape (..., D) and that every number is finite."""
        return kinematics.check_configuration(self, argument, value)

    # --- dynamics -------------------------------------------------------------------------------

    def dynamics_residual(
        self,
        x: ArrayLike,
        x1: ArrayLike,
        x2: ArrayLike,
        dt: ArrayLike,
        world: World | None = None,
        contact: Contact | None = None,
        integrator: str = "linear_acceleration",
    ) -> Floats:
        """Generalized force that three consecutive frames ask of the motors.

        Inertia minus gravity and contact forces, tested with every dof.  Without world and contact
        the model is in free flight.

        Parameters
        ----------
        x, x1, x2 : array_like, shape (..., D)
            Configurations of frames i, i−1 and i−2; they broadcast.
        dt : float or array_like, shape (...)
            Time step [s].
        world : World, optional
            Default: gravity alone, and the ground z = 0 if ``contact`` is given.
        contact : Contact, optional
            Law of contact; default ``Contact()`` where the world has an obstacle.
        integrator : str
            "implicit" (Pan, equation 5), "verlet", "fox_goodwin", "linear_acceleration" or
            "trapezoidal".

        Returns
        -------
        ndarray, shape (..., D)
            In N and N·m.

        Raises
        ------
        ArgumentError
            If a shape does not fit, a number is not finite, or dt is not positive.
        """
        from trajopt.models import dynamics

        return dynamics.residual(self, x, x1, x2, dt, world, contact, integrator)

    def dynamics_jacobians(
        self,
        x: ArrayLike,
        x1: ArrayLike,
        x2: ArrayLike,
        dt: ArrayLike,
        world: World | None = None,
        contact: Contact | None = None,
        integrator: str = "linear_acceleration",
    ) -> tuple[Floats, Floats, Floats]:
        """Derivatives of :meth:`dynamics_residual`, with respect to rotation vectors for balls.

        Parameters
        ----------
        x, x1, x2, dt, world, contact, integrator
            As for :meth:`dynamics_residual`.

        Returns
        -------
        tuple of three ndarrays, shape (..., D, D)
            ∂FD/∂x, ∂FD/∂x1 and ∂FD/∂x2.
        """
        from trajopt.models import dynamics

        return dynamics.jacobians(self, x, x1, x2, dt, world, contact, integrator)

    def core_arguments(self, mass: float = 1.0, length: float = 1.0) -> dict[str, Any]:
        """Keyword arguments of the compiled core's model, in units of a mass and a length.

        Parameters
        ----------
        mass : float
            Unit of mass [kg].
        length : float
            Unit of length [m].

        Returns
        -------
        dict
        """
        return core_arguments(self, mass, length)

    # --- persistence ----------------------------------------------------------------------------

    def replace(self, **changes: Any) -> Model:
        """Return a copy with some attributes changed.

        Examples
        --------
        >>> import trajopt
        >>> trajopt.load_model("chain").replace(name="worm").name
        'worm'
        """
        return replace(self, **changes)

    def to_dict(self) -> dict[str, NDArray[Any]]:
        """All attributes as plain arrays, strings included; nothing that needs pickle.

        Returns
        -------
        dict of str to ndarray
            Fit for ``numpy.savez``; :meth:`from_dict` restores the model bit by bit.
        """
        return to_arrays(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, ArrayLike]) -> Model:
        """Restore a model from :meth:`to_dict`.

        Parameters
        ----------
        data : mapping of str to array_like

        Returns
        -------
        Model

        Raises
        ------
        ModelError
            If an attribute is missing.

        Examples
        --------
        >>> import trajopt
        >>> model = trajopt.load_model("chain")
        >>> Model.from_dict(model.to_dict()).dof_names == model.dof_names
        True
        """
        return cls(**from_arrays(cls, data))
