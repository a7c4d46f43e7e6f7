"""``trajopt scenarios``."""

from __future__ import annotations

import sys

import typer
from rich import box
from rich.console import Console
from rich.table import Table

__all__ = ["scenarios"]


def scenarios() -> None:
    """List the built-in scenarios: name, character, frames, task.

    A table on a terminal; elsewhere one line each without a header, separated by tabs.
    """
    from trajopt.scenarios import list_scenarios, load_scenario

    rows = [
        (scenario.name, scenario.character, str(scenario.frames), " ".join(scenario.task.split()))
        for scenario in map(load_scenario, list_scenarios())
    ]
    if not sys.stdout.isatty():
        for row in rows:
            typer.echo("\t".join(row))
        return
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("name", no_wrap=True)
    table.add_column("character", no_wrap=True)
    table.add_column("frames", no_wrap=True, justify="right")
    table.add_column("task", overflow="fold")
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table)
