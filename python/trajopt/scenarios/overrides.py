"""``--set key=value``: change single entries of a scenario."""

from __future__ import annotations

import copy
import re
import sys
from collections.abc import Iterable
from typing import Any

from trajopt.scenarios.keys import ScenarioError, check_choice

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["apply_overrides", "parse_value"]

BARE_WORD = re.compile(r"[A-Za-z_][\w./-]*")


def parse_value(text: str) -> Any:
    """Return the TOML value that `text` stands for; a bare word is a string.

    Examples
    --------
    >>> parse_value("0.025"), parse_value("[0.3, 0, 0]"), parse_value("true"), parse_value("spline")
    (0.025, [0.3, 0, 0], True, 'spline')
    """
    try:
        parsed = tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError as error:
        if BARE_WORD.fullmatch(text):
            return text
        raise ScenarioError(f"{text!r} is not a TOML value ({error})") from error
    if list(parsed) != ["value"]:
        raise ScenarioError(f"{text!r} is not a single TOML value")
    return parsed["value"]


def apply_overrides(settings: dict[str, Any], assignments: Iterable[str]) -> dict[str, Any]:
    """Return a copy of `settings` with every ``key=value`` of `assignments` carried out.

    Parameters
    ----------
    settings : dict
        Parsed scenario.
    assignments : iterable of str
        ``grid.dt=0.02``; an objective is addressed by its number or its type:
        ``objective.0.weight=2``, ``objective.control_effort.weight=1e-3``.

    Raises
    ------
    ScenarioError
        If an assignment has no ``=``, its value is no TOML, or its path leads nowhere.

    Examples
    --------
    >>> apply_overrides({"grid": {"dt": 0.05}}, ["grid.dt=0.025", "solver.seed=3"])
    {'grid': {'dt': 0.025}, 'solver': {'seed': 3}}
    """
    result = copy.deepcopy(settings)
    for assignment in assignments:
        path, equals, text = assignment.partition("=")
        *parents, key = (part.strip() for part in path.split("."))
        if not equals or not key or "" in parents:
            raise ScenarioError(f"--set needs KEY=VALUE with a dotted key, got {assignment!r}")
        holder: Any = result
        for parent in parents:
            holder = _descend(holder, parent, assignment)
        value = parse_value(text.strip())
        if isinstance(holder, list):
            holder[_index(holder, key)] = value
        else:
            holder[key] = value
    return result


def _descend(holder: Any, key: str, assignment: str) -> Any:
    child = holder[_index(holder, key)] if isinstance(holder, list) else holder.setdefault(key, {})
    if not isinstance(child, (dict, list)):
        raise ScenarioError(f"--set {assignment}: {key!r} holds a value, not a table")
    return child


def _index(entries: list[Any], key: str) -> int:
    """Return the position of the entry with number or type `key`."""
    if key.isdecimal() and int(key) < len(entries):
        return int(key)
    types = [str(entry.get("type")) if isinstance(entry, dict) else "" for entry in entries]
    names = [name for name in types if name] + [str(number) for number in range(len(entries))]
    return types.index(check_choice(key, names, "entry"))
