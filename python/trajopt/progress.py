"""Observers of the solver: what is shown while it works, and checkpoints."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, TextIO

from trajopt.checks import whole
from trajopt.records import IterationRecord, Observer

if TYPE_CHECKING:
    import os

    from rich.live import Live
    from rich.progress import Progress

    from trajopt.solution import Solution

__all__ = ["BatchProgress", "CheckpointWriter", "LinePrinter", "LivePrinter", "chain", "printer"]

COLUMNS: tuple[tuple[str, int, Callable[[IterationRecord], str]], ...] = (
    ("it", 5, lambda r: str(r.iteration)),
    ("stage", 5, lambda r: str(r.stage)),
    ("objective", 12, lambda r: _format(r.objective, ".6g")),
    ("frame/mg", 9, lambda r: _format(r.frame_violation, ".1e")),
    ("step", 9, lambda r: _format(r.step_norm, ".2e")),
    ("radius", 9, lambda r: _format(r.radius or math.nan, ".2e")),
    ("λ", 8, lambda r: _format(r.damping, ".1e")),
    ("ok", 3, lambda r: "yes" if r.accepted else "no"),
    ("s", 8, lambda r: _format(r.elapsed, ".2f")),
)
HEADER = " ".join(title.rjust(width) for title, width, _ in COLUMNS)


def _format(value: float, spec: str) -> str:
    return "-" if math.isnan(value) else format(value, spec)


def format_record(record: IterationRecord) -> str:
    """Return one line of the iteration table, aligned with `HEADER`.

    Examples
    --------
    >>> print(HEADER)
       it stage    objective  frame/mg      step    radius        λ  ok        s
    >>> print(format_record(IterationRecord(7, objective=0.25, frame_violation=3e-5, elapsed=0.5)))
        7     0         0.25   3.0e-05         -         -  0.0e+00 yes     0.50
    """
    return " ".join(cell(record).rjust(width) for _, width, cell in COLUMNS)


class LinePrinter:
    """Writes every k-th record as a plain line; for logs and pipes.

    Parameters
    ----------
    stream : file, optional
        Where to write; the standard error stream by default.
    every : int, optional
        Write iterations 0, k, 2k, ... and the first of every stage; `close` adds the last.

    Examples
    --------
    >>> with LinePrinter(sys.stdout, every=10) as show:
    ...     for k in range(12):
    ...         show(IterationRecord(k, objective=1.0 / (k + 1)))
       it stage    objective  frame/mg      step    radius        λ  ok        s
        0     0            1         -         -         -  0.0e+00 yes     0.00
       10     0    0.0909091         -         -         -  0.0e+00 yes     0.00
       11     0    0.0833333         -         -         -  0.0e+00 yes     0.00
    """

    def __init__(self, stream: TextIO | None = None, every: int = 10) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._every = whole(type(self).__name__, "every", every, 1)
        self._last: IterationRecord | None = None
        self._pending = False

    def __call__(self, record: IterationRecord) -> None:
        """Show `record` if its turn has come."""
        if self._last is None:
            self._emit(HEADER)
        new_stage = self._last is None or record.stage != self._last.stage
        self._pending = not (new_stage or record.iteration % self._every == 0)
        self._last = record
        if not self._pending:
            self._emit(format_record(record))

    def close(self) -> None:
        """Show the last record if it was skipped."""
        if self._pending and self._last is not None:
            self._emit(format_record(self._last))
        self._pending = False

    def _emit(self, line: str) -> None:
        print(line, file=self._stream, flush=True)

    def __enter__(self) -> LinePrinter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class LivePrinter(LinePrinter):
    """Table on a terminal: every k-th record stays, the newest is redrawn below it in place.

    Parameters
    ----------
    every : int, optional
        As for `LinePrinter`.
    """

    def __init__(self, every: int = 10) -> None:
        super().__init__(sys.stderr, every)
        self._live: Live | None = None

    def __call__(self, record: IterationRecord) -> None:
        """Show `record`."""
        from rich.text import Text

        super().__call__(record)
        if self._live is not None:
            self._live.update(Text(format_record(record) if self._pending else "", style="dim"))

    def _emit(self, line: str) -> None:
        from rich.text import Text

        if self._live is not None:
            self._live.console.print(Text(line))

    def __enter__(self) -> LivePrinter:
        from rich.console import Console
        from rich.live import Live
        from rich.text import Text

        console = Console(stderr=True, highlight=False)
        self._live = Live(Text(""), console=console, transient=True, refresh_per_second=8)
        self._live.start()
        return self

    def close(self) -> None:
        """Show the last record if it was skipped and leave the terminal as it was."""
        super().close()
        if self._live is not None:
            self._live.stop()
            self._live = None


class CheckpointWriter:
    """Saves the best iterate so far every few seconds, for ``trajopt solve --resume``.

    Parameters
    ----------
    path : path-like
        Trajectory file to write; always a whole one, replaced in one step.
    every : float, optional
        Least time between two writes [s].
    settings : mapping, optional
        Added to the settings in the file; says what to resume.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        every: float = 10.0,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        self.path = path
        self._settings = dict(settings or {})
        self._every = every
        self._due = time.monotonic() + every

    def __call__(self, record: IterationRecord) -> None:
        """Write a checkpoint if one is due."""
        if record.snapshot is not None and time.monotonic() >= self._due:
            solution = record.snapshot()
            solution.settings = {**solution.settings, **self._settings}
            solution.save(self.path)
            self._due = time.monotonic() + self._every


