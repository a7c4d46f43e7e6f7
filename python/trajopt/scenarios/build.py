"""Turn the settings of a scenario into a problem."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trajopt.checks import whole
from trajopt.scenarios.keys import ScenarioError, call_with, entry_name
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
    from trajopt.initial import parse_initial
    from trajopt.problem import Problem
    from trajopt.settings import check_factors
    from trajopt.world import Contact

    model = _model(settings["model"], folder)
    world = _world(settings.get("world", {}))
    given = {"model": model, "world": world, "initial": settings.get("initial")}
    problem: Problem = call_with(
        Problem,
        {
            **settings["grid"],
            "world": world,
            "contact": call_with(Contact, settings.get("contact", {}), "[contact]"),
            "initial": call_with(parse_initial, given, "[initial]", owner="initial"),
        },
        "[grid]",
        model,
    )
    for number, table in enumerate(settings["objective"]):
        values = {key: value for key, value in table.items() if key != "type"}
        where, kind = (
            entry_name("objective", number, table["type"]),
            objective_types()[table["type"]],
        )
        term = call_with(kind, values, where)
        call_with(problem.add, {}, where, term, owner=kind.__name__)
    if not any(getattr(term, "weight", 1.0) > 0 for term in problem.terms):
        raise ScenarioError("[[objective]]: no objective term with a weight > 0")
    options = _options(settings.get("solver", {}))
    call_with(
        check_factors, {}, "[solver]", "solve: ", problem, options.get("stages", ()), owner="solve"
    )
    return problem, options


def _options(table: dict[str, Any]) -> dict[str, Any]:
    """Arguments of `solve`, checked here so that an error names the section."""
    from trajopt.settings import make_settings
    from trajopt.solver import Stage, solve

    options = dict(table)
    if "stages" in table:
        options["stages"] = [
            call_with(Stage, stage, f"[[solver.stages]] {number + 1}")
            for number, stage in enumerate(table["stages"])
        ]
    known = signature(make_settings).parameters
    defaults = {p.name: p.default for p in signature(solve).parameters.values() if p.name in known}
    given = {key: value for key, value in options.items() if key in known}
    call_with(make_settings, defaults | given, "[solver]", "solve", owner="solve")
    call_with(whole, {}, "[solver]", "solve", "seed", options.get("seed", 0), 0, owner="solve")
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
        options["obstacles"] = [
            _obstacle(number, entry) for number, entry in enumerate(table["obstacles"])
        ]
    world: World = call_with(World, options, "[world]")
    return world


def _obstacle(number: int, entry: dict[str, Any]) -> Any:
    values = {key: value for key, value in entry.items() if key != "type"}
    where = entry_name("world.obstacles", number, entry["type"])
    return call_with(obstacle_types()[entry["type"]], values, where)
