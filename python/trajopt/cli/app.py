"""The application object, its commands, and what becomes of errors."""

from __future__ import annotations

import os
import traceback
import warnings
from collections.abc import Sequence
from typing import Any

import typer

from trajopt.cli.check import check
from trajopt.cli.info import info
from trajopt.cli.plot import plot
from trajopt.cli.scenarios import scenarios
from trajopt.cli.solve import solve
from trajopt.errors import TrajoptError

__all__ = ["app", "main"]

TRACEBACK = "TRAJOPT_TRACEBACK"

app = typer.Typer(
    name="trajopt",
    help="Find motions that touch the world: contacts are discovered, not scheduled.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (solve, scenarios, check, plot, info):
    app.command()(command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the program name; ``sys.argv[1:]`` by default.

    Returns
    -------
    int
        0 done, 1 stopped before convergence, 2 bad input, 3 internal error.
    """
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            code = app(args=arguments, prog_name="trajopt", standalone_mode=False)
        return code if isinstance(code, int) else 0
    except typer.Abort:
        return _fail(1, "aborted")
    except (TrajoptError, OSError) as error:
        return _fail(2, str(error))
    except Exception as error:  # noqa: BLE001  the last resort of a program
        usage = getattr(error, "format_message", None)  # a mistake in the command line itself
        if usage is not None:
            return _fail(2, f"{usage()} (see trajopt --help)")
        if os.environ.get(TRACEBACK):
            traceback.print_exc()
        return _fail(
            3,
            f"internal error: {type(error).__name__}: {error}"
            f" (set {TRACEBACK}=1 to see the traceback)",
        )


def _fail(code: int, message: str) -> int:
    typer.echo("error: " + " ".join(message.split()), err=True)
    return code


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Show a warning as one line, without the place in the program that issued it."""
    typer.echo(f"warning: {message}", err=True)
