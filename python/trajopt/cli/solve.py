"""``trajopt solve``."""

from __future__ import annotations

import json as json_module
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from trajopt.errors import ArgumentError
from trajopt.interrupt import InterruptFlag
from trajopt.methods import METHODS
from trajopt.records import continued
from trajopt.scenarios import Scenario, ScenarioError, load_scenario
from trajopt.scenarios.schema import check_schema

if TYPE_CHECKING:
    from trajopt.solution import Solution

__all__ = ["solve"]

# A residual between frames above this share of the weight is worth a word.
ROUGH = 0.1


def solve(
    scenario: Annotated[
        str | None,
        typer.Argument(help="Name of a built-in scenario, or a TOML file.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Trajectory to write; out/SCENARIO.npz by default.")
    ] = None,
    device: Annotated[str, typer.Option(help="cpu, cuda or auto.")] = "auto",
    threads: Annotated[int | None, typer.Option(help="CPU threads; all by default.")] = None,
    method: Annotated[
        str | None,
        typer.Option(help=f"{' or '.join(METHODS)}; else the scenario's."),
    ] = None,
    max_iterations: Annotated[
        int | None, typer.Option(help="Stop after this many iterations.")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a scenario entry: grid.dt=0.02"),
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Continue from this checkpoint or trajectory.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object, no table.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Print no iterations.")] = False,
) -> None:
    """Find a motion and write it to a file.

    While it works, the best motion so far is kept beside the output as a checkpoint. Ctrl-C stops
    the solver and writes the best motion.
    """
    import trajopt
    from trajopt.progress import CheckpointWriter, chain, printer

    if out is not None and out.suffix != ".npz":
        raise ArgumentError(f"--out {out}: a trajectory is a .npz file: {out.with_suffix('.npz')}")
    start = None if resume is None else trajopt.Solution.load(resume)
    chosen = _scenario(scenario, start, resume).override(assignments or [])
    target = Path("out") / f"{chosen.name}.npz" if out is None else out
    problem, options = chosen.build()
    given = {"method": method, "max_iterations": max_iterations, "threads": threads}
    options |= {key: value for key, value in given.items() if value is not None}

    origin = {
        "scenario": {
            "name": chosen.name,
            "settings": chosen.settings,
            "folder": str(chosen.folder),
        }
    }
    checkpoint = target.with_suffix(".checkpoint.npz")
    # Until the motion is in its file, no Ctrl-C interrupts anything: it ends the solve.
    note = f"stopping after this iteration, to write {target}; another Ctrl-C changes nothing"
    with InterruptFlag(insist=False, note=note):
        with nullcontext() if json or quiet else printer() as show:
            solution = trajopt.solve(
                problem,
                device=device,
                warm_start=start,
                callback=chain(show, CheckpointWriter(checkpoint, settings=origin)),
                **options,
            )
        if start is not None:
            solution.history = continued(start.history, solution.history)
        solution.settings |= origin
        solution.save(target)
        checkpoint.unlink(missing_ok=True)
        _report(solution, target, as_json=json)
    raise typer.Exit(0 if solution.converged else 1)


def _scenario(name: str | None, start: Solution | None, resume: Path | None) -> Scenario:
    """Return the scenario called `name`, or the one that `start` was solved for."""
    if name is not None:
        return load_scenario(name)
    if start is None:
        raise ScenarioError("name a scenario: `trajopt scenarios` lists the built-in ones")
    origin = start.settings.get("scenario")
    if origin is None:
        raise ScenarioError(f"{resume}: does not say which scenario it is of: name it")
    check_schema(origin["settings"])
    return Scenario(origin["name"], origin["settings"], Path(origin["folder"]), origin["name"])


def _report(solution: Solution, target: Path, *, as_json: bool) -> None:
    figures: dict[str, Any] = {**solution.summary(), "out": str(target)}
    if as_json:
        typer.echo(json_module.dumps(figures))
        return
    typer.echo(f"{solution.status}: {solution.message}")
    typer.echo(
        f"  {figures['iterations']} iterations, {figures['seconds']:.1f} s on"
        f" {solution.device} ({solution.ordering} elimination), objective {solution.objective:.6g}"
    )
    terms = sorted(solution.objective_terms.items(), key=lambda item: -item[1])
    typer.echo("  of which " + ", ".join(f"{name} {value:.3g}" for name, value in terms if value))
    for name, label in (
        ("frame_violation_max", "physics on the frames, max"),
        ("frame_violation_rms", "physics on the frames, rms"),
        ("fine_violation_rms", "physics between frames, rms"),
    ):
        if figures[name] is not None:
            typer.echo(f"  {label}: {figures[name]:.2e} of the body weight")
    if (figures["fine_violation_rms"] or 0.0) > ROUGH:
        typer.echo(
            "  rough between frames: try a smaller grid.dt, or softer ground (contact.normal)"
        )
    typer.echo(f"  written: {target}")
