"""What keeps a motion gentle, and makes it one that a time grid can resolve."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from trajopt.objectives.base import Term
from trajopt.objectives.contact import ContactForceRate, ContactSlip

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder

__all__ = [
    "ControlEffort",
    "JointVelocity",
    "PhysicsPenalty",
    "Smoothness",
    "TerminalPose",
    "regularizers",
]


@dataclass(frozen=True)
class ControlEffort(Term):
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
class Smoothness(Term):
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
class JointVelocity(Term):
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
class PhysicsPenalty(Term):
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
class TerminalPose(Term):
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


def regularizers(effort: float = 1.0) -> list[Term]:
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
