"""trajopt with IPOPT."""

import with_trajopt
from with_trajopt import biped, cart_pole, solve, versions

__all__ = ["biped", "cart_pole", "solve", "versions"]
with_trajopt.SOLVER = "ipopt"
