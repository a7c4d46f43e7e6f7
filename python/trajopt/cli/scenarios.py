"""``trajopt scenarios``."""

from __future__ import annotations

import typer
from rich.console import Console
from rich.table import Table

__all__ = ["scenarios"]


def scenarios() -> None:
    """List the built-in scenarios: name, character, task, frames."""
    from trajopt.scenarios import list_scenarios, load_scenario

    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("name", "character", "frames", "task"):
        table.add_column(
            title, no_wrap=title != "task", justify="right" if title == "frames" else "left"
        )
    for name in list_scenarios():
        scenario = load_scenario(name)
        table.add_row(name, scenario.character, str(scenario.frames), scenario.task)
    console = Console(highlight=False)
    if console.is_terminal:
        console.print(table)
    else:
        for name in list_scenarios():
            scenario = load_scenario(name)
            typer.echo(f"{name}\t{scenario.character}\t{scenario.frames}\t{scenario.task}")
