"""What a motion is asked for. Terms are data; each is a weighted sum of squares over time.

A term's cost is the time average of its squared residual in dimensionless units. Tasks (where to
go, how fast) are then rescaled so that they cost their `weight` on the initial guess, as Pan does
before optimizing; regularizers (effort, smoothness) are not.
"""

from trajopt.objectives.contact import ContactForceRate, ContactImpact, ContactSlip
from trajopt.objectives.regularization import (
    ControlEffort,
    JointVelocity,
    PhysicsPenalty,
    Smoothness,
    TerminalPose,
    regularizers,
)
from trajopt.objectives.residual import Residual
from trajopt.objectives.tasks import (
    CenterOfMassPosition,
    CenterOfMassVelocity,
    PointPosition,
    PointVelocity,
    Pose,
)

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
