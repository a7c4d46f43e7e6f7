"""How a motion is to touch the ground: softly, slowly, without slipping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from trajopt.objectives.base import Term

if TYPE_CHECKING:
    from trajopt.terms import TermBuilder

__all__ = ["ContactForceRate", "ContactImpact", "ContactSlip"]


@dataclass(frozen=True)
class ContactForceRate(Term):
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
class ContactSlip(Term):
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
class ContactImpact(Term):
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
