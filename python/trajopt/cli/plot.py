"""``trajopt plot``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

__all__ = ["plot"]


def plot(
    file: Annotated[Path, typer.Argument(help="Trajectory file (.npz).", show_default=False)],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Picture to write; FILE.png by default."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Only this part: motion, forces or convergence. May be repeated."),
    ] = None,
) -> None:
    """Draw a trajectory: the motion, its contact forces, and how it converged."""
    from trajopt.plotting import PARTS, plot_solution
    from trajopt.solution import Solution

    target = file.with_suffix(".png") if output is None else output
    typer.echo(plot_solution(Solution.load(file), target, tuple(only or PARTS)))
