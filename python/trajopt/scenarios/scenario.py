"""Read, change and build scenarios."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from trajopt.scenarios.build import build
from trajopt.scenarios.keys import ScenarioError, check_choice, check_keys
from trajopt.scenarios.overrides import apply_overrides
from trajopt.scenarios.schema import check_schema

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from trajopt.problem import Problem

__all__ = ["Scenario", "ScenarioError", "list_scenarios", "load_scenario"]

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Scenario:
    """A parsed and checked scenario.

    Parameters
    ----------
    name : str
        Name of the built-in scenario or of the file.
    settings : dict
        All sections of the file, as plain TOML values.
    folder : Path
        Where relative file names in the scenario are looked up.
    source : str
        What messages call it: the name of its file.

    Examples
    --------
    >>> hop = load_scenario("hop")
    >>> hop.override(["grid.duration=2", "grid.dt=0.02"]).frames
    100
    """

    name: str
    settings: dict[str, Any]
    folder: Path
    source: str = "the scenario"

    @property
    def task(self) -> str:
        """What the character is asked to do, in one line."""
        return str(self.settings.get("task", ""))

    @property
    def character(self) -> str:
        """Name of the built-in character or the model's file name."""
        model = self.settings["model"]
        return str(model["name"] if "name" in model else Path(model["file"]).name)

    @property
    def dt(self) -> float:
        """Time step [s]."""
        return float(self.settings["grid"]["dt"])

    @property
    def frames(self) -> int:
        """Number of frames N."""
        return round(float(self.settings["grid"]["duration"]) / self.dt)

    def override(self, assignments: str | Iterable[str]) -> Scenario:
        """Return the scenario with single entries changed.

        Parameters
        ----------
        assignments : str or iterable of str
            ``key=value`` with dotted keys and TOML values, such as ``grid.dt=0.02``.

        Returns
        -------
        Scenario

        Raises
        ------
        ScenarioError
            If a key does not exist or a value is not TOML.
        """
        entries = [assignments] if isinstance(assignments, str) else assignments
        settings = apply_overrides(self.settings, entries)
        with _named(self.source):
            check_schema(settings)
        return replace(self, settings=settings)

    def build(self) -> tuple[Problem, dict[str, Any]]:
        """Return the problem and the keyword arguments for `trajopt.solve`.

        Raises
        ------
        ScenarioError
            If a value cannot be used; the message names the file and the section.
        """
        with _named(self.source):
            return build(self.settings, self.folder)


def list_scenarios() -> list[str]:
    """Return the names of the built-in scenarios.

    Examples
    --------
    >>> list_scenarios()
    ['biped-walk', 'chain-jump', 'hop', 'mammal-walk']
    """
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load_scenario(scenario: str | os.PathLike[str] | Mapping[str, Any]) -> Scenario:
    """Return a built-in scenario, one from a TOML file, or one from its parsed settings.

    Parameters
    ----------
    scenario : str, path-like or mapping
        Name of a built-in scenario, path of a ``.toml`` file, or parsed settings.

    Returns
    -------
    Scenario

    Raises
    ------
    ScenarioError
        If there is no such scenario, the file is no TOML, or a key is unknown.
    """
    if isinstance(scenario, Mapping):
        settings = check_keys(scenario, scenario, "the scenario")
        check_schema(settings)
        return Scenario("custom", settings, Path.cwd())
    path = _find(Path(scenario))
    try:
        settings = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot be read ({error.strerror})") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ScenarioError(f"{path}: not a TOML file ({error})") from error
    with _named(path.name):
        check_schema(settings)
    return Scenario(path.stem, settings, path.parent, path.name)


@contextmanager
def _named(source: str) -> Iterator[None]:
    """Let errors begin with the name of the file they are about."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error


def _find(path: Path) -> Path:
    """Return the file that `path`, a file or the name of a built-in, stands for."""
    if path.suffix == ".toml" or len(path.parts) > 1:
        if path.is_file():
            return path
        raise ScenarioError(f"{path}: no such scenario file")
    return FOLDER / f"{check_choice(str(path), list_scenarios(), 'scenario')}.toml"
