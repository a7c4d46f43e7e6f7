"""Ctrl-C as a request: the solver finishes its iteration and keeps the best iterate."""

from __future__ import annotations

import os
import signal
import threading
from types import FrameType, TracebackType
from typing import Any

__all__ = ["InterruptFlag"]

# Presses that are taken as one: a second Ctrl-C is impatience, which must not cost the motion.
PATIENCE = 2


class InterruptFlag:
    """While active, Ctrl-C sets `raised` and interrupts nothing.

    Whoever insists, with a third Ctrl-C, gets a `KeyboardInterrupt`. Of flags within one another
    the outermost decides about that, and all of them are raised.

    Outside of the main thread, where Python takes no signals, it does nothing; nor where the
    program ignores Ctrl-C.

    Parameters
    ----------
    insist : bool
        Whether a third Ctrl-C raises `KeyboardInterrupt`.
    note : str, optional
        Line for the error stream at the first Ctrl-C.

    Examples
    --------
    >>> before = signal.signal(signal.SIGINT, signal.default_int_handler)
    >>> with InterruptFlag() as flag:
    ...     signal.raise_signal(signal.SIGINT)
    ...     print(flag.raised)
    True
    >>> _ = signal.signal(signal.SIGINT, before)
    """

    def __init__(self, insist: bool = True, note: str = "") -> None:
        self.raised = False
        self._insist = insist
        self._note = note
        self._presses = 0
        self._before: Any = None
        self._outer: InterruptFlag | None = None

    def __enter__(self) -> InterruptFlag:
        before = signal.getsignal(signal.SIGINT)
        main = threading.current_thread() is threading.main_thread()
        if main and before is not None and before is not signal.SIG_IGN:
            outer = getattr(before, "__self__", None)
            if isinstance(outer, InterruptFlag):
                self._outer, self.raised = outer, outer.raised
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

    def _take(self, number: int, frame: FrameType | None) -> None:
        self.raised = True
        self._presses += 1
        if self._presses == 1 and self._note:
            os.write(2, f"{self._note}\n".encode())  # print() may be what was interrupted
        if self._outer is not None:
            self._outer._take(number, frame)
        elif self._insist and self._presses > PATIENCE:
            raise KeyboardInterrupt
