"""Contact-aware trajectory optimization: contacts are discovered, not scheduled.

Examples
--------
>>> import trajopt
>>> model = trajopt.load_model("chain")
>>> model.nbodies
5
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

# GCC's OpenMP spins at barriers for milliseconds; on a machine that is busy with anything else two
# spinning threads slow a solve down by a factor of 50. Has to be set before the core is loaded.
os.environ.setdefault("GOMP_SPINCOUNT", "1000")

if TYPE_CHECKING:
    from trajopt import collocation, linalg, objectives
    from trajopt.audit import Audit
    from trajopt.batch import solve_batch
    from trajopt.errors import (
        ArgumentError,
        ArgumentTypeError,
        BatchError,
        DeviceError,
        FactorizationError,
        MissingDependencyError,
        ModelError,
        ModelWarning,
        TrajoptError,
    )
    from trajopt.model import Model
    from trajopt.models import load_model
    from trajopt.problem import Problem
    from trajopt.records import IterationRecord
    from trajopt.scenarios import Scenario, ScenarioError, list_scenarios, load_scenario
    from trajopt.solution import Solution
    from trajopt.solver import solve
    from trajopt.status import Status
    from trajopt.storage import FileFormatError
    from trajopt.world import Contact, Plane, World

__version__ = "0.1.0"

__all__ = [
    "ArgumentError",
    "ArgumentTypeError",
    "Audit",
    "BatchError",
    "Contact",
    "DeviceError",
    "FactorizationError",
    "FileFormatError",
    "IterationRecord",
    "MissingDependencyError",
    "Model",
    "ModelError",
    "ModelWarning",
    "Plane",
    "Problem",
    "Scenario",
    "ScenarioError",
    "Solution",
    "Status",
    "TrajoptError",
    "World",
    "__version__",
    "collocation",
    "linalg",
    "list_scenarios",
    "load_model",
    "load_scenario",
    "objectives",
    "solve",
    "solve_batch",
]

# Where each public name lives. Modules are imported when first asked for, so that `import trajopt`
# and the command line start at once.
_HOMES = {
    "Audit": "audit",
    "Contact": "world",
    "FileFormatError": "storage",
    "IterationRecord": "records",
    "Model": "model",
    "Plane": "world",
    "Problem": "problem",
    "Scenario": "scenarios",
    "ScenarioError": "scenarios",
    "Solution": "solution",
    "Status": "status",
    "World": "world",
    "list_scenarios": "scenarios",
    "load_model": "models",
    "load_scenario": "scenarios",
    "solve": "solver",
    "solve_batch": "batch",
}
_MODULES = ("collocation", "linalg", "objectives")


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module(f"trajopt.{name}")
    if name not in __all__:
        raise AttributeError(f"module 'trajopt' has no attribute {name!r}")
    value = getattr(import_module(f"trajopt.{_HOMES.get(name, 'errors')}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
