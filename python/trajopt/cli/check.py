"""``trajopt check``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, cast

import numpy as np
import typer

if TYPE_CHECKING:
    from trajopt.model import Model

__all__ = ["check"]


def check(
    model: Annotated[
        str, typer.Argument(help="URDF or MJCF file, or a built-in character.", show_default=False)
    ],
    base: Annotated[str, typer.Option(help="auto, floating or fixed.")] = "auto",
) -> None:
    """Load a model, print what was understood, verify its derivatives and dynamics."""
    from trajopt.models import load_model
    from trajopt.verification import verify

    loaded = load_model(model, base=cast("Any", base))  # which checks it
    _describe(loaded)
    found = verify(loaded)
    typer.echo("")
    typer.echo(f"derivatives in flight   {found.flight:.1e} from central differences")
    typer.echo(f"derivatives in contact  {found.contact:.1e} from central differences")
    typer.echo(f"inverse dynamics        {found.inverse:.1e} from MuJoCo, order {found.order:.1f}")
    typer.echo("good" if found.good else "NOT good: the dynamics of this model cannot be trusted")
    raise typer.Exit(0 if found.good else 1)


def _describe(model: Model) -> None:
    masses = model.pseudo_inertia[:, 3, 3]
    points = np.bincount(model.point_body, minlength=model.nbodies)
    typer.echo(
        f"{model.name}: {model.nbodies} bodies, {model.ndof} degrees of freedom"
        f" ({model.nactuated} actuated), {model.mass:.4g} kg, {model.npoints} contact points"
    )
    for note in model.notes:
        typer.echo(f"  {note}")
    typer.echo(f"\n{'body':<24}{'mass [kg]':>12}{'contacts':>10}")
    for name, mass, count in zip(model.body_names, masses, points, strict=True):
        typer.echo(f"{name:<24}{mass:>12.4g}{count:>10d}")
    typer.echo(f"\n{'degree of freedom':<24}{'lower':>12}{'upper':>10}{'home':>10}  motor")
    for name, low, high, home, motor in zip(
        model.dof_names, model.lower, model.upper, model.home, model.actuated, strict=True
    ):
        typer.echo(f"{name:<24}{low:>12.4g}{high:>10.4g}{home:>10.4g}  {'yes' if motor else 'no'}")
