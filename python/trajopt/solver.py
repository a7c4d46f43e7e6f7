"""`solve`: from a problem to a motion, in stages of growing contact stiffness."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from trajopt import _core
from trajopt.errors import ArgumentTypeError
from trajopt.interrupt import InterruptFlag
from trajopt.methods import run_core
from trajopt.records import IterationRecord
from trajopt.run import drive, passes
from trajopt.settings import make_settings, make_task
from trajopt.transcription import Stage

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.solution import Solution

__all__ = ["Stage", "solve"]


def solve(
    problem: Problem,
    method: str = "default",
    device: str = "auto",
    callback: Callable[[IterationRecord], object] | None = None,
    max_iterations: int | None = None,
    warm_start: Solution | None = None,
    seed: int = 0,
    threads: int | None = None,
    tolerance: float = 2e-3,
    constraint_tolerance: float = 1e-9,
    noise: float = 1e-3,
    stages: Sequence[Stage] | None = None,
    ordering: str = "auto",
    refine: float | None = None,
    max_refinements: int = 3,
    guess: str = "auto",
) -> Solution:
    """Find a motion.

    Parameters
    ----------
    problem : Problem
    method : {"default", "paper"}
        ``default``: Levenberg-Marquardt SQP in a funnel, in stages of growing stiffness.
        ``paper``: Pan's Algorithm 1 on his version of the problem (Hermite spline, implicit
        integrator, undamped contact with w_t = w_n), in his three passes of stiffness.
    device : {"auto", "cpu", "cuda"}
        Where to run. ``"cuda"`` is for the default method; ``"auto"`` is the CPU. For one
        `ordering` that both know they are written to give the same bits (so far tested by emulation
        only).
    callback : callable, optional
        Called with an `IterationRecord` after each iteration; returning True stops the solve.
    max_iterations : int, optional
        Limit over all stages; 1000 by default.
    warm_start : Solution, optional
        Motion to start from; a checkpoint continues with the stage it was written in.
    seed : int
        Seed of the noise on the start.
    threads : int, optional
        Of the processor, by default all it has; an error with ``device="cuda"``. The result has the
        same bits for every number.
    tolerance : float
        Solved when the objective falls by less than this share in ten iterations ...
    constraint_tolerance : float
        ... and ‖C‖∞ is below this many body weights.
    noise : float
        Amplitude of the noise on the guess [lengths, rad].
    stages : sequence of Stage, optional
        Passes of the solve. A warm start goes on in the pass where it was cut off; a motion that
        was solved runs only the last.
    ordering : {"auto", "frontal", "sequential", "cyclic", "chunked"}
        Elimination order of the KKT system: frame by frame, or one of blocks of two nodes.
        ``"auto"`` is the fastest one that there is for the problem and the device.
    refine : float, optional
        Refine the time grid where the residual between frames exceeds this share of the body
        weight, and solve again.
    max_refinements : int
        Limit of such passes.
    guess : {"auto", "still", "gliding"}
        Where to start without a `warm_start`: at rest, or gliding in the start pose at the velocity
        that `CenterOfMassVelocity` asks for. ``"auto"`` is at rest, but for a way of more than 15
        characteristic lengths by the default method. Tasks are scaled by their cost at rest in any
        case.

    Returns
    -------
    Solution
        Always the best motion found; `status` and `message` say why the solver stopped.

    Raises
    ------
    ArgumentError, DeviceError
        Bad arguments, before any work starts.
    """
    settings = make_settings(
        "solve",
        method=method,
        device=device,
        threads=threads,
        max_iterations=max_iterations,
        tolerance=tolerance,
        constraint_tolerance=constraint_tolerance,
        noise=noise,
        guess=guess,
        stages=stages,
        ordering=ordering,
        refine=refine,
        max_refinements=max_refinements,
    )
    if callback is not None and not callable(callback):
        raise ArgumentTypeError(f"solve: callback must be callable, not {callback!r}")
    task = make_task("solve", settings, problem, warm_start, seed)
    with InterruptFlag() as interrupt:
        cores = threads or _core.hardware_threads()
        run = passes(task, settings, callback, lambda: interrupt.raised, cores)
        stop = _core.StopFlag() if settings.device == "cuda" else None
        return drive(run, lambda request: run_core(request, settings, stop, interrupt))