class BatchProgress:
    """How many problems of a batch have ended: a bar on a terminal, a line a tenth elsewhere.

    Parameters
    ----------
    total : int
        Problems of the batch.
    active : bool
        Whether to show anything.
    stream : file, optional
        Where to write; the standard error stream by default.

    Examples
    --------
    >>> with BatchProgress(20, True, sys.stdout) as show:
    ...     for _ in range(3):
    ...         show.ended(None)
    2 of 20 ended, 0 solved
    """

    def __init__(self, total: int, active: bool = True, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._total, self._active = total, active
        self._ended = self._solved = 0
        self._bar: Progress | None = None

    def ended(self, solution: Solution | None) -> None:
        """Count a problem; None: it raised an exception."""
        before = self._ended
        self._ended += 1
        self._solved += solution is not None and solution.converged
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=self._ended, solved=self._solved)
        elif self._active and 10 * self._ended // self._total > 10 * before // self._total:
            text = f"{self._ended} of {self._total} ended, {self._solved} solved"
            print(text, file=self._stream, flush=True)

    def __enter__(self) -> BatchProgress:
        if self._active and self._total > 0 and self._stream.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self._bar = Progress(
                TextColumn("{task.completed:.0f} of {task.total:.0f} ended"),
                BarColumn(),
                TextColumn("{task.fields[solved]} solved"),
                TimeElapsedColumn(),
                console=Console(file=self._stream, highlight=False),
            )
            self._bar.add_task("", total=self._total, solved=0)
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


def printer(stream: TextIO | None = None, every: int = 10) -> LinePrinter:
    """Return the printer that suits `stream`: live on a terminal, plain lines elsewhere."""
    stream = sys.stderr if stream is None else stream
    if stream is sys.stderr and stream.isatty():
        return LivePrinter(every)
    return LinePrinter(stream, every)


def chain(*observers: Observer | None) -> Observer:
    """Return an observer that calls all of `observers`; None stands for nobody.

    The solver is asked to stop as soon as one of them asks for it.

    Examples
    --------
    >>> chain(None, lambda record: record.iteration > 5)(IterationRecord(6))
    True
    """
    present = [observer for observer in observers if observer is not None]

    def observe(record: IterationRecord) -> bool:
        answers = [observer(record) for observer in present]  # all of them, before any decides
        return any(answer is True for answer in answers)

    return observe
