"""Direct collocation for smooth optimal control problems, after Kelly's tutorial.

Needs CasADi: ``pip install 'contact-trajopt[casadi]'``.
"""

from trajopt.collocation.problem import Problem
from trajopt.collocation.solution import Solution
from trajopt.collocation.solver import solve
from trajopt.collocation.symbols import TraceError, linear_solve

__all__ = ["Problem", "Solution", "TraceError", "linear_solve", "solve"]
