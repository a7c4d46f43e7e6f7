"""What the options of `solve` may be; a scenario is checked by the same rules when it is read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from trajopt.checks import choice, non_negative, positive, whole
from trajopt.errors import ArgumentTypeError
from trajopt.methods import METHODS
from trajopt.transcription import Stage

__all__ = ["check_options"]

ORDERINGS = ("auto", "sequential", "cyclic", "chunked")


def check_options(options: Mapping[str, Any]) -> None:
    """Check options of `solve` by name.

    Raises
    ------
    ArgumentError, ArgumentTypeError
        Names the option, its value and what was expected.

    Examples
    --------
    >>> check_options({"seed": -1})
    Traceback (most recent call last):
    ...
    trajopt.errors.ArgumentError: solve: seed must be a whole number >= 0, not -1
    """
    for name, value in options.items():
        _CHECKS[name](name, value)


def _whole(minimum: int) -> Callable[[str, Any], object]:
    return lambda name, value: whole("solve", name, value, minimum)


def _one_of(valid: Sequence[str]) -> Callable[[str, Any], object]:
    return lambda name, value: choice("solve", name, value, valid)


def _or_none(check: Callable[[str, Any], object]) -> Callable[[str, Any], object]:
    return lambda name, value: None if value is None else check(name, value)


def _positive(name: str, value: Any) -> float:
    return positive("solve", name, value)


def _stages(name: str, stages: Any) -> None:
    good = isinstance(stages, Sequence) and all(isinstance(stage, Stage) for stage in stages)
    if not good or not stages:
        raise ArgumentTypeError(f"solve: {name} must be a list of Stage, not {stages!r}")


_CHECKS: dict[str, Callable[[str, Any], object]] = {
    "method": _one_of(list(METHODS)),
    "ordering": _one_of(ORDERINGS),
    "threads": _or_none(_whole(1)),
    "max_iterations": _or_none(_whole(1)),
    "seed": _whole(0),
    "max_refinements": _whole(0),
    "tolerance": _positive,
    "constraint_tolerance": _positive,
    "noise": lambda name, value: non_negative("solve", name, value),
    "refine": _or_none(_positive),
    "stages": _or_none(_stages),
}
