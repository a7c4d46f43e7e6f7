"""Loading and checking of models."""

from trajopt.models.loader import load_model
from trajopt.models.source import builtin_names

__all__ = ["builtin_names", "load_model"]
