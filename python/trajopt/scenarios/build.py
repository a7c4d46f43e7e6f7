"""Turn the settings of a scenario into a problem."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from trajopt.scenarios.keys import call_with
from trajopt.scenarios.schema import objective_types, obstacle_types

if TYPE_CHECKING:
    from trajopt.model import Model
    from trajopt.problem import Problem
    from trajopt.world import World

__all__ = ["build"]


def build(settings: dict[str, Any], folder: Path) -> tuple[Problem, dict[str, Any]]:
    """Return the problem that checked `settings` describe, and the options of the solver.

    Parameters
    ----------
    settings : dict
        Settings that passed `check_schema`.
    folder : Path
        Where relative file names are looked up.
    """
    from trajopt.problem import Problem
    from trajopt.world import Contact

    model = _model(settings["model"], folder)
    problem: Problem = call_with(
        Problem,
        {
            **settings["grid"],
            "world": _world(settings.get("world", {})),
            "contact": call_with(Contact, settings.get("contact", {}), "[contact]"),
            "initial": settings.get("initial"),
        },
        "the scenario",
        model,
    )
    for table in settings["objective"]:
        values = {key: value for key, value in table.items() if key != "type"}
        where = f"[[objective]] {table['type']}"
        term = call_with(objective_types()[table["type"]], values, where)
        call_with(problem.add, {}, where, term)
    return problem, _options(settings.get("solver", {}))


def _options(table: dict[str, Any]) -> dict[str, Any]:
    from trajopt.solver import Stage

    options = dict(table)
    if "stages" in table:
        options["stages"] = [call_with(Stage, s, "[[solver.stages]]") for s in table["stages"]]
    return options


def _model(table: dict[str, Any], folder: Path) -> Model:
    from trajopt.models import load_model

    options = {key: value for key, value in table.items() if key not in ("name", "file")}
    source = table["name"] if "name" in table else folder / str(table["file"])
    model: Model = call_with(load_model, options, "[model]", source)
    return model


def _world(table: dict[str, Any]) -> World:
    from trajopt.world import World

    options = dict(table)
    if "obstacles" in table:
        options["obstacles"] = [_obstacle(entry) for entry in table["obstacles"]]
    world: World = call_with(World, options, "[world]")
    return world


def _obstacle(entry: dict[str, Any]) -> Any:
    values = {key: value for key, value in entry.items() if key != "type"}
    return call_with(
        obstacle_types()[entry["type"]], values, f"[[world.obstacles]] {entry['type']}"
    )
