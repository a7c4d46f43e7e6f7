"""Ctrl-C as a request: the solver finishes its iteration and keeps the best iterate."""

from __future__ import annotations

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

__all__ = ["InterruptFlag"]


class InterruptFlag:
    """While active, the first Ctrl-C sets `raised`; the second one raises `KeyboardInterrupt`.

    Outside of the main thread, where Python takes no signals, it does nothing; nor where the
    program ignores Ctrl-C.

    Examples
    --------
    >>> before = signal.signal(signal.SIGINT, signal.default_int_handler)
    >>> with InterruptFlag() as flag:
    ...     signal.raise_signal(signal.SIGINT)
    ...     print(flag.raised)
    True
    >>> _ = signal.signal(signal.SIGINT, before)
    """

    def __init__(self) -> None:
        self.raised = False
        self._before: Any = None

    def __enter__(self) -> InterruptFlag:
        before = signal.getsignal(signal.SIGINT)
        main = threading.current_thread() is threading.main_thread()
        if main and before is not None and before is not signal.SIG_IGN:
            self._before = signal.signal(signal.SIGINT, self._take)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _take(self, _number: int, _frame: FrameType | None) -> None:
        if self.raised:
            raise KeyboardInterrupt
        self.raised = True
