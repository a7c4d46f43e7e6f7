"""The sections of a scenario and the keys each of them may hold.

Most keys are the arguments of the classes that a section is turned into, read from their
signatures: what the Python interface takes, a scenario takes.
"""

from __future__ import annotations

import dataclasses
import inspect
from functools import cache
from typing import Any

from trajopt.scenarios.keys import (
    ScenarioError,
    check_choice,
    check_keys,
    entry_name,
    parameters,
    required,
    snake_case,
)

__all__ = ["check_schema", "objective_types", "obstacle_types", "solver_keys"]

SECTIONS = ("task", "model", "world", "contact", "grid", "initial", "objective", "solver")
REQUIRED = ("model", "grid", "objective")
INITIAL = ("pose", "height", "velocity")
# Classes of trajopt.world that are not obstacles.
NO_OBSTACLES = ("Contact", "ResolvedContact", "World")
# Arguments of trajopt.solve that belong to a run, not to a scenario.
OF_THE_RUN = ("problem", "device", "callback", "warm_start", "threads")


@cache
def objective_types() -> dict[str, type]:
    """Return the objective terms that TOML can describe, by their names in a scenario."""
    from trajopt import objectives

    return {
        snake_case(name): kind
        for name, kind in vars(objectives).items()
        if inspect.isclass(kind)
        and dataclasses.is_dataclass(kind)
        and kind.__module__.startswith("trajopt")
        and not inspect.isabstract(kind)
        and name in objectives.__all__
        and name != "Residual"
    }


@cache
def obstacle_types() -> dict[str, type]:
    """Return the obstacles of a world, by their names in a scenario."""
    from trajopt import world

    return {
        snake_case(name): kind
        for name, kind in vars(world).items()
        if inspect.isclass(kind) and name in world.__all__ and name not in NO_OBSTACLES
    }


def contact_keys() -> list[str]:
    """Return the keys of ``[contact]``."""
    from trajopt.world import Contact

    return parameters(Contact)


def world_keys() -> list[str]:
    """Return the keys of ``[world]``."""
    from trajopt.world import World

    return parameters(World)


def grid_keys() -> list[str]:
    """Return the keys of ``[grid]``."""
    from trajopt.problem import Problem

    return parameters(Problem, without=("model", "world", "contact", "initial"))


def model_keys() -> list[str]:
    """Return the keys of ``[model]``."""
    from trajopt.models import load_model

    first, *others = parameters(load_model)
    return ["name", "file", *(key for key in others if key != first)]


def solver_keys() -> list[str]:
    """Return the keys of ``[solver]``."""
    from trajopt.solver import solve

    return parameters(solve, without=OF_THE_RUN)


def stage_keys() -> list[str]:
    """Return the keys of ``[[solver.stages]]``."""
    from trajopt.solver import Stage

    return parameters(Stage)


def check_schema(settings: dict[str, Any]) -> None:
    """Check that every section and key of `settings` exists.

    Parameters
    ----------
    settings : dict
        Parsed scenario.

    Raises
    ------
    ScenarioError
        Names the offending key and the nearest valid one.
    """
    check_keys(settings, SECTIONS, "the scenario")
    for name in REQUIRED:
        if name not in settings:
            raise ScenarioError(f"section [{name}] is missing")
    model = check_keys(settings["model"], model_keys(), "[model]")
    if ("name" in model) == ("file" in model):
        raise ScenarioError("[model] needs either name (a built-in character) or file")
    check_keys(settings["grid"], grid_keys(), "[grid]")
    for key in ("duration", "dt"):
        value = settings["grid"].get(key)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0:
            raise ScenarioError(f"[grid] {key} must be a number > 0 [s], got {value!r}")
    check_keys(settings.get("initial", {}), INITIAL, "[initial]")
    check_keys(settings.get("contact", {}), contact_keys(), "[contact]")
    solver = check_keys(settings.get("solver", {}), solver_keys(), "[solver]")
    for stage in _tables(solver.get("stages", []), "[[solver.stages]]"):
        check_keys(stage, stage_keys(), "[[solver.stages]]")
    world = check_keys(settings.get("world", {}), world_keys(), "[world]")
    _check_typed(world.get("obstacles", []), obstacle_types(), "world.obstacles")
    _check_typed(settings["objective"], objective_types(), "objective")


def _check_typed(tables: object, types: dict[str, type], section: str) -> None:
    """Check a list of tables, each of which names the class it describes as ``type``."""
    for number, table in enumerate(_tables(tables, f"[[{section}]]")):
        where = f"[[{section}]] {number + 1}"
        if "type" not in table:
            raise ScenarioError(f"{where} needs a type: one of {', '.join(types)}")
        kind = types[check_choice(table["type"], types, f"type in {where}")]
        name = entry_name(section, number, table["type"])
        check_keys(table, ["type", *parameters(kind)], name, required(kind))


def _tables(value: object, where: str) -> list[dict[str, Any]]:
    """Return `value` if it is a list of tables."""
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise ScenarioError(f"{where} must be a list of tables")
    return value
