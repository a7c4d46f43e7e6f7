"""A kinematic tree with masses and contact points: everything a solver knows of a character."""

from trajopt.kinematics import BALL, HINGE, SLIDE
from trajopt.model.model import Model

__all__ = ["BALL", "HINGE", "SLIDE", "Model"]
