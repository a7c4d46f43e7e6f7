"""Direct collocation for smooth optimal control problems, after Kelly's tutorial.

Needs CasADi: ``pip install 'contact-trajopt[casadi]'``.
"""

from trajopt.collocation.diagnosis import Violation
from trajopt.collocation.guesses import continuation, keyframes, line, scatter
from trajopt.collocation.phases import MultiPhase, MultiPhaseSolution, PhaseLink
from trajopt.collocation.problem import Problem
from trajopt.collocation.progress import IterationPrinter
from trajopt.collocation.smoothing import add_absolute, smooth_abs, smooth_max, smooth_min
from trajopt.collocation.solution import Pass, Solution
from trajopt.collocation.solver import solve
from trajopt.collocation.tables import table
from trajopt.collocation.verification import DerivativeCheck, check_derivatives
from trajopt.tracing import TraceError, linear_solve

__all__ = [
    "DerivativeCheck",
    "IterationPrinter",
    "MultiPhase",
    "MultiPhaseSolution",
    "Pass",
    "PhaseLink",
    "Problem",
    "Solution",
    "TraceError",
    "Violation",
    "add_absolute",
    "check_derivatives",
    "continuation",
    "keyframes",
    "line",
    "linear_solve",
    "scatter",
    "smooth_abs",
    "smooth_max",
    "smooth_min",
    "solve",
    "table",
]
