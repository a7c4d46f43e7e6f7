"""Scenarios: a character, a world, a wish and a time grid in one TOML file."""

from trajopt.scenarios.scenario import (
    Scenario,
    ScenarioError,
    list_scenarios,
    load_scenario,
)

__all__ = ["Scenario", "ScenarioError", "list_scenarios", "load_scenario"]
