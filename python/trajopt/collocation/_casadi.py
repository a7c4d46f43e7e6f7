"""The one place where CasADi is imported, with a clear message where it is missing."""

from __future__ import annotations

from trajopt.errors import MissingDependencyError

try:
    import casadi
except ImportError as error:  # pragma: no cover - depends on the installation
    raise MissingDependencyError("casadi", "Collocation", extra="casadi") from error

__all__ = ["casadi"]
