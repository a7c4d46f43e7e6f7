"""Put the pictures of a solution on one page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from trajopt.errors import ArgumentError
from trajopt.plotting.convergence import draw_convergence
from trajopt.plotting.forces import draw_forces, forces_by_body
from trajopt.plotting.strobe import Strobe
from trajopt.plotting.style import INK, figure
from trajopt.storage import write_atomically

if TYPE_CHECKING:
    import os

    from matplotlib.figure import Figure, SubFigure

    from trajopt.solution import Solution

__all__ = ["PARTS", "plot_solution"]

PARTS = ("motion", "forces", "convergence")
WIDTH = 11.0


def plot_solution(
    solution: Solution,
    path: str | os.PathLike[str],
    parts: tuple[str, ...] = PARTS,
) -> Path:
    """Write a picture of a solution.

    Parameters
    ----------
    solution : Solution
        What to draw. Parts for which it holds no data (no history, no contact) are left out.
    path : path-like
        File to write; its suffix (png, svg, pdf) decides the format, png if there is none.
    parts : tuple of str, optional
        Any of ``motion``, ``forces``, ``convergence``, drawn in this order.

    Returns
    -------
    Path
        The file that was written.

    Raises
    ------
    MissingDependencyError
        If matplotlib is not installed.
    ArgumentError
        If a part does not exist or nothing is there to draw.
    """
    unknown = [part for part in parts if part not in PARTS]
    if unknown:
        raise ArgumentError(f"no such part: {unknown[0]!r}; choose from {', '.join(PARTS)}")
    shown = [part for part in PARTS if part in parts and _has_data(solution, part)]
    if not shown:
        raise ArgumentError(f"the solution holds no data for {' and '.join(parts)}")
    drawings = [DRAW[part](solution) for part in shown]
    heights = [height for height, _ in drawings]
    page = figure(WIDTH, sum(heights) + 0.3)
    page.suptitle(_title(solution), fontsize=10, color=INK, x=0.01, ha="left")
    cells = page.subfigures(len(shown), 1, height_ratios=heights, squeeze=False)[:, 0]
    for (_, draw), cell in zip(drawings, cells, strict=True):
        draw(cell)
    return _save(page, Path(path))


def _has_data(solution: Solution, part: str) -> bool:
    if part == "convergence":
        return len(solution.history) > 1
    if part == "forces":
        return solution.contact_forces.size > 0
    return solution.frames > 0


def _title(solution: Solution) -> str:
    name = solution.settings.get("scenario", {}).get("name", solution.model.name)
    return f"{name}   {solution.status}, {solution.iterations} iterations, {solution.seconds:.1f} s"


# Each part says how high it is [inch] and returns what draws it.
Drawing = tuple[float, Callable[["SubFigure"], None]]


def _motion(solution: Solution) -> Drawing:
    strobe = Strobe(solution)

    def draw(cell: SubFigure) -> None:
        strobe.draw(cell, list(cell.subplots(len(strobe.strips), 1, squeeze=False)[:, 0]))

    return strobe.height(WIDTH), draw


def _forces(solution: Solution) -> Drawing:
    bars = 0.55 + 0.19 * max(len(forces_by_body(solution)), 2)

    def draw(cell: SubFigure) -> None:
        force, contact = cell.subplots(2, 1, height_ratios=[2.4, bars], sharex=True)
        draw_forces(force, contact, solution)

    return 2.4 + bars, draw


def _convergence(solution: Solution) -> Drawing:
    def draw(cell: SubFigure) -> None:
        axes = cell.subplots(3, 2, sharex="col", sharey="row")
        draw_convergence([tuple(axes[:, 0]), tuple(axes[:, 1])], solution.history)

    return 5.4, draw


DRAW = {"motion": _motion, "forces": _forces, "convergence": _convergence}


def _save(page: Figure, path: Path) -> Path:
    """Write the page, whole or not at all."""
    kind = path.suffix.lstrip(".").lower() or "png"
    if kind not in page.canvas.get_supported_filetypes():
        raise ArgumentError(
            f"{path}: pictures of type {kind!r} cannot be written; use png, svg or pdf"
        )
    write_atomically(path, lambda file: page.savefig(file, format=kind))
    return path
