"""CasADi, for the modules of this package; with a clear message where it is missing."""

from __future__ import annotations

from trajopt.tracing import casadi

__all__ = ["casadi"]
