"""The one place where CasADi is imported, with a clear message where it is missing."""

from __future__ import annotations

from trajopt.errors import MissingDependencyError

try:
    import casadi
except ImportError as error:
    raise MissingDependencyError(
        "casadi", "Differentiating functions of your own (Residual, collocation)", extra="casadi"
    ) from error

__all__ = ["casadi"]
