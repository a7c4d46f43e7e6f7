"""Drake's DirectCollocation by SNOPT."""

import with_drake
from with_drake import biped, cart_pole, iterations, solve, versions

__all__ = ["biped", "cart_pole", "iterations", "solve", "versions"]
with_drake.SOLVER = "snopt"
