"""Pictures of a solution: the motion, its contact forces, and how the solver got there.

Needs matplotlib: ``pip install 'contact-trajopt[plot]'``.
"""

from trajopt.plotting.compose import PARTS, plot_solution

__all__ = ["PARTS", "plot_solution"]
