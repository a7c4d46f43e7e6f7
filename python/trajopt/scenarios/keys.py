"""Check the keys of a scenario against the signatures of the classes that receive them."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from trajopt.errors import TrajoptError

__all__ = [
    "ScenarioError",
    "call_with",
    "check_choice",
    "check_keys",
    "entry_name",
    "parameters",
    "required",
    "snake_case",
]


class ScenarioError(TrajoptError, ValueError):
    """A scenario asks for something that does not exist or cannot be."""


def snake_case(name: str) -> str:
    """Return a class name as it is written in a scenario.

    Examples
    --------
    >>> snake_case("CenterOfMassVelocity")
    'center_of_mass_velocity'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def parameters(target: Callable[..., Any], *, without: Iterable[str] = ()) -> list[str]:
    """Return the names that `target` can be called with, except those in `without`."""
    excluded = {"self", *without}
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return [
        name
        for name, parameter in inspect.signature(target).parameters.items()
        if parameter.kind in named and name not in excluded
    ]


def check_choice(value: object, valid: Iterable[str], what: str) -> str:
    """Return `value` if it is one of `valid`.

    Raises
    ------
    ScenarioError
        Names the value and the nearest valid one.

    Examples
    --------
    >>> check_choice("hopp", ["hop", "mammal-walk"], "scenario")
    Traceback (most recent call last):
    ...
    trajopt.scenarios.keys.ScenarioError: unknown scenario 'hopp': did you mean 'hop'?
    """
    options = list(valid)
    if isinstance(value, str) and value in options:
        return value
    near = difflib.get_close_matches(str(value), options, n=1, cutoff=0.8)
    hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(options) or 'none'}"
    raise ScenarioError(f"unknown {what} {value!r}: {hint}")


def check_keys(
    table: object, valid: Iterable[str], where: str, needed: Iterable[str] = ()
) -> dict[str, Any]:
    """Return `table` if it is a TOML table with the keys `needed` and no others than `valid`."""
    if not isinstance(table, Mapping):
        raise ScenarioError(f"{where} must be a table, got {table!r}")
    options = list(valid)
    for key in table:
        check_choice(key, options, f"key in {where}")
    for key in needed:
        if key not in table:
            raise ScenarioError(f"{where} needs the key {key!r}")
    return dict(table)


def required(target: Callable[..., Any]) -> list[str]:
    """Return the names that `target` cannot be called without.

    Examples
    --------
    >>> required(check_choice)
    ['value', 'valid', 'what']
    """
    signature = inspect.signature(target).parameters
    empty = inspect.Parameter.empty
    return [name for name in parameters(target) if signature[name].default is empty]


def call_with(
    target: Callable[..., Any],
    values: Mapping[str, Any],
    where: str,
    *args: Any,
    owner: str | None = None,
) -> Any:
    """Call `target` with `values`; what it rejects becomes an error that says `where`.

    Parameters
    ----------
    target : callable
    values : mapping
        Its keyword arguments.
    where : str
        The section of the scenario.
    *args
        Its positional arguments.
    owner : str, optional
        Who `target`'s messages begin with, which `where` takes the place of; its name by default.
    """
    try:
        return target(*args, **values)
    except ScenarioError:
        raise
    except (TrajoptError, TypeError, ValueError) as error:
        name = owner or getattr(target, "__name__", "")
        raise ScenarioError(f"{where}: {str(error).removeprefix(f'{name}: ')}") from error


def entry_name(section: str, number: int, kind: str) -> str:
    """Return how messages name an entry of a list of tables, counted from 1 as in the file.

    Examples
    --------
    >>> entry_name("objective", 1, "pose")
    '[[objective]] 2 (pose)'
    """
    return f"[[{section}]] {number + 1} ({kind})"
