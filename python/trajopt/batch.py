"""`solve_batch`: many problems at once, each with the result it would have by itself."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol

from trajopt import _core
from trajopt.errors import ArgumentError, ArgumentTypeError, BatchError
from trajopt.interrupt import InterruptFlag
from trajopt.methods import run_core, run_together
from trajopt.progress import BatchProgress
from trajopt.records import IterationRecord
from trajopt.run import Pass, Passes, drive, passes
from trajopt.settings import Settings, Task, make_settings, make_task
from trajopt.solver import solve
from trajopt.transcription import Stage

if TYPE_CHECKING:
    from trajopt.problem import Problem
    from trajopt.solution import Solution

    Outcome = Solution | Exception

__all__ = ["Submits", "solve_batch"]

BatchCallback = Callable[[int, IterationRecord], object]

POLL = 0.1  # seconds between two looks for Ctrl-C


class Submits(Protocol):
    """What runs calls elsewhere, as `concurrent.futures.Executor` does.

    The futures need `result()`. Where they have `add_done_callback` they are taken as they end,
    else in order; where they have `cancel`, Ctrl-C cancels those that have not begun.
    """

    def submit(self, function: Callable[..., Any], /, *arguments: Any) -> Any:
        """Begin ``function(*arguments)`` and return a future."""
        ...


def solve_batch(
    problems: Sequence[Problem],
    *,
    device: str = "auto",
    executor: Submits | None = None,
    threads: int | None = None,
    warm_start: Sequence[Solution | None] | None = None,
    seed: int | Sequence[int] = 0,
    callback: BatchCallback | None = None,
    progress: bool = False,
    method: str = "default",
    max_iterations: int | None = None,
    tolerance: float = 2e-3,
    constraint_tolerance: float = 1e-9,
    noise: float = 1e-3,
    stages: Sequence[Stage] | None = None,
    ordering: str = "auto",
    refine: float | None = None,
    max_refinements: int = 3,
    guess: str = "auto",
) -> list[Solution]:
    """Find a motion for each of many problems.

    On the processor `threads` problems are in work at a time, one thread each. On a GPU all
    problems of one shape (frames, degrees of freedom, number of terms) are solved by the same
    launches; they may differ in everything else. Every motion has the bits that `solve` gives its
    problem alone with the same `ordering`.

    Parameters
    ----------
    problems : sequence of Problem
        May be empty, and may hold one problem several times.
    device : {"auto", "cpu", "cuda"}
        As for `solve`.
    executor : optional
        Where to solve instead of in this process: anything with ``submit(function, *arguments)``
        that returns futures, such as a `concurrent.futures.ProcessPoolExecutor` or what a Dask
        client's ``get_executor()`` returns. Each call solves one problem on one thread.
    threads : int, optional
        Problems in work at a time; all processors by default. Not with an `executor`, whose workers
        are its own affair, nor with ``device="cuda"``.
    warm_start : sequence of Solution or None, optional
        Motion to start from, one for every problem.
    seed : int or sequence of int
        Seed of the noise on the start, for all or for every problem.
    callback : callable, optional
        Called with a problem's index and an `IterationRecord` after each iteration of that problem,
        from whatever thread solves it; returning True stops this problem. Not with an `executor`.
    progress : bool
        Show on the standard error stream how many problems have ended.
    method, max_iterations, tolerance, constraint_tolerance, noise, stages, ordering, refine, \
    max_refinements, guess
        As for `solve`, for every problem.

    Returns
    -------
    list of Solution
        In the order of the problems. Ctrl-C ends all of them with the best motions found so far,
        for problems that had not begun their start; a third one raises `KeyboardInterrupt`.

    Raises
    ------
    ArgumentError, ArgumentTypeError, DeviceError
        Bad arguments, before any work starts; what is wrong with one problem names its index.
    BatchError
        When all have ended and some raised an exception: it holds the exceptions by index, and the
        solutions of the others.

    Examples
    --------
    >>> import trajopt
    >>> from trajopt.objectives import CenterOfMassVelocity, regularizers
    >>> chain = trajopt.load_model("chain")
    >>> def crawl(speed):
    ...     problem = trajopt.Problem(chain, duration=0.5, dt=0.05)
    ...     return problem.add(CenterOfMassVelocity((speed, 0, 0)), *regularizers())
    >>> found = trajopt.solve_batch([crawl(0.1), crawl(0.2)], max_iterations=3)
    >>> [str(solution.status) for solution in found]
    ['max_iterations', 'max_iterations']
    """
    settings = make_settings(
        "solve_batch",
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
    workers = _check_execution(executor, threads, callback)
    tasks = _make_tasks(problems, warm_start, seed, settings)
    with InterruptFlag() as interrupt, BatchProgress(len(tasks), progress) as show:
        batch = _Batch(tasks, settings, callback, interrupt, show)
        if executor is not None:
            outcomes = batch.elsewhere(executor, list(problems), warm_start)
        elif settings.device == "cuda":
            outcomes = batch.on_device()
        else:
            outcomes = batch.on_threads(workers)
    errors = {i: end for i, end in outcomes.items() if isinstance(end, Exception)}
    found = {i: end for i, end in outcomes.items() if not isinstance(end, Exception)}
    if errors:
        raise BatchError([found.get(i) for i in range(len(tasks))], errors)
    return [found[i] for i in range(len(tasks))]


def _check_execution(
    executor: Submits | None, threads: int | None, callback: BatchCallback | None
) -> int:
    if callback is not None and not callable(callback):
        raise ArgumentTypeError(f"solve_batch: callback must be callable, not {callback!r}")
    if executor is not None:
        if not callable(getattr(executor, "submit", None)):
            raise ArgumentTypeError(
                "solve_batch: executor must have submit(function, *arguments), "
                f"not be a {type(executor).__name__}"
            )
        if threads is not None or callback is not None:
            name = "threads" if threads is not None else "callback"
            raise ArgumentError(
                f"solve_batch: {name} cannot be given with an executor, which solves elsewhere"
            )
    return threads or int(_core.hardware_threads())


def _make_tasks(
    problems: Sequence[Problem],
    warm_start: Sequence[Solution | None] | None,
    seed: int | Sequence[int],
    settings: Settings,
) -> list[Task]:
    for name, value in (("problems", problems), ("warm_start", warm_start)):
        if value is None and name == "warm_start":
            continue
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ArgumentTypeError(
                f"solve_batch: {name} must be a sequence, not {type(value).__name__}"
            )
    count = len(problems)
    seeds = [seed] * count if not isinstance(seed, Sequence) else seed
    starts = [None] * count if warm_start is None else warm_start
    for name, values in (("warm_start", starts), ("seed", seeds)):
        if len(values) != count:
            raise ArgumentError(
                f"solve_batch: {name} holds {len(values)} values for {count} problems"
            )
    return [
        make_task("solve_batch", settings, problem, starts[i], seeds[i], f"[{i}]")
        for i, problem in enumerate(problems)
    ]


class _Batch:
    """A batch in work: by index how every problem ended."""

    def __init__(
        self,
        tasks: list[Task],
        settings: Settings,
        callback: BatchCallback | None,
        interrupt: InterruptFlag,
        show: BatchProgress,
    ) -> None:
        self.tasks = tasks
        self.settings = settings
        self.callback = callback
        self.interrupt = interrupt
        self.show = show
        self.stop = _core.StopFlag()
        self.outcomes: dict[int, Outcome] = {}

    def _end(self, index: int, outcome: Outcome) -> None:
        self.outcomes[index] = outcome
        self.show.ended(None if isinstance(outcome, Exception) else outcome)

    def _passes(self, index: int) -> Passes:
        watch: Callable[[IterationRecord], object] | None = None
        if self.callback is not None:
            callback = self.callback

            def watch(record: IterationRecord) -> object:
                try:
                    return callback(index, record)
                except KeyboardInterrupt:  # as Ctrl-C: of all problems
                    self.stop.set()
                    return True

        return passes(self.tasks[index], self.settings, watch, self.stop.is_set, threads=1)

    def _solve(self, index: int) -> Solution:
        return drive(
            self._passes(index), lambda request: run_core(request, self.settings, self.stop)
        )

    # ---- on the processor --------------------------------------------------------------------

    def on_threads(self, workers: int) -> Mapping[int, Outcome]:
        """Solve in this process, `workers` problems at a time."""
        with ThreadPoolExecutor(max_workers=workers) as pool, self._stopping(pool):
            ended: queue.SimpleQueue[int] = queue.SimpleQueue()
            futures = [pool.submit(self._solve, index) for index in range(len(self.tasks))]
            for index, future in enumerate(futures):
                future.add_done_callback(partial(_put, ended, index))
            for index in self._arrivals(ended, len(futures)):
                self._end(index, _outcome(futures[index]))
        return self.outcomes

    @contextmanager
    def _stopping(self, pool: ThreadPoolExecutor) -> Iterator[None]:
        """Whatever ends the block early, a third Ctrl-C, also ends the work at hand."""
        try:
            yield
        except BaseException:
            self.stop.set()
            pool.shutdown(cancel_futures=True)
            raise

    def _arrivals(
        self, ended: queue.SimpleQueue[int], count: int, cancel: Sequence[Any] = ()
    ) -> Iterator[int]:
        """Indices in the order in which `count` problems end; Ctrl-C cancels the given futures."""
        while count > 0:
            if self.interrupt.raised and not self.stop.is_set():
                self.stop.set()
                for future in cancel:
                    if callable(getattr(future, "cancel", None)):
                        future.cancel()
            try:
                index = ended.get(timeout=POLL)
            except queue.Empty:
                continue
            count -= 1
            yield index

    # ---- elsewhere ---------------------------------------------------------------------------

    def elsewhere(
        self,
        executor: Submits,
        problems: list[Problem],
        warm_start: Sequence[Solution | None] | None,
    ) -> Mapping[int, Outcome]:
        """Solve by an executor's workers, a call a problem."""
        settings = self.settings
        options = {
            "method": settings.method,
            "device": settings.device,
            "max_iterations": settings.max_iterations,
            "tolerance": settings.tolerance,
            "constraint_tolerance": settings.constraint_tolerance,
            "noise": settings.noise,
            "guess": settings.guess,
            "stages": settings.stages,
            "ordering": settings.ordering,
            "refine": settings.refine,
            "max_refinements": settings.max_refinements,
            "threads": 1 if settings.device == "cpu" else None,
        }
        ended: queue.SimpleQueue[int] = queue.SimpleQueue()
        futures: dict[int, Any] = {}
        in_order = []
        for index, (problem, task) in enumerate(zip(problems, self.tasks, strict=True)):
            start = None if warm_start is None else warm_start[index]
            particular = {**options, "warm_start": start, "seed": task.seed}
            try:
                future = executor.submit(_solve_there, problem, particular)
            except Exception as error:  # noqa: BLE001 - whatever it is, it is this problem's
                self._end(index, error)
                continue
            futures[index] = future
            if hasattr(future, "add_done_callback"):
                future.add_done_callback(partial(_put, ended, index))
            else:
                in_order.append(index)
        for index in in_order:
            self._end(index, _outcome(futures[index]))
        for index in self._arrivals(ended, len(futures) - len(in_order), list(futures.values())):
            future = futures[index]
            gone = callable(getattr(future, "cancelled", None)) and future.cancelled()
            self._end(index, self._start(index) if gone else _outcome(future))
        return self.outcomes

    def _start(self, index: int) -> Outcome:
        """The start of a problem that nobody began with."""
        try:
            return self._solve(index)
        except Exception as error:  # noqa: BLE001 - it is this problem's
            return error

    # ---- on a device -------------------------------------------------------------------------

    def on_device(self) -> Mapping[int, Outcome]:
        """Solve all problems pass by pass, those of a shape by the same launches."""
        runs = {index: self._passes(index) for index in range(len(self.tasks))}
        waiting: dict[int, Pass] = {}

        def go_on(index: int, step: Callable[[], Pass]) -> None:
            waiting.pop(index, None)
            try:
                waiting[index] = step()
            except StopIteration as end:
                self._end(index, end.value)
            except Exception as error:  # noqa: BLE001 - it is this problem's
                self._end(index, error)

        for index, run in runs.items():
            go_on(index, run.__next__)
        while waiting:
            if self.interrupt.raised:
                self.stop.set()
            indices = list(waiting)
            answers = run_together(
                [waiting[index] for index in indices], self.settings, self.stop, self.interrupt
            )
            for index, answer in zip(indices, answers, strict=True):
                run = runs[index]
                if isinstance(answer, Exception):
                    go_on(index, partial(run.throw, answer))
                else:
                    go_on(index, partial(run.send, answer))
        return self.outcomes


def _put(ended: queue.SimpleQueue[int], index: int, _future: Any) -> None:
    ended.put(index)


def _outcome(future: Any) -> Outcome:
    try:
        solution: Solution = future.result()
    except Exception as error:  # noqa: BLE001 - it is this problem's
        return error
    return solution


def _solve_there(problem: Problem, options: dict[str, Any]) -> Solution:
    """What an executor's worker does."""
    return solve(problem, **options)
